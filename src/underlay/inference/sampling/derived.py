"""Quantities computed from the parameters for each draw, so that their intervals are right.

- reduced modulus 2 theta, for an isotropic material E / (1 - nu^2) (Pa): acts in a shallow indentation;
- oedometric modulus A33 = 1/c, for an isotropic material E (1 - nu) / ((1 + nu)(1 - 2 nu)) (Pa): acts in a thin
confined layer; infinite, and left out, where the material is incompressible;
- instantaneous and equilibrium modulus of a layer that relaxes from one to the other (Pa): E and E e(infinity), e
being the relaxation function with e(0) = 1;
- aggregate modulus (Pa), diffusivity c (m^2/s), drainage time a^2/c (s), a the contact radius, and peak over
equilibrium force of a poroelastic layer;
- stiffness dP/dw of the contact at the deepest point of the curve (N/m);
- pull-off force (N) and depth (m) of an adhesive contact, and its contact radius (m) at zero load;
- stiffening factor of a layer that stiffens with strain, at the deepest point of the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.forward_batch import batched_pull_offs
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.body import Base
from underlay.mechanics.relaxation import Prony
from underlay.mechanics.response import WholeHistory
from underlay.mechanics.solver import Solver
from underlay.quantities import Quantity, kind_of, numbers_of, path_of
from underlay.scene.scene import Scene

#: Quantities derived for an adhesive contact, by the last word of their names.
ADHESIVE = {
    "pull_off_force": Quantity("force", "pull-off force"),
    "pull_off_depth": Quantity("length", "pull-off depth"),
    "zero_load_radius": Quantity("length", "contact radius without load"),
}
#: Kind and name of the derived quantities, by the last word of their names.
DERIVED = {
    "reduced_modulus": Quantity("pressure", "reduced modulus of the {part}"),
    "oedometric_modulus": Quantity("pressure", "oedometric modulus of the {part}"),
    "instantaneous_modulus": Quantity("pressure", "instantaneous modulus of the {part}"),
    "equilibrium_modulus": Quantity("pressure", "equilibrium modulus of the {part}"),
    "aggregate_modulus": Quantity("pressure", "aggregate modulus of the {part}", "H_A"),
    "diffusivity": Quantity("diffusivity", "diffusivity of the {part}", "c"),
    "drainage_time": Quantity("time", "drainage time of the {part}", "a^2/c"),
    "peak_ratio": Quantity("dimensionless", "peak over equilibrium force of the {part}", "P0/P∞"),
    "stiffness": Quantity("stiffness", "contact stiffness at the deepest point"),
    "stiffening_factor": Quantity("dimensionless", "stiffening at the deepest point"),
    **ADHESIVE,
}


def adhesive_numbers(scene: Scene, solver: Solver) -> dict[str, float]:
    """Pull-off force (N), pull-off depth (m) and zero-load radius (m) of a scene with adhesion, by name.

    The pull-off force is that under load control, the depth that at which a stiff (depth-controlled) instrument
    loses contact.
    """
    law = scene.contact_law(0.0, solver=solver)
    return {f"adhesion.{name}": float(getattr(law, name)) for name in ADHESIVE}


def kind_of_quantity(name: str) -> str:
    """Physical kind of a parameter or a derived quantity, e.g. ``"stiffness"`` for ``"stiffness[1]"``."""
    own = DERIVED.get(path_of(name).rpartition(".")[2])
    return kind_of(name) if own is None else own.kind


def derived_quantities(problem: Problem, physical: FloatArray) -> dict[str, FloatArray]:
    """Derived quantities (moduli, stiffness, pull-off, ...) at draws of the parameters.

    Parameters
    ----------
    problem : Problem
        The problem that the draws are of.
    physical : FloatArray
        Values of its parameters (SI), (..., parameters).

    Returns
    -------
    dict of str to FloatArray
        Each (...), SI. Names such as ``"layer.reduced_modulus"`` and ``"stiffness"``; with several curves the
        stiffness, and quantities of parameters that single curves have, end in the curve's number,
        ``"stiffness[1]"``.
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
        # A memory with its own force law has no single stiffness at a depth.
        if not isinstance(member.forward.history, WholeHistory):
            stiffness, possible = _deepest_stiffness(member, flat)
            if possible:
                quantities[f"stiffness{suffix}"] = stiffness
        for name, values in _pull_offs(member, flat).items():
            quantities[f"adhesion.{name}{suffix}"] = values
        if member.scene.layer.stiffening is not None:
            quantities[f"layer.stiffening_factor{suffix}"] = _stiffening(member, flat)
    quantities |= relaxed_moduli(problem, flat) | of_memory(problem, flat)
    return {name: values.reshape(physical.shape[:-1]) for name, values in quantities.items()}


def _pull_offs(member: Member, flat: FloatArray) -> dict[str, FloatArray]:
    """Pull-off force (N) and depth (m) at all draws, (n,) each; empty where there is no adhesion."""
    if not member.scene.adheres:
        return {}
    found = batched_pull_offs(member.forward, member.values_of(flat), len(flat))
    return {} if found is None else {"pull_off_force": found[0], "pull_off_depth": found[1]}


def _stiffening(member: Member, flat: FloatArray) -> FloatArray:
    """Stiffening factor G, the force over that without stiffening, at the deepest point of one curve, (sets,)."""
    # Loaded only for a layer that stiffens.
    from underlay.inference.model.on_law import OnLinear  # noqa: PLC0415  see above
    from underlay.inference.model.on_law_batch import stiffening_factors  # noqa: PLC0415  see above

    on_linear = member.forward.left_out
    if not isinstance(on_linear, OnLinear):
        return np.ones(len(flat))
    return stiffening_factors(member.forward, member.values_of(flat), len(flat), on_linear)


def _constants(member: Member, part: str) -> list[str]:
    """Paths of all elastic constants of a part's material if at least one of them is free, else none."""
    material = _material(member, part)
    paths = [] if material is None else [f"{part}.{name}" for name in numbers_of(material)]
    return paths if any(path in member.entries for path in paths) else []


def _material(member: Member, part: str) -> Base | None:
    return member.scene.layer.material if part == "layer" else member.scene.base


def _moduli(member: Member, part: str, paths: list[str], flat: FloatArray) -> dict[str, FloatArray]:
    """Reduced and oedometric modulus (Pa), (n,), of one part from the constants at `paths`."""
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
