"""Prior distributions of parameters: densities, bounds, and their form in a scene file.

A prior is a density in the physical parameter x (SI). It is used in three ways:

- a sampler works in a scaled coordinate q and needs the density there, `log_density` plus the logarithm of |dx/dq|;
`Problem.log_prior` adds that Jacobian;
- a least-squares fit adds `penalty` as one more residual, the standardised distance from an earlier measurement,
for the priors that are such a measurement (Normal, HalfNormal in x; LogNormal in ln x); the flat ones only set
bounds;
- both draw starting values from `quantile`.

`Flat` is the default of a parameter without a prior: it is not normalisable, which a fit allows and a sampler
refuses (`proper` is False).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy import special

from underlay._arrays import FloatArray, finite, positive
from underlay.errors import InputError

_LOG_SQRT_2PI = 0.5 * np.log(2.0 * np.pi)


class Prior(ABC):
    """Prior density of one parameter; all numbers in the parameter's SI unit."""

    #: Whether it can be normalised, as a sampler needs.
    proper: bool = True
    #: Whether it contributes to a fit like a measurement, and is not only a bound.
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
        """Residual that a least-squares fit adds for this prior, and its derivative; zero for a flat prior."""
        del value
        return 0.0, 0.0

    def sample(self, rng: np.random.Generator, size: int | tuple[int, ...]) -> FloatArray:
        """Draw from the prior, shape `size`."""
        return self.quantile(rng.random(size))

    def truncated(self, low: float = -np.inf, high: float = np.inf) -> Prior:
        """Return this prior restricted to [low, high]; itself if that cuts nothing."""
        below, above = self.support
        return self if low <= below and above <= high else Truncated(self, low, high)


#: What a caller may give for a free parameter: a prior, bounds (SI), or None.
Given: TypeAlias = Prior | tuple[float, float] | None


def inside(value: FloatArray, support: tuple[float, float], log_density: FloatArray) -> FloatArray:
    """Log-density inside a support, -inf outside; same shape as `value`."""
    low, high = support
    return np.where((value >= low) & (value <= high), log_density, -np.inf)


@dataclass(frozen=True)
class Truncated(Prior):
    """Another prior restricted to [low, high] and normalised again.

    Raises
    ------
    InputError
        If the prior has no probability in the interval.
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
        """Whether the prior can be normalised: as the original prior."""
        return self.prior.proper

    @property
    def informative(self) -> bool:  # type: ignore[override]  # likewise
        """Whether the prior contributes to a fit: as the original prior."""
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
        """Log-density of the original prior, renormalised; -inf outside the interval."""
        return inside(np.asarray(value), self.support, self.prior.log_density(value) - np.log(self._mass))

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution of the original prior, rescaled to 0 to 1 over the interval."""
        below, above = self._ends
        return np.clip((self.prior.probability_below(value) - below) / (above - below), 0.0, 1.0)

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Inverse of `probability_below`, from the original prior's quantiles."""
        below, above = self._ends
        inner = self.prior.quantile(below + np.asarray(probability) * (above - below))
        low, high = self.support
        # Rounding of the inverse may exceed the interval by one unit in the last place.
        return np.clip(inner, low, high)

    def penalty(self, value: float) -> tuple[float, float]:
        """Least-squares residual and derivative of the original prior."""
        return self.prior.penalty(value)


@dataclass(frozen=True)
class _Between(Prior):
    """A prior between two finite bounds."""

    low: float
    high: float

    def __post_init__(self) -> None:
        low, high = finite(self.low, "lower bound", "SI"), finite(self.high, "upper bound", "SI")
        if not low < high:
            raise InputError(f"a prior's lower bound must be below its upper one; got {low!r} and {high!r}")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @property
    def support(self) -> tuple[float, float]:
        """The interval (low, high)."""
        return self.low, self.high


@dataclass(frozen=True)
class Uniform(_Between):
    """Constant density between `low` and `high`.

    Raises
    ------
    InputError
        If a bound is not finite or they are not in order.
    """

    def log_density(self, value: FloatArray) -> FloatArray:
        """-ln(high - low) between the bounds, -inf outside."""
        flat = np.full(np.shape(value), -np.log(self.high - self.low))
        return inside(np.asarray(value), self.support, flat)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution: linear from 0 at `low` to 1 at `high`."""
        return np.clip((value - self.low) / (self.high - self.low), 0.0, 1.0)

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Inverse of `probability_below`: linear from `low` to `high`."""
        return self.low + np.asarray(probability) * (self.high - self.low)


