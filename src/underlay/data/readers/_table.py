"""From a table with labelled columns to curves: which column is which, in which unit, and how many tests.

Every reader of plain tables, text or workbook, ends here. Tests may stand side by side, approach and way back
too, or one test below the other; a height or a scanner's travel with a lever's deflection becomes depth and
force. A column whose commas may be of thousands or of decimals is refused rather than guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.curve import MIN_POINTS, Curve
from underlay.data.readers._columns import (
    KNOWN,
    ROLES,
    Asked,
    Column,
    bare_name,
    check_mapping,
    find_columns,
    name_of,
    parse_column,
    unread,
)
from underlay.data.readers._format import Options, make_curve
from underlay.data.readers._lever import STILL_BENT, Lever
from underlay.data.readers._names import side_by_side, sides_of
from underlay.data.readers._not_readings import (
    beginnings,
    is_count,
    require_readings,
    stacked_note,
    without_statistics,
)
from underlay.data.readers._source import Source
from underlay.data.readers._text import (
    SAID,
    bare_cell,
    column_factor,
    is_number,
    kind_named,
    numbers,
    split_label,
    unit_named,
    without_brackets,
    words,
)
from underlay.data.segments import HOLD, LOADING, UNLOADING, against_motion
from underlay.data.signs import reversed_columns, sign_note
from underlay.errors import FileFormatError, InputError
from underlay.units import unit_factor

# 1,000 or 12.500: what separates thousands where nothing else is divided; and a number just below them.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:[.,]\d{3})+")
_PLAIN_HUNDREDS = re.compile(r"[+-]?[1-9]\d\d")
# Names from which a lever's bending is still to be taken off.
_SCANNER = frozenset((*KNOWN["travel"], *KNOWN["height"])) - words("of_a_stage")


@dataclass(frozen=True)
class Table:
    """A table of a file as text: names of its columns, rows of cells, and what the file says about them.

    Parameters
    ----------
    labels : sequence of str
        Name of each column, with or without its unit.
    rows : sequence of sequences of str
        The cells.
    breaks : sequence of int
        Rows before which a blank row or a repeated row of names stands.
    comma : bool, optional
        Whether the decimal sign is a comma; None to find out from the cells.
    commas_between : bool
        Whether commas separate the cells: a quoted ``"1,234"`` may then be a decimal or a thousand.
    units : sequence of str
        Unit of each column, where the file states them elsewhere, as in a comment.
    segments : sequence of (int, str)
        First row and label of each segment, where the file names them.
    starts : sequence of int
        First row of each test, where the file marks it.
    stated : mapping
        The calibration that the file states: ``stiffness`` (N/m), ``sensitivity`` (m/V).
    """

    labels: Sequence[str]
    rows: Sequence[Sequence[str]]
    breaks: Sequence[int] = ()
    comma: bool | None = None
    commas_between: bool = False
    units: Sequence[str] = ()
    segments: Sequence[tuple[int, str]] = ()
    starts: Sequence[int] = ()
    stated: Mapping[str, float] = field(default_factory=dict)

    def of(self, indices: Sequence[int], labels: Sequence[str]) -> Table:
        """Return a table of the columns `indices` only, named `labels`, without rows that are empty in all."""
        rows = [[row[at] if at < len(row) else "" for at in indices] for row in self.rows]
        units = [self.units[at] for at in indices] if self.units else ()
        kept = [row for row in rows if any(cell.strip() for cell in row)]
        return replace(self, labels=labels, rows=kept, units=units, breaks=())


def _column(rows: Iterable[Sequence[str]], at: int) -> list[str]:
    return [row[at] if at < len(row) else "" for row in rows]


def table_curves(source: Source, table: Table, options: Options, **metadata: Any) -> list[Curve]:
    """Make the curves of a table, one for each test in it.

    Raises
    ------
    FileFormatError
        If depth or force is missing (the message names the columns there are), or a cell of them is no number.
    UnitError
        If a column has no unit or one of the wrong kind.
    """
    check_mapping(options.columns)
    if options.columns is None and (tests := side_by_side(table.labels, source.path.stem)):
        return [
            curve
            for test, indices, labels in tests
            for curve in _curves(source, {"": table.of(indices, labels)}, options, {**metadata, "name": test})
        ]
    asked, directions = (options.columns or {}).values(), sides_of(table.labels)
    if directions and (not asked or any(parse_column(str(text), table.labels) is None for text in asked)):
        sides = {label: table.of(*way) for label, way in directions.items()}
        return _curves(source, sides, options, metadata)
    return _curves(source, {"": table}, options, metadata)


def _curves(
    source: Source, parts: Mapping[str, Table], options: Options, metadata: Mapping[str, Any]
) -> list[Curve]:
    """Make the curves of a table.

    `parts` is the table under the key ``""``, or approach and retraction as tables of their own, by segment label,
    which are joined into one curve.
    """
    read = [_Reader(source, table, options) for table in parts.values()]
    first, times = read[0], [one.time for one in read if one.time is not None]
    depth, force, bending = (
        np.concatenate([getattr(one, name) for one in read]) for name in ("depth", "force", "bending")
    )
    time = np.concatenate(times) if len(times) == len(read) else None
    labels: NDArray[np.str_] | None
    if len(parts) > 1:
        sides = zip(parts, read, strict=True)
        labels = np.concatenate([np.full(len(one.depth), label, dtype="<U9") for label, one in sides])
        starts: Sequence[int] = [0]
        remarks: Sequence[str] = ()
    else:
        labels, remarks = first.segments()
        starts = first.tests()
    notes = [*remarks, *metadata.get("notes", ()), *first.notes]
    if len(starts) > 1:
        notes.append(stacked_note(starts))
    about = {**metadata, "units": first.units, "sign_rules": first.signs, "notes": notes, **first.known}
    curves = []
    for number, (start, end) in enumerate(zip(starts, [*starts[1:], len(depth)], strict=True), start=1):
        here = slice(start, end)
        if len(starts) > 1:
            about["name"] = f"{metadata.get('name') or source.path.stem}, test {number}"
        clock = None if time is None else time[here]
        segment = None if labels is None else labels[here]
        beside = {"bending": bending[here]} if first.free else {}
        curve = make_curve(source, depth[here], force[here], clock, segment, columns=beside, **about)
        curves.append(_with_signs(curve, free=first.free))
    return curves


def _with_signs(curve: Curve, *, free: bool) -> Curve:
    """Add a note if depth or force looks reversed; if `free`, a travel of either direction is turned instead.

    The column ``bending`` (m), if there is one, was taken off the travel; it is dropped.
    """
    notes, bending = curve.metadata["notes"], curve.columns.get("bending", 0.0)
    curve = replace(curve, columns={})
    travel = replace(curve, depth=curve.depth + bending).with_metadata(bending_taken_off=False)
    if free and reversed_columns(travel) == ("depth",):
        rules = {**curve.metadata["sign_rules"], "depth": "turned: the first motion goes into the sample"}
        note = "the depth is turned: its column may grow either way, and the first motion of a test goes in"
        turned = replace(curve, depth=-curve.depth - 2.0 * bending)
        return turned.with_metadata(sign_rules=rules, notes=(*notes, note))
    doubt = sign_note(curve)
    return curve.with_metadata(notes=(*notes, *doubt)) if doubt else curve


class _Reader:
    """Depth, force and time (SI) of one table, with their units, rules of sign and notes.

    `free`: the depth is a travel whose direction is not known, less the `bending` (m) of a lever. `known`: the
    calibration used, for the metadata.
    """

    def __init__(self, source: Source, table: Table, options: Options) -> None:
        self.source, self.table, self.options = source, table, options
        self.mapping = {role: str(text) for role, text in (options.columns or {}).items()}
        self.labels = [label.strip() for label in table.labels]
        self.above = [split_label(label)[1] for label in table.labels]
        stated = [unit_named(without_brackets(unit)) for unit in table.units]
        self.below = [*stated, *[""] * len(self.above)][: len(self.above)]
        units = zip(table.labels, self.above, self.below, strict=True)
        self.found = find_columns(
            [f"{label} ({below})" if below and not above else label for label, above, below in units],
            self.mapping,
        )
        self.rows, statistics = without_statistics(table.rows)
        self.notes: list[str] = list(statistics)
        self.signs: dict[str, str] = {}
        self.units: dict[str, str] = {}
        self.known: dict[str, Any] = {}
        self.free = self.scanner = False
        wanted = {"depth": self._depth(), "force": self._force()}
        source.require(self.rows, "names its columns but has no rows of numbers")
        if (time := self._asked_time()) is not None:
            wanted["time"] = time
        self._read_columns(wanted)
        self.depth, self.force = (self._value(role, wanted[role]) for role in ("depth", "force"))
        self.time = self._clock(self._value("time", wanted["time"])) if "time" in wanted else None
        self.bending = np.zeros(len(self.depth))
        self._take_off_bending()
        self.depth = self.depth - self.bending
        self.notes += unread(self.labels, self.found, self.mapping)

    def _read_columns(self, wanted: dict[str, Asked]) -> None:
        """Read the `wanted` columns, by role; drop a time that the caller did not name and that is no number."""
        try:
            table = self._numbers(indices := _indices(wanted))
        except FileFormatError:
            said = "" if "time" not in wanted else "".join(_column(self.rows[:1], wanted["time"].indices[0]))
            if "time" not in wanted or "time" in self.mapping or is_number(said):
                raise
            del wanted["time"]
            table = self._numbers(indices := _indices(wanted))
            label = self.labels[self.found["time"]]
            self.notes.append(f"the time is left out: {label!r:.80} holds no numbers")
        self.columns = dict(zip(indices, table.T, strict=True))
        quoted = self.table.comma is None and self.table.commas_between
        _require_no_thousands(self.source, self.labels, self.rows, self.columns, quoted=quoted)
        if not {"depth", "force"} <= self.mapping.keys():
            units = [one or other for one, other in zip(self.above, self.below, strict=False)]
            main = [self.columns[wanted[role].indices[0]] for role in ("depth", "force")]
            require_readings(self.source, self.labels, units, self.rows, *main)

    def segments(self) -> tuple[NDArray[np.str_] | None, Sequence[str]]:
        """Segment labels (n,) from the file's segments, segment column or marker column, else None; and notes."""
        labels: NDArray[np.str_] | None = None
        remarks: Sequence[str] = ()
        if self.table.segments:
            labels = np.full(len(self.depth), LOADING, dtype="<U9")
            for row, label in self.table.segments:
                labels[row:] = label
        elif "segment" in self.found:
            cells = _column(self.rows, self.found["segment"])
            said = {cell: bare_cell(cell).lower() for cell in set(cells)}
            if set(said.values()) <= {LOADING, HOLD, UNLOADING}:
                labels = np.array([said[cell] for cell in cells], dtype="<U9")
            else:
                remarks = (
                    "the segment column is not used: it holds other words than loading, hold and unloading",
                )
        depth, force, time = self.depth, self.force, self.time
        marks = [at for at, label in enumerate(self.labels) if label.lower() in {"markers", "marker"}]
        if labels is None and marks:
            motion = Curve(depth, force, time).segments() if np.isfinite(depth).all() else None
            return marked(_column(self.rows, marks[0]), motion), remarks
        if labels is not None and np.isfinite([depth, force]).all():
            clock = None if time is None or not np.isfinite(time).all() else time
            labels, against = against_motion(labels, depth, clock, force)
            remarks = (*remarks, *against)
        return labels, remarks

    def tests(self) -> Sequence[int]:
        """Rows at which a test begins: as the file says, by a column that numbers tests, or by the motion."""
        marked = self.table.starts or self._numbered()
        return marked or beginnings(self.depth, self.time, self.table.breaks, self._clocks)

    def _numbered(self) -> list[int]:
        """Rows at which a column that numbers tests changes, with row 0; [] without such a column."""
        for index, label in enumerate(self.labels):
            if is_count(label, of_tests=True):
                cells = np.array([cell.strip() for cell in _column(self.rows, index)])
                starts = [0, *(np.flatnonzero(cells[1:] != cells[:-1]) + 1).tolist()]
                if len(starts) > 1 and len(cells) >= MIN_POINTS * len(starts):
                    return starts
                self.source.require(
                    not 1 < len(set(cells)) <= len(cells) / 2,
                    f", column {label!r:.80}: the rows of several tests are mixed, or fewer than {MIN_POINTS} "
                    "each; sort the table by it",
                )
        return []

    def _clocks(self) -> Iterator[FloatArray]:
        for index in range(len(self.labels)):
            if index not in self.columns:
                try:
                    yield self._numbers([index])[:, 0]
                except FileFormatError:
                    continue

    def _numbers(self, indices: Sequence[int]) -> FloatArray:
        return numbers(self.rows, indices, self.source.name, comma=self.table.comma)

    def _asked(self, role: str) -> Asked | None:
        """Return the parsed column mapping of a role, or the column found by name, or None.

        FileFormatError if the mapping names a column that the table does not have.
        """
        if role not in self.mapping:
            return Asked((Column(self.found[role]),)) if role in self.found else None
        parsed = parse_column(self.mapping[role], self.labels)
        if parsed is None:
            raise self._missing(role, f"no column {self.mapping[role]!r:.80}")
        return parsed

    def _missing(self, role: str, what: str) -> FileFormatError:
        there = names_there(label for label in self.labels if label)
        return self.source.wrong(
            f'has {what}; it has {there}. Say which with columns = {{ {role} = "name (unit)" }} in [curve]'
        )

    def _depth(self) -> Asked:
        asked = self._asked("depth")
        if asked is None:
            role = next((role for role in ("travel", "height") if role in self.found), None)
            if role is None:
                raise self._missing("depth", "no column for the depth")
            self.free = True
            index = self.found["depth"] = self.found[role]
            self.scanner = bare_name(name_of(self.labels[index])) in _SCANNER
            asked = Asked((Column(index),))
        return asked

    def _force(self) -> Asked:
        asked, deflection = self._asked("force"), self.found.get("deflection")
        # A calibration that is given goes before the one the file's own forces were made with.
        anew = self.options.calibration and "force" not in self.mapping and deflection is not None
        if asked is None or (anew and name_of(self.labels[self.found["force"]]) in KNOWN["deflection"]):
            if deflection is None:
                raise self._missing("force", "no column for the force")
            self.found.pop("force", None)
            asked = Asked((Column(deflection),))
        return asked

    def _asked_time(self) -> Asked | None:
        asked = self._asked("time")
        if asked is None or "time" in self.mapping:
            return asked
        unit, label = self._unit(asked.columns[0]), self.labels[self.found["time"]]
        if kind_named(unit) == "time":
            return asked
        self.notes.append(
            f"the time is left out: the column {label!r:.80} has {f'the unit {unit!r:.40}' if unit else 'no unit'}"
            f'; say it with columns = {{ time = "{split_label(label)[0]} (s)" }}'
        )
        return None

    def _unit(self, column: Column) -> str:
        """Unit of a column: from the mapping, else from its name, else from the row of units below the names."""
        at = column.index
        return column.unit or _one_unit(self.source, self.labels[at], self.above[at], self.below[at])

    def _value(self, role: str, asked: Asked) -> FloatArray:
        """Values (n,) in SI of a role (depth, force, time); records its unit and its rule of sign."""
        text, source = self.mapping.get(role, "").strip(), self.source
        if asked.node is not None:
            self.units |= {self.labels[column.index]: self._unit(column) for column in asked.columns}
            self.signs[role] = f"{text}, as asked"
            what = f"{source.name}, columns = {{ {role} = {text!r:.120} }}"
            return asked.values(lambda one: self.columns[one.index], self._unit, ROLES[role], what)
        column = asked.columns[0]
        values, label, unit = self.columns[column.index], self.labels[column.index], self._unit(column)
        if role == "force" and role not in self.found and kind_named(unit) != "force":
            return self._lever_force(values, label, unit)
        if not unit:
            raise FileFormatError(_no_unit(source, label, role))
        self.units[label] = unit
        factor = column_factor(unit, ROLES[role], label, source.name)
        turned = text.startswith("-")
        self.signs[role] = f"minus the column {label!r}, as asked" if turned else f"as written in {label!r}"
        return np.asarray(values * (-factor if turned else factor))

    def _clock(self, time: FloatArray) -> FloatArray:
        """Return the time (n,) made continuous where the instrument sets its clock back at each segment."""
        starts = [row for row, _ in self.table.segments if 0 < row < len(time)]
        back = np.flatnonzero(np.diff(time) < 0.0) + 1
        inside = sorted({*starts} - {*self.table.starts})
        if not back.size or not {*back.tolist()} <= {*inside, *self.table.starts}:
            return time
        time = time.copy()
        for row in inside:
            end = next((start for start in self.table.starts if start > row), len(time))
            if time[row] < time[row - 1]:
                step = time[row - 1] - time[row - 2] if row > 1 else 0.0
                time[row:end] += time[row - 1] + max(step, 0.0) - time[row]
        self.notes.append("each segment sets the clock back: it goes on from the segment before")
        return time

    def _lever(self, *, volts: bool = False) -> Lever:
        """The calibration of the lever; `volts`: whether it is used on volts, to which any sensitivity applies."""
        stated, given = self.table.stated, self.options.calibration
        if "sensitivity" in given and not volts and "sensitivity" not in stated:
            raise InputError(
                f"{self.source.name} holds forces, not volts, and does not say with which sensitivity they were "
                "made; a sensitivity cannot be given"
            )
        lever = Lever.of(self.source, stated, given)
        self.known |= {**lever.about, "bending_taken_off": True}
        return lever

    def _lever_force(self, values: FloatArray, label: str, unit: str) -> FloatArray:
        """Force (N), (n,), from a cantilever's deflection in a unit of length or in volts of its detector."""
        volts = kind_named(unit) == "voltage"
        lever = self._lever(volts=volts)
        self.units[label] = unit
        self.signs["force"] = f"{label!r} *{' sensitivity *' if volts else ''} spring constant"
        factor = column_factor(unit, "voltage" if volts else "length", label, self.source.name)
        return lever.force(self.source, values * factor, "V" if volts else "m")

    def _take_off_bending(self) -> None:
        """Make a depth of a height or a scanner's travel: turn a height, subtract the cantilever's bending."""
        if self.free and self.found.get("height") == self.found["depth"]:
            self.depth = -self.depth
            self.signs["depth"] = f"minus {self.labels[self.found['depth']]!r}"
        if not self.scanner:
            if self.options.calibration and not self.known:
                raise InputError(
                    f"{self.source.name}: a calibration has no use here, depth and force are read as they are "
                    "written; leave it out, or name the columns of travel and deflection"
                )
            return
        deflection = self.found.get("deflection")
        unit = "" if deflection is None else self._unit(Column(deflection))
        if deflection is not None and kind_named(unit) == "length":
            name = self.labels[deflection]
            if deflection not in self.columns:
                self.columns[deflection] = self._numbers([deflection])[:, 0]
            self.bending = self.columns[deflection] * unit_factor(unit, "length")
            self.signs["depth"] += f" - {name!r}"
            self.units[name] = unit
            if self.table.stated.get("stiffness") or self.options.calibration:
                lever = self._lever()
                self.bending = lever.force(self.source, self.bending, "m") / lever.stiffness
            self.known["bending_taken_off"] = True
        elif self.options.calibration or self.table.stated:
            of_file = not self.known  # and not made of volts with the calibration that is given
            lever = self._lever(volts=not of_file)
            if of_file:
                self.force = lever.force(self.source, self.force, "N")
            self.bending = self.force / lever.stiffness
            self.signs["depth"] += " - force / spring constant"
        else:
            self.notes.append(STILL_BENT)


