"""Reads every file that comes in: curves, scenes, tables, results, chains. No other module opens a file to read it.

A file may come from an untrusted source. Here it is opened only if it is a regular file, so that no pipe is waited
for and no device read without end; it is read up to a size limit of its kind; and whatever error a parser raises on
its content (a number of 5000 digits, lists in lists, a false promise of a billion points) becomes one error of ours
that names the file and says what to do.

Archives in memory are limited by the sizes they declare, and these are enforced. JSON and TOML may not be nested or
long beyond reason, and hold no integer beyond 64 bits: Python's parsers accept a hundred thousand brackets, keys of
twenty thousand parts and integers of four thousand digits, on which code that walks, prints or converts the result
fails later.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import stat
import tomllib
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

from underlay._text import one_line
from underlay.errors import FileAccessError, FileFormatError, UnderlayError

PathLike: TypeAlias = str | os.PathLike[str]
_MB = 1_000_000
_PIECE, _LEAST = 16 * _MB, 65_536
# More members than any instrument archive of 256 MB holds (a JPK map has about 20 per point).
_MAX_MEMBERS = 400_000
_GZIP, _MOST_STREAMS = b"\x1f\x8b\x08", 8
# Our own files nest about ten deep; recursion on the result must stay far from Python's limit.
_DEEPEST = 50
# An empty list takes 60 bytes of memory for its two characters, so their number is limited too.
_MOST_CONTAINERS = 2_000_000
_LONGEST_INTEGER = 20  # digits: the largest of 64 bits has 20
_LONGEST_KEY = (
    16  # parts of a dotted key: a scene file has three, and the time of tomllib grows as their square
)
# Strings and comments of TOML, whose dots are not parts of a key. An unterminated one takes the rest, so that no
# text is scanned twice: tomllib refuses it anyway.
_TOML_TEXT = re.compile(
    r'"""(?:[^\\"]|\\.|"(?!""))*+(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)'
    r'|"(?:[^"\\\n]|\\[^\n])*+"?|\'[^\'\n]*+\'?|#[^\n]*+',
    re.DOTALL,
)
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_LONGEST_KEY}}}")
_LONG_NUMBER = re.compile(rf"(?<![\w.])\d[\d_]{{{_LONGEST_INTEGER},}}+(?![\w.])")


@dataclass(frozen=True)
class FileKind:
    """A kind of file, for size limits and messages.

    Parameters
    ----------
    name : str
        With its article, for messages: "a scene file".
    largest : int
        Size limit in bytes.
    advice : str
        What to do with one that is damaged or too large.
    """

    name: str
    largest: int
    advice: str


# Any file whose content is only hashed: the limit is above all others.
_ANY = FileKind("a file that is read here", 4096 * _MB, "split it first")


def read_bytes(path: PathLike, kind: FileKind) -> bytes:
    """Read a file.

    Raises
    ------
    FileAccessError
        If it is missing, unreadable, a directory, a pipe or another special file.
    FileFormatError
        If it is larger than its kind may be.
    """
    with _regular(path, kind) as stream:
        return b"".join(_pieces(stream, path, kind))


def read_text(path: PathLike, kind: FileKind) -> str:
    """Read a text file in UTF-8, with or without a byte order mark; see `read_bytes`.

    Raises
    ------
    FileAccessError, FileFormatError
        As `read_bytes`, or if it is no such text.
    """
    data = read_bytes(path, kind)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(
            f"{printable(path)} is not {kind.name}: byte {error.start} is not text in UTF-8; {kind.advice}"
        ) from error


def read_start(path: PathLike, size: int) -> bytes:
    """Return the first `size` bytes of a file, to recognise its format."""
    with _regular(path, None) as stream:
        return next(_pieces(stream, path, _ANY, size), b"")


def sha256_of(path: PathLike) -> str:
    """SHA-256 of a file, read in pieces."""
    digest = hashlib.sha256()
    with _regular(path, _ANY) as stream:
        for piece in _pieces(stream, path, _ANY):
            digest.update(piece)
    return digest.hexdigest()


def require_regular(path: PathLike, kind: FileKind | None = None) -> None:
    """Raise an error for a path that is no regular file or too large, for libraries that open a path themselves.

    Raises
    ------
    FileAccessError, FileFormatError
        As `read_bytes`.
    """
    with _regular(path, kind):
        pass


