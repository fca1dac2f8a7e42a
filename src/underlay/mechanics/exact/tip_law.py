"""Laws of a sphere or a measured tip read off the tables of `tip_curves`: what a fit asks for at every step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.batch import CurveBatch
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, too_wide
from underlay.mechanics.exact.curve_family import end_numbers, range_numbers
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import MasterCurve, Stretch
from underlay.mechanics.exact.tip_curves import TipContacts, TipCurves, tip_curves
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.kernel import Family

__all__ = ["TipSets", "TipSlopes", "in_size", "tip_laws", "tip_range"]

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

    All lengths together scale the force with their square.
    """
    return np.asarray(2.0 * force - depth * stiffness - in_thickness)


def tip_range(contact: Contact, depth: float) -> int:
    """Number of the range of varpi that reaches `depth` (m)."""
    varpi = contact.indenter.power_law.halfspace_radius(np.asarray(depth)) / contact.thickness
    return int(_ranges(varpi))


def _ranges(varpi: FloatArray) -> FloatArray:
    """Numbers of the ranges of a law that reach varpi, as whole floats."""
    return np.asarray(np.ceil(_RANGES_PER_OCTAVE * np.log2(np.maximum(varpi, _SMALLEST) / _RANGE_EDGE)))


class TipSlopes(NamedTuple):
    """Force, dP/dw, dP/d ln k and dP/d ln(size of the tip), each (sets, n), and which sets have them, (sets,).

    On layers of theta = 1, in the unit of the tip: of the force squared, of dP/dw as it is.
    """

    force: FloatArray
    stiffness: FloatArray
    in_ratio: FloatArray
    in_size: FloatArray
    known: NDArray[np.bool_]


@dataclass(frozen=True)
class TipSets:
    """Contacts of one tip on layers of any thickness and bodies of one family, each with a depth to reach.

    Parameters
    ----------
    tip : Indenter
        In a unit of its own (`Indenter.in_its_unit`).
    family : Family
        The bodies.
    ratio : ndarray (sets,) or None
        Which of them; None for a family of one.
    thickness, depth : ndarray (sets,)
        Thickness, and the depth that each must reach, both in the tip's unit.
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
        """Curves that the tables have, to the end of their range, with the sets of each; a later one is finer."""
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
        """Force and dP/dw of all sets on layers of theta = 1, and which of them the tables have.

        Parameters
        ----------
        depth : ndarray (sets, n)
            Indentation depths, none beyond the one to reach, in the tip's unit.
        stiffness : bool
            Whether dP/dw is asked for; else it is zero.

        Returns
        -------
        tuple of ndarray
            Force in the unit squared and dP/dw in the unit, each (sets, n), zero without a table, and (sets,).
        """
        force, slope, known = np.zeros(depth.shape), np.zeros(depth.shape), np.zeros(len(depth), dtype=bool)
        for rows, batch in self._known():
            arguments = depth[rows], np.ones(rows.size), self.thickness[rows]
            force[rows], known[rows] = batch.force(*arguments), True
            if stiffness:
                slope[rows] = batch.stiffness(*arguments)
        return force, slope, known

    def with_slopes(self, depth: FloatArray) -> TipSlopes:
        """Forces and their derivatives; the parameter is that of `forces`."""
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
        """Curves as good and as deep as asked, with their sets."""
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
        The bodies.
    ratios : sequence of float or None
        Which of them; None for a family of one.
    depths : sequence of float
        Depth (m) that each must reach; it goes to the end of its range.
    rtol : float
        Relative error allowed.

    Returns
    -------
    list of ExactLaw, RangeError or None
        Why there is no law so deep; None where the tables do not reach, or not to `rtol`.
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
    stretch = Stretch(float(batch.stretch.length[0, 0]), float(batch.stretch.rate[0, 0]))
    tables = np.concatenate((batch.coefficients, slopes), axis=1)
    return ExactLaw(
        method="exact",
        reason=f"exact contact problem, off tables of the flat punch for a/h up to {found.eps[place]:.3g}",
        max_depth=max_depth,
        error_estimate=error,
        measure=measure,
        theta=contact.theta,
        thickness=contact.thickness,
        curve=MasterCurve(stretch, (-1.0, 1.0), tables, error),
        resolution=found.resolution,
    )
