"""The option --excel: refused before the work where it could not be met after it."""

from __future__ import annotations

from pathlib import Path

from underlay._files import require_writable_folder
from underlay.errors import InputError

__all__ = ["require_excel"]


def require_excel(path: Path) -> None:
    """Refuse a file that could not be written at the end.

    Raises
    ------
    InputError
        If it does not end in .xlsx.
    MissingExtraError
        If the extra ``excel`` is not installed.
    FileAccessError
        If its folder cannot be written.
    """
    from underlay.report.spreadsheet import excel_library

    if path.suffix.lower() != ".xlsx":
        raise InputError(f"--excel must end in .xlsx; got {path.name!r}")
    excel_library()
    require_writable_folder(path.parent)
