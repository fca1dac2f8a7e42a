"""Arrays from callers: conversion and checks of numbers, once, where they enter the library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay.errors import InputError

#: A thousandth of a proton (m): no indenter, layer or indentation is smaller, and quotients of much smaller ones
#: leave the range of a double.
SMALLEST_LENGTH = 1e-18

FloatArray: TypeAlias = NDArray[np.float64]
#: One number for all sets of parameters, or one per set: shape () or (sets, 1).
PerSet: TypeAlias = float | FloatArray
#: A number, a sequence of numbers, a numpy array or a pandas Series.
ArrayLike: TypeAlias = float | Sequence[float] | NDArray[Any] | Any


def as_finite(values: ArrayLike, name: str) -> FloatArray:
    """Return `values` as a float array of their shape.

    Raises
    ------
    InputError
        If they are no numbers, or one is NaN or infinite; the message gives its index.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must hold numbers; got {values!r:.80}") from error
    finite = np.isfinite(array)
    if not finite.all():
        index = int(np.flatnonzero(~finite.ravel())[0])
        raise InputError(
            f"{name} holds {array.ravel()[index]} at index {index}; remove or mask such points first"
        )
    return array


def positive(value: float, name: str, unit: str) -> float:
    """Return `value` as a float if it is positive and finite; `name` and `unit` are for the message.

    Raises
    ------
    InputError
        If it is no number, not above zero, or infinite.
    """
    number = _number(value, name)
    if not (0.0 < number < np.inf):
        raise InputError(f"{name} must be positive and finite ({unit}); got {value!r}")
    return number


def physical_length(length: float, name: str) -> float:
    """Return a length (m) from a file or a user, unless it is positive and too small to be physical.

    For input only: inside, lengths may be in any unit. Zero and negative lengths are checked elsewhere.

    Raises
    ------
    InputError
        If it is above zero and below `SMALLEST_LENGTH`.
    """
    if 0.0 < length < SMALLEST_LENGTH:
        raise InputError(f"{name} of {length!r} m is not physical: at least {SMALLEST_LENGTH:g} m is needed")
    return length


def _number(value: float, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be a number; got {value!r}") from error


def finite(value: float, name: str, unit: str) -> float:
    """Return `value` as a float if it is finite; `name` and `unit` are for the message.

    Raises
    ------
    InputError
        If it is no number, NaN or infinite.
    """
    number = _number(value, name)
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite ({unit}); got {value!r}")
    return number


def read_only(array: FloatArray) -> FloatArray:
    """Return a read-only copy of `array`."""
    copy = np.array(array)
    copy.flags.writeable = False
    return copy


def median(values: FloatArray) -> float:
    """Return the median of finite numbers (n,), the same as numpy's, without the overhead of its calls."""
    half = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, half)[half])
    below, above = np.partition(values, (half - 1, half))[half - 1 : half + 1].tolist()
    return float(0.5 * (below + above))
