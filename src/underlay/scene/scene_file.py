"""Scene files: scene.toml to `Scene` and back, quantities as strings with units, and the fitted parameters.

A scene file, whose ``[fit]`` section names the fitted parameters with their bounds or priors::

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

Further layers under the top one, from the top down, stand before their base, and each may state the bond of its
lower face, ``bond = "slip"`` or ``bond = { normal = "1 GPa/m", shear = "0 Pa/m" }``::

    [substrate]
    rigid = true

    [[substrate.layers]]
    E = "20 MPa"
    nu = 0.4
    thickness = "100 um"

A layer filled with water states its permeability and, before all sections, how water leaves at the tip::

    drainage = "solid"

    [layer]
    E = "0.4 MPa"
    nu = 0.1
    permeability = "1e-15 m^4/(N s)"
    thickness = "1.5 mm"

Optional sections: ``[layer.relaxation]``, ``[history]`` and ``[adhesion]`` (model, and its numbers),
``[instrument]``, ``[uncertainties]`` (how well the inputs are known), ``[solver]`` (name, rtol, order, form),
``[noise]``, ``[curve]`` (which part of which file, and column names) and ``[simulate]`` (depths of a simulated
curve). A new indenter, relaxation, history or model of adhesion needs no change here.
"""

from __future__ import annotations

import os
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from underlay._door import FileKind, parse_toml, printable, read_text, understood
from underlay.errors import InputError, ParameterError, UnderlayError
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.solver import Solver
from underlay.quantities import field_quantities
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.parameters import fields_meant, hint, kind_of, unknown_parameter
from underlay.scene.program import SimulatedDepths
from underlay.scene.scene import Scene
from underlay.scene.scene_keys import CurveSection, fit_keys, keys_of, read_table
from underlay.scene.scene_sections import noise_of, scene_of, solver_of, table_of

# Placeholder for a length that only the file of a curve gives; never computed with.
_STAND_IN = "1 m"
#: Placeholder in a starter scene for a number that is still to be written.
PLACE = "TODO"
#: Kind of file, and the bytes that it may have: a scene is a page of text.
SCENE_FILE = FileKind("a scene file (TOML)", 1_000_000, "see data_samples for files to begin with")
_LONGEST_MESSAGE = 1000  # characters of a parser's message that are shown
_SECTIONS = (
    "title",
    "friction",
    "finite_strain",
    "drainage",
    "assumed",
    "indenter",
    "layer",
    "substrate",
    "instrument",
    "history",
    "adhesion",
    "lever",
    "discrepancy",
    "uncertainties",
    "fit",
    "solver",
    "noise",
    "curve",
    "simulate",
)


@dataclass(frozen=True)
class FreeParameter:
    """One fitted parameter as a scene file states it; numbers in SI.

    Parameters
    ----------
    path : str
        E.g. ``"layer.E"``.
    prior : str or None
        ``"uniform"``, ``"loguniform"``, ``"normal"``, ``"lognormal"``, ``"halfnormal"``, ``"found"`` (the contact
        depth found in the curve), or None when only bounds are given.
    low, high : float
        Bounds; infinite where the file gives none.
    numbers : mapping
        What the prior needs besides: mean, sd, median, relative_sd.
    """

    path: str
    prior: str | None
    low: float
    high: float
    numbers: Mapping[str, float]


def free_parameters(table: Mapping[str, Any], scene: Scene, noise: NoiseModel) -> list[FreeParameter]:
    """Read the fitted parameters from the ``[fit]`` section of a scene file.

    Raises
    ------
    InputError
        If a path is not one of the scene or its noise, or its entry is not allowed.
    """
    known = [*scene.parameters, *(f"noise.{name}" for name in field_quantities(type(noise)))]
    free = []
    parts = {path[:end] for path in known for end, sign in enumerate(path) if sign == "."}
    for path, entry in entries(table, parts):
        if path not in known:
            raise unknown_parameter(path, known) if "." in path else _without_part(path, known)
        numbers = read_table(f"fit] [{path}", fit_keys(kind_of(path)), entry)
        low, high = numbers.pop("min", -np.inf), numbers.pop("max", np.inf)
        if not low < high:
            raise InputError(f"[fit] {path}: min must be below max")
        free.append(FreeParameter(path, numbers.pop("prior", None), low, high, numbers))
    return free


