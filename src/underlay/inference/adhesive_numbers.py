"""What follows from a contact that sticks: pull-off force and depth, and the radius at which the tip rests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.solver import Solver
from underlay.quantities import Quantity
from underlay.scene.scene import Scene

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["ADHESIVE", "AdhesiveNumber", "adhesive_estimates", "adhesive_numbers"]

#: What they are, by the last word of their names.
ADHESIVE = {
    "pull_off_force": Quantity("force", "pull-off force"),
    "pull_off_depth": Quantity("length", "pull-off depth"),
    "zero_load_radius": Quantity("length", "contact radius without load"),
}

# Central differences of numbers that are smooth in every parameter, relative.
_STEP = 1e-3
# Share of a change of a parameter below which a number does not follow it.
_ACTS = 0.02


class AdhesiveNumber(NamedTuple):
    """A value (SI) and its 95 % interval; its ends are infinite where the data leave them open."""

    name: str
    value: float
    low: float
    high: float


def adhesive_numbers(scene: Scene, solver: Solver) -> dict[str, float]:
    """Pull-off force (N), pull-off depth (m) and zero-load radius (m) of a scene with adhesion, by name.

    The pull-off force is that of a given load, the depth that at which a stiff instrument loses contact.
    """
    law = scene.contact_law(0.0, solver=solver)
    return {f"adhesion.{name}": float(getattr(law, name)) for name in ADHESIVE}


def adhesive_estimates(result: Fit, curve: int = 0) -> list[AdhesiveNumber]:
    """The same of one curve of a fit, with intervals; empty without adhesion.

    A number that follows one parameter has that one's interval, turned over; others have that of `Fit.band`, and
    none where a parameter that they follow is open.
    """
    scene, member = result.scenes[curve], result.problem.members[curve]
    if scene.adhesion is None:
        return []
    paths = [
        path for path in member.entries if path in scene.parameters and not path.startswith("instrument.")
    ]
    rows = [member.entries[path] for path in paths]
    numbers = adhesive_numbers(scene, result.solver)
    at = np.array([*numbers.values()])
    slopes = _slopes(scene, result.solver, paths)
    optimum = result.problem.physical(result.vector)[rows]
    shares = slopes * optimum[:, None] / at

    def of(physical: FloatArray) -> FloatArray:
        # Sizes, their logarithms to first order.
        return np.asarray(np.abs(at) * np.exp((physical[:, rows] - optimum) @ (slopes / at)))

    band = np.sort(np.sign(at) * np.array(result.band(of)), axis=0)
    found = []
    for column, name in enumerate(numbers):
        acting = np.flatnonzero(~(np.abs(shares[:, column]) < _ACTS))
        stated = [result.interval(result.problem.names[rows[row]]) for row in acting]
        low, value, high = (float(end) for end in band[:, column])
        if len(stated) == 1:
            path, slope = paths[acting[0]], float(slopes[acting[0], column])
            ends = (stated[0].low, stated[0].value, stated[0].high)
            low, value, high = sorted(_followed(scene, result.solver, name, path, end, slope) for end in ends)
        elif any(known.is_open for known in stated):
            low, high = -math.inf, math.inf
        found.append(AdhesiveNumber(name, value, low, high))
    return found


def _followed(scene: Scene, solver: Solver, name: str, path: str, end: float, slope: float) -> float:
    """The number where the one parameter that it follows is at an end; an open end stays open."""
    if math.isfinite(end):
        try:
            return adhesive_numbers(scene.with_values({path: end}), solver)[name]
        except InputError:
            end = math.copysign(math.inf, end - scene.parameters[path])
    return math.copysign(math.inf, end * slope)


def _slopes(scene: Scene, solver: Solver, paths: Sequence[str]) -> FloatArray:
    """d number / d parameter, (parameters, numbers); one-sided where only one side is possible."""
    values, slopes = scene.parameters, np.zeros((len(paths), len(ADHESIVE)))
    middle = np.array([*adhesive_numbers(scene, solver).values()])
    for row, path in enumerate(paths):
        step = _STEP * (abs(values[path]) or 1.0)
        sides = []
        for sign in (1.0, -1.0):
            try:
                moved = scene.with_values({path: values[path] + sign * step})
                numbers = adhesive_numbers(moved, solver)
            except InputError:
                continue
            sides.append((np.array([*numbers.values()]) - middle) / (sign * step))
        slopes[row] = np.mean(sides, axis=0) if sides else np.nan
    return slopes
