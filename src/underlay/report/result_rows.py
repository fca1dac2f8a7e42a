"""A fit as rows of numbers that can be repeated: what goes into CSV files and spreadsheets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from underlay._text import one_line
from underlay.mechanics.solver import Solver
from underlay.quantities import curve_of, numbers_of, path_of
from underlay.report.tables import fit_table
from underlay.scene.noise_model import NoiseModel
from underlay.scene.scene_writer import scene_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["curve_rows", "result_rows", "setting_rows"]

_CONTACT = "instrument.contact_depth"


def result_rows(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter with all that says what it is of and how it was found.

    Returns
    -------
    pandas.DataFrame
        The columns of `fit_table`; then ``verdict`` and ``reasons``; of the curve, where the parameter is one
        curve's: ``curve``, ``contact point (m)`` with its interval, ``fitted from (m)`` and ``fitted to (m)``
        (depth readings), ``points``, ``thickness (m)``, ``indenter``, ``radius (m)``, ``Poisson's ratio``; and
        ``solver``, ``file``, its ``SHA-256``, ``underlay`` (version). A parameter that several curves share has
        those of the curves that all have in common.
    """
    table = fit_table(result)
    told = [_about(result, number) for number in range(len(result.curves))]
    rows = []
    for name in table["parameter"]:
        curve = curve_of(name)
        rows.append(told[curve] if curve is not None else _common(told))
    about = pd.DataFrame(rows, index=table.index)
    about.insert(0, "verdict", result.verdict.word)
    about.insert(1, "reasons", one_line("; ".join(result.verdict.reasons)))
    return pd.concat([table, about], axis=1)


def _about(result: Fit, number: int) -> dict[str, Any]:
    """Everything that a row says of one curve."""
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
        "solver": result.solver.label,
        "file": one_line(record["path"] or ""),
        "SHA-256": record["file_sha256"] or record["data_sha256"],
        "underlay": result.provenance["versions"]["underlay"],
    }


def _common(told: list[dict[str, Any]]) -> dict[str, Any]:
    """What all curves have in common; empty where they differ."""
    return {
        key: value if all(_same(value, other[key]) for other in told) else None
        for key, value in told[0].items()
    }


def _same(first: Any, second: Any) -> bool:
    both_none = isinstance(first, float) and isinstance(second, float) and math.isnan(first + second)
    return bool(first == second) or both_none


def setting_rows(result: Fit) -> pd.DataFrame:
    """Return all that repeats a fit, one setting a row: scenes as text, priors, noise, solver, files, versions."""
    problem, record = result.problem, result.provenance
    rows: list[tuple[str, str]] = [("solver", _solver(result.solver))]
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


def _solver(solver: Solver) -> str:
    return f"{solver.label}: {solver!r}"


def _noise(given: Any) -> str:
    """The noise as it was stated; one per curve if several were."""
    if given is None:
        return "not stated: intervals are averaged over what the residuals may be"
    if isinstance(given, NoiseModel):
        stated = [f"{path} = {number.value:.17g}" for path, number in numbers_of(given, "noise").items()]
        return ", ".join(stated) or repr(given)
    return "; ".join(_noise(entry) for entry in given)


def _of_curve(curve: Curve, record: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for name in ("name", "path", "scene_path", "recorded", "file_sha256", "data_sha256", "points"):
        if record.get(name):
            yield name, str(record[name])
    for name in ("format", "test", "fit_range"):
        if curve.metadata.get(name):
            yield name, str(curve.metadata[name])
    if curve.segment is not None:
        yield "segments", ", ".join(sorted(set(curve.segment.tolist())))


def curve_rows(result: Fit, most: int) -> pd.DataFrame:
    """Return the points of every curve with what the fit makes of them (SI), at most about `most` rows in all."""
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
