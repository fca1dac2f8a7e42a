"""Selects the curves of a map's table, or of results, that a population uses, with labels and likelihoods."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from underlay.errors import InputError
from underlay.inference.batch.decisions import ACCEPT, REFUSED_BY_HAND
from underlay.inference.batch.results_table import FITTED, LIKELIHOOD, fitted_names
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.population.likelihood import CurveLikelihood
from underlay.inference.profiling.profile_result import LikelihoodProfile
from underlay.inference.sampling.posterior import Posterior
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.inference.uncertainty.verdict import CHECK, REJECT

if TYPE_CHECKING:
    import pandas as pd

#: Labels by column, with the result of one curve.
Labelled: TypeAlias = tuple[Mapping[str, str], Fit | Posterior | LikelihoodProfile]
# Largest number of names that a message lists.
_LISTED = 4
_KEEP, _DROP = "keep", "drop"
# Names of columns that tell groups apart, which a population compares.
_GROUPS = ("group", "treatment", "condition")


@dataclass(frozen=True)
class LabelledCurve:
    """One curve that is used: its group, its labels (outermost first), its likelihood."""

    group: str
    labels: tuple[str, ...]
    likelihood: CurveLikelihood


@dataclass(frozen=True)
class LeftOut:
    """One curve that is not used: its group, its name, and why."""

    group: str
    name: str
    reason: str


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


def _refused(doubtful: str) -> tuple[str, ...]:
    """Verdicts that leave a curve out: a rejected model says nothing of the sample, a doubtful one may be kept."""
    if doubtful not in (_KEEP, _DROP):
        raise InputError(f"doubtful must be {_KEEP!r} or {_DROP!r}; got {doubtful!r}")
    return (REJECT,) if doubtful == _KEEP else (REJECT, CHECK)


def group_column(table: pd.DataFrame, by: Sequence[str] = ()) -> str:
    """Column of a map's table that tells groups of its fitted curves apart, none of `by`; "" without one."""
    fitted = table[table["status"] == FITTED]
    there = (name for name in _GROUPS if name in table.columns and name not in by)
    return next((name for name in there if len(set(fitted[name].dropna())) > 1), "")


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
