"""The posterior of a problem: weighted draws from a fit's likelihood, checked by an ensemble of walkers (emcee).

First come a fit, its likelihood (`inference/uncertainty`) and weighted draws from that; they are the posterior if a
short chain that starts from them agrees. Where their weights are not trusted, or a chain is requested, walkers
continue until the chain is longer than 50 autocorrelation times, R-hat is below 1.01 and every quantile is known to
0.06 standard deviations, or the result says that it has not converged. Both use one density,
`Likelihood.log_density`, in scaled coordinates, so that a modulus moves in ratios; all walkers are evaluated in one
call of the batched forward model.

Moves are emcee's own (Foreman-Mackey, Hogg, Lang and Goodman 2013, doi:10.1086/670067): independent proposals from
the distribution of the weighted draws and from Student kernels about them (Tierney 1994,
doi:10.1214/aos/1176325750); from a kernel estimate of the other half of the walkers, which follows a curved ridge;
differences of walkers (ter Braak 2006, doi:10.1007/s11222-006-8769-1), and a full difference (gamma0 = 1) that
jumps between separate maxima. The snooker move is left out: up to version 3.1.6 it divides by the root of a length
instead of the length, and the variance it yields is too small.
"""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any, NamedTuple, TypeAlias, cast

import emcee
import numpy as np
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.errors import FitError, InputError, UnderlayWarning
from underlay.inference.journal import Chain, ChainFile, open_chain
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit
from underlay.inference.least_squares.provenance import provenance
from underlay.inference.model.laws import quiet_law
from underlay.inference.priors import Uniform, require_proper
from underlay.inference.problem import Problem
from underlay.inference.progress import ProgressLine
from underlay.inference.sampling.derived import derived_quantities
from underlay.inference.sampling.diagnostics import (
    MIN_STEPS,
    Outcome,
    SamplingDiagnostics,
    judge,
    memory,
    predictive_bands,
    prior_levels,
)
from underlay.inference.sampling.draws import Proposal, Target, WeightedDraws, differs, weigh
from underlay.inference.sampling.posterior import Posterior

#: A caller's own progress line: called with the steps that are done, those that will probably be needed, and the
#: effective samples so far.
Told: TypeAlias = Callable[[int, int, float], None]

# Steps at the first check of convergence, and the growth from one check to the next: checks get rarer as the chain
# grows, so that all of them together cost a few times the last one.
_FIRST_CHECK, _GROWTH = 100, 1.15
# Default limits: steps, and processor seconds, since without a table laws are solved one by one and so many steps
# may take an hour.
_MOST_STEPS, _MOST_SECONDS = 20_000, 300.0
# Bounds of a baseline without any, over the range of the curve.
_WEAK = 10.0
_BASELINE, _SLOPE = "instrument.baseline", "instrument.baseline_slope"
# Share of evaluations that may fail without a warning.
_TOLERATED_FAILURES = 0.01
# Number of resampled draws for each weighted one (an error of 0.01 standard deviations is left), and of the columns
# in which they are arranged.
_TIMES, _COLUMNS = 4, 8
# Draws that are kept per shortest autocorrelation time: four cost about 1 % of the effective size.
_KEPT_PER_TIME = 4.0
# Quantiles of a prior, and draws at which derived quantities and predictive bands are computed.
_PRIOR_LEVELS, _DERIVED_DRAWS, _PREDICTIVE_DRAWS = 1001, 4096, 500

