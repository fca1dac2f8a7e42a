"""HDF5 files of many curves, curve by curve: a list of what the file holds, and each curve as a file of its own.

Such a file may be larger than memory. Its root is listed once; whoever then reads a curve opens the file, copies
the group of that curve, and hands it to the reader of single curves, which checks it as it checks any file.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from underlay._door import opened
from underlay.data.export import HDF5_MARK
from underlay.data.readers._hdf5 import HDF5_MAGIC, check_group
from underlay.data.readers._source import Source
from underlay.errors import FileFormatError

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
    """

    path: Path
    sha256: str
    number: int
    group: str
    name: str

    def source(self) -> Source:
        """Read this curve as a file of its own.

        Raises
        ------
        FileAccessError
            If the file cannot be read.
        FileFormatError
            If it is damaged, its group leads out of the file, or claims more than is read of one file.
        """
        alone = io.BytesIO()
        h5py: Any = import_module("h5py")
        with _hdf5(self.path) as file, h5py.File(alone, "w") as copy:
            if self.group not in file:
                raise FileFormatError(f"{self.path.name} holds no curve {self.number} any more")
            check_group(self.path.name, file, (self.group,))
            for key, value in file.attrs.items():
                copy.attrs[key] = value
            file.copy(file[self.group], copy, name=self.group)
        return Source(self.path, alone.getvalue(), self.sha256)


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
        with _hdf5(file) as content:
            own = bytes(content.attrs.get("format", b"")) == HDF5_MARK.encode()
            groups = [name for name in content if name.isdigit()]
    except (ImportError, FileFormatError):
        # Whoever reads the whole file says what is wrong with it.
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


@contextmanager
def _hdf5(path: Path) -> Iterator[Any]:
    """Open an HDF5 file on the disk."""
    h5py: Any = import_module("h5py")
    with opened(path) as stream:
        try:
            with h5py.File(stream, "r") as file:
                yield file
        except FileFormatError:
            raise
        except Exception as error:  # h5py raises OSError, KeyError, RuntimeError and more on damaged files
            raise FileFormatError(
                f"{path.name} is a damaged HDF5 file: {type(error).__name__}: {error!s:.120}"
            ) from error
