"""Readers: one file per instrument format, and the table of formats."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from underlay._door import printable
from underlay._version import VERSION
from underlay.data.curve import Curve
from underlay.data.readers import (
    afm,
    bioindenter,
    delimited,
    excel,
    exported,
    fischer,
    hysitron,
    mach1,
    nanosuite,
    optics11,
    testxpert,
)
from underlay.data.readers._added import added_formats, plugged_readers
from underlay.data.readers._format import Format, Options
from underlay.data.readers._jpk_map import JpkMapCurve, curves_of_jpk_map
from underlay.data.readers._source import Source, load, unpack
from underlay.errors import CurveError, FileFormatError, InputError, UnitError
from underlay.plugins import faults
from underlay.units import parse_quantity

__all__ = [
    "FORMATS",
    "Format",
    "JpkMapCurve",
    "all_formats",
    "curves_of_jpk_map",
    "plugged_readers",
    "read",
    "read_all",
    "read_from_map",
]

#: Every format of this package, in the order in which they are tried on a file. Plain tables come last: many
#: instrument files look like one.
FORMATS: tuple[Format, ...] = (
    mach1.FORMAT,
    optics11.FORMAT,
    bioindenter.FORMAT,
    hysitron.FORMAT,
    fischer.FORMAT,
    nanosuite.FORMAT,
    testxpert.FORMAT,
    exported.JSON_FORMAT,
    exported.HDF5_FORMAT,
    afm.FORMAT,
    excel.FORMAT,
    delimited.FORMAT,
)

# What may be given, and the kinds of quantity it may be: detectors give a voltage or a current.
_CALIBRATION = {"spring_constant": ("stiffness",), "sensitivity": ("sensitivity", "current sensitivity")}
_LISTED = 12


def all_formats() -> tuple[Format, ...]:
    """Every format that is tried on a file, in order: those of plug-ins before plain tables."""
    *instruments, tables = FORMATS
    return (*instruments, *added_formats(FORMATS), tables)


def read(
    path: str | os.PathLike[str],
    format: str | Format | None = None,  # noqa: A002  the name users know from other readers
    columns: Mapping[str, str] | None = None,
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
        name overrides the file's; a minus sign turns the direction.
    test : int, optional
        Which test of a file that holds several, counted from 1.
    calibration : mapping, optional
        What an AFM file may lack: ``{"spring_constant": "0.04 N/m", "sensitivity": "60 nm/V"}``.

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
    if test is not None and len(parts := curves_of_jpk_map(path)) > 1:
        if not 1 <= test <= len(parts):
            raise InputError(f"there is no test {test}: {Path(path).name} holds {len(parts)} tests")
        return read_from_map(parts[test - 1], format, columns, calibration=calibration)
    curves = read_all(path, format, columns, calibration=calibration)
    if test is None:
        if len(curves) == 1:
            return curves[0]
        raise InputError(
            f"{_listing(curves)}. Pick one: test = 1 to test = {len(curves)} in the [curve] section of a scene "
            f"file, or read(path, test=1); read_all takes all of them"
        )
    if not 1 <= test <= len(curves):
        raise InputError(f"there is no test {test}: {_listing(curves)}")
    return curves[test - 1]


def read_all(
    path: str | os.PathLike[str],
    format: str | Format | None = None,  # noqa: A002  as in read
    columns: Mapping[str, str] | None = None,
    *,
    calibration: Mapping[str, str | float] | None = None,
) -> list[Curve]:
    """Read every curve of an instrument file; see `read`.

    An archive (.zip) of instrument files is read member by member, in memory.
    """
    source = load(path)
    curves = _read_source(source, format, columns, calibration)
    return [curve.with_metadata(test=number) for number, curve in enumerate(curves, start=1)]


def read_from_map(
    place: JpkMapCurve,
    format: str | Format | None = None,  # noqa: A002  as in read
    columns: Mapping[str, str] | None = None,
    *,
    calibration: Mapping[str, str | float] | None = None,
) -> Curve:
    """Read one curve of a map on the disk, and nothing else of it; see `read`."""
    (curve, *_) = _read_source(place.source(), format, columns, calibration)
    return curve.with_metadata(name=place.name, test=place.number)


def _read_source(
    source: Source,
    format: str | Format | None,  # noqa: A002  as in read
    columns: Mapping[str, str] | None,
    calibration: Mapping[str, str | float] | None,
) -> list[Curve]:
    chosen = _format_named(format) if format is not None else None
    options = Options(columns, _calibration(calibration))
    curves: list[Curve] = []
    for part in unpack(source):
        reader = chosen or recognise(part)
        if columns is not None and not reader.takes_columns:
            raise InputError(
                f"a column mapping does not apply to {part.name}, a file of format {reader.name!r}"
            )
        if options.calibration and not reader.takes_calibration:
            raise InputError(
                f"{part.name}, of format {reader.name!r}, holds its calibration; none can be given"
            )
        curves.extend(_stamp(curve, part, reader) for curve in reader.read_all(part, options))
    if not curves:
        raise CurveError(f"{source.name} holds no curve")
    return curves


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
    names = ", ".join(known.name for known in all_formats())
    broken = faults(plugged_readers(FORMATS))
    raise FileFormatError(f"{source.name} is not recognised as any known format ({names}){broken}")


def _format_named(name: str | Format) -> Format:
    if isinstance(name, Format):
        return name
    known = {candidate.name: candidate for candidate in all_formats()}
    if name not in known:
        broken = faults(plugged_readers(FORMATS))
        raise InputError(f"no format {name!r}; there are {', '.join(known)}{broken}")
    return known[name]


def _calibration(given: Mapping[str, str | float] | None) -> dict[str, float]:
    """SI numbers by kind of quantity: "stiffness", "sensitivity", "current sensitivity"."""
    numbers = {}
    for name, value in (given or {}).items():
        if name not in _CALIBRATION:
            raise InputError(f"no calibration {name!r}; there are {', '.join(_CALIBRATION)}")
        kinds = _CALIBRATION[name]
        kind = next((kind for kind in kinds if _is_of_kind(value, kind)), kinds[0])
        numbers[kind] = parse_quantity(value, kind)
        if numbers[kind] <= 0.0:
            raise InputError(f"calibration {name!r} must be positive; got {value!r}")
    return numbers


def _is_of_kind(value: str | float, kind: str) -> bool:
    try:
        parse_quantity(value, kind)
    except UnitError:
        return False
    return True


def _stamp(curve: Curve, source: Source, reader: Format) -> Curve:
    """Add to a curve where it came from."""
    return curve.with_metadata(
        name=curve.metadata.get("name") or printable(source.path.stem),
        path=str(source.path),
        member=source.member or None,
        sha256=source.sha256,
        format=reader.name,
        reader=f"underlay {VERSION}, reader {reader.name}",
    )


def _listing(curves: list[Curve]) -> str:
    names = [
        f"{number}: {curve.metadata.get('name')}, {len(curve)} points"
        for number, curve in enumerate(curves, 1)
    ]
    more = f"; and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{curves[0].metadata.get('path')} holds {len(curves)} tests ({'; '.join(names[:_LISTED])}{more})"
