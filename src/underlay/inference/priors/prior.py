"""What is known of a parameter before the test.

A prior is a density in the physical parameter (SI). Three readers use it:

- a sampler works in a scaled coordinate q and needs the density there, `log_density` plus the logarithm of
  |dx/dq|; `Problem.log_prior` adds that Jacobian;
- a least-squares fit adds `penalty` as one more residual: the standardised distance from what was measured
  before, for the priors that are such a measurement (Normal, HalfNormal in x; LogNormal in ln x); the flat
  ones only bound;
- both draw starts from `quantile`.

`Flat` is what a parameter without a prior gets: no preference, not normalisable, fine for a fit; a sampler
refuses it (`proper` is False).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError

__all__ = ["Given", "Prior", "Truncated", "inside"]


class Prior(ABC):
    """A density of one parameter; all numbers in the parameter's SI unit."""

    #: Whether it can be normalised, as a sampler needs.
    proper: bool = True
    #: Whether it is a measurement that pulls a fit, not only a bound.
    informative: bool = False

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """Smallest interval that holds all of the density."""

    @abstractmethod
    def log_density(self, value: FloatArray) -> FloatArray:
        """Logarithm of the density at `value`, same shape; -inf outside the support."""

    @abstractmethod
    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution at `value`, same shape."""

    @abstractmethod
    def quantile(self, probability: FloatArray) -> FloatArray:
        """Inverse of `probability_below`, same shape."""

    def penalty(self, value: float) -> tuple[float, float]:
        """Residual that a least-squares fit adds for this prior, and its slope in `value`."""
        del value
        return 0.0, 0.0

    def sample(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> FloatArray:
        """Draw from the prior, shape `size`."""
        return self.quantile(rng.random(size))

    def truncated(self, low: float = -np.inf, high: float = np.inf) -> Prior:
        """Return this prior restricted to [low, high]; itself if that cuts nothing."""
        below, above = self.support
        return self if low <= below and above <= high else Truncated(self, low, high)


#: What may be said of a free parameter: a prior, bounds, or nothing.
Given: TypeAlias = Prior | tuple[float, float] | None


def inside(value: FloatArray, support: tuple[float, float], log_density: FloatArray) -> FloatArray:
    """Density (as its logarithm) inside a support, -inf outside; same shape as `value`."""
    low, high = support
    return np.where((value >= low) & (value <= high), log_density, -np.inf)


@dataclass(frozen=True)
class Truncated(Prior):
    """Another prior restricted to [low, high] and normalised again.

    Raises
    ------
    InputError
        If the interval holds none of the prior.
    """

    prior: Prior
    low: float = -np.inf
    high: float = np.inf

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(f"truncation needs low below high; got {self.low!r} and {self.high!r}")
        if not self._mass > 0.0:
            raise InputError(f"{self.prior!r} has no probability between {self.low!r} and {self.high!r}")

    @property
    def proper(self) -> bool:  # type: ignore[override]  # a class constant elsewhere, inherited here
        """As the truncated prior."""
        return self.prior.proper

    @property
    def informative(self) -> bool:  # type: ignore[override]  # likewise
        """As the truncated prior."""
        return self.prior.informative

    @property
    def support(self) -> tuple[float, float]:
        """The part of [low, high] inside the prior's own support."""
        low, high = self.prior.support
        return max(low, self.low), min(high, self.high)

    @property
    def _ends(self) -> tuple[float, float]:
        low, high = self.support
        below = 0.0 if low == self.prior.support[0] else float(self.prior.probability_below(np.asarray(low)))
        above = (
            1.0 if high == self.prior.support[1] else float(self.prior.probability_below(np.asarray(high)))
        )
        return below, above

    @property
    def _mass(self) -> float:
        below, above = self._ends
        return above - below

    def log_density(self, value: FloatArray) -> FloatArray:
        """The prior's own, raised by what was cut away."""
        return inside(np.asarray(value), self.support, self.prior.log_density(value) - np.log(self._mass))

    def probability_below(self, value: FloatArray) -> FloatArray:
        """The prior's own, rescaled."""
        below, above = self._ends
        return np.clip((self.prior.probability_below(value) - below) / (above - below), 0.0, 1.0)

    def quantile(self, probability: FloatArray) -> FloatArray:
        """The prior's own, rescaled."""
        below, above = self._ends
        inner = self.prior.quantile(below + np.asarray(probability) * (above - below))
        low, high = self.support
        # Rounding of the inverse may leave the interval by one unit in the last place.
        return np.clip(inner, low, high)

    def penalty(self, value: float) -> tuple[float, float]:
        """As the truncated prior."""
        return self.prior.penalty(value)
