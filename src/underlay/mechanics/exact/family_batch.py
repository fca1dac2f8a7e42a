"""Master curves of many parameter sets at once, read off the tables of their cells."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.exact.curve_batch import CurveBatch
from underlay.mechanics.exact.curve_family import (
    Cell,
    CurveFamily,
    family_holding,
    range_numbers,
    ratio_numbers,
)
from underlay.mechanics.exact.master_curve import Factor
from underlay.mechanics.exact.tables import TABLES
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.kernel import Family

__all__ = ["family_batch"]

# Ranges per span of ratios in the number of a cell: any more than there are.
_RANGES = 1024


@dataclass(frozen=True)
class _SideBySide:
    """Tables of one tip and one family of bodies, side by side; every array has one entry a cell.

    A set without a table finds an entry with an infinite error.

    Parameters
    ----------
    places : dict of int to int
        Entry of a cell, by its number.
    coefficients : ndarray (cells, ratio terms, 3, rows, 4)
        In powers of the ratio's place in its span; see `CurveFamily`.
    middles, halves : ndarray (cells,)
        Of the span in ln k.
    lengths, softness, tops, errors : ndarray (cells,)
        Of the curves; see `CurveBatch`.
    """

    places: dict[int, int] = field(default_factory=dict)
    coefficients: FloatArray = field(default_factory=lambda: np.zeros((0, 1, len(Factor), 1, 4)))
    middles: FloatArray = field(default_factory=lambda: np.zeros(0))
    halves: FloatArray = field(default_factory=lambda: np.zeros(0))
    lengths: FloatArray = field(default_factory=lambda: np.zeros(0))
    softness: FloatArray = field(default_factory=lambda: np.zeros(0))
    tops: FloatArray = field(default_factory=lambda: np.zeros(0))
    errors: FloatArray = field(default_factory=lambda: np.zeros(0))

    def with_table(self, number: int, cell: Cell, family: CurveFamily | None) -> Self:
        """Return them with one table more; one in several pieces counts as none here."""
        if family is not None and len(family.edges) > 2:
            family = None
        low, high = cell.log_ratios
        flat = np.zeros((1, len(Factor), 1, 4)) if family is None else family.coefficients[:, 0]
        old = self.coefficients
        terms, rows = max(old.shape[1], flat.shape[0]), max(old.shape[3], flat.shape[2])
        coefficients = np.zeros((len(old) + 1, terms, len(Factor), rows, 4))
        coefficients[:-1, : old.shape[1], :, : old.shape[3]] = old
        coefficients[-1, : flat.shape[0], :, : flat.shape[2]] = flat
        stretch = None if family is None else family.stretch
        return type(self)(
            self.places | {number: len(self.places)},
            coefficients,
            np.append(self.middles, 0.5 * (low + high)),
            np.append(self.halves, 0.5 * (high - low)),
            np.append(self.lengths, 1.0 if stretch is None else stretch.length),
            np.append(self.softness, 0.0 if stretch is None else stretch.softness),
            np.append(self.tops, np.inf if family is None else cell.top),
            np.append(self.errors, np.inf if family is None else family.error_estimate),
        )


def family_batch(
    indenter: PowerLawShape,
    *,
    family: Family,
    ratio: FloatArray,
    varpi: FloatArray,
    rtol: float,
    slopes: bool = False,
) -> CurveBatch:
    """Master curves of many parameter sets, each from the table of its cell.

    Parameters
    ----------
    indenter : PowerLawShape
        The tip; its size may change from set to set through `CurveBatch.force`.
    family : Family
        The bodies.
    ratio, varpi : ndarray (sets,)
        Which of them, and the largest varpi.
    rtol : float
        Relative error asked for.
    slopes : bool
        Whether the curves say their derivative in the ratio.

    Returns
    -------
    CurveBatch
        With an infinite error estimate where there is no table.
    """
    spans, ranges = ratio_numbers(ratio), range_numbers(varpi)
    numbers = (spans * _RANGES + ranges).astype(np.int64).tolist()
    key = ("side by side", indenter.exponent, family, rtol)
    tables = TABLES.get(key, _SideBySide)
    missing = {number: first for first, number in enumerate(numbers) if number not in tables.places}
    for number, first in missing.items():
        cell = Cell(indenter.exponent, family, int(spans[first]), int(ranges[first]), rtol)
        tables = tables.with_table(number, cell, family_holding(cell))
    if missing:
        # Never changed but replaced, so that another thread finds it whole.
        TABLES.put(key, tables)
    places = np.array([tables.places[number] for number in numbers])
    table = tables.coefficients[places]
    position = (np.log(ratio) - tables.middles[places]) / tables.halves[places]
    orders = np.arange(table.shape[1])
    weights = np.zeros((ratio.size, 1 + slopes, orders.size))
    weights[:, 0] = position[:, None] ** orders
    if slopes:
        weights[:, 1, 1:] = orders[1:] * weights[:, 0, :-1] / tables.halves[places][:, None]
    said = (weights @ table.reshape(*table.shape[:2], -1)).reshape(ratio.size, -1, *table.shape[2:])
    return CurveBatch(
        indenter,
        tables.tops[places],
        tables.lengths[places][:, None],
        tables.softness[places][:, None],
        said[:, 0],
        tables.errors[places],
        said[:, 1:, Factor.FORCE] if slopes else None,
    )
