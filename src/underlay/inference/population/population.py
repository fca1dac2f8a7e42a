"""Population statistics from curves of several animals: mean, spread between animals and within, ratios of groups.

Curves of one animal are not independent: with five animals of twenty sites each, spread 30 % between and 20 %
within, an interval that treats them as independent covers the mean in 37 of 100 studies at a nominal 95 %. The
model here has a spread for every level (`levels`), uses the whole likelihood of every curve (`likelihood`), open
ones too, and integrates over the spreads. The plain t interval of the animals' means, which needs no prior, is
given too, and is preferred where animals are few.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._given import columns_given, require_share
from underlay.errors import InputError
from underlay.inference.batch.decisions import ACCEPT, REFUSED_BY_HAND, read_map, shared_error_of
from underlay.inference.batch.results_table import FITTED, LIKELIHOOD, fitted_names
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.population.levels import GroupModel
from underlay.inference.population.likelihood import CurveLikelihood
from underlay.inference.population.result import (
    Comparison,
    Density,
    Group,
    LeftOut,
    PlainMean,
    Population,
    Spread,
    Triple,
    Variance,
)
from underlay.inference.profiling.profile_result import LikelihoodProfile
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.inference.uncertainty.verdict import CHECK, REJECT

#: Labels by column, with the result of one curve.
Labelled: TypeAlias = tuple[Mapping[str, str], Fit | Posterior | LikelihoodProfile]
# Largest number of names that a message lists.
_LISTED = 4
_KEEP, _DROP = "keep", "drop"
# Names of columns that tell groups apart, which a population compares.
_GROUPS = ("group", "treatment", "condition")
# Probabilities of the ends and the middle of a 95 % interval.
_ENDS = np.array([0.025, 0.5, 0.975])
# A spread is stated as an upper limit only where the probability of one below the first number exceeds the second.
_NO_SPREAD, _MAY_BE_NONE = 0.05, 0.05
_TAILS = ("normal", "outliers")
_MODULUS = "layer.E"
# Number of units from which they determine their spread: with fewer the prior would, and no scale of it covers so
# evenly.
_ENOUGH = 6


@dataclass(frozen=True)
class LabelledCurve:
    """One curve that is used: its group, its labels (outermost first), its likelihood."""

    group: str
    labels: tuple[str, ...]
    likelihood: CurveLikelihood


def population(
    results: pd.DataFrame | str | os.PathLike[str] | Sequence[Labelled],
    by: str | Sequence[str] = ("animal",),
    parameter: str = "layer.E",
    *,
    group: str | None = None,
    doubtful: str = "keep",
    tails: str = "normal",
    shared_error: float | None = None,
) -> Population:
    """Mean and spread of a population from curves at several sites of several animals.

    Parameters
    ----------
    results : DataFrame, path, or sequence of (labels, result)
        The table of a map (`fit_many`), its file, or pairs of labels by column and a `Fit`, a profile or a
        `Posterior`, whose prior is divided out.
    by : str or sequence of str
        Label columns of the units that curves belong to, outermost level first: ``["animal", "joint"]``. An empty
        list treats all curves as independent; the interval then holds for these sites only.
    parameter : str
        A positive parameter; its logarithm is modelled as normal.
    group : str, optional
        Column of the groups that are compared. "rat 1" in two groups is two animals.
    doubtful : str
        "keep" includes curves whose verdict is "check", "drop" leaves them out. Those whose verdict is "reject" are
        left out, unless accepted by hand; the result states how many.
    tails : str
        "normal", or "outliers": a tenth of the curves may come from a distribution five times as wide.
    shared_error : float, optional
        Relative error that all curves have in common, such as that of the tip's radius times its effect: it does
        not average out, and is in every mean but in no ratio of groups. By default that of a map's table
        (``layer.E.syst.low`` and ``.high``), else none.

    Raises
    ------
    InputError
        If a column or a label is missing, the parameter was not fitted, a group has fewer than two curves, or the
        results are of different models.

    Notes
    -----
    Levels nest: ln p = mean of the group + step of the animal + step of the site + step of the curve, each normal,
    with priors on the spreads (half-Cauchy 0.3 between, half-t4 0.5 within; separate per group) and none on the
    mean. The interval without a prior is Student's on the animals' means, that of a ratio Welch's.

    Up to five animals hardly determine how much animals differ, so the prior would: of three that differ by 20 % or
    less its 95 % interval covers 98 to 100 %, of three that differ by more 92 to 95 %, and no other scale covers so
    evenly. There the interval without a prior is preferred: it covers 93 to 98 % in all cells of the stored study,
    and is up to half as long again. It is not preferred where outliers are allowed for, or an end is open. For
    animals that agree by chance it is bounded below by the errors of their curves and the scatter within each
    (`PlainMean`).
    """
    names = columns_given(
        by, "by", '["animal"] or ["animal", "joint"], or [] to take all curves for independent'
    )
    if tails not in _TAILS:
        raise InputError(f"tails must be one of {', '.join(_TAILS)}; got {tails!r}")
    if shared_error is not None:
        require_share(shared_error, "shared_error", what="a relative error", zero=True)
    curves, left, of_map, apart = _selected(results, parameter, names, group, doubtful)
    shared = of_map if shared_error is None else float(shared_error)
    groups: dict[str, list[LabelledCurve]] = {}
    for curve in curves:
        groups.setdefault(curve.group, []).append(curve)
    lost = {entry.group for entry in left} - set(groups)
    if not groups or lost:
        named = f" of group {min(lost)!r}" if lost and groups else ""
        raise InputError(
            f"no curve{named} is left: {len(left)} were left out ({left[0].reason if left else 'none'})"
        )
    found = {
        name: _group(name, members, names, outliers=tails == "outliers", shared=shared)
        for name, members in groups.items()
    }
    ordered = list(found.values())
    comparisons = [
        _compared(later, earlier) for place, later in enumerate(ordered) for earlier in ordered[:place]
    ]
    return Population(parameter, names, found, tuple(comparisons), tuple(left), shared, apart)


def _selected(
    results: pd.DataFrame | str | os.PathLike[str] | Sequence[Labelled],
    parameter: str,
    by: Sequence[str],
    group: str | None,
    doubtful: str,
) -> tuple[list[LabelledCurve], list[LeftOut], float, str]:
    """Curves used, curves left out, the relative error that all curves of a map share, and `Population.apart`."""
    if isinstance(results, str | os.PathLike):
        results = read_map(results)
    if not isinstance(results, pd.DataFrame):
        return *select_results(results, parameter, by, group, doubtful), 0.0, ""
    of_map = shared_error_of(results) if parameter == _MODULUS else None
    kept, left = select_rows(results, parameter, by, group, doubtful)
    return kept, left, of_map or 0.0, "" if group else group_column(results, by)


def _group(
    name: str, members: Sequence[LabelledCurve], by: Sequence[str], *, outliers: bool, shared: float
) -> Group:
    if len(members) < 2:
        raise InputError(
            f"group {name!r} has one curve: a population needs two, of different {by[0] if by else 'site'}s"
        )
    model = GroupModel(
        [member.likelihood for member in members], [member.labels for member in members], outliers=outliers
    )
    modelled = _triple(_widened(model.mean, shared))
    spreads = tuple(_spread(model, level, label) for level, label in enumerate((*by, "curve")))
    errors = np.array([member.likelihood.error for member in members])
    values, plain = pd.DataFrame(), _plain_of_curves(model)
    if by:
        centre, deviation = model.unit_values()
        own = model.own_values([spread.median for spread in spreads[1:]])[0]
        labels = [" / ".join(unit) for unit in model.units.names[0]]
        counted = Counter(member.labels[0] for member in members)
        values = pd.DataFrame(
            {
                "mean": np.exp(centre),
                "low": np.exp(centre - NORMAL_95 * deviation),
                "high": np.exp(centre + NORMAL_95 * deviation),
                "own": np.exp(own),
                "curves": [counted[unit[0]] for unit in model.units.names[0]],
            },
            index=labels,
        )
        plain = _plain_of_units(model, own, spreads)
    return Group(
        name,
        modelled,
        plain.interval(shared),
        not outliers and 1 < len(values) < _ENOUGH and modelled[1] > 0.0 and modelled[2] < math.inf,
        spreads,
        len(values),
        len(members),
        sum(member.likelihood.is_open for member in members),
        float(np.median(errors)),
        values,
        model.mean,
        plain,
        model.spreads.probability_of_none(min(_NO_SPREAD, float(np.median(errors)))) > _MAY_BE_NONE,
    )


def _spread(model: GroupModel, level: int, label: str) -> Spread:
    grid = model.spreads
    low, median, high = (float(end) for end in grid.quantile(level, _ENDS))
    if grid.probability_below(level, _NO_SPREAD) > _MAY_BE_NONE:
        return Spread(label, median, 0.0, float(grid.quantile(level, np.array([0.95]))[0]))
    return Spread(label, median, low, high)


def _plain_of_curves(model: GroupModel) -> PlainMean:
    """Mean of independent curves with equal weights, each at its likeliest value."""
    middles = np.array([curve.middle for curve in model.curves])
    errors = np.array([curve.error for curve in model.curves])
    known = float(np.mean(errors**2)) / len(errors) if np.isfinite(errors).all() else 0.0
    return PlainMean.of_units(middles, np.ones(len(middles)), Variance(known, math.inf))


def _plain_of_units(model: GroupModel, own: FloatArray, spreads: Sequence[Spread]) -> PlainMean:
    """Mean of the outermost units, `own` (units,), weighted by the variance of each and by their spread."""
    inner = [spread.median for spread in spreads[1:]]
    weights = 1.0 / (model.own_values(inner)[1] + spreads[0].median ** 2)
    shares = weights / weights.sum()

    def left(which: Sequence[float]) -> float:
        return float(shares**2 @ model.own_values(which)[1])

    # Where no unit has two members of the next level, their spread is seen only in the scatter of the units.
    freedoms = model.units.freedoms(len(model.curves))
    seen = [spread if freedom else 0.0 for spread, freedom in zip(inner, freedoms, strict=True)]
    parts, rest = [], left(seen)
    for level, freedom in enumerate(freedoms):
        if freedom:
            seen[level] = 0.0
            parts.append(Variance(max(rest - left(seen), 0.0), freedom))
            rest = left(seen)
    return PlainMean.of_units(own, weights, Variance.sum_of([*parts, Variance(rest, math.inf)]))


def _compared(later: Group, earlier: Group) -> Comparison:
    """Ratio of the later group to the earlier one, by the model and without a prior."""
    difference = later.density.minus(earlier.density)
    plain = later.plain_mean.over(earlier.plain_mean)
    leads_plain = plain.variance is not None and (later.leads_plain or earlier.leads_plain)
    above = plain.probability_above() if leads_plain else float(difference.shares[difference.x > 0.0].sum())
    return Comparison(later.name, _triple(difference), plain.interval(), leads_plain, earlier.name, above)


def _triple(density: Density) -> Triple:
    """Median and ends of the 95 % interval of the parameter, from the density of its logarithm."""
    low, middle, high = (
        math.exp(end) if end < math.inf else math.inf for end in density.quantile(_ENDS).tolist()
    )
    return middle, low, high


def _widened(density: Density, shared: float) -> Density:
    """Density of the mean with the relative error that all curves share added."""
    if not shared:
        return density
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    moved = Density(shared * nodes, weights / weights.sum())
    return density.minus(moved)


# --- which curves ---------------------------------------------------------------------------------------


def select_rows(
    table: pd.DataFrame, parameter: str, by: Sequence[str], group: str | None, doubtful: str
) -> tuple[list[LabelledCurve], list[LeftOut]]:
    """Curves of a map's table that are used, and those left out with the reason.

    Parameters
    ----------
    table : DataFrame
        The table of a map.
    parameter, by, group, doubtful
        As in `population`.

    Raises
    ------
    InputError
        If a column is missing, a label is empty, or the parameter was not fitted.
    """
    wanted = [*([] if group is None else [group]), *by]
    _require_columns(table, wanted, parameter)
    kept: list[LabelledCurve] = []
    left: list[LeftOut] = []
    text = f"{parameter}.{LIKELIHOOD}"
    for row in table.to_dict("records"):
        labels = [_label(row, column) for column in wanted]
        head = labels[0] if group is not None else ""
        name = str(row.get("name", ""))
        if row["status"] != FITTED:
            by_hand = row["status"] == REFUSED_BY_HAND
            left.append(LeftOut(head, name, REFUSED_BY_HAND if by_hand else "no fit"))
        elif row["verdict"] in _refused(doubtful) and row.get("decision") != ACCEPT:
            left.append(LeftOut(head, name, f"verdict {row['verdict']}"))
        else:
            nine_numbers = row.get(text)
            likelihood = (
                CurveLikelihood.from_text(nine_numbers)
                if isinstance(nine_numbers, str) and nine_numbers
                else _normal(row, parameter, name)
            )
            kept.append(LabelledCurve(head, tuple(labels[len(wanted) - len(by) :]), likelihood))
    return kept, left


def group_column(table: pd.DataFrame, by: Sequence[str] = ()) -> str:
    """Column of a map's table that tells groups of its fitted curves apart, none of `by`; "" without one."""
    fitted = table[table["status"] == FITTED]
    there = (name for name in _GROUPS if name in table.columns and name not in by)
    return next((name for name in there if len(set(fitted[name].dropna())) > 1), "")


