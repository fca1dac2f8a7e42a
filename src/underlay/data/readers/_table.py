"""From a table with labelled columns to curves: which column is which, in which unit, and how many tests.

Every reader of plain tables, text or workbook, ends here. Tests may stand side by side, approach and way back
too, or one test below the other; a height or a scanner's travel with a lever's deflection becomes depth and
force. A column whose commas may be of thousands or of decimals is refused rather than guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._columns import (
    KNOWN,
    ROLES,
    Column,
    Node,
    bare_name,
    check_mapping,
    columns_of,
    evaluate,
    find_columns,
    name_of,
    parse_column,
    require_kind,
    unread,
)
from underlay.data.readers._format import Options, make_curve
from underlay.data.readers._lever import Lever
from underlay.data.readers._not_readings import (
    NUMBERED,
    beginnings,
    require_readings,
    stacked_note,
    without_statistics,
)
from underlay.data.readers._source import Source
from underlay.data.readers._text import (
    column_factor,
    is_number,
    kind_named,
    numbers,
    split_label,
    unit_named,
)
from underlay.data.segments import HOLD, LOADING, UNLOADING, against_motion
from underlay.data.signs import reversed_columns, sign_note
from underlay.errors import FileFormatError, InputError
from underlay.units import unit_factor

__all__ = ["Table", "is_marker", "sides_of", "table_curves", "tests_beside"]

# 1,000 or 12.500: what separates thousands where nothing else is divided; and a number just below them.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:[.,]\d{3})+")
_PLAIN_HUNDREDS = re.compile(r"[+-]?[1-9]\d\d")
_THREE_DIGITS, _ROUNDING = 100.0, 1e-6
_LABELS = (LOADING, HOLD, UNLOADING)
# Tests side by side, as Anton Paar writes them: "X_gel_1_Time_[s]", "Y_gel_1_Fn_[mN]".
_BESIDE = re.compile(r"[XY][_ ](?P<test>.+)[_ ](?P<name>Time|Fn|Pd)[_ ]*[\[(](?P<unit>[^\])]+)[\])]\s*")
# Waves of Asylum's Igor program, "F0001Raw", "F0001Defl": in SI where no unit is said.
_WAVE = re.compile(
    r"(?P<test>.*?)_?(?P<name>DeflVolts|DeflV|Defl|Raw|ZSnsr|LVDT|Force|Sep|Ind)"
    r"(?:[_ ]*[\[(]?(?P<unit>[num]?m|[pnum]?N|m?V)[\])]?)?"
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
# Approach and way back side by side: a word of each, beside the name of the channel.
_WAYS = {
    **dict.fromkeys(("ex", "extend", "approach", "trace", "ext"), LOADING),
    **dict.fromkeys(("rt", "retract", "withdraw", "retrace", "ret"), UNLOADING),
}
# Names from which a lever's bending is still to be taken off.
_SCANNER = frozenset((*KNOWN["travel"], *KNOWN["height"])) - frozenset(
    ("extension", "stroke", "travel", "position", "separation", "sep", "tip sample separation")
)
_MARKS = (
    ("end of loading", HOLD),
    ("end of hold", UNLOADING),
    ("unload", UNLOADING),
    ("hold", HOLD),
    ("load", LOADING),
    ("approach", LOADING),
)


@dataclass(frozen=True)
class Table:
    """Rows of cells under names.

    Parameters
    ----------
    labels : sequence of str
        One a column, with or without its unit.
    rows : sequence of sequences of str
        The cells; the first row may hold units.
    breaks : sequence of int
        Rows before which something else than readings stands: blank rows, the names once more.
    comma : bool, optional
        Whether the decimal sign is a comma; the cells are asked where it is not said.
    commas_between : bool
        Whether commas stand between the cells, as where a decimal is written with a point: a quoted ``"1,234"`` may
        be either there.
    units : sequence of str
        Of all columns, where they stand elsewhere.
    segments : sequence of (int, str)
        First row and label of each segment, where the file names them.
    starts : sequence of int
        First row of each test, where the file says it.
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
        """The table of some of the columns under other names, without the rows in which all of them are empty."""
        rows = [[row[at] if at < len(row) else "" for at in indices] for row in self.rows]
        units = [self.units[at] for at in indices] if self.units else ()
        kept = [row for row in rows if any(cell.strip() for cell in row)]
        return replace(self, labels=labels, rows=kept, units=units, breaks=())


