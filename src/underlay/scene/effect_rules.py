"""The physical effects in a scene, each as a pair of scenes: with the effect and without it.

An effect is measured by leaving it out. An effect that a scene does not declare runs none of its code, nor does a
layer that differs from its base by less than the requested accuracy. Friction under the tip and finite strain are
effects that a law leaves out unless the scene says otherwise (`left_out_effects`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

import numpy as np

from underlay._arrays import ArrayLike, FloatArray
from underlay.errors import InputError
from underlay.mechanics.body import RIGID, Base, Body, Layer, stacked
from underlay.mechanics.contact import Adhesion, Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepancy import finite_strain_excess, why_unmeasured
from underlay.mechanics.indenters import Indenter, Sphere
from underlay.mechanics.response import History
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver
from underlay.quantities import replace_values
from underlay.scene.instrument import Instrument

#: A function that finds one effect, from a scene and the law of its contact.
EffectRule: TypeAlias = "Callable[[Simulated, ContactLaw], Effect]"
# Duration of a ramp over a^2/c (a the contact radius, c the consolidation coefficient) in which most of the water
# stays.
_QUICK = 0.1
_FRICTION, _FINITE_STRAIN = "friction", "finite strain"


@runtime_checkable
class Drains(Protocol):
    """A material whose pore pressure equilibrates over a length (m) in a time (s)."""

    def drainage_time(self, length: float) -> float:
        """Time (s) in which it equilibrates over a length (m)."""


class Simulated(Protocol):
    """Interface of a scene as the list of effects uses it: its parts, its law and its force. `Scene` has it."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def indenter(self) -> Indenter:
        """The tip."""

    @property
    def layer(self) -> Layer:
        """The top layer, which is indented."""

    @property
    def substrate(self) -> Body | None:
        """The layers and the half-space under the top layer; None for a half-space of the layer."""

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Every layer, from the top down."""

    @property
    def base(self) -> Base | None:
        """The half-space under all layers."""

    @property
    def drainage(self) -> str | None:
        """Whether the tip lets water through: "solid", "porous" or "unknown"; None without pore water."""

    @property
    def instrument(self) -> Instrument:
        """The instrument that reads depth and force."""

    @property
    def history(self) -> History | None:
        """A time-dependent model of the sample besides relaxation and drainage of its layer; None without one."""

    @property
    def adhesion(self) -> Adhesion | None:
        """The adhesion between tip and surface, or None."""

    @property
    def friction(self) -> str:
        """Friction under the tip: "none", "stuck" or "unknown"."""

    @property
    def contact(self) -> Contact:
        """Indenter and body, as a solver takes them."""

    @property
    def elastic(self) -> Simulated:
        """The scene without relaxation and drainage."""

    @property
    def ages(self) -> bool:
        """Whether the layer relaxes on an elastic base."""

    def contact_law(self, max_depth: float, *, solver: AnySolver = "auto") -> ContactLaw:
        """Law of its contact up to `max_depth` (m)."""

    def force(
        self, depth: ArrayLike, time: ArrayLike | None = None, *, solver: AnySolver = "auto"
    ) -> FloatArray:
        """Force reading (N) at depth readings (m)."""


@dataclass(frozen=True)
class Effect:
    """One physical effect: the scene with it and without it.

    Parameters
    ----------
    name : str
        Its name.
    with_it, without : Scene or None
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
    with_it: Simulated | None
    without: Simulated | None
    simulated: bool
    note: str
    duration: float | None = None
    excess: Callable[[FloatArray], FloatArray] | None = None
    note_at: Callable[[float], str] | None = None


def left_out_effects(level: Simulated) -> list[Effect]:
    """The effects of friction and finite strain; `level` is the scene without memory and baseline."""
    return [_friction(level), _finite_strain(level)]


def _friction(level: Simulated) -> Effect:
    """Effect of a tip without slip relative to a frictionless one; real friction lies between."""
    if level.adhesion is not None:
        note = "how a tip that sticks and adheres behaves is not simulated"
        return Effect(_FRICTION, None, None, simulated=False, note=note)
    simulated = level.friction == "stuck"
    said = {"stuck": "the tip is declared to stick", "none": "declared none", "unknown": "unknown"}
    return Effect(
        _FRICTION,
        replace(level, friction="stuck"),
        replace(level, friction="none"),
        simulated=simulated,
        note=f"a tip that sticks against one that slides; {said[level.friction]}",
    )


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

    return Effect(
        _FINITE_STRAIN, None, None, simulated=False, note="against small strains", excess=excess, note_at=note
    )


