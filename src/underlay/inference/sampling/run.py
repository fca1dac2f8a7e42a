"""The posterior of a problem: weighted draws, and an ensemble of walkers (emcee).

A fit, its likelihood (`inference/uncertainty`) and weighted draws of that: they are the posterior once a short
chain that was begun from them agrees. Where they are refused, or a chain is asked for, walkers go on until the
chain is longer than 50 autocorrelation times, R-hat is below 1.01 and every quantile is known to 0.06 standard
deviations, or the result says that it is not. Both ask one density, `Likelihood.log_density`, in scaled
coordinates, so that a modulus moves in ratios; all walkers are evaluated in one call of the batched forward model.

Moves are emcee's own (Foreman-Mackey, Hogg, Lang and Goodman 2013, doi:10.1086/670067): proposals from what the
draws came from and from Student kernels about them (Raftery and Bao 2010, doi:10.1111/j.1541-0420.2010.01399.x),
whatever the place of a walker (Tierney 1994, doi:10.1214/aos/1176325750); from a kernel estimate of the other half, which follows a bent ridge; differences of
walkers (ter Braak 2006, doi:10.1007/s11222-006-8769-1), and a full difference (gamma0 = 1) that jumps between
separate tops. The snooker is left out: up to version 3.1.6 it divides by the root of a length where the length
belongs, and the variance it yields is too small.
"""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeAlias, cast

import emcee
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from scipy.special import gammaln, logsumexp

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.errors import FitError, InputError, UnderlayError, UnderlayWarning
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit
from underlay.inference.least_squares.provenance import provenance
from underlay.inference.model.laws import quiet_law
from underlay.inference.problem import Problem
from underlay.inference.sampling import chain_file
from underlay.inference.sampling.chain_file import ChainFile
from underlay.inference.sampling.derived import derived_quantities
from underlay.inference.sampling.diagnostics import (
    LEVELS,
    MIN_STEPS,
    Importance,
    Outcome,
    SamplingDiagnostics,
    chain_errors,
    judge,
    memory,
    predictive_bands,
    prior_levels,
    quantile_errors,
)
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.uncertainty.adapt import Kernels
from underlay.inference.uncertainty.likelihood import Likelihood
from underlay.inference.uncertainty.linear import Mixture
from underlay.inference.uncertainty.mixture import pareto_shape, weighted_quantiles
from underlay.inference.uncertainty.reading import DrawnReading, LinearReading, Reading

__all__ = ["marginalised", "moves", "posterior_from_chain", "sample"]

#: Told the steps that are done, those that will probably be needed, and the effective samples so far.
Told: TypeAlias = Callable[[int, int, float], None]

