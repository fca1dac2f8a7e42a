"""Binary force curves of three makers: Asylum Research (.ibw), Nanosurf (.nid) and Park Systems (.tiff).

**Asylum**: an Igor binary wave of version 5 whose columns are channels in metres (`Raw` or `ZPiezo`, `ZSnsr`,
`Defl`), equally spaced in time, with a note of lines ``key: value``. The header is checked here for what it claims;
the wave is taken apart in memory by igor2 (LGPL, pure Python, 2026), which afmformats uses too. Why not through
afmformats (0.18): it keeps no time, takes `InputTime` for the duration (13.5 s for a curve of 1.0 s), takes no
calibration, and fails on an image with a KeyError. Heights and forces are the same to rounding. The deflection's
rise is the file's own trigger point.

**Nanosurf** (C3000 and easyScan controllers): text in sections, ``[DataSet-0:0]`` with ``key=value``, up to ``#!``;
then every channel in the order of its group, lines of 16- or 32-bit integers, little-endian. A number is a share of
the channel's range, ``Dim2Min`` and ``Dim2Range``, in ``Dim2Unit``. A line is a curve of ``LineDim<i>Points``
points; the rest of it is padding. Both ways of the modulation are stored *along the axis*, from far to near: the
way back is turned round here. Pauses are stored in time. Why not by Nanosurf's NSFopen 2.2.4 (MIT, 2024): it opens
a path of its own, trusts every size in the header, and knows no pause by line. Its numbers are ours to rounding.
Not read: .nhf of Nanosurf Studio, of which no public force curve was found.

**Park** (XEI and SmartScan): a TIFF file whose private tags hold the curves: 50438 the header of the spectroscopy,
a table of eight channels (name, unit, gain) and numbers at fixed places, and 50439 the values, point by point on
the sample, channel by channel, the way in and the way back one after the other. The place of each number is as
pspylib's reader has it. What a public file shows: "Z Scan" *falls* towards the sample, the scanner goes down; each
way is padded to its length by repeating its last point, time stamp included; a "Z Detector" may be dead. The
channel "Force" is 8 % above what the header's own spring constant and sensitivity make of the volts: what the
maker's program shows is taken, a note says so, and a calibration that is given acts on the volts. Why not by Park's
pspylib 0.1.2 (2025): it may be used under a licence of Park's own only and opens a path; tifffile is not needed for
six tags.

What public files show is held by `tests/test_public_afm.py`.
"""

from __future__ import annotations

import io
import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._door import understood
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Options, declared, library
from underlay.data.readers._lever import Lever, lever_curve, sensor_note
from underlay.data.readers._source import CURVES, MAX_BYTES, MOST_PARTS, Source, finite
from underlay.data.readers._text import SAID, si_factor
from underlay.data.segments import HOLD, LOADING, UNLOADING, segments_from_motion

# --- Asylum


# Igor binary waves begin with their version, in either byte order; Asylum's note names the spring constant.
_ORDERS = {b"\x05\x00": "<", b"\x00\x05": ">"}
_NOTE = b"SpringConstant"
# Of the headers of version 5, of 384 bytes: sizes of the thirteen parts, points, and four dimensions.
_CLAIMS, _HEADERS = "4x13i20xi52x4i", 384
_IBW_HEIGHTS = ("ZSnsr", "ZSensor", "LVDT", "Raw", "ZPiezo", "Height")
_IBW_DEFL, _SPRING = ("Defl", "Deflection"), _NOTE.decode()


