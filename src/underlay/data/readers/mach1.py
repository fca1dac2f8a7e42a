"""Biomomentum Mach-1 Motion text files.

``<Mach-1 File>``, then blocks: ``<INFO>`` lines, the function (``<Find Contact>``, ``<Stress Relaxation>``,
...) with its settings, and ``<DATA>`` with one row of names. ``<divider>`` ends each ramp of a block. Each
block that is a test becomes a curve; searches for contact and zeroing become part of what is known about
the test that follows them.

Rules of sign: the stage position grows into the sample. A single-axis cell (gf) reads compression positive;
a multi-axis cell (N) reads compression negative, so its force is turned. Depth is the position less that at
the first row of the block, which is where the search for contact stopped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, require
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, is_number, lines_of, numbers, split_label
from underlay.data.segments import segments_from_motion
from underlay.errors import FileFormatError
from underlay.units import parse_quantity

__all__ = ["FORMAT"]

_SEARCH = "Find Contact"
# Blocks that prepare a test and are not one.
_PREPARATION = frozenset({_SEARCH, "Zero Load", "Load cell zero", "Move Relative", "Move Absolute", "Wait"})
_MARKS = frozenset({"<DATA>", "<END DATA>", "<INFO>", "<END INFO>", "<divider>", "<Mach-1 File>"})
_AXIS = "Position (z)"
_CELL = "Fz"


@dataclass
class _Block:
    """One block while it is read."""

    function: str
    settings: dict[str, str]
    labels: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    dividers: list[int] = field(default_factory=list)


def _sniff(source: Source) -> bool:
    return source.head(200).lstrip().startswith("<Mach-1 File>")


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    blocks = _blocks(source, lines_of(source))
    numbered = list(enumerate(blocks, start=1))
    tests = [pair for pair in numbered if pair[1].function not in _PREPARATION]
    if not tests:  # only searches: then they are what there is to look at
        tests = [pair for pair in numbered if pair[1].function == _SEARCH]
    require(tests, source, "holds no block with a test in it")
    return [_curve(source, number, block, _search_before(blocks, number)) for number, block in tests]


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
            inside.dividers.append(len(inside.rows))
        elif inside is not None:
            _add_row(inside, line)
        elif line.startswith("<") and line.endswith(">") and line not in _MARKS:
            function = line[1:-1]
        elif ":" in line:
            key, _, value = line.partition(":\t") if ":\t" in line else line.partition(":")
            settings[key.strip()] = value.strip()
    require(inside is None, source, "the last block has no <END DATA>: the file is cut short")
    return blocks


def _add_row(block: _Block, line: str) -> None:
    if block.labels:
        block.rows.append(line.split("\t"))
    else:
        block.labels = line.split("\t")


def _search_before(blocks: Sequence[_Block], number: int) -> _Block | None:
    """Return the search for contact right before block `number`, counted from 1."""
    for block in reversed(blocks[: number - 1]):
        if block.function == _SEARCH:
            return block
        if block.function not in _PREPARATION:
            return None
    return None


def _curve(source: Source, number: int, block: _Block, search: _Block | None) -> Curve:
    where = f"{source.name}, block {number} ({block.function})"
    columns, units = _columns(where, block)
    axis, cell = _axes(block)
    for name in ("Time", axis, cell):
        if name not in columns:
            there = names_there(block.labels)
            raise FileFormatError(f"{where} has no column {name!r}; it has {there}")
    time, position = columns["Time"], columns[axis]
    turned = _reads_compression_negative(block, units[cell])
    force = -columns[cell] if turned else columns[cell]
    finite = np.isfinite(position).all() and np.isfinite(time).all()
    height = float(position[0])
    known: dict[str, Any] = {"contact_height": height, **_search_result(where, search)}
    sides = [columns.get(f"Position ({name})") for name in "xy"]
    known["position"] = (*(0.0 if side is None else float(side[0]) for side in sides), height)
    return make_curve(
        source,
        position - height,
        force,
        time,
        segments_from_motion(position, time) if finite else None,
        name=f"{source.path.stem}, block {number} ({block.function})",
        block=number,
        function=block.function,
        header=block.settings,
        units=units,
        ramp_ends=block.dividers,
        sign_rules={
            "depth": f"{axis} grows into the sample; its first value in the block is zero",
            "force": f"minus {cell}: this cell reads compression negative"
            if turned
            else f"{cell} as written: this cell reads compression positive",
            "segment": f"from the motion of {axis}",
        },
        **known,
    )


def _columns(where: str, block: _Block) -> tuple[dict[str, FloatArray], dict[str, str]]:
    if not block.rows:
        raise FileFormatError(f"{where} has no rows of numbers")
    labels = [split_label(label) for label in block.labels]
    table = numbers(block.rows, range(len(labels)), where)
    kinds = {"Time": "time"}
    columns: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    for j, (name, unit) in enumerate(labels):
        kind = kinds.get(name, "length" if name.startswith("Position") else "force")
        if unit == "deg" or (name.startswith("T") and name != "Time"):  # rotations and torques are not used
            continue
        columns[name] = table[:, j] * column_factor(unit, kind, name, where)
        units[name] = unit
    return columns, units


def _axes(block: _Block) -> tuple[str, str]:
    """Names of the columns of the indenting axis and of its load cell."""
    return block.settings.get("Stage Axis", _AXIS), block.settings.get("Load Cell Axis", _CELL)


def _reads_compression_negative(block: _Block, unit: str) -> bool:
    kind = block.settings.get("Load Cell Type", "").lower()
    if kind.startswith("single"):
        return False
    return kind.startswith("multi") or unit == "N"


def _search_result(where: str, search: _Block | None) -> dict[str, Any]:
    """What the search for contact before a test asked for and reached (N), said aloud if it failed."""
    if search is None or not search.rows:
        return {}
    asked, unit = _criterion(search)
    if not unit:
        return {}
    columns, units = _columns(where, search)
    cell = _axes(search)[1]
    force = columns.get(cell)
    if force is None or not np.isfinite(force).any():
        return {}
    peak = float(np.nanmax(-force if _reads_compression_negative(search, units[cell]) else force))
    criterion = parse_quantity(f"{asked} {unit}", "force")
    known: dict[str, Any] = {"search_criterion": criterion, "search_reached": peak}
    # A tenth below still counts: the cell is read in steps of about 0.001 gf.
    if peak < 0.9 * criterion:
        reached = peak / parse_quantity(f"1 {unit}", "force")
        known["notes"] = [
            f"the search for contact ended without it: {reached:.4f} {unit} where {asked} {unit} was asked"
        ]
    return known


def _criterion(search: _Block) -> tuple[str, str]:
    """Number and unit of the force at which the search stops; empty if not stated."""
    for unit in ("gf", "N"):
        asked = search.settings.get(f"Contact Criteria, {unit}", "")
        if is_number(asked):
            return asked, unit
    return "", ""


FORMAT = Format(
    name="mach1",
    description="Biomomentum Mach-1 Motion text files",
    sniff=_sniff,
    read_all=_read_all,
)
