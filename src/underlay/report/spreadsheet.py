"""Tables as the sheets of one Excel file, in which nothing that came from a file is a formula or a link."""

from __future__ import annotations

import importlib
import io
import math
from collections.abc import Mapping
from numbers import Real
from types import ModuleType
from typing import Any

import pandas as pd

from underlay._text import one_line
from underlay.errors import InputError, MissingExtraError

__all__ = ["MOST_ROWS", "excel_library", "workbook"]

#: Rows of a sheet under its header, as the format allows; and letters of a cell.
MOST_ROWS, _LONGEST = 1_048_575, 32_767
_WIDEST, _MARGIN = 60, 2
# Rows of which the widths of columns are taken.
_LOOKED_AT = 200
_OPTIONS = {
    "in_memory": True,
    "strings_to_formulas": False,
    "strings_to_urls": False,
    "strings_to_numbers": False,
}


def excel_library() -> ModuleType:
    """Import what writes Excel files.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module("xlsxwriter")
    except ImportError as error:
        raise MissingExtraError("an Excel file needs xlsxwriter: pip install 'underlay[excel]'") from error


def workbook(sheets: Mapping[str, pd.DataFrame]) -> bytes:
    """Return the bytes of an Excel file with one sheet per table, in order.

    Numbers are numbers, words are words; an infinite end of an interval is the word ``open`` and what is not known
    an empty cell.

    Raises
    ------
    MissingExtraError
        If the extra ``excel`` is not installed.
    InputError
        If a table has more rows than a sheet can hold.
    """
    stream = io.BytesIO()
    with excel_library().Workbook(stream, _OPTIONS) as book:
        head = book.add_format({"bold": True, "text_wrap": True, "valign": "top", "bottom": 1})
        for name, table in sheets.items():
            if len(table) > MOST_ROWS:
                raise InputError(
                    f"a sheet of Excel holds {MOST_ROWS} rows; {name!r} has {len(table)}: write CSV instead"
                )
            _fill(book.add_worksheet(name), table, head)
    return stream.getvalue()


def _fill(sheet: Any, table: pd.DataFrame, head: Any) -> None:
    sheet.freeze_panes(1, 0)
    for column, name in enumerate(table.columns):
        values = table.iloc[:, column].tolist()
        sheet.write_string(0, column, one_line(name, _LONGEST), head)
        sheet.set_column(column, column, _width(str(name), values[:_LOOKED_AT]))
        for row, value in enumerate(values, start=1):
            _write(sheet, row, column, value)


def _write(sheet: Any, row: int, column: int, value: Any) -> None:
    """Write one cell by its kind: no text is looked at for what it might mean."""
    if isinstance(value, bool):
        sheet.write_boolean(row, column, value)
    elif isinstance(value, Real):
        if math.isfinite(value):
            sheet.write_number(row, column, float(value))
        elif math.isinf(value):
            sheet.write_string(row, column, "open")
    elif value is not None and value is not pd.NA:
        sheet.write_string(row, column, one_line(value, _LONGEST))


def _width(name: str, values: list[Any]) -> float:
    words = [f"{value:.6g}" if isinstance(value, float) else str(value) for value in values]
    # A long name is wrapped, a long text runs on.
    longest = max([*(len(word) for word in words), min(len(name), _WIDEST // 4)], default=0)
    return float(min(_WIDEST, longest + _MARGIN))
