"""How the likelihoods of curves are carried up the levels: curve, site, animal, group.

At every level the likelihood of a unit, over the logarithm of the parameter, is kept as

    exp(constant - precision (x - centre)^2 / 2) * exp(table(x)),

the normal part of the units below that are normal, and a table on a common grid for those that are not (open
curves, heavy tails). A unit of the level above sees it blurred by the spread of its level: normal parts in
closed form, tables cell by cell with the normal distribution function, the outermost cells reaching to
infinity, so that what is open stays open and no spread is too small for the grid. Units of one parent multiply.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, special

from underlay._arrays import FloatArray

__all__ = ["Grid", "IntArray", "Messages", "blurred", "gathered"]

IntArray: TypeAlias = NDArray[np.intp]
# Of a table's largest value: what lies further down is as good as nothing, and its logarithm stays finite.
_NOTHING = 1e-290
# So far below its table's largest a cell counts for nothing; distance between places that are computed, in standard
# deviations of the normal.
_NEGLIGIBLE, _APART = 300.0, 0.25


@dataclass(frozen=True)
class Grid:
    """Places of ln of the parameter at which tables are kept: evenly spaced ones, and coarser ones outside.

    Parameters
    ----------
    outside : FloatArray
        Distances of the coarser places from the first and the last even one, increasing.
    first, step : float
        First even place and the distance between two.
    count : int
        How many even places.
    """

    outside: FloatArray
    first: float
    step: float
    count: int

    @cached_property
    def x(self) -> FloatArray:
        """All places, increasing."""
        even = self.first + self.step * np.arange(self.count)
        return np.concatenate([self.first - self.outside[::-1], even, even[-1] + self.outside])

    @cached_property
    def widths(self) -> FloatArray:
        """Width of each place's cell, the outermost as wide as their half."""
        widths: FloatArray = np.gradient(self.x)
        return widths

    def blurred(self, logarithms: FloatArray, spread: float) -> FloatArray:
        """Logarithm of exp(logarithms), (..., x), under a normal of standard deviation `spread`.

        Only cells that hold something are summed, and where the normal is wide beside the cells only some of the
        even places are computed: the logarithm of what it smoothed is a spline between them.
        """
        largest = logarithms.max(axis=-1, keepdims=True)
        off = logarithms - largest
        held = np.flatnonzero((off > -_NEGLIGIBLE).reshape(-1, len(self.x)).any(axis=0))
        columns = slice(int(held[0]), int(held[-1]) + 1)
        stride = max(int(_APART * spread / self.step), 1)
        outer, last = len(self.outside), len(self.outside) + self.count - 1
        rows = np.unique(np.r_[:outer, outer : last + 1 : stride, last : len(self.x)])
        share = np.exp(off[..., columns]) @ self.kernel(spread, rows, columns).T
        found: FloatArray = np.log(np.maximum(share, _NOTHING)) + largest
        if stride == 1:
            return found
        return np.asarray(interpolate.CubicSpline(self.x[rows], found, axis=-1)(self.x))

    def kernel(self, spread: float, rows: IntArray | None = None, columns: slice | None = None) -> FloatArray:
        """Share of a normal density about each place (rows) that falls into each cell (columns), all or some."""
        size, outer, count = len(self.x), len(self.outside), self.count
        rows = np.arange(size) if rows is None else rows
        columns = slice(0, size) if columns is None else columns
        marks = np.arange(columns.start, columns.stop + 1)
        edges = np.concatenate([[-np.inf], 0.5 * (self.x[1:] + self.x[:-1]), [np.inf]])[marks]
        below = np.empty((len(rows), len(marks)))
        is_even = (rows >= outer) & (rows < outer + count)
        between_even = (marks > outer) & (marks < outer + count)
        below[~is_even] = special.ndtr((edges - self.x[rows[~is_even], None]) / spread)
        here = self.x[rows[is_even], None]
        below[np.ix_(is_even, ~between_even)] = special.ndtr((edges[~between_even] - here) / spread)
        # Among even places only the distance counts.
        steps = special.ndtr((np.arange(-count, count) + 0.5) * self.step / spread)
        away = marks[between_even] - 1 - rows[is_even][:, None]
        below[np.ix_(is_even, between_even)] = steps[away + count]
        share: FloatArray = np.diff(below, axis=1)
        return share


@dataclass(frozen=True)
class Messages:
    """Likelihoods of the units of one level, over ln of the parameter.

    Parameters
    ----------
    precision, centre, constant : FloatArray
        Of the normal parts, (..., units); leading axes are spreads of the levels below.
    tables : FloatArray
        (..., tabulated units, x): logarithms on the grid.
    tabulated : ndarray of int
        Which units have a table.
    """

    precision: FloatArray
    centre: FloatArray
    constant: FloatArray
    tables: FloatArray
    tabulated: IntArray


def blurred(units: Messages, spreads: FloatArray, grid: Grid) -> Messages:
    """Return the messages as the level above sees them, with a new leading axis of `spreads`."""
    spread = spreads.reshape(-1, *([1] * units.precision.ndim))
    widened = 1.0 + units.precision * spread**2
    precision = units.precision / widened
    constant = units.constant - 0.5 * np.log(widened)
    centre = np.broadcast_to(units.centre, precision.shape)
    if not len(units.tabulated):
        tables = np.zeros((len(spreads), *units.tables.shape))
        return Messages(precision, centre, constant, tables, units.tabulated)
    of = units.tabulated
    whole = (
        units.constant[..., of, None]
        - 0.5 * units.precision[..., of, None] * (grid.x - units.centre[..., of, None]) ** 2
        + units.tables
    )
    tables = np.stack([grid.blurred(whole, float(s)) for s in spreads])
    # All of such a unit is in its table now.
    precision, constant = precision.copy(), constant.copy()
    precision[..., of], constant[..., of] = 0.0, 0.0
    return Messages(precision, centre, constant, tables, units.tabulated)


def gathered(units: Messages, parents: IntArray, count: int) -> Messages:
    """Multiply the units of each parent: `parents` (units,) says whose each is, 0 to `count` - 1, in order."""
    starts = np.searchsorted(parents, np.arange(count))
    precision = np.add.reduceat(units.precision, starts, axis=-1)
    weighted = np.add.reduceat(units.precision * units.centre, starts, axis=-1)
    # A parent whose units are all tabulated has no normal part: any centre does.
    centre = np.divide(weighted, precision, out=np.zeros_like(weighted), where=precision > 0.0)
    off = units.centre - np.repeat(centre, np.diff([*starts, len(parents)]), axis=-1)
    constant = np.add.reduceat(units.constant - 0.5 * units.precision * off**2, starts, axis=-1)
    of = parents[units.tabulated]
    tabulated = np.unique(of)
    shape = (*units.tables.shape[:-2], len(tabulated), units.tables.shape[-1])
    tables = np.zeros(shape)
    if len(tabulated):
        tables = np.add.reduceat(units.tables, np.searchsorted(of, tabulated), axis=-2)
    return Messages(precision, centre, constant, tables, tabulated)
