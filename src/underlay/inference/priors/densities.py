"""The densities that a prior may have, and the absence of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from underlay._arrays import FloatArray, finite, positive
from underlay.errors import InputError
from underlay.inference.priors.prior import Prior, inside

__all__ = ["Flat", "HalfNormal", "LogNormal", "LogUniform", "Normal", "Uniform"]

_LOG_SQRT_2PI = 0.5 * np.log(2.0 * np.pi)


def _ordered(low: float, high: float) -> tuple[float, float]:
    low, high = finite(low, "lower bound", "SI"), finite(high, "upper bound", "SI")
    if not low < high:
        raise InputError(f"a prior's lower bound must be below its upper one; got {low!r} and {high!r}")
    return low, high


@dataclass(frozen=True)
class Uniform(Prior):
    """Every value between `low` and `high` alike.

    Raises
    ------
    InputError
        If a bound is not finite or they are not in order.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        low, high = _ordered(self.low, self.high)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @property
    def support(self) -> tuple[float, float]:
        """(low, high)."""
        return self.low, self.high

    def log_density(self, value: FloatArray) -> FloatArray:
        """-ln(high - low) inside."""
        flat = np.full(np.shape(value), -np.log(self.high - self.low))
        return inside(np.asarray(value), self.support, flat)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Linear from 0 to 1."""
        return np.clip((value - self.low) / (self.high - self.low), 0.0, 1.0)

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Linear from `low` to `high`."""
        return self.low + np.asarray(probability) * (self.high - self.low)


@dataclass(frozen=True)
class LogUniform(Prior):
    """Every ratio alike between `low` and `high`, both positive (Jeffreys' prior of a scale).

    Raises
    ------
    InputError
        If a bound is not positive and finite or they are not in order.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        low, high = _ordered(positive(self.low, "lower bound of LogUniform", "SI"), self.high)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @property
    def support(self) -> tuple[float, float]:
        """(low, high)."""
        return self.low, self.high

    def log_density(self, value: FloatArray) -> FloatArray:
        """-ln x - ln ln(high / low) inside."""
        x = np.asarray(value, dtype=np.float64)
        # Outside the support the logarithm is taken of `low` and then discarded.
        safe = np.where(x > 0.0, x, self.low)
        return inside(x, self.support, -np.log(safe) - np.log(np.log(self.high / self.low)))

    def probability_below(self, value: FloatArray) -> FloatArray:
        """ln(x / low) / ln(high / low)."""
        x = np.clip(value, self.low, self.high)
        return np.asarray(np.log(x / self.low) / np.log(self.high / self.low))

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Geometric between `low` and `high`."""
        return self.low * (self.high / self.low) ** np.asarray(probability)


@dataclass(frozen=True)
class Normal(Prior):
    """A measured value and its standard uncertainty: `mean` +- `sd`."""

    mean: float
    sd: float

    informative = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", finite(self.mean, "mean of Normal", "SI"))
        object.__setattr__(self, "sd", positive(self.sd, "sd of Normal", "SI"))

    @property
    def support(self) -> tuple[float, float]:
        """The whole line."""
        return -np.inf, np.inf

    def log_density(self, value: FloatArray) -> FloatArray:
        """Gaussian."""
        z = (np.asarray(value) - self.mean) / self.sd
        return np.asarray(-0.5 * z * z - np.log(self.sd) - _LOG_SQRT_2PI)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Gaussian."""
        return np.asarray(special.ndtr((np.asarray(value) - self.mean) / self.sd))

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Gaussian."""
        return np.asarray(self.mean + self.sd * special.ndtri(probability))

    def penalty(self, value: float) -> tuple[float, float]:
        """(x - mean) / sd."""
        return (value - self.mean) / self.sd, 1.0 / self.sd


@dataclass(frozen=True)
class LogNormal(Prior):
    """A positive quantity known to a factor: ln x is normal about ln `median` with deviation `sigma`."""

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
        """Gaussian in ln x, over x."""
        x = np.asarray(value, dtype=np.float64)
        safe = np.where(x > 0.0, x, self.median)
        z = np.log(safe / self.median) / self.sigma
        inside = -0.5 * z * z - np.log(self.sigma * safe) - _LOG_SQRT_2PI
        return np.where(x > 0.0, inside, -np.inf)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Gaussian in ln x."""
        x = np.asarray(value, dtype=np.float64)
        safe = np.where(x > 0.0, x, self.median)
        return np.where(x > 0.0, special.ndtr(np.log(safe / self.median) / self.sigma), 0.0)

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Gaussian in ln x."""
        return np.asarray(self.median * np.exp(self.sigma * special.ndtri(probability)))

    def penalty(self, value: float) -> tuple[float, float]:
        """ln(x / median) / sigma."""
        return float(np.log(value / self.median)) / self.sigma, 1.0 / (self.sigma * value)


@dataclass(frozen=True)
class HalfNormal(Prior):
    """A quantity that is zero or positive and of the order of `sd`."""

    sd: float

    informative = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "sd", positive(self.sd, "sd of HalfNormal", "SI"))

    @property
    def support(self) -> tuple[float, float]:
        """Zero and above."""
        return 0.0, np.inf

    def log_density(self, value: FloatArray) -> FloatArray:
        """Twice the Gaussian, above zero."""
        z = np.asarray(value) / self.sd
        density = -0.5 * z * z + np.log(2.0 / self.sd) - _LOG_SQRT_2PI
        return inside(np.asarray(value), self.support, density)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Error function."""
        return np.asarray(special.erf(np.maximum(value, 0.0) / (np.sqrt(2.0) * self.sd)))

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Inverse error function."""
        return np.asarray(np.sqrt(2.0) * self.sd * special.erfinv(probability))

    def penalty(self, value: float) -> tuple[float, float]:
        """The residual x / sd and its slope."""
        return value / self.sd, 1.0 / self.sd


@dataclass(frozen=True)
class Flat(Prior):
    """No preference between `low` and `high`, at least one of them infinite: cannot be normalised.

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
        """(low, high)."""
        return self.low, self.high

    def truncated(self, low: float = -np.inf, high: float = np.inf) -> Prior:
        """Return this prior restricted to [low, high]; proper once both ends are finite."""
        low, high = max(low, self.low), min(high, self.high)
        if not (np.isfinite(low) and np.isfinite(high)):
            return Flat(low, high, self.log)
        return LogUniform(low, high) if self.log and low > 0.0 else Uniform(low, high)

    def log_density(self, value: FloatArray) -> FloatArray:
        """Zero, or -ln x when `log` is set."""
        x = np.asarray(value, dtype=np.float64)
        if not self.log:
            return inside(x, self.support, np.zeros_like(x))
        safe = np.where(x > 0.0, x, 1.0)
        return np.where(x > 0.0, inside(x, self.support, -np.log(safe)), -np.inf)

    def probability_below(self, value: FloatArray) -> FloatArray:
        """Not defined: raises InputError."""
        del value
        raise InputError(f"{self!r} is improper: it has no probabilities; give the parameter a proper prior")

    def quantile(self, probability: FloatArray) -> FloatArray:
        """Not defined: raises InputError."""
        del probability
        raise InputError(f"{self!r} is improper: it cannot be drawn from; give the parameter a proper prior")
