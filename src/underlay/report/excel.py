"""Results as one Excel file: results, settings, curves, depths and groups, each a sheet.

The sheets hold numbers, and everything that is needed to repeat a fit. Cells are written by the type of their
value, and no text is interpreted: nothing that came from another file can become a formula or a link.
"""

from __future__ import annotations

import importlib.util
import io
import math
import os
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pandas as pd

from underlay._files import require_writable_folder, write_atomic
from underlay._text import one_line
from underlay._version import VERSION
from underlay.errors import InputError, missing_extra
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.population.result import Population
from underlay.inference.uncertainty.answer import PointwiseModulus
from underlay.quantities import curve_of, numbers_of, path_of
from underlay.report.tables import fit_table
from underlay.scene.noise import NoiseModel
from underlay.scene.scene_writer import scene_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from underlay.data.curve import Curve

#: Rows of a sheet under its header, as the format allows; and letters of a cell.
MOST_ROWS, _LONGEST = 1_048_575, 32_767
# Pixels of the widest column.
_WIDEST = 425
_CONTACT = "instrument.contact_depth"
#: What an Excel file can hold: fits or the table of a map, and what was made of them.
_Reported: TypeAlias = Fit | PointwiseModulus | Population | pd.DataFrame
# Points of all curves together: a file of some 10 MB that a spreadsheet opens at once.
_MOST_POINTS = 100_000
# Columns of a map's table that say which curve a row is of.
_WHICH = ("name", "path", "sha256", "x", "y", "status", "verdict", "reason", "decision", "decision_reason")
_VERSION = pd.DataFrame({"setting": ["underlay", "units"], "value": [VERSION, "SI: m, N, Pa, s"]})


def excel_path(path: str | os.PathLike[str]) -> Path:
    """Return `path`, checked to be one that an Excel file can be written to.

    Raises
    ------
    InputError
        If it does not end in ``.xlsx``.
    MissingExtraError
        If the extra ``excel`` is not installed.
    FileAccessError
        If its folder cannot be written.
    """
    if Path(path).suffix.lower() != ".xlsx":
        raise InputError(f"an Excel file ends in .xlsx; got {Path(path).name!r}")
    _require_library()
    require_writable_folder(Path(path).absolute().parent)
    return Path(path)


def _require_library() -> None:
    if importlib.util.find_spec("xlsxwriter") is None:
        raise missing_extra("an Excel file needs xlsxwriter", "excel")


def workbook(sheets: Mapping[str, pd.DataFrame]) -> bytes:
    """Return the bytes of an Excel file with one sheet per table, in order.

    Numbers are written as numbers and text as text; an infinite end of an interval becomes the word ``open``, and a
    missing value an empty cell.

    Raises
    ------
    MissingExtraError
        If the extra ``excel`` is not installed.
    InputError
        If a table has more rows than a sheet can hold.
    """
    _require_library()
    for name, table in sheets.items():
        if len(table) > MOST_ROWS:
            raise InputError(
                f"a sheet of Excel holds {MOST_ROWS} rows; {name!r} has {len(table)}: write CSV instead"
            )
    stream = io.BytesIO()
    with pd.ExcelWriter(stream, engine="xlsxwriter", engine_kwargs={"options": {"in_memory": True}}) as book:
        for name, table in sheets.items():
            cells = table.rename(columns=_cell).astype(object).map(_cell)
            # Text stays text, whatever it begins with: up to 3.3.0 xlsxwriter's own options let {=A1} through.
            book.book.add_worksheet(name).add_write_handler(str, _as_text)
            cells.to_excel(book, sheet_name=name, index=False, freeze_panes=(1, 0))
            book.sheets[name].autofit(_WIDEST)
    return stream.getvalue()


def _as_text(sheet: Any, *cell: Any) -> Any:
    """Write a cell of text, given as (row, column, text, format), as text: never as a formula or a link.

    None for an empty text, which is a missing value: the writer then leaves the cell empty.
    """
    return sheet.write_string(*cell) if cell[2] else None


def _cell(value: Any) -> Any:
    """Return a value as its cell: a number, a text of one line, ``open`` for infinity, None for what is missing."""
    if isinstance(value, float) and math.isinf(value):
        return "open"
    if isinstance(value, Real) or pd.isna(value):
        return value
    return one_line(value, _LONGEST)


