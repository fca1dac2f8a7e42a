"""Text of instrument files: decoding, lines, units in the names of columns, and numbers in cells."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import parse_toml
from underlay.data.readers._source import MAX_TEXT_BYTES, SHOWN, Source
from underlay.errors import FileFormatError, UnitError
from underlay.units import kind_of, unit_factor

#: The document: ``columns``, ``words``, ``units`` and ``formats``.
SAID: Mapping[str, Any] = parse_toml(files(__package__).joinpath("formats.toml").read_text(encoding="utf-8"))


def listed(text: str) -> tuple[str, ...]:
    """Split a text at commas into its entries, blanks tidied; () of an empty text."""
    return tuple(" ".join(name.split()) for name in text.split(",") if name.strip())


def words(name: str) -> frozenset[str]:
    """Return the set of words that ``formats.toml`` holds under this name in its section ``words``."""
    return frozenset(listed(SAID["words"][name]))


#: Label of a segment (loading, hold, unloading) by the word that an instrument has for it.
SEGMENT_OF: Mapping[str, str] = {
    word: label for label, text in SAID["segments"].items() for word in listed(text)
}
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
_UNITS = SAID["units"]
_PLAIN_UNITS = frozenset(listed(_UNITS["plain"]))
_PREFIXES = {"": "", **{word: prefix for prefix, text in _UNITS["prefixes"].items() for word in listed(text)}}
_WORD_UNITS = {word: unit for unit, text in _UNITS["words"].items() for word in listed(text)} | {
    f"{word}{stem}": f"{prefix}{unit}"
    for word, prefix in _PREFIXES.items()
    for unit, text in _UNITS["stems"].items()
    for stem in listed(text)
}
_NUMBER = re.compile(r"\s*[+-]?(?:\d+[.,]?\d*|[.,]\d+|\d{1,3}(?:,\d{3})+\.\d*)(?:[eE][+-]?\d+)?\s*")
_MISSING = frozenset({"", "na", "n/a", "-", "--", "x", "#n/a"})
# Files of one kind ask for the same.
_factor = lru_cache(maxsize=256)(unit_factor)


@dataclass(frozen=True)
class Lines(Sequence[Sequence[str]]):
    """Rows of a plain table, kept as the lines of the file; a row is split into cells when it is accessed.

    Parameters
    ----------
    lines : list of str
        One line for each row, without quotes.
    separator : str
        Character between the cells; a blank stands for any number of blanks.
    """

    lines: list[str]
    separator: str

    def __len__(self) -> int:
        return len(self.lines)

    def __iter__(self) -> Iterator[list[str]]:
        between = self.between
        return (line.split(between) for line in self.lines)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return Lines(self.lines[index], self.separator)
        return self.lines[index].split(self.between)

    @property
    def between(self) -> str | None:
        """The separator for `str.split` and `numpy.loadtxt`: None for blanks."""
        return None if self.separator == " " else self.separator

    def count_cells(self) -> int:
        """Count the cells of all rows together."""
        if self.separator == " ":
            return sum(map(len, map(str.split, self.lines)))
        return "\n".join(self.lines).count(self.separator) + len(self.lines)


@dataclass(frozen=True)
class Arrays(Sequence[Sequence[str]]):
    """Rows of a table whose columns are arrays of numbers, with cells as text like any other table.

    Parameters
    ----------
    columns : sequence of ndarray (n,)
        The columns, all of one length.
    """

    columns: Sequence[FloatArray]

    def __len__(self) -> int:
        return len(self.columns[0])

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return Arrays([column[index] for column in self.columns])
        return [repr(float(column[index])) for column in self.columns]


def decode(source: Source) -> str:
    """Return the text of a file: UTF-8, UTF-16 if it has a byte-order mark, else Latin-1.

    Raises
    ------
    FileFormatError
        If it is binary (holds NUL bytes) or larger than `MAX_TEXT_BYTES`.
    """
    data = source.data
    source.require(
        len(data) <= MAX_TEXT_BYTES,
        f"holds {len(data) / 1e6:.0f} MB of text, more than the {MAX_TEXT_BYTES // 1_000_000} MB that are read; "
        "split it into one file per test",
    )
    wide = data[:2] in {b"\xff\xfe", b"\xfe\xff"}
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        if wide:
            raise source.wrong(f"starts as UTF-16 text but is damaged: {error.reason}") from error
        text = data.decode("latin-1")
    if not text.isascii():
        text = text.replace("\u2212", "-")  # a minus sign as it is printed
    source.require("\0" not in text, "holds NUL bytes: it is binary or damaged, not a text file")
    return text


def lines_of(source: Source) -> list[str]:
    r"""Return the lines of a file that are not blank, whatever mixture of \n, \r\n, \r and \n\r ends them.

    Raises
    ------
    FileFormatError
        If all lines are blank, or the file is not text.
    """
    return lines_and_gaps(source)[0]


def lines_and_gaps(source: Source) -> tuple[list[str], list[int]]:
    """Return the lines that are not blank, and the indices (from 0, among these) of those after a blank line.

    Raises
    ------
    FileFormatError
        If all lines are blank, a line is too long for a table, or the file is not text.
    """
    text = decode(source)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\n\r", "\n").replace("\r", "\n")
    every = text.split("\n")
    lines = list(filter(str.strip, every))
    source.require(lines, "holds nothing but blank lines")
    gaps: list[int] = []
    if len(lines) < len(every) - 1:
        count = 0
        for before, line in zip(["", *every], every, strict=False):
            if line and not line.isspace():
                if count and (not before or before.isspace()):
                    gaps.append(count)
                count += 1
    if len(text) > _LONGEST_LINE and max(map(len, lines)) > _LONGEST_LINE:
        for number, line in enumerate(lines, start=1):
            source.require(
                len(line) <= _LONGEST_LINE or line.startswith("#"),
                f"has {len(line)} characters in line {number} of those that are not blank; a row of a table has at "
                f"most {_LONGEST_LINE}: export it again as a table with a row per point",
            )
    return lines, gaps


def unit_named(text: str) -> str:
    """Return the symbol of a unit written as a word ("microns") or a mass meant as a force ("g"); else the text.

    Examples
    --------
    >>> unit_named("Newtons"), unit_named("microns"), unit_named("g"), unit_named("kPa")
    ('N', 'um', 'gf', 'kPa')
    """
    word = text.strip()
    return word if word in _PLAIN_UNITS else _WORD_UNITS.get(word.rstrip(".").casefold(), word)


def si_factor(unit: str, *kinds: str) -> float | None:
    """Return the SI value of a unit, a tilde in it read as micro; None unless it is of one of these kinds."""
    symbol = unit_named(unit.replace("~", "u"))
    kind = kind_named(symbol)
    return _factor(symbol, kind) if kind in kinds else None


def bare_cell(cell: str) -> str:
    """A cell without blanks and quotes around it."""
    return cell.strip().strip('"')


def without_brackets(cell: str) -> str:
    """A cell without blanks, quotes and brackets around it."""
    return bare_cell(cell).strip("()[]{}<>").strip()


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
    """Kind of quantity (``length``, ``force``, ...) of a unit; None of an unknown one or of an ordinary word."""
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
    return _split_label(bare_cell(label).strip()[:200].rstrip(" :="))


def _has_kind(unit: str) -> bool:
    return kind_of(unit_named(unit)) is not None


@lru_cache(maxsize=1024)
def _split_label(text: str) -> tuple[str, str]:
    forms = (_AFTER_COMMA, _has_kind), (_BRACKETED, None), (_AFTER_SLASH, _has_kind), (_AFTER_WORD, is_unit)
    for pattern, is_known in forms:
        matched = pattern.fullmatch(text)
        if matched and matched[1] and (is_known is None or is_known(matched[2])):
            return matched[1].strip(), unit_named(matched[2])
    words = text.split("_")
    units = [word for word in words[1:-1] if word in _PLAIN_UNITS and len(word) > 1]
    if len(units) == 1:  # "Defl_nm_Ex"
        return "_".join(word for word in words if word != units[0]), units[0]
    return text, ""


def column_factor(unit: str, kind: str, column: str, where: str) -> float:
    """Factor that converts the unit of a column to SI; an error names the column and the file (`where`).

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