def _read_asylum(source: Source, options: Options) -> list[Curve]:
    data = source.data
    source.require(data[:2] in _ORDERS, "is no Igor binary wave of version 5")
    source.require(len(data) >= _HEADERS, "ends within its header")
    declared = struct.unpack_from(_ORDERS[data[:2]] + _CLAIMS, data)
    product = math.prod(size for size in declared[-4:] if size)
    claims = (*declared, product, 64 + sum(declared[:13]))  # the sizes are of what follows the first header
    sound = min(claims) >= 0 and max(claims) <= len(data)
    source.require(sound, f"claims {max(claims)} points or bytes; it has {len(data)} bytes")
    with understood(source.name, CURVES):
        values, names, note, step = _wave(source)
    source.require(
        values.ndim == 2 and len(names) == values.shape[1],
        f"is an Igor wave of {values.ndim} dimensions, no force curve: an image; save the force curves themselves",
    )
    columns = dict(zip(names, values.T, strict=True))
    channels = [next((name for name in known if name in columns), "") for known in (_IBW_HEIGHTS, _IBW_DEFL)]
    source.require(all(channels), f"has no height or no deflection; it has {names_there(names)}")
    travel, bending = (columns[name] for name in channels)
    stated = {"stiffness": finite(note.get(_SPRING, "")), "sensitivity": finite(note.get("InvOLS", ""))}
    lever = Lever.of(source, stated, options.calibration)
    time = step * np.arange(len(bending), dtype=np.float64) if step > 0.0 else None
    known = np.isfinite(travel) & np.isfinite(bending)
    trigger = finite(note.get("TriggerPoint", "")) if note.get("TriggerChannel") == "Force" else None
    more: dict[str, Any] = {"setpoint": trigger} if trigger else {}
    curve = lever_curve(
        source,
        travel,
        lever.force(source, bending, "m"),
        lever,
        channel=channels[0],
        time=time,
        segment=segments_from_motion(travel, time) if known.all() else None,
        header={name: note.get(key, "") for name, key in SAID["formats"]["asylum"]["about"].items()},
        sign_rules={"segment": "from the motion of the height"},
        **more,
    )
    return [curve]


def _wave(source: Source) -> tuple[FloatArray, list[str], dict[str, str], float]:
    """Read an Igor wave: numbers (rows, columns), column names, its note, and seconds between rows (0: unknown)."""
    binarywave = library("igor2.binarywave", "reading Asylum .ibw files needs igor2")
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


ASYLUM = declared("asylum", _read_asylum, lambda source: source.data[:2] in _ORDERS and _NOTE in source.data)


# --- Nanosurf


# "D[2.72436]*[N/m]"
_PROPERTY = re.compile(r"\w\[([^\]]*)\]\*\[([^\]]*)\]")
_END = b"#!"
_INTEGERS: Mapping[str, np.dtype[Any]] = {"16": np.dtype("<i2"), "32": np.dtype("<i4")}
_DEFLECTION = "Deflection"
# Groups of a force curve in the order of time: name, label, whether it is stored against time, and where the
# duration and the number of points of the whole of it are.
_GROUPS = (
    ("Spec forward", LOADING, False, "FwMod"),
    ("Spec fwd pause", HOLD, False, "FwPause"),
    ("Spec backward", UNLOADING, True, "BwMod"),
)
_CHANNEL_KEY = re.compile(r"Gr(\d{1,6})-Ch(\d{1,6})")
# What is worth showing, by its name in the section of the measurement.
_NID_ABOUT = {"instrument": "Head type", "software version": "Software ver.", "date": "Date", "time": "Time"}
_TIMES = r"DataSet\Parameters\Spectroscopy"