def _refused(doubtful: str) -> tuple[str, ...]:
    """Verdicts that leave a curve out: a rejected model says nothing of the sample, a doubtful one may be kept."""
    if doubtful not in (_KEEP, _DROP):
        raise InputError(f"doubtful must be {_KEEP!r} or {_DROP!r}; got {doubtful!r}")
    return (REJECT,) if doubtful == _KEEP else (REJECT, CHECK)


def select_results(
    results: Sequence[Labelled], parameter: str, by: Sequence[str], group: str | None, doubtful: str
) -> tuple[list[LabelledCurve], list[LeftOut]]:
    """Curves of fits, profiles or posteriors that are used, and those left out with the reason.

    Parameters
    ----------
    results : sequence of (labels, result)
        Labels by column, and a `Fit`, a profile or a `Posterior`.
    parameter, by, group, doubtful
        As in `population`.

    Raises
    ------
    InputError
        If a label is missing, the parameter is not free, or the results are of different models.
    """
    _require_pairs(results)
    kept: list[LabelledCurve] = []
    left: list[LeftOut] = []
    refused = _refused(doubtful)
    frees = {_free(found) for _, found in results}
    if len(frees) > 1:
        raise InputError(
            "the results have different free parameters, so their likelihoods do not mean the same: "
            + "; ".join(", ".join(names) for names in sorted(frees)[:_LISTED])
        )
    models = {model for _, found in results if (model := _model(found))}
    if len(models) > 1:
        raise InputError(
            "the results are of different tests, so their values do not mean the same: "
            + "; ".join(sorted(models)[:_LISTED])
        )
    for number, (labels, found) in enumerate(results):
        for column in [*([] if group is None else [group]), *by]:
            if not str(labels.get(column, "")).strip():
                raise InputError(
                    f"result {number} has no label {column!r}; it has {', '.join(labels) or 'none'}"
                )
        head = "" if group is None else str(labels[group])
        verdict = (found.fit if isinstance(found, LikelihoodProfile) else found).verdict.word
        if verdict in refused:
            left.append(LeftOut(head, f"result {number}", f"verdict {verdict}"))
            continue
        own = tuple(str(labels[column]) for column in by)
        kept.append(LabelledCurve(head, own, _likelihood(found, parameter)))
    return kept, left