@dataclass(frozen=True)
class LogUniform(_Between):
    """Density proportional to 1/x between `low` and `high`, both positive (Jeffreys' prior of a scale).

    Raises
    ------
    InputError
        If a bound is not positive and finite or they are not in order.
    """

    def __post_init__(self) -> None:
        positive(self.low, "lower bound of LogUniform", "SI")
        super().__post_init__()

    def log_density(self, value: FloatArray) -> FloatArray:
        """-ln x - ln ln(high / low) between the bounds, -inf outside."""
        x = np.asarray(value, dtype=np.float64)
        # Outside the support the logarithm is taken of `low` and then discarded.
        safe = np.where(x > 0.0, x, self.low)
        return inside(x, self.support, -np.log(safe) - np.log(np.log(self.high / self.low)))

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution, ln(x / low) / ln(high / low) between the bounds."""
        x = np.clip(value, self.low, self.high)
        return np.asarray(np.log(x / self.low) / np.log(self.high / self.low))

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Inverse of `probability_below`: low (high / low)^p for a probability p."""
        return self.low * (self.high / self.low) ** np.asarray(probability)


@dataclass(frozen=True)
class Normal(Prior):
    """Normal prior, as from a measured value `mean` with standard uncertainty `sd`."""

    mean: float
    sd: float

    informative = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", finite(self.mean, "mean of Normal", "SI"))
        object.__setattr__(self, "sd", positive(self.sd, "sd of Normal", "SI"))

    @property
    def support(self) -> tuple[float, float]:
        """The whole real line."""
        return -np.inf, np.inf

    def log_density(self, value: FloatArray) -> FloatArray:
        """Logarithm of the normal density."""
        z = (np.asarray(value) - self.mean) / self.sd
        return np.asarray(-0.5 * z * z - np.log(self.sd) - _LOG_SQRT_2PI)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative normal distribution."""
        return np.asarray(special.ndtr((np.asarray(value) - self.mean) / self.sd))

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Quantile of the normal distribution."""
        return np.asarray(self.mean + self.sd * special.ndtri(probability))

    def penalty(self, value: float) -> tuple[float, float]:
        """Least-squares residual (x - mean) / sd and its derivative 1 / sd."""
        return (value - self.mean) / self.sd, 1.0 / self.sd


@dataclass(frozen=True)
class LogNormal(Prior):
    """Log-normal prior of a positive quantity: ln x is normal about ln `median` with standard deviation `sigma`."""

    median: float
    sigma: float

    informative = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "median", positive(self.median, "median of LogNormal", "SI"))
        object.__setattr__(self, "sigma", positive(self.sigma, "sigma of LogNormal", "dimensionless"))

    @property
    def support(self) -> tuple[float, float]:
        """All positive values."""
        return 0.0, np.inf

    def log_density(self, value: FloatArray) -> FloatArray:
        """Logarithm of the log-normal density in x; -inf at zero and below."""
        x = np.asarray(value, dtype=np.float64)
        safe = np.where(x > 0.0, x, self.median)
        z = np.log(safe / self.median) / self.sigma
        inside = -0.5 * z * z - np.log(self.sigma * safe) - _LOG_SQRT_2PI
        return np.where(x > 0.0, inside, -np.inf)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution: that of a normal in ln x."""
        x = np.asarray(value, dtype=np.float64)
        safe = np.where(x > 0.0, x, self.median)
        return np.where(x > 0.0, special.ndtr(np.log(safe / self.median) / self.sigma), 0.0)

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Quantile of the log-normal distribution."""
        return np.asarray(self.median * np.exp(self.sigma * special.ndtri(probability)))

    def penalty(self, value: float) -> tuple[float, float]:
        """Least-squares residual ln(x / median) / sigma and its derivative in x."""
        return float(np.log(value / self.median)) / self.sigma, 1.0 / (self.sigma * value)


