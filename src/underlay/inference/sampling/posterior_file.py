"""The file of a posterior: arrays and a document of plain values in one compressed ``.npz`` file, no pickles.

A file may come from an untrusted source: the type and the shape of every entry are checked before anything is built
from it, so that a number in the place of a name, or a chain of other parameters than those listed, is refused.

The problem is stored so that it can be restored to the last bit: scenes as the text of scene files, curves as
arrays with the hash of their points, priors and noise by name and numbers. No code is stored: what has no such
name, such as a caller's own class of prior, cannot be stored, and `problem_record` raises an error.
"""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from underlay._arrays import FloatArray
from underlay._door import FileKind, open_zip, parse_json, printable, read_bytes, read_member, understood
from underlay._files import write_atomic
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
from underlay.inference.sampling.diagnostics import (
    PREDICTIVE_LEVELS,
    Predictive,
    SamplingDiagnostics,
)
from underlay.mechanics.solvers import solver_named, solver_record
from underlay.quantities import field_quantities
from underlay.scene.noise import Noise, NoiseModel
from underlay.scene.scene import Scene
from underlay.scene.scene_file import scene_from_text
from underlay.scene.scene_writer import scene_text

#: Most bytes of such a file, packed and unpacked: 125 million numbers, more than a sampler can keep in memory.
LARGEST = 1_000_000_000
# Booleans, numbers and text; no objects, which would be code.
_PLAIN = "biufU"
# Priors that can be stored, by the name of their class.
_PRIORS: Mapping[str, type[Prior]] = {
    kind.__name__: kind for kind in (Flat, HalfNormal, LogNormal, LogUniform, Normal, Truncated, Uniform)
}
# Columns of a curve that are stored, besides further ones.
_COLUMNS = ("depth", "force", "time", "segment")
# Prefix of the names of further columns of a curve.
_FURTHER = "columns/"
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def write_archive(
    path: str | os.PathLike[str], about: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]
) -> None:
    """Write `arrays` by name, and `about` as JSON, to one file, atomically.

    Raises
    ------
    FileAccessError
        If the file cannot be written.
    """
    buffer = io.BytesIO()
    # Any: the type checker would take an array's name for one of the function's own options.
    named: dict[str, Any] = {"about": np.array(json.dumps(about)), **arrays}
    np.savez_compressed(buffer, **named)
    write_atomic(path, buffer.getvalue())


def read_archive(
    path: str | os.PathLike[str], known: str, kind: FileKind
) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Return the document and the arrays that `write_archive` wrote, if its ``format`` is `known`.

    Parameters
    ----------
    path : path
        The file.
    known : str
        The format that the file must state.
    kind : FileKind
        Names the file in messages and limits its size.

    Raises
    ------
    FileAccessError
        If the file cannot be read.
    FileFormatError
        If it is another file, a damaged one, one that claims more than it holds, or one of another version.
    """
    data = read_bytes(path, kind)
    with understood(path, kind):
        if not data.startswith(b"PK"):
            raise ValueError("it is no archive of arrays")
        arrays = _arrays(data)
        about = parse_json(str(arrays.pop("about")))
        found = about["format"]
    if found != known:
        raise FileFormatError(f"{printable(path)} is {kind.name} of another version: {found!r:.80}")
    return about, arrays


def _arrays(data: bytes) -> dict[str, np.ndarray[Any, Any]]:
    with open_zip(data, "the file", LARGEST) as archive:
        return {name.removesuffix(".npy"): _array(read_member(archive, name)) for name in archive.namelist()}


def _array(data: bytes) -> np.ndarray[Any, Any]:
    """The array of a ``.npy`` member, of exactly the size that its header declares."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"an array of format {version}")
    shape, by_columns, dtype = _HEADERS[version](stream)
    if dtype.kind not in _PLAIN or dtype.hasobject or dtype.names:
        raise ValueError(f"an array of {dtype!s:.40}, which is neither numbers nor text")
    start = stream.tell()
    if min(shape, default=1) < 0 or math.prod(shape) * dtype.itemsize != len(data) - start:
        raise ValueError(f"an array declares the shape {shape!s:.60} and has {len(data) - start} bytes")
    if not dtype.itemsize:  # an array of empty strings has no bytes
        return np.zeros(shape, dtype)
    flat = np.frombuffer(data, dtype, offset=start)
    return flat.reshape(shape, order="F" if by_columns else "C").copy()


@dataclass(frozen=True)
class _Document:
    """Plain values of a posterior's file, without its format and its problem."""

    names: list[str]
    priors: list[str]
    derived: list[str]
    curves: int
    truth: dict[str, float]
    diagnostics: SamplingDiagnostics


def parts_of(about: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """Keyword arguments of a `Posterior`, without its problem, from the checked contents of a file.

    Parameters
    ----------
    about : mapping
        The document of the file.
    arrays : mapping of name to ndarray
        Its arrays.

    Raises
    ------
    KeyError
        If something is missing.
    ValueError
        If something is of another type or shape.
    """
    read = _document(about)
    _require(read.names and len(set(read.names)) == len(read.names), "names", "distinct names, one at least")
    _require(len(read.priors) == len(read.names), "priors", "as many as names")
    chain = _floats(arrays, "chain", (None, None, len(read.names)))
    _require(chain.size and np.isfinite(chain).all(), "chain", "finite draws, one at least")
    return {
        "names": tuple(read.names),
        "chain": chain,
        "log_posterior": _floats(arrays, "log_posterior", chain.shape[:2]),
        "priors": tuple(read.priors),
        "prior_quantiles": _floats(arrays, "prior_quantiles", (None, len(read.names))),
        "derived": {name: _draws(arrays, f"derived/{name}") for name in read.derived},
        "predictive": tuple(_band(arrays, number) for number in range(read.curves)),
        "diagnostics": read.diagnostics,
        "truth": read.truth,
    }


def _document(about: Mapping[str, Any]) -> _Document:
    """The validated document, every entry of its field's type; entries of other names are dropped."""
    adapter = TypeAdapter(_Document)
    try:
        document = adapter.validate_json(json.dumps(about), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    known = document.diagnostics
    counts = (document.curves, known.steps, known.burn_in, known.thin, known.walkers)
    _require(min(*counts, known.evaluations, known.failures) >= 0, "a count", "zero or more")
    return document


def _draws(arrays: Mapping[str, np.ndarray[Any, Any]], name: str) -> FloatArray:
    values = _floats(arrays, name, (None, None))
    _require(values.size and np.isfinite(values).all(), name, "finite draws, one at least")
    return values


def _band(arrays: Mapping[str, np.ndarray[Any, Any]], number: int) -> Predictive:
    depth = _floats(arrays, f"predictive/{number}/depth", (None,))
    shapes = {
        "force": depth.shape,
        "model": (len(PREDICTIVE_LEVELS), len(depth)),
        "reading": (len(PREDICTIVE_LEVELS), len(depth)),
    }
    rest = {name: _floats(arrays, f"predictive/{number}/{name}", shape) for name, shape in shapes.items()}
    return Predictive(depth, **rest)


def _require(condition: object, name: str, wanted: str) -> None:
    if not condition:
        raise ValueError(f"{name} must be {wanted}")


def _floats(
    arrays: Mapping[str, np.ndarray[Any, Any]], name: str, shape: tuple[int | None, ...]
) -> FloatArray:
    """An array of floats of the given shape, where None stands for any length; raises ValueError otherwise."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    _require(array.dtype.kind == "f" and fits, name, f"numbers of shape {shape}")
    return array.astype(np.float64, copy=False)


# --- the problem ----------------------------------------------------------------------------------------


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
