"""HDF5 files of many curves, curve by curve: a list of what the file holds, and each curve as a source of its own.

Such a file may be larger than memory. Its root is listed once; whoever then reads a curve opens the file, or has it
open from the curve before, and reads the group of that curve alone, in place, checked as any file is.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from underlay._door import opened
from underlay.data.export import HDF5_MARK
from underlay.data.readers._hdf5 import HDF5_MAGIC, GroupSource, KeptOpen

__all__ = ["Hdf5MapCurve", "curves_of_hdf5"]


@dataclass(frozen=True)
class Hdf5MapCurve:
    """One curve of an HDF5 file on the disk.

    Parameters
    ----------
    path : Path
        The file.
    sha256 : str
        Of the file.
    number : int
        Which curve, counted from 1.
    group : str
        Its group.
    name : str
        What the curve is called where the whole file is read; empty where its group says it.
    kept : KeptOpen or None
        What keeps the file open for the next curve, where they are read one after the other.
    """

    path: Path
    sha256: str
    number: int
    group: str
    name: str
    kept: KeptOpen | None = None

    def source(self) -> GroupSource:
        """What the readers take for a file of this curve alone."""
        known = HDF5_MAGIC if self.name else HDF5_MAGIC + HDF5_MARK.encode()
        return GroupSource(self.path, known, self.sha256, group=self.group, kept=self.kept)


def curves_of_hdf5(path: str | os.PathLike[str]) -> list[Hdf5MapCurve]:
    """List the curves of an HDF5 file without reading them; none where it is no HDF5 file, or h5py is missing.

    Raises
    ------
    FileAccessError
        If the file cannot be read, or is no regular file.
    """
    file = Path(path)
    with opened(file) as stream:
        if stream.read(len(HDF5_MAGIC)) != HDF5_MAGIC:
            return []
        stream.seek(0)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    try:
        h5py: Any = import_module("h5py")
        with opened(file) as stream, h5py.File(stream, "r") as content:
            own = bytes(content.attrs.get("format", b"")) == HDF5_MARK.encode()
            groups = [name for name in content if name.isdigit()]
    except Exception:  # noqa: BLE001  h5py raises OSError, RuntimeError and more; whoever reads the whole file says why
        return []
    if own:
        groups.sort(key=int)
    resolved = file.resolve()
    return [
        Hdf5MapCurve(resolved, sha256, number, group, "" if own else _name(file, number))
        for number, group in enumerate(groups, start=1)
    ]


def _name(path: Path, number: int) -> str:
    return path.stem if number == 1 else f"{path.stem}, curve {number}"
