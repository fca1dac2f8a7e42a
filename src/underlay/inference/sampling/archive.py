"""A result on disk: arrays and a document of plain values in one compressed ``.npz`` file, without pickles."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from underlay._files import write_atomic
from underlay.errors import FileAccessError, FileFormatError

__all__ = ["read_archive", "write_archive"]


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
    path: str | os.PathLike[str], known: str, what: str
) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Return what `write_archive` wrote, if its ``format`` is `known`.

    Parameters
    ----------
    path : path
        The file.
    known : str
        The format there must be.
    what : str
        What it is called in a message, e.g. ``"posterior"``.

    Raises
    ------
    FileAccessError
        If the file cannot be read.
    FileFormatError
        If it is another file, or of another version.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        about = json.loads(str(arrays.pop("about")))
        found = about["format"]
    except OSError as error:
        raise FileAccessError(f"cannot read {os.fspath(path)}: {error}") from error
    except (ValueError, KeyError) as error:
        raise FileFormatError(f"{os.fspath(path)} is not a saved {what}: {error}") from error
    if found != known:
        raise FileFormatError(f"{os.fspath(path)} is a {what} of another version: {found!r}")
    return about, arrays
