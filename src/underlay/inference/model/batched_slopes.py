"""Derivatives of one curve's model from parameter sets that are computed together.

Where a law is read off no table its derivative in a ratio costs as much as the law, tens of milliseconds. A batch
gives the laws of neighbouring sets for a few: what moves a ratio is differenced over one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward, Reading
from underlay.inference.model.forward_batch import batched_readings, has_batches
from underlay.inference.model.parameter_sets import Values
from underlay.scene.chain import Chain, ContactDepth, Frame

__all__ = ["batched_jacobian"]

# Of a positive number: the error of a forward difference is half of it. Batches share their nodes, so that the
# laws' own errors, 1e-7 of the force at a tolerance of 1e-4, mostly cancel.
_STEP = 1e-3
# What is positive, has both neighbours, and can be moved by a share of itself.
_MOVED = ("layer.E", "layer.thickness", "substrate.E", "indenter.radius")


def batched_jacobian(
    forward: Forward, values: Mapping[str, float], paths: Sequence[str]
) -> tuple[Reading, FloatArray] | None:
    """Reading at `values`, and the derivative of its force in each parameter (SI) at `paths`, (n, k).

    Off by 1e-3 of itself. None where sets are not computed together, or one of them has no law.
    """
    columns = Chain.of(values, free=paths).offset_slopes(forward.depth)
    moved = [path for path in paths if path not in columns and path != ContactDepth.path]
    if not moved or not set(moved) <= set(_MOVED) or values[Frame.path]:
        return None
    rows = 1 + len(moved)
    sets: dict[str, float | FloatArray] = dict(values)
    for row, path in enumerate(moved, start=1):
        column = np.full(rows, values[path])
        column[row] *= 1.0 + _STEP
        sets[path] = column
    asked: Values = sets
    if not has_batches(forward, asked, rows):
        return None
    found = batched_readings(forward, asked, rows)
    if not found.possible.all():
        return None
    columns[ContactDepth.path] = -found.stiffness[0]
    for row, path in enumerate(moved, start=1):
        columns[path] = (found.force[row] - found.force[0]) / (_STEP * values[path])
    reading = Reading(found.contact[0], found.stiffness[0], found.force[0])
    return reading, np.column_stack([columns[path] for path in paths])
