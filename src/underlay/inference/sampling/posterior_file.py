"""The file of a posterior: arrays and a document, every entry checked.

A result on disk: arrays and a document of plain values in one compressed ``.npz`` file, without pickles.

What the file of a posterior must hold: every entry checked for kind and shape before anything is built.

The file may come from anybody and is shown to people: a number in the place of a name, or a chain of other
parameters than those it lists, must not get further than this.
"""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import FileKind, open_zip, parse_json, printable, read_bytes, read_member, understood
from underlay._files import write_atomic
from underlay.errors import FileFormatError
from underlay.inference.ridge.importance import Importance
from underlay.inference.sampling.diagnostics import PREDICTIVE_LEVELS, Predictive, SamplingDiagnostics

__all__ = ["LARGEST", "parts_of", "read_archive", "write_archive"]

#: Most bytes of such a file, packed and unpacked: 125 million numbers, more than a sampler can keep in memory.
LARGEST = 1_000_000_000


# Truth values, numbers and text; no objects, which would be code.
_PLAIN = "biufU"


_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def write_archive(
    path: str | os.PathLike[str], about: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]
) -> None:
    """Write `arrays` by name, and `about` as JSON, whole or not at all.

    Raises
    ------
    FileAccessError
        If the file cannot be written.
    """
    buffer = io.BytesIO()
    # Any: a name of an array may not stand for one of the function's own options.
    named: dict[str, Any] = {"about": np.array(json.dumps(about)), **arrays}
    np.savez_compressed(buffer, **named)
    write_atomic(path, buffer.getvalue())


def read_archive(
    path: str | os.PathLike[str], known: str, kind: FileKind
) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Return what `write_archive` wrote, if its ``format`` is `known`.

    Parameters
    ----------
    path : path
        The file.
    known : str
        The format there must be.
    kind : FileKind
        What it is called in a message.

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
    if not dtype.itemsize:  # text of no letters has no bytes to look at
        return np.zeros(shape, dtype)
    flat = np.frombuffer(data, dtype, offset=start)
    return flat.reshape(shape, order="F" if by_columns else "C").copy()


def parts_of(about: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """Keywords of a `Posterior`, but for its problem.

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
        If something is of another kind or shape.
    """
    names = _texts(about["names"], "names")
    _require(names and len(set(names)) == len(names), "names", "distinct names, one at least")
    chain = _floats(arrays, "chain", (None, None, len(names)))
    _require(chain.size and np.isfinite(chain).all(), "chain", "finite draws, one at least")
    return {
        "names": names,
        "chain": chain,
        "log_posterior": _floats(arrays, "log_posterior", chain.shape[:2]),
        "priors": _texts(about["priors"], "priors", len(names)),
        "prior_quantiles": _floats(arrays, "prior_quantiles", (None, len(names))),
        "derived": {name: _draws(arrays, f"derived/{name}") for name in _texts(about["derived"], "derived")},
        "predictive": tuple(_band(arrays, number) for number in range(_count(about["curves"], "curves"))),
        "diagnostics": _diagnostics(about["diagnostics"]),
        "truth": _numbers_by_name(about["truth"], "truth"),
    }


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


def _diagnostics(entry: Any) -> SamplingDiagnostics:
    """Each entry as its field is declared."""
    return SamplingDiagnostics(**_as_declared(SamplingDiagnostics, entry, "diagnostics"))


def _as_declared(kind: type[SamplingDiagnostics | Importance], entry: Any, name: str) -> dict[str, Any]:
    """Keywords of a record: every entry checked by its field's declaration; one with a default may be missing."""
    table = _table(entry, name)
    return {
        field.name: _AS_DECLARED[str(field.type)](table[field.name], field.name)
        for field in fields(kind)
        if field.name in table or (field.default is MISSING and field.default_factory is MISSING)
    }


def _importance(value: Any, name: str) -> Importance | None:
    return None if value is None else Importance(**_as_declared(Importance, value, name))


def _require(condition: object, name: str, wanted: str) -> None:
    if not condition:
        raise ValueError(f"{name} must be {wanted}")


def _floats(
    arrays: Mapping[str, np.ndarray[Any, Any]], name: str, shape: tuple[int | None, ...]
) -> FloatArray:
    """An array of numbers; None in `shape` stands for any length."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    _require(array.dtype.kind == "f" and fits, name, f"numbers of shape {shape}")
    return array.astype(np.float64, copy=False)


def _table(value: Any, name: str) -> dict[str, Any]:
    _require(isinstance(value, dict), name, "a table")
    table: dict[str, Any] = value
    return table


def _texts(values: Any, name: str, count: int | None = None) -> tuple[str, ...]:
    are_texts = isinstance(values, list) and all(isinstance(value, str) for value in values)
    _require(are_texts and count in (None, len(values)), name, "a list of texts")
    return tuple(values)


def _text(value: Any, name: str) -> str:
    return _texts([value], name)[0]


def _texts_by_name(value: Any, name: str) -> dict[str, str]:
    return {key: _text(entry, name) for key, entry in _table(value, name).items()}


def _numbers_by_name(value: Any, name: str) -> dict[str, float]:
    return {key: _number(entry, name) for key, entry in _table(value, name).items()}


def _pairs_by_name(value: Any, name: str) -> dict[str, tuple[float, float]]:
    pairs = {key: _numbers(entry, name) for key, entry in _table(value, name).items()}
    _require(all(len(pair) == 2 for pair in pairs.values()), name, "pairs of numbers")
    return {key: (low, high) for key, (low, high) in pairs.items()}


def _tuples_by_name(value: Any, name: str) -> dict[str, tuple[float, ...]]:
    return {key: _numbers(entry, name) for key, entry in _table(value, name).items()}


def _numbers(values: Any, name: str) -> tuple[float, ...]:
    _require(isinstance(values, list), name, "a list of numbers")
    return tuple(_number(value, name) for value in values)


def _number(value: Any, name: str) -> float:
    _require(isinstance(value, int | float) and not isinstance(value, bool), name, "a number")
    return float(value)


def _count(value: Any, name: str) -> int:
    _require(type(value) is int and value >= 0, name, "a whole number")
    return int(value)


def _count_or_none(value: Any, name: str) -> int | None:
    return None if value is None else _count(value, name)


def _truth_value(value: Any, name: str) -> bool:
    _require(isinstance(value, bool), name, "true or false")
    return bool(value)


# How an entry of the diagnostics is checked, by the declaration of its field.
_AS_DECLARED: Mapping[str, Callable[[Any, str], Any]] = {
    "bool": _truth_value,
    "str": _text,
    "int": _count,
    "int | None": _count_or_none,
    "float": _number,
    "tuple[float, ...]": _numbers,
    "Mapping[str, tuple[float, float]]": _pairs_by_name,
    "Mapping[str, str]": _texts_by_name,
    "Mapping[str, float]": _numbers_by_name,
    "Mapping[str, tuple[float, ...]]": _tuples_by_name,
    "Importance | None": _importance,
}
