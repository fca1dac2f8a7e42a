"""What a table holds besides the readings of one test: rows of statistics, tables of results, further tests.

Each looks like readings, and a curve of it could be fitted. Statistics that a spreadsheet leaves below the
readings are left out with a note (`without_statistics`), a table with one row for each test is refused
(`require_readings`), and several tests one below the other are told apart (`beginnings`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, median
from underlay._text import names_there
from underlay.data.curve import MIN_POINTS
from underlay.data.readers._source import SHOWN, Source
from underlay.data.readers._text import bare_cell, is_number, kind_named, split_label, words

_STATISTICS, _OF_A_TEST, _NUMBERED = words("statistics"), words("of_a_test"), words("numbered")
_NAMED = words("named")
# No word for a statistic is longer: who looks for brackets in a cell without end looks for long.
_LONGEST = 60
# A reading may be named by its time, in words (8:00:16 AM, 26 Nov 2026), and have its unit beside each number.
_CLOCK = re.compile(
    r"(?:[\d\s:.,/+-]|[ap]\.?m\.?|[tz]|jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec|mon|tue|wed|thu|fri|sat|sun)*",
    re.IGNORECASE,
)
_WITH_UNIT = re.compile(r"[+-]?[\d.,]+(?:e[+-]?\d+)?\s*[^\d\s_]{1,6}", re.IGNORECASE)
_FEWEST = 3
# A motion that passes over its range as often as a third of its rows allows leaps; one of many cycles has a dozen
# readings a way.
_LEAPS = 6.0
# Forces that differ by less are those of one load of many tests.
_SAME = 0.02
# A test goes in by this share of the depths of all; a depth that goes on does not leap by
# as much between two readings. The published tables in which this was met (public AFM and Instron exports) have 60
# readings a test and more.
_WAY = 0.3
# Where rows mark it, a leap is one of this many steps.
_STEPS, _SMALL = 10.0, 0.1
# Blank rows between all rows mark nothing.
_DENSE = 0.25


def without_statistics(rows: Sequence[Sequence[str]]) -> tuple[Sequence[Sequence[str]], tuple[str, ...]]:
    """Drop rows of statistics (mean, SD, ...) at the foot of a table; return the rows and a note on those dropped.

    A row of statistics holds such a word in any of its cells; blank rows may stand between them.
    """
    end = len(rows)
    found: list[str] = []
    for number in range(len(rows), 0, -1):
        cells = list(map(bare_cell, rows[number - 1]))
        word = next((cell for cell in cells if _is_statistic(cell)), None)
        if word is None and any(cells):
            break
        if word is not None:
            found.insert(0, word)
        if found:
            end = number - 1
    if not found:
        return rows, ()
    return rows[:end], (f"not read: rows of statistics at the foot of the table, {names_there(found)}",)


def _is_statistic(cell: str) -> bool:
    """Whether a cell names a statistic, or several such as "Mean ± SD"; text in brackets is ignored."""
    if len(cell) > _LONGEST or is_number(cell):
        return False
    bare = re.sub(r"[(\[].*?[)\]]", "", cell.lower())
    return all(part.rstrip(" .:=%()").strip() in _STATISTICS for part in re.split(r"±|\+/?-|[/&]", bare))


def require_readings(
    source: Source,
    labels: Sequence[str],
    units: Sequence[str],
    rows: Sequence[Sequence[str]],
    depth: FloatArray,
    force: FloatArray,
) -> None:
    """Refuse a table of results (one row for each test), which could be mistaken for the curve of one test.

    ASMEC and Fischer write such tables, and people type them: a row holds the force and the depth at the peak
    of a test, its modulus and its hardness. Read as a curve, 220 tests of a public file (TriDiMap,
    ``ASMEC_example_20x11.xlsx``) were 220 points. What tells them: a name in every row, words for what only a
    whole test has (its work, its creep, its final depth), or a modulus beside depths and forces that leap
    from row to row. A curve that carries its modulus point by point, as of a continuous stiffness, does none
    of these.

    Parameters
    ----------
    labels, units : sequence of str
        Name and unit of each column.
    rows : sequence of sequences of str
        Cells of the table.
    depth, force : ndarray (n,)
        Depth and force as read from the cells, in any unit.

    Raises
    ------
    FileFormatError
        If its rows are tests and not readings.
    """
    some = rows[:SHOWN]
    why = (
        _names_of_tests(labels, some)
        or _words_of_tests(labels)
        or _side_by_side_moduli(labels, units, some, depth, force)
    )
    source.require(
        not why,
        f"is a table of results, a row for each test, not the readings of one: {why}. Export the readings of each "
        "test, its depth, force and time; if the rows are readings after all, give columns with both names, such "
        'as columns = { depth = "h (um)", force = "F (mN)" }',
    )


def _names_of_tests(labels: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    # Nearly all columns end at their first cell.
    first = rows[0] if len(rows) >= _FEWEST else ()
    for index, cell in enumerate(first[: len(labels)]):
        if _is_name(cell):
            names = [bare_cell(row[index]) for row in rows if index < len(row)]
            if len(set(names)) == len(rows) and all(map(_is_name, names)):
                return f"the column {labels[index].strip()!r:.80} names each row, as {names[0]!r:.40}"
    return ""


def _is_name(cell: str) -> bool:
    text = bare_cell(cell)
    sound = text and len(text) <= SHOWN and not is_number(text)
    return bool(sound) and _CLOCK.fullmatch(text) is None and _WITH_UNIT.fullmatch(text) is None


def _words_of_tests(labels: Sequence[str]) -> str:
    found = [label for label in labels if split_label(label)[0].strip().lower() in _OF_A_TEST]
    return f"it has {names_there(found)}" if len(found) > 1 else ""


def is_count(label: str, *, of_tests: bool = False) -> bool:
    """Whether the name of a column says that it numbers tests, such as "test no.".

    With `of_tests` also where it holds the name of a test, repeated in each of its rows. A column that numbers
    readings, "point" or "no.", is not meant.
    """
    name = " ".join(split_label(label)[0].strip(" .#").lower().replace("_", " ").split())
    return name in _NUMBERED or (of_tests and name in _NAMED)


def _side_by_side_moduli(
    labels: Sequence[str],
    units: Sequence[str],
    rows: Sequence[Sequence[str]],
    depth: FloatArray,
    force: FloatArray,
) -> str:
    moduli = [label for label, unit in zip(labels, units, strict=True) if kind_named(unit) == "pressure"]
    if not moduli:
        return ""
    there = f"it has {names_there(moduli)}, and"
    for index, label in enumerate(labels):
        if is_count(label):
            numbers = [row[index].strip() for row in rows if index < len(row)]
            if len(numbers) >= _FEWEST and len(set(numbers)) == len(numbers):
                return f"{there} the column {label.strip()!r:.80} numbers its rows"
    if _leaping(depth) and _leaping(force):
        return f"{there} its depths and forces leap from row to row"
    same = _leaping(depth) and np.ptp(force) <= _SAME * np.abs(np.median(force))
    return f"{there} its depths leap from row to row while its forces are all the same" if same else ""


def _leaping(values: FloatArray) -> bool:
    values = values[np.isfinite(values)]
    way = float(np.abs(np.diff(values)).sum())
    return len(values) >= MIN_POINTS and way > float(np.ptp(values)) * len(values) / _LEAPS


# --- several tests one below the other


def beginnings(
    depth: FloatArray,
    time: FloatArray | None,
    breaks: Sequence[int],
    clocks: Callable[[], Iterable[FloatArray]],
) -> list[int]:
    """Find the rows at which a test begins in a table of tests one below the other; ``[0]`` for a single test.

    A test may begin after blank rows or a row of names that is repeated, where a clock is set back, or where
    the depth jumps. If the depth is near its start there and then increases, it is a new test rather than the next
    segment of one.

    Parameters
    ----------
    depth, time : ndarray (n,)
        As read; NaN where a value is missing.
    breaks : sequence of int
        Rows before which a blank line or a repeated row of names stands.
    clocks : callable
        Gives the other columns of numbers, one of which may be a clock; called only where the depth returns to its
        start and increases again.
    """
    count = len(depth)
    if count < 2 * MIN_POINTS:
        return [0]
    goes_on = time is None or not (time[1:] < time[:-1]).any()
    if not breaks and goes_on and (depth[1:] >= depth[:-1]).all():  # as most curves do
        return [0]
    filled = _filled(depth)
    extent = float(np.ptp(filled))
    if not extent > 0.0:
        return [0]
    motion = _Motion(filled, extent)
    marked = [row for row in breaks if 0 < row < count] if len(breaks) < _DENSE * count else []
    certain = {row for row in marked if motion.begins(row)} | {
        row for row in motion.leaps() if motion.goes_in(row)
    }
    found = [time] if time is not None else (clocks() if not certain and motion.comes_back() else [])
    for clock in found:
        certain |= _set_back(clock, motion)
    return _apart(sorted(certain), count)


def stacked_note(rows: Sequence[int]) -> str:
    """Note for the metadata that a table holds several tests, which begin at these rows (counted from 0)."""
    where = ", ".join(str(row + 1) for row in rows[1:6])
    more = ", ..." if len(rows) > 6 else ""
    return (
        f"the table holds {len(rows)} tests one below the other: the depth begins again in row "
        f"{where}{more}; each is read as a test of its own"
    )


class _Motion:
    """Depth readings (n,) of a table, turned to grow with the first motion, their range and typical step."""

    def __init__(self, depth: FloatArray, extent: float) -> None:
        self.start = median(depth[:3])
        far = int(np.abs(depth - self.start).argmax())
        self.into = 1.0 if depth[far] >= self.start else -1.0
        self.depth, self.extent = self.into * depth, extent
        self.start *= self.into
        moved = np.abs(np.diff(depth))
        self.step = median(moved[moved > 0.0]) if (moved > 0.0).any() else 0.0

    def leaps(self) -> list[int]:
        """Rows before which the depth falls back in a single step too large for a motion of the instrument."""
        back = -np.diff(self.depth)
        far = back > max(_WAY * self.extent, 0.5 * _STEPS * self.step)
        return [int(row) + 1 for row in np.flatnonzero(far)]

    def goes_in(self, row: int) -> bool:
        """Whether the depth, from a row on, first moves far by increasing rather than by decreasing."""
        ahead = self.depth[row:] - self.depth[row]
        far = np.flatnonzero(np.abs(ahead) > _WAY * self.extent)
        return bool(far.size and ahead[far[0]] > 0.0)

    def begins(self, row: int) -> bool:
        """Whether a test begins at a row: the depth is near its start, or jumps, and increases from then on."""
        leap = abs(self.depth[row] - self.depth[row - 1])
        near = abs(self.depth[row] - self.start) <= _WAY * self.extent
        again = near or leap > max(_SMALL * self.extent, _STEPS * self.step)
        return again and self.goes_in(row) and bool(np.ptp(self.depth[:row]) > _WAY * self.extent)

    def comes_back(self) -> bool:
        """Whether the depth returns near its start after it was deep, and then becomes deep once more."""
        pressed = self.depth - self.start
        far = np.flatnonzero(pressed > 0.5 * self.extent)
        if not far.size:
            return False
        near = np.flatnonzero(pressed[far[0] :] < _SMALL * self.extent)
        return bool(near.size) and bool((pressed[far[0] + near[0] :] > 0.5 * self.extent).any())


def _set_back(clock: FloatArray, motion: _Motion) -> set[int]:
    """Rows at which a clock is set back and the depth begins again.

    None where the clock is also set back at other rows, as by an instrument that does so at each segment.
    """
    if not np.isfinite(clock).any():
        return set()
    ticks = np.diff(_filled(clock))
    rows = [int(row) + 1 for row in np.flatnonzero(ticks < 0.0)]
    # What falls as often as that is a reading and no clock.
    if not rows or len(rows) * MIN_POINTS > len(clock):
        return set()
    begun = {row for row in rows if motion.begins(row)}
    return begun if len(begun) == len(rows) else set()


def _filled(values: FloatArray) -> FloatArray:
    """Replace each missing value (NaN) by the last finite one before it; leading ones by the first."""
    there = np.isfinite(values)
    if there.all():
        return values
    if not there.any():
        return np.zeros(len(values))
    last: NDArray[np.intp] = np.maximum.accumulate(np.where(there, np.arange(len(values)), 0))
    last[: int(there.argmax())] = int(there.argmax())
    return values[last]


def _apart(rows: Sequence[int], count: int) -> list[int]:
    """Keep those rows, after row 0, that leave enough readings for a test before and after them, of `count`."""
    kept = [0]
    for row in rows:
        if row - kept[-1] >= MIN_POINTS and count - row >= MIN_POINTS:
            kept.append(row)
    return kept