# The progress line.
_LINE = (
    TextColumn("sampling"),
    BarColumn(),
    TextColumn("{task.completed} of about {task.total} steps"),
    TextColumn("{task.fields[worth]}"),
    TimeElapsedColumn(),
    TimeRemainingColumn(),
)


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
        With a proper prior for every free parameter. Readings near a jump of the force that `fit` leaves out are
        left out. Where no noise is stated the likelihood is that of the intervals of `fit`.
    walkers : int, default 64
        At least two more than twice as many as parameters: each half of them must span the space for the other.
    max_steps : int, optional
        Most steps of the ensemble; it stops earlier when the chain has converged. By default 20,000, and no more
        than five minutes of processor time allow.
    rng : int or numpy Generator, default 0
        Seed, or a generator to draw one from. The same seed gives the same posterior.
    backend : path, optional
        File to which every step is written at once (an SQLite database), so that a killed process loses none.
    resume : bool, default False
        Continue the chain in `backend`, as if it had never stopped; begin it if there is no such file.
    progress : bool or callable, optional
        Show a progress line; by default only on a terminal. A function is called at every step with the steps done,
        those that will probably be needed and the effective samples so far; a KeyboardInterrupt that it raises ends
        the sampling as Ctrl-C does.
    method : {"emcee", "importance"}, optional
        By default weighted draws, resampled, which a short chain that starts from them checks; where the two differ
        by more than their errors, or the weights are not trusted, the chain continues and is the posterior.
        ``"importance"`` gives the weighted draws alone: it makes no chain, so `walkers`, `max_steps` and `backend`
        have no effect. ``"emcee"`` gives the draws of the long chain.

    Returns
    -------
    Posterior
        Also when it did not converge or was interrupted: ``converged`` and ``diagnostics.reason`` say so.

    Raises
    ------
    InputError
        If a prior but the baseline's is improper, there are too few walkers or steps, the file exists and `resume`
        is not set, or it holds the chain of another problem.
    FitError
        If nothing can be fitted, or ``"importance"`` is requested and the weights are not trusted: it says why.
    FileAccessError, FileFormatError
        If the file `backend` cannot be written, or is no chain.

    Warns
    -----
    UnderlayWarning
        If it did not converge, more than 1 % of the model evaluations failed, or a baseline without a prior was
        given bounds: ten times the range of the curve.
    """
    require_given(problem, "problem", Problem)
    limit = math.inf if max_steps is not None else time.process_time() + _MOST_SECONDS
    max_steps = _MOST_STEPS if max_steps is None else max_steps
    problem = _with_proper_baseline(problem)
    _check(problem, walkers, max_steps, method, backend, resume=resume)
    began = time.perf_counter()
    seed, generator = _seeded(rng)
    for_draws, for_walkers, for_bands = generator.spawn(3)
    found = fit(problem)
    density = Target(found)
    drawn = weigh(density, for_draws)
    if method == "importance":
        if drawn.refused:
            raise FitError(f"weighted draws are refused: {drawn.refused}; take the sampler emcee")
        draws = _of_weights(drawn, for_draws, None)
    else:
        names = found.problem.names
        kept = (
            nullcontext((None, None))
            if backend is None
            else open_chain(backend, names, walkers, resume=resume)
        )
        with (
            kept as (file, before),
            ProgressLine(*_LINE, shown=progress, total=max_steps, worth="") as line,
        ):
            run = _Run(density, drawn, walkers, max_steps, for_walkers, file, before)
            draws = _judged(run, drawn, line, limit, for_draws, names, by_weights=method is None)
    posterior = _assemble(density, draws, for_bands, seed, time.perf_counter() - began)
    _warn(posterior)
    return posterior


def _judged(
    run: _Run,
    drawn: WeightedDraws,
    line: ProgressLine,
    limit: float,
    rng: np.random.Generator,
    names: tuple[str, ...],
    *,
    by_weights: bool,
) -> _Draws:
    """Weighted draws if they are requested and a chain agrees with them; else the draws of the long chain."""
    if by_weights and not drawn.refused:
        run.go(line, limit, most=_FIRST_CHECK)
        disagreement = differs(names, drawn, run.coords)
        if not disagreement:
            return _of_weights(drawn, rng, run)
    outcome = run.go(line, limit)
    disagreement = "" if drawn.refused else differs(names, drawn, run.coords)
    if by_weights and not (drawn.refused or disagreement):
        return _of_weights(drawn, rng, run)
    return _of_chain(run.coords, run.log_density, outcome, drawn, disagreement)


def _with_proper_baseline(problem: Problem) -> Problem:
    """The problem with wide uniform priors for baselines and their slopes that have none.

    A sampler needs proper priors. The force is linear in both, and ten times the range of the curve contains all
    possible values.
    """
    weak = {}
    for member in problem.members:
        force = _WEAK * float(np.ptp(member.curve.force))
        widths = {_BASELINE: force, _SLOPE: force / float(np.ptp(member.curve.depth))}
        for path, width in widths.items():
            entry = member.entries.get(path)
            if entry is not None and not problem.coordinates[entry].prior.proper:
                weak[problem.names[entry]] = Uniform(-width, width)
    if not weak:
        return problem
    warnings.warn(
        f"{', '.join(weak)}: no bounds and no prior, so within ten times the range of the curve",
        UnderlayWarning,
        stacklevel=4,
    )
    bounded = problem.revised(free={**problem.free, **weak})
    return bounded if problem.likelihood is None else bounded.with_likelihood(problem.likelihood)


def _check(
    problem: Problem,
    walkers: int,
    max_steps: int,
    method: str | None,
    backend: str | os.PathLike[str] | None,
    *,
    resume: bool,
) -> None:
    """Raise InputError for a problem or options that cannot be sampled."""
    if method not in (None, "emcee", "importance"):
        raise InputError(f"unknown method {method!r}; known: 'emcee', 'importance'")
    if method == "importance" and backend is not None:
        raise InputError("weighted draws are no chain and are not kept in a file: leave backend out")
    require_proper(problem.priors)
    # The moves use the covariance of one half of the walkers, which needs p + 1 points to span p dimensions.
    least = 2 * (len(problem.names) + 1)
    if walkers < least:
        raise InputError(
            f"{walkers} walkers are too few for {len(problem.names)} parameters: at least {least} are needed, "
            "and 64 serve well"
        )
    if max_steps < MIN_STEPS:
        raise InputError(f"max_steps must be at least {MIN_STEPS}; got {max_steps}")
    if resume and backend is None:
        raise InputError("to resume a sampling, give the file that holds its chain")


def _seeded(rng: int | np.random.Generator) -> tuple[int | None, np.random.Generator]:
    """The seed, or None for a given generator, and the generator."""
    if isinstance(rng, np.random.Generator):
        return None, rng
    try:
        return int(rng), np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        raise InputError(f"rng must be a seed (an integer, 0 or more) or a Generator; got {rng!r}") from error


# --- the chain --------------------------------------------------------------------------------------------


def moves(proposal: Callable[[FloatArray, Any], tuple[FloatArray, FloatArray]]) -> list[tuple[Any, float]]:
    """Moves of the emcee ensemble, each with the share of the steps in which it is used.

    `proposal` takes the positions of walkers (m, p) and returns independent proposals (m, p) and log q(old) - log
    q(new), (m,), q being the density of the proposal.
    """
    return [
        (emcee.moves.MHMove(proposal), 0.50),
        (emcee.moves.KDEMove(), 0.25),
        (emcee.moves.DEMove(), 0.20),
        (emcee.moves.DEMove(gamma0=1.0), 0.05),
    ]


class _Run:
    """One ensemble of walkers during its run: the chain so far, (steps, walkers, parameters), and its sampler.

    The walkers are placed by the weighted draws, or at the last step that a file holds. Steps read from a file are
    replayed and checked in the same way as new ones: all decisions are taken again, so that an interrupted run ends
    where it would have ended.
    """

    def __init__(
        self,
        density: Target,
        drawn: WeightedDraws,
        walkers: int,
        max_steps: int,
        rng: np.random.Generator,
        file: ChainFile | None,
        before: Chain | None,
    ) -> None:
        parameters = drawn.vectors.shape[1]
        kept = np.empty((0, walkers, parameters + 1)) if before is None else before.steps
        words = np.random.RandomState(rng.integers(2**32, size=8, dtype=np.uint32))
        proposal = Proposal.of(drawn, rng)
        if before is not None and len(kept):
            last = kept[-1]
            density.evaluations, density.failures = before.evaluations, before.failures
            density.require_same(last[:, :-1], last[:, -1])
            self._state = emcee.State(last[:, :-1], log_prob=last[:, -1], random_state=before.random_state)
        else:
            coords, log_density = _placed(density, drawn, proposal, walkers, rng)
            self._state = emcee.State(coords, log_prob=log_density, random_state=words.get_state())
        self._sampler = emcee.EnsembleSampler(
            walkers, parameters, density, moves=moves(proposal), vectorize=True
        )
        self._density, self._file = density, file
        self._coords = np.empty((max_steps, walkers, parameters))
        self._log_density = np.empty((max_steps, walkers))
        self.max_steps = self._needed = max_steps
        self._effective = 0.0
        self.steps, self._kept = 0, min(len(kept), max_steps)
        self._coords[: self._kept] = kept[: self._kept, :, :-1]
        self._log_density[: self._kept] = kept[: self._kept, :, -1]

    @property
    def coords(self) -> FloatArray:
        """Scaled coordinates so far, (steps, walkers, parameters)."""
        return self._coords[: self.steps]

    @property
    def log_density(self) -> FloatArray:
        """Log-posterior so far, (steps, walkers)."""
        return self._log_density[: self.steps]

    def go(self, line: ProgressLine, limit: float, *, most: int | None = None) -> Outcome:
        """Step until `most` are done; without it until the chain has converged or steps or time are used up.

        A KeyboardInterrupt ends it too. Returns the verdict on the chain.
        """
        most = self.max_steps if most is None else min(most, self.max_steps)
        next_check = _check_from(max(self.steps, 1))
        try:
            if self.steps == next_check and (outcome := judge(self.coords, most)).converged:
                return outcome
            for _ in self._onward(most):
                worth = f"{self._effective:.0f} effective samples" if self._effective else ""
                told = (self.steps, self._needed, self._effective)
                line.show(*told, completed=self.steps, total=self._needed, worth=worth)
                if self.steps < next_check or self.steps >= most:
                    continue
                outcome = judge(self.coords, most)
                self._effective = float(outcome.effective.min())
                self._needed = min(outcome.probable_length, self.max_steps)
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
        """Replay the steps read from a file, then make new ones, up to `most`; yields after each."""
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
        """Verdict on a chain that was stopped early, not converged; `why` is the reason in words."""
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
    density: Target, drawn: WeightedDraws, proposal: Proposal, walkers: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Starting positions (walkers, p), resampled from the weighted draws, and their log-density.

    Positions come from the proposal instead where the weights are not trusted.
    """
    coords = (
        np.empty((0, drawn.vectors.shape[1])) if drawn.refused else drawn.vectors[drawn.rows(walkers, rng)]
    )
    levels = density(coords) if len(coords) else np.empty(0)
    while len(coords) < walkers:
        more = proposal.draw(walkers, rng)
        density_of_more = density(more)
        coords, levels = (
            np.vstack((coords, more[np.isfinite(density_of_more)])),
            np.append(levels, density_of_more[np.isfinite(density_of_more)]),
        )
    return coords[:walkers], levels[:walkers]


