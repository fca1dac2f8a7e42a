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
from underlay.data.readers._words import SAID
from underlay.errors import CurveError, InputError, MissingExtraError, UnderlayError, UnderlayWarning
from underlay.plugins import READERS, Plugin, plugins

# Rows left out that are named.
_LISTED = 5


@dataclass(frozen=True)
class Options:
    """What a caller of `read` states in addition to the content of a file.

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
    """A file format of an instrument: how it is recognised and what reads it.

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
        Whether files of this format accept a column mapping.
    takes_calibration : bool
        Whether files of this format accept a calibration of the cantilever.
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
    """Make a curve of SI columns; points without depth, force or time are left out, with a warning and a note.

    Parameters
    ----------
    depth, force, time, segment : ndarray (n,)
        Depth (m), force (N), time (s) and segment labels; NaN marks an empty cell or a sentinel.
    columns : mapping of str to ndarray (n,), optional
        Further columns of the curve; a NaN in one of these leaves no point out.
    **metadata
        Entries of the curve's metadata; ``notes`` are added to.

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
        rows = ", ".join(map(str, np.flatnonzero(~valid)[:_LISTED] + 1)) + (
            ", ..." if left_out > _LISTED else ""
        )
        note = (
            f"{left_out} of {len(valid)} points left out: empty cell, NaN or sentinel value "
            f"(row{'s' if left_out > 1 else ''} {rows} of the table)"
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
    """Copy the chosen values into a read-only array, which `Curve` then takes without a second copy."""
    kept = values[chosen].copy() if isinstance(chosen, slice) else values[chosen]
    kept.flags.writeable = False
    return kept


def read_parts(parts: Sequence[tuple[str, Callable[[], list[Curve]]]]) -> list[Curve]:
    """Read the parts of a file (sheets, archive members); one that cannot be read is left out with a note.

    Parameters
    ----------
    parts : sequence of (str, callable)
        Name of each part, and the function that reads its curves.

    Returns
    -------
    list of Curve
        Curves of all parts; the metadata of the first note which parts were left out and why.

    Raises
    ------
    UnderlayError
        If no part can be read: the error of one of them, preferably of one whose format was recognised.
    """
    curves: list[Curve] = []
    failures: dict[str, UnderlayError] = {}
    for name, read in parts:
        try:
            curves += read()
        except MissingExtraError:
            raise
        except InputError as error:
            failures[f"{name} is left out: {error}"] = error
    if failures and not curves:
        # What is no curve at all says less than what is one and cannot be read.
        raise min(failures.values(), key=lambda error: "not recognised" in str(error))
    return with_note(curves, [*failures])


def with_note(curves: list[Curve], notes: Sequence[str]) -> list[Curve]:
    """Add notes on what was left out of a file to the metadata of its first curve; return all its curves."""
    if not (notes and curves):
        return curves
    more = (f"and {len(notes) - _LISTED} more parts",) if len(notes) > _LISTED else ()
    first = curves[0].with_metadata(notes=(*curves[0].metadata["notes"], *notes[:_LISTED], *more))
    return [first, *curves[1:]]


def plugged_readers(known: Sequence[Format]) -> tuple[Plugin, ...]:
    """Load the readers of other packages (entry points, see `underlay.plugins`).

    One whose name is that of a `known` format or of an earlier plug-in is returned with a fault, not used.
    """
    names = {entry.name for entry in known}
    judged = []
    for plugin in plugins(READERS, _fault):
        name = "" if plugin.fault else plugin.thing.name
        second = replace(plugin, thing=None, fault=f"another format is called {name!r}")
        judged.append(second if name in names else plugin)
        names |= {name} - {""}
    return tuple(judged)


def _fault(_: str, thing: object) -> str:
    return "" if isinstance(thing, Format) else "it is no Format"


def added_formats(known: Sequence[Format]) -> tuple[Format, ...]:
    """Formats of other packages that can be used, each wrapped so that its errors stop no other reader.

    An error in `sniff` becomes a warning and False; an error in `read_all` becomes a `FileFormatError` that
    names the package.
    """
    return tuple(_contained(entry) for entry in plugged_readers(known) if not entry.fault)


def _contained(plugin: Plugin) -> Format:
    own: Format = plugin.thing
    label = f"reader {own.name} of {plugin.package}"

    def said(error: Exception) -> str:
        return one_line(f"{type(error).__name__}: {error}")

    def sniff(source: Source) -> bool:
        try:
            return bool(own.sniff(source))
        except Exception as error:  # noqa: BLE001  code of others: whatever it raises is theirs
            fault = f"{source.name}: the {label} failed to look at it ({said(error)}) and is passed over"
            warnings.warn(fault, UnderlayWarning, stacklevel=2)
            return False

    def read_all(source: Source, options: Options) -> list[Curve]:
        try:
            curves: list[Any] = list(own.read_all(source, options))
        except UnderlayError:
            raise
        except Exception as error:
            raise source.wrong(f": the {label} failed: {said(error)}") from error
        for curve in curves:
            source.require(isinstance(curve, Curve), f": the {label} gave {curve!r:.60} in place of a curve")
        return curves

    return replace(own, sniff=sniff, read_all=read_all)


def way_out(source: Source) -> str:
    """Say what a file of a known but unsupported format is and what to do with it; '' for any other file.

    The text completes a sentence that begins with the name of the file and "is".

    Examples
    --------
    >>> from pathlib import Path
    >>> way_out(Source(Path("a.mdt"), bytes([0x01, 0xB0, 0x93, 0xFF, 0]), ""))[:24]
    'an NT-MDT file (.mdt), w'
    """
    for known in SAID["not_read"]:
        if source.data.startswith(known["mark"].encode("latin-1"), known.get("at", 0)):
            return f"{known['what']}, which is not read here: {known['advice']}"
    return ""
