"""The two moduli that laboratories report from a relaxation test, without any fit of the transient.

The instantaneous one, before any water has moved, comes from the rise of the force over each ramp, by the elastic
law at nu = 0.5; the equilibrium one, after drainage, from the force at the end of each hold, by the law at the
drained Poisson's ratio. Each is the least-squares slope over all steps, for an isotropic layer of known thickness.

Instantaneous and equilibrium moduli of relaxing layers, from draws of the parameters, and their names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import CurveError, InputError
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.relaxation import Prony
from underlay.mechanics.response import WholeHistory
from underlay.scene.scene import Scene


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


# Last share of each hold, whose mean force is taken as the equilibrium force.
_LATE = 0.05
# Poisson's ratio before drainage.
_INCOMPRESSIBLE = 0.5


@dataclass(frozen=True)
class RelaxationModuli:
    """The two moduli that a laboratory reports from a relaxation test.

    Parameters
    ----------
    instantaneous, equilibrium : float
        Young's moduli (Pa): the initial one, of an incompressible layer, and the one after drainage.
    depth, peak, settled : ndarray (steps,)
        Depth (m) of each hold since contact, largest force (N) of its step and the force at its end.
    """

    instantaneous: float
    equilibrium: float
    depth: FloatArray
    peak: FloatArray
    settled: FloatArray


def relaxation_moduli(curve: Curve, scene: Scene) -> RelaxationModuli:
    """Instantaneous and equilibrium modulus of a record of ramps and holds.

    Parameters
    ----------
    curve : Curve
        One or more steps, with times.
    scene : Scene
        The test: tip, thickness, contact depth, baseline, and the drained Poisson's ratio of an isotropic layer.

    Returns
    -------
    RelaxationModuli

    Raises
    ------
    CurveError
        If there are no times, or no hold.
    InputError
        If the layer is not isotropic.
    """
    material = scene.layer.material
    if not material.isotropic:
        raise InputError("instantaneous and equilibrium moduli are reported of an isotropic layer")
    if curve.time is None:
        raise CurveError("a relaxation test needs the times of its points (s)")
    # Loaded only where it is used.
    from underlay.mechanics.biphasic.history import ramps_and_holds  # noqa: PLC0415  see above

    w = curve.depth - scene.instrument.contact_depth
    force = curve.force - scene.instrument.chain.reading(np.zeros_like(w), curve.depth)
    line = ramps_and_holds(w, curve.time).in_contact
    tops = np.flatnonzero(np.diff(line.value) > 0.0) + 1
    starts = [*line.time[tops - 1], curve.time[-1]]
    steps = [
        (float(line.value[top]), *_step(curve.time, force, starts[i : i + 2])) for i, top in enumerate(tops)
    ]
    if not steps:
        raise CurveError("a relaxation test has a ramp and a hold: the depth never rises")
    depth, peak, settled = np.array(steps).T
    quick, slow = (_unit_force(scene, nu, depth) for nu in (_INCOMPRESSIBLE, material.nu))
    rises = peak - np.concatenate(([0.0], settled[:-1]))
    grown = np.diff(quick, prepend=0.0)
    return RelaxationModuli(
        float(rises @ grown / (grown @ grown)), float(settled @ slow / (slow @ slow)), depth, peak, settled
    )


def _step(time: FloatArray, force: FloatArray, ends: list[float]) -> tuple[float, float]:
    """Largest force (N) of a step, between the starts of its ramp and of the next, and mean force at its end."""
    mine = np.flatnonzero((time >= ends[0]) & (time <= ends[1]))
    late = mine[-max(int(_LATE * mine.size), 1) :]
    return float(force[mine].max()), float(force[late].mean())


def _unit_force(scene: Scene, nu: float, depth: FloatArray) -> FloatArray:
    """Force (N), (steps,), on the elastic layer with Young's modulus 1 Pa and Poisson's ratio `nu`."""
    elastic = replace(scene.elastic, uncertainties=None)
    layer = replace(elastic.layer, material=Isotropic(1.0, nu))
    law = replace(elastic, layer=layer).contact_law(float(depth.max()))
    return np.asarray(law.force(depth))
