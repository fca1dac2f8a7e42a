"""Where the sample curves are: inside the installed package, or in the tree it was built from."""

from __future__ import annotations

from pathlib import Path

from underlay.errors import FileAccessError

__all__ = ["sample"]

_PACKAGE = Path(__file__).resolve().parents[1]
_FOLDERS = (_PACKAGE / "data_samples", _PACKAGE.parents[1] / "data_samples")


def sample(name: str) -> Path:
    """Return the path of a sample file.

    Raises
    ------
    FileAccessError
        If the installation lacks it.
    """
    for folder in _FOLDERS:
        if (folder / name).is_file():
            return folder / name
    places = " and ".join(map(str, _FOLDERS))
    raise FileAccessError(f"sample {name} is not in this installation; looked in {places}")
