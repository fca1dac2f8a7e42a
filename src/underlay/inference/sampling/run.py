"""The posterior of a problem by an ensemble of walkers (emcee).

What `sample` is asked for, checked before anything is computed.

How the walkers of an ensemble move.

Every move is invariant under linear maps, so a strong correlation costs nothing. Draws from a kernel estimate
of the other half follow a bent ridge: half the autocorrelation time of differences alone, a quarter of
stretches alone, on a modulus, thickness and contact point. Differences of walkers (ter Braak 2006,
doi:10.1007/s11222-006-8769-1) and stretches (Goodman and Weare 2010, doi:10.2140/camcos.2010.5.65) take over
where the estimate is poor; a full difference (gamma0 = 1) jumps between separate tops. emcee's snooker is
left out: up to version 3.1.6 it divides by the root of a length where the length belongs, and the variance it
yields is too small.

Where a mixture lies along the ridges of the posterior most proposals come from it, whatever the place of a walker:
on a layer with its base, 179 effective draws in 1000 evaluations against 1.2 with the others alone.

Foreman-Mackey, Hogg, Lang and Goodman (2013), doi:10.1086/670067. The walkers see scaled coordinates, so a
modulus moves in ratios; all walkers of a half-ensemble are evaluated in one call of the batched forward
model. A mixture is laid along the ridges of the posterior from every optimum of the fit and frozen
(`inference/ridge`): they start over-dispersed on it, inside the priors, and most moves propose from it. They go on
until the chain is longer than 50 autocorrelation times, of the tails too, the rank-normalised R-hat is below 1.01
and every quantile is known to 0.06 standard deviations, or the result says that it is not. Draws of the
mixture with their weights give the evidence, and a second opinion. Where chain and weights agree and these know the
quantiles better, which takes a tenth of the evaluations, the answer is drawn from them.
"""

from __future__ import annotations

import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.errors import InputError, UnderlayWarning
from underlay.inference.least_squares.fitting import determined
from underlay.inference.problem import Problem
from underlay.inference.ridge.march import FARTHEST, Budget, PriorNormal
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.sampling.assembly import Making, assemble_posterior
from underlay.inference.sampling.chain_file import ChainFile, Progress, RandomState
from underlay.inference.sampling.convergence import MIN_STEPS, Outcome, judge
from underlay.inference.sampling.counted import CountedDensity, marginalised
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.sampling.progress import SamplingProgress, Told
from underlay.inference.sampling.walker_start import start_walkers
from underlay.inference.sampling.weighted import NotAcceptedError, Ridges, by_weights, second_opinion, surer

__all__ = [
    "IndependenceMove",
    "KernelMove",
    "Tallied",
    "check_arguments",
    "is_weighted",
    "moves",
    "sample",
    "seeded",
]


def is_weighted(method: str | None, backend: str | os.PathLike[str] | None) -> bool:
    """Whether weighted draws alone are asked for."""
    if method not in (None, "emcee", "importance"):
        raise InputError(f"unknown method {method!r}; known: 'emcee', 'importance'")
    if method == "importance" and backend is not None:
        raise InputError("weighted draws are no chain and are not kept in a file: leave backend out")
    return method == "importance"


def check_arguments(
    problem: Problem, walkers: int, max_steps: int, backend: str | os.PathLike[str] | None, *, resume: bool
) -> None:
    """Refuse what cannot be sampled.

    Raises
    ------
    InputError
        If a prior is improper, there are too few walkers or steps, or nothing is there to resume.
    """
    improper = [name for name, prior in problem.priors.items() if not prior.proper]
    if improper:
        raise InputError(
            f"the prior of {', '.join(improper)} is improper and cannot be sampled: give finite bounds or a "
            "prior such as LogUniform(low, high) or Normal(mean, sd)"
        )
    # The moves take the covariance of one half of the walkers: p + 1 points span p dimensions, no fewer do.
    least = 2 * (len(problem.names) + 1)
    if walkers < least:
        raise InputError(
            f"{walkers} walkers are too few for {len(problem.names)} parameters: at least {least} are needed, "
            "and 64 serve well"
        )
    if max_steps < MIN_STEPS:
        raise InputError(f"max_steps must be at least {MIN_STEPS}; got {max_steps}")
    if resume and backend is None:
        raise InputError("resume=True needs backend, the file that holds the chain")


def seeded(rng: int | np.random.Generator) -> tuple[int | None, np.random.Generator]:
    """Seed, where one is given, and the generator."""
    if isinstance(rng, np.random.Generator):
        return None, rng
    try:
        return int(rng), np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        raise InputError(f"rng must be a seed (an integer, 0 or more) or a Generator; got {rng!r}") from error


