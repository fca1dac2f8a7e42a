"""The record of a map under way: rows are appended as they come, and what was appended is never lost.

Each line carries its own checksum, so a process may be killed at any byte: a line that was cut is found and
its curve fitted again, and nothing else is touched. The first line says what the run is (hashes of scene,
manifest and curves); a run is continued only by the same. The table that people read is made from it, whole.

    underlay-map 1 <crc> {"hashes": {...}, "columns": [...], "curves": 2000}
    <crc> <index> <row as CSV>
    ...
"""

from __future__ import annotations

import io
import json
import os
import sys
import zlib
from array import array
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from underlay.errors import FileAccessError, FileFormatError, InputError

if sys.platform != "win32":
    import fcntl

__all__ = ["Journal"]

_MARK = b"underlay-map 1 "
_ABSENT = -1


class Journal:
    """Rows of a map, one per curve, in an append-only file. A context manager.

    Parameters
    ----------
    path : Path
        The file.
    identity : mapping
        What the run is: ``hashes`` (mapping of what to SHA-256), ``columns``, ``curves`` (how many).
    resume : bool
        Continue the file if it is there. Otherwise it must not be there.

    Raises
    ------
    InputError
        If the file is there and `resume` is not set, or it belongs to another run, or another process is
        writing to it.
    FileFormatError
        If it is no such file.
    FileAccessError
        If it cannot be read or written.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], *, resume: bool) -> None:
        self.path = path
        self._offsets = array("q", [_ABSENT]) * int(identity["curves"])
        existed = path.exists()
        if existed and not resume:
            raise InputError(
                f"{path} holds a run already: continue it with resume (--resume), or choose another output"
            )
        try:
            # A new one is made, not found: a link of that name would lead out of the output.
            self._file = path.open("r+b" if existed else "x+b", buffering=0)
        except OSError as error:
            raise FileAccessError(f"cannot open {path}: {error.strerror or error}") from error
        try:
            self._lock()
            self._begin(identity)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    @property
    def done(self) -> int:
        """How many rows there are."""
        return len(self._offsets) - self._offsets.count(_ABSENT)

    def has(self, index: int) -> bool:
        """Whether the row of a curve is there."""
        return self._offsets[index] != _ABSENT

    def append(self, rows: Iterable[tuple[int, str]]) -> int:
        """Append rows (index, CSV text) with one write; return how many were new.

        Raises
        ------
        FileAccessError
            If the disk is full or gone; the file is then as it was before.
        """
        parts: list[bytes] = []
        starts: dict[int, int] = {}
        length = self._end
        for index, text in rows:
            if self.has(index) or index in starts:
                continue
            line = _line(f"{index} {text}")
            starts[index] = length
            length += len(line)
            parts.append(line)
        self._write(b"".join(parts))
        for index, start in starts.items():
            self._offsets[index] = start
        return len(starts)

    def sync(self) -> None:
        """Have the operating system put everything on the disk."""
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise FileAccessError(f"cannot write {self.path}: {error.strerror or error}") from error

    def lines(self) -> Iterator[str]:
        """Rows as CSV text, in the order of their curves."""
        with self.path.open("rb") as stream:
            for start in self._offsets:
                if start != _ABSENT:
                    stream.seek(start)
                    yield _content(stream.readline()).partition(" ")[2]

    def _lock(self) -> None:
        # Windows has no advisory locks of this kind: there, two runs into one output go unnoticed.
        if sys.platform != "win32":
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise InputError(f"another run is writing to {self.path}; wait for it, or end it") from error

    def _begin(self, identity: Mapping[str, Any]) -> None:
        """Write the first line, or check it and find the rows that are there."""
        first = _line(json.dumps(identity, sort_keys=True), _MARK)
        self._end = self._file.seek(0, os.SEEK_END)
        if self._end < len(_MARK):
            # New, or killed before its first words were written.
            self._end = 0
            self._file.truncate(0)
            self._write(first)
            return
        with self.path.open("rb", buffering=io.DEFAULT_BUFFER_SIZE) as stream:
            header = stream.readline()
            if header != first:
                if header and first.startswith(header):
                    self._end = 0
                    self._file.truncate(0)
                    self._write(first)
                    return
                self._refuse(header, identity)
            position = whole = len(header)
            for line in stream:
                self._find(line, position)
                position += len(line)
                whole = position if line.endswith(b"\n") else whole
        # A line that was cut short would spoil the next one.
        self._file.truncate(whole)
        self._end = whole

    def _find(self, line: bytes, position: int) -> None:
        content = _content(line)
        number = content.partition(" ")[0]
        if number.isdigit() and int(number) < len(self._offsets) and not self.has(int(number)):
            self._offsets[int(number)] = position

    def _refuse(self, header: bytes, identity: Mapping[str, Any]) -> None:
        content = _content(header.removeprefix(_MARK)) if header.startswith(_MARK) else ""
        if not content:
            raise FileFormatError(f"{self.path} is not the journal of a map; choose another output")
        old = json.loads(content)
        changed = [
            what for what, value in identity["hashes"].items() if old.get("hashes", {}).get(what) != value
        ]
        what = (
            f"the {' and the '.join(changed)} changed since"
            if changed
            else "other columns were asked for when"
        )
        raise InputError(
            f"{self.path} belongs to another run: {what} it was begun. Results of both in one table would "
            "mislead: put back what changed, or choose another output"
        )

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        try:
            self._file.seek(self._end)
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            self._file.truncate(self._end)
            raise FileAccessError(
                f"cannot write {self.path}: {error.strerror or error}; {self.done} curves are kept: make "
                "room and continue with resume (--resume)"
            ) from error
        self._end += len(data)


def _line(content: str, mark: bytes = b"") -> bytes:
    data = content.encode("utf-8", errors="backslashreplace")
    return mark + b"%08x " % zlib.crc32(data) + data + b"\n"


def _content(line: bytes) -> str:
    """Content of a whole line, or the empty string where it is damaged."""
    crc, _, data = line.removesuffix(b"\n").partition(b" ")
    intact = line.endswith(b"\n") and len(crc) == 8 and crc == b"%08x" % zlib.crc32(data)
    return data.decode("utf-8") if intact else ""
