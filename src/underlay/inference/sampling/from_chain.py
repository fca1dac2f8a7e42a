"""A `Posterior` from a chain that a sampler of one's own made."""

from __future__ import annotations

import numpy as np

from underlay._arrays import ArrayLike, as_finite
from underlay._given import require_given
from underlay.errors import InputError
from underlay.inference.problem import Problem
from underlay.inference.sampling.assembly import Making, assemble_posterior
from underlay.inference.sampling.convergence import MIN_STEPS
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.sampling.stopping import judge

__all__ = ["posterior_from_chain"]


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
