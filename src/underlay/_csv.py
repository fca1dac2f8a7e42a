"""The rows of a text with commas, counted before a parser that trusts them is let near.

One row with a hundred thousand cells takes pandas minutes: it makes an index of the cells that have no name.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

__all__ = ["numbered_rows"]


def numbered_rows(
    text: str, most_columns: int, separator: str = ",", comment: str = ""
) -> Iterator[tuple[int, list[str]]]:
    """Go through the rows of a table: first its line of names, then rows that fit under it.

    Parameters
    ----------
    text : str
        A line of names and rows; rows of empty cells do not count.
    most_columns : int
        Most names.
    separator : str
        What stands between two cells.
    comment : str
        What a line begins with that is no row.

    Yields
    ------
    line : int
        Where the row ends in the text, from 1.
    cells : list of str
        As many as there are names; empty ones stand for those that a short row leaves out.

    Raises
    ------
    ValueError
        If there is no line of names, it has too many, a row has more cells than it, or a cell is longer than
        the csv module takes (131,072 characters).
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
