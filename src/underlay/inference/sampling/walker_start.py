"""Where walkers start: the tops of a posterior, and their widths.

The top of a posterior and its width there: where the walkers of a sampler start.

Newton's method on a log-density of which only values are known, many at a time. Derivatives are differences
over about one standard deviation, taken in a basis that is whitened again after every step: at that size
they are far above rounding, they see a bent ridge as wide as it is, and parameters correlated to 0.999 cost
no digits. Where the data say nothing the curvature vanishes and the width of the prior takes its place.

Where walkers start: around the best fit, inside the priors, wider than the posterior.

Where the ridges of a posterior are looked for: optima of a fit, and what else its scan of the data offers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.candidates import candidates
from underlay.inference.least_squares.scan import Landscape
from underlay.inference.least_squares.scan_curve import blocked_objective
from underlay.inference.problem import Problem
from underlay.inference.ridge.march import PriorNormal, Target, derivatives
from underlay.inference.ridge.mixture import Mixture
from underlay.inference.sampling.counted import CountedDensity

__all__ = ["Laplace", "Starts", "find_mode", "optima", "overdispersed", "prior_marks", "start_walkers"]

_MAX_STEPS = 25


# Redraws of walkers, each a tenth closer: 40 of them bring a spread of 2 down to 0.03.
_MAX_REDRAWS = 40


_STEP_LENGTHS = 2.0 ** -np.arange(12.0)


# A thousandth of a log unit is 1/20 of a standard deviation; widths within 30 % are enough for a start.
_NEGLIGIBLE = 0.001


_SETTLED = 0.5


# At the wall of the box there is always something to gain beyond it.
_PATIENCE = 3


# First the prior's widths and down to 3e-9 of them, later some factors around the length so far.
_FIRST_TRIALS = 10.0 ** -np.arange(0.0, 9.0, 0.5)


_LATER_TRIALS = 2.0 ** np.arange(3.0, -6.0, -1.0)


_MAX_GROWTH = 8.0


class Laplace(NamedTuple):
    """Mode (p,) and factor (p, p): ``mode + factor @ z`` with normal z is the posterior near its top."""

    mode: FloatArray
    factor: FloatArray
    log_density: float


def find_mode(
    log_density: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    width: FloatArray,
    box: tuple[FloatArray, FloatArray],
) -> Laplace:
    """Climb from `start` to the nearest top inside a box.

    Parameters
    ----------
    log_density : callable
        (m, p) -> (m,); -inf where not allowed.
    start : FloatArray
        (p,), where the density is not zero.
    width : FloatArray
        (p,): standard deviation of the prior of each coordinate, the widest the result may be.
    box : pair of FloatArray
        Lower and upper ends (p,), within the priors: a top at the very edge of a prior has no neighbours to
        take differences with.

    Raises
    ------
    FitError
        If the density is zero or not a number at the start.
    """
    mode = np.clip(start, *box)
    top = float(log_density(mode[None])[0])
    if not np.isfinite(top):
        raise FitError(f"the log-posterior is {top} at the start: move the start inside the priors")
    basis, trials = np.diag(width), _FIRST_TRIALS
    idle = 0
    for _ in range(_MAX_STEPS):
        basis = basis * _line_scales(log_density, mode, top, basis, width, trials)
        trials = _LATER_TRIALS
        # A column that leaves the prior keeps its length: that was chosen for a bend of one.
        _, gradient, hessian = derivatives(log_density, mode, basis, lost=1.0)
        curvature, directions = np.linalg.eigh(-hessian)
        longest = np.linalg.norm((basis @ directions) / width[:, None], axis=0)
        # A direction the density does not bend in, or bends upwards in, grows until it does or to the prior.
        precision = np.maximum(curvature, np.maximum(longest**2, _MAX_GROWTH**-2))
        slope = directions.T @ gradient
        still_to_gain = 0.5 * float(np.sum(slope**2 / precision))
        step = basis @ (directions @ (slope / precision))
        basis = (basis @ directions) / np.sqrt(precision)
        candidates = np.clip(mode + _STEP_LENGTHS[:, None] * step, *box)
        values = log_density(candidates)
        best = int(np.argmax(values))
        idle = 0 if values[best] - top > _NEGLIGIBLE else idle + 1
        if values[best] > top:
            mode, top = candidates[best], float(values[best])
        settled = bool((np.abs(np.log(precision)) < _SETTLED).all())
        if settled and (still_to_gain < _NEGLIGIBLE or idle >= _PATIENCE):
            break
    return Laplace(mode, basis, top)


def overdispersed(
    log_density: Callable[[FloatArray], FloatArray],
    laplace: Laplace,
    count: int,
    rng: np.random.Generator,
    *,
    spread: float = 2.0,
) -> FloatArray:
    """Draw `count` points (count, p) around the mode, `spread` times as wide as the posterior.

    Points that are not allowed, or so far down a bent ridge that a walker would take long to come back
    (more than ten log units per parameter), are drawn again, a little closer each time.

    Raises
    ------
    FitError
        If they do not fit inside the prior.
    """
    parameters = laplace.mode.size
    floor = laplace.log_density - 10.0 * parameters
    points = np.empty((count, parameters))
    missing = np.arange(count)
    for _ in range(_MAX_REDRAWS):
        drawn = laplace.mode + spread * rng.standard_normal((missing.size, parameters)) @ laplace.factor.T
        points[missing] = drawn
        missing = missing[~(log_density(drawn) > floor)]
        if not missing.size:
            return points
        spread *= 0.9
    raise FitError(
        f"{missing.size} of {count} walkers found no place inside the priors near the best fit; is the start "
        "at the edge of a prior?"
    )


def _line_scales(
    log_density: Callable[[FloatArray], FloatArray],
    mode: FloatArray,
    top: float,
    basis: FloatArray,
    width: FloatArray,
    trials: FloatArray,
) -> FloatArray:
    """Factors (p,) by which each column of the basis costs half a log unit, at most the prior's width.

    Of the trial lengths the one whose bend is nearest to one decides: far shorter ones measure rounding,
    far longer ones another part of the density.
    """
    parameters = mode.size
    steps = (trials[:, None, None] * basis.T).reshape(-1, parameters)
    values = log_density(np.concatenate([mode + steps, mode - steps]))
    bend = (2.0 * top - values[: len(steps)] - values[len(steps) :]).reshape(-1, parameters)
    found = 1.0 / np.linalg.norm(basis / width[:, None], axis=0)
    for i in range(parameters):
        usable = np.isfinite(bend[:, i]) & (bend[:, i] > 0.0)
        if usable.any():
            nearest = np.flatnonzero(usable)[np.argmin(np.abs(np.log(bend[usable, i])))]
            found[i] = min(found[i], trials[nearest] / np.sqrt(bend[nearest, i]))
    return np.asarray(found)


# The best fit is sought where the prior leaves this much on either side.
_EDGE = 1e-4


# How much wider than the mixture, which is wider than the posterior; how far below its top, by parameter, a walker
# would take long to come back from; how often as many are drawn again.
_WIDER, _FLOOR, _WALKER_START_MAX_REDRAWS = 1.5, 10.0, 20


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
    for _ in range(_WALKER_START_MAX_REDRAWS):
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


# Starts asked of the scan: every local minimum of its grid that was ever seen; and the best of its other places.
_STARTS, _PLACES = 12, 24


class Starts(NamedTuple):
    """Where to look for ridges, in scaled vectors (parameters,).

    Parameters
    ----------
    optima : list of FloatArray
        The best fit, then the others.
    places : list of FloatArray
        Of the scan, best first: no optima, but where the rest was fitted to the data.
    """

    optima: list[FloatArray]
    places: list[FloatArray]


def optima(problem: Problem) -> Starts:
    """Optima of a fit and what its scan offers."""
    try:
        found = fit(problem)
    except FitError:
        return Starts([problem.start], [])
    # By their values: a fit with adhesion may have left out a reading, and its coordinates have its curve's scale.
    values = [found.values, *(other.values for other in found.alternatives)]
    scanned = _scanned(problem)
    return Starts([*(problem.vector(each) for each in values), *scanned.optima], scanned.places)


def _scanned(problem: Problem) -> Starts:
    """Minima on blocks of the curves below every start of the scan that may be an optimum, and the scan's places.

    A fit keeps those that the data hardly reject; a posterior has room for one that is worse and wide, and for a
    ridge that bends back where no minimum is.
    """
    if any(member.forward.history is not None or member.scene.adhesion for member in problem.members):
        # Blocks of neighbouring depths have no time, and no jump.
        return Starts([], [])
    low, high = problem.bounds.T
    landscape = Landscape.of(problem)
    starts, places = (
        [np.clip(landscape.vector(place), low, high) for place in chosen]
        for chosen in (landscape.minima(_STARTS), landscape.places()[:_PLACES])
    )
    minima = candidates(blocked_objective(problem, robust=False), starts)
    return Starts([entry.vector for entry in minima], places)
