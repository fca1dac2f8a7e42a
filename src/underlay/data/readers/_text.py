"""Text of instrument files: decoding, lines, units in the names of columns, and numbers in cells."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import overload

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.readers._source import MAX_TEXT_BYTES, Source
from underlay.errors import FileFormatError, UnitError
from underlay.units import kind_of, unit_factor

__all__ = [
    "SENTINEL",
    "Arrays",
    "Lines",
    "column_factor",
    "decode",
    "is_number",
    "is_unit",
    "kind_named",
    "lines_and_gaps",
    "lines_of",
    "listed",
    "numbers",
    "plain",
    "split_label",
    "unit_named",
    "uses_comma",
]

#: Instruments write the largest double, or averages of it, for "no value".
SENTINEL = 1e300

# A row of the widest sheet that is read, 256 columns of 60 characters, is shorter. Python's csv module stops at
# 131,072 characters with an error of its own.
_LONGEST_LINE = 32_768
# "Depth (nm)", "force [mN]", "Load {N}"; the unit is the last bracket.
_BRACKETED = re.compile(r"(.*?)[\s_]*[(\[{<]([^()\[\]{}<>]*(?:\([^()]*\))?[^()\[\]{}<>]*)[)\]}>]\s*")
# "Time, s", "Position (z), mm"
_AFTER_COMMA = re.compile(r"(.*\S)\s*,\s*([^\s,]+)\s*")
# "Load / mN", "Load/mN", "Defl / nm/V"
_AFTER_SLASH = re.compile(r"(.*?\S)\s*/\s*([^\s/]+(?:/[^\s/]+)?)\s*")
# "depth_um", "Force-N", "Load: mN", "depth in um", "Force N": after these only a unit of the lists below is one.
_AFTER_WORD = re.compile(r"(.*?[^\s_:=-])(?:\s+in\s+|[\s_:=-]+)([^\W\d_]+)\.?\s*", re.IGNORECASE)
# Letters of a unit without a sign in it; longer ones that are usual stand below.
_LONGEST_WORD = 4
_PLAIN_UNITS = frozenset(
    "pm nm um µm μm mm cm m pN nN uN µN μN mN N kN gf kgf lbf s ms us µs μs V mV".split()  # noqa: SIM905
)
_PREFIX_WORDS = {
    "pico": "p",
    "nano": "n",
    "micro": "u",
    "mikro": "u",
    "milli": "m",
    "centi": "c",
    "": "",
    "kilo": "k",
}
_UNIT_STEMS = {
    "m": ("meter", "meters", "metre", "metres"),
    "N": ("newton", "newtons"),
    "s": ("second", "seconds", "sekunden", "secondes"),
    "V": ("volt", "volts"),
}
_NUMBER = re.compile(r"\s*[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?\s*")
# Rows that show which decimal sign a table has.
_SHOWN = 200
_MISSING = frozenset({"", "na", "n/a", "-", "--", "x", "#n/a"})
# Files of one kind ask for the same.
_factor = lru_cache(maxsize=256)(unit_factor)


def listed(text: str) -> tuple[str, ...]:
    """Words of a list that a text holds, commas between."""
    return tuple(" ".join(name.split()) for name in text.split(","))


_WORD_UNITS = {
    **{
        f"{word}{stem}": f"{prefix}{unit}"
        for word, prefix in _PREFIX_WORDS.items()
        for unit, stems in _UNIT_STEMS.items()
        for stem in stems
    },
    **dict.fromkeys(("micron", "microns"), "um"),
    **dict.fromkeys(("sec", "secs", "sek"), "s"),
    **dict.fromkeys(("msec", "msecs"), "ms"),
    **dict.fromkeys(("g", "gr", "gram", "grams", "gf", "gramm"), "gf"),
    **dict.fromkeys(("kg", "kgs", "kilogram", "kilograms", "kgf"), "kgf"),
    **dict.fromkeys(("lb", "lbs", "lbf", "pound", "pounds"), "lbf"),
    **dict.fromkeys(("minute", "minutes"), "min"),
}


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

    def count_cells(self) -> int:
        """Cells of all rows."""
        if self.separator == " ":
            return sum(map(len, map(str.split, self.lines)))
        return "\n".join(self.lines).count(self.separator) + len(self.lines)


@dataclass(frozen=True)
class Arrays(Sequence[Sequence[str]]):
    """Rows of a table whose columns are numbers already.

    Parameters
    ----------
    columns : sequence of ndarray (n,)
        All of one length.
    """

    columns: Sequence[FloatArray]

    def __len__(self) -> int:
        return len(self.columns[0])

    @overload
    def __getitem__(self, index: int) -> Sequence[str]: ...

    @overload
    def __getitem__(self, index: slice) -> Arrays: ...

    def __getitem__(self, index: int | slice) -> Sequence[str] | Arrays:
        if isinstance(index, slice):
            return Arrays([column[index] for column in self.columns])
        return [repr(float(column[index])) for column in self.columns]


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
    return lines_and_gaps(source)[0]


def lines_and_gaps(source: Source) -> tuple[list[str], list[int]]:
    """Return the lines that hold something, and the numbers (from 0) of those that come after a blank line.

    Raises
    ------
    FileFormatError
        If there is no such line, or the file is not text.
    """
    text = decode(source)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\n\r", "\n").replace("\r", "\n")
    every = text.split("\n")
    lines = list(filter(str.strip, every))
    if not lines:
        raise FileFormatError(f"{source.name} holds nothing but blank lines")
    gaps: list[int] = []
    if len(lines) < len(every) - 1:
        count = 0
        for before, line in zip(["", *every], every, strict=False):
            if line and not line.isspace():
                if count and (not before or before.isspace()):
                    gaps.append(count)
                count += 1
    _require_lines(source, lines, len(text))
    return lines, gaps


def _require_lines(source: Source, lines: Sequence[str], size: int) -> None:
    if size <= _LONGEST_LINE or max(map(len, lines)) <= _LONGEST_LINE:
        return
    for number, line in enumerate(lines, start=1):
        if len(line) > _LONGEST_LINE and not line.startswith("#"):
            raise FileFormatError(
                f"{source.name} has {len(line)} characters in line {number} of those that are not blank; a row "
                f"of a table has at most {_LONGEST_LINE}: export it again as a table with a row per point"
            )


def unit_named(text: str) -> str:
    """The unit of a text that may write it in a word, or as a mass for its weight; any other text as it is.

    Examples
    --------
    >>> unit_named("Newtons"), unit_named("microns"), unit_named("g"), unit_named("kPa")
    ('N', 'um', 'gf', 'kPa')
    """
    word = text.strip()
    if word in _PLAIN_UNITS:
        return word
    return _WORD_UNITS.get(word.rstrip(".").casefold(), word)


def plain(name: str) -> str:
    """Name in small letters without accents, however these are coded."""
    if name.isascii():
        return name.strip().lower()
    letters = unicodedata.normalize("NFKD", name.strip().lower())
    return "".join(letter for letter in letters if not unicodedata.combining(letter)).replace("’", "'")


def is_unit(text: str) -> bool:
    """Whether a word is one of the usual units of a curve's columns, by letters or in words."""
    return text in _PLAIN_UNITS or text.rstrip(".").casefold() in _WORD_UNITS