@dataclass(frozen=True)
class HalfNormal(Prior):
    """Half-normal prior of a quantity that is zero or positive, of scale `sd`."""

    sd: float

    informative = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "sd", positive(self.sd, "sd of HalfNormal", "SI"))

    @property
    def support(self) -> tuple[float, float]:
        """Zero and above."""
        return 0.0, np.inf

    def log_density(self, value: FloatArray) -> FloatArray:
        """Logarithm of twice the normal density of mean zero; -inf below zero."""
        z = np.asarray(value) / self.sd
        density = -0.5 * z * z + np.log(2.0 / self.sd) - _LOG_SQRT_2PI
        return inside(np.asarray(value), self.support, density)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Cumulative distribution: erf(x / (sqrt(2) sd))."""
        return np.asarray(special.erf(np.maximum(value, 0.0) / (np.sqrt(2.0) * self.sd)))

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Quantile, by the inverse error function."""
        return np.asarray(np.sqrt(2.0) * self.sd * special.erfinv(probability))

    def penalty(self, value: float) -> tuple[float, float]:
        """Least-squares residual x / sd and its derivative 1 / sd."""
        return value / self.sd, 1.0 / self.sd


@dataclass(frozen=True)
class Flat(Prior):
    """Constant density between `low` and `high`, at least one of them infinite: it cannot be normalised.

    The density is constant (taken as 1) in x, or in ln x when `log` is set, as for a scale.
    """

    low: float = -np.inf
    high: float = np.inf
    log: bool = False

    proper = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(f"bounds need low below high; got {self.low!r} and {self.high!r}")

    @property
    def support(self) -> tuple[float, float]:
        """The interval (low, high)."""
        return self.low, self.high

    def truncated(self, low: float = -np.inf, high: float = np.inf) -> Prior:
        """Return this prior restricted to [low, high]; proper once both ends are finite."""
        low, high = max(low, self.low), min(high, self.high)
        if not (np.isfinite(low) and np.isfinite(high)):
            return Flat(low, high, self.log)
        return LogUniform(low, high) if self.log and low > 0.0 else Uniform(low, high)

    def log_density(self, value: FloatArray) -> FloatArray:
        """Zero, or -ln x when `log` is set; -inf outside the bounds."""
        x = np.asarray(value, dtype=np.float64)
        if not self.log:
            return inside(x, self.support, np.zeros_like(x))
        safe = np.where(x > 0.0, x, 1.0)
        return np.where(x > 0.0, inside(x, self.support, -np.log(safe)), -np.inf)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Not defined for an improper prior: raises InputError."""
        del value
        raise InputError(f"{self!r} is improper: it has no probabilities; give the parameter a proper prior")

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Not defined for an improper prior: raises InputError."""
        del probability
        raise InputError(f"{self!r} is improper: it cannot be drawn from; give the parameter a proper prior")


def require_proper(priors: Mapping[str, Prior]) -> None:
    """Raise InputError where a prior is improper, which no sampler can use."""
    improper = [name for name, prior in priors.items() if not prior.proper]
    if improper:
        raise InputError(
            f"the prior of {', '.join(improper)} is improper and cannot be sampled: give it finite bounds "
            "(min and max) or a prior that has a mean (normal, lognormal)"
        )


def prior_from_numbers(name: str | None, low: float, high: float, numbers: Mapping[str, float]) -> Given:
    """Make the prior of one free parameter, as `Problem` takes it, from an entry of a scene file.

    Parameters
    ----------
    name : str or None
        ``"uniform"``, ``"loguniform"``, ``"normal"`` (mean; sd or relative_sd), ``"lognormal"`` (median;
        relative_sd, the standard deviation of ln x), ``"halfnormal"`` (sd), or None: bounds only.
    low, high : float
        Bounds (SI), infinite where there are none; they truncate the prior.
    numbers : mapping
        mean, sd, median, relative_sd.

    Returns
    -------
    Prior, tuple of float, or None
        None where neither a prior nor bounds are given.

    Raises
    ------
    InputError
        If the name is unknown or a number is missing.
    """
    if name is None:
        return None if (low, high) == (-np.inf, np.inf) else (low, high)
    given = dict(numbers)

    def take(key: str) -> float:
        if key not in given:
            raise InputError(f"prior {name!r} needs {key!r}; given: {', '.join(sorted(given)) or 'nothing'}")
        return given[key]

    if name == "uniform":
        return Uniform(low, high)
    if name == "loguniform":
        return LogUniform(low, high)
    if name == "normal":
        mean = take("mean")
        sd = given["sd"] if "sd" in given else take("relative_sd") * abs(mean)
        return Normal(mean, sd).truncated(low, high)
    if name == "lognormal":
        return LogNormal(take("median"), take("relative_sd")).truncated(low, high)
    if name == "halfnormal":
        return HalfNormal(take("sd")).truncated(low, high)
    raise InputError(
        f"unknown prior {name!r}; known: uniform, loguniform, normal, lognormal, halfnormal, or none"
    )
