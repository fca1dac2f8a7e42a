"""The manifest of a map: every curve's file, name, position, labels and own numbers of the scene.

A manifest is a table with one row per curve. ``file`` names the curve; ``name``, ``x`` and ``y`` are optional;
``animal``, ``group`` and other labels group curves (any name followed by ``(label)`` is a label); any other column
is a parameter path (``layer.thickness``) or one of the short names ``thickness`` and ``radius``. In a file, lengths
and moduli carry units, in the header (``thickness (mm)``) or in the cell (``1.5 mm``). In a table made in Python a
bare number is SI.
"""

from __future__ import annotations

import difflib
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from underlay._csv import numbered_rows
from underlay._door import FileKind, printable, read_start, read_text, understood
from underlay.data.readers._source import load
from underlay.data.readers.workbooks import OLE_MAGIC, sheets_of
from underlay.errors import InputError, UnderlayError
from underlay.inference.batch.results_table import RESERVED
from underlay.quantities import kind_of
from underlay.scene.parameters import unknown_parameter
from underlay.scene.scene import Scene
from underlay.units import kind_of as unit_kind
from underlay.units import parse_quantity

# Names of columns: short names of parameters, names of the file, of a position, and all of these without a path.
_SHORT = {"thickness": "layer.thickness", "radius": "indenter.radius"}
_FILE = ("file", "path", "curve")
_PLACES = ("x", "y")
_WORDS = (*_FILE, "name", *_PLACES)
# Usual names of groups and of the sources of curves; any other label is marked with "(label)".
_LABELS = frozenset(
    {
        *("group", "treatment", "condition", "animal", "donor", "patient", "subject", "joint", "organ"),
        *("sample", "specimen", "dish", "cell", "site", "region", "day", "batch"),
    }
)
_LABEL, _REMARK = "label", "remark"
# Similarity (difflib) from which an unknown word is taken as a misspelling of a known one ("thicknes": 0.94).
_SLIP = 0.8
# Name of a column, with a unit or a mark in brackets.
_HEADER = re.compile(r"\s*(?P<name>[^()\[\]]+?)\s*(?:[(\[]\s*(?P<unit>[^()\[\]]*?)\s*[)\]])?\s*")
# Bytes that a manifest may have: a million curves with ten numbers each.
_KIND = FileKind("a manifest (CSV)", 256_000_000, "it needs a row of names with 'file', and a row per curve")
# Largest number of columns, and of characters of a cell, that are read.
_MOST_COLUMNS, _LONGEST_CELL = 1000, 1000
# Largest number of names that a message lists.
_LISTED = 5


@dataclass(frozen=True)
class Entry:
    """One row of a manifest: file and name of a curve, position (m), numbers of its scene (SI), labels."""

    file: str
    name: str = ""
    x: float | None = None
    y: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Manifest:
    """The rows of a manifest by curve.

    `entries` has one `Entry` for each file named, `paths` and `labels` are the parameter paths and labels that have
    columns, and `source` names the manifest in messages.
    """

    entries: Mapping[str, Entry]
    paths: tuple[str, ...]
    source: str
    labels: tuple[str, ...] = ()

    def for_curves(self, names: Sequence[str]) -> list[Entry]:
        """One entry per curve, in the order of `names`.

        Raises
        ------
        InputError
            If a row has no curve or a curve no row.
        """
        keys = self._keys(names)
        missing = [name for name in names if keys[name] not in self.entries]
        known = set(keys.values())
        extra = [file for file in self.entries if file not in known]
        if missing:
            raise InputError(
                f"{self.source} has no row for {_listed(missing)}: add a row, or take the curve out"
            )
        if extra:
            raise InputError(f"{self.source} names {_listed(extra)}, but there is no such curve")
        return [self.entries[keys[name]] for name in names]

    def _keys(self, names: Sequence[str]) -> dict[str, str]:
        """The key of each curve's row: its whole name, or the part after the last slash where that is unique."""
        short = Counter(_last(name) for name in names)
        return {
            name: _last(name) if name not in self.entries and short[_last(name)] == 1 else name
            for name in names
        }


