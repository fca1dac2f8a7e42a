"""The result of `population`: groups, their spreads, their ratios, and sentences on their limits."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from underlay._arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd

#: A value, and the low and the high end of its 95 % interval.
Triple = tuple[float, float, float]
# Probability below the upper end of a 95 % interval, and that end of a standard normal distribution.
_UPPER = 0.975
_NORMAL = float(special.ndtri(_UPPER))
# Share of the largest probability below which a place is left out, and number of places of a difference.
_NOTHING, _DIFFERENCES = 1e-10, 1600


@dataclass(frozen=True)
class LeftOut:
    """One curve that is not used: its group, its name, and why."""

    group: str
    name: str
    reason: str


@dataclass(frozen=True)
class Variance:
    """A variance, and its degrees of freedom, infinite where it was stated and not estimated."""

    value: float
    freedom: float

    @classmethod
    def sum_of(cls, parts: Sequence[Variance]) -> Variance:
        """Sum of independent variances (Satterthwaite 1946, Welch 1947)."""
        value = sum(part.value for part in parts)
        lost = sum(part.value**2 / part.freedom for part in parts if part.value)
        return cls(value, value**2 / lost if lost else math.inf)

    @property
    def half(self) -> float:
        """Half-width of the 95 % interval of a number with this variance, by Student's t."""
        quantile = _NORMAL if math.isinf(self.freedom) else float(special.stdtrit(self.freedom, _UPPER))
        return quantile * math.sqrt(self.value)


@dataclass(frozen=True)
class PlainMean:
    """Logarithm of a mean of a few units, or of a ratio of two means, with Student's interval and no prior.

    Values x_j of J units (animals) with weights w_j that sum to one have the mean m = sum w_j x_j and, whatever the
    spread of the units (Hartung and Knapp 2001, doi 10.1002/sim.1009), the interval

        m +- t_(J-1) sqrt( sum w_j (x_j - m)^2 / (J - 1) ),

    t being Student's quantile. Two to five units may agree by chance, and that interval then has no width, though
    no unit is known so well: each x_j has its own variance v_j, from the errors and the scatter of its curves. For
    units that do not differ at all the interval is

        m +- t_f sqrt( sum w_j^2 v_j ),

    with f degrees of freedom: stated errors cost none (t is normal then), the scatter within units has as many as
    there are curves beyond the first of each unit, combined after Satterthwaite (1946). Units that differ have a
    longer one, so the longer of the two contains the mean at least as often as the first. An error that all curves
    share adds in quadrature, by the normal distribution: it is stated, not estimated.

    Parameters
    ----------
    value : float
        The logarithm.
    scatter : Variance or None
        Variance of the logarithm from the scatter of the units; None where there is one unit only.
    within : Variance
        Variance if units did not differ: from the errors of the curves and their scatter within units.
    """

    value: float
    scatter: Variance | None
    within: Variance

    @classmethod
    def of_units(cls, values: FloatArray, weights: FloatArray, within: Variance) -> PlainMean:
        """Mean of values (units,) with weights (units,), which are normalised."""
        shares = weights / weights.sum()
        mean, freedom = float(shares @ values), len(values) - 1
        scatter = Variance(float(shares @ (values - mean) ** 2) / freedom, freedom) if freedom else None
        return cls(mean, scatter, within)

    def over(self, other: PlainMean) -> PlainMean:
        """Logarithm of the ratio to another, independent mean."""
        scatter = None
        if self.scatter is not None and other.scatter is not None:
            scatter = Variance.sum_of([self.scatter, other.scatter])
        return PlainMean(self.value - other.value, scatter, Variance.sum_of([self.within, other.within]))

    @property
    def variance(self) -> Variance | None:
        """The variance with the longer interval, of `scatter` and `within`; None where there is one unit only."""
        return None if self.scatter is None else max(self.scatter, self.within, key=lambda one: one.half)

    @property
    def agrees_by_chance(self) -> bool:
        """Whether the units scatter less than their own errors alone would make them."""
        return self.scatter is not None and self.scatter.half < self.within.half

    def interval(self, shared: float = 0.0) -> Triple:
        """Mean and ends of its 95 % interval, as the parameter; the ends are nan where there is one unit.

        `shared` is the standard error of the logarithm that all curves have in common.
        """
        if self.variance is None:
            return math.exp(self.value), math.nan, math.nan
        half = math.hypot(self.variance.half, _NORMAL * shared)
        return math.exp(self.value), math.exp(self.value - half), math.exp(self.value + half)

    def probability_above(self) -> float:
        """Probability that the logarithm exceeds zero, one minus its one-sided p-value; nan for one unit."""
        if self.variance is None or not self.variance.value:
            return math.nan
        z = self.value / math.sqrt(self.variance.value)
        freedom = self.variance.freedom
        return float(special.ndtr(z) if math.isinf(freedom) else special.stdtr(freedom, z))


