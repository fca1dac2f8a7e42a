"""The mean of a few units without a prior: Student's interval of their values, and what it may not fall short of.

Values x_j of units (animals) with weights w_j that sum to one have the mean m = sum w_j x_j, and, whatever the
units differ by, (Hartung and Knapp 2001, doi 10.1002/sim.1009)

    m +- t_(J-1) sqrt( sum w_j (x_j - m)^2 / (J - 1) ).

Of two to five units some agree by chance, and that interval has no width then, though no unit is known so well:
each x_j has a variance v_j of its own, by the errors of its curves and by what they scatter. Units that do not
differ at all leave

    m +- t_f sqrt( sum w_j^2 v_j ),

with f degrees of freedom: none are lost to the stated errors (t is normal then), as many as there are curves beyond
the first of each unit to the scatter within, both after Satterthwaite (1946). Units that differ leave more, so the
longer of the two holds the mean at least as often as the first, and whatever their agreement where they do not
differ. An error that all share adds in quadrature, by the normal distribution: it is stated, not found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy import special

from underlay._arrays import FloatArray

__all__ = ["PlainMean", "Triple", "Variance"]

#: What is found, and the low and the high end of its 95 % interval.
Triple = tuple[float, float, float]

_UPPER = 0.975
_NORMAL = float(special.ndtri(_UPPER))


@dataclass(frozen=True)
class Variance:
    """A variance, and the degrees of freedom with which it was found; infinite where it was stated."""

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
        """Half of the 95 % interval of what has this variance."""
        quantile = _NORMAL if math.isinf(self.freedom) else float(special.stdtrit(self.freedom, _UPPER))
        return quantile * math.sqrt(self.value)


@dataclass(frozen=True)
class PlainMean:
    """Logarithm of a mean, or of a ratio of two, without a prior.

    Parameters
    ----------
    value : float
        The logarithm.
    scatter : Variance or None
        Its variance by how the units scatter; none where one unit is all there is.
    within : Variance
        Its variance if units did not differ: by the errors of the curves and their scatter within units.
    """

    value: float
    scatter: Variance | None
    within: Variance

    @classmethod
    def of_units(cls, values: FloatArray, weights: FloatArray, within: Variance) -> PlainMean:
        """Mean of units (units,) with weights (units,), which are made to sum to one."""
        shares = weights / weights.sum()
        mean, freedom = float(shares @ values), len(values) - 1
        scatter = Variance(float(shares @ (values - mean) ** 2) / freedom, freedom) if freedom else None
        return cls(mean, scatter, within)

    def over(self, other: PlainMean) -> PlainMean:
        """Logarithm of the ratio to another, independent one."""
        scatter = None
        if self.scatter is not None and other.scatter is not None:
            scatter = Variance.sum_of([self.scatter, other.scatter])
        return PlainMean(self.value - other.value, scatter, Variance.sum_of([self.within, other.within]))

    @property
    def variance(self) -> Variance | None:
        """The variance that leaves the longer interval; none where one unit is all there is."""
        return None if self.scatter is None else max(self.scatter, self.within, key=lambda one: one.half)

    @property
    def agrees_by_chance(self) -> bool:
        """Whether the units scatter less than what is known of each allows."""
        return self.scatter is not None and self.scatter.half < self.within.half

    def interval(self, shared: float = 0.0) -> Triple:
        """Mean and ends of its 95 % interval, as the parameter; no-numbers for ends where there is one unit.

        `shared` is the standard error of the logarithm that all curves have in common.
        """
        if self.variance is None:
            return math.exp(self.value), math.nan, math.nan
        half = math.hypot(self.variance.half, _NORMAL * shared)
        return math.exp(self.value), math.exp(self.value - half), math.exp(self.value + half)

    def probability_above(self) -> float:
        """Of one minus its p: that the logarithm exceeds zero; not-a-number where there is one unit."""
        if self.variance is None or not self.variance.value:
            return math.nan
        z = self.value / math.sqrt(self.variance.value)
        freedom = self.variance.freedom
        return float(special.ndtr(z) if math.isinf(freedom) else special.stdtr(freedom, z))
