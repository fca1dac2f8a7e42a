r"""The header of a NanoScope file, the numbers of its channels as volts or metres, and the taps of PeakForce.

The header is sections of lines ``\name: value``. A channel's volts are its numbers times the hard scale,
``(0.0003750000 V/LSB)``. From version 9.20 on every number takes 4 bytes, but "Bytes/pixel" still says whose
LSB the scale counts (Gwyddion's ``nanoscope.c`` has this from Bruker): 0.000375 V of 2 bytes and 5.72205e-9 V
of 4 are both 24.576 V over all numbers.

Numbers of 24 or 32 bits on a scale for 16, or data that a byte too many in the header has shifted, make
forces 256 or 65536 times too large and still look like curves. One such file is public (PyFMReader,
``20200903_Egel2.0_00023.spm``). So numbers that have more bits than their scale are refused, and so is a way
in that rises far above the trigger that should have ended it (`check_trigger`).
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
from underlay.data.readers._source import Source
from underlay.data.segments import LOADING, UNLOADING
from underlay.errors import FileFormatError

__all__ = [
    "SCALE",
    "TRIGGER",
    "Header",
    "Scale",
    "Section",
    "Tap",
    "channel_numbers",
    "check_trigger",
    "read_header",
    "tap_of",
]

_END = b"\\*File list end"
# Headers of 35 to 80 kB were seen.
_LONGEST_HEADER = 1_000_000
_LONGEST_COUNT = 12
_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
# "V [Sens. DeflSens] (0.0003750000 V/LSB) 2.500000 V", "V 21.90000 nm/V"
_SCALE = re.compile(rf"V\s+(?:\[([^\]]*)\]\s*)?\(\s*({_NUMBER})\s*([^/\s]*)/LSB\)\s*({_NUMBER})?")
_SENSITIVITY = re.compile(rf"V\s+({_NUMBER})\s*(?:([^/\s]+)/V)?")
_PLAIN = re.compile(rf"({_NUMBER})\s*(\S*)")
_METRES = {"m": 1.0, "um": 1e-6, "~m": 1e-6, "µm": 1e-6, "nm": 1e-9, "pm": 1e-12}
_VOLTS = {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "~V": 1e-6}
SCALE = ("@4:Z scale", "@4:Z Scale")
TRIGGER = ("@4:Trig threshold Deflection", "@4:Trig Threshold Deflection")
_SIGNAL = "@4:Image Data"
_NUMBERS: Mapping[int, np.dtype[Any]] = {2: np.dtype("<i2"), 4: np.dtype("<i4")}
# The drives of piezos, the widest of all signals, have 440 V over all numbers.
_WIDEST = 1000.0
# Between the overshoot of fast ramps (1.1 seen) and the least wrong power of two, 256, but wide of the first.
_OVERSHOOT = 32.0
_NEXT = (
    "take the file from the microscope once more (a transfer as text, or an edit of the header, shifts the "
    "numbers), or open it in NanoScope Analysis and export the curves as text"
)
# The turn of the drive: the first that is not zero.
_TURNS = ("Sync Distance QNM", "Sync Distance New", "Sync Distance")


class Scale(NamedTuple):
    """A quantity in volts: volts per number of the file, the value itself, and the sensitivity it names."""

    per_number: float
    volts: float
    sensitivity: str


@dataclass(frozen=True)
class Section:
    """One section of the header."""

    title: str
    entries: Mapping[str, str]

    def text(self, *names: str) -> str:
        """Value of the first of these entries that is there; else ''."""
        return next((self.entries[name] for name in names if name in self.entries), "")

    def number(self, *names: str) -> float | None:
        """Return the finite number that such an entry begins with; None where there is none."""
        found = _PLAIN.match(self.text(*names))
        value = math.inf if found is None else float(found[1])
        return value if math.isfinite(value) else None

    def length(self, name: str) -> float:
        """Return a length (m); zero where it is not written."""
        value, found = self.number(name), _PLAIN.match(self.text(name))
        return 0.0 if value is None or found is None else value * _METRES.get(found[2], 1e-9)

    def scale(self, *names: str) -> Scale | None:
        """Return a quantity in volts; None where the entry is none."""
        found = _SCALE.match(self.text(*names))
        if found is None or found[3] not in _VOLTS:
            return None
        volt = _VOLTS[found[3]]
        per_number, value = float(found[2]) * volt, float(found[4] or "nan") * volt
        if not math.isfinite(per_number) or math.isinf(value):
            return None
        return Scale(per_number, value, found[1] or "")


@dataclass(frozen=True)
class Header:
    """All sections of a file."""

    source: Source
    sections: tuple[Section, ...]

    def section(self, title: str) -> Section:
        """Return the first section of this title, or an empty one."""
        return next((section for section in self.sections if section.title == title), Section(title, {}))

    @property
    def images(self) -> list[Section]:
        """The channels of force curves."""
        return [section for section in self.sections if section.title == "Ciao force image list"]

    @property
    def version(self) -> int:
        """Version of the program that wrote the file, 0x09200000 for 9.20; zero where it is not written."""
        try:
            return int(self.section("Force file list").text("Version"), 16)
        except ValueError:
            return 0

    def sensitivity(self, name: str) -> float | None:
        """Metres per volt, by the name of the sensitivity; None where that is no length."""
        for section in self.sections:
            found = _SENSITIVITY.match(section.text(f"@{name}"))
            if found:
                # Where no unit was written in a file that was seen, the number was of nanometres.
                metres = float(found[1]) * _METRES.get(found[2] or "nm", math.nan)
                return metres if math.isfinite(metres) else None
        return None

    def count(self, section: Section, name: str) -> int:
        """Return a whole number that must be there.

        Raises
        ------
        FileFormatError
            If it is not.
        """
        text = section.text(name)
        if not text.isdecimal() or len(text) > _LONGEST_COUNT:
            raise FileFormatError(f"{self.source.name}: no number for {name!r}; it says {text!r:.40}")
        return int(text)


def read_header(source: Source) -> Header:
    """Take the header of a file apart.

    Raises
    ------
    FileFormatError
        If it does not end.
    """
    end = source.data.find(_END, 0, _LONGEST_HEADER)
    if end < 0:
        raise FileFormatError(f"{source.name} is a NanoScope file whose header does not end: it is cut short")
    sections: list[Section] = []
    entries: dict[str, str] = {}
    for line in re.split(r"[\r\n]+", source.data[:end].decode("latin-1")):
        if line[1:2] == "*":
            entries = {}
            sections.append(Section(line[2:].strip(), entries))
        else:
            # The names of scaled quantities hold a colon themselves: "@4:Z scale".
            name, _, value = line[1:].partition(": ")
            entries.setdefault(name.strip(": "), value.strip())
    return Header(source, tuple(sections))


def channel_numbers(
    header: Header, image: Section, shape: tuple[int, int], width: int, per_volt: float = 1.0
) -> Callable[[int], FloatArray]:
    """Return what gives a curve of a channel as it is stored.

    Parameters
    ----------
    shape : (int, int)
        Curves, and points of each.
    width : int
        Bytes that a number takes.
    per_volt : float
        What a volt is.

    Returns
    -------
    callable
        Of the number of a curve, counted from 0: (points,) in the unit of `per_volt`, NaN where none was recorded.

    Raises
    ------
    FileFormatError
        If the file is cut short, has no scale, or has numbers that the scale cannot be for.
    """
    name, start = header.source.name, header.count(image, "Data offset")
    length = shape[0] * shape[1] * width
    content = header.source.data[start : start + length]
    if len(content) < length:
        raise FileFormatError(
            f"{name} is cut short: a channel claims {length} bytes from byte {start} on, and the "
            f"file has {len(header.source.data)}"
        )
    scale = image.scale(*SCALE)
    if scale is None:
        raise FileFormatError(f"{name}: no scale in volts for {image.text(_SIGNAL)!r:.60}")
    raw = np.frombuffer(content, _NUMBERS[width]).reshape(shape)
    bits, per_number = _bits(image, scale, width), scale.per_number * per_volt
    # The least number marks what was not recorded: of the bytes, and of the scale, as where 16 bits were widened.
    marks = (np.iinfo(raw.dtype).min, -(2 ** (bits - 1)))
    recorded = raw[(raw != marks[0]) & (raw != marks[1])]
    if recorded.size and max(int(recorded.max()), -1 - int(recorded.min())) >= 2 ** (bits - 1):
        reached = max(int(recorded.max()), -int(recorded.min()))
        raise FileFormatError(
            f"{name}: the numbers of {image.text(_SIGNAL)!r:.60} reach {reached}, and their scale, "
            f"{scale.per_number:g} V each, is for {bits} bits, up to {2 ** (bits - 1)}: read so, they would be "
            f"{reached * scale.per_number:.3g} V, a power of two too large; {_NEXT}"
        )
    return lambda number: np.where(np.isin(raw[number], marks), np.nan, raw[number] * per_number)


def _bits(image: Section, scale: Scale, width: int) -> int:
    """Bits of the numbers that a scale is for."""
    stated = 4 if image.number("Bytes/pixel") == 4 else 2
    # A scale of 16 bits beside "Bytes/pixel: 4" was not seen, but then no signal is as wide as that makes it.
    return 8 * min(stated, width) if scale.per_number * 2.0 ** (8 * stated) <= _WIDEST else 16


def check_trigger(header: Header, way_in: FloatArray) -> None:
    """Refuse a way in that goes on far above the trigger that should have ended it: its scale is wrong.

    Parameters
    ----------
    way_in : ndarray (n,)
        Deflection (V), in the order of time.

    Raises
    ------
    FileFormatError
        If it does.
    """
    force = header.section("Ciao force list")
    trigger, recorded = force.scale(*TRIGGER), way_in[np.isfinite(way_in)]
    if (
        trigger is None
        or not trigger.volts > 0.0
        or force.text("Trigger mode") != "Relative"
        or not recorded.size
    ):
        return
    rise = float(recorded.max() - np.median(recorded[: max(len(recorded) // 5, 1)]))
    if rise > _OVERSHOOT * trigger.volts:
        raise FileFormatError(
            f"{header.source.name}: the deflection rises by {rise:.3g} V on the way in, {rise / trigger.volts:.3g} "
            f"times the relative trigger of {trigger.volts:g} V that should have ended it: its numbers cannot be "
            f"on the scale that the header gives; {_NEXT}"
        )


@dataclass(frozen=True)
class Tap:
    """One period of a PeakForce capture's drive, a sine of which the file holds the amplitude and the turn.

    Parameters
    ----------
    points : int
        Points of a period, beginning on the way in.
    turn : float
        Point at which the drive is deepest.
    amplitude : float
        Of the drive (m).
    period : float or None
        Time of one tap (s), if it is written.
    """

    points: int
    turn: float
    amplitude: float
    period: float | None

    @property
    def travel(self) -> FloatArray:
        """Travel of the drive (m), (points,), in the order of time: amplitude times the cosine about the turn."""
        phase = 2.0 * np.pi * (np.arange(self.points) - self.turn) / self.points
        return np.asarray(self.amplitude * np.cos(phase))

    @property
    def time(self) -> FloatArray | None:
        """Time (s), (points,)."""
        return None if self.period is None else np.linspace(0.0, self.period, self.points, endpoint=False)

    @property
    def labels(self) -> NDArray[np.str_]:
        """Labels of the points of this tap; past the far end of its travel the way in of the next one begins."""
        last = min(int(self.turn + self.points / 2) + 1, self.points)
        return np.where(np.arange(last) <= self.turn, LOADING, UNLOADING).astype("<U9")


def tap_of(header: Header, points: int, hold: int) -> Tap | None:
    """Return what the header says of a capture's taps of so many points; None where the file holds ramps.

    Raises
    ------
    FileFormatError
        If it says too little, or the drive turns elsewhere than on its way in.
    """
    scan = header.section("Ciao scan list")
    if scan.text("PeakForce Capture") != "Allow" or scan.text("Operating mode") != "Image":
        return None
    amplitude = scan.length("Peak Force Amplitude")
    turn = next((number for name in _TURNS if (number := scan.number(name))), 0.0)
    turn *= points / (scan.number("Sample Points") or points)
    if hold or not amplitude > 0.0 or not 1.0 < turn < points / 2:
        raise FileFormatError(
            f"{header.source.name} is a capture whose drive of {1e9 * amplitude:g} nm turns at point {turn:g} of "
            f"{points}: it should turn on its way in, and be larger than zero"
        )
    kilohertz = scan.number("PFT Freq")
    return Tap(points, turn, amplitude, 1e-3 / abs(kilohertz) if kilohertz else None)
