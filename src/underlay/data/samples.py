"""Paths of the sample curves: in the installed package, or in the source tree."""

from __future__ import annotations

from pathlib import Path

from underlay.errors import FileAccessError

_PACKAGE = Path(__file__).resolve().parents[1]
_FOLDERS = (_PACKAGE / "data_samples", _PACKAGE.parents[1] / "data_samples")


def sample(name: str) -> Path:
    """Return the path of a sample file, by its name in the folder ``data_samples``.

    Raises
    ------
    FileAccessError
        If the installation lacks it.
    """
    for folder in _FOLDERS:
        if (folder / name).is_file():
            return folder / name
    raise FileAccessError(f"sample {name} is not in this installation; looked in {_places()}")


def samples(folder: str, ending: str) -> list[Path]:
    """Return the sample files of a folder whose names end in `ending`, sorted.

    Raises
    ------
    FileAccessError
        If the installation lacks them.
    """
    for place in _FOLDERS:
        found = sorted((place / folder).glob(f"*{ending}"))
        if found:
            return found
    raise FileAccessError(f"the samples {folder} are not in this installation; looked in {_places()}")


def _places() -> str:
    return " and ".join(map(str, _FOLDERS))
