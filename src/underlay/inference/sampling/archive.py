"""A result on disk: arrays and a document of plain values in one compressed ``.npz`` file, without pickles."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from underlay._documents import parse_json
from underlay._door import FileKind, printable, read_bytes, understood
from underlay._files import write_atomic
from underlay._zip import open_zip, read_member
from underlay.errors import FileFormatError

__all__ = ["LARGEST", "read_archive", "write_archive"]

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
