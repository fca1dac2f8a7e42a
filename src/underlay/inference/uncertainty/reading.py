"""What is read from a likelihood: an interval of one number, draws of all of them, how far to trust them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.linear import Mixture
from underlay.inference.uncertainty.mixture import weighted_quantiles

if TYPE_CHECKING:
    from underlay.inference.uncertainty.ridge import Ridge
    from underlay.inference.uncertainty.seen import Seen
    from underlay.inference.uncertainty.weighed import Weighed

__all__ = ["DrawnReading", "LinearReading", "Reading", "widened"]

# Draws of a reading in closed form, where their number is not given.
_DRAWS = 2000


@dataclass(frozen=True, eq=False)
class Reading(ABC):
    """Intervals and draws of the scaled vector of a fit.

    Parameters
    ----------
    likelihood : Weighed
        The curves of a fit, with what may disturb them weighed.
    """

    likelihood: Weighed

    @property
    def seen(self) -> tuple[Seen, ...]:
        """What is seen of each curve."""
        return self.likelihood.seen

    @property
    def value(self) -> FloatArray:
        """Scaled vector (k,) of least squares."""
        return np.asarray(self.likelihood.fit.vector)

    @property
    def corrected(self) -> FloatArray:
        """`value` less what a step, a ramp or a turn does to it where these weigh more than a half, (k,)."""
        return self.value + self._correction

    @cached_property
    def _correction(self) -> FloatArray:
        """Mean move (k,) of the hypotheses that correct the value, where they outweigh the others."""
        mixture = self.likelihood.mixture
        moves = mixture.means - self.value
        acts = np.any(moves != 0.0, axis=1)
        share = float(mixture.weights[acts].sum())
        if share <= 0.5:
            return np.zeros(len(self.value))
        return np.asarray(mixture.weights[acts] @ moves[acts] / share)

    def edge(self, level: float) -> FloatArray:  # noqa: ARG002  a closed form has no ridge
        """Scaled vectors (m, k) at the edge of what the likelihood along a ridge does not tell from its top.

        Ends of intervals reach there. Where a number is open, most of its range is far from where the others are
        sharp: draws alone, which are even over that range, then held 83 % (E, thickness and the substrate's modulus
        free, 120 curves).
        """
        return np.zeros((0, len(self.value)))

    @abstractmethod
    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """Ends of one entry of the scaled vector; infinite where the curve leaves an end open."""

    @property
    @abstractmethod
    def draws(self) -> FloatArray:
        """Scaled vectors (m, k)."""

    @property
    @abstractmethod
    def weights(self) -> FloatArray:
        """Weights (m,) of the draws, summing to 1."""

    @property
    def pareto(self) -> float:
        """Pareto k of the weights; above 0.7 the draws are not to be trusted: ask emcee (`log_density`)."""
        return 0.0

    @property
    @abstractmethod
    def deviations(self) -> FloatArray:
        """Standard deviations (k,) of the scaled vector."""

    def moved(self, columns: Sequence[FloatArray]) -> FloatArray:
        """As `Weighed.moved`."""
        return self.likelihood.moved(columns)


def widened(ends: FloatArray, edge: FloatArray) -> tuple[float, float]:
    """Two ends of draws, and the values (m,) at an edge that they must reach."""
    return float(np.min(edge, initial=ends[0])), float(np.max(edge, initial=ends[1]))


@dataclass(frozen=True, eq=False)
class LinearReading(Reading):
    """A reading in closed form: the force is straight in what is free."""

    mixture: Mixture
    rng: np.random.Generator
    count: int = _DRAWS

    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """As `Reading.interval`; open where the entry does not act."""
        if not self.deviations[index] > 0.0:
            return -np.inf, np.inf
        low, high = self.mixture.quantiles(index, np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level]))
        return float(low), float(high)

    @cached_property
    def draws(self) -> FloatArray:
        """As `Reading.draws`."""
        return self.mixture.draws(self.count, self.rng)

    @property
    def weights(self) -> FloatArray:
        """As `Reading.weights`."""
        return np.full(self.count, 1.0 / self.count)

    @cached_property
    def deviations(self) -> FloatArray:
        """As `Reading.deviations`."""
        return self.mixture.deviations


@dataclass(frozen=True, eq=False)
class DrawnReading(Reading):
    """A reading by weighted draws along the ridge."""

    ridge: Ridge

    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """As `Reading.interval`; open where the likelihood at a bound, or without end, is not below the level's."""
        shares = np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
        ends = weighted_quantiles(self.draws[:, index], self.weights, shares)
        low, high = widened(ends, self.edge(level)[:, index])
        open_low, open_high = self.ridge.open_ends(index, level)
        return (-np.inf if open_low else low), (np.inf if open_high else high)

    def edge(self, level: float) -> FloatArray:
        """As `Reading.edge`."""
        return self.ridge.edge(level)

    @property
    def draws(self) -> FloatArray:
        """As `Reading.draws`."""
        return self.ridge.draws

    @property
    def weights(self) -> FloatArray:
        """As `Reading.weights`."""
        return self.ridge.weights

    @property
    def pareto(self) -> float:
        """As `Reading.pareto`."""
        return self.ridge.pareto

    @cached_property
    def deviations(self) -> FloatArray:
        """As `Reading.deviations`."""
        off = self.draws - self.weights @ self.draws
        return np.sqrt(self.weights @ (off * off))
