"""Which effects a scene calls for: how large each one is, whether it is simulated, what it costs.

An effect is measured by leaving it out: the force with it and without it. What a scene does not declare, and
a layer that differs from its base by less than the accuracy asked, runs none of its code.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np
import pandas as pd

from underlay._arrays import ArrayLike, FloatArray, positive
from underlay.errors import RangeError
from underlay.mechanics.contact import Adhesion, Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Indenter, Paraboloid, Sphere
from underlay.mechanics.materials import (
    RIGID,
    Isotropic,
    Layer,
    Material,
    Rigid,
    Substrate,
    TransverselyIsotropic,
)
from underlay.mechanics.response import History
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.mechanics.stack import Body, Stack
from underlay.scene.instrument import Instrument

__all__ = ["Effect", "EffectRule", "Simulated", "effect_sizes", "effects_table"]

_COLUMNS = ("effect", "size_percent", "simulated", "cost_percent", "note")
# The cost of an effect is timed on curves of this many depths, from cold, with and without it in turns.
_COST_POINTS = 200
# The shortest of many rounds counts, in processor time.
_COST_ROUNDS = 25
# One that takes longer than this (s) is timed once.
_LONG = 0.2
_INCOMPRESSIBLE = 0.5


class Simulated(Protocol):
    """What the ledger asks of a scene: its parts, its law and its force. `Scene` is one."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def indenter(self) -> Indenter:
        """What is pressed in."""

    @property
    def layer(self) -> Layer:
        """What it is pressed into."""

    @property
    def substrate(self) -> Body | None:
        """What the layer stands on."""

    @property
    def instrument(self) -> Instrument:
        """What reads depth and force."""

    @property
    def history(self) -> History | None:
        """What the sample remembers."""

    @property
    def adhesion(self) -> Adhesion | None:
        """What holds tip and surface together."""

    @property
    def contact(self) -> Contact:
        """Indenter and body."""

    @property
    def elastic(self) -> Simulated:
        """The scene without memory."""

    def contact_law(self, max_depth: float, *, solver: AnySolver = "auto") -> ContactLaw:
        """Law of its contact up to `max_depth` (m)."""

    def force(
        self, depth: ArrayLike, time: ArrayLike | None = None, *, solver: AnySolver = "auto"
    ) -> FloatArray:
        """Force reading (N) at depth readings (m)."""


@dataclass(frozen=True)
class Effect:
    """One effect: the scene with it and without it.

    Parameters
    ----------
    name : str
        What it is called.
    with_it, without : Scene or None
        The two scenes; None where the scene says too little to build one.
    simulated : bool
        Whether the scene as it stands runs the effect's code.
    note : str
        What the size is measured against, or why there is none.
    duration : float, optional
        Time (s) of the even motion to the deepest point, for an effect that acts in time.
    """

    name: str
    with_it: Simulated | None
    without: Simulated | None
    simulated: bool
    note: str
    duration: float | None = None


#: How an effect is found: from a scene and the law of its contact.
EffectRule: TypeAlias = "Callable[[Simulated, ContactLaw], Effect]"


