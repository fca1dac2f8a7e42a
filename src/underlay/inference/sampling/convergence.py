"""Whether a chain has converged, and when it may stop.

Whether a chain has converged, and how many independent draws it is worth.

Rank-normalised split R-hat, effective sample size and Monte Carlo error of quantiles, all after Vehtari,
Gelman, Simpson, Carpenter and Buerkner (2021), doi:10.1214/20-BA1221. Ranks make them valid for heavy tails
and blind to any increasing change of the parameter: a modulus and its logarithm give the same numbers.

A chain is an array (steps, walkers) of one quantity; each walker counts as a chain.

When a chain may stop: long against its own memory, and every walker telling the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import fft, special, stats

from underlay._arrays import FloatArray
from underlay.inference.ridge.mixture import LEVELS

__all__ = [
    "LARGEST_ERROR",
    "Outcome",
    "autocorrelation_time",
    "effective_size",
    "highest_density_interval",
    "judge",
    "median_error",
    "quantile_error",
    "rank_normalised_rhat",
    "tail_size",
]

#: Fewest steps for which halves of a chain have a variance and an autocorrelation.
MIN_STEPS = 8


#: The autocorrelation is summed over this many of its own times (Sokal's window).
_WINDOW = 5.0


#: Quantiles whose effective size is that of the tails.
_TAILS = (0.05, 0.95)


def autocorrelation_time(chain: FloatArray) -> float:
    """Integrated autocorrelation time (steps) of one quantity, (steps, walkers).

    The autocorrelation is averaged over the walkers and summed up to five times its own time: Sokal's
    window, as Goodman and Weare (2010), doi:10.2140/camcos.2010.5.65, use it for ensembles. Estimates from
    chains shorter than some 50 times are too small. A chain that does not move gives inf.
    """
    covariance = _autocovariance(chain)
    moving = covariance[0] > 0.0
    if not moving.any():
        return float("inf")
    rho = (covariance[:, moving] / covariance[0, moving]).mean(axis=1)
    times = 2.0 * np.cumsum(rho) - 1.0
    outside = np.flatnonzero(np.arange(len(times)) >= _WINDOW * times)
    return float(times[outside[0]] if outside.size else times[-1])


def rank_normalised_rhat(chain: FloatArray) -> float:
    """Potential scale reduction of one quantity: 1 when all walkers, and both halves of each, agree.

    The larger of that of the rank-normalised draws (location) and that of their folded distances from the
    median (spread).

    Parameters
    ----------
    chain : FloatArray
        (steps, walkers), at least `MIN_STEPS` steps.

    Returns
    -------
    float
        At least about 1; nan where the chain does not move.
    """
    halves = _split(chain)
    folded = np.abs(halves - np.median(halves))
    return max(_rhat(_rank_normalised(halves)), _rhat(_rank_normalised(folded)))


def effective_size(chain: FloatArray) -> float:
    """Bulk effective sample size of one quantity, (steps, walkers): the independent draws it is worth."""
    return _effective_size(_rank_normalised(_split(chain)))


def tail_size(chain: FloatArray) -> float:
    """Tail effective sample size of one quantity, (steps, walkers): that of its 5 and 95 % quantiles, the smaller.

    Walkers that go far out and stay there for long leave the autocorrelation of the quantity itself short.
    """
    halves = _split(chain)
    return min(_effective_size(_below(halves, level)) for level in _TAILS)


def median_error(chain: FloatArray) -> float:
    """Monte Carlo standard error of the median of one quantity, (steps, walkers), in its unit."""
    return quantile_error(chain, 0.5)


def quantile_error(chain: FloatArray, level: float) -> float:
    """Monte Carlo standard error of a quantile of one quantity, (steps, walkers), in its unit.

    The share of draws below the quantile has the effective size of that indicator; its one-sigma beta
    quantiles are turned back into draws (section 4.3 of the source). A chain that does not move gives nan.
    """
    halves = _split(chain)
    size = _effective_size(_below(halves, level))
    if math.isnan(size):
        return size
    low, high = special.betaincinv(level * size + 1.0, (1.0 - level) * size + 1.0, special.ndtr([-1.0, 1.0]))
    draws = np.sort(halves, axis=None)
    below = int(np.floor(low * draws.size))
    above = min(int(np.ceil(high * draws.size)), draws.size - 1)
    return float(0.5 * (draws[above] - draws[below]))


def highest_density_interval(draws: FloatArray, probability: float) -> tuple[float, float]:
    """Shortest interval that holds a share `probability` of `draws` (n,)."""
    ordered = np.sort(draws, axis=None)
    inside = int(np.ceil(probability * ordered.size))
    width = ordered[inside - 1 :] - ordered[: ordered.size - inside + 1]
    start = int(np.argmin(width))
    return float(ordered[start]), float(ordered[start + inside - 1])


def _split(chain: FloatArray) -> FloatArray:
    """Halves of every walker as chains of their own; the middle step of an odd number is dropped."""
    half = chain.shape[0] // 2
    return np.concatenate([chain[:half], chain[chain.shape[0] - half :]], axis=1)


def _below(chain: FloatArray, level: float) -> FloatArray:
    """Which draws (1 or 0) are not above a quantile; below it, where a walker that rests is the quantile itself."""
    quantile = np.quantile(chain, level)
    below = chain <= quantile
    return np.asarray(chain < quantile if below.all() else below, dtype=np.float64)


def _rank_normalised(chain: FloatArray) -> FloatArray:
    ranks = stats.rankdata(chain, axis=None).reshape(chain.shape)
    return np.asarray(special.ndtri((ranks - 0.375) / (chain.size + 0.25)))


def _rhat(chain: FloatArray) -> float:
    within, total = _variances(chain)
    if within == 0.0:
        return float("nan") if total == 0.0 else float("inf")
    return float(np.sqrt(total / within))


def _variances(chain: FloatArray) -> tuple[float, float]:
    """Mean variance within the chains, and the estimate of the whole from within and between."""
    steps = chain.shape[0]
    within = float(chain.var(axis=0, ddof=1).mean())
    between = float(chain.mean(axis=0).var(ddof=1))
    return within, within * (steps - 1) / steps + between


def _effective_size(chain: FloatArray) -> float:
    """Effective size from the combined autocorrelation of several chains, cut by Geyer's rules.

    Geyer (1992), doi:10.1214/ss/1177011137: sums of neighbouring autocorrelations of a reversible chain are
    positive and decrease; the sum ends where the estimate stops doing so.
    """
    steps, count = chain.shape
    within, total = _variances(chain)
    if total == 0.0:
        return float("nan")
    rho = 1.0 - (within - _autocovariance(chain).mean(axis=1) * steps / (steps - 1)) / total
    rho[0] = 1.0
    pairs = rho[: 2 * (steps // 2)].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs < 0.0)
    positive = pairs[: negative[0]] if negative.size else pairs
    time = -1.0 + 2.0 * float(np.minimum.accumulate(positive).sum())
    draws = float(steps * count)
    # Antithetic chains may be worth more than their length; the source bounds the gain by log10 of it.
    return draws / max(time, 1.0 / math.log10(draws))


def _autocovariance(chain: FloatArray) -> FloatArray:
    """Autocovariance at every lag, (lags, chains), divided by the number of steps."""
    steps = chain.shape[0]
    size = fft.next_fast_len(2 * steps, real=True)
    spectrum = fft.rfft(chain - chain.mean(axis=0), n=size, axis=0)
    return np.asarray(fft.irfft(np.abs(spectrum) ** 2, n=size, axis=0)[:steps] / steps)


_TIMES_NEEDED = 50.0


_RHAT_NEEDED = 1.01


#: Monte Carlo error of a quantile, in standard deviations, with which one is hardly ever off by 0.15.
LARGEST_ERROR = 0.06


# The walkers' memory of their start fades as exp(-t / tau): ten times leave 5e-5 of it.
_BURN_IN_TIMES = 10.0


class Outcome(NamedTuple):
    """Where a chain stands: burn-in; after it autocorrelation times, those of the tails, R-hat; a verdict in words.

    The time of a tail is what its quantile's effective sample size says: steps of all walkers per sample. Errors of
    the 2.5, 50 and 97.5 % quantiles, (3, parameters), are in standard deviations of the parameter.
    """

    steps: int
    walkers: int
    burn_in: int
    times: FloatArray
    tail_times: FloatArray
    rhat: FloatArray
    quantile_errors: FloatArray
    converged: bool
    reason: str

    @property
    def effective(self) -> float:
        """Effective samples of the slowest parameter, of all walkers together."""
        return (self.steps - self.burn_in) * self.walkers / float(self.times.max())

    @property
    def probable_length(self) -> int:
        """Steps that will probably do: R-hat of single walkers comes below 1.01 at about a hundred times."""
        return max(
            self.steps, int((2.0 * _TIMES_NEEDED + _BURN_IN_TIMES) * min(self.times.max(), self.steps))
        )


def judge(coords: FloatArray, max_steps: int, *, known: bool = False) -> Outcome:
    """Judge a chain in scaled coordinates, (steps, walkers, parameters), that may grow to `max_steps`.

    Where `known` the quantiles are told by weighted draws, and the chain only has to be one that can contradict.
    Every parameter is watched in its bulk, its tails and its spread: the slowest of them decides. R-hat and the
    tails are left out (nan) while the chain is too short for them to decide.
    """
    steps, walkers, parameters = coords.shape
    late = np.array([autocorrelation_time(coords[steps // 2 :, :, i]) for i in range(parameters)])
    burn_in = min(steps // 2, int(np.ceil(_BURN_IN_TIMES * min(late.max(), steps))))
    kept = coords[burn_in:]
    times = np.array([autocorrelation_time(kept[..., i]) for i in range(parameters)])
    long_enough = len(kept) > _TIMES_NEEDED * times.max()
    # Ranking half a million numbers costs more than all autocorrelations: only when it can decide, or last.
    if not long_enough and steps < max_steps:
        rhat = tails = np.full(parameters, np.nan)
        errors = np.full((len(LEVELS), parameters), np.nan)
    else:
        rhat = np.array([rank_normalised_rhat(kept[..., i]) for i in range(parameters)])
        tails = kept[..., 0].size / np.array([tail_size(kept[..., i]) for i in range(parameters)])
        errors = np.array([[_error(kept[..., i], level) for i in range(parameters)] for level in LEVELS])
    mixed = bool((rhat < _RHAT_NEEDED).all()) and bool((len(kept) > _TIMES_NEEDED * tails).all())
    sure = known or bool((errors <= LARGEST_ERROR).all())
    lengths = len(kept) / times.max(), len(kept) / tails.max()
    told = f"{lengths[0]:.0f} autocorrelation times ({lengths[1]:.0f} of the slowest tail)"
    if long_enough and mixed and sure:
        reason = (
            f"converged: {len(kept)} steps after burn-in are {told}, R-hat is {rhat.max():.4f}, and no quantile "
            f"is uncertain by more than {errors.max():.2f} standard deviations"
        )
    else:
        reason = (
            f"not converged after {steps} steps: {len(kept)} of them, after burn-in, are {told}, where "
            f"{_TIMES_NEEDED:.0f} autocorrelation times are needed, and R-hat is {rhat.max():.4f} "
            f"({_RHAT_NEEDED} is needed){_unsure(errors)}"
        )
    return Outcome(
        steps, walkers, burn_in, times, tails, rhat, errors, bool(long_enough and mixed and sure), reason
    )


def _error(chain: FloatArray, level: float) -> float:
    """Error of a quantile in standard deviations; nan where the chain does not move."""
    deviation = float(chain.std())
    return quantile_error(chain, level) / deviation if deviation > 0.0 else float("nan")


def _unsure(errors: FloatArray) -> str:
    """What is said of quantiles that are not known well enough."""
    if not (errors > LARGEST_ERROR).any():
        return ""
    return (
        f"; a quantile is uncertain by {errors.max():.2f} standard deviations, where {LARGEST_ERROR} may be"
    )
