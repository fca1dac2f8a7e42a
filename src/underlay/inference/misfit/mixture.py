"""The distribution of parameters that several models share by their weights."""

from __future__ import annotations

from dataclasses import dataclass

from scipy import optimize, special

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
        own = self.shift[:, entry] + self.deviation[:, entry] * special.stdtrit(self.degrees, probability)
        low, high = float(own.min()), float(own.max())
        if not high - low > 1e-12 * max(abs(low), abs(high)):
            return low
        found = optimize.brentq(
            lambda value: self.probability_below(entry, value) - probability,
            low,
            high,
            xtol=1e-9 * (high - low),
        )
        return float(found)
