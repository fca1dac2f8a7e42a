"""Numbers of an adhesive contact from a fit: pull-off force and depth, zero-load radius, with intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.sampling.derived import ADHESIVE, adhesive_numbers
from underlay.mechanics.solver import Solver
from underlay.scene.scene import Scene

# Relative step of central differences of the adhesive numbers, which are smooth in every parameter.
_STEP = 1e-3
# Relative change of a number over that of a parameter below which it does not depend on the parameter.
_ACTS = 0.02


class AdhesiveNumber(NamedTuple):
    """A number of an adhesive contact: value (SI) and 95 % interval, infinite where the data set no limit."""

    name: str
    value: float
    low: float
    high: float


def adhesive_estimates(result: Fit, curve: int = 0) -> list[AdhesiveNumber]:
    """Pull-off force and depth and zero-load radius of one curve of a fit, with intervals; empty without adhesion.

    A number that depends on one parameter alone has that parameter's interval, converted; others have the interval
    of `Fit.band`, which is infinite where a parameter that they depend on is not determined.
    """
    scene, member = result.scenes[curve], result.problem.members[curve]
    if not scene.adheres:
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
        # Absolute values, with the logarithms to first order.
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
    """An adhesive number with its one parameter at the end of that one's interval; infinite for an infinite end.

    `slope` is the derivative of the number, whose sign gives the side.
    """
    if math.isfinite(end):
        try:
            return adhesive_numbers(scene.with_values({path: end}), solver)[name]
        except InputError:
            end = math.copysign(math.inf, end - scene.parameters[path])
    return math.copysign(math.inf, end * slope)


def _slopes(scene: Scene, solver: Solver, paths: Sequence[str]) -> FloatArray:
    """d number / d parameter, (parameters, numbers), by differences; one-sided where only one side is possible."""
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
