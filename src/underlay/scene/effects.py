"""The physical effects in a scene: how large each is, whether it is simulated, and its computing time.

An effect is a pair of scenes: with the effect and without it. Size and cost compare the force of the two. An effect
that a scene does not declare runs none of its code, nor does a layer that differs from its base by less than the
requested accuracy. Friction under the tip and finite strain are effects that a law leaves out unless the scene says
otherwise.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError
from underlay.mechanics.body import RIGID, Layer, stacked
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepancy import finite_strain_excess, why_unmeasured
from underlay.mechanics.indenters import Sphere
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.quantities import replace_values

# Duration of a ramp over a^2/c (a the contact radius, c the consolidation coefficient) in which most of the water
# stays.
_QUICK = 0.1
_FINITE_STRAIN = "finite strain"
# Number of depths of the curves on which the cost of an effect is timed, from cold, with and without it in turns.
_COST_POINTS = 200
# Number of timing rounds; the shortest processor time is used.
_COST_ROUNDS = 25
# Time (s) beyond which a curve is timed once.
_LONG = 0.2
# Relative size below which an effect is rounding.
_ROUNDING = 1e3 * np.finfo(float).eps


#: A function that finds one effect, from a scene and the law of its contact.
EffectRule: TypeAlias = "Callable[[Simulated, ContactLaw], Effect]"
#: A scene, its parts and its force, by the interface of `Scene`, which calls this module and so stands above it.
Simulated: TypeAlias = Any


@dataclass(frozen=True)
class Effect:
    """One physical effect: the scene with it and without it.

    Parameters
    ----------
    name : str
        Its name.
    with_it, without : Scene, optional
        The two scenes; None where they cannot be built.
    simulated : bool
        Whether the scene as given includes the effect.
    note : str
        In words, what the size is relative to, or why there is none.
    duration : float, optional
        Time (s) of a ramp to the deepest point at constant rate, for an effect that depends on time.
    excess : callable, optional
        Relative change of the force at depths (m), (n,), of an effect that no scene simulates; NaN where unknown.
    note_at : callable, optional
        The note as a function of the largest depth (m), for an effect that is known to a limited depth.
    """

    name: str
    with_it: Simulated | None = None
    without: Simulated | None = None
    simulated: bool = False
    note: str = ""
    duration: float | None = None
    excess: Callable[[FloatArray], FloatArray] | None = None
    note_at: Callable[[float], str] | None = None


def _friction(level: Simulated) -> Effect:
    """Effect of a tip without slip relative to a frictionless one; real friction lies between."""
    if level.adhesion is not None:
        return Effect("friction", note="how a tip that sticks and adheres behaves is not simulated")
    said = {"stuck": "the tip is declared to stick", "none": "declared none", "unknown": "unknown"}
    sticking, sliding = (replace(level, friction=friction) for friction in ("stuck", "none"))
    note = f"a tip that sticks against one that slides; {said[level.friction]}"
    return Effect("friction", sticking, sliding, level.friction == "stuck", note)


def _finite_strain(level: Simulated) -> Effect:
    """Effect of finite strain on the linear law, by the computed function; no scene simulates it."""

    def excess(depth: FloatArray) -> FloatArray:
        why = why_unmeasured(level.contact, float(depth.max()))
        if why:
            return np.full(depth.shape, np.nan)
        radius = level.contact_law(float(depth.max())).contact_radius(depth)
        return finite_strain_excess(level.contact, depth, radius)

    def note(deepest: float) -> str:
        why = why_unmeasured(level.contact, deepest)
        return (
            f"beyond what is known here: {why}"
            if why
            else "a neo-Hookean layer against small strains, known to a half of itself"
        )

    return Effect(_FINITE_STRAIN, note="against small strains", excess=excess, note_at=note)


def effects_in(scene: Simulated, law: ContactLaw, solver: Solver) -> list[Effect]:
    """All effects of a scene.

    All but the baseline are measured without the baseline, so that sizes are relative to the contact force.
    Relaxation and drainage are left out of the other effects: the sizes are those of a sudden depth.

    Parameters
    ----------
    scene : Scene
        The test.
    law : ContactLaw
        Law that simulates its contact.
    solver : Solver
        What built that law; for an adhesion model without a range of attraction a row says which one it implies.
    """
    given, scene = scene, replace(scene.elastic, discrepancy=None)
    ranged = scene
    if scene.adhesion is not None:
        # An attraction of finite range costs a thousand times as much time, and has its own row.
        scene = replace(scene, adhesion=scene.adhesion.short_ranged)
    level = replace(scene, instrument=replace(scene.instrument, baseline=0.0, baseline_slope=0.0))
    above = level
    if level.layer.linear is not level.layer:
        level, scene = (replace(one, layer=one.layer.linear) for one in (level, scene))
    layered = law.method != "halfspace"
    return [
        _thickness_effect(level, layered=layered),
        _substrate_effect(level, layered=layered),
        *_stack_effects(level, layered=layered),
        *_bond_effects(level, layered=layered),
        _anisotropy_effect(level, layered=layered),
        _sphere_effect(level),
        _compliance_effect(level),
        _baseline_effect(scene, level),
        *_adhesion_effects(ranged, level, law),
        _friction(level),
        *([] if above.layer.stiffening else [_finite_strain(level)]),
        *_effects_on_law(above, level),
        *_relaxation_effects(given, level),
        *_drainage_effects(given, level, law),
        _history_effect(remembers=given.history is not None),
        *_implied_range(given, solver),
    ]


def _effects_on_law(scene: Simulated, linear: Simulated) -> list[Effect]:
    """Effects beyond linear elasticity that the layer declares: finite strain, stiffening, sides of the sample."""
    layer, found = scene.layer, []
    wide = replace(scene, layer=replace(layer, half_width=None, shape="plug"))
    if layer.stiffening is not None:
        soft = replace(wide, layer=replace(wide.layer, stiffening=layer.stiffening.unstiffened))
        note = "a neo-Hookean layer against small strains"
        found.append(Effect(_FINITE_STRAIN, soft, linear, simulated=True, note=note))
        note = "against a neo-Hookean layer of the same E"
        found.append(Effect("stiffening", wide, soft, simulated=True, note=note))
    if layer.has_sides:
        found.append(Effect("sides", scene, wide, simulated=True, note="against a sample without sides"))
    elif layer.half_width is not None:
        found.append(_ignored_sides(scene, wide))
    return found


def _ignored_sides(scene: Simulated, wide: Simulated) -> Effect:
    """Effect of the sides of a sample that its law ignores, estimated for a round plug."""
    try:
        plug = replace(scene, layer=replace(scene.layer, shape="plug"))
    except InputError as error:
        return Effect("sides", note=f"ignored; {error}")
    return Effect("sides", plug, wide, note="ignored; as of a round plug")


def _thickness_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "finite thickness"
    if scene.substrate is None:
        return Effect(name, note="no substrate at a finite depth is declared")
    halfspace = replace(scene, layer=Layer(scene.layer.material), substrate=None)
    return Effect(name, scene, halfspace, simulated=layered, note="against a half-space of the layer")


def _substrate_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "substrate compliance"
    if scene.substrate is None or scene.base == RIGID:
        return Effect(name, note="no elastic substrate is declared")
    rigid = replace(scene, substrate=scene.substrate.on(RIGID))
    return Effect(name, scene, rigid, simulated=layered, note="against a rigid base")


def _stack_effects(scene: Simulated, *, layered: bool) -> list[Effect]:
    """Effect of every further layer of a stack, relative to the stack without it."""
    base, layers = scene.base, scene.layers[1:]
    if base is None:
        return []
    return [
        Effect(
            f"layer {number + 2}",
            scene,
            replace(scene, substrate=stacked((*layers[:number], *layers[number + 1 :]), base)),
            simulated=layered,
            note="against the stack without this layer",
        )
        for number in range(len(layers))
    ]


def _bond_effects(scene: Simulated, *, layered: bool) -> list[Effect]:
    """Effect of faces that slip or have springs, all at once, relative to bonded faces.

    Where the bond of the top layer is not known, also the effect of slip there, which the scene does not simulate.
    """
    if scene.substrate is None:
        return []
    bonded = replace(scene, layer=replace(scene.layer, bond="bonded"), substrate=scene.substrate.bonded)
    found = []
    if any(layer.bond not in ("bonded", "unknown") for layer in scene.layers):
        found.append(Effect("interfaces", scene, bonded, simulated=layered, note="against bonded faces"))
    if scene.layer.bond == "unknown":
        slipping = replace(scene, layer=replace(scene.layer, bond="slip"))
        note = "a layer free to slip against one that is bonded; unknown"
        found.append(Effect("bond of the layer", slipping, scene, note=note))
    return found


def _anisotropy_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "anisotropy"
    body = scene.substrate
    isotropic = replace(scene, layer=scene.layer.in_plane, substrate=None if body is None else body.in_plane)
    if isotropic == scene:
        return Effect(name, note="the materials are isotropic")
    used = layered or isotropic.layer != scene.layer
    note = "against isotropic materials of the in-plane E and nu"
    return Effect(name, scene, isotropic, simulated=used, note=note)


def _sphere_effect(scene: Simulated) -> Effect:
    name, tip = "true sphere", scene.indenter
    if tip.curvature_radius is None:
        return Effect(name, note="the tip is not a sphere")
    if tip.power_law is not tip:
        paraboloid = replace(scene, indenter=tip.power_law)
        return Effect(name, scene, paraboloid, True, "against the paraboloid of the same radius")
    note = "the tip is declared a paraboloid; Sphere(radius) would put this in"
    return Effect(name, replace(scene, indenter=Sphere(tip.curvature_radius)), scene, note=note)


def _compliance_effect(scene: Simulated) -> Effect:
    name = "instrument compliance"
    if not scene.instrument.compliance:
        return Effect(name, note="the instrument is declared stiff")
    stiff = replace(scene, instrument=replace(scene.instrument, compliance=0.0))
    return Effect(name, scene, stiff, simulated=True, note="against a stiff instrument")


def _baseline_effect(scene: Simulated, level: Simulated) -> Effect:
    if scene == level:
        return Effect("baseline", note="no baseline is declared")
    return Effect("baseline", scene, level, simulated=True, note="against no baseline")


def _adhesion_effects(scene: Simulated, level: Simulated, law: ContactLaw) -> list[Effect]:
    """Effect of adhesion, and for a stated range of attraction, of that range relative to JKR's zero range."""
    name, adhesion = "adhesion", scene.adhesion
    if adhesion is None:
        return [Effect(name, note="none is declared: a work of adhesion would put it in")]
    note = f"against a tip that does not stick; {law.reason}"
    found = [Effect(name, level, replace(level, adhesion=None), simulated=True, note=note)]
    if adhesion != adhesion.short_ranged:
        ranged, note = replace(level, adhesion=adhesion), f"against JKR; {law.reason}"
        found.append(Effect("range of attraction", ranged, level, simulated=True, note=note))
    return found


