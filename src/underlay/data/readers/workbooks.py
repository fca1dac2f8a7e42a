"""Workbooks, .xls and .xlsx: plain tables in sheets, KLA NanoSuite and Zwick/Roell testXpert.

`sheets_of` reads the sheets as rows of text, bounded in size. As a plain table, a sheet is read if it has a row
that names a depth and a force, with units in it or in the row below, or the columns that a mapping names. Each such
sheet is one test. Signs are taken as written.

NanoSuite (MTS, Agilent, KLA; .xls) has a sheet per test: names, units, then numbers, in any order of columns. The
first column is a marker, filled only at the first row of a segment (``Load Segment Type``, ..., ``END``). Where the
stiffness was measured dynamically, the harmonic contact stiffness S = dP/dh stands in
``curve.columns["contact_stiffness"]``. A sheet with columns ``STANDARD DEVIATION (x)`` is an average of tests: the
deviations, the scatter of one test about the average, stand in ``depth_scatter``, ``force_scatter`` and
``contact_stiffness_scatter``, and averages come after the tests of a workbook.

testXpert (.xlsx, .xls) has sheets of parameters, results and statistics, then one per specimen: its name repeated,
a row of names in the machine's language, a row of units (s, N, mm, mm), and numbers. A table of results has a row
of units too (N, mm), but its rows are specimens: its first column holds their names and has no unit. Depth is the
travel of the crosshead, turned if the gap between the tools does not close with it.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np

from underlay._door import read_member
from underlay._text import names_there, one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import (
    CLOSURE,
    Columns,
    Options,
    Part,
    TextFormat,
    channels_of,
    declared,
    found_columns,
    library,
    read_parts,
)
from underlay.data.readers._names import Row, find_names, is_same_unit_row, layout_of, serves, units_above
from underlay.data.readers._source import MAX_TEXT_BYTES, Source, open_zip
from underlay.data.readers._table import Table, is_marker, marked, table_curves
from underlay.data.readers._text import SAID, is_number
from underlay.errors import FileFormatError, MissingExtraError
from underlay.units import format_quantity, kind_of

#: First bytes of a compound file, the container of .xls.
OLE_MAGIC = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_WORKBOOK = "xl/workbook.xml"
# A sheet may name a cell in row 1048576 and nothing else. What comes after so many empty rows is left.
_MAX_CELLS, _MAX_GAP = 8_000_000, 10_000
# What xlrd calls cells of .xls that are empty, text, a number, or blank.
_PLAIN = bytes((0, 1, 2, 6))


@dataclass(frozen=True)
class Sheet:
    """One sheet of a workbook, as text.

    Parameters
    ----------
    name : str
        Its name in the workbook.
    rows : list of list of str
        Cells as text; numbers with a decimal point and all digits, empty cells as ''.
    """

    name: str
    rows: list[list[str]]


def _is_xls(source: Source) -> bool:
    return source.data[:8] == OLE_MAGIC


def _is_xlsx(source: Source) -> bool:
    return source.is_zip and _WORKBOOK.encode() in source.data


def sheets_of(source: Source) -> list[Sheet]:
    """Read all sheets of a workbook.

    Raises
    ------
    MissingExtraError
        If the package that reads it is not installed.
    FileFormatError
        If the workbook is damaged or too large.
    """
    most = f"{MAX_TEXT_BYTES // 1_000_000} MB"
    source.require(len(source.data) <= MAX_TEXT_BYTES, f": more than {most} of spreadsheet")
    name = "openpyxl" if source.is_zip else "xlrd"
    package = library(name, f"reading a spreadsheet needs {name}")
    try:
        return _read_xlsx(source, package, most) if source.is_zip else _read_xls(source, package)
    except (FileFormatError, MissingExtraError):
        raise
    except Exception as error:  # both packages raise whatever a damaged file makes of them
        said = f"{type(error).__name__}: {one_line(error, 120)}"
        raise source.wrong(f"is a damaged workbook: {said}") from error


def _read_xlsx(source: Source, openpyxl: Any, most: str) -> list[Sheet]:
    with open_zip(source) as archive:
        total = sum(member.file_size for member in archive.infolist())
        # Every part is unpacked once, so that none is larger than it claims.
        for info in archive.infolist():
            if not info.filename.endswith("/"):
                read_member(archive, info.filename)
    source.require(total <= MAX_TEXT_BYTES, f"unpacks to {total / 1e6:.0f} MB, more than {most}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about styles and printers, not about cells
        workbook = openpyxl.load_workbook(
            io.BytesIO(source.data), read_only=True, data_only=True, keep_links=False
        )
        try:
            sheets = []
            for sheet in workbook.worksheets:
                # The size a sheet claims is not trusted: rows come as they are found.
                sheet.reset_dimensions()
                sheets.append(Sheet(str(sheet.title), list(_rows(source, sheet.iter_rows(values_only=True)))))
            return sheets
        finally:
            workbook.close()


def _read_xls(source: Source, xlrd: Any) -> list[Sheet]:
    workbook = xlrd.open_workbook(
        file_contents=source.data, logfile=io.StringIO(), on_demand=True, ragged_rows=True
    )
    sheets = []
    for index in range(workbook.nsheets):
        sheet = workbook.sheet_by_index(index)
        values = (_xls_row(xlrd, sheet, row) for row in range(sheet.nrows))
        sheets.append(Sheet(str(sheet.name), list(_rows(source, values))))
        workbook.unload_sheet(index)
    return sheets


def _xls_row(xlrd: Any, sheet: Any, row: int) -> Sequence[Any]:
    """Values of a row of an .xls sheet, with errors and dates, which xlrd keeps as numbers, turned into text."""
    values: list[Any] = sheet.row_values(row)
    kinds = bytes(sheet.row_types(row))
    if kinds.translate(None, _PLAIN):
        shown: dict[int, Callable[[Any], Any]] = {
            xlrd.XL_CELL_ERROR: lambda value: xlrd.error_text_from_code.get(value, "#ERROR"),
            xlrd.XL_CELL_DATE: lambda value: f"date {value:g}",
            xlrd.XL_CELL_BOOLEAN: bool,
        }
        values = [
            shown[kind](one) if kind in shown else one for kind, one in zip(kinds, values, strict=False)
        ]
    return values


def _rows(source: Source, rows: Iterator[Sequence[Any]]) -> Iterator[list[str]]:
    cells = empty = 0
    for row in rows:
        cells += len(row) + 1
        source.require(cells <= _MAX_CELLS, f": more than {_MAX_CELLS} cells in a sheet")
        texts = list(map(_text, row))
        if any(texts):
            # Empty rows count only when something follows them.
            yield from ([] for _ in range(min(empty, 64)))
            empty = 0
            yield texts
        else:
            empty += 1
            if empty > _MAX_GAP:
                return


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    return repr(cell) if isinstance(cell, float) else str(cell).replace("_x000D_", "").strip()


# --- plain tables


def _read_all(source: Source, options: Options) -> list[Curve]:
    sheets = sheets_of(source)
    tables = [(sheet, _table(source, sheet, options)) for sheet in sheets]
    curves = read_parts(
        [
            (f"sheet {sheet.name!r:.60}", partial(_curves, source, sheet, table, options))
            for sheet, table in tables
            if table is not None
        ]
    )
    if curves:
        return curves
    rows = ([cell for cell in row if cell] for sheet in sheets for row in sheet.rows)
    first = next((row for row in rows if len(row) >= 2 and not any(map(is_number, row))), [])
    raise source.wrong(
        f"has no sheet with columns for depth and force; the first table has {names_there(first)}. "
        'Say which with columns = { depth = "name (unit)", force = "name (unit)" } in [curve]'
    )


def _curves(source: Source, sheet: Sheet, table: Table, options: Options) -> list[Curve]:
    name = f"{source.path.stem}, sheet {sheet.name}"
    return table_curves(source, table, options, name=name, sheet=sheet.name)


def _table(source: Source, sheet: Sheet, options: Options) -> Table | None:
    """Return the table of a sheet; None where it has none with the columns needed (depth and force, or mapped)."""
    layout = layout_of(len(sheet.rows), lambda at: Row.of(sheet.rows[at]))
    if layout is None:
        return None
    above, asked = [list(row) for row in sheet.rows[: layout.first]], options.columns
    try:
        names, units = find_names(source, above, (), layout, asked, lambda text, _: text.split())
    except FileFormatError:
        return None
    if not serves(names, asked):
        return None
    units = units or units_above(above)
    rows: list[list[str]] = []
    breaks: list[int] = []
    for row in sheet.rows[layout.first :]:
        filled = [cell for cell in row if cell]
        title = len(filled) == 1 and not is_number(filled[0]) and len(row) > 1 and not is_marker(filled[0])
        if not filled or title or (rows and (row == names or is_same_unit_row(source, row, units))):
            breaks.append(len(rows))
        else:
            rows.append(row)
    return Table(names, rows, breaks, units=units)


EXCEL = declared("excel", _read_all, lambda source: _is_xlsx(source) or _is_xls(source))


# --- workbooks of instruments


def _in_bytes(source: Source, *words: str) -> bool:
    # Texts in .xls are stored with one or with two bytes per letter.
    return any(word.encode(code) in source.data for word in words for code in ("latin-1", "utf-16-le"))


def _sheet_part(
    sheet: Sheet, at: int, found: Mapping[str, int], rows: Sequence[Sequence[str]], **about: Any
) -> Part:
    """Make the `Part` of a sheet; names stand in row `at`, units in the next; `found` gives columns by role."""
    labels = _labels(sheet, at)
    return Part([], labels, rows, f"sheet {sheet.name!r:.60}", found, {"sheet": sheet.name, **about})


def _labels(sheet: Sheet, at: int) -> list[tuple[str, str]]:
    """Name and unit of each column of a sheet: names from row `at`, units from the row below."""
    return list(zip_longest(sheet.rows[at], sheet.rows[at + 1], fillvalue=""))


def _padded(rows: Sequence[Sequence[str]], columns: Collection[int]) -> list[Sequence[str]]:
    """Drop rows that are empty in all of these columns (indices); fill up short rows with empty cells."""
    width = max(columns) + 1
    kept = (row for row in rows if any(row[at] for at in columns if at < len(row)))
    return [row if len(row) >= width else [*row, *[""] * (width - len(row))] for row in kept]


_MARKER = "Segment Type"
_NANOSUITE = channels_of("nanosuite")


def _nanosuite_parts(source: Source) -> Iterator[Part]:
    sheets = [sheet for sheet in sheets_of(source) if len(sheet.rows) > 2]
    found = [(sheet, found_columns(_NANOSUITE, _labels(sheet, 0))) for sheet in sheets]
    tests = [(sheet, places) for sheet, places in found if {"depth", "force"} <= places.keys()]
    # Where the rows of some are marked, a sheet without marks is one of results.
    marks = any(_is_marked(sheet) for sheet, _ in tests)
    kept = [one for one in tests if not marks or _is_marked(one[0]) or "force_scatter" in one[1]]
    source.require(kept, ": has no sheet with columns for displacement and load")
    notes = [
        f"sheet {sheet.name!r:.60} is left out: no test, it has no marks of segments"
        for sheet, places in tests
        if (sheet, places) not in kept
    ]
    # Whoever counts tests counts the single ones first.
    for sheet, places in sorted(kept, key=lambda one: "force_scatter" in one[1]):
        called = f"{source.path.stem}, sheet {sheet.name}"
        called += " (average of tests)" if "force_scatter" in places else ""
        rows = [
            row for row in sheet.rows[2:] if row and (row[0].lower() != "end" or _is_reading(row, places))
        ]
        yield _sheet_part(sheet, 0, places, _padded(rows, {0, *places.values()}), name=called, notes=notes)
        notes = []


def _is_marked(sheet: Sheet) -> bool:
    return any(row and _MARKER.lower() in row[0].lower() for row in sheet.rows[2:])


def _is_reading(row: Sequence[str], found: Mapping[str, int]) -> bool:
    return all(len(row) > found[role] and is_number(row[found[role]]) for role in ("depth", "force"))


def _made_of_nanosuite(part: Part, columns: Columns) -> dict[str, Any]:
    segment = marked([row[0] for row in part.rows])
    scatter, notes = columns.get("force_scatter"), list(part.about["notes"])
    if scatter is not None and np.isfinite(scatter).any():
        typical = format_quantity(float(np.nanmedian(scatter)), "force")
        notes.append(
            f"an average of several tests, which scatter about it by {typical} in force (median): that is the "
            "noise of one test, kept for every point in curve.columns['force_scatter']"
        )
    return {
        "segment": segment,
        "columns": {
            role: column for role, column in columns.items() if role not in {"depth", "force", "time"}
        },
        "notes": notes,
        "sign_rules": {
            "depth": "displacement into the surface as written",
            "force": "load on the sample as written, positive in compression",
            "segment": "from the marker column" if segment is not None else "from the motion",
        },
    }


NANOSUITE = TextFormat(
    "nanosuite",
    _nanosuite_parts,
    _made_of_nanosuite,
    lambda source: _is_xls(source) and _in_bytes(source, _MARKER, "Load On Sample"),
).format


_SPECIMEN = channels_of("testxpert")
_PARAMETER_SHEETS, _RESULT_SHEETS, _TEST_COLUMNS = (
    SAID["formats"]["testxpert"][name] for name in ("parameter_sheets", "result_sheets", "test_columns")
)


def _is_testxpert(source: Source) -> bool:
    if not _is_xlsx(source):
        known = _is_xls(source) and _in_bytes(source, *_PARAMETER_SHEETS)
        return known and _in_bytes(source, *_RESULT_SHEETS, *_TEST_COLUMNS)
    try:
        with open_zip(source) as archive:
            text = read_member(archive, _WORKBOOK)[:65_536].decode("utf-8", errors="replace")
    except FileFormatError:
        return False
    return all(
        any(f'name="{name}"' in text for name in names) for names in (_PARAMETER_SHEETS, _RESULT_SHEETS)
    )


def _testxpert_parts(source: Source) -> Iterator[Part]:
    sheets = [(sheet, at) for sheet in sheets_of(source) if (at := _unit_row(sheet))]
    source.require(sheets, ": has no sheet of a specimen: no row of units s, N, mm")
    for sheet, at in sheets:
        found = _specimen_columns(_labels(sheet, at - 1))
        rows = _padded(sheet.rows[at + 1 :], found.values())
        yield _sheet_part(sheet, at - 1, found, rows, name=f"{source.path.stem}, {sheet.name}")


def _unit_row(sheet: Sheet) -> int:
    """Index of the row of units in the sheet of a specimen; 0 for any other sheet."""
    for at, units in enumerate(sheet.rows[1:6], start=1):
        kinds = [kind_of(unit) if unit else None for unit in units]
        if kinds and kinds[0] is not None and "force" in kinds and "length" in kinds:
            return at
    return 0


def _specimen_columns(labels: Sequence[tuple[str, str]]) -> dict[str, int]:
    """Find the columns of a specimen's sheet, by role.

    By names in the languages known, else by units: the first time, the first force, the first two lengths.
    """
    by_name = found_columns(_SPECIMEN, labels)
    if {"force", "depth"} <= by_name.keys():
        return by_name
    by_order: dict[str, int] = {}
    for role, channel in _SPECIMEN.items():
        of_kind = (at for at, (_, unit) in enumerate(labels) if unit and kind_of(unit) == channel.kind)
        if (free := next((at for at in of_kind if at not in by_order.values()), None)) is not None:
            by_order[role] = free
    return by_order


def _made_of_testxpert(part: Part, columns: Columns) -> dict[str, Any]:
    """Return depth (m), turned if the gap between the tools shows it reversed; its rule of sign; first gap (m)."""
    del part
    travel, gap = columns["depth"], columns.get("gap")
    rules = {"force": "as written, positive in compression", "segment": "from the motion"}
    if gap is None or not (np.isfinite(gap).all() and np.isfinite(travel).all()):
        return {"sign_rules": {"depth": "travel as written; the file has no gap to check it with", **rules}}
    sign, rule = 1.0, "travel as written; it does not close with the gap between the tools"
    for way, text in (
        (-1.0, "minus the travel as written"),
        (1.0, "travel as written: gap plus travel is constant"),
    ):
        if np.ptp(gap + way * travel) <= CLOSURE * max(float(np.ptp(travel)), np.finfo(float).tiny):
            sign, rule = way, text
    return {"depth": sign * travel, "initial_gap": float(gap[0]), "sign_rules": {"depth": rule, **rules}}


TESTXPERT = TextFormat("testxpert", _testxpert_parts, _made_of_testxpert, _is_testxpert).format
