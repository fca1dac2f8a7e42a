"""The bytes of an instrument file: taken in once, of bounded size, and from a regular file only."""

from __future__ import annotations

import hashlib
import math
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from underlay._door import FileKind, PathLike, printable, read_bytes, read_member, unpacked
from underlay._door import open_zip as bounded_zip
from underlay._text import names_there
from underlay.errors import FileFormatError

_Value = TypeVar("_Value")
_MB = 1_000_000
#: Largest file, and largest total of what an archive holds, in bytes.
MAX_BYTES = 256 * _MB
#: Largest text: lines and numbers take about four times the bytes while they are parsed.
MAX_TEXT_BYTES = 64 * _MB
#: What the door is told of a file of curves.
CURVES = FileKind("a file of curves", MAX_BYTES, "export it again, or split it into one file per test")
#: How much of a file all formats but those with long headers look at, in bytes.
HEAD = 65_536
#: Longest header of a file or of a part of it, in bytes (80 kB were seen), and most entries, lines or waves of one,
#: or curves that are read at once (a map of 128 by 128 has 16,384).
LONGEST_HEADER, MOST_PARTS = 4_000_000, 50_000
#: How many things of one kind a message or the notes of a curve name.
LISTED = 5
#: Rows at either end of a table that tell what it holds.
SHOWN = 200
# Of a text in UTF-8.
_MARK = b"\xef\xbb\xbf"
# Of a text in UTF-16, and how many of its letters tell one that lacks it.
_WIDE_MARKS, _WIDE_LETTERS = (b"\xff\xfe", b"\xfe\xff"), 512
_NOT_IN_TEXT = frozenset(range(32)) - frozenset(b"\t\n\r\f")
# How an archive says it is something else than a folder of instrument files.
_OFFICE_MEMBER = "[Content_Types].xml"
_JPK_MEMBER = "header.properties"
# What systems and people put beside curves: names of folders and files, and the first bytes of pictures.
_NO_CURVES = frozenset(("thumbs.db", "desktop.ini"))
_FOLDERS = frozenset(("__macosx", ".git", "__pycache__"))
_PICTURES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"%PDF", b"II*\0", b"MM\0*", b"BM", b"{\\rtf")
_TEXTS = (".md", ".rtf", ".html", ".htm", ".toml", ".py", ".m", ".doc", ".docx", ".xml", ".yml", ".yaml")


