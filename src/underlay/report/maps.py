"""Words and tables for people on a map of many curves, and on the population (animals, groups) it samples.

`table` is the result of `fit_many`, or of `read_map`, a row per curve in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from underlay._text import one_line
from underlay.errors import InputError
from underlay.inference.batch.decisions import ACCEPT, REFUSE
from underlay.inference.batch.results_table import FITTED, fitted_names, standard_errors
from underlay.inference.least_squares.provenance import version_record
from underlay.inference.uncertainty.answer import NORMAL_95, Advice
from underlay.report.labels import label
from underlay.report.screen import counted, interval_text, line, name_of, verdict_lines
from underlay.report.tables import labelled_table, provenance_table
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.population.result import Comparison, Group, Population, Spread, Triple

# More rows than this are looked up in the table itself.
_LISTED = 50
_MIDDLE = (0.5, 0.16, 0.84)
# Factor to either side from which an interval is too wide for use, as of the verdict on a fit.
_WIDE = 2.0
# What follows from a fit with adhesion at every site; the table has no error of them.
_FOLLOW = ("adhesion.pull_off_force", "adhesion.pull_off_depth")
# Columns of a map that say whose a curve is, and of which group.
_WHOSE, _GROUP = "animal", "group"


def sample_parameters(table: pd.DataFrame) -> list[str]:
    """Return the columns of fitted parameters of layer, substrate and adhesion, then those of the pull-off."""
    fitted = [
        name for name in fitted_names(table.columns) if name.startswith(("layer.", "substrate.", "adhesion."))
    ]
    return [*fitted, *(name for name in _FOLLOW if name in table.columns)]


def has_positions(table: pd.DataFrame) -> bool:
    """Whether at least one site has a position (finite ``x`` and ``y``)."""
    return {"x", "y"} <= set(table.columns) and bool((table["x"].notna() & table["y"].notna()).any())


def columns_to_draw(table: pd.DataFrame) -> list[str]:
    """Return the parameter columns of the sample to draw as maps by position; empty without positions."""
    return known_parameters(table) if has_positions(table) else []


def known_parameters(table: pd.DataFrame) -> list[str]:
    """Return the columns of `sample_parameters` with a finite value at one site or more."""
    return [name for name in sample_parameters(table) if np.isfinite(table[name].to_numpy(float)).any()]


def errors_in_words(table: pd.DataFrame) -> str:
    """Say what the ± of a curve in the map stands for.

    That is the whole uncertainty at 95 % where the table has it, otherwise the standard error from white noise
    alone.
    """
    if not any(str(column).endswith(".stat.low") for column in table.columns):
        return "± of a curve is the standard error of white noise alone; without --quick it is what a fit prints."
    return (
        "± of one curve is at 95 % and holds all its errors, also those that all share (of the radius, say)."
    )


def parameter_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per parameter of the sample, as text: median and spread of the sites, median standard error."""
    rows = []
    for name in known_parameters(table):
        values = table[name].to_numpy(dtype=float)
        known = values[np.isfinite(values)]
        middle, low, high = (float(value) for value in np.quantile(known, _MIDDLE))
        share = (
            np.nanmedian(standard_errors(table, name) / np.abs(values))
            if name in fitted_names(table.columns)
            else np.nan
        )
        rows.append(
            {
                "parameter": label(name),
                "median (two thirds of the sites)": interval_text(middle, low, high, kind_of(name)),
                "median standard error": f"{100.0 * share:.2g} %" if np.isfinite(share) else "",
                **_instrument_cells(table, name),
            }
        )
    return labelled_table(rows or [{"parameter": "none", "median (two thirds of the sites)": ""}])


def _instrument_cells(table: pd.DataFrame, name: str) -> dict[str, str]:
    """Return cells with the median value that the instrument itself reported for a parameter, and our deviation.

    Both are for the same Poisson's ratio; empty where the table lacks them.
    """
    columns = [f"{name}.instrument", f"{name}.difference_percent"]
    if not set(columns) <= set(table.columns) or not table[columns].notna().all(axis=1).any():
        return {}
    own, difference = (float(np.nanmedian(table[column].to_numpy(dtype=float))) for column in columns)
    return {
        "instrument's own (median)": format_quantity(own, kind_of(name)),
        "ours against it (median)": f"{difference:+.2g} %",
    }


def decision_words(table: pd.DataFrame) -> str:
    """Say in a sentence how many curves a person accepted and refused by hand; empty where none was judged."""
    decided = _decisions(table)
    if decided.empty:
        return ""
    counts = decided["decision"].value_counts()
    told = " and ".join(
        f"{counts[word]} {done}"
        for word, done in ((REFUSE, "refused"), (ACCEPT, "accepted"))
        if word in counts
    )
    return f"By hand {told}. What was refused keeps its numbers in the table and counts nowhere on this page."


