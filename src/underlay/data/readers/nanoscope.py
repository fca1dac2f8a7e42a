"""Bruker NanoScope: force curves (.spm, .000, .001, ...), force volumes, and PeakForce captures (.pfc).

After the header come numbers of 2 or 4 bytes, little-endian. Each section "Ciao force image list" is one
channel of all curves; of each curve it holds the way in, *stored backwards from the turn*, then the way out,
then the hold at the turn. Volts are the number times the hard scale (`_nanoscope_channels.py`), and metres
volts times the sensitivity that the scale names.

What was seen in public files (`tests/test_public_afm.py`): from version 9.20 on every number takes 4 bytes,
whatever "Bytes/pixel" says; the least number marks points of the way in that were not recorded; the
deflection reaches the file's own trigger at the turn; a PeakForce tap turns where its "Sync Distance" says.
Two ways of unequal length and scripts of several ramps were not seen whole and are refused.

Why by a reader of our own: pyfmreader 0.1.3 (MIT, its last release is of 2023) opens a path of its own
without bounds, knows neither height sensor nor hold, and shifts the baseline; pySPM reads images; Bruker's
own ``nanoscope`` needs a library of Windows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._lever import Lever, lever_curve, sensor_note
from underlay.data.readers._nanoscope_channels import (
    SCALE,
    TRIGGER,
    Header,
    Section,
    Tap,
    channel_numbers,
    check_trigger,
    read_header,
    tap_of,
)
from underlay.data.readers._source import Source, curve_name
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import FileFormatError, InputError

__all__ = ["FORMAT"]

_STARTS = (b"\\*Force file list", b"\\*File list")
# A map of 128 by 128 with room: 20,000 curves of 256 points are 400 MB as curves.
_MOST_CURVES = 20_000
_WIDE_SINCE = 0x09200000
_RAMP = ("@4:Ramp size", "@4:Ramp Size")
_SIGNAL = "@4:Image Data"
_EXPORT = "open it in NanoScope Analysis and export the curves as text, one file a curve"


@dataclass(frozen=True)
class _Layout:
    """How many points a curve has on each way and at the turn, how many curves there are, bytes a number."""

    way: int
    hold: int
    curves: int
    width: int

    @property
    def points(self) -> int:
        return 2 * self.way + self.hold

    def stored(self, in_time: FloatArray, held: FloatArray | None = None) -> FloatArray:
        """Signals of the points in the order of time, put into the order of the file."""
        parts = (in_time[: self.way][::-1], in_time[self.way :], *(() if held is None else (held,)))
        return np.concatenate(parts)


def _sniff(source: Source) -> bool:
    return source.data.startswith(_STARTS)


def _read_all(source: Source, options: Options) -> list[Curve]:
    curves, count = _opened(source, options)
    if count > _MOST_CURVES:
        raise FileFormatError(
            f"{source.name} holds {count} curves; up to {_MOST_CURVES} are read at once: pick one, test = 1 to "
            f"test = {count}, or save a part of the volume"
        )
    return [curve for number in range(count) if (curve := curves(number)) is not None]


def _read_one(source: Source, options: Options, number: int) -> Curve:
    curves, count = _opened(source, options)
    curve = curves(number - 1) if 1 <= number <= count else None
    if curve is None:
        raise InputError(
            f"there is no test {number}: {source.name} holds {count} tests, or nothing of this one"
        )
    return curve


def _opened(source: Source, options: Options) -> tuple[Callable[[int], Curve | None], int]:
    """Return what makes a curve of its number (from 0), and how many there are.

    The callable gives None for a curve that was not recorded.
    """
    header = read_header(source)
    deflection = next((image for image in header.images if "[Deflection" in image.text(_SIGNAL)), None)
    if deflection is None:
        raise FileFormatError(
            f"{source.name} is a NanoScope file without a force curve of the deflection: an image, or another "
            "signal; save the force curves themselves"
        )
    layout = _layout(header, deflection)
    tap = tap_of(header, layout.points, layout.hold)
    lever = _lever(header, deflection, options)
    volts, travels = _signal(header, deflection, layout), _travel(header, deflection, layout, tap)
    time = _time(header, deflection, layout, tap)
    order, labels = _order(tap, layout)
    about = _about(header, lever)

    def curve(number: int) -> Curve | None:
        deflection = volts(number)[order]
        if tap is None:
            check_trigger(header, deflection[: layout.way])
        force = lever.force(source, deflection)
        recorded = np.isfinite(force)
        if not recorded.any():
            return None
        which, travel = order[recorded], travels.of(number)
        return lever_curve(
            source,
            travel[which],
            force[recorded],
            lever,
            channel=travels.channel,
            time=None if time is None else time[which],
            segment=labels[recorded],
            name=curve_name(source.path, number + 1),
            notes=(*_notes(recorded, tap), *sensor_note(travel[: layout.way], travels.ramp)),
            test=number + 1,
            **_place(header, layout, number),
            **about,
        )

    return curve, layout.curves


def _layout(header: Header, image: Section) -> _Layout:
    source, kind = header.source, header.section("Force file list").text("Start context")
    counts = [int(word) for word in image.text("Samps/line").split() if word.isdecimal() and len(word) < 9]
    ways = (counts * 2)[:2]
    if len(ways) < 2 or min(ways) < 1 or kind == "SCRIPT":
        raise FileFormatError(f"{source.name} is a NanoScope file of another kind than ramps; {_EXPORT}")
    if ways[0] != ways[1]:
        raise FileFormatError(
            f"{source.name} has {ways[0]} and {ways[1]} points on the two ways of its ramp; only equal ones are "
            f"known here; {_EXPORT}"
        )
    hold = max(int(header.section("Ciao force list").number("Hold Samples") or 0), 0)
    points, length = 2 * ways[0] + hold, header.count(image, "Data length")
    wide = header.version >= _WIDE_SINCE or image.number("Bytes/pixel") == 4
    for width in (4, 2) if wide else (2, 4):
        curves, left = divmod(length, width * points)
        if left == 0 and (curves == 1 or (curves > 1 and kind != "FOL")):
            return _Layout(ways[0], hold, curves, width)
    raise FileFormatError(
        f"{source.name} is damaged: {length} bytes of deflection are no whole number of curves of {points} points"
    )


def _signal(
    header: Header, image: Section, layout: _Layout, per_volt: float = 1.0
) -> Callable[[int], FloatArray]:
    return channel_numbers(header, image, (layout.curves, layout.points), layout.width, per_volt)


def _lever(header: Header, image: Section, options: Options) -> Lever:
    scale = image.scale(*SCALE)
    stated = {
        "stiffness": image.number("Spring Constant", "Spring constant"),
        "sensitivity": header.sensitivity(scale.sensitivity) if scale and scale.sensitivity else None,
    }
    return Lever.of(header.source, stated, options.calibration)


class _Travels(NamedTuple):
    """Travel towards the sample (m), (points,), of a curve as stored, what it is read from, and the ramp (m)."""

    of: Callable[[int], FloatArray]
    channel: str
    ramp: float = 0.0


def _travel(header: Header, deflection: Section, layout: _Layout, tap: Tap | None) -> _Travels:
    if tap is not None:
        tapped = layout.stored(tap.travel)
        return _Travels(lambda _: tapped, "sine of the drive, of which the file holds size and turn,")
    ramp = deflection.scale(*_RAMP)
    piezo = header.sensitivity(ramp.sensitivity) if ramp else None
    driven = ramp.volts * piezo if ramp and piezo and ramp.volts > 0.0 else 0.0
    for image in header.images:
        scale = image.scale(*SCALE)
        metres = header.sensitivity(scale.sensitivity) if scale else None
        if "[ZSensor]" in image.text(_SIGNAL) and metres is not None:
            return _Travels(_signal(header, image, layout, metres), "height sensor", driven)
    if not driven > 0.0:
        raise FileFormatError(
            f"{header.source.name}: neither a height sensor nor the size of the ramp is there"
        )
    way_in = np.linspace(0.0, driven, layout.way, endpoint=False)
    in_time = np.concatenate((way_in, way_in[::-1]))
    stored = layout.stored(in_time, np.full(layout.hold, way_in[-1]))
    return _Travels(lambda _: stored, "ramp of the piezo, of which the file holds the size,")


def _order(tap: Tap | None, layout: _Layout) -> tuple[NDArray[np.intp], NDArray[np.str_]]:
    """Indices of the stored points in the order of time, and their labels."""
    way_in = np.arange(layout.way)[::-1]
    way_out = np.arange(layout.way, 2 * layout.way)
    if tap is not None:
        labels = tap.labels
        return np.concatenate((way_in, way_out))[: len(labels)], labels
    held = np.arange(2 * layout.way, layout.points)
    names: NDArray[np.str_] = np.array((LOADING, HOLD, UNLOADING), dtype="<U9")
    return np.concatenate((way_in, held, way_out)), np.repeat(names, (layout.way, layout.hold, layout.way))


def _time(header: Header, image: Section, layout: _Layout, tap: Tap | None) -> FloatArray | None:
    """Time (s) of every stored point, from the speeds of the ramp; None where they are not written."""
    force = header.section("Ciao force list")
    if tap is not None:
        return None if tap.time is None else layout.stored(tap.time)
    ramp, forward, back = image.scale(*_RAMP), force.number("Forward vel."), force.number("Reverse vel.")
    held = (force.number("Hold Time") or 0.0) if layout.hold else 0.0
    if ramp is None or not ramp.volts > 0.0 or not forward or not back or (layout.hold and not held):
        return None
    ways = np.linspace(0.0, 1.0, layout.way, endpoint=False)
    there, rest = ramp.volts / abs(forward), abs(held)
    in_time = np.concatenate((ways * there, there + rest + ways * (ramp.volts / abs(back))))
    return layout.stored(in_time, np.linspace(there, there + rest, layout.hold, endpoint=False))


def _place(header: Header, layout: _Layout, number: int) -> dict[str, tuple[float, float]]:
    """Place of a curve on the sample (m): of a volume, the middle of its pixel; nothing where it is not known."""
    scan = header.section("Ciao scan list")
    across = int(header.section("Ciao force list").number("force/line") or 0) if layout.curves > 1 else 1
    if across < 1 or layout.curves % across:
        return {}
    pitch, angle = scan.length("Scan Size") / across, scan.number("Rotate Ang.") or 0.0
    cosine, sine = float(np.cos(angle)), float(np.sin(angle))
    row, column = divmod(number, across)
    x, y = (column + 0.5 - across / 2) * pitch, (row + 0.5 - layout.curves / across / 2) * pitch
    middle_x, middle_y = scan.length("X Offset"), scan.length("Y Offset")
    return {"position": (middle_x + cosine * x - sine * y, middle_y + sine * x + cosine * y)}


def _about(header: Header, lever: Lever) -> dict[str, Any]:
    """What is worth keeping of the header."""
    file, force = header.section("Force file list"), header.section("Ciao force list")
    told = {
        "instrument": header.section("Equipment list").text("Microscope", "Description"),
        "software version": file.text("Version"),
        "date": file.text("Date"),
        "trigger": force.text("Trigger mode"),
        # Typed in, and often the program's preset: never taken for the tip's own.
        "tip radius (nm), as typed in": header.section("Ciao scan list").text("Tip Radius"),
    }
    about: dict[str, Any] = {
        "header": {name: one_line(text)[:200] for name, text in told.items() if text},
        "sign_rules": {"segment": "from the order of the ramp: way in, hold, way out"},
    }
    trigger = force.scale(*TRIGGER)
    if trigger and lever.sensitivity and trigger.volts > 0.0:
        about["setpoint"] = trigger.volts * lever.sensitivity * lever.stiffness
    return about


def _notes(recorded: NDArray[np.bool_], tap: Tap | None) -> tuple[str, ...]:
    notes = []
    if not recorded.all():
        missing = int(np.count_nonzero(~recorded))
        notes.append(f"{missing} of {len(recorded)} points were not recorded, as the file marks them")
    if tap is not None:
        notes.append("a PeakForce tap: the depth is made of the drive's size and turn, not measured")
    return tuple(notes)


FORMAT = Format(
    name="nanoscope",
    description="Bruker NanoScope force curves, volumes and PeakForce captures (.spm, .000, .pfc)",
    sniff=_sniff,
    read_all=_read_all,
    read_one=_read_one,
    takes_calibration=True,
)
