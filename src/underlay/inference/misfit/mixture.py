"""The distribution of parameters that several models share by their weights."""

from __future__ import annotations

from dataclasses import dataclass

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
        Standard deviations, (g, k).
    degrees : int
        Degrees of freedom.
    """

    weights: FloatArray
    shift: FloatArray
    deviation: FloatArray
    degrees: int

    def probability_below(self, entry: int, value: float) -> float:
        """Probability that parameter `entry` has shifted by less than `value`."""
        scaled = (value - self.shift[:, entry]) / self.deviation[:, entry]
        return float(self.weights @ special.stdtr(self.degrees, scaled))

    def quantile(self, entry: int, probability: float) -> float:
        """Shift of parameter `entry` (scaled coordinates) below which `probability` lies."""
        deviation = self.deviation[:, entry]
        own = self.shift[:, entry] + deviation * special.stdtrit(self.degrees, probability)
        # Newton's method between the lowest and the highest of the parts' own quantiles.
        low, high = float(own.min()), float(own.max())
        near = 1e-7 * (high - low)
        value = float(self.weights @ own)
        while high - low > max(near, 1e-12 * max(abs(low), abs(high))):
            beyond = self.probability_below(entry, value) - probability
            low, high = (low, value) if beyond > 0.0 else (value, high)
            scaled = (value - self.shift[:, entry]) / deviation
            logs = -0.5 * (self.degrees + 1.0) * np.log1p(np.square(scaled) / self.degrees)
            density = float((self.weights / deviation) @ np.exp(logs)) * self._peak
            step = -beyond / density if density > 0.0 else np.inf
            if not low < value + step < high:
                step = 0.5 * (low + high) - value
            elif abs(step) <= near:
                # Steps square: the next one is nothing.
                return value + step
            value += step
        return value

    @property
    def _peak(self) -> float:
        """Density of Student's t at zero."""
        half = 0.5 * self.degrees
        return float(
            np.exp(special.gammaln(half + 0.5) - special.gammaln(half)) / np.sqrt(2.0 * np.pi * half)
        )