def _implied_range(scene: Simulated, solver: Solver) -> list[Effect]:
    """A row on the range of attraction that an adhesion model without one implies, for the user to check."""
    note = "" if scene.adhesion is None else scene.adhesion.about_range(scene.contact, solver)
    return [Effect("range of attraction", note=note)] if note else []


def _history_effect(*, remembers: bool) -> Effect:
    if not remembers:
        return Effect("history", note="the sample is declared elastic")
    note = "it acts in time: compare the forces of a history of depths with it and without"
    return Effect("history", None, None, simulated=True, note=note)


def _relaxation_effects(given: Simulated, level: Simulated) -> list[Effect]:
    """Effect of the layer's relaxation along a ramp, and of relaxation in shear only.

    `given` is the scene, `level` the scene without memory and baseline.
    """
    relaxation = given.layer.relaxation
    if relaxation is None:
        return [Effect("relaxation", note="the layer is declared elastic")]
    if given.ages:
        # Its effect depends on the motion and on the allowed error, and so is not stated here.
        note = "it acts on an elastic base: compare the forces of a history of depths with it and without"
        return [Effect("relaxation", None, None, simulated=True, note=note)]
    ramp = relaxation.longest_time
    relaxing = replace(level, layer=replace(level.layer, relaxation=relaxation))
    note = f"a ramp of {ramp:.4g} s against the elastic layer of its modulus E; Poisson's ratio constant"
    return [
        Effect("relaxation", relaxing, level, simulated=True, note=note, duration=ramp),
        *_shear_alone(level, relaxation.equilibrium),
    ]