# Weighted draws: of so many four fifths count, and an end of a 95 % interval is known to 0.05 standard deviations.
_DRAWS = 4000
# Weights with a heavier tail, or worth fewer draws, are refused: the reading's own rule (`uncertainty/ridge`).
# Where the closed form was drawn from, up to so many rounds from kernels about the draws follow: one did in 43 of
# 47 cases.
_LARGEST_PARETO, _FEWEST, _EVEN, _ROUNDS = 0.7, 300.0, 0.99, 4
# Quantiles that differ by so many of their joint standard errors, and by so many standard deviations of the
# posterior beyond what the two are asked for, are not one.
_SIGMAS, _SLACK = 4.0, 0.05
# Steps of the chain that judges; when a chain is judged first, and how much rarer each time: checks get rarer as
# the chain grows, so that all of them together cost a few times the last one.
_FIRST_CHECK, _GROWTH = 100, 1.15
# Most steps where no number is asked for, and the processor seconds that they may take: where no table reaches laws
# are solved one by one, and so many steps may take an hour.
_MOST_STEPS, _MOST_SECONDS = 20_000, 300.0
# Sets that are asked for together: of more, what is in between does not stay in the processor's near memory.
_TOGETHER = 256
# The same density in another batch repeats to rounding times the condition of the contact problem, far below
# a thousandth of a log unit; another problem differs by log units.
_SAME_DENSITY = 1e-3
_TOLERATED_FAILURES = 0.01
# Resampled draws of each weighted one (the tail's light draws count by their own weight: an error of 0.01 standard
# deviations is left), and the columns they are put in.
_TIMES, _COLUMNS = 4, 8
# A quarter of the shortest autocorrelation time between kept draws costs about 1 % of the effective size.
_KEPT_PER_TIME = 4.0
_PRIOR_LEVELS, _DERIVED_DRAWS, _PREDICTIVE_DRAWS = 1001, 4096, 500


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
        Where no noise is stated the likelihood is that of the intervals of `fit`.
    walkers : int, default 64
        At least two more than twice as many as parameters: half of them span the space for the other half.
    max_steps : int, optional
        Most steps of the ensemble; it stops earlier when the chain has converged. By default 20,000, and no more
        than five minutes of processor time allow.
    rng : int or numpy Generator, default 0
        Seed, or a generator to draw one from. The same seed gives the same posterior.
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
        By default weighted draws, resampled, which a short chain begun from them judges; where the two differ by
        more than their errors, or the weights are refused, the chain goes on and is the posterior.
        ``"importance"`` gives the weighted draws alone: it makes no chain, so `walkers`, `max_steps` and `backend`
        do not matter to it. ``"emcee"`` gives the draws of the long chain.

    Returns
    -------
    Posterior
        Also when it did not converge or was interrupted: ``converged`` and ``diagnostics.reason`` say so.

    Raises
    ------
    InputError
        If a prior is improper, there are too few walkers or steps, the file exists and `resume` is not set, or it
        holds the chain of another problem.
    FitError
        If nothing can be fitted, or weighted draws alone were asked for and are refused: it says why.
    MissingExtraError
        If `backend` is given and h5py is not installed.

    Warns
    -----
    UnderlayWarning
        If it did not converge, or more than 1 % of the model evaluations failed.
    """
    require_given(problem, "problem", Problem)
    limit = math.inf if max_steps is not None else time.process_time() + _MOST_SECONDS
    max_steps = _MOST_STEPS if max_steps is None else max_steps
    _check(problem, walkers, max_steps, method, backend, resume=resume)
    began = time.perf_counter()
    seed, generator = _seeded(rng)
    for_draws, for_walkers, for_bands = generator.spawn(3)
    found = fit(problem)
    density = _Density.of(found)
    drawn = _weigh(density, for_draws)
    if method == "importance":
        if drawn.refused:
            raise FitError(f"weighted draws are refused: {drawn.refused}; take the sampler emcee")
        answer = _Answer.of_weights(drawn, for_draws, None, "")
    else:
        names = found.problem.names
        with (
            _chain_file(names, walkers, max_steps, backend, resume=resume) as (file, before),
            _Line(max_steps, shown=progress) as line,
        ):
            run = _Run.begin(density, drawn, walkers, max_steps, for_walkers, file, before)
            answer = _judged(run, drawn, line, limit, for_draws, names, by_weights=method is None)
    posterior = _assemble(density, answer, for_bands, seed, time.perf_counter() - began)
    _warn(posterior)
    return posterior


def _judged(
    run: _Run,
    drawn: _Weighted,
    line: _Line,
    limit: float,
    rng: np.random.Generator,
    names: tuple[str, ...],
    *,
    by_weights: bool,
) -> _Answer:
    """Weighted draws if a short chain agrees with them, and are asked for; else the long chain."""
    if by_weights and not drawn.refused:
        run.go(line, limit, most=_FIRST_CHECK)
        told = _differs(names, drawn, run.coords)
        if not told:
            return _Answer.of_weights(drawn, rng, run, "")
    outcome = run.go(line, limit)
    told = "" if drawn.refused else _differs(names, drawn, run.coords)
    if by_weights and not (drawn.refused or told):
        return _Answer.of_weights(drawn, rng, run, "")
    return _Answer.of_chain(run, outcome, drawn, told)


def _check(
    problem: Problem,
    walkers: int,
    max_steps: int,
    method: str | None,
    backend: str | os.PathLike[str] | None,
    *,
    resume: bool,
) -> None:
    """Refuse what cannot be sampled."""
    if method not in (None, "emcee", "importance"):
        raise InputError(f"unknown method {method!r}; known: 'emcee', 'importance'")
    if method == "importance" and backend is not None:
        raise InputError("weighted draws are no chain and are not kept in a file: leave backend out")
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


def _seeded(rng: int | np.random.Generator) -> tuple[int | None, np.random.Generator]:
    """Seed, where one is given, and the generator."""
    if isinstance(rng, np.random.Generator):
        return None, rng
    try:
        return int(rng), np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        raise InputError(f"rng must be a seed (an integer, 0 or more) or a Generator; got {rng!r}") from error


# --- the density ------------------------------------------------------------------------------------------


class _Density:
    """Callable (m, p) -> (m,) that gives -inf for a failed evaluation and remembers it.

    An evaluation fails when the prior allows the parameters and the model has no finite likelihood there, or
    raises one of the project's errors or an arithmetic one.
    """

    def __init__(self, found: Fit, likelihood: Likelihood) -> None:
        self.fit, self.problem, self.likelihood = found, found.problem, likelihood
        self.evaluations = self.failures = 0
        self._low, self._high = np.full((2, len(found.names)), np.array([[np.inf], [-np.inf]]))

    @classmethod
    def of(cls, found: Fit) -> Self:
        """That of a fit's likelihood."""
        return cls(found, cast(Any, found.statement).likelihood)

    def __call__(self, vectors: FloatArray) -> FloatArray:
        """Log-posterior (m,) at scaled vectors (m, p)."""
        values = self.peek(vectors)
        self.evaluations += len(vectors)
        impossible = np.isneginf(values)
        if impossible.any():
            failed = vectors[impossible][np.isfinite(self.problem.log_prior(vectors[impossible]))]
            self.failures += len(failed)
            self._low = np.minimum(self._low, failed.min(axis=0, initial=np.inf))
            self._high = np.maximum(self._high, failed.max(axis=0, initial=-np.inf))
        return values

    def peek(self, vectors: FloatArray) -> FloatArray:
        """Return the same without counting."""
        if len(vectors) > _TOGETHER:
            parts = np.array_split(vectors, -(-len(vectors) // _TOGETHER))
            return np.concatenate([self.peek(part) for part in parts])
        try:
            values = self.likelihood.log_density(vectors)
        except (UnderlayError, ArithmeticError, np.linalg.LinAlgError):
            # One of them broke the batch: find out which.
            if len(vectors) == 1:
                return np.array([-np.inf])
            return np.concatenate([self.peek(vector[None]) for vector in vectors])
        return np.where(np.isfinite(values), values, -np.inf)

    def require_same(self, vectors: FloatArray, before: FloatArray) -> None:
        """Refuse a chain whose log-posterior `before` (m,) at `vectors` (m, p) is not that of this problem."""
        now = self.peek(vectors)
        if not np.allclose(now, before, rtol=1e-6, atol=_SAME_DENSITY):
            worst = int(np.argmax(np.abs(now - before)))
            raise InputError(
                "the file holds the chain of another problem: the log-posterior of its last step is "
                f"{before[worst]:.6g} there and {now[worst]:.6g} here; did the curve, a prior, the noise or "
                "the contact law change?"
            )

    @property
    def failure_region(self) -> dict[str, tuple[float, float]]:
        """Range (SI) of each parameter over the failures of this run; empty where there are none."""
        if not (self._low <= self._high).all():
            return {}
        low, high = self.problem.physical(self._low), self.problem.physical(self._high)
        return {name: (float(a), float(b)) for name, a, b in zip(self.problem.names, low, high, strict=True)}


# --- weighted draws ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Weighted:
    """Weighted draws of a posterior: scaled vectors (n, p), log-density and weights (n,)."""

    source: _Source
    vectors: FloatArray
    log_density: FloatArray
    weights: FloatArray
    pareto: float
    log_evidence: float

    @classmethod
    def of(
        cls, source: _Source, vectors: FloatArray, log_density: FloatArray, log_weights: FloatArray
    ) -> Self:
        """Draws of one distribution, with the logarithms of density over proposal, (n,)."""
        total = float(logsumexp(log_weights))
        weights = np.exp(log_weights - total)
        # Where the closed form is the density all weights are alike, and what rounding leaves of them has no tail.
        even = 1.0 / float(weights @ weights) > _EVEN * len(weights)
        pareto = 0.0 if even and np.ptp(log_weights) < 1.0 else pareto_shape(log_weights)
        return cls(source, vectors, log_density, weights, pareto, total - math.log(len(vectors)))

    @property
    def effective(self) -> float:
        """Kish's effective sample size."""
        return 1.0 / float(self.weights @ self.weights)

    @property
    def refused(self) -> str:
        """Why the weights are not believed; empty where they are."""
        if not self.pareto < _LARGEST_PARETO:
            return f"the Pareto k of their weights is {self.pareto:.2f}, where {_LARGEST_PARETO} may be"
        few = self.effective < _FEWEST
        return f"{len(self.weights)} draws are worth {self.effective:.0f}, too few" if few else ""

    @property
    def quantiles(self) -> FloatArray:
        """Quantiles (3, p) at `LEVELS`."""
        return np.array([weighted_quantiles(x, self.weights, np.array(LEVELS)) for x in self.vectors.T]).T

    @property
    def quantile_errors(self) -> FloatArray:
        """Their Monte Carlo errors (3, p), in standard deviations."""
        below = self.vectors <= self.quantiles[:, None]
        off = self.weights[None, :, None] * (below - np.array(LEVELS)[:, None, None])
        return quantile_errors(self.vectors, self.weights, np.sqrt(np.square(off).sum(axis=1)))

    def record(self, disagreement: str, *, is_open: bool) -> Importance:
        """What they say, for the record; of noise that nobody stated without an evidence."""
        error = math.sqrt(max(1.0 / self.effective - 1.0 / len(self.weights), 0.0))
        return Importance(
            draws=len(self.weights),
            effective=self.effective,
            k_hat=self.pareto,
            log_evidence=None if is_open else self.log_evidence,
            log_evidence_error=None if is_open else error,
            quantile_error=float(np.nanmax(self.quantile_errors)),
            refused=self.refused,
            disagreement=disagreement,
        )

    def rows(self, count: int, rng: np.random.Generator) -> np.ndarray[Any, Any]:
        """Numbers (count,) of draws by their weights: systematic, then in an order of chance."""
        places = (np.arange(count) + rng.random()) / count
        found = np.minimum(np.searchsorted(np.cumsum(self.weights), places), len(self.weights) - 1)
        return rng.permutation(found)


@dataclass(frozen=True, eq=False)
class _Source:
    """What a reading draws from; entries that act on no curve (`silent`) are drawn from their priors."""

    reading: Reading
    problem: Problem
    silent: np.ndarray[Any, Any]

    @classmethod
    def of(cls, reading: Reading) -> Self:
        """That of a reading."""
        problem, silent = reading.likelihood.fit.problem, ~reading.likelihood.determined
        silent[sorted(problem.noise_entries)] = False
        return cls(reading, problem, np.flatnonzero(silent))

    def draw(self, count: int, rng: Any) -> FloatArray:
        """Vectors (count, p)."""
        own = self.reading
        if isinstance(own, DrawnReading):
            return self.filled(own.ridge.source.draw(count, rng), rng)
        return self.filled(cast(LinearReading, own).mixture.draws(count, rng), rng)

    def filled(self, vectors: FloatArray, rng: Any) -> FloatArray:
        """Vectors (n, p) with what acts on no curve drawn from its prior."""
        filled = vectors.copy()
        for i in self.silent:
            c = self.problem.coordinates[i]
            values = c.prior.truncated(c.low, c.high).quantile(rng.uniform(size=len(vectors)))
            filled[:, i] = [c.scaled(float(x)) for x in values]
        return filled

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) of vectors (n, p)."""
        own = self.reading
        if isinstance(own, DrawnReading):
            return own.ridge.source.log_density(vectors) + self.log_prior(vectors)
        return _log_density(cast(LinearReading, own).mixture, vectors) + self.log_prior(vectors)

    def log_prior(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) before the test of what acts on no curve."""
        found = np.zeros(len(vectors))
        for i in self.silent:
            found += self.problem.coordinates[i].log_prior(vectors[:, i])
        return found


def _weigh(density: _Density, rng: np.random.Generator) -> _Weighted:
    """Draw along the likelihood's reading, and weigh by the density itself.

    Raises
    ------
    FitError
        If there is nothing to draw along.
    """
    try:
        reading = density.likelihood.read(rng, _DRAWS)
        source = _Source.of(reading)
        vectors = source.filled(reading.draws, rng)
    except RuntimeError as error:
        raise FitError(f"nothing can be drawn: {error}") from error
    if isinstance(reading, DrawnReading):
        ridge = reading.ridge
        density.evaluations += len(vectors)
        density.failures += ridge.failed
        levels = density.peek(vectors) if len(source.silent) else ridge.log_density
        evidence = ridge.log_evidence - float(source.log_prior(density.fit.vector[None])[0])
        return _Weighted(source, vectors, levels, ridge.weights, ridge.pareto, evidence)
    levels = density(vectors)
    drawn = _Weighted.of(source, vectors, levels, levels - source.log_density(vectors))
    for _ in range(_ROUNDS):
        if not drawn.refused:
            break
        proposal = _Proposal.of(drawn, rng)
        vectors = proposal.draw(_DRAWS, rng)
        levels = density(vectors)
        drawn = _Weighted.of(source, vectors, levels, levels - proposal.log_density(vectors))
    return drawn


def _log_density(mixture: Mixture, vectors: FloatArray) -> FloatArray:
    """Log-density (n,) of a mixture at vectors (n, p), in the entries that scatter."""
    free = np.flatnonzero(mixture.deviations > 0.0)
    freedom, q = mixture.freedom, len(free)
    roots = np.linalg.cholesky(mixture.covariances[:, free[:, None], free])
    off = vectors[:, None, free] - mixture.means[:, free]
    z = np.linalg.solve(roots, off[..., None])[..., 0]
    constant = gammaln(0.5 * (freedom + q)) - gammaln(0.5 * freedom) - 0.5 * q * np.log(freedom * np.pi)
    told = constant - np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    told = told - 0.5 * (freedom + q) * np.log1p(np.square(z).sum(axis=2) / freedom)
    return np.asarray(logsumexp(told, axis=1, b=mixture.weights))


def _differs(names: tuple[str, ...], drawn: _Weighted, coords: FloatArray) -> str:
    """Quantiles of a chain (steps, walkers, p) and of weighted draws that differ beyond their errors, in words."""
    kept = coords[memory(coords)[0] :]
    flat = kept.reshape(-1, kept.shape[-1])
    deviations = np.sqrt(drawn.weights @ np.square(drawn.vectors - drawn.weights @ drawn.vectors))
    off = (np.quantile(flat, LEVELS, axis=0) - drawn.quantiles) / deviations
    error = np.hypot(chain_errors(kept), drawn.quantile_errors)
    return ", ".join(
        f"the {100.0 * LEVELS[level]:g} % quantile of {names[i]} by {off[level, i]:+.2f} standard deviations"
        for level, i in np.argwhere(~(np.abs(off) <= _SIGMAS * error + _SLACK))
    )


# --- the chain --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Proposal:
    """Half from what the draws came from, half from Student kernels about them."""

    source: _Source
    kernels: Kernels

    @classmethod
    def of(cls, drawn: _Weighted, rng: np.random.Generator) -> Self:
        """Kernels about weighted draws."""
        with np.errstate(divide="ignore"):  # a draw without weight is no place for a kernel
            log_weights = np.log(drawn.weights)
        entries = np.arange(drawn.vectors.shape[1])
        return cls(drawn.source, Kernels.about(drawn.vectors, log_weights, entries, rng))

    def __call__(self, places: FloatArray, random: Any) -> tuple[FloatArray, FloatArray]:
        """Proposals (m, p), and log q(old) - log q(new), (m,), for walkers at `places` (m, p)."""
        proposed = self.draw(len(places), random)
        return proposed, self.log_density(places) - self.log_density(proposed)

    def draw(self, count: int, rng: Any) -> FloatArray:
        """Vectors (count, p)."""
        # In an order of chance: draws are stratified, and a walker's are of the whole mixture, not of one stratum.
        own = rng.permutation(self.source.draw(count, rng))
        whole = len(self.kernels.centres) * -(-count // len(self.kernels.centres))
        near = rng.permutation(self.kernels.draw(whole, own[0], rng))[:count]
        return np.asarray(np.where(rng.uniform(size=(count, 1)) < 0.5, own, near))

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) of vectors (n, p)."""
        both = self.source.log_density(vectors), self.kernels.log_density(vectors)
        return np.asarray(np.logaddexp(*both) - np.log(2.0))


def moves(proposal: Callable[[FloatArray, Any], tuple[FloatArray, FloatArray]]) -> list[tuple[Any, float]]:
    """Moves of an ensemble and how often each is made.

    `proposal` gives places (m, p) whatever those of the walkers (m, p), and log q(old) - log q(new), (m,).
    """
    return [
        (emcee.moves.MHMove(proposal), 0.50),
        (emcee.moves.KDEMove(), 0.25),
        (emcee.moves.DEMove(), 0.20),
        (emcee.moves.DEMove(gamma0=1.0), 0.05),
    ]


class _Run:
    """One ensemble on its way: the chain so far, (steps, walkers, parameters), and what moves it.

    Steps that a file kept are gone through and judged as new ones are: whatever was decided on the way is decided
    again, and a run that was stopped ends where it would have ended.
    """

    def __init__(
        self,
        sampler: emcee.EnsembleSampler,
        density: _Density,
        state: emcee.State,
        max_steps: int,
        file: ChainFile | None,
        before: FloatArray,
    ) -> None:
        self._sampler, self._density, self._state, self._file = sampler, density, state, file
        self._coords = np.empty((max_steps, *state.coords.shape))
        self._log_density = np.empty((max_steps, len(state.coords)))
        self.max_steps = max_steps
        self.steps, self._kept = 0, min(len(before), max_steps)
        self._coords[: self._kept] = before[: self._kept, :, :-1]
        self._log_density[: self._kept] = before[: self._kept, :, -1]

    @classmethod
    def begin(
        cls,
        density: _Density,
        drawn: _Weighted,
        walkers: int,
        max_steps: int,
        rng: np.random.Generator,
        file: ChainFile | None,
        before: chain_file.Progress | None,
    ) -> _Run:
        """Place the walkers by the draws, or take them up where a file left them."""
        parameters = drawn.vectors.shape[1]
        kept = np.empty((0, walkers, parameters + 1)) if before is None else before.chain
        words = np.random.RandomState(rng.integers(2**32, size=8, dtype=np.uint32))
        proposal = _Proposal.of(drawn, rng)
        if before is not None and len(kept):
            last = kept[-1]
            density.evaluations, density.failures = before.evaluations, before.failures
            density.require_same(last[:, :-1], last[:, -1])
            state = emcee.State(last[:, :-1], log_prob=last[:, -1], random_state=before.random_state)
        else:
            coords, log_density = _placed(density, drawn, proposal, walkers, rng)
            state = emcee.State(coords, log_prob=log_density, random_state=words.get_state())
        sampler = emcee.EnsembleSampler(walkers, parameters, density, moves=moves(proposal), vectorize=True)
        return cls(sampler, density, state, max_steps, file, kept)

    @property
    def coords(self) -> FloatArray:
        """Scaled coordinates so far, (steps, walkers, parameters)."""
        return self._coords[: self.steps]

    @property
    def log_density(self) -> FloatArray:
        """Log-posterior so far, (steps, walkers)."""
        return self._log_density[: self.steps]

    def go(self, line: _Line, limit: float, *, most: int | None = None) -> Outcome:
        """Step until `most` are done; without it until the chain has converged, or steps or time are used up.

        An interrupt of the user's ends it, too.
        """
        most = self.max_steps if most is None else min(most, self.max_steps)
        next_check = _check_from(max(self.steps, 1))
        try:
            if self.steps == next_check and (outcome := judge(self.coords, most)).converged:
                return outcome
            for _ in self._onward(most):
                line.step(self.steps)
                if self.steps < next_check or self.steps >= most:
                    continue
                outcome = judge(self.coords, most)
                line.judge(float(outcome.effective.min()), min(outcome.probable_length, self.max_steps))
                if outcome.converged:
                    return outcome
                if time.process_time() > limit:
                    return self._cut(
                        f"not converged: stopped, {_MOST_SECONDS:.0f} s of processor time being used up,"
                    )
                next_check = _check_from(self.steps + 1)
        except KeyboardInterrupt:
            if self.steps < MIN_STEPS:
                raise
            return self._cut("interrupted")
        return judge(self.coords, self.steps)

    def _onward(self, most: int) -> Iterator[None]:
        """Go through the steps that were kept, then make new ones, to the most."""
        while self.steps < min(self._kept, most):
            self.steps += 1
            yield
        count = most - self.steps
        for state in self._sampler.sample(
            self._state, iterations=count, store=False, skip_initial_state_check=True
        ):
            self._keep(state)
            yield

    def _cut(self, why: str) -> Outcome:
        """What there is of a chain that was cut short."""
        reason = f"{why} after {self.steps} steps"
        return judge(self.coords, self.steps)._replace(converged=False, reason=reason)

    def _keep(self, state: emcee.State) -> None:
        if self._file is not None:
            counts = (self._density.evaluations, self._density.failures)
            self._file.append(state.coords, state.log_prob, self._sampler.random_state, counts)
        self._state = state
        self._coords[self.steps] = state.coords
        self._log_density[self.steps] = state.log_prob
        self.steps += 1


def _placed(
    density: _Density, drawn: _Weighted, proposal: _Proposal, walkers: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Walkers (walkers, p) by the draws' weights, or of the proposal where these are refused; their density."""
    coords = (
        np.empty((0, drawn.vectors.shape[1])) if drawn.refused else drawn.vectors[drawn.rows(walkers, rng)]
    )
    levels = density(coords) if len(coords) else np.empty(0)
    while len(coords) < walkers:
        more = proposal.draw(walkers, rng)
        told = density(more)
        coords, levels = (
            np.vstack((coords, more[np.isfinite(told)])),
            np.append(levels, told[np.isfinite(told)]),
        )
    return coords[:walkers], levels[:walkers]


def _check_from(steps: int) -> int:
    """First number of steps, `steps` or more, at which a chain is judged: the same however often it was stopped."""
    check = _FIRST_CHECK
    while check < steps:
        check = int(np.ceil(check * _GROWTH))
    return check


@contextmanager
def _chain_file(
    names: tuple[str, ...],
    walkers: int,
    max_steps: int,
    backend: str | os.PathLike[str] | None,
    *,
    resume: bool,
) -> Iterator[tuple[ChainFile | None, chain_file.Progress | None]]:
    if backend is None:
        yield None, None
    elif resume and Path(backend).exists():
        with ChainFile.resume(backend, names, (max_steps, walkers)) as (file, before):
            yield file, before
    else:
        with ChainFile.create(backend, names, (max_steps, walkers)) as file:
            yield file, None


class _Line:
    """Steps done, effective samples so far and time left, on the terminal; silent when nobody looks.

    None shows the line if standard error is a terminal; a function is told instead.
    """

    def __init__(self, total: int, *, shown: bool | Told | None) -> None:
        self._told: Told | None = None if isinstance(shown, bool) else shown
        self._total, self._effective = total, 0.0
        console = Console(stderr=True, force_terminal=(shown is True) or None)
        self._bar = Progress(
            TextColumn("sampling"),
            BarColumn(),
            TextColumn("{task.completed} of about {task.total} steps"),
            TextColumn("{task.fields[worth]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not (console.is_terminal if shown is None else shown is True),
            refresh_per_second=4,
        )
        self._task = self._bar.add_task("sampling", total=total, worth="")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Stopping prints a line even where nothing was shown, in versions of rich up to 14.
        if not self._bar.disable:
            self._bar.stop()

    def step(self, done: int) -> None:
        """Tell that `done` steps are done."""
        self._bar.update(self._task, completed=done)
        if self._told is not None:
            self._told(done, self._total, self._effective)

    def judge(self, effective: float, needed: int) -> None:
        """Tell the effective samples so far and how many steps will probably be needed."""
        self._total, self._effective = needed, effective
        self._bar.update(self._task, total=needed, worth=f"{effective:.0f} effective samples")


# --- the posterior ----------------------------------------------------------------------------------------


class _Answer(NamedTuple):
    """Draws (n, columns, p), scaled, and log-density (n, columns), with what is recorded of them."""

    coords: FloatArray
    log_density: FloatArray
    effective: FloatArray
    outcome: Outcome
    acceptance: float
    thin: int
    drawn: _Weighted | None
    disagreement: str
    weighted: bool
    is_chain: bool

    @classmethod
    def of_weights(
        cls, drawn: _Weighted, rng: np.random.Generator, run: _Run | None, disagreement: str
    ) -> _Answer:
        """Weighted draws, resampled, and the chain that judged them, if one was made."""
        count = -(-_TIMES * len(drawn.weights) // _COLUMNS) * _COLUMNS
        rows = drawn.rows(count, rng).reshape(-1, _COLUMNS)
        p = drawn.vectors.shape[1]
        worth = (
            f"{len(drawn.weights)} weighted draws, worth {drawn.effective:.0f}, with a Pareto k of "
            f"{drawn.pareto:.2f}"
        )
        if run is None:
            none = np.full(p, np.nan)
            outcome = Outcome(len(rows), _COLUMNS, 0, none, none, drawn.quantile_errors, True, worth)
            acceptance = drawn.effective / len(drawn.weights)
        else:
            burn_in, times = memory(run.coords)
            reason = f"{worth}; a chain of {run.steps} steps begun from them agrees within the errors of both"
            walkers = run.coords.shape[1]
            none = np.full(p, np.nan)
            outcome = Outcome(run.steps, walkers, burn_in, times, none, drawn.quantile_errors, True, reason)
            acceptance = _moved(run.coords[burn_in:])
        effective = np.full(p, drawn.effective)
        coords, levels = drawn.vectors[rows], drawn.log_density[rows]
        is_chain = run is not None
        return cls(coords, levels, effective, outcome, acceptance, 1, drawn, disagreement, True, is_chain)

    @classmethod
    def of_chain(
        cls,
        run: _Run | _Made,
        outcome: Outcome,
        drawn: _Weighted | None,
        disagreement: str,
    ) -> _Answer:
        """A chain after burn-in, thinned."""
        fastest = float(np.min(outcome.times))
        thin = max(1, int(fastest / _KEPT_PER_TIME)) if np.isfinite(fastest) else 1
        thin = min(thin, max(1, (outcome.steps - outcome.burn_in) // MIN_STEPS))
        kept = slice(outcome.burn_in, None, thin)
        if disagreement:
            outcome = outcome._replace(reason=f"{outcome.reason}; weighted draws differ: {disagreement}")
        acceptance = _moved(run.coords[outcome.burn_in :])
        coords, levels = run.coords[kept], run.log_density[kept]
        return cls(
            coords, levels, outcome.effective, outcome, acceptance, thin, drawn, disagreement, False, True
        )


class _Made(NamedTuple):
    """A chain that was made elsewhere: (steps, walkers, p) and (steps, walkers)."""

    coords: FloatArray
    log_density: FloatArray


def _moved(chain: FloatArray) -> float:
    """Share of steps at which a walker of a chain (steps, walkers, p) moved."""
    return float((np.diff(chain, axis=0) != 0.0).any(axis=-1).mean())


def _assemble(
    density: _Density, answer: _Answer, rng: np.random.Generator, seed: int | None, seconds: float
) -> Posterior:
    """Turn draws into SI, and add what follows from them."""
    problem, outcome = density.problem, answer.outcome
    chain = problem.physical(answer.coords)
    flat = chain.reshape(-1, chain.shape[-1])
    chosen = rng.choice(len(flat), size=min(_PREDICTIVE_DRAWS, len(flat)), replace=False)
    best = problem.physical(density.fit.vector)
    record = None
    if answer.drawn is not None:
        record = answer.drawn.record(answer.disagreement, is_open=problem.noise_is_open)
    return Posterior(
        names=problem.names,
        chain=chain,
        log_posterior=answer.log_density.copy(),
        priors=tuple(repr(prior) for prior in problem.priors.values()),
        prior_quantiles=_prior_quantiles(problem),
        derived=derived_quantities(problem, chain[:: -(-len(flat) // _DERIVED_DRAWS)]),
        predictive=predictive_bands(problem, flat[chosen], best, rng),
        diagnostics=SamplingDiagnostics(
            converged=outcome.converged,
            reason=outcome.reason,
            steps=outcome.steps,
            burn_in=outcome.burn_in,
            thin=answer.thin,
            walkers=outcome.walkers,
            autocorrelation_time=tuple(outcome.times.tolist()) if answer.is_chain else (),
            rhat=() if np.isnan(outcome.rhat).all() else tuple(outcome.rhat.tolist()),
            acceptance=answer.acceptance,
            evaluations=density.evaluations,
            failures=density.failures,
            failure_region=density.failure_region,
            seconds=seconds,
            seed=seed,
            model_error=_model_error(problem, best),
            versions={**provenance(problem.curves)["versions"], "emcee": emcee.__version__},
            method="emcee" if answer.is_chain else "importance",
            effective=tuple(answer.effective.tolist()),
            quantile_errors={
                name: tuple(errors.tolist())
                for name, errors in zip(problem.names, outcome.quantile_errors.T, strict=True)
            },
            importance=record,
            weighted=answer.weighted,
        ),
        truth=_truth(problem),
        problem=problem,
        fit=density.fit,
    )


def _prior_quantiles(problem: Problem) -> FloatArray:
    levels = prior_levels(_PRIOR_LEVELS)
    return np.column_stack([c.prior.truncated(c.low, c.high).quantile(levels) for c in problem.coordinates])


def _model_error(problem: Problem, best: FloatArray) -> float:
    """Largest error estimate of the contact laws at `best` (p,), SI, relative to the force."""
    errors = []
    for member in problem.members:
        scene = member.scene_at(best)
        deepest = max(float(member.curve.depth.max()) - scene.instrument.contact_depth, 0.0)
        errors.append(quiet_law(scene, problem.solver, deepest).error_estimate)
    return max(errors)


def _truth(problem: Problem) -> dict[str, float]:
    """True values of the parameters, from the curves' own record."""
    truth: dict[str, float] = {}
    for curve, member in zip(problem.curves, problem.members, strict=True):
        noise = {f"noise.{name}": entry for name, entry in member.noise_entries.items()}
        for path, entry in {**member.entries, **noise}.items():
            if curve.truth is not None and path in curve.truth:
                truth[problem.names[entry]] = float(curve.truth[path])
    return truth


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


def posterior_from_chain(problem: Problem, chain: ArrayLike, *, seed: int = 0) -> Posterior:
    """Return what a chain of any sampler says, judged, summed up and reported as a chain of `sample` is.

    A sampler of one's own needs the log-density of many scaled vectors at once and a place to begin, such as
    `Fit.vector` with `Fit.scaled_covariance`. Where a noise is stated the density is `Problem.log_posterior`; else
    ``fit.statement.likelihood.log_density``, which is the same where one is stated.

    Parameters
    ----------
    problem : Problem
        What was sampled.
    chain : array_like (steps, walkers, parameters)
        Draws in scaled coordinates, as they were made: from the start, unthinned. Independent chains are walkers.
    seed : int, default 0
        Of the draws of the predictive bands.

    Returns
    -------
    Posterior
        `converged` by the same rule as for ``sample(method="emcee")``.

    Raises
    ------
    InputError
        If the chain has another shape, is too short to be judged, or leaves what the priors allow.
    """
    require_given(problem, "problem", Problem)
    coords = as_finite(chain, "chain")
    parameters = len(problem.names)
    if coords.ndim != 3 or coords.shape[2] != parameters or coords.shape[0] < MIN_STEPS:
        raise InputError(
            f"a chain is {MIN_STEPS} steps or more of walkers in {parameters} scaled coordinates, "
            f"(steps, walkers, {parameters}); got shape {coords.shape}"
        )
    density = _Density.of(fit(problem))
    log_density = density(coords.reshape(-1, parameters)).reshape(coords.shape[:2])
    if not np.isfinite(log_density).all():
        step, walker = np.argwhere(~np.isfinite(log_density))[0]
        raise InputError(
            f"the chain is at a place of no probability at step {step} of walker {walker}, where no draw can have "
            "been accepted; are these scaled coordinates?"
        )
    answer = _Answer.of_chain(_Made(coords, log_density), judge(coords, len(coords)), None, "")
    return _assemble(density, answer, np.random.default_rng(seed), seed, 0.0)


class _Averaged:
    """Log-density of the data (sets,) at physical vectors (sets, p), by a fit's likelihood."""

    left_out, data, parts = 1.0, (), ()

    def __init__(self, found: Fit) -> None:
        self._problem, self._likelihood = found.problem, cast(Any, found.statement).likelihood

    def __call__(self, physical: FloatArray) -> FloatArray:
        q = np.column_stack(
            [
                [c.scaled(float(x)) for x in own]
                for c, own in zip(self._problem.coordinates, physical.T, strict=True)
            ]
        )
        return np.asarray(self._likelihood.log_density(q) - self._problem.log_prior(q))


def marginalised(problem: Problem) -> Problem:
    """Return the problem with noise and misfit averaged over in its likelihood: ``fit.statement.likelihood``.

    .. deprecated:: 0.2
        Ask ``fit(problem).statement.likelihood.log_density`` of scaled vectors.
    """
    require_given(problem, "problem", Problem)
    warnings.warn(
        "marginalised goes with the next version: the likelihood of a fit has the density",
        DeprecationWarning,
        stacklevel=2,
    )
    if not problem.noise_is_open or problem.likelihood is not None:
        return problem
    return problem.with_likelihood(cast(Any, _Averaged(fit(problem))))
