"""Contact laws read off the table of a family of master curves, one at a time or many at once.

A fit asks for a law at every step: `tabulated_law` reads one off the table of `curve_family`, `side_by_side` solves
for a few laws of one family in one call, and `family_batch` reads the curves of many parameter sets off the tables
of their cells, as samplers need them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import log
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.batch import CurveBatch
from underlay.mechanics.exact.contact_problem import ContactProblem, SolvedCurve
from underlay.mechanics.exact.curve_family import (
    Cell,
    CurveFamily,
    RigidBase,
    curve_family,
    range_end,
    range_number,
    range_numbers,
    ratio_number,
    ratio_numbers,
)
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import Factor, Stretch
from underlay.mechanics.exact.nodes import TABLES
from underlay.mechanics.exact.stored_curves import known_curve
from underlay.mechanics.indenters import PowerLaw, PowerLawShape
from underlay.mechanics.kernel import Family


def table_number(contact: Contact, depth: float) -> int:
    """Number of the range of varpi (half-space contact radius over thickness) whose table reaches `depth` (m)."""
    return range_number(float(contact.indenter.halfspace_radius(np.asarray(depth))) / contact.thickness)


def tabulated_law(
    contact: Contact, family: Family | None, ratio: float, depth: float, rtol: float, *, alone: bool = False
) -> ExactLaw | None:
    """Exact law of a power-law tip on one body of a family, read off its table or solved for and cached.

    Parameters
    ----------
    contact : Contact
        Of a power-law tip on one of them.
    family : Family or None
        The bodies, which differ in one ratio k; None for an isotropic layer on a rigid base, a single body.
    ratio : float
        The ratio k to use; that of `contact` is ignored.
    depth : float
        Depth (m) that must be reached; the law goes to the end of its cell.
    rtol : float
        Relative error allowed.
    alone : bool
        Whether no other ratio near this one will be needed: then it is solved directly, without a table over ratios
        and without the derivative in the ratio.

    Returns
    -------
    ExactLaw
        From a table it has dP/d ln k too. None where there is no table.
    """
    indenter, body, thickness, theta = contact.indenter, contact.isotropic, contact.thickness, contact.theta
    if not isinstance(indenter, PowerLawShape):
        return None
    reach = table_number(contact, depth)
    found: SolvedCurve | CurveFamily | None
    if family is None or alone:
        if family is None and body is None:
            return None
        one = family or RigidBase(body.layer.nu if body is not None else 0.0)
        found = _alone(indenter.exponent, one, 1.0 if family is None else ratio, reach, rtol)
    else:
        found = curve_family(Cell(indenter.exponent, family, ratio_number(ratio), reach, rtol))
    if found is None or found.error_estimate > rtol:
        return None
    how = "tabulated over what varies" if isinstance(found, CurveFamily) else "solved"
    return ExactLaw(
        method="exact",
        reason=f"exact contact problem, {how} for a/h up to {found.eps:.3g}, {found.resolution.radial} nodes",
        max_depth=float(indenter.abel(np.asarray(range_end(reach) * thickness))),
        error_estimate=found.error_estimate,
        measure=indenter,
        theta=theta,
        thickness=thickness,
        curve=found.curve(log(ratio)) if isinstance(found, CurveFamily) else found.curve,
        resolution=found.resolution,
    )


def side_by_side(
    contact: Contact, family: Family, ratios: Sequence[float], depth: float, rtol: float
) -> Callable[[FloatArray], FloatArray] | None:
    """Forces of several bodies of a family in one call, each solved directly (`tabulated_law` with ``alone=True``).

    One call for all bodies, since for few depths calls cost more than arithmetic.

    Parameters
    ----------
    contact, family, depth, rtol
        As in `tabulated_law`.
    ratios : sequence of float
        The ratio k of each body.

    Returns
    -------
    callable
        Depths (m), (laws, n), or (1, n) for all, to forces (N), (laws, n). None where one of the bodies has no
        curve.
    """
    indenter = contact.indenter
    if not isinstance(indenter, PowerLawShape):
        return None
    exponent, reach = indenter.exponent, table_number(contact, depth)
    key = ("side by side, alone", exponent, family, tuple(ratios), reach, rtol)

    def gathered() -> CurveBatch | None:
        solved = [_alone(exponent, family, ratio, reach, rtol) for ratio in ratios]
        known = [each for each in solved if each is not None and len(each.curve.edges) == 2]
        if len(known) < len(solved):
            return None
        tables = [each.curve.coefficients[0, : len(Factor)] for each in known]
        rows = max(table.shape[1] for table in tables)
        stretches = list(dict.fromkeys(each.curve.stretch for each in known))
        if len(stretches) > 1:
            stretches = [each.curve.stretch for each in known]
        return CurveBatch(
            PowerLaw(exponent, 1.0),
            range_end(reach),
            Stretch.of_all(stretches),
            np.stack([np.pad(table, ((0, 0), (0, rows - table.shape[1]), (0, 0))) for table in tables]),
            np.array([each.error_estimate for each in known]),
        )

    found = TABLES.get(key, gathered)
    if found is None:
        return None
    curves = replace(found, measure=indenter)
    return lambda w: curves.of_one_layer(w, contact.theta, contact.thickness)


def _alone(exponent: float, family: Family, ratio: float, reach: int, rtol: float) -> SolvedCurve | None:
    """Curve of a power-law tip on a layer of unit thickness, cached; None beyond a/h = 20, or at a fold."""
    key = ("alone", exponent, family, ratio, reach, rtol)
    return TABLES.get(key, lambda: _solved_alone(exponent, family, ratio, reach, rtol))


def _solved_alone(
    exponent: float, family: Family, ratio: float, reach: int, rtol: float
) -> SolvedCurve | None:
    problem = ContactProblem.of(PowerLaw(exponent, 1.0), 1.0, family.kernel(ratio))
    try:
        solved = known_curve(problem, range_end(reach), rtol)
    except RangeError:
        return None
    return None if solved.curve.jumps else solved


@dataclass(frozen=True)
class _SideBySide:
    """Tables of one tip and one family of bodies, stacked into arrays with one entry per cell.

    A cell without a table has an entry with an infinite error.

    varpi is the half-space contact radius at the depth over the thickness.

    k is the ratio in which the bodies of the family differ.

    Parameters
    ----------
    places : dict of (int, int) to int
        Index of a cell in the arrays, by the numbers of its ranges of ratio and of varpi.
    coefficients : ndarray (cells, ratio terms, 3, rows, 4)
        As in `CurveFamily`, for tables of one piece.
    middles, halves : ndarray (cells,)
        Middle and half length of the range of ln k.
    lengths, rates, tops, errors : ndarray (cells,)
        Stretch, largest varpi and error estimate of the curves; see `CurveBatch`.
    """

    places: dict[tuple[int, int], int] = field(default_factory=dict)
    coefficients: FloatArray = field(default_factory=lambda: np.zeros((0, 1, len(Factor), 1, 4)))
    middles: FloatArray = field(default_factory=lambda: np.zeros(0))
    halves: FloatArray = field(default_factory=lambda: np.zeros(0))
    lengths: FloatArray = field(default_factory=lambda: np.zeros(0))
    rates: FloatArray = field(default_factory=lambda: np.zeros(0))
    tops: FloatArray = field(default_factory=lambda: np.zeros(0))
    errors: FloatArray = field(default_factory=lambda: np.zeros(0))

    def with_table(self, cell: Cell, family: CurveFamily | None) -> Self:
        """Return a copy with one cell more; a table in several pieces is stored as if there were none."""
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
            self.places | {(cell.ratio, cell.range): len(self.places)},
            coefficients,
            np.append(self.middles, 0.5 * (low + high)),
            np.append(self.halves, 0.5 * (high - low)),
            np.append(self.lengths, 1.0 if stretch is None else stretch.length),
            np.append(self.rates, 0.0 if stretch is None else stretch.rate),
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
        The bodies, which differ in one ratio k.
    ratio, varpi : ndarray (sets,)
        k of each set, and its largest varpi, the half-space contact radius over the thickness.
    rtol : float
        Relative error asked for.
    slopes : bool
        Whether to give d ln P/d ln k as well.

    Returns
    -------
    CurveBatch
        With an infinite error estimate for sets without a table.
    """
    numbers = list(zip(ratio_numbers(ratio).tolist(), range_numbers(varpi).tolist(), strict=True))
    key = ("side by side", indenter.exponent, family, rtol)
    tables = TABLES.get(key, _SideBySide)
    missing = set(numbers) - tables.places.keys()
    for span, reach in missing:
        cell = Cell(indenter.exponent, family, int(span), int(reach), rtol)
        tables = tables.with_table(cell, curve_family(cell))
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
        Stretch(tables.lengths[places][:, None], tables.rates[places][:, None]),
        said[:, 0],
        tables.errors[places],
        said[:, 1:, Factor.FORCE] if slopes else None,
    )
