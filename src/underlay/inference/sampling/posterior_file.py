"""The file of a posterior: arrays and a document of plain values in one compressed ``.npz`` file, no pickles.

A file may come from an untrusted source: the type and the shape of every entry are checked before anything is built
from it, so that a number in the place of a name, or a chain of other parameters than those listed, is refused.
"""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from underlay._arrays import FloatArray
from underlay._door import FileKind, open_zip, parse_json, printable, read_bytes, read_member, understood
from underlay._files import write_atomic
from underlay.errors import FileFormatError
from underlay.inference.sampling.diagnostics import (
    PREDICTIVE_LEVELS,
    Predictive,
    SamplingDiagnostics,
)

#: Most bytes of such a file, packed and unpacked: 125 million numbers, more than a sampler can keep in memory.
LARGEST = 1_000_000_000
# Booleans, numbers and text; no objects, which would be code.
_PLAIN = "biufU"
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
