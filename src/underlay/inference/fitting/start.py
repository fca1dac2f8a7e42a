"""A start from the data alone: scan what is not linear, solve for what is.

Thickness, modulus ratio and contact depth are laid on a coarse grid of scale-free values; for each, the
layer's modulus (which scales the force when the ratio is held), the baseline and its slope follow by linear
least squares. The scene's own values are only one more grid point, so a start wrong by orders of magnitude,
or the last curve's result, does not decide where a fit ends. Every local minimum of the grid is a start:
thin and stiffly backed can look like thick and stiff.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.fitting.trial import (
    BASE_MODULUS,
    CONTACT,
    MODULUS,
    THICKNESS,
    Blocks,
    Candidate,
    Trial,
)
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.accuracy import Accuracy
from underlay.mechanics.indenters import FlatPunch
from underlay.scene.scene import Scene

__all__ = ["scan_starts", "thinned"]

_SCAN_ACCURACY = Accuracy(rtol=1e-2)
_ROUGH_ACCURACY = Accuracy(rtol=1e-3)
# Contact radius over thickness: below the first the layer is a half-space, above the last a fit is hopeless.
_RADIUS_RATIOS = np.geomspace(0.06, 5.0, 9)
# Base over layer.
_MODULUS_RATIOS = np.array([1e-2, 0.1, 0.5, 2.0, 10.0, 100.0])
_MODULUS_STEPS = 3.0 ** np.arange(-5.0, 6.0)
_CONTACT_STEPS = np.linspace(-0.2, 0.9, 18)
#: Values of thickness and of moduli at a grid point, by path.
Values: TypeAlias = dict[str, float]
#: Position on the grid (thickness, moduli).
Key: TypeAlias = tuple[int, int]


def scan_starts(problem: Problem, count: int = 3) -> list[FloatArray]:
    """Local minima of the grid as starts (scaled vectors (k,)), best first, at most `count`.

    Thickness and moduli that curves share are scanned together; what is a curve's own is chosen by it alone.
    Empty if no grid point has a law.
    """
    trials = [_trial(member, problem) for member in problem.members]
    radii = [_radius_scale(m.scene, trial.blocks) for m, trial in zip(problem.members, trials, strict=True)]
    scans = [
        _scan(member, trial, problem, (min(radii), max(radii)), trials)
        for member, trial in zip(problem.members, trials, strict=True)
    ]
    keys = set.intersection(*(set(scan) for scan in scans))
    total = {key: sum(scan[key].misfit for scan in scans) for key in keys}
    if not total:
        return []
    best = min(total, key=lambda key: total[key])
    # The thin end of the grid is a minimum only if it is the lowest: else the curve is only falling there.
    thinnest = 0 if any(key[0] for key in keys) else -1
    minima = [key for key in keys if _is_local_minimum(total, key) and (key[0] != thinnest or key == best)]
    ranked = sorted(minima, key=lambda key: total[key])
    return [_vector(problem, [scan[key] for scan in scans]) for key in ranked[:count]]


def thinned(problem: Problem) -> Problem:
    """Return the problem with its curves in blocks, a coarse law and white noise: cheap to fit roughly."""
    free = {path: given for path, given in problem.free.items() if not path.startswith("noise.")}
    options = problem.options
    return Problem.joint(
        [(member.scene, Blocks.of(member.curve).curve) for member in problem.members],
        free,
        [path for path in problem.shared if path in free],
        accuracy=_ROUGH_ACCURACY,
        method=options.method,
        order=options.order,
        form=options.form,
    )


def _is_local_minimum(total: Mapping[Key, float], key: Key) -> bool:
    i, j = key
    around = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
    return all(total[key] <= total.get(neighbour, np.inf) for neighbour in around)


def _vector(problem: Problem, candidates: Sequence[Candidate]) -> FloatArray:
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


def _trial(member: Member, problem: Problem) -> Trial:
    blocks = Blocks.of(member.curve)
    free = {path: problem.coordinates[entry] for path, entry in member.entries.items()}
    options = replace(member.forward.laws.options, accuracy=_SCAN_ACCURACY)
    forward = Forward.compile(member.scene, blocks.depth, tuple(free), options, LawStore())
    scales = MODULUS in free and (BASE_MODULUS not in member.base or BASE_MODULUS in free)
    return Trial(forward, blocks, free, _contacts(free, blocks, member.base[CONTACT]), scales)


def _scan(
    member: Member, trial: Trial, problem: Problem, radii: tuple[float, float], trials: Sequence[Trial]
) -> dict[Key, Candidate]:
    """Best candidate of one curve for every place of the shared grid."""
    alone = len(trials) == 1
    thickness_counts = alone or THICKNESS in problem.shared
    moduli_count = alone or {MODULUS, BASE_MODULUS} & set(problem.shared)
    thicknesses = _thicknesses(trial.free, radii)
    found: dict[Key, Candidate] = {}
    # A grid that curves share is laid about what the first of them shows.
    grid = _moduli(problem.members[0].base, trials[0]) if moduli_count else _moduli(member.base, trial)
    for j, moduli in enumerate(grid):
        rows = [{**member.base, **thickness, **moduli} for thickness in thicknesses]
        for i, candidate in enumerate(trial.best(rows)):
            key = (i if thickness_counts else 0, j if moduli_count else 0)
            if candidate is not None and (key not in found or candidate.misfit < found[key].misfit):
                found[key] = candidate
    return found


def _radius_scale(scene: Scene, blocks: Blocks) -> float:
    """Contact radius (m) on a half-space at the curve's whole range of depth."""
    travel = np.array([np.ptp(blocks.depth)])
    limit = scene.indenter.max_radius
    if np.isfinite(limit) and not isinstance(scene.indenter, FlatPunch):
        travel = np.minimum(travel, scene.indenter.abel(np.array([limit])))
    return float(scene.indenter.halfspace_radius(travel)[0])


