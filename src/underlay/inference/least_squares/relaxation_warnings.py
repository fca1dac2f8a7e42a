"""What a fit of a relaxing layer cannot know from the record it has."""

from __future__ import annotations

from underlay._arrays import FloatArray
from underlay.inference.least_squares.fit_result import FitWarning
from underlay.inference.problem import Problem
from underlay.units import format_quantity

__all__ = ["about_relaxation", "times_told_by"]


def times_told_by(problem: Problem) -> list[tuple[float, float]]:
    """Shortest and longest relaxation time (s) that the record of every relaxing curve tells."""
    clocks = [
        member.curve.time
        for member in problem.members
        if member.scene.layer.relaxation is not None and member.curve.time is not None
    ]
    if not clocks:
        return []
    # Not loaded for a sample that does not relax.
    from underlay.mechanics.viscoelastic.history import times_told  # noqa: PLC0415  see above

    return [times_told(clock) for clock in clocks]


def about_relaxation(problem: Problem, vector: FloatArray) -> list[FitWarning]:
    """Warnings of relaxation times that ended outside of what the records tell; none without relaxation."""
    told = times_told_by(problem)
    if not told:
        return []
    low, high = min(low for low, _ in told), max(high for _, high in told)
    return [
        FitWarning(
            "relaxation-time",
            f"{name} ended at {format_quantity(value, 'time')}, and the record tells times from "
            f"{format_quantity(low, 'time')}, its sampling, to {format_quantity(high, 'time')}, its length: fix it "
            "there, or leave this term out",
        )
        for name, value in problem.values(vector).items()
        if ".relaxation.times[" in name and not low <= value <= high
    ]
