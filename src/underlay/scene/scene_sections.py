"""Builds the parts of a test from the sections of a scene file."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
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
from underlay.scene.scene_keys import EQUIVALENT_CONES, SolverSection, keys_of, read_table
from underlay.scene.uncertainties import rows_of, split_uncertainties

#: Sections of the top layer. `Gent` is loaded with this module, so that it is among the kinds.
_EFFECTS = {"relaxation": Relaxation, Gent.section.partition(".")[2]: Stiffening}
#: Former keys of [solver], and their present names.
_OLD_SOLVER_KEYS = {"method": "name", "accuracy": "rtol"}


def table_of(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a section of the document as a dict, empty where it has none."""
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"[{name}] must be a section, not {table!r}")
    return dict(table)


def scene_of(document: Mapping[str, Any], stood_in: Mapping[str, str]) -> Scene:
    """Return the test of a document; `stood_in` are placeholder numbers of the indenter that it leaves out."""
    document, inline = split_uncertainties(document)
    scene = Scene(
        indenter=_indenter({**table_of(document, "indenter"), **stood_in}),
        layer=_layer("layer", table_of(document, "layer")),
        substrate=_substrate(document),
        instrument=_build(Instrument, "instrument", table_of(document, "instrument")),
        history=_chosen(History, "history", document),
        adhesion=_chosen(Adhesion, "adhesion", document),
        lever=_given(Lever, "lever", document),
        discrepancy=_given(Discrepancy, "discrepancy", document),
        **_words(document),
    )
    left_out = tuple(f"indenter.{name}" for name in stood_in)
    rows = rows_of(document.get("uncertainties"), inline, numbers_of(scene), left_out)
    return replace(scene, uncertainties=rows)


