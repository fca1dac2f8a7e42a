"""The bytes of an instrument file, taken in once, bounded and never from anything but a regular file."""

from __future__ import annotations

import hashlib
import io
import os
import stat
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

from underlay.errors import FileAccessError, FileFormatError

__all__ = ["MAX_BYTES", "MAX_TEXT_BYTES", "Source", "load", "open_zip", "read_member", "unpack"]

_MB = 1_000_000
#: Largest file, and largest total of what an archive holds, in bytes.
MAX_BYTES = 256 * _MB
#: Largest text: lines and numbers take about four times the bytes while they are parsed.
MAX_TEXT_BYTES = 64 * _MB
# More members than any instrument archive of that size holds (a JPK map has about 20 per point).
_MAX_MEMBERS = 400_000
# How an archive says it is something else than a folder of instrument files.
_OFFICE_MEMBER = "[Content_Types].xml"
_JPK_MEMBER = "header.properties"


@dataclass(frozen=True)
class Source:
    """One file, or one member of an archive, in memory.

    Parameters
    ----------
    path : Path
        The file on disk.
    data : bytes
        Its content, or that of the member.
    sha256 : str
        Of the file on disk.
    member : str
        Name inside the archive; empty for a plain file.
    """

    path: Path
    data: bytes
    sha256: str
    member: str = ""

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return f"{self.path.name}!{self.member}" if self.member else self.path.name

    @property
    def is_zip(self) -> bool:
        """Whether it starts as a ZIP archive does."""
        return self.data[:4] in {b"PK\x03\x04", b"PK\x05\x06"}

    def head(self, size: int = 16_384) -> str:
        """Return the first bytes as text for recognition, line ends unified; binary content gives ''."""
        start = self.data[:size]
        if start[:2] in {b"\xff\xfe", b"\xfe\xff"}:
            return start[: len(start) // 2 * 2].decode("utf-16", errors="ignore").replace("\r", "\n")
        if b"\0" in start:
            return ""
        return start.removeprefix(b"\xef\xbb\xbf").decode("latin-1").replace("\r", "\n")


def load(path: str | os.PathLike[str]) -> Source:
    """Read a regular file into memory.

    Raises
    ------
    FileAccessError
        If it is missing, unreadable, a directory, a pipe or another special file.
    FileFormatError
        If it is empty or larger than `MAX_BYTES`.
    """
    file, descriptor = _open_regular(path)
    with os.fdopen(descriptor, "rb", buffering=0) as stream:
        try:
            data = _read_up_to(stream, MAX_BYTES + 1)
        except OSError as error:
            raise FileAccessError(f"cannot read {str(file)!r}: {error.strerror}") from error
    if len(data) > MAX_BYTES:
        raise FileFormatError(_too_large(file))
    if not data:
        raise FileFormatError(f"{file.name} is empty")
    return Source(file, data, hashlib.sha256(data).hexdigest())


def _open_regular(path: str | os.PathLike[str]) -> tuple[Path, int]:
    """Open a file without waiting on it, and close it again if it is not a regular one."""
    try:
        file = Path(path)
        # Without O_NONBLOCK, opening a FIFO waits for a writer for ever.
        descriptor = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError, TypeError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise FileAccessError(f"cannot open {str(path)!r:.200}: {reason}") from error
    status = os.fstat(descriptor)
    mode = status.st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        what = "a directory; name one file in it" if stat.S_ISDIR(mode) else "a pipe or device, not a file"
        raise FileAccessError(f"cannot read {str(file)!r}: it is {what}")
    if status.st_size > MAX_BYTES:
        os.close(descriptor)
        raise FileFormatError(_too_large(file))
    return file, descriptor


def _too_large(file: Path) -> str:
    return f"{file.name} holds more than the {MAX_BYTES // _MB} MB that are read; split it first"


def _read_up_to(stream: io.FileIO, limit: int) -> bytes:
    # A file that grows while it is read must not grow in memory.
    parts = []
    left = limit
    while left > 0 and (part := stream.read(min(left, 16 * _MB))):
        parts.append(part)
        left -= len(part)
    return b"".join(parts)


def open_zip(source: Source) -> zipfile.ZipFile:
    """Open an archive in memory after checking what it claims to hold.

    Raises
    ------
    FileFormatError
        If it is damaged, or its members add up to more than `MAX_BYTES`.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(source.data))
    except (zipfile.BadZipFile, ValueError, OSError, EOFError, NotImplementedError, OverflowError) as error:
        raise FileFormatError(f"{source.name} starts as a ZIP archive but is damaged: {error}") from error
    members = archive.infolist()
    total = sum(member.file_size for member in members)
    if total > MAX_BYTES or len(members) > _MAX_MEMBERS:
        raise FileFormatError(
            f"{source.name} claims {len(members)} members and {total / _MB:.0f} MB unpacked; at most "
            f"{_MAX_MEMBERS} and {MAX_BYTES // _MB} MB are read"
        )
    return archive


def read_member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Unpack one member into memory, never beyond the size it claims.

    Raises
    ------
    FileFormatError
        If it is missing, damaged, encrypted or larger than it claims.
    """
    try:
        info = archive.getinfo(name)
        with archive.open(info) as stream:
            data = stream.read(info.file_size + 1)
    except KeyError as error:
        raise FileFormatError(f"the archive has no member {name!r:.80}") from error
    # zlib.error and struct-like faults come straight from the decompressors.
    except (
        zipfile.BadZipFile,
        zlib.error,
        OSError,
        EOFError,
        RuntimeError,
        NotImplementedError,
        ValueError,
    ) as error:
        raise FileFormatError(f"archive member {name!r:.80} is damaged: {error}") from error
    if len(data) > info.file_size:
        raise FileFormatError(f"archive member {name!r:.80} is larger than it claims")
    return data


def unpack(source: Source) -> list[Source]:
    """Return the files in a plain archive as sources, or the source itself where it is not one.

    Spreadsheets and JPK files are archives too, but not plain ones. Archives within archives are left.

    Raises
    ------
    FileFormatError
        If the archive is damaged, too large, or holds no file.
    """
    if not source.is_zip or source.member:
        return [source]
    with open_zip(source) as archive:
        # Not ZipInfo.is_dir(), which fails on a member without a name.
        names = [info.filename for info in archive.infolist() if not info.filename.endswith("/")]
        if _OFFICE_MEMBER in names or _JPK_MEMBER in names:
            return [source]
        if not names:
            raise FileFormatError(f"{source.name} is an empty archive")
        # Names are labels only: nothing is ever written, so "../" in one leads nowhere.
        members = [Source(source.path, read_member(archive, name), source.sha256, name) for name in names]
    return [member for member in members if member.data]
