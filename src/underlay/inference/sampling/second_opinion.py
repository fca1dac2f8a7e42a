"""A chain against the weighted draws of the mixture that proposed to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.importance import Importance, judged, leak_of
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.ridge.weights import LEVELS, WeightedDraws
from underlay.inference.sampling.assembly import Draws
from underlay.inference.sampling.stopping import Outcome
from underlay.inference.sampling.weighted import Ridges

__all__ = ["second_opinion", "surer"]

# Quantiles that differ by so many of their joint standard errors, and by so many standard deviations of the
# posterior beyond what the two are asked for, are not one.
_SIGMAS, _SLACK = 4.0, 0.05
# Draws of the chain that are asked where the mixture hardly reaches.
_ASKED = 4096


def second_opinion(
    ridges: Ridges, coords: FloatArray, log_density: FloatArray, outcome: Outcome
) -> tuple[Outcome, Importance | None]:
    """The verdict on a chain, with what weighted draws say; they must not differ where both are believed.

    Parameters
    ----------
    ridges : Ridges
        The mixture.
    coords, log_density : FloatArray
        Chain in scaled coordinates, (steps, walkers, parameters), and its log-posterior (steps, walkers).
    outcome : Outcome
        The verdict so far.
    """
    answer = ridges.draws()
    if answer is None or not np.isfinite(answer[0].log_weights).any():
        return outcome, None
    drawn, proposal = answer
    kept = coords[outcome.burn_in :].reshape(-1, coords.shape[-1])
    every = -(-len(kept) // _ASKED)
    theirs = log_density[outcome.burn_in :].ravel()[::every]
    leak = _leak(ridges, kept[::every], theirs, drawn, proposal.mixture)
    importance = judged(drawn, proposal, leak)
    if not (outcome.converged and importance.accepted):
        return outcome, importance
    disagreement = _disagreement(ridges.problem.names, kept, outcome, drawn)
    if disagreement:
        reason = f"not converged: the chain met its stop rule, and weighted draws disagree: {disagreement}"
        outcome = outcome._replace(converged=False, reason=reason)
    return outcome, replace(importance, disagreement=disagreement)


def surer(ridges: Ridges, outcome: Outcome, importance: Importance | None) -> tuple[Outcome, Draws | None]:
    """Weighted draws, resampled, where they stand and know the quantiles better than a chain; else None."""
    answer = ridges.draws()
    if answer is None or importance is None or not importance.stands:
        return outcome, None
    if not importance.quantile_error < outcome.quantile_errors.max():
        return outcome, None
    reason = (
        f"{outcome.reason}; {importance.draws} weighted draws agree with it and know every quantile to "
        f"{importance.quantile_error:.2f} standard deviations: the draws are these"
    )
    found = outcome._replace(quantile_errors=answer[0].quantile_errors(), reason=reason)
    return found, ridges.resampled(answer[0], outcome.walkers, ridges.for_draws)


def _leak(
    ridges: Ridges, vectors: FloatArray, log_density: FloatArray, drawn: WeightedDraws, mixture: Mixture
) -> float:
    """Share of the chain's draws (n, p), of log-posterior (n,), where the mixture reaches less than it should."""
    z = ridges.coordinates.normal(vectors)
    near = np.isfinite(z).all(axis=1)
    if not near.any():
        return 1.0
    target = log_density[near] - ridges.coordinates.log_slope(vectors[near], z[near])
    return leak_of(target - mixture.log_density(z[near]), drawn)


def _disagreement(names: tuple[str, ...], kept: FloatArray, outcome: Outcome, drawn: WeightedDraws) -> str:
    """Quantiles of a chain (draws, parameters) and of weighted draws that differ beyond their errors, in words."""
    off = (np.quantile(kept, LEVELS, axis=0) - drawn.quantiles()) / drawn.deviations
    error = np.hypot(outcome.quantile_errors, drawn.quantile_errors())
    beyond = np.abs(off) > _SIGMAS * error + _SLACK
    return ", ".join(
        f"the {100.0 * LEVELS[level]:g} % quantile of {names[i]} by {off[level, i]:+.2f} standard deviations"
        for level, i in np.argwhere(beyond)
    )