@lru_cache(maxsize=1024)
def kind_named(unit: str) -> str | None:
    """Kind of quantity of a unit as instruments write it; None of a word, without asking what it might be."""
    return kind_of(unit) if is_unit(unit) or len(unit) <= _LONGEST_WORD or not unit.isalpha() else None


def split_label(label: str) -> tuple[str, str]:
    """Split a column label into name and unit.

    Examples
    --------
    >>> split_label("Load (µN)"), split_label("Position (z), mm"), split_label("force [mN]"), split_label("h")
    (('Load', 'µN'), ('Position (z)', 'mm'), ('force', 'mN'), ('h', ''))
    >>> split_label("force_N"), split_label("Load in Newtons"), split_label("depth/um"), split_label("time: Sec")
    (('force', 'N'), ('Load', 'N'), ('depth', 'um'), ('time', 's'))
    """
    return _split_label(label.strip().strip('"').strip()[:200])


@lru_cache(maxsize=1024)
def _split_label(text: str) -> tuple[str, str]:
    matched = _AFTER_COMMA.fullmatch(text)
    if matched and kind_of(unit_named(matched.group(2))) is not None:
        return matched.group(1).strip(), unit_named(matched.group(2))
    matched = _BRACKETED.fullmatch(text)
    if matched and matched.group(1):
        return matched.group(1).strip(), unit_named(matched.group(2))
    matched = _AFTER_SLASH.fullmatch(text) if "/" in text else None
    if matched and kind_of(unit_named(matched.group(2))) is not None:
        return matched.group(1).strip(), unit_named(matched.group(2))
    matched = _AFTER_WORD.fullmatch(text)
    if matched and is_unit(matched.group(2)):
        return matched.group(1).strip(), unit_named(matched.group(2))
    words = text.split("_")
    units = [word for word in words[1:-1] if word in _PLAIN_UNITS and len(word) > 1]
    if len(units) == 1:  # "Defl_nm_Ex"
        return "_".join(word for word in words if word != units[0]), units[0]
    return text, ""


def column_factor(unit: str, kind: str, column: str, where: str) -> float:
    """SI value of the unit of a column, with an error that names the column.

    Raises
    ------
    UnitError
        If the unit is unknown or of another kind.
    """
    try:
        return _factor(unit, kind)
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
    comma: bool | None = None,
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
    comma : bool, optional
        Whether the decimal sign is a comma; the first rows of these columns are asked where it is not said.

    Returns
    -------
    ndarray (n, m)
        NaN where a cell is empty, marked as missing or holds a sentinel (above `SENTINEL`).

    Raises
    ------
    FileFormatError
        If a row is too short or a cell is not a number.
    """
    if comma is None and isinstance(rows, Lines):
        comma = None if any("," in line for line in rows.lines[:_SHOWN]) else False
    if comma is None:
        comma = uses_comma([row[at] for row in rows[:_SHOWN] for at in indices if at < len(row)])
    if isinstance(rows, Arrays):
        table: FloatArray | None = np.column_stack([rows.columns[at] for at in indices]).astype(np.float64)
    else:
        table = _all_good(rows, indices, comma=comma)
    if table is None:
        table = _cell_by_cell(rows, indices, where, comma=comma)
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
    """Convert plain decimal numbers (n, m) by numpy's own reader; None where a cell is anything else."""
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
    rows: Sequence[Sequence[str]], indices: Sequence[int], where: str, *, comma: bool
) -> FloatArray:
    """Convert a table (n, m) with missing cells, or say which cell is wrong."""
    table = np.empty((len(rows), len(indices)))
    for i, row in enumerate(rows):
        for j, index in enumerate(indices):
            try:
                cell = row[index]
            except IndexError:
                raise FileFormatError(
                    f"{where}, row {i + 1} of the table has {len(row)} cells where at least "
                    f"{max(indices) + 1} are expected; the file may be cut short"
                ) from None
            table[i, j] = _number(cell, comma=comma, where=where, line=i + 1)
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
