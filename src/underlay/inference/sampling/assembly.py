"""From a chain in scaled coordinates to a `Posterior` in SI.

A `Posterior` from a chain that a sampler of one's own made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay._given import require_given
from underlay.errors import InputError
from underlay.inference.least_squares.provenance import provenance
from underlay.inference.model.laws import quiet_law
from underlay.inference.problem import Problem
from underlay.inference.ridge.importance import Importance
from underlay.inference.sampling.convergence import MIN_STEPS, Outcome, judge
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.derived import derived_quantities
from underlay.inference.sampling.diagnostics import SamplingDiagnostics, predictive_bands, prior_levels
from underlay.inference.sampling.posterior import Posterior

__all__ = ["Draws", "Making", "assemble_posterior", "posterior_from_chain"]

# A quarter of the shortest autocorrelation time between kept draws costs about 1 % of the effective size.
_KEPT_PER_TIME = 4.0


_PRIOR_LEVELS = 1001


_DERIVED_DRAWS = 4096


_PREDICTIVE_DRAWS = 500


class Draws(NamedTuple):
    """Draws of a posterior: scaled coordinates (n, columns, parameters), and the log-posterior (n, columns)."""

    coords: FloatArray
    log_density: FloatArray


@dataclass(frozen=True)
class Making:
    """How a chain was made.

    Parameters
    ----------
    seed : int or None
        Of its chance.
    seconds : float
        Time it took; zero where it was made elsewhere.
    versions : mapping of str to str
        Of the programs that made it, beyond our own.
    method : str
        ``"emcee"`` for a chain, ``"importance"`` for weighted draws.
    moves : mapping of str to float
        Share of its proposals that each kind of move saw accepted.
    importance : Importance, optional
        What weighted draws say of the same posterior.
    resampled : Draws, optional
        Those draws by their weights, where they are the answer.
    """

    seed: int | None
    seconds: float = 0.0
    versions: Mapping[str, str] = field(default_factory=dict)
    method: str = "emcee"
    moves: Mapping[str, float] = field(default_factory=dict)
    importance: Importance | None = None
    resampled: Draws | None = None


def assemble_posterior(
    problem: Problem,
    coords: FloatArray,
    log_density: FloatArray,
    outcome: Outcome,
    density: CountedDensity,
    rng: np.random.Generator,
    made: Making,
) -> Posterior:
    """Burn in, thin, turn into SI, and add what follows from the draws.

    Parameters
    ----------
    problem : Problem
        Whose posterior it is.
    coords, log_density : FloatArray
        Scaled coordinates (steps, walkers, parameters) and log-posterior (steps, walkers).
    outcome : Outcome
        The verdict on that chain.
    density : CountedDensity
        Counters of the evaluations.
    rng : numpy Generator
        Chooses draws and noise of the predictive bands.
    made : Making
        How the chain was made, for the record.
    """
    fastest = float(np.min(outcome.times))
    thin = max(1, int(fastest / _KEPT_PER_TIME)) if np.isfinite(fastest) else 1
    thin = min(thin, max(1, (outcome.steps - outcome.burn_in) // MIN_STEPS))
    burnt = coords[outcome.burn_in :]
    kept = made.resampled or Draws(coords[outcome.burn_in :: thin], log_density[outcome.burn_in :: thin])
    chain = problem.physical(kept.coords)
    best = coords.reshape(-1, chain.shape[-1])[int(np.argmax(log_density))]
    every = -(-chain[..., 0].size // _DERIVED_DRAWS)
    spaced = chain.reshape(-1, chain.shape[-1])
    chosen = rng.choice(len(spaced), size=min(_PREDICTIVE_DRAWS, len(spaced)), replace=False)
    is_chain = made.method == "emcee"
    effective = (outcome.steps - outcome.burn_in) * outcome.walkers / outcome.times
    if made.resampled is not None and made.importance is not None:
        effective = np.full(len(problem.names), made.importance.effective)
    moved = (np.diff(burnt, axis=0) != 0.0).any(axis=-1)
    return Posterior(
        names=problem.names,
        chain=chain,
        log_posterior=kept.log_density.copy(),
        priors=tuple(repr(prior) for prior in problem.priors.values()),
        prior_quantiles=_prior_quantiles(problem),
        derived=derived_quantities(problem, chain[::every]),
        predictive=predictive_bands(problem, spaced[chosen], rng),
        diagnostics=SamplingDiagnostics(
            converged=outcome.converged,
            reason=outcome.reason,
            steps=outcome.steps,
            burn_in=outcome.burn_in,
            thin=thin,
            walkers=outcome.walkers,
            autocorrelation_time=tuple(outcome.times.tolist()) if is_chain else (),
            rhat=tuple(outcome.rhat.tolist()) if is_chain else (),
            acceptance=float(moved.mean()),
            evaluations=density.evaluations,
            failures=density.failures,
            failure_region=density.failure_region,
            seconds=made.seconds,
            seed=made.seed,
            model_error=_model_error(problem, best),
            versions={**provenance(problem.curves)["versions"], **made.versions},
            method=made.method,
            effective=tuple(effective.tolist()),
            quantile_errors={
                name: tuple(errors.tolist())
                for name, errors in zip(problem.names, outcome.quantile_errors.T, strict=True)
            },
            moves=dict(made.moves),
            importance=made.importance,
            weighted=made.resampled is not None,
            left_out=1.0 if problem.likelihood is None else problem.likelihood.left_out,
        ),
        truth=_truth(problem),
        problem=problem,
    )


def _prior_quantiles(problem: Problem) -> FloatArray:
    levels = prior_levels(_PRIOR_LEVELS)
    return np.column_stack([c.prior.truncated(c.low, c.high).quantile(levels) for c in problem.coordinates])


def _model_error(problem: Problem, best: FloatArray) -> float:
    """Largest error estimate of the contact laws at the best draw, relative to the force."""
    errors = []
    for scene, curve in zip(problem.scenes(best), problem.curves, strict=True):
        deepest = max(float(curve.depth.max()) - scene.instrument.contact_depth, 0.0)
        errors.append(quiet_law(scene, problem.solver, deepest).error_estimate)
    return max(errors)


def _truth(problem: Problem) -> dict[str, float]:
    """True values of the parameters, from the curves' own record."""
    truth: dict[str, float] = {}
    for curve, member in zip(problem.curves, problem.members, strict=True):
        if curve.truth is None:
            continue
        entries = {
            **member.entries,
            **{f"noise.{name}": entry for name, entry in member.noise_entries.items()},
        }
        for path, entry in entries.items():
            if path in curve.truth:
                truth[problem.names[entry]] = float(curve.truth[path])
    return truth


def posterior_from_chain(problem: Problem, chain: ArrayLike, *, seed: int = 0) -> Posterior:
    """Return what a chain of any sampler says, judged, summed up and reported as a chain of `sample` is.

    A sampler of one's own needs two things of a problem: `Problem.log_posterior` of many scaled vectors at once,
    and a place to begin, such as `Fit.vector` with `Fit.scaled_covariance`. Where no noise is stated, the problem
    that `marginalised` returns is the one that `sample` would take.

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
        `converged` by the same rule as for `sample`.

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
    density = CountedDensity(problem)
    log_density = density(coords.reshape(-1, parameters)).reshape(coords.shape[:2])
    if not np.isfinite(log_density).all():
        step, walker = np.argwhere(~np.isfinite(log_density))[0]
        raise InputError(
            f"the chain is at a place of no probability at step {step} of walker {walker}, where no draw can have "
            "been accepted; are these scaled coordinates?"
        )
    rng = np.random.default_rng(seed)
    outcome = judge(coords, len(coords))
    return assemble_posterior(problem, coords, log_density, outcome, density, rng, Making(seed))
