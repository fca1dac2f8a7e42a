"""Text files of indenters, each format said as data: Optics11, Anton Paar Bioindenter, Hysitron, Fischer, Mach-1.

Depth grows into the sample and force is positive in compression as they are written, except where a format
says otherwise; no file marks contact.

Mach-1 (Biomomentum Mach-1 Motion): ``<Mach-1 File>``, then blocks: ``<INFO>`` lines, the function (``<Find
Contact>``, ``<Stress Relaxation>``, ...) with its settings, and ``<DATA>`` with one row of names. ``<divider>``
ends each ramp of a block. Searches for contact and zeroing become part of what is known about the test that follows
them. The stage position grows into the sample. A single-axis cell (gf) reads compression positive; a multi-axis
cell (N) reads compression negative, so its force is turned. Depth is the position less that at the first row of the
block, which is where the search for contact stopped.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.readers._format import CLOSURE, Columns, Part, TextFormat, header_of, place_of, table_below
from underlay.data.readers._source import LONGEST_HEADER, Source
from underlay.data.readers._text import as_number, is_number, lines_of, split_label
from underlay.data.segments import (
    HOLD,
    LOADING,
    UNLOADING,
    against_motion,
    label_pieces,
    segments_from_motion,
)
from underlay.errors import FileFormatError
from underlay.units import parse_quantity

# --- Optics11 Piuma and Chiaro, all three generations


# An indentation that is zero at more of the points than this was cut by the software.
_CUT_SHARE = 0.05


def _optics11_parts(source: Source) -> Iterator[Part]:
    lines, needed = lines_of(source), {"time", "load", "cantilever", "piezo"}
    for at, line in enumerate(lines):
        if needed <= {split_label(label)[0].lower() for label in line.split("\t")}:
            source.require(lines[at + 1 :], ": the table has no rows")
            named = at > 1 and "\t" not in lines[1]
            yield table_below(lines, at, name=lines[1].strip() if named else source.path.stem)
            return
    raise source.wrong(": no table header 'Time (s)  Load (uN) ...' found")


def _made_of_optics11(part: Part, columns: Columns) -> dict[str, Any]:
    """Add depth, segments, place and notes to an Optics11 test.

    Depth is Piezo - Cantilever. The file's "Indentation" is that less a constant of the software, and cut to zero.
    """
    piezo, cantilever, header = columns["piezo"], columns["cantilever"], header_of(part.head)
    depth = piezo - cantilever
    made: dict[str, Any] = dict(place_of(header, *(f"{axis}-position (um)" for axis in "XYZ")))
    indentation = columns.get("indentation", np.zeros(0))
    cut, pressed = indentation == 0.0, indentation > 0.0
    # Some versions write Piezo - Cantilever as it is; a zero in it is then a chance.
    if pressed.any() and cut.mean() >= _CUT_SHARE:
        made["software_contact_depth"] = float(np.median((depth - indentation)[pressed]))
    finite = np.isfinite(piezo).all() and np.isfinite(columns["time"]).all()
    return {
        "depth": depth,
        "segment": segments_from_motion(piezo, columns["time"]) if finite else None,
        "bending_taken_off": True,
        "notes": _closure(columns["force"], cantilever, header.get("k (N/m)", "")),
        **made,
    }


def _closure(load: FloatArray, cantilever: FloatArray, stiffness: str) -> list[str]:
    if not is_number(stiffness):
        return ["the header gives no cantilever stiffness: load could not be checked against deflection"]
    gap = np.nanmax(np.abs(load - as_number(stiffness) * cantilever))
    if gap <= CLOSURE * np.nanmax(np.abs(load)):
        return []
    return [f"load differs from stiffness times deflection by up to {gap:.3g} N: check the file's units"]


OPTICS11 = TextFormat("optics11", _optics11_parts, _made_of_optics11).format


# --- Anton Paar Bioindenter (UNHT Bio)


_MEASURED = "Measured values"
# "Linear load 20.00 uN ; 100.00 uN/min", "Pause in depth 120 s": a step has its numbers on its line.
_STEP = re.compile(r"\s*(linear|pause in)\s+(?:load|depth)\b.*\d", re.IGNORECASE)
# "Load Fit [10%,98%]": over which share of the force the first analysis was fitted.
_FIT_RANGE = re.compile(r"\s*Load Fit \[\s*(\d+(?:\.\d+)?)\s*%\s*[,;]\s*(\d+(?:\.\d+)?)\s*%\s*\]\s*")
_PROFILE = re.compile(r"\s*\+?\s*user defined profile", re.IGNORECASE)
# The number of the pause in the automatic protocol "+ Advanced": load, pause, unload, retract.
_PAUSE_OF_ADVANCED = 2


def _bioindenter_parts(source: Source) -> Iterator[Part]:
    lines = lines_of(source)
    marks = [at for at, line in enumerate(lines) if line.strip() == _MEASURED]
    source.require(marks and marks[0] + 2 < len(lines), f": no table after the line {_MEASURED!r}")
    yield table_below(lines, marks[0] + 1)


def _made_of_bioindenter(part: Part, columns: Columns) -> dict[str, Any]:
    """Return segment labels from SegmentID and the protocol, and model and range of the vendor's own fit."""
    made: dict[str, Any] = {}
    if "ErHz" in header_of(part.head):
        made["instrument_model"] = "Hertz"
    if found := next((matched for matched in map(_FIT_RANGE.fullmatch, part.head) if matched), None):
        made["instrument_fit_range"] = tuple(float(end) / 100.0 for end in found.groups())
    ids, depth, force, time = (columns[name] for name in ("id", "depth", "force", "time"))
    if not np.isfinite(ids).all() or not np.isfinite(depth).all():
        return made
    # A pause of the protocol is a hold, else the motion of each run of one number decides. In a profile of the user
    # 0 is the approach, and 1 the first step.
    pauses = {_PAUSE_OF_ADVANCED}
    if any(map(_PROFILE.match, part.head)):
        steps = [matched[1].lower() for matched in map(_STEP.match, part.head) if matched]
        pauses = {number for number, step in enumerate(steps, start=1) if step.startswith("pause")}
    starts = np.concatenate(([0], np.flatnonzero(np.diff(ids)) + 1, [len(ids)]))
    segment = label_pieces(depth, starts, {int(at): HOLD for at in starts[:-1] if int(ids[at]) in pauses})
    if np.isfinite(force).all() and np.isfinite(time).all():
        segment, made["notes"] = against_motion(segment, depth, time, force)
    return {**made, "segment": segment}


