"""Where the numbers of a plain table begin, and what its columns are called.

A file may begin with pages of settings, a table of results or comments. `layout_of` finds the first long run
of rows of numbers; `find_names` then looks for as many names in the rows above it, else in the comments. Tests may
stand side by side (`side_by_side`), and so may approach and way back, of which one may stand alone (`sides_of`).
"""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import NamedTuple, TypeAlias

from underlay._text import names_there
from underlay.data.readers._columns import find_columns, parse_column
from underlay.data.readers._source import Source
from underlay.data.readers._text import (
    SEGMENT_OF,
    is_number,
    is_unit,
    kind_named,
    plain,
    split_label,
    unit_named,
    without_brackets,
    words,
)
from underlay.data.segments import LOADING, UNLOADING
from underlay.units import unit_factor

#: What a caller asks for of each role.
Asked: TypeAlias = Mapping[str, str | int] | None
# How far down a table may begin (the head of a NanoScope export has 658 lines), how many rows in a run are one for
# certain, and how far above them the names may stand.
_MAX_HEAD, _CERTAIN, _MAX_PREAMBLE = 4000, 24, 80
# Rows of units stand as near the numbers.
_UNITS_ABOVE = 3
# Letters of a unit that is not among the usual ones, such as "1/s" or "mm/min".
_LONGEST_UNIT = 8
# What may stand in front of the names, in place of one, and in front of their units.
_LABELS, _UNITS = words("labels"), words("units")
# "\\Spring Constant: 0.06", "springConstant: 0.06": N/m in every file seen; "DeflSens: V 41.0 nm/V".
_SPRING = re.compile(
    r"\\?spring\s?constant[^:=\d]{0,12}[:=]\s*([\d.]+(?:e[+-]?\d+)?)\s*(\w+/\w+)?", re.IGNORECASE
)
_SENSITIVITY = re.compile(
    r"(?:defl\w*\.?\s?sens\w*|invols|sensitivity)[^\d\n]{0,12}([\d.]+(?:e[+-]?\d+)?)\s*([num]?m/V|$)",
    re.IGNORECASE,
)
# AFM Workshop: nN/nm is N/m, mV/nm an inverse sensitivity; a 1 is written where nothing was calibrated.
_WORKSHOP = re.compile(r"(Force Constant, nN/nm|Light Lever Gain, mV/nm):\s*([\d.]+)\s*")
_UNSET = (0.0, 1.0)
# "Column 1: time (s)", one a line; "1: time 2: depth", "[1] time [2] depth".
_ONE_A_LINE = re.compile(
    r"\W*(?:column|col\.?|spalte|colonne|columna|channel|kanal)?\s*#?(\d{1,3})\s*[\]:.)=]\s*(\D.*)",
    re.IGNORECASE,
)
_NUMBERED, _COUNT = re.compile(r"\W*1[\]:.)]\s*[^\W\d]"), re.compile(r"\[?\b\d{1,3}[\]:.)]\s*(?=[^\W\d])")
# Tests side by side, as Anton Paar writes them: "X_gel_1_Time_[s]", "Y_gel_1_Fn_[mN]"; and waves of Asylum's Igor
# program, "F0001Raw", "F0001Defl": in SI where no unit is said.
_SIDE_BY_SIDE = (
    re.compile(r"[XY][_ ](?P<test>.+)[_ ](?P<name>Time|Fn|Pd)[_ ]*[\[(](?P<unit>[^\])]+)[\])]\s*"),
    re.compile(
        r"(?P<test>.*?)_?(?P<name>DeflVolts|DeflV|Defl|Raw|ZSnsr|LVDT|Force|Sep|Ind)"
        r"(?:[_ ]*[\[(]?(?P<unit>[num]?m|[pnum]?N|m?V)[\])]?)?"
    ),
)
# "depth 1", "Force_B"; pandas counts a name that it met before: "depth (um).1".
_COUNTED, _PANDAS = (
    re.compile(r"(.*?[^\W\d])[\s._#-]*(\d{1,3}|(?<=[\s._#-])[A-H])"),
    re.compile(r"(.*\S)\.(\d{1,3})"),
)
# What a test needs to be one.
_COMPLETE = [{"Fn", "Pd"}] + [
    {force, travel}
    for force in ("Defl", "DeflV", "DeflVolts", "Force")
    for travel in ("Raw", "ZSnsr", "LVDT", "Sep", "Ind")
]
_WAVES_ALONE = frozenset({"Raw", "Defl", "DeflV", "DeflVolts", "ZSnsr", "LVDT"})
_WAVE_NAMES = {"DeflV": "Defl", "DeflVolts": "Defl"}
_WAVE_UNITS = {"DeflV": "V", "DeflVolts": "V", "Force": "N"}


