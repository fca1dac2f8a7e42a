"""Text of instrument files: decoding, lines, units in headers, and numbers in cells."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.readers._source import MAX_TEXT_BYTES, Source
from underlay.errors import FileFormatError, UnitError
from underlay.units import kind_of, unit_factor

__all__ = [
    "SENTINEL",
    "Lines",
    "column_factor",
    "decode",
    "is_number",
    "lines_of",
    "numbers",
    "split_label",
    "uses_comma",
]

#: Instruments write the largest double, or averages of it, for "no value".
SENTINEL = 1e300

# A row of the widest sheet that is read, 256 columns of 60 characters, is shorter. Python's csv module stops at
# 131,072 characters with an error of its own.
_LONGEST_LINE = 32_768
# "Depth (nm)", "force [mN]", "Piezo speed  (um/s)"; the unit is the last bracket.
_BRACKETED = re.compile(r"(.*?)\s*[(\[]([^()\[\]]*(?:\([^()]*\))?[^()\[\]]*)[)\]]\s*")
# "Time, s", "Position (z), mm"
_AFTER_COMMA = re.compile(r"(.*\S)\s*,\s*([^\s,]+)\s*")
# "Load / mN"
_AFTER_SLASH = re.compile(r"(.*\S)\s+/\s*([^\s/]+(?:/[^\s/]+)?)\s*")
_NUMBER = re.compile(r"\s*[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?\s*")
_MISSING = frozenset({"", "na", "n/a", "-", "--", "x", "#n/a"})


@dataclass(frozen=True)
class Lines(Sequence[Sequence[str]]):
    """Rows of a plain table, kept as the lines of the file; one is split where its cells are asked for.

    Parameters
    ----------
    lines : list of str
        One for each row, without quotes.
    separator : str
        Between its cells; a blank stands for any number of blanks.
    """

    lines: list[str]
    separator: str

    def __len__(self) -> int:
        return len(self.lines)

    @overload
    def __getitem__(self, index: int) -> Sequence[str]: ...

    @overload
    def __getitem__(self, index: slice) -> Lines: ...

    def __getitem__(self, index: int | slice) -> Sequence[str] | Lines:
        if isinstance(index, slice):
            return Lines(self.lines[index], self.separator)
        return self.lines[index].split(None if self.separator == " " else self.separator)


def decode(source: Source) -> str:
    """Return the text of a file: UTF-8, UTF-16 with its mark, else Latin-1.

    Raises
    ------
    FileFormatError
        If it is binary (holds NUL bytes) or larger than `MAX_TEXT_BYTES`.
    """
    data = source.data
    if len(data) > MAX_TEXT_BYTES:
        raise FileFormatError(
            f"{source.name} holds {len(data) / 1e6:.0f} MB of text, more than the "
            f"{MAX_TEXT_BYTES // 1_000_000} MB that are read; split it into one file per test"
        )
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        try:
            text = data.decode("utf-16")
        except UnicodeDecodeError as error:
            raise FileFormatError(
                f"{source.name} starts as UTF-16 text but is damaged: {error.reason}"
            ) from error
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    if "\0" in text:
        raise FileFormatError(f"{source.name} holds NUL bytes: it is binary or damaged, not a text file")
    return text


def lines_of(source: Source) -> list[str]:
    r"""Return the lines that hold something, whatever mixture of \n, \r\n, \r and \n\r ends them.

    Raises
    ------
    FileFormatError
        If there is none, or the file is not text.
    """
    text = decode(source).replace("\r", "\n")
    lines = list(filter(str.strip, text.split("\n")))
    if not lines:
        raise FileFormatError(f"{source.name} holds nothing but blank lines")
    if len(text) <= _LONGEST_LINE or max(map(len, lines)) <= _LONGEST_LINE:
        return lines
    for number, line in enumerate(lines, start=1):
        if len(line) > _LONGEST_LINE and not line.startswith("#"):
            raise FileFormatError(
                f"{source.name} has {len(line)} characters in line {number} of those that are not blank; a row "
                f"of a table has at most {_LONGEST_LINE}: export it again as a table with a row per point"
            )
    return lines


def split_label(label: str) -> tuple[str, str]:
    """Split a column label into name and unit.

    Examples
    --------
    >>> split_label("Load (µN)"), split_label("Position (z), mm"), split_label("force [mN]"), split_label("h")
    (('Load', 'µN'), ('Position (z)', 'mm'), ('force', 'mN'), ('h', ''))
    """
    text = label.strip().strip('"').strip()[:200]
    matched = _AFTER_COMMA.fullmatch(text)
    if matched and kind_of(matched.group(2)) is not None:
        return matched.group(1).strip(), matched.group(2)
    matched = _BRACKETED.fullmatch(text)
    if matched and matched.group(1):
        return matched.group(1).strip(), matched.group(2).strip()
    matched = _AFTER_SLASH.fullmatch(text)
    if matched and kind_of(matched.group(2)) is not None:
        return matched.group(1).strip(), matched.group(2)
    return text, ""


def column_factor(unit: str, kind: str, column: str, where: str) -> float:
    """SI value of the unit of a column, with an error that names the column.

    Raises
    ------
    UnitError
        If the unit is unknown or of another kind.
    """
    try:
        return unit_factor(unit, kind)
    except UnitError as error:
        raise UnitError(f"{where}, column {column!r:.80}: {error}") from error


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, with a decimal point or comma."""
    return len(cell) < 60 and _NUMBER.fullmatch(cell) is not None