@dataclass(frozen=True)
class Density:
    """Posterior density of ln of a mean: places `x` and the probability of each, `shares`, (x,) each."""

    x: FloatArray
    shares: FloatArray

    def quantile(self, shares: FloatArray) -> FloatArray:
        """Quantiles, same shape as `shares`; infinite where the density does not vanish at the end of the grid."""
        below = np.cumsum(self.shares)
        edges = np.concatenate([0.5 * (self.x[1:] + self.x[:-1]), [self.x[-1]]])
        places = np.interp(shares, below, edges)
        places = np.where(shares < below[0], -np.inf, places)
        return np.where(shares > below[-2], np.inf, places)

    @property
    def _held(self) -> tuple[FloatArray, FloatArray]:
        """Places from the first to the last with a non-negligible probability, and their probabilities."""
        some = np.flatnonzero(self.shares > _NOTHING * self.shares.max())
        held = slice(some[0], some[-1] + 1)
        return self.x[held], self.shares[held]

    def minus(self, other: Density) -> Density:
        """Density of the difference of two independent quantities."""
        (mine, own), (theirs, others) = self._held, other._held
        low, high = mine[0] - theirs[-1], mine[-1] - theirs[0]
        step = (high - low) / _DIFFERENCES
        shares = np.convolve(_evenly(mine, own, step), _evenly(-theirs[::-1], others[::-1], step))
        return Density(low + step * np.arange(len(shares)), shares)


def _evenly(x: FloatArray, shares: FloatArray, step: float) -> FloatArray:
    """Probabilities on an even grid from x[0] on: each is split between two neighbours so that the mean is kept."""
    cells = (x - x[0]) / step
    below = cells.astype(int)
    part = cells - below
    size = int(below[-1]) + 2
    lower = np.bincount(below, shares * (1.0 - part), size)
    upper = np.bincount(below + 1, shares * part, size)
    return np.asarray(lower + upper, dtype=np.float64)


@dataclass(frozen=True)
class Spread:
    """Spread of ln of the parameter at one level: its median and 95 % interval, or an upper limit only.

    Parameters
    ----------
    level : str
        Level whose units differ so: "animal" for animals, "curve" for curves of one innermost unit.
    median, low, high : float
        Relative: 0.2 is 20 %. Where there may be no spread `low` is zero, and `high` a one-sided limit.
    """

    level: str
    median: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class _TwoWays:
    """A number estimated by the model and without a prior, and whether the second is preferred."""

    name: str
    modelled: Triple
    plain: Triple
    leads_plain: bool

    @property
    def low(self) -> float:
        """Low end of the preferred 95 % interval; zero where there is none."""
        return self._first[1]

    @property
    def high(self) -> float:
        """High end of the preferred 95 % interval; infinite where there is none."""
        return self._first[2]

    @property
    def _first(self) -> Triple:
        return self.plain if self.leads_plain else self.modelled


@dataclass(frozen=True, eq=False)
class Group(_TwoWays):
    """One group of a population.

    Parameters
    ----------
    name : str
        Empty where the population has no groups.
    modelled : tuple of float
        Geometric mean (SI), low and high end of its 95 % interval by the hierarchical model, with its priors on the
        spreads; zero or infinite for ends that do not exist.
    plain : tuple of float
        That mean by the t interval of the animals' means, or by the errors of their curves where that is longer;
        without a prior; nan for fewer than two animals.
    leads_plain : bool
        Whether `plain` is preferred: for two to five animals, whose spread the prior would decide.
    spreads : tuple of Spread
        Outermost level first, curves last.
    units : int
        Number of outermost units (animals); zero without labels.
    curves, open_curves : int
        Number of curves used, and of those with an open end.
    curve_error : float
        Median standard error of ln of the parameter of one curve.
    unit_values : DataFrame
        Per outermost unit: ``mean``, ``low``, ``high`` (SI, shrunk towards the group's mean), ``own`` (from its
        curves alone), ``curves`` (their number).
    density : Density
        Posterior of ln of the mean, without the error that all curves share.
    plain_mean : PlainMean
        Logarithm of the mean without a prior, with its variances and their degrees of freedom.
    errors_explain_all : bool
        Whether the errors of the curves may explain all of their scatter.
    """

    spreads: tuple[Spread, ...]
    units: int
    curves: int
    open_curves: int
    curve_error: float
    unit_values: pd.DataFrame
    density: Density
    plain_mean: PlainMean
    errors_explain_all: bool

    @property
    def mean(self) -> float:
        """Preferred geometric mean (SI)."""
        return self._first[0]


