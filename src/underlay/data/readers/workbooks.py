"""Workbooks of indenters and testing machines, each said as data: KLA NanoSuite and Zwick/Roell testXpert.

NanoSuite (MTS, Agilent, KLA; .xls) has a sheet per test: names, units, then numbers, in any order of columns. The
first column is a marker, filled only at the first row of a segment (``Load Segment Type``, ..., ``END``). Where the
stiffness was measured dynamically, the harmonic contact stiffness S = dP/dh stands in
``curve.columns["contact_stiffness"]``. A sheet with columns ``STANDARD DEVIATION (x)`` is an average of tests: the
deviations, the scatter of one test about the average, stand in ``depth_scatter``, ``force_scatter`` and
``contact_stiffness_scatter``, and averages come after the tests of a workbook.

testXpert (.xlsx, .xls) has sheets of parameters, results and statistics, then one per specimen: its name repeated,
a row of names in the machine's language, a row of units (s, N, mm, mm), and numbers. A table of results has a row
of units too (N, mm), but its rows are specimens: its first column holds their names and has no unit. Depth is the
travel of the crosshead, turned if the gap between the tools does not close with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from underlay.data.readers._format import require
from underlay.data.readers._source import Source
from underlay.data.readers._table import marked
from underlay.data.readers._text import is_number
from underlay.data.readers.excel import Sheet, is_xls, is_xlsx, padded, sheets_of, xlsx_text
from underlay.data.readers.text_format import Channel, Columns, Part, TextFormat
from underlay.units import format_quantity, kind_of

__all__ = ["NANOSUITE", "TESTXPERT"]

_MARKER = "Segment Type"
_OF_A_TEST = {
    "depth": Channel("length", ("displacement into surface", "displacement", "indentation depth", "depth")),
    "force": Channel("force", ("load on sample", "load", "force")),
    "contact_stiffness": Channel(
        "stiffness", ("harmonic contact stiffness", "contact stiffness"), needed=False
    ),
    "time": Channel("time", ("time on sample", "time"), needed=False),
}
_SPECIMEN = {
    "time": Channel(
        "time", ("temps d'essai", "temps", "prüfzeit", "zeit", "test time", "time"), needed=False
    ),
    "force": Channel("force", ("force standard", "force", "standardkraft", "kraft", "standard force")),
    "depth": Channel(
        "length",
        (
            *("allongement", "déformation", "standardweg", "weg", "verformung"),
            *("standard travel", "deformation"),
        ),
    ),
    "gap": Channel(
        "length",
        ("ecartement entre outils", "écartement entre outils", "werkzeugabstand", "tool separation"),
        needed=False,
    ),
}
_PARAMETER_SHEETS = ("Paramètres", "Parameter", "Parameters", "Parámetros", "Parametri")
# Beside the parameters stand results, or specimens alone, with names of columns such as these.
_RESULT_SHEETS = ("Résultats", "Ergebnisse", "Results", "Resultados", "Risultati")
_TEST_COLUMNS = ("Temps d'essai", "Ecartement entre outils", "Prüfzeit", "Werkzeugabstand", "Tool separation")
# Gap plus travel is constant to the digits written where both describe one test.
_CLOSURE = 1e-3


def _in_bytes(source: Source, *words: str) -> bool:
    # Texts in .xls are stored with one or with two bytes per letter.
    return any(word.encode(code) in source.data for word in words for code in ("latin-1", "utf-16-le"))


def _sheet_part(
    sheet: Sheet, at: int, found: Mapping[str, int], rows: Sequence[Sequence[str]], **about: Any
) -> Part:
    """Part of a sheet whose names stand in row `at` and whose units in the next one."""
    names, units = sheet.rows[at], [*sheet.rows[at + 1], *[""] * len(sheet.rows[at])]
    return Part(
        [],
        list(zip(names, units, strict=False)),
        rows,
        f"sheet {sheet.name!r:.60}",
        found,
        {"sheet": sheet.name, **about},
    )


# --- NanoSuite


_SCATTER = {
    f"{role}_scatter": Channel(
        channel.kind, tuple(f"standard deviation ({name})" for name in channel.names), needed=False
    )
    for role, channel in _OF_A_TEST.items()
    if role != "time"
}
_NANOSUITE_COLUMNS = {**_OF_A_TEST, **_SCATTER}


def _nanosuite_parts(source: Source) -> Iterator[Part]:
    tests = [
        (sheet, found)
        for sheet in sheets_of(source)
        if {"depth", "force"} <= (found := _places(sheet)).keys()
    ]
    # Where the rows of some are marked, a sheet without marks is one of results.
    marks = any(_is_marked(sheet) for sheet, _ in tests)
    kept = [one for one in tests if not marks or _is_marked(one[0]) or "force_scatter" in one[1]]
    require(kept, source, "has no sheet with columns for displacement and load")
    notes = [
        f"sheet {sheet.name!r:.60} is left out: no test, it has no marks of segments"
        for sheet, found in tests
        if (sheet, found) not in kept
    ]
    # Whoever counts tests counts the single ones first.
    for sheet, found in sorted(kept, key=lambda one: "force_scatter" in one[1]):
        called = f"{source.path.stem}, sheet {sheet.name}"
        called += " (average of tests)" if "force_scatter" in found else ""
        rows = [row for row in sheet.rows[2:] if row and (row[0].lower() != "end" or _is_reading(row, found))]
        yield _sheet_part(sheet, 0, found, padded(rows, {0, *found.values()}), name=called, notes=notes)
        notes = []


def _places(sheet: Sheet) -> dict[str, int]:
    """Columns of a sheet by role; none of one that is no test."""
    names = [cell.lower() for cell in sheet.rows[0]] if len(sheet.rows) > 2 else []
    places = {
        role: next((names.index(name) for name in channel.names if name in names), -1)
        for role, channel in _NANOSUITE_COLUMNS.items()
    }
    return {role: at for role, at in places.items() if at >= 0}


def _is_marked(sheet: Sheet) -> bool:
    return any(row and _MARKER.lower() in row[0].lower() for row in sheet.rows[2:])


def _is_reading(row: Sequence[str], found: Mapping[str, int]) -> bool:
    return all(len(row) > found[role] and is_number(row[found[role]]) for role in ("depth", "force"))


def _made_of_nanosuite(part: Part, columns: Columns) -> dict[str, Any]:
    segment = marked([row[0] for row in part.rows])
    scatter, notes = columns.get("force_scatter"), list(part.about["notes"])
    if scatter is not None and np.isfinite(scatter).any():
        typical = format_quantity(float(np.nanmedian(scatter)), "force")
        notes.append(
            f"an average of several tests, which scatter about it by {typical} in force (median): that is the "
            "noise of one test, kept for every point in curve.columns['force_scatter']"
        )
    return {
        "segment": segment,
        "columns": {
            role: column for role, column in columns.items() if role not in {"depth", "force", "time"}
        },
        "notes": notes,
        "sign_rules": {
            "depth": "displacement into the surface as written",
            "force": "load on the sample as written, positive in compression",
            "segment": "from the marker column" if segment is not None else "from the motion",
        },
    }


NANOSUITE = TextFormat(
    name="nanosuite",
    description="MTS, Agilent and KLA NanoSuite workbooks (.xls)",
    sniff=lambda source: is_xls(source) and _in_bytes(source, _MARKER, "Load On Sample"),
    parts=_nanosuite_parts,
    columns=_NANOSUITE_COLUMNS,
    signs={},
    made=_made_of_nanosuite,
    comma=False,
    extra="afm",
).format


# --- testXpert


def _is_testxpert(source: Source) -> bool:
    if is_xlsx(source):
        text = xlsx_text(source)
        sheets = (_PARAMETER_SHEETS, _RESULT_SHEETS)
        return all(any(f'name="{name}"' in text for name in names) for names in sheets)
    known = is_xls(source) and _in_bytes(source, *_PARAMETER_SHEETS)
    return known and _in_bytes(source, *_RESULT_SHEETS, *_TEST_COLUMNS)


def _testxpert_parts(source: Source) -> Iterator[Part]:
    sheets = [(sheet, at) for sheet in sheets_of(source) if (at := _unit_row(sheet))]
    require(sheets, source, "has no sheet of a specimen: no row of units s, N, mm")
    for sheet, at in sheets:
        found = _specimen_columns(sheet.rows[at - 1], sheet.rows[at])
        rows = padded(sheet.rows[at + 1 :], found.values())
        yield _sheet_part(sheet, at - 1, found, rows, name=f"{source.path.stem}, {sheet.name}")


def _unit_row(sheet: Sheet) -> int:
    """Row of units of a specimen's sheet, else 0."""
    for at, units in enumerate(sheet.rows[1:6], start=1):
        kinds = [kind_of(unit) if unit else None for unit in units]
        if kinds and kinds[0] is not None and "force" in kinds and "length" in kinds:
            return at
    return 0


