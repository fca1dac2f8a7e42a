"""Biomomentum Mach-1 Motion text files: each test in a file becomes a curve.

``<Mach-1 File>``, then blocks: ``<INFO>`` lines, the function (``<Find Contact>``, ``<Stress Relaxation>``,
...) with its settings, and ``<DATA>`` with one row of names. ``<divider>`` ends each ramp of a block.
Searches for contact and zeroing become part of what is known about the test that follows them.

Rules of sign: the stage position grows into the sample. A single-axis cell (gf) reads compression positive; a
multi-axis cell (N) reads compression negative, so its force is turned. Depth is the position less that at the
first row of the block, which is where the search for contact stopped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from underlay._text import names_there
from underlay.data.readers._format import require
from underlay.data.readers._source import Source
from underlay.data.readers._text import is_number, lines_of, split_label
from underlay.data.readers.text_format import Channel, Columns, Part, TextFormat
from underlay.data.segments import segments_from_motion
from underlay.errors import FileFormatError
from underlay.units import parse_quantity

__all__ = ["FORMAT"]

_SEARCH = "Find Contact"
# Blocks that prepare a test and are not one.
_PREPARATION = frozenset({_SEARCH, "Zero Load", "Load cell zero", "Move Relative", "Move Absolute", "Wait"})
_MARKS = frozenset({"<DATA>", "<END DATA>", "<INFO>", "<END INFO>", "<divider>", "<Mach-1 File>"})


@dataclass
class _Block:
    """One block while it is read; the first of its rows are the names."""

    function: str
    settings: dict[str, str]
    rows: list[list[str]] = field(default_factory=list)
    dividers: list[int] = field(default_factory=list)

    @property
    def axes(self) -> dict[str, str]:
        """Names of the indenting axis, of its load cell, and of what else is read, by role."""
        axis = self.settings.get("Stage Axis", "Position (z)")
        cell = self.settings.get("Load Cell Axis", "Fz")
        return {"time": "Time", "stage": axis, "force": cell, "x": "Position (x)", "y": "Position (y)"}

    def part(self, where: str, name: str = "") -> Part:
        """The table of the block, with its columns found by the names of the axes.

        Raises
        ------
        FileFormatError
            If it has no numbers, or no column of the time, the stage or the load cell.
        """
        if len(self.rows) < 2:
            raise FileFormatError(f"{where} has no rows of numbers")
        labels = [split_label(label) for label in self.rows[0]]
        names = [label for label, _ in labels]
        found = {role: names.index(axis) for role, axis in self.axes.items() if axis in names}
        if missing := [self.axes[role] for role in ("time", "stage", "force") if role not in found]:
            raise FileFormatError(f"{where} has no column {missing[0]!r}; it has {names_there(self.rows[0])}")
        return Part([], labels, self.rows[1:], name, found)

    def sign(self, unit: str) -> float:
        """Factor, 1 or -1, that makes compression positive; -1 for multi-axis cells, which read newtons."""
        kind = self.settings.get("Load Cell Type", "").lower()
        turned = kind.startswith("multi") or unit == "N"
        return -1.0 if turned and not kind.startswith("single") else 1.0


def _parts(source: Source) -> Iterator[Part]:
    blocks = _blocks(source, lines_of(source))
    tests = [at for at, block in enumerate(blocks) if block.function not in _PREPARATION]
    if not tests:  # only searches: then they are what there is to look at
        tests = [at for at, block in enumerate(blocks) if block.function == _SEARCH]
    require(tests, source, "holds no block with a test in it")
    for at in tests:
        yield _part(source, at + 1, blocks[at], _search_before(blocks, at))


def _blocks(source: Source, lines: Sequence[str]) -> list[_Block]:
    blocks: list[_Block] = []
    settings: dict[str, str] = {}
    function = ""
    inside: _Block | None = None
    for line in (raw.strip() for raw in lines):
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
    require(inside is None, source, "the last block has no <END DATA>: the file is cut short")
    return blocks


def _search_before(blocks: Sequence[_Block], at: int) -> _Block | None:
    """The search for contact right before a block."""
    for block in reversed(blocks[:at]):
        if block.function == _SEARCH:
            return block
        if block.function not in _PREPARATION:
            return None
    return None


def _part(source: Source, number: int, block: _Block, search: _Block | None) -> Part:
    called = f"block {number} ({block.function})"
    where = f"{source.name}, {called}"
    part = block.part(where, called)
    axis, cell = block.axes["stage"], block.axes["force"]
    sign = block.sign(part.labels[part.found["force"]][1])
    way = f"minus {cell}: this cell reads" if sign < 0.0 else f"{cell} as written: this cell reads"
    about = {
        "name": f"{source.path.stem}, {called}",
        "block": number,
        "function": block.function,
        "header": block.settings,
        "ramp_ends": block.dividers,
        "sign_rules": {
            "depth": f"{axis} grows into the sample; its first value in the block is zero",
            "force": f"{way} compression {'negative' if sign < 0.0 else 'positive'}",
            "segment": f"from the motion of {axis}",
        },
        **_search_result(where, search),
    }
    return replace(part, about=about)


def _made(part: Part, columns: Columns) -> dict[str, Any]:
    stage, time = columns["stage"], columns["time"]
    height = float(stage[0])
    sides = [columns.get(side) for side in "xy"]
    negative = part.about["sign_rules"]["force"].startswith("minus")
    return {
        "depth": stage - height,
        "force": -columns["force"] if negative else columns["force"],
        "segment": segments_from_motion(stage, time)
        if np.isfinite(stage).all() and np.isfinite(time).all()
        else None,
        "contact_height": height,
        "position": (*(0.0 if side is None else float(side[0]) for side in sides), height),
    }


def _search_result(where: str, search: _Block | None) -> dict[str, Any]:
    """What the search for contact before a test asked for and reached (N), said aloud if it failed."""
    if search is None or len(search.rows) < 2:
        return {}
    asked = {unit: search.settings.get(f"Contact Criteria, {unit}", "") for unit in ("gf", "N")}
    unit = next((unit for unit, number in asked.items() if is_number(number)), "")
    if not unit or search.axes["force"] not in {split_label(label)[0] for label in search.rows[0]}:
        return {}
    part = search.part(where)
    force = _FORMAT.read(where, part, part.found)["force"]
    if not np.isfinite(force).any():
        return {}
    peak = float(np.nanmax(search.sign(part.labels[part.found["force"]][1]) * force))
    criterion = parse_quantity(f"{asked[unit]} {unit}", "force")
    known: dict[str, Any] = {"search_criterion": criterion, "search_reached": peak}
    # A tenth below still counts: the cell is read in steps of about 0.001 gf.
    if peak < 0.9 * criterion:
        reached = peak / parse_quantity(f"1 {unit}", "force")
        known["notes"] = [
            f"the search for contact ended without it: {reached:.4f} {unit} where {asked[unit]} {unit} was asked"
        ]
    return known


_FORMAT = TextFormat(
    name="mach1",
    description="Biomomentum Mach-1 Motion text files",
    sniff=lambda source: source.head(200).lstrip().startswith("<Mach-1 File>"),
    parts=_parts,
    columns={
        "time": Channel("time"),
        "stage": Channel("length"),
        "force": Channel("force"),
        "x": Channel("length", needed=False),
        "y": Channel("length", needed=False),
    },
    signs={},
    made=_made,
)
FORMAT = _FORMAT.format
