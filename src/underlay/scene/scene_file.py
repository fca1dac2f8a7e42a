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

Optional sections: ``[layer.relaxation]`` and ``[history]`` (model, and its numbers), ``[instrument]``,
``[solver]`` (name, rtol, order, form), ``[noise]``, ``[curve]`` (which part of which file, and column names) and
``[simulate]`` (depths of a made curve). A new indenter, relaxation or history needs no change here.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from underlay.errors import FileAccessError, FileFormatError, InputError, UnderlayError
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.materials import RIGID, Isotropic, Layer, Material, Substrate, TransverselyIsotropic
from underlay.mechanics.relaxation import Relaxation
from underlay.mechanics.response import History
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import solver_named
from underlay.quantities import field_quantities
from underlay.scene.fit_section import FreeParameter, free_parameters
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene
from underlay.scene.scene_schema import (
    CurveSection,
    NoiseSection,
    SimulateSection,
    SolverSection,
    check,
    schema_of,
)

__all__ = ["SceneFile", "SimulatedDepths", "load_scene", "read_scene_file", "scene_from_text"]

_LARGEST_FILE = 1_000_000  # bytes; a scene is a page of text


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
    scene : Scene
        The test.
    free : tuple of FreeParameter
        What is fitted; empty if there is no ``[fit]``.
    solver : Solver
        What builds the contact law; `Auto` where the file does not say.
    noise : mapping
        Numbers of ``[noise]``, SI.
    curve : mapping
        Which part of a curve file: format, test, columns and calibration for the reader; segment, min_depth
        and max_depth (readings, m) for what is used of it.
    simulate : SimulatedDepths or None
        Depths of a made curve.
    path : Path
        Where it was read.
    """

    scene: Scene
    free: tuple[FreeParameter, ...]
    solver: Solver
    noise: Mapping[str, float]
    curve: Mapping[str, Any]
    simulate: SimulatedDepths | None
    path: Path


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
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise FileFormatError(f"the text of the scene is not TOML: {error}") from error
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
    document = _read_toml(source)
    try:
        return _interpret(document, source)
    except UnderlayError as error:
        raise type(error)(f"{source.name}: {error}") from error


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        if not path.is_file():
            raise FileAccessError(f"scene file {path} does not exist or is not a file")
        if path.stat().st_size > _LARGEST_FILE:
            raise FileFormatError(f"{path} is larger than a scene file can be (1 MB)")
        return tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        if isinstance(error, FileAccessError):
            raise
        raise FileAccessError(f"cannot read scene file {path}: {error.strerror}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise FileFormatError(f"{path} is not a TOML file: {error}") from error


_SECTIONS = (
    "title",
    "indenter",
    "layer",
    "substrate",
    "instrument",
    "history",
    "fit",
    "solver",
    "noise",
    "curve",
    "simulate",
)


def _interpret(document: dict[str, Any], path: Path) -> SceneFile:
    for name in document:
        if name not in _SECTIONS:
            raise InputError(f"unknown section [{name}]; allowed: {', '.join(_SECTIONS[1:])}")
    for name in ("indenter", "layer"):
        if name not in document:
            raise InputError(f"section [{name}] is missing")
    scene = Scene(
        indenter=_indenter(dict(_table(document, "indenter"))),
        layer=_layer(dict(_table(document, "layer"))),
        substrate=_substrate(document),
        instrument=_build(Instrument, "instrument", _table(document, "instrument")),
        history=_history(document),
    )
    return SceneFile(
        scene=scene,
        free=tuple(free_parameters(_table(document, "fit"), scene)),
        solver=_solver(_table(document, "solver")),
        noise=check(NoiseSection, "noise", _table(document, "noise")),
        curve=check(CurveSection, "curve", _table(document, "curve")),
        simulate=_simulated_depths(document),
        path=path,
    )


def _table(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"[{name}] must be a section, not {table!r}")
    return table


# --- parts of the scene -------------------------------------------------------------------------------


def _indenter(table: dict[str, Any]) -> Indenter:
    shapes = {shape.shape: shape for shape in Indenter.shapes()}
    name = table.pop("shape", None)
    if name not in shapes:
        raise InputError(f"[indenter] shape: {name!r} is not known; allowed: {', '.join(sorted(shapes))}")
    indenter: Indenter = _build(shapes[name], "indenter", table)
    return indenter


def _layer(table: dict[str, Any]) -> Layer:
    relaxation = _relaxation(table)
    own = {name: table.pop(name) for name in field_quantities(Layer) if name in table}
    numbers = check(schema_of(Layer), "layer", own)
    return Layer(_material("layer", table), relaxation=relaxation, **numbers)


def _relaxation(layer: dict[str, Any]) -> Relaxation | None:
    """The relaxation of a layer's section, which is taken out of it."""
    if "relaxation" not in layer:
        return None
    section, given = "layer.relaxation", layer.pop("relaxation")
    if not isinstance(given, Mapping):
        raise InputError(f"[{section}] must be a section, not {given!r}")
    table = dict(given)
    kind = _named({kind.model: kind for kind in Relaxation.models()}, section, table)
    words = {"relaxes": table.pop("relaxes")} if "relaxes" in table else {}
    numbers = check(schema_of(kind), section, table)
    try:
        relaxation: Relaxation = kind(**words, **numbers)
    except InputError as error:
        raise InputError(f"[{section}] {error}") from error
    return relaxation


def _material(section: str, table: dict[str, Any]) -> Material:
    kind = TransverselyIsotropic if {"E_axial", "G_axial", "nu_axial"} & table.keys() else Isotropic
    material: Material = _build(kind, section, table)
    return material


def _substrate(document: Mapping[str, Any]) -> Substrate | None:
    if "substrate" not in document:
        return None
    table = dict(_table(document, "substrate"))
    rigid = table.pop("rigid", False)
    if not isinstance(rigid, bool):
        raise InputError(f"[substrate] rigid: must be true or false, not {rigid!r}")
    if not rigid:
        return _material("substrate", table)
    if table:
        raise InputError(f"[substrate] is rigid and needs nothing else; remove {', '.join(table)}")
    return RIGID


def _history(document: Mapping[str, Any]) -> History | None:
    if "history" not in document:
        return None
    table = dict(_table(document, "history"))
    kind = _named({kind.model: kind for kind in History.models()}, "history", table)
    history: History = _build(kind, "history", table)
    return history


def _named(models: Mapping[str, type[Any]], section: str, table: dict[str, Any]) -> type[Any]:
    """The class that a section's ``model`` names; the key is taken out."""
    name = table.pop("model", None)
    if name not in models:
        raise InputError(
            f"[{section}] model: {name!r} is not known; allowed: {', '.join(sorted(models)) or 'none'}"
        )
    return models[name]


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


def _build(kind: type[Any], section: str, table: Mapping[str, Any]) -> Any:
    """Make a dataclass from a section; its fields say which keys there are."""
    return kind(**check(schema_of(kind), section, table))
