"""Intervals as people read them.

Intervals as people read them: as many digits as the nearer end needs, and a wider one that looks wider.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from underlay.data.quality import check_quality
from underlay.units import format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = [
    "doubts_of_curves",
    "quantity_with_interval",
]


def doubts_of_curves(result: Fit) -> list[str]:
    """What speaks against the curves of a fit, each once, before anything is fitted to them."""
    found = [
        check_quality(curve, scene)
        for curve, scene in zip(result.problem.curves, result.problem.base_scenes, strict=True)
    ]
    return list(dict.fromkeys(reason for quality in found for reason in quality.reasons))


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
