"""Intervals as people read them.

Intervals of fitted parameters as they are printed: those of `Fit.interval`, and words where there is none.

Intervals as people read them: as many digits as the nearer end needs, and a wider one that looks wider.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from underlay.data.quality import check_quality
from underlay.quantities import path_of
from underlay.units import format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit, FitWarning

__all__ = [
    "Estimate",
    "doubts_of_curves",
    "estimates",
    "is_averaged",
    "quantity_with_interval",
    "standing",
    "wide_interval",
]


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter with its interval (SI).

    Parameters
    ----------
    name, path : str
        As in `Fit`; the path lacks the number of the curve.
    value, low, high : float
        Middle and ends; infinite ends where the data leave them open.
    kind : str
        As in `StatedInterval`.
    not_fixed : str
        Why the data do not fix it; empty where they set an end.
    wide_low, wide_high : float
        Ends with what the law leaves out; those of the noise where that is no more.
    left_out : tuple of str
        What these allow for; empty where it does nothing.
    """

    name: str
    path: str
    value: float
    low: float
    high: float
    kind: str
    not_fixed: str
    wide_low: float
    wide_high: float
    left_out: tuple[str, ...]


def estimates(result: Fit, level: float = 0.95) -> list[Estimate]:
    """Return every parameter and derived modulus with its interval at `level`: the one of `Fit.interval`."""
    rows = []
    for coordinate in result.problem.coordinates:
        known = result.interval(coordinate.name, level)
        reason = ""
        if known.low == -float("inf") and known.high == float("inf"):
            bound = result.bounds_hit.get(coordinate.name)
            reason = (
                f"it ended on its {bound}"
                if bound
                else result.no_error_bars.get(coordinate.name, "the data bound it neither below nor above")
            )
        wide = result.interval(coordinate.name, level, model_error=True)
        rows.append(
            Estimate(
                coordinate.name,
                coordinate.path,
                known.value,
                known.low,
                known.high,
                known.kind,
                reason,
                wide.low,
                wide.high,
                () if wide == known else result.allowed_for.allowed,
            )
        )
    for name in result.derived:
        known, wide = result.interval(name, level), result.interval(name, level, model_error=True)
        open_ = known.low == -float("inf") and known.high == float("inf")
        reason = "what it follows from is not fixed" if open_ else ""
        rows.append(
            Estimate(
                name,
                path_of(name),
                known.value,
                known.low,
                known.high,
                known.kind,
                reason,
                wide.low,
                wide.high,
                () if wide == known else result.allowed_for.allowed,
            )
        )
    return rows


def is_averaged(result: Fit) -> bool:
    """Whether the printed intervals are averaged over what the residuals may be."""
    return any(result.interval(name).kind.startswith("averaged") for name in result.names)


def doubts_of_curves(result: Fit) -> list[str]:
    """What speaks against the curves of a fit, each once, before anything is fitted to them."""
    found = [
        check_quality(curve, scene)
        for curve, scene in zip(result.problem.curves, result.problem.base_scenes, strict=True)
    ]
    return list(dict.fromkeys(reason for quality in found for reason in quality.reasons))


def standing(result: Fit) -> list[FitWarning]:
    """Warnings that hold for the printed intervals.

    Those that are averaged over correlated noise are not too narrow for it; what is said of standard errors is not
    said of them.
    """
    spared = {"correlated-residuals"} if is_averaged(result) else set()
    return [warning for warning in result.warnings if warning.code not in spared]


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
