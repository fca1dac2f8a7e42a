"""Laws with corrections for friction and finite strain, at many parameter sets.

The frictionless and the no-slip law are computed in batches, and then combined by the sizes of each set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward, LeftOutLaws
from underlay.inference.model.groups import ParameterSets, Values
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH
from underlay.scene.instrument import Frame

__all__ = ["left_out_readings"]

#: Contact force (N), stiffness (N/m), instrument force (N), (sets, n), and which sets exist, (sets,).
Found = tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]


def left_out_readings(
    forward: Forward, values: Values, sets: int, batched: Callable[[Forward, Values, int], Found]
) -> Found | None:
    """Readings of all parameter sets of a law with corrections; None where they must be computed one by one.

    Parameters
    ----------
    forward : Forward
        Forward model with corrections of its law (`LeftOutLaws`).
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    batched : callable
        Function that computes the readings of a model without corrections; without stiffness.

    Returns
    -------
    tuple or None
        Contact force (N), stiffness (N/m, left zero) and instrument force (N), each (sets, n), and which sets have
        a law.
    """
    left_out = forward.left_out
    if not isinstance(left_out, LeftOutLaws) or np.any(values[Frame.path]):
        # A frame gives way under the whole force: its depths are those of one law at a time.
        return None
    bare = replace(forward, left_out=None)
    free, _, _, exists = batched(bare, values, sets)
    sticks, _, _, also = batched(bare.solved_by(bare.laws.solver.without_slip), values, sets)
    asked = ParameterSets(bare, values, sets)
    upright: Any = {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
    strained = upright[FINITE_STRAIN_PATH] * left_out.excess(forward, upright, asked.tip)
    strained = strained + upright[BOTH_PATH] * left_out.further(upright, sticks, free, asked.tip)
    contact = free + upright[FRICTION_PATH] * (sticks - free) + free * strained
    return contact, np.zeros_like(contact), asked.instrument_force(contact), exists & also
