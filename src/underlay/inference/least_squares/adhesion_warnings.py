"""What a fit with adhesion cannot know from the curve it has."""

from __future__ import annotations

from underlay._arrays import FloatArray
from underlay.inference.least_squares.fit_result import FitWarning
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.scene.chain import Chain
from underlay.units import format_quantity

__all__ = ["about_adhesion"]


def about_adhesion(problem: Problem, vector: FloatArray) -> list[FitWarning]:
    """Warnings of curves that show no pull-off, or nothing but what comes after it; none without adhesion."""
    sticking = [(n, m) for n, m in enumerate(problem.members, start=1) if m.scene.adhesion is not None]
    physical = problem.physical(vector)
    warnings = []
    for number, member in sticking:
        text = _about(member, physical)
        if text:
            which = f"curve {number}: " if len(problem.members) > 1 else ""
            warnings.append(FitWarning("pull-off", which + text))
    return warnings


def _about(member: Member, physical: FloatArray) -> str:
    values = member.values_at(physical)
    chain = Chain.of(values)
    law = member.forward.law(values, max(float(chain.travel(member.forward.depth_at(values)).max()), 0.0))
    tip = chain.tip_depth(law, member.forward.depth_at(values))
    first = law.domain[0]
    if not (tip > first).any():
        return (
            f"every point lies beyond the pull-off of the fitted contact, {format_quantity(first, 'length')}: "
            "modulus and work of adhesion do not act on the curve"
        )
    if first < 0.0 and float(tip.min()) > first:
        return (
            f"the curve ends at {format_quantity(float(tip.min()), 'length')}, before the pull-off at "
            f"{format_quantity(first, 'length')} that the fit expects: the work of adhesion is known from the "
            "shape of the loaded curve alone, together with the contact point; it is only known that the contact "
            "bears the smallest force measured"
        )
    return ""
