"""Amounts side by side as text: zero has no unit of its own, and takes the one of what stands beside it."""

from __future__ import annotations

from collections.abc import Sequence

from underlay.units import format_quantity, human_unit

__all__ = ["amounts"]

# Below this share of the largest it is what rounding leaves of zero.
_NOTHING = 1e-9


def amounts(values: Sequence[float], kind: str) -> list[str]:
    """Return SI values in units of their sizes, those that are zero in the unit of the largest.

    Examples
    --------
    >>> amounts([0.0, 3e-6], "length"), amounts([-5e-22, 3e-6], "length"), amounts([0.0], "stiffness")
    (['0 um', '3 um'], ['0 um', '3 um'], ['0'])
    """
    largest = max(map(abs, values), default=0.0)
    unit = human_unit(largest, kind)[0] if largest else ""
    zero = f"0 {unit}".strip()
    return [format_quantity(value, kind) if abs(value) > _NOTHING * largest else zero for value in values]
