"""What follows from a contact that sticks: pull-off force and depth, and the radius at which the tip rests."""

from __future__ import annotations

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
_WIDTH = 1.959964  # of 95 %


class AdhesiveNumber(NamedTuple):
    """A value (SI) and its 95 % interval; NaN where the fit has no covariance."""

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
    """The same of one curve of a fit, with intervals from the fit's covariance; empty without adhesion."""
    scene, member = result.scenes[curve], result.problem.members[curve]
    if scene.adhesion is None:
        return []
    paths = [
        path for path in member.entries if path in scene.parameters and not path.startswith("instrument.")
    ]
    rows = [member.entries[path] for path in paths]
    slopes = _slopes(scene, result.solver, paths)
    covariance = np.asarray(result.covariance)[np.ix_(rows, rows)]
    found = []
    for column, (name, value) in enumerate(adhesive_numbers(scene, result.solver).items()):
        half = _WIDTH * float(np.sqrt(slopes[:, column] @ covariance @ slopes[:, column]))
        found.append(AdhesiveNumber(name, value, value - half, value + half))
    return found


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
