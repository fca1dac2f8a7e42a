"""JPK force archives: curves, maps and quantitative imaging, with any number and order of segments.

A file is a ZIP archive of Java property files and big-endian numbers. The properties of a channel lead from
integers to volts (encoder), from volts to a distance (sensitivity) and from there to a force (spring
constant); newer files keep them in ``shared-data/header.properties`` and point there by number. A channel of
type ``float-data`` holds the unit at which its conversions begin. What a segment is stands in its own header.

Headers are bounded before they are unpacked: a hundred kilobytes of archive can claim a header of 200 MB, of
which every line would become an entry. Headers of up to 60 kB and a thousand entries were seen; they grow
with the channels, not with the points.

Why not through afmformats (0.18): it refuses pauses at constant height, several pauses and floats, and
numbers segments without saying what they are. Where it reads a file, the numbers are the same to the last bit
(`tests/test_real_files.py`).
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.readers._lever import uncalibrated
from underlay.data.readers._source import Source, open_zip, read_member
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import FileFormatError

__all__ = [
    "LONGEST_HEADER",
    "JpkCurve",
    "Shared",
    "properties",
    "read_jpk",
    "shared_properties",
    "with_shared",
]

#: Entries ``lcd-info.3.channel...`` of the shared header, by ``lcd-info.3``.
Shared: TypeAlias = Mapping[str, Mapping[str, str]]
#: Most bytes that a header may claim.
LONGEST_HEADER = 4_000_000
_MOST_ENTRIES = 50_000
_HEADER = "segment-header.properties"
_SHARED = "shared-data/header.properties"
_GENERAL = "header.properties"
_SEGMENT = re.compile(r"((?:index/\d{1,9}/)?)segments/(\d{1,9})/" + re.escape(_HEADER))
_HEIGHTS = ("measuredHeight", "strainGaugeHeight", "capacitiveSensorHeight", "height")
_INTEGERS = {
    "signedshort": ">i2",
    "unsignedshort": ">u2",
    "signedinteger": ">i4",
    "unsignedinteger": ">u4",
    "signedlong": ">i8",
}
_FLOATS = "float-data"
_STYLES = {"extend": LOADING, "pause": HOLD, "modulation": HOLD, "retract": UNLOADING}
# From the base of the deflection to the force: what each step is multiplied by, and what a caller may give.
_STEPS = {"distance": "sensitivity", "force": "stiffness"}
# More points than a number of so many digits says are in no file.
_DIGITS = 12
# What is worth showing of the general header, by the end of its key.
_ABOUT = {"instrument": ".description.instrument", "software version": ".description.source-software"}


def properties(archive: zipfile.ZipFile, name: str) -> dict[str, str]:
    """Read a member of Java properties: ``key=value`` in Latin-1, with escaped colons.

    Raises
    ------
    FileFormatError
        If the member is missing, damaged, or claims more than any header takes.
    """
    found = {}
    for line in read_member(archive, name, LONGEST_HEADER).decode("latin-1").splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found[key.strip()] = value.strip().replace("\\:", ":")
    return found


def shared_properties(archive: zipfile.ZipFile, name: str) -> Shared:
    """Read the entries that segments point to, by ``kind.number`` and then by the rest of their names."""
    groups: dict[str, dict[str, str]] = {}
    for key, value in properties(archive, name).items():
        parts = key.split(".", 2)
        if len(parts) == 3:
            groups.setdefault(f"{parts[0]}.{parts[1]}", {})[parts[2]] = value
    return groups


def with_shared(header: Mapping[str, str], shared: Shared) -> dict[str, str]:
    """Return a segment's header with what it points to among the shared properties.

    ``channel.X.lcd-info.*=3`` points to the entries ``lcd-info.3....``.

    Raises
    ------
    FileFormatError
        If they add up to more than any header has.
    """
    found = dict(header)
    for key, number in sorted(header.items()):
        if ".*" in key:
            kind = ".".join(key.split(".")[-2:-1])
            head = key.rsplit(".", 2)[0]
            group = shared.get(f"{kind}.{number}", {})
            if len(found) + len(group) > _MOST_ENTRIES:
                raise FileFormatError(f"the header of a segment claims more than {_MOST_ENTRIES} entries")
            found.update({f"{head}.{name}": value for name, value in group.items()})
    return found


# Where a segment says what it is, in files of different ages.
_STYLE_KEYS = tuple(
    f"force-segment-header.{place}style" for place in ("settings.segment-settings.", "settings.", "")
)


@dataclass(frozen=True)
class JpkCurve:
    """One curve of an archive.

    Parameters
    ----------
    height, force, time : ndarray (n,)
        Height of the scanner, falling towards the sample (m), force (N), time (s).
    segment : tuple of str, (n,)
        Labels.
    stiffness : float
        Spring constant (N/m).
    position : tuple of float
        Place on the sample (m); empty if not written.
    known : mapping of str to float
        What the file itself says, as far as it does: ``stiffness`` (N/m), ``sensitivity`` (m/V).
    about : mapping of str to str
        Instrument and software.
    """

    height: FloatArray
    force: FloatArray
    time: FloatArray
    segment: tuple[str, ...]
    stiffness: float
    position: tuple[float, ...] = ()
    known: Mapping[str, float] = field(default_factory=dict)
    about: Mapping[str, str] = field(default_factory=dict)


def _chain(source: Source, header: Mapping[str, str], conversions: str, slot: str) -> list[str]:
    """Slots from `slot` down to the base of a channel's conversions, the base left out."""
    base = header.get(f"{conversions}.conversions.base", "volts")
    chain: list[str] = []
    while slot != base:
        if slot in chain:
            raise FileFormatError(f"{source.name}: the conversions {conversions!r:.80} lead in a circle")
        chain.append(slot)
        slot = header.get(f"{conversions}.conversion.{slot}.base-calibration-slot", base)
    return chain


