"""Atomic force microscopes: JPK, NT-MDT text, and HDF5 and tables (.tab) of afmformats.

The content is recognised, not the extension. All give the height of the scanner, falling towards the sample, and
the force. The tip is at height + force / spring constant, so depth = -(height + force / spring constant); its zero
is arbitrary and contact is found later. A file without a spring constant gives depth = -height, which still holds
the bending of the cantilever: a note says so.

Why not through afmformats (0.18): it opens a path of its own and takes metadata as they are. The numbers are its to
the last bit (`tests/test_real_files.py`).
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import parse_json
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Options, declared
from underlay.data.readers._hdf5 import HDF5_MAGIC, Checked, curve_groups, is_own, open_checked
from underlay.data.readers._lever import Lever, lever_curve, uncalibrated
from underlay.data.readers._source import Source
from underlay.data.readers._text import Lines, lines_of, numbers
from underlay.data.readers.jpk import read_jpk
from underlay.data.segments import HOLD, label_pieces, segments_from_motion
from underlay.errors import InputError

# What opens and ends the metadata of a .tab: JSON behind "#". A row of names behind "#" and SI numbers follow.
_TAB_MARK, _END = "# BEGIN METADATA", "# END METADATA"
_COLUMNS = ("force", "time", "segment")
# The better height that there is, of these.
_HEIGHTS = ("height (measured)", "height (piezo)")
# Of two segments, older versions of a .tab wrote which one as a boolean; no other column of them is used.
_OLD_SEGMENTS = {"False": "0", "True": "1"}
# Numbers that other parts rely on, and what those that stand in a curve's metadata are called there.
_KNOWN = {"spring constant": "spring_constant", "sensitivity": "sensitivity", "setpoint": "setpoint"}
_NUMBERS = (*_KNOWN, "position x", "position y")
# NT-MDT: no header, three columns with decimal commas: height (nm), detector (nA) on the way in and on the way out.
_NTMDT_ROW = re.compile(r"-?\d+,\d+\t-?\d+,\d+\t-?\d+,\d+")
# A segment that travels less than this share of the whole rests: creep under a held force is a few per cent.
_REST = 0.1


def _kind(source: Source) -> str:
    data = source.data
    if source.is_zip:
        return "jpk" if b"header.properties" in data else ""
    if data.startswith(HDF5_MAGIC):
        return "" if is_own(source) else "hdf5"
    head = source.head(2000)
    if _TAB_MARK in head:
        return "tab"
    lines = [line for line in head.split("\n") if line][:4]
    return "ntmdt" if len(lines) == 4 and all(map(_NTMDT_ROW.fullmatch, lines[:3])) else ""


def _read_all(source: Source, options: Options) -> list[Curve]:
    given, kind = options.calibration, _kind(source)
    source.require(kind, "is none of JPK, NT-MDT, HDF5 or .tab")
    if kind == "ntmdt" and given.keys() != {"stiffness", "current sensitivity"}:
        raise uncalibrated(source, "nm/nA")
    if given and kind in {"tab", "hdf5"}:
        raise InputError(f"{source.name} holds forces, not signals; a calibration cannot be given")
    return _READERS[kind](source, given)


def _tab(source: Source, _: Mapping[str, float]) -> list[Curve]:
    """Read a .tab file of afmformats, one curve of SI columns and JSON metadata; no calibration is used."""
    lines = lines_of(source)
    comments = [line.strip() for line in lines if line.startswith("#")]
    rows = [line.split("\t") for line in lines if not line.startswith("#")]
    whole = _TAB_MARK in comments and _END in comments and rows
    source.require(whole, f": no line {_TAB_MARK!r} or {_END!r}, or no rows of numbers below them")
    names = comments[-1].lstrip("# ").split("\t")
    wanted = [name for name in (*_HEIGHTS, *_COLUMNS) if name in names]
    there = "force" in wanted and wanted[0] in _HEIGHTS
    source.require(there, f"has no column 'force' or no height; it has {names_there(names)}")
    if "segment" in wanted:
        at = names.index("segment")
        for row in rows:
            row[at:] = [_OLD_SEGMENTS.get(cell, cell) for cell in row[at:]]
    table = numbers(rows, [names.index(name) for name in wanted], source.name, comma=False)
    about = comments[comments.index(_TAB_MARK) + 1 : comments.index(_END)]
    try:
        found = parse_json("\n".join(line.lstrip("#") for line in about))
    except (ValueError, RecursionError) as error:
        raise source.wrong(f": its metadata are damaged JSON: {error!s:.120}") from error
    entries: Mapping[str, Any] = found if isinstance(found, dict) else {}
    # A number that other parts rely on is one, or is left out.
    known = {key: value for key, value in entries.items() if key not in _NUMBERS or _is_number(value)}
    return [_curve(source, 1, dict(zip(wanted, table.T, strict=True)), known)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _ntmdt(source: Source, given: Mapping[str, float]) -> list[Curve]:
    """Read the curve of an NT-MDT text: height, deepest point first, and detector current of both ways."""
    height, *passes = numbers(Lines(lines_of(source), "\t"), (0, 1, 2), source.name, comma=True).T
    heights, signals = [], []
    for signal, turn in zip(passes, (-1, 1), strict=True):
        # What was padded repeats the first reading.
        moving = np.flatnonzero(signal != signal[0])
        source.require(moving.size, ": its signal is the same everywhere")
        heights.append(height[moving[0] - 1 :][::turn])
        signals.append(signal[moving[0] - 1 :][::turn])
    data = {
        _HEIGHTS[0]: 1e-9 * np.concatenate(heights),
        "force": np.concatenate(signals) * (given["current sensitivity"] * given["stiffness"]) * 1e-9,
        "segment": np.repeat((0.0, 1.0), [len(part) for part in heights]),
    }
    found = {"spring constant": given["stiffness"], "sensitivity": given["current sensitivity"]}
    return [_curve(source, 1, data, found)]


def _hdf5(source: Source, _: Mapping[str, float]) -> list[Curve]:
    with open_checked(source) as file:
        groups = [(number, file[number]) for number in curve_groups(source, file)]
        _require_afmformats(source, file, groups[0][1] if groups else None)
        return [
            _curve(
                source,
                number,
                {name: group[name] for name in _columns(group)},
                {**group.said(), "enum": int(key)},
            )
            for number, (key, group) in enumerate(groups, start=1)
        ]


def _columns(group: Checked) -> list[str]:
    """Names of the data sets of a curve that are read: the best height there is, force, time and segment."""
    return [*[name for name in _HEIGHTS if name in group][:1], *[name for name in _COLUMNS if name in group]]


def _require_afmformats(source: Source, file: Checked, group: Any) -> None:
    """Refuse an HDF5 file that afmformats did not write (FileFormatError); the message says what it holds."""
    if file.is_said("software") and isinstance(group, Checked) and "force" in group:
        return
    if file.is_said("nsf_file_version_major"):
        raise source.wrong(
            "is a Nanosurf Studio file (.nhf), which is not read here: export its curves from "
            "Studio as .nid, or as text with names and units in the first row"
        )
    raise source.wrong(
        f"is an HDF5 file of a layout not known here (it holds {names_there(file)}): known are those written "
        "by underlay and by afmformats. Export its curves as text with names and units in the first row, such "
        "as 'depth (um),force (mN),time (s)', or read it in Python and make an underlay.Curve of its columns"
    )


_READERS: Mapping[str, Callable[[Source, Mapping[str, float]], list[Curve]]] = {
    "jpk": read_jpk,
    "ntmdt": _ntmdt,
    "tab": _tab,
    "hdf5": _hdf5,
}


def _curve(
    source: Source, number: int, data: Mapping[str, FloatArray], found: Mapping[str, Any], **known: Any
) -> Curve:
    """Make a curve of SI columns: heights, force (N), time (s), segment numbers.

    `found` are its metadata by afmformats' names, such as "spring constant"; `known` are further metadata.
    """
    channel = next((name for name in _HEIGHTS if name in data), _HEIGHTS[-1])
    height, force = (np.array(data[name], dtype=np.float64) for name in (channel, "force"))
    time = np.array(data["time"], dtype=np.float64) if "time" in data else None
    if "position x" in found and "position y" in found:
        known["position"] = (float(found["position x"]), float(found["position y"]))
    about = {name: found[key] for key, name in _KNOWN.items() if key in found}
    stiffness = found.get("spring constant")
    rules = {
        "force": "positive in compression",
        "segment": "from the file's segments where it has several, else from the motion of the height",
    }
    return lever_curve(
        source,
        -height,
        force,
        Lever(stiffness) if stiffness else None,
        channel=f"minus {channel}",
        time=time,
        segment=_segments(data, height, time),
        number=number,
        sign_rules=rules,
        **{
            "header": {key: str(found[key]) for key in found if key not in {"path", "z range"}},
            **about,
            **known,
        },
    )


def _segments(data: Mapping[str, FloatArray], height: FloatArray, time: FloatArray | None) -> Any:
    """Segment labels (n,) from the motion within each numbered segment; None where a height is missing."""
    if not np.isfinite(height).all():
        return None
    numbers = np.asarray(data["segment"]) if "segment" in data else np.zeros(len(height))
    ends = np.flatnonzero(np.diff(numbers)) + 1
    if not ends.size:
        return segments_from_motion(-height, time)
    starts = np.concatenate(([0], ends, [len(height)]))
    travel = np.abs([height[last - 1] - height[first] for first, last in itertools.pairwise(starts)])
    resting = starts[:-1][travel < _REST * np.ptp(height)]
    return label_pieces(-height, starts, {int(first): HOLD for first in resting})


FORMAT = declared("afm", _read_all, lambda source: bool(_kind(source)))
