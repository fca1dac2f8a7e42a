"""HDF5 files in memory, opened only if nothing in them leads out of the file or claims too much."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from underlay.data.export import HDF5_MARK
from underlay.data.readers._source import MAX_BYTES, Source
from underlay.errors import FileFormatError, MissingExtraError, UnderlayError

__all__ = ["HDF5_MAGIC", "is_own", "open_checked"]

#: First bytes of an HDF5 file.
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_MAX_OBJECTS = 500_000


def is_own(source: Source) -> bool:
    """Whether underlay wrote this HDF5 file."""
    return source.data.startswith(HDF5_MAGIC) and HDF5_MARK.encode() in source.data


@contextmanager
def open_checked(source: Source) -> Iterator[Any]:
    """Open an HDF5 file from memory.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    FileFormatError
        If the file is damaged, links to another file, or claims more than `MAX_BYTES`.
    """
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise MissingExtraError('reading HDF5 needs the package h5py: pip install "underlay[afm]"') from error
    try:
        with h5py.File(io.BytesIO(source.data), "r") as file:
            _check(h5py, source, file)
            yield file
    except UnderlayError:
        raise
    except Exception as error:  # h5py raises OSError, KeyError, RuntimeError and more on damaged files
        raise FileFormatError(
            f"{source.name} is a damaged HDF5 file: {type(error).__name__}: {error!s:.120}"
        ) from error


def _check(h5py: Any, source: Source, file: Any) -> None:
    total = 0
    seen = 0
    waiting = [file]
    while waiting:
        group = waiting.pop()
        for name in group:
            seen += 1
            if seen > _MAX_OBJECTS:
                raise FileFormatError(f"{source.name} holds more than {_MAX_OBJECTS} objects")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise FileFormatError(
                    f"{source.name} links to another place at {name!r:.80}; links are not followed"
                )
            item = group[name]
            if isinstance(item, h5py.Group):
                waiting.append(item)
            elif isinstance(item, h5py.Dataset):
                if item.external or item.is_virtual:
                    raise FileFormatError(
                        f"{source.name} keeps {name!r:.80} in another file; that is not followed"
                    )
                total += int(item.nbytes)
                if total > MAX_BYTES:
                    raise FileFormatError(
                        f"{source.name} claims more than {MAX_BYTES // 1_000_000} MB of numbers"
                    )
