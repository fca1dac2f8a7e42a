"""Hierarchical model of one group: ln of the parameter is a mean plus a step per animal, per site, per curve.

Every step is normal with the spread (standard deviation) of its level; the mean has a flat prior. Spreads are
integrated over a grid, the steps and the mean analytically or on a grid (`messages`), so there is no Markov chain
and no randomness in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.population.likelihood import CurveLikelihood
from underlay.inference.population.messages import (
    BETWEEN,
    WITHIN,
    Grid,
    IntArray,
    Messages,
    SpreadGrid,
    SpreadPrior,
    Windows,
    carried,
    multiplied_tables,
    spread_windows,
    weighted_grid,
)
from underlay.inference.population.result import Density

_LOG_2PI = float(np.log(2.0 * np.pi))
# For outliers: share of the curves that may come from a wider step, and the factor on its spread.
_OUTLIERS, _WIDER = 0.1, 5.0
# Largest and smallest cell in ln of the parameter; between these it is half the width of the narrowest likelihood,
# which adds two per cent to its variance.
_WIDEST, _NARROWEST = 0.05, 0.01
# For locating the spreads: factor on the width of cells, and least scatter of curves (in ln).
_LARGER, _LEAST = 2.5, 0.05
# Extent (in ln) of the fine part of a grid beyond the curves' middles, of the coarse part beyond that, and ratio of
# neighbouring coarse cells.
_FINE, _COARSE, _GROWTH = 1.0, 8.0, 1.25
# Number of grid points for a mean, their extent in its standard deviations, and log units below the largest weight
# from which a combination of spreads is left out.
_PLACES, _FAR, _NEGLIGIBLE = 801, 9.0, 30.0


@dataclass(frozen=True)
class Units:
    """How the curves of a group nest in units (animals, sites), for each level, outermost first.

    Parameters
    ----------
    names : tuple of tuple of tuple of str
        Labels of each unit of each level, outermost first.
    parents : tuple of ndarray of int
        For each level, the index of its unit that each unit of the level below belongs to; below the innermost
        level are the curves.
    """

    names: tuple[tuple[tuple[str, ...], ...], ...]
    parents: tuple[IntArray, ...]

    @classmethod
    def of(cls, labels: Sequence[tuple[str, ...]]) -> tuple[Units, IntArray]:
        """Units of curves with these labels, and the order of the curves in which each unit's are adjacent."""
        order = np.array(sorted(range(len(labels)), key=lambda i: labels[i]), dtype=int)
        below: list[tuple[str, ...]] = [labels[i] for i in order]
        names, parents = [], []
        for depth in range(len(labels[0]), 0, -1):
            heads = [label[:depth] for label in below]
            distinct = list(dict.fromkeys(heads))
            place = {head: number for number, head in enumerate(distinct)}
            parents.append(np.array([place[head] for head in heads], dtype=int))
            names.append(tuple(distinct))
            below = distinct
        return cls(tuple(names[::-1]), tuple(parents[::-1])), order

    def freedoms(self, curves: int) -> list[int]:
        """Degrees of freedom of the scatter within the units of each level, outermost first, of `curves` curves.

        Each is the number of members of the level below less the number of units.
        """
        counts = [*(len(names) for names in self.names), curves]
        return [below - above for above, below in pairwise(counts)]


