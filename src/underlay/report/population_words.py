"""A population in sentences and tables that a person reads."""

from __future__ import annotations

import math
from collections.abc import Callable

import pandas as pd

from underlay._text import one_line
from underlay.errors import InputError
from underlay.inference.population.population import population
from underlay.inference.population.result import Comparison, Group, Population, Spread, Triple
from underlay.report.interval_words import quantity_with_interval
from underlay.report.labels import label, start
from underlay.report.maps import sample_parameters
from underlay.report.markdown import markdown_text
from underlay.scene.parameters import kind_of

__all__ = [
    "comparison_table",
    "group_table",
    "of_map",
    "population_sentences",
    "population_tables",
    "spread_in_words",
    "told",
]

# Columns of a map that say whose a curve is, and of which group.
_WHOSE, _GROUP = "animal", "group"


def of_map(table: pd.DataFrame) -> Population | str:
    """What the curves of a map say of their animals, of its first parameter; or in words why nothing is said."""
    parameters = sample_parameters(table)
    if _WHOSE not in table.columns or not parameters:
        return (
            "The curves are not told apart by animal. Sites of one animal are not independent: an interval that "
            "takes them so is too narrow. A column `animal` in the manifest, and `group` for those to compare, "
            "lets this page say what the animals say."
        )
    group = _GROUP if _GROUP in table.columns else None
    try:
        return population(table, [_WHOSE], parameters[0], group=group)
    except InputError as error:
        return f"The animals cannot be summed up: {markdown_text(str(error))}."


def told(result: Population | str) -> str:
    """Return it as Markdown."""
    return (
        result if isinstance(result, str) else "\n\n".join(map(markdown_text, population_sentences(result)))
    )


def population_tables(result: Population | str) -> list[pd.DataFrame]:
    """Tables of the groups and of their ratios, as far as there are any."""
    if isinstance(result, str):
        return []
    return [group_table(result), *([comparison_table(result)] if result.comparisons else [])]


def group_table(result: Population) -> pd.DataFrame:
    """One row per group: how many, the mean to go by, the other way to it, the spreads."""
    kind = kind_of(result.parameter)
    rows = []
    for name, group in result.groups.items():
        row = {"group": one_line(name)} if len(result.groups) > 1 or name else {}
        if result.by:
            row[f"{result.by[0]}s"] = str(group.units)
        row["curves"] = str(group.curves)
        row["mean"] = quantity_with_interval(group.mean, group.low, group.high, kind)
        row["beside it"] = _beside(group, lambda found: quantity_with_interval(*found, kind))
        for spread in group.spreads:
            row[f"spread, {spread.level}s"] = spread_in_words(spread)
        row["error of a curve"] = f"{100.0 * group.curve_error:.2g} %"
        rows.append(row)
    return pd.DataFrame(rows)


def comparison_table(result: Population) -> pd.DataFrame:
    """One row per pair of groups: their ratio with its interval, and the other way to it."""
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


def population_sentences(result: Population) -> list[str]:
    """Means and ratios in words, first what people copy, then what they must know beside it."""
    said = []
    kind = kind_of(result.parameter)
    for name, group in result.groups.items():
        who = f"{one_line(name)}: " if name else ""
        of = (
            f"{group.units} {result.by[0]}s, {group.curves} curves" if result.by else f"{group.curves} curves"
        )
        mean = quantity_with_interval(group.mean, group.low, group.high, kind)
        said.append(f"{who}{start(label(result.parameter))} {mean}, geometric mean of {of}.")
    said += [_compared(pair) for pair in result.comparisons]
    if result.shared_error:
        said.append(
            f"An error of {100.0 * result.shared_error:.2g} % that all curves share is in every mean."
        )
    return said + result.sentences()


def spread_in_words(spread: Spread) -> str:
    """Return ``"24 % (9 to 56)"``, or an upper limit where there may be none."""
    if spread.low == 0.0:
        return f"under {100.0 * spread.high:.2g} %"
    return f"{100.0 * spread.median:.2g} % ({100.0 * spread.low:.2g} to {100.0 * spread.high:.2g})"


def _compared(pair: Comparison) -> str:
    return (
        f"{one_line(pair.name)} over {one_line(pair.reference)}: {_ratio(pair.ratio, pair.low, pair.high)}; "
        f"the probability that it is above one is {_probability(pair.probability_above)}."
    )


def _ratio(ratio: float, low: float, high: float) -> str:
    if math.isnan(low):
        return f"{ratio:.3g} (no interval)"
    return quantity_with_interval(ratio, low, high, "dimensionless")


def _beside(found: Group | Comparison, written: Callable[[Triple], str]) -> str:
    """Return the interval that is not the one to go by, and what tells them apart."""
    if found.leads_plain:
        return f"with priors {written(found.modelled)}"
    return "-" if math.isnan(found.plain[1]) else f"without a prior {written(found.plain)}"


def _probability(share: float) -> str:
    if share < 0.001:
        return "under 0.001"
    return "over 0.999" if share > 0.999 else f"{share:.3f}"