BIOINDENTER = TextFormat("bioindenter", _bioindenter_parts, _made_of_bioindenter).format


# --- Hysitron TriboScan: .hld, and the text export of load-controlled tests


# The section "Test Data Points" of a .hld is the curve; approach and drift, a few thousand rows, stand before it.
_POINTS = re.compile(r"^(?:Test Data Points:|Number of Points\s*=)\s*(\d{1,18})\s*$", re.MULTILINE)
_DYNAMIC = "nanoDMA Text Export"
_DEMANDS = ("Begin Time", "End Time", "Begin Demand", "End Demand")


def _is_hysitron(source: Source) -> bool:
    head = source.head(LONGEST_HEADER)
    if _DYNAMIC in head[:200]:
        return True
    if "Test Data Points:" in head and "Disp_" in head and "Force_" in head:
        return bool(_POINTS.search(head))
    return "Depth (" in head[:2000] and "\tLoad (" in head[:2000] and bool(_POINTS.search(head[:2000]))


def _hysitron_parts(source: Source) -> Iterator[Part]:
    lines = lines_of(source)
    source.require(
        _DYNAMIC not in lines[0],
        "is a nanoDMA export: it holds dynamic moduli, not one force-depth curve. Export the quasi-static data, or "
        'read columns of it with format = "csv" and columns = { depth = "name (unit)", force = "name (unit)" }',
    )
    marks = [(at, int(found[1])) for at, line in enumerate(lines) if (found := _POINTS.match(line))]
    source.require(marks, "has no line 'Test Data Points: N' or 'Number of Points = N'")
    at, count = marks[0]
    there = len(lines) - at - 2
    source.require(there >= 0, ": the file ends before the table")
    cut = f": the header claims {count} points but {there} rows follow; the file is cut short"
    source.require(count <= there, cut)
    yield table_below(lines, at + 1, slice(count))


def _made_of_hysitron(part: Part, columns: Columns) -> dict[str, Any]:
    """Return labels from the file's list of segments: loading, hold or unloading as its demanded load changes."""
    listed: dict[str, list[float]] = {name: [] for name in _DEMANDS}
    for line in part.head:
        key, _, value = line.partition(":")
        number = (value.split() or [""])[0]
        name = key.strip().removeprefix("Segment ")
        if key.startswith("Segment ") and name in listed and is_number(number):
            listed[name].append(as_number(number))
    count, time = len(listed["End Time"]), columns["time"]
    whole = count and all(len(values) == count for values in listed.values()) and np.isfinite(time).all()
    ends = np.array(listed["End Time"])
    if not whole or (np.diff(ends) < 0.0).any():
        return {}
    rise = np.array(listed["End Demand"]) - np.array(listed["Begin Demand"])
    kinds = np.where(rise > 0.0, LOADING, np.where(rise < 0.0, UNLOADING, HOLD)).astype("<U9")
    return {"segment": kinds[np.minimum(np.searchsorted(ends, time, side="left"), count - 1)]}