def _require_pairs(results: object) -> None:
    entries = list(results) if isinstance(results, Iterable) else [results]
    for entry in entries:
        pair = entry if isinstance(entry, tuple | list) and len(entry) == 2 else (None, None)
        if not (isinstance(pair[0], Mapping) and isinstance(pair[1], Fit | Posterior | LikelihoodProfile)):
            raise InputError(
                "results must be the table of a map, its file, or pairs (labels, result) such as "
                f"({{'animal': '3'}}, fit), the result a Fit, a Posterior or a profile; got {entry!r:.80}"
            )


def _likelihood(found: Fit | Posterior | LikelihoodProfile, parameter: str) -> CurveLikelihood:
    if isinstance(found, Posterior):
        return CurveLikelihood.of_posterior(found, parameter)
    if isinstance(found, Fit):
        return CurveLikelihood.of_answers(found.answer, parameter)
    if found.name != parameter:
        raise InputError(f"a profile of {found.name} says nothing of {parameter}: walk that one")
    return CurveLikelihood.of_answers(found.fit.answer, parameter)


def _free(found: Fit | Posterior | LikelihoodProfile) -> tuple[str, ...]:
    return found.fit.names if isinstance(found, LikelihoodProfile) else tuple(found.names)


def _model(found: Fit | Posterior | LikelihoodProfile) -> str:
    """Classes of tip, layer and base of a result, as text; empty for a posterior without its problem."""
    problem = found.fit.problem if isinstance(found, LikelihoodProfile) else found.problem
    return " and ".join(
        f"{type(scene.indenter).__name__} on {type(scene.layer).__name__}, "
        + ("no base" if scene.substrate is None else f"base {type(scene.substrate).__name__}")
        for scene in (() if problem is None else problem.base_scenes)
    )


