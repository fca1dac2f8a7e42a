"""Nanosurf .nid: force curves and maps of the C3000 and easyScan controllers.

A file is text in sections, ``[DataSet-0:0]`` with ``key=value``, up to ``#!``; then every channel in the
order of its group, lines of 16- or 32-bit integers, little-endian. A number is a share of the channel's
range, ``Dim2Min`` and ``Dim2Range``, in ``Dim2Unit``. A line is a curve of ``LineDim<i>Points`` points; the
rest of it is padding. Both ways of the modulation are stored *along the axis*, from far to near: the way back
is turned round here. Pauses are stored in time.

Why by a reader of our own: Nanosurf's NSFopen 2.2.4 (MIT, 2024) opens a path of its own, trusts every size in
the header, and knows no pause by line. Its numbers are ours to rounding (`tests/test_public_afm.py`). What is
not read: .nhf of Nanosurf Studio, of which no public force curve was found.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options
from underlay.data.readers._lever import Lever, lever_curve, sensor_note
from underlay.data.readers._source import MAX_BYTES, Source, curve_name
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import FileFormatError

__all__ = ["FORMAT", "NidHeader"]

# "D[2.72436]*[N/m]"
_PROPERTY = re.compile(r"\w\[([^\]]*)\]\*\[([^\]]*)\]")
_COUNT = re.compile(r"\d{1,9}")
_START = b"[DataSet]"
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
# 18 groups of 8 channels and 256 lines were seen.
_MOST_GROUPS, _MOST_CHANNELS, _MOST_LINES = 1000, 64, 20_000
# What is worth showing, by its name in the section of the measurement.
_ABOUT = {"instrument": "Head type", "software version": "Software ver.", "date": "Date", "time": "Time"}
_CANTILEVER = r"DataSet\Calibration\Cantilever"
_SCANHEAD = r"DataSet\Calibration\Scanhead"
_TIMES = r"DataSet\Parameters\Spectroscopy"
# The axis of a modulation is measured where it has a sensor.
_SENSOR = "sensor"


class NidHeader:
    """The text in front of the numbers of a .nid file: entries by section and key.

    Parameters
    ----------
    source : Source
        The file, for messages.
    text : str
        What stands before the numbers.
    """

    def __init__(self, source: Source, text: str) -> None:
        self.source = source
        self._sections: dict[str, dict[str, str]] = {}
        entries: dict[str, str] = {}
        for line in text.splitlines():
            if line.startswith("[") and line.endswith("]"):
                entries = self._sections.setdefault(line[1:-1], {})
            elif "=" in line:
                key, _, value = line.partition("=")
                entries.setdefault(key, value.strip())

    def __getitem__(self, section: str) -> Mapping[str, str]:
        return self._sections.get(section, {})

    def count(self, section: str, key: str, most: int = MAX_BYTES) -> int:
        """Return a whole number up to `most` that must be there.

        Raises
        ------
        FileFormatError
            If it is not.
        """
        text = self[section].get(key, "")
        if not _COUNT.fullmatch(text) or int(text) > most:
            raise FileFormatError(
                f"{self.source.name}: no number up to {most} for {key!r} in [{section!s:.60}]; it says {text!r:.40}"
            )
        return int(text)

    def number(self, section: str, key: str) -> float:
        """Return a finite number that must be there.

        Raises
        ------
        FileFormatError
            If it is not.
        """
        value = _finite(self[section].get(key, ""))
        if value is None:
            raise FileFormatError(
                f"{self.source.name}: {self[section].get(key, '')!r:.40} for {key!r} in [{section!s:.60}]"
            )
        return value

    def number_if_there(self, section: str, key: str) -> float | None:
        """Return a finite number, bare or as ``D[2.7]*[N/m]``; None where there is none."""
        text = self[section].get(key, "")
        found = _PROPERTY.fullmatch(text)
        return _finite(found[1] if found else text)


def _finite(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


@dataclass(frozen=True)
class _Channel:
    """One channel of one group: its name, unit, numbers (lines, points), points of each line, and its section."""

    name: str
    unit: str
    values: FloatArray
    points: tuple[int, ...]
    section: str

    def line(self, number: int, *, backwards: bool) -> FloatArray:
        """Numbers of a curve in the order of time, (n,), without the padding."""
        count = min(self.points[number], self.values.shape[1])
        line: FloatArray = self.values[number][:count]
        return line[::-1] if backwards else line


def _sniff(source: Source) -> bool:
    return source.data.startswith(_START)


def _read_all(source: Source, options: Options) -> list[Curve]:
    end = source.data.find(_END)
    if end < 0:
        raise FileFormatError(f"{source.name} is cut short: its header does not end")
    sections = NidHeader(source, source.data[:end].decode("latin-1"))
    groups = _groups(sections, end + len(_END))
    deflections = {
        name: next((channel for channel in channels if channel.name == _DEFLECTION), None)
        for name, channels in groups.items()
    }
    forward = deflections.get(_GROUPS[0][0])
    if forward is None:
        raise FileFormatError(
            f"{source.name} is a Nanosurf file without a force curve ('Spec forward' of the deflection); images "
            "and spectra are not read"
        )
    lever = _lever(sections, options)
    return [
        _curve(sections, groups, deflections, lever, number)
        for number in range(len(forward.points))
        if forward.points[number]
    ]


def _groups(sections: NidHeader, start: int) -> dict[str, list[_Channel]]:
    """Channels of the groups of a force curve, by the name of the group."""
    source, wanted = sections.source, {name for name, *_ in _GROUPS}
    groups: dict[str, list[_Channel]] = {}
    for group in range(sections.count("DataSet", "GroupCount", _MOST_GROUPS)):
        name = sections["DataSet"].get(f"Gr{group}-Name", "")
        for channel in range(sections.count("DataSet", f"Gr{group}-Count", _MOST_CHANNELS)):
            section = sections["DataSet"].get(f"Gr{group}-Ch{channel}")
            if section is None:
                continue
            points, lines = sections.count(section, "Points"), sections.count(section, "Lines", _MOST_LINES)
            integer = _INTEGERS.get(sections[section].get("SaveBits", ""))
            if integer is None:
                raise FileFormatError(f"{source.name}: [{section!s:.60}] holds no numbers of 16 or 32 bits")
            size = points * lines * integer.itemsize
            if start + size > len(source.data):
                raise FileFormatError(
                    f"{source.name} is cut short: [{section!s:.60}] claims {size} bytes from byte {start} on, and "
                    f"the file has {len(source.data)}"
                )
            if name in wanted:
                raw = np.frombuffer(source.data, integer, points * lines, start).reshape(lines, points)
                groups.setdefault(name, []).append(_channel(sections, section, raw))
            start += size
    return groups


def _channel(sections: NidHeader, section: str, raw: NDArray[Any]) -> _Channel:
    bits = 8 * raw.dtype.itemsize
    low, extent = sections.number(section, "Dim2Min"), sections.number(section, "Dim2Range")
    values = low + (raw + 2.0 ** (bits - 1)) * (extent / 2.0**bits)
    entries = sections[section]
    points = tuple(
        sections.count(section, f"LineDim{line}Points") if f"LineDim{line}Points" in entries else raw.shape[1]
        for line in range(raw.shape[0])
    )
    return _Channel(entries.get("Dim2Name", ""), entries.get("Dim2Unit", ""), values, points, section)


def _lever(sections: NidHeader, options: Options) -> Lever:
    """Spring constant of the cantilever, and sensitivity from the full scales of one signal in metres and volts."""
    stated = {"stiffness": sections.number_if_there(_CANTILEVER, "Prop0")}
    scales: dict[str, float] = {}
    for entry in sections[_SCANHEAD].values():
        # "5,TipSignalDC,Deflection,m,7.30723e-07,0"
        cells = entry.split(",")
        if len(cells) == 6 and cells[1].startswith("TipSignalDC") and cells[2] == _DEFLECTION:
            try:
                scales.setdefault(cells[3], float(cells[4]))
            except ValueError:
                continue
    if "m" in scales and scales.get("V"):
        stated["sensitivity"] = scales["m"] / scales["V"]
    return Lever.of(sections.source, stated, options.calibration)


def _curve(
    sections: NidHeader,
    groups: Mapping[str, list[_Channel]],
    deflections: Mapping[str, _Channel | None],
    lever: Lever,
    number: int,
) -> Curve:
    travels, forces, times, labels = [], [], [], []
    began, timed = 0.0, True
    for group, label, backwards, setting in _GROUPS:
        deflection = deflections.get(group)
        if deflection is None or number >= len(deflection.points):
            continue
        force = _force(sections, deflection, lever, number, backwards=backwards)
        axis = _axis(sections.source, groups[group])
        travel = axis.line(number, backwards=backwards)
        if len(travel) != len(force):
            raise FileFormatError(f"{sections.source.name}: {group!r} has channels of different lengths")
        lasted = sections.number_if_there(_TIMES, f"{setting}Time") or 0.0
        planned = sections.number_if_there(_TIMES, f"{setting}Datapoints") or 0.0
        timed &= lasted > 0.0 and planned > 0.0
        # One that was stopped early took its share.
        taken = lasted / max(planned, 1.0)
        times.append(began + np.arange(len(force)) * taken)
        began += len(force) * taken
        travels.append(travel)
        forces.append(force)
        labels += [label] * len(force)
    source = sections.source
    told = {name: one_line(sections["DataSet-Info"].get(key, ""))[:200] for name, key in _ABOUT.items()}
    axis = _axis(source, groups[_GROUPS[0][0]])
    return lever_curve(
        source,
        np.concatenate(travels),
        np.concatenate(forces),
        lever,
        channel=axis.name[:80],
        time=np.concatenate(times) if timed else None,
        segment=np.array(labels, dtype="<U9"),
        name=curve_name(source.path, number + 1),
        header={name: text for name, text in told.items() if text},
        notes=sensor_note(travels[0], _driven(sections, axis.section, number)),
        sign_rules={
            "segment": "forward, pause and backward of the modulation; backward is stored along its axis"
        },
    )


def _driven(sections: NidHeader, section: str, number: int) -> float:
    """How far the axis was driven on the way in (m); zero where it is not written in metres."""
    in_metres = sections[section].get("Dim0Unit") == "m"
    return (sections.number_if_there(section, f"LineDim{number}Range") or 0.0) if in_metres else 0.0


def _axis(source: Source, channels: list[_Channel]) -> _Channel:
    """The channel along which the tip travels: a sensor where there is one."""
    lengths = [channel for channel in channels if channel.unit == "m" and channel.name != _DEFLECTION]
    if not lengths:
        raise FileFormatError(f"{source.name} holds no position of the scanner along its force curves")
    return next((channel for channel in lengths if _SENSOR in channel.name.lower()), lengths[0])


def _force(
    sections: NidHeader, channel: _Channel, lever: Lever, number: int, *, backwards: bool
) -> FloatArray:
    """Force (N) of the deflection in newtons, metres or volts, by the calibration that is used."""
    values = channel.line(number, backwards=backwards)
    if channel.unit == "V":
        return lever.force(sections.source, values)
    if channel.unit not in {"N", "m"}:
        raise FileFormatError(
            f"{sections.source.name}: a deflection in {channel.unit!r:.20}, not in N, m or V"
        )
    # Another calibration than the file's changes what its own has made of the volts.
    about = lever.about
    for name, used in (("spring_constant", channel.unit == "N"), ("sensitivity", True)):
        if used and f"file_{name}" in about:
            values = values * (about[name] / about[f"file_{name}"])
    return values if channel.unit == "N" else values * lever.stiffness


FORMAT = Format(
    name="nanosurf",
    description="Nanosurf force curves and maps (.nid)",
    sniff=_sniff,
    read_all=_read_all,
    takes_calibration=True,
)
