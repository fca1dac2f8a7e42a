"""Asylum Research force curves: Igor binary waves (.ibw), one curve a file.

A wave of version 5 whose columns are channels in metres (`Raw` or `ZPiezo`, `ZSnsr`, `Defl`), equally spaced in
time, with a note of lines ``key: value``. The header is checked here for what it claims; the wave is taken apart
in memory by igor2 (LGPL, pure Python, 2026), which afmformats uses too.

Why not through afmformats (0.18): it keeps no time, takes `InputTime` for the duration (13.5 s for a curve of
1.0 s), takes no calibration, and fails on an image with a KeyError. Heights and forces are the same to rounding.
The deflection's rise is the file's own trigger point (`tests/test_public_afm.py`).
"""

from __future__ import annotations

import io
import math
import struct
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import understood
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._lever import Lever, lever_curve
from underlay.data.readers._source import CURVES, Source
from underlay.data.segments import segments_from_motion
from underlay.errors import FileFormatError, missing_extra

__all__ = ["FORMAT"]

# Igor binary waves begin with their version, in either byte order; Asylum's note names the spring constant.
_ORDERS = {b"\x05\x00": "<", b"\x00\x05": ">"}
_NOTE = b"SpringConstant"
# Both headers of version 5: sizes of the parts from byte 4 on, points at 76, dimensions at 132.
_HEADERS = 384
_HEIGHTS = ("ZSnsr", "ZSensor", "LVDT", "Raw", "ZPiezo", "Height")
_DEFLECTIONS = ("Defl", "Deflection")
_ABOUT = {
    "instrument": "MicroscopeModel",
    "software version": "Version",
    "date": "Date",
    "time": "Time",
    "imaging mode": "ImagingMode",
}


def _sniff(source: Source) -> bool:
    return source.data[:2] in _ORDERS and _NOTE in source.data


def _read_all(source: Source, options: Options) -> list[Curve]:
    _check(source)
    with understood(source.name, CURVES):
        values, names, note, step = _wave(source)
    if values.ndim != 2 or len(names) != values.shape[1]:
        raise FileFormatError(
            f"{source.name} is an Igor wave of {values.ndim} dimensions, no force curve: an image; save the force "
            "curves themselves"
        )
    columns = dict(zip(names, values.T, strict=True))
    height = next((name for name in _HEIGHTS if name in columns), None)
    deflection = next((name for name in _DEFLECTIONS if name in columns), None)
    if height is None or deflection is None:
        there = ", ".join(repr(name[:40]) for name in names[:8])
        raise FileFormatError(f"{source.name} has no height or no deflection; it has {there}")
    stated = {"stiffness": _number(note, "SpringConstant"), "sensitivity": _number(note, "InvOLS")}
    lever = Lever.of(source, stated, options.calibration)
    bending = columns[deflection] * _anew(lever)
    time = step * np.arange(len(bending), dtype=np.float64) if step > 0.0 else None
    travel = columns[height]
    known = np.isfinite(travel) & np.isfinite(bending)
    more: dict[str, Any] = {}
    if note.get("TriggerChannel") == "Force" and (trigger := _number(note, "TriggerPoint")):
        more["setpoint"] = trigger
    curve = lever_curve(
        source,
        travel,
        bending * lever.stiffness,
        lever,
        channel=height,
        time=time,
        segment=segments_from_motion(travel, time) if known.all() else None,
        name=source.path.stem,
        header={name: one_line(note[key])[:200] for name, key in _ABOUT.items() if note.get(key)},
        sign_rules={"segment": "from the motion of the height"},
        **more,
    )
    return [curve]


def _check(source: Source) -> None:
    """Refuse a wave whose header claims more than the file holds."""
    data = source.data
    if data[:2] not in _ORDERS:
        raise FileFormatError(f"{source.name} is no Igor binary wave of version 5")
    order = _ORDERS[data[:2]]
    if len(data) < _HEADERS:
        raise FileFormatError(f"{source.name} ends within its header")
    sizes = struct.unpack_from(f"{order}13i", data, 4)
    (points,) = struct.unpack_from(f"{order}i", data, 76)
    dimensions = struct.unpack_from(f"{order}4i", data, 132)
    product = math.prod(size for size in dimensions if size)
    claims = (*sizes, points, *dimensions, product)
    if min(claims) < 0 or max(claims) > len(data):
        raise FileFormatError(f"{source.name} claims {max(claims)} points or bytes; it has {len(data)} bytes")


def _wave(source: Source) -> tuple[FloatArray, list[str], dict[str, str], float]:
    """Numbers of a wave, names of its columns, its note, and the time between two rows (s; 0: not written)."""
    try:
        binarywave = import_module("igor2.binarywave")
    except ImportError as error:
        raise missing_extra("reading Asylum .ibw files needs igor2", "afm") from error
    wave = binarywave.load(io.BytesIO(source.data))["wave"]
    values = np.asarray(wave["wData"], dtype=np.float64)
    # The first label of a dimension is that of the dimension itself.
    names = [label.decode("latin-1") for label in wave["labels"][1][1:]]
    note: dict[str, str] = {}
    for line in wave["note"].decode("latin-1").replace("\n", "\r").split("\r"):
        key, colon, text = line.partition(":")
        if colon:
            note.setdefault(key.strip(), text.strip())
    header = wave["wave_header"]
    is_time = b"".join(header["dimUnits"][0].tolist()) == b"s"
    step = float(header["sfA"][0]) if is_time else 0.0
    return values, names, note, step if math.isfinite(step) else 0.0


def _number(note: Mapping[str, str], key: str) -> float | None:
    try:
        value = float(note.get(key, ""))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _anew(lever: Lever) -> float:
    """Factor on the file's deflection, which is in metres, where another sensitivity is given."""
    about = lever.about
    return about["sensitivity"] / about["file_sensitivity"] if "file_sensitivity" in about else 1.0


FORMAT = Format(
    name="asylum",
    description="Asylum Research force curves (Igor binary waves, .ibw)",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
    takes_calibration=True,
)
