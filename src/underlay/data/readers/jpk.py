"""JPK force archives: curves, maps and quantitative imaging, with any number and order of segments.

A file is a ZIP archive of Java property files and big-endian numbers. The properties of a channel lead from
integers to volts (encoder), from volts to a distance (sensitivity) and from there to a force (spring
constant); newer files keep them in ``shared-data/header.properties`` and point there by number. A channel of
type ``float-data`` holds the unit at which its conversions begin. What a segment is stands in its own header.

Headers are bounded before they are unpacked: a hundred kilobytes of archive can claim a header of 200 MB, of
which every line would become an entry. Headers of up to 60 kB and a thousand entries were seen; they grow
with the channels, not with the points.

A map has a dozen members a curve, and may be larger than memory: its directory is read once
(`curves_of_jpk_map`), and whoever then reads a curve unpacks the members of that curve and those that all
share, as an archive of its own.

Why not through afmformats (0.18): it refuses pauses at constant height, several pauses and floats, and
numbers segments without saying what they are. Where it reads a file, the numbers are the same to the last bit
(`tests/test_real_files.py`).
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay._door import opened, read_member
from underlay.data.curve import Curve
from underlay.data.readers._lever import Lever, lever_curve, uncalibrated
from underlay.data.readers._source import LONGEST_HEADER, MAX_BYTES, MOST_PARTS, Source, curve_name, open_zip
from underlay.data.readers._text import SAID, SEGMENT_OF
from underlay.errors import FileFormatError

#: Entries ``lcd-info.3.channel...`` of the shared header, by ``lcd-info.3``.
Shared: TypeAlias = Mapping[str, Mapping[str, str]]
_GENERAL, _SHARED = "header.properties", "shared-data/header.properties"
_SEGMENT = re.compile(r"((?:index/\d{1,9}/)?)segments/(\d{1,9})/segment-header\.properties")
_HEIGHTS = ("measuredHeight", "strainGaugeHeight", "capacitiveSensorHeight", "height")
_INTEGERS = SAID["jpk_integers"]
_FLOATS = "float-data"
# Where a segment says what it is, in files of different ages.
_STYLE_KEYS = [f"force-segment-header.{at}style" for at in ("settings.segment-settings.", "settings.", "")]
# From the base of the deflection to the force: what each step is multiplied by, and what a caller may give.
_STEPS = {"distance": "sensitivity", "force": "stiffness"}
_CONVERSIONS = "channel.{}.conversion-set.conversion"
# What is worth showing of the general header, by the end of its key.
_ABOUT = {"instrument": ".description.instrument", "software version": ".description.source-software"}


def _properties(archive: zipfile.ZipFile, name: str) -> dict[str, str]:
    """Read a member of Java properties, ``key=value`` in Latin-1 with escaped colons; {} where there is none."""
    found: dict[str, str] = {}
    if name not in archive.NameToInfo:
        return found
    for line in read_member(archive, name, LONGEST_HEADER).decode("latin-1").splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found[key.strip()] = value.strip().replace("\\:", ":")
    return found


class _Archive:
    """An open JPK archive, with its general header and the entries that its segments share."""

    def __init__(self, source: Source, archive: zipfile.ZipFile) -> None:
        self.source, self.archive, self.names = source, archive, set(archive.namelist())
        self.whole = _properties(archive, _GENERAL)
        self.shared: dict[str, dict[str, str]] = {}
        for key, value in _properties(archive, _SHARED).items():
            parts = key.split(".", 2)
            if len(parts) == 3:
                self.shared.setdefault(f"{parts[0]}.{parts[1]}", {})[parts[2]] = value

    def header(self, place: str) -> dict[str, str]:
        """Header of the segment at `place`, with the shared entries that it refers to filled in.

        ``channel.X.lcd-info.*=3`` stands for all entries ``lcd-info.3....`` of the shared header.
        """
        header = _properties(self.archive, f"{place}segment-header.properties")
        found = dict(header)
        for key, number in sorted(header.items()):
            if ".*" in key:
                head = key.rsplit(".", 2)[0]
                group = self.shared.get(f"{key.split('.')[-2]}.{number}", {})
                if len(found) + len(group) > MOST_PARTS:
                    raise FileFormatError(f"the header of a segment claims more than {MOST_PARTS} entries")
                found.update({f"{head}.{name}": value for name, value in group.items()})
        return found

    def curves(self) -> dict[str, list[int]]:
        """Numbers of the segments of each curve, by the folder of the curve in the archive."""
        curves: dict[str, list[int]] = {}
        for name in self.names:
            if matched := _SEGMENT.fullmatch(name):
                curves.setdefault(matched[1], []).append(int(matched[2]))
        self.source.require(curves, "holds no force segment")
        # "index/10/" after "index/9/".
        return {
            folder: sorted(curves[folder]) for folder in sorted(curves, key=lambda text: (len(text), text))
        }


class _Segment:
    """One segment: its header, and its channels as numbers."""

    def __init__(self, archive: _Archive, place: str) -> None:
        self.archive, self.source, self.place = archive, archive.source, place
        self.header = archive.header(place)
        there = [name for name in _HEIGHTS if f"{place}channels/{name}.dat" in archive.names]
        both = there and f"{place}channels/vDeflection.dat" in archive.names
        self.source.require(both, f", {place} lacks the channel of the height or the deflection")
        self.channel = there[0]

    def number(self, key: str) -> float:
        """The finite number that the header holds for `key`; FileFormatError without one."""
        return self.source.number(self.header.get(key, ""), f"{key!r:.120}")

    @property
    def label(self) -> str:
        """Label of the segment (loading, hold or unloading) by the style that its header states."""
        style = next((self.header[key] for key in _STYLE_KEYS if key in self.header), "")
        self.source.require(style in SEGMENT_OF, f", {self.place}: unknown kind of segment {style!r:.40}")
        return SEGMENT_OF[style]

    @property
    def calibration(self) -> dict[str, float]:
        """Calibration that the file states, if any: ``stiffness`` (N/m), ``sensitivity`` (m/V)."""
        place = _CONVERSIONS.format("vDeflection")
        keys = {name: f"{place}.{step}.scaling.multiplier" for step, name in _STEPS.items()}
        return {name: self.number(key) for name, key in keys.items() if key in self.header}

    def force(self, calibration: Mapping[str, float]) -> FloatArray:
        """Force (N), (n,), from the deflection channel, whether stored in volts, as a distance or as a force."""
        values = self.raw("vDeflection")
        base = self.header.get("channel.vDeflection.conversion-set.conversions.base", "volts")
        steps = list(_STEPS)
        for step in steps[steps.index(base) + 1 if base in steps else 0 :]:
            if _STEPS[step] not in calibration:
                raise uncalibrated(self.source)
            values = values * calibration[_STEPS[step]]
        return values

    def height(self) -> FloatArray:
        """Height (m), (n,), by the chain of conversions in the header of the segment."""
        values, place = self.raw(self.channel), _CONVERSIONS.format(self.channel)
        base = self.header.get(f"{place}s.base", "volts")
        slot, chain = "calibrated" if self.channel == "height" else "nominal", list[str]()
        while slot != base:
            circle = slot in chain
            self.source.require(not circle, f": the conversions {place[:-11]!r:.80} lead in a circle")
            chain.append(slot)
            slot = self.header.get(f"{place}.{slot}.base-calibration-slot", base)
        for step in reversed(chain):
            scaling = f"{place}.{step}.scaling"
            if f"{scaling}.multiplier" in self.header:
                values = values * self.number(f"{scaling}.multiplier")
                values = values + self.number(f"{scaling}.offset")
        return values

    def raw(self, channel: str) -> FloatArray:
        """Decoded numbers (n,) of a channel, in the unit at which its conversions begin (V; m for some heights)."""
        header, source = self.header, self.source
        content = read_member(self.archive.archive, f"{self.place}channels/{channel}.dat")
        prefix = f"channel.{channel}.data.encoder"
        if f"{prefix}.type" not in header:
            prefix = f"channel.{channel}.encoder"
        kind = header.get(f"{prefix}.type", "")
        types = [header.get(f"channel.{channel}.{place}type") for place in ("data.", "")]
        is_float = not kind and _FLOATS in types
        known = is_float or kind in _INTEGERS
        source.require(known, f", {self.place}: unknown encoding {kind!r:.40} of {channel}")
        claim = header.get("force-segment-header.num-points", "0")
        declared = source.count(claim, f"the points of {self.place}")
        # Floats are single unless there are twice as many bytes.
        dtype = np.dtype((">f8" if len(content) == 8 * declared else ">f4") if is_float else _INTEGERS[kind])
        source.require(
            len(content) % dtype.itemsize == 0 and len(content) >= declared * dtype.itemsize,
            f", {self.place}: the channel {channel} is cut short; the header claims {declared} points and "
            f"{len(content)} bytes are there",
        )
        values = np.frombuffer(content, dtype)
        if is_float:
            return values.astype(np.float64)
        multiplier = self.number(f"{prefix}.scaling.multiplier")
        return values * multiplier + self.number(f"{prefix}.scaling.offset")


def read_jpk(source: Source, calibration: Mapping[str, float]) -> list[Curve]:
    """Read every curve of an archive.

    Parameters
    ----------
    source : Source
        The archive.
    calibration : mapping
        ``stiffness`` (N/m) and ``sensitivity`` (m/V) that the caller gives in place of the file's; may be empty.

    Raises
    ------
    FileFormatError
        If the archive is damaged or holds no segment.
    InputError
        If neither the file nor the caller gives the calibration.
    """
    with open_zip(source) as opened_archive:
        archive = _Archive(source, opened_archive)
        curves = enumerate(archive.curves().items(), start=1)
        return [_curve(archive, number, *numbered, calibration) for number, numbered in curves]


def _curve(
    archive: _Archive, number: int, folder: str, segments: Sequence[int], calibration: Mapping[str, float]
) -> Curve:
    source = archive.source
    heights, forces, times, labels = [], [], [], list[str]()
    start, known = 0.0, dict[str, float]()
    # Of the whole file, and of the curve in a map.
    general = archive.whole | (_properties(archive.archive, folder + _GENERAL) if folder else {})
    for at in segments:
        segment = _Segment(archive, f"{folder}segments/{at}/")
        known = segment.calibration
        forces.append(segment.force({**known, **calibration}))
        heights.append(segment.height())
        count = len(forces[-1])
        source.require(len(heights[-1]) == count, f", {segment.place}: channels of different lengths")
        duration = segment.number("force-segment-header.duration")
        times.append(start + np.arange(count) * (duration / max(count, 1)))
        start += duration
        labels += [segment.label] * count
    keys = [key for axis in "xy" for key in general if key.endswith(f".header.position.{axis}")]
    return lever_curve(
        source,
        -np.concatenate(heights),
        np.concatenate(forces),
        Lever.of(source, known, calibration),
        channel="minus height",
        time=np.concatenate(times),
        segment=np.array(labels, dtype="<U9"),
        number=number,
        header={name: general[key] for name, end in _ABOUT.items() for key in general if key.endswith(end)},
        sign_rules={"segment": "from the header of each segment"},
        position=tuple(source.number(general[key], f"{key!r:.120}") for key in keys)
        if len(keys) == 2
        else (),
    )


# --- maps, curve by curve


_OF_A_CURVE = re.compile(r"index/(\d{1,9})/.*", re.DOTALL)
_OF_ALL = re.compile(r"header\.properties|shared-data/[^/]*|index/")
# Fixed part of what stands before the bytes of a member; its name and further fields follow.
_LOCAL_HEADER, _LOCAL_MARK = struct.Struct("<4s22xHH"), b"PK\x03\x04"
# Bytes of the longest directory: that of a map of 1000 by 1000 curves takes about as much.
_LONGEST_DIRECTORY = 2_000_000_000


class _Member(NamedTuple):
    """A member of a ZIP archive: name, place in the file, compression method, sizes (bytes) and checksum."""

    name: str
    offset: int
    method: int
    packed: int
    size: int
    crc: int


@dataclass(frozen=True)
class JpkMapCurve:
    """Place of one curve in a JPK map on the disk, so that it can be read alone.

    Parameters
    ----------
    path : Path
        The file of the map.
    sha256 : str
        Hash of that file.
    number : int
        Which curve, counted from 1.
    members : tuple
        Members of the archive that belong to the curve, and those that all curves share.
    """

    path: Path
    sha256: str
    number: int
    members: tuple[_Member, ...]

    @property
    def name(self) -> str:
        """Name of the curve, the same as when the whole map is read."""
        return curve_name(self.path, self.number)

    def source(self) -> Source:
        """Read this curve as an archive of its own.

        Raises
        ------
        FileAccessError
            If the map cannot be read.
        FileFormatError
            If the members are damaged, or claim more than is read of one file.
        """
        declared = sum(member.size for member in self.members)
        if declared > MAX_BYTES:
            raise FileFormatError(f"{self.name} claims {declared / 1e6:.0f} MB unpacked")
        for member in self.members:
            if member.name.endswith(".properties") and member.size > LONGEST_HEADER:
                raise FileFormatError(
                    f"{self.name}: the header {member.name!r:.80} claims {member.size / 1e6:.0f} MB unpacked; at "
                    f"most {LONGEST_HEADER / 1e6:g} MB of one are read"
                )
        packed = io.BytesIO()
        with _open(self.path) as stream, zipfile.ZipFile(packed, "w") as archive:
            for member in self.members:
                archive.writestr(zipfile.ZipInfo(member.name), self._unpacked(stream, member))
        return Source(self.path, packed.getvalue(), self.sha256)

    def _unpacked(self, stream: io.FileIO, member: _Member) -> bytes:
        stream.seek(member.offset)
        header = stream.read(_LOCAL_HEADER.size)
        if len(header) == _LOCAL_HEADER.size and member.method in {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
            mark, name, further = _LOCAL_HEADER.unpack(header)
            stream.seek(name + further, os.SEEK_CUR)
            data = stream.read(member.packed)
            if member.method == zipfile.ZIP_DEFLATED:
                data = _inflated(data, member.size)
            if mark == _LOCAL_MARK and len(data) == member.size and zlib.crc32(data) == member.crc:
                return data
        raise FileFormatError(f"{self.name}: archive member {member.name!r:.80} is damaged")


def curves_of_jpk_map(path: str | os.PathLike[str]) -> list[JpkMapCurve]:
    """List the curves of a map without reading them; empty where the file is no map of JPK.

    Raises
    ------
    FileAccessError
        If the file cannot be read, or is no regular file.
    """
    file = Path(path)
    shared: list[_Member] = []
    curves: dict[int, list[_Member]] = {}
    with _open(file) as stream:
        if stream.read(len(_LOCAL_MARK)) != _LOCAL_MARK:
            return []
        try:
            # Closing this archive leaves the stream open.
            with zipfile.ZipFile(stream) as archive:
                members = archive.infolist()
        except (zipfile.BadZipFile, ValueError, EOFError, NotImplementedError, OverflowError, OSError):
            return []  # whoever reads the whole file says what is wrong with it
        for of in members:
            sizes = (of.compress_size, of.file_size, of.CRC)
            member = _Member(of.filename, of.header_offset, of.compress_type, *sizes)
            if matched := _OF_A_CURVE.fullmatch(member.name):
                curves.setdefault(int(matched[1]), []).append(member)
            elif _OF_ALL.fullmatch(member.name):
                shared.append(member)
        if not curves or _GENERAL not in {member.name for member in shared}:
            return []
        stream.seek(0)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    return [
        JpkMapCurve(file.resolve(), sha256, number, (*shared, *curves[index]))
        for number, index in enumerate(sorted(curves), start=1)
    ]


class _Bounded(io.FileIO):
    """A file that refuses to read more bytes at once than the directory of the largest map takes."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read `size` bytes; ValueError for more than `_LONGEST_DIRECTORY`."""
        if size is not None and size > _LONGEST_DIRECTORY:
            raise ValueError(f"{size} bytes at once are not read")
        return super().read(-1 if size is None else size) or b""


@contextmanager
def _open(path: Path) -> Iterator[io.FileIO]:
    """Open a file as `_Bounded`, so that a damaged directory cannot make it read too much at once."""
    with opened(path) as stream:
        yield _Bounded(stream.fileno(), closefd=False)


def _inflated(data: bytes, size: int) -> bytes:
    """Inflate to at most one byte more than `size`, so that excess shows; b'' where the data are damaged."""
    try:
        return zlib.decompressobj(-zlib.MAX_WBITS).decompress(data, size + 1)
    except zlib.error:
        return b""
