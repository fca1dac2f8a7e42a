"""HDF5 files of curves: read from memory, or from the disk one group at a time.

Nothing is taken that leads out of the file or the group (links, references), or that claims more than
`MAX_BYTES` together with what was taken before: `Checked` looks before it reads.

A file of many curves may be larger than memory. Its root is listed once; whoever then reads a curve opens the
file, or has it open from the curve before (`KeptOpen`), and reads the group of that curve alone, in place,
checked as any file is.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from math import prod
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from underlay._door import opened
from underlay.data.export import HDF5_MARK
from underlay.data.readers._format import library
from underlay.data.readers._source import MAX_BYTES, Source, curve_name
from underlay.errors import FileFormatError, UnderlayError

#: First bytes of an HDF5 file.
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_MAX_OBJECTS = 500_000
_BUFFER = 65_536
# Numbers that files hold, by numpy's name for them on this machine and the library's.
_NATIVE: Mapping[str, str] = {
    np.dtype("f8").str: "NATIVE_DOUBLE",
    np.dtype("f4").str: "NATIVE_FLOAT",
    np.dtype("i8").str: "NATIVE_INT64",
    np.dtype("u1").str: "NATIVE_UINT8",
}


class KeptOpen:
    """Keeps the HDF5 file of a map open between its curves: opening it takes as long as reading a curve."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._file: Any = None
        self._open = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def file(self, h5py: Any, path: Path) -> Any:
        """Return the open `h5py.File` at `path`; a file at another path that is still open is closed first."""
        if path != self._path:
            self.close()
            stream = self._open.enter_context(opened(path))
            # The library asks for a few hundred bytes at a time.
            buffered = self._open.enter_context(io.BufferedReader(stream, _BUFFER))
            self._file = self._open.enter_context(h5py.File(buffered, "r"))
            self._path = path
        return self._file

    def close(self) -> None:
        """Close the file; the next call of `file` opens it again."""
        self._path = self._file = None
        self._open.close()


@dataclass(frozen=True)
class GroupSource(Source):
    """One group of an HDF5 file on the disk, read without loading the file; `data` are only its first bytes.

    Parameters
    ----------
    group : str
        Name of the group.
    kept : KeptOpen or None
        Holds the file open for the next group; None opens and closes it for this one alone.
    """

    group: str = ""
    kept: KeptOpen | None = None


def curve_groups(source: Source, file: Checked) -> list[str]:
    """Names of the groups to read: the one of a `GroupSource`, else all whose name is a number, in file order."""
    return [source.group] if isinstance(source, GroupSource) else [name for name in file if name.isdigit()]


def is_own(source: Source) -> bool:
    """Whether underlay wrote this HDF5 file."""
    return source.data.startswith(HDF5_MAGIC) and HDF5_MARK.encode() in source.data


class Checked:
    """A group of an HDF5 file in which size and place of each data set are checked before it is read.

    Links, virtual and external data sets are refused (`FileFormatError`), and so is too large a total.

    Parameters
    ----------
    h5py : module
        The imported library.
    where : str
        Name of the file in error messages.
    group : h5py.Group
        The group that is wrapped.
    bytes_read : list of int
        One entry, shared by all groups of a file: bytes of the data sets read so far.
    """

    def __init__(self, h5py: Any, where: str, group: Any, bytes_read: list[int]) -> None:
        self._h5py, self._where, self._group, self._bytes_read = h5py, where, group, bytes_read

    def is_said(self, name: str) -> bool:
        """Whether the group has an attribute of this name."""
        return bool(self._h5py.h5a.exists(self._group.id, _encoded(name)))

    def said(self) -> dict[str, Any]:
        """Attributes of the group by name, equal to those of h5py's `attrs` and read in a third of the time."""
        h5py, here = self._h5py, self._group.id
        names: list[bytes] = []
        h5py.h5a.iterate(here, names.append)
        return {
            name.decode("utf-8", "surrogateescape"): self._word(h5py.h5a.open(here, name)) for name in names
        }

    def _word(self, said: Any) -> Any:
        h5py, kind = self._h5py, said.dtype
        string_type = h5py.check_string_dtype(kind)
        is_word = string_type is not None and string_type.length is None
        if said.shape != () or not (is_word or kind.kind in "fiu"):
            return self._group.attrs[said.name]
        value: Any = np.empty((), kind)
        said.read(value, _in_memory(h5py, kind))
        return value[()].decode("utf-8", "surrogateescape") if is_word else value[()]

    def __iter__(self) -> Iterator[str]:
        if len(self._group) > _MAX_OBJECTS:
            raise FileFormatError(f"{self._where} holds more than {_MAX_OBJECTS} objects")
        return iter(self._group)

    def __contains__(self, name: str) -> bool:
        return bool(self._group.id.links.exists(_encoded(name)))

    def __getitem__(self, name: str) -> Any:
        """Return the member of this name: a group as `Checked`, or all values of a data set as an array.

        Raises
        ------
        FileFormatError
            If it is a link or lies in another file, or the bytes read so far and its own exceed `MAX_BYTES`.
        """
        h5py, here = self._h5py, self._group.id
        # The library's own calls: its mappings ask each of these several times.
        if here.links.get_info(_encoded(name)).type != h5py.h5l.TYPE_HARD:
            raise FileFormatError(
                f"{self._where} links to another place at {name!r:.80}; links are not followed"
            )
        found = h5py.h5o.open(here, _encoded(name))
        if isinstance(found, h5py.h5g.GroupID):
            return Checked(h5py, self._where, h5py.Group(found), self._bytes_read)
        # What has a place of its own in this file is not kept elsewhere.
        made = found.get_create_plist() if found.get_offset() is None else None
        if made is not None and (made.get_external_count() or made.get_layout() == h5py.h5d.VIRTUAL):
            raise FileFormatError(f"{self._where} keeps {name!r:.80} in another file; that is not followed")
        shape, dtype = found.shape or (), found.dtype
        self._bytes_read[0] += prod(shape) * dtype.itemsize
        if self._bytes_read[0] > MAX_BYTES:
            raise FileFormatError(f"{self._where} claims more than {MAX_BYTES // 1_000_000} MB of numbers")
        if dtype.kind not in "fiu":
            return h5py.Dataset(found)[()]
        values = np.empty(shape, dtype)
        found.read(h5py.h5s.ALL, h5py.h5s.ALL, values, _in_memory(h5py, dtype))
        return values


