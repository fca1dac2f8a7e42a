"""What is put behind the name of a derived quantity where several curves have one: a number, or nothing."""

from __future__ import annotations

from collections.abc import Sequence

from underlay.inference.model.members import Member
from underlay.inference.problem import Problem

__all__ = ["suffixes"]


def suffixes(problem: Problem, paths: Sequence[Sequence[str]]) -> list[str]:
    """Of every curve what is put behind the name of a quantity that follows from these numbers of its scene.

    Curves whose numbers are the same parameters and the same known values have one quantity, without a number;
    others have their own, ``"[1]"`` that of the second. A curve without such a quantity has no paths.
    """
    if len(problem.members) == 1:
        return [""]
    sources = [
        tuple((path, _source(problem, member, path)) for path in own)
        for member, own in zip(problem.members, paths, strict=True)
    ]
    # A parameter of one curve alone is named with that curve's number.
    shared = [all(source == path or not isinstance(source, str) for path, source in own) for own in sources]
    distinct = {own for own, is_shared in zip(sources, shared, strict=True) if own and is_shared}
    return [
        "" if is_shared and len(distinct) < 2 else f"[{number}]" for number, is_shared in enumerate(shared)
    ]


def _source(problem: Problem, member: Member, path: str) -> str | float:
    """Name of the free parameter that a number is, or its known value."""
    return problem.names[member.entries[path]] if path in member.entries else member.base[path]
