"""A table as the text of a CSV file that a spreadsheet may open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd

from underlay._text import guarded_cell, unguarded_cell

__all__ = ["csv_text", "unguarded"]


def csv_text(table: pd.DataFrame) -> str:
    """Return `table` as comma-separated text in which no word can act as a formula.

    Numbers are written as they are; words, names of columns among them, as `guarded_cell` says. An index of
    names is the first column; one of numbers is left out.
    """
    guarded = _mapped(table, guarded_cell)
    return str(guarded.to_csv(index=not pd.api.types.is_integer_dtype(table.index)))


def unguarded(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table that was read from such text with the words that were written."""
    return _mapped(table, unguarded_cell)


def _mapped(table: pd.DataFrame, change: Callable[[str], str]) -> pd.DataFrame:
    """Return `table` with every word changed: cells, names of columns and names of rows."""

    def changed(value: Any) -> Any:
        return change(value) if isinstance(value, str) else value

    made = table.rename(columns=changed, index=changed).rename_axis(index=changed)
    for place, kind in enumerate(table.dtypes):
        if not pd.api.types.is_numeric_dtype(kind):
            made.isetitem(place, table.iloc[:, place].map(changed).to_numpy())
    return made