def _contacts(free: Mapping[str, Coordinate], blocks: Blocks, known: float) -> FloatArray:
    if CONTACT not in free:
        return np.array([known])
    coordinate = free[CONTACT]
    grid = blocks.depth[0] + _CONTACT_STEPS * float(np.ptp(blocks.depth))
    low, high = coordinate.low, coordinate.high
    if np.isfinite(low) and np.isfinite(high) and high - low < np.ptp(grid):
        grid = np.linspace(low, high, len(grid))
    inside = grid[(grid >= low) & (grid <= high)]
    # Bounds beside the curve leave none: then the scene's own value is all there is to try.
    return inside if len(inside) > 1 else np.array([coordinate.reference])


def _thicknesses(free: Mapping[str, Coordinate], radii: tuple[float, float]) -> list[dict[str, float]]:
    if THICKNESS not in free:
        return [{}]
    coordinate = free[THICKNESS]
    lowest, highest = radii[0] / _RADIUS_RATIOS[-1], radii[1] / _RADIUS_RATIOS[0]
    grid = np.geomspace(lowest, highest, len(_RADIUS_RATIOS))
    low, high = coordinate.low, coordinate.high
    if low > 0.0 and np.isfinite(high) and high / low < highest / lowest:
        grid = np.geomspace(low, high, len(grid))
    inside = grid[(grid >= low) & (grid <= high)].tolist()
    return [{THICKNESS: value} for value in sorted({*inside, coordinate.reference})]


def _moduli(base: Mapping[str, float], trial: Trial) -> list[dict[str, float]]:
    """Pairs of moduli to try; where the layer's scales the force only their ratio matters."""
    free = trial.free
    if BASE_MODULUS not in base or not {MODULUS, BASE_MODULUS} & free.keys():
        return [{}]
    if BASE_MODULUS in free:
        values = {base[MODULUS] * float(ratio) for ratio in _MODULUS_RATIOS} | {base[BASE_MODULUS]}
        return [{BASE_MODULUS: value} for value in sorted(values)]
    # The base's modulus is known: the layer's is tried about the value that a half-space would have.
    apparent = replace(trial, scales=True).best([{**base, BASE_MODULUS: base[MODULUS]}])[0]
    centre = base[MODULUS] if apparent is None else apparent.values[MODULUS]
    low, high = free[MODULUS].low, free[MODULUS].high
    values = {min(max(centre * float(factor), low), high) for factor in _MODULUS_STEPS} | {base[MODULUS]}
    return [{MODULUS: value} for value in sorted(values)]
