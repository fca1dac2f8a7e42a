"""The posterior of a problem by an ensemble of walkers (emcee).

Foreman-Mackey, Hogg, Lang and Goodman (2013), doi:10.1086/670067. The walkers see scaled coordinates, so a
modulus moves in ratios; all walkers of a half-ensemble are evaluated in one call of the batched forward
model. They start over-dispersed around the best fit, inside the priors, and go on until the chain is longer
than 50 autocorrelation times and the rank-normalised R-hat is below 1.01, or the result says that it is not.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import metadata
from typing import NamedTuple

import emcee
import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError, UnderlayWarning
from underlay.inference.chain_file import ChainFile, Progress, RandomState
from underlay.inference.convergence import MIN_STEPS, autocorrelation_time, rank_normalised_rhat
from underlay.inference.counted import CountedDensity
from underlay.inference.derived import derived_quantities
from underlay.inference.information import prior_levels
from underlay.inference.laplace import find_mode, overdispersed
from underlay.inference.posterior import Posterior, SamplingDiagnostics
from underlay.inference.predictive import predictive_bands
from underlay.inference.problem import Problem
from underlay.inference.progress import SamplingProgress

__all__ = ["sample"]

_TIMES_NEEDED = 50.0
_RHAT_NEEDED = 1.01
# The walkers' memory of their start fades as exp(-t / tau): ten times leave 5e-5 of it.
_BURN_IN_TIMES = 10.0
# A quarter of the shortest autocorrelation time between kept draws costs about 1 % of the effective size.
_KEPT_PER_TIME = 4.0
_FIRST_CHECK = 100
# Checks get rarer as the chain grows, so that all of them together cost a few times the last one.
_GROWTH = 1.15
_TOLERATED_FAILURES = 0.01
_PRIOR_LEVELS = 1001
# The best fit is sought where the prior leaves this much on either side.
_EDGE = 1e-4
_DERIVED_DRAWS = 4096
_PREDICTIVE_DRAWS = 500
# Recomputing the same density on the same machine repeats to rounding; another problem differs in the
# first digits.
_SAME_DENSITY = 1e-6


def sample(
    problem: Problem,
    walkers: int = 64,
    max_steps: int = 20_000,
    rng: int | np.random.Generator = 0,
    *,
    start: Mapping[str, float] | None = None,
    backend: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: bool | None = None,
) -> Posterior:
    """Sample the posterior of a problem.

    Parameters
    ----------
    problem : Problem
        With a proper prior for every free parameter.
    walkers : int, default 64
        At least twice as many as parameters.
    max_steps : int, default 20000
        Most steps of the ensemble; it stops earlier when the chain has converged.
    rng : int or numpy Generator, default 0
        Seed, or a generator to draw one from. The same seed gives the same chain.
    start : mapping of str to float, optional
        Values (SI) by parameter name from which the best fit is sought, e.g. ``fit.values``; those not named
        start at the scene's.
    backend : path, optional
        HDF5 file in which every step is kept as it is made (extra ``uq``). A process that is killed loses
        nothing of it.
    resume : bool, default False
        Continue the chain in `backend`, as if it had never stopped; begin it if there is no such file.
    progress : bool, optional
        Show a progress line; by default only on a terminal.

    Returns
    -------
    Posterior
        Also when it did not converge or was interrupted: ``converged`` and ``diagnostics.reason`` say so.

    Raises
    ------
    InputError
        If a prior is improper, the start is outside the priors, there are too few walkers or steps, the file
        exists and `resume` is not set, or it holds the chain of another problem.
    FitError
        If the walkers find no place inside the priors.
    MissingExtraError
        If `backend` is given and h5py is not installed.

    Warns
    -----
    UnderlayWarning
        If it did not converge, or more than 1 % of the model evaluations failed.
    """
    _check(problem, walkers, max_steps, backend, resume=resume)
    begin = time.perf_counter()
    seed, generator = _seeded(rng)
    density = CountedDensity(problem)
    with _chain_file(problem, walkers, max_steps, backend, resume=resume) as (file, before):
        run = _Run.begin(problem, density, walkers, max_steps, generator, start, file, before)
        with SamplingProgress(max_steps, shown=progress) as line:
            outcome = run.go(line)
    posterior = _assemble(problem, run, outcome, density, generator, seed, time.perf_counter() - begin)
    _warn(posterior)
    return posterior


class _Outcome(NamedTuple):
    """Where a chain stands: burn-in, autocorrelation times and R-hat after it, and a verdict in words."""

    steps: int
    burn_in: int
    times: FloatArray
    rhat: FloatArray
    converged: bool
    reason: str


class _Run:
    """One ensemble on its way: the chain so far, (steps, walkers, parameters), and what moves it."""

    def __init__(
        self,
        sampler: emcee.EnsembleSampler,
        density: CountedDensity,
        state: emcee.State,
        max_steps: int,
        file: ChainFile | None,
        before: Progress | None,
    ) -> None:
        self._sampler, self._density, self._state, self._file = sampler, density, state, file
        walkers, parameters = state.coords.shape
        self._coords = np.empty((max_steps, walkers, parameters))
        self._log_density = np.empty((max_steps, walkers))
        self.max_steps = max_steps
        self.steps = 0
        if before is not None:
            self.steps = min(len(before.chain), max_steps)
            self._coords[: self.steps] = before.chain[: self.steps, :, :-1]
            self._log_density[: self.steps] = before.chain[: self.steps, :, -1]

    @classmethod
    def begin(
        cls,
        problem: Problem,
        density: CountedDensity,
        walkers: int,
        max_steps: int,
        generator: np.random.Generator,
        start: Mapping[str, float] | None,
        file: ChainFile | None,
        before: Progress | None,
    ) -> _Run:
        """Place the walkers, or take them up where a file left them."""
        sampler = emcee.EnsembleSampler(walkers, len(problem.names), density, moves=_moves(), vectorize=True)
        if before is not None and len(before.chain):
            last = before.chain[-1]
            density.continue_from(before.evaluations, before.failures)
            _check_same_density(density, last)
            state = emcee.State(last[:, :-1], log_prob=last[:, -1], random_state=before.random_state)
        else:
            words = np.random.RandomState(generator.integers(2**32, size=8, dtype=np.uint32))
            coords = _start(problem, density, walkers, generator, start)
            state = emcee.State(coords, log_prob=density(coords), random_state=words.get_state())
            before = None
        return cls(sampler, density, state, max_steps, file, before)

    @property
    def coords(self) -> FloatArray:
        """Scaled coordinates so far, (steps, walkers, parameters)."""
        return self._coords[: self.steps]

    @property
    def log_density(self) -> FloatArray:
        """Log-posterior so far, (steps, walkers)."""
        return self._log_density[: self.steps]

    def go(self, line: SamplingProgress) -> _Outcome:
        """Step until the chain has converged, the steps are used up, or the user interrupts."""
        next_check = max(_FIRST_CHECK, self.steps)
        outcome = _judge(self.coords, self.max_steps) if self.steps else None
        if self.steps == self.max_steps or (outcome is not None and outcome.converged):
            return outcome if outcome is not None else _judge(self.coords, self.max_steps)
        try:
            for state in self._sampler.sample(
                self._state,
                iterations=self.max_steps - self.steps,
                store=False,
                skip_initial_state_check=True,
            ):
                self._keep(state)
                line.step(self.steps)
                if self.steps >= next_check:
                    outcome = _judge(self.coords, self.max_steps)
                    line.judge(_worth(outcome, self.coords.shape[1]), _steps_needed(outcome, self.max_steps))
                    if outcome.converged:
                        return outcome
                    next_check = int(np.ceil(self.steps * _GROWTH))
        except KeyboardInterrupt:
            if self.steps < MIN_STEPS:
                raise
            return _judge(self.coords, self.max_steps)._replace(
                converged=False, reason=f"interrupted after {self.steps} steps"
            )
        return _judge(self.coords, self.max_steps)

    def _keep(self, state: emcee.State) -> None:
        if self._file is not None:
            random_state: RandomState = self._sampler.random_state
            counts = (self._density.evaluations, self._density.failures)
            self._file.append(state.coords, state.log_prob, random_state, counts)
        self._coords[self.steps] = state.coords
        self._log_density[self.steps] = state.log_prob
        self.steps += 1


def _moves() -> list[tuple[emcee.moves.Move, float]]:
    """How walkers move: all of it invariant under linear maps, so a strong correlation costs nothing.

    Draws from a kernel estimate of the other half follow a bent ridge (half the autocorrelation time of
    differences alone, a quarter of stretches alone, on E, thickness and contact point); differences of walkers
    (ter Braak 2006, doi:10.1007/s11222-006-8769-1) and stretches take over where the estimate is poor. A full
    difference (gamma0 = 1) jumps between separate tops. emcee's snooker is left out: up to version 3.1.6 it
    divides by the root of a length where the length belongs, and the variance it yields is too small.
    """
    return [
        (emcee.moves.KDEMove(), 0.40),
        (emcee.moves.DEMove(), 0.35),
        (emcee.moves.DEMove(gamma0=1.0), 0.05),
        (emcee.moves.StretchMove(), 0.20),
    ]


def _check(
    problem: Problem, walkers: int, max_steps: int, backend: str | os.PathLike[str] | None, *, resume: bool
) -> None:
    improper = [name for name, prior in problem.priors.items() if not prior.proper]
    if improper:
        raise InputError(
            f"the prior of {', '.join(improper)} is improper and cannot be sampled: give finite bounds or a "
            "prior such as LogUniform(low, high) or Normal(mean, sd)"
        )
    if walkers < 2 * len(problem.names):
        raise InputError(
            f"{walkers} walkers are too few for {len(problem.names)} parameters: at least "
            f"{2 * len(problem.names)} are needed, and 64 serve well"
        )
    if max_steps < MIN_STEPS:
        raise InputError(f"max_steps must be at least {MIN_STEPS}; got {max_steps}")
    if resume and backend is None:
        raise InputError("resume=True needs backend, the file that holds the chain")


def _seeded(rng: int | np.random.Generator) -> tuple[int | None, np.random.Generator]:
    if isinstance(rng, np.random.Generator):
        return None, rng
    try:
        return int(rng), np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        raise InputError(f"rng must be a seed (an integer, 0 or more) or a Generator; got {rng!r}") from error


@contextmanager
def _chain_file(
    problem: Problem, walkers: int, max_steps: int, backend: str | os.PathLike[str] | None, *, resume: bool
) -> Iterator[tuple[ChainFile | None, Progress | None]]:
    if backend is None:
        yield None, None
    elif resume and os.path.exists(backend):
        with ChainFile.resume(backend, problem.names, (max_steps, walkers)) as (file, before):
            yield file, before
    else:
        with ChainFile.create(backend, problem.names, (max_steps, walkers)) as file:
            yield file, None


def _check_same_density(density: CountedDensity, last: FloatArray) -> None:
    """Refuse a chain whose densities are not those of this problem."""
    now, then = density.peek(last[:, :-1]), last[:, -1]
    if not np.allclose(now, then, rtol=_SAME_DENSITY, atol=_SAME_DENSITY):
        worst = int(np.argmax(np.abs(now - then)))
        raise InputError(
            "the file holds the chain of another problem: the log-posterior of its last step is "
            f"{then[worst]:.6g} there and {now[worst]:.6g} here; did the curve, a prior, the noise or the "
            "contact law change?"
        )


def _start(
    problem: Problem,
    density: CountedDensity,
    walkers: int,
    generator: np.random.Generator,
    start: Mapping[str, float] | None,
) -> FloatArray:
    """Walkers (walkers, parameters) around the best fit, twice as wide as the posterior."""
    vector = problem.start if start is None else problem.vector(start)
    if not np.isfinite(density(vector[None])[0]):
        raise InputError(_outside(problem, vector))
    low, inner_low, inner_high, high = _prior_marks(problem)
    laplace = find_mode(density, vector, 0.5 * (inner_high - inner_low), (low, high))
    return overdispersed(density, laplace, walkers, generator)


def _outside(problem: Problem, vector: FloatArray) -> str:
    for coordinate, q in zip(problem.coordinates, vector, strict=True):
        value = float(coordinate.physical(q))
        if not np.isfinite(coordinate.log_prior(q)):
            return (
                f"the start is outside the prior: {coordinate.name} = {value:.6g} (SI), and its prior is "
                f"{coordinate.prior!r}; change the start or the prior"
            )
    return "no contact law exists at the start, or its likelihood is zero; start closer to the data"


def _prior_marks(problem: Problem) -> FloatArray:
    """Scaled coordinates of prior quantiles, (4, parameters): nearly its ends, and its 68 % between them."""
    marks = []
    for coordinate in problem.coordinates:
        prior = coordinate.prior.truncated(coordinate.low, coordinate.high)
        quantiles = prior.quantile(np.array([_EDGE, 0.16, 0.84, 1.0 - _EDGE]))
        marks.append([coordinate.scaled(float(x)) for x in quantiles])
    return np.array(marks).T


def _judge(coords: FloatArray, max_steps: int) -> _Outcome:
    """Burn-in, autocorrelation and verdict for a chain in scaled coordinates."""
    steps, _, parameters = coords.shape
    late = np.array([autocorrelation_time(coords[steps // 2 :, :, i]) for i in range(parameters)])
    burn_in = min(steps // 2, int(np.ceil(_BURN_IN_TIMES * min(late.max(), steps))))
    kept = coords[burn_in:]
    times = np.array([autocorrelation_time(kept[..., i]) for i in range(parameters)])
    long_enough = len(kept) > _TIMES_NEEDED * times.max()
    # Ranking half a million numbers costs more than all autocorrelations: only when it can decide, or last.
    if not long_enough and steps < max_steps:
        rhat = np.full(parameters, np.nan)
    else:
        rhat = np.array([rank_normalised_rhat(kept[..., i]) for i in range(parameters)])
    mixed = bool((rhat < _RHAT_NEEDED).all())
    if long_enough and mixed:
        reason = (
            f"converged: {len(kept)} steps after burn-in are {len(kept) / times.max():.0f} autocorrelation times, "
            f"R-hat is {rhat.max():.4f}"
        )
    else:
        reason = (
            f"not converged after {steps} steps: {len(kept)} of them, after burn-in, are "
            f"{len(kept) / times.max():.1f} autocorrelation times ({_TIMES_NEEDED:.0f} are needed) and R-hat is "
            f"{rhat.max():.4f} ({_RHAT_NEEDED} is needed)"
        )
    return _Outcome(steps, burn_in, times, rhat, long_enough and mixed, reason)


def _worth(outcome: _Outcome, walkers: int) -> float:
    """Effective samples so far, from the slowest parameter."""
    return (outcome.steps - outcome.burn_in) * walkers / float(outcome.times.max())


def _steps_needed(outcome: _Outcome, max_steps: int) -> int:
    """Probable length: R-hat over single walkers comes below 1.01 at about a hundred times, plus burn-in."""
    return int(
        min(max_steps, max(outcome.steps, (2.0 * _TIMES_NEEDED + _BURN_IN_TIMES) * outcome.times.max()))
    )


def _assemble(
    problem: Problem,
    run: _Run,
    outcome: _Outcome,
    density: CountedDensity,
    generator: np.random.Generator,
    seed: int | None,
    seconds: float,
) -> Posterior:
    walkers = run.coords.shape[1]
    fastest = float(np.min(outcome.times))
    thin = max(1, int(fastest / _KEPT_PER_TIME)) if np.isfinite(fastest) else 1
    thin = min(thin, max(1, (run.steps - outcome.burn_in) // MIN_STEPS))
    burnt = run.coords[outcome.burn_in :]
    kept = slice(outcome.burn_in, None, thin)
    chain = problem.physical(run.coords[kept])
    best = run.coords.reshape(-1, chain.shape[-1])[int(np.argmax(run.log_density))]
    every = -(-len(chain) * walkers // _DERIVED_DRAWS)
    spaced = chain.reshape(-1, chain.shape[-1])
    chosen = generator.choice(len(spaced), size=min(_PREDICTIVE_DRAWS, len(spaced)), replace=False)
    moved = (np.diff(burnt, axis=0) != 0.0).any(axis=-1)
    return Posterior(
        names=problem.names,
        chain=chain,
        log_posterior=run.log_density[kept].copy(),
        priors=tuple(repr(prior) for prior in problem.priors.values()),
        prior_quantiles=_prior_quantiles(problem),
        derived=derived_quantities(problem, chain[::every]),
        predictive=predictive_bands(problem, spaced[chosen], generator),
        diagnostics=SamplingDiagnostics(
            converged=outcome.converged,
            reason=outcome.reason,
            steps=run.steps,
            burn_in=outcome.burn_in,
            thin=thin,
            walkers=walkers,
            autocorrelation_time=tuple(outcome.times.tolist()),
            rhat=tuple(outcome.rhat.tolist()),
            acceptance=float(moved.mean()),
            evaluations=density.evaluations,
            failures=density.failures,
            failure_region=density.failure_region,
            seconds=seconds,
            seed=seed,
            model_error=_model_error(problem, best),
            versions=_versions(),
        ),
        truth=_truth(problem),
    )


def _prior_quantiles(problem: Problem) -> FloatArray:
    levels = prior_levels(_PRIOR_LEVELS)
    return np.column_stack([c.prior.truncated(c.low, c.high).quantile(levels) for c in problem.coordinates])


def _model_error(problem: Problem, best: FloatArray) -> float:
    """Largest error estimate of the contact laws at the best draw, relative to the force."""
    options = problem.options
    errors = []
    for scene, curve in zip(problem.scenes(best), problem.curves, strict=True):
        deepest = max(float(curve.depth.max()) - scene.instrument.contact_depth, 0.0)
        errors.append(options.build(scene, deepest).error_estimate)
    return max(errors)


def _truth(problem: Problem) -> dict[str, float]:
    """True values of the parameters, from the curves' own record."""
    truth: dict[str, float] = {}
    for curve, member in zip(problem.curves, problem.members, strict=True):
        if curve.truth is None:
            continue
        entries = member.entries | {f"noise.{name}": entry for name, entry in member.noise_entries.items()}
        for path, entry in entries.items():
            if path in curve.truth:
                truth[problem.names[entry]] = float(curve.truth[path])
    return truth


def _versions() -> dict[str, str]:
    versions = {}
    for name in ("underlay", "numpy", "emcee"):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            # Run from a source tree that is not installed.
            versions[name] = "not installed"
    return versions


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