def side_by_side(labels: Sequence[str], file: str = "") -> Sequence[tuple[str, list[int], list[str]]]:
    """Find tests that stand side by side in the columns of one table; [] for any other table.

    `labels` are the names of all columns, `file` the name that numbered tests get. Each entry returned is the name
    of a test, the indices of its columns and their labels.
    """
    for pattern in _SIDE_BY_SIDE:
        found: dict[str, dict[str, tuple[int, str]]] = {}
        for index, label in enumerate(labels):
            matched = pattern.fullmatch(label.strip().strip('"'))
            if matched and (matched["test"] or matched["name"] in _WAVES_ALONE):
                name = matched["name"]
                text = f"{_WAVE_NAMES.get(name, name)} ({matched['unit'] or _WAVE_UNITS.get(name, 'm')})"
                found.setdefault(matched["test"], {}).setdefault(name, (index, text))
        tests = [
            (test, [index for index, _ in parts.values()], [label for _, label in parts.values()])
            for test, parts in found.items()
            if any(one <= parts.keys() for one in _COMPLETE)
        ]
        if tests:
            return tests
    return _repeated(labels, file)


def _repeated(labels: Sequence[str], file: str) -> Sequence[tuple[str, list[int], list[str]]]:
    """Find tests side by side whose columns have the same names, up to a number or letter at their ends.

    So testing machines and spreadsheets write several specimens. A column of time that stands alone is that of all.
    """
    seen: list[tuple[str, str]] = []
    for label in map(str.strip, labels):
        name, unit = split_label(label)
        matched = _PANDAS.fullmatch(label) or _COUNTED.fullmatch(name)
        base, mark = matched.groups() if matched else (label, "")
        seen.append((f"{base} ({unit})" if matched and unit and "(" not in base else base, mark))
    count, before = Counter(base for base, _ in seen), Counter[tuple[str, str]]()
    tests: dict[tuple[str, int], list[tuple[int, str]]] = {}
    for index, (base, mark) in enumerate(seen):
        if base and count[base] > 1:  # by its mark, or as the same name once more
            tests.setdefault((mark, before[base, mark]), []).append((index, base))
            before[base, mark] += 1
    names = [sorted(base for _, base in test) for test in tests.values()]
    if len(tests) < 2 or any(one != names[0] for one in names) or not _serves_by_name(names[0], None):
        return []
    alone = [
        (at, base) for at, (base, _) in enumerate(seen) if count[base] == 1 and "time" in find_columns([base])
    ]
    return [
        (f"{file}, test {number}", [at for at, _ in columns], [base for _, base in columns])
        for number, columns in enumerate((alone + test for test in tests.values()), start=1)
    ]


def sides_of(labels: Sequence[str]) -> Mapping[str, tuple[list[int], list[str]]]:
    """Find approach and retraction that stand side by side in one table; {} for any other table.

    Maps the segment label (loading, unloading) to the indices of its columns and to their labels without the word
    for the direction.
    """
    found: dict[str, tuple[list[int], list[str]]] = {LOADING: ([], []), UNLOADING: ([], [])}
    for index, label in enumerate(labels):
        joint = "_" if "_" in label else " "
        words = label.strip().split("_" if joint == "_" else None)
        directions = [word for word in words if SEGMENT_OF.get(word.lower()) in found]
        if len(directions) == 1:
            indices, names = found[SEGMENT_OF[directions[0].lower()]]
            indices.append(index)
            names.append(joint.join(word for word in words if word != directions[0]))
    there, back = found[LOADING][1], found[UNLOADING][1]
    # One way alone has its word in every name.
    both = sorted(there) == sorted(back) or len(there) == len(list(filter(str.strip, labels)))
    return {side: way for side, way in found.items() if way[0]} if len(there) >= 2 and both else {}


class Layout(NamedTuple):
    """Where a table stands in a file.

    `first` is its first row of numbers, `cells` the most cells of a row, `numbers` the last cell that holds a
    number (counted from 1).
    """

    first: int
    cells: int
    numbers: int

    def fits(self, names: Sequence[str]) -> bool:
        """Whether there are as many names as columns: `numbers` to `cells`, as cells at the end may be text."""
        return self.numbers <= len(names) <= self.cells


class Row(NamedTuple):
    """Count of the cells of a row, of the numbers among them, and the last cell that is a number (from 1)."""

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
        """Whether the row holds two numbers or more, as a row of readings does."""
        return self.numbers >= 2


