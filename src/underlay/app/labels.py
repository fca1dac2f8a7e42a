"""Labels of the curves, such as animal and group, and checks of the commas that people type.

The labels are stored in a manifest of plain text, which `underlay map --manifest` reads as it is. A comma may
separate numbers or be part of one: `comma_problem` finds ambiguous ones, and `pairs_of` refuses them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from underlay._csv import csv_text, numbered_rows
from underlay._door import FileKind, read_text, understood
from underlay._files import write_atomic
from underlay._text import one_line, unguarded_cell
from underlay.app.folder import AnalysisFolder
from underlay.errors import InputError

# A comma with a digit on each side: of 0.45, of 45 thousand, or between 0 and 45.
_COMMA = re.compile(r"\d*,\d+(?:,\d+)*")
#: Columns that can be filled in on the page; a manifest that is brought may have others.
LABELS = ("animal", "group", "region")
#: Column of the curves that are on the bare substrate, beside the sample: they give its height and no modulus.
BARE = "bare substrate"
_KIND = FileKind("a manifest (CSV)", 20_000_000, "it needs a row of names with 'file', and a row per curve")
_MOST_COLUMNS, _LONGEST = 200, 80


def comma_problem(text: str, *, may_list: bool = True) -> str:
    """Return what is wrong with the commas in a number, or a list of numbers; empty if nothing is.

    Without `may_list`, any comma is wrong.

    Examples
    --------
    >>> comma_problem("0,45 MPa")
    "write numbers with a point, such as 0.45, and thousands without a comma; got '0,45'"
    >>> comma_problem("0.4, 0.3"), comma_problem("0.4,")
    ('', '')
    """
    found = _COMMA.search(text)
    if found is None and (may_list or "," not in text):
        return ""
    got = text.strip() if found is None else found[0]
    words = f"write numbers with a point, such as 0.45, and thousands without a comma; got {got[:40]!r}"
    listed = found is not None and may_list and "," in text.replace(found[0], "", 1)
    return f"{words}; where several numbers stand, put a space behind each comma" if listed else words


def pairs_of(text: str) -> dict[str, str]:
    """Parse name and value pairs from a text such as ``"depth = h (nm), force = F (mN)"``.

    Raises
    ------
    InputError
        If a part has no ``=``, or a number contains a comma.
    """
    wrong = comma_problem(text)
    if wrong:
        raise InputError(wrong)
    pairs = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InputError(
                f"write name = value, with commas between; got {part[:60]!r} (what holds a comma itself can be "
                "written in the test as text, step 2)"
            )
        pairs[name] = value
    return pairs


def read_labels(folder: AnalysisFolder) -> dict[str, dict[str, str]]:
    """Return the cells of the manifest by file and column; every curve has a row, even without a manifest."""
    rows: dict[str, dict[str, str]] = {path.name: {} for path in folder.curve_files()}
    path = folder.path / "manifest.csv"
    if not path.exists():
        return rows
    with understood(path, _KIND):
        lines = numbered_rows(read_text(path, _KIND), _MOST_COLUMNS, comment="#")
        _, names = next(lines)
        for _, cells in lines:
            row = {name: unguarded_cell(cell) for name, cell in zip(names, cells, strict=True)}
            file = row.pop("file", "")
            if file in rows:
                rows[file] = row
    return rows


def curves_on_sample(folder: AnalysisFolder) -> list[Path]:
    """Return the files of all curves except those marked as being on the bare substrate."""
    rows = read_labels(folder)
    return [path for path in folder.curve_files() if not rows[path.name].get(BARE)]


def label_columns(folder: AnalysisFolder) -> list[str]:
    """Return the columns of the manifest in which some curve has a label."""
    rows = read_labels(folder).values()
    return [
        name
        for name in dict.fromkeys(name for row in rows for name in row)
        if any(row.get(name) for row in rows)
    ]


def set_label(folder: AnalysisFolder, files: list[str], column: str, label: str) -> None:
    """Set a label of curves in one column.

    Where any curve has a label in it, curves without one get their file name as label.

    Raises
    ------
    InputError
        If the column is not one of `LABELS`.
    """
    if column not in LABELS:
        raise InputError(f"labels are {', '.join(LABELS)}; got {column!r}")
    rows = read_labels(folder)
    for file in files:
        if file in rows:
            rows[file][column] = one_line(label.strip(), _LONGEST)
    write_labels(folder, rows)


def take_manifest(folder: AnalysisFolder, content: bytes) -> None:
    """Store an uploaded manifest (CSV); `fit_many` checks it against the curves.

    Raises
    ------
    FileFormatError
        If it is no table with the column ``file``.
    """
    with understood("the manifest", _KIND):
        text = content.decode("utf-8-sig")
        _, names = next(numbered_rows(text, _MOST_COLUMNS, comment="#"))
        if "file" not in names:
            raise ValueError(f"it has no column 'file', but {', '.join(names)[:200]}")
    write_atomic(folder.path / "manifest.csv", content)


def write_labels(folder: AnalysisFolder, rows: dict[str, dict[str, str]]) -> None:
    """Write the cells of every curve, by file and column, as a manifest; delete it where all cells are empty."""
    path = folder.path / "manifest.csv"
    if text := manifest_text(rows):
        write_atomic(path, text)
    else:
        path.unlink(missing_ok=True)


def manifest_text(rows: Mapping[str, Mapping[str, str]], *, leave: str = "") -> str:
    """Return a manifest with the cells of curves, by file and column but one to `leave`; empty where all are empty.

    A curve without a label is its own animal, sample or the like; a place or a thickness that is not known stays
    empty.
    """
    columns = dict.fromkeys(name for row in rows.values() for name in row if name != leave)
    used = [name for name in columns if any(row.get(name) for row in rows.values())]
    table = [
        {"file": file, **{name: row.get(name) or (file if name in LABELS else "") for name in used}}
        for file, row in rows.items()
    ]
    return csv_text(pd.DataFrame(table)) if used else ""