@dataclass(frozen=True)
class Comparison(_TwoWays):
    """Ratio of one group to another.

    Parameters
    ----------
    name : str
        The later group, the numerator.
    modelled : tuple of float
        Ratio of the geometric means, low and high end of its 95 % interval by the model, with its priors.
    plain : tuple of float
        That ratio by Welch's interval of the animals' means, or by the errors of their curves where that is longer;
        without a prior.
    leads_plain : bool
        Whether `plain` is preferred: where one of the groups has few animals.
    reference : str
        The earlier group, the denominator.
    probability_above : float
        Probability that the ratio exceeds one, by the preferred interval.
    """

    reference: str
    probability_above: float

    @property
    def ratio(self) -> float:
        """Preferred ratio of the geometric means."""
        return self._first[0]


@dataclass(frozen=True, eq=False)
class Population:
    """Result of `population`.

    Parameters
    ----------
    parameter : str
        The parameter whose means and spreads these are.
    by : tuple of str
        Levels, outermost first.
    groups : mapping of str to Group
        By name, in the order in which they came; one with an empty name without groups.
    comparisons : tuple of Comparison
        Every group over every earlier one.
    left_out : tuple of LeftOut
        Curves that are not used, and why.
    shared_error : float
        Relative error that all curves share (radius, spring constant): in every mean, in no ratio.
    apart : str
        Column of the table that tells groups apart which are taken together here; empty where there is none.
    """

    parameter: str
    by: tuple[str, ...]
    groups: Mapping[str, Group]
    comparisons: tuple[Comparison, ...]
    left_out: tuple[LeftOut, ...]
    shared_error: float
    apart: str = ""

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
                **_three("modelled", "mean", group.modelled),
                **_three("plain", "mean", group.plain),
            }
            for spread in group.spreads:
                row |= {
                    f"spread {spread.level}": spread.median,
                    f"spread {spread.level} low": spread.low,
                    f"spread {spread.level} high": spread.high,
                }
            rows[name] = row
        return pd.DataFrame.from_dict(rows, orient="index")

    def ratios(self) -> pd.DataFrame:
        """One row per comparison: the preferred ratio with its interval, and both estimates."""
        import pandas as pd  # noqa: PLC0415  where a table is asked for

        return pd.DataFrame(
            [
                {
                    "group": pair.name,
                    "over": pair.reference,
                    "ratio": pair.ratio,
                    "low": pair.low,
                    "high": pair.high,
                    "P(ratio > 1)": pair.probability_above,
                    **_three("modelled", "ratio", pair.modelled),
                    **_three("plain", "ratio", pair.plain),
                }
                for pair in self.comparisons
            ]
        )

    def __str__(self) -> str:
        numbers = [
            f"{name or self.parameter}: {own.mean:.4g} ({own.low:.4g} to {own.high:.4g}), {own.curves} curves"
            for name, own in self.groups.items()
        ]
        return "\n".join([*numbers, *self.sentences()])

    def sentences(self) -> list[str]:
        """Sentences that belong to the numbers: curves left out, few animals, no scatter beyond the errors."""
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
        elif group.leads_plain:
            said.append(
                f"{group.units} {level}s are too few to measure how much {level}s differ: the interval is "
                "Student's t of their means, without a prior."
            )
            if group.plain_mean.agrees_by_chance:
                said.append(
                    f"The {level}s agree better than what is known of each lets them but by chance: the interval "
                    f"is what the errors of their curves and the scatter within each {level} leave."
                )
        if group.open_curves:
            said.append(
                f"{group.open_curves} of {group.curves} curves are open to one side; they count as that."
            )
        if group.errors_explain_all:
            limits = ", ".join(f"{spread.level} < {100.0 * spread.high:.0f} %" for spread in group.spreads)
            said.append(f"No scatter beyond the errors of the curves ({limits}).")
        return said


def _three(way: str, what: str, found: Triple) -> dict[str, float]:
    return dict(zip((f"{way} {what}", f"{way} low", f"{way} high"), found, strict=True))