def layout_of(
    count: int, row_at: Callable[[int], Row | None], is_regular: Callable[[int, int, int], bool] | None = None
) -> Layout | None:
    """Find the table of readings in a file: the first run of rows of numbers at least half as long as the longest.

    A row of numbers has two of them or more. A shorter run above, such as a table of results, is passed over. None
    without such a row.

    Parameters
    ----------
    count : int
        Number of rows in the file.
    row_at : callable
        `Row` by its index; None for a row that is a comment or holds no table.
    is_regular : callable, optional
        Called with the index of a row, a count of rows and a count of cells: whether these rows hold so many cells
        each, all of them numbers. A faster check than row by row.
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
    asked: Asked,
    split: Callable[[str, str], list[str]],
) -> tuple[list[str], list[str]]:
    """Find the names of the columns, one for each, and their units where a comment states them (else []).

    Parameters
    ----------
    above : sequence of lists of str
        Cells of the rows above the numbers.
    comments : sequence of str
        Comment lines without their comment marks.
    layout : Layout
        Where the rows of numbers stand.
    asked : mapping, optional
        Column mapping of the caller.
    split : callable
        Splits a text into cells at a separator; an empty one stands for the separator of the file.

    Raises
    ------
    FileFormatError
        If there are no names, or it is not clear which name belongs to which column.
    """
    # Comments that name the columns anew in another order, as above each segment.
    said = (text.partition(":") for text in comments)
    labelled = [rest.strip() for label, colon, rest in said if colon and plain(label).strip() in _LABELS]
    orders = {" ".join(text.split()) for text in labelled}
    source.require(
        len(orders) < 2,
        f"names its columns {len(orders)} times in different ways; save each part as a file of its own",
    )
    units = next((found for text in comments if (found := _units(text, layout))), [])
    rows = [
        names
        for cells in above[-_MAX_PREAMBLE:]
        if len(names := _unlabelled(cells, layout)) >= 2
        and sum(map(is_number, names)) < 2
        and not is_unit_row(names)
    ]
    fitting = [names for names in reversed(rows) if layout.fits(names)]
    commented = (names for text in reversed(comments) for names in _commented_names(text, layout, split))
    seen: list[list[str]] = []
    for names in chain(fitting, _one_a_line(comments, layout), commented):
        if serves(names, asked):
            return names, units
        seen.append(names)
    # Names over fewer cells: the first of them is one for certain, or it may be anything. Under fewer names the
    # table is refused with the row that has more.
    for names in reversed(rows):
        certain = kind_named(split_label(names[0])[1]) not in (None, "dimensionless")
        wide = len(names) > layout.cells and certain
        if (wide or len(names) < layout.numbers) and serves(names, asked):
            return names, units
    numbered = [f"column {at}" for at in range(1, layout.cells + 1)]
    if asked and all(parse_column(str(text), numbered) is not None for text in asked.values()):
        return fitting[0] if fitting else numbered, units
    if seen:
        return seen[0], units
    others = [names for names in rows if len(names) != layout.cells] or [
        row for text in (*comments, *labelled) if len(row := split(text, "")) > layout.cells
    ]
    what = (
        f"has {len(others[-1])} names ({names_there(others[-1])}) over {layout.cells} columns of numbers: which "
        "belongs to which is not known"
        if others and len(others[-1]) > layout.cells
        else "has no row of names above its numbers"
    )
    raise source.wrong(
        f"{what}; write one with units, such as 'depth (um),force (mN)', or say the columns by "
        'number with units: columns = { depth = "2 (nm)", force = "3 (mN)" }'
    )


def serves(names: Sequence[str], asked: Asked) -> bool:
    """Whether a row of names has all columns of the caller's mapping; without one, a depth and a force."""
    if asked:
        named = all(parse_column(str(text), names) is not None for text in asked.values())
        return named and _serves_by_name(names, asked)
    sides = (labels for _, labels in sides_of(names).values())
    return any(_serves_by_name(labels, None) for labels in (names, *sides)) or bool(side_by_side(names))


def _serves_by_name(names: Sequence[str], asked: Asked) -> bool:
    there = find_columns(names, asked).keys()
    return bool(there & {"depth", "travel", "height"}) and bool(there & {"force", "deflection"})


def _unlabelled(names: list[str], layout: Layout) -> list[str]:
    """Drop from a row of names the label in front of it, such as "columns:", and empty cells at its end."""
    while names and not names[-1] and len(names) > layout.cells:
        names = names[:-1]
    first = names[0] if names else ""
    label = first.endswith(":") or plain(first).strip(" :=") in _LABELS or not (first or layout.fits(names))
    if not label or len(names) <= layout.numbers:
        return names
    return names[2:] if len(names) > 1 and names[1] in {"=", ":"} else names[1:]