def result_rows(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter: its value, the curve it belongs to, and how it was fitted.

    Returns
    -------
    pandas.DataFrame
        The columns of `fit_table`; then ``verdict``, ``reasons`` and ``cause``; of the curve: ``curve``, ``contact
        point (m)`` with its interval, ``fitted from (m)`` and ``fitted to (m)`` (depth readings), ``points``,
        ``thickness (m)``, ``indenter``, ``radius (m)``, ``Poisson's ratio``, ``assumed`` (paths of inputs that
        are usual values, not measured); and ``solver``, ``file``, its ``SHA-256``, ``underlay`` (version). For a
        parameter that several curves share, a column is empty where the curves differ.
    """
    table = fit_table(result)
    told = pd.DataFrame([_about(result, number) for number in range(len(result.curves))], dtype=object)
    common = told.iloc[0].where(told.eq(told.iloc[0]).all() | told.isna().all(), None)
    curves = map(curve_of, table["parameter"])
    about = pd.DataFrame([common if curve is None else told.loc[curve] for curve in curves])
    about = about.set_axis(table.index).infer_objects()
    about.insert(0, "verdict", result.verdict.word)
    about.insert(1, "reasons", one_line("; ".join(result.verdict.reasons)))
    about.insert(2, "cause", one_line(result.verdict.cause))
    return pd.concat([table, about], axis=1)


def _about(result: Fit, number: int) -> dict[str, Any]:
    """Return the columns of `result_rows` that describe one curve (counted from 0), by name, in SI units."""
    curve, scene = result.curves[number], result.scenes[number]
    record = result.provenance["curves"][number]
    own = _CONTACT if len(result.curves) == 1 or _CONTACT in result.names else f"{_CONTACT}[{number}]"
    contact = scene.instrument.contact_depth
    ends = (math.nan, math.nan)
    if own in result.names:
        known = result.interval(own)
        contact, ends = known.value, (known.low, known.high)
    numbers = dict(scene.parameters)
    for name in result.names:
        if curve_of(name) in (None, number):
            numbers[path_of(name)] = result.interval(name).value
    return {
        "curve": one_line(record["name"] or f"curve {number + 1}"),
        "contact point (m)": contact,
        "contact point low (m)": ends[0],
        "contact point high (m)": ends[1],
        "fitted from (m)": float(curve.depth.min()),
        "fitted to (m)": float(curve.depth.max()),
        "points": len(curve),
        "thickness (m)": numbers.get("layer.thickness", math.inf),
        "indenter": scene.indenter.shape,
        "radius (m)": numbers.get("indenter.radius", math.nan),
        "Poisson's ratio": numbers.get("layer.nu", math.nan),
        "assumed": ", ".join(record["assumed"]),
        "solver": result.solver.label,
        "file": one_line(record["path"] or ""),
        "SHA-256": record["file_sha256"] or record["data_sha256"],
        "underlay": result.provenance["versions"]["underlay"],
    }


def _setting_rows(result: Fit) -> pd.DataFrame:
    """Return all settings that repeat a fit, a row each (``setting``, ``value``).

    They are the scenes as text, priors, noise, solver, files and versions.
    """
    problem, record = result.problem, result.provenance
    rows: list[tuple[str, str]] = [("solver", f"{result.solver.label}: {result.solver!r}")]
    rows += [(f"free: {name}", repr(prior)) for name, prior in problem.priors.items()]
    rows += [("shared by all curves", ", ".join(problem.shared))] if problem.shared else []
    rows.append(("noise", _noise(problem.noise)))
    for number, curve in enumerate(result.curves):
        which = f" {number + 1}" if len(result.curves) > 1 else ""
        rows += [(f"curve{which}: {name}", text) for name, text in _of_curve(curve, record["curves"][number])]
        text = scene_text(problem.base_scenes[number])
        rows += [
            (f"scene file{which}, line {n}", line) for n, line in enumerate(text.splitlines(), 1) if line
        ]
    rows += [(f"version of {name}", version) for name, version in record["versions"].items()]
    return pd.DataFrame([(name, one_line(text)) for name, text in rows], columns=["setting", "value"])


def _noise(given: Any) -> str:
    """Write the noise as the user stated it, for each curve where several were stated; `given` may be None."""
    if given is None:
        return "not stated: what the residuals show is allowed for"
    if isinstance(given, NoiseModel):
        stated = [f"{path} = {number.value:.17g}" for path, number in numbers_of(given, "noise").items()]
        return ", ".join(stated) or repr(given)
    return "; ".join(_noise(entry) for entry in given)


def _of_curve(curve: Curve, record: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for name in ("name", "path", "scene_path", "recorded", "file_sha256", "data_sha256", "points"):
        if record.get(name):
            yield name, str(record[name])
    if record["assumed"]:
        yield "assumed, not measured", ", ".join(record["assumed"])
    for name in ("format", "test", "fit_range"):
        if curve.metadata.get(name):
            yield name, str(curve.metadata[name])
    if curve.segment is not None:
        yield "segments", ", ".join(sorted(set(curve.segment.tolist())))


def _curve_rows(result: Fit, most: int) -> pd.DataFrame:
    """Return the points of every curve with fit, residual and noise (SI); thinned to about `most` rows in all."""
    step = max(1, -(-sum(len(curve) for curve in result.curves) // most))
    parts = []
    for number, (curve, residual, sigma) in enumerate(
        zip(result.curves, result.residuals, result.sigmas, strict=True)
    ):
        columns = {
            "curve": one_line(curve.metadata.get("name") or f"curve {number + 1}"),
            "time (s)": np.full(len(curve), np.nan) if curve.time is None else curve.time,
            "depth (m)": curve.depth,
            "force (N)": curve.force,
            "fit (N)": curve.force - residual,
            "residual (N)": residual,
            "noise (N)": sigma,
            "segment": "" if curve.segment is None else curve.segment,
        }
        parts.append(pd.DataFrame(columns).iloc[::step])
    return pd.concat(parts, ignore_index=True)


def write_excel(
    path: str | os.PathLike[str], *results: _Reported, settings: Mapping[str, str] | None = None
) -> Path:
    """Write results as one Excel file, whole or not at all.

    Parameters
    ----------
    path : path
        Ends in ``.xlsx``.
    *results : Fit, DataFrame, PointwiseModulus or Population
        Fits, or one table of `fit_many`; with them moduli at each depth and one population. Sheets, as far as there
        is something for them: ``results`` (parameters with unit, interval, verdict, contact point, range,
        thickness), ``settings`` (scene, priors, noise, solver, files, versions: all that repeats the fit),
        ``curves`` (points with fit and residual, thinned above 100,000; for a map its files), ``depths``
        (`pointwise_modulus`), ``groups``, ``ratios`` and ``left out`` (`population`).
    settings : mapping of str to str, optional
        Further rows, name and value, to write first in the sheet ``settings``.

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
    return write_atomic(excel_path(path), excel_bytes(*results, settings=settings))


def excel_bytes(*results: _Reported, settings: Mapping[str, str] | None = None) -> bytes:
    """Return the Excel file of results as bytes; see `write_excel`."""
    return workbook(excel_sheets(*results, settings=settings))


def excel_sheets(*results: _Reported, settings: Mapping[str, str] | None = None) -> dict[str, pd.DataFrame]:
    """Return the tables that `write_excel` writes, by the name of their sheet.

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
    settings = [_setting_rows(fit) for fit in fits]
    if len(fits) > 1:
        for number, rows in enumerate(settings, 1):
            rows.insert(0, "fit", number)
    most = max(1, _MOST_POINTS // len(fits))
    return {
        "results": pd.concat([result_rows(fit) for fit in fits], ignore_index=True),
        "settings": pd.concat(settings, ignore_index=True),
        "curves": pd.concat([_curve_rows(fit, most) for fit in fits], ignore_index=True),
    }


def _of_map(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    if not {"name", "status", "verdict"} <= set(table.columns):
        raise InputError("this is no table of a map: it lacks name, status or verdict")
    which = [name for name in _WHICH if name in table.columns]
    return {"results": table, "settings": _VERSION, "curves": table[which]}


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
