"""JPK force archives where afmformats refuses: any number and kind of pauses, or that package not installed.

A ZIP archive of Java property files and big-endian integers. The properties of a channel lead from integers
to volts (encoder), from volts to a distance (sensitivity) and from there to a force (spring constant); newer
files keep them in ``shared-data/header.properties`` and point there by number.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.readers._source import Source, open_zip, read_member
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import FileFormatError, InputError

__all__ = ["JpkCurve", "check_claims", "read_jpk"]

_HEADER = "segment-header.properties"
_SHARED = "shared-data/header.properties"
_GENERAL = "header.properties"
_SLOT = re.compile(r"(.+\.conversion-set)\.conversion\.([^.]+)\.base-calibration-slot")
_SEGMENT = re.compile(r"((?:index/\d{1,9}/)?)segments/(\d{1,9})/" + re.escape(_HEADER))
_POINTS = re.compile(rb"num-points=([^\r\n]*)")
_HEIGHTS = ("measuredHeight", "strainGaugeHeight", "capacitiveSensorHeight", "height")
_INTEGERS = {
    "signedshort": ">i2",
    "unsignedshort": ">u2",
    "signedinteger": ">i4",
    "unsignedinteger": ">u4",
    "signedlong": ">i8",
}
_STYLES = {"extend": LOADING, "pause": HOLD, "retract": UNLOADING}
_MOST_POINTS = 20_000_000


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
    """

    height: FloatArray
    force: FloatArray
    time: FloatArray
    segment: tuple[str, ...]
    stiffness: float
    position: tuple[float, ...] = ()


def check_claims(source: Source) -> None:
    """Refuse an archive that would keep a trusting reader busy for ever or take all memory.

    Raises
    ------
    FileFormatError
        If it is damaged, unpacks to too much, claims more points in a segment than any file holds, or its
        conversions lead in a circle.
    """
    with open_zip(source) as archive:
        names = archive.namelist()
        for name in names:
            if name.endswith("header.properties"):
                for claim in _POINTS.findall(read_member(archive, name)):
                    if not _is_sane(claim):
                        raise FileFormatError(
                            f"{source.name} claims {claim[:40].decode('latin-1')!r} points in a segment"
                        )
        shared = _properties(archive, _SHARED) if _SHARED in names else {}
        general = _properties(archive, _GENERAL) if _GENERAL in names else {}
        for name in names:
            matched = _SEGMENT.fullmatch(name)
            if matched:
                index = matched.group(1) + _GENERAL
                header = _properties(archive, index) if index in names else {}
                merged = {**_with_shared({**header, **_properties(archive, name)}, shared), **general}
                for key in merged:
                    found = _SLOT.fullmatch(key)
                    if found:
                        _chain(source, merged, found.group(1), found.group(2))


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


def _is_sane(claim: bytes) -> bool:
    try:
        return 0.0 <= float(claim) <= _MOST_POINTS
    except ValueError:
        return False


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
        shared = _properties(archive, _SHARED) if _SHARED in names else {}
        curves: dict[str, list[int]] = {}
        for name in names:
            matched = _SEGMENT.fullmatch(name)
            if matched:
                curves.setdefault(matched.group(1), []).append(int(matched.group(2)))
        if not curves:
            raise FileFormatError(f"{source.name} holds no force segment")
        # "index/10/" after "index/9/".
        return [
            _curve(source, archive, names, folder, sorted(curves[folder]), shared, calibration)
            for folder in sorted(curves, key=lambda text: (len(text), text))
        ]


def _properties(archive: zipfile.ZipFile, name: str) -> dict[str, str]:
    """Java properties: ``key=value`` in Latin-1, with escaped colons."""
    found = {}
    for line in read_member(archive, name).decode("latin-1").splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found[key.strip()] = value.strip().replace("\\:", ":")
    return found


