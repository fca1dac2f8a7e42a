"""A text format said as data: what tells it, where its tests stand, what columns and head it has.

An instrument's reader is then a `TextFormat`: a few functions that find the tests (`Part`) and one table of
its columns (`Channel`). Units, signs, numbers and errors are the same code for all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, TypeAlias

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve, read_parts
from underlay.data.readers._source import Source
from underlay.data.readers._text import (
    Lines,
    as_number,
    column_factor,
    is_number,
    kind_named,
    numbers,
    split_label,
)
from underlay.data.readers._words import SAID, listed
from underlay.errors import FileFormatError, UnitError
from underlay.units import parse_quantity, unit_factor

__all__ = [
    "Channel",
    "Columns",
    "Part",
    "TextFormat",
    "channels_of",
    "found_columns",
    "header_of",
    "table_below",
]

#: Columns (n,) in SI by what they are.
Columns: TypeAlias = Mapping[str, FloatArray]
# "Model: Hertz", "SMDuration (s) 0.0", "ErHz= 830.29 kPa": a key ends in a colon, an equals sign or a bracket.
_KEY_VALUE = re.compile(r"(.+?(?:\)|:|=))\s*(.*)")


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
    sniff : callable
        Whether the content of a file is of this format.
    parts : callable
        Finds the tests (`Part`) of a file; raises `FileFormatError` where there is none.
    made : callable
        Of a part and its SI columns: further arguments of `make_curve` (depth, segment, notes, metadata).
    """

    name: str
    sniff: Callable[[Source], bool]
    parts: Callable[[Source], Iterable[Part]]
    made: Callable[[Part, Columns], Mapping[str, Any]] = lambda _, __: {}

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
        return Format(
            self.name, self.said["description"], self.sniff, self._read_all, extra=self.said.get("extra", "")
        )

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