def table_curves(source: Source, table: Table, options: Options, **metadata: Any) -> list[Curve]:
    """Make the curves of a table, one for each test in it.

    Raises
    ------
    FileFormatError
        If depth or force is not there (names the columns that are), or a cell of them is not a number.
    UnitError
        If a column has no unit or one of the wrong kind.
    """
    check_mapping(options.columns)
    name = metadata.pop("name", None)
    if options.columns is None and (tests := tests_beside(table.labels)):
        return [
            curve
            for test, indices, labels in tests
            for curve in _curves(
                source, [(table.of(indices, labels), "")], options, {**metadata, "name": test}
            )
        ]
    if name is not None:
        metadata["name"] = name
    asked = [str(text) for text in (options.columns or {}).values()]
    ways = sides_of(table.labels)
    if ways and (not asked or any(parse_column(text, table.labels) is None for text in asked)):
        return _curves(source, [(table.of(*way), label) for label, way in ways.items()], options, metadata)
    return _curves(source, [(table, "")], options, metadata)


def tests_beside(labels: Sequence[str]) -> Sequence[tuple[str, list[int], list[str]]]:
    """Tests side by side: name, columns and their labels of each; [] for any other table."""
    for pattern in (_BESIDE, _WAVE):
        found: dict[str, dict[str, tuple[int, str]]] = {}
        for index, label in enumerate(labels):
            matched = pattern.fullmatch(label.strip().strip('"'))
            if matched and (matched["test"] or matched["name"] in _WAVES_ALONE):
                name = matched["name"]
                told = f"{_WAVE_NAMES.get(name, name)} ({matched['unit'] or _WAVE_UNITS.get(name, 'm')})"
                found.setdefault(matched["test"], {}).setdefault(name, (index, told))
        tests = [
            (test, [index for index, _ in parts.values()], [label for _, label in parts.values()])
            for test, parts in found.items()
            if any(one <= parts.keys() for one in _COMPLETE)
        ]
        if tests:
            return tests
    return []


def sides_of(labels: Sequence[str]) -> Mapping[str, tuple[list[int], list[str]]]:
    """Columns of the approach and of the way back, and their labels, of a table that has both side by side."""
    found: dict[str, tuple[list[int], list[str]]] = {LOADING: ([], []), UNLOADING: ([], [])}
    for index, label in enumerate(labels):
        joint = "_" if "_" in label else " "
        words = label.strip().split("_" if joint == "_" else None)
        ways = [word for word in words if word.lower() in _WAYS]
        if len(ways) == 1:
            indices, names = found[_WAYS[ways[0].lower()]]
            indices.append(index)
            names.append(joint.join(word for word in words if word != ways[0]))
    there, back = found[LOADING][1], found[UNLOADING][1]
    return found if len(there) >= 2 and sorted(there) == sorted(back) else {}


@dataclass(frozen=True)
class _Read:
    """Columns of a table in SI, and how they came about."""

    depth: FloatArray
    force: FloatArray
    time: FloatArray | None
    units: Mapping[str, str]
    signs: Mapping[str, str]
    notes: Sequence[str]
    known: Mapping[str, Any]
    free: bool


def _curves(
    source: Source, parts: Sequence[tuple[Table, str]], options: Options, metadata: dict[str, Any]
) -> list[Curve]:
    """Curves of a table, or of its ways in and out (label of each), one after the other."""
    read = [(_Reader(source, table, options), label) for table, label in parts]
    columns = [(reader.read(), label) for reader, label in read]
    first, reader = columns[0][0], read[0][0]
    depth, force = (np.concatenate([getattr(one, name) for one, _ in columns]) for name in ("depth", "force"))
    times = [one.time for one, _ in columns if one.time is not None]
    time = np.concatenate(times) if len(times) == len(columns) else None
    notes, labels = [*metadata.pop("notes", ()), *first.notes], None
    if len(parts) > 1:
        labels = np.concatenate([np.full(len(one.depth), label, dtype="<U9") for one, label in columns])
        starts = [0]
    else:
        labels, told = _segment(reader.rows, reader.found.get("segment"))
        if parts[0][0].segments:
            labels = _named_segments(parts[0][0].segments, len(depth))
        if labels is None and (markers := reader.markers()):
            labels = marked(
                markers, Curve(depth, force, time).segments() if np.isfinite(depth).all() else None
            )
        elif labels is not None and np.isfinite([depth, force]).all():
            labels, against = against_motion(
                labels, depth, None if time is None or not np.isfinite(time).all() else time, force
            )
            told = (*told, *against)
        notes = [*told, *notes]
        starts = reader.tests(depth, time)
    if len(starts) > 1:
        notes.append(stacked_note(starts))
    curves = []
    for number, (start, end) in enumerate(zip(starts, [*starts[1:], len(depth)], strict=True), start=1):
        here = slice(start, end)
        about = dict(metadata)
        if len(starts) > 1:
            about["name"] = f"{metadata.get('name') or source.path.stem}, test {number}"
        curve = make_curve(
            source,
            depth[here],
            force[here],
            None if time is None else time[here],
            None if labels is None else labels[here],
            units=first.units,
            sign_rules=first.signs,
            notes=notes,
            **{**about, **first.known},
        )
        curves.append(_with_signs(curve, free=first.free))
    return curves


