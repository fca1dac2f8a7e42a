"""Intervals as people read them: as many digits as the nearer end needs, and a wider one that looks wider."""

from __future__ import annotations

import math
from collections.abc import Sequence

from underlay.report.intervals import Estimate
from underlay.units import format_quantity, human_unit

__all__ = ["quantity_with_interval", "wide_interval"]

# Decimals that an end near zero may add, so that it is not read as zero, and one; and most of all.
_MORE, _MOST = 4, 12


def quantity_with_interval(value: float, low: float, high: float, kind: str) -> str:
    """Return ``"0.420 MPa (0.400 to 0.440)"``; two digits of the distance to the nearer end are shown."""
    unit, factor = human_unit(value, kind)
    suffix = f" {unit}" if unit else ""
    decimals = _decimals(value, low, high, factor)
    middle = f"{value / factor:.{decimals}f}{suffix}"
    if math.isfinite(low) and math.isfinite(high):
        return f"{middle} ({low / factor:.{decimals}f} to {high / factor:.{decimals}f})"
    told = _one_end(low, high, factor, decimals, kind)
    return f"{middle} ({told})" if told else middle


def wide_interval(entry: Estimate, kind: str) -> str:
    """Return the interval with what the law leaves out, ``"0.394 to 0.451"``, to stand beside that of the noise.

    It holds that one, and no rounding of the two says otherwise. Empty where it has no end.
    """
    factor = human_unit(entry.value, kind)[1]
    decimals = _decimals(entry.value, entry.wide_low, entry.wide_high, factor)
    beside = _decimals(entry.value, entry.low, entry.high, factor)
    pairs = ((entry.wide_low, entry.low), (-entry.wide_high, -entry.high))
    for digits in range(decimals, max(decimals, beside) + 1):
        decimals = digits
        if all(_rounded(wide, factor, digits) <= _rounded(own, factor, beside) for wide, own in pairs):
            break
    if math.isfinite(entry.wide_low) and math.isfinite(entry.wide_high):
        return f"{entry.wide_low / factor:.{decimals}f} to {entry.wide_high / factor:.{decimals}f}"
    return _one_end(entry.wide_low, entry.wide_high, factor, decimals, kind)


def _one_end(low: float, high: float, factor: float, decimals: int, kind: str) -> str:
    """An interval without one of its ends, in words; empty without both."""
    for word, end in (("at least", low), ("at most", high)):
        if math.isfinite(end):
            far = _misread((end,), factor, decimals)
            return f"{word} {format_quantity(end, kind) if far else f'{end / factor:.{decimals}f}'}"
    return ""


def _rounded(end: float, factor: float, decimals: int) -> float:
    return round(end / factor, decimals) if math.isfinite(end) else end


def _misread(ends: Sequence[float], factor: float, decimals: int) -> bool:
    """Whether an end is off by a quarter with so many decimals: 0.00 for 0.0048."""
    return any(abs(round(end / factor, decimals) - end / factor) > 0.25 * abs(end / factor) for end in ends)


def _decimals(value: float, low: float, high: float, factor: float) -> int:
    """Decimals that show two digits of the distance to the nearer end, and no end near zero as zero or one."""
    widths = [abs(end - value) / factor for end in (low, high) if math.isfinite(end)]
    width = min((w for w in widths if w > 0.0), default=0.0)
    decimals = min(_MOST, max(0, 1 - math.floor(math.log10(width)))) if width > 0.0 else _MORE
    if math.isfinite(low) and math.isfinite(high):
        decimals += next((n for n in range(_MORE) if not _misread((low, high), factor, decimals + n)), 0)
    return decimals