def _words(document: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of the whole scene, before its sections: friction, finite_strain and drainage, checked."""
    said = {key: document[key] for key in ("friction", "finite_strain", "drainage") if key in document}
    if said.get("friction", "none") not in FRICTIONS:
        raise InputError(f"friction: {said['friction']!r:.60} is not known; allowed: {', '.join(FRICTIONS)}")
    if not isinstance(said.get("finite_strain", True), bool):
        raise InputError(f"finite_strain: must be true or false, not {said['finite_strain']!r:.60}")
    return said


def _indenter(table: dict[str, Any]) -> Indenter:
    shapes: Mapping[str, type[Indenter]] = Indenter.kinds()
    name = table.pop("shape", None)
    if isinstance(name, str) and name in EQUIVALENT_CONES:
        return _equivalent_cone(name, table)
    if isinstance(name, str) and name in shapes:
        indenter: Indenter = _build(shapes[name], "indenter", table, besides=("shape",))
        return indenter
    allowed = sorted([*shapes, *EQUIVALENT_CONES])
    if name is None:
        raise InputError(f"[indenter] needs 'shape'; allowed: {', '.join(allowed)}")
    raise InputError(
        f"[indenter] shape: {name!r:.80} is not known{hint(str(name), allowed) or ';'} "
        f"allowed: {', '.join(allowed)}{faults(plugged_indenters())}"
    )


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


def _layer(section: str, table: dict[str, Any]) -> Layer:
    """A layer from its section: material, thickness, bond and, for the top one, relaxation and stiffening."""
    bond = _bond(section, table.pop("bond", "bonded"))
    on_top = section == "layer"
    effects = {
        name: _effect(family, f"layer.{name}", table.pop(name))
        for name, family in _EFFECTS.items()
        if on_top and name in table
    }
    kind, of_layer = _kind_of_material(table), keys_of(Layer)
    sizes = ("thickness", "half_width", "shape") if on_top else ("thickness",)
    keys = keys_of(kind) | {name: of_layer[name] for name in sizes}
    numbers = read_table(section, keys, table, besides=("bond", *_EFFECTS))
    sized = {name: numbers.pop(name) for name in sizes if name in numbers}
    return Layer(_made(kind, section, numbers), bond=bond, **sized, **effects)


def _effect(family: type[Part], section: str, given: Any) -> Any:
    if not isinstance(given, Mapping):
        raise InputError(f"[{section}] must be a section, not {given!r}")
    table = dict(given)
    return _build(_named(family, section, table), section, table)


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


def _kind_of_material(table: Mapping[str, Any]) -> type[Material]:
    transverse = bool({"E_axial", "G_axial", "nu_axial"} & table.keys())
    if not {"permeability", "permeability_ratio"} & table.keys():
        return TransverselyIsotropic if transverse else Isotropic
    # Loaded only for a poroelastic layer.
    from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse  # noqa: PLC0415

    return BiphasicTransverse if transverse or "permeability_ratio" in table else Biphasic


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
    stack = [_layer(f"substrate.layers[{number}]", dict(entry)) for number, entry in enumerate(layers)]
    try:
        return Stack(stack, base)
    except InputError as error:
        raise InputError(f"[[substrate.layers]] {error}") from error


def _base(table: dict[str, Any]) -> Base:
    rigid = table.pop("rigid", False)
    if not isinstance(rigid, bool):
        raise InputError(f"[substrate] rigid: must be true or false, not {rigid!r}")
    if not rigid:
        base: Base = _build(_kind_of_material(table), "substrate", table, besides=("rigid", "layers"))
        return base
    if table:
        raise InputError(f"[substrate] is rigid and needs nothing else; remove {', '.join(table)}")
    return RIGID


def noise_of(document: Mapping[str, Any]) -> NoiseModel | None:
    """Return the noise model of ``[noise]``; None where there is nothing in it."""
    table = {"model": Noise.model, **table_of(document, "noise")}
    if table.keys() == {"model"}:
        return None
    noise: NoiseModel = _build(_named(NoiseModel, "noise", table), "noise", table)
    return noise


def solver_of(document: Mapping[str, Any]) -> Solver:
    """Return the solver of ``[solver]``; `Auto` without one."""
    table = table_of(document, "solver")
    for old, new in _OLD_SOLVER_KEYS.items():
        if old in table:
            value = table[old]
            said = f'"{value}"' if isinstance(value, str) else value
            raise InputError(f"[solver] {old} is now {new}: write {new} = {said}")
    stated = {"name": "auto", **read_table("solver", keys_of(SolverSection), table)}
    solver: Solver = _made(solver_named, "solver", stated)
    return solver


def _given(kind: type[Any], name: str, document: Mapping[str, Any]) -> Any:
    """An object of class `kind` from its section; None without the section."""
    return _build(kind, name, table_of(document, name)) if name in document else None


def _chosen(family: type[Part], name: str, document: Mapping[str, Any]) -> Any:
    """An object of the class that a section's ``model`` names; None without the section."""
    if name not in document:
        return None
    table = table_of(document, name)
    return _build(_named(family, name, table), name, table)


def _named(family: type[Part], section: str, table: dict[str, Any]) -> type[Any]:
    """The class that a section's ``model`` names; the key is removed from the table."""
    name, models = table.pop("model", None), family.kinds()
    if not isinstance(name, str) or name not in models:
        raise InputError(
            f"[{section}] model: {name!r:.80} is not known; allowed: {', '.join(sorted(models)) or 'none'}"
        )
    return models[name]


def _build(kind: type[Any], section: str, table: Mapping[str, Any], *, besides: tuple[str, ...] = ()) -> Any:
    """Make an object of a dataclass from a section, whose keys are its fields and those in `besides`."""
    return _made(kind, section, read_table(section, keys_of(kind), table, besides=besides))


def _made(kind: Callable[..., Any], section: str, numbers: Mapping[str, Any]) -> Any:
    """Call `kind` with the numbers of a section; its errors name the section."""
    try:
        return kind(**numbers)
    except InputError as error:
        raise type(error)(f"[{section}] {error}") from error
