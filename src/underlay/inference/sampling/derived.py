"""Quantities that follow from the parameters, draw by draw, so that their intervals are right.

- reduced modulus 2 theta, for an isotropic material E / (1 - nu^2) (Pa): what a shallow indentation sees;
- oedometric modulus A33 = 1/c, for an isotropic material E (1 - nu) / ((1 + nu)(1 - 2 nu)) (Pa): what a thin
  confined layer sees; infinite, and left out, where the material is incompressible;
- instantaneous and equilibrium modulus of a layer that relaxes from one to the other (Pa), E and E e(infinity);
- stiffness dP/dw of the contact at the deepest point of the curve (N/m);
- pull-off force (N) and depth (m) of a contact that sticks.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.adhesive_numbers import ADHESIVE
from underlay.inference.derived_names import suffixes
from underlay.inference.model.adhesion_batch import batched_pull_offs
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.inference.relaxed_moduli import relaxed_moduli
from underlay.mechanics.body import Base
from underlay.quantities import Quantity, numbers_of, path_of
from underlay.scene.parameters import kind_of

__all__ = ["DERIVED", "derived_quantities", "kind_of_quantity"]

#: What the derived quantities are, by the last word of their names.
DERIVED = {
    "reduced_modulus": Quantity("pressure", "reduced modulus of the {part}"),
    "oedometric_modulus": Quantity("pressure", "oedometric modulus of the {part}"),
    "instantaneous_modulus": Quantity("pressure", "instantaneous modulus of the {part}"),
    "equilibrium_modulus": Quantity("pressure", "equilibrium modulus of the {part}"),
    "stiffness": Quantity("stiffness", "contact stiffness at the deepest point"),
    **ADHESIVE,
}


def kind_of_quantity(name: str) -> str:
    """Physical kind of a parameter or a derived quantity, e.g. ``"stiffness"`` for ``"stiffness[1]"``."""
    own = DERIVED.get(path_of(name).rpartition(".")[2])
    return kind_of(name) if own is None else own.kind


def derived_quantities(problem: Problem, physical: FloatArray) -> dict[str, FloatArray]:
    """Derived quantities at draws of the parameters.

    Parameters
    ----------
    problem : Problem
        Whose parameters they are.
    physical : FloatArray
        (..., parameters), SI.

    Returns
    -------
    dict of str to FloatArray
        Each (...), SI. Names such as ``"layer.reduced_modulus"`` and ``"stiffness"``; with several curves
        the stiffness, and what follows from numbers that a curve has of its own, carry the curve's number.
    """
    flat = physical.reshape(-1, physical.shape[-1])
    quantities: dict[str, FloatArray] = {}
    several = len(problem.members) > 1
    for part in ("layer", "substrate"):
        paths = [_constants(member, part) for member in problem.members]
        for member, own, suffix in zip(problem.members, paths, suffixes(problem, paths), strict=True):
            for name, values in _moduli(member, part, own, flat).items():
                quantities.setdefault(f"{part}.{name}{suffix}", values)
    for number, member in enumerate(problem.members):
        suffix = f"[{number}]" if several else ""
        stiffness, possible = _deepest_stiffness(member, flat)
        if possible:
            quantities[f"stiffness{suffix}"] = stiffness
        for name, values in _pull_offs(member, flat).items():
            quantities[f"adhesion.{name}{suffix}"] = values
    quantities |= relaxed_moduli(problem, flat)
    return {name: values.reshape(physical.shape[:-1]) for name, values in quantities.items()}


def _pull_offs(member: Member, flat: FloatArray) -> dict[str, FloatArray]:
    """Pull-off of a contact that sticks, where it can be had for all draws at once."""
    if member.scene.adhesion is None:
        return {}
    found = batched_pull_offs(member.forward, member.values_of(flat), len(flat))
    return {} if found is None else {"pull_off_force": found[0], "pull_off_depth": found[1]}


def _constants(member: Member, part: str) -> list[str]:
    """Paths of the constants of a part's material, if any of them is free."""
    material = _material(member, part)
    paths = [] if material is None else [f"{part}.{name}" for name in numbers_of(material)]
    return paths if any(path in member.entries for path in paths) else []


def _material(member: Member, part: str) -> Base | None:
    return member.scene.layer.material if part == "layer" else member.scene.base


def _moduli(member: Member, part: str, paths: list[str], flat: FloatArray) -> dict[str, FloatArray]:
    """Reduced and oedometric modulus of one part from the constants at these paths; none of none."""
    material = _material(member, part)
    if material is None or not paths:
        return {}
    constants = {
        path.removeprefix(f"{part}."): flat[:, member.entries[path]]
        if path in member.entries
        else member.base[path]
        for path in paths
    }
    plane = material.constants_of(**constants)
    if plane is None:
        return {}
    moduli = {"reduced_modulus": np.broadcast_to(2.0 * plane.theta, len(flat)).copy()}
    compliance = np.broadcast_to(plane.c, len(flat))
    if (compliance > 0.0).all():
        moduli["oedometric_modulus"] = 1.0 / compliance
    return moduli


def _deepest_stiffness(member: Member, flat: FloatArray) -> tuple[FloatArray, bool]:
    """dP/dw (N/m) at the deepest reading, (n,), and whether a law exists at every draw."""
    deepest = np.array([member.curve.depth.max()])
    short = replace(
        member,
        curve=replace(member.curve, depth=deepest, force=np.zeros(1), time=None, segment=None),
        forward=replace(member.forward, depth=deepest, history=None, time=None, bending=None),
    )
    _, stiffness, _, possible = short.readings(flat)
    return stiffness[:, 0], bool(possible.all())
