"""HDF5 in memory, or a group of a file on the disk: nothing is taken that leads out of it or claims too much."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from math import prod
from typing import Any

import numpy as np

from underlay._door import opened
from underlay.data.export import HDF5_MARK
from underlay.data.readers._source import MAX_BYTES, Source
from underlay.errors import FileFormatError, MissingExtraError, UnderlayError

__all__ = ["HDF5_MAGIC", "Checked", "GroupSource", "curve_groups", "is_own", "open_checked"]

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


def curve_groups(source: Source, file: Checked) -> list[str]:
    """Groups of the curves that are to be read, in the order of the file."""
    return [source.group] if isinstance(source, GroupSource) else [name for name in file if name.isdigit()]


def is_own(source: Source) -> bool:
    """Whether underlay wrote this HDF5 file."""
    return source.data.startswith(HDF5_MAGIC) and HDF5_MARK.encode() in source.data


class Checked:
    """A group of an HDF5 file, of which nothing is taken before it is looked at.

    Parameters
    ----------
    h5py : module
        The library.
    where : str
        The file, for messages.
    group : h5py.Group
        The group.
    claimed : list of int
        Bytes of the numbers that were taken so far, of the whole file: one entry, which all its groups share.
    """

    def __init__(self, h5py: Any, where: str, group: Any, claimed: list[int]) -> None:
        self._h5py, self._where, self._group, self._claimed = h5py, where, group, claimed

    @property
    def attrs(self) -> Any:
        """What is said of the group."""
        return self._group.attrs

    def __iter__(self) -> Iterator[str]:
        if len(self._group) > _MAX_OBJECTS:
            raise FileFormatError(f"{self._where} holds more than {_MAX_OBJECTS} objects")
        return iter(self._group)

    def __contains__(self, name: str) -> bool:
        return bool(self._group.id.links.exists(_encoded(name)))

    def __getitem__(self, name: str) -> Any:
        """A group, or all numbers of a data set.

        Raises
        ------
        FileFormatError
            If it lies elsewhere, or claims more than `MAX_BYTES` together with what was taken before.
        """
        h5py, here = self._h5py, self._group.id
        # The library's own calls: its mappings ask each of these several times.
        if here.links.get_info(_encoded(name)).type != h5py.h5l.TYPE_HARD:
            raise FileFormatError(
                f"{self._where} links to another place at {name!r:.80}; links are not followed"
            )
        found = h5py.h5o.open(here, _encoded(name))
        if isinstance(found, h5py.h5g.GroupID):
            return Checked(h5py, self._where, h5py.Group(found), self._claimed)
        made = found.get_create_plist()
        if made.get_external_count() or made.get_layout() == h5py.h5d.VIRTUAL:
            raise FileFormatError(f"{self._where} keeps {name!r:.80} in another file; that is not followed")
        shape, dtype = found.shape or (), found.dtype
        self._claimed[0] += prod(shape) * dtype.itemsize
        if self._claimed[0] > MAX_BYTES:
            raise FileFormatError(f"{self._where} claims more than {MAX_BYTES // 1_000_000} MB of numbers")
        if dtype.kind not in "fiu":
            return h5py.Dataset(found)[()]
        values = np.empty(shape, dtype)
        found.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
        return values


def _encoded(name: str) -> bytes:
    return name.encode("utf-8", "surrogateescape")


@contextmanager
def open_checked(source: Source) -> Iterator[Checked]:
    """Open an HDF5 file from memory, or from the disk for one group of it.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    FileFormatError
        If what is read is damaged, or as `Checked` says.
    """
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise MissingExtraError('reading HDF5 needs the package h5py: pip install "underlay[afm]"') from error
    in_place = isinstance(source, GroupSource)
    try:
        with (
            opened(source.path) if in_place else io.BytesIO(source.data) as stream,
            h5py.File(stream, "r") as file,
        ):
            yield Checked(h5py, source.name, file, [0])
    except UnderlayError:
        raise
    except Exception as error:  # h5py raises OSError, KeyError, RuntimeError and more on damaged files
        raise FileFormatError(
            f"{source.name} is a damaged HDF5 file: {type(error).__name__}: {error!s:.120}"
        ) from error