def effects_table(
    scene: Simulated, max_depth: float, solver: AnySolver = "auto", further: Iterable[EffectRule] = ()
) -> pd.DataFrame:
    """List every effect of `scene` at tip depth `max_depth` (m).

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
        One row per effect: ``effect``; ``size_percent``, the change of the force at the deepest point when
        the effect is put in, in per cent of the force without it (NaN where the scene says nothing of it);
        ``simulated`` (bool), whether its code runs for this scene; ``cost_percent``, the time it adds to a
        curve of 200 depths from cold, in per cent of the curve without it; ``note``. Size and cost are NaN
        too where the scene to compare with cannot go as deep. The law that is taken and its reason stand in
        ``.attrs["law"]``.

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
    found = (*_effects(scene, law), *_range_asked(scene, wanted), *(rule(scene, law) for rule in further))
    table = pd.DataFrame([_row(effect, deepest, wanted) for effect in found])
    table.attrs["law"] = f"{law.method}: {law.reason}"
    return table


def effect_sizes(scene: Simulated, depth: FloatArray, solver: AnySolver = "auto") -> pd.DataFrame:
    """Size of every effect the scene gives numbers for, against depth.

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
        ``depth`` (m) and one column per effect: the relative change of the force when it is put in.
    """
    wanted = as_solver(solver)
    law = scene.contact_law(float(depth[-1]), solver=wanted)
    known = {}
    for effect in _effects(scene, law):
        try:
            size = _size(effect, depth, wanted)
        except RangeError:
            continue  # the scene to compare with ends before: there is no size along the whole curve
        if np.isfinite(size).all():
            known[effect.name] = size
    return pd.DataFrame({"depth": depth, **known})


def _row(effect: Effect, deepest: float, solver: Solver) -> dict[str, object]:
    row = {"effect": effect.name, "simulated": effect.simulated, "note": effect.note}
    try:
        size = float(_size(effect, np.array([deepest]), solver)[0])
        cost = _added_cost(effect, deepest, solver) if effect.simulated else 0.0
    except RangeError as error:
        size, cost, row["note"] = np.nan, np.nan, f"not measured: {error}"
    if effect.simulated and abs(size) < solver.tolerance:
        row["note"] = f"{effect.note}; below rtol = {solver.tolerance:g} here"
    numbers = {"size_percent": 100.0 * size, "cost_percent": cost}
    return {key: (row | numbers)[key] for key in _COLUMNS}


def _effects(scene: Simulated, law: ContactLaw) -> list[Effect]:
    """Every effect there is, for a scene whose contact is simulated by `law`.

    All but the baseline are measured without it: a per cent of the force is one of the contact force. What the
    sample remembers acts in time and is left out: the sizes are those of a sudden depth.
    """
    given, scene = scene, scene.elastic
    ranged = scene
    if scene.adhesion is not None:
        # An attraction of finite range costs a thousand times as much, and is a row of its own.
        scene = replace(scene, adhesion=scene.adhesion.short_ranged)
    level = replace(scene, instrument=replace(scene.instrument, baseline=0.0, baseline_slope=0.0))
    return [
        *_layer_effects(level, layered=law.method != "halfspace"),
        _sphere_effect(level),
        _compliance_effect(level),
        _baseline_effect(scene, level),
        *_adhesion_effects(ranged, level, law),
        *_relaxation_effects(given, level),
        _history_effect(remembers=given.history is not None),
    ]


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
    if not _has_base(scene):
        return Effect(name, None, None, simulated=False, note="no substrate at a finite depth is declared")
    halfspace = replace(scene, layer=Layer(scene.layer.material), substrate=None)
    return Effect(name, scene, halfspace, simulated=layered, note="against a half-space of the layer")


def _substrate_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "substrate compliance"
    stack = scene.substrate if isinstance(scene.substrate, Stack) else None
    base = scene.substrate if stack is None else stack.base
    if not _has_base(scene) or isinstance(base, Rigid):
        return Effect(name, None, None, simulated=False, note="no elastic substrate is declared")
    rigid = replace(scene, substrate=RIGID if stack is None else replace(stack, base=RIGID))
    return Effect(name, scene, rigid, simulated=layered, note="against a rigid base")


def _stack_effects(scene: Simulated, *, layered: bool) -> list[Effect]:
    """Every further layer of a stack, against the body without it."""
    if not (_has_base(scene) and isinstance(scene.substrate, Stack)):
        return []
    stack = scene.substrate
    return [
        Effect(
            f"layer {number + 2}",
            scene,
            replace(scene, substrate=stack.without(number)),
            simulated=layered,
            note="against the stack without this layer",
        )
        for number in range(len(stack.layers))
    ]


def _bond_effects(scene: Simulated, *, layered: bool) -> list[Effect]:
    """What slip and springs do, all together, against bonded faces."""
    bonded = replace(scene, layer=replace(scene.layer, bond="bonded"), substrate=_bonded(scene.substrate))
    if not _has_base(scene) or bonded == scene:
        return []
    return [Effect("interfaces", scene, bonded, simulated=layered, note="against bonded faces")]


def _bonded(body: Body | None) -> Body | None:
    if not isinstance(body, Stack):
        return body
    return replace(body, layers=tuple(replace(layer, bond="bonded") for layer in body.layers))


def _anisotropy_effect(scene: Simulated, *, layered: bool) -> Effect:
    name = "anisotropy"
    isotropic = _isotropic(scene)
    if isotropic == scene:
        return Effect(name, None, None, simulated=False, note="the materials are isotropic")
    used = layered or isinstance(scene.layer.material, TransverselyIsotropic)
    note = "against isotropic materials of the in-plane E and nu"
    return Effect(name, scene, isotropic, simulated=used, note=note)


def _has_base(scene: Simulated) -> bool:
    return scene.substrate is not None and bool(np.isfinite(scene.layer.thickness))


def _sphere_effect(scene: Simulated) -> Effect:
    name, tip = "true sphere", scene.indenter
    if isinstance(tip, Sphere):
        return Effect(
            name,
            scene,
            replace(scene, indenter=Paraboloid(tip.radius)),
            simulated=True,
            note="against the paraboloid of the same radius",
        )
    if isinstance(tip, Paraboloid):
        return Effect(
            name,
            replace(scene, indenter=Sphere(tip.radius)),
            scene,
            simulated=False,
            note="the tip is declared a paraboloid; Sphere(radius) would put this in",
        )
    return Effect(name, None, None, simulated=False, note="the tip is not a sphere")


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
    """Adhesion against none; where its range is declared, also that range against JKR, which has none."""
    name, adhesion = "adhesion", scene.adhesion
    if adhesion is None:
        note = "none is declared; adhesion=JKR(work) would put it in"
        return [Effect(name, None, None, simulated=False, note=note)]
    note = f"against a tip that does not stick; {law.reason}"
    found = [Effect(name, level, replace(level, adhesion=None), simulated=True, note=note)]
    if adhesion != adhesion.short_ranged:
        ranged = replace(level, adhesion=adhesion)
        found.append(
            Effect("range of attraction", ranged, level, simulated=True, note=f"against JKR; {law.reason}")
        )
    return found


def _range_asked(scene: Simulated, solver: Solver) -> list[Effect]:
    """What range of attraction a model that has none stands for: whether it may be used is for the user to see."""
    adhesion = scene.adhesion
    note = "" if adhesion is None else adhesion.about_range(scene.contact, solver)
    return [Effect("range of attraction", None, None, simulated=False, note=note)] if note else []


def _history_effect(*, remembers: bool) -> Effect:
    if not remembers:
        return Effect("history", None, None, simulated=False, note="the sample is declared elastic")
    note = "it acts in time: compare the forces of a history of depths with it and without"
    return Effect("history", None, None, simulated=True, note=note)


def _relaxation_effects(given: Simulated, level: Simulated) -> list[Effect]:
    """What the layer's relaxation does along a ramp, and what it would do if shear alone relaxed.

    `level` is the scene without memory and baseline.
    """
    relaxation = given.layer.relaxation
    if relaxation is None:
        return [Effect("relaxation", None, None, simulated=False, note="the layer is declared elastic")]
    ramp = relaxation.longest_time
    relaxing = replace(level, layer=replace(level.layer, relaxation=relaxation))
    note = f"a ramp of {ramp:.4g} s against the elastic layer of its modulus E; Poisson's ratio constant"
    return [
        Effect("relaxation", relaxing, level, simulated=True, note=note, duration=ramp),
        *_shear_alone(level, relaxation.equilibrium),
    ]


def _shear_alone(level: Simulated, kept: float) -> list[Effect]:
    """The end of a relaxation in which the bulk modulus stays: what a constant Poisson's ratio leaves out."""
    material = level.layer.material
    if not isinstance(material, Isotropic) or material.nu == _INCOMPRESSIBLE or not kept:
        return []
    shear = 0.5 * kept * material.E / (1.0 + material.nu)
    bulk = material.E / (3.0 * (1.0 - 2.0 * material.nu))
    nu = (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear))
    rising, constant = (
        replace(level, layer=replace(level.layer, material=Isotropic(2.0 * shear * (1.0 + ratio), ratio)))
        for ratio in (nu, material.nu)
    )
    note = f"at equilibrium, if the bulk modulus stayed and Poisson's ratio rose to {nu:.3f}; assumed not to"
    return [Effect("relaxation of shear alone", rising, constant, simulated=False, note=note)]


