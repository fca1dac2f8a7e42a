"""Weighted draws of the mixture along a posterior's ridges, and a chain judged by them.

Weighted draws of the mixture along a posterior's ridges: found for a chain, or an answer of their own.

A chain against the weighted draws of the mixture that proposed to it.
"""

from __future__ import annotations

import time
from copy import deepcopy
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError, InputError
from underlay.inference.problem import Problem
from underlay.inference.ridge.importance import (
    Importance,
    Proposal,
    Trial,
    aimed,
    judged,
    leak_of,
    leak_of_walk,
    learn,
    produced,
    weigh,
)
from underlay.inference.ridge.march import Budget, Part, PriorNormal, Target
from underlay.inference.ridge.mixture import LEVELS, Mixture, WeightedDraws
from underlay.inference.sampling.assembly import Draws, Making, assemble_posterior
from underlay.inference.sampling.convergence import LARGEST_ERROR, Outcome
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.sampling.walker_start import optima, prior_marks

__all__ = ["NotAcceptedError", "Ridges", "by_weights", "second_opinion", "surer"]

# Processor seconds that walking and trying may take, and drawing: where a density costs milliseconds a chain of the
# old moves is not slower than what a mixture would save.
_TO_LEARN, _TO_DRAW = 10.0, 5.0


# What a quantile may be uncertain by, in standard deviations; and where noise is averaged over, whose density costs
# ten times as much. Evenly spread draws are off by half of it.
_ERROR, _AVERAGED_ERROR = 0.035, 0.1


_CHAINS = 8


# Draws by which a mixture is taught and aimed, and that of an averaged posterior with its wings.
_TO_TEACH, _TO_TEACH_WINGS = 4096, 8192


# Resampled draws of each weighted one. A tail that many light draws know well is thinned to what its own weight is
# worth by as many as there were: a quantile was off by 0.06 standard deviations for that alone; by four times as
# many, by 0.01.
_TIMES = 4


class NotAcceptedError(FitError):
    """Weighted draws that are not believed."""