HYSITRON = TextFormat("hysitron", _hysitron_parts, _made_of_hysitron, sniff=_is_hysitron).format


# --- Fischer (Picodentor, HM2000): blocks of one application; the units stand nowhere and are fixed


_BLOCK = re.compile(r"^Block\s*:\s*(\d{1,9})\s+Value\s*:\s*(\d{1,9})\s*$", re.MULTILINE)
_PLACE = re.compile(r"^x=\s*([-+\d.,]+)\s+y=\s*([-+\d.,]+)")


def _is_fischer(source: Source) -> bool:
    head = source.head(262_144)
    # The longer words first: they are looked for in long steps.
    is_block = "Block" in head and ("Name of the application" in head or "HM" in head)
    return is_block and _BLOCK.search(head) is not None


def _fischer_parts(source: Source) -> Iterator[Part]:
    lines = lines_of(source)
    starts = [(at, found) for at, line in enumerate(lines) if (found := _BLOCK.match(line.strip()))]
    source.require(starts, ": no line 'Block : 1   Value : 1'")
    ends = [*(at for at, _ in starts[1:]), len(lines)]
    for (at, matched), end in zip(starts, ends, strict=True):
        block, value = map(int, matched.groups())
        about: dict[str, Any] = {"block": block, "name": f"{source.path.stem}, block {block}, value {value}"}
        head, rows = [], []
        for line in lines[at + 1 : end]:
            cells, place = line.split("\t"), _PLACE.match(line)
            if len(cells) == 3 and all(map(is_number, cells)):
                rows.append(cells)
            elif place and all(map(is_number, place.groups())):
                # The unit of the stage is mm in every file seen.
                about["position"] = tuple(as_number(text) * 1e-3 for text in place.groups())
            elif len(cells) >= 3:
                head.append(f"{cells[0].strip()} {cells[1].strip()}:\t{' '.join(map(str.strip, cells[2:]))}")
        labels = [("F", "mN"), ("h", "um"), ("t", "s")]
        yield Part(head, labels, rows, f"block {block}, value {value}", about=about)


FISCHER = TextFormat("fischer", _fischer_parts, sniff=_is_fischer).format


# --- Biomomentum Mach-1


_SEARCH = "Find Contact"
# Blocks that prepare a test and are not one.
_PREPARATION = frozenset({_SEARCH, "Zero Load", "Load cell zero", "Move Relative", "Move Absolute", "Wait"})
_MARKS = frozenset({"<DATA>", "<END DATA>", "<INFO>", "<END INFO>", "<divider>", "<Mach-1 File>"})


@dataclass
class _Block:
    """One block of a Mach-1 file: its function, its settings, its rows (the first holds the names) and dividers."""

    function: str
    settings: dict[str, str]
    rows: list[list[str]] = field(default_factory=list)
    dividers: list[int] = field(default_factory=list)

    @property
    def axes(self) -> dict[str, str]:
        """Column name of each role: time, stage (the indenting axis), force (its load cell), x and y."""
        axis = self.settings.get("Stage Axis", "Position (z)")
        cell = self.settings.get("Load Cell Axis", "Fz")
        return {"time": "Time", "stage": axis, "force": cell, "x": "Position (x)", "y": "Position (y)"}

    def part(self, where: str, name: str = "") -> Part:
        """Return the table of the block, its columns found by `axes`; FileFormatError where one is missing.

        `where` names the block in errors, `name` the part that is returned.
        """
        if len(self.rows) < 2:
            raise FileFormatError(f"{where} has no rows of numbers")
        labels = [split_label(label) for label in self.rows[0]]
        names = [label for label, _ in labels]
        found = {role: names.index(axis) for role, axis in self.axes.items() if axis in names}
        if missing := [self.axes[role] for role in ("time", "stage", "force") if role not in found]:
            raise FileFormatError(
                f"{where} has no column {missing[0]!r:.80}; it has {names_there(self.rows[0])}"
            )
        kind, unit = self.settings.get("Load Cell Type", "").lower(), labels[found["force"]][1]
        # Multi-axis cells, which read newtons, read compression negative.
        turned = (kind.startswith("multi") or unit == "N") and not kind.startswith("single")
        return Part([], labels, self.rows[1:], name, found, {"turned": turned})


