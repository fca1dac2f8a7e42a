"""One curve tried at the points of a grid: every contact at once, linear parameters solved for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward

__all__ = ["BASE_MODULUS", "CONTACT", "MODULUS", "THICKNESS", "Blocks", "Candidate", "Trial"]

MODULUS, BASE_MODULUS, THICKNESS = "layer.E", "substrate.E", "layer.thickness"
CONTACT = "instrument.contact_depth"
_LINEAR = ("instrument.baseline", "instrument.baseline_slope")

_BLOCKS = 32  # points of a curve after taking neighbours together: enough to tell a contact to a grid step
# Closer looks about the best contact so far, in steps of the look before.
_CLOSER = np.linspace(-0.75, 0.75, 7)
_LOOKS = 2


@dataclass(frozen=True)
class Blocks:
    """A curve as medians of neighbouring points: depth (m), force (N), each (m,)."""

    depth: FloatArray
    force: FloatArray

    @property
    def curve(self) -> Curve:
        """The same as a curve."""
        return Curve(self.depth, self.force)

    @classmethod
    def of(cls, curve: Curve) -> Blocks:
        """Take neighbouring depths together; medians, so that no outlier decides where a fit starts."""
        order = np.argsort(curve.depth, kind="stable")
        groups = np.array_split(order, min(_BLOCKS, len(order)))
        return cls(
            np.array([np.median(curve.depth[group]) for group in groups]),
            np.array([np.median(curve.force[group]) for group in groups]),
        )


@dataclass(frozen=True)
class Candidate:
    """One grid point: misfit of a curve and the values (SI) by path that go with it."""

    misfit: float
    values: dict[str, float]


@dataclass(frozen=True)
class Trial:
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

    def best(self, rows: Sequence[Mapping[str, float]]) -> list[Candidate | None]:
        """Best contact at every one of `rows` (values by path); None where no law reaches."""
        found = self._look(rows, np.broadcast_to(self.contacts, (len(rows), len(self.contacts))))
        if len(self.contacts) == 1:
            return found
        step = float(self.contacts[1] - self.contacts[0])
        coordinate = self.free[CONTACT]
        for _ in range(_LOOKS):
            centres = [self.contacts[0] if one is None else one.values[CONTACT] for one in found]
            closer = np.clip(np.array(centres)[:, None] + step * _CLOSER, coordinate.low, coordinate.high)
            found = [
                one if two is None or (one is not None and one.misfit <= two.misfit) else two
                for one, two in zip(found, self._look(rows, closer), strict=True)
            ]
            step *= float(_CLOSER[1] - _CLOSER[0])
        return found

    def _look(self, rows: Sequence[Mapping[str, float]], contacts: FloatArray) -> list[Candidate | None]:
        """Best of the `contacts` (r, c) of every row."""
        w = self._travel(rows[0]) - contacts[:, :, None]
        forces, possible = self._forces(rows, w)
        linear = self._linear_columns()
        rest = self.blocks.force - self._fixed_offset(rows[0])
        target, shapes = _project_out(rest, linear), _project_out(forces, linear)
        amplitude = self._amplitudes(rows, target, shapes)
        left = target - amplitude[..., None] * shapes
        misfit = np.where(possible[:, None], np.einsum("rcm,rcm->rc", left, left), np.inf)
        found: list[Candidate | None] = []
        for i, (values, j) in enumerate(zip(rows, np.argmin(misfit, axis=1), strict=True)):
            if not possible[i]:
                found.append(None)
                continue
            solved = self._solved(values, float(amplitude[i, j]), rest, forces[i, j], linear)
            if CONTACT in self.free:
                solved[CONTACT] = float(contacts[i, j])
            found.append(Candidate(float(misfit[i, j]), solved))
        return found

    def _amplitudes(
        self, rows: Sequence[Mapping[str, float]], target: FloatArray, shapes: FloatArray
    ) -> FloatArray:
        """Factor (r, c) on the layer's modulus that fits best, within its bounds; one if it is fixed."""
        if not self.scales:
            return np.ones(shapes.shape[:2])
        power = np.einsum("rcm,rcm->rc", shapes, shapes)
        # A contact beyond the last point gives no force at all: it explains nothing.
        felt = power > 0.0
        amplitude = np.where(felt, shapes @ target / np.where(felt, power, 1.0), 0.0)
        start = np.array([values[MODULUS] for values in rows])[:, None]
        coordinate = self.free[MODULUS]
        lowest = max(coordinate.low, 1e-12 * float(start.min()))
        return np.asarray(np.clip(amplitude, lowest / start, coordinate.high / start))

    def _forces(
        self, rows: Sequence[Mapping[str, float]], w: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Contact forces (r, c, m) and which rows have a law; equal ratios are asked of one law at once."""
        similarity, deepest = self.forward.similarity, max(float(w.max()), 0.0)
        factors = np.array([similarity.factors(values) for values in rows])
        ratios = [similarity.reduced(values) for values in rows]
        b, c = factors[:, :1, None], factors[:, 1:, None]
        if len(set(ratios)) == 1:
            try:
                law = self.forward.reference_law(ratios[0], float(b.max()) * deepest)
                return c * law.force(b * w), np.ones(len(rows), dtype=bool)
            except InputError:
                pass  # one row is out of reach: each by itself
        forces = np.zeros_like(w)
        possible = np.ones(len(rows), dtype=bool)
        for i, ratio in enumerate(ratios):
            try:
                law = self.forward.reference_law(ratio, float(factors[i, 0]) * deepest)
                forces[i] = factors[i, 1] * law.force(factors[i, 0] * w[i])
            except InputError:
                possible[i] = False
        return forces, possible

    def _solved(
        self,
        values: Mapping[str, float],
        amplitude: float,
        rest: FloatArray,
        force: FloatArray,
        linear: FloatArray | None,
    ) -> dict[str, float]:
        """Values of one grid point with the linear parameters that go with it."""
        found = {path: values[path] for path in (MODULUS, BASE_MODULUS, THICKNESS) if path in self.free}
        if self.scales:
            found |= {path: amplitude * found[path] for path in (MODULUS, BASE_MODULUS) if path in found}
        if linear is not None:
            solved = np.linalg.lstsq(linear, rest - amplitude * force, rcond=None)[0]
            found.update(zip((path for path in _LINEAR if path in self.free), solved.tolist(), strict=True))
        return found

    def _travel(self, values: Mapping[str, float]) -> FloatArray:
        """Depth without the frame's share, which the measured force gives without knowing the sample."""
        compliance = values["instrument.compliance"]
        return self.blocks.depth - compliance * self.blocks.force if compliance else self.blocks.depth

    def _linear_columns(self) -> FloatArray | None:
        columns = {_LINEAR[0]: np.ones_like(self.blocks.depth), _LINEAR[1]: self.blocks.depth}
        free = [column for path, column in columns.items() if path in self.free]
        return np.stack(free, axis=1) if free else None

    def _fixed_offset(self, values: Mapping[str, float]) -> FloatArray:
        baseline, slope = (0.0 if path in self.free else values[path] for path in _LINEAR)
        return baseline + slope * self.blocks.depth


def _project_out(rows: FloatArray, columns: FloatArray | None) -> FloatArray:
    """What remains of `rows` (..., m) after a least-squares fit of `columns` (m, p)."""
    if columns is None:
        return rows
    # Columns are brought to unit length first: metres beside ones would cost digits.
    q, _ = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))
    return np.asarray(rows - (rows @ q) @ q.T)
