"""HDF5 in memory, or a group of a file on the disk, opened only if nothing in it leads out or claims too much."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from underlay._door import opened
from underlay.data.export import HDF5_MARK
from underlay.data.readers._source import MAX_BYTES, Source
from underlay.errors import FileFormatError, MissingExtraError, UnderlayError

__all__ = ["HDF5_MAGIC", "GroupSource", "curve_groups", "is_own", "open_checked"]

#: First bytes of an HDF5 file.
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_MAX_OBJECTS = 500_000


@dataclass(frozen=True)
class GroupSource(Source):
    """One group of a file on the disk, which is read in place; `data` are what the file is recognised by.

    Parameters
    ----------
    group : str
        Its name.
    """

    group: str = ""


def curve_groups(source: Source, file: Any) -> list[str]:
    """Groups of the curves that are to be read, in the order of the file."""
    return [source.group] if isinstance(source, GroupSource) else [name for name in file if name.isdigit()]


def is_own(source: Source) -> bool:
    """Whether underlay wrote this HDF5 file."""
    return source.data.startswith(HDF5_MAGIC) and HDF5_MARK.encode() in source.data


@contextmanager
def open_checked(source: Source) -> Iterator[Any]:
    """Open an HDF5 file from memory, or from the disk for one group of it.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    FileFormatError
        If what is to be read is damaged, links to another file, or claims more than `MAX_BYTES`.
    """
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise MissingExtraError('reading HDF5 needs the package h5py: pip install "underlay[afm]"') from error
    try:
        if isinstance(source, GroupSource):
            with opened(source.path) as stream, h5py.File(stream, "r") as file:
                _check(h5py, source, file, (source.group,))
                yield file
        else:
            with h5py.File(io.BytesIO(source.data), "r") as file:
                _check(h5py, source, file, tuple(file))
                yield file
    except UnderlayError:
        raise
    except Exception as error:  # h5py raises OSError, KeyError, RuntimeError and more on damaged files
        raise FileFormatError(
            f"{source.name} is a damaged HDF5 file: {type(error).__name__}: {error!s:.120}"
        ) from error


def _check(h5py: Any, source: Source, root: Any, names: tuple[str, ...]) -> None:
    """Refuse a file of which these members of the root lead elsewhere, or claim too much together."""
    where = source.name
    total = 0
    seen = 0
    waiting = [(root, names)]
    while waiting:
        group, members = waiting.pop()
        for name in members:
            seen += 1
            if seen > _MAX_OBJECTS:
                raise FileFormatError(f"{where} holds more than {_MAX_OBJECTS} objects")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise FileFormatError(
                    f"{where} links to another place at {name!r:.80}; links are not followed"
                )
            item = group[name]
            if isinstance(item, h5py.Group):
                waiting.append((item, tuple(item)))
            elif isinstance(item, h5py.Dataset):
                if item.external or item.is_virtual:
                    raise FileFormatError(f"{where} keeps {name!r:.80} in another file; that is not followed")
                total += int(item.nbytes)
                if total > MAX_BYTES:
                    raise FileFormatError(f"{where} claims more than {MAX_BYTES // 1_000_000} MB of numbers")
