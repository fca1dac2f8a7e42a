"""What many curves say of a population: mean, spread between animals and within, differences of groups.

Curves of one animal are not independent: with five animals of twenty sites each, spread 30 % between and 20 %
within, an interval that takes them so covers the mean in 37 of 100 studies where it claims 95. The model here
has a spread for every level (`levels`), keeps the whole likelihood of every curve (`likelihood`), open ones too,
and sums over the spreads; beside it stands the plain t interval of the animals' means, which needs no prior.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.population.levels import Density, GroupModel
from underlay.inference.population.selection import (
    Labelled,
    LabelledCurve,
    LeftOut,
    select_results,
    select_rows,
)

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Comparison", "Group", "Population", "population"]

_ENDS = np.array([0.025, 0.5, 0.975])
# A spread is told by an upper limit where it may be none: less than this has more than that probability.
_NO_SPREAD, _MAY_BE_NONE = 0.05, 0.05
_TAILS = ("normal", "outliers")


@dataclass(frozen=True)
class Spread:
    """Spread of ln of the parameter at one level: its median and 95 % interval, or an upper limit alone.

    Parameters
    ----------
    level : str
        Whose spread: "animal" says how animals differ, "curve" how curves of one innermost unit do.
    median, low, high : float
        As shares: 0.2 is 20 %. `low` is zero where there may be none, and `high` a one-sided limit then.
    """

    level: str
    median: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Group:
    """One group of a population.

    Parameters
    ----------
    name : str
        Empty where the population has no groups.
    mean, low, high : float
        Geometric mean (SI) with its 95 % interval; an end that is not there is zero or infinite.
    spreads : tuple of Spread
        Outermost level first, curves last.
    units : int
        How many outermost units (animals); zero without labels.
    curves, open_curves : int
        How many curves count, and how many of them have an open end.
    curve_error : float
        Median standard error of ln of a curve.
    plain : tuple of float
        Mean, low and high by the t interval of the animals' means, without a prior; not-a-number for fewer
        than two.
    unit_values : DataFrame
        Per outermost unit: ``mean``, ``low``, ``high`` (SI, drawn towards the group's mean), ``own`` (its
        curves alone), ``curves``.
    density : Density
        Posterior of ln of the mean, without the error that all curves share.
    plain_moments : tuple
        Of ln of the plain mean: value, variance, degrees of freedom.
    """

    name: str
    mean: float
    low: float
    high: float
    spreads: tuple[Spread, ...]
    units: int
    curves: int
    open_curves: int
    curve_error: float
    plain: tuple[float, float, float]
    unit_values: pd.DataFrame
    density: Density
    plain_moments: tuple[float, float, int]


@dataclass(frozen=True)
class Comparison:
    """One group over another.

    Parameters
    ----------
    name, reference : str
        The two groups.
    ratio, low, high : float
        Of the geometric means, with the 95 % interval.
    probability_above : float
        That the ratio exceeds one.
    plain : tuple of float
        Ratio, low and high by Welch's interval of the animals' means.
    """

    name: str
    reference: str
    ratio: float
    low: float
    high: float
    probability_above: float
    plain: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Population:
    """Result of `population`.

    Parameters
    ----------
    parameter : str
        What it is of.
    by : tuple of str
        Levels, outermost first.
    groups : mapping of str to Group
        By name, in the order in which they came; one with an empty name without groups.
    comparisons : tuple of Comparison
        Every group over every earlier one.
    left_out : tuple of LeftOut
        Curves that do not count, and why.
    shared_error : float
        Relative error that all curves share (radius, spring constant): in every mean, in no ratio.
    """

    parameter: str
    by: tuple[str, ...]
    groups: Mapping[str, Group]
    comparisons: tuple[Comparison, ...]
    left_out: tuple[LeftOut, ...]
    shared_error: float

    def table(self) -> pd.DataFrame:
        """One row per group (SI): means and spreads with the ends of their intervals."""
        import pandas as pd  # noqa: PLC0415  where a table is asked for

        rows = {}
        for name, group in self.groups.items():
            row: dict[str, float] = {
                "units": group.units,
                "curves": group.curves,
                "mean": group.mean,
                "low": group.low,
                "high": group.high,
                "plain mean": group.plain[0],
                "plain low": group.plain[1],
                "plain high": group.plain[2],
            }
            for spread in group.spreads:
                row |= {
                    f"spread {spread.level}": spread.median,
                    f"spread {spread.level} low": spread.low,
                    f"spread {spread.level} high": spread.high,
                }
            rows[name] = row
        return pd.DataFrame.from_dict(rows, orient="index")

    def sentences(self) -> list[str]:
        """What a reader must know beside the numbers: left out, too few, no scatter beyond the errors."""
        said = []
        if self.left_out:
            total = sum(group.curves for group in self.groups.values()) + len(self.left_out)
            by_reason = Counter((left.group, left.reason) for left in self.left_out)
            parts = [
                f"{count} {reason}" + (f" in {group}" if group else "")
                for (group, reason), count in by_reason.items()
            ]
            said.append(f"Left out: {len(self.left_out)} of {total} curves ({', '.join(parts)}).")
            if len({left.group for left in self.left_out}) < len(self.groups):
                said.append("Groups lost curves unequally: their ratio may be biased.")
        for name, group in self.groups.items():
            of = f"{name}: " if name else ""
            said += [of + sentence for sentence in self._of_group(group)]
        return said

    def _of_group(self, group: Group) -> list[str]:
        said = []
        level = self.by[0] if self.by else ""
        if not self.by:
            said.append("The interval is for these sites: nothing here says how samples differ.")
        elif group.units == 1:
            said.append(
                f"One {level} alone: nothing here says how {level}s differ; the interval rests on the prior."
            )
        elif group.units == 2:
            said.append(f"Two {level}s: the spread between them is mostly the prior's.")
        if group.open_curves:
            said.append(
                f"{group.open_curves} of {group.curves} curves are open to one side; they count as that."
            )
        if all(spread.low == 0.0 for spread in group.spreads):
            limits = ", ".join(f"{spread.level} < {100.0 * spread.high:.0f} %" for spread in group.spreads)
            said.append(f"No scatter beyond the errors of the curves ({limits}).")
        return said


def population(
    results: pd.DataFrame | str | os.PathLike[str] | Sequence[Labelled],
    by: Sequence[str] = ("animal",),
    parameter: str = "layer.E",
    *,
    group: str | None = None,
    doubtful: str = "keep",
    tails: str = "normal",
    shared_error: float = 0.0,
) -> Population:
    """Mean and spread of a population from curves at several sites of several animals.

    Parameters
    ----------
    results : DataFrame, path, or sequence of (labels, result)
        The table of a map (`fit_many`), its file, or pairs of labels by column and a `Fit`, a profile or a
        `Posterior`, whose prior is divided out.
    by : sequence of str
        Columns that say whose a curve is, outermost level first: ``["animal", "joint"]``. None takes all
        curves for independent and speaks of these sites only.
    parameter : str
        A positive parameter; its logarithm is what is normal.
    group : str, optional
        Column of the groups that are compared. "rat 1" in two groups is two animals.
    doubtful : str
        "keep" counts curves with a doubtful verdict, "drop" leaves them out; how many is said.
    tails : str
        "normal", or "outliers": a tenth of the curves may lie five spreads off.
    shared_error : float
        Relative error that all curves have in common, such as that of the tip's radius times its effect: it
        does not average out, and is in every mean but in no ratio of groups.

    Raises
    ------
    InputError
        If a column or a label is missing, the parameter was not fitted, a group has fewer than two curves, or
        the results are of different models.

    Notes
    -----
    Levels nest: ln p = mean of the group + step of the animal + step of the site + step of the curve, each
    normal, with priors on the spreads (half-Cauchy 0.3 between, half-t4 0.5 within; separate per group) and
    none on the mean. The interval without a prior is Student's on the animals' means, that of a ratio Welch's.
    """
    names = tuple(by)
    if tails not in _TAILS:
        raise InputError(f"tails must be one of {', '.join(_TAILS)}; got {tails!r}")
    if not (math.isfinite(shared_error) and 0.0 <= shared_error < 1.0):
        raise InputError(f"shared_error is a relative error, 0 to 1; got {shared_error!r}")
    curves, left = _selected(results, parameter, names, group, doubtful)
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
        name: _group(name, members, names, outliers=tails == "outliers", shared=shared_error)
        for name, members in groups.items()
    }
    ordered = list(found.values())
    comparisons = [
        _compared(later, earlier) for place, later in enumerate(ordered) for earlier in ordered[:place]
    ]
    return Population(parameter, names, found, tuple(comparisons), tuple(left), float(shared_error))


def _selected(
    results: pd.DataFrame | str | os.PathLike[str] | Sequence[Labelled],
    parameter: str,
    by: Sequence[str],
    group: str | None,
    doubtful: str,
) -> tuple[list[LabelledCurve], list[LeftOut]]:
    if isinstance(results, str | os.PathLike):
        from underlay.inference.batch.map_table import read_map  # noqa: PLC0415  brings pandas

        return select_rows(read_map(results), parameter, by, group, doubtful)
    if isinstance(results, Sequence):
        return select_results(results, parameter, by, group), []
    return select_rows(results, parameter, by, group, doubtful)


def _group(
    name: str, members: Sequence[LabelledCurve], by: Sequence[str], *, outliers: bool, shared: float
) -> Group:
    import pandas as pd  # noqa: PLC0415  where a table is made

    if len(members) < 2:
        raise InputError(
            f"group {name!r} has one curve: a population needs two, of different {by[0] if by else 'site'}s"
        )
    model = GroupModel(
        [member.likelihood for member in members], [member.labels for member in members], outliers=outliers
    )
    low, middle, high = _physical(_widened(model.mean, shared).quantile(_ENDS))
    spreads = tuple(_spread(model, level, label) for level, label in enumerate((*by, "curve")))
    errors = np.array([member.likelihood.error for member in members])
    values, moments = pd.DataFrame(), _plain_of_curves(model)
    if by:
        centre, deviation = model.unit_values()
        own, own_variance = model.own_values([spread.median for spread in spreads[1:]])
        labels = [" / ".join(unit) for unit in model.units.names[0]]
        counted = Counter(member.labels[0] for member in members)
        values = pd.DataFrame(
            {
                "mean": np.exp(centre),
                "low": np.exp(centre - 1.96 * deviation),
                "high": np.exp(centre + 1.96 * deviation),
                "own": np.exp(own),
                "curves": [counted[unit[0]] for unit in model.units.names[0]],
            },
            index=labels,
        )
        moments = _moments(own, own_variance, spreads[0].median)
    return Group(
        name,
        middle,
        low,
        high,
        spreads,
        len(values),
        len(members),
        sum(member.likelihood.is_open for member in members),
        float(np.median(errors)),
        _plain(moments, shared),
        values,
        model.mean,
        moments,
    )


def _spread(model: GroupModel, level: int, label: str) -> Spread:
    grid = model.spreads
    low, median, high = (float(end) for end in grid.quantile(level, _ENDS))
    if grid.probability_below(level, _NO_SPREAD) > _MAY_BE_NONE:
        return Spread(label, median, 0.0, float(grid.quantile(level, np.array([0.95]))[0]))
    return Spread(label, median, low, high)


def _plain_of_curves(model: GroupModel) -> tuple[float, float, int]:
    middles = np.array([curve.middle for curve in model.curves])
    return _moments(middles, np.ones(len(middles)), 1e6)


def _moments(values: FloatArray, variances: FloatArray, between: float) -> tuple[float, float, int]:
    """Weighted mean of units, variance of that mean from their scatter, and degrees of freedom.

    Weights go by each unit's own variance and the spread between units, as in the interval of Hartung and Knapp
    (2001).
    """
    weights = 1.0 / (variances + between**2)
    weights /= weights.sum()
    mean = float(weights @ values)
    freedom = len(values) - 1
    variance = float(weights @ (values - mean) ** 2) / freedom if freedom else math.nan
    return mean, variance, freedom


def _plain(moments: tuple[float, float, int], shared: float) -> tuple[float, float, float]:
    mean, variance, freedom = moments
    if not freedom:
        return math.exp(mean), math.nan, math.nan
    half = float(special.stdtrit(freedom, _ENDS[2])) * math.sqrt(variance + shared**2)
    return math.exp(mean), math.exp(mean - half), math.exp(mean + half)


def _compared(later: Group, earlier: Group) -> Comparison:
    difference = later.density.minus(earlier.density)
    low, middle, high = _physical(difference.quantile(_ENDS))
    above = float(difference.shares[difference.x > 0.0].sum())
    return Comparison(later.name, earlier.name, middle, low, high, above, _welch(later, earlier))


def _welch(later: Group, earlier: Group) -> tuple[float, float, float]:
    (a, va, fa), (b, vb, fb) = later.plain_moments, earlier.plain_moments
    if not (fa and fb):
        return math.exp(a - b), math.nan, math.nan
    freedom = (va + vb) ** 2 / (va**2 / fa + vb**2 / fb)
    half = float(special.stdtrit(freedom, _ENDS[2])) * math.sqrt(va + vb)
    return math.exp(a - b), math.exp(a - b - half), math.exp(a - b + half)


def _physical(ends: FloatArray) -> tuple[float, ...]:
    """The parameter of its logarithm; no end stays none."""
    return tuple(math.exp(end) if end < math.inf else math.inf for end in ends.tolist())


def _widened(density: Density, shared: float) -> Density:
    """Density with an error that all curves share."""
    if not shared:
        return density
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    moved = Density(shared * nodes, weights / weights.sum())
    return density.minus(moved)
