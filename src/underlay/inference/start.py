"""A start from the data alone: scan what is not linear, solve for what is.

Thickness, modulus ratio and contact depth are laid on a coarse grid of scale-free values; for each, the
layer's modulus (which scales the force when the ratio is held), the baseline and its slope follow by linear
least squares. The scene's own values are only one more grid point, so a start wrong by orders of magnitude,
or the last curve's result, does not decide where a fit ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.coordinates import Coordinate
from underlay.inference.forward import Forward, LawStore
from underlay.inference.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.accuracy import Accuracy
from underlay.mechanics.indenters import FlatPunch
from underlay.scene.scene import Scene

__all__ = ["scan_starts"]

_BLOCKS = 32  # points of a curve after averaging neighbours: enough to place a contact to a grid step
_SCAN_ACCURACY = Accuracy(rtol=1e-2)
# Contact radius over thickness: below the first the layer is a half-space, above the last a fit is hopeless.
_RADIUS_RATIOS = np.geomspace(0.06, 3.0, 6)
# Base over layer.
_MODULUS_RATIOS = np.array([1e-2, 0.1, 0.5, 2.0, 10.0, 100.0])
_CONTACT_STEPS = np.linspace(-0.2, 0.9, 18)
_MODULUS = "layer.E"
_BASE_MODULUS = "substrate.E"
_THICKNESS = "layer.thickness"
_CONTACT = "instrument.contact_depth"
_LINEAR = ("instrument.baseline", "instrument.baseline_slope")


@dataclass(frozen=True)
class _Blocks:
    """A curve as medians of neighbouring points: depth (m), force (N), each (m,)."""

    depth: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class _Candidate:
    """One grid point: misfit of a curve and the values (SI) by path that go with it."""

    misfit: float
    values: dict[str, float]


def scan_starts(problem: Problem, count: int = 3) -> list[FloatArray]:
    """Best starts (scaled vectors (k,)) of a problem, best first, at most `count`.

    Thickness and moduli that curves share are scanned together; what is a curve's own is chosen by it alone.
    Empty if no grid point has a law.
    """
    blocks = [_average(member.curve) for member in problem.members]
    radii = [
        _radius_scale(member.scene, block) for member, block in zip(problem.members, blocks, strict=True)
    ]
    scans = [
        _scan(member, block, problem, (min(radii), max(radii)))
        for member, block in zip(problem.members, blocks, strict=True)
    ]
    keys = set.intersection(*(set(scan) for scan in scans))
    ranked = sorted(keys, key=lambda key: sum(scan[key].misfit for scan in scans))
    return [_vector(problem, [scan[key] for scan in scans]) for key in ranked[:count]]


def _vector(problem: Problem, candidates: Sequence[_Candidate]) -> FloatArray:
    """Scaled vector of what each curve found; a shared parameter takes the mean."""
    found: list[list[float]] = [[] for _ in problem.coordinates]
    for member, candidate in zip(problem.members, candidates, strict=True):
        for path, entry in member.entries.items():
            if path in candidate.values:
                coordinate = problem.coordinates[entry]
                value = min(max(candidate.values[path], coordinate.low), coordinate.high)
                if value > 0.0 or coordinate.scale is not None:
                    found[entry].append(coordinate.scaled(value))
    return np.array([float(np.mean(values)) if values else 0.0 for values in found])


def _scan(
    member: Member, blocks: _Blocks, problem: Problem, radii: tuple[float, float]
) -> dict[tuple[int, ...], _Candidate]:
    """Best candidate for every combination of the shared grid values."""
    free = {path: problem.coordinates[entry] for path, entry in member.entries.items()}
    options = replace(member.forward.options, accuracy=_SCAN_ACCURACY)
    forward = Forward.compile(member.scene, blocks.depth, tuple(free), options, LawStore())
    scales = _MODULUS in free and (_BASE_MODULUS not in member.base or _BASE_MODULUS in free)
    trial = _Trial(
        forward, blocks, free, member.base, _contacts(free, blocks, member.base[_CONTACT]), scales=scales
    )
    thicknesses = _thicknesses(free, radii)
    found: dict[tuple[int, ...], _Candidate] = {}
    for j, moduli in enumerate(_moduli(free, member.base, trial)):
        rows = [{**member.base, **thickness, **moduli} for thickness in thicknesses]
        for i, candidate in enumerate(trial.best(rows)):
            key = (i if _THICKNESS in problem.shared else 0, j if _BASE_MODULUS in problem.shared else 0)
            if candidate is not None and (key not in found or candidate.misfit < found[key].misfit):
                found[key] = candidate
    return found


@dataclass(frozen=True)
class _Trial:
    """One curve tried at grid points: every contact at once, linear parameters solved for."""

    forward: Forward
    blocks: _Blocks
    free: Mapping[str, Coordinate]
    base: Mapping[str, float]
    contacts: FloatArray
    scales: bool

    def best(self, rows: Sequence[Mapping[str, float]]) -> list[_Candidate | None]:
        """Best contact at every one of `rows` (values by path); None where no law reaches."""
        w = self._travel(rows[0]) - self.contacts[:, None]
        forces, possible = self._forces(rows, w)
        linear = self._linear_columns()
        rest = self.blocks.force - self._fixed_offset(rows[0])
        target, shapes = _project_out(rest, linear), _project_out(forces, linear)
        amplitude = self._amplitudes(rows, target, shapes)
        left = target - amplitude[..., None] * shapes
        misfit = np.where(possible[:, None], np.einsum("rcm,rcm->rc", left, left), np.inf)
        contact = np.argmin(misfit, axis=1)
        return [
            self._candidate(
                values, float(misfit[i, j]), float(amplitude[i, j]), int(j), rest, forces[i, j], linear
            )
            if possible[i]
            else None
            for i, (values, j) in enumerate(zip(rows, contact, strict=True))
        ]

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
        start = np.array([values[_MODULUS] for values in rows])[:, None]
        coordinate = self.free[_MODULUS]
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
        forces = np.zeros((len(rows), *w.shape))
        possible = np.ones(len(rows), dtype=bool)
        for i, ratio in enumerate(ratios):
            try:
                law = self.forward.reference_law(ratio, float(factors[i, 0]) * deepest)
                forces[i] = factors[i, 1] * law.force(factors[i, 0] * w)
            except InputError:
                possible[i] = False
        return forces, possible

    def _candidate(
        self,
        values: Mapping[str, float],
        misfit: float,
        amplitude: float,
        contact: int,
        rest: FloatArray,
        force: FloatArray,
        linear: FloatArray | None,
    ) -> _Candidate:
        """One grid point with the linear parameters that go with it."""
        found = {path: values[path] for path in (_MODULUS, _BASE_MODULUS, _THICKNESS) if path in self.free}
        if self.scales:
            found |= {path: amplitude * found[path] for path in (_MODULUS, _BASE_MODULUS) if path in found}
        if _CONTACT in self.free:
            found[_CONTACT] = float(self.contacts[contact])
        if linear is not None:
            solved = np.linalg.lstsq(linear, rest - amplitude * force, rcond=None)[0]
            found.update(zip((path for path in _LINEAR if path in self.free), solved.tolist(), strict=True))
        return _Candidate(misfit, found)

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


def _average(curve: Curve) -> _Blocks:
    # Medians: an outlier in every block must not decide where a robust fit starts.
    order = np.argsort(curve.depth, kind="stable")
    groups = np.array_split(order, min(_BLOCKS, len(order)))
    return _Blocks(
        np.array([np.median(curve.depth[group]) for group in groups]),
        np.array([np.median(curve.force[group]) for group in groups]),
    )


def _radius_scale(scene: Scene, blocks: _Blocks) -> float:
    """Contact radius (m) on a half-space at the curve's whole range of depth."""
    travel = np.array([np.ptp(blocks.depth)])
    limit = scene.indenter.max_radius
    if np.isfinite(limit) and not isinstance(scene.indenter, FlatPunch):
        travel = np.minimum(travel, scene.indenter.abel(np.array([limit])))
    return float(scene.indenter.halfspace_radius(travel)[0])