def _drainage_effects(given: Simulated, level: Simulated, law: ContactLaw) -> list[Effect]:
    """Effect of undrained pore water along a ramp; none where the layer has no pore water.

    `given` is the scene, `level` the scene without memory and baseline, `law` its contact law, whose range sets the
    depth.
    """
    material = given.layer.material
    if not material.drains:
        return []
    radius = float(given.indenter.halfspace_radius(np.array([law.max_depth]))[0])
    ramp = _QUICK * material.drainage_time(radius)
    wet = replace(level, layer=replace(level.layer, material=material), drainage=given.drainage)
    note = f"a ramp of {ramp:.4g} s, {_QUICK:g} a^2/c, against the layer without water"
    return [Effect("drainage", wet, level, simulated=True, note=note, duration=ramp)]


def _shear_alone(level: Simulated, kept: float) -> list[Effect]:
    """Effect at equilibrium if the bulk modulus stayed constant, which a constant Poisson's ratio leaves out.

    `kept` is the equilibrium share of the modulus.
    """
    material = level.layer.material
    sheared = material.relaxed_in_shear(kept) if kept else None
    if sheared is None or sheared.nu == material.nu:
        return []
    even = replace_values(material, {"E": kept * material.E})
    rising, constant = (replace(level, layer=replace(level.layer, material=kind)) for kind in (sheared, even))
    note = (
        "at equilibrium, if the bulk modulus stayed and Poisson's ratio rose to "
        f"{sheared.nu:.3f}; assumed not to"
    )
    return [Effect("relaxation of shear alone", rising, constant, note=note)]