def _with_signs(curve: Curve, *, free: bool) -> Curve:
    """A note of signs that look reversed; a travel that may grow either way is turned, and it is said."""
    notes = curve.metadata["notes"]
    if free and reversed_columns(curve) == ("depth",):
        rules = {**curve.metadata["sign_rules"], "depth": "turned: the first motion goes into the sample"}
        note = "the depth is turned: its column may grow either way, and the first motion of a test goes in"
        return replace(curve, depth=-curve.depth).with_metadata(sign_rules=rules, notes=(*notes, note))
    doubt = sign_note(curve)
    return curve.with_metadata(notes=(*notes, *doubt)) if doubt else curve


class _Reader:
    """Reads depth, force and time of one table."""

    def __init__(self, source: Source, table: Table, options: Options) -> None:
        self.source, self.table, self.options = source, table, options
        self.mapping = {role: str(text) for role, text in (options.columns or {}).items()}
        self.labels = [label.strip() for label in table.labels]
        self.above, self.below, rows = _take_unit_row(table.labels, table.rows, table.units)
        units = zip(table.labels, self.above, self.below, strict=True)
        self.found = find_columns(
            [f"{label} ({below})" if below and not above else label for label, above, below in units],
            self.mapping,
        )
        self.shift = len(table.rows) - len(rows)
        self.rows, self.statistics = without_statistics(rows)
        self.notes: list[str] = list(self.statistics)
        self.signs: dict[str, str] = {}
        self.units: dict[str, str] = {}
        self.known: dict[str, Any] = {}
        self.lever = Lever(0.0)
        self.free = self.scanner = False

    def read(self) -> _Read:
        """Everything that a curve is made of."""
        depth, force = self._depth_node(), self._force_node()
        if not self.rows:
            raise FileFormatError(f"{self.source.name} names its columns but has no rows of numbers")
        wanted = [index for node in (depth, force) for index in _indices(node)]
        time = self._time_node()
        if time is not None:
            wanted += _indices(time)
        indices = sorted(set(wanted))
        try:
            table = self._numbers(indices)
        except FileFormatError:
            if time is None or "time" in self.mapping:
                raise
            time, indices = None, sorted({index for node in (depth, force) for index in _indices(node)})
            table = self._numbers(indices)
            self.notes.append(
                f"the time is left out: {self.labels[self.found['time']]!r:.80} holds no numbers"
            )
        self.columns = dict(zip(indices, table.T, strict=True))
        self._require_sound(indices, table, depth, force)
        found = {"depth": self._value("depth", depth), "force": self._value("force", force)}
        clock = None if time is None else self._time(time)
        self._take_off_bending(found)
        others = unread(self.labels, self.found, self.mapping)
        notes = (*self.notes, *others)
        return _Read(
            found["depth"], found["force"], clock, self.units, self.signs, notes, self.known, self.free
        )

    def markers(self) -> list[str]:
        """The instrument's marks of its rows, where a column holds some."""
        index = next(
            (at for at, label in enumerate(self.labels) if label.lower() in {"markers", "marker"}), None
        )
        return [] if index is None else [row[index] if index < len(row) else "" for row in self.rows]

    def tests(self, depth: FloatArray, time: FloatArray | None) -> list[int]:
        """Rows at which a test begins."""
        numbered = [*self.table.starts] or self._numbered()
        return numbered or beginnings(
            depth, time, [row - self.shift for row in self.table.breaks], self._clocks
        )

    def _numbered(self) -> list[int]:
        """Rows at which a column that counts tests has another number; [] without one."""
        for index, label in enumerate(self.labels):
            if split_label(label)[0].strip(" .#").lower() not in NUMBERED:
                continue
            cells = np.array([row[index].strip() if index < len(row) else "" for row in self.rows])
            starts = [0, *(np.flatnonzero(cells[1:] != cells[:-1]) + 1).tolist()]
            if len(starts) > 1 and len(cells) >= 8 * len(starts):
                return starts
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

    def _require_sound(self, indices: Sequence[int], table: FloatArray, depth: Node, force: Node) -> None:
        _require_no_groups(self.source, self.labels, self.rows, indices, table)
        if self.table.comma is None and self.table.commas_between:
            _require_decimals(self.source, self.labels, self.rows, indices)
        if not {"depth", "force"} <= self.mapping.keys():
            units = [one or other for one, other in zip(self.above, self.below, strict=False)]
            main = [self.columns[_indices(node)[0]] for node in (depth, force)]
            require_readings(self.source, self.labels, units, self.rows, main[0], main[1])

    def _node(self, role: str) -> Node | None:
        """What the mapping asks for; raises where the table has no such column."""
        if role not in self.mapping:
            return Column(self.found[role]) if role in self.found else None
        parsed = parse_column(self.mapping[role], self.labels)
        if parsed is None:
            raise FileFormatError(self._missing(role, f"no column {self.mapping[role]!r:.80}"))
        return parsed[0]

    def _missing(self, role: str, what: str) -> str:
        there = names_there(label for label in self.labels if label)
        return f"{self.source.name} has {what}; it has {there}. Say which with columns={{{role!r}: 'name (unit)'}}"

    def _depth_node(self) -> Node:
        node = self._node("depth")
        if node is None:
            role = next((role for role in ("travel", "height") if role in self.found), None)
            if role is None:
                raise FileFormatError(self._missing("depth", "no column for the depth"))
            self.free = True
            self.found["depth"] = self.found[role]
            self.scanner = bare_name(name_of(self.labels[self.found[role]])) in _SCANNER
            node = Column(self.found[role])
        return node

    def _force_node(self) -> Node:
        node = self._node("force")
        if node is None:
            if "deflection" not in self.found:
                raise FileFormatError(self._missing("force", "no column for the force"))
            node = Column(self.found["deflection"])
        # A calibration that is given goes before the one the file's own forces were made with.
        elif self.options.calibration and "force" not in self.mapping and self._is_lever(node):
            self.found.pop("force")
            node = Column(self.found["deflection"])
        return node

    def _is_lever(self, node: Node) -> bool:
        """Whether this force is that of a lever whose deflection stands beside it."""
        named = isinstance(node, Column) and name_of(self.labels[node.index]) in KNOWN["deflection"]
        return named and "deflection" in self.found

    def _time_node(self) -> Node | None:
        node = self._node("time")
        if node is None or "time" in self.mapping:
            return node
        unit = self._unit(Column(self.found["time"]))
        if kind_named(unit) == "time":
            return node
        label = self.labels[self.found["time"]]
        self.notes.append(
            f"the time is left out: the column {label!r:.80} has {f'the unit {unit!r:.40}' if unit else 'no unit'}"
            f"; say it with columns={{'time': '{split_label(label)[0]} (s)'}}"
        )
        return None

    def _unit(self, column: Column) -> str:
        """Unit of a column: asked for, or in its name, or below."""
        at = column.index
        return column.unit or _one_unit(self.source, self.labels[at], self.above[at], self.below[at])

    def _value(self, role: str, node: Node) -> FloatArray:
        """SI values of a role."""
        text = self.mapping.get(role, "").strip()
        if not isinstance(node, Column):
            what = f"{self.source.name}, columns = {{ {role} = {text!r:.120} }}"
            for column in columns_of(node):
                self.units[self.labels[column.index]] = self._unit(column)
            self.signs[role] = f"{text}, as asked"
            found = evaluate(node, lambda column: self.columns[column.index], self._unit, what)
            return require_kind(found, ROLES[role], what)
        label, unit = self.labels[node.index], self._unit(node)
        if role == "force" and role not in self.found and kind_named(unit) != "force":
            return self._lever_force(node, unit)
        if not unit:
            raise FileFormatError(_no_unit(self.source, label, role))
        self.units[label] = unit
        factor = column_factor(unit, ROLES[role], label, self.source.name)
        turned = text.startswith("-")
        self.signs[role] = f"minus the column {label!r}, as asked" if turned else f"as written in {label!r}"
        return np.asarray(self.columns[node.index] * (-factor if turned else factor))

    def _time(self, node: Node) -> FloatArray | None:
        return self._value("time", node)

    def _lever(self) -> Lever:
        if self.known:
            return self.lever
        lever = self.lever = Lever.of(self.source, self.table.stated, self.options.calibration)
        self.known |= {**lever.about, "bending_taken_off": True}
        return lever

    def _lever_force(self, node: Column, unit: str) -> FloatArray:
        """Force (N) of a lever's deflection, a length or the volts of its detector."""
        label = self.labels[node.index]
        lever, values = self._lever(), self.columns[node.index]
        self.units[label] = unit
        if kind_named(unit) == "voltage":
            self.signs["force"] = f"{label!r} * sensitivity * spring constant"
            return lever.force(self.source, values * unit_factor(unit, "voltage"))
        self.signs["force"] = f"{label!r} * spring constant"
        factor = column_factor(unit, "length", label, self.source.name)
        return np.asarray(values * (factor * lever.stiffness))

    def _take_off_bending(self, found: dict[str, FloatArray]) -> None:
        """Turn a height, and take the bending of the lever off the travel of its scanner."""
        if not self.free:
            if self.options.calibration and not self.known:
                raise InputError(
                    f"{self.source.name}: a calibration has no use here, depth and force are read as they are "
                    "written; leave it out, or name the columns of travel and deflection"
                )
            return
        label = self.labels[self.found["depth"]]
        if "height" in self.found and self.found["height"] == self.found["depth"]:
            found["depth"] = -found["depth"]
            self.signs["depth"] = f"minus {label!r}"
        deflection = self.found.get("deflection")
        unit = "" if deflection is None else self._unit(Column(deflection))
        if not self.scanner:
            return
        if deflection is not None and kind_named(unit) == "length":
            name = self.labels[deflection]
            if deflection not in self.columns:
                self.columns[deflection] = self._numbers([deflection])[:, 0]
            found["depth"] = found["depth"] - self.columns[deflection] * unit_factor(unit, "length")
            self.signs["depth"] += f" - {name!r}"
            self.units[name] = unit
            if self.table.stated.get("stiffness"):
                self._lever()
            self.known["bending_taken_off"] = True
        elif self.options.calibration or self.table.stated:
            lever = self._lever()
            found["depth"] = found["depth"] - found["force"] / lever.stiffness
            self.signs["depth"] += " - force / spring constant"
        else:
            self.notes.append(
                f"the depth is read from {label!r:.80} and still holds the bending of the lever: give "
                "calibration={'spring_constant': '0.04 N/m'} with your number, or set the instrument's compliance"
            )


