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

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward_batch import batched_pull_offs
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.inference.reported_moduli import of_memory, relaxed_moduli, suffixes
from underlay.mechanics.body import Base
from underlay.mechanics.response import WholeHistory
from underlay.mechanics.solver import Solver
from underlay.quantities import Quantity, kind_of, numbers_of, path_of
from underlay.scene.scene import Scene

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

#: Quantities derived for an adhesive contact, by the last word of their names.
ADHESIVE = {
    "pull_off_force": Quantity("force", "pull-off force"),
    "pull_off_depth": Quantity("length", "pull-off depth"),
    "zero_load_radius": Quantity("length", "contact radius without load"),
}
# Relative step of central differences of the adhesive numbers, which are smooth in every parameter.
_STEP = 1e-3
# Relative change of a number over that of a parameter below which it does not depend on the parameter.
_ACTS = 0.02
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


class AdhesiveNumber(NamedTuple):
    """A number of an adhesive contact: value (SI) and 95 % interval, infinite where the data set no limit."""

    name: str
    value: float
    low: float
    high: float


def adhesive_numbers(scene: Scene, solver: Solver) -> dict[str, float]:
    """Pull-off force (N), pull-off depth (m) and zero-load radius (m) of a scene with adhesion, by name.

    The pull-off force is that under load control, the depth that at which a stiff (depth-controlled) instrument
    loses contact.
    """
    law = scene.contact_law(0.0, solver=solver)
    return {f"adhesion.{name}": float(getattr(law, name)) for name in ADHESIVE}


def adhesive_estimates(result: Fit, curve: int = 0) -> list[AdhesiveNumber]:
    """Pull-off force and depth and zero-load radius of one curve of a fit, with intervals; empty without adhesion.

    A number that depends on one parameter alone has that parameter's interval, converted; others have the interval
    of `Fit.band`, which is infinite where a parameter that they depend on is not determined.
    """
    scene, member = result.scenes[curve], result.problem.members[curve]
    if scene.adhesion is None:
        return []
    paths = [
        path for path in member.entries if path in scene.parameters and not path.startswith("instrument.")
    ]
    rows = [member.entries[path] for path in paths]
    numbers = adhesive_numbers(scene, result.solver)
    at = np.array([*numbers.values()])
    slopes = _slopes(scene, result.solver, paths)
    optimum = result.problem.physical(result.vector)[rows]
    shares = slopes * optimum[:, None] / at

    def of(physical: FloatArray) -> FloatArray:
        # Absolute values, with the logarithms to first order.
        return np.asarray(np.abs(at) * np.exp((physical[:, rows] - optimum) @ (slopes / at)))

    band = np.sort(np.sign(at) * np.array(result.band(of)), axis=0)
    found = []
    for column, name in enumerate(numbers):
        acting = np.flatnonzero(~(np.abs(shares[:, column]) < _ACTS))
        stated = [result.interval(result.problem.names[rows[row]]) for row in acting]
        low, value, high = (float(end) for end in band[:, column])
        if len(stated) == 1:
            path, slope = paths[acting[0]], float(slopes[acting[0], column])
            ends = (stated[0].low, stated[0].value, stated[0].high)
            low, value, high = sorted(_followed(scene, result.solver, name, path, end, slope) for end in ends)
        elif any(known.is_open for known in stated):
            low, high = -math.inf, math.inf
        found.append(AdhesiveNumber(name, value, low, high))
    return found


def _followed(scene: Scene, solver: Solver, name: str, path: str, end: float, slope: float) -> float:
    """An adhesive number with its one parameter at the end of that one's interval; infinite for an infinite end.

    `slope` is the derivative of the number, whose sign gives the side.
    """
    if math.isfinite(end):
        try:
            return adhesive_numbers(scene.with_values({path: end}), solver)[name]
        except InputError:
            end = math.copysign(math.inf, end - scene.parameters[path])
    return math.copysign(math.inf, end * slope)


def _slopes(scene: Scene, solver: Solver, paths: Sequence[str]) -> FloatArray:
    """d number / d parameter, (parameters, numbers), by differences; one-sided where only one side is possible."""
    values, slopes = scene.parameters, np.zeros((len(paths), len(ADHESIVE)))
    middle = np.array([*adhesive_numbers(scene, solver).values()])
    for row, path in enumerate(paths):
        step = _STEP * (abs(values[path]) or 1.0)
        sides = []
        for sign in (1.0, -1.0):
            try:
                moved = scene.with_values({path: values[path] + sign * step})
                numbers = adhesive_numbers(moved, solver)
            except InputError:
                continue
            sides.append((np.array([*numbers.values()]) - middle) / (sign * step))
        slopes[row] = np.mean(sides, axis=0) if sides else np.nan
    return slopes


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
    if member.scene.adhesion is None:
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
