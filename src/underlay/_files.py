"""Files written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from underlay.errors import FileAccessError

__all__ = ["require_writable_folder", "write_atomic"]


def write_atomic(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Write `content` to `path` through a temporary file beside it, so that no reader sees a part of it.

    Raises
    ------
    FileAccessError
        If the folder does not exist or cannot be written; nothing is left behind.
    """
    target = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    temporary: str | None = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(target)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise FileAccessError(f"cannot write {target}: {error.strerror or error}") from error
    return target


def require_writable_folder(path: str | os.PathLike[str]) -> Path:
    """Make the folder `path` if need be and make sure that files can be written into it.

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
