"""Changes that a layer makes to the law of linear elasticity: it stiffens with strain, or has a finite width.

The linear laws come from `Forward.bare_law`, tables and all, as without it. Derivatives in E and in the layer's own
numbers are exact; in numbers that move the linear law otherwise than by a scale (thickness, radius, Poisson's
ratio) they are differences of whole laws.

Default priors of a layer's strain stiffening, and what a curve alone cannot determine of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import ParameterError
from underlay.inference.model.law_slopes import LawSlopes, first_possible
from underlay.inference.priors import Given, LogNormal, Normal, Prior
from underlay.mechanics.body import Layer, Rigid
from underlay.mechanics.contact_law import ContactLaw, OnLaw
from underlay.mechanics.finite_width import NarrowLaw, Sides, sides_at
from underlay.mechanics.stiffening.factors import FORM_SPREAD
from underlay.mechanics.stiffening.law import StiffeningLaw, StiffLayer, at_values
from underlay.quantities import kind_of, path_of
from underlay.scene.scene import Scene

_SECTION = "layer.stiffening."
#: Path of the size of the form of the energy.
FORM = _SECTION + "form"
# Median and logarithmic standard deviation of the inverse limit of soft tissue: 95 % from 0.02 to 12, locking
# stretches from 1.18 upward (the study of stiffening layers, section 3).
_LIMIT, _LIMIT_SPREAD = 0.5, 1.6
# The same of the standard deviation of heights over the tip's radius (same study).
_HEIGHTS, _HEIGHTS_SPREAD = 0.02, 1.5
#: What a layer that stiffens leaves open where its scene has zero: what it is called, and its size to 95 %. How
#: often intervals hold E of Ogden's layers: tests/studies/results/stiffening_coverage.csv.
LEFT_OPEN = {
    FORM: ("form of the energy", "Ogden's -16 to 20"),
    _SECTION + "height_spread": ("gradual contact", "heights by 0.001 to 0.4 R"),
}


def usual_prior(path: str, given: Given, scene: Scene) -> Given:
    """Prior or bounds of a parameter: as given, else the default of a strain-stiffening parameter."""
    if given is not None or not path.startswith(_SECTION):
        return given
    name = path.removeprefix(_SECTION)
    if name == "height_spread":
        return LogNormal(_HEIGHTS * scene.parameters["indenter.radius"], _HEIGHTS_SPREAD)
    return Normal(0.0, FORM_SPREAD) if name == "form" else LogNormal(_LIMIT, _LIMIT_SPREAD)


def begun(path: str, start: float, given: Given) -> float:
    """Starting value (SI) of a search: the middle of its prior for a stiffening parameter that is zero.

    Zero has no logarithm to search in. `given` are the prior or bounds.
    """
    if start != 0.0 or not path.startswith(_SECTION) or path.endswith(".form") or given is None:
        return start
    if isinstance(given, Prior):
        return float(given.quantile(np.array(0.5)))
    low, high = given
    return float(np.sqrt(low * high)) if low > 0.0 else 0.5 * (low + high)


def require_thickness_prior(free: Mapping[str, Given] | Iterable[str]) -> None:
    """Refuse stiffening and thickness both free where the thickness has no informative prior.

    Raises
    ------
    ParameterError
        With what to do.
    """
    given_free = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    paths = {path_of(name) for name in given_free}
    if not {_SECTION + "inverse_limit", "layer.thickness"} <= paths:
        return
    if all(
        isinstance(given, Prior) and given.informative
        for name, given in given_free.items()
        if path_of(name) == "layer.thickness"
    ):
        return
    raise ParameterError(
        "layer.thickness and layer.stiffening.inverse_limit cannot be told apart by a curve (the thickness "
        "stays open by 8 to 84 %): give the thickness a Normal prior of 5 % or better, or take one of them as known"
    )


# Relative (of a ratio: absolute) step of a difference of laws, each right to 1e-6.
_STEP = 1e-3


class Linear(Protocol):
    """Interface to laws of linear elasticity: `Forward` has it."""

    def bare_law(self, values: Mapping[str, float], deepest: float) -> ContactLaw:
        """Law of linear elasticity at numbers `values` (SI, by path) for depths up to `deepest` (m)."""


@dataclass(frozen=True)
class OnLinear:
    """Changes that the layer of one scene makes to the law of linear elasticity: strain stiffening, finite width.

    Parameters
    ----------
    layer : Layer
        The layer as declared.
    layered : bool
        Whether it stands on a rigid base.
    gain : callable
        Function from the scene's numbers by path to force reading over true force: one unless a cantilever's
        calibration is off.
    """

    layer: Layer
    layered: bool
    gain: Callable[[Mapping[str, Any]], Any]

    @classmethod
    def of(cls, scene: Scene, gain: Callable[[Mapping[str, Any]], Any]) -> OnLinear:
        """Prepare for a scene whose layer stiffens or has a finite width."""
        return cls(scene.layer, isinstance(scene.substrate, Rigid), gain)

    def laws(self, values: Mapping[str, Any]) -> tuple[StiffLayer | None, Sides | None]:
        """The layer's stiffening and its sides, each None if it has none, at numbers (SI) by path.

        Numbers that vary between parameter sets are (sets, 1).
        """
        stiff = None
        if self.layer.stiffening is not None:
            sliding = self.layered and self.layer.bond == "slip"
            stiff = at_values(values, sliding=sliding, layered=self.layered)
        if not self.layer.has_sides:
            return stiff, None
        return stiff, sides_at(values, self.layer, self.gain(values))

    def law(self, forward: Linear, values: Mapping[str, float], deepest: float) -> ContactLaw:
        """Law of the layer at numbers `values` (SI, by path) for depths up to `deepest` (m)."""
        build: Callable[[float], ContactLaw] = partial(forward.bare_law, values)
        for outer in self.laws(values):
            if outer is not None:
                build = _put_on(outer, build)
        return build(deepest)

    def slope(self, forward: Linear, path: str, slopes: LawSlopes) -> FloatArray:
        """Derivative (n,) of the force in the parameter at `path` (SI), at fixed tip depths."""
        values, law, w = slopes.values, slopes.law, slopes.w
        section, _, name = path.rpartition(".")
        if path == "layer.E":
            return np.asarray(slopes.P / values[path])
        if section == "layer.stiffening" and isinstance(law, StiffeningLaw | NarrowLaw):
            return law.own_slope(name, w)
        size = _STEP if kind_of(path) == "dimensionless" else _STEP * abs(values[path])

        def force(steps: float) -> FloatArray:
            if not steps:
                return slopes.P
            return self.law(forward, {**values, path: values[path] + steps * size}, slopes.deepest).force(w)

        return np.asarray(first_possible(force, slopes.stencils(path)) / size)


def _put_on(outer: OnLaw, inner: Callable[[float], ContactLaw]) -> Callable[[float], ContactLaw]:
    return lambda depth: outer.law(inner, depth)
