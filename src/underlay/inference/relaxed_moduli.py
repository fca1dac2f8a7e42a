"""Instantaneous and equilibrium moduli of relaxing layers, from draws of the parameters, and their names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.relaxation import Prony
from underlay.mechanics.response import WholeHistory

__all__ = ["of_memory", "relaxed_moduli", "suffixes"]


def suffixes(problem: Problem, paths: Sequence[Sequence[str]]) -> list[str]:
    """Suffixes of the names of a quantity that is computed from some numbers of a scene, one for every curve.

    `paths` are those numbers' paths, for every curve. Curves in which they are the same parameters and the same
    known values share one quantity, without a suffix; others have their own, ``"[1]"`` that of the second. A curve
    without such a quantity has no paths.
    """
    if len(problem.members) == 1:
        return [""]
    sources = [
        tuple((path, _source(problem, member, path)) for path in own)
        for member, own in zip(problem.members, paths, strict=True)
    ]
    # A parameter of a single curve has that curve's number in its name.
    shared = [all(source == path or not isinstance(source, str) for path, source in own) for own in sources]
    distinct = {own for own, is_shared in zip(sources, shared, strict=True) if own and is_shared}
    return [
        "" if is_shared and len(distinct) < 2 else f"[{number}]" for number, is_shared in enumerate(shared)
    ]


def _source(problem: Problem, member: Member, path: str) -> str | float:
    """Name of the free parameter at a path of one curve, or its known value."""
    return problem.names[member.entries[path]] if path in member.entries else member.base[path]


def relaxed_moduli(problem: Problem, flat: FloatArray) -> dict[str, FloatArray]:
    """Instantaneous and equilibrium modulus of every relaxing layer, (n,), at draws (n, parameters)."""
    paths = [_paths(member) for member in problem.members]
    # The first path is that of the modulus, which alone gives the instantaneous value.
    firsts, lasts = suffixes(problem, [own[:1] for own in paths]), suffixes(problem, paths)
    found: dict[str, FloatArray] = {}
    for member, own, first, last in zip(problem.members, paths, firsts, lasts, strict=True):
        if own:
            modulus, *fractions = (
                flat[:, member.entries[path]]
                if path in member.entries
                else np.full(len(flat), member.base[path])
                for path in own
            )
            found.setdefault(f"layer.instantaneous_modulus{first}", modulus)
            found.setdefault(f"layer.equilibrium_modulus{last}", modulus * (1.0 - np.sum(fractions, axis=0)))
    return found


def of_memory(problem: Problem, flat: FloatArray) -> dict[str, FloatArray]:
    """Quantities derived from memories with their own force law, by name, (n,), at draws (n, parameters)."""
    found: dict[str, FloatArray] = {}
    several = len(problem.members) > 1
    for number, member in enumerate(problem.members):
        history = member.forward.history
        if not isinstance(history, WholeHistory) or not history.derived():
            continue
        rows = [history.at(member.values_at(row)).derived() for row in flat]
        for name in rows[0] if rows else ():
            found[f"{name}[{number}]" if several else name] = np.array([row[name] for row in rows])
    return found


def _paths(member: Member) -> list[str]:
    """Paths of modulus and relaxing fractions of a layer, if at least one of them is free, else none."""
    relaxation = member.scene.layer.relaxation
    if not isinstance(relaxation, Prony):
        return []
    fractions = (f"layer.relaxation.fractions[{k}]" for k in range(len(relaxation.fractions)))
    paths = ["layer.E", *fractions]
    return paths if any(path in member.entries for path in paths) else []
