"""scene.toml <-> Scene: quantities as strings with units, and what is fitted in the same file.

::

    [indenter]
    shape = "sphere"
    radius = "0.5 mm"

    [layer]
    E = "0.4 MPa"
    nu = 0.45
    thickness = "1.5 mm"

    [substrate]
    rigid = true

    [fit]
    layer.E = { min = "1 kPa", max = "100 MPa" }
    instrument.contact_depth = { min = "-20 um", max = "20 um" }

Further layers under the one on top, from the top down, stand before their base, and each may say how its lower face
holds, ``bond = "slip"`` or ``bond = { normal = "1 GPa/m", shear = "0 Pa/m" }``::

    [substrate]
    rigid = true

    [[substrate.layers]]
    E = "20 MPa"
    nu = 0.4
    thickness = "100 um"

Optional sections: ``[layer.relaxation]``, ``[history]`` and ``[adhesion]`` (model, and its numbers),
``[instrument]``, ``[solver]`` (name, rtol, order, form), ``[noise]``, ``[curve]`` (which part of which file, and
column names) and ``[simulate]`` (depths of a made curve). A new indenter, relaxation, history or model of adhesion
needs no change here.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from underlay._documents import parse_toml
from underlay._door import FileKind, printable, read_text, understood
from underlay.errors import InputError, UnderlayError, UnderlayWarning
from underlay.mechanics.adhesion import Adhesion
from underlay.mechanics.body import RIGID, Base, Body, Layer, Material
from underlay.mechanics.bonds import Bond, Spring, as_bond
from underlay.mechanics.friction import FRICTIONS
from underlay.mechanics.indenters import Cone, Indenter
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.relaxation import Relaxation
from underlay.mechanics.response import History
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import solver_named
from underlay.mechanics.stack import Stack
from underlay.quantities import Part
from underlay.scene.field_names import hint
from underlay.scene.fit_section import FreeParameter, free_parameters
from underlay.scene.instrument import Instrument
from underlay.scene.noise import Noise
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene import Scene
from underlay.scene.scene_schema import (
    CurveSection,
    SimulateSection,
    SolverSection,
    ThicknessSection,
    check,
    schema_of,
)

__all__ = [
    "EQUIVALENT_CONES",
    "PLACE",
    "SceneFile",
    "SimulatedDepths",
    "load_scene",
    "read_scene_file",
    "scene_from_text",
]

# In place of a length that only the file of a curve says; never computed with.
_STAND_IN = "1 m"
#: What stands in a starter scene where a number is still to be written.
PLACE = "TODO"
# A scene is a page of text.
_KIND = FileKind("a scene file (TOML)", 1_000_000, "see data_samples for files to begin with")


@dataclass(frozen=True)
class SimulatedDepths:
    """Depth readings of a made curve: `points` from `start` to `max_depth` (m), over `duration` (s)."""

    max_depth: float
    start: float = 0.0
    points: int = 200
    duration: float = 1.0

    @property
    def depth(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """The readings (m), shape (points,)."""
        return np.linspace(self.start, self.max_depth, self.points)

    @property
    def time(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """The times of the readings (s), shape (points,)."""
        return np.linspace(0.0, self.duration, self.points)


@dataclass(frozen=True)
class SceneFile:
    """All that a scene file says.

    Parameters
    ----------
    draft : Scene
        The test; where the file leaves a number to the file of the curve it holds a stand-in.
    free : tuple of FreeParameter
        What is fitted; empty if there is no ``[fit]``.
    solver : Solver
        What builds the contact law; `Auto` where the file does not say.
    noise : NoiseModel or None
        What ``[noise]`` says; None where there is no such section, or nothing in it.
    curve : mapping
        Which part of which curve file: file (a path beside the scene file); format, test, columns and
        calibration for the reader; flip for signs that are the other way round; segment, min_depth and
        max_depth (readings, m) for what is used of it; overrule, for what the scene knows better than the
        file of the curve.
    simulate : SimulatedDepths or None
        Depths of a made curve.
    stated : frozenset of str
        Paths of the instrument's numbers that the file gives; what it leaves out is a default.
    path : Path
        Where it was read.
    left_out : tuple of str
        Paths of the scene that the file of the curve must say.
    """

    draft: Scene
    free: tuple[FreeParameter, ...]
    solver: Solver
    noise: NoiseModel | None
    curve: Mapping[str, Any]
    simulate: SimulatedDepths | None
    path: Path
    left_out: tuple[str, ...] = ()
    stated: frozenset[str] = frozenset()

    @property
    def scene(self) -> Scene:
        """The test.

        Raises
        ------
        InputError
            If a number is left out: only with a curve whose file says it is the test complete.
        """
        if self.left_out:
            section, _, key = self.left_out[0].partition(".")
            raise InputError(
                f"{self.path.name}: [{section}] needs {key!r}; it can be left out only with a curve whose file "
                "says it"
            )
        return self.draft

    @property
    def curve_path(self) -> Path | None:
        """Curve file that ``[curve] file`` names, relative to the scene file; None if it names none."""
        named = self.curve.get("file")
        return None if named is None else self.path.parent / named


def load_scene(path: str | os.PathLike[str]) -> Scene:
    """Read the scene of a scene file; see `read_scene_file` for the rest of it."""
    return read_scene_file(path).scene


def scene_from_text(text: str) -> Scene:
    """Return the scene of the text of a scene file, such as `scene_text` makes.

    Raises
    ------
    FileFormatError
        If it is not TOML.
    InputError
        If a section, key, unit or value is not allowed.
    """
    with understood("the text of the scene", _KIND):
        document = parse_toml(text)
    return _interpret(document, Path("scene.toml")).scene


def read_scene_file(path: str | os.PathLike[str]) -> SceneFile:
    """Read and check a scene file.

    Raises
    ------
    FileAccessError
        If the file cannot be read.
    FileFormatError
        If it is not TOML.
    InputError
        If a section, key, unit or value is not allowed; the message names file, section and key.
    """
    source = Path(path)
    with understood(source, _KIND):
        document = parse_toml(read_text(source, _KIND))
    try:
        return _interpret(document, source)
    except UnderlayError as error:
        # A key or value of a hostile file may be as long as the file.
        raise type(error)(f"{printable(source.name)}: {printable(str(error))[:_LONGEST_MESSAGE]}") from error


#: Pyramids that are taken as the cone of the same projected area.
EQUIVALENT_CONES = {"berkovich": Cone.berkovich, "vickers": Cone.vickers}

_LONGEST_MESSAGE = 1000
_SECTIONS = (
    "title",
    "friction",
    "finite_strain",
    "indenter",
    "layer",
    "substrate",
    "instrument",
    "history",
    "adhesion",
    "fit",
    "solver",
    "noise",
    "curve",
    "simulate",
)


def _interpret(document: dict[str, Any], path: Path) -> SceneFile:
    _require_filled_in(document)
    for name in document:
        if name not in _SECTIONS:
            meant = hint(name, _SECTIONS) or ";"
            raise InputError(f"unknown section [{name}]{meant} allowed: {', '.join(_SECTIONS[3:])}")
    for name in ("indenter", "layer"):
        if name not in document:
            raise InputError(f"section [{name}] is missing")
    tip = dict(_table(document, "indenter"))
    left_out = _left_out(tip)
    scene = Scene(
        indenter=_indenter({**tip, **{path.partition(".")[2]: _STAND_IN for path in left_out}}),
        layer=_layer(dict(_table(document, "layer"))),
        substrate=_substrate(document),
        instrument=_build(Instrument, "instrument", _table(document, "instrument")),
        history=_history(document),
        adhesion=_adhesion(document),
        **_words(document),
    )
    noise = _noise(document)
    return SceneFile(
        draft=scene,
        free=tuple(free_parameters(_table(document, "fit"), scene, noise or Noise())),
        solver=_solver(_table(document, "solver")),
        noise=noise,
        curve=check(CurveSection, "curve", _table(document, "curve")),
        simulate=_simulated_depths(document),
        path=path,
        left_out=left_out,
        stated=frozenset(f"instrument.{name}" for name in _table(document, "instrument")),
    )


def _words(document: Mapping[str, Any]) -> dict[str, Any]:
    """What the file says of the whole scene, before its sections."""
    said = {key: document[key] for key in ("friction", "finite_strain") if key in document}
    if said.get("friction", "none") not in FRICTIONS:
        raise InputError(f"friction: {said['friction']!r:.60} is not known; allowed: {', '.join(FRICTIONS)}")
    if not isinstance(said.get("finite_strain", True), bool):
        raise InputError(f"finite_strain: must be true or false, not {said['finite_strain']!r:.60}")
    return said


def _left_out(tip: Mapping[str, Any]) -> tuple[str, ...]:
    """What a section of the indenter leaves to the file of a curve: the radius of a shape that has one."""
    shape: Any = Indenter.kinds().get(str(tip.get("shape")))
    if shape is None or "radius" in tip:
        return ()
    return ("indenter.radius",) if any(field.name == "radius" for field in fields(shape)) else ()


def _require_filled_in(document: Mapping[str, Any]) -> None:
    """Refuse a starter scene whose places are not filled in, naming all of them at once."""
    empty = list(_places(document, ""))
    if empty:
        raise InputError(f"not filled in yet: {', '.join(empty)}; replace {PLACE} by what you know")


def _places(table: Mapping[str, Any], above: str) -> Iterator[str]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _places(value, f"{above}{name}.")
        elif isinstance(value, str) and PLACE in value:
            yield f"{above}{name}"


def _table(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"[{name}] must be a section, not {table!r}")
    return table


# --- parts of the scene -------------------------------------------------------------------------------


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
        raise InputError(f"[indenter] shape: {name!r:.80} is not known{meant} allowed: {', '.join(allowed)}")
    indenter: Indenter = _build(shapes[name], "indenter", table, besides=("shape",))
    return indenter


def _layer(table: dict[str, Any]) -> Layer:
    relaxation = _relaxation(table)
    return replace(_one_layer("layer", table), relaxation=relaxation)


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
    return Layer(_material(section, table, besides=("thickness", "bond", "relaxation")), thickness, bond)


def _bond(section: str, given: Any) -> Bond:
    if isinstance(given, Mapping):
        spring: Spring = _build(Spring, f"{section}.bond", given)
        return spring
    try:
        return as_bond(given)
    except InputError as error:
        raise InputError(
            f'[{section}] bond: {given!r:.60} is not known; allowed: "bonded", "slip" or '
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
    kind = TransverselyIsotropic if {"E_axial", "G_axial", "nu_axial"} & table.keys() else Isotropic
    material: Material = _build(kind, section, table, besides=besides)
    return material


def _substrate(document: Mapping[str, Any]) -> Body | None:
    if "substrate" not in document:
        return None
    table = dict(_table(document, "substrate"))
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


def _history(document: Mapping[str, Any]) -> History | None:
    if "history" not in document:
        return None
    table = dict(_table(document, "history"))
    history: History = _build(_named(History, "history", table), "history", table)
    return history


def _named(family: type[Part], section: str, table: dict[str, Any]) -> type[Any]:
    """The class that a section's ``model`` names; the key is taken out."""
    name, models = table.pop("model", None), family.kinds()
    if not isinstance(name, str) or name not in models:
        raise InputError(
            f"[{section}] model: {name!r:.80} is not known; allowed: {', '.join(sorted(models)) or 'none'}"
        )
    return models[name]


