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
import warnings
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from underlay._door import FileKind, parse_toml, printable, read_text, understood
from underlay.errors import InputError, ParameterError, UnderlayError, UnderlayWarning
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
from underlay.mechanics.stiffening.law import Gent
from underlay.plugins import faults
from underlay.quantities import Part, field_quantities, numbers_of
from underlay.scene.discrepancy import Discrepancy
from underlay.scene.instrument import Instrument, Lever
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.parameters import fields_meant, hint, kind_of, unknown_parameter
from underlay.scene.program import SimulatedDepths
from underlay.scene.scene import Scene
from underlay.scene.scene_keys import (
    EQUIVALENT_CONES,
    CurveSection,
    SolverSection,
    fit_keys,
    keys_of,
    read_table,
)
from underlay.scene.uncertainties import leaves, rows_of, split_uncertainties

# Placeholder for a length that only the file of a curve gives; never computed with.
_STAND_IN = "1 m"
#: Placeholder in a starter scene for a number that is still to be written.
PLACE = "TODO"
#: Kind of file, and the bytes that it may have: a scene is a page of text.
SCENE_FILE = FileKind("a scene file (TOML)", 1_000_000, "see data_samples for files to begin with")
_LONGEST_MESSAGE = 1000  # characters of a parser's message that are shown
# Keys of the whole file, sections of the parts of a scene, and sections of what is done with it.
_TOP = ("title", "friction", "finite_strain", "drainage", "assumed")
_SECTIONS = (
    *(entry.name for entry in fields(Scene) if entry.name not in _TOP),
    *("fit", "solver", "noise", "curve", "simulate"),
)
#: Sections of the top layer. `Gent` is loaded with this module, so that it is among the kinds.
_EFFECTS = {"relaxation": Relaxation, Gent.section.partition(".")[2]: Stiffening}
#: Former keys of [solver], and their present names.
_OLD_SOLVER_KEYS = {"method": "name", "accuracy": "rtol"}


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
        if name not in (*_TOP, *_SECTIONS):
            meant = hint(name, (*_TOP, *_SECTIONS)) or ";"
            raise InputError(f"unknown section [{name}]{meant} allowed: {', '.join(_SECTIONS)}")
    for name in ("indenter", "layer"):
        if name not in document:
            raise InputError(f"section [{name}] is missing")
    left_out = _left_out(_table_of(document, "indenter"))
    scene = _scene_of(document, {path.partition(".")[2]: _STAND_IN for path in left_out})
    noise = _noise_of(document)
    return SceneFile(
        draft=scene,
        free=tuple(free_parameters(_table_of(document, "fit"), scene, noise or Noise())),
        solver=_solver_of(document),
        noise=noise,
        curve=_curve(_table_of(document, "curve")),
        simulate=_simulated_depths(document),
        path=path,
        left_out=left_out,
        stated=frozenset(
            f"{section}.{name}"
            for section in ("instrument", "layer")
            for name in _table_of(document, section)
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
    empty = [path for path, value in leaves(document) if isinstance(value, str) and PLACE in value]
    if empty:
        raise InputError(f"not filled in yet: {', '.join(empty)}; replace {PLACE} by what you know")


def _simulated_depths(document: Mapping[str, Any]) -> SimulatedDepths | None:
    if "simulate" not in document:
        return None
    return SimulatedDepths(
        **read_table("simulate", keys_of(SimulatedDepths), _table_of(document, "simulate"))
    )


# --- the parts of a test, from their sections -------------------------------------------------------------------


def _table_of(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a section of the document as a dict, empty where it has none."""
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"[{name}] must be a section, not {table!r}")
    return dict(table)


def _scene_of(document: Mapping[str, Any], stood_in: Mapping[str, str]) -> Scene:
    """Return the test of a document; `stood_in` are placeholder numbers of the indenter that it leaves out."""
    document, inline = split_uncertainties(document)
    scene = Scene(
        indenter=_indenter({**_table_of(document, "indenter"), **stood_in}),
        layer=_layer("layer", _table_of(document, "layer")),
        substrate=_substrate(document),
        instrument=_build(Instrument, "instrument", _table_of(document, "instrument")),
        history=_given(History, "history", document),
        adhesion=_given(Adhesion, "adhesion", document),
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
        name: _given(family, f"layer.{name}", {f"layer.{name}": table.pop(name)})
        for name, family in _EFFECTS.items()
        if on_top and name in table
    }
    kind, of_layer = _kind_of_material(table), keys_of(Layer)
    sizes = ("thickness", "half_width", "shape") if on_top else ("thickness",)
    keys = keys_of(kind) | {name: of_layer[name] for name in sizes}
    numbers = read_table(section, keys, table, besides=("bond", *_EFFECTS))
    sized = {name: numbers.pop(name) for name in sizes if name in numbers}
    return Layer(_made(kind, section, numbers), bond=bond, **sized, **effects)


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
    table = _table_of(document, "substrate")
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


def _noise_of(document: Mapping[str, Any]) -> NoiseModel | None:
    """Return the noise model of ``[noise]``; None where there is nothing in it."""
    table = {"model": Noise.model, **_table_of(document, "noise")}
    noise: NoiseModel | None = _given(NoiseModel, "noise", {} if len(table) == 1 else {"noise": table})
    return noise


def _solver_of(document: Mapping[str, Any]) -> Solver:
    """Return the solver of ``[solver]``; `Auto` without one."""
    table = _table_of(document, "solver")
    for old, new in _OLD_SOLVER_KEYS.items():
        if old in table:
            value = table[old]
            said = f'"{value}"' if isinstance(value, str) else value
            raise InputError(f"[solver] {old} is now {new}: write {new} = {said}")
    stated = {"name": "auto", **read_table("solver", keys_of(SolverSection), table)}
    solver: Solver = _made(solver_named, "solver", stated)
    return solver


def _given(family: type[Part], section: str, document: Mapping[str, Any]) -> Any:
    """A part from its section, of the kind that its ``model`` names where there are several; None without it."""
    if section not in document:
        return None
    table = _table_of(document, section)
    return _build(_named(family, section, table) if family.chosen_by else family, section, table)


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