def as_number(cell: str) -> float:
    """Return the number in a cell for which `is_number` is true."""
    return float(_with_point(cell))


def _with_point(cell: str) -> str:
    """A number as text with a decimal point, without the commas of thousands that stand before one: 1,234.5."""
    return cell.replace(",", "" if "." in cell and is_number(cell) else ".")


def numbers(
    rows: Sequence[Sequence[str]], indices: Sequence[int], where: str, *, comma: bool | None = None
) -> FloatArray:
    """Convert some columns of a table of cells to numbers.

    Parameters
    ----------
    rows : sequence of sequences of str
        The cells.
    indices : sequence of int, (m,)
        Columns wanted.
    where : str
        Name of the file in error messages.
    comma : bool, optional
        Whether the decimal sign is a comma; None to find out from the first rows of these columns: it is one if
        some of them hold a comma and none a point.

    Returns
    -------
    ndarray (n, m)
        NaN where a cell is empty, marked as missing or holds a sentinel (above `SENTINEL`).

    Raises
    ------
    FileFormatError
        If a row is too short or a cell is not a number.
    """
    if comma is None:
        # A test begins and may end with nothing but zeros, and no instrument with both.
        ends = slice(SHOWN), slice(-SHOWN, None)
        some = not isinstance(rows, Lines) or any("," in line for end in ends for line in rows.lines[end])
        shown = (
            [row[at] for end in ends for row in rows[end] for at in indices if at < len(row)] if some else []
        )
        comma = any("," in cell for cell in shown) and not any("." in cell for cell in shown)
    if isinstance(rows, Arrays):
        table: FloatArray | None = np.column_stack([rows.columns[at] for at in indices]).astype(np.float64)
    else:
        table = _all_good(rows, indices, comma=comma)
    if table is None:
        table = np.empty((len(rows), len(indices)))
        for i, row in enumerate(rows):
            at = f"{where}, row {i + 1} of the table"
            for j, index in enumerate(indices):
                if index >= len(row):
                    raise FileFormatError(
                        f"{at} has {len(row)} cells where at least {max(indices) + 1} are expected; the file may "
                        "be cut short"
                    )
                table[i, j] = _number(row[index], comma=comma, where=at)
    no_value = np.abs(table) > SENTINEL
    if no_value.any():
        table[no_value] = np.nan
    return table


