"""The folder that a command writes its results into: made before it computes, and gone if nothing was written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from underlay._files import require_writable_folder

__all__ = ["ready_folder", "without_empty_folders"]

# Folders that the command at hand has made, innermost first.
_made: ContextVar[list[Path] | None] = ContextVar("made", default=None)


def ready_folder(path: Path) -> Path:
    """Make an output folder, so that a command that cannot write fails before it computes.

    Raises
    ------
    FileAccessError
        As `require_writable_folder`.
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    folder = require_writable_folder(path)
    made = _made.get()
    if made is not None:
        made.extend(missing)
    return folder


@contextmanager
def without_empty_folders() -> Iterator[None]:
    """Take away what `ready_folder` made and nothing was written into, as after input that is refused."""
    token = _made.set([])
    try:
        yield
    finally:
        for folder in _made.get() or []:
            # Only an empty folder can be removed so.
            with suppress(OSError):
                folder.rmdir()
        _made.reset(token)
