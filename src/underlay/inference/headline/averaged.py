"""The interval without a stated noise: averaged over noise, drift and jump, carried along a profile where bent."""

from __future__ import annotations

import math

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.headline.plain import ends_of
from underlay.inference.least_squares.fit_result import Fit, StatedInterval
from underlay.inference.misfit.averaging import Averaged, average
from underlay.inference.misfit.valley import FARTHEST

__all__ = ["averaged_fit", "averaged_interval", "is_straight"]

# The profile at an end of the linearised model may be off by this share of z before it is walked.
_UNLIKE = 0.12
# In scaled coordinates: an interval of a tenth is bent by no more than about half of that.
_NARROW = 0.1


def averaged_fit(fit: Fit) -> Averaged | None:
    """Average a fit over what its residuals may be; None where its noise was stated, or nothing can be averaged."""
    problem = fit.problem
    if not problem.noise_is_open or fit.statistics.robust != "none":
        return None
    held = frozenset(
        i for i, name in enumerate(problem.names) if name in fit.no_error_bars or name in fit.bounds_hit
    )
    if len(held) == len(problem.names):
        return None
    try:
        return average(problem, fit.vector, [other.vector for other in fit.alternatives], held)
    except (InputError, np.linalg.LinAlgError):
        # No law beside the optimum, or residuals of rounding alone: the plain interval is what there is.
        return None


def averaged_interval(fit: Fit, averaged: Averaged, name: str, level: float) -> StatedInterval:
    """Interval of a parameter, noise and misfit averaged over.

    Raises
    ------
    InputError
        If there is no law where a profile begins.
    """
    index = fit.names.index(name)
    held, inside = averaged.blocked.held, averaged.inside(level)
    if index in held:
        return _of_the_profile_alone(fit, averaged, index, level)
    tails = (0.5 - 0.5 * inside, 0.5, 0.5 + 0.5 * inside)
    low, middle, high = averaged.mixture.quantiles(index, tails)
    if not held and is_straight(averaged, index, level):
        return _stated(fit, index, level, np.array([low, middle, high]), "averaged")
    # Bent: both what other noises allow and what the likeliest allows far out belong to the interval.
    valley, least = averaged.valley, averaged.least_z(inside)
    ends = [min(valley.end(index, -1.0, least), low), max(valley.end(index, 1.0, least), high)]
    middle = min(max(middle, ends[0]), ends[1])
    return _stated(fit, index, level, np.array([ends[0], middle, ends[1]]), "averaged profile")


def is_straight(averaged: Averaged, index: int, level: float) -> bool:
    """Whether the profile under the heaviest combination rises as that of a linear model does."""
    z = averaged.least_z(averaged.inside(level))
    reach = z * averaged.deviations
    if (reach < _NARROW).all():
        return True
    ends = averaged.vector[index] + reach[index] * np.array([-1.0, 1.0])
    return all(averaged.valley.agrees(index, float(end), z, _UNLIKE) for end in ends)


def _of_the_profile_alone(fit: Fit, averaged: Averaged, index: int, level: float) -> StatedInterval:
    """Interval of a parameter on a bound, or that hardly acts: the profile under the heaviest combination."""
    z = averaged.least_z(averaged.inside(level))
    ends = [averaged.valley.end(index, side, z) for side in (-1.0, 1.0)]
    middle = float(averaged.valley.optimum.vector[index])
    return _stated(fit, index, level, np.array([ends[0], middle, ends[1]]), "averaged profile")


def _stated(fit: Fit, index: int, level: float, q: FloatArray, kind: str) -> StatedInterval:
    name = fit.names[index]
    if not abs(q[1] - fit.vector[index]) <= FARTHEST:
        # Half of a mixture that wide lies where no curve says anything; the fit's own value is as good.
        q = np.array([q[0], fit.vector[index], q[2]])
    # Further than a profile is walked an end of a linearised model means nothing: that side is open.
    q = np.where(np.abs(q - q[1]) > FARTHEST, [-np.inf, q[1], np.inf], q)
    # Nor does one beyond what the parameter may be: the bound ends that side, not the data.
    least, most = fit.problem.bounds[index]
    q = np.array(
        [q[0] if q[0] >= least else -np.inf, np.clip(q[1], least, most), q[2] if q[2] <= most else np.inf]
    )
    inside = np.where(np.isfinite(q), q, q[1])
    low, high = ends_of(fit, index, inside[[0, 2]])
    value, _ = ends_of(fit, index, inside[[1, 1]])
    low = low if math.isfinite(q[0]) else -math.inf
    high = high if math.isfinite(q[2]) else math.inf
    return StatedInterval(name, level, value, low, high, kind)
