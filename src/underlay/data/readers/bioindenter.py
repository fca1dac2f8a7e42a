"""Anton Paar Bioindenter (UNHT Bio) text exports.

A free-text header with the protocol and the vendor's analyses, the line ``Measured values``, and a table
``Time (s)  Pd (um)  Fn (uN)  FnRef (uN)  SegmentID`` with tabs. Penetration depth and normal force are
positive into the sample as written. Zero depth is where the head first met the contact force, not contact.

Segments, as the protocol numbers them. ``+ Advanced``: 1 load, 2 the pause, 3 unload, 4 retract; its line
``Linear loading`` is a setting and no step. ``+ User defined profile``: 0 is the approach and the first listed
step is 1.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, require
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, lines_of, numbers, split_label, uses_comma
from underlay.data.segments import HOLD, against_motion, label_pieces
from underlay.errors import UnitError
from underlay.units import parse_quantity

__all__ = ["FORMAT"]

_TABLE = "Measured values"
_KINDS = {"time": "time", "pd": "length", "fn": "force"}
# "Max load :<tab>1000.00 <tab>uN", "EHz=<tab>755.57 <tab>kPa", "Loading rate : 2000.00 uN/min"
_PAIR = re.compile(r"\s*(.+?)\s*(?::\s|=)\s*(.*?)\s*")
# "Linear load 20.00 uN ; 100.00 uN/min", "Pause in depth 120 s": a step has its numbers on its line.
_STEP = re.compile(r"\s*(linear|pause in)\s+(?:load|depth)\b.*\d", re.IGNORECASE)
# "Load Fit [10%,98%]": over which share of the force the first analysis was fitted.
_FIT_RANGE = re.compile(r"\s*Load Fit \[\s*(\d+(?:\.\d+)?)\s*%\s*[,;]\s*(\d+(?:\.\d+)?)\s*%\s*\]\s*")
_PROFILE = re.compile(r"\s*\+?\s*user defined profile", re.IGNORECASE)
# The number of the pause in the automatic protocol: load, pause, unload, retract.
_PAUSE_OF_ADVANCED = 2


def _sniff(source: Source) -> bool:
    head = source.head(65_536)
    return _TABLE in head and "SegmentID" in head and "\tFn (" in head


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    lines = lines_of(source)
    marks = [i for i, line in enumerate(lines) if line.strip() == _TABLE]
    require(marks and marks[0] + 2 < len(lines), source, f"no table after the line {_TABLE!r}")
    start = marks[0] + 1
    header_lines = lines[: marks[0]]
    labels = [split_label(label) for label in lines[start].split("\t")]
    names = [name.lower() for name, _ in labels]
    for name in (*_KINDS, "segmentid"):
        require(name in names, source, f"the table has no column {name!r}; it has {names_there(names)}")
    cells = [line.split("\t") for line in lines[start + 1 :]]
    indices = [names.index(name) for name in (*_KINDS, "segmentid")]
    comma = uses_comma([cell for row in cells[:200] for cell in row])
    table = numbers(cells, indices, source.name, comma=comma)
    time, depth, force = (
        table[:, j] * column_factor(labels[indices[j]][1], kind, name, source.name)
        for j, (name, kind) in enumerate(_KINDS.items())
    )
    header = _header(header_lines)
    notes: tuple[str, ...] = ()
    segment = _segments(header_lines, table[:, 3], depth)
    if segment is not None and np.isfinite(force).all() and np.isfinite(time).all():
        segment, notes = against_motion(segment, depth, time, force)
    return [
        make_curve(
            source,
            depth,
            force,
            time,
            segment,
            notes=notes,
            header=header,
            units={name: unit for name, unit in labels if unit},
            sign_rules={
                "depth": "Pd as written, growing into the sample",
                "force": "Fn as written, positive in compression",
                "segment": "from SegmentID and the protocol",
            },
            **_known_numbers(header),
            **_fit_range(header_lines),
        )
    ]


def _header(lines: Sequence[str]) -> dict[str, str]:
    header: dict[str, str] = {}
    for line in lines:
        matched = _PAIR.fullmatch(line.rstrip())
        if matched:
            header.setdefault(matched.group(1).rstrip(" :="), re.sub(r"\s+", " ", matched.group(2)))
    return header


def _known_numbers(header: dict[str, str]) -> dict[str, Any]:
    """Reduced modulus E / (1 - nu^2) of the vendor's Hertz fit (Pa), to compare with."""
    try:
        return {
            "instrument_reduced_modulus": parse_quantity(header["ErHz"], "pressure"),
            "instrument_model": "Hertz",
        }
    except (KeyError, UnitError):  # not every export holds an analysis; nothing depends on it
        return {}


def _fit_range(lines: Sequence[str]) -> dict[str, Any]:
    """Shares of the largest force between which the vendor's Hertz fit lies."""
    found = next((matched for matched in map(_FIT_RANGE.fullmatch, lines) if matched), None)
    return (
        {} if found is None else {"instrument_fit_range": tuple(float(end) / 100.0 for end in found.groups())}
    )


def _segments(lines: Sequence[str], ids: FloatArray, depth: FloatArray) -> NDArray[np.str_] | None:
    """Label each run of one SegmentID: a pause of the protocol is a hold, else the motion decides."""
    if not np.isfinite(ids).all() or not np.isfinite(depth).all():
        return None
    pauses = _pauses(lines)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(ids)) + 1, [len(ids)]))
    known = {int(first): HOLD for first in starts[:-1] if int(ids[first]) in pauses}
    return label_pieces(depth, starts, known)


def _pauses(lines: Sequence[str]) -> set[int]:
    """SegmentIDs of the pauses of a protocol."""
    if not any(map(_PROFILE.match, lines)):
        return {_PAUSE_OF_ADVANCED}
    steps = [matched.group(1).lower() for matched in map(_STEP.match, lines) if matched]
    return {number for number, step in enumerate(steps, start=1) if step.startswith("pause")}


FORMAT = Format(
    name="bioindenter",
    description="Anton Paar Bioindenter (UNHT Bio) text exports",
    sniff=_sniff,
    read_all=_read_all,
)
