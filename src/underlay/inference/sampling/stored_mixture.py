"""The frozen mixture in a chain file: where it stands, and whether what stands there is one."""

from __future__ import annotations

from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.ridge.mixture import MOST_COMPONENTS

__all__ = ["fill_mixture", "mixture_size", "stored_mixture"]

# How many numbers there are comes first.
_FIRST = 1
# What `Proposal.numbers` has before the components.
_HEAD = 3


def mixture_size(parameters: int) -> int:
    """Numbers that are reserved: how many there are, and room for the most."""
    return _FIRST + _HEAD + MOST_COMPONENTS * _row(parameters)


def fill_mixture(file: Any, numbers: FloatArray) -> None:
    """Write what `Proposal.numbers` gave, then how many they are."""
    file["proposal"][_FIRST : _FIRST + numbers.size] = numbers
    file["proposal"][0] = numbers.size


def stored_mixture(file: Any, parameters: int) -> FloatArray | None:
    """The numbers of a file's mixture; None where there is none.

    Raises
    ------
    ValueError
        If they are not those of a mixture.
    """
    count = float(file["proposal"][0])
    components = (count - _HEAD) / _row(parameters)
    if count == 0.0:
        return None
    if not (components.is_integer() and 0.0 < components <= MOST_COMPONENTS):
        raise ValueError(f"it counts {count} numbers of a mixture")
    numbers = np.asarray(file["proposal"][_FIRST : _FIRST + int(count)], dtype=np.float64)
    rows = numbers[_HEAD:].reshape(-1, _row(parameters))
    diagonals = rows[:, 1 + parameters :: parameters + 1]
    whole = np.isfinite(numbers).all() and (rows[:, 0] > 0.0).all() and (diagonals > 0.0).all()
    if not (whole and numbers[0] == parameters):
        raise ValueError("it holds no mixture")
    return numbers


def _row(parameters: int) -> int:
    """Numbers of a component: weight, place, factor."""
    return 1 + parameters + parameters**2