class GroupModel:
    """Posterior of the mean and the spreads of ln of a parameter in one group of curves.

    Parameters
    ----------
    curves : sequence of CurveLikelihood
        Likelihood of every curve.
    labels : sequence of tuple of str
        Labels of every curve, outermost first (animal, site); empty tuples where curves are independent.
    outliers : bool
        Whether a tenth of the curves may come from steps five times as wide.
    between : SpreadPrior
        Prior of the spread of every level of units.
    rough : bool
        Whether coarse tables suffice, as for locating the spreads.
    """

    def __init__(
        self,
        curves: Sequence[CurveLikelihood],
        labels: Sequence[tuple[str, ...]],
        *,
        outliers: bool = False,
        between: SpreadPrior = BETWEEN,
        rough: bool = False,
    ) -> None:
        self.units, order = Units.of(labels)
        self.curves = [curves[i] for i in order]
        self._outliers = outliers
        self._middles = np.array([curve.middle for curve in self.curves])
        self._errors = np.array([curve.error for curve in self.curves])
        self._normal = np.array([curve.is_normal for curve in self.curves])
        self._priors = (between,) * len(self.units.names) + (WITHIN,)
        self._is_rough = rough
        self._rough = partial(GroupModel, curves, labels, outliers=outliers, between=between, rough=True)
        self._known: dict[str, tuple[tuple[bytes, ...], Messages]] = {}

    @cached_property
    def spreads(self) -> SpreadGrid:
        """Posterior of the spreads of each level of units, outermost first, and of the curves."""
        return weighted_grid(self.log_evidence, self._priors, self._windows)

    @cached_property
    def _windows(self) -> Windows:
        return spread_windows(self._rough().log_evidence, self._priors)

    @cached_property
    def mean(self) -> Density:
        """Posterior of ln of the geometric mean of the group."""
        top = self._top(self.spreads.nodes)
        weights = self.spreads.weights.ravel()
        kept = weights > np.exp(-_NEGLIGIBLE) * weights.max()
        return _mixture(_flat(top, kept), weights[kept], self._grid)

    def unit_values(self) -> tuple[FloatArray, FloatArray]:
        """Posterior mean and standard deviation (units,) of ln of each outermost unit, shrunk to the group's mean.

        Raises
        ------
        IndexError
            If the curves have no labels.
        """
        nodes = self.spreads.nodes
        below = self._messages(nodes[1:])  # of the outermost units, not yet blurred by their spread
        centre, variance = self._as_normal(below)
        between = nodes[0].reshape(-1, *([1] * (centre.ndim - 1)), 1)
        seen = 1.0 / (variance + between**2)
        total = seen.sum(axis=-1, keepdims=True)
        mean, mean_variance = (seen * centre).sum(axis=-1, keepdims=True) / total, 1.0 / total
        own = between**2 * seen
        values = own * centre + (1.0 - own) * mean
        variances = own * variance + (1.0 - own) ** 2 * mean_variance
        weights = self.spreads.weights[..., None]
        axes = tuple(range(self.spreads.weights.ndim))
        average = (weights * values).sum(axis=axes)
        spread = (weights * (variances + (values - average) ** 2)).sum(axis=axes)
        return average, np.sqrt(spread)

    def own_values(self, spreads: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Ln of each outermost unit from its own curves only, and its variance, (units,), at given spreads."""
        nodes = tuple(np.array([max(spread, 1e-3)]) for spread in spreads)
        centre, variance = self._as_normal(self._messages(nodes))
        return centre.reshape(-1), variance.reshape(-1)

    def log_evidence(self, nodes: tuple[FloatArray, ...]) -> FloatArray:
        """Log-likelihood of every combination of spreads, one axis per level, with the mean integrated out."""
        top = self._top(nodes)
        if not len(top.tabulated):
            return np.asarray((top.constant + 0.5 * (_LOG_2PI - np.log(top.precision)))[..., 0])
        x = self._grid.x
        whole = _whole(top, x)
        largest = whole.max(axis=-1)
        widths = self._grid.widths
        return np.asarray(largest + np.log((np.exp(whole - largest[..., None]) * widths).sum(axis=-1)))

    def _once(
        self, what: str, nodes: tuple[FloatArray, ...], make: Callable[[tuple[FloatArray, ...]], Messages]
    ) -> Messages:
        """The result of `make` at some nodes, stored under the name `what` and reused for the same nodes."""
        asked = tuple(each.tobytes() for each in nodes)
        if what not in self._known or self._known[what][0] != asked:
            self._known[what] = asked, make(nodes)
        return self._known[what][1]

    def _top(self, nodes: tuple[FloatArray, ...]) -> Messages:
        """Likelihood of the group's mean at all combinations of spreads."""
        return self._once("top", nodes, self._gathered)

    def _messages(self, nodes: tuple[FloatArray, ...]) -> Messages:
        """Likelihoods of the outermost units, not yet blurred by their spread; `nodes` of all levels below."""
        return self._once("units", nodes, self._carried)

    def _gathered(self, nodes: tuple[FloatArray, ...]) -> Messages:
        """The product of the outermost units' likelihoods, each blurred by their spread."""
        if not self.units.names:
            return self._of_curves(nodes[0], np.zeros(len(self.curves), dtype=int), 1)
        count = len(self.units.names[0])
        return carried(self._messages(nodes[1:]), nodes[0], np.zeros(count, dtype=int), 1, self._grid)

    def _carried(self, nodes: tuple[FloatArray, ...]) -> Messages:
        """Likelihoods of the outermost units, from those of the curves through all levels between."""
        inward = zip(self.units.names, self.units.parents, nodes, strict=True)
        (names, parents, within), *further = list(inward)[::-1]
        units = self._of_curves(within, parents, len(names))
        for names, parents, spreads in further:
            units = carried(units, spreads, parents, len(names), self._grid)
        return units

    def _of_curves(self, within: FloatArray, parents: IntArray, count: int) -> Messages:
        """Likelihoods of the innermost units, (spreads, units), from those of their curves."""
        normal = self._normal & (not self._outliers)
        precision = np.where(normal, 1.0 / np.where(self._normal, self._errors, 1.0) ** 2, 0.0)
        constant = np.zeros(len(self.curves))
        if not self._outliers:
            curves = Messages(
                precision, self._middles, constant, self._open_logarithms, np.flatnonzero(~normal)
            )
            return carried(curves, within, parents, count, self._grid)
        none = np.zeros((len(within), count))
        tables = multiplied_tables(self._tolerant_tables(within), within, parents, self._grid)
        return Messages(none, none, none, tables, np.arange(count))

    def _tolerant_tables(self, within: FloatArray) -> Iterator[FloatArray]:
        """Log-likelihoods of all curves (curves, places) for each spread, under a mixture that allows outliers."""
        plain, wide = (
            self._grid.blurred(self._open_logarithms, within, wider=wider) for wider in (1.0, _WIDER)
        )
        for spread, near, far in zip(within.tolist(), plain, wide, strict=True):
            x = self._grid.x[self._grid.places(spread)]
            yield np.logaddexp(
                np.log1p(-_OUTLIERS) + self._with_normal_ones(near, x, spread),
                np.log(_OUTLIERS) + self._with_normal_ones(far, x, _WIDER * spread),
            )

    def _with_normal_ones(self, open_ones: FloatArray, x: FloatArray, spread: float) -> FloatArray:
        """Blurred log-likelihoods of all curves, (curves, x): `open_ones` as given, normal ones in closed form."""
        tables = np.empty((len(self.curves), len(x)))
        tables[~self._normal] = open_ones
        errors = self._errors[self._normal]
        variance = errors**2 + spread**2
        off = x - self._middles[self._normal, None]
        tables[self._normal] = -0.5 * off**2 / variance[:, None] + np.log(errors / np.sqrt(variance))[:, None]
        return tables

    @cached_property
    def _open_logarithms(self) -> FloatArray:
        """Log-likelihoods on the grid of the curves that are not normal, without blur, (curves, x)."""
        open_ones = np.flatnonzero(~self._normal)
        tables = [self.curves[i].log_at(self._grid.x) for i in open_ones]
        return np.array(tables).reshape(len(tables), len(self._grid.x))

    @cached_property
    def _grid(self) -> Grid:
        """Grid of ln of the parameter for tables: fine where the curves are, coarse far beyond."""
        if self._normal.all() and not self._outliers:
            return Grid(np.zeros(0), 0.0, 1.0, 1)
        step = _WIDEST
        if self.units.names:
            least = _LEAST if self._is_rough else math.exp(self._windows[-1][0])
            weights = 1.0 / (np.minimum(self._errors, 1.0) ** 2 + least**2)
            finest = 0.5 / math.sqrt(np.bincount(self.units.parents[-1], weights).max())
            step = min(max(finest, _NARROWEST), _WIDEST)
        if self._is_rough:
            step *= _LARGER
        low, high = self._middles.min() - _FINE, self._middles.max() + _FINE
        count = int(np.ceil((high - low) / step)) + 1
        further = int(np.ceil(np.log1p(_COARSE * (_GROWTH - 1.0) / step) / np.log(_GROWTH)))
        return Grid(np.cumsum(step * _GROWTH ** np.arange(1, further + 1)), low, step, count)

    def _as_normal(self, units: Messages) -> tuple[FloatArray, FloatArray]:
        """Mean and variance of every unit's likelihood, by numerical moments where it is tabulated."""
        precision = np.where(units.precision > 0.0, units.precision, 1.0)
        centre, variance = np.array(units.centre), 1.0 / precision
        if len(units.tabulated):
            x, widths = self._grid.x, self._grid.widths
            of = units.tabulated
            whole = (
                -0.5 * units.precision[..., of, None] * (x - units.centre[..., of, None]) ** 2 + units.tables
            )
            shares = np.exp(whole - whole.max(axis=-1, keepdims=True)) * widths
            shares /= shares.sum(axis=-1, keepdims=True)
            mean = (shares * x).sum(axis=-1)
            centre[..., of] = mean
            variance[..., of] = (shares * (x - mean[..., None]) ** 2).sum(axis=-1)
        return centre, variance


def _flat(top: Messages, kept: NDArray[np.bool_]) -> Messages:
    """Messages of a group with all combinations of spreads on one axis, of which those in the mask are kept."""
    length = top.tables.shape[-1]
    tables = top.tables.reshape(-1, len(top.tabulated), length)[kept] if len(top.tabulated) else top.tables
    parts = (part[..., 0].reshape(-1)[kept] for part in (top.precision, top.centre, top.constant))
    precision, centre, constant = (part[:, None] for part in parts)
    return Messages(precision, centre, constant, tables, top.tabulated)


def _whole(top: Messages, x: FloatArray) -> FloatArray:
    """Logarithm of a group's likelihood, normal part and tables together, (..., x)."""
    result: FloatArray = top.constant - 0.5 * top.precision * (x - top.centre) ** 2 + top.tables[..., 0, :]
    return result


def _mixture(top: Messages, weights: FloatArray, grid: Grid) -> Density:
    """Posterior of the mean: a mixture over the spreads' weights, each component normal or tabulated."""
    if len(top.tabulated):
        x, widths = grid.x, grid.widths
        whole = _whole(top, x)
        each = np.exp(whole - whole.max(axis=-1, keepdims=True)) * widths
    else:
        spread = 1.0 / np.sqrt(top.precision[:, 0])
        low, high = (top.centre[:, 0] - _FAR * spread).min(), (top.centre[:, 0] + _FAR * spread).max()
        # Sinh-spaced about the middle: the sum has narrow and wide parts.
        middle, narrow = float(weights @ top.centre[:, 0]), float(spread.min())
        reach = max(high - middle, middle - low)
        x = middle + narrow * np.sinh(np.linspace(-1.0, 1.0, _PLACES) * np.arcsinh(reach / narrow))
        each = np.exp(-0.5 * top.precision * (x - top.centre) ** 2) * np.gradient(x)
    shares = weights @ (each / each.sum(axis=-1, keepdims=True))
    return Density(x, shares / shares.sum())