def read_manifest(
    manifest: str | os.PathLike[str] | pd.DataFrame | Sequence[Mapping[str, Any]], scene: Scene
) -> Manifest:
    """Read and check a manifest.

    Parameters
    ----------
    manifest : path, DataFrame, or sequence of mappings
        A CSV file (or one with tabs or semicolons), an Excel workbook, or a table in memory with SI numbers.
    scene : Scene
        What the curves have in common; with the numbers of each row it must be a possible scene.

    Raises
    ------
    FileAccessError, FileFormatError
        If the file cannot be read, or is no table.
    InputError
        If a column is unknown, a unit is missing, a file is named twice, or the numbers of a row make no possible
        scene; the message says which row.
    """
    if isinstance(manifest, str | os.PathLike):
        source, frame, from_file = printable(Path(manifest).name), _read(Path(manifest)), True
    else:
        source, frame, from_file = "the manifest", pd.DataFrame(manifest), False
    columns = [_column(str(name), scene, source) for name in frame.columns]
    twice = [name for name, count in Counter(column.name for column in columns).items() if count > 1]
    if twice:
        raise InputError(f"{source} has two columns for {twice[0]!r}")
    if not any(column.name == "file" for column in columns):
        raise InputError(f"{source} has no column 'file' that says which curve each row belongs to")
    if frame.empty:
        raise InputError(f"{source} has no rows")
    entries: dict[str, Entry] = {}
    names: dict[str, int] = {}
    rows = zip(*(frame.iloc[:, i].tolist() for i in range(len(columns))), strict=True)
    for number, cells in zip(frame.index, rows, strict=True):
        where = f"{source}, {'line' if from_file else 'row'} {number}"
        entry = _entry(columns, cells, where, from_file=from_file)
        if entry.file in entries:
            raise InputError(f"{where}: {entry.file!r} has a row already; each curve has one")
        if entry.name in names:
            raise InputError(f"{where}: the name {entry.name!r} is taken by row {names[entry.name]}")
        if entry.name:
            names[entry.name] = number
        try:
            scene.with_values(entry.values)
        except UnderlayError as error:
            raise InputError(f"{where} ({entry.file}): {error}") from error
        entries[entry.file] = entry
    paths = tuple(column.name for column in columns if "." in column.name)
    labels = tuple(column.name for column in columns if column.unit in (_LABEL, _REMARK))
    return Manifest(entries, paths, source, labels)


@dataclass(frozen=True)
class _Column:
    name: str
    unit: str


def _read_workbook(path: Path) -> pd.DataFrame:
    """The first sheet of an Excel workbook that has a column ``file``, as a table of text."""
    with understood(path.name, _KIND):
        for sheet in sheets_of(load(path)):
            rows = [(number, row) for number, row in enumerate(sheet.rows, start=1) if any(row)]
            at = next(
                (i for i, (_, row) in enumerate(rows) if set(_FILE) & {cell.lower() for cell in row}), None
            )
            if at is None:
                continue
            names = list(rows[at][1])
            while names and not names[-1]:
                names.pop()
            below = [(number, (row + [""] * len(names))[: len(names)]) for number, row in rows[at + 1 :]]
            return pd.DataFrame([cells for _, cells in below], index=[n for n, _ in below], columns=names)
        raise ValueError("no sheet has a column 'file' that says which curve each row belongs to")


def _read(path: Path) -> pd.DataFrame:
    if read_start(path, 8).startswith((b"PK\x03\x04", OLE_MAGIC)):
        return _read_workbook(path)
    text = read_text(path, _KIND)
    head = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    separator = max((",", ";", "\t"), key=head.count)
    with understood(path.name, _KIND):
        (_, names), *rows = numbered_rows(text, _MOST_COLUMNS, separator, comment="#")
        longest = max(len(cell) for cells in (names, *(cells for _, cells in rows)) for cell in cells)
        if longest > _LONGEST_CELL:
            raise ValueError(f"a cell of {longest} characters")
    return pd.DataFrame([cells for _, cells in rows], index=[line for line, _ in rows], columns=names)


