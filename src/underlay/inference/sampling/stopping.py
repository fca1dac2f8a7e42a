"""When a chain may stop: long against its own memory, and every walker telling the same."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.weights import LEVELS
from underlay.inference.sampling.convergence import (
    autocorrelation_time,
    quantile_error,
    rank_normalised_rhat,
    tail_size,
)

__all__ = ["LARGEST_ERROR", "Outcome", "judge"]

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
