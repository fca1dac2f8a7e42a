"""The profile of a parameter where noise and misfit are averaged over: the ends of its intervals at every level.

There is no single likelihood whose rise could be drawn: the interval at each level is that of a mixture, carried
along a profile where the model bends. Drawn over the parameter is the squared normal deviate of the level at which
a value becomes an end, z^2 with level = 2 Phi(z) - 1, which for one likelihood is its profile. (A confidence curve:
Birnbaum 1961, doi:10.1080/01621459.1961.10482107, with z^2 for the level.)
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from underlay._arrays import FloatArray, read_only
from underlay.inference.headline.averaged import is_straight
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.misfit.averaging import Averaged
from underlay.inference.misfit.valley import FARTHEST
from underlay.inference.profiling.profile_result import LikelihoodProfile

__all__ = ["averaged_profile"]

# Deviates at which ends are sought, up to 99.9 % and a little more; those of 68 and 95 % are among them.
_HEIGHTS = np.array([0.25, 0.5, 0.75, special.ndtri(0.84), 1.4, 1.7, special.ndtri(0.975), 2.4, 2.9, 3.4])
_LEVEL = 0.95


def averaged_profile(fit: Fit, averaged: Averaged, name: str) -> LikelihoodProfile:
    """Profile of a parameter whose 95 % interval is the one that the fit states.

    Raises
    ------
    InputError
        If there is no law where a profile begins.
    """
    index = fit.names.index(name)
    bent = index in averaged.blocked.held or not is_straight(averaged, index, _LEVEL)
    sides = [_side(averaged, index, direction, bent=bent) for direction in (-1.0, 1.0)]
    (middle,) = averaged.mixture.quantiles(index, [0.5])
    if index in averaged.blocked.held:
        middle = float(averaged.valley.optimum.vector[index])
    below, above = (np.array([q for q in side if abs(q - middle) <= FARTHEST]) for side in sides)
    q = np.concatenate((below[::-1], [middle], above))
    heights = np.concatenate((_HEIGHTS[: len(below)][::-1], [0.0], _HEIGHTS[: len(above)]))
    low, high = fit.problem.bounds[index]
    inside = (q >= low) & (q <= high)
    ends = tuple(
        "data" if len(side) == len(_HEIGHTS) and inside[at] else "none"
        for side, at in ((below, 0), (above, -1))
    )
    q, heights = q[inside], heights[inside]
    return LikelihoodProfile(
        name=name,
        fit=fit,
        values=read_only(np.asarray(fit.problem.coordinates[index].physical(q))),
        delta_chi_square=read_only(np.square(heights)),
        vectors=read_only(_alongside(averaged, index, q)),
        ends=(ends[0], ends[1]),
        averaged=True,
    )


def _side(averaged: Averaged, index: int, direction: float, *, bent: bool) -> list[float]:
    """Ends (scaled) on one side at every height; infinite where the data set none."""
    levels = [averaged.inside(level) for level in 2.0 * special.ndtr(_HEIGHTS) - 1.0]
    least = [averaged.least_z(level) for level in levels]
    path = averaged.valley.path(index, direction, least[-1]) if bent else None
    alike = averaged.mixture.quantiles(index, [0.5 + 0.5 * direction * level for level in levels])
    ends: list[float] = []
    for mixed, z in zip(alike, least, strict=True):
        end = mixed
        if path is not None:
            walked = path.crossing(z)
            alone = index in averaged.blocked.held
            end = walked if alone else direction * max(direction * walked, direction * mixed)
        ends.append(end if not ends or direction * (end - ends[-1]) >= 0.0 else ends[-1])
    return [end for end in ends if math.isfinite(end)]


def _alongside(averaged: Averaged, index: int, q: FloatArray) -> FloatArray:
    """Scaled vectors (m, k): the others where the heaviest combination expects them, to first order."""
    k = len(averaged.vector)
    covariance = averaged.competition.covariance[averaged.competition.heaviest][:k, :k]
    own = float(covariance[index, index])
    tangent = covariance[index] / own if own > 0.0 else np.zeros(k)
    tangent[index] = 1.0
    vectors = averaged.vector + (q - averaged.vector[index])[:, None] * tangent
    vectors[:, index] = q
    return np.asarray(vectors)