@dataclass(frozen=True)
class Source:
    """One file, or one member of an archive, in memory.

    Parameters
    ----------
    path : Path
        The file on disk.
    data : bytes
        Its content, or that of the member; UTF-16 text without a byte-order mark gets one in front.
    sha256 : str
        Hash of the file on disk.
    member : str
        Name inside the archive; empty for a plain file.
    """

    path: Path
    data: bytes
    sha256: str
    member: str = ""

    @cached_property
    def name(self) -> str:
        """Name of the file, and of the member inside it, for messages."""
        return printable(f"{self.path.name}!{self.member}" if self.member else self.path.name)

    def wrong(self, message: str) -> FileFormatError:
        """Return, not raise, the error whose text is the name of the file followed by `message`."""
        return FileFormatError(f"{self.name}{'' if message[0] in ',:' else ' '}{message}")

    def require(self, condition: object, message: str) -> None:
        """Refuse the file unless `condition` holds.

        Raises
        ------
        FileFormatError
            With the name of the file and `message`.
        """
        if not condition:
            raise self.wrong(message)

    def given(self, value: _Value | None, message: str) -> _Value:
        """Return a value that the file must have; FileFormatError with `message` where it is None."""
        if value is None:
            raise self.wrong(message)
        return value

    def count(self, text: str, what: str, most: int = 10**12) -> int:
        """Return the whole number of a header entry, at most `most`; FileFormatError, which names `what`, else."""
        sound = text.isdecimal() and len(text) <= len(str(most)) and int(text) <= most
        self.require(sound, f": no whole number for {what}, or one above {most}; it says {text!r:.40}")
        return int(text)

    def number(self, text: str, what: str) -> float:
        """Return the finite number of a header entry; FileFormatError, which names `what`, else."""
        return self.given(finite(text), f": no number for {what}; it says {text!r:.40}")

    def array(self, kind: np.dtype[Any], count: int, at: int, what: str) -> NDArray[Any]:
        """Return `count` numbers from byte `at` on; FileFormatError, naming `what`, where the file ends before."""
        size = count * kind.itemsize
        sound = 0 <= at <= len(self.data) - size
        claim = f"{what} claims {size} bytes from byte {at} on, and the file has {len(self.data)}"
        self.require(sound, f"is cut short: {claim}")
        return np.frombuffer(self.data, kind, count, at)

    @property
    def is_zip(self) -> bool:
        """Whether it starts as a ZIP archive does."""
        return self.data[:4] in {b"PK\x03\x04", b"PK\x05\x06"}

    def head(self, size: int = 16_384) -> str:
        """Return the first `size` bytes as text, line ends unified, to recognise a format; '' if binary."""
        # Most formats ask for the same.
        if size not in self._heads:
            self._heads[size] = self._head(size)
        return self._heads[size]

    @cached_property
    def _heads(self) -> dict[int, str]:
        return {}

    def _head(self, size: int) -> str:
        if self.data[:2] in _WIDE_MARKS:
            start = self.data[:size]
            return start[: len(start) // 2 * 2].decode("utf-16", errors="ignore").replace("\r", "\n")
        if self.data.find(b"\0", 0, size) >= 0:
            return ""
        mark = len(_MARK) if self.data.startswith(_MARK) else 0
        whole = self._first if min(size, len(self.data)) <= HEAD else self._letters(size)
        return whole[: size - mark]

    @cached_property
    def _first(self) -> str:
        # Every format looks at it.
        return self._letters(HEAD)

    def _letters(self, size: int) -> str:
        return self.data[:size].removeprefix(_MARK).decode("latin-1").replace("\r", "\n")


def finite(text: str) -> float | None:
    """Return the finite number that a text is; None of any other text."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def curve_name(path: Path, number: int) -> str:
    """Return the name of a curve in a file of several: the file's name, and from the second curve on its number."""
    return path.stem if number == 1 else f"{path.stem}, curve {number}"


def load(path: PathLike) -> Source:
    """Read a regular file into memory.

    Raises
    ------
    FileAccessError
        If it is missing, unreadable, a directory, a pipe or another special file.
    FileFormatError
        If it is empty or larger than `MAX_BYTES`.
    """
    content = read_bytes(path, CURVES)
    file = Path(path)
    data = unpacked(content, file.name, MAX_BYTES)
    if not data:
        raise FileFormatError(f"{printable(file.name)} is empty")
    return Source(file, _with_mark(data), hashlib.sha256(content).hexdigest())


def _with_mark(data: bytes) -> bytes:
    """Put a byte-order mark before UTF-16 text that lacks it, which has NUL in every other byte."""
    start = data[: 2 * _WIDE_LETTERS]
    if b"\0" not in start or len(data) % 2 or start[:2] in _WIDE_MARKS:
        return data
    byte_orders = ((start[::2], start[1::2]), (start[1::2], start[::2]))
    for mark, (letters, high) in zip(_WIDE_MARKS, byte_orders, strict=True):
        # Nine in ten: some letters, such as a Greek mu, are not Latin.
        if high.count(0) >= 0.9 * len(high) and not _NOT_IN_TEXT.intersection(letters):
            return mark + data
    return data


def open_zip(source: Source) -> zipfile.ZipFile:
    """Open an archive in memory after checking what it claims to hold.

    Raises
    ------
    FileFormatError
        If it is damaged, or its members add up to more than `MAX_BYTES`.
    """
    return bounded_zip(source.data, source.name, MAX_BYTES)


def _is_no_curve(member: str, data: bytes) -> bool:
    """Whether a member of an archive is a picture, a readme, a system file or the like, and so no curve."""
    *folders, name = member.lower().split("/")
    known = (
        name in _NO_CURVES or name.startswith((".", "readme", "licence", "license")) or name.endswith(_TEXTS)
    )
    return known or bool(_FOLDERS.intersection(folders)) or data.startswith(_PICTURES)


def unpack(source: Source) -> tuple[list[Source], list[str]]:
    """Return the files in a plain .zip archive as sources, and notes on members that are left out.

    Any other file, also a workbook or a JPK file, which are archives too, comes back as the only source. Archives
    within archives are not unpacked. Pictures, descriptive texts and system files are left out.

    Raises
    ------
    FileFormatError
        If the archive is damaged, too large, or holds no file.
    """
    if not source.is_zip or source.member:
        return [source], []
    with open_zip(source) as archive:
        # Not ZipInfo.is_dir(), which fails on a member without a name.
        names = [info.filename for info in archive.infolist() if not info.filename.endswith("/")]
        if _OFFICE_MEMBER in names or _JPK_MEMBER in names:
            return [source], []
        if not names:
            raise FileFormatError(f"{source.name} is an empty archive")
        # Names are labels only: nothing is ever written, so "../" in one leads nowhere.
        contents = [(name, read_member(archive, name)) for name in names]
    kept = [(name, data) for name, data in contents if data and not _is_no_curve(name, data)]
    left_out = sorted({name for name, _ in contents} - {name for name, _ in kept})
    members = [
        Source(source.path, _with_mark(unpacked(data, name, MAX_BYTES)), source.sha256, name)
        for name, data in kept
    ]
    notes = [f"left out of the archive, no curves: {names_there(left_out)}"] if left_out else []
    return members, notes