def read_jpk(source: Source, calibration: Mapping[str, float]) -> list[JpkCurve]:
    """Read every curve of an archive.

    Parameters
    ----------
    source : Source
        The archive.
    calibration : mapping
        ``stiffness`` (N/m) and ``sensitivity`` (m/V), where given, in place of the file's.

    Raises
    ------
    FileFormatError
        If the archive is damaged or holds no segment.
    InputError
        If neither the file nor the caller gives the calibration.
    """
    with open_zip(source) as archive:
        names = set(archive.namelist())
        shared = shared_properties(archive, _SHARED) if _SHARED in names else {}
        whole = properties(archive, _GENERAL) if _GENERAL in names else {}
        curves: dict[str, list[int]] = {}
        for name in names:
            matched = _SEGMENT.fullmatch(name)
            if matched:
                curves.setdefault(matched.group(1), []).append(int(matched.group(2)))
        if not curves:
            raise FileFormatError(f"{source.name} holds no force segment")
        # "index/10/" after "index/9/".
        return [
            _curve(source, archive, names, folder, sorted(curves[folder]), shared, whole, calibration)
            for folder in sorted(curves, key=lambda text: (len(text), text))
        ]


def _curve(
    source: Source,
    archive: zipfile.ZipFile,
    names: set[str],
    folder: str,
    numbers: Sequence[int],
    shared: Shared,
    whole: Mapping[str, str],
    calibration: Mapping[str, float],
) -> JpkCurve:
    heights, forces, times = [], [], []
    labels: list[str] = []
    start, known = 0.0, {}
    # Of the whole file, and of the curve in a map.
    place = folder + _GENERAL
    general = {**whole, **(properties(archive, place) if folder and place in names else {})}
    for number in numbers:
        place = f"{folder}segments/{number}/"
        header = with_shared(properties(archive, place + _HEADER), shared)
        height_name = next((name for name in _HEIGHTS if f"{place}channels/{name}.dat" in names), None)
        if height_name is None or f"{place}channels/vDeflection.dat" not in names:
            raise FileFormatError(f"{source.name}, {place} lacks the channel of the height or the deflection")
        known = _calibration(source, header)
        deflection = _raw(source, archive, place, header, "vDeflection")
        forces.append(_force(source, header, deflection, {**known, **calibration}))
        heights.append(_height(source, archive, place, header, height_name))
        if len(heights[-1]) != len(deflection):
            raise FileFormatError(f"{source.name}, {place}: channels of different lengths")
        duration = _number(source, header, "force-segment-header.duration")
        times.append(start + np.arange(len(deflection)) * (duration / max(len(deflection), 1)))
        start += duration
        labels += [_style(source, header, place)] * len(deflection)
    stiffness = calibration.get("stiffness") or known.get("stiffness")
    if stiffness is None:
        raise uncalibrated(source)
    return JpkCurve(
        np.concatenate(heights),
        np.concatenate(forces),
        np.concatenate(times),
        tuple(labels),
        stiffness,
        _position(source, general),
        known,
        {name: value for name, end in _ABOUT.items() for key, value in general.items() if key.endswith(end)},
    )


