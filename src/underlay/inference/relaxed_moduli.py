"""What a relaxing layer's modulus is at once and in the end, of a fit or of draws."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.derived_names import suffixes
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.relaxation import Prony

__all__ = ["relaxed_moduli"]


def relaxed_moduli(problem: Problem, flat: FloatArray) -> dict[str, FloatArray]:
    """Instantaneous and equilibrium modulus of every relaxing layer, (n,), at draws (n, parameters)."""
    paths = [_paths(member) for member in problem.members]
    # The first path is that of the modulus, and at once nothing has relaxed.
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


def _paths(member: Member) -> list[str]:
    """Modulus and fractions of a layer that relaxes, if any of them is free."""
    relaxation = member.scene.layer.relaxation
    if not isinstance(relaxation, Prony):
        return []
    fractions = (f"layer.relaxation.fractions[{k}]" for k in range(len(relaxation.fractions)))
    paths = ["layer.E", *fractions]
    return paths if any(path in member.entries for path in paths) else []
