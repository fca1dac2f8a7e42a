"""The parts of a test from the sections of a scene file that declare them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from underlay.errors import InputError, UnderlayWarning
from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.body import (
    RIGID,
    Base,
    Body,
    Bond,
    Layer,
    Material,
    Spring,
    Stack,
    Stiffening,
    as_bond,
)
from underlay.mechanics.discrepancy import FRICTIONS
from underlay.mechanics.indenters import Cone, Indenter, plugged_indenters
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.relaxation import Relaxation
from underlay.mechanics.response import History
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import solver_named
from underlay.mechanics.stiffening import Gent
from underlay.plugins import faults
from underlay.quantities import Part, numbers_of
from underlay.scene.discrepancy import Discrepancy
from underlay.scene.instrument import Instrument, Lever
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.parameters import hint
from underlay.scene.scene import Scene
from underlay.scene.scene_schema import SolverSection, ThicknessSection, WidthSection, check, schema_of
from underlay.scene.uncertainties import rows_of, taken_out

__all__ = ["EQUIVALENT_CONES", "noise_of", "scene_of", "solver_of", "table_of"]

#: Pyramids that are taken as the cone of the same projected area.
EQUIVALENT_CONES = {"berkovich": Cone.berkovich, "vickers": Cone.vickers}


def table_of(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a section of the document, empty where it has none."""
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"[{name}] must be a section, not {table!r}")
    return dict(table)


def scene_of(document: Mapping[str, Any], stood_in: Mapping[str, str]) -> Scene:
    """Return the test; `stood_in` are numbers of the indenter that the document leaves out."""
    document, beside = taken_out(document)
    scene = Scene(
        indenter=_indenter({**table_of(document, "indenter"), **stood_in}),
        layer=_layer(table_of(document, "layer")),
        substrate=_substrate(document),
        instrument=_build(Instrument, "instrument", table_of(document, "instrument")),
        history=_chosen(History, "history", document),
        adhesion=_chosen(Adhesion, "adhesion", document),
        lever=_build(Lever, "lever", table_of(document, "lever")) if "lever" in document else None,
        discrepancy=_discrepancy(document),
        **_words(document),
    )
    left_out = tuple(f"indenter.{name}" for name in stood_in)
    rows = rows_of(document.get("uncertainties"), beside, numbers_of(scene), left_out)
    return replace(scene, uncertainties=rows)


def _discrepancy(document: Mapping[str, Any]) -> Discrepancy | None:
    if "discrepancy" not in document:
        return None
    found: Discrepancy = _build(Discrepancy, "discrepancy", table_of(document, "discrepancy"))
    return found


def _words(document: Mapping[str, Any]) -> dict[str, Any]:
    """What the file says of the whole scene, before its sections."""
    said = {key: document[key] for key in ("friction", "finite_strain", "drainage") if key in document}
    if said.get("friction", "none") not in FRICTIONS:
        raise InputError(f"friction: {said['friction']!r:.60} is not known; allowed: {', '.join(FRICTIONS)}")
    if not isinstance(said.get("finite_strain", True), bool):
        raise InputError(f"finite_strain: must be true or false, not {said['finite_strain']!r:.60}")
    return said


def _indenter(table: dict[str, Any]) -> Indenter:
    shapes = Indenter.kinds()
    name = table.pop("shape", None)
    if isinstance(name, str) and name in EQUIVALENT_CONES:
        return _equivalent_cone(name, table)
    if not isinstance(name, str) or name not in shapes:
        allowed = sorted([*shapes, *EQUIVALENT_CONES])
        if name is None:
            raise InputError(f"[indenter] needs 'shape'; allowed: {', '.join(allowed)}")
        meant = hint(str(name), allowed) or ";"
        raise InputError(
            f"[indenter] shape: {name!r:.80} is not known{meant} allowed: {', '.join(allowed)}"
            f"{faults(plugged_indenters())}"
        )
    indenter: Indenter = _build(shapes[name], "indenter", table, besides=("shape",))
    return indenter


def _layer(table: dict[str, Any]) -> Layer:
    relaxation, stiffening = _relaxation(table), _stiffening(table)
    stated = {key: table.pop(key) for key in _WIDTH if key in table}
    width = check(WidthSection, "layer", stated)
    return replace(_one_layer("layer", table), relaxation=relaxation, stiffening=stiffening, **width)


_WIDTH = tuple(WidthSection.model_fields)


def _stiffening(layer: dict[str, Any]) -> Stiffening | None:
    """The stiffening of a layer's section, which is taken out of it; `Gent` is loaded to be among its kinds."""
    if "stiffening" not in layer:
        return None
    section, given = Gent.section, layer.pop("stiffening")
    if not isinstance(given, Mapping):
        raise InputError(f"[{section}] must be a section, not {given!r}")
    table = dict(given)
    found: Stiffening = _build(_named(Stiffening, section, table), section, table)
    return found


def _relaxation(layer: dict[str, Any]) -> Relaxation | None:
    """The relaxation of a layer's section, which is taken out of it."""
    if "relaxation" not in layer:
        return None
    section, given = "layer.relaxation", layer.pop("relaxation")
    if not isinstance(given, Mapping):
        raise InputError(f"[{section}] must be a section, not {given!r}")
    table = dict(given)
    kind = _named(Relaxation, section, table)
    words = {"relaxes": table.pop("relaxes")} if "relaxes" in table else {}
    numbers = check(schema_of(kind), section, table)
    try:
        relaxation: Relaxation = kind(**words, **numbers)
    except InputError as error:
        raise InputError(f"[{section}] {error}") from error
    return relaxation


