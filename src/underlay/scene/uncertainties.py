"""Stated uncertainties of the inputs of a test: how well a radius, a thickness or the force is known.

A scene file states one with its number, ``radius = "1 mm +- 0.02 mm"``, ``"1 mm ± 2 %"`` or ``"1 mm exact"``, or in
a table of its own::

    [uncertainties]
    indenter.radius = "0.02 mm"
    force = "2 %"
    depth = "1 %"
    spring_constant = "10 %"

All are half widths of 95 % intervals. ``uncertainties = "none"`` takes every input as exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from numbers import Real
from typing import Any, NamedTuple

from underlay.errors import InputError
from underlay.quantities import Number
from underlay.scene.parameters import unknown_parameter
from underlay.units import KINDS, parse_quantity

#: Inputs that have no path in a scene; their uncertainties are relative.
RELATIVE = ("force", "depth", "spring_constant")
# Parts whose numbers are inputs; the instrument's other numbers are seen in the curve.
_INPUTS = ("indenter.", "layer.", "substrate.", "instrument.compliance", "adhesion.", "history.")
# Sections of a scene file in which an uncertainty may be written with its number.
_SECTIONS = ("indenter", "layer", "substrate", "instrument", "adhesion", "history", "lever", "discrepancy")
_SIGNS = ("±", "+/-", "+-")
_EXACT = "exact"


class StatedUncertainties(Mapping[str, float]):
    """Half widths of 95 % intervals by input, read-only: SI by path; relative for those named in `RELATIVE`."""

    def __init__(self, rows: Mapping[str, float]) -> None:
        self._rows = dict(rows)

    def __getitem__(self, path: str) -> float:
        return self._rows[path]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __hash__(self) -> int:
        return hash(frozenset(self._rows.items()))

    def __repr__(self) -> str:
        return repr(self._rows)


class Stated(NamedTuple):
    """One uncertainty as a file states it: its text, and the section and key for messages."""

    text: Any
    place: str


def checked(given: object, numbers: Mapping[str, Number]) -> StatedUncertainties | str | None:
    """Checked uncertainties for a scene with these numbers; see `Scene`.

    Of those that were checked before, for another scene, only rows of numbers that this scene has are kept.

    Raises
    ------
    ParameterError
        If there is no such input; names the nearest one.
    InputError
        If an uncertainty is not a number of zero or more.
    """
    inputs = [path for path, number in numbers.items() if _is_input(path) and math.isfinite(number.value)]
    known = (*inputs, *RELATIVE)
    if isinstance(given, StatedUncertainties):
        rows = {path: size for path, size in given.items() if path in known}
        return (given if len(rows) == len(given) else StatedUncertainties(rows)) if rows else None
    if given is None or given == "none":
        return "none" if given else None
    if not isinstance(given, Mapping):
        raise InputError(
            'uncertainties must be a mapping such as {"indenter.radius": 2e-5, "force": 0.02}, "none" or None; '
            f"got {given!r:.80}"
        )
    for path in given:
        _require_input(path, known, numbers)
    return StatedUncertainties({path: _size(path, size, numbers) for path, size in given.items()}) or None


def _is_input(path: str) -> bool:
    return path.startswith(_INPUTS)


def _require_input(path: object, known: tuple[str, ...], numbers: Mapping[str, Number]) -> None:
    if path in known:
        return
    if path not in numbers:
        raise unknown_parameter(str(path), known)
    if _is_input(str(path)):
        raise InputError(f"uncertainties: {path} is infinite in this scene; leave its uncertainty out")
    meant = "spring_constant" if path == "lever.spring_constant" else "a prior under [fit]"
    raise InputError(f"uncertainties: {path} takes none; how well it is known is said by {meant}")


def _size(path: str, given: object, numbers: Mapping[str, Number]) -> float:
    relative = path in RELATIVE
    unit = "a share, such as 0.02" if relative else KINDS[numbers[path].quantity.kind].si or "dimensionless"
    size = math.nan if isinstance(given, bool) or not isinstance(given, Real) else float(given)
    if not 0.0 <= size < math.inf:
        raise InputError(
            f"uncertainties: {path} must be zero (exact) or more and finite ({unit}); got {given!r:.80}"
        )
    if relative and size > 1.0:
        raise InputError(f'uncertainties: {path} is {unit} or "2 %"; got {given!r:.80}')
    return size


# --- scene files -----------------------------------------------------------------------------------------


def split_uncertainties(document: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Stated]]:
    """Split a scene file into the document without the uncertainties of its numbers, and these, by path."""
    found: dict[str, Stated] = {}
    bare = {
        name: _bare(entry, name, found) if name in _SECTIONS else entry for name, entry in document.items()
    }
    return bare, found


def _bare(entry: Any, path: str, found: dict[str, Stated]) -> Any:
    """A value, section or list without its uncertainties, which are stored in `found`."""
    if isinstance(entry, Mapping):
        return {key: _bare(inner, f"{path}.{key}", found) for key, inner in entry.items()}
    if isinstance(entry, list):
        return [_bare(inner, f"{path}[{number}]", found) for number, inner in enumerate(entry)]
    number, size = parted(entry) if isinstance(entry, str) else (entry, None)
    if size is not None:
        section, _, key = path.rpartition(".")
        found[path] = Stated(size, f"[{section}] {key}")
    return number


def parted(text: str) -> tuple[str, str | None]:
    """Split a text into a number and its uncertainty; None where none is stated.

    Examples
    --------
    >>> parted("1 mm ± 2 %"), parted("0.46 exact"), parted("35 deg")
    (('1 mm', '2 %'), ('0.46', 'exact'), ('35 deg', None))
    """
    for sign in _SIGNS:
        number, stated, size = text.partition(sign)
        if stated:
            return number.strip(), size.strip()
    words = text.rsplit(maxsplit=1)
    return (words[0], _EXACT) if len(words) > 1 and words[1] == _EXACT else (text, None)


def rows_of(
    given: Any, inline: Mapping[str, Stated], numbers: Mapping[str, Number], left_out: tuple[str, ...]
) -> dict[str, float] | str | None:
    """Uncertainties (SI) of a scene with these numbers, by path, from the entries of a scene file.

    Parameters
    ----------
    given : object
        Value of ``uncertainties`` in the file: a table, or a word.
    inline : mapping of path to Stated
        Uncertainties that are written with their numbers.
    numbers : mapping of path to Number
        Numbers of the scene.
    left_out : tuple of str
        Paths of numbers that the file of a curve will give.
    """
    if given is None or isinstance(given, Mapping):
        stated = {path: Stated(text, f"[uncertainties] {path}") for path, text in leaves(given or {})}
        twice = sorted(stated.keys() & inline.keys())
        if twice:
            raise InputError(
                f"{inline[twice[0]].place}: its uncertainty is stated twice; leave one of them out"
            )
        joined = {**inline, **stated}
        checked(dict.fromkeys(joined, 0.0), numbers)
        return {path: _read(path, entry, numbers, left_out) for path, entry in joined.items()}
    if given != "none":
        raise InputError(
            f'uncertainties: write uncertainties = "none", or a section [uncertainties]; got {given!r:.60}'
        )
    if inline:
        place = next(iter(inline.values())).place
        raise InputError(f'{place}: an uncertainty beside uncertainties = "none"; leave one of them out')
    return "none"


def leaves(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested keys, ``layer.E = "10 %"``, each with its full path."""
    for key, entry in table.items():
        if isinstance(entry, Mapping):
            yield from leaves(entry, f"{above}{key}.")
        else:
            yield f"{above}{key}", entry