def _indices(node: Node) -> list[int]:
    return [column.index for column in columns_of(node)]


def _require_no_groups(
    source: Source,
    labels: Sequence[str],
    rows: Sequence[Sequence[str]],
    indices: Sequence[int],
    table: FloatArray,
) -> None:
    """Refuse a column that counts 998, 999, 1,000: its separator is one of thousands, read as a decimal sign."""
    # Nearly every table ends here, and nearly every column below.
    if np.abs(table).max() < _THREE_DIGITS:
        return
    for j, index in enumerate(indices):
        values = table[:, j]
        whole = values == np.rint(values)
        divided = 1e3 * values[~whole]
        if not divided.size or not (np.abs(values[whole]) >= _THREE_DIGITS).any():
            continue
        if not (np.abs(divided - np.rint(divided)) < _ROUNDING).all():
            continue
        # Whole ones may be grouped as well: 1,000 is read as 1.
        cells = [row[index].strip() for row in rows if index < len(row)]
        groups = [cell for cell in cells if "," in cell or "." in cell]
        if all(map(_GROUPED.fullmatch, groups)) and any(map(_PLAIN_HUNDREDS.fullmatch, cells)):
            raise FileFormatError(
                f"{source.name}, column {labels[index].strip()!r:.80}: {groups[0]!r:.40} beside whole numbers of "
                "three digits looks like thousands and would be read as a decimal; write the numbers without a "
                "separator of thousands"
            )