def _mach1_parts(source: Source) -> Iterator[Part]:
    blocks = _blocks(source, lines_of(source))
    tests = [at for at, block in enumerate(blocks) if block.function not in _PREPARATION]
    if not tests:  # only searches: then they are what there is to look at
        tests = [at for at, block in enumerate(blocks) if block.function == _SEARCH]
    source.require(tests, ": holds no block with a test in it")
    for at in tests:
        # The search for contact right before it.
        before = [
            block for block in blocks[:at] if block.function == _SEARCH or block.function not in _PREPARATION
        ]
        search = before[-1] if before and before[-1].function == _SEARCH else None
        yield _mach1_part(source, at + 1, blocks[at], search)


def _blocks(source: Source, lines: Sequence[str]) -> list[_Block]:
    blocks: list[_Block] = []
    settings: dict[str, str] = {}
    function = ""
    inside: _Block | None = None
    for line in map(str.strip, lines):
        if line == "<INFO>":
            settings, function = {}, ""
        elif line == "<DATA>":
            inside = _Block(function, settings)
            blocks.append(inside)
            settings = dict(settings)
        elif line == "<END DATA>":
            inside = None
        elif line == "<divider>" and inside is not None:
            inside.dividers.append(max(len(inside.rows) - 1, 0))
        elif inside is not None:
            inside.rows.append(line.split("\t"))
        elif line.startswith("<") and line.endswith(">") and line not in _MARKS:
            function = line[1:-1]
        elif ":" in line:
            key, _, value = line.partition(":\t") if ":\t" in line else line.partition(":")
            settings[key.strip()] = value.strip()
    source.require(inside is None, ": the last block has no <END DATA>: the file is cut short")
    return blocks


def _mach1_part(source: Source, number: int, block: _Block, search: _Block | None) -> Part:
    called = f"block {number} ({block.function:.60})"
    where = f"{source.name}, {called}"
    part = block.part(where, called)
    axis, cell = block.axes["stage"], block.axes["force"]
    way, sign = (f"minus {cell}", "negative") if part.about["turned"] else (f"{cell} as written", "positive")
    about = {
        "name": f"{source.path.stem}, {called}",
        "block": number,
        "function": block.function,
        "header": block.settings,
        "ramp_ends": block.dividers,
        "sign_rules": {
            "depth": f"{axis} grows into the sample; its first value in the block is zero",
            "force": f"{way}: this cell reads compression {sign}",
            "segment": f"from the motion of {axis}",
        },
        **_search_result(where, search),
    }
    return replace(part, about=about)


def _made_of_mach1(part: Part, columns: Columns) -> dict[str, Any]:
    stage, time = columns["stage"], columns["time"]
    height = float(stage[0])
    sides = [columns.get(side) for side in "xy"]
    negative = part.about["sign_rules"]["force"].startswith("minus")
    finite = np.isfinite(stage).all() and np.isfinite(time).all()
    return {
        "depth": stage - height,
        "force": -columns["force"] if negative else columns["force"],
        "segment": segments_from_motion(stage, time) if finite else None,
        "contact_height": height,
        "position": (*(0.0 if side is None else float(side[0]) for side in sides), height),
    }


def _search_result(where: str, search: _Block | None) -> dict[str, Any]:
    """Return criterion and largest force (N) of the search for contact before a test; a note if it was missed."""
    if search is None or len(search.rows) < 2:
        return {}
    asked = {unit: search.settings.get(f"Contact Criteria, {unit}", "") for unit in ("gf", "N")}
    unit = next((unit for unit, number in asked.items() if is_number(number)), "")
    if not unit or search.axes["force"] not in {split_label(label)[0] for label in search.rows[0]}:
        return {}
    part = search.part(where)
    force = _MACH1.read(where, part, part.found)["force"]
    if not np.isfinite(force).any():
        return {}
    peak = float(np.nanmax(-force if part.about["turned"] else force))
    criterion = parse_quantity(f"{asked[unit]} {unit}", "force")
    known: dict[str, Any] = {"search_criterion": criterion, "search_reached": peak}
    # A tenth below still counts: the cell is read in steps of about 0.001 gf.
    if peak < 0.9 * criterion:
        reached = peak / parse_quantity(f"1 {unit}", "force")
        known["notes"] = [
            f"the search for contact ended without it: {reached:.4f} {unit} where {asked[unit]} {unit} was asked"
        ]
    return known


_MACH1 = TextFormat("mach1", _mach1_parts, _made_of_mach1)
MACH1 = _MACH1.format
