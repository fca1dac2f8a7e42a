"""Sheets of .xls and .xlsx workbooks as rows of text, and plain tables in them, the spreadsheet form of a CSV.

Other readers of workbooks take the sheets from here (`sheets_of`), bounded in size. As a plain table, a sheet
is read if it has a row that names a depth and a force, with units in it or in the row below, or the columns
that a mapping names. Each such sheet is one test. Signs are taken as written.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any

from underlay._text import names_there, one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, read_parts
from underlay.data.readers._names import Row, find_names, is_unit_row, layout_of, serves
from underlay.data.readers._source import MAX_TEXT_BYTES, Source, open_zip, read_member
from underlay.data.readers._table import Table, is_marker, table_curves
from underlay.data.readers._text import is_number
from underlay.errors import FileFormatError, MissingExtraError, missing_extra

__all__ = ["FORMAT", "OLE_MAGIC", "Sheet", "is_xls", "is_xlsx", "padded", "sheets_of", "xlsx_text"]

#: First bytes of a compound file, the container of .xls.
OLE_MAGIC = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_WORKBOOK = "xl/workbook.xml"
_MAX_ROWS = 1_048_576
# A sheet may name a cell in row 1048576 and nothing else. What comes after so many empty rows is left.
_MAX_GAP = 10_000
_MAX_CELLS = 8_000_000
_MAX_COLUMNS = 256
# What xlrd calls cells of .xls that are empty, text, a number, or blank.
_PLAIN = bytes((0, 1, 2, 6))


@dataclass(frozen=True)
class Sheet:
    """One sheet.

    Parameters
    ----------
    name : str
        Its name in the workbook.
    rows : list of list of str
        Cells as text; numbers with a decimal point and all digits, empty cells as ''.
    """

    name: str
    rows: list[list[str]]


def is_xls(source: Source) -> bool:
    """Whether the content is a compound file, as .xls is."""
    return source.data[:8] == OLE_MAGIC


def is_xlsx(source: Source) -> bool:
    """Whether the content is an archive with a workbook in it."""
    return source.is_zip and _WORKBOOK.encode() in source.data


def xlsx_text(source: Source) -> str:
    """Return the raw XML that names the sheets, for recognition; '' if it cannot be read."""
    try:
        with open_zip(source) as archive:
            return read_member(archive, _WORKBOOK)[:65_536].decode("utf-8", errors="replace")
    except FileFormatError:
        return ""


def padded(rows: Sequence[Sequence[str]], columns: Collection[int]) -> list[Sequence[str]]:
    """Rows that hold something in one of the columns, with '' for the cells that a row leaves out at its end."""
    width = max(columns) + 1
    kept = (row for row in rows if any(row[at] for at in columns if at < len(row)))
    return [row if len(row) >= width else [*row, *[""] * (width - len(row))] for row in kept]


def sheets_of(source: Source) -> list[Sheet]:
    """Read all sheets of a workbook.

    Raises
    ------
    MissingExtraError
        If the package that reads it is not installed.
    FileFormatError
        If the workbook is damaged or too large.
    """
    if len(source.data) > MAX_TEXT_BYTES:
        raise FileFormatError(f"{source.name}: more than {MAX_TEXT_BYTES // 1_000_000} MB of spreadsheet")
    try:
        return _read_xlsx(source) if source.is_zip else _read_xls(source)
    except (FileFormatError, MissingExtraError):
        raise
    except Exception as error:  # both packages raise whatever a damaged file makes of them
        raise FileFormatError(
            f"{source.name} is a damaged workbook: {type(error).__name__}: {one_line(error, 120)}"
        ) from error


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise missing_extra(f"reading a spreadsheet needs {name}", "afm") from error


def _read_xlsx(source: Source) -> list[Sheet]:
    openpyxl = _module("openpyxl")
    with open_zip(source) as archive:
        total = sum(member.file_size for member in archive.infolist())
        _check_members(archive)
    if total > MAX_TEXT_BYTES:
        raise FileFormatError(
            f"{source.name} unpacks to {total / 1e6:.0f} MB, more than {MAX_TEXT_BYTES // 1_000_000} MB"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about styles and printers, not about cells
        workbook = openpyxl.load_workbook(
            io.BytesIO(source.data), read_only=True, data_only=True, keep_links=False
        )
        try:
            return [
                Sheet(str(sheet.title), list(_rows(source, _values(sheet)))) for sheet in workbook.worksheets
            ]
        finally:
            workbook.close()


def _check_members(archive: zipfile.ZipFile) -> None:
    """Unpack every part once, so that none is larger than it claims."""
    for info in archive.infolist():
        if not info.filename.endswith("/"):
            read_member(archive, info.filename)


def _values(sheet: Any) -> Iterator[Sequence[Any]]:
    # The size a sheet claims is not trusted: rows come as they are found.
    sheet.reset_dimensions()
    rows: Iterator[Sequence[Any]] = sheet.iter_rows(values_only=True)
    return rows


def _read_xls(source: Source) -> list[Sheet]:
    xlrd = _module("xlrd")
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
    """What the cells of a row show: the package keeps errors as their codes (#DIV/0! is 7), dates as days."""
    values: list[Any] = sheet.row_values(row)
    kinds = bytes(sheet.row_types(row))
    if kinds.translate(None, _PLAIN):
        for j, kind in enumerate(kinds):
            if kind == xlrd.XL_CELL_ERROR:
                values[j] = xlrd.error_text_from_code.get(values[j], "#ERROR")
            elif kind == xlrd.XL_CELL_DATE:
                values[j] = f"date {values[j]:g}"
            elif kind == xlrd.XL_CELL_BOOLEAN:
                values[j] = bool(values[j])
    return values


def _rows(source: Source, rows: Iterator[Sequence[Any]]) -> Iterator[list[str]]:
    cells = 0
    empty = 0
    for number, row in enumerate(rows):
        cells += len(row) + 1
        if number >= _MAX_ROWS or cells > _MAX_CELLS:
            raise FileFormatError(
                f"{source.name}: more than {_MAX_ROWS} rows or {_MAX_CELLS} cells in a sheet"
            )
        texts = [_text(cell) for cell in row[:_MAX_COLUMNS]]
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
    if isinstance(cell, float):
        return repr(cell)
    return str(cell).replace("_x000D_", "").strip()


def _sniff(source: Source) -> bool:
    return is_xlsx(source) or is_xls(source)


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
    first = next((row for sheet in sheets for row in sheet.rows if _is_header(row)), [])
    there = names_there(cell for cell in first if cell)
    raise FileFormatError(
        f"{source.name} has no sheet with columns for depth and force; the first table has {there}. "
        "Say which with columns={'depth': 'name (unit)', 'force': 'name (unit)'}"
    )


def _curves(source: Source, sheet: Sheet, table: Table, options: Options) -> list[Curve]:
    name = f"{source.path.stem}, sheet {sheet.name}"
    return table_curves(source, table, options, name=name, sheet=sheet.name)


def _is_header(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return len(filled) >= 2 and not any(map(is_number, filled))


def _table(source: Source, sheet: Sheet, options: Options) -> Table | None:
    """The table of a sheet; None where it holds none with what is asked for."""
    layout = layout_of(len(sheet.rows), lambda at: Row.of(sheet.rows[at]))
    if layout is None:
        return None
    above = [list(row) for row in sheet.rows[: layout.first]]
    try:
        names, units = find_names(source, above, (), layout, options.columns, lambda text, _: text.split())
    except FileFormatError:
        return None
    if not serves(names, options.columns):
        return None
    first = layout.first
    if first and is_unit_row(sheet.rows[first - 1]):
        first -= 1
    rows: list[list[str]] = []
    breaks: list[int] = []
    for row in sheet.rows[first:]:
        filled = [cell for cell in row if cell]
        title = len(filled) == 1 and not is_number(filled[0]) and len(row) > 1 and not is_marker(filled[0])
        if not filled or title or (rows and (row == names or is_unit_row(row))):
            breaks.append(len(rows))
        else:
            rows.append(row)
    return Table(names, rows, breaks, units=units)


FORMAT = Format(
    name="excel",
    description="tables in .xlsx and .xls workbooks, names and units in the first rows",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
    takes_columns=True,
    takes_calibration=True,
)
