"""Where the numbers of a plain table begin, and what its columns are called.

A file may begin with pages of settings, a table of results or comments. `layout_of` finds the first long run
of rows of numbers; `find_names` then looks for as many names in the rows above it, else in the comments.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Sequence
from itertools import chain
from typing import NamedTuple

from underlay._text import names_there
from underlay.data.readers._columns import find_columns, parse_column
from underlay.data.readers._format import Options
from underlay.data.readers._source import Source
from underlay.data.readers._table import sides_of, tests_beside
from underlay.data.readers._text import is_number, is_unit, kind_named, plain, split_label
from underlay.errors import FileFormatError
from underlay.units import unit_factor

__all__ = ["Layout", "Row", "find_names", "is_unit_row", "layout_of", "serves", "stated_lever", "with_units"]

# How far down a table may begin (the head of a NanoScope export has 658 lines), how many rows in a run are one for
# certain, and how far above them the names may stand.
_MAX_HEAD, _CERTAIN, _MAX_PREAMBLE = 4000, 24, 80
# Letters of a unit that is not among the usual ones, such as "1/s" or "mm/min".
_LONGEST_UNIT = 8
# What may stand in front of the names, in place of one.
_LABELS = frozenset(
    """columns column cols col fields field names name header headers channels channel variables variable labels
    legend data spalten felder kanale colonnes champs columnas campos colonne""".split()  # noqa: SIM905
)
_UNITS = frozenset("units unit einheiten einheit unites unite unidades unita".split())  # noqa: SIM905
# "\\Spring Constant: 0.06", "springConstant: 0.06": N/m in every file seen; "DeflSens: V 41.0 nm/V".
_SPRING = re.compile(
    r"\\?spring\s?constant[^:=\d]{0,12}[:=]\s*([\d.]+(?:e[+-]?\d+)?)\s*(?:N/m)?\W*", re.IGNORECASE
)
_SENSITIVITY = re.compile(
    r"(?:defl\w*\.?\s?sens\w*|invols|sensitivity)[^\d\n]{0,12}([\d.]+(?:e[+-]?\d+)?)\s*([num]m/V|m/V)",
    re.IGNORECASE,
)
# "1: time 2: depth", "[1] time [2] depth".
_COUNTED, _COUNT = re.compile(r"\W*1[\]:.)]\s*[^\W\d]"), re.compile(r"\[?\b\d{1,3}[\]:.)]\s*(?=[^\W\d])")


class Layout(NamedTuple):
    """Where a table stands: first row of numbers, cells of a row, and up to which cell there are numbers."""

    first: int
    cells: int
    numbers: int


class Row(NamedTuple):
    """How many cells a row has, how many of them are numbers, and up to which cell there are numbers."""

    cells: int
    numbers: int
    last: int

    @classmethod
    def of(cls, cells: Sequence[str]) -> Row:
        """Count the cells of a row and the numbers among them."""
        numeric = [at for at, cell in enumerate(cells, start=1) if is_number(cell)]
        return cls(len(cells), len(numeric), numeric[-1] if numeric else 0)

    @property
    def is_reading(self) -> bool:
        """Whether it holds two numbers or more."""
        return self.numbers >= 2


def layout_of(
    count: int, row_at: Callable[[int], Row | None], is_regular: Callable[[int, int, int], bool] | None = None
) -> Layout | None:
    """The first long run of rows of two numbers or more: a table of results above the readings is short.

    Parameters
    ----------
    count : int
        How many rows there are.
    row_at : callable
        A row by its number; None where there is none.
    is_regular : callable, optional
        Whether so many rows from a number on hold so many cells each, all of them numbers: one look at all of them.
    """
    runs: list[tuple[int, Layout]] = []
    at, end = 0, min(count, _MAX_HEAD)
    while at < end:
        row = row_at(at)
        if row is None or not row.is_reading:
            at += 1
            continue
        first, cells, last = at, row.cells, row.last
        # A row with one number of as many cells is one of them, with a cell that is none.
        while first and (above := row_at(first - 1)) and above.numbers and above.cells == cells:
            first -= 1
        if row.numbers == cells and is_regular is not None and is_regular(at, _CERTAIN, cells):
            at += _CERTAIN
        while row is not None and row.is_reading and at - first < _CERTAIN:
            cells, last = max(cells, row.cells), max(last, row.last)
            at += 1
            row = row_at(at) if at < end else None
        runs.append((at - first, Layout(first, cells, last)))
        if at - first >= _CERTAIN:
            break
    longest = max((length for length, _ in runs), default=0)
    return next((layout for length, layout in runs if 2 * length >= longest), None)


def find_names(
    source: Source,
    above: Sequence[list[str]],
    comments: Sequence[str],
    layout: Layout,
    options: Options,
    split: Callable[[str, str], list[str]],
) -> tuple[list[str], list[str]]:
    """Names of the columns, as many as there are, and their units where a comment says them.

    Parameters
    ----------
    above : sequence of lists of str
        Cells of the rows above the numbers.
    comments : sequence of str
        Without what marks them.
    layout : Layout
        Of the rows of numbers.
    split : callable
        Cells of a text at a separator; at none, the file's own.

    Raises
    ------
    FileFormatError
        If there are none, or it cannot be told which belongs to which column.
    """
    _require_one_order(source, comments)
    units = next((found for text in comments if (found := _units(text, layout))), [])
    rows = [_unlabelled(cells, layout) for cells in above[-_MAX_PREAMBLE:]]
    rows = [
        names
        for names in rows
        if len(names) >= 2 and sum(map(is_number, names)) < 2 and not is_unit_row(names)
    ]
    fitting = [names for names in reversed(rows) if layout.numbers <= len(names) <= layout.cells]
    said = (names for text in reversed(comments) for names in _commented_names(text, layout, split))
    seen: list[list[str]] = []
    for names in chain(fitting, said):
        if serves(names, options):
            return names, units
        seen.append(names)
    # Names over fewer cells: the first of them is one for certain, or it may be anything.
    for names in reversed(rows):
        if len(names) > layout.cells and _is_name(names[0]) and serves(names, options):
            return names, units
        if len(names) < layout.numbers and serves(names, options):
            return names, units  # refused with the row that has more
    if _by_number(options, layout.cells):
        return fitting[0] if fitting else [f"column {at}" for at in range(1, layout.cells + 1)], units
    if seen:
        return seen[0], units
    others = [names for names in rows if len(names) != layout.cells] or [
        row for text in reversed(comments) if len(row := split(text, "")) > layout.cells
    ]
    what = (
        f"has {len(others[-1])} names ({names_there(others[-1])}) over {layout.cells} columns of numbers: which "
        "belongs to which is not known"
        if others and len(others[-1]) > layout.cells
        else "has no row of names above its numbers"
    )
    raise FileFormatError(
        f"{source.name} {what}; write one with units, such as 'depth (um),force (mN)', or say the columns by "
        'number with units: columns = { depth = "2 (nm)", force = "3 (mN)" }'
    )


def _require_one_order(source: Source, comments: Sequence[str]) -> None:
    """Refuse comments that name the columns anew in another order, as above each segment."""
    said = [text.partition(":") for text in comments]
    orders = {
        " ".join(rest.split()) for label, colon, rest in said if colon and plain(label).strip() in _LABELS
    }
    if len(orders) > 1:
        raise FileFormatError(
            f"{source.name} names its columns {len(orders)} times in different ways; save each part as a file of "
            "its own"
        )


def serves(names: Sequence[str], options: Options) -> bool:
    """Whether a row of names holds what is asked for, or a depth and a force."""
    if options.columns:
        asked = (str(text) for text in options.columns.values())
        return all(parse_column(text, names) is not None for text in asked) and _serves_by_name(
            [*names], {role: str(text) for role, text in options.columns.items()}
        )
    if _serves_by_name(names, None) or tests_beside(names):
        return True
    sides = sides_of(names)
    return bool(sides) and _serves_by_name(next(iter(sides.values()))[1], None)


def _serves_by_name(names: Sequence[str], mapping: dict[str, str] | None) -> bool:
    there = find_columns(names, mapping).keys()
    return bool(there & {"depth", "travel", "height"}) and bool(there & {"force", "deflection"})


def _by_number(options: Options, count: int) -> bool:
    """Whether the columns are asked for by number."""
    numbered = [f"column {at}" for at in range(1, count + 1)]
    asked = (str(text) for text in (options.columns or {}).values())
    return bool(options.columns) and all(parse_column(text, numbered) is not None for text in asked)


def _is_name(text: str) -> bool:
    return kind_named(split_label(text)[1]) not in (None, "dimensionless")


def _unlabelled(names: list[str], layout: Layout) -> list[str]:
    """Names without the label in front of them, and without the empty cell behind them."""
    while names and not names[-1] and len(names) > layout.cells:
        names = names[:-1]
    first = names[0] if names else ""
    label = first.endswith(":") or plain(first).strip(" :=") in _LABELS
    if not label or len(names) <= layout.numbers:
        return names
    return names[2:] if len(names) > 1 and names[1] in {"=", ":"} else names[1:]


def _commented_names(text: str, layout: Layout, split: Callable[[str, str], list[str]]) -> list[list[str]]:
    """Ways to take a comment for the names of the columns, as many as there are."""
    if _COUNTED.match(text):
        text = _COUNT.sub(" ", text)
    label, colon, rest = text.partition(":")
    texts = [rest, text] if colon and len(label.split()) <= 2 else [text]
    ways = [split(one.strip(), each) for one in texts for each in ("", "\t", ";", ",", " ")]
    for one in texts:
        try:
            ways += [shlex.split(one), one.split(), with_units(one)]
        except ValueError:  # a quote without its end
            continue
    named = [_unlabelled([name.strip() for name in names], layout) for names in ways]
    return [
        names
        for names in named
        if layout.numbers <= len(names) <= layout.cells
        and not any(is_number(name) or name.endswith(":") for name in names)
    ]


def with_units(text: str) -> list[str]:
    """Words of a text, and a unit in brackets with the word before it."""
    words: list[str] = []
    for word in text.split():
        if words and word[0] in "([{<" and word[-1] in ")]}>":
            words[-1] += f" {word}"
        else:
            words.append(word)
    return words


def _units(text: str, layout: Layout) -> list[str]:
    """Units of all columns, where a comment says them after a label."""
    label, colon, rest = text.partition(":")
    words = rest.replace(",", " ").replace(";", " ").split() if colon else text.split()[1:]
    first = plain(label if colon else (text.split() or [""])[0])
    if first in _UNITS and layout.numbers <= len(words) <= layout.cells:
        return words
    bare = [word.strip("()[]") for word in text.replace(",", " ").replace(";", " ").split()]
    alone = all(map(is_unit, bare)) and layout.numbers <= len(bare) <= layout.cells
    return bare if alone else []


def stated_lever(lines: Sequence[str]) -> dict[str, float]:
    """The calibration of a lever that the head of an export states: ``stiffness`` (N/m), ``sensitivity`` (m/V)."""
    found: dict[str, float] = {}
    for line in lines:
        spring, sensitivity = _SPRING.search(line), _SENSITIVITY.search(line)
        if spring and _positive(spring[1]):
            found.setdefault("stiffness", float(spring[1]))
        if sensitivity and _positive(sensitivity[1]):
            found.setdefault(
                "sensitivity", float(sensitivity[1]) * unit_factor(sensitivity[2], "sensitivity")
            )
    return found


def _positive(text: str) -> bool:
    return is_number(text) and float(text) > 0.0


def is_unit_row(cells: Sequence[str]) -> bool:
    """Whether cells are units, or nothing."""
    filled = [bare for cell in cells if (bare := cell.strip().strip('"').strip("()[]{}<>").strip())]
    if not filled or not any(map(is_unit, filled)):
        return False
    return all(is_unit(cell) or len(cell) <= _LONGEST_UNIT for cell in filled) and not any(
        map(is_number, filled)
    )