def _require_decimals(
    source: Source, labels: Sequence[str], rows: Sequence[Sequence[str]], indices: Sequence[int]
) -> None:
    """Refuse a column whose commas may all be of thousands."""
    for index in indices:
        commas = [cell for row in rows if index < len(row) and "," in (cell := row[index].strip())]
        if commas and all(map(_GROUPED.fullmatch, commas)):
            raise FileFormatError(
                f"{source.name}, column {labels[index].strip()!r:.80}: the comma of {commas[0]!r:.40} may be of a "
                "decimal or of thousands; write the numbers with decimal points and without thousands, or "
                "separate the columns by semicolons, where a comma is a decimal's"
            )


def _no_unit(source: Source, label: str, role: str) -> str:
    example = {"depth": "um", "force": "mN", "time": "s"}[role]
    name = label.removeprefix("column ")
    header = "" if name != label else f"write it in the header as '{label} ({example})', or "
    return f"{source.name}, column {label!r:.80}: no unit; {header}give columns={{{role!r}: '{name} ({example})'}}"


def _take_unit_row(
    labels: Sequence[str], rows: Sequence[Sequence[str]], stated: Sequence[str]
) -> tuple[list[str], list[str], Sequence[Sequence[str]]]:
    """Units of all columns beside and below their names, and the rows of numbers without a row of units."""
    units = [split_label(label)[1] for label in labels]
    below = [""] * len(units)
    if rows and not any(is_number(cell) for cell in rows[0]):
        found = [unit_named(cell.strip().strip('"').strip("()[]{}<>")) for cell in rows[0]]
        if any(kind_named(unit) is not None for unit in found if unit):
            below, rows = (found + below)[: len(units)], rows[1:]
    if stated:
        below = [one or unit_named(other) for one, other in zip(below, [*stated, *below], strict=False)]
    return units, below, rows


