"""Contact laws read off tables, one at a time or many at once.

A fit asks for a law at every step: `tabulated_law` reads one off the table of `curve_family`, `side_by_side` solves
for a few laws of one family in one call, and `family_batch` reads the curves of many parameter sets off the tables
of their cells, as samplers need them.

Laws of spheres and measured tips are read off the tables of `tip_curves` (`tip_laws`, `TipSets`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.batch import CurveBatch
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, SolvedCurve, too_wide
from underlay.mechanics.exact.curve_family import (
    Cell,
    CurveFamily,
    RigidBase,
    curve_family,
    end_numbers,
    range_end,
    range_number,
    range_numbers,
    ratio_number,
    ratio_numbers,
    solved_alone,
)
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import Factor, MasterCurve, Stretch
from underlay.mechanics.exact.nodes import TABLES
from underlay.mechanics.exact.tip_curves import TipContacts, TipCurves, tip_curves
from underlay.mechanics.indenters import Indenter, PowerLaw, PowerLawShape
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
        found = solved_alone(indenter.exponent, one, 1.0 if family is None else ratio, reach, rtol)
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
        solved = [solved_alone(exponent, family, ratio, reach, rtol) for ratio in ratios]
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


class _Stacked(NamedTuple):
    """Tables of one tip and one family of bodies as arrays with one entry per cell.

    varpi is the half-space contact radius at the depth over the thickness.

    k is the ratio in which the bodies of the family differ.

    Parameters
    ----------
    cells : tuple of Cell
        Their keys.
    coefficients : ndarray (cells, ratio terms, 3, rows, 4)
        As in `CurveFamily`, for tables of one piece.
    middles, halves : ndarray (cells,)
        Middle and half length of the range of ln k.
    lengths, rates, tops, errors : ndarray (cells,)
        Stretch, largest varpi and error estimate of the curves; see `CurveBatch`.
    """

    cells: tuple[Cell, ...]
    coefficients: FloatArray
    middles: FloatArray
    halves: FloatArray
    lengths: FloatArray
    rates: FloatArray
    tops: FloatArray
    errors: FloatArray


def _stacked(cells: tuple[Cell, ...]) -> _Stacked:
    """Stack the tables of some cells; one without a table, or in several pieces, has an infinite error."""
    tables = [curve_family(cell) for cell in cells]
    known = [(i, table) for i, table in enumerate(tables) if table is not None and len(table.edges) == 2]
    terms = max((len(table.coefficients) for _, table in known), default=1)
    rows = max((table.coefficients.shape[3] for _, table in known), default=1)
    coefficients = np.zeros((len(cells), terms, len(Factor), rows, 4))
    lengths, rates, tops, errors = (np.full(len(cells), value) for value in (1.0, 0.0, np.inf, np.inf))
    for i, table in known:
        own = table.coefficients[:, 0]
        coefficients[i, : own.shape[0], :, : own.shape[2]] = own
        lengths[i], rates[i] = table.stretch.length, table.stretch.rate
        tops[i], errors[i] = table.cell.top, table.error_estimate
    low, high = np.array([cell.log_ratios for cell in cells]).T
    return _Stacked(cells, coefficients, 0.5 * (low + high), 0.5 * (high - low), lengths, rates, tops, errors)


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
    order = {number: place for place, number in enumerate(sorted(set(numbers)))}
    cells = tuple(Cell(indenter.exponent, family, int(span), int(reach), rtol) for span, reach in order)
    key = ("stacked", indenter.exponent, family, rtol)
    tables = TABLES.get(key, lambda: _stacked(cells))
    if tables.cells != cells:
        # The last alone are kept: a search stays among its cells, and a sampler would fill the store with stacks.
        tables = TABLES.put(key, _stacked(cells))
    places = np.array([order[number] for number in numbers])
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


# On a base this much softer than its layer a table takes up to 0.6 s, mostly to tell that it errs by too much: a
# law that is solved for takes 0.05.
_SOFTEST = 1e-5
# Ranges of varpi are finer than those of the tables: a sphere ends soon after it is asked.
_RANGES_PER_OCTAVE, _RANGE_EDGE = 4, 1.31
_SMALLEST = 0.02  # varpi: nothing is gained by less
# Where a curve of the tables ends because the contact is too wide the law ends too, no deeper than by so much.
_WIDE, _DEEPER = 0.9999 * LARGEST_EPS, 1.0005


def in_size(
    depth: FloatArray, force: FloatArray, stiffness: FloatArray, in_thickness: FloatArray
) -> FloatArray:
    """dP/d ln(size of the tip) (N) from P (N), dP/dw (N/m) and dP/d ln(thickness) (N) at depths (m).

    By dimensions: multiplying all lengths by a factor multiplies the force by its square.
    """
    return np.asarray(2.0 * force - depth * stiffness - in_thickness)


def tip_range(contact: Contact, depth: float) -> int:
    """Number of the range of varpi that reaches `depth` (m): laws are made up to the end of a range.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    varpi = contact.indenter.power_law.halfspace_radius(np.asarray(depth)) / contact.thickness
    return int(_ranges(varpi))


