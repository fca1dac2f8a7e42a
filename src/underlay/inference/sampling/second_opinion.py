"""A chain against the weighted draws of the mixture that proposed to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.importance import Importance, judged, leak_of
from underlay.inference.ridge.weights import LEVELS, WeightedDraws
from underlay.inference.sampling.stopping import Outcome
from underlay.inference.sampling.weighted import Ridges

__all__ = ["second_opinion"]

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
    drawn = ridges.draws()
    if drawn is None or ridges.proposal is None or not np.isfinite(drawn.log_weights).any():
        return outcome, None
    kept = coords[outcome.burn_in :].reshape(-1, coords.shape[-1])
    every = -(-len(kept) // _ASKED)
    theirs = log_density[outcome.burn_in :].ravel()[::every]
    importance = judged(drawn, ridges.proposal, _leak(ridges, kept[::every], theirs, drawn))
    if not (outcome.converged and importance.accepted):
        return outcome, importance
    disagreement = _disagreement(ridges.problem.names, kept, outcome, drawn)
    if disagreement:
        reason = f"not converged: the chain met its stop rule, and weighted draws disagree: {disagreement}"
        outcome = outcome._replace(converged=False, reason=reason)
    return outcome, replace(importance, disagreement=disagreement)


def _leak(ridges: Ridges, vectors: FloatArray, log_density: FloatArray, drawn: WeightedDraws) -> float:
    """Share of the chain's draws (n, p), of log-posterior (n,), where the mixture reaches less than it should."""
    z = ridges.coordinates.normal(vectors)
    near = np.isfinite(z).all(axis=1)
    if ridges.mixture is None or not near.any():
        return 1.0
    target = log_density[near] - ridges.coordinates.log_slope(vectors[near], z[near])
    return leak_of(target - ridges.mixture.log_density(z[near]), drawn)


def _disagreement(names: tuple[str, ...], kept: FloatArray, outcome: Outcome, drawn: WeightedDraws) -> str:
    """Quantiles of a chain (draws, parameters) and of weighted draws that differ beyond their errors, in words."""
    off = (np.quantile(kept, LEVELS, axis=0) - drawn.quantiles()) / drawn.deviations
    error = np.hypot(outcome.quantile_errors, drawn.quantile_errors())
    beyond = np.abs(off) > _SIGMAS * error + _SLACK
    return ", ".join(
        f"the {100.0 * LEVELS[level]:g} % quantile of {names[i]} by {off[level, i]:+.2f} standard deviations"
        for level, i in np.argwhere(beyond)
    )
