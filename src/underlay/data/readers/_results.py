"""Tables of results, one row for each test, which look like the curve of one test: ASMEC, Fischer, typed ones.

A row holds the force and the depth at the peak of a test, its modulus and its hardness. Read as a curve, 220
tests of a public file (TriDiMap, ``ASMEC_example_20x11.xlsx``) were 220 points. What tells them: a name in every
row, words for what only a whole test has (its work, its creep, its final depth), or a modulus beside depths and
forces that leap from row to row. A curve that carries its modulus point by point, as of a continuous stiffness,
does none of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from underlay._arrays import FloatArray
from underlay._text import names_there
from underlay.data.readers._source import Source
from underlay.data.readers._text import is_number, split_label
from underlay.errors import FileFormatError
from underlay.units import kind_of

__all__ = ["require_readings"]

# What a whole test has once, in small letters: work, creep, recovery, values at the peak and after it.
_OF_A_TEST = frozenset(
    (
        *("wtot", "welast", "wplast", "we", "wp", "nit", "ηit", "cit", "rit", "t rec", "average of"),
        *("hmax", "fmax", "pmax", "hf", "hp", "hr", "max. force", "max. depth", "max force", "max depth"),
        *("maximum force", "maximum depth", "max load", "maximum load", "peak load"),
    )
)
_ENOUGH = 2
# A reading may be named by its time, in words (8:00:16 AM, 26 Nov 2026), and have its unit beside each number.
_CLOCK = re.compile(
    r"(?:[\d\s:.,/+-]|[ap]\.?m\.?|[tz]|jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec|mon|tue|wed|thu|fri|sat|sun)*",
    re.IGNORECASE,
)
_WITH_UNIT = re.compile(r"[+-]?[\d.,]+(?:e[+-]?\d+)?\s*[^\d\s_]{1,6}", re.IGNORECASE)
_LONGEST = 200
_FEWEST, _LOOKED_AT = 3, 200
# A motion that passes over its range as often as a third of its rows allows leaps; one of many cycles has a dozen
# readings a way.
_LEAPS, _SHORTEST = 6.0, 8
# Forces that differ by less are those of one load of many tests.
_SAME = 0.02
# What a column that counts tests is called; one that counts readings is "point" or "no.".
_NUMBERED = frozenset(
    (
        *(
            "test",
            "test no",
            "test number",
            "test id",
            "indent",
            "indent no",
            "indent number",
            "indentation no",
        ),
        *(
            "measurement",
            "measurement no",
            "specimen",
            "specimen no",
            "versuch",
            "probe",
            "messung",
            "eindruck",
        ),
        *("essai", "mesure", "ensayo", "prova"),
    )
)


def require_readings(
    source: Source,
    labels: Sequence[str],
    units: Sequence[str],
    rows: Sequence[Sequence[str]],
    depth: FloatArray,
    force: FloatArray,
) -> None:
    """Refuse a table of results.

    Parameters
    ----------
    labels, units : sequence of str
        Of all columns.
    rows : sequence of sequences of str
        All cells.
    depth, force : ndarray (n,)
        As read of them, in any unit.

    Raises
    ------
    FileFormatError
        If its rows are tests and not readings.
    """
    why = (
        _names_of_tests(labels, rows)
        or _words_of_tests(labels)
        or _tests_beside_moduli(labels, units, rows, depth, force)
    )
    if why:
        raise FileFormatError(
            f"{source.name} is a table of results, a row for each test, not the readings of one: {why}. Export the "
            "readings of each test, its depth, force and time; if the rows are readings after all, give columns "
            "with both names, such as columns={'depth': 'h (um)', 'force': 'F (mN)'}"
        )


def _names_of_tests(labels: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    some = rows[:_LOOKED_AT]
    if len(some) < _FEWEST:
        return ""
    first = some[0]
    for index, label in enumerate(labels):
        # Nearly all columns end here.
        if index >= len(first) or not _is_name(first[index]):
            continue
        names = [row[index].strip().strip('"') for row in some if index < len(row)]
        if len(set(names)) == len(some) and all(map(_is_name, names)):
            return f"the column {label.strip()!r:.80} names each row, as {names[0]!r:.40}"
    return ""


def _is_name(cell: str) -> bool:
    text = cell.strip().strip('"')
    if not text or len(text) > _LONGEST or is_number(text):
        return False
    return _CLOCK.fullmatch(text) is None and _WITH_UNIT.fullmatch(text) is None


def _words_of_tests(labels: Sequence[str]) -> str:
    found = [label for label in labels if split_label(label)[0].strip().lower() in _OF_A_TEST]
    return f"it has {names_there(found)}" if len(found) >= _ENOUGH else ""


def _tests_beside_moduli(
    labels: Sequence[str],
    units: Sequence[str],
    rows: Sequence[Sequence[str]],
    depth: FloatArray,
    force: FloatArray,
) -> str:
    moduli = [
        label for label, unit in zip(labels, units, strict=True) if unit and kind_of(unit) == "pressure"
    ]
    if not moduli:
        return ""
    there = f"it has {names_there(moduli)}, and"
    for index, label in enumerate(labels):
        if split_label(label)[0].strip(" .#").lower() in _NUMBERED:
            numbers = [row[index].strip() for row in rows[:_LOOKED_AT] if index < len(row)]
            if len(numbers) >= _FEWEST and len(set(numbers)) == len(numbers):
                return f"{there} the column {label.strip()!r:.80} numbers its rows"
    if not _leaping(depth):
        return ""
    if _leaping(force):
        return f"{there} its depths and forces leap from row to row"
    if np.ptp(force) <= _SAME * np.abs(np.median(force)):
        return f"{there} its depths leap from row to row while its forces are all the same"
    return ""


def _leaping(values: FloatArray) -> bool:
    values = values[np.isfinite(values)]
    if len(values) < _SHORTEST:
        return False
    return float(np.abs(np.diff(values)).sum()) > float(np.ptp(values)) * len(values) / _LEAPS
