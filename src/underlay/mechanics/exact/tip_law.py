"""Laws of a sphere or a measured tip read off the tables of `tip_curves`: what a fit asks for at every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.batch import CurveBatch
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, too_wide
from underlay.mechanics.exact.curve_family import end_number, range_number
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import Factor, MasterCurve, Stretch
from underlay.mechanics.exact.tip_curves import TipContacts, TipCurves, tip_curves
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.kernel import Family

__all__ = ["TipLaw", "TipSlopes", "in_size", "tip_laws", "tip_range", "tips_side_by_side"]

# On a base this much softer than its layer a table takes up to 0.6 s, mostly to tell that it errs by too much: a
# law that is solved for takes 0.05.
_SOFTEST = 1e-5
# Ranges of varpi are finer than those of the tables: a sphere ends soon after it is asked.
_RANGES_PER_OCTAVE, _RANGE_EDGE = 4, 1.31
_SMALLEST = 0.02  # varpi: nothing is gained by less
# Where a curve of the tables ends because the contact is too wide the law ends too, no deeper than by so much.
_WIDE, _DEEPER = 0.9999 * LARGEST_EPS, 1.0005
#: A tip in its unit, number of the span in ln k, number of the range of varpi.
_Group: TypeAlias = tuple[Indenter, int | None, int]


@dataclass(frozen=True, kw_only=True)
class TipLaw(ExactLaw):
    """An exact law off the tables of the flat punch; beside dP/dw it knows dP/d ln k and dP/d ln(thickness)."""


class TipSlopes(NamedTuple):
    """P (N), dP/dw (N/m), dP/d ln k and dP/d ln(size of the tip) (N), each (laws, n)."""

    force: FloatArray
    stiffness: FloatArray
    in_ratio: FloatArray
    in_size: FloatArray


def tips_side_by_side(laws: Sequence[TipLaw], depth: FloatArray) -> TipSlopes:
    """Forces and their derivatives of several laws in one call.

    Parameters
    ----------
    laws : sequence of TipLaw
        One for each row.
    depth : ndarray (laws, n)
        Indentation depths (m).

    Returns
    -------
    TipSlopes
        Each entry (laws, n).
    """
    count, first = len(laws), laws[0]
    tables = [law.curve.coefficients[0] for law in laws]
    coefficients = np.zeros((count, len(tables[0]), max(table.shape[1] for table in tables), 4))
    for into, table in zip(coefficients, tables, strict=True):
        into[:, : table.shape[1]] = table
    factors = len(Factor)
    batch = CurveBatch(
        first.measure,
        np.inf,
        Stretch.of_all([law.curve.stretch for law in laws]),
        coefficients[:, :factors],
        np.zeros(count),
        coefficients[:, factors:],
    )
    thickness, theta = (np.array([getattr(law, name) for law in laws]) for name in ("thickness", "theta"))
    abel = np.array([law.measure.abel_coefficient for law in laws])
    w = np.maximum(depth, 0.0)
    force, stiffness, slopes = batch.with_slopes(w, theta, thickness, abel)
    return TipSlopes(force, stiffness, slopes[:, 0], in_size(w, force, stiffness, slopes[:, 1]))


def in_size(
    depth: FloatArray, force: FloatArray, stiffness: FloatArray, in_thickness: FloatArray
) -> FloatArray:
    """dP/d ln(size of the tip) (N) from P (N), dP/dw (N/m) and dP/d ln(thickness) (N) at depths (m).

    All lengths together scale the force with their square.
    """
    return np.asarray(2.0 * force - depth * stiffness - in_thickness)


def tip_range(contact: Contact, depth: float) -> int:
    """Number of the range of varpi that reaches `depth` (m): the `octave` of `TipContacts`."""
    varpi = float(contact.indenter.power_law.halfspace_radius(np.asarray(depth))) / contact.thickness
    return ceil(_RANGES_PER_OCTAVE * log(max(varpi, _SMALLEST) / _RANGE_EDGE) / log(2.0))


def tip_laws(
    contacts: Sequence[Contact],
    family: Family,
    ratios: Sequence[float] | None,
    depths: Sequence[float],
    rtol: float,
) -> list[TipLaw | RangeError | None]:
    """Exact laws of contacts of one tip, of any size and on layers of any thickness, all at once.

    Parameters
    ----------
    contacts : sequence of Contact
        Of tips of one shape on bodies of one family.
    family : Family
        The bodies.
    ratios : sequence of float or None
        Which of them; None for a family of one.
    depths : sequence of float
        Depth (m) that each must reach; it goes to the end of its range.
    rtol : float
        Relative error allowed.

    Returns
    -------
    list of TipLaw, RangeError or None
        Why there is no law so deep; None where the tables do not reach, or not to `rtol`.
    """
    laws: list[TipLaw | RangeError | None] = [None] * len(contacts)
    tops = [
        _RANGE_EDGE * 2.0 ** (tip_range(contact, depth) / _RANGES_PER_OCTAVE)
        for contact, depth in zip(contacts, depths, strict=True)
    ]
    groups: dict[_Group, list[int]] = {}
    for row, contact in enumerate(contacts):
        if ratios is not None and ratios[row] < _SOFTEST:
            continue
        span = None if ratios is None else end_number(ratios[row])
        groups.setdefault((contact.indenter.in_its_unit()[0], span, range_number(tops[row])), []).append(row)
    for (tip, span, octave), members in groups.items():
        log_ratios = np.zeros(len(members)) if ratios is None else np.log([ratios[row] for row in members])
        thickness = np.array(
            [contacts[row].thickness / contacts[row].indenter.in_its_unit()[1] for row in members]
        )
        asked = TipContacts(
            tip,
            family,
            span,
            octave,
            rtol,
            log_ratios,
            thickness,
            np.array([tops[row] for row in members]),
        )
        for rows, found in tip_curves(asked):
            for place, member in enumerate(rows.tolist()):
                row = members[member]
                laws[row] = _law(contacts[row], found, place, depths[row], rtol)
    return laws


def _law(
    contact: Contact, found: TipCurves, place: int, depth: float, rtol: float
) -> TipLaw | RangeError | None:
    """One of the curves as a law, or why there is none so deep; None where it errs by more, or ends before."""
    batch, measure = found.batch, contact.indenter.power_law
    if len(batch.error_estimate) > 1:
        batch = batch.part([place])
    error, slopes = float(batch.error_estimate[0]), batch.slopes
    max_depth = float(measure.abel(np.asarray(batch.top)[0] * contact.thickness))
    if depth > _DEEPER * max_depth and found.eps[place] >= _WIDE:
        return too_wide(depth, max_depth)
    if slopes is None or not error <= rtol or max_depth < depth:
        return None
    stretch = Stretch(float(batch.stretch.length[0, 0]), float(batch.stretch.softness[0, 0]))
    tables = np.concatenate((batch.coefficients, slopes), axis=1)
    return TipLaw(
        method="exact",
        reason=f"exact contact problem, off tables of the flat punch for a/h up to {found.eps[place]:.3g}",
        max_depth=max_depth,
        error_estimate=error,
        measure=measure,
        theta=contact.theta,
        thickness=contact.thickness,
        curve=MasterCurve(stretch, (-1.0, 1.0), tables, error),
        resolution=found.resolution,
        radii=found.radii,
    )
