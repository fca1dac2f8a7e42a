"""Plain tables in .xlsx and .xls workbooks: the spreadsheet form of a CSV.

A sheet is read if it has a row that names a depth and a force, with units in it or in the row below, or
the columns a mapping names. Each such sheet is one test. Signs are taken as written.
"""

from __future__ import annotations

from collections.abc import Sequence

from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._sheets import Sheet, is_xls, is_xlsx, sheets_of
from underlay.data.readers._source import Source
from underlay.data.readers._table import find_columns, table_curve
from underlay.data.readers._text import is_number
from underlay.errors import FileFormatError

__all__ = ["FORMAT"]

# How far down a sheet the row of names is looked for.
_MAX_PREAMBLE = 80


def _sniff(source: Source) -> bool:
    return is_xlsx(source) or is_xls(source)


def _read_all(source: Source, options: Options) -> list[Curve]:
    sheets = sheets_of(source)
    named = [(sheet, _names_at(sheet, options)) for sheet in sheets]
    curves = [
        table_curve(
            source,
            sheet.rows[at],
            [row for row in sheet.rows[at + 1 :] if any(row)],
            options,
            may_use_comma=True,
            name=f"{source.path.stem}, sheet {sheet.name}",
            sheet=sheet.name,
        )
        for sheet, at in named
        if at is not None
    ]
    if curves:
        return curves
    first = next((row for sheet in sheets for row in sheet.rows if _is_header(row)), [])
    there = names_there(cell for cell in first if cell)
    raise FileFormatError(
        f"{source.name} has no sheet with columns for depth and force; the first table has {there}. "
        "Say which with columns={'depth': 'name (unit)', 'force': 'name (unit)'}"
    )


def _is_header(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return len(filled) >= 2 and not any(map(is_number, filled))


def _names_at(sheet: Sheet, options: Options) -> int | None:
    for i, row in enumerate(sheet.rows[:_MAX_PREAMBLE]):
        if _is_header(row) and {"depth", "force"} <= find_columns(row, options.columns).keys():
            return i
    return None


FORMAT = Format(
    name="excel",
    description="tables in .xlsx and .xls workbooks, names and units in the first rows",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
    takes_columns=True,
)