@contextmanager
def opened(path: PathLike) -> Iterator[io.FileIO]:
    """Open a regular file of any size, for a format that is read in place, piece by piece.

    Raises
    ------
    FileAccessError
        As `read_bytes`.
    """
    with _regular(path, None) as stream:
        yield stream


@contextmanager
def understood(name: PathLike, kind: FileKind) -> Iterator[None]:
    """Context that converts any exception from parsing a file's content to a `FileFormatError`.

    Only parsing belongs inside: an exception there is taken as a fault of the file.

    Parameters
    ----------
    name : str or path
        Name of the file in the message.
    kind : FileKind
        What kind of file is expected.

    Raises
    ------
    FileFormatError
        For every exception that is not one of ours.
    """
    try:
        yield
    except FileFormatError as error:
        if printable(os.path.basename(name)) in str(error):  # noqa: PTH119  of any kind of path
            raise
        raise FileFormatError(f"{printable(name)}: {error}; {kind.advice}") from error
    except UnderlayError:
        raise
    except Exception as error:
        raise FileFormatError(
            f"{printable(name)} is not {kind.name}, or damaged: {_in_words(error)}; {kind.advice}"
        ) from error


def printable(name: PathLike) -> str:
    """Return the name of a file as one line that can be printed and stored anywhere; see `one_line`."""
    return one_line(os.fspath(name))


