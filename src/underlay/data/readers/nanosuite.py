"""MTS, Agilent and KLA NanoSuite workbooks (.xls).

One sheet per test. Row 1 names, row 2 units, numbers below. The first column is a marker, filled only at
the first row of a segment (``Load Segment Type``, ``Hold Segment Type``, ``Unload From Peak Segment Type``,
``END``). The order of the columns differs between files, so they are found by name. Sheets without columns
for displacement and load are left out. Values such as 1.797e308 mean that there is none. Signs are as written:
displacement into the surface, load on the sample.

Where the stiffness was measured dynamically, the harmonic contact stiffness S = dP/dh stands in
``curve.columns["contact_stiffness"]``. A sheet with columns ``STANDARD DEVIATION (x)`` is an average of tests:
the deviations, the scatter of one test about the average, stand in ``depth_scatter``, ``force_scatter`` and
``contact_stiffness_scatter``. Averages come after the tests of a workbook.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, read_parts, with_note
from underlay.data.readers._source import Source
from underlay.data.readers._table import marked
from underlay.data.readers._text import column_factor, is_number, numbers
from underlay.data.readers.excel import Sheet, is_xls, padded, sheets_of
from underlay.errors import FileFormatError
from underlay.units import format_quantity

__all__ = ["FORMAT"]

_COLUMNS = {
    "depth": ("displacement into surface", "displacement", "indentation depth", "depth"),
    "force": ("load on sample", "load", "force"),
    "time": ("time on sample", "time"),
    "contact_stiffness": ("harmonic contact stiffness", "contact stiffness"),
}
_KINDS = {"depth": "length", "force": "force", "time": "time", "contact_stiffness": "stiffness"}
_DEVIATION = "standard deviation ({})"
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
    tests = [(sheet, found) for sheet in sheets_of(source) if (found := _find(sheet)) is not None]
    # Where the rows of some are marked, a sheet without marks is one of results.
    marked = any(_is_marked(sheet) for sheet, _ in tests)
    kept = [
        (sheet, found)
        for sheet, found in tests
        if not marked or _is_marked(sheet) or "force_scatter" in found
    ]
    if not kept:
        raise FileFormatError(f"{source.name} has no sheet with columns for displacement and load")
    curves = read_parts(
        [(f"sheet {sheet.name!r:.60}", partial(_curves, source, sheet, found)) for sheet, found in kept]
    )
    gone = [
        f"sheet {sheet.name!r:.60} is left out: no test, it has no marks of segments"
        for sheet, found in tests
        if (sheet, found) not in kept
    ]
    # Whoever counts tests counts the single ones first.
    return with_note(sorted(curves, key=lambda curve: "depth_scatter" in curve.columns), gone)


def _is_marked(sheet: Sheet) -> bool:
    return any(row and _MARKER.lower() in row[0].lower() for row in sheet.rows[2:])


def _curves(source: Source, sheet: Sheet, found: dict[str, int]) -> list[Curve]:
    return [_curve(source, sheet, found)]


def _find(sheet: Sheet) -> dict[str, int] | None:
    """Columns of a sheet that is a test or an average of tests, else None."""
    if len(sheet.rows) < 3:
        return None
    names = [cell.lower() for cell in sheet.rows[0]]
    found: dict[str, int] = {}
    for role, candidates in _COLUMNS.items():
        name = next((name for name in candidates if name in names), None)
        if name is None:
            continue
        found[role] = names.index(name)
        if (deviation := _DEVIATION.format(name)) in names and role != "time":
            found[f"{role}_scatter"] = names.index(deviation)
    return found if {"depth", "force"} <= found.keys() else None


def _curve(source: Source, sheet: Sheet, found: dict[str, int]) -> Curve:
    where = f"{source.name}, sheet {sheet.name!r}"
    units = [*sheet.rows[1], *[""] * len(sheet.rows[0])]
    rows = padded(
        [row for row in sheet.rows[2:] if row and (row[0].lower() != "end" or _is_reading(row, found))],
        {0, *found.values()},
    )
    if not rows:
        raise FileFormatError(f"{where} has no rows of numbers")
    table = numbers(rows, list(found.values()), where)
    columns = {
        role: table[:, j]
        * column_factor(units[at], _KINDS[role.removesuffix("_scatter")], sheet.rows[0][at], where)
        for j, (role, at) in enumerate(found.items())
    }
    segment = marked([row[0] for row in rows])
    scatter = columns.get("force_scatter")
    return make_curve(
        source,
        columns.pop("depth"),
        columns.pop("force"),
        columns.pop("time", None),
        segment,
        columns=columns,
        name=f"{source.path.stem}, sheet {sheet.name}{' (average of tests)' if scatter is not None else ''}",
        sheet=sheet.name,
        units={sheet.rows[0][at]: units[at] for at in found.values()},
        sign_rules={
            "depth": "displacement into the surface as written",
            "force": "load on the sample as written, positive in compression",
            "segment": "from the marker column" if segment is not None else "from the motion",
        },
        notes=_average_note(scatter),
    )


def _is_reading(row: Sequence[str], found: dict[str, int]) -> bool:
    return all(len(row) > found[role] and is_number(row[found[role]]) for role in ("depth", "force"))


def _average_note(scatter: FloatArray | None) -> tuple[str, ...]:
    if scatter is None or not np.isfinite(scatter).any():
        return ()
    typical = format_quantity(float(np.nanmedian(scatter)), "force")
    note = (
        f"an average of several tests, which scatter about it by {typical} in force (median): that is the noise "
        "of one test, kept for every point in curve.columns['force_scatter']"
    )
    return (note,)


FORMAT = Format(
    name="nanosuite",
    description="MTS, Agilent and KLA NanoSuite workbooks (.xls)",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
)
