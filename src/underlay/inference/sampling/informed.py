"""Did the data tell anything about a parameter? Its posterior against its prior."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.sampling.convergence import effective_size, highest_density_interval

__all__ = [
    "INFORMED",
    "INFORMED_COLUMNS",
    "NOT_INFORMED",
    "WEAKLY_INFORMED",
    "Information",
    "compare_with_prior",
    "prior_levels",
]

INFORMED = "informed"
WEAKLY_INFORMED = "weakly informed"
NOT_INFORMED = "not informed by these data"

# Largest difference of the distribution functions. A normal posterior that is a third narrower than its
# normal prior, or a quarter of a standard deviation beside it, is 0.1 away from it; one 0.4 times as wide, or
# half a standard deviation beside it, 0.2.
_NOTHING = 0.1
_LITTLE = 0.2
# Ratio of the ends of a positive prior above which it is one over orders of magnitude.
_DECADES = 20.0
# 95 % point of the Kolmogorov distribution: what the noise of the draws alone makes of identical ones.
_KOLMOGOROV_95 = 1.358


class Information(NamedTuple):
    """Prior and posterior of one parameter side by side (SI)."""

    prior_median: float
    prior_low: float
    prior_high: float
    posterior_median: float
    posterior_low: float
    posterior_high: float
    narrowing: float
    distance: float
    informed: str


INFORMED_COLUMNS = list(Information._fields)


def prior_levels(count: int) -> FloatArray:
    """Middles of `count` equal shares of probability, (count,)."""
    return (np.arange(count) + 0.5) / count


def compare_with_prior(draws: FloatArray, prior_quantiles: FloatArray, inside: float = 0.95) -> Information:
    """Compare the draws of one parameter with its prior.

    Parameters
    ----------
    draws : FloatArray
        (draws, walkers).
    prior_quantiles : FloatArray
        (levels,): quantiles of the prior at `prior_levels`.
    inside : float
        Share of the draws that their 95 % interval holds.

    Returns
    -------
    Information
        ``narrowing`` is 1 minus the ratio of the 68 % widths, those of the logarithm where the prior of a positive
        parameter spans more than a factor of 20; ``distance`` the Kolmogorov distance of the two
        distributions, 0 for equal ones and 1 for disjoint ones. Below 0.1, or what the noise of the draws
        explains, the verdict is "not informed by these data", below 0.2 "weakly informed".
    """
    levels = prior_levels(len(prior_quantiles))
    ordered = np.sort(draws, axis=None)
    below = np.interp(ordered, prior_quantiles, levels, left=0.0, right=1.0)
    ranks = np.arange(ordered.size + 1) / ordered.size
    distance = float(max(np.max(ranks[1:] - below), np.max(below - ranks[:-1])))
    noise = _KOLMOGOROV_95 / np.sqrt(effective_size(draws))
    if distance < max(_NOTHING, noise):
        verdict = NOT_INFORMED
    else:
        verdict = WEAKLY_INFORMED if distance < _LITTLE else INFORMED
    prior68, posterior68 = _widths(prior_quantiles, ordered)
    prior95 = highest_density_interval(prior_quantiles, 0.95)
    posterior95 = highest_density_interval(ordered, inside)
    return Information(
        float(np.median(prior_quantiles)),
        *prior95,
        float(np.median(ordered)),
        *posterior95,
        narrowing=float(1.0 - posterior68 / prior68),
        distance=distance,
        informed=verdict,
    )


def _widths(prior: FloatArray, posterior: FloatArray) -> tuple[float, float]:
    """Widths of the 68 % intervals; on an even axis one over decades is as wide as its upper end is high."""
    low, high = np.quantile(prior, (0.025, 0.975))
    if low > 0.0 and high / low > _DECADES and posterior[0] > 0.0:
        prior, posterior = np.log(prior), np.log(posterior)
    ends = (highest_density_interval(draws, 0.68) for draws in (prior, posterior))
    first, second = (high - low for low, high in ends)
    return first, second
