"""Archives in memory, bounded by what they claim and held to it."""

from __future__ import annotations

import io
import zipfile

from underlay._door import printable
from underlay.errors import FileFormatError

__all__ = ["open_zip", "read_member"]

# More members than any instrument archive of 256 MB holds (a JPK map has about 20 per point).
_MAX_MEMBERS = 400_000
_MB = 1_000_000


def open_zip(data: bytes, name: str, largest: int) -> zipfile.ZipFile:
    """Open an archive after checking what it claims to hold.

    Parameters
    ----------
    data : bytes
        The archive.
    name : str
        What it is called in a message.
    largest : int
        Most bytes that its members may claim together.

    Raises
    ------
    FileFormatError
        If it is damaged, or claims more than that.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except Exception as error:  # BadZipFile, struct.error, and whatever else a damaged directory gives
        raise FileFormatError(f"{name} starts as a ZIP archive but is damaged: {error!s:.120}") from error
    members = archive.infolist()
    total = sum(member.file_size for member in members)
    if total > largest or len(members) > _MAX_MEMBERS:
        raise FileFormatError(
            f"{name} claims {len(members)} members and {total / _MB:.0f} MB unpacked; at most "
            f"{_MAX_MEMBERS} and {largest // _MB} MB are read"
        )
    return archive


def read_member(archive: zipfile.ZipFile, name: str, largest: int | None = None) -> bytes:
    """Unpack one member into memory, never beyond the size it claims.

    Parameters
    ----------
    archive : ZipFile
        The archive.
    name : str
        Of the member.
    largest : int, optional
        Most bytes that it may claim.

    Raises
    ------
    FileFormatError
        If it is missing, damaged, encrypted, larger than it claims, or claims more than `largest`.
    """
    shown = printable(name)[:80]
    try:
        info = archive.getinfo(name)
    except KeyError as error:
        raise FileFormatError(f"the archive has no member {shown!r}") from error
    if largest is not None and info.file_size > largest:
        raise FileFormatError(
            f"archive member {shown!r} claims {info.file_size / _MB:.0f} MB unpacked; at most "
            f"{largest / _MB:g} MB of such a member are read"
        )
    try:
        with archive.open(info) as stream:
            data = stream.read(info.file_size + 1)
    except Exception as error:  # each decompressor has errors of its own
        raise FileFormatError(f"archive member {shown!r} is damaged: {error!s:.120}") from error
    if len(data) > info.file_size:
        raise FileFormatError(f"archive member {shown!r} is larger than it claims")
    return data