def _all_good(rows: Sequence[Sequence[str]], indices: Sequence[int], *, comma: bool) -> FloatArray | None:
    """Convert the columns to an array (n, m) at once; None if a cell is not a plain finite number."""
    table = np.empty((len(rows), len(indices)), order="F")
    try:
        if isinstance(rows, Lines) and not comma:
            # Plain decimal numbers, by numpy's own reader.
            table = np.loadtxt(rows.lines, delimiter=rows.between, usecols=indices, comments=None, ndmin=2)
            return table if len(table) == len(rows) and np.isfinite(table).all() else None
        for j, index in enumerate(indices):
            cells = [row[index] for row in rows]
            if comma:
                cells = [cell.replace(",", ".") for cell in cells]
            table[:, j] = list(map(float, cells))
            if "_" in "".join(cells):
                return None
    except (IndexError, ValueError):
        return None
    return table if np.isfinite(table).all() else None


def _number(cell: str, *, comma: bool, where: str) -> float:
    text = _with_point(cell) if comma or ("," in cell and "." in cell and is_number(cell)) else cell
    try:
        value = math.nan if "_" in text else float(text)  # Python reads 1_000; no instrument writes it
    except ValueError:
        if cell.strip().lower() in _MISSING:
            return math.nan
        raise FileFormatError(f"{where}: {cell!r:.40} is not a number") from None
    if not math.isfinite(value):
        raise FileFormatError(
            f"{where}: {cell!r:.40} is not a finite number; take the row out, or leave the cell empty if the point "
            "is missing"
        )
    return value
