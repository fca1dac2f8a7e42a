"""Park Systems force-distance curves (.tiff of XEI and SmartScan).

A TIFF file whose private tags hold the curves: 50438 the header of the spectroscopy, a table of eight channels
(name, unit, gain) and numbers at fixed places, and 50439 the values, point by point on the sample, channel by
channel, the way in and the way back one after the other. The place of each number is as pspylib's reader has it.

What a public file shows (`tests/test_public_afm.py`): "Z Scan" *falls* towards the sample, the scanner goes down;
each way is padded to its length by repeating its last point, time stamp included; a "Z Detector" may be dead.
The channel "Force" is 8 % above what the header's own spring constant and sensitivity make of the volts: what the
maker's program shows is taken, a note says so, and a calibration that is given acts on the volts.

Why by a reader of our own: Park's pspylib 0.1.2 (2025) may be used under a licence of Park's own only and opens
a path; tifffile is not needed for six tags.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._lever import Lever, lever_curve
from underlay.data.readers._source import Source, curve_name
from underlay.data.segments import LOADING, UNLOADING
from underlay.errors import FileFormatError

__all__ = ["FORMAT"]

_TIFF = b"II*\0"
_MAGIC, _SPECTRA, _VALUES = 50432, 50438, 50439
_MAGIC_NUMBER = 235082497
_SOFTWARE, _DATE = 305, 306
_WANTED = {_SPECTRA, _VALUES, _SOFTWARE, _DATE}
# Bytes of one item of a TIFF type; others are not met here.
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 7: 1}
_MOST_TAGS = 1000
# In the header of the spectroscopy: eight channels of 96 bytes, then numbers, then three floats a point.
_CHANNELS, _CHANNEL = 8, struct.Struct("<64s16sdii")
_COUNTS, _COUNTS_AT = struct.Struct("<4i"), 768
_CALIBRATION, _CALIBRATION_AT = struct.Struct("<2d"), 976
_TYPE, _TYPE_AT = struct.Struct("<i"), 1108
_PLACES_AT, _PLACE = 1208, 12
_NUMBERS: Mapping[int, np.dtype[Any]] = {0: np.dtype("<i2"), 1: np.dtype("<i4"), 2: np.dtype("<f4")}
_UNITS = {"um": 1e-6, "µm": 1e-6, "nm": 1e-9, "N": 1.0, "uN": 1e-6, "nN": 1e-9, "pN": 1e-12, "V": 1.0, "mV": 1e-3,
          "sec": 1.0, "s": 1.0, "msec": 1e-3, "usec": 1e-6}  # fmt: skip
_VOLTS = "Vertical (A-B)"
_FORCE, _TIME = "Force", "Time Stamp"
# The sensor first: the scan is what the scanner was told.
_HEIGHTS = ("Z Detector", "Z Scan")
# A sensor that moves less than this share of what the scanner was told is dead.
_DEAD = 0.5
# Two calibrations of one file that differ by more are worth a note.
_SAME = 0.01


@dataclass(frozen=True)
class _Spectra:
    """Channels of every curve in SI, (curves, n), by name, and places (m)."""

    channels: Mapping[str, FloatArray]
    places: tuple[tuple[float, float], ...]
    stated: Mapping[str, float]


def _sniff(source: Source) -> bool:
    return (
        source.data.startswith(_TIFF)
        and struct.pack("<HHII", _MAGIC, 4, 1, _MAGIC_NUMBER) in source.data[:4096]
    )


def _read_all(source: Source, options: Options) -> list[Curve]:
    tags = _tags(source)
    spectra = _spectra(source, tags)
    lever = Lever.of(source, spectra.stated, options.calibration)
    header = {
        "instrument": "Park Systems AFM",
        "software version": _text(tags, _SOFTWARE),
        "date": _text(tags, _DATE),
    }
    return [_curve(source, spectra, lever, header, number) for number in range(len(spectra.places))]


def _tags(source: Source) -> dict[int, bytes]:
    """Content of the tags that are wanted of the first directory, by their numbers."""
    data = source.data
    found: dict[int, bytes] = {}
    try:
        (start,) = struct.unpack_from("<I", data, 4)
        (count,) = struct.unpack_from("<H", data, start)
        for number in range(min(count, _MOST_TAGS)):
            at = start + 2 + 12 * number
            tag, kind, items, place = struct.unpack_from("<HHII", data, at)
            if tag not in _WANTED or tag in found:
                continue
            size = items * _SIZES.get(kind, 0)
            place = at + 8 if size <= 4 else place
            if place + size > len(data):
                raise FileFormatError(
                    f"{source.name} is cut short: tag {tag} claims {size} bytes from byte {place} on, and the file "
                    f"has {len(data)}"
                )
            found[tag] = data[place : place + size]
    except struct.error as error:
        raise FileFormatError(f"{source.name} is cut short within its directory") from error
    return found


def _text(tags: Mapping[int, bytes], tag: int) -> str:
    return one_line(tags.get(tag, b"").split(b"\0")[0].decode("latin-1"))[:200]


def _spectra(source: Source, tags: Mapping[int, bytes]) -> _Spectra:
    header, content = tags.get(_SPECTRA, b""), tags.get(_VALUES, b"")
    if not header or not content:
        raise FileFormatError(
            f"{source.name} is a Park Systems file without force-distance curves: an image; save the spectroscopy"
        )
    if len(header) < _PLACES_AT:
        raise FileFormatError(f"{source.name} is damaged: its header of the spectroscopy ends early")
    used, _, points, curves = _COUNTS.unpack_from(header, _COUNTS_AT)
    (kind,) = _TYPE.unpack_from(header, _TYPE_AT)
    if not (0 < used <= _CHANNELS and points > 1 and curves > 0 and kind in _NUMBERS):
        raise FileFormatError(
            f"{source.name} is damaged: {used} channels of {points} points at {curves} places, of kind {kind}"
        )
    integer = _NUMBERS[kind]
    claimed = used * points * curves
    if claimed * integer.itemsize > len(content) or _PLACES_AT + curves * _PLACE > len(header):
        raise FileFormatError(
            f"{source.name} is cut short: it claims {curves} curves of {used} channels of {points} points, and "
            f"holds {len(content)} bytes of them"
        )
    raw = np.frombuffer(content, integer, claimed).reshape(curves, used, points)
    channels = {}
    for number in range(used):
        name, unit, gain, *_ = _CHANNEL.unpack_from(header, number * _CHANNEL.size)
        scale = _UNITS.get(_wide(unit))
        if scale is not None and np.isfinite(gain):
            channels[_wide(name)] = raw[:, number, :] * (gain * scale)
    places = np.frombuffer(header, "<f4", 3 * curves, _PLACES_AT).reshape(curves, 3)[:, :2]
    stiffness, volts_per_micrometre = _CALIBRATION.unpack_from(header, _CALIBRATION_AT)
    stated = {
        "stiffness": stiffness,
        "sensitivity": 1e-6 / volts_per_micrometre if volts_per_micrometre else 0.0,
    }
    return _Spectra(
        channels,
        tuple((1e-6 * float(x), 1e-6 * float(y)) for x, y in places),
        stated,
    )


def _wide(text: bytes) -> str:
    """UTF-16 up to its first zero."""
    return text.decode("utf-16-le", errors="replace").split("\0")[0].strip()


def _curve(source: Source, spectra: _Spectra, lever: Lever, header: Mapping[str, str], number: int) -> Curve:
    channels = {name: values[number] for name, values in spectra.channels.items()}
    heights = [name for name in _HEIGHTS if name in channels]
    if not heights or not {_VOLTS, _FORCE} & set(channels):
        there = ", ".join(repr(name) for name in channels)
        raise FileFormatError(
            f"{source.name} has no height or no deflection; it has {there or 'no known unit'}"
        )
    moved = {name: _moved(channels[name]) for name in heights}
    height = next(name for name in heights if moved[name] >= _DEAD * max(moved.values()))
    half = len(channels[height]) // 2
    recorded = _recorded(channels.get(_TIME), channels[height], half)
    force, notes = _force(source, channels, lever)
    labels = np.where(np.arange(2 * half) < half, LOADING, UNLOADING).astype("<U9")
    time = channels.get(_TIME)
    return lever_curve(
        source,
        -channels[height][: 2 * half][recorded],
        force[: 2 * half][recorded],
        lever,
        channel=f"minus {height}",
        time=None if time is None else time[: 2 * half][recorded],
        segment=labels[recorded],
        name=curve_name(source.path, number + 1),
        header={name: text for name, text in header.items() if text},
        sign_rules={"segment": "first half in, second half back"},
        notes=notes,
        position=spectra.places[number],
    )


def _moved(height: FloatArray) -> float:
    """How far a height moves (m), points without a value left out."""
    known = height[np.isfinite(height)]
    return float(np.ptp(known)) if known.size else 0.0


def _recorded(time: FloatArray | None, height: FloatArray, half: int) -> NDArray[np.bool_]:
    """Which points of both ways were recorded, (2 half,) of bool: those that repeat the last one are padding."""
    clock = height if time is None else time
    known = []
    for way in (clock[:half], clock[half : 2 * half]):
        moving = np.flatnonzero(way != way[-1])
        last = int(moving[-1]) + 1 if moving.size else 0
        known.append(np.arange(half) <= last)
    return np.concatenate(known)


def _force(
    source: Source, channels: Mapping[str, FloatArray], lever: Lever
) -> tuple[FloatArray, tuple[str, ...]]:
    """Force (N): the file's own channel, or the volts where another calibration is given; and what to say of it."""
    volts, force = channels.get(_VOLTS), channels.get(_FORCE)
    given = any(name.startswith("file_") for name in lever.about)
    if force is None or (given and volts is not None):
        if volts is None:
            raise FileFormatError(f"{source.name} holds no volts to calibrate anew")
        return lever.force(source, volts), ()
    if given:
        raise FileFormatError(f"{source.name} holds forces and no volts; no calibration can be given")
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


FORMAT = Format(
    name="park",
    description="Park Systems force-distance curves (.tiff)",
    sniff=_sniff,
    read_all=_read_all,
    takes_calibration=True,
)
