"""What a single fit states, for a row of a map that asks for it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from underlay.data.quality import DOUBTFUL, GOOD
from underlay.inference.least_squares.fit_result import Fit

__all__ = ["stated_interval_ends", "stated_reasons"]


def stated_interval_ends(fit: Fit) -> Mapping[str, float]:
    """Ends (SI) of the 95 % interval of every parameter, by column; an end that is open is left out."""
    ends: dict[str, float] = {}
    for name in fit.names:
        known = fit.interval(name)
        ends |= {f"{name}.low": known.low, f"{name}.high": known.high}
    return {column: end for column, end in ends.items() if math.isfinite(end)}


def stated_reasons(fit: Fit) -> tuple[str, ...]:
    """Reasons of the verdict; behind its word where that is neither good nor doubtful."""
    verdict = fit.verdict
    before = "" if verdict.word in (GOOD, DOUBTFUL) else f"{verdict.word}: "
    return tuple(before + reason for reason in verdict.reasons)