def _style(source: Source, header: Mapping[str, str], place: str) -> str:
    """Label of a segment, from its own header."""
    style = next((header[key] for key in _STYLE_KEYS if key in header), "")
    if style not in _STYLES:
        raise FileFormatError(f"{source.name}, {place}: unknown kind of segment {style!r:.40}")
    return _STYLES[style]


def _calibration(source: Source, header: Mapping[str, str]) -> dict[str, float]:
    keys = {
        name: f"channel.vDeflection.conversion-set.conversion.{step}.scaling.multiplier"
        for step, name in _STEPS.items()
    }
    return {name: _number(source, header, key) for name, key in keys.items() if key in header}


def _force(
    source: Source, header: Mapping[str, str], values: FloatArray, calibration: Mapping[str, float]
) -> FloatArray:
    """Force in newtons, from the base of the deflection on."""
    base = header.get("channel.vDeflection.conversion-set.conversions.base", "volts")
    steps = list(_STEPS)
    for step in steps[steps.index(base) + 1 if base in steps else 0 :]:
        if _STEPS[step] not in calibration:
            raise uncalibrated(source)
        values = values * calibration[_STEPS[step]]
    return values


def _position(source: Source, header: Mapping[str, str]) -> tuple[float, ...]:
    keys = [key for axis in "xy" for key in header if key.endswith(f".header.position.{axis}")]
    return tuple(_number(source, header, key) for key in keys) if len(keys) == 2 else ()


def _number(source: Source, header: Mapping[str, str], key: str) -> float:
    try:
        value = float(header[key])
    except (KeyError, ValueError) as error:
        raise FileFormatError(f"{source.name}: no number for {key!r:.120}") from error
    if not np.isfinite(value):
        raise FileFormatError(f"{source.name}: {value} for {key!r:.120}")
    return value


def _raw(
    source: Source, archive: zipfile.ZipFile, place: str, header: Mapping[str, str], channel: str
) -> FloatArray:
    """Channel in the unit at which its conversions begin (V, or m for some heights)."""
    content = read_member(archive, f"{place}channels/{channel}.dat")
    prefix = f"channel.{channel}.data.encoder"
    if f"{prefix}.type" not in header:
        prefix = f"channel.{channel}.encoder"
    kind = header.get(f"{prefix}.type", "")
    is_float = not kind and _FLOATS in (
        header.get(f"channel.{channel}.data.type"),
        header.get(f"channel.{channel}.type"),
    )
    if not is_float and kind not in _INTEGERS:
        raise FileFormatError(f"{source.name}, {place}: unknown encoding {kind!r:.40} of {channel}")
    claimed = _claimed(source, header, place)
    # Floats are single unless there are twice as many bytes.
    dtype = np.dtype((">f8" if len(content) == 8 * claimed else ">f4") if is_float else _INTEGERS[kind])
    if len(content) % dtype.itemsize or len(content) < claimed * dtype.itemsize:
        raise FileFormatError(
            f"{source.name}, {place}: the channel {channel} is cut short; the header claims {claimed} points "
            f"and {len(content)} bytes are there"
        )
    values = np.frombuffer(content, dtype)
    if is_float:
        return values.astype(np.float64)
    multiplier = _number(source, header, f"{prefix}.scaling.multiplier")
    return values * multiplier + _number(source, header, f"{prefix}.scaling.offset")


def _claimed(source: Source, header: Mapping[str, str], place: str) -> int:
    claim = header.get("force-segment-header.num-points", "0")
    if not claim.isdecimal() or len(claim) > _DIGITS:
        raise FileFormatError(f"{source.name}, {place}: claims {claim!r:.40} points in a segment")
    return int(claim)


def _height(
    source: Source, archive: zipfile.ZipFile, place: str, header: Mapping[str, str], channel: str
) -> FloatArray:
    """Height in metres, by the chain of conversions of the file."""
    values = _raw(source, archive, place, header, channel)
    conversions = f"channel.{channel}.conversion-set"
    slot = "calibrated" if channel == "height" else "nominal"
    for step in reversed(_chain(source, header, conversions, slot)):
        prefix = f"{conversions}.conversion.{step}.scaling"
        if f"{prefix}.multiplier" in header:
            values = values * _number(source, header, f"{prefix}.multiplier")
            values = values + _number(source, header, f"{prefix}.offset")
    return values
