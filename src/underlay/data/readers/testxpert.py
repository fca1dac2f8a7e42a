"""Zwick/Roell testXpert workbooks (.xlsx, .xls).

Sheets of parameters, results and statistics, then one per specimen: its name repeated, a row of names in
the machine's language, a row of units (s, N, mm, mm), and numbers. A table of results has a row of units
too (N, mm), but its rows are specimens: its first column holds their names and has no unit. Columns are
matched by name in French, German and English, else by the order of their units. Compression is positive as
written; depth is the travel of the crosshead, turned if the gap between the tools does not close with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.readers._format import Format, Options, make_curve
from underlay.data.readers._source import Source
from underlay.data.readers._text import column_factor, numbers
from underlay.data.readers.excel import Sheet, is_xls, is_xlsx, padded, sheets_of, xlsx_text
from underlay.errors import FileFormatError
from underlay.units import kind_of

__all__ = ["FORMAT"]

_NAMES = {
    "time": ("temps d'essai", "temps", "prüfzeit", "zeit", "test time", "time"),
    "force": ("force standard", "force", "standardkraft", "kraft", "standard force"),
    "depth": (
        "allongement",
        "déformation",
        "standardweg",
        "weg",
        "verformung",
        "standard travel",
        "deformation",
    ),
    "gap": ("ecartement entre outils", "écartement entre outils", "werkzeugabstand", "tool separation"),
}
_KINDS = {"time": "time", "force": "force", "depth": "length", "gap": "length"}
_PARAMETER_SHEETS = ("Paramètres", "Parameter", "Parameters", "Parámetros", "Parametri")
# Beside the parameters stand results, or specimens alone, with names of columns such as these.
_RESULT_SHEETS = ("Résultats", "Ergebnisse", "Results", "Resultados", "Risultati")
_TEST_COLUMNS = ("Temps d'essai", "Ecartement entre outils", "Prüfzeit", "Werkzeugabstand", "Tool separation")
# Gap plus travel is constant to the digits written where both describe one test.
_CLOSURE = 1e-3


def _sniff(source: Source) -> bool:
    if is_xlsx(source):
        text = xlsx_text(source)
        sheets = (_PARAMETER_SHEETS, _RESULT_SHEETS)
        return all(any(f'name="{name}"' in text for name in names) for names in sheets)
    if is_xls(source):
        return _in_bytes(source, _PARAMETER_SHEETS) and _in_bytes(source, _RESULT_SHEETS + _TEST_COLUMNS)
    return False


def _in_bytes(source: Source, names: Sequence[str]) -> bool:
    # Sheet names in .xls are stored with one or with two bytes per letter.
    return any(name.encode(code) in source.data for name in names for code in ("latin-1", "utf-16-le"))


def _read_all(source: Source, options: Options) -> list[Curve]:
    del options
    curves = [
        _curve(source, sheet, found) for sheet in sheets_of(source) if (found := _find(sheet)) is not None
    ]
    if not curves:
        raise FileFormatError(f"{source.name} has no sheet of a specimen: no row of units s, N, mm")
    return curves


def _find(sheet: Sheet) -> tuple[int, dict[str, int]] | None:
    """Row of units and columns of a specimen's sheet, else None."""
    for at, units in enumerate(sheet.rows[1:6], start=1):
        kinds = [kind_of(unit) if unit else None for unit in units]
        if kinds and kinds[0] is not None and "force" in kinds and "length" in kinds:
            names = [cell.lower() for cell in sheet.rows[at - 1]]
            return at, _by_name(names, kinds) or _by_order(kinds)
    return None


def _by_name(names: Sequence[str], kinds: Sequence[str | None]) -> dict[str, int]:
    found: dict[str, int] = {}
    for role, candidates in _NAMES.items():
        for j, name in enumerate(names[: len(kinds)]):
            if role not in found and name in candidates and kinds[j] == _KINDS[role]:
                found[role] = j
    return found if {"force", "depth"} <= found.keys() else {}


def _by_order(kinds: Sequence[str | None]) -> dict[str, int]:
    """First time, first force, first and second length."""
    found: dict[str, int] = {}
    for role, kind in _KINDS.items():
        taken = set(found.values())
        for j, present in enumerate(kinds):
            if present == kind and j not in taken:
                found[role] = j
                break
    return found


def _curve(source: Source, sheet: Sheet, placed: tuple[int, dict[str, int]]) -> Curve:
    at, found = placed
    where = f"{source.name}, sheet {sheet.name!r}"
    rows = padded(sheet.rows[at + 1 :], found.values())
    if not rows:
        raise FileFormatError(f"{where} has no rows of numbers")
    roles = list(found)
    names, units = sheet.rows[at - 1], sheet.rows[at]
    table = numbers(rows, [found[role] for role in roles], where)
    columns = {
        role: table[:, j] * column_factor(units[found[role]], _KINDS[role], names[found[role]], where)
        for j, role in enumerate(roles)
    }
    depth, rule, known = _depth(columns["depth"], columns.get("gap"))
    return make_curve(
        source,
        depth,
        columns["force"],
        columns.get("time"),
        name=f"{source.path.stem}, {sheet.name}",
        sheet=sheet.name,
        units={names[found[role]]: units[found[role]] for role in roles},
        sign_rules={
            "depth": rule,
            "force": "as written, positive in compression",
            "segment": "from the motion",
        },
        **known,
    )


def _depth(travel: FloatArray, gap: FloatArray | None) -> tuple[FloatArray, str, dict[str, Any]]:
    """Travel into the sample, the rule of its sign, and the first gap between the tools."""
    if gap is None or not (np.isfinite(gap).all() and np.isfinite(travel).all()):
        return travel, "travel as written; the file has no gap to check it with", {}
    known = {"initial_gap": float(gap[0])}
    for sign, rule in (
        (1.0, "travel as written: gap plus travel is constant"),
        (-1.0, "minus the travel as written"),
    ):
        total = gap + sign * travel
        if np.ptp(total) <= _CLOSURE * max(float(np.ptp(travel)), np.finfo(float).tiny):
            return sign * travel, rule, known
    return travel, "travel as written; it does not close with the gap between the tools", known


FORMAT = Format(
    name="testxpert",
    description="Zwick/Roell testXpert workbooks (.xlsx, .xls)",
    sniff=_sniff,
    read_all=_read_all,
    extra="afm",
)