def _in_memory(h5py: Any, dtype: np.dtype[Any]) -> Any:
    """Return h5py's type for a numpy dtype in memory, or None to let the library find it itself.

    Letting it search takes longer than reading a curve, but is needed for types with metadata (enumerations).
    """
    name = _NATIVE.get(dtype.str) if dtype.metadata is None else None
    return None if name is None else getattr(h5py.h5t, name)


def _encoded(name: str) -> bytes:
    return name.encode("utf-8", "surrogateescape")


@contextmanager
def open_checked(source: Source) -> Iterator[Checked]:
    """Open the HDF5 file of a source as `Checked`: from memory, or on the disk for a `GroupSource`.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    FileFormatError
        If the file is damaged, or something in it is refused by `Checked`.
    """
    h5py = library("h5py", "reading HDF5 needs h5py")
    kept = source.kept if isinstance(source, GroupSource) else None
    try:
        with _content(h5py, source, kept) as file:
            yield Checked(h5py, source.name, file, [0])
    except BaseException as error:
        # What a damaged group leaves behind in the library is not carried to the next one.
        if kept is not None:
            kept.close()
        if isinstance(error, UnderlayError) or not isinstance(error, Exception):
            raise
        # h5py raises OSError, KeyError, RuntimeError and more on damaged files.
        raise FileFormatError(
            f"{source.name} is a damaged HDF5 file: {type(error).__name__}: {error!s:.120}"
        ) from error


@contextmanager
def _content(h5py: Any, source: Source, kept: KeptOpen | None) -> Iterator[Any]:
    if kept is not None:
        yield kept.file(h5py, source.path)
        return
    with (
        opened(source.path) if isinstance(source, GroupSource) else io.BytesIO(source.data) as stream,
        h5py.File(stream, "r") as file,
    ):
        yield file


@dataclass(frozen=True)
class Hdf5MapCurve:
    """Place of one curve in an HDF5 file on the disk, so that it can be read alone.

    Parameters
    ----------
    path : Path
        The file.
    sha256 : str
        Hash of the file.
    number : int
        Which curve, counted from 1.
    group : str
        Name of its group.
    name : str
        Name of the curve; empty where the group's own metadata give it (files that underlay wrote).
    kept : KeptOpen or None
        Holds the file open for the next curve where several are read one after the other.
    """

    path: Path
    sha256: str
    number: int
    group: str
    name: str
    kept: KeptOpen | None = None

    def source(self) -> GroupSource:
        """Return the group of this curve as a source that readers treat as a file with one curve."""
        known = HDF5_MAGIC if self.name else HDF5_MAGIC + HDF5_MARK.encode()
        return GroupSource(self.path, known, self.sha256, group=self.group, kept=self.kept)


def curves_of_hdf5(path: str | os.PathLike[str]) -> list[Hdf5MapCurve]:
    """List the curves of an HDF5 file without reading them; none where it is no HDF5 file, or h5py is missing.

    Raises
    ------
    FileAccessError
        If the file cannot be read, or is no regular file.
    """
    file = Path(path)
    with opened(file) as stream:
        if stream.read(len(HDF5_MAGIC)) != HDF5_MAGIC:
            return []
        stream.seek(0)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    try:
        h5py: Any = import_module("h5py")
        with opened(file) as stream, h5py.File(stream, "r") as content:
            own = bytes(content.attrs.get("format", b"")) == HDF5_MARK.encode()
            groups = [name for name in content if name.isdigit()]
    except Exception:  # noqa: BLE001  h5py raises OSError, RuntimeError and more; whoever reads the whole file says why
        return []
    if own:
        groups.sort(key=int)
    resolved = file.resolve()
    return [
        Hdf5MapCurve(resolved, sha256, number, group, "" if own else curve_name(file, number))
        for number, group in enumerate(groups, start=1)
    ]