def _size(effect: Effect, depth: FloatArray, solver: Solver) -> FloatArray:
    """Relative change of the force at tip depths `depth` when the effect is put in; NaN where unknown."""
    if effect.with_it is None or effect.without is None:
        return np.full(depth.shape, np.nan)
    if effect.duration is not None:
        along, clock = _ramp(effect, float(depth.max()))
        sizes = effect.with_it.force(along, clock, solver=solver)[1:]
        sizes = sizes / effect.without.force(along, solver=solver)[1:] - 1.0
        return np.interp(depth, along[1:] - along[0], sizes)
    readings = depth + effect.with_it.instrument.contact_depth
    with_it = effect.with_it.force(readings, solver=solver)
    return np.asarray(with_it / effect.without.force(readings, solver=solver) - 1.0)


def _added_cost(effect: Effect, deepest: float, solver: Solver) -> float:
    """Time of the scene with the effect over that without, less one, in per cent."""
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
    """Readings (m) from contact to `deepest` (m), and their times (s) where the effect acts in time."""
    first = 0.0 if effect.with_it is None else effect.with_it.instrument.contact_depth
    depth = np.linspace(0.0, deepest, _COST_POINTS) + first
    clock = None if effect.duration is None else np.linspace(0.0, effect.duration, _COST_POINTS)
    return depth, clock


def _isotropic(scene: Simulated) -> Simulated:
    """Return the scene with each anisotropic material replaced by its in-plane E and nu."""
    layer = replace(scene.layer, material=_in_plane(scene.layer.material))
    substrate = scene.substrate
    if isinstance(substrate, Stack):
        layers = tuple(replace(deeper, material=_in_plane(deeper.material)) for deeper in substrate.layers)
        substrate = Stack(layers, _base_in_plane(substrate.base))
    elif substrate is not None:
        substrate = _base_in_plane(substrate)
    return replace(scene, layer=layer, substrate=substrate)


def _base_in_plane(base: Substrate) -> Substrate:
    return base if isinstance(base, Rigid) else _in_plane(base)


def _in_plane(material: Material) -> Isotropic:
    if isinstance(material, Isotropic):
        return material
    # An isotropic material cannot have the in-plane ratio above 0.5 that an anisotropic one may.
    return Isotropic(material.E, min(material.nu, 0.5))
