r"""Bruker NanoScope: force curves (.spm, .000, .001, ...), force volumes, and PeakForce captures (.pfc).

The header is sections of lines ``\name: value``; after it come numbers of 2 or 4 bytes, little-endian. Each section
"Ciao force image list" is one channel of all curves; of each curve it holds the way in, *stored backwards from the
turn*, then the way out, then the hold at the turn. Volts are the number times the hard scale, ``(0.0003750000
V/LSB)``, and metres volts times the sensitivity that the scale names. From version 9.20 on every number takes 4
bytes, but "Bytes/pixel" still says whose LSB the scale counts (Gwyddion's ``nanoscope.c`` has this from Bruker):
0.000375 V of 2 bytes and 5.72205e-9 V of 4 are both 24.576 V over all numbers.

Numbers of 24 or 32 bits on a scale for 16, or data that a byte too many in the header has shifted, make forces 256
or 65536 times too large and still look like curves. One such file is public (PyFMReader,
``20200903_Egel2.0_00023.spm``). So numbers that have more bits than their scale are refused, and so is a way in
that rises far above the trigger that should have ended it (`_check_trigger`).

What was seen in public files (`tests/test_public_afm.py`): the least number marks points of the way in that were
not recorded; the deflection reaches the file's own trigger at the turn; a PeakForce tap turns where its "Sync
Distance" says. Two ways of unequal length and scripts of several ramps were not seen whole and are refused.

Why by a reader of our own: pyfmreader 0.1.3 (MIT, its last release is of 2023) opens a path of its own
without bounds, knows neither height sensor nor hold, and shifts the baseline; pySPM reads images; Bruker's
own ``nanoscope`` needs a library of Windows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._format import Options, declared
from underlay.data.readers._lever import Lever, lever_curve, sensor_note
from underlay.data.readers._source import LONGEST_HEADER, MOST_PARTS, Source
from underlay.data.readers._text import si_factor
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import InputError

_END = b"\\*File list end"
_WIDE_SINCE = 0x09200000
_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
# "V [Sens. DeflSens] (0.0003750000 V/LSB) 2.500000 V", "V 21.90000 nm/V"
_SCALE = re.compile(rf"V\s+(?:\[([^\]]*)\]\s*)?\(\s*({_NUMBER})\s*([^/\s]*)/LSB\)\s*({_NUMBER})?")
_SENSITIVITY = re.compile(rf"V\s+({_NUMBER})\s*(?:([^/\s]+)/V)?")
_PLAIN = re.compile(rf"({_NUMBER})\s*(\S*)")
_Z = ("@4:Z scale", "@4:Z Scale")
_TRIGGER = ("@4:Trig threshold Deflection", "@4:Trig Threshold Deflection")
_RAMP = ("@4:Ramp size", "@4:Ramp Size")
_SIGNAL = "@4:Image Data"
_NUMBERS: Mapping[int, np.dtype[Any]] = {2: np.dtype("<i2"), 4: np.dtype("<i4")}
# The drives of piezos, the widest of all signals, have 440 V over all numbers.
_WIDEST = 1000.0
# Between the overshoot of fast ramps (1.1 seen) and the least wrong power of two, 256, but wide of the first.
_OVERSHOOT = 32.0
_EXPORT = "open it in NanoScope Analysis and export the curves as text"
_NEXT = (
    "take the file from the microscope once more (a transfer as text, or an edit of the header, shifts the "
    f"numbers), or {_EXPORT}"
)
# The turn of the drive: the first that is not zero.
_TURNS = ("Sync Distance QNM", "Sync Distance New", "Sync Distance")


class _Scale(NamedTuple):
    """A scaled header entry: volts per integer stored, its own value (V), and the name of its sensitivity."""

    per_number: float
    volts: float
    sensitivity: str


class _Section(dict[str, str]):
    """One section of the header: text values by entry name, and its `title`."""

    title = ""

    def text(self, *names: str) -> str:
        """Value of the first of these entries that the section has; '' without any."""
        return next((self[name] for name in names if name in self), "")

    def number(self, *names: str) -> float | None:
        """Finite number at the beginning of the first of these entries; None where there is none."""
        found = _PLAIN.match(self.text(*names))
        value = math.inf if found is None else float(found[1])
        return value if math.isfinite(value) else None

    def length(self, name: str) -> float:
        """A length (m) of the header; zero where the entry is missing."""
        value, found = self.number(name), _PLAIN.match(self.text(name))
        return 0.0 if value is None or found is None else value * (si_factor(found[2], "length") or 1e-9)

    def scale(self, *names: str) -> _Scale | None:
        """The first of these entries as a scaled quantity in volts; None where it is not of that form."""
        found = _SCALE.match(self.text(*names))
        factor = si_factor(found[3], "voltage") if found else None
        if found is None or factor is None:
            return None
        per_number, value = (float(text) * factor for text in (found[2], found[4] or "nan"))
        sound = math.isfinite(per_number) and not math.isinf(value)
        return _Scale(per_number, value, found[1] or "") if sound else None


class _Header:
    """Header of a NanoScope file: its sections, and how its curves are stored.

    `way`: points of the approach, and of the retraction; `hold`: points of the hold between them; `points`: all of
    a curve; `curves`: number of curves; `width`: bytes of a number.
    """

    def __init__(self, source: Source) -> None:
        self.source, self.sections = source, list[_Section]()
        end = source.data.find(_END, 0, LONGEST_HEADER)
        source.require(end >= 0, "is a NanoScope file whose header does not end: it is cut short")
        entries = _Section()
        for line in re.split(r"[\r\n]+", source.data[:end].decode("latin-1")):
            if line[1:2] == "*":
                entries = _Section()
                entries.title = line[2:].strip()
                self.sections.append(entries)
            else:
                # The names of scaled quantities hold a colon themselves: "@4:Z scale".
                name, _, value = line[1:].partition(": ")
                entries.setdefault(name.strip(": "), value.strip())
        self.images = [one for one in self.sections if one.title == "Ciao force image list"]
        self.file, self.force, self.scan = map(
            self.section, ("Force file list", "Ciao force list", "Ciao scan list")
        )
        self.deflection = source.given(
            next((image for image in self.images if "[Deflection" in image.text(_SIGNAL)), None),
            "is a NanoScope file without a force curve of the deflection: an image, or another signal; save the "
            "force curves themselves",
        )
        self._lay_out()

    def section(self, title: str) -> _Section:
        """The first section of this title, or an empty one."""
        return next((section for section in self.sections if section.title == title), _Section())

    def sensitivity(self, name: str) -> float | None:
        """Sensitivity (m/V) that the header gives under this name; None where it is missing or no length."""
        for section in self.sections:
            if found := _SENSITIVITY.match(section.text(f"@{name}")):
                # Where no unit was written in a file that was seen, the number was of nanometres.
                metres = float(found[1]) * (si_factor(found[2] or "nm", "length") or math.nan)
                return metres if math.isfinite(metres) else None
        return None

    def count(self, section: _Section, name: str) -> int:
        """A whole number of a section; FileFormatError where it is missing."""
        return self.source.count(section.text(name), repr(name))

    def _lay_out(self) -> None:
        source, kind, image = self.source, self.file.text("Start context"), self.deflection
        counts = [
            int(word) for word in image.text("Samps/line").split() if word.isdecimal() and len(word) < 9
        ]
        sizes = (counts * 2)[:2]
        source.require(
            len(sizes) == 2 and min(sizes) > 0 and kind != "SCRIPT",
            f"is a NanoScope file of another kind than ramps; {_EXPORT}, one file a curve",
        )
        source.require(
            sizes[0] == sizes[1],
            f"has {sizes[0]} and {sizes[1]} points on the two ways of its ramp; only equal ones are known here; "
            f"{_EXPORT}, one file a curve",
        )
        self.way, self.hold = sizes[0], max(int(self.force.number("Hold Samples") or 0), 0)
        self.points, length = 2 * self.way + self.hold, self.count(image, "Data length")
        try:
            version = int(self.file.text("Version"), 16)
        except ValueError:
            version = 0
        wide = version >= _WIDE_SINCE or image.number("Bytes/pixel") == 4
        for self.width in (4, 2) if wide else (2, 4):
            self.curves, left = divmod(length, self.width * self.points)
            if left == 0 and (self.curves == 1 or (self.curves > 1 and kind != "FOL")):
                return
        raise source.wrong(
            f"is damaged: {length} bytes of deflection are no whole number of curves of {self.points} points"
        )

    def numbers(
        self, image: _Section, order: NDArray[np.intp], per_volt: float = 1.0
    ) -> Callable[[int], FloatArray]:
        """Return a function that gives the values (n,) of a channel for a curve by its index, from 0.

        Values are volts times `per_volt`, put into `order`; NaN where no reading was recorded.
        """
        source, width, start = self.source, self.width, self.count(image, "Data offset")
        signal = image.text(_SIGNAL)
        scale = source.given(image.scale(*_Z), f": no scale in volts for {signal!r:.60}")
        raw = source.array(_NUMBERS[width], self.curves * self.points, start, "a channel")
        raw = raw.reshape(self.curves, self.points)
        stated = 8 * min(4 if image.number("Bytes/pixel") == 4 else 2, width)
        # A scale of 16 bits beside "Bytes/pixel: 4" was not seen, but then no signal is as wide as that makes it.
        whole = scale.per_number * 2.0 ** (32 if image.number("Bytes/pixel") == 4 else 16)
        bits, per_number = stated if whole <= _WIDEST else 16, scale.per_number * per_volt
        # The least number marks what was not recorded: of the bytes, and of the scale, as where 16 bits were
        # widened.
        marks = (np.iinfo(raw.dtype).min, -(2 ** (bits - 1)))
        recorded = raw[(raw != marks[0]) & (raw != marks[1])]
        most, least = (int(recorded.max()), int(recorded.min())) if recorded.size else (0, 0)
        reached = max(most, -least)
        source.require(
            max(most, -1 - least) < 2 ** (bits - 1),
            f": the numbers of {signal!r:.60} reach {reached}, and their scale, {scale.per_number:g} V each, is "
            f"for {bits} bits, up to {2 ** (bits - 1)}: read so, they would be {reached * scale.per_number:.3g} V, "
            f"a power of two too large; {_NEXT}",
        )

        def values(number: int) -> FloatArray:
            stored = raw[number][order]
            return np.where(np.isin(stored, marks), np.nan, stored * per_number)

        return values


def _read_all(source: Source, options: Options) -> list[Curve]:
    curves, count = _opened(source, options)
    source.require(
        count <= MOST_PARTS,
        f"holds {count} curves; up to {MOST_PARTS} are read at once: pick one, test = 1 to test = {count}, or "
        "save a part of the volume",
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
    """Return a function that makes the curve of an index (from 0), and the number of curves in the file.

    The function returns None for a curve that was not recorded.
    """
    header = _Header(source)
    tap = _tap_of(header)
    scale = header.deflection.scale(*_Z)
    stated = {
        "stiffness": header.deflection.number("Spring Constant", "Spring constant"),
        "sensitivity": header.sensitivity(scale.sensitivity) if scale and scale.sensitivity else None,
    }
    lever = Lever.of(source, stated, options.calibration)
    order, labels = _order(tap, header)
    volts, travels, time = (
        header.numbers(header.deflection, order),
        _travel(header, tap, order),
        _time(header, tap),
    )
    about = _about(header, lever)

    def curve(number: int) -> Curve | None:
        deflection = volts(number)
        if tap is None:
            _check_trigger(header, deflection[: header.way])
        force = lever.force(source, deflection)
        recorded = np.isfinite(force)
        if not recorded.any():
            return None
        travel = travels.of(number)
        return lever_curve(
            source,
            travel[recorded],
            force[recorded],
            lever,
            channel=travels.channel,
            time=None if time is None else time[recorded],
            segment=labels[recorded],
            number=number + 1,
            notes=(*_notes(recorded, tap), *sensor_note(travel[: header.way], travels.ramp)),
            test=number + 1,
            **_place(header, number),
            **about,
        )

    return curve, header.curves


class _Travels(NamedTuple):
    """Travel of the scanner towards the sample.

    `of` gives it (m), in the order of time, for a curve by its index; `channel` names its origin; `ramp` is the
    size of the driven ramp (m), zero if unknown.
    """

    of: Callable[[int], FloatArray]
    channel: str
    ramp: float = 0.0


def _travel(header: _Header, tap: _Tap | None, order: NDArray[np.intp]) -> _Travels:
    if tap is not None:
        return _Travels(lambda _: tap.travel, "sine of the drive, of which the file holds size and turn,")
    ramp = header.deflection.scale(*_RAMP)
    piezo = header.sensitivity(ramp.sensitivity) if ramp else None
    driven = ramp.volts * piezo if ramp and piezo and ramp.volts > 0.0 else 0.0
    for image in header.images:
        scale = image.scale(*_Z)
        metres = header.sensitivity(scale.sensitivity) if scale else None
        if "[ZSensor]" in image.text(_SIGNAL) and metres is not None:
            return _Travels(header.numbers(image, order, metres), "height sensor", driven)
    header.source.require(driven > 0.0, ": neither a height sensor nor the size of the ramp is there")
    way_in = np.linspace(0.0, driven, header.way, endpoint=False)
    ramped = np.concatenate((way_in, np.full(header.hold, way_in[-1]), way_in[::-1]))
    return _Travels(lambda _: ramped, "ramp of the piezo, of which the file holds the size,")


def _order(tap: _Tap | None, header: _Header) -> tuple[NDArray[np.intp], NDArray[np.str_]]:
    """Indices that put the stored points of a curve into order of time, and the segment labels in that order.

    Stored are the approach from its end, the retraction, and the hold.
    """
    way, hold = header.way, header.hold
    way_in, way_out = np.arange(way)[::-1], np.arange(way, 2 * way)
    if tap is not None:
        return np.concatenate((way_in, way_out))[: len(tap.labels)], tap.labels
    names: NDArray[np.str_] = np.array((LOADING, HOLD, UNLOADING), dtype="<U9")
    order = np.concatenate((way_in, np.arange(2 * way, header.points), way_out))
    return order, np.repeat(names, (way, hold, way))


def _time(header: _Header, tap: _Tap | None) -> FloatArray | None:
    """Time (s) of each point in order, from ramp speeds and hold time; None where these are not written."""
    force, hold = header.force, header.hold
    if tap is not None:
        return tap.time
    ramp = header.deflection.scale(*_RAMP)
    forward, back = (force.number(f"{way} vel.") for way in ("Forward", "Reverse"))
    held = (force.number("Hold Time") or 0.0) if hold else 0.0
    if ramp is None or not ramp.volts > 0.0 or not forward or not back or (hold and not held):
        return None
    fractions = np.linspace(0.0, 1.0, header.way, endpoint=False)
    there, rest = ramp.volts / abs(forward), abs(held)
    held_at = np.linspace(there, there + rest, hold, endpoint=False)
    return np.concatenate((fractions * there, held_at, there + rest + fractions * (ramp.volts / abs(back))))


def _place(header: _Header, number: int) -> dict[str, Any]:
    """Entry ``position`` (x, y) (m) of a curve, in a force volume the middle of its pixel; {} where not known."""
    scan, curves = header.scan, header.curves
    across = int(header.force.number("force/line") or 0) if curves > 1 else 1
    if across < 1 or curves % across:
        return {}
    pitch, angle = scan.length("Scan Size") / across, scan.number("Rotate Ang.") or 0.0
    cosine, sine = float(np.cos(angle)), float(np.sin(angle))
    row, column = divmod(number, across)
    x, y = (column + 0.5 - across / 2) * pitch, (row + 0.5 - curves / across / 2) * pitch
    middle_x, middle_y = scan.length("X Offset"), scan.length("Y Offset")
    return {"position": (middle_x + cosine * x - sine * y, middle_y + sine * x + cosine * y)}


def _about(header: _Header, lever: Lever) -> dict[str, Any]:
    """Entries of a curve's metadata from the header: instrument, date, trigger, rules of sign, setpoint (N)."""
    about: dict[str, Any] = {
        "header": {
            "instrument": header.section("Equipment list").text("Microscope", "Description"),
            "software version": header.file.text("Version"),
            "date": header.file.text("Date"),
            "trigger": header.force.text("Trigger mode"),
            # Typed in, and often the program's preset: never taken for the tip's own.
            "tip radius (nm), as typed in": header.scan.text("Tip Radius"),
        },
        "sign_rules": {"segment": "from the order of the ramp: way in, hold, way out"},
    }
    trigger = header.force.scale(*_TRIGGER)
    if trigger and lever.sensitivity and trigger.volts > 0.0:
        about["setpoint"] = trigger.volts * lever.sensitivity * lever.stiffness
    return about