def _column(header: str, scene: Scene, source: str) -> _Column:
    match = _HEADER.fullmatch(header)
    if match is None:
        raise InputError(f"{source}: column {header!r} is not a name with a unit, such as 'thickness (mm)'")
    name, unit = match["name"], match["unit"] or ""
    if name in _FILE:
        return _Column("file", "")
    if name in _WORDS:
        return _Column(name, unit)
    if unit == _LABEL and (name in RESERVED or "." in name):
        raise InputError(
            f"{source}: a label cannot be called {name!r}; the table has such a column of its own"
        )
    if unit == _LABEL or (name in _LABELS and not unit):
        return _Column(name, _LABEL)
    path = _SHORT.get(name, name)
    if path in scene.parameters:
        return _Column(path, unit)
    if "." in path:
        error = unknown_parameter(path, scene.parameters)
        raise InputError(f"{source}, column {header!r}: {error}")
    near = difflib.get_close_matches(name, [*_WORDS, *_SHORT], n=1, cutoff=_SLIP)
    # Any further column is a label, which a row may leave empty.
    if not near and name not in RESERVED and (not unit or unit_kind(unit) is None):
        return _Column(" ".join(header.split()), _REMARK)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise InputError(
        f"{source} has an unknown column {header!r}{hint} Known are {', '.join(_WORDS)}, {', '.join(_SHORT)}, "
        "every parameter path, such as layer.thickness, and labels: 'animal', 'group' and the like, or any "
        f"'{name} (label)'"
    )


def _without(where: str, column: _Column, texts: Mapping[str, str]) -> str:
    """Say that a row has an empty cell, with the file of the row where that is known."""
    which = f" for {texts['file']}" if texts.get("file") else ""
    return f"{where}: no {column.name}{which}; every row needs one, or leave the column out"


def _entry(columns: Sequence[_Column], cells: Sequence[Any], where: str, *, from_file: bool) -> Entry:
    texts: dict[str, str] = {}
    numbers: dict[str, float] = {}
    for column, cell in zip(columns, cells, strict=True):
        blank = bool(pd.isna(cell)) or (isinstance(cell, str) and not cell.strip())
        if column.name in ("file", "name") or column.unit in (_LABEL, _REMARK):
            if blank and column.unit == _LABEL:
                raise InputError(_without(where, column, texts))
            texts[column.name] = "" if blank else str(cell).strip()
        elif not blank:
            try:
                numbers[column.name] = _number(cell, column, from_file=from_file)
            except UnderlayError as error:
                raise InputError(f"{where}, column {column.name}: {error}") from error
        elif column.name not in _PLACES:
            raise InputError(_without(where, column, texts))
    if not texts["file"]:
        raise InputError(f"{where}: no file")
    x, y = numbers.pop("x", None), numbers.pop("y", None)
    labels = {column.name: texts[column.name] for column in columns if column.unit in (_LABEL, _REMARK)}
    file = texts["file"].replace("\\", "/").removeprefix("./")
    return Entry(file, texts.get("name", ""), x, y, numbers, labels)


def _number(cell: Any, column: _Column, *, from_file: bool) -> float:
    kind = "length" if column.name in _PLACES else kind_of(column.name)
    if isinstance(cell, str):
        text = cell.strip()
        bare = re.fullmatch(r"[-+0-9.eE]+", text) is not None
        return parse_quantity(f"{text} {column.unit}" if bare and column.unit else text, kind)
    if column.unit:
        return parse_quantity(f"{float(cell)!r} {column.unit}", kind)
    if from_file:
        return parse_quantity(cell, kind)
    return float(cell)


def _last(name: str) -> str:
    return name.rpartition("/")[2]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(repr(name) for name in names[:_LISTED]) + more