def _ranges(varpi: FloatArray) -> FloatArray:
    """Numbers of the ranges that reach the given values of varpi, as whole floats; a law covers its whole range.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    return np.asarray(np.ceil(_RANGES_PER_OCTAVE * np.log2(np.maximum(varpi, _SMALLEST) / _RANGE_EDGE)))


class TipSlopes(NamedTuple):
    """Force, dP/dw, dP/d ln k and dP/d ln(size of the tip), each (sets, n), and which sets have them, (sets,).

    Of layers with elastic constant theta = 1 and lengths in units of the tip: multiply force and its derivatives by
    theta times the unit squared, dP/dw by theta times the unit. k is the ratio in which the bodies of the family
    differ.
    """

    force: FloatArray
    stiffness: FloatArray
    in_ratio: FloatArray
    in_size: FloatArray
    known: NDArray[np.bool_]


@dataclass(frozen=True)
class TipSets:
    """Contacts of one tip on layers of any thickness and bodies of one family, each with a largest depth.

    Parameters
    ----------
    tip : Indenter
        Scaled to its own unit of length (`Indenter.in_its_unit`).
    family : Family
        The bodies, which differ in one ratio.
    ratio : ndarray (sets,) or None
        That ratio for each set; None for a family with a single member.
    thickness, depth : ndarray (sets,)
        Thickness of the layer, and the depth that the curve must reach, both in the tip's unit.
    rtol : float
        Relative error allowed.
    """

    tip: Indenter
    family: Family
    ratio: FloatArray | None
    thickness: FloatArray
    depth: FloatArray
    rtol: float

    def curves(self) -> Iterator[tuple[NDArray[np.intp], TipCurves]]:
        """Iterate over (row numbers of sets, their curves) from the tables, each curve up to the end of its range.

        A set may come again with a finer curve, which replaces the earlier one; a set for which there is no table
        never comes.
        """
        varpi = self.tip.power_law.halfspace_radius(self.depth) / self.thickness
        top = _RANGE_EDGE * 2.0 ** (_ranges(varpi) / _RANGES_PER_OCTAVE)
        octave, span, log_ratio = range_numbers(top), np.zeros(len(top)), np.zeros(len(top))
        known = np.ones(len(top), dtype=bool)
        if self.ratio is not None:
            known = self.ratio >= _SOFTEST
            span, log_ratio = end_numbers(self.ratio), np.log(self.ratio)
        for own_span, own_octave in sorted(
            set(zip(span[known].tolist(), octave[known].tolist(), strict=True))
        ):
            rows = np.flatnonzero(known & (span == own_span) & (octave == own_octave))
            asked = TipContacts(
                self.tip,
                self.family,
                None if self.ratio is None else int(own_span),
                int(own_octave),
                self.rtol,
                log_ratio[rows],
                self.thickness[rows],
                top[rows],
            )
            for inner, found in tip_curves(asked):
                yield rows[inner], found

    def forces(
        self, depth: FloatArray, *, stiffness: bool
    ) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Force and dP/dw of all sets on layers of elastic constant theta = 1, and which sets the tables cover.

        Parameters
        ----------
        depth : ndarray (sets, n)
            Indentation depths in the tip's unit, none beyond the set's largest, `TipSets.depth`.
        stiffness : bool
            Whether to compute dP/dw; else it is zero.

        Returns
        -------
        tuple of ndarray
            Force in the unit squared and dP/dw in the unit, each (sets, n), zero for sets without a table, and a
            mask (sets,) of those with one.
        """
        force, slope, known = np.zeros(depth.shape), np.zeros(depth.shape), np.zeros(len(depth), dtype=bool)
        for rows, batch in self._known():
            arguments = depth[rows], np.ones(rows.size), self.thickness[rows]
            force[rows], known[rows] = batch.force(*arguments), True
            if stiffness:
                slope[rows] = batch.stiffness(*arguments)
        return force, slope, known

    def with_slopes(self, depth: FloatArray) -> TipSlopes:
        """Forces and their derivatives at `depth` (sets, n), in the tip's unit, as in `forces`."""
        force, stiffness, in_ratio, size, known = (
            *np.zeros((4, *depth.shape)),
            np.zeros(len(depth), dtype=bool),
        )
        for rows, batch in self._known():
            w = np.maximum(depth[rows], 0.0)
            P, S, slopes = batch.with_slopes(w, np.ones(rows.size), self.thickness[rows])
            force[rows], stiffness[rows], in_ratio[rows] = P, S, slopes[:, 0]
            size[rows], known[rows] = in_size(w, P, S, slopes[:, 1]), True
        return TipSlopes(force, stiffness, in_ratio, size, known)

    def _known(self) -> Iterator[tuple[NDArray[np.intp], CurveBatch]]:
        """Iterate over (row numbers of sets, their curves), of those within `rtol` and deep enough."""
        for rows, found in self.curves():
            batch = found.batch
            end = batch.measure.abel(np.broadcast_to(batch.top, rows.size) * self.thickness[rows])
            fine = np.flatnonzero((batch.error_estimate <= self.rtol) & (self.depth[rows] <= end))
            if fine.size:
                yield rows[fine], batch if fine.size == rows.size else batch.part(fine.tolist())