# --- sizes and costs --------------------------------------------------------------------------------------------


def effects_table(
    scene: Simulated, max_depth: float, solver: AnySolver = "auto", further: Iterable[EffectRule] = ()
) -> pd.DataFrame:
    """List every effect of `scene` at tip depth `max_depth` (m), with its size and cost.

    Parameters
    ----------
    scene : Scene
        The test.
    max_depth : float
        Deepest point (m) since contact, positive.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`. An effect below its tolerance is marked.
    further : iterable of callable
        Effects of your own: each takes the scene and its law and returns an `Effect`.

    Returns
    -------
    pandas.DataFrame
        One row per effect: ``effect``; ``size_percent``, the change of the force at the deepest point by the
        effect, in per cent of the force without it (NaN where the scene does not determine it); ``simulated``
        (bool), whether its code runs for this scene; ``cost_percent``, the time it adds to a curve of 200 depths
        from cold, in per cent of the curve without it; ``note``. Size and cost are NaN too where the scene without
        the effect has no law to that depth. The law that is used and its reason are in ``.attrs["law"]``.

    Raises
    ------
    InputError
        If `max_depth` is not positive.
    RangeError
        If no law reaches `max_depth`.
    """
    wanted = as_solver(solver)
    deepest = positive(max_depth, "max_depth", "m")
    law = scene.contact_law(deepest, solver=wanted)
    found = (*effects_in(scene, law, wanted), *(rule(scene, law) for rule in further))
    table = pd.DataFrame([_row(effect, deepest, wanted) for effect in found])
    table.attrs["law"] = f"{law.method}: {law.reason}"
    return table