def entries(
    table: Mapping[str, Any], parts: Container[str] = (), above: str = ""
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Entries of the ``[fit]`` section with the full path of each fitted number, however the file nests them.

    ``layer.E = {...}``, which TOML nests, and ``"layer.E" = {...}`` are the same. `parts` are the paths that lead
    to further ones.

    Raises
    ------
    InputError
        If the entry of a number is no table.
    """
    for name, entry in table.items():
        path = f"{above}{name}"
        if not isinstance(entry, Mapping):
            # A list of names is the form that Python takes.
            names = entry if isinstance(entry, list) and entry else [path]
            lines = "; ".join(f"{one} = {{ min = ..., max = ... }}" for one in names)
            raise InputError(
                f"[fit] {path}: each number has a line of its own, {{}} without bounds; write {lines}"
            )
        if path in parts or (entry and all(isinstance(inner, Mapping) for inner in entry.values())):
            yield from entries(entry, parts, f"{path}.")
        else:
            yield path, entry


def _without_part(name: str, known: Sequence[str]) -> ParameterError:
    """Build the error for a parameter name without its part of the scene, such as E for layer.E."""
    fields = {path.rpartition(".")[2] for path in known}
    meant = fields_meant(name, sorted(fields))
    paths = [path for path in known if meant and path.rpartition(".")[2] == meant[0]]
    if not paths:
        return unknown_parameter(name, known)
    written = " or ".join(f"{path} = {{ min = ..., max = ... }}" for path in paths)
    return ParameterError(f"[fit] {name}: say of which part of the scene; write {written}")


@dataclass(frozen=True)
class SceneFile:
    """All that a scene file states.

    Parameters
    ----------
    draft : Scene
        The test, with a placeholder for a number that is left to the file of the curve.
    free : tuple of FreeParameter
        Fitted parameters; empty if there is no ``[fit]``.
    solver : Solver
        What builds the contact law; `Auto` by default.
    noise : NoiseModel or None
        The noise of ``[noise]``; None where there is no such section, or nothing in it.
    curve : mapping
        Which part of which curve file: file (a path relative to the scene file); format, test, columns and
        calibration for the reader; flip for signs that are reversed; segment, min_depth and max_depth (readings, m)
        for what is used of it; overrule, for numbers in which the scene takes precedence over the file of the
        curve.
    simulate : SimulatedDepths or None
        Depths of a simulated curve.
    stated : frozenset of str
        Paths of the numbers of instrument and layer that the file gives; the others have their defaults.
    assumed : tuple of str
        Paths of numbers that nobody measured: a usual value stands in their place.
    path : Path
        Where it was read.
    left_out : tuple of str
        Paths of the scene that the file of the curve must give.
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
    assumed: tuple[str, ...] = ()

    @property
    def scene(self) -> Scene:
        """The test.

        Raises
        ------
        InputError
            If a number is left out: the test is complete only with a curve whose file gives it.
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
    """Read the scene of a scene file; `read_scene_file` also returns fit, noise, solver and curve sections."""
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
    return scene_file_from_text(text).scene


def scene_file_from_text(text: str) -> SceneFile:
    """Return all that the text of a scene file states, as if read from ``scene.toml`` in the current folder.

    Raises
    ------
    FileFormatError
        If it is not TOML.
    InputError
        If a section, key, unit or value is not allowed.
    """
    with understood("the text of the scene", SCENE_FILE):
        document = parse_toml(text)
    return _interpret(document, Path("scene.toml"))


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
    with understood(source, SCENE_FILE):
        document = parse_toml(read_text(source, SCENE_FILE))
    try:
        return _interpret(document, source)
    except UnderlayError as error:
        # A key or value of a hostile file may be as long as the whole file.
        raise type(error)(f"{printable(source.name)}: {printable(str(error))[:_LONGEST_MESSAGE]}") from error


def _interpret(document: dict[str, Any], path: Path) -> SceneFile:
    _require_filled_in(document)
    for name in document:
        if name not in _SECTIONS:
            meant = hint(name, _SECTIONS) or ";"
            raise InputError(
                f"unknown section [{name}]{meant} allowed: {', '.join(_SECTIONS[_SECTIONS.index('indenter') :])}"
            )
    for name in ("indenter", "layer"):
        if name not in document:
            raise InputError(f"section [{name}] is missing")
    left_out = _left_out(table_of(document, "indenter"))
    scene = scene_of(document, {path.partition(".")[2]: _STAND_IN for path in left_out})
    noise = noise_of(document)
    return SceneFile(
        draft=scene,
        free=tuple(free_parameters(table_of(document, "fit"), scene, noise or Noise())),
        solver=solver_of(document),
        noise=noise,
        curve=_curve(table_of(document, "curve")),
        simulate=_simulated_depths(document),
        path=path,
        left_out=left_out,
        stated=frozenset(
            f"{section}.{name}" for section in ("instrument", "layer") for name in table_of(document, section)
        ),
        assumed=_assumed(document.get("assumed", []), scene),
    )


def _assumed(paths: Any, scene: Scene) -> tuple[str, ...]:
    if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
        raise InputError('assumed: write a list of numbers of this test, such as ["layer.nu"]')
    for path in paths:
        if path not in scene.parameters:
            raise unknown_parameter(path, list(scene.parameters))
    return tuple(paths)


def _curve(table: Mapping[str, Any]) -> dict[str, Any]:
    if table.get("segment") == "hold":
        raise InputError(
            "[curve] segment: a hold cannot be fitted: at one depth the force tells of time, not of depth. Allowed "
            "are 'loading', 'unloading' (of an elastic sample), 'all' and 'equilibrium' (the ends of the holds of "
            "a stepwise test)"
        )
    return read_table("curve", keys_of(CurveSection), table)


def _left_out(tip: Mapping[str, Any]) -> tuple[str, ...]:
    """Path of the radius if an indenter section lacks one that its shape needs: the curve's file must give it."""
    shape: Any = Indenter.kinds().get(str(tip.get("shape")))
    if shape is None or "radius" in tip:
        return ()
    return ("indenter.radius",) if any(field.name == "radius" for field in fields(shape)) else ()


def _require_filled_in(document: Mapping[str, Any]) -> None:
    """Raise InputError for a starter scene with unfilled entries, naming all of them at once."""
    empty = list(_places(document, ""))
    if empty:
        raise InputError(f"not filled in yet: {', '.join(empty)}; replace {PLACE} by what you know")


def _places(table: Mapping[str, Any], above: str) -> Iterator[str]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _places(value, f"{above}{name}.")
        elif isinstance(value, str) and PLACE in value:
            yield f"{above}{name}"


def _simulated_depths(document: Mapping[str, Any]) -> SimulatedDepths | None:
    if "simulate" not in document:
        return None
    return SimulatedDepths(**read_table("simulate", keys_of(SimulatedDepths), table_of(document, "simulate")))
