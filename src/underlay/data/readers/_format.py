"""What a format is: how a reader tells its files and hands over their curves; and files that nobody reads.

A `Format` pairs a test of a file's content with what reads it, and `make_curve` is the one way from SI
columns to a curve. Formats of other packages (`underlay.plugins`) are wrapped, so that an error in one of
them names the package and costs no other reader its file. `way_out` tells what to do with a file that is
known and not read, because no maintained reader exists, none is known to read forces, or a program has packed
it.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._text import names_there, one_line
from underlay.data.curve import Curve
from underlay.data.readers._source import HEAD, LISTED, Source
from underlay.data.readers._text import (
    SAID,
    Lines,
    as_number,
    column_factor,
    is_number,
    kind_named,
    listed,
    numbers,
    split_label,
)
from underlay.errors import (
    CurveError,
    FileFormatError,
    InputError,
    MissingExtraError,
    UnderlayError,
    UnderlayWarning,
    UnitError,
    missing_extra,
)
from underlay.plugins import READERS, Plugin, plugins
from underlay.units import parse_quantity, unit_factor

#: Two columns that describe one thing, as load and deflection or travel and gap, agree to this share of their
#: range, by the digits that are written.
CLOSURE = 1e-3
# "Model: Hertz", "SMDuration (s) 0.0", "ErHz= 830.29 kPa": a key ends in a colon, an equals sign or a bracket.
_KEY_VALUE = re.compile(r"(.+?(?:\)|:|=))\s*(.*)")


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


def declared(
    name: str,
    read_all: Callable[[Source, Options], list[Curve]],
    sniff: Callable[[Source], bool] | None = None,
    read_one: Callable[[Source, Options, int], Curve] | None = None,
) -> Format:
    """Return the format of this name as ``formats.toml`` describes it: what it takes, and the extra it needs.

    Without `sniff` it is recognised by how its files begin (``begins``), or by texts in their heads (``holds``).
    """
    said = SAID["formats"][name]
    begins = tuple(text.encode("latin-1") for text in said.get("begins", ()))

    def known(source: Source) -> bool:
        if begins:
            return source.data.startswith(begins)
        return all(text in source.head(HEAD) for text in said["holds"])

    takes = {f"takes_{what}": True for what in said.get("takes", ())}
    return Format(
        name, said["description"], sniff or known, read_all, read_one, said.get("extra", ""), **takes
    )


def library(name: str, need: str, otherwise: str = "") -> Any:
    """Import a library of the extra "afm"; MissingExtraError, which says what `need` it is, if it is not there."""
    try:
        return import_module(name)
    except ImportError as error:
        raise missing_extra(need, "afm", otherwise) from error


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
        rows = ", ".join(map(str, np.flatnonzero(~valid)[:LISTED] + 1)) + (
            ", ..." if left_out > LISTED else ""
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
    more = (f"and {len(notes) - LISTED} more parts",) if len(notes) > LISTED else ()
    first = curves[0].with_metadata(notes=(*curves[0].metadata["notes"], *notes[:LISTED], *more))
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


# --- text formats said as data

#: Columns (n,) in SI by what they are.
Columns: TypeAlias = Mapping[str, FloatArray]


@dataclass(frozen=True)
class Channel:
    """One column that an instrument writes.

    Parameters
    ----------
    kind : str
        Kind of quantity; "" for a number without a unit.
    names : tuple of str
        Its names, in small letters, best first; empty where `Part.found` gives its place.
    needed : bool
        Whether a curve cannot be made without it.
    """

    kind: str
    names: tuple[str, ...] = ()
    needed: bool = True


@dataclass(frozen=True)
class Part:
    """One test as it stands in a file: a header, and a table as text.

    Parameters
    ----------
    head : sequence of str
        Lines above the table.
    labels : sequence of (str, str)
        Name and unit of each column.
    rows : sequence of sequences of str
        The cells.
    name : str
        Name of the part in error messages, such as its block or sheet.
    found : mapping of str to int
        Index of the column of a role, where the reader knows it and names are not needed.
    about : mapping
        Further entries of the curve's metadata.
    """

    head: Sequence[str]
    labels: Sequence[tuple[str, str]]
    rows: Sequence[Sequence[str]]
    name: str = ""
    found: Mapping[str, int] = field(default_factory=dict)
    about: Mapping[str, Any] = field(default_factory=dict)


def table_below(lines: Sequence[str], at: int, rows: slice = slice(None), **about: Any) -> Part:
    """Return the table below a line of names, tabs between cells, with all lines above the names as its head.

    Parameters
    ----------
    lines : sequence of str
        The file.
    at : int
        Number of the line of names, from 0.
    rows : slice, optional
        Which of the lines below it are rows; all by default.
    **about
        Further entries of the curve's metadata.
    """
    labels = [split_label(label) for label in lines[at].split("\t")]
    return Part(lines[:at], labels, Lines(list(lines[at + 1 :][rows]), "\t"), about=about)


def place_of(header: Mapping[str, str], *keys: str) -> dict[str, tuple[float, ...]]:
    """Return the ``position`` (m) of a test from these entries of a header, in um; {} where one is missing."""
    places = [header.get(key, "") for key in keys]
    return (
        {"position": tuple(1e-6 * as_number(text) for text in places)} if all(map(is_number, places)) else {}
    )


def header_of(lines: Sequence[str]) -> dict[str, str]:
    """Parse header lines such as "Model: Hertz" into keys and values; tabs separate the pairs of a line."""
    header: dict[str, str] = {}
    for line in lines:
        cells = [" ".join(cell.split()) for cell in line.strip().split("\t")]
        if len(cells) == 1:
            matched = _KEY_VALUE.fullmatch(cells[0])
            cells = [matched[1], matched[2]] if matched else []
        elif len(cells) % 2 or cells[0].endswith((":", "=")):  # a number and its unit in cells of their own
            cells = [cells[0], " ".join(cells[1:]).strip()]
        for key, value in zip(cells[::2], cells[1::2], strict=False):
            if key:
                header.setdefault(key.rstrip(" :="), value)
    return header


def channels_of(name: str) -> dict[str, Channel]:
    """Return the columns of a format, by role, as ``formats.toml`` lists them under its name."""
    said = SAID["formats"][name]["columns"]
    return {role: Channel(kind, listed(names), *needed) for role, (kind, names, *needed) in said.items()}


def found_columns(channels: Mapping[str, Channel], labels: Sequence[tuple[str, str]]) -> dict[str, int]:
    """Find the index of the column of each role by its names; of several, one whose unit is of the right kind."""
    found = {}
    for role, channel in channels.items():
        named = [at for name in channel.names for at, label in enumerate(labels) if label[0].lower() == name]
        # "Depth (V)" beside "Depth (nm)" is the raw signal.
        fitting = [at for at in named if kind_named(labels[at][1]) == channel.kind]
        if named:
            found[role] = (fitting or named)[0]
    return found


@dataclass(frozen=True)
class TextFormat:
    """A text format described by data: its entry in ``formats.toml`` and a few functions, over one table reader.

    The entry holds its ``description``; its ``columns``, of which ``depth``, ``force`` and ``time`` become those of
    the curve and others serve `made`; its ``signs``, the rule of sign of each in words; ``known`` entries of the
    header, by key: the name in the curve's metadata, the kind of quantity, and the unit if the value has none;
    whether a ``comma`` is the decimal sign, found from the first rows if missing; and the ``extra`` it needs, as
    in `Format`.

    Parameters
    ----------
    name : str
        Name of the format, as in `Format`, and of its entry in ``formats.toml``.
    parts : callable
        Finds the tests (`Part`) of a file; raises `FileFormatError` where there is none.
    made : callable
        Of a part and its SI columns: further arguments of `make_curve` (depth, segment, notes, metadata).
    sniff : callable, optional
        Whether the content of a file is of this format, where the entry does not tell; see `declared`.
    """

    name: str
    parts: Callable[[Source], Iterable[Part]]
    made: Callable[[Part, Columns], Mapping[str, Any]] = lambda _, __: {}
    sniff: Callable[[Source], bool] | None = None

    @property
    def said(self) -> Mapping[str, Any]:
        """The entry of this format in ``formats.toml``."""
        return SAID["formats"][self.name]  # type: ignore[no-any-return]

    @cached_property
    def columns(self) -> Mapping[str, Channel]:
        """The columns that the instrument writes, by role (``depth``, ``force``, ...)."""
        return channels_of(self.name)

    @property
    def format(self) -> Format:
        """The `Format` by which `read` recognises and reads such files."""
        return declared(self.name, self._read_all, self.sniff)

    def _read_all(self, source: Source, options: Options) -> list[Curve]:
        del options
        parts = [(part.name, partial(self._curves, source, part)) for part in self.parts(source)]
        if all(name.startswith("sheet") for name, _ in parts):
            return read_parts(parts)
        return [curve for _, read in parts for curve in read()]

    def _curves(self, source: Source, part: Part) -> list[Curve]:
        where = f"{source.name}, {part.name}" if part.name else source.name
        found = {**found_columns(self.columns, part.labels), **part.found}
        for role, channel in self.columns.items():
            if role not in found and channel.needed:
                there = names_there(name for name, _ in part.labels)
                raise FileFormatError(f"{where} has no column {channel.names[0]!r}; it has {there}")
        columns = self.read(where, part, found)
        header = header_of(part.head)
        own = {role: columns.get(role) for role in ("depth", "force", "time")}
        made: dict[str, Any] = {
            **({"header": header} if part.head else {}),
            "units": {part.labels[at][0]: part.labels[at][1] for at in found.values()},
            "sign_rules": dict(self.said.get("signs", {})),
            **self._known(header),
            **own,
            **part.about,
            **self.made(part, columns),
        }
        main = (made.pop(role, None) for role in (*own, "segment"))
        return [make_curve(source, *main, **made)]

    def read(self, where: str, part: Part, found: Mapping[str, int]) -> dict[str, FloatArray]:
        """Read the columns of a part, (n,) in SI, by role; `found`: their indices, `where`: its name in errors."""
        if not len(part.rows):
            raise FileFormatError(f"{where} has no rows of numbers")
        table = numbers(part.rows, list(found.values()), where, comma=self.said.get("comma"))
        columns = {}
        for j, (role, at) in enumerate(found.items()):
            channel, (label, unit) = self.columns[role], part.labels[at]
            factor = column_factor(unit, channel.kind, label, where) if channel.kind else 1.0
            columns[role] = table[:, j] * factor
        return columns

    def _known(self, header: Mapping[str, str]) -> dict[str, float]:
        """Numbers of the header (SI) that a fit uses, by their name in the metadata; missing ones are left out."""
        known = {}
        for key, (name, kind, unit) in self.said.get("known", {}).items():
            value = header.get(key, "")
            if unit and is_number(value):
                known[name] = as_number(value) * unit_factor(unit, kind)
            elif not unit:
                try:
                    known[name] = parse_quantity(value, kind)
                except UnitError:  # written without a unit in some versions: then it is not used
                    continue
        return known
