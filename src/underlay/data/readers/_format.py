"""What a format is: how a reader tells its files and hands over their curves; and files that nobody reads.

A `Format` pairs a test of a file's content with what reads it, and `make_curve` is the one way from SI
columns to a curve. Formats of other packages (`underlay.plugins`) are wrapped, so that an error in one of
them names the package and costs no other reader its file. `way_out` tells what to do with a file that is
known and not read, because no maintained reader exists, none is known to read forces, or a program has packed
it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import one_line
from underlay.data.curve import Curve
from underlay.data.readers._source import Source
from underlay.errors import (
    CurveError,
    FileFormatError,
    InputError,
    MissingExtraError,
    UnderlayError,
    UnderlayWarning,
)
from underlay.plugins import READERS, Plugin, plugins

__all__ = [
    "Format",
    "Options",
    "added_formats",
    "make_curve",
    "plugged_readers",
    "read_parts",
    "require",
    "way_out",
]

# Rows left out that are named.
_LISTED = 5
# First bytes, what the file is, and what to do. No reader of these is maintained, or none is known to read forces.
_KNOWN = (
    (
        b"MATLAB 7.3 MAT-file",
        "a MATLAB file of version 7.3",
        "save it in MATLAB with save(name, variables, '-v7'), which is read",
    ),
    (
        b"\x01\xb0\x93\xff",
        "an NT-MDT file (.mdt)",
        "open it in NT-MDT's Nova or Image Analysis and export the curves as text (.txt), which is read",
    ),
    (
        b"GWYP",
        "a Gwyddion file (.gwy)",
        "export the curves from Gwyddion as text with names and units in the first row",
    ),
    (
        b"WIT_PR06",
        "a WITec project (.wip)",
        "export the curves from WITec's Project as text with names and units in the first row",
    ),
)
_UNPACK = "unpack it, or pack the curves as a ZIP archive (.zip), which is read"
_PACKED = (
    (b"BZh", "compressed by bzip2 (.bz2)"),
    (b"\xfd7zXZ\0", "compressed by xz (.xz)"),
    (b"\x28\xb5\x2f\xfd", "compressed by Zstandard (.zst)"),
    (b"7z\xbc\xaf\x27\x1c", "an archive of 7-Zip (.7z)"),
    (b"Rar!\x1a\x07", "an archive of RAR (.rar)"),
)
# A TAR archive has its mark behind the first name.
_TAR_AT, _TAR = 257, b"ustar"
# Asylum's container of whole force maps writes its name behind a check sum and a size.
_ARDF = b"ARDF"


@dataclass(frozen=True)
class Options:
    """What a caller adds to a file.

    Parameters
    ----------
    columns : mapping, optional
        For tables: which column is ``depth``, ``force``, ``time`` or ``segment``.
    calibration : mapping
        SI numbers that a file may lack, by kind: ``stiffness`` of the cantilever (N/m), ``sensitivity`` (m/V)
        or ``current sensitivity`` (m/A) of its detector.
    """

    columns: Mapping[str, str | int] | None = None
    calibration: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Format:
    """One instrument format.

    Parameters
    ----------
    name : str
        What ``read(..., format=)`` takes.
    description : str
        One line for people.
    sniff : callable
        Whether the content of a file is of this format; looks at content only.
    read_all : callable
        All curves in a file of this format.
    read_one : callable, optional
        One curve by its number, counted from 1, where that takes less than reading all.
    extra : str
        The optional extra that the format needs; empty if none.
    takes_columns : bool
        Whether a column mapping means something.
    takes_calibration : bool
        Whether a calibration means something.
    """

    name: str
    description: str
    sniff: Callable[[Source], bool]
    read_all: Callable[[Source, Options], list[Curve]]
    read_one: Callable[[Source, Options, int], Curve] | None = None
    extra: str = ""
    takes_columns: bool = False
    takes_calibration: bool = False


def make_curve(
    source: Source,
    depth: FloatArray,
    force: FloatArray,
    time: FloatArray | None = None,
    segment: NDArray[np.str_] | None = None,
    *,
    columns: Mapping[str, FloatArray] | None = None,
    **metadata: Any,
) -> Curve:
    """Make a curve of SI columns, leaving out points without a value and saying so.

    Parameters
    ----------
    depth, force, time, segment : ndarray (n,)
        NaN marks an empty cell or a sentinel.
    columns : mapping of str to ndarray (n,), optional
        Further columns of the curve; a NaN in one of these leaves no point out.
    **metadata
        What the reader knows of the curve.

    Raises
    ------
    CurveError
        If no point is left.
    """
    valid = np.isfinite(depth) & np.isfinite(force)
    if time is not None:
        valid &= np.isfinite(time)
    left_out = int(np.count_nonzero(~valid))
    if left_out == len(valid):
        raise CurveError(f"{source.name}: no point has both a depth and a force")
    notes = tuple(metadata.pop("notes", ()))
    if left_out:
        rows = ", ".join(str(row) for row in np.flatnonzero(~valid)[:_LISTED] + 1)
        more = ", ..." if left_out > _LISTED else ""
        note = (
            f"{left_out} of {len(valid)} points left out: empty cell, NaN or sentinel value "
            f"(row{'s' if left_out > 1 else ''} {rows}{more} of the table)"
        )
        warnings.warn(f"{source.name}: {note}", UnderlayWarning, stacklevel=2)
        notes = (*notes, note)
    chosen = valid if left_out else slice(None)
    return Curve(
        _kept(depth, chosen),
        _kept(force, chosen),
        None if time is None else _kept(time, chosen),
        segment if segment is None else segment[chosen],
        {**metadata, "notes": notes, "points_left_out": left_out},
        columns={name: _kept(values, chosen) for name, values in (columns or {}).items()},
    )


def _kept(values: FloatArray, chosen: NDArray[np.bool_] | slice) -> FloatArray:
    """Copy the chosen values, once: what is read-only a curve takes as it is."""
    kept = values[chosen].copy() if isinstance(chosen, slice) else values[chosen]
    kept.flags.writeable = False
    return kept


def require(condition: object, source: Source, message: str) -> None:
    """Refuse a file whose content is not what the format promises.

    Raises
    ------
    FileFormatError
        With the name of the file and `message`, unless `condition` holds.
    """
    if not condition:
        raise FileFormatError(f"{source.name}: {message}")


def read_parts(parts: Sequence[tuple[str, Callable[[], list[Curve]]]]) -> list[Curve]:
    """Curves of the parts of a file, sheets or members: one that cannot be read costs no other its curves.

    Parameters
    ----------
    parts : sequence of (str, callable)
        What a part is called, and what reads it.

    Returns
    -------
    list of Curve
        The first of them notes what was left out.

    Raises
    ------
    UnderlayError
        What the first part raised, if none can be read.
    """
    curves: list[Curve] = []
    failures: list[tuple[str, UnderlayError]] = []
    for name, read in parts:
        try:
            curves += read()
        except MissingExtraError:
            raise
        except InputError as error:
            failures.append((name, error))
    if failures and not curves:
        # What is no curve at all says less than what is one and cannot be read.
        raise min((error for _, error in failures), key=lambda error: "not recognised" in str(error))
    return with_note(curves, [f"{name} is left out: {error}" for name, error in failures])


def with_note(curves: list[Curve], notes: Sequence[str]) -> list[Curve]:
    """Return the curves with notes on what was left out of their file; the first of them carries them."""
    if not (notes and curves):
        return curves
    more = (f"and {len(notes) - _LISTED} more parts",) if len(notes) > _LISTED else ()
    first = curves[0].with_metadata(notes=(*curves[0].metadata["notes"], *notes[:_LISTED], *more))
    return [first, *curves[1:]]


def plugged_readers(known: Sequence[Format]) -> tuple[Plugin, ...]:
    """Load the readers that other packages add, beside those that are `known`; see `underlay.plugins`."""
    taken = {entry.name for entry in known}
    judged = []
    for plugin in plugins(READERS, _fault):
        name = "" if plugin.fault else plugin.thing.name
        judged.append(
            replace(plugin, thing=None, fault=f"another format is called {name!r}")
            if name in taken
            else plugin
        )
        taken |= {name} - {""}
    return tuple(judged)


def added_formats(known: Sequence[Format]) -> tuple[Format, ...]:
    """Formats of other packages that can be used, each wrapped so that its failures stay its own.

    An error while a file is recognised becomes a warning and a no; one while it is read becomes a
    `FileFormatError` that names the package.
    """
    return tuple(_contained(entry) for entry in plugged_readers(known) if not entry.fault)


def _fault(name: str, thing: object) -> str:
    del name
    return "" if isinstance(thing, Format) else "it is no Format"


def _contained(plugin: Plugin) -> Format:
    own: Format = plugin.thing
    whose = f"reader {own.name} of {plugin.package}"

    def sniff(source: Source) -> bool:
        try:
            return bool(own.sniff(source))
        except Exception as error:  # noqa: BLE001  code of others: whatever it raises is theirs
            said = one_line(f"{type(error).__name__}: {error}")
            warnings.warn(
                f"{source.name}: the {whose} failed to look at it ({said}) and is passed over",
                UnderlayWarning,
                stacklevel=2,
            )
            return False

    def read_all(source: Source, options: Options) -> list[Curve]:
        try:
            curves: list[Any] = list(own.read_all(source, options))
        except UnderlayError:
            raise
        except Exception as error:
            said = one_line(f"{type(error).__name__}: {error}")
            raise FileFormatError(f"{source.name}: the {whose} failed: {said}") from error
        for curve in curves:
            if not isinstance(curve, Curve):
                raise FileFormatError(f"{source.name}: the {whose} gave {curve!r:.60} in place of a curve")
        return curves

    return replace(own, sniff=sniff, read_all=read_all)


def way_out(source: Source) -> str:
    """What to say of a file that is known but not read, as the end of a sentence; '' of any other.

    Examples
    --------
    >>> from pathlib import Path
    >>> way_out(Source(Path("a.mdt"), bytes([0x01, 0xB0, 0x93, 0xFF, 0]), ""))[:24]
    'an NT-MDT file (.mdt), w'
    """
    for start, what, advice in _KNOWN:
        if source.data.startswith(start):
            return f"{what}, which is not read here: {advice}"
    for start, what in _PACKED:
        if source.data.startswith(start):
            return f"{what}, which is not read here: {_UNPACK}"
    if source.data.startswith(_TAR, _TAR_AT):
        return f"an archive of tar (.tar), which is not read here: {_UNPACK}"
    if source.data[8:12] == _ARDF or source.data.startswith(_ARDF):
        return (
            "an Asylum Research map (.ardf), which is not read here: export its curves from Asylum's Igor program "
            "as .ibw, one a file, which are read"
        )
    return ""
