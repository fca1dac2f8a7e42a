"""Results as one Excel file: results, settings, curves, depths and groups, each a sheet."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import pandas as pd

from underlay._files import write_atomic
from underlay._version import VERSION
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.pointwise.modulus import PointwiseModulus
from underlay.inference.population.result import Population
from underlay.report.result_rows import curve_rows, result_rows, setting_rows
from underlay.report.spreadsheet import workbook

__all__ = ["Reported", "excel_bytes", "excel_sheets", "write_excel"]

#: What an Excel file can hold: fits or the table of a map, and what was made of them.
Reported: TypeAlias = Fit | PointwiseModulus | Population | pd.DataFrame

# Points of all curves together: a file of some 10 MB that a spreadsheet opens at once.
_MOST_POINTS = 100_000
# Columns of a map's table that say which curve a row is of.
_WHICH = ("name", "path", "sha256", "x", "y", "status", "verdict", "reason", "decision", "decision_reason")

_VERSION = pd.DataFrame({"setting": ["underlay", "units"], "value": [VERSION, "SI: m, N, Pa, s"]})


def write_excel(
    path: str | os.PathLike[str], *results: Reported, settings: Mapping[str, str] | None = None
) -> Path:
    """Write results as one Excel file, whole or not at all.

    Parameters
    ----------
    path : path
        Ends in ``.xlsx``.
    *results : Fit, DataFrame, PointwiseModulus or Population
        Fits, or the table of `fit_many`; and what was made of them. Sheets: ``results`` (parameters with unit,
        interval, verdict, contact point, range, thickness), ``settings`` (scene, priors, noise, solver, files,
        versions: all that repeats the fit), ``curves`` (points with fit and residual, of more than 100,000 every
        so many; of a map its files), ``depths`` (`pointwise_modulus`), ``groups``, ``ratios`` and ``left out``
        (`population`), as far as there is something for them.
    settings : mapping of str to str, optional
        More rows of the sheet ``settings``, first: what was asked, by whom.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    MissingExtraError
        If the extra ``excel`` is not installed.
    InputError
        If `path` has another ending, or a result is none of these.
    FileAccessError
        If the file cannot be written.
    """
    if Path(path).suffix.lower() != ".xlsx":
        raise InputError(f"an Excel file ends in .xlsx; got {Path(path).name!r}")
    return write_atomic(path, excel_bytes(*results, settings=settings))


def excel_bytes(*results: Reported, settings: Mapping[str, str] | None = None) -> bytes:
    """Return the Excel file of results as bytes; see `write_excel`."""
    return workbook(excel_sheets(*results, settings=settings))


def excel_sheets(*results: Reported, settings: Mapping[str, str] | None = None) -> dict[str, pd.DataFrame]:
    """Return the tables of such a file by the name of their sheet; see `write_excel`.

    Raises
    ------
    InputError
        If there is nothing, or something else, to report.
    """
    fits = [entry for entry in results if isinstance(entry, Fit)]
    maps = [entry for entry in results if isinstance(entry, pd.DataFrame)]
    populations = [entry for entry in results if isinstance(entry, Population)]
    pointwise = [entry for entry in results if isinstance(entry, PointwiseModulus)]
    others = len(results) - len(fits) - len(maps) - len(populations) - len(pointwise)
    if not results or others or len(maps) > 1 or len(populations) > 1 or (maps and fits):
        raise InputError(
            "an Excel file holds fits or one table of a map, and pointwise moduli and one population of them; got "
            f"{', '.join(type(entry).__name__ for entry in results) or 'nothing'}"
        )
    sheets = _of_fits(fits) if fits else {}
    sheets |= _of_map(maps[0]) if maps else {}
    given = pd.DataFrame(list((settings or {}).items()), columns=["setting", "value"])
    sheets["settings"] = pd.concat([given, sheets.get("settings", _VERSION)], ignore_index=True)
    if pointwise:
        sheets["depths"] = pd.concat([_of_depths(found) for found in pointwise], ignore_index=True)
    return sheets | (_of_population(populations[0]) if populations else {})


def _of_fits(fits: Sequence[Fit]) -> dict[str, pd.DataFrame]:
    settings = [setting_rows(fit) for fit in fits]
    if len(fits) > 1:
        for number, rows in enumerate(settings, 1):
            rows.insert(0, "fit", number)
    most = max(1, _MOST_POINTS // len(fits))
    return {
        "results": pd.concat([result_rows(fit) for fit in fits], ignore_index=True),
        "settings": pd.concat(settings, ignore_index=True),
        "curves": pd.concat([curve_rows(fit, most) for fit in fits], ignore_index=True),
    }


def _of_map(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    if not {"name", "status", "verdict"} <= set(table.columns):
        raise InputError("this is no table of a map: it lacks name, status or verdict")
    which = [name for name in _WHICH if name in table.columns]
    return {
        "results": table,
        "settings": _VERSION,
        "curves": table[which],
    }


def _of_depths(found: PointwiseModulus) -> pd.DataFrame:
    units = {"depth": "depth (m)", "force": "force (N)", "points": "points"}
    table = found.table.rename(columns=lambda name: units.get(name, f"{name} (Pa)"))
    table.insert(0, "curve", found.name)
    return table


def _of_population(result: Population) -> dict[str, pd.DataFrame]:
    groups = result.table()
    groups.insert(0, "group", groups.index.to_list())
    groups.insert(1, "parameter", result.parameter)
    sheets = {"groups": groups}
    if result.comparisons:
        sheets["ratios"] = result.ratios()
    if result.left_out:
        sheets["left out"] = pd.DataFrame(list(result.left_out))
    return sheets
