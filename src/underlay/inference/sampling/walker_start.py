"""Where walkers start: around the best fit, inside the priors, wider than the posterior."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError, InputError
from underlay.inference.least_squares import fit
from underlay.inference.problem import Problem
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.laplace import find_mode, overdispersed

__all__ = ["start_walkers"]

# The best fit is sought where the prior leaves this much on either side.
_EDGE = 1e-4


def start_walkers(
    problem: Problem,
    density: CountedDensity,
    walkers: int,
    generator: np.random.Generator,
    start: Mapping[str, float] | None,
) -> FloatArray:
    """Place walkers, (walkers, parameters), around the best fit, twice as wide as the posterior.

    Raises
    ------
    InputError
        If the start is outside the priors.
    FitError
        If the walkers find no place inside them.
    """
    low, inner_low, inner_high, high = _prior_marks(problem)
    vector = np.clip(_fitted(problem), low, high) if start is None else problem.vector(start)
    if not np.isfinite(density(vector[None])[0]):
        raise InputError(_outside(problem, vector))
    laplace = find_mode(density, vector, 0.5 * (inner_high - inner_low), (low, high))
    return overdispersed(density, laplace, walkers, generator)


def _fitted(problem: Problem) -> FloatArray:
    """Scaled vector (parameters,) of the least-squares fit, or of the scene where there is none."""
    try:
        return problem.vector(fit(problem).values)
    except FitError:
        return problem.start


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
