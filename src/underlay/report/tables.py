"""Tables of results, in units for people."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay._door import sha256_of
from underlay._text import one_line
from underlay.inference.least_squares.provenance import version_record
from underlay.inference.recipe import Step
from underlay.quantities import numbers_of
from underlay.report.amounts import amounts
from underlay.report.interval_words import quantity_with_interval, wide_interval
from underlay.report.intervals import Estimate, doubts_of_curves, estimates, standing
from underlay.report.labels import label
from underlay.report.open_ends import rival_name
from underlay.report.words import strong_pairs
from underlay.scene.noise_model import NoiseModel
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity, human_unit, printed

if TYPE_CHECKING:
    from underlay.inference.design.identifiability import Identifiability
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.sampling.posterior import Posterior

__all__ = [
    "combinations_table",
    "correlated_pairs",
    "diagnostics_table",
    "facts_table",
    "fit_table",
    "interval_table",
    "labelled_table",
    "provenance_table",
    "reservations_table",
    "source_rows",
    "steps_table",
]


def fit_table(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter, as numbers.

    Returns
    -------
    pandas.DataFrame
        ``parameter``, ``value``, its 95 % interval ``low`` to ``high`` (infinite where open), ``unit``, half of
        the interval in per cent of the value, ``interval`` (its kind, as in `StatedInterval`), ``at bound``, and
        ``wide low`` to ``wide high``, the interval with what the law leaves out and an unknown bond, where that is
        more for any parameter.
        Where the file of the curve says what the instrument found: ``instrument's own``, in the same unit and
        for the same Poisson's ratio, and ``least squares differs``, how far the least-squares value is from it
        (per cent).
    """
    told = result.instrument_moduli
    rows = []
    widens = any(entry.left_out for entry in estimates(result))
    for name in (*result.names, *result.derived):
        known, wide = result.interval(name), result.interval(name, model_error=True)
        unit, factor = human_unit(known.value, kind_of(name))
        half = 0.5 * (known.high - known.low)
        rows.append(
            {
                "parameter": name,
                "value": known.value / factor,
                "low": known.low / factor,
                "high": known.high / factor,
                "unit": unit,
                "half width (%)": 100.0 * abs(half / known.value) if known.value else np.nan,
                "interval": known.kind,
                "at bound": result.bounds_hit.get(name, ""),
            }
        )
        if widens:
            rows[-1] |= {"wide low": wide.low / factor, "wide high": wide.high / factor}
        if told:
            own = told.get(name)
            rows[-1]["instrument's own"] = own.youngs / factor if own else np.nan
            rows[-1]["least squares differs (%)"] = 100.0 * own.difference if own else np.nan
    return pd.DataFrame(rows)


def correlated_pairs(result: Fit) -> pd.DataFrame:
    """Return the pairs of parameters whose correlation is above 0.9 in size, strongest first."""
    rows = [
        {"parameters": f"{first} and {second}", "correlation": value}
        for first, second, value in strong_pairs(result)
    ]
    return pd.DataFrame(rows, columns=["parameters", "correlation"])


