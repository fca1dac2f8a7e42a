"""Changes that a layer makes to the law of linear elasticity: it stiffens with strain, or has a finite width.

The linear laws come from `Forward.bare_law`, tables and all, as without it. Derivatives in E and in the layer's own
numbers are exact; in numbers that move the linear law otherwise than by a scale (thickness, radius, Poisson's
ratio) they are differences of whole laws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.law_slopes import LawSlopes, first_possible
from underlay.mechanics.body import Layer, Rigid
from underlay.mechanics.contact_law import ContactLaw, OnLaw
from underlay.mechanics.finite_width import NarrowLaw, Sides, sides_at
from underlay.mechanics.stiffening import StiffeningLaw, StiffLayer, at_values
from underlay.scene.parameters import kind_of
from underlay.scene.scene import Scene

__all__ = ["OnLinear"]

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
