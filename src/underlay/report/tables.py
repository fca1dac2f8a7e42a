"""Tables of results, in units for people."""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from underlay._text import one_line
from underlay.errors import FileAccessError
from underlay.inference.least_squares.provenance import version_record
from underlay.report.intervals import estimates
from underlay.report.labels import label
from underlay.report.open_ends import rival_name
from underlay.report.words import quantity_with_interval, strong_pairs
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.identifiability import Identifiability
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.profiles import LikelihoodProfile
    from underlay.inference.sampling.posterior import Posterior

__all__ = [
    "combinations_table",
    "correlated_pairs",
    "diagnostics_table",
    "facts_table",
    "file_hash",
    "fit_table",
    "interval_table",
    "labelled_table",
    "provenance_table",
    "reservations_table",
    "source_rows",
]

_MEGABYTE = 1 << 20


def fit_table(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter, as numbers.

    Returns
    -------
    pandas.DataFrame
        ``parameter``, ``value``, ``standard error``, ``unit``, ``relative`` (per cent) and ``at bound``.
    """
    rows = []
    for name, value in result.values.items():
        path = name.partition("[")[0]
        unit, factor = human_unit(value, kind_of(path))
        error = result.stderr[name]
        rows.append(
            {
                "parameter": name,
                "value": value / factor,
                "standard error": error / factor,
                "unit": unit,
                "relative (%)": 100.0 * abs(error / value) if value else np.nan,
                "at bound": result.bounds_hit.get(name, ""),
            }
        )
    return pd.DataFrame(rows)


def correlated_pairs(result: Fit) -> pd.DataFrame:
    """Return the pairs of parameters whose correlation is above 0.9 in size, strongest first."""
    rows = [
        {"parameters": f"{first} and {second}", "correlation": value}
        for first, second, value in strong_pairs(result)
    ]
    return pd.DataFrame(rows, columns=["parameters", "correlation"])


def interval_table(result: Fit, profiles: Mapping[str, LikelihoodProfile] | None = None) -> pd.DataFrame:
    """Return one row per fitted parameter, as text: what it is, its value and 95 % interval, its prior.

    Intervals are those of `profiles`, by name of the parameter, where there are some. Another optimum the data
    hardly reject has a column of its own.
    """
    rows = []
    for entry in estimates(result, profiles):
        kind = kind_of(entry.path)
        others = {
            f"{rival_name(place)} optimum": format_quantity(other.values[entry.name], kind)
            for place, other in enumerate(result.alternatives)
        }
        rows.append(
            {
                "parameter": label(entry.name),
                "value (95 % interval)": (
                    f"{format_quantity(entry.value, kind)}, not fixed"
                    if entry.not_fixed
                    else quantity_with_interval(entry.value, entry.low, entry.high, kind)
                ),
                **others,
                "standard error": _error_text(result, entry.name, entry.value, kind),
                "before the test": _prior_text(result, entry.name, kind),
                "path": entry.name,
            }
        )
    return labelled_table(rows)


def _error_text(result: Fit, name: str, value: float, kind: str) -> str:
    """In per cent of a quantity that is positive by nature; an offset near zero has no meaningful per cent."""
    error = result.stderr[name]
    if not math.isfinite(error):
        return "none"
    coordinate = next(entry for entry in result.problem.coordinates if entry.name == name)
    if coordinate.scale is None:
        return f"{100.0 * error / value:.2g} %"
    unit, factor = human_unit(error, kind)
    return f"{error / factor:.2g} {unit}".rstrip()


def _prior_text(result: Fit, name: str, kind: str) -> str:
    prior = result.problem.priors[name]
    low, high = prior.support
    bounds = [
        f"{word} {format_quantity(end, kind)}"
        for word, end in (("from", low), ("up to", high))
        if math.isfinite(end)
    ]
    shape = type(prior).__name__ if prior.informative else ""
    return ", ".join(part for part in (shape, " ".join(bounds)) if part) or "free"


def diagnostics_table(result: Fit) -> pd.DataFrame:
    """Return how well and how the fit was reached, and what the residuals look like, as text."""
    s = result.statistics
    which_law = "contact law" if len(result.curves) == 1 else "contact law, of the curve where it errs most"
    rows = {
        "points, parameters": f"{s.points}, {s.parameters}",
        "noise": "; ".join(_noise_text(noise) for noise in result.noises)
        + (" (estimated from the scatter)" if s.noise_estimated else " (given or fitted)"),
        "chi-square": f"{s.chi_square:.6g} (reduced {s.reduced_chi_square:.4g})",
        "AIC, BIC": f"{s.aic:.6g}, {s.bic:.6g}",
        which_law: f"{s.law_method}: {s.law_reason}",
        "its estimated error": f"{s.law_error:.1e} of the force",
        "minimiser": f"{s.method}: {s.stopped}",
        "effort": f"{s.evaluations} evaluations, {s.laws_built} contact laws, {1e3 * s.seconds:.0f} ms",
    }
    for number, d in enumerate(result.diagnostics):
        which = f" of curve {number + 1}" if len(result.diagnostics) > 1 else ""
        rows[f"residuals{which}"] = (
            f"rms {format_quantity(d.rms, 'force')}, lag-one correlation {d.lag_one:+.2f}, "
            f"{d.runs} runs where {d.expected_runs:.0f} are expected"
        )
        rows[f"independent points{which}"] = f"{d.effective_points:.0f} of {d.points}"
    return facts_table(rows)


def _noise_text(noise: Any) -> str:
    parts = [f"{format_quantity(noise.force, 'force')} on the force"] if noise.force else []
    if noise.relative:
        parts.append(f"{100.0 * noise.relative:.3g} % of the force")
    if noise.correlation_time:
        parts.append(f"correlated over {format_quantity(noise.correlation_time, 'time')}")
    if noise.depth:
        parts.append(f"{format_quantity(noise.depth, 'length')} on the depth")
    return ", ".join(parts) or "none"


def reservations_table(result: Fit) -> pd.DataFrame:
    """Return what to beware of, one row each: what the reader of the file said, then the fit."""
    rows = [
        {"from": "reading the file", "reservation": str(note)}
        for curve in result.curves
        for note in curve.metadata.get("notes", ())
    ]
    rows += [{"from": "the fit", "reservation": warning.message} for warning in result.warnings]
    return labelled_table(rows or [{"from": "the fit", "reservation": "none"}])


def provenance_table(result: Fit | Posterior, facts: Mapping[str, str], *files: str) -> pd.DataFrame:
    """Return what the result came from: the given facts, hashes of files, versions, as text.

    Parameters
    ----------
    result : Fit or Posterior
        Its own record is part of the table.
    facts : mapping of str to str
        What the caller knows, e.g. the command that repeats it.
    *files : path
        Files whose SHA-256 is listed.

    Raises
    ------
    FileAccessError
        If one of the files cannot be read.
    """
    rows = {f"file {name}": f"SHA-256 {file_hash(name)}" for name in files}
    record = result.provenance
    for number, curve in enumerate(record["curves"]):
        which = f" {number + 1}" if len(record["curves"]) > 1 else ""
        rows[f"points used{which}"] = f"{curve['points']}, SHA-256 {curve['data_sha256']}"
    versions = record["versions"] | {
        "python": platform.python_version(),
        "system": platform.platform(terse=True),
    }
    rows["versions"] = ", ".join(f"{name} {version}" for name, version in versions.items())
    return facts_table({**rows, **facts})


def file_hash(path: str | Path) -> str:
    """SHA-256 of a file, read in pieces.

    Raises
    ------
    FileAccessError
        If it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with Path(path).open("rb") as file:
            while piece := file.read(_MEGABYTE):
                digest.update(piece)
    except OSError as error:
        raise FileAccessError(f"cannot read {path}: {error.strerror or error}") from error
    return digest.hexdigest()


def combinations_table(told: Identifiability) -> pd.DataFrame:
    """Return which products of parameters the data fix, best first, as text."""
    rows = [
        {
            "product": entry.formula,
            "verdict": entry.verdict,
            "relative error": f"{100.0 * entry.relative_sd:.2g} %",
        }
        for entry in told.combinations
    ]
    return labelled_table(rows or [{"product": "none", "verdict": "", "relative error": ""}])


def source_rows(files: Iterable[str]) -> dict[str, str]:
    """Return rows for `facts_table`: hashes of files, and versions of what computed."""
    rows = {f"file {name}": f"SHA-256 {file_hash(name)}" for name in files}
    own = {"python": platform.python_version(), "system": platform.platform(terse=True)}
    versions = version_record(("underlay", "numpy", "scipy", "pandas")) | own
    return rows | {"versions": ", ".join(f"{name} {version}" for name, version in versions.items())}


def labelled_table(rows: list[dict[str, str]]) -> pd.DataFrame:
    """Make a table whose first column labels the rows; what came from a file is one printable line in it."""
    frame = pd.DataFrame([{name: one_line(text) for name, text in row.items()} for row in rows])
    # The first column's name goes beside the others': pandas would give the index a header row of its own.
    return frame.set_index(frame.columns[0]).rename_axis(index=None, columns=frame.columns[0])


def facts_table(rows: Mapping[str, str]) -> pd.DataFrame:
    """Make a table of one value per row."""
    return labelled_table([{"": name, "value": text} for name, text in rows.items()])