class _Nid:
    """Header of a Nanosurf .nid file: text entries by section and key."""

    def __init__(self, source: Source) -> None:
        self.source, self.start = source, source.data.find(_END) + len(_END)
        source.require(self.start >= len(_END), "is cut short: its header does not end")
        self.sections: dict[str, dict[str, str]] = {}
        entries: dict[str, str] = {}
        for line in source.data[: self.start - len(_END)].decode("latin-1").splitlines():
            if line.startswith("[") and line.endswith("]"):
                entries = self.sections.setdefault(line[1:-1], {})
            elif "=" in line:
                key, _, value = line.partition("=")
                entries.setdefault(key, value.strip())

    def __getitem__(self, section: str) -> Mapping[str, str]:
        return self.sections.get(section, {})

    def count(self, section: str, key: str, most: int = MAX_BYTES) -> int:
        """A whole number of the header, at most `most`; FileFormatError where it is missing or larger."""
        return self.source.count(self[section].get(key, ""), f"{key!r} in [{section!s:.60}]", most)

    def number(self, section: str, key: str) -> float | None:
        """A finite number of the header, written plainly or as ``D[2.7]*[N/m]``; None where there is none."""
        text = self[section].get(key, "")
        found = _PROPERTY.fullmatch(text)
        return finite(found[1] if found else text)

    def groups(self) -> dict[str, list[_Channel]]:
        """Channels of the groups that make a force curve (forward, pause, backward), by the name of the group."""
        source, start, wanted = self.source, self.start, {name for name, *_ in _GROUPS}
        groups: dict[str, list[_Channel]] = {}
        there = [
            (found, section)
            for key, section in self["DataSet"].items()
            if (found := _CHANNEL_KEY.fullmatch(key))
        ]
        for found, section in sorted(there, key=lambda one: (int(one[0][1]), int(one[0][2]))):
            name = self["DataSet"].get(f"Gr{found[1]}-Name", "")
            points, lines = self.count(section, "Points"), self.count(section, "Lines", MOST_PARTS)
            bits = self[section].get("SaveBits", "")
            source.require(bits in _INTEGERS, f": [{section!s:.60}] holds no numbers of 16 or 32 bits")
            raw = source.array(_INTEGERS[bits], points * lines, start, f"[{section!s:.60}]")
            if name in wanted:
                groups.setdefault(name, []).append(_Channel.of(self, section, raw.reshape(lines, points)))
            start += raw.nbytes
        return groups

    def lever(self, options: Options) -> Lever:
        """Calibration of the cantilever: spring constant, and sensitivity from full scales in metres and volts."""
        stated = {"stiffness": self.number(r"DataSet\Calibration\Cantilever", "Prop0")}
        scales: dict[str, float] = {}
        for entry in self[r"DataSet\Calibration\Scanhead"].values():
            # "5,TipSignalDC,Deflection,m,7.30723e-07,0"
            cells = entry.split(",")
            if len(cells) == 6 and cells[1].startswith("TipSignalDC") and cells[2] == _DEFLECTION:
                scales.setdefault(cells[3], finite(cells[4]) or 0.0)
        if scales.get("m") and scales.get("V"):
            stated["sensitivity"] = scales["m"] / scales["V"]
        return Lever.of(self.source, stated, options.calibration)


@dataclass(frozen=True)
class _Channel:
    """One channel of one group of a .nid file: name, unit, values (lines, points), points per line, header section.

    A line is one curve; of the points stored only the first ones given in `points` are readings.
    """

    name: str
    unit: str
    values: FloatArray
    points: tuple[int, ...]
    section: str

    @classmethod
    def of(cls, nid: _Nid, section: str, raw: NDArray[Any]) -> _Channel:
        """Make a channel from its integers (lines, points), scaled to the range that its header section states."""
        entries, bits = nid[section], 8 * raw.dtype.itemsize
        low, extent = (
            nid.source.number(entries.get(key, ""), f"{key!r} in [{section!s:.60}]")
            for key in ("Dim2Min", "Dim2Range")
        )
        keys = [f"LineDim{line}Points" for line in range(len(raw))]
        points = tuple(nid.count(section, key) if key in entries else raw.shape[1] for key in keys)
        values = low + (raw + 2.0 ** (bits - 1)) * (extent / 2.0**bits)
        return cls(entries.get("Dim2Name", ""), entries.get("Dim2Unit", ""), values, points, section)

    def line(self, number: int, *, backwards: bool) -> FloatArray:
        """Values (n,) of one line without its padding; reversed if `backwards`, to be in order of time."""
        count = min(self.points[number], self.values.shape[1])
        line: FloatArray = self.values[number][:count]
        return line[::-1] if backwards else line