def _require_columns(table: pd.DataFrame, wanted: Sequence[str], parameter: str) -> None:
    columns = [str(column) for column in table.columns]
    for column in ("status", "verdict"):
        if column not in columns:
            raise InputError(f"this is not the table of a map: it has no column {column!r}")
    fitted = fitted_names(columns)
    if parameter not in fitted:
        raise InputError(f"{parameter} was not fitted in this map; fitted were {', '.join(fitted) or 'none'}")
    for column in wanted:
        if column not in columns:
            labels = [name for name in columns if name in {"animal", "group", "joint", "site", "sample"}]
            raise InputError(
                f"the table has no column {column!r}"
                + (f"; it has {', '.join(labels)}" if labels else "")
                + ". Labels come from the manifest of the map, or from its folders (--folders)"
            )


def _label(row: Mapping[Any, Any], column: str) -> str:
    value = row[column]
    text = "" if value is None or value != value else str(value).strip()  # noqa: PLR0124  NaN
    if not text:
        raise InputError(f"row {row.get('name', '')!r} has no {column}: give each curve one in the manifest")
    return text


def _error(row: Mapping[Any, Any], parameter: str) -> float:
    """Standard error (SI) of a row of a map, from its statistical interval in the logarithm or its error column."""
    if f"{parameter}.stderr" in row:
        return float(row[f"{parameter}.stderr"])
    low, high = (float(row[f"{parameter}.stat.{end}"]) for end in ("low", "high"))
    if not 0.0 < low < high:
        return math.nan
    return float(row[parameter]) * 0.5 * math.log(high / low) / NORMAL_95


def _normal(row: Mapping[Any, Any], parameter: str, name: str) -> CurveLikelihood:
    value, error = float(row[parameter]), _error(row, parameter)
    if not (value > 0.0 and error > 0.0 and math.isfinite(value) and math.isfinite(error)):
        raise InputError(
            f"row {name!r} has {parameter} = {value!r} with standard error {error!r}: a population is of the "
            "logarithm of a positive number with an error"
        )
    return CurveLikelihood.normal(value, error)