def _specimen_columns(names: Sequence[str], units: Sequence[str]) -> dict[str, int]:
    """Columns by their names in a language that is known, else the first time, first force, first two lengths."""
    kinds = [kind_of(unit) if unit else None for unit in units]
    by_name: dict[str, int] = {}
    by_order: dict[str, int] = {}
    for role, channel in _SPECIMEN.items():
        of_kind = [at for at, kind in enumerate(kinds) if kind == channel.kind]
        if named := [at for at in of_kind if at < len(names) and names[at].lower() in channel.names]:
            by_name[role] = named[0]
        if free := [at for at in of_kind if at not in by_order.values()]:
            by_order[role] = free[0]
    return by_name if {"force", "depth"} <= by_name.keys() else by_order


def _made_of_testxpert(part: Part, columns: Columns) -> dict[str, Any]:
    """Travel into the sample and the rule of its sign, and the first gap between the tools."""
    del part
    travel, gap = columns["depth"], columns.get("gap")
    rules = {"force": "as written, positive in compression", "segment": "from the motion"}
    if gap is None or not (np.isfinite(gap).all() and np.isfinite(travel).all()):
        return {"sign_rules": {"depth": "travel as written; the file has no gap to check it with", **rules}}
    sign, rule = 1.0, "travel as written; it does not close with the gap between the tools"
    for way, told in (
        (-1.0, "minus the travel as written"),
        (1.0, "travel as written: gap plus travel is constant"),
    ):
        if np.ptp(gap + way * travel) <= _CLOSURE * max(float(np.ptp(travel)), np.finfo(float).tiny):
            sign, rule = way, told
    return {"depth": sign * travel, "initial_gap": float(gap[0]), "sign_rules": {"depth": rule, **rules}}


TESTXPERT = TextFormat(
    name="testxpert",
    description="Zwick/Roell testXpert workbooks (.xlsx, .xls)",
    sniff=_is_testxpert,
    parts=_testxpert_parts,
    columns=_SPECIMEN,
    signs={},
    made=_made_of_testxpert,
    comma=False,
    extra="afm",
).format