class Ridges:
    """The mixture of a problem, and draws of it; chance of its own, so that a chain's is what it was.

    Parameters
    ----------
    problem : Problem
        What is sampled.
    density : CountedDensity
        Its posterior; what is asked of it here is not counted among the chain's failures.
    rng : numpy Generator
        Chance of the pilots and of the draws.
    """

    def __init__(self, problem: Problem, density: CountedDensity, rng: np.random.Generator) -> None:
        self.problem, self.density = problem, density
        self.coordinates = PriorNormal(problem)
        self.target = Target(self.coordinates, problem, density.peek)
        self.proposal: Proposal | None = None
        self._drawn: tuple[WeightedDraws, Proposal] | None = None
        self._best: FloatArray | None = None
        self._for_pilots, self.for_draws = rng.spawn(2)

    @property
    def mixture(self) -> Mixture | None:
        """The frozen mixture; None where none was found."""
        return None if self.proposal is None else self.proposal.mixture

    def seek(self) -> FloatArray:
        """Lay the mixture from every optimum of the fit, once; the best fit, (k,), scaled.

        Raises
        ------
        InputError
            If no contact law exists at the best fit.
        """
        if self._best is not None:
            return self._best
        found, places = optima(self.problem)
        low, *_, high = prior_marks(self.problem)
        found = [np.clip(vector, low, high) for vector in found]
        if not np.isfinite(self.density(found[0][None])[0]):
            raise InputError(
                "no contact law exists at the best fit, or its likelihood is zero; change the values in the scene"
            )
        starts = self.coordinates.normal(np.array(found + places))
        self.proposal = learn(
            self.target,
            list(starts[: len(found)]),
            self._for_pilots,
            Budget(_TO_LEARN),
            places=list(starts[len(found) :]),
            parts=self._parts(),
        )
        self.count()
        self._best = found[0]
        return self._best

    def _parts(self) -> list[Part]:
        """What the likelihood is a sum of, as parts of the posterior in z."""
        if self.problem.likelihood is None:
            return []
        parts = []
        for part in self.problem.likelihood.parts:
            places, factors = self.coordinates.factors(part.middle[None], part.covariance[None])
            if not len(places):
                continue
            problem = self.problem.with_likelihood(part.likelihood)
            target = Target(self.coordinates, problem, CountedDensity(problem).peek)
            parts.append(Part(target, places[0], factors[0]))
        return parts

    def count(self) -> None:
        """Count what was asked of the density here since the last time among its evaluations."""
        self.density.continue_from(self.target.evaluations, 0)
        self.target.evaluations = 0

    def recall(self, numbers: FloatArray | None) -> None:
        """Take the mixture that an earlier run found, if it did."""
        if numbers is not None:
            self.proposal = Proposal.from_numbers(numbers)

    def draws(self) -> tuple[WeightedDraws, Proposal] | None:
        """Weighted draws of the mixture, taught and aimed at the quantiles, and that mixture; None without one.

        They are made once.
        """
        if self._drawn is None and self.proposal is not None:
            budget = Budget(_TO_DRAW)
            # So many draws tell of what a pilot does not meet. They teach, and are not used otherwise.
            averaged, mixture = self.problem.likelihood is not None, self.proposal.mixture
            count = _TO_TEACH_WINGS if averaged else _TO_TEACH
            learnt = weigh(self.target, self.coordinates, mixture, count, self.for_draws)
            if np.isfinite(learnt.k_hat):
                trial = Trial(self.target, self.coordinates, self.for_draws, mixture, learnt)
                mixture = aimed(trial.mended(), learnt)
            proposal = replace(self.proposal, mixture=mixture)
            error = _AVERAGED_ERROR if averaged else _ERROR
            drawn = produced(self.target, proposal, self.for_draws, budget, error=error)
            self._drawn = drawn, proposal
            self.count()
        return self._drawn

    @property
    def know_quantiles(self) -> bool:
        """Whether weighted draws tell of the quantiles as much as a chain must, if a chain agrees with them."""
        answer = self.draws()
        if answer is None or not np.isfinite(answer[0].k_hat):
            return False
        told = judged(*answer, leak=0.0)
        return told.accepted and told.quantile_error <= LARGEST_ERROR

    def resampled(self, drawn: WeightedDraws, columns: int, rng: np.random.Generator) -> Draws:
        """Draws of one weight each, in so many columns."""
        rows = drawn.resampled(columns * -(-_TIMES * len(drawn.z) // columns), rng)
        rows = rows.reshape(-1, columns)
        log_density, used = drawn.log_target.copy(), drawn.weights > 0.0
        log_density[used] += self.coordinates.log_slope(drawn.vectors[used], drawn.z[used])
        return Draws(drawn.vectors[rows], log_density[rows])


def by_weights(
    ridges: Ridges,
    rng: np.random.Generator,
    *,
    seed: int | None,
    begin: float,
) -> Posterior:
    """Posterior from weighted draws alone.

    Raises
    ------
    FitError
        If they are not accepted.
    """
    ridges.seek()
    answer = ridges.draws()
    if answer is None:
        raise NotAcceptedError("weighted draws are not accepted: no ridge was found; take the sampler emcee")
    drawn, proposal = answer
    # Chance of its own: a chain that is made where these are declined is the same where it is taken up again.
    chance = deepcopy(ridges.for_draws)
    importance = judged(drawn, proposal, leak_of_walk(ridges.target, drawn, proposal, chance))
    ridges.count()
    if importance.refused:
        raise NotAcceptedError(
            f"weighted draws are not accepted: {importance.refused}; take the sampler emcee, which is exact "
            "where they are not"
        )
    draws = ridges.resampled(drawn, _CHAINS, chance)
    return assemble_posterior(
        ridges.problem,
        draws.coords,
        draws.log_density,
        _outcome(
            draws.coords,
            drawn,
            f"accepted: {importance.effective:.0f} effective draws of {importance.draws}, k-hat "
            f"is {importance.k_hat:.2f}",
        ),
        ridges.density,
        rng,
        Making(
            seed, time.perf_counter() - begin, method="importance", importance=importance, resampled=draws
        ),
    )


def _outcome(coords: FloatArray, drawn: WeightedDraws, reason: str) -> Outcome:
    """Weighted draws as a chain whose memory is what makes it worth as many draws as they are."""
    steps, chains, parameters = coords.shape
    times = np.full(parameters, max(1.0, steps * chains / drawn.effective))
    return Outcome(
        steps, chains, 0, times, times, np.full(parameters, np.nan), drawn.quantile_errors(), True, reason
    )


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
