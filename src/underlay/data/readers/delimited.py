"""Plain CSV and TSV tables: a row of names with units, then numbers.

Units stand in the header (``depth (um)``, ``force [mN]``, ``Time, s``, ``load_N``), in a row below the names,
which a row of remarks may follow as in Origin, in a comment, or in the column mapping. Separators are tab,
semicolon, bar, comma or blanks; a decimal comma is understood where the separator is not a comma, or the cells
stand in quotes.

What stands above the first long run of rows of numbers (results, settings) is passed over. Lines that start with
``#`` are kept as comments; the names are looked for there where there are no others. Names and cells must be
as many: a label in front of the names (``# columns:``) is none. A table without names is read by the numbers
of its columns (``depth = "2 (nm)"``).

Signs are taken as written: depth grows into the sample and force is positive in compression, unless the
mapping says ``-name``.
"""

from __future__ import annotations

import csv
import io
import re
from bisect import bisect_left
from collections.abc import Callable, Sequence
from itertools import zip_longest
from operator import itemgetter
from typing import Any

from underlay._door import parse_json
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.export import METADATA_MARK, restored
from underlay.data.readers._format import Options, declared, header_of, place_of
from underlay.data.readers._names import (
    Layout,
    Row,
    find_names,
    is_same_unit_row,
    layout_of,
    stated_lever,
    units_above,
    with_units,
)
from underlay.data.readers._source import HEAD, LISTED, MOST_PARTS, SHOWN, Source
from underlay.data.readers._table import Table, table_curves
from underlay.data.readers._text import SEGMENT_OF, Lines, is_number, lines_and_gaps
from underlay.errors import UnitError
from underlay.units import kind_of, parse_quantity

#: Comments that carry a number, as in ``# indenter radius: 27.5 um``, and the SI unit of each.
COMMENTED_NUMBERS = {"indenter_radius": "m", "spring_constant": "N/m", "instrument_reduced_modulus": "Pa"}
_COMMENT = ("#", "%", "//")
# Comments too where nothing is separated by them.
_ALSO_COMMENT = (";", "!")
# The first line of an Igor text file.
_IGOR = "IGOR"
_DECIMAL = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_DIGIT = re.compile(r"\d")
_NUMERIC = frozenset("0123456789+-.")
# Rows of nothing but numbers, by what separates them; a comma between cells is no decimal's.
_READINGS = {
    separator: re.compile(rf"(?:[ \t]*{number}(?:{between}{number})*[ \t]*\n)*")
    for separator, between, number in (
        ("\t", "[ ]*\t[ ]*", _DECIMAL),
        (";", r"[ \t]*;[ \t]*", _DECIMAL),
        ("|", r"[ \t]*\|[ \t]*", _DECIMAL),
        (",", r"[ \t]*,[ \t]*", _DECIMAL.replace(",", "")),
        (" ", r"[ \t]+", _DECIMAL),
    )
}
_LABEL_WITH_UNIT = re.compile(r"(?<![^\s(\[])[^\s(\[]+\s*[(\[][^)\]]*[)\]]")


def _separator(line: str) -> str:
    """Separator (a key of `_READINGS`) of the cells of a line with two numbers or more; '' for any other line."""
    if _DIGIT.search(line) is None or line.lstrip().startswith(_COMMENT):
        return ""
    some = ""
    for separator in _READINGS:
        if separator in line or separator == " ":
            cells = _split(line, separator)
            count = sum(map(is_number, cells))
            # "1,5 2,25" holds two numbers between commas too, and a cell that is none.
            if count >= 2 and count == sum(map(bool, map(str.strip, cells))):
                return separator
            # Words of a name may be numbers: "depth 1 (um)".
            mostly = separator != " " or 2 * count >= len(cells)
            some = some or (separator if count >= 2 and mostly else "")
    return some


def _layout(lines: Sequence[str]) -> tuple[Layout, str] | None:
    """Find where the rows of numbers stand, and the separator of their cells; None if there are none."""
    separators: dict[int, str] = {}

    def row_at(at: int) -> Row | None:
        line = lines[at]
        if line.lstrip().startswith(_COMMENT):
            return None
        # As the row above, by what stands in it, or, in front of rows of numbers, as the row below.
        known = separators.get(at - 1, "")
        row = Row.of(_split(line, known)) if known else None
        if row is None or not row.is_reading:
            known = _separator(line) or separators.get(at + 1, "")
            row = Row.of(_split(line, known)) if known else None
        if row is not None:
            separators[at] = known
        return row

    def is_regular(at: int, count: int, cells: int) -> bool:
        separator = separators[at]
        block = "\n".join([*lines[at : at + count], ""])
        there = len(block.split()) if separator == " " else block.count(separator) + count
        return there == count * cells and bool(_READINGS[separator].fullmatch(block))

    found = layout_of(len(lines), row_at, is_regular)
    return None if found is None else (found, separators[found.first])


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if '"' in line:
        return next(csv.reader(io.StringIO(line), delimiter=separator), [])
    return line.split(separator)