def _read_nanosurf(source: Source, options: Options) -> list[Curve]:
    nid = _Nid(source)
    groups = nid.groups()
    forward = source.given(
        _deflection(groups, _GROUPS[0][0]),
        "is a Nanosurf file without a force curve ('Spec forward' of the deflection); images and spectra are "
        "not read",
    )
    lever = nid.lever(options)
    numbers = [number for number, points in enumerate(forward.points) if points]
    return [_nid_curve(nid, groups, lever, number) for number in numbers]


def _deflection(groups: Mapping[str, list[_Channel]], group: str) -> _Channel | None:
    return next((channel for channel in groups.get(group, ()) if channel.name == _DEFLECTION), None)


def _nid_curve(nid: _Nid, groups: Mapping[str, list[_Channel]], lever: Lever, number: int) -> Curve:
    source = nid.source
    travels, forces, times, labels = [], [], [], list[str]()
    began, timed = 0.0, True
    for group, label, backwards, setting in _GROUPS:
        deflection = _deflection(groups, group)
        if deflection is None or number >= len(deflection.points):
            continue
        unit, values = deflection.unit, deflection.line(number, backwards=backwards)
        known = unit in {"N", "m", "V"}
        source.require(known, f": a deflection in {unit!r:.20}, not in N, m or V")
        forces.append(lever.force(source, values, unit))
        axis, count = _axis(source, groups[group]), len(values)
        there = number < len(axis.points) and len(axis.line(number, backwards=backwards)) == count
        source.require(there, f": {group!r} has channels of different lengths")
        travels.append(axis.line(number, backwards=backwards))
        lasted, planned = (nid.number(_TIMES, f"{setting}{key}") or 0.0 for key in ("Time", "Datapoints"))
        timed &= lasted > 0.0 and planned > 0.0
        # One that was stopped early took its share.
        interval = lasted / max(planned, 1.0)
        times.append(began + np.arange(count) * interval)
        began += count * interval
        labels += [label] * count
    axis = _axis(source, groups[_GROUPS[0][0]])
    in_metres = nid[axis.section].get("Dim0Unit") == "m"
    # How far the axis was driven on the way in (m).
    driven = (nid.number(axis.section, f"LineDim{number}Range") or 0.0) if in_metres else 0.0
    return lever_curve(
        source,
        np.concatenate(travels),
        np.concatenate(forces),
        lever,
        channel=axis.name[:80],
        time=np.concatenate(times) if timed else None,
        segment=np.array(labels, dtype="<U9"),
        number=number + 1,
        header={name: nid["DataSet-Info"].get(key, "") for name, key in _NID_ABOUT.items()},
        notes=sensor_note(travels[0], driven),
        sign_rules={
            "segment": "forward, pause and backward of the modulation; backward is stored along its axis"
        },
    )


def _axis(source: Source, channels: list[_Channel]) -> _Channel:
    """Choose the channel of the scanner's travel: a position in metres, from a sensor if there is one."""
    lengths = [channel for channel in channels if channel.unit == "m" and channel.name != _DEFLECTION]
    source.require(lengths, "holds no position of the scanner along its force curves")
    return next((channel for channel in lengths if "sensor" in channel.name.lower()), lengths[0])


NANOSURF = declared("nanosurf", _read_nanosurf)


# --- Park


