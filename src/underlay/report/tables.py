"""Tables of a result for people: every number in a unit that suits its size.

Numbers side by side share units where that helps to compare them: zero takes the unit of the largest number beside
it (`amounts`). `reading_table` says how a file was read, and `beyond_loading` finds the whole measurement, of which
often the loading alone is fitted. `accuracy_summary` and `answer_summary` are tables of the accuracy and cost of
solution methods, one row per method, with times relative to that of a simple known one.
"""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from underlay._door import sha256_of
from underlay._text import one_line
from underlay.data.readers import all_formats, read_all
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.data.signs import flipped
from underlay.inference.from_files import whole_curve
from underlay.inference.recipe import Step
from underlay.inference.sampling.derived import DERIVED
from underlay.quantities import numbers_of, path_of
from underlay.report.labels import label, labelled
from underlay.report.limits import quality_doubts, rival_name
from underlay.report.screen import answer_text
from underlay.scene.noise import NoiseModel
from underlay.scene.parameters import declared, kind_of
from underlay.units import format_quantity, human_unit, printed

if TYPE_CHECKING:
    from pathlib import Path

    from underlay._arrays import FloatArray
    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit

# Below this share of the largest it is what rounding leaves of zero.
_NOTHING = 1e-9
# Columns of tables of parameters that hold no value of the parameter.
_BARE = frozenset({"ess", "rhat", "narrowing", "distance", "curves", "points", "units"})
_SUFFIXES = (".stderr", ".low", ".high", ".expected", ".instrument")
# Correlation above which two parameters are known together only; standard error of a logarithm that is badly known.
_STRONG, _BADLY = 0.9, 0.05


def amounts(values: Sequence[float], kind: str) -> list[str]:
    """Return SI values of one kind of quantity as text, each in a unit of its size; zeros in that of the largest.

    Examples
    --------
    >>> amounts([0.0, 3e-6], "length"), amounts([-5e-22, 3e-6], "length"), amounts([0.0], "stiffness")
    (['0 um', '3 um'], ['0 um', '3 um'], ['0'])
    """
    largest = max(map(abs, values), default=0.0)
    unit = human_unit(largest, kind)[0] if largest else ""
    zero = f"0 {unit}".strip()
    return [format_quantity(value, kind) if abs(value) > _NOTHING * largest else zero for value in values]


def span(low: float, high: float, kind: str) -> str:
    """Write two SI values in one unit, small enough that the larger is one or more: ``"-15.8 to 124 um"``."""
    unit, factor = human_unit(0.1 * max(abs(low), abs(high)), kind)
    return f"{low / factor + 0.0:.4g} to {high / factor + 0.0:.4g} {unit}".rstrip()


def with_units(table: pd.DataFrame) -> pd.DataFrame:
    """Return a copy of a table of SI numbers as text with units, for reading.

    Parameters
    ----------
    table : pandas.DataFrame
        With a row per parameter, such as ``posterior.summary()``, or a column per parameter, such as what
        `fit_many` returns. Other numbers are written with four digits, other values as they are.

    Examples
    --------
    >>> table = pd.DataFrame({"median": [637052.3, 1.3512e-3], "rhat": [1.0004, 1.0]})
    >>> table.index = ["layer.E", "layer.thickness"]
    >>> with_units(table)["median"].to_list(), with_units(table)["rhat"].to_list()
    (['0.6371 MPa', '1.351 mm'], ['1', '1'])
    """
    by_row = all(_kind(str(name)) is not None for name in table.index) and len(table) > 0
    cells = {
        column: [
            _cell(value, _kind(str(name)) if by_row and str(column) not in _BARE else _kind(str(column)))
            for name, value in zip(table.index, table[column], strict=True)
        ]
        for column in table.columns
    }
    return pd.DataFrame(cells, index=table.index)


def _kind(name: str) -> str | None:
    """Return the kind of quantity of a table's row or column named after a parameter; None for any other name.

    Suffixes such as ``.low`` or ``.stderr`` are ignored.
    """
    for suffix in _SUFFIXES:
        name = name.removesuffix(suffix)
    path = path_of(name)
    known = DERIVED.get(path.rpartition(".")[2]) or declared(path)
    return known.kind if known.label and ("." in path or path in DERIVED) else None


def _cell(value: object, kind: str | None) -> str:
    if isinstance(value, bool) or not isinstance(value, Real):
        return "" if value is None else str(value)
    number = float(value)
    if math.isnan(number):
        return ""
    if kind is None or math.isinf(number):
        return f"{number:.4g}"
    return printed(format_quantity(number, kind))