def _indices(wanted: Mapping[str, Asked]) -> list[int]:
    return sorted({index for asked in wanted.values() for index in asked.indices})


def _require_no_thousands(
    source: Source,
    labels: Sequence[str],
    rows: Sequence[Sequence[str]],
    columns: Mapping[int, FloatArray],
    *,
    quoted: bool,
) -> None:
    """Refuse a column whose separator of thousands was read as a decimal sign, as in 998, 999, 1,000.

    `quoted`: commas separate the cells, so that one within a cell in quotes may be either.
    """
    for index, values in columns.items():
        if not quoted and np.abs(values).max() < 100.0:
            continue
        whole = values == np.rint(values)
        divided = 1e3 * values[~whole]
        # Nearly every column ends here, or above: a group of three digits is a multiple of a thousandth.
        if not divided.size or (np.abs(divided - np.rint(divided)) > 1e-6).any():
            continue
        # Whole ones may be grouped as well: 1,000 is read as 1.
        cells = [row[index].strip() for row in rows if index < len(row)]
        groups = [cell for cell in cells if ("," in cell) != ("." in cell) and (not quoted or "," in cell)]
        beside = quoted or any(map(_PLAIN_HUNDREDS.fullmatch, cells))
        source.require(
            not (groups and beside and all(map(_GROUPED.fullmatch, groups))),
            f", column {labels[index].strip()!r:.80}: the separator of {''.join(groups[:1])!r:.40} may be of a "
            "decimal or of thousands; write the numbers with decimal points and without thousands, or separate the "
            "columns by semicolons, where a comma is a decimal's",
        )