def _bare(comment: str) -> str:
    return comment.lstrip("#%/;! \t")


def _lines_of(source: Source) -> tuple[list[str], list[int]]:
    """Lines of a file that are not blank, and which of them come after a blank one; see `lines_and_gaps`.

    An Igor text file is made a table, names in quotes that go over several lines are joined, and the line by which
    spreadsheets name the separator is dropped.
    """
    lines, gaps = lines_and_gaps(source)
    if lines[0].strip() == _IGOR:
        return _waves(source, lines), []
    joined = _with_whole_quotes(lines) if '"' in source.head(HEAD) else lines
    first = bool(re.fullmatch(r"sep=.\s*", joined[0]))
    return joined[first:], [gap - len(lines) + len(joined) - first for gap in gaps]


def _read_all(source: Source, options: Options) -> list[Curve]:
    lines, gaps = _lines_of(source)
    found = _layout(lines)
    if found is None:
        raise source.wrong(
            "holds no row of numbers; a table needs a row of names with units, such as 'depth (um),force (mN)', "
            "and rows of numbers below it"
        )
    layout, separator = found
    marks = _COMMENT if separator == ";" else (*_COMMENT, *_ALSO_COMMENT)
    # Most lines begin as a number does: few are looked at twice.
    plain_body = _NUMERIC.issuperset(map(itemgetter(0), lines[layout.first :]))
    looked_at = lines[: layout.first] if plain_body else lines
    odd = {at: line for at, line in enumerate(looked_at) if line[0] not in _NUMERIC}
    commented = {at: line for at, line in odd.items() if line.lstrip().startswith(marks)}
    comments = [_bare(line).rstrip() for line in commented.values()]
    above = [line for line in lines[: layout.first] if not line.lstrip().startswith(marks)]
    try:
        cells_above = [_split_names(line, separator) for line in above]
        if separator == " ":
            pairs = zip(cells_above, map(with_units, above), strict=True)
            cells_above = [two if len(two) == layout.cells else one for one, two in pairs]

        def split(text: str, at: str) -> list[str]:
            return _split_names(text, at or separator)

        names, units = find_names(source, cells_above, comments, layout, options.columns, split)
        first = layout.first
        units = units or units_above([_split(line, separator) for line in above[-LISTED:]])
        below = {at: line for at, line in odd.items() if at >= first}
        named = [name.strip() for name in names]
        left_out, notes = _left_out(source, below, commented, separator, named, units)
    except csv.Error as error:
        raise source.wrong(f"is not a readable table: {error}") from error
    gone = sorted(left_out | {at for at in commented if at >= first})

    def row_of(at: int) -> int:
        """Index of the first row of the table that stands at or below the line with that index in the file."""
        return max(at - first - bisect_left(gone, at), 0)

    breaks = {row_of(at) for at in (*(gap for gap in gaps if gap > first), *(at + 1 for at in left_out))}
    segments, starts = _said_above(commented, row_of)
    skipped = frozenset(gone)
    rows = (
        [line for at, line in enumerate(lines[first:], first) if at not in skipped] if gone else lines[first:]
    )
    # What stands above the table may quote: nothing is looked at line by line where nothing below does.
    start = source.data.find(rows[0].encode("latin-1", "replace")) if rows else 0
    quoted = source.data.rfind(b'"') >= start and any('"' in line for line in rows)
    cells: Sequence[Sequence[str]] = Lines(rows, separator)
    if quoted and separator != " ":
        cells = [_split(line, separator) for line in rows]
    del lines, rows
    texts = [comment for comment in comments if not comment.startswith(METADATA_MARK)]
    about = texts + [line.strip() for line, row in zip(above, cells_above, strict=True) if row != names]
    table = Table(
        names,
        cells,
        sorted(breaks),
        # Between commas only what stands in quotes can hold one.
        comma=False if separator == "," and isinstance(cells, Lines) else None,
        commas_between=separator == ",",
        units=units,
        stated=stated_lever(about),
        segments=segments,
        starts=starts,
    )
    known = {**_known_numbers(about), **({"notes": notes} if notes else {})}
    curves = table_curves(source, table, options, comments=about, **known)
    _require_names(source, names, cells)
    stored = _stored(comments)
    return [restored(curve, stored) for curve in curves]


def _with_whole_quotes(lines: Sequence[str]) -> list[str]:
    """Join the first lines where a line ends within a quoted cell, as names do that were typed over two lines.

    Lines come back as they are where a quote has no end: it is none, as an inch in a remark.
    """
    joined: list[str] = [""]
    for line in lines[:SHOWN]:
        if joined[-1].count('"') % 2 and not joined[-1].lstrip().startswith(_COMMENT):
            joined[-1] += f" {line}"
        else:
            joined.append(line)
    return [*joined[1:], *lines[SHOWN:]] if joined[-1].count('"') % 2 == 0 else list(lines)