def _read(path: str, stated: Stated, numbers: Mapping[str, Number], left_out: tuple[str, ...]) -> float:
    """One uncertainty (SI, or a share) from its text."""
    text = stated.text.strip() if isinstance(stated.text, str) else stated.text
    kind = "dimensionless" if path in RELATIVE else numbers[path].quantity.kind
    try:
        if text == _EXACT:
            return 0.0
        share = text[:-1].strip() if isinstance(text, str) and text.endswith("%") else None
        size = parse_quantity(text, kind) if share is None else parse_quantity(share, "dimensionless") / 100.0
        if share is not None and path not in RELATIVE:
            size *= _whole(path, numbers, left_out)
        return _size(path, size, numbers)
    except InputError as error:
        raise type(error)(f"{stated.place}: {str(error).removeprefix('uncertainties: ')}") from error


def _whole(path: str, numbers: Mapping[str, Number], left_out: tuple[str, ...]) -> float:
    """Absolute value of the number that a percentage refers to."""
    if path in left_out:
        raise InputError("a percentage of a number that the file of the curve says; write it with a unit")
    value = abs(numbers[path].value)
    if not value:
        raise InputError("a percentage of zero; write it with a unit, or exact")
    return value


def written(rows: Mapping[str, float], numbers: Mapping[str, Number]) -> dict[str, str | float]:
    """Entries of a scene file's section that state these uncertainties to the last bit."""
    found: dict[str, str | float] = {}
    for path, size in rows.items():
        unit = "" if path in RELATIVE else KINDS[numbers[path].quantity.kind].si
        found[path] = (f"{size!r} {unit}" if unit else size) if size else _EXACT
    return found
