"""Maps of JPK curve by curve: a list of what the archive holds, and each curve as an archive of its own.

A map is one ZIP archive with a dozen members a curve, and may be larger than memory. Its directory is read
once; whoever then reads a curve opens the file, unpacks the members of that curve and those that all curves
share, and hands them to the reader of single curves.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from underlay._door import opened
from underlay.data.readers._source import MAX_BYTES, Source, curve_name
from underlay.data.readers.jpk import LONGEST_HEADER
from underlay.errors import FileFormatError

__all__ = ["JpkMapCurve", "curves_of_jpk_map"]

_OF_A_CURVE = re.compile(r"index/(\d{1,9})/.*", re.DOTALL)
_OF_ALL = re.compile(r"header\.properties|shared-data/[^/]*|index/")
# Fixed part of what stands before the bytes of a member; its name and further fields follow.
_LOCAL_HEADER = struct.Struct("<4s22xHH")
_LOCAL_MARK = b"PK\x03\x04"
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# Bytes of the longest directory: that of a map of 1000 by 1000 curves takes about as much.
_LONGEST_DIRECTORY = 2_000_000_000


class _Member(NamedTuple):
    """Where a member of the archive stands, and what it claims."""

    name: str
    offset: int
    method: int
    packed: int
    size: int
    crc: int


@dataclass(frozen=True)
class JpkMapCurve:
    """One curve of a map on the disk.

    Parameters
    ----------
    path : Path
        The map.
    sha256 : str
        Of the map.
    number : int
        Which curve, counted from 1.
    members : tuple
        The members of the archive that make it.
    """

    path: Path
    sha256: str
    number: int
    members: tuple[_Member, ...]

    @property
    def name(self) -> str:
        """What the curve is called where the whole map is read."""
        return curve_name(self.path, self.number)

    def source(self) -> Source:
        """Read this curve as an archive of its own.

        Raises
        ------
        FileAccessError
            If the map cannot be read.
        FileFormatError
            If the members are damaged, or claim more than is read of one file.
        """
        claimed = sum(member.size for member in self.members)
        if claimed > MAX_BYTES:
            raise FileFormatError(f"{self.name} claims {claimed / 1e6:.0f} MB unpacked")
        for member in self.members:
            if member.name.endswith(".properties") and member.size > LONGEST_HEADER:
                raise FileFormatError(
                    f"{self.name}: the header {member.name!r:.80} claims {member.size / 1e6:.0f} MB unpacked; at "
                    f"most {LONGEST_HEADER / 1e6:g} MB of one are read"
                )
        packed = io.BytesIO()
        with _open(self.path) as stream, zipfile.ZipFile(packed, "w") as archive:
            for member in self.members:
                archive.writestr(zipfile.ZipInfo(member.name), self._unpacked(stream, member))
        return Source(self.path, packed.getvalue(), self.sha256)

    def _unpacked(self, stream: io.FileIO, member: _Member) -> bytes:
        stream.seek(member.offset)
        header = stream.read(_LOCAL_HEADER.size)
        if len(header) == _LOCAL_HEADER.size and member.method in _METHODS:
            mark, name, further = _LOCAL_HEADER.unpack(header)
            stream.seek(name + further, os.SEEK_CUR)
            data = stream.read(member.packed)
            if member.method == zipfile.ZIP_DEFLATED:
                data = _inflated(data, member.size)
            if mark == _LOCAL_MARK and len(data) == member.size and zlib.crc32(data) == member.crc:
                return data
        raise FileFormatError(f"{self.name}: archive member {member.name!r:.80} is damaged")


def curves_of_jpk_map(path: str | os.PathLike[str]) -> list[JpkMapCurve]:
    """List the curves of a map without reading them; empty where the file is no map of JPK.

    Raises
    ------
    FileAccessError
        If the file cannot be read, or is no regular file.
    """
    file = Path(path)
    with _open(file) as stream:
        if stream.read(len(_LOCAL_MARK)) != _LOCAL_MARK:
            return []
        shared, curves = _members(stream)
        if "header.properties" not in {member.name for member in shared} or not curves:
            return []
        stream.seek(0)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    return [
        JpkMapCurve(file.resolve(), sha256, number, (*shared, *curves[index]))
        for number, index in enumerate(sorted(curves), start=1)
    ]


def _members(stream: io.FileIO) -> tuple[list[_Member], dict[int, list[_Member]]]:
    """Members that all curves share, and those of each curve by its index; none of a damaged archive."""
    shared: list[_Member] = []
    curves: dict[int, list[_Member]] = {}
    try:
        # Closing this archive leaves the stream open.
        with zipfile.ZipFile(stream) as archive:
            for info in archive.infolist():
                member = _Member(
                    info.filename,
                    info.header_offset,
                    info.compress_type,
                    info.compress_size,
                    info.file_size,
                    info.CRC,
                )
                if matched := _OF_A_CURVE.fullmatch(info.filename):
                    curves.setdefault(int(matched[1]), []).append(member)
                elif _OF_ALL.fullmatch(info.filename):
                    shared.append(member)
    except (zipfile.BadZipFile, ValueError, EOFError, NotImplementedError, OverflowError, OSError):
        # Whoever reads the whole file says what is wrong with it.
        return [], {}
    return shared, curves


class _Bounded(io.FileIO):
    """A file of which no more is read at once than the longest directory takes."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read `size` bytes; raises ValueError where that is too much."""
        if size is not None and size > _LONGEST_DIRECTORY:
            raise ValueError(f"{size} bytes at once are not read")
        return super().read(-1 if size is None else size) or b""


@contextmanager
def _open(path: Path) -> Iterator[io.FileIO]:
    """Open a file of which pieces of bounded size are read."""
    with opened(path) as stream:
        yield _Bounded(stream.fileno(), closefd=False)


def _inflated(data: bytes, size: int) -> bytes:
    """Unpack to at most a byte more than `size`; empty where the data are damaged."""
    try:
        return zlib.decompressobj(-zlib.MAX_WBITS).decompress(data, size + 1)
    except zlib.error:
        return b""