def _waves(source: Source, lines: Sequence[str]) -> list[str]:
    """Turn an Igor text file (.itx) into the lines of a table with a row of wave names; the rest as comments."""
    columns: list[tuple[str, list[str]]] = []
    others: list[str] = []
    first, inside = 0, False
    for line in lines[1:]:
        word = line.strip()
        if word.upper().startswith("WAVES"):
            names = re.split(r"[\s,]+", word.partition("\t")[2].strip() or word.partition(" ")[2].strip())
            first = len(columns)
            columns += [(name.strip("'"), []) for name in names]
        elif word.upper() in {"BEGIN", "END"}:
            inside = word.upper() == "BEGIN"
        elif inside and columns:
            for (_, column), cell in zip(columns[first:], word.split(), strict=False):
                column.append(cell)
        else:
            others.append(f"# {word}")
    source.require(
        0 < len(columns) <= MOST_PARTS,
        f"is an Igor text file with {len(columns)} waves; a curve has 2 or more",
    )
    rows = zip_longest(*(column for _, column in columns), fillvalue="")
    table = [*others, "\t".join(name for name, _ in columns), *("\t".join(row) for row in rows)]
    return list(filter(str.strip, table))  # a wave may lack its name, and its numbers


def _left_out(
    source: Source,
    below: dict[int, str],
    commented: dict[int, str],
    separator: str,
    names: Sequence[str],
    units: Sequence[str],
) -> tuple[set[int], list[str]]:
    """Find lines among the rows of numbers that are no readings: blank, repeated names or units, or a title.

    Parameters
    ----------
    below, commented : dict of int to str
        By their index in the file, the lines that do not begin as a number does, and the comments among all lines.
    separator : str
        Of the cells.
    names, units : sequence of str
        Names of the columns, and their units where a row or a comment gives them.

    Returns
    -------
    (set of int, list of str)
        Indices of these lines, and notes that quote the titles.

    Raises
    ------
    FileFormatError
        If other units are said further down.
    """
    left_out: set[int] = set()
    notes: list[str] = []
    for at, line in below.items():
        if not line.strip(',;\t "'):
            left_out.add(at)
        elif at not in commented:
            cells = [cell.strip() for cell in _split(line, separator)]
            filled = [cell for cell in cells if cell]
            again = cells == names or is_same_unit_row(source, cells, units)
            title = not again and len(filled) == 1 and not is_number(filled[0])
            if title and len(notes) < LISTED:
                notes.append(f"left out: the line {one_line(filled[0])!r:.60} between the rows of numbers")
            if again or title or (len(filled) > 1 and filled == [name for name in names if name]):
                left_out.add(at)
    return left_out, notes


def _said_above(
    commented: dict[int, str], row_of: Callable[[int], int]
) -> tuple[list[tuple[int, str]], list[int]]:
    """Read comments as JPK's text export has them: first row and label of each segment, first row of each curve."""
    segments: list[tuple[int, str]] = []
    starts, before = {0}, ""
    for at, line in commented.items():
        label, word = (text.strip() for text in _bare(line).partition(":")[::2])
        if label.lower() == "segment" and word.lower() in SEGMENT_OF:
            segments.append((row_of(at), SEGMENT_OF[word.lower()]))
        elif label.lower() == "index" and word != before:
            starts.add(row_of(at))
            before = word
    return segments, sorted(starts) if segments else []


def _split_names(line: str, separator: str) -> list[str]:
    if separator == " ":
        labels = _LABEL_WITH_UNIT.findall(line)
        return labels if len(labels) >= 2 else line.split()
    return [cell.strip() for cell in _split(line, separator)]


def _require_names(source: Source, names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Refuse rows with more numbers than there are names: which number belongs to which name is not known.

    Typical causes: a comma within numbers of a table separated by commas, a first column without a name, names with
    blanks in a table separated by blanks.
    """
    most = len(names)
    if isinstance(rows, Lines) and rows.count_cells() == len(rows) * most:  # as of most tables
        return
    for i, cells in enumerate(rows):
        source.require(
            not any(map(is_number, cells[most:])),
            f", row {i + 1} of the table has {len(cells)} cells under {most} names: {cells!r:.80}; give every "
            "column a name and a unit, and where numbers hold commas separate the columns by semicolons or tabs",
        )


def _known_numbers(comments: Sequence[str]) -> dict[str, Any]:
    """Read the numbers of `COMMENTED_NUMBERS` (SI) from comments such as ``indenter radius: 27.5 um``.

    Also the ``position`` (x, y) (m), as AFM Workshop writes it: ``X, um: 0.5``.
    """
    known: dict[str, Any] = dict(place_of(header_of(comments), "X, um", "Y, um"))
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
    """Parse the metadata that underlay's own CSV export stores in a comment; None where there are none."""
    for comment in comments:
        if comment.startswith(METADATA_MARK):
            try:
                return parse_json(comment.removeprefix(METADATA_MARK))
            except (ValueError, RecursionError):  # a comment that is not ours after all
                return None
    return None


def _is_table(source: Source) -> bool:
    head = source.head(HEAD)
    return head.startswith(_IGOR) or any(map(_separator, head.split("\n")))


FORMAT = declared("csv", _read_all, _is_table)
