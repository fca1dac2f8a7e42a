"""Plain CSV and TSV: one row of names with units, then numbers.

Units stand in the header (``depth (um)``, ``force [mN]``, ``Time, s``), in a row below the names, or in the
column mapping. Separators are tab, semicolon, comma or blanks; a decimal comma is understood where the
separator is not a comma, or the cells stand in quotes. Lines that start with ``#`` are kept as comments; the
names are looked for there where there are no others. Signs are taken as written: depth grows into the sample
and force is positive in compression, unless the mapping says ``-name``.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from typing import Any

from underlay._door import parse_json
from underlay.data.curve import Curve
from underlay.data.export import METADATA_MARK
from underlay.data.readers._format import Format, Options
from underlay.data.readers._source import Source
from underlay.data.readers._table import find_columns, table_curve
from underlay.data.readers._text import Lines, is_number, lines_of
from underlay.data.readers.exported import restored
from underlay.errors import FileFormatError, UnitError
from underlay.units import kind_of, parse_quantity

__all__ = ["COMMENTED_NUMBERS", "FORMAT"]

# How far down the row of names is looked for.
_MAX_PREAMBLE = 80
_FIRST_LINES = 8
_AT_A_TIME = 1000
#: Comments that carry a number, as in ``# indenter radius: 27.5 um``, and the SI unit of each.
COMMENTED_NUMBERS = {"indenter_radius": "m", "spring_constant": "N/m", "instrument_reduced_modulus": "Pa"}
_COMMENT = ("#", "%", "//")
_NUMERIC = frozenset("0123456789+-.")
_LABEL_WITH_UNIT = re.compile(r"(?<![^\s(\[])[^\s(\[]+\s*[(\[][^)\]]*[)\]]")


def _sniff(source: Source) -> bool:
    head = source.head()
    # Most tables begin with their first lines.
    return any(
        _separator_of_table(head.split("\n", most)[:most]) is not None
        for most in (_FIRST_LINES, _MAX_PREAMBLE * 4)
    )


def _separator_of_table(lines: Sequence[str]) -> str | None:
    """Return the separator of lines that look like a table: a row of two numbers or more."""
    for line in lines[: _MAX_PREAMBLE * 4]:
        for separator in ("\t", ";", ",", " "):
            if separator not in line and separator != " ":
                continue
            cells = _split(line, separator)
            filled = [cell for cell in cells if cell.strip()]
            if len(filled) >= 2 and sum(map(is_number, filled)) >= 2:
                return separator
    return None


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if '"' in line:
        return next(csv.reader(io.StringIO(line), delimiter=separator), [])
    return line.split(separator)


def _split_all(source: Source, lines: list[str], separator: str) -> Sequence[Sequence[str]]:
    # What stands above the table may quote: nothing is looked at line by line where nothing below does.
    quoted = bool(lines) and source.data.rfind(b'"') >= source.data.find(
        lines[0].encode("latin-1", "replace")
    )
    if quoted and separator != " " and any('"' in line for line in lines):
        return [_split(line, separator) for line in lines]
    return Lines(lines, separator)


def _split_names(line: str, separator: str) -> list[str]:
    if separator == " ":
        labels = _LABEL_WITH_UNIT.findall(line)
        return labels if len(labels) >= 2 else line.split()
    return _split(line, separator)


def _read_all(source: Source, options: Options) -> list[Curve]:
    lines = lines_of(source)
    if lines and re.fullmatch(r"sep=.\s*", lines[0]):  # a line by which spreadsheets name the separator
        lines = lines[1:]
    # Most files hold no comment, and most lines of the others begin as a number does: few are looked at twice.
    marked = any(mark[:1].encode() in source.data for mark in _COMMENT)
    looked_at = [line for line in lines if line[0] not in _NUMERIC] if marked else []
    commented = [line for line in looked_at if line.lstrip().startswith(_COMMENT)]
    comments = [line.lstrip("#%/ \t").rstrip() for line in commented]
    if commented:
        left_out = frozenset(commented)
        lines = [line for line in lines if line not in left_out]
    if not lines:
        raise FileFormatError(f"{source.name} holds no table")
    separator = _separator_of_table(lines)
    if separator is None:
        raise FileFormatError(
            f"{source.name} holds no row of numbers; a table needs a row of names with units, such as "
            "'depth (um),force (mN)', and rows of numbers below it"
        )
    try:
        names_at, names = _find_names(lines, comments, separator, source, options)
        preamble = [line.strip() for line in lines[: max(names_at, 0)]]
        # Kept once: the lines of a million points take more than all else.
        del lines[: names_at + 1]
        cells = _split_all(source, lines, separator)
    except csv.Error as error:
        raise FileFormatError(f"{source.name} is not a readable table: {error}") from error
    texts = [comment for comment in comments if not comment.startswith(METADATA_MARK)]
    about = texts + preamble
    curve = table_curve(
        source,
        names,
        cells,
        options,
        # Between commas only what stands in quotes can hold one.
        may_use_comma=separator != "," or not isinstance(cells, Lines),
        commas_between=separator == ",",
        comments=about,
        **_known_numbers(about),
    )
    _require_names(source, names, cells, separator)
    return [restored(curve, _stored(comments))]


def _find_names(
    lines: Sequence[str], comments: Sequence[str], separator: str, source: Source, options: Options
) -> tuple[int, list[str]]:
    """Row number and labels of the first row that names a depth and a force; -1 of the last comment that does."""
    candidate: tuple[int, list[str]] | None = None
    for i, line in enumerate(lines[:_MAX_PREAMBLE]):
        names = [name.strip() for name in _split_names(line, separator)]
        if sum(map(is_number, names)) >= 2:
            break
        if len(names) >= 2:
            if {"depth", "force"} <= find_columns(names, options.columns).keys():
                return i, names
            if candidate is None or len(names) > len(candidate[1]):
                candidate = i, names
    if candidate is None:
        for comment in reversed(comments):  # as numpy.savetxt writes them
            names = [name.strip() for name in _split_names(comment, separator)]
            if {"depth", "force"} <= find_columns(names, options.columns).keys():
                return -1, names
        raise FileFormatError(
            f"{source.name} has no row of names above its numbers; write one with units, such as "
            "'depth (um),force (mN)'"
        )
    return candidate


def _require_names(
    source: Source, names: Sequence[str], rows: Sequence[Sequence[str]], separator: str
) -> None:
    """Refuse rows with more numbers than there are names: which number belongs to which name is not known.

    A decimal or thousands comma in a table with commas, a first column without a name, names with blanks in a
    table with blanks.
    """
    most = len(names)
    if isinstance(rows, Lines) and separator != " ":
        long = _long_lines(rows.lines, separator, most)
    else:
        long = (i for i, row in enumerate(rows) if len(row) > most)
    for i in long:
        cells = rows[i]
        if any(map(is_number, cells[most:])):
            raise FileFormatError(
                f"{source.name}, row {i + 1} of the table has {len(cells)} cells under {most} names: "
                f"{cells!r:.80}; give every column a name and a unit, and where numbers hold commas separate the "
                "columns by semicolons or tabs"
            )


def _long_lines(lines: Sequence[str], separator: str, most: int) -> Iterator[int]:
    """Lines with more cells than `most`; those of a regular table are counted many at a time."""
    for first in range(0, len(lines), _AT_A_TIME):
        some = lines[first : first + _AT_A_TIME]
        if "\n".join(some).count(separator) != len(some) * (most - 1):
            yield from (i for i, line in enumerate(some, first) if line.count(separator) >= most)


def _known_numbers(comments: Sequence[str]) -> dict[str, float]:
    """Numbers that mean something to a fit, from comments such as ``indenter radius: 27.5 um``."""
    known = {}
    for comment in comments:
        key, _, value = comment.partition(":")
        name = key.strip().lower().replace(" ", "_")
        if name in COMMENTED_NUMBERS:
            try:
                known[name] = parse_quantity(value, kind_of(COMMENTED_NUMBERS[name]) or "dimensionless")
            except UnitError as error:
                raise UnitError(f"comment {comment!r:.80}: {error}") from error
    return known


def _stored(comments: Sequence[str]) -> Any:
    """What an exported curve says about itself, or None."""
    for comment in comments:
        if comment.startswith(METADATA_MARK):
            try:
                return parse_json(comment.removeprefix(METADATA_MARK))
            except (ValueError, RecursionError):  # a comment that is not ours after all
                return None
    return None


FORMAT = Format(
    name="csv",
    description="plain CSV or TSV with names and units in the header",
    sniff=_sniff,
    read_all=_read_all,
    takes_columns=True,
)