def _one_unit(source: Source, label: str, above: str, below: str) -> str:
    """The unit of a column, which its name and the row of units below may both say."""
    kind = kind_named(above) if above and below else None
    if above and below and kind is None and kind_named(below) is not None:
        return below  # what stands in brackets is a remark
    if (
        kind is not None
        and kind == kind_named(below)
        and unit_factor(above, kind) != unit_factor(below, kind)
    ):
        raise FileFormatError(
            f"{source.name}, column {label!r:.80}: the row below the names says {below!r:.40}; say which unit is "
            "right in columns"
        )
    return above or below


def is_marker(cell: str) -> bool:
    """Whether a cell marks the row of an instrument, as KLA's "End Of Loading Index"."""
    return cell.strip().lower().endswith((" index", "segment type")) or cell.strip().lower() == "end"


def _named_segments(segments: Sequence[tuple[int, str]], count: int) -> NDArray[np.str_]:
    labels = np.full(count, LOADING, dtype="<U9")
    for row, label in segments:
        labels[row:] = label
    return labels


def marked(markers: Sequence[str], motion: NDArray[np.str_] | None = None) -> NDArray[np.str_] | None:
    """Labels of rows by the marks above them, as an instrument writes them at the first row of each segment.

    Parameters
    ----------
    markers : sequence of str
        One a row, most of them empty.
    motion : ndarray (n,) of str, optional
        Labels of the rows that stand before the first mark that says one, and after one that ends it.

    Returns
    -------
    ndarray (n,) of str or None
        None where there is no mark, or one is not understood and there is no motion.
    """
    after_hold = len(markers)
    labels = np.full(len(markers), LOADING, dtype="<U9") if motion is None else np.array(motion, dtype="<U9")
    current, seen = "", False
    for row, marker in enumerate(markers):
        text = marker.strip().lower()
        if text and text != "end":
            found = next((label for word, label in _MARKS if word in text), "")
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


def _segment(
    rows: Sequence[Sequence[str]], index: int | None
) -> tuple[NDArray[np.str_] | None, tuple[str, ...]]:
    if index is None:
        return None, ()
    cells = [row[index].strip().strip('"').lower() if index < len(row) else "" for row in rows]
    if set(cells) <= set(_LABELS):
        return np.array(cells, dtype="<U9"), ()
    return None, ("the segment column is not used: it holds other words than loading, hold and unloading",)