def decision_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the curves that a person accepted or refused by hand, each with the reason, as text.

    More than 50 are counted in a last row.
    """
    return _first_of(_decisions(table).set_axis(["curve", "decision", "why"], axis=1), "")


def _decisions(table: pd.DataFrame) -> pd.DataFrame:
    decided = table.reindex(columns=["name", "decision", "decision_reason"])
    return decided[decided["decision"].isin([ACCEPT, REFUSE])]


def _first_of(table: pd.DataFrame, otherwise: str) -> pd.DataFrame:
    """Return the first 50 rows of a table as text, the others counted; `otherwise` stands where there are none."""
    between = [""] * (table.shape[1] - 2)
    rows = table[:_LISTED].fillna("").astype(str).to_numpy().tolist()
    if len(table) > _LISTED:
        rows.append([f"and {len(table) - _LISTED} more", *between, "see the table"])
    rows = rows or [["none", *between, otherwise]]
    return labelled_table([dict(zip(table.columns, row, strict=True)) for row in rows])


def failure_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the curves without a fit, each with the reason, as text; more than 50 are counted in a last row."""
    failed = table.loc[table["status"] != FITTED, ["name", "reason"]]
    return _first_of(failed.set_axis(["curve", "reason"], axis=1), "every curve was fitted")


def map_provenance_table(table: pd.DataFrame, facts: Mapping[str, str], *files: str) -> pd.DataFrame:
    """Return where a map came from, as text: hashes of files, number of curves, versions, and the given facts.

    Raises
    ------
    FileAccessError
        If one of the files cannot be read.
    """
    versions = version_record(("underlay", "numpy", "scipy", "pandas"))
    rows = {"curves": str(len(table))}
    if "seconds" in table.columns:
        rows["time of all fits"] = f"{float(table['seconds'].sum()):.3g} s"
    return provenance_table({"curves": [], "versions": versions}, {**rows, **facts}, *files)


def of_map(table: pd.DataFrame) -> Population | str:
    """Return the population of a map's first parameter, with animals as units; or a sentence why there is none."""
    parameters = sample_parameters(table)
    if _WHOSE not in table.columns or not parameters:
        return (
            "The curves are not told apart by animal. Sites of one animal are not independent: an interval that "
            "takes them so is too narrow. A column animal in the manifest, and group for those to compare, "
            "lets this page say what the animals say."
        )
    # Populations are loaded where there is one.
    from underlay.inference.population.population import population  # noqa: PLC0415  see above

    group = _GROUP if _GROUP in table.columns else None
    try:
        return population(table, [_WHOSE], parameters[0], group=group)
    except InputError as error:
        return f"The animals cannot be summed up: {one_line(error)}."


def population_tables(result: Population | str) -> list[pd.DataFrame]:
    """Return the tables of the groups and of their ratios, if any; none if `result` is a message."""
    if isinstance(result, str):
        return []
    return [group_table(result), *([comparison_table(result)] if result.comparisons else [])]


def group_table(result: Population) -> pd.DataFrame:
    """Return a row per group as text: counts, mean with interval by two methods, spreads, error of a curve.

    One method has priors, the other none; `Group.leads_plain` says which gives the column ``mean``, and the other
    stands in ``beside it``.
    """
    kind = kind_of(result.parameter)
    rows = []
    for name, group in result.groups.items():
        row = {"group": one_line(name)} if len(result.groups) > 1 or name else {}
        if result.by:
            row[f"{result.by[0]}s"] = str(group.units)
        row["curves"] = str(group.curves)
        row["mean"] = interval_text(group.mean, group.low, group.high, kind)
        row["beside it"] = _beside(group, lambda found: interval_text(*found, kind))
        for spread in group.spreads:
            row[f"spread, {spread.level}s"] = _spread_in_words(spread)
        row["error of a curve"] = f"{100.0 * group.curve_error:.2g} %"
        rows.append(row)
    return pd.DataFrame(rows)


def comparison_table(result: Population) -> pd.DataFrame:
    """Return a row per pair of groups as text: the ratio of their means with interval, by two methods.

    One method has priors, the other none. The last column is the probability that the ratio exceeds 1.
    """
    return pd.DataFrame(
        [
            {
                "ratio": f"{one_line(pair.name)} / {one_line(pair.reference)}",
                "of the means": _ratio(pair.ratio, pair.low, pair.high),
                "beside it": _beside(pair, lambda found: _ratio(*found)),
                "P(ratio > 1)": _probability(pair.probability_above),
            }
            for pair in result.comparisons
        ]
    )


def means_in_words(result: Population) -> Iterator[tuple[str, str, str]]:
    """Yield for each group its name, its mean with interval, and the numbers of units and curves, all as text."""
    for name, group in result.groups.items():
        units = f"{counted(group.units, result.by[0])}, " if result.by else ""
        mean = interval_text(group.mean, group.low, group.high, kind_of(result.parameter))
        yield one_line(name), mean, f"{units}{counted(group.curves, 'curve')}"


