"""Hysitron TriboScan files: ``.hld`` and the text export of load-controlled tests.

``.hld``: lines ``Key: value unit``, a list of segments, then sections ``... Data Points: N`` each with a row
of names (``Disp_nm``, ``Force_uN``) and N rows; the section ``Test Data Points`` is the curve. The text
export: a date, ``Number of Points = N`` and a table ``Depth (nm)  Load (uN)  Time (s)``. Depth grows into the
sample and force is positive in compression as written; neither file marks contact.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, require
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, is_number, lines_of, numbers, split_label, uses_comma
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import FileFormatError, UnitError
from underlay.units import parse_quantity

__all__ = ["FORMAT"]

_TEST = re.compile(r"^Test Data Points:\s*(\d{1,18})\s*$", re.MULTILINE)
_COUNT = re.compile(r"^Number of Points\s*=\s*(\d{1,18})\s*$", re.MULTILINE)
_DYNAMIC = "nanoDMA Text Export"
_KINDS = {"depth": "length", "force": "force", "time": "time"}
_NAMES = {"disp": "depth", "depth": "depth", "force": "force", "load": "force", "time": "time"}
# Approach and drift sections come before the test; they hold a few thousand rows.
_HEAD = 1_000_000


def _sniff(source: Source) -> bool:
    head = source.head(_HEAD)
    if _DYNAMIC in head[:200]:
        return True
    if "Test Data Points:" in head and _TEST.search(head):
        return "Disp_" in head and "Force_" in head
    return "Depth (" in head[:2000] and "\tLoad (" in head[:2000] and bool(_COUNT.search(head[:2000]))


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    lines = lines_of(source)
    if _DYNAMIC in lines[0]:
        raise FileFormatError(
            f"{source.name} is a nanoDMA export: it holds dynamic moduli, not one force-depth curve. "
            "Export the quasi-static data, or read columns of it with format='csv' and columns={...}"
        )
    for i, line in enumerate(lines):
        claimed = _TEST.match(line) or _COUNT.match(line)
        if claimed:
            return [_curve(source, lines[:i], int(claimed.group(1)), lines[i + 1 :])]
    raise FileFormatError(f"{source.name} has no line 'Test Data Points: N' or 'Number of Points = N'")


def _curve(source: Source, header_lines: Sequence[str], claimed: int, rest: Sequence[str]) -> Curve:
    require(rest, source, "the file ends before the table")
    require(
        claimed <= len(rest) - 1,
        source,
        f"the header claims {claimed} points but {len(rest) - 1} rows follow; the file is cut short",
    )
    labels = [_split(label) for label in rest[0].split("\t")]
    found: dict[str, int] = {}
    for j, (name, unit) in enumerate(labels):
        role = _NAMES.get(name.strip().lower())
        # "Depth (V)" beside "Depth (nm)" is the raw signal.
        if role is not None and role not in found and unit not in {"V", "mV"}:
            found[role] = j
    for role in _KINDS:
        require(role in found, source, f"the table has no {role}; it has {rest[0].split(chr(9))!r:.200}")
    cells = [line.split("\t") for line in rest[1 : claimed + 1]]
    comma = uses_comma([cell for row in cells[:200] for cell in row])
    table = numbers(cells, [found[role] for role in _KINDS], source.name, comma=comma)
    depth, force, time = (
        table[:, j] * column_factor(labels[found[role]][1], kind, role, source.name)
        for j, (role, kind) in enumerate(_KINDS.items())
    )
    header = _header(header_lines)
    segment = _segments(header_lines, time)
    return make_curve(
        source,
        depth,
        force,
        time,
        segment,
        header=header,
        units={role: labels[found[role]][1] for role in _KINDS},
        sign_rules={
            "depth": "displacement as written, growing into the sample",
            "force": "as written, positive in compression",
            "segment": "from the file's list of segments" if segment is not None else "from the motion",
        },
        **_known_numbers(header),
    )


def _split(label: str) -> tuple[str, str]:
    """Name and unit of ``Disp_nm`` or ``Depth (nm)``."""
    name, unit = split_label(label)
    if not unit and "_" in name:
        name, _, unit = name.rpartition("_")
    return name, unit


def _header(lines: Sequence[str]) -> dict[str, str]:
    header: dict[str, str] = {}
    for line in lines:
        key, colon, value = line.partition(": ")
        if colon and "\t" not in line:
            header.setdefault(key.strip(), value.strip())
    return header


def _known_numbers(header: dict[str, str]) -> dict[str, Any]:
    known: dict[str, Any] = {}
    for key, name, kind in (
        ("Drift Rate", "drift_rate", "speed"),
        ("Machine Comp", "machine_compliance", "compliance"),
    ):
        try:
            known[name] = parse_quantity(header[key], kind)
        except (KeyError, UnitError):  # written without a unit in some versions: then it is not used
            continue
    return known


def _segments(lines: Sequence[str], time: FloatArray) -> NDArray[np.str_] | None:
    """Label the points by the demand of the segment in which they fall, where the file lists segments."""
    rows: dict[str, list[float]] = {"Begin Time": [], "End Time": [], "Begin Demand": [], "End Demand": []}
    for line in lines:
        key, _, value = line.partition(":")
        name = key.strip().removeprefix("Segment ")
        number = (value.split() or [""])[0]
        if key.startswith("Segment ") and name in rows and is_number(number):
            rows[name].append(float(number.replace(",", ".")))
    count = len(rows["End Time"])
    if not count or any(len(values) != count for values in rows.values()) or not np.isfinite(time).all():
        return None
    ends = np.array(rows["End Time"])
    if (np.diff(ends) < 0.0).any():
        return None
    rise = np.array(rows["End Demand"]) - np.array(rows["Begin Demand"])
    kinds = np.where(rise > 0.0, LOADING, np.where(rise < 0.0, UNLOADING, HOLD))
    index = np.minimum(np.searchsorted(ends, time, side="left"), count - 1)
    return np.asarray(kinds[index], dtype="<U9")


FORMAT = Format(
    name="hysitron",
    description="Hysitron TriboScan .hld files and text exports",
    sniff=_sniff,
    read_all=_read_all,
)
