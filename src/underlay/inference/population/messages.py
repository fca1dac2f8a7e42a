"""Propagation of the curves' likelihoods up the levels of a population, and integration over the spreads.

The levels are curve, site, animal, group. At every level the likelihood of a unit, as a function of the logarithm x
of the parameter, is kept as

    exp(constant - precision (x - centre)^2 / 2) * exp(table(x)),

a normal part from the units below that are normal, and a table on a common grid for those that are not (open
curves, heavy tails). For the level above it is blurred by the spread of its level: normal parts in closed form,
tables cell by cell with the normal distribution function, the outermost cells reaching to infinity, so that an open
likelihood stays open and no spread is too small for the grid. The units of one parent are multiplied.

A spread is the standard deviation of ln of the parameter among the units of a level: 0.2 is 20 %. Priors:
half-Cauchy of scale 0.3 between animals (Gelman 2006, doi 10.1214/06-BA117A) and half-t with four degrees of
freedom and scale 0.5 among curves of one animal, chosen by coverage for three to ten animals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, special

from underlay._arrays import FloatArray

#: Function from a tuple of spreads per level to the log-likelihood of all their combinations.
LogLikelihood: TypeAlias = Callable[[tuple[FloatArray, ...]], FloatArray]
#: Per level, outermost first: ln of the smallest and of the largest spread of the range.
Windows: TypeAlias = tuple[tuple[float, float], ...]
# Smallest and largest spread on a grid.
_SMALLEST, _LARGEST = 1e-3, 5.0
# Nodes per axis: for locating the posterior, for the sums by number of levels, and for more levels.
_FIRST = 9
_NODES = {1: (32,), 2: (24, 16), 3: (14, 12, 12)}
_MOST = 10
# Log units below the largest at which a node is left out: a share of 1e-5.
_NEGLIGIBLE = 12.0
# Number of times that the ranges of the spreads are narrowed.
_PASSES = 6
IntArray: TypeAlias = NDArray[np.intp]
# Log units below a table's largest at which a place is left out, and the number of standard deviations at which a
# normal is as low.
_MESSAGES_NEGLIGIBLE = 300.0
_NOTHING, _FURTHEST = math.exp(-_MESSAGES_NEGLIGIBLE), math.sqrt(2.0 * _MESSAGES_NEGLIGIBLE)
# Distance between computed places, in standard deviations of the normal.
_APART = 1.0 / 3.0


@dataclass(frozen=True)
class SpreadPrior:
    """Half-t prior of a spread: scale, and degrees of freedom (1 is half-Cauchy)."""

    scale: float
    freedom: float

    def log_density(self, spread: FloatArray) -> FloatArray:
        """Log-density, without the constant, at spreads of any shape."""
        power = 0.5 * (self.freedom + 1.0)
        result: FloatArray = -power * np.log1p((spread / self.scale) ** 2 / self.freedom)
        return result


#: Priors of the spread between units, and among the curves of one unit: see the head of this module.
BETWEEN, WITHIN = SpreadPrior(0.3, 1.0), SpreadPrior(0.5, 4.0)


@dataclass(frozen=True)
class SpreadGrid:
    """Posterior of the spreads, outermost level first, on a grid.

    Parameters
    ----------
    nodes : tuple of FloatArray
        Spreads per level.
    weights : FloatArray
        Posterior probability of every combination, one axis per level; sums to one.
    log_evidence : float
        Logarithm of the integral over the grid, without the priors' constants.
    """

    nodes: tuple[FloatArray, ...]
    weights: FloatArray
    log_evidence: float

    def quantile(self, level: int, shares: FloatArray) -> FloatArray:
        """Quantiles of the spread of one level at the probabilities `shares`; zero where they are off the grid."""
        weights = self._marginal(level)
        log_nodes = np.log(self.nodes[level])
        edges = 0.5 * (log_nodes[1:] + log_nodes[:-1])
        below = np.cumsum(weights)
        places = np.exp(np.interp(shares, below, [*edges, log_nodes[-1]]))
        at_least = self.nodes[level][0] <= _SMALLEST * 1.01
        return np.where(at_least & (shares < below[0]), 0.0, places)

    def probability_below(self, level: int, spread: float) -> float:
        """Posterior probability that the spread of one level is smaller than `spread`."""
        log_nodes = np.log(self.nodes[level])
        edges = [*(0.5 * (log_nodes[1:] + log_nodes[:-1])), log_nodes[-1]]
        return float(np.interp(np.log(spread), edges, np.cumsum(self._marginal(level)), left=0.0, right=1.0))

    def probability_of_none(self, least: float) -> float:
        """Posterior probability that the root of the sum of all squared spreads is below `least`."""
        squares = sum(
            nodes.reshape([-1 if axis == here else 1 for axis in range(self.weights.ndim)]) ** 2
            for here, nodes in enumerate(self.nodes)
        )
        return float(self.weights[np.broadcast_to(squares < least**2, self.weights.shape)].sum())

    def _marginal(self, level: int) -> FloatArray:
        others = tuple(axis for axis in range(self.weights.ndim) if axis != level)
        result: FloatArray = self.weights.sum(axis=others)
        return result


def spread_windows(log_likelihood: LogLikelihood, priors: Sequence[SpreadPrior]) -> Windows:
    """Find the range of each spread that holds nearly all of the posterior.

    Parameters
    ----------
    log_likelihood : callable
        Logarithm of the likelihood at all combinations of a tuple of nodes per level, accurate to about one.
    priors : sequence of SpreadPrior
        One per level, outermost first.

    Returns
    -------
    tuple of (float, float)
        Per level, outermost first: ln of the smallest and of the largest spread of the range.
    """
    windows: Windows = ((math.log(_SMALLEST), math.log(_LARGEST)),) * len(priors)
    for _ in range(_PASSES):
        log_nodes = [np.linspace(low, high, _FIRST) for low, high in windows]
        found = _log_posterior(log_likelihood, log_nodes, priors)
        narrowed = tuple(_window(found, axis, log_nodes[axis]) for axis in range(len(priors)))
        shrunk = any(
            high - low < 0.6 * (b - a) for (low, high), (a, b) in zip(narrowed, windows, strict=True)
        )
        windows = narrowed
        if not shrunk:
            break
    return windows


def weighted_grid(
    log_likelihood: LogLikelihood, priors: Sequence[SpreadPrior], windows: Windows
) -> SpreadGrid:
    """Posterior of the spreads on a grid over their ranges, outermost level first."""
    counts = _NODES.get(len(priors), (_MOST,) * len(priors))
    log_nodes = [np.linspace(low, high, count) for (low, high), count in zip(windows, counts, strict=True)]
    found = _log_posterior(log_likelihood, log_nodes, priors)
    log_cell = sum(
        np.log(_cells(nodes)).reshape([-1 if axis == here else 1 for axis in range(len(priors))])
        for here, nodes in enumerate(log_nodes)
    )
    log_weights = found + log_cell
    largest = log_weights.max()
    weights = np.exp(log_weights - largest)
    total = weights.sum()
    return SpreadGrid(
        tuple(np.exp(nodes) for nodes in log_nodes), weights / total, float(largest + np.log(total))
    )


def _log_posterior(
    log_likelihood: LogLikelihood,
    log_nodes: Sequence[FloatArray],
    priors: Sequence[SpreadPrior],
) -> FloatArray:
    """Log-posterior per unit of ln spread at all combinations of nodes, one axis per level."""
    nodes = tuple(np.exp(at) for at in log_nodes)
    found = log_likelihood(nodes)
    for axis, (at, prior) in enumerate(zip(nodes, priors, strict=True)):
        along = [-1 if other == axis else 1 for other in range(len(priors))]
        found = found + (prior.log_density(at) + np.log(at)).reshape(along)
    return found


def _cells(log_nodes: FloatArray) -> FloatArray:
    """Trapezoidal width of each node in ln spread; the smallest also stands for all smaller spreads."""
    step = log_nodes[1] - log_nodes[0]
    cells = np.full(len(log_nodes), step)
    cells[[0, -1]] *= 0.5
    if log_nodes[0] <= np.log(_SMALLEST) + 1e-9:
        cells[0] += 1.0
    return cells


def _window(found: FloatArray, axis: int, log_nodes: FloatArray) -> tuple[float, float]:
    others = tuple(other for other in range(found.ndim) if other != axis)
    along = found.max(axis=others)
    kept = np.flatnonzero(along > along.max() - _NEGLIGIBLE)
    low, high = max(kept[0] - 1, 0), min(kept[-1] + 1, len(log_nodes) - 1)
    return float(log_nodes[low]), float(log_nodes[high])


@dataclass(frozen=True)
class Grid:
    """Grid of ln of the parameter for tables: evenly spaced in the middle, coarser outside.

    Parameters
    ----------
    outside : FloatArray
        Distances of the coarser places from the first and the last even one, increasing.
    first, step : float
        First even place, and the spacing of the even ones.
    count : int
        Number of even places.
    """

    outside: FloatArray
    first: float
    step: float
    count: int

    @cached_property
    def x(self) -> FloatArray:
        """All places of the grid, increasing."""
        even = self.first + self.step * np.arange(self.count)
        return np.concatenate([self.first - self.outside[::-1], even, even[-1] + self.outside])

    @cached_property
    def widths(self) -> FloatArray:
        """Width of each place's cell, for sums over the grid."""
        widths: FloatArray = np.gradient(self.x)
        return widths

    def blurred(
        self, logarithms: FloatArray, spreads: FloatArray, *, wider: float = 1.0
    ) -> Iterator[FloatArray]:
        """Convolve exp(logarithms), (..., x), with normals of standard deviation `wider` times each spread.

        Yields the logarithm of each result at the places `self.places(spread)`, (..., places). Cells of negligible
        value are left out of the sums.
        """
        largest = logarithms.max(axis=-1, keepdims=True)
        off = logarithms - largest
        some = np.flatnonzero((off > -_MESSAGES_NEGLIGIBLE).reshape(-1, len(self.x)).any(axis=0))
        held = slice(int(some[0]), int(some[-1]) + 1) if len(some) else slice(0, 0)
        shares = np.exp(off[..., held]).reshape(math.prod(off.shape[:-1]), held.stop - held.start)
        for spread in spreads.tolist():
            rows = self.places(spread)
            found = shares @ self.kernel(wider * spread, rows, held).T
            found = found.reshape(*logarithms.shape[:-1], len(rows))
            np.log(np.maximum(found, _NOTHING, out=found), out=found)
            found += largest
            yield found

    def places(self, spread: float) -> IntArray:
        """Indices of grid places that suffice for a function blurred by a normal of this standard deviation."""
        stride = max(int(_APART * spread / self.step), 1)
        outer, last = len(self.outside), len(self.outside) + self.count - 1
        parts = np.arange(outer), np.arange(outer, last, stride), np.arange(last, len(self.x))
        return np.concatenate(parts)

    def everywhere(self, logarithms: FloatArray, spread: float) -> FloatArray:
        """Values at `places(spread)`, (..., places), interpolated by a spline to the whole grid, (..., x)."""
        rows = self.places(spread)
        if len(rows) == len(self.x):
            return logarithms
        return np.asarray(interpolate.make_interp_spline(self.x[rows], logarithms, axis=-1)(self.x))

    def kernel(self, spread: float, rows: IntArray, columns: slice) -> FloatArray:
        """Share of a normal density about each place (rows) that falls into each cell (columns)."""
        edges = np.concatenate([[-np.inf], 0.5 * (self.x[1:] + self.x[:-1]), [np.inf]])
        return _shares_of_cells(edges[columns.start : columns.stop + 1], self.x[rows], spread)


