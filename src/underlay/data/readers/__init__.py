"""Readers of instrument files: one file per format, the order in which they are tried, and `read`.

A format is recognised by the content of a file, never by the ending of its name. What comes out is a `Curve`
in SI, with depth growing into the sample and force positive in compression, whose metadata say which rule of
sign was used and where the file came from.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeAlias, TypeVar

from underlay._door import printable
from underlay._version import VERSION
from underlay.data.curve import Curve
from underlay.data.readers import (
    afm,
    delimited,
    indenters,
    microscopes,
    nanoscope,
    recorded,
    workbooks,
)
from underlay.data.readers._format import (
    Format,
    Options,
    added_formats,
    plugged_readers,
    read_parts,
    way_out,
    with_note,
)
from underlay.data.readers._hdf5 import Hdf5MapCurve, KeptOpen, curves_of_hdf5
from underlay.data.readers._lever import Calibration
from underlay.data.readers._source import LISTED, Source, load, unpack
from underlay.data.readers.jpk import JpkMapCurve, curves_of_jpk_map
from underlay.errors import CurveError, InputError
from underlay.plugins import faults

__all__ = ["FORMATS", "Format", "KeptOpen", "MapCurve", "all_formats", "curves_of_jpk_map", "curves_of_map"]
__all__ += ["kept_open", "plugged_readers", "read", "read_all", "read_from_map"]

#: Every format of this package, in the order in which they are tried on a file. Plain tables come last: many
#: instrument files look like one.
FORMATS: tuple[Format, ...] = (
    indenters.MACH1,
    indenters.OPTICS11,
    indenters.BIOINDENTER,
    indenters.HYSITRON,
    indenters.FISCHER,
    workbooks.NANOSUITE,
    nanoscope.FORMAT,
    microscopes.NANOSURF,
    microscopes.PARK,
    microscopes.ASYLUM,
    workbooks.TESTXPERT,
    recorded.JSON_FORMAT,
    recorded.HDF5_FORMAT,
    afm.FORMAT,
    recorded.MATLAB_FORMAT,
    recorded.TDMS_FORMAT,
    workbooks.EXCEL,
    delimited.FORMAT,
)

#: One curve of a file of many, which is read alone.
MapCurve: TypeAlias = JpkMapCurve | Hdf5MapCurve

_Test = TypeVar("_Test")


def all_formats() -> tuple[Format, ...]:
    """Every format that is tried on a file, in order: those of plug-ins before plain tables."""
    *instruments, tables = FORMATS
    return (*instruments, *added_formats(FORMATS), tables)


def read(
    path: str | os.PathLike[str],
    format: str | Format | None = None,  # noqa: A002  the name users know from other readers
    columns: Mapping[str, str | int] | None = None,
    *,
    test: int | None = None,
    calibration: Mapping[str, str | float] | None = None,
) -> Curve:
    """Read the one curve of an instrument file.

    Parameters
    ----------
    path : str or path
        The file.
    format : str or Format, optional
        Name of a format that `underlay formats` lists, or one of your own; recognised from the content by default.
    columns : mapping, optional
        For plain tables, which column is what: ``{"depth": "h (nm)", "force": "-Fz (mN)"}``. A unit in the
        name overrides the file's; a minus sign turns the direction. By number where there are no names,
        ``{"depth": "2 (nm)", "force": "3 (mN)"}``; and sums and products, ``"ramp - deflection"`` or
        ``"volts * 41 nm/V * 0.06 N/m"``.
    test : int, optional
        Which test of a file that holds several, counted from 1.
    calibration : mapping, optional
        What an AFM file may lack: ``{"spring_constant": "0.04 N/m", "sensitivity": "60 nm/V"}``; how well it
        is known, ``"0.04 N/m ± 10 %"``; or how well the file's own is known, ``"± 10 %"``.

    Returns
    -------
    Curve
        In SI, depth into the sample and force in compression positive; its metadata say how that was done.

    Raises
    ------
    FileAccessError
        If the file cannot be read.
    FileFormatError
        If its content is not understood.
    InputError
        If it holds several tests and `test` does not say which.
    """
    asked = _Asked(format, columns, Calibration.of(calibration))
    if test is not None and len(parts := curves_of_map(path)) > 1:
        return asked.of_map(_one_of(parts, test, f"{Path(path).name} holds {len(parts)} tests"))
    source = load(path)
    if test is not None and (one := asked.one(source, test)) is not None:
        return one
    curves = _numbered(asked.all(source))
    if test is None and len(curves) > 1:
        raise InputError(
            f"{_listing(curves)}. Pick one: test = 1 to test = {len(curves)} in the [curve] section of a scene "
            "file or among the options of read; read_all takes all of them"
        )
    return curves[0] if test is None else _one_of(curves, test, _listing(curves))


def _one_of(tests: Sequence[_Test], test: int, there: str) -> _Test:
    """Return the test of that number, counted from 1; InputError, with `there` as its reason, if there is none."""
    if not 1 <= test <= len(tests):
        raise InputError(f"there is no test {test}: {there}")
    return tests[test - 1]


def read_all(
    path: str | os.PathLike[str],
    format: str | Format | None = None,  # noqa: A002  as in read
    columns: Mapping[str, str | int] | None = None,
    *,
    calibration: Mapping[str, str | float] | None = None,
) -> list[Curve]:
    """Read every curve of an instrument file; see `read`.

    An archive (.zip) of instrument files is read member by member, in memory.
    """
    return _numbered(_Asked(format, columns, Calibration.of(calibration)).all(load(path)))


def read_from_map(
    place: MapCurve,
    format: str | Format | None = None,  # noqa: A002  as in read
    columns: Mapping[str, str | int] | None = None,
    *,
    calibration: Mapping[str, str | float] | None = None,
) -> Curve:
    """Read one curve of a map on the disk, and nothing else of it; see `read`."""
    return _Asked(format, columns, Calibration.of(calibration)).of_map(place)


def kept_open(place: MapCurve, kept: KeptOpen) -> MapCurve:
    """Return the place of a curve in a map, changed so that reading it leaves its HDF5 file open in `kept`.

    The next curve read with the same `kept` does not open the file again. A curve of a JPK map is unchanged.
    """
    return replace(place, kept=kept) if isinstance(place, Hdf5MapCurve) else place


def curves_of_map(path: str | os.PathLike[str]) -> Sequence[MapCurve]:
    """List the curves of a JPK or HDF5 map without reading them; empty for any other file.

    Each entry can then be read alone (`read_from_map`), so a map may be larger than memory.

    Raises
    ------
    FileAccessError
        If the file cannot be read, or is no regular file.
    """
    return curves_of_jpk_map(path) or curves_of_hdf5(path)


@dataclass(frozen=True)
class _Asked:
    """What a caller of `read` states about a file: its format, its column mapping and its calibration."""

    format: str | Format | None
    columns: Mapping[str, str | int] | None
    known: Calibration

    def all(self, source: Source) -> list[Curve]:
        """Read every curve of a file; of a plain .zip archive, the curves of all its members."""
        parts, left_out = unpack(source)
        source.require(parts or not left_out, f"holds no curve: {''.join(left_out[:1])}")
        alone = len(parts) == 1
        curves = read_parts([(printable(part.member), partial(self._curves, part, alone)) for part in parts])
        if not curves:
            raise CurveError(f"{source.name} holds no curve")
        return with_note(curves, left_out)

    def one(self, source: Source, test: int) -> Curve | None:
        """Read the test of that number (from 1) alone; None where the format can only read all curves of a file."""
        reader = None if source.is_zip else self._reader_of(source)
        if reader is None or reader.read_one is None:
            return None
        curve = reader.read_one(source, self._options(source, reader), test)
        return self._stamped(curve, source, reader, test)

    def of_map(self, place: MapCurve) -> Curve:
        """Read one curve of a map on the disk, with its name and number in its metadata."""
        (curve, *_) = self.all(place.source())
        return curve.with_metadata(**{"name": place.name} if place.name else {}, test=place.number)

    def _curves(self, source: Source, alone: bool) -> list[Curve]:
        reader = self._reader_of(source)
        curves = reader.read_all(source, self._options(source, reader))
        return [
            self._stamped(curve, source, reader, number if alone else None)
            for number, curve in enumerate(curves, start=1)
        ]

    def _reader_of(self, source: Source) -> Format:
        if self.format is None:
            return recognise(source)
        return self.format if isinstance(self.format, Format) else _format_named(self.format)

    def _options(self, source: Source, reader: Format) -> Options:
        """Return the column mapping and calibration for a reader; InputError where its format takes none."""
        if self.columns is not None and not reader.takes_columns:
            raise InputError(
                f"a column mapping does not apply to {source.name}, a file of format {reader.name!r}"
            )
        if (self.known.values or self.known.uncertainties) and not reader.takes_calibration:
            raise InputError(
                f"{source.name}, of format {reader.name!r}, holds its calibration; none can be given"
            )
        return Options(self.columns, self.known.values)

    def _stamped(self, curve: Curve, source: Source, reader: Format, number: int | None) -> Curve:
        """Add file, hash, format, calibration uncertainties and, if unset, the number to a curve's metadata."""
        return curve.with_metadata(
            **({} if number is None or "test" in curve.metadata else {"test": number}),
            **{f"{name}_uncertainty": share for name, share in self.known.uncertainties.items()},
            name=curve.metadata.get("name") or printable(source.path.stem),
            path=str(source.path),
            member=source.member or None,
            sha256=source.sha256,
            format=reader.name,
            reader=f"underlay {VERSION}, reader {reader.name}",
        )


