"""Tables as CSV text: read with a check of the number of cells, and written so that no cell is a formula.

The cells are counted because one row with a hundred thousand cells takes pandas minutes: it makes an index of the
cells that have no name. Cells that begin like a formula are guarded because a spreadsheet would run them.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from typing import Any

import pandas as pd

from underlay._text import guarded_cell, unguarded_cell


def numbered_rows(
    text: str, most_columns: int, separator: str = ",", comment: str = ""
) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a table with their line numbers: first its header, then rows of the same width.

    Parameters
    ----------
    text : str
        A header and rows; rows of empty cells are skipped.
    most_columns : int
        Largest number of columns.
    separator : str
        The separator of cells.
    comment : str
        Beginning of comment lines, which are skipped.

    Yields
    ------
    line : int
        Where the row ends in the text, from 1.
    cells : list of str
        As many as the header has; short rows are filled up with empty ones.

    Raises
    ------
    ValueError
        If there is no header, it has too many cells, a row has more cells than it, or a cell is longer than the csv
        module takes (131,072 characters).
    """
    lines = io.StringIO(text, newline="")
    kept = ("\n" if comment and line.startswith(comment) else line for line in lines)
    reader = csv.reader(kept, delimiter=separator)
    width = 0
    try:
        for cells in reader:
            if len(cells) > (width or most_columns):
                allowed = (
                    f"there are names: {len(cells)} under {width}" if width else f"the {most_columns} allowed"
                )
                raise ValueError(f"line {reader.line_num} has more cells than {allowed}")
            if not any(cells):
                continue
            width = width or len(cells)
            yield reader.line_num, cells + [""] * (width - len(cells))
    except csv.Error as error:
        raise ValueError(f"line {reader.line_num}: {error}") from error
    if not width:
        raise ValueError("it has no line of names")


def csv_text(table: pd.DataFrame) -> str:
    """Return `table` as comma-separated text in which no word can act as a formula.

    Numbers are written as they are; words, also in the header, by `guarded_cell`. An index of names is the first
    column; one of integers is left out.
    """
    guarded = _mapped(table, guarded_cell)
    return str(guarded.to_csv(index=not pd.api.types.is_integer_dtype(table.index)))


def unguarded(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table read from the text of `csv_text`, with its words restored."""
    return _mapped(table, unguarded_cell)


def _mapped(table: pd.DataFrame, change: Callable[[str], str]) -> pd.DataFrame:
    """Return `table` with `change` applied to every word: cells, names of columns and names of rows."""

    def changed(value: Any) -> Any:
        return change(value) if isinstance(value, str) else value

    made = table.rename(columns=changed, index=changed).rename_axis(index=changed)
    for place, kind in enumerate(table.dtypes):
        if not pd.api.types.is_numeric_dtype(kind):
            made.isetitem(place, table.iloc[:, place].map(changed).to_numpy())
    return made