def tip_laws(
    contacts: Sequence[Contact],
    family: Family,
    ratios: Sequence[float] | None,
    depths: Sequence[float],
    rtol: float,
) -> list[ExactLaw | RangeError | None]:
    """Exact laws of contacts of one tip, of any size and on layers of any thickness, all at once.

    Parameters
    ----------
    contacts : sequence of Contact
        Of tips of one shape on bodies of one family.
    family : Family
        The bodies, which differ in one ratio.
    ratios : sequence of float or None
        That ratio for each contact; None for a family with a single member.
    depths : sequence of float
        Depth (m) that each law must reach; it goes to the end of its range.
    rtol : float
        Relative error allowed.

    Returns
    -------
    list of ExactLaw, RangeError or None
        For each contact its law; or an error (returned, not raised) where a/h would pass 20 at that depth; or None
        where the tables do not reach the depth, or not to `rtol`.
    """
    laws: list[ExactLaw | RangeError | None] = [None] * len(contacts)
    unit = np.array([contact.indenter.in_its_unit()[1] for contact in contacts])
    asked = TipSets(
        contacts[0].indenter.in_its_unit()[0],
        family,
        None if ratios is None else np.asarray(ratios, dtype=np.float64),
        np.array([contact.thickness for contact in contacts]) / unit,
        np.asarray(depths) / unit,
        rtol,
    )
    for rows, found in asked.curves():
        for place, row in enumerate(rows.tolist()):
            laws[row] = _law(contacts[row], found, place, depths[row], rtol)
    return laws


def _law(
    contact: Contact, found: TipCurves, place: int, depth: float, rtol: float
) -> ExactLaw | RangeError | None:
    """Law made of curve number `place` of `found`; an error where a/h would pass 20 at `depth` (m).

    None where the curve errs by more than `rtol`, ends before `depth`, or has no derivatives.
    """
    batch, measure = found.batch, contact.indenter.power_law
    if len(batch.error_estimate) > 1:
        batch = batch.part([place])
    error, slopes = float(batch.error_estimate[0]), batch.slopes
    max_depth = float(measure.abel(np.asarray(batch.top)[0] * contact.thickness))
    if depth > _DEEPER * max_depth and found.eps[place] >= _WIDE:
        return too_wide(depth, max_depth)
    if slopes is None or not error <= rtol or max_depth < depth:
        return None
    stretch = Stretch(float(batch.stretch.length[0, 0]), float(batch.stretch.rate[0, 0]))
    tables = np.concatenate((batch.coefficients, slopes), axis=1)
    return ExactLaw(
        method="exact",
        reason=f"exact contact problem, interpolated in tables of flat punches up to a/h = {found.eps[place]:.3g}",
        max_depth=max_depth,
        error_estimate=error,
        measure=measure,
        theta=contact.theta,
        thickness=contact.thickness,
        curve=MasterCurve(stretch, (-1.0, 1.0), tables, error),
        resolution=found.resolution,
    )
