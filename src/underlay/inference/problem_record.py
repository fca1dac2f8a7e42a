"""A problem as text and arrays, as a file stores it so that it can be restored to the last bit.

Scenes are stored as the text of scene files, curves as arrays with the hash of their points, priors and noise by
name and numbers. No code is stored: what has no such name, such as a caller's own class of prior, cannot be stored,
and `problem_record` raises an error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from underlay.data.curve import Curve, Metadata
from underlay.errors import FileFormatError, InputError
from underlay.inference.least_squares.provenance import curve_hash
from underlay.inference.priors import (
    Flat,
    Given,
    HalfNormal,
    LogNormal,
    LogUniform,
    Normal,
    Prior,
    Truncated,
    Uniform,
)
from underlay.inference.problem import Problem
from underlay.mechanics.solvers import solver_named, solver_record
from underlay.quantities import field_quantities
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.scene import Scene
from underlay.scene.scene_file import scene_from_text
from underlay.scene.scene_writer import scene_text

# Priors that can be stored, by the name of their class.
_PRIORS: Mapping[str, type[Prior]] = {
    kind.__name__: kind for kind in (Flat, HalfNormal, LogNormal, LogUniform, Normal, Truncated, Uniform)
}
# Columns of a curve that are stored, besides further ones.
_COLUMNS = ("depth", "force", "time", "segment")
# Prefix of the names of further columns of a curve.
_FURTHER = "columns/"


def problem_record(problem: Problem) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Return a problem as a document of plain values, ready for JSON, and its arrays by name.

    An infinity, such as the thickness of a half-space, stays one: Python's JSON writes and reads it.

    Raises
    ------
    InputError
        If a part of it has no name under which it could be restored.
    """
    tests: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    for number, (scene, curve) in enumerate(zip(problem.base_scenes, problem.curves, strict=True)):
        tests.append(
            {
                "scene": _text_of(scene),
                "sha256": curve_hash(curve),
                "metadata": Metadata(curve.metadata).to_dict(),
                "truth": None if curve.truth is None else Metadata(curve.truth).to_dict(),
            }
        )
        columns = {name: getattr(curve, name) for name in _COLUMNS}
        columns |= {f"{_FURTHER}{name}": values for name, values in curve.columns.items()}
        arrays |= {f"{number}/{name}": array for name, array in columns.items() if array is not None}
    document = {
        "tests": tests,
        "free": {path: _given(path, given) for path, given in problem.free.items()},
        "shared": list(problem.shared),
        "noise": _noise(problem.noise),
        "solver": solver_record(problem.solver),
    }
    return document, arrays


def problem_from_record(document: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> Problem:
    """Restore the problem that `problem_record` stored.

    Raises
    ------
    FileFormatError
        If something is missing, or the points of a curve do not have the stored hash.
    InputError
        If the problem cannot be built here, e.g. for a shape of indenter that this program does not know.
    """
    try:
        tests = [
            (scene_from_text(test["scene"]), _curve(number, test, arrays))
            for number, test in enumerate(document["tests"])
        ]
        free = {path: _from_given(given) for path, given in document["free"].items()}
        noise, shared, solver = document["noise"], document["shared"], solver_named(**document["solver"])
        models = [_from_noise(entry) for entry in noise] if isinstance(noise, list) else _from_noise(noise)
    except (KeyError, TypeError, AttributeError) as error:
        raise FileFormatError(f"the record of its problem lacks {error}") from error
    return Problem.joint(tests, free, shared, models, solver=solver)


def _text_of(scene: Scene) -> str:
    """Scene-file text of a scene, after a check that reading it gives the same scene."""
    name = type(scene.indenter).__name__
    if not type(scene.indenter).shape:
        raise InputError(f"its indenter, {name}, has no name in scene files")
    try:
        text = scene_text(scene)
        whole = scene_from_text(text) == scene
    except (TypeError, ValueError, KeyError) as error:
        raise InputError(f"its scene, of a {name}, cannot be written as a scene file: {error}") from error
    if not whole:
        raise InputError(f"its scene, of a {name}, does not come back from a scene file as it was")
    return text


def _curve(number: int, test: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> Curve:
    columns = {name: arrays.get(f"{number}/{name}") for name in _COLUMNS}
    if columns["depth"] is None or columns["force"] is None:
        raise KeyError("depth")
    start = f"{number}/{_FURTHER}"
    further = {key.removeprefix(start): array for key, array in arrays.items() if key.startswith(start)}
    curve = Curve(
        columns["depth"],
        columns["force"],
        columns["time"],
        columns["segment"],
        metadata=test["metadata"],
        truth=test["truth"],
        columns=further,
    )
    if curve_hash(curve) != test["sha256"]:
        raise FileFormatError(f"the points of curve {number + 1} are not those that were saved")
    return curve


def _given(path: str, given: Given) -> dict[str, Any] | None:
    """A prior, bounds or None as plain values."""
    if given is None:
        return None
    if not isinstance(given, Prior):
        return {"low": float(given[0]), "high": float(given[1])}
    name = type(given).__name__
    if _PRIORS.get(name) is not type(given):
        raise InputError(f"the prior of {path}, {name}, is not part of underlay")
    values = {field.name: getattr(given, field.name) for field in fields(given)}  # type: ignore[arg-type]  # each is a dataclass
    inner = {key: _given(path, value) for key, value in values.items() if isinstance(value, Prior)}
    return {"kind": name, **values, **inner}


def _from_given(entry: Mapping[str, Any] | None) -> Given:
    if entry is None:
        return None
    # Any: a truncated prior contains another prior as well as numbers.
    values: dict[str, Any] = {
        key: _from_given(value) if isinstance(value, Mapping) else value
        for key, value in entry.items()
        if key != "kind"
    }
    return _PRIORS[entry["kind"]](**values) if "kind" in entry else (values["low"], values["high"])


def _noise(noise: Any) -> Any:
    """A noise model, or one per curve, as plain values."""
    if noise is None:
        return None
    if isinstance(noise, NoiseModel):
        return {**noise.choice, **{name: getattr(noise, name) for name in field_quantities(type(noise))}}
    return [_noise(entry) for entry in noise]


def _from_noise(entry: Mapping[str, Any] | None) -> NoiseModel | None:
    if entry is None:
        return None
    # Any: the types of the numbers depend on the class.
    numbers: dict[str, Any] = dict(entry)
    return NoiseModel.kinds()[numbers.pop("model", Noise.model)](**numbers)