def interval_table(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter, as text: what it is, its value and 95 % interval, its prior.

    Another optimum the data hardly reject has a column of its own, and so has the interval with what the law
    leaves out where that is more.
    """
    told = result.instrument_moduli
    rows = []
    entries = estimates(result)
    widens = any(entry.left_out for entry in entries)
    for entry in entries:
        kind = kind_of(entry.path)
        others = {
            f"{rival_name(place)} optimum": (
                format_quantity(other.values[entry.name], kind) if entry.name in other.values else ""
            )
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
                **({"with what is unknown": _wide_text(entry, kind)} if widens else {}),
                **others,
                **(
                    {"instrument's own (ours against it)": _instrument_text(result, entry.name)}
                    if told
                    else {}
                ),
                "interval": entry.kind,
                "before the test": _prior_text(result, entry.name, kind),
            }
        )
    return labelled_table(rows)


def _wide_text(entry: Estimate, kind: str) -> str:
    """The interval with what the law leaves out and an unknown bond; empty where it is no more."""
    if not entry.left_out:
        return ""
    return wide_interval(entry, kind) or "anything"


def steps_table(steps: Sequence[Step]) -> pd.DataFrame:
    """Return one row per step from an instrument's number to ours, as text: what was changed, and by how much."""
    rows = []
    for before, step in zip([None, *steps], steps, strict=False):
        change = "" if before is None else f"{100.0 * (step.modulus / before.modulus - 1.0):+.2f} %"
        value = format_quantity(step.modulus, "pressure")
        rows.append({"step": step.what, "Young's modulus": value, "change": change})
    return labelled_table(rows)


def _instrument_text(result: Fit, name: str) -> str:
    own = result.instrument_moduli.get(name)
    if own is None:
        return ""
    return (
        f"{format_quantity(own.youngs, 'pressure')} at nu = {own.nu:g} (reduced: "
        f"{format_quantity(own.reduced, 'pressure')}; {100.0 * own.difference:+.2g} %)"
    )


def _prior_text(result: Fit, name: str, kind: str) -> str:
    if name in result.derived:
        return "follows from the others"
    prior = result.problem.priors[name]
    low, high = prior.support
    bounds = [
        f"{word} {amounts([end], kind)[0]}"
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
        "verdict": str(result.verdict),
        "points, parameters": f"{s.points}, {s.parameters}",
        "noise": "; ".join(_noise_text(noise) for noise in result.noises)
        + (" (estimated from the scatter)" if s.noise_estimated else " (given or fitted)"),
        # Where the noise is estimated from the scatter both are n - k and 1 by construction.
        **(
            {}
            if s.noise_estimated
            else {"chi-square": f"{s.chi_square:.6g} (reduced {s.reduced_chi_square:.4g})"}
        ),
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


def _noise_text(noise: NoiseModel) -> str:
    """Every number of a noise model that is not zero, by its declared name."""
    numbers = numbers_of(noise, "noise")
    parts = [
        f"{label(path)} {format_quantity(number.value, number.quantity.kind)}"
        for path, number in numbers.items()
        if number.value
    ]
    return ", ".join(parts) or "none"


def reservations_table(result: Fit) -> pd.DataFrame:
    """Return what to beware of, one row each: what the reader of the file said, then the curves, then the fit."""
    rows = [
        {"from": "reading the file", "reservation": str(note)}
        for curve in result.curves
        for note in curve.metadata.get("notes", ())
    ]
    rows += [{"from": "the curve", "reservation": reason} for reason in doubts_of_curves(result)]
    rows += [{"from": "the fit", "reservation": warning.message} for warning in standing(result)]
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
    rows = {f"file {name}": f"SHA-256 {sha256_of(name)}" for name in files}
    record = result.provenance
    for number, curve in enumerate(record["curves"]):
        which = f" {number + 1}" if len(record["curves"]) > 1 else ""
        if curve.get("recorded"):
            rows[f"recorded{which}"] = one_line(curve["recorded"])
        rows[f"points used{which}"] = f"{curve['points']}, SHA-256 {curve['data_sha256']}"
    versions = record["versions"] | {
        "python": platform.python_version(),
        "system": platform.platform(terse=True),
    }
    rows["versions"] = ", ".join(f"{name} {version}" for name, version in versions.items())
    return facts_table({**rows, **facts})


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
    rows = {f"file {name}": f"SHA-256 {sha256_of(name)}" for name in files}
    own = {"python": platform.python_version(), "system": platform.platform(terse=True)}
    versions = version_record(("underlay", "numpy", "scipy", "pandas")) | own
    return rows | {"versions": ", ".join(f"{name} {version}" for name, version in versions.items())}


def labelled_table(rows: list[dict[str, str]]) -> pd.DataFrame:
    """Make a table whose first column labels the rows; what came from a file is one printable line in it."""
    frame = pd.DataFrame([{name: printed(one_line(text)) for name, text in row.items()} for row in rows])
    # The first column's name goes beside the others': pandas would give the index a header row of its own.
    return frame.set_index(frame.columns[0]).rename_axis(index=None, columns=frame.columns[0])


def facts_table(rows: Mapping[str, str]) -> pd.DataFrame:
    """Make a table of one value per row."""
    return labelled_table([{"": name, "value": text} for name, text in rows.items()])