def uses_comma(cells: Sequence[str]) -> bool:
    """Whether these cells write a decimal comma: some hold a comma, and none a point."""
    return any("," in cell for cell in cells) and not any("." in cell for cell in cells)


def numbers(
    rows: Sequence[Sequence[str]],
    indices: Sequence[int],
    where: str,
    *,
    comma: bool = False,
    first_line: int = 1,
) -> FloatArray:
    """Read some columns of a table of cells.

    Parameters
    ----------
    rows : sequence of sequences of str
        The cells.
    indices : sequence of int, (m,)
        Columns wanted.
    where : str
        File, for messages.
    comma : bool
        Whether the decimal sign is a comma.
    first_line : int
        Number of the first row, for messages.

    Returns
    -------
    ndarray (n, m)
        NaN where a cell is empty, marked as missing or holds a sentinel (above `SENTINEL`).

    Raises
    ------
    FileFormatError
        If a row is too short or a cell is not a number.
    """
    table = _all_good(rows, indices, comma=comma)
    if table is None:
        table = _cell_by_cell(rows, indices, where, comma=comma, first_line=first_line)
    no_value = np.abs(table) > SENTINEL
    if no_value.any():
        table[no_value] = np.nan
    return table


def _all_good(rows: Sequence[Sequence[str]], indices: Sequence[int], *, comma: bool) -> FloatArray | None:
    """Convert a table (n, m) in one go; None if a cell of it needs a look."""
    if isinstance(rows, Lines) and not comma:
        table = _all_lines(rows, indices)
        return table if table is not None and len(table) == len(rows) and np.isfinite(table).all() else None
    table = np.empty((len(rows), len(indices)), order="F")
    for j, index in enumerate(indices):
        try:
            cells = [row[index] for row in rows]
            if comma:
                cells = [cell.replace(",", ".") for cell in cells]
            table[:, j] = list(map(float, cells))
        except (IndexError, ValueError):
            return None
        if "_" in "".join(cells):
            return None
    return table if np.isfinite(table).all() else None


def _all_lines(rows: Lines, indices: Sequence[int]) -> FloatArray | None:
    """The same by numpy's own reader, which takes plain decimal numbers alone, as Python reads them."""
    try:
        return np.loadtxt(
            rows.lines,
            delimiter=None if rows.separator == " " else rows.separator,
            usecols=indices,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return None


def _cell_by_cell(
    rows: Sequence[Sequence[str]], indices: Sequence[int], where: str, *, comma: bool, first_line: int
) -> FloatArray:
    """Convert a table (n, m) with missing cells, or say which cell is wrong."""
    table = np.empty((len(rows), len(indices)))
    for i, row in enumerate(rows):
        for j, index in enumerate(indices):
            try:
                cell = row[index]
            except IndexError:
                raise FileFormatError(
                    f"{where}, row {first_line + i} of the table has {len(row)} cells where at least "
                    f"{max(indices) + 1} are expected; the file may be cut short"
                ) from None
            table[i, j] = _number(cell, comma=comma, where=where, line=first_line + i)
    return table


def _number(cell: str, *, comma: bool, where: str, line: int) -> float:
    text = cell.replace(",", ".") if comma else cell
    try:
        value = math.nan if "_" in text else float(text)  # Python reads 1_000; no instrument writes it
    except ValueError:
        if cell.strip().lower() in _MISSING:
            return math.nan
        raise FileFormatError(f"{where}, row {line} of the table: {cell!r:.40} is not a number") from None
    if not math.isfinite(value):
        raise FileFormatError(
            f"{where}, row {line} of the table: {cell!r:.40} is not a finite number; take the row out, or leave "
            "the cell empty if the point is missing"
        )
    return value
