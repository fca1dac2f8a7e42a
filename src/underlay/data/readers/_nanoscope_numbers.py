r"""The numbers of a NanoScope channel as volts or metres, and whether they can be on the scale of the header.

Volts are the number times the hard scale, ``(0.0003750000 V/LSB)``. From version 9.20 on every number takes
4 bytes, but "Bytes/pixel" still says whose LSB the scale counts (Gwyddion's ``nanoscope.c`` has this from Bruker):
0.000375 V of 2 bytes and 5.72205e-9 V of 4 are both 24.576 V over all numbers. Numbers of 24 or 32 bits on a scale
for 16, or data that a byte too many in the header has shifted, make forces 256 or 65536 times too large and look
like curves. One such file is public (PyFMReader, ``20200903_Egel2.0_00023.spm``). So numbers that have more bits
than their scale are refused, and a way in that rises far above the trigger that should have ended it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.readers._nanoscope_header import Header, Scale, Section
from underlay.errors import FileFormatError

__all__ = ["SCALE", "TRIGGER", "channel_numbers", "check_trigger"]

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
    """Refuse a way in (V), in the order of time, that goes on far above the trigger that should have ended it.

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
