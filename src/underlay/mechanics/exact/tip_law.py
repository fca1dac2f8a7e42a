"""Laws of a sphere or a measured tip read off tables (`tip_curves`): what a fit asks for at every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, exp, log
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.contact_curve import too_wide
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, depth_measure
from underlay.mechanics.exact.curve_batch import CurveBatch
from underlay.mechanics.exact.curve_family import range_number, ratio_number
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import MasterCurve, Stretch
from underlay.mechanics.exact.tip_curves import TipContacts, TipCurves, tip_curves
from underlay.mechanics.indenters import Indenter, Sphere
from underlay.mechanics.kernel import Family

__all__ = ["TipLaw", "TipSlopes", "tip_laws", "tip_range", "tips_side_by_side"]

# Ranges of varpi are finer than those of the tables: a sphere ends soon after it is asked.
_RANGES_PER_OCTAVE, _RANGE_EDGE = 4, 1.31
_SMALLEST = 0.02  # varpi: nothing is gained by less
# Where a curve of the tables ends because the contact is too wide the law ends too, no deeper than by so much.
_WIDE, _DEEPER = 0.9999 * LARGEST_EPS, 1.0005
# Of ln k and ln h: a difference of polynomials, whose truncation is 1e-7 of the derivative and rounding 1e-9.
_STEP = 1e-7


@dataclass(frozen=True, kw_only=True)
class TipLaw(ExactLaw):
    """An exact law off the tables of the flat punch, with its derivatives in the ratio and in the tip's size.

    Parameters
    ----------
    neighbours : CurveBatch
        Curves of this contact, of that a step further in ln k, and of that a step further in ln h.
    """

    neighbours: CurveBatch

    def ratio_slope(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/d ln k (N) at fixed depth (m), (n,), where the force (N) is `force`; zero out of contact."""
        return np.asarray(force * self._slope(depth, 1, self.thickness))

    def size_slope(self, depth: FloatArray, force: FloatArray, stiffness: FloatArray) -> FloatArray:
        """dP/d ln(size of the tip) (N) at fixed depth (m) and thickness, (n,).

        All lengths together scale the force with their square, P(s w; s R, s h) = s^2 P.
        """
        slope = self._slope(depth, 2, self.thickness * exp(_STEP))
        return np.asarray(2.0 * force - depth * stiffness - force * slope)

    def _slope(self, depth: FloatArray, which: int, thickness: float) -> FloatArray:
        """Derivative of ln P at fixed depth (m), (n,), by the difference to a neighbour of that thickness (m)."""
        pair = self.neighbours.part([0, which])
        force = pair.force(np.maximum(depth, 0.0), np.ones(2), np.array([self.thickness, thickness]))
        logarithms = np.log(np.where(force > 0.0, force, 1.0))
        return np.asarray((logarithms[1] - logarithms[0]) / _STEP)


class TipSlopes(NamedTuple):
    """P (N), dP/dw (N/m), dP/d ln k and dP/d ln(size of the tip) (N), each (laws, n)."""

    force: FloatArray
    stiffness: FloatArray
    in_ratio: FloatArray
    in_size: FloatArray


def tips_side_by_side(laws: Sequence[TipLaw], depth: FloatArray) -> TipSlopes:
    """What the laws say at depths (m), (laws, n), each at its row: for the calls of one law."""
    count, first = len(laws), laws[0].neighbours
    tables = [law.neighbours.coefficients for law in laws]
    coefficients = np.zeros(
        (count, *first.coefficients.shape[:2], max(table.shape[2] for table in tables), 4)
    )
    for into, table in zip(coefficients, tables, strict=True):
        into[:, :, : table.shape[2]] = table
    # The curves of all, then those a step further in ln k, then in ln h.
    batch = CurveBatch(
        first.measure,
        np.inf,
        np.stack([law.neighbours.lengths for law in laws], axis=1).reshape(-1, 1),
        np.stack([law.neighbours.softness for law in laws], axis=1).reshape(-1, 1),
        coefficients.swapaxes(0, 1).reshape(3 * count, *coefficients.shape[2:]),
        np.zeros(3 * count),
    )
    thickness, theta = (np.array([getattr(law, name) for law in laws]) for name in ("thickness", "theta"))
    abel = np.array([law.measure.abel_coefficient for law in laws])
    w = np.maximum(depth, 0.0)
    own = batch.part(slice(0, count))
    stiffness = own.stiffness(w, theta, thickness, abel)
    thick = np.concatenate((thickness, thickness, thickness * exp(_STEP)))
    forces = batch.force(np.concatenate((w, w, w)), np.tile(theta, 3), thick, np.tile(abel, 3))
    force, further, thicker = forces.reshape(3, count, -1)
    felt = force > 0.0
    over = np.where(felt, force, 1.0)
    in_ratio, in_thickness = (
        force * np.log(np.where(felt, other, 1.0) / over) / _STEP for other in (further, thicker)
    )
    return TipSlopes(force, stiffness, in_ratio, 2.0 * force - w * stiffness - in_thickness)


