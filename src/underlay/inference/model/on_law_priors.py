"""Default priors of a layer's strain stiffening, and what a curve alone cannot determine of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from underlay.errors import ParameterError
from underlay.inference.priors import Given, LogNormal, Normal, Prior
from underlay.mechanics.stiffening import FORM_SPREAD
from underlay.quantities import path_of
from underlay.scene.scene import Scene

__all__ = ["FORM", "LEFT_OPEN", "begun", "require_thickness_prior", "usual_prior"]

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
