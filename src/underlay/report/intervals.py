"""95 % intervals of fitted parameters, in the coordinates in which the fit was made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.profiles import LikelihoodProfile

__all__ = ["Estimate", "estimates"]

# In scaled coordinates: an uncertain factor of e, or of the whole range of the curve, fixes nothing.
_NOTHING = 1.0


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter with its 95 % interval (SI).

    Parameters
    ----------
    name, path : str
        As in `Fit`; the path lacks the number of the curve.
    value, low, high : float
        Optimum and ends; infinite ends where there is no error bar.
    not_fixed : str
        Why the data do not fix it; empty where they do.
    """

    name: str
    path: str
    value: float
    low: float
    high: float
    not_fixed: str


def estimates(
    result: Fit, profiles: Mapping[str, LikelihoodProfile] | None = None, level: float = 0.95
) -> list[Estimate]:
    """Return every parameter with its interval at `level`.

    Parameters
    ----------
    result : Fit
        The fit.
    profiles : mapping of name to LikelihoodProfile, optional
        Profile likelihoods, whose intervals are taken where there is one: they can be open at one side.
    level : float
        Confidence.

    Returns
    -------
    list of Estimate
        Without a profile the interval is symmetric in the scaled coordinate: a modulus has an interval in
        ratios, so that it never goes below zero. Student's t where the size of the noise was estimated, the
        normal distribution where it was given.
    """
    s = result.statistics
    freedom = max(s.points - s.parameters, 1)
    half = 0.5 * (1.0 + level)
    times = float(stats.t.ppf(half, freedom) if s.noise_estimated else stats.norm.ppf(half))
    deviations = np.sqrt(np.diag(result.scaled_covariance))
    rows = []
    for i, coordinate in enumerate(result.problem.coordinates):
        name = coordinate.name
        if profiles and name in profiles:
            rows.append(_from_profile(profiles[name], coordinate.path, result.values[name], level))
            continue
        deviation = float(deviations[i])
        reason = result.bounds_hit.get(name, "")
        reason = f"it ended on its {reason}" if reason else result.no_error_bars.get(name, "")
        if not reason and deviation > _NOTHING:
            reason = (
                f"its standard error is a factor of {math.exp(min(deviation, 50.0)):.2g}"
                if coordinate.scale is None
                else "its standard error is larger than its whole range"
            )
        if reason:
            low, high = -math.inf, math.inf
        else:
            ends = coordinate.physical(result.vector[i] + times * deviation * np.array([-1.0, 1.0]))
            low, high = float(ends[0]), float(ends[1])
        rows.append(Estimate(name, coordinate.path, result.values[name], low, high, reason))
    return rows


def _from_profile(walk: LikelihoodProfile, path: str, value: float, level: float) -> Estimate:
    found = walk.interval(level)
    low = found.low if found.low_reason == "data" else -math.inf
    high = found.high if found.high_reason == "data" else math.inf
    nothing = "the data bound it neither below nor above" if math.isinf(low) and math.isinf(high) else ""
    return Estimate(walk.name, path, value, low, high, nothing)