def tip_range(contact: Contact, depth: float) -> int:
    """Number of the range of varpi that reaches `depth` (m)."""
    varpi = float(depth_measure(contact.indenter).halfspace_radius(np.asarray(depth))) / contact.thickness
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
        span = None if ratios is None else ratio_number(ratios[row])
        groups.setdefault((_shape(contact.indenter), span, range_number(tops[row])), []).append(row)
    for (tip, span, octave), members in groups.items():
        # Each with its neighbours, side by side.
        log_ratios = np.zeros(len(members)) if ratios is None else np.log([ratios[row] for row in members])
        thickness = np.array([contacts[row].thickness / _unit(contacts[row].indenter) for row in members])
        asked = TipContacts(
            tip,
            family,
            span,
            octave,
            rtol,
            np.ravel(log_ratios[:, None] + np.array([0.0, _STEP, 0.0])),
            np.ravel(thickness[:, None] * np.exp([0.0, 0.0, _STEP])),
            np.repeat([tops[row] for row in members], 3),
        )
        for rows, found in tip_curves(asked):
            for place in np.flatnonzero(rows % 3 == 0).tolist():
                row = members[int(rows[place]) // 3]
                # A neighbour that another table has is one too far.
                if rows[place : place + 3].tolist() == list(range(int(rows[place]), int(rows[place]) + 3)):
                    laws[row] = _law(contacts[row], found, place, depths[row], rtol)
    return laws


#: A tip in its unit, number of the span in ln k, number of the range of varpi.
_Group: TypeAlias = tuple[Indenter, int | None, int]


def _shape(tip: Indenter) -> Indenter:
    """The tip in a unit of its own, in which tips of other sizes are the same."""
    return Sphere(1.0) if isinstance(tip, Sphere) else tip


def _unit(tip: Indenter) -> float:
    return tip.radius if isinstance(tip, Sphere) else 1.0


def _law(
    contact: Contact, found: TipCurves, place: int, depth: float, rtol: float
) -> TipLaw | RangeError | None:
    """One of the curves as a law, or why there is none so deep; None where it errs by more, or ends before."""
    batch = found.batch.part(slice(place, place + 3))
    error, measure = float(batch.error_estimate[0]), depth_measure(contact.indenter)
    max_depth = float(measure.abel(np.asarray(batch.top)[0] * contact.thickness))
    if depth > _DEEPER * max_depth and found.eps[place] >= _WIDE:
        return too_wide(depth, max_depth)
    if not error <= rtol or max_depth < depth:
        return None
    stretch = Stretch(float(batch.lengths[0, 0]), float(batch.softness[0, 0]))
    return TipLaw(
        method="exact",
        reason=f"exact contact problem, off tables of the flat punch for a/h up to {found.eps[place]:.3g}",
        max_depth=max_depth,
        error_estimate=error,
        measure=measure,
        theta=contact.theta,
        thickness=contact.thickness,
        curve=MasterCurve(stretch, (-1.0, 1.0), batch.coefficients[:1], error),
        resolution=found.resolution,
        radii=found.radii,
        neighbours=replace(batch, measure=measure, top=np.inf),
    )