def _adhesion(document: Mapping[str, Any]) -> Adhesion | None:
    if "adhesion" not in document:
        return None
    table = dict(_table(document, "adhesion"))
    adhesion: Adhesion = _build(_named(Adhesion, "adhesion", table), "adhesion", table)
    return adhesion


def _noise(document: Mapping[str, Any]) -> NoiseModel | None:
    table = dict(_table(document, "noise"))
    if not table:
        return None
    kind = _named(NoiseModel, "noise", {"model": Noise.model, **table})
    noise: NoiseModel = _build(kind, "noise", {key: table[key] for key in table if key != "model"})
    return noise


#: Keys that [solver] had once, and what to write now.
_OLD_SOLVER_KEYS = {"method": "name", "accuracy": "rtol"}


def _solver(table: Mapping[str, Any]) -> Solver:
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


def _simulated_depths(document: Mapping[str, Any]) -> SimulatedDepths | None:
    if "simulate" not in document:
        return None
    depths = SimulatedDepths(**check(SimulateSection, "simulate", _table(document, "simulate")))
    if not depths.start < depths.max_depth:
        raise InputError("[simulate] start must be below max_depth")
    return depths


def _build(kind: type[Any], section: str, table: Mapping[str, Any], *, besides: tuple[str, ...] = ()) -> Any:
    """Make a dataclass from a section; its fields, and `besides`, say which keys there are."""
    return kind(**check(schema_of(kind), section, table, besides=besides))