@contextmanager
def _regular(path: PathLike, kind: FileKind | None) -> Iterator[io.FileIO]:
    """Open a file without waiting; raise an error, with the file closed, if it is not regular or too large."""
    try:
        # Without O_NONBLOCK, opening a FIFO waits for a writer for ever.
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        descriptor = os.open(path, flags)
    except (OSError, ValueError, TypeError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise FileAccessError(f"cannot open {_quoted(path)}: {reason}") from error
    status = os.fstat(descriptor)
    if stat.S_ISDIR(status.st_mode):
        os.close(descriptor)
        raise FileAccessError(f"cannot read {_quoted(path)}: it is a directory; name one file in it")
    with io.FileIO(descriptor, "rb") as stream:
        if not stat.S_ISREG(status.st_mode):
            raise FileAccessError(f"cannot read {_quoted(path)}: it is a pipe or device, not a file")
        if kind is not None and status.st_size > kind.largest:
            raise FileFormatError(_too_large(path, kind))
        yield stream


def _pieces(stream: io.FileIO, path: PathLike, kind: FileKind, size: int = -1) -> Iterator[bytes]:
    """Yield the content in pieces: `size` bytes in all, or all of it up to the limit of its kind."""
    left = kind.largest + 1 if size < 0 else size
    # Buffer for the size that the file reports; a larger file is read all the same.
    room = min(_PIECE, max(_LEAST, os.fstat(stream.fileno()).st_size + 1))
    while left > 0:
        try:
            piece = stream.read(min(left, room))
        except OSError as error:
            raise FileAccessError(f"cannot read {_quoted(path)}: {error.strerror or error}") from error
        if piece is None:  # some special files of the operating system return None
            raise FileAccessError(f"cannot read {_quoted(path)}: it is a pipe or device, not a file")
        if not piece:
            return
        left -= len(piece)
        if left <= 0 and size < 0:
            raise FileFormatError(_too_large(path, kind))
        yield piece


def _too_large(path: PathLike, kind: FileKind) -> str:
    return (
        f"{printable(path)} holds more than the {kind.largest / _MB:.0f} MB that are read of {kind.name}; "
        f"{kind.advice}"
    )


def _quoted(path: Any) -> str:
    return f"'{printable(path)}'" if isinstance(path, str | os.PathLike) else repr(path)[:200]


def _in_words(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"it lacks {printable(str(error))[:80]}"
    if isinstance(error, MemoryError):
        return "it claims more than fits into memory"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    text = printable(" ".join(str(error).split()))[:120]
    return text if text and isinstance(error, ValueError) else f"{type(error).__name__} {text}".strip()


def open_zip(data: bytes, name: str, largest: int) -> zipfile.ZipFile:
    """Open a ZIP archive after a check of the sizes that it declares.

    Parameters
    ----------
    data : bytes
        The archive.
    name : str
        Its name in a message.
    largest : int
        Largest total size in bytes of the unpacked members.

    Raises
    ------
    FileFormatError
        If it is damaged, or declares more than that.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except Exception as error:  # BadZipFile, struct.error, and whatever else a damaged directory causes
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
    """Unpack one member of an archive into memory, never beyond the size it declares.

    Parameters
    ----------
    archive : ZipFile
        The archive.
    name : str
        Of the member.
    largest : int, optional
        Largest size in bytes that it may declare.

    Raises
    ------
    FileFormatError
        If it is missing, damaged, encrypted, larger than it declares, or declares more than `largest`.
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
    except Exception as error:  # each decompressor has its own errors
        raise FileFormatError(f"archive member {shown!r} is damaged: {error!s:.120}") from error
    if len(data) > info.file_size:
        raise FileFormatError(f"archive member {shown!r} is larger than it claims")
    return data


def unpacked(data: bytes, name: str, largest: int) -> bytes:
    """Return the unpacked content of a gzip file (.gz), or any other content as it is.

    Parameters
    ----------
    data : bytes
        Content of the file.
    name : str
        Its name in a message.
    largest : int
        Largest unpacked size in bytes.

    Raises
    ------
    FileFormatError
        If it is damaged, or unpacks to more than that.
    """
    if not data.startswith(_GZIP):
        return data
    found, left = b"", data
    try:
        # A gzip file may hold several streams in a row; a million empty ones are not a file of curves.
        for _ in range(_MOST_STREAMS):
            if not left.startswith(_GZIP) or len(found) > largest:
                break
            stream = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
            found += stream.decompress(left, largest + 1 - len(found))
            if not stream.eof and len(found) <= largest:
                raise FileFormatError(f"{printable(name)} is compressed by gzip and cut short; copy it again")
            left = stream.unused_data
    except zlib.error as error:
        raise FileFormatError(
            f"{printable(name)} is compressed by gzip but damaged: {error!s:.120}"
        ) from error
    if len(found) > largest:
        raise FileFormatError(
            f"{printable(name)} unpacks to more than the {largest // _MB} MB that are read; split it first"
        )
    return found


def parse_json(text: str) -> Any:
    """Parse JSON, with limits on its nesting and size; for use inside `understood`.

    Raises
    ------
    ValueError, RecursionError
        If it is not JSON, or exceeds the limits.
    """
    if text.count("[") + text.count("{") > _MOST_CONTAINERS:
        raise ValueError(f"more than {_MOST_CONTAINERS} lists and tables")
    return _checked(json.loads(text, parse_int=_integer))


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML, with limits on the nesting of keys and tables; for use inside `understood`.

    Raises
    ------
    ValueError, RecursionError
        If it is not TOML, or exceeds the limits.
    """
    bare = _TOML_TEXT.sub("s", text)
    if _LONG_KEY.search(bare):
        raise ValueError(f"a key has more than {_LONGEST_KEY} parts")
    if _LONG_NUMBER.search(bare):
        raise ValueError(f"an integer of more than {_LONGEST_INTEGER} digits")
    document: dict[str, Any] = _checked(tomllib.loads(text))
    return document


def _integer(digits: str) -> int:
    if len(digits) > _LONGEST_INTEGER:
        raise ValueError(f"an integer of {len(digits)} digits")
    return int(digits)


def _checked(document: Any) -> Any:
    """Return a parsed document; raise ValueError if it is nested too deeply or has an integer beyond 64 bits."""
    level, deep = [document], 0
    while level:
        deep += 1
        if deep > _DEEPEST:
            raise ValueError(f"nested more than {_DEEPEST} deep")
        below: list[Any] = []
        for part in level:
            below += _containers(part)
        level = below
    return document


def _containers(part: Any) -> Iterator[Any]:
    values = part.values() if isinstance(part, dict) else part if isinstance(part, list) else (part,)
    for value in values:
        if isinstance(value, dict | list):
            yield value
        elif type(value) is int and abs(value) >> 64:
            raise ValueError("an integer beyond 64 bits")
