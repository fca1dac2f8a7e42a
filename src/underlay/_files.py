"""Writes files atomically: completely or not at all."""

from __future__ import annotations

import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from underlay.errors import FileAccessError


def write_atomic(path: str | os.PathLike[str], content: str | bytes) -> Path:
    r"""Write `content` to `path` completely or not at all; see `replacing`.

    Text is written as UTF-8. A byte of a file name that is no UTF-8, which Python keeps as a lone surrogate,
    becomes an escape such as ``\udce9``: in JSON that is the character itself.

    Raises
    ------
    FileAccessError
        If the file cannot be written; nothing is left behind.
    """
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with replacing(path) as file:
        file.write(data)
    return Path(path)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a temporary file that replaces `path` once it is complete, so that no reader sees a part of it.

    An existing file's permissions are kept; a new one has those of the user's umask. A symbolic link is replaced,
    never written through: nothing outside the folder of `path` changes.

    Raises
    ------
    FileAccessError
        If the folder does not exist or cannot be written, or `path` is a folder, a device or a pipe. The file is
        then as it was, and no temporary file is left.
    """
    target = Path(path)
    # A short temporary name: the target's may have the maximal length already.
    temporary = target.parent / f".underlay-{secrets.token_hex(8)}"
    try:
        mode = _mode_of(target)
        with _new_file(temporary, mode) as file:
            try:
                yield file
                file.flush()
                os.fsync(file.fileno())
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
        _move(temporary, target)
    except OSError as error:
        raise FileAccessError(f"cannot write {target}: {error.strerror or error}") from error


def _mode_of(target: Path) -> int | None:
    """Return the permissions of a file that will be replaced; None where there is none, or a link."""
    try:
        there = target.stat()
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(there.st_mode):
        raise OSError("it is there, and is no regular file")
    return None if target.is_symlink() else stat.S_IMODE(there.st_mode) & 0o777


def _new_file(path: Path, mode: int | None) -> BinaryIO:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    # The system applies the umask to 0666; reading the umask would change it for every thread.
    number = os.open(path, flags, 0o666 if mode is None else mode)
    try:
        if mode is not None:
            path.chmod(mode)
    except OSError:
        os.close(number)
        path.unlink(missing_ok=True)
        raise
    return os.fdopen(number, "wb")


def _move(temporary: Path, target: Path) -> None:
    try:
        temporary.replace(target)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        raise


def require_own_folder(path: Path) -> Path:
    """Make a folder inside an output, as `require_writable_folder` does, but refuse a symbolic link.

    Raises
    ------
    FileAccessError
        If it is a link, which would lead out of the output, or cannot be written.
    """
    if path.is_symlink():
        raise FileAccessError(f"cannot write into {path}: it is a link to another place; remove it")
    return require_writable_folder(path)


def require_writable_folder(path: str | os.PathLike[str]) -> Path:
    """Make the folder `path` if it does not exist, and check that files can be written into it.

    Raises
    ------
    FileAccessError
        If it is a file, cannot be made or cannot be written.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise FileAccessError(f"cannot write into folder {folder}: {error.strerror or error}") from error
    return folder