# Tag 50432, one whole number: the mark of Park Systems.
_MAGIC = b"\x00\xc5\x04\x00\x01\x00\x00\x00\x01\x13\x03\x0e"
# Tags: header of the spectroscopy, its values, program, date; and bytes of one item of a type.
_SPECTRA, _VALUES, _SOFTWARE, _DATE = 50438, 50439, 305, 306
_ITEM = {1: 1, 2: 1, 3: 2, 4: 4, 7: 1}
_BYTE = np.dtype("u1")
# In the header of the spectroscopy: eight channels of 96 bytes, then numbers, then three floats a point.
_CHANNELS, _CHANNEL = 8, struct.Struct("<64s16sdii")
_COUNTS_AT, _CALIBRATION_AT, _TYPE_AT, _PLACES_AT, _PLACE = 768, 976, 1108, 1208, 12
_NUMBERS: Mapping[int, np.dtype[Any]] = {0: np.dtype("<i2"), 1: np.dtype("<i4"), 2: np.dtype("<f4")}
_KINDS = ("length", "force", "voltage", "time")
_VOLTS, _FORCE, _TIME = "Vertical (A-B)", "Force", "Time Stamp"
# The sensor first: the scan is what the scanner was told. One that moves less than this share of it is dead.
_PARK_HEIGHTS, _DEAD = ("Z Detector", "Z Scan"), 0.5
# Two calibrations of one file that differ by more are worth a note.
_SAME = 0.01


def _read_park(source: Source, options: Options) -> list[Curve]:
    tags = _tags(source)
    channels, places, stated = _spectra(source, tags)
    lever = Lever.of(source, stated, options.calibration)
    about = {"instrument": "Park Systems AFM"} | {
        name: tags.get(tag, b"").split(b"\0")[0].decode("latin-1")
        for name, tag in (("software version", _SOFTWARE), ("date", _DATE))
    }
    return [
        _park_curve(
            source, {name: values[at] for name, values in channels.items()}, place, lever, about, at + 1
        )
        for at, place in enumerate(places)
    ]


def _tags(source: Source) -> dict[int, bytes]:
    """Read from the first TIFF directory the content of the tags that a force curve needs, by tag number."""
    data = source.data
    found: dict[int, bytes] = {}
    try:
        (start,) = struct.unpack_from("<I", data, 4)
        (count,) = struct.unpack_from("<H", data, start)
        for number in range(count):
            at = start + 2 + 12 * number
            tag, kind, items, place = struct.unpack_from("<HHII", data, at)
            if tag not in {_SPECTRA, _VALUES, _SOFTWARE, _DATE} or tag in found:
                continue
            size = items * _ITEM.get(kind, 0)
            place = at + 8 if size <= 4 else place
            found[tag] = source.array(_BYTE, size, place, f"tag {tag}").tobytes()
    except struct.error as error:
        raise source.wrong("is cut short within its directory") from error
    return found


def _spectra(
    source: Source, tags: Mapping[int, bytes]
) -> tuple[dict[str, FloatArray], list[tuple[float, float]], dict[str, float]]:
    """Read the curves of a Park file.

    Returns channels in SI, (curves, n), by name; the place (x, y) (m) of each curve; and the calibration that the
    file states, ``stiffness`` (N/m) and ``sensitivity`` (m/V).
    """
    header, content = tags.get(_SPECTRA, b""), tags.get(_VALUES, b"")
    source.require(
        header and content,
        "is a Park Systems file without force-distance curves: an image; save the spectroscopy",
    )
    source.require(len(header) >= _PLACES_AT, "is damaged: its header of the spectroscopy ends early")
    used, _, points, curves = struct.unpack_from("<4i", header, _COUNTS_AT)
    (kind,) = struct.unpack_from("<i", header, _TYPE_AT)
    source.require(
        0 < used <= _CHANNELS and points > 1 and curves > 0 and kind in _NUMBERS,
        f"is damaged: {used} channels of {points} points at {curves} places, of kind {kind}",
    )
    declared = used * points * curves
    source.require(
        declared * _NUMBERS[kind].itemsize <= len(content) and _PLACES_AT + curves * _PLACE <= len(header),
        f"is cut short: it claims {curves} curves of {used} channels of {points} points, and holds {len(content)} "
        "bytes of them",
    )
    raw = np.frombuffer(content, _NUMBERS[kind], declared).reshape(curves, used, points)
    channels = {}
    for number in range(used):
        name, unit, gain, *_ = _CHANNEL.unpack_from(header, number * _CHANNEL.size)
        # UTF-16 up to its first zero.
        name, unit = (
            text.decode("utf-16-le", errors="replace").split("\0")[0].strip() for text in (name, unit)
        )
        factor = si_factor(unit, *_KINDS)
        if factor and np.isfinite(gain):
            channels[name] = raw[:, number, :] * (gain * factor)
    at = np.frombuffer(header, "<f4", 3 * curves, _PLACES_AT).reshape(curves, 3)
    stiffness, volts_per_micrometre = struct.unpack_from("<2d", header, _CALIBRATION_AT)
    sensitivity = 1e-6 / volts_per_micrometre if volts_per_micrometre else 0.0
    places = [(1e-6 * float(x), 1e-6 * float(y)) for x, y, _ in at]
    return channels, places, {"stiffness": stiffness, "sensitivity": sensitivity}


