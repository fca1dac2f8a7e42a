"""What a curve's model says at many parameter sets, and the way that always works: set by set."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward import Forward
from underlay.inference.model.parameter_sets import Values, values_of

__all__ = ["Readings", "is_shaped_by_lengths", "set_by_set"]


class Readings(NamedTuple):
    """Contact force (N), stiffness (N/m), instrument force (N), (sets, n), and which sets exist."""

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray
    possible: NDArray[np.bool_]

    @classmethod
    def empty(cls, sets: int, points: int) -> Readings:
        """Room for `sets` sets, none of which exists yet."""
        contact, stiffness, force = (np.zeros((sets, points)) for _ in range(3))
        return cls(contact, stiffness, force, np.zeros(sets, dtype=bool))


def set_by_set(
    forward: Forward, values: Values, rows: Iterable[int], readings: Readings, *, stiffness: bool = True
) -> Readings:
    """Put the readings of some sets into `readings`; a set without a law is left out."""
    for row in rows:
        try:
            one = forward.of_set(row).reading(values_of(values, row), stiffness=stiffness)
        except InputError:
            continue
        readings.contact[row], readings.stiffness[row] = one.contact, one.stiffness
        readings.force[row] = one.force
        readings.possible[row] = True
    return readings


def is_shaped_by_lengths(forward: Forward) -> bool:
    """Whether the tip's shape varies otherwise than through one coefficient."""
    return any(path.startswith(("indenter.", "layer.thickness")) for path in forward.similarity.direct)
