"""How a sampling went, for the record and for a verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from underlay.inference.ridge.importance import Importance

__all__ = ["SamplingDiagnostics"]


@dataclass(frozen=True)
class SamplingDiagnostics:
    """How the sampling went.

    Parameters
    ----------
    converged : bool
        Whether the stop rule was met: longer than 50 autocorrelation times, of the tails too, R-hat below 1.01, and
        2.5, 50 and 97.5 % quantiles known to 0.06 standard deviations, by the chain itself or by weighted draws
        that agree with it; of weighted draws alone, whether they were accepted.
    reason : str
        Why it stopped, in words.
    steps, burn_in, thin, walkers : int
        Steps taken, steps dropped at the start, steps per kept draw, walkers.
    autocorrelation_time : tuple of float
        Of each parameter (steps), after burn-in; empty for weighted draws.
    rhat : tuple of float
        Rank-normalised split R-hat of each parameter over the walkers, after burn-in; empty for weighted draws.
    acceptance : float
        Share of proposals accepted, after burn-in; of weighted draws, effective ones per draw.
    evaluations, failures : int
        Model evaluations, and how many of them failed inside the priors (each counted as impossible).
    failure_region : mapping of name to (low, high)
        Where they failed (SI), by parameter; empty where none did.
    seconds : float
        Time of this run, without what a resumed file already held.
    seed : int or None
        Seed of the generator, if one was given.
    model_error : float
        Relative error of the force that the contact law itself admits at the best fit.
    versions : mapping of str to str
        Of underlay and the libraries under it.
    method : str
        ``"emcee"`` where a chain was made, or ``"importance"`` for weighted draws alone.
    effective : tuple of float
        Effective draws of each parameter.
    quantile_errors : mapping of name to tuple of float
        Monte Carlo errors of the 2.5, 50 and 97.5 % quantiles, in standard deviations of the parameter.
    moves : mapping of str to float
        Share of proposals accepted by each move, over this run.
    importance : Importance or None
        What the weighted draws of a frozen mixture say; None where no mixture was found.
    weighted : bool
        Whether the draws are the weighted ones, resampled, several of each: a chain, if one was made, agreed with
        them and knew the quantiles less well.
    left_out : float
        What printed intervals leave out, over what they are asked to: below 1 where a fit's would (`Fit.interval`).
    """

    converged: bool
    reason: str
    steps: int
    burn_in: int
    thin: int
    walkers: int
    autocorrelation_time: tuple[float, ...]
    rhat: tuple[float, ...]
    acceptance: float
    evaluations: int
    failures: int
    failure_region: Mapping[str, tuple[float, float]]
    seconds: float
    seed: int | None
    model_error: float
    versions: Mapping[str, str]
    method: str = "emcee"
    effective: tuple[float, ...] = ()
    quantile_errors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    moves: Mapping[str, float] = field(default_factory=dict)
    importance: Importance | None = None
    weighted: bool = False
    left_out: float = 1.0