def _one_a_line(comments: Sequence[str], layout: Layout) -> list[list[str]]:
    """Names from comments such as "Column 1: time (s)", one a line, if they are as many as the columns; else []."""
    found = [matched for text in comments if (matched := _ONE_A_LINE.fullmatch(text))]
    names = [matched[2].strip() for matched in found]
    is_numbered = [int(matched[1]) for matched in found] == list(range(1, len(found) + 1))
    return [names] if is_numbered and layout.fits(names) else []


def _commented_names(text: str, layout: Layout, split: Callable[[str, str], list[str]]) -> list[list[str]]:
    """All ways to split a comment into names of the columns that give as many names as there are columns."""
    if _NUMBERED.match(text):
        text = _COUNT.sub(" ", text)
    label, colon, rest = text.partition(":")
    texts = [rest, text] if colon and len(label.split()) <= 2 else [text]
    splits = [split(one.strip(), each) for one in texts for each in ("", "\t", ";", "|", ",", " ")]
    for one in texts:
        try:
            splits += [shlex.split(one), one.split(), with_units(one)]
        except ValueError:  # a quote without its end
            continue
    named = [_unlabelled([name.strip() for name in names], layout) for names in splits]
    return [
        names
        for names in named
        if layout.fits(names) and not any(is_number(name) or name.endswith(":") for name in names)
    ]


def with_units(text: str) -> list[str]:
    """Split a text at blanks, but keep a unit in brackets with the word before it: "depth (um)" stays one."""
    words: list[str] = []
    for word in text.split():
        if words and word[0] in "([{<" and word[-1] in ")]}>":
            words[-1] += f" {word}"
        else:
            words.append(word)
    return words


def _units(text: str, layout: Layout) -> list[str]:
    """Units of all columns from a comment such as "units: um mN s" or "um, mN, s"; [] of any other comment."""
    label, colon, rest = text.partition(":")
    words = rest.replace(",", " ").replace(";", " ").split() if colon else text.split()[1:]
    if plain(label if colon else (text.split() or [""])[0]) in _UNITS and layout.fits(words):
        return words
    bare = [word.strip("()[]") for word in text.replace(",", " ").replace(";", " ").split()]
    return bare if all(map(is_unit, bare)) and layout.fits(bare) else []


def stated_lever(lines: Sequence[str]) -> dict[str, float]:
    """Read ``stiffness`` (N/m) and ``sensitivity`` (m/V) of a cantilever, if stated, from a text file's header."""
    found: dict[str, float] = {}
    for line in lines:
        for kind, pattern in (("stiffness", _SPRING), ("sensitivity", _SENSITIVITY)):
            stated = pattern.search(line)
            if stated and is_number(stated[1]) and float(stated[1]) > 0.0:
                # Where no unit is written, as by JPK, it is N/m or m/V.
                unit = stated[2] or {"stiffness": "N/m"}.get(kind, "m/V")
                found.setdefault(kind, float(stated[1]) * unit_factor(unit, kind))
        stated = _WORKSHOP.fullmatch(line)
        if stated and is_number(stated[2]) and (value := float(stated[2])) not in _UNSET:
            gain = stated[1].startswith("Light")
            found["sensitivity" if gain else "stiffness"] = 1e-6 / value if gain else value
    return found


def units_above(rows: Sequence[Sequence[str]]) -> list[str]:
    """Units of the columns, from a row of them among the last above the numbers; [] where there is none.

    Below it, Origin writes a row of comments.
    """
    return next((list(cells) for cells in reversed(rows[-_UNITS_ABOVE:]) if is_unit_row(cells)), [])


def is_same_unit_row(source: Source, cells: Sequence[str], units: Sequence[str]) -> bool:
    """Whether a row among the readings is one of units; FileFormatError where they are not the `units` of above."""
    if not is_unit_row(cells):
        return False
    said, before = ([unit_named(without_brackets(cell)) for cell in row] for row in (cells, units))
    source.require(
        not units or said[: len(before)] == before[: len(said)],
        f"says other units further down ({names_there(said)}) than above ({names_there(before)}); save each part "
        "as a file of its own",
    )
    return True


def is_unit_row(cells: Sequence[str]) -> bool:
    """Whether a row of cells is a row of units: at least one usual unit, and no numbers or long words beside it."""
    filled = [bare for cell in cells if (bare := without_brackets(cell))]
    return any(map(is_unit, filled)) and all(
        (is_unit(cell) or len(cell) <= _LONGEST_UNIT) and not is_number(cell) for cell in filled
    )