def _notes(recorded: NDArray[np.bool_], tap: _Tap | None) -> tuple[str, ...]:
    missing = int(np.count_nonzero(~recorded))
    lost = f"{missing} of {len(recorded)} points were not recorded, as the file marks them"
    made = "a PeakForce tap: the depth is made of the drive's size and turn, not measured"
    return (*([lost] if missing else []), *([made] if tap is not None else []))


def _check_trigger(header: _Header, way_in: FloatArray) -> None:
    """Refuse a deflection (V), (n,), that rises on approach far above the trigger that should have ended it."""
    trigger, recorded = header.force.scale(*_TRIGGER), way_in[np.isfinite(way_in)]
    relative = header.force.text("Trigger mode") == "Relative"
    if trigger is None or not trigger.volts > 0.0 or not relative or not recorded.size:
        return
    rise = float(recorded.max() - np.median(recorded[: max(len(recorded) // 5, 1)]))
    header.source.require(
        rise <= _OVERSHOOT * trigger.volts,
        f": the deflection rises by {rise:.3g} V on the way in, {rise / trigger.volts:.3g} times the relative "
        f"trigger of {trigger.volts:g} V that should have ended it: its numbers cannot be on the scale that the "
        f"header gives; {_NEXT}",
    )


@dataclass(frozen=True)
class _Tap:
    """One period of a PeakForce capture's drive, a sine of which the file holds the amplitude and the turn.

    Parameters
    ----------
    points : int
        Points of a period, beginning on the approach.
    turn : float
        Index of the point at which the drive is deepest; may be fractional.
    amplitude : float
        Amplitude of the drive (m).
    period : float or None
        Time of one tap (s), if it is written.
    """

    points: int
    turn: float
    amplitude: float
    period: float | None

    @property
    def travel(self) -> FloatArray:
        """Travel of the drive (m), (n,): amplitude times the cosine about the turn."""
        phase = 2.0 * np.pi * (np.arange(len(self.labels)) - self.turn) / self.points
        return np.asarray(self.amplitude * np.cos(phase))

    @property
    def time(self) -> FloatArray | None:
        """Time (s) of each point since the period began, (n,); None where the period is not known."""
        if self.period is None:
            return None
        return np.linspace(0.0, self.period, self.points, endpoint=False)[: len(self.labels)]

    @property
    def labels(self) -> NDArray[np.str_]:
        """Segment labels (n,) of this tap; n may be below `points`, as past the top the next approach begins."""
        last = min(int(self.turn + self.points / 2) + 1, self.points)
        return np.where(np.arange(last) <= self.turn, LOADING, UNLOADING).astype("<U9")


def _tap_of(header: _Header) -> _Tap | None:
    """Drive of the taps of a PeakForce capture, from the header; None where the file holds ramps instead."""
    scan, points = header.scan, header.points
    if scan.text("PeakForce Capture") != "Allow" or scan.text("Operating mode") != "Image":
        return None
    amplitude = scan.length("Peak Force Amplitude")
    turn = next((number for name in _TURNS if (number := scan.number(name))), 0.0)
    turn *= points / (scan.number("Sample Points") or points)
    header.source.require(
        not header.hold and amplitude > 0.0 and 1.0 < turn < points / 2,
        f"is a capture whose drive of {1e9 * amplitude:g} nm turns at point {turn:g} of {points}: it should turn "
        "on its way in, and be larger than zero",
    )
    kilohertz = scan.number("PFT Freq")
    return _Tap(points, turn, amplitude, 1e-3 / abs(kilohertz) if kilohertz else None)


FORMAT = declared("nanoscope", _read_all, read_one=_read_one)