def _one_layer(section: str, table: dict[str, Any]) -> Layer:
    thickness, bond = np.inf, _bond(section, table.pop("bond", "bonded"))
    if "thickness" in table:
        stated = {"thickness": table.pop("thickness")}
        thickness = check(ThicknessSection, section, stated)["thickness"]
    return Layer(_material(section, table, besides=("thickness", "bond", *_OF_LAYER)), thickness, bond)


#: What the layer on top may have besides.
_OF_LAYER = ("relaxation", "stiffening", *_WIDTH)


def _bond(section: str, given: Any) -> Bond:
    if isinstance(given, Mapping):
        spring: Spring = _build(Spring, f"{section}.bond", given)
        return spring
    try:
        return as_bond(given)
    except InputError as error:
        raise InputError(
            f'[{section}] bond: {given!r:.60} is not known; allowed: "bonded", "slip", "unknown" or '
            '{ normal = "1 GPa/m", shear = "0 Pa/m" }'
        ) from error


def _equivalent_cone(name: str, table: Mapping[str, Any]) -> Cone:
    if table:
        raise InputError(f"[indenter] shape {name} needs nothing else; remove {', '.join(table)}")
    cone = EQUIVALENT_CONES[name]()
    warnings.warn(
        f"[indenter] shape: a {name} tip is taken as the cone of the same projected area, half-angle "
        f"{np.rad2deg(cone.half_angle):.2f} deg; the pyramid's edges are not in the model",
        UnderlayWarning,
        stacklevel=2,
    )
    return cone


def _material(section: str, table: dict[str, Any], besides: tuple[str, ...]) -> Material:
    transverse = bool({"E_axial", "G_axial", "nu_axial"} & table.keys())
    kind: type[Material] = TransverselyIsotropic if transverse else Isotropic
    if {"permeability", "permeability_ratio"} & table.keys():
        # Not loaded for a layer without water.
        from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse  # noqa: PLC0415

        kind = BiphasicTransverse if transverse or "permeability_ratio" in table else Biphasic
    material: Material = _build(kind, section, table, besides=besides)
    return material


def _substrate(document: Mapping[str, Any]) -> Body | None:
    if "substrate" not in document:
        return None
    table = table_of(document, "substrate")
    layers = table.pop("layers", None)
    base = _base(table)
    if layers is None:
        return base
    if not isinstance(layers, list) or not all(isinstance(entry, Mapping) for entry in layers):
        raise InputError("[substrate] layers: write each as a section of its own, [[substrate.layers]]")
    stack = [_one_layer(f"substrate.layers[{number}]", dict(entry)) for number, entry in enumerate(layers)]
    try:
        return Stack(stack, base)
    except InputError as error:
        raise InputError(f"[[substrate.layers]] {error}") from error


def _base(table: dict[str, Any]) -> Base:
    rigid = table.pop("rigid", False)
    if not isinstance(rigid, bool):
        raise InputError(f"[substrate] rigid: must be true or false, not {rigid!r}")
    if not rigid:
        return _material("substrate", table, besides=("rigid", "layers"))
    if table:
        raise InputError(f"[substrate] is rigid and needs nothing else; remove {', '.join(table)}")
    return RIGID


def _chosen(family: type[Part], name: str, document: Mapping[str, Any]) -> Any:
    """The part that a section declares, of the kind that it names; None without the section."""
    if name not in document:
        return None
    table = table_of(document, name)
    return _build(_named(family, name, table), name, table)


def _named(family: type[Part], section: str, table: dict[str, Any]) -> type[Any]:
    """The class that a section's ``model`` names; the key is taken out."""
    name, models = table.pop("model", None), family.kinds()
    if not isinstance(name, str) or name not in models:
        raise InputError(
            f"[{section}] model: {name!r:.80} is not known; allowed: {', '.join(sorted(models)) or 'none'}"
        )
    return models[name]


def noise_of(document: Mapping[str, Any]) -> NoiseModel | None:
    """Return the noise model of ``[noise]``; None where there is nothing in it."""
    table = table_of(document, "noise")
    if not table:
        return None
    kind = _named(NoiseModel, "noise", {"model": Noise.model, **table})
    noise: NoiseModel = _build(kind, "noise", {key: table[key] for key in table if key != "model"})
    return noise


#: Keys that [solver] had once, and what to write now.
_OLD_SOLVER_KEYS = {"method": "name", "accuracy": "rtol"}


def solver_of(document: Mapping[str, Any]) -> Solver:
    """Return the solver of ``[solver]``; `Auto` without one."""
    table = table_of(document, "solver")
    for old, new in _OLD_SOLVER_KEYS.items():
        if old in table:
            value = table[old]
            said = f'"{value}"' if isinstance(value, str) else value
            raise InputError(f"[solver] {old} is now {new}: write {new} = {said}")
    stated = {"name": "auto", **check(SolverSection, "solver", table)}
    try:
        return solver_named(**stated)
    except InputError as error:
        raise InputError(f"[solver] {error}") from error


def _build(kind: type[Any], section: str, table: Mapping[str, Any], *, besides: tuple[str, ...] = ()) -> Any:
    """Make a dataclass from a section; its fields, and `besides`, say which keys there are."""
    return kind(**check(schema_of(kind), section, table, besides=besides))