def effects_of(scene: Simulated, law: ContactLaw) -> list[Effect]:
    """All effects of a scene whose contact is simulated by `law`.

    All but the baseline are measured without the baseline, so that sizes are relative to the contact force.
    Relaxation and drainage are left out of the other effects: the sizes are those of a sudden depth.
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
    return [
        *_layer_effects(level, layered=law.method != "halfspace"),
        _sphere_effect(level),
        _compliance_effect(level),
        _baseline_effect(scene, level),
        *_adhesion_effects(ranged, level, law),
        *left_out_effects(level)[: 1 if above.layer.stiffening else None],
        *_effects_on_law(above, level),
        *_relaxation_effects(given, level),
        *_drainage_effects(given, level, law),
        _history_effect(remembers=given.history is not None),
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
        return Effect("sides", None, None, simulated=False, note=f"ignored; {error}")
    return Effect("sides", plug, wide, simulated=False, note="ignored; as of a round plug")


def _layer_effects(scene: Simulated, *, layered: bool) -> list[Effect]:
    return [
        _thickness_effect(scene, layered=layered),
        _substrate_effect(scene, layered=layered),
        *_stack_effects(scene, layered=layered),
        *_bond_effects(scene, layered=layered),
        _anisotropy_effect(scene, layered=layered),
    ]


def _thickness_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "finite thickness"
    if scene.substrate is None:
        return Effect(name, None, None, simulated=False, note="no substrate at a finite depth is declared")
    halfspace = replace(scene, layer=Layer(scene.layer.material), substrate=None)
    return Effect(name, scene, halfspace, simulated=layered, note="against a half-space of the layer")


def _substrate_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "substrate compliance"
    if scene.substrate is None or scene.base == RIGID:
        return Effect(name, None, None, simulated=False, note="no elastic substrate is declared")
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
        found.append(Effect("bond of the layer", slipping, scene, simulated=False, note=note))
    return found


def _anisotropy_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "anisotropy"
    body = scene.substrate
    isotropic = replace(scene, layer=scene.layer.in_plane, substrate=None if body is None else body.in_plane)
    if isotropic == scene:
        return Effect(name, None, None, simulated=False, note="the materials are isotropic")
    used = layered or isotropic.layer != scene.layer
    note = "against isotropic materials of the in-plane E and nu"
    return Effect(name, scene, isotropic, simulated=used, note=note)


def _sphere_effect(scene: Simulated) -> Effect:
    name, tip = "true sphere", scene.indenter
    if tip.curvature_radius is None:
        return Effect(name, None, None, simulated=False, note="the tip is not a sphere")
    if tip.power_law is not tip:
        return Effect(
            name,
            scene,
            replace(scene, indenter=tip.power_law),
            simulated=True,
            note="against the paraboloid of the same radius",
        )
    return Effect(
        name,
        replace(scene, indenter=Sphere(tip.curvature_radius)),
        scene,
        simulated=False,
        note="the tip is declared a paraboloid; Sphere(radius) would put this in",
    )


def _compliance_effect(scene: Simulated) -> Effect:
    name = "instrument compliance"
    if not scene.instrument.compliance:
        return Effect(name, None, None, simulated=False, note="the instrument is declared stiff")
    stiff = replace(scene, instrument=replace(scene.instrument, compliance=0.0))
    return Effect(name, scene, stiff, simulated=True, note="against a stiff instrument")


def _baseline_effect(scene: Simulated, level: Simulated) -> Effect:
    if scene == level:
        return Effect("baseline", None, None, simulated=False, note="no baseline is declared")
    return Effect("baseline", scene, level, simulated=True, note="against no baseline")


def _adhesion_effects(scene: Simulated, level: Simulated, law: ContactLaw) -> list[Effect]:
    """Effect of adhesion, and for a stated range of attraction, of that range relative to JKR's zero range."""
    name, adhesion = "adhesion", scene.adhesion
    if adhesion is None:
        note = "none is declared: a work of adhesion would put it in"
        return [Effect(name, None, None, simulated=False, note=note)]
    note = f"against a tip that does not stick; {law.reason}"
    found = [Effect(name, level, replace(level, adhesion=None), simulated=True, note=note)]
    if adhesion != adhesion.short_ranged:
        ranged = replace(level, adhesion=adhesion)
        found.append(
            Effect("range of attraction", ranged, level, simulated=True, note=f"against JKR; {law.reason}")
        )
    return found


def range_asked(scene: Simulated, solver: Solver) -> list[Effect]:
    """A row on the range of attraction that an adhesion model without one implies, for the user to check."""
    adhesion = scene.adhesion
    note = "" if adhesion is None else adhesion.about_range(scene.contact, solver)
    return [Effect("range of attraction", None, None, simulated=False, note=note)] if note else []


def _history_effect(*, remembers: bool) -> Effect:
    if not remembers:
        return Effect("history", None, None, simulated=False, note="the sample is declared elastic")
    note = "it acts in time: compare the forces of a history of depths with it and without"
    return Effect("history", None, None, simulated=True, note=note)


def _relaxation_effects(given: Simulated, level: Simulated) -> list[Effect]:
    """Effect of the layer's relaxation along a ramp, and of relaxation in shear only.

    `given` is the scene, `level` the scene without memory and baseline.
    """
    relaxation = given.layer.relaxation
    if relaxation is None:
        return [Effect("relaxation", None, None, simulated=False, note="the layer is declared elastic")]
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
    if not isinstance(material, Drains):
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
    return [Effect("relaxation of shear alone", rising, constant, simulated=False, note=note)]
