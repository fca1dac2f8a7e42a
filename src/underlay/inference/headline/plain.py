"""The interval where the noise was stated: quadratic where the profile agrees with it, else the profile's."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.least_squares.fit_result import Fit, StatedInterval
from underlay.inference.profiling.profile_result import interval_threshold
from underlay.inference.profiling.walk import Walk
from underlay.inference.profiling.walked import walked

__all__ = ["correlated_interval", "ends_of", "is_about", "plain_interval", "quadratic_interval"]

# The rise at a quadratic end may be off by this share of the threshold: an end then moves by half of it.
_UNLIKE = 0.2
# Where a quadratic end lies on the profile, the others are found in few steps; from elsewhere it is walked anyway.
_MOST_MODELS = 12
# In z: a profile is walked a little beyond its threshold, so that an end lies between two steps.
_BEYOND = 0.1


def plain_interval(fit: Fit, name: str, level: float) -> StatedInterval:
    """Interval of a parameter from the likelihood of the stated noise.

    Raises
    ------
    InputError
        If the level is not between 0 and 0.999.
    """
    threshold = interval_threshold(fit, level)
    quadratic = quadratic_interval(fit, name, level)
    if name.startswith("noise.") or fit.statistics.robust != "none":
        # Nothing walks these: the likelihood of noise is another, and a robust loss has none.
        return quadratic
    in_doubt = quadratic.is_open or bool(fit.alternatives) or bool(fit.bounds_hit) or bool(fit.no_error_bars)
    if not in_doubt and all(_agrees(fit, name, end, threshold) for end in (quadratic.low, quadratic.high)):
        return quadratic
    profile, _ = walked(fit, name, math.sqrt(threshold) + _BEYOND)
    found = profile.interval(level)
    return StatedInterval(
        name,
        level,
        fit.values[name],
        found.low if found.low_reason == "data" else -math.inf,
        found.high if found.high_reason == "data" else math.inf,
        "profile",
    )


def quadratic_interval(fit: Fit, name: str, level: float) -> StatedInterval:
    """Interval symmetric in the scaled coordinate: a modulus has one in ratios, which never goes below zero.

    Student's t where the size of the noise was estimated, the normal distribution where it was given. Open
    where there is no error bar.
    """
    s = fit.statistics
    half = 0.5 * (1.0 + level)
    freedom = max(s.points - s.parameters, 1)
    times = float(special.stdtrit(freedom, half) if s.noise_estimated else special.ndtri(half))
    index = fit.names.index(name)
    deviation = math.sqrt(float(fit.scaled_covariance[index, index]))
    low, high = -math.inf, math.inf
    # In scaled coordinates: an uncertain factor of e, or of the whole range of the curve, fixes nothing.
    if name not in fit.no_error_bars and name not in fit.bounds_hit and 0.0 < deviation <= 1.0:
        low, high = ends_of(fit, index, fit.vector[index] + times * deviation * np.array([-1.0, 1.0]))
    return StatedInterval(name, level, fit.values[name], low, high, "quadratic")


def correlated_interval(fit: Fit, name: str, level: float) -> StatedInterval:
    """Interval of the plain likelihood, as much wider as residuals that hang together make its errors too small.

    Raises
    ------
    InputError
        If the level is not between 0 and 0.999.
    """
    plain = plain_interval(fit, name, level)
    wider = max((entry.too_narrow_by for entry in fit.diagnostics if entry.correlated), default=1.0)
    if fit.problem.noise_is_stated or wider == 1.0 or name.startswith("noise."):
        return plain
    index = fit.names.index(name)
    coordinate = fit.problem.coordinates[index]
    ends = [
        coordinate.scaled(end) if math.isfinite(end) else math.copysign(math.inf, end)
        for end in (plain.low, plain.high)
    ]
    middle = fit.vector[index]
    q = middle + wider * (np.array(ends) - middle)
    is_open = np.isinf(q) | (q < coordinate.bounds[0]) | (q > coordinate.bounds[1])
    low, high = ends_of(fit, index, np.where(is_open, middle, q))
    return replace(
        plain, low=-math.inf if is_open[0] else low, high=math.inf if is_open[1] else high, kind="correlated"
    )


def is_about(fit: Fit, found: StatedInterval) -> bool:
    """Whether the least-squares value lies within half a width of what a route takes for its middle."""
    coordinate = fit.problem.coordinates[fit.names.index(found.name)]
    own = fit.values[found.name]
    if not found.low <= own <= found.high:
        return False
    if found.is_open or found.high == found.low:
        return True
    low, middle, high, here = (
        coordinate.scaled(value) for value in (found.low, found.value, found.high, own)
    )
    return bool(abs(here - middle) <= 0.5 * (high - low))


def ends_of(fit: Fit, index: int, q: FloatArray) -> tuple[float, float]:
    """Values (SI) of two scaled ends of an entry."""
    low, high = fit.problem.coordinates[index].physical(q)
    return float(low), float(high)


def _agrees(fit: Fit, name: str, value: float, threshold: float) -> bool:
    """Whether the profile at a quadratic end has risen as far as it should."""
    index = fit.names.index(name)
    coordinate = fit.problem.coordinates[index]
    if not coordinate.low <= value <= coordinate.high:
        return False
    walk = Walk.start(fit, index, fit.vector)
    found = walk.follow(coordinate.scaled(value), _MOST_MODELS)
    return found is not None and abs(walk.delta_chi_square(found) - threshold) <= _UNLIKE * threshold
