"""Weighted draws of the mixture along a posterior's ridges: found for a chain, or an answer of their own."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError
from underlay.inference.problem import Problem
from underlay.inference.ridge.budget import Budget
from underlay.inference.ridge.coordinates import PriorNormal, Target
from underlay.inference.ridge.importance import judged, leak_of_walk, produced
from underlay.inference.ridge.learn import Proposal, learn
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.ridge.weights import WeightedDraws
from underlay.inference.sampling.assembly import Making, assemble_posterior
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.optima import optima
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.sampling.stopping import Outcome
from underlay.inference.sampling.walker_start import checked_start, prior_marks

__all__ = ["Ridges", "by_weights"]

# Processor seconds that walking and trying may take, and drawing: where a density costs milliseconds a chain of the
# old moves is not slower than what a mixture would save.
_TO_LEARN, _TO_DRAW = 10.0, 5.0
# What a quantile of weighted draws that stand alone may be off by, in standard deviations.
_ALONE_ERROR = 0.07
_CHAINS = 8


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
        self._for_pilots, self.for_draws = rng.spawn(2)

    @property
    def mixture(self) -> Mixture | None:
        """The frozen mixture; None where none was found."""
        return None if self.proposal is None else self.proposal.mixture

    def seek(self, start: Mapping[str, float] | None) -> FloatArray:
        """Lay the mixture from every optimum of the fit, or from `start` (SI); return the best fit, (k,), scaled.

        Raises
        ------
        InputError
            If the start is outside the priors.
        """
        found, places = optima(self.problem, start)
        if start is None:
            low, *_, high = prior_marks(self.problem)
            found = [np.clip(vector, low, high) for vector in found]
        checked_start(self.problem, self.density, found[0])
        starts = self.coordinates.normal(np.array(found + places))
        self.proposal = learn(
            self.target,
            list(starts[: len(found)]),
            self._for_pilots,
            Budget(_TO_LEARN),
            places=list(starts[len(found) :]),
            known=self._known,
        )
        self.count()
        return found[0]

    @property
    def _known(self) -> tuple[FloatArray, FloatArray] | None:
        """What the likelihood looks like, places (m, p) and factors (m, p, p) in z; None where unknown."""
        if self.problem.likelihood is None:
            return None
        return self.coordinates.factors(*self.problem.likelihood.about)

    def count(self) -> None:
        """Count what was asked of the density here since the last time among its evaluations."""
        self.density.continue_from(self.target.evaluations, 0)
        self.target.evaluations = 0

    def recall(self, numbers: FloatArray | None) -> None:
        """Take the mixture that an earlier run found, if it did."""
        if numbers is not None:
            self.proposal = Proposal.from_numbers(numbers)

    def draws(self, error: float | None = None) -> WeightedDraws | None:
        """Draw from the frozen mixture; None without one."""
        if self.proposal is None:
            return None
        budget = Budget(_TO_DRAW)
        if error is None:
            return produced(self.target, self.proposal, self.for_draws, budget)
        return produced(self.target, self.proposal, self.for_draws, budget, error=error)


def by_weights(
    ridges: Ridges,
    start: Mapping[str, float] | None,
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
    ridges.seek(start)
    drawn = ridges.draws(_ALONE_ERROR)
    if drawn is None or ridges.proposal is None:
        raise FitError("weighted draws are not accepted: no ridge was found; take the sampler emcee")
    leak = leak_of_walk(ridges.target, drawn, ridges.proposal, ridges.for_draws)
    importance = judged(drawn, ridges.proposal, leak)
    if importance.refused:
        raise FitError(
            f"weighted draws are not accepted: {importance.refused}; take the sampler emcee, which is exact "
            "where they are not"
        )
    ridges.count()
    count = _CHAINS * max(1, int(drawn.effective) // _CHAINS)
    rows = drawn.resampled(count, ridges.for_draws).reshape(-1, _CHAINS)
    coords = drawn.vectors[rows]
    return assemble_posterior(
        ridges.problem,
        coords,
        ridges.problem.log_posterior(coords),
        _outcome(
            coords,
            drawn,
            f"accepted: {importance.effective:.0f} effective draws of {importance.draws}, k-hat "
            f"is {importance.k_hat:.2f}",
        ),
        ridges.density,
        rng,
        Making(seed, time.perf_counter() - begin, method="importance", importance=importance),
    )


def _outcome(coords: FloatArray, drawn: WeightedDraws, reason: str) -> Outcome:
    """Weighted draws as a chain that remembers nothing: as many draws as they are worth."""
    steps, chains, parameters = coords.shape
    alone = np.ones(parameters)
    return Outcome(
        steps, chains, 0, alone, alone, np.full(parameters, np.nan), drawn.quantile_errors(), True, reason
    )