def population_lines(result: Population) -> list[str]:
    """Return the short text of a population, by lines.

    First come the means, then ratios to the first group, the verdict with cause and next step, and the spreads.
    """
    name, lines = name_of(result.parameter)[0], list[str]()
    for called, mean, of in means_in_words(result):
        scale = "" if lines else "; 95 %, geometric mean"
        lines.append(line("" if lines else name, f"{called or 'mean'} {mean} ({of}{scale})"))
    first = next(iter(result.groups))
    for pair in result.comparisons:
        if pair.reference == first:
            ratio = f"{one_line(pair.name)} / {one_line(first)} {_ratio(pair.ratio, pair.low, pair.high)}"
            lines.append(
                line("Ratio", f"{ratio} (> 1 with probability {_probability(pair.probability_above)})")
            )
    lines += verdict_lines(population_verdict(result))
    spreads = next(iter(result.groups.values())).spreads
    within = f" of one {result.by[-1]}" if result.by else ""
    told = [
        f"between {spread.level}s{within if spread.level == 'curve' else ''} {_spread_in_words(spread)}"
        for spread in spreads
    ]
    lines.append(line("Spread", f"{'; '.join(told)} (standard deviations, 95 %)"))
    if result.shared_error:
        lines.append(line("Systematic", shared_error_words(result)))
    if result.left_out:
        lines.append(line("Left out", f"{counted(len(result.left_out), 'curve')} (--details says why)"))
    return "\n".join(lines).splitlines()


def shared_error_words(result: Population) -> str:
    """Write the 95 % systematic error (inputs and model) that shifts all curves alike, in per cent."""
    share = 100.0 * NORMAL_95 * result.shared_error
    return f"± {share:.2g} % on all curves alike, by inputs and model (95 %)"


def population_verdict(result: Population) -> Advice:
    """Return the verdict on whether the means can be used, with likely cause and next step where they cannot."""
    level = result.by[0] if result.by else "animal"
    wide = {
        name: math.sqrt(one.high / one.low) if one.low else math.inf for name, one in result.groups.items()
    }
    worst, factor = result.groups[max(wide, key=lambda name: wide[name])], max(wide.values())
    if not result.by:
        cause = f"the {level} of each curve is not named"
        return Advice(
            "check", "the interval holds for these sites alone", cause, f"name the {level} of each curve"
        )
    if result.apart:
        return Advice(
            "check",
            f"the column {result.apart} tells groups apart, which are taken as one here",
            "a mean over groups that differ holds for none of them",
            f"compare them: --group {result.apart} (in Python group={result.apart!r})",
        )
    cause = f"only {worst.units} {level}s; curves of one {level} are not independent"
    if worst.units == 1:
        reason = f"one {level} does not show how {level}s differ"
        return Advice("check", reason, f"curves of one {level} are not independent", f"measure more {level}s")
    if factor > _WIDE:
        known = f"to a factor of {factor:.2g} only" if math.isfinite(factor) else "to one side only"
        return Advice("check", f"the mean is known {known}", cause, _more_units(result, worst, level))
    return Advice("good", f"the interval holds for {level}s like these")


def _more_units(result: Population, group: Group, level: str, most: int = 30) -> str:
    """Say how many units (animals, say) would narrow a group's interval to a factor of 2, and to what.

    Their spread is taken as that of the group. `level` names a unit; above `most` units the number is not stated.
    """
    from underlay.inference.population.result import Variance  # noqa: PLC0415  as above

    variance = group.plain_mean.variance
    if variance is None:
        return f"measure more {level}s"
    for count in range(group.units + 1, most + 1):
        fewer = Variance(variance.value * group.units / count, count - 1.0)
        half = math.hypot(fewer.half, NORMAL_95 * result.shared_error)
        if half <= math.log(_WIDE):
            ends = interval_text(
                group.mean,
                group.mean * math.exp(-half),
                group.mean * math.exp(half),
                kind_of(result.parameter),
            )
            return f"measure {count - group.units} more: {count} {level}s of this spread would give {ends} (95 %)"
    return f"measure more {level}s: of this spread more than {most} are needed"


def _spread_in_words(spread: Spread) -> str:
    """Write a relative spread with its interval: ``"24 % (9 to 56)"``, or ``"less than 30 %"``."""
    low, middle, high = (
        f"{float(f'{100.0 * end:.2g}'):g}" for end in (spread.low, spread.median, spread.high)
    )
    return f"{middle} % ({low} to {high})" if spread.low > 0.0 else f"less than {high} %"


def _ratio(ratio: float, low: float, high: float) -> str:
    if math.isnan(low):
        return f"{ratio:.3g} (no interval)"
    return interval_text(ratio, low, high, "dimensionless")


def _beside(found: Group | Comparison, written: Callable[[Triple], str]) -> str:
    """Write the mean or ratio by the method that is not the leading one: with priors, or without a prior.

    `written` makes text of value and interval ends.
    """
    if found.leads_plain:
        return f"with priors {written(found.modelled)}"
    return "-" if math.isnan(found.plain[1]) else f"without a prior {written(found.plain)}"


def _probability(share: float) -> str:
    if share < 0.001:
        return "under 0.001"
    return "over 0.999" if share > 0.999 else f"{share:.3f}"
