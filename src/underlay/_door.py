"""The one door through which every file comes in: curves, scenes, tables, results, chains.

A file may come from anybody. Here it is opened only if it is a regular file, so that no pipe is waited for
and no device read without end; it is taken in up to a size that its kind states; and whatever the parser
behind the door makes of its content (a number of 5000 digits, lists in lists, a false promise of a billion
points) becomes one error of ours that names the file and says what to do. No other module opens a file to
read it.
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

from underlay._text import one_line
from underlay.errors import FileAccessError, FileFormatError, UnderlayError

__all__ = [
    "FileKind",
    "PathLike",
    "opened",
    "printable",
    "read_bytes",
    "read_start",
    "read_text",
    "require_regular",
    "sha256_of",
    "understood",
]

PathLike: TypeAlias = str | os.PathLike[str]

_MB = 1_000_000
_PIECE, _LEAST = 16 * _MB, 65_536


@dataclass(frozen=True)
class FileKind:
    """What a file is meant to be.

    Parameters
    ----------
    name : str
        With its article, for messages: "a scene file".
    largest : int
        Most bytes that are taken in.
    advice : str
        What to do with one that is damaged or too large.
    """

    name: str
    largest: int
    advice: str


# Any file whose content is only hashed: larger than all that is read.
_ANY = FileKind("a file that is read here", 4096 * _MB, "split it first")


def read_bytes(path: PathLike, kind: FileKind) -> bytes:
    """Take in a file.

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
    """Take in a text file in UTF-8, with or without its mark; see `read_bytes`.

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
    """Return the first `size` bytes of a file, to see what it is."""
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
    """Refuse what is no regular file or too large, for libraries that open a path themselves.

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
    """Turn whatever the code inside makes of a file's content into an error of ours.

    Only parsing belongs inside: what is raised there is taken for the file's fault.

    Parameters
    ----------
    name : str or path
        What the file is called in the message.
    kind : FileKind
        What it is meant to be.

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
    """Open a file without waiting on it, and close it again if it is not a regular one or too large."""
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
    """Content in pieces: never more than its kind may hold, whatever the file claimed or grows to."""
    left = kind.largest + 1 if size < 0 else size
    # Room for as much as the file says it holds; more of it is taken all the same.
    room = min(_PIECE, max(_LEAST, os.fstat(stream.fileno()).st_size + 1))
    while left > 0:
        try:
            piece = stream.read(min(left, room))
        except OSError as error:
            raise FileAccessError(f"cannot read {_quoted(path)}: {error.strerror or error}") from error
        if piece is None:  # some files of the operating system have nothing to say yet
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
    told = printable(" ".join(str(error).split()))[:120]
    return told if told and isinstance(error, ValueError) else f"{type(error).__name__} {told}".strip()