def fit_table(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter, as numbers.

    Returns
    -------
    pandas.DataFrame
        ``parameter``, ``value``, its 95 % interval ``low`` to ``high`` (infinite where open), the ends of its
        statistical and systematic parts, ``unit``, the larger half width in per cent of the value, ``at bound``.
        Where the file of the curve states the instrument's own modulus: ``instrument's own``, in the same unit and
        for the same Poisson's ratio, and by how much ours ``differs`` from it (per cent).
    """
    told = result.instrument_moduli
    rows = []
    for name in (*result.names, *result.derived):
        known = result.answer(name)
        unit, factor = human_unit(known.value, kind_of(name))
        half = max(known.high - known.value, known.value - known.low)
        rows.append(
            {
                "parameter": name,
                "value": known.value / factor,
                **{
                    f"{part}{end}": getattr(interval, end) / factor
                    for part, interval in (
                        ("", known),
                        ("stat ", known.statistical),
                        ("syst ", known.systematic),
                    )
                    for end in ("low", "high")
                },
                "unit": unit,
                "half width (%)": 100.0 * abs(half / known.value) if known.value else np.nan,
                "at bound": result.bounds_hit.get(name, ""),
            }
        )
        if told:
            own = told.get(name)
            rows[-1]["instrument's own"] = own.youngs / factor if own else np.nan
            rows[-1]["differs (%)"] = 100.0 * own.difference if own else np.nan
    return pd.DataFrame(rows)


def strong_pairs(result: Fit) -> list[tuple[str, str, float]]:
    """Return name, name and correlation of pairs with correlation above 0.9 in absolute value, strongest first."""
    frame = result.correlations
    matrix, names = frame.to_numpy(), [str(name) for name in frame.columns]
    pairs = [
        (names[j], names[i], float(matrix[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) > _STRONG
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def known_together(result: Fit) -> list[tuple[str, str, float]]:
    """Return strongly correlated pairs of parameters of which each would be well known if the other were given.

    Their standard errors (of the logarithm) exceed 0.05, and would be below it with the other parameter fixed.

    Returns
    -------
    list of (str, str, float)
        Names of both, and their correlation.
    """
    index = {name: i for i, name in enumerate(result.names)}
    pairs = []
    for first, second, value in strong_pairs(result):
        errors = [
            math.sqrt(float(result.scaled_covariance[index[name], index[name]])) for name in (first, second)
        ]
        if max(errors) > _BADLY and max(errors) * math.sqrt(max(1.0 - value * value, 0.0)) < _BADLY:
            pairs.append((first, second, value))
    return pairs


def interval_table(result: Fit) -> pd.DataFrame:
    """Return one row per fitted parameter, as text: name, value with 95 % interval, prior.

    Each further optimum that the data hardly reject has a column of its own.
    """
    told = result.instrument_moduli
    rows = []
    for name in (*result.names, *result.derived):
        kind = kind_of(name)
        others = {
            f"{rival_name(place)} optimum": format_quantity(other.values[name], kind)
            if name in other.values
            else ""
            for place, other in enumerate(result.alternatives)
        }
        own = {"instrument's own (ours against it)": _instrument_text(result, name)} if told else {}
        rows.append(
            {
                "parameter": label(name),
                "value (95 %)": answer_text(result.answer(name)),
                **others,
                **own,
                "before the test": _prior_text(result, name, kind),
            }
        )
    return labelled_table(rows)


def steps_table(steps: Sequence[Step]) -> pd.DataFrame:
    """Return one row per step from the instrument's modulus to ours, as text: change made, modulus, its change."""
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
    """Return diagnostics of a fit as text: verdict, noise, chi-square, AIC, contact law, minimiser, residuals."""
    s = result.statistics
    which_law = "contact law" if len(result.curves) == 1 else "contact law, of the curve where it errs most"
    rows = {
        "verdict": labelled(str(result.verdict)),
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
    """Write the nonzero parameters of a noise model with their names: ``"force noise 1 nN"``; else ``"none"``."""
    numbers = numbers_of(noise, "noise")
    parts = [
        f"{label(path)} {format_quantity(number.value, number.quantity.kind)}"
        for path, number in numbers.items()
        if number.value
    ]
    return ", ".join(parts) or "none"


def reservations_table(result: Fit) -> pd.DataFrame:
    """Return the reservations about a fit, one row each: from the file reader, then the curves, then the fit."""
    rows = [{"from": "reading the file", "reservation": note} for note in notes_of(*result.curves)]
    doubts = quality_doubts(result.problem, require=False)
    rows += [{"from": "the curve", "reservation": reason} for reason in doubts]
    rows += [{"from": "the fit", "reservation": warning.message} for warning in result.warnings]
    return labelled_table(rows or [{"from": "the fit", "reservation": "none"}])


def provenance_table(record: Mapping[str, Any], facts: Mapping[str, str], *files: str) -> pd.DataFrame:
    """Return where a result came from, as text: hashes of files and points, versions, and the given facts.

    Parameters
    ----------
    record : mapping
        The ``provenance`` of a fit or posterior: its ``curves`` and ``versions``.
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


def labelled_table(rows: list[dict[str, str]]) -> pd.DataFrame:
    """Make a table of text from rows; its first column becomes the index. Each text is made one printable line."""
    frame = pd.DataFrame([{name: printed(one_line(text)) for name, text in row.items()} for row in rows])
    # The first column's name goes beside the others': pandas would give the index a header row of its own.
    return frame.set_index(frame.columns[0]).rename_axis(index=None, columns=frame.columns[0])


def facts_table(rows: Mapping[str, str]) -> pd.DataFrame:
    """Make a table with one row per name and a single column ``value``."""
    return labelled_table([{"": name, "value": text} for name, text in rows.items()])


def beyond_loading(part: Curve) -> Curve | None:
    """Return the whole curve that `part` was cut from, if it has points beyond loading; otherwise None.

    It is read again from the curve's file: also None where the file is no longer there.
    """
    whole = whole_curve(part)
    return whole if whole is not None and (whole.segments() != LOADING).any() else None


def format_name(curve: Curve) -> str:
    """Return the name and description of the file format a curve was read in: ``"mach1 (Biomomentum ...)"``."""
    name = str(curve.metadata["format"])
    described = next((entry.description for entry in all_formats() if entry.name == name), "")
    return name + (f" ({described})" if described else "")


def curves_as_read(path: Path, stated: Mapping[str, Any]) -> list[Curve]:
    """Return every curve of a file, read as a scene file's section ``[curve]`` states, before its signs are judged.

    Only the signs that the section turns (``flip``) are turned, so that a table shows the file as it is.
    """
    options = {key: stated[key] for key in ("format", "columns", "calibration") if key in stated}
    return [flipped(curve, stated.get("flip") or ()) for curve in read_all(path, **options)]


def notes_of(*curves: Curve) -> list[str]:
    """Return what the reader of their files remarked on curves."""
    return [str(note) for curve in curves for note in curve.metadata.get("notes", ())]


def reading_table(tests: Sequence[tuple[int, Curve]]) -> pd.DataFrame:
    """Return one row per test, as text: number, name, points, spans of depth and force, points of each segment.

    Parameters
    ----------
    tests : sequence of (int, Curve)
        The number of each test in its file, from 1, and its curve as it was read.
    """
    return pd.DataFrame([_test_row(number, curve) for number, curve in tests])


def _test_row(number: int, curve: Curve) -> dict[str, object]:
    counts = {label: int((curve.segments() == label).sum()) for label in (LOADING, HOLD, UNLOADING)}
    return {
        "test": number,
        "name": str(curve.metadata.get("name", "")),
        "points": len(curve),
        "depth": _span(curve.depth, "length"),
        "force": _span(curve.force, "force"),
        "segments": ", ".join(f"{label} {count}" for label, count in counts.items() if count),
    }


def _span(values: FloatArray, kind: str) -> str:
    finite = values[np.isfinite(values)]
    return span(float(finite.min()), float(finite.max()), kind) if finite.size else "no finite number"


def accuracy_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return errors and times of contact laws (from `accuracy_cost`) in columns for people, most accurate first.

    Returns
    -------
    pandas.DataFrame
        ``law``; ``error`` (largest relative error of the force); ``cold (us)``, the time with the law built anew;
        ``cold (x)`` and ``held (x)``, that time and the one with the law already built, relative to the explicit
        formula; ``best`` (no other law is both more accurate and faster, from cold).
    """
    answered = table[table["error"].notna()]
    return pd.DataFrame(
        {
            "law": [_with_nodes(row) for _, row in answered.iterrows()],
            "error": answered["error"].to_numpy(),
            "cold (us)": 1e6 * answered["cold_seconds"].to_numpy(),
            "cold (x)": answered["cold_ratio"].to_numpy(),
            "held (x)": answered["held_ratio"].to_numpy(),
            "best": answered["pareto"].to_numpy(),
        }
    )


def answer_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return errors and times of fits with each contact law (from `answer_cost`) in columns for people, best first.

    Returns
    -------
    pandas.DataFrame
        ``law``; ``E (%)``, the error of the modulus with known thickness, and ``fit (x)``, the time of the fit
        relative to lmfit's Hertz fit; ``E, free h (%)``, ``h (%)`` and ``fit, free h (x)``, the same with modulus
        and thickness both fitted.
    """
    ordered = table.sort_values("E_error", key=abs, ignore_index=True)
    return pd.DataFrame(
        {
            "law": [_with_nodes(row) for _, row in ordered.iterrows()],
            "E (%)": 100.0 * ordered["E_error"],
            "fit (x)": ordered["ratio"],
            "E, free h (%)": 100.0 * ordered["E_error_joint"],
            "h (%)": 100.0 * ordered["thickness_error"],
            "fit, free h (x)": ordered["joint_ratio"],
        }
    )


def _with_nodes(row: pd.Series[Any]) -> str:
    nodes = "" if pd.isna(row["nodes"]) else f" ({row['nodes']:.0f} nodes)"
    return f"{method_label(row)}{nodes}"


def method_label(row: pd.Series[Any]) -> str:
    """Name a method with its settings: ``"explicit 4"`` (form, order), ``"exact 1e-06"`` (tolerance)."""
    if row["form"]:
        return f"{row['form']} {row['order']:.0f}"
    return row["method"] if pd.isna(row["rtol"]) else f"{row['method']} {row['rtol']:.0e}"