def _contacts(free: Mapping[str, Coordinate], blocks: _Blocks, known: float) -> FloatArray:
    if _CONTACT not in free:
        return np.array([known])
    coordinate = free[_CONTACT]
    grid = blocks.depth[0] + _CONTACT_STEPS * float(np.ptp(blocks.depth))
    low, high = coordinate.low, coordinate.high
    if np.isfinite(low) and np.isfinite(high) and high - low < np.ptp(grid):
        grid = np.linspace(low, high, len(grid))
    inside = grid[(grid >= low) & (grid <= high)]
    return np.append(inside, coordinate.reference)


def _thicknesses(free: Mapping[str, Coordinate], radii: tuple[float, float]) -> list[dict[str, float]]:
    if _THICKNESS not in free:
        return [{}]
    coordinate = free[_THICKNESS]
    lowest, highest = radii[0] / _RADIUS_RATIOS[-1], radii[1] / _RADIUS_RATIOS[0]
    grid = np.geomspace(lowest, highest, len(_RADIUS_RATIOS))
    low, high = coordinate.low, coordinate.high
    if low > 0.0 and np.isfinite(high) and high / low < highest / lowest:
        grid = np.geomspace(low, high, len(grid))
    values = [*grid[(grid >= low) & (grid <= high)].tolist(), coordinate.reference]
    return [{_THICKNESS: value} for value in values]


def _moduli(
    free: Mapping[str, Coordinate], base: Mapping[str, float], trial: _Trial
) -> list[dict[str, float]]:
    """Pairs of moduli to try; where the layer's scales the force only their ratio matters."""
    if _BASE_MODULUS not in base or not {_MODULUS, _BASE_MODULUS} & free.keys():
        return [{}]
    if _BASE_MODULUS in free:
        grid = [{_BASE_MODULUS: base[_MODULUS] * ratio} for ratio in _MODULUS_RATIOS]
        return [*grid, {_BASE_MODULUS: base[_BASE_MODULUS]}]
    # The base's modulus is known: the layer's is tried about the value that a half-space would have.
    apparent = replace(trial, scales=True).best([{**base, _BASE_MODULUS: base[_MODULUS]}])[0]
    centre = base[_MODULUS] if apparent is None else apparent.values[_MODULUS]
    low, high = free[_MODULUS].low, free[_MODULUS].high
    grid = [{_MODULUS: min(max(centre * factor, low), high)} for factor in 3.0 ** np.arange(-5.0, 6.0)]
    return [*grid, {_MODULUS: base[_MODULUS]}]
