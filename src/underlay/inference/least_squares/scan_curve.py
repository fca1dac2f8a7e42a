"""One curve at the points of a grid: every contact at once, linear parameters solved for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import EllipsisType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.least_squares.blocks import Blocks
from underlay.inference.least_squares.law_rows import LawRows, Rows
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward

__all__ = ["BASE_MODULUS", "CONTACT", "MODULUS", "THICKNESS", "GridFit", "ScanCurve"]

MODULUS, BASE_MODULUS, THICKNESS = "layer.E", "substrate.E", "layer.thickness"
CONTACT = "instrument.contact_depth"
# Of the steps between contacts: about the lowest point of a parabola through these, how far off it may be.
_NEAR, _BESIDE = 0.3, np.array([-1.0, 0.0, 1.0])
_LINEAR = ("instrument.baseline", "instrument.baseline_slope")


@dataclass(frozen=True)
class GridFit:
    """How well a curve goes with the rows of a grid, each (r,).

    Parameters
    ----------
    misfit : FloatArray
        Sum of squares (N^2); infinite where no law reaches.
    contact : FloatArray
        Best contact depth (m).
    amplitude : FloatArray
        Factor on the moduli that goes with it.
    lowest : FloatArray
        Contact depth (m) where the parabola through the misfits of the best and its neighbours is lowest.
    residuals : FloatArray
        Of the blocks (N), (r, m).
    """

    misfit: FloatArray
    contact: FloatArray
    amplitude: FloatArray
    lowest: FloatArray
    residuals: FloatArray

    def better(self, other: GridFit) -> GridFit:
        """Row by row the one that fits better."""
        lower = other.misfit < self.misfit
        pairs = (
            (self.misfit, other.misfit),
            (self.contact, other.contact),
            (self.amplitude, other.amplitude),
            (self.lowest, other.lowest),
        )
        misfit, contact, amplitude, lowest = (np.where(lower, theirs, ours) for ours, theirs in pairs)
        residuals = np.where(lower[:, None], other.residuals, self.residuals)
        return GridFit(misfit, contact, amplitude, lowest, residuals)


class _Tried(NamedTuple):
    """Contacts c tried of every row: shapes (r, c, m) whose multiples, (r, c), should be the target (m,) (N)."""

    target: FloatArray
    shapes: FloatArray
    amplitude: FloatArray
    misfit: FloatArray

    def residuals(self, which: tuple[NDArray[np.intp], NDArray[np.intp]] | EllipsisType = ...) -> FloatArray:
        """Of all (r, c, m), or of some."""
        return np.asarray(self.target - self.amplitude[which][..., None] * self.shapes[which])


@dataclass(frozen=True)
class ScanCurve:
    """A curve and what is free of its scene.

    Parameters
    ----------
    forward : Forward
        Compiled for the depths of `blocks`.
    blocks : Blocks
        The curve.
    free : mapping of path to Coordinate
        Its free parameters.
    contacts : FloatArray
        Contact depths to try (m), (c,), in even steps; one where the contact is known.
    scales : bool
        Whether the layer's modulus is free and scales the force: alone, or with the base's at a fixed ratio.
    """

    forward: Forward
    blocks: Blocks
    free: Mapping[str, Coordinate]
    contacts: FloatArray
    scales: bool

    def laws(self, rows: Rows) -> LawRows:
        """Laws of the rows for every contact that is tried."""
        return LawRows.of(self.forward, rows, float(self._travel(rows).max() - self.contacts[0]))

    def best_contact(self, rows: Rows, laws: LawRows) -> GridFit:
        """Best of the contacts that are tried of every row."""
        tried = self._tried(rows, laws, self.contacts[None])
        best = np.argmin(tried.misfit, axis=1)
        chosen = np.arange(len(best)), best
        contact = self.contacts[best]
        lowest = contact.copy()
        inside = np.flatnonzero((best > 0) & (best < len(self.contacts) - 1))
        if inside.size:
            beside = (tried.misfit[inside, best[inside] + i] for i in (-1, 0, 1))
            lowest[inside] += self._step * _steps_to_lowest(*beside)
        amplitude, misfit = tried.amplitude[chosen], tried.misfit[chosen]
        return GridFit(misfit, contact, amplitude, lowest, tried.residuals(chosen))

    def refined(self, rows: Rows, laws: LawRows, found: GridFit) -> GridFit:
        """The same where the misfit is lowest about the lowest point of each parabola, where that is better.

        Between contacts so close together residuals are parabolas too.
        """
        step = _NEAR * self._step
        # No earlier than the first: the laws reach no deeper.
        lowest = np.maximum(found.lowest, self.contacts[0] + step)
        tried = self._tried(rows, laws, lowest[:, None] + step * _BESIDE)
        share = np.minimum(np.maximum(_steps_to_lowest(*tried.misfit.T), -1.0), 1.0)
        parts = np.empty((len(share), 3))
        parts[:, 1] = 1.0 - share * share
        parts[:, 0] = 0.5 * (share * share - share)
        parts[:, 2] = parts[:, 0] + share
        weights = (parts * tried.amplitude)[:, None, :]
        # The target whole: the parts sum to one.
        residuals = tried.target - (weights @ tried.shapes)[:, 0]
        misfit = np.einsum("rm,rm->r", residuals, residuals)
        if not laws.possible.all():
            misfit[~laws.possible] = np.inf
        contact, amplitude = lowest + step * share, weights[:, 0].sum(axis=1)
        return found.better(GridFit(misfit, contact, amplitude, contact, residuals))

    @property
    def _step(self) -> float:
        """From contact to contact (m)."""
        return float(self.contacts[1] - self.contacts[0])

    def _tried(self, rows: Rows, laws: LawRows, contacts: FloatArray) -> _Tried:
        """All contacts (m), (r, c) or (1, c), of every row."""
        forces = laws.force(self._travel(rows) - contacts[:, :, None])
        basis = self._linear_basis
        target = _project_out(self.blocks.force - self._fixed_offset(rows), basis)
        shapes = _project_out(forces, basis)
        power, along = np.einsum("rcm,rcm->rc", shapes, shapes), shapes @ target
        amplitude = self._amplitudes(rows, power, along)
        # From products: what these lose in digits is far below the error of so coarse a law.
        misfit = float(target @ target) - amplitude * (2.0 * along - amplitude * power)
        if not laws.possible.all():
            misfit[~laws.possible] = np.inf
        return _Tried(target, shapes, amplitude, misfit)

    def linear(self, values: Mapping[str, float]) -> dict[str, float]:
        """Baseline and slope, those that are free, that go best with the other numbers."""
        columns = self._linear_columns
        if columns is None:
            return {}
        travel = self._travel(values) - values[CONTACT]
        laws = LawRows.of(self.forward, values, float(travel.max()))
        rest = self.blocks.force - self._fixed_offset(values) - laws.force(travel[None, None])[0, 0]
        solved = np.linalg.lstsq(columns, rest, rcond=None)[0]
        return dict(zip((path for path in _LINEAR if path in self.free), solved.tolist(), strict=True))

    def _amplitudes(self, rows: Rows, power: FloatArray, along: FloatArray) -> FloatArray:
        """Factor (r, c) on the layer's modulus that fits best, within its bounds; one if it is fixed.

        From the squares of the forces, and their products with the target, each (r, c).
        """
        if not self.scales:
            return np.ones(power.shape)
        # A contact beyond the last point gives no force at all: it explains nothing.
        felt = power > 0.0
        amplitude = along / power if felt.all() else np.where(felt, along / np.where(felt, power, 1.0), 0.0)
        start = np.reshape(rows[MODULUS], (-1, 1))
        coordinate = self.free[MODULUS]
        lowest = max(coordinate.low, 1e-12 * float(start.min()))
        # numpy.clip takes three times as long on so few.
        return np.asarray(np.minimum(np.maximum(amplitude, lowest / start), coordinate.high / start))

    def _travel(self, rows: Rows) -> FloatArray:
        """Depth without the frame's share, which the measured force gives without knowing the sample."""
        compliance = rows["instrument.compliance"]
        return self.blocks.depth - compliance * self.blocks.force if compliance else self.blocks.depth

    @cached_property
    def _linear_columns(self) -> FloatArray | None:
        """Columns (m, p) of the linear parameters that are free; None where none is."""
        depth = self.blocks.depth
        free = [
            column
            for path, column in zip(_LINEAR, (np.ones(depth.shape), depth), strict=True)
            if path in self.free
        ]
        return np.stack(free, axis=1) if free else None

    @cached_property
    def _linear_basis(self) -> FloatArray | None:
        """Orthonormal columns (m, p) that span those of the linear parameters."""
        columns = self._linear_columns
        # Columns are brought to unit length first: metres beside ones would cost digits.
        return None if columns is None else np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]

    def _fixed_offset(self, rows: Rows) -> FloatArray:
        baseline, slope = (0.0 if path in self.free else rows[path] for path in _LINEAR)
        return np.asarray(baseline + slope * self.blocks.depth)


def _steps_to_lowest(before: FloatArray, here: FloatArray, after: FloatArray) -> FloatArray:
    """Steps (r,) from the middle of three to where the parabola through them is lowest; none where it is not."""
    # Where no law reaches all three are infinite.
    reached = here < np.inf
    if not reached.all():
        before, here, after = (np.where(reached, each, 0.0) for each in (before, here, after))
    bend = before - 2.0 * here + after
    return np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend > 0.0)


def _project_out(rows: FloatArray, basis: FloatArray | None) -> FloatArray:
    """What remains of `rows` (..., m) after a least-squares fit of the orthonormal columns `basis` (m, p)."""
    return rows if basis is None else np.asarray(rows - (rows @ basis) @ basis.T)
