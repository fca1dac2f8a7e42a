"""MTS, Agilent and KLA NanoSuite workbooks (.xls).

One sheet per test. Row 1 names, row 2 units, numbers below. The first column is a marker, filled only at
the first row of a segment (``Load Segment Type``, ``Hold Segment Type``, ``Unload From Peak Segment Type``,
``END``). The order of the columns differs between files, so they are found by name. Sheets of averages
(with ``STANDARD DEVIATION`` columns) and sheets without the columns are left out. Values such as
1.797e308 mean that there is none. Signs are as written: displacement into the surface, load on the sample.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve
from underlay.data.readers._sheets import Sheet, is_xls, sheets_of
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, numbers
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import FileFormatError

__all__ = ["FORMAT"]

_COLUMNS = {
    "depth": ("displacement into surface", "displacement", "indentation depth", "depth"),
    "force": ("load on sample", "load", "force"),
    "time": ("time on sample", "time"),
}
_KINDS = {"depth": "length", "force": "force", "time": "time"}
_MARKER = "Segment Type"
_LOAD_COLUMN = "Load On Sample"


def _sniff(source: Source) -> bool:
    if not is_xls(source):
        return False
    # Texts in the file are stored with one or with two bytes per letter.
    return any(
        text.encode(code) in source.data
        for text in (_MARKER, _LOAD_COLUMN)
        for code in ("latin-1", "utf-16-le")
    )


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    curves = []
    for sheet in sheets_of(source):
        found = _find(sheet)
        if found is not None:
            curves.append(_curve(source, sheet, found))
    if not curves:
        raise FileFormatError(f"{source.name} has no sheet with columns for displacement and load")
    return curves


def _find(sheet: Sheet) -> dict[str, int] | None:
    """Columns of a sheet that is a test, else None."""
    if len(sheet.rows) < 3:
        return None
    names = [cell.lower() for cell in sheet.rows[0]]
    if any("standard deviation" in name for name in names):
        return None
    found = {
        role: names.index(name)
        for role, candidates in _COLUMNS.items()
        for name in reversed(candidates)
        if name in names
    }
    return found if {"depth", "force"} <= found.keys() else None


def _curve(source: Source, sheet: Sheet, found: dict[str, int]) -> Curve:
    where = f"{source.name}, sheet {sheet.name!r}"
    units = [*sheet.rows[1], *[""] * len(sheet.rows[0])]
    rows = [row for row in sheet.rows[2:] if len(row) > max(found.values())]
    if not rows:
        raise FileFormatError(f"{where} has no rows of numbers")
    roles = list(found)
    table = numbers(rows, [found[role] for role in roles], where)
    columns = {
        role: table[:, j] * column_factor(units[found[role]], _KINDS[role], sheet.rows[0][found[role]], where)
        for j, role in enumerate(roles)
    }
    segment = _segments([row[0] for row in rows])
    return make_curve(
        source,
        columns["depth"],
        columns["force"],
        columns.get("time"),
        segment,
        name=f"{source.path.stem}, sheet {sheet.name}",
        sheet=sheet.name,
        units={sheet.rows[0][found[role]]: units[found[role]] for role in roles},
        sign_rules={
            "depth": "displacement into the surface as written",
            "force": "load on the sample as written, positive in compression",
            "segment": "from the marker column" if segment is not None else "from the motion",
        },
    )


def _segments(markers: Sequence[str]) -> NDArray[np.str_] | None:
    """Label the rows by the marker above them; None if a marker is not understood or there is none."""
    labels: list[str] = []
    current = LOADING  # rows above the first marker are the approach
    seen = False
    for marker in markers:
        text = marker.lower()
        if text and text != "end":
            seen = True
            if "unload" in text:
                current = UNLOADING
            elif "hold" in text:
                current = HOLD
            elif "load" in text or "approach" in text:
                current = LOADING
            else:
                return None
        labels.append(current)
    return np.array(labels, dtype="<U9") if seen else None


FORMAT = Format(
    name="nanosuite",
    description="MTS, Agilent and KLA NanoSuite workbooks (.xls)",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
)