def effect_sizes(scene: Simulated, depth: FloatArray, solver: AnySolver = "auto") -> pd.DataFrame:
    """Size of every effect against depth, for the effects that can be computed over the whole range.

    Parameters
    ----------
    scene : Scene
        The test.
    depth : ndarray, shape (n,)
        Depths (m) since contact, positive and increasing.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`.

    Returns
    -------
    pandas.DataFrame
        ``depth`` (m) and one column per effect: the relative change of the force by it.
    """
    wanted = as_solver(solver)
    law = scene.contact_law(float(depth[-1]), solver=wanted)
    known = {}
    for effect in effects_in(scene, law, wanted):
        try:
            size = _size(effect, depth, wanted)
        except InputError:
            continue  # the scene without the effect has no law to this depth: no size along the curve
        if np.isfinite(size).all():
            known[effect.name] = size
    return pd.DataFrame({"depth": depth, **known})


def _row(effect: Effect, deepest: float, solver: Solver) -> dict[str, object]:
    note = effect.note if effect.note_at is None else effect.note_at(deepest)
    try:
        size = float(_size(effect, np.array([deepest]), solver)[0])
        cost = _added_cost(effect, deepest, solver) if effect.simulated else 0.0
    except InputError as error:
        size, cost, note = np.nan, np.nan, f"not measured: {error}"
    if effect.simulated and abs(size) < solver.tolerance:
        note = f"{effect.note}; below rtol = {solver.tolerance:g} here"
    return {
        "effect": effect.name,
        "size_percent": 100.0 * size,
        "simulated": effect.simulated,
        "cost_percent": cost,
        "note": note,
    }


def _size(effect: Effect, depth: FloatArray, solver: Solver) -> FloatArray:
    """Relative change of the force by an effect at tip depths (m), (n,); NaN where unknown."""
    if effect.excess is not None:
        return effect.excess(depth)
    if effect.with_it is None or effect.without is None:
        return np.full(depth.shape, np.nan)
    if effect.duration is not None:
        along, clock = _ramp(effect, float(depth.max()))
        with_it = effect.with_it.force(along, clock, solver=solver)[1:]
        sizes = with_it / effect.without.force(along, solver=solver)[1:] - 1.0
        return np.asarray(np.interp(depth, along[1:] - along[0], sizes))
    readings = depth + effect.with_it.instrument.contact_depth
    with_it = effect.with_it.force(readings, solver=solver)
    change = np.asarray(with_it / effect.without.force(readings, solver=solver) - 1.0)
    # Two laws of one contact may agree to rounding: friction has no effect on an incompressible half-space.
    return np.where(np.abs(change) > _ROUNDING, change, 0.0)


def _added_cost(effect: Effect, deepest: float, solver: Solver) -> float:
    """Computing time that an effect adds to a curve, in per cent of the time without it."""
    if effect.with_it is None or effect.without is None:
        return 0.0
    depth, clock = _ramp(effect, deepest)
    with_it = without = np.inf
    for _ in range(_COST_ROUNDS):
        start = time.process_time()
        effect.with_it.force(depth, clock, solver=solver)
        middle = time.process_time()
        effect.without.force(depth, solver=solver)
        with_it = min(with_it, middle - start)
        without = min(without, time.process_time() - middle)
        if with_it > _LONG:
            break
    return 100.0 * (with_it / without - 1.0)


def _ramp(effect: Effect, deepest: float) -> tuple[FloatArray, FloatArray | None]:
    """Depth readings (m) from contact to `deepest` (m), and their times (s) for an effect that depends on time."""
    first = 0.0 if effect.with_it is None else effect.with_it.instrument.contact_depth
    depth = np.linspace(0.0, deepest, _COST_POINTS) + first
    clock = None if effect.duration is None else np.linspace(0.0, effect.duration, _COST_POINTS)
    return depth, clock
