"""What a relaxing layer's modulus is at once and in the end, of a fit or of draws."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.relaxation import Prony

__all__ = ["relaxed_moduli"]


def relaxed_moduli(problem: Problem, flat: FloatArray) -> dict[str, FloatArray]:
    """Instantaneous and equilibrium modulus of every relaxing layer, (n,), at draws (n, parameters)."""
    found: dict[str, FloatArray] = {}
    for number, member in enumerate(problem.members):
        entries = [entry for path, entry in member.entries.items() if path.startswith("layer.")]
        own = len(problem.members) > 1 and any("[" in problem.names[entry] for entry in entries)
        for name, values in _relaxed(member, "layer", flat).items():
            found.setdefault(f"layer.{name}{f'[{number}]' if own else ''}", values)
    return found


def _relaxed(member: Member, part: str, flat: FloatArray) -> dict[str, FloatArray]:
    """Moduli at once and at equilibrium of a layer that relaxes, if the modulus or a fraction of it is free."""
    relaxation = getattr(getattr(member.scene, part), "relaxation", None)
    if not isinstance(relaxation, Prony):
        return {}
    paths = [f"{part}.relaxation.fractions[{k}]" for k in range(len(relaxation.fractions))]
    if not any(path in member.entries for path in (f"{part}.E", *paths)):
        return {}
    modulus, *fractions = (
        flat[:, member.entries[path]] if path in member.entries else np.full(len(flat), member.base[path])
        for path in (f"{part}.E", *paths)
    )
    kept = 1.0 - np.sum(fractions, axis=0)
    return {"instantaneous_modulus": modulus, "equilibrium_modulus": modulus * kept}