def _check_from(steps: int) -> int:
    """First number of steps, at least `steps`, at which a chain is checked for convergence, in a fixed series."""
    check = _FIRST_CHECK
    while check < steps:
        check = int(np.ceil(check * _GROWTH))
    return check


# --- the posterior ----------------------------------------------------------------------------------------


class _Draws(NamedTuple):
    """Draws (n, columns, p), scaled, their log-density (n, columns), and what the diagnostics record of them."""

    coords: FloatArray
    log_density: FloatArray
    record: dict[str, Any]


def _of_weights(drawn: WeightedDraws, rng: np.random.Generator, run: _Run | None) -> _Draws:
    """Weighted draws, resampled, with the chain that checked them, if one was made."""
    count = -(-_TIMES * len(drawn.weights) // _COLUMNS) * _COLUMNS
    rows = drawn.rows(count, rng).reshape(-1, _COLUMNS)
    reason = (
        f"{len(drawn.weights)} weighted samples, as good as {drawn.effective:.0f} independent ones (Pareto k "
        f"{drawn.pareto:.2f}; below 0.7 they can be trusted)"
    )
    record = {
        "converged": True,
        "reason": reason,
        "steps": len(rows),
        "burn_in": 0,
        "thin": 1,
        "walkers": _COLUMNS,
        "autocorrelation_time": (),
        "rhat": (),
        "acceptance": drawn.effective / len(drawn.weights),
        "method": "importance",
        "effective": (drawn.effective,) * drawn.vectors.shape[1],
        "quantile_errors": drawn.quantile_errors,
        "importance": drawn.record(""),
        "weighted": True,
    }
    if run is not None:
        burn_in, times = memory(run.coords)
        record |= {
            "reason": f"{reason}; a chain of {run.steps} steps from them agrees within the errors of both",
            "steps": run.steps,
            "burn_in": burn_in,
            "walkers": run.coords.shape[1],
            "autocorrelation_time": tuple(times.tolist()),
            "acceptance": _moved(run.coords[burn_in:]),
            "method": "emcee",
        }
    return _Draws(drawn.vectors[rows], drawn.log_density[rows], record)


def _of_chain(
    coords: FloatArray,
    log_density: FloatArray,
    outcome: Outcome,
    drawn: WeightedDraws | None = None,
    disagreement: str = "",
) -> _Draws:
    """Draws of a chain (steps, walkers, p) after burn-in, thinned."""
    fastest = float(np.min(outcome.times))
    thin = max(1, int(fastest / _KEPT_PER_TIME)) if np.isfinite(fastest) else 1
    thin = min(thin, max(1, (outcome.steps - outcome.burn_in) // MIN_STEPS))
    kept = slice(outcome.burn_in, None, thin)
    reason = outcome.reason
    record = {
        "converged": outcome.converged,
        "reason": f"{reason}; weighted draws differ: {disagreement}" if disagreement else reason,
        "steps": outcome.steps,
        "burn_in": outcome.burn_in,
        "thin": thin,
        "walkers": outcome.walkers,
        "autocorrelation_time": tuple(outcome.times.tolist()),
        "rhat": () if np.isnan(outcome.rhat).all() else tuple(outcome.rhat.tolist()),
        "acceptance": _moved(coords[outcome.burn_in :]),
        "method": "emcee",
        "effective": tuple(outcome.effective.tolist()),
        "quantile_errors": outcome.quantile_errors,
        "importance": None if drawn is None else drawn.record(disagreement),
        "weighted": False,
    }
    return _Draws(coords[kept], log_density[kept], record)


def _moved(chain: FloatArray) -> float:
    """Share of steps at which a walker of a chain (steps, walkers, p) moved."""
    return float((np.diff(chain, axis=0) != 0.0).any(axis=-1).mean())


def _assemble(
    density: Target, draws: _Draws, rng: np.random.Generator, seed: int | None, seconds: float
) -> Posterior:
    """The posterior: draws converted to SI, derived quantities, predictive bands and diagnostics."""
    problem = density.problem
    chain = problem.physical(draws.coords)
    flat = chain.reshape(-1, chain.shape[-1])
    chosen = rng.choice(len(flat), size=min(_PREDICTIVE_DRAWS, len(flat)), replace=False)
    best = problem.physical(density.fit.vector)
    errors = draws.record["quantile_errors"].T.tolist()
    return Posterior(
        names=problem.names,
        chain=chain,
        log_posterior=draws.log_density.copy(),
        priors=tuple(repr(prior) for prior in problem.priors.values()),
        prior_quantiles=_prior_quantiles(problem),
        derived=derived_quantities(problem, chain[:: -(-len(flat) // _DERIVED_DRAWS)]),
        predictive=predictive_bands(problem, flat[chosen], best, rng),
        diagnostics=SamplingDiagnostics(
            **{**draws.record, "quantile_errors": dict(zip(problem.names, map(tuple, errors), strict=True))},
            evaluations=density.evaluations,
            failures=density.failures,
            failure_region=density.failure_region,
            seconds=seconds,
            seed=seed,
            model_error=_model_error(problem, best),
            versions={**provenance(problem.curves)["versions"], "emcee": emcee.__version__},
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
    """True values of the parameters by name, as synthetic curves record them; empty for measured curves."""
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
    """Make a posterior from the chain of any sampler, with the checks and summaries of `sample`.

    A sampler of your own needs the log-density of many scaled vectors at once and a starting point, such as
    `Fit.vector` with `Fit.scaled_covariance`. Where a noise is stated the density is `Problem.log_posterior`; else
    ``fit.statement.likelihood.log_density``, which is the same where one is stated.

    Parameters
    ----------
    problem : Problem
        What was sampled.
    chain : array_like (steps, walkers, parameters)
        Draws in scaled coordinates, as they were made: from the start, unthinned. Independent chains are walkers.
    seed : int, default 0
        Seed of the draws of the predictive bands.

    Returns
    -------
    Posterior
        `converged` by the same rule as for ``sample(method="emcee")``.

    Raises
    ------
    InputError
        If the chain has another shape, is too short for a verdict, or leaves the support of the priors.
    """
    require_given(problem, "problem", Problem)
    coords = as_finite(chain, "chain")
    parameters = len(problem.names)
    if coords.ndim != 3 or coords.shape[2] != parameters or coords.shape[0] < MIN_STEPS:
        raise InputError(
            f"a chain is {MIN_STEPS} steps or more of walkers in {parameters} scaled coordinates, "
            f"(steps, walkers, {parameters}); got shape {coords.shape}"
        )
    density = Target(fit(problem))
    log_density = density(coords.reshape(-1, parameters)).reshape(coords.shape[:2])
    if not np.isfinite(log_density).all():
        step, walker = np.argwhere(~np.isfinite(log_density))[0]
        raise InputError(
            f"the chain is at a place of no probability at step {step} of walker {walker}, where no draw can have "
            "been accepted; are these scaled coordinates?"
        )
    draws = _of_chain(coords, log_density, judge(coords, len(coords)))
    return _assemble(density, draws, np.random.default_rng(seed), seed, 0.0)


class _Averaged:
    """Log-likelihood (sets,) at physical vectors (sets, p), by a fit's likelihood."""

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
    """Return the problem with a likelihood averaged over noise and misfit: ``fit.statement.likelihood``.

    .. deprecated:: 0.2
        Use ``fit(problem).statement.likelihood.log_density`` of scaled vectors.
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