# Share of the steps that propose from the mixture. With 0.6 a posterior takes a third longer (median of 27, in
# pairs): the other moves hardly forget where a walker was. But where a ridge goes on beyond the mixture they alone
# lead there.
_INDEPENDENT, _INDEPENDENT_OPEN = 0.8, 0.6


# Proposals of the mixture that a walker gets in a step.
_AT_ONCE = 3


def moves(
    independent: emcee.moves.Move | None = None, *, is_open: bool = False
) -> list[tuple[emcee.moves.Move, float]]:
    """Moves and how often each is made: most often the independent one, less often where its mixture is open."""
    share = 0.0 if independent is None else _INDEPENDENT_OPEN if is_open else _INDEPENDENT
    others = 1.0 - share
    walking = [
        (KernelMove(), 0.40 * others),
        (emcee.moves.DEMove(), 0.35 * others),
        (emcee.moves.DEMove(gamma0=1.0), 0.05 * others),
        (emcee.moves.StretchMove(), 0.20 * others),
    ]
    return walking if independent is None else [(independent, share), *walking]


class KernelMove(emcee.moves.RedBlueMove):  # type: ignore[misc]  # emcee ships no types
    """Independent draws from a Gaussian kernel estimate of the complementary ensemble.

    The kernel has the ensemble's covariance times n^(-2 / (p + 4)), Scott's rule. The same move as
    ``emcee.moves.KDEMove``, without threaded linear algebra on matrices of a dozen numbers, which on a busy
    machine waits a thousand times longer than it works.
    """

    def get_proposal(
        self, sample: FloatArray, complement: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Draw proposals (m, p) for `sample` (m, p), with log q(old) - log q(new), (m,)."""
        others = np.concatenate(complement)
        count, parameters = others.shape
        deviations = others - others.mean(axis=0)
        covariance = np.einsum("ni,nj->ij", deviations, deviations) / (count - 1)
        factor = np.linalg.cholesky(covariance) * count ** (-1.0 / (parameters + 4))
        shifts = np.einsum("mi,ji->mj", random.randn(len(sample), parameters), factor)
        proposals = others[random.randint(count, size=len(sample))] + shifts
        whiten = np.linalg.inv(factor)
        old_and_new = np.einsum("mi,ji->mj", np.concatenate([sample, proposals]), whiten)
        centres = np.einsum("mi,ji->mj", others, whiten)
        squares = np.square(old_and_new[:, None, :] - centres).sum(axis=-1)
        nearest = squares.min(axis=-1, keepdims=True)
        log_density = np.log(np.exp(0.5 * (nearest - squares)).sum(axis=-1)) - 0.5 * nearest[:, 0]
        return proposals, log_density[: len(sample)] - log_density[len(sample) :]


class IndependenceMove(emcee.moves.Move):  # type: ignore[misc]  # emcee ships no types
    """Independence sampler, several proposals a step: Tierney (1994), doi:10.1214/aos/1176325750.

    The mixture lives where the prior is a standard normal, cut where |z| is 7.5; in the walkers' coordinates its
    density is that times |dz/dq|. What is proposed does not depend on where a walker is: the densities of all that
    a step proposes are asked for together, which costs little more than those of one proposal each.

    Parameters
    ----------
    coordinates : PriorNormal
        The way between the two.
    mixture : Mixture
        Frozen: one that learns from the chain would bend it.
    density : callable
        Log-posterior (m,) of scaled vectors (m, p).
    """

    def __init__(
        self, coordinates: PriorNormal, mixture: Mixture, density: Callable[[FloatArray], FloatArray]
    ) -> None:
        self._coordinates, self._mixture, self._density = coordinates, mixture, density

    def log_proposal(self, vectors: FloatArray, z: FloatArray | None = None) -> FloatArray:
        """Log-density (m,) with which scaled vectors (m, p), at `z`, are proposed; -inf where they never are."""
        places = self._coordinates.normal(vectors) if z is None else z
        result = np.full(len(vectors), -np.inf)
        near = (np.abs(places) < FARTHEST).all(axis=1)
        slopes = self._coordinates.log_slope(vectors[near], places[near])
        result[near] = self._mixture.log_density(places[near]) + slopes
        return result

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Let every walker accept or decline its proposals one after another; whether it did, (proposals x m,)."""
        walkers = len(state.coords)
        z = self._mixture.draw(_AT_ONCE * walkers, model.random)
        near = (np.abs(z) < FARTHEST).all(axis=1)
        # What is cut away is proposed to nobody: such a walker stays, and its density is not asked for elsewhere.
        proposals = np.tile(state.coords, (_AT_ONCE, 1))
        proposals[near] = self._coordinates.scaled(z[near])
        # Log-weights: posterior over proposal, of which a walker takes the next with the ratio.
        log_posterior = self._density(proposals)
        proposed = self.log_proposal(proposals, z)
        possible = near & np.isfinite(proposed)
        fresh = np.where(possible, log_posterior - np.where(possible, proposed, 0.0), -np.inf)
        weight = state.log_prob - self.log_proposal(state.coords)
        chance = np.log(model.random.rand(_AT_ONCE, walkers))
        accepted = np.zeros((_AT_ONCE, walkers), dtype=bool)
        for turn, rows in enumerate(np.arange(_AT_ONCE * walkers).reshape(_AT_ONCE, walkers)):
            taken = accepted[turn] = chance[turn] < fresh[rows] - weight
            weight = np.where(taken, fresh[rows], weight)
            state.coords[taken] = proposals[rows[taken]]
            state.log_prob[taken] = log_posterior[rows[taken]]
        return state, accepted.ravel()


class Tallied:
    """A move of emcee's with a count of what became of its proposals.

    Parameters
    ----------
    move : emcee.moves.Move
        The move.
    """

    def __init__(self, move: Any) -> None:
        self.move = move
        self.name = type(move).__name__
        self.proposed = self.accepted = 0

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Make the move."""
        state, accepted = self.move.propose(model, state)
        self.proposed += len(accepted)
        self.accepted += int(np.sum(accepted))
        return state, accepted


_FIRST_CHECK = 100


# Checks get rarer as the chain grows, so that all of them together cost a few times the last one.
_GROWTH = 1.15


_TOLERATED_FAILURES = 0.01


# Most steps where no number is asked for, and the processor seconds that they may take: where no table reaches laws
# are solved one by one, and so many steps may take an hour.
_MOST_STEPS, _MOST_SECONDS = 20_000, 300.0


@one_thread()
def sample(
    problem: Problem,
    walkers: int = 64,
    max_steps: int | None = None,
    rng: int | np.random.Generator = 0,
    *,
    backend: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: bool | Told | None = None,
    method: str | None = None,
) -> Posterior:
    """Sample the posterior of a problem.

    Parameters
    ----------
    problem : Problem
        With a proper prior for every free parameter. Readings beside a jump that `fit` leaves out are left out.
        Where no noise is stated, noise and misfit are averaged over as in the intervals of `fit` (`marginalised`).
    walkers : int, default 64
        At least two more than twice as many as parameters: half of them span the space for the other half.
    max_steps : int, optional
        Most steps of the ensemble; it stops earlier when the chain has converged. By default 20,000, and no more
        than five minutes of processor time allow.
    rng : int or numpy Generator, default 0
        Seed, or a generator to draw one from. The same seed gives the same chain.
    backend : path, optional
        HDF5 file in which every step is kept as it is made (extra ``uq``). A process that is killed loses
        nothing of it.
    resume : bool, default False
        Continue the chain in `backend`, as if it had never stopped; begin it if there is no such file.
    progress : bool or callable, optional
        Show a progress line; by default only on a terminal. A function is called at every step with the steps done,
        those that will probably be needed and the effective samples so far; a KeyboardInterrupt that it raises ends
        the sampling as Ctrl-C does.
    method : {"emcee", "importance"}, optional
        ``"importance"`` gives the weighted draws of the mixture alone, resampled, where they are accepted: for
        quick looks and for maps. It makes no chain, so `walkers`, `max_steps` and `backend` do not matter to it.
        ``"emcee"`` gives the draws of a chain. By default both are made: where they agree, the draws are those
        that know the quantiles better (``diagnostics.weighted``), and the chain's where weights must be declined.
        But where noise is averaged over weighted draws alone are tried first, since such a posterior has a narrow
        core and wide wings, in which a chain takes minutes. A chain that lies in `backend` to be continued goes on.

    Returns
    -------
    Posterior
        Also when it did not converge or was interrupted: ``converged`` and ``diagnostics.reason`` say so.

    Raises
    ------
    InputError
        If a prior is improper, no contact law exists at the best fit, there are too few walkers or steps, the
        file exists and `resume` is not set, or it holds the chain of another problem.
    FitError
        If the walkers find no place inside the priors, or weighted draws alone were asked for and are not
        accepted: it says why.
    MissingExtraError
        If `backend` is given and h5py is not installed.

    Warns
    -----
    UnderlayWarning
        If it did not converge, or more than 1 % of the model evaluations failed.
    """
    require_given(problem, "problem", Problem)
    limit = Budget(np.inf if max_steps is not None else _MOST_SECONDS)
    max_steps = _MOST_STEPS if max_steps is None else max_steps
    check_arguments(problem, walkers, max_steps, backend, resume=resume)
    begin = time.perf_counter()
    problem = marginalised(determined(problem))
    seed, generator = seeded(rng)
    for_walkers, for_bands, for_mixture = generator.spawn(3)
    density = CountedDensity(problem)
    ridges = Ridges(problem, density, for_mixture)
    if is_weighted(method, backend):
        return by_weights(ridges, for_bands, seed=seed, begin=begin)
    begun = resume and backend is not None and Path(backend).exists()
    if method is None and problem.likelihood is not None and not begun:
        try:
            return by_weights(ridges, for_bands, seed=seed, begin=begin)
        except NotAcceptedError:
            # The chain is exact where they are not; what was learnt serves it.
            pass
    with _chain_file(problem, walkers, max_steps, backend, resume=resume) as (file, before):
        run = _Run.begin(problem, density, ridges, walkers, max_steps, for_walkers, file, before)
        known = method is None and ridges.know_quantiles
        with SamplingProgress(max_steps, shown=progress) as line:
            chain = run.go(line, limit, known=known)
            outcome, importance = second_opinion(ridges, run.coords, run.log_density, chain)
            if known and chain.converged and not (importance and importance.stands):
                # What was relied on is not believed: the chain has to know all by itself.
                chain = run.go(line, limit)
                outcome, importance = second_opinion(ridges, run.coords, run.log_density, chain)
    resampled = None
    if method is None and outcome.converged:
        outcome, resampled = surer(ridges, outcome, importance)
    made = Making(
        seed,
        time.perf_counter() - begin,
        {"emcee": emcee.__version__},
        moves=run.acceptance,
        importance=importance,
        resampled=resampled,
    )
    posterior = assemble_posterior(problem, run.coords, run.log_density, outcome, density, for_bands, made)
    _warn(posterior)
    return posterior


class _Run:
    """One ensemble on its way: the chain so far, (steps, walkers, parameters), and what moves it.

    Steps that a file kept are gone through and judged as new ones are: whatever was decided on the way is decided
    again, and a run that was stopped ends where it would have ended.
    """

    def __init__(
        self,
        sampler: emcee.EnsembleSampler,
        density: CountedDensity,
        state: emcee.State,
        max_steps: int,
        file: ChainFile | None,
        before: Progress | None,
        tallies: Sequence[Tallied],
    ) -> None:
        self._sampler, self._density, self._state, self._file = sampler, density, state, file
        self._tallies = tallies
        walkers, parameters = state.coords.shape
        self._coords = np.empty((max_steps, walkers, parameters))
        self._log_density = np.empty((max_steps, walkers))
        self.max_steps = max_steps
        self.steps = self._kept = 0
        if before is not None:
            self._kept = min(len(before.chain), max_steps)
            self._coords[: self._kept] = before.chain[: self._kept, :, :-1]
            self._log_density[: self._kept] = before.chain[: self._kept, :, -1]

    @classmethod
    def begin(
        cls,
        problem: Problem,
        density: CountedDensity,
        ridges: Ridges,
        walkers: int,
        max_steps: int,
        generator: np.random.Generator,
        file: ChainFile | None,
        before: Progress | None,
    ) -> _Run:
        """Place the walkers, or take them up where a file left them."""
        if before is not None and len(before.chain):
            last = before.chain[-1]
            density.continue_from(before.evaluations, before.failures)
            density.require_same(last[:, :-1], last[:, -1])
            ridges.recall(before.proposal)
            state = emcee.State(last[:, :-1], log_prob=last[:, -1], random_state=before.random_state)
        else:
            words = np.random.RandomState(generator.integers(2**32, size=8, dtype=np.uint32))
            best = ridges.seek()
            coords = start_walkers(problem, density, walkers, generator, best, ridges.mixture)
            state = emcee.State(coords, log_prob=density(coords), random_state=words.get_state())
            before = None
            if file is not None and ridges.proposal is not None:
                file.propose(ridges.proposal.numbers)
        mixture = ridges.mixture
        independent = None if mixture is None else IndependenceMove(ridges.coordinates, mixture, density)
        is_open = ridges.proposal is not None and bool(ridges.proposal.open_end)
        tallies = [(Tallied(move), weight) for move, weight in moves(independent, is_open=is_open)]
        sampler = emcee.EnsembleSampler(walkers, len(problem.names), density, moves=tallies, vectorize=True)
        return cls(sampler, density, state, max_steps, file, before, [tally for tally, _ in tallies])

    @property
    def acceptance(self) -> dict[str, float]:
        """Share of proposals accepted, by move."""
        made, taken = Counter[str](), Counter[str]()
        for tally in self._tallies:
            made[tally.name] += tally.proposed
            taken[tally.name] += tally.accepted
        return {name: taken[name] / count for name, count in made.items() if count}

    @property
    def coords(self) -> FloatArray:
        """Scaled coordinates so far, (steps, walkers, parameters)."""
        return self._coords[: self.steps]

    @property
    def log_density(self) -> FloatArray:
        """Log-posterior so far, (steps, walkers)."""
        return self._log_density[: self.steps]

    def go(self, line: SamplingProgress, limit: Budget, *, known: bool = False) -> Outcome:
        """Step until the chain has converged, the steps or the time are used up, or the user interrupts.

        It may know the quantiles less well where they are `known` otherwise.
        """
        next_check = _check_from(self.steps)
        if self.steps in (next_check, self.max_steps):
            outcome = judge(self.coords, self.max_steps, known=known)
            if self.steps == self.max_steps or outcome.converged:
                return outcome
            next_check = _check_from(self.steps + 1)
        try:
            for _ in self._onward():
                line.step(self.steps)
                if self.steps >= next_check:
                    outcome = judge(self.coords, self.max_steps, known=known)
                    line.judge(outcome.effective, min(outcome.probable_length, self.max_steps))
                    if outcome.converged:
                        return outcome
                    if not limit.left:
                        return self._cut(
                            f"not converged: stopped, {_MOST_SECONDS:.0f} s of processor time being used up,"
                        )
                    next_check = _check_from(self.steps + 1)
        except KeyboardInterrupt:
            if self.steps < MIN_STEPS:
                raise
            return self._cut("interrupted")
        return judge(self.coords, self.max_steps, known=known)

    def _onward(self) -> Iterator[None]:
        """Go through the steps that were kept, then make new ones, to the most."""
        while self.steps < self._kept:
            self.steps += 1
            yield
        for state in self._sampler.sample(
            self._state,
            iterations=self.max_steps - self.steps,
            store=False,
            skip_initial_state_check=True,
        ):
            self._keep(state)
            yield

    def _cut(self, why: str) -> Outcome:
        """What there is of a chain that was cut short."""
        return judge(self.coords, self.steps)._replace(
            converged=False, reason=f"{why} after {self.steps} steps"
        )

    def _keep(self, state: emcee.State) -> None:
        if self._file is not None:
            random_state: RandomState = self._sampler.random_state
            counts = (self._density.evaluations, self._density.failures)
            self._file.append(state.coords, state.log_prob, random_state, counts)
        self._state = state
        self._coords[self.steps] = state.coords
        self._log_density[self.steps] = state.log_prob
        self.steps += 1


def _check_from(steps: int) -> int:
    """First number of steps, `steps` or more, at which a chain is judged: the same however often it was stopped."""
    check = _FIRST_CHECK
    while check < steps:
        check = int(np.ceil(check * _GROWTH))
    return check


@contextmanager
def _chain_file(
    problem: Problem, walkers: int, max_steps: int, backend: str | os.PathLike[str] | None, *, resume: bool
) -> Iterator[tuple[ChainFile | None, Progress | None]]:
    if backend is None:
        yield None, None
    elif resume and Path(backend).exists():
        with ChainFile.resume(backend, problem.names, (max_steps, walkers)) as (file, before):
            yield file, before
    else:
        with ChainFile.create(backend, problem.names, (max_steps, walkers)) as file:
            yield file, None


def _warn(posterior: Posterior) -> None:
    details = posterior.diagnostics
    if not details.converged:
        warnings.warn(
            f"{details.reason}; intervals may be wrong: take more steps", UnderlayWarning, stacklevel=3
        )
    if details.failures > _TOLERATED_FAILURES * details.evaluations:
        region = "; ".join(
            f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in details.failure_region.items()
        )
        warnings.warn(
            f"{details.failures} of {details.evaluations} model evaluations failed and count as impossible, "
            f"which cuts the posterior there (SI): {region}; narrow the priors or use another contact law",
            UnderlayWarning,
            stacklevel=3,
        )
