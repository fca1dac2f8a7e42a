"""The distribution of parameters that several models share by their weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from underlay._arrays import FloatArray

__all__ = ["Mixture"]


@dataclass(frozen=True)
class Mixture:
    """Student-t distributions of the scaled parameters, one for each combination that weighs something.

    Parameters
    ----------
    weights : FloatArray
        They sum to one, (g,).
    shift : FloatArray
        Of the parameters from the present fit, (g, k).
    deviation : FloatArray
        Standard deviations, (g, k); zero where a part is certain.
    degrees : int
        Degrees of freedom.
    """

    weights: FloatArray
    shift: FloatArray
    deviation: FloatArray
    degrees: int

    def probability_below(self, entry: int, value: float) -> float:
        """Probability that parameter `entry` has shifted by less than `value`."""
        return float(self.weights @ special.stdtr(self.degrees, self._scaled(entry, np.array(value))))

    def quantiles(self, entry: int, probabilities: Sequence[float]) -> list[float]:
        """Shifts of parameter `entry` (scaled coordinates) below which each of the `probabilities` lies."""
        asked, deviation = np.array(probabilities), self.deviation[:, entry]
        own = self.shift[:, entry] + special.stdtrit(self.degrees, asked)[:, None] * deviation
        # Newton's method between the lowest and the highest of the parts' own quantiles, in the normal deviate of
        # the probability: that is nearly a straight line, where the probability itself is flat far out.
        low, high = own.min(axis=1), own.max(axis=1)
        near = np.maximum(1e-7 * (high - low), 1e-12 * np.maximum(np.abs(low), np.abs(high)))
        found, wanted = own @ self.weights, special.ndtri(asked)
        heights = np.divide(self.weights, deviation, out=np.zeros_like(deviation), where=deviation > 0.0)
        (going,) = np.nonzero(high - low > near)
        while going.size:
            value = found[going]
            scaled = self._scaled(entry, value[:, None])
            deviate = special.ndtri(special.stdtr(self.degrees, scaled) @ self.weights)
            beyond = deviate - wanted[going]
            low[going] = np.where(beyond > 0.0, low[going], value)
            high[going] = np.where(beyond > 0.0, value, high[going])
            logs = -0.5 * (self.degrees + 1.0) * np.log1p(np.square(scaled) / self.degrees)
            density = np.exp(logs) @ heights * self._peak
            # So far out that the probability is rounded to nothing or to one there is no slope: halve.
            sloped = np.isfinite(deviate) & (density > 0.0)
            slope = np.sqrt(2.0 * np.pi) * density * np.exp(0.5 * np.square(np.where(sloped, deviate, 0.0)))
            there = value - np.divide(beyond, slope, out=np.full_like(value, np.inf), where=sloped)
            inside = (low[going] < there) & (there < high[going])
            found[going] = np.where(inside, there, 0.5 * (low[going] + high[going]))
            # Newton's steps square: after one this short the next one is nothing.
            short = (np.abs(found[going] - value) <= near[going]) | (high - low <= near)[going]
            going = going[~short]
        return [float(each) for each in found]

    def _scaled(self, entry: int, value: FloatArray) -> FloatArray:
        """How far a value, or values (n, 1), are from the parts, in deviations; infinite from what is certain."""
        away, deviation = value - self.shift[:, entry], self.deviation[:, entry]
        beyond = np.where(away >= 0.0, np.inf, -np.inf)
        return np.asarray(np.divide(away, deviation, out=beyond, where=deviation > 0.0))

    @cached_property
    def _peak(self) -> float:
        """Density of Student's t at zero."""
        half = 0.5 * self.degrees
        return float(
            np.exp(special.gammaln(half + 0.5) - special.gammaln(half)) / np.sqrt(2.0 * np.pi * half)
        )