def _shares_of_cells(edges: FloatArray, x: FloatArray, spread: float) -> FloatArray:
    """Probability of a normal about each x (rows) between neighbouring edges, (rows, edges - 1)."""
    away = (edges - x[:, None]) / spread
    # Tail probabilities beyond an edge keep their digits however small they are.
    beyond = np.zeros(away.shape)
    near = np.abs(away) < _FURTHEST
    beyond[near] = special.ndtr(-np.abs(away[near]))
    above = away > 0.0
    holds_x = above[:, 1:] & ~above[:, :-1]
    share: FloatArray = np.abs(np.diff(beyond, axis=1))
    share[holds_x] = 1.0 - (beyond[:, 1:] + beyond[:, :-1])[holds_x]
    return share


@dataclass(frozen=True)
class Messages:
    """Likelihoods of the units of one level as functions of ln of the parameter; form as in the module.

    Parameters
    ----------
    precision, centre, constant : FloatArray
        Numbers of the normal parts, (..., units); leading axes are spreads of the levels below.
    tables : FloatArray
        Logarithms on the grid, (..., tabulated units, x).
    tabulated : ndarray of int
        Indices of the units that have a table.
    """

    precision: FloatArray
    centre: FloatArray
    constant: FloatArray
    tables: FloatArray
    tabulated: IntArray


