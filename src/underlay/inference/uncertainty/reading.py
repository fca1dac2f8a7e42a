"""Intervals and draws of the fitted numbers from a likelihood, in closed form or by importance sampling."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.mixture import Mixture, weighted_quantiles

if TYPE_CHECKING:
    from underlay.inference.uncertainty.ridge import Ridge

# Default number of draws of a result in closed form.
_DRAWS = 2000


@dataclass(frozen=True, eq=False)
class Reading(ABC):
    """Intervals and draws of the scaled vector of a fit.

    Parameters
    ----------
    likelihood : Likelihood
        The curves of a fit, with the probabilities of what may disturb them.
    """

    likelihood: Any

    @property
    def value(self) -> FloatArray:
        """Scaled vector (k,) of the least-squares fit."""
        return np.asarray(self.likelihood.fit.vector)

    @cached_property
    def corrected(self) -> FloatArray:
        """`value`; the value without a step, a ramp or a turn that has a probability above one half, (k,)."""
        mixture = self.likelihood.mixture
        moves = mixture.means - self.value
        acts = np.any(moves != 0.0, axis=1)
        share = float(mixture.weights[acts].sum())
        return self._without(mixture.weights[acts] @ moves[acts] / share) if share > 0.5 else self.value

    def _without(self, shift: FloatArray) -> FloatArray:
        """The value without the disturbances, whose mean shift to first order is `shift`, (k,)."""
        return self.value + shift

    def edge(self, level: float) -> FloatArray:  # noqa: ARG002  a closed form has no ridge
        """Scaled vectors (m, k) along a ridge where the likelihood has dropped by the amount of the level.

        Intervals are widened to reach them. Where a number is not determined, most of its range lies far from where
        the others are well determined: intervals from draws alone, which are uniform over that range, covered 83 %
        (E, thickness and the substrate's modulus free, 120 curves). In closed form there are none, (0, k).
        """
        return np.zeros((0, len(self.value)))

    @abstractmethod
    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """Ends of the interval of one entry of the scaled vector; infinite where the data set no limit."""

    @property
    @abstractmethod
    def draws(self) -> FloatArray:
        """Weighted draws of the scaled vector, (m, k)."""

    @property
    @abstractmethod
    def weights(self) -> FloatArray:
        """Weights (m,) of the draws, summing to 1."""

    @property
    def pareto(self) -> float:
        """Pareto k of the weights; above 0.7 the draws cannot be trusted: sample with emcee (`log_density`)."""
        return 0.0


def widened(ends: FloatArray, edge: FloatArray) -> tuple[float, float]:
    """Ends of an interval from draws, `ends` (2,), widened to contain the values `edge` (m,)."""
    return float(np.min(edge, initial=ends[0])), float(np.max(edge, initial=ends[1]))


@dataclass(frozen=True, eq=False)
class LinearReading(Reading):
    """Intervals and draws in closed form, for a force that is linear in the free parameters.

    `mixture` is the distribution, `rng` and `count` the generator and the number of the draws.
    """

    mixture: Mixture
    rng: np.random.Generator
    count: int = _DRAWS

    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """Quantiles of the mixture; infinite where no curve depends on the entry."""
        if not self.mixture.deviations[index] > 0.0:
            return -np.inf, np.inf
        low, high = self.mixture.quantiles(index, np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level]))
        return float(low), float(high)

    @cached_property
    def draws(self) -> FloatArray:
        """Draws of the mixture, (count, k), all of the same weight."""
        return self.mixture.draws(self.count, self.rng)

    @property
    def weights(self) -> FloatArray:
        """Equal weights, (count,), that sum to 1."""
        return np.full(self.count, 1.0 / self.count)


@dataclass(frozen=True, eq=False)
class DrawnReading(Reading):
    """Intervals and weighted draws by importance sampling along the ridge of the likelihood."""

    ridge: Ridge

    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:
        """Weighted quantiles, widened to the ridge's edge.

        An end is infinite where the likelihood at the bound, or where the search ended, has not dropped by the
        level's amount.
        """
        shares = np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
        ends = weighted_quantiles(self.draws[:, index], self.weights, shares)
        low, high = widened(ends, self.edge(level)[:, index])
        open_low, open_high = self.ridge.open_ends(index, level)
        return (-np.inf if open_low else low), (np.inf if open_high else high)

    def _without(self, shift: FloatArray) -> FloatArray:  # noqa: ARG002  the force is not linear over it
        """Medians (k,) of the draws.

        One step to first order is too far: of 24 to 40 curves with a step, an adhesive dip or a ramp that turns, E
        and thickness free, it left the thickness off by 9, 34 and 16 % (root mean square), in some beside its own
        interval; medians by 13, 10 and 12 %.
        """
        return np.array([weighted_quantiles(own, self.weights, np.array([0.5]))[0] for own in self.draws.T])

    def edge(self, level: float) -> FloatArray:
        """Scaled vectors (m, k) on the ridge where the likelihood has dropped by the amount of the level."""
        return self.ridge.edge(level)

    @property
    def draws(self) -> FloatArray:
        """Draws along the ridge, (m, k)."""
        return self.ridge.draws

    @property
    def weights(self) -> FloatArray:
        """Importance weights (m,) of the draws, summing to 1."""
        return self.ridge.weights

    @property
    def pareto(self) -> float:
        """Pareto k of the importance weights; above 0.7 the draws cannot be trusted."""
        return self.ridge.pareto


@dataclass(frozen=True, eq=False)
class OpenReading(Reading):
    """Of curves that say nothing of their parameters, such as one without contact: every interval is open."""

    def interval(self, index: int, level: float = 0.95) -> tuple[float, float]:  # noqa: ARG002  all are open
        """No limit on either side."""
        return -np.inf, np.inf

    @property
    def draws(self) -> FloatArray:
        """The least-squares fit alone, (1, k)."""
        return self.value[None]

    @property
    def weights(self) -> FloatArray:
        """Its weight, (1,)."""
        return np.ones(1)