def _curve(
    source: Source,
    archive: zipfile.ZipFile,
    names: set[str],
    folder: str,
    numbers: Sequence[int],
    shared: Mapping[str, str],
    calibration: Mapping[str, float],
) -> JpkCurve:
    heights, forces, times = [], [], []
    labels: list[str] = []
    start = 0.0
    stiffness = 0.0
    for number in numbers:
        place = f"{folder}segments/{number}/"
        header = _with_shared(_properties(archive, place + _HEADER), shared)
        height_name = next((name for name in _HEIGHTS if f"{place}channels/{name}.dat" in names), None)
        if height_name is None or f"{place}channels/vDeflection.dat" not in names:
            raise FileFormatError(f"{source.name}, {place} lacks the channel of the height or the deflection")
        volts = _raw(source, archive, place, header, "vDeflection")
        sensitivity = calibration.get("sensitivity") or _scaling(source, header, "vDeflection", "distance")
        stiffness = calibration.get("stiffness") or _scaling(source, header, "vDeflection", "force")
        forces.append(volts * sensitivity * stiffness)
        heights.append(_height(source, archive, place, header, height_name))
        if len(heights[-1]) != len(volts):
            raise FileFormatError(f"{source.name}, {place}: channels of different lengths")
        duration = _number(source, header, "force-segment-header.duration")
        times.append(start + np.arange(len(volts)) * (duration / max(len(volts), 1)))
        start += duration
        style = header.get(
            "force-segment-header.settings.style", header.get("force-segment-header.style", "")
        )
        if style not in _STYLES:
            raise FileFormatError(f"{source.name}, {place}: unknown kind of segment {style!r:.40}")
        labels += [_STYLES[style]] * len(volts)
    return JpkCurve(
        np.concatenate(heights),
        np.concatenate(forces),
        np.concatenate(times),
        tuple(labels),
        float(stiffness),
        _position(source, archive, names, folder),
    )


def _position(source: Source, archive: zipfile.ZipFile, names: set[str], folder: str) -> tuple[float, ...]:
    header = _properties(archive, folder + _GENERAL) if folder + _GENERAL in names else {}
    keys = [key for axis in "xy" for key in header if key.endswith(f".header.position.{axis}")]
    return tuple(_number(source, header, key) for key in keys) if len(keys) == 2 else ()


def _with_shared(header: Mapping[str, str], shared: Mapping[str, str]) -> dict[str, str]:
    """Follow ``channel.X.lcd-info.*=3`` to the entries ``lcd-info.3....`` of the shared properties."""
    found = dict(header)
    for key, number in sorted(header.items()):
        if ".*" in key:
            kind = ".".join(key.split(".")[-2:-1])
            head = key.rsplit(".", 2)[0]
            start = f"{kind}.{number}."
            for name, value in shared.items():
                if name.startswith(start):
                    found[f"{head}.{name.split('.', 2)[2]}"] = value
    return found


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
    """Channel in the unit of its encoder (V, or m for some heights)."""
    prefix = f"channel.{channel}.data.encoder"
    if f"{prefix}.type" not in header:
        prefix = f"channel.{channel}.encoder"
    kind = header.get(f"{prefix}.type", "")
    if kind not in _INTEGERS:
        raise FileFormatError(f"{source.name}, {place}: unknown encoding {kind!r:.40} of {channel}")
    content = read_member(archive, f"{place}channels/{channel}.dat")
    dtype = np.dtype(_INTEGERS[kind])
    if len(content) % dtype.itemsize:
        raise FileFormatError(f"{source.name}, {place}: the channel {channel} is cut short")
    multiplier = _number(source, header, f"{prefix}.scaling.multiplier")
    return np.frombuffer(content, dtype) * multiplier + _number(source, header, f"{prefix}.scaling.offset")


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


def _scaling(source: Source, header: Mapping[str, str], channel: str, slot: str) -> float:
    key = f"channel.{channel}.conversion-set.conversion.{slot}.scaling.multiplier"
    if key not in header:
        raise InputError(
            f"{source.name} does not hold its calibration; give calibration={{'spring_constant': '0.04 N/m', "
            "'sensitivity': '60 nm/V'} with your numbers"
        )
    return _number(source, header, key)