def carried(units: Messages, spreads: FloatArray, parents: IntArray, count: int, grid: Grid) -> Messages:
    """Propagate likelihoods one level up: blurred by each of the spreads, and multiplied for each parent.

    Parameters
    ----------
    units : Messages
        Likelihoods of the units of one level.
    spreads : FloatArray
        Spreads of that level; a new leading axis of the result.
    parents : ndarray of int (units,)
        Parent of each unit, 0 to `count` - 1, in order.
    count : int
        Number of parents.
    grid : Grid
        Places of the tables.
    """
    of = units.tabulated
    # A unit that has a table has all of its likelihood in the table.
    own, constant = units.precision.copy(), units.constant.copy()
    own[..., of], constant[..., of] = 0.0, 0.0
    widened = 1.0 + own * spreads.reshape(-1, *([1] * own.ndim)) ** 2
    precision, constant = own / widened, constant - 0.5 * np.log(widened)
    starts = np.searchsorted(parents, np.arange(count))
    together = np.add.reduceat(precision, starts, axis=-1)
    weighted = np.add.reduceat(precision * units.centre, starts, axis=-1)
    # A parent whose units all have tables has no normal part: its centre has no effect.
    centre = np.divide(weighted, together, out=np.zeros_like(weighted), where=together > 0.0)
    off = units.centre - np.repeat(centre, np.diff([*starts, len(parents)]), axis=-1)
    constants = np.add.reduceat(constant - 0.5 * precision * off**2, starts, axis=-1)
    tables = np.zeros((*precision.shape[:-1], 0, 0))
    if len(of):
        whole = (
            units.constant[..., of, None]
            - 0.5 * units.precision[..., of, None] * (grid.x - units.centre[..., of, None]) ** 2
            + units.tables
        )
        tables = multiplied_tables(grid.blurred(whole, spreads), spreads, parents[of], grid)
    return Messages(together, centre, constants, tables, np.unique(parents[of]))


def multiplied_tables(
    each: Iterable[FloatArray], spreads: FloatArray, parents: IntArray, grid: Grid
) -> FloatArray:
    """Tables (spreads, ..., parents, x) of parents, each the product of its units' likelihoods.

    `each` yields one table of logarithms (..., units, places of the spread) for each spread, as `Grid.blurred`
    does. They are added before they are interpolated: a spline of a sum is the sum of splines.
    """
    starts = np.searchsorted(parents, np.unique(parents))
    return np.stack(
        [
            grid.everywhere(np.add.reduceat(tables, starts, axis=-2), spread)
            for tables, spread in zip(each, spreads.tolist(), strict=True)
        ]
    )