def _numbered(curves: list[Curve]) -> list[Curve]:
    """Return the curves with ``test`` in their metadata, counted from 1, where their reader has not set it."""
    return [
        curve if "test" in curve.metadata else curve.with_metadata(test=number)
        for number, curve in enumerate(curves, start=1)
    ]


def recognise(source: Source) -> Format:
    """Return the format of a file, from its content alone.

    Raises
    ------
    FileFormatError
        If it is none of `all_formats`.
    """
    for candidate in all_formats():
        if candidate.sniff(source):
            return candidate
    if what := way_out(source):
        raise source.wrong(f"is {what}")
    raise source.wrong(
        "is in no format that can be read; an export as text with names and units of its columns "
        f"is{faults(plugged_readers(FORMATS))}"
    )


def _format_named(name: str) -> Format:
    known = {one.name: one for one in all_formats()}
    if name not in known:
        raise InputError(
            f"no format {name!r}; there are {', '.join(known)}{faults(plugged_readers(FORMATS))}"
        )
    return known[name]


def _listing(curves: list[Curve]) -> str:
    names = [
        f"{number}: {curve.metadata.get('name')}, {len(curve)} points"
        for number, curve in enumerate(curves, 1)
    ]
    more = f"; and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return f"{curves[0].metadata.get('path')} holds {len(curves)} tests ({'; '.join(names[:LISTED])}{more})"
