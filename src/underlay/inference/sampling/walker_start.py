"""Where walkers start: around the best fit, inside the priors, wider than the posterior."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.problem import Problem
from underlay.inference.ridge.coordinates import PriorNormal, Target
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.laplace import find_mode, overdispersed

__all__ = ["prior_marks", "start_walkers"]

# The best fit is sought where the prior leaves this much on either side.
_EDGE = 1e-4
# How much wider than the mixture, which is wider than the posterior; how far below its top, by parameter, a walker
# would take long to come back from; how often as many are drawn again.
_WIDER, _FLOOR, _MAX_REDRAWS = 1.5, 10.0, 20


def start_walkers(
    problem: Problem,
    density: CountedDensity,
    walkers: int,
    generator: np.random.Generator,
    vector: FloatArray,
    mixture: Mixture | None,
) -> FloatArray:
    """Place walkers, (walkers, parameters), over-dispersed: then R-hat tells whether they forgot their start.

    Parameters
    ----------
    problem, density, walkers, generator
        What is sampled, by how many, with which chance.
    vector : FloatArray
        Best fit, (parameters,), scaled.
    mixture : Mixture or None
        What lies along the ridges; without it they start around the best fit, twice as wide as the posterior.

    Raises
    ------
    FitError
        If the walkers find no place inside them.
    """
    if mixture is not None:
        placed = _along(problem, density, walkers, generator, mixture)
        if placed is not None:
            return placed
    low, inner_low, inner_high, high = prior_marks(problem)
    laplace = find_mode(density, vector, 0.5 * (inner_high - inner_low), (low, high))
    return overdispersed(density, laplace, walkers, generator)


def _along(
    problem: Problem,
    density: CountedDensity,
    walkers: int,
    generator: np.random.Generator,
    mixture: Mixture,
) -> FloatArray | None:
    """Draws of a wider mixture, but for those far down; None where too few are left of many."""
    coordinates = PriorNormal(problem)
    target = Target(coordinates, problem, density)
    floor = float(target(mixture.places).max()) - _FLOOR * len(problem.names)
    placed: list[FloatArray] = []
    for _ in range(_MAX_REDRAWS):
        z = mixture.widened(_WIDER).draw(walkers, generator)
        placed += list(coordinates.scaled(z[target(z) > floor]))
        if len(placed) >= walkers:
            return np.array(placed[:walkers])
    return None


def prior_marks(problem: Problem) -> FloatArray:
    """Scaled coordinates of prior quantiles, (4, parameters): nearly its ends, and its 68 % between them."""
    marks = []
    for coordinate in problem.coordinates:
        prior = coordinate.prior.truncated(coordinate.low, coordinate.high)
        quantiles = prior.quantile(np.array([_EDGE, 0.16, 0.84, 1.0 - _EDGE]))
        marks.append([coordinate.scaled(float(x)) for x in quantiles])
    return np.array(marks).T