def _park_curve(
    source: Source,
    channels: Mapping[str, FloatArray],
    place: tuple[float, float],
    lever: Lever,
    about: Mapping[str, str],
    number: int,
) -> Curve:
    # How far each height moves (m), points without a value left out.
    known = {name: channels[name][np.isfinite(channels[name])] for name in _PARK_HEIGHTS if name in channels}
    moved = {name: float(np.ptp(values)) if values.size else 0.0 for name, values in known.items()}
    there = names_there(channels) if channels else "no known unit"
    signals = moved and {_VOLTS, _FORCE} & set(channels)
    source.require(signals, f"has no height or no deflection; it has {there}")
    height = next(name for name in moved if moved[name] >= _DEAD * max(moved.values()))
    half = len(channels[height]) // 2
    recorded = _recorded(channels.get(_TIME, channels[height]), half)
    force, notes = _park_force(source, channels, lever)
    labels = np.where(np.arange(2 * half) < half, LOADING, UNLOADING).astype("<U9")
    return lever_curve(
        source,
        -channels[height][recorded],
        force[recorded],
        lever,
        channel=f"minus {height}",
        time=channels[_TIME][recorded] if _TIME in channels else None,
        segment=labels[recorded],
        number=number,
        header=about,
        sign_rules={"segment": "first half in, second half back"},
        notes=notes,
        position=place,
    )


def _recorded(clock: FloatArray, half: int) -> NDArray[np.intp]:
    """Indices of the points that were recorded, without the padding that repeats the last point of a way.

    `clock` (n,) is the channel in which padding shows; approach and retraction have `half` points each.
    """
    known = []
    for start in (0, half):
        way = clock[start : start + half]
        moving = np.flatnonzero(way != way[-1])
        known.append(start + np.arange(min(int(moving[-1]) + 2 if moving.size else 1, half)))
    return np.concatenate(known)


def _park_force(
    source: Source, channels: Mapping[str, FloatArray], lever: Lever
) -> tuple[FloatArray, Sequence[str]]:
    """Force (N), (n,), from the file's force channel, or its volts where the caller calibrates; and notes on it."""
    volts, force = channels.get(_VOLTS), channels.get(_FORCE)
    given = any(name.startswith("file_") for name in lever.about)
    if volts is not None and (given or force is None):
        return lever.force(source, volts), ()
    source.require(not given, "holds forces and no volts; no calibration can be given")
    force = source.given(force, "holds no volts to calibrate anew")
    if volts is None or lever.sensitivity is None or not np.ptp(volts) > 0.0:
        return force, ()
    ratio = float(np.ptp(force) / (np.ptp(volts) * lever.sensitivity * lever.stiffness))
    if abs(ratio - 1.0) <= _SAME:
        return force, ()
    note = (
        f"the file's force is {ratio:.3f} times what its spring constant ({lever.stiffness:.4g} N/m) and "
        f"sensitivity ({1e9 * lever.sensitivity:.4g} nm/V) make of its volts; the force is taken, the spring "
        "constant takes the bending off; give a calibration to settle it"
    )
    return force, (note,)


PARK = declared(
    "park", _read_park, lambda source: source.data[:4] == b"II*\0" and _MAGIC in source.data[:4096]
)