def _no_unit(source: Source, label: str, role: str) -> str:
    example = {"depth": "um", "force": "mN", "time": "s"}[role]
    name = label.removeprefix("column ")
    header = "" if name != label else f"write it in the header as '{label} ({example})', or "
    asked = f'columns = {{ {role} = "{name} ({example})" }}'
    return f"{source.name}, column {label!r:.80}: no unit; {header}give {asked}"


def _one_unit(source: Source, label: str, above: str, below: str) -> str:
    """Unit of a column from its name (`above`) or the row below (`below`); refused where the two contradict."""
    if not (above and below):
        return above or below
    kind, other = kind_named(above), kind_named(below)
    if kind is None and other is not None:
        return below  # what stands in brackets is a remark
    source.require(
        kind is None or kind != other or unit_factor(above, kind) == unit_factor(below, kind),
        f", column {label!r:.80}: the row below the names says {below!r:.40}; say which unit is right in columns",
    )
    return above


def is_marker(cell: str) -> bool:
    """Whether a cell is an instrument's mark of the row it stands in, such as KLA's "End Of Loading Index"."""
    return cell.strip().lower().endswith((" index", "segment type")) or cell.strip().lower() == "end"


def marked(markers: Sequence[str], motion: NDArray[np.str_] | None = None) -> NDArray[np.str_] | None:
    """Segment labels (n,) from the marks that an instrument writes in the first row of each segment.

    Parameters
    ----------
    markers : sequence of str
        Text of the marker column in each row, most of them empty.
    motion : ndarray (n,) of str, optional
        Labels found from the motion, for rows before the first mark of a segment and after the last has ended.

    Returns
    -------
    ndarray (n,) of str or None
        None where there is no mark, or one is not understood and `motion` is not given.
    """
    after_hold = len(markers)
    labels = np.full(len(markers), LOADING, dtype="<U9") if motion is None else np.array(motion, dtype="<U9")
    current, seen = "", False
    for row, marker in enumerate(markers):
        text = marker.strip().lower()
        if text and text != "end":
            found = next((label for word, label in SAID["marks"].items() if word in text), "")
            if not found and motion is None:
                return None
            # What is no mark of a segment, as the first reading of a drift, ends one.
            current = found if found or "drift" in text else current
            if "end of hold" in text:
                after_hold = row
            seen |= bool(found)
        if current:
            labels[row] = current
    if motion is not None and (labels[after_hold:] == UNLOADING).any():
        # The instrument marks where it begins to come back, not where it rests again.
        back = after_hold + np.flatnonzero(labels[after_hold:] == UNLOADING)
        moving = back[motion[back] == UNLOADING]
        labels[back[back > moving[-1]] if moving.size else back[:0]] = HOLD
    return labels if seen else None
