"""What speaks against a result: its curve, its fit and its laws."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from underlay.data.quality import check_quality
from underlay.report.intervals import standing

if TYPE_CHECKING:
    from underlay.inference.least_squares import Fit
    from underlay.inference.problem import Problem

__all__ = ["quality_doubts", "reservations"]


def quality_doubts(problem: Problem) -> list[str]:
    """Return what speaks against each curve before it is fitted.

    Raises
    ------
    CurveError
        If a curve shows no contact, with the reason.
    """
    doubts: list[str] = []
    for curve, scene in zip(problem.curves, problem.base_scenes, strict=True):
        quality = check_quality(curve, scene)
        quality.require()
        doubts += quality.reasons
    return doubts


def reservations(result: Fit, notes: Iterable[str]) -> list[str]:
    """Return what the reader, the fit and the laws have to say, in that order.

    A second optimum is not among it: it stands beside the headline.
    """
    reader = [str(note) for curve in result.curves for note in curve.metadata.get("notes", ())]

    fitted = [str(warning) for warning in standing(result) if warning.code != "second-optimum"]
    return [*reader, *fitted, *notes]
