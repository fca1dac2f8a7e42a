"""Noise of a force reading: one model, shared by the generator of curves and by the likelihood.

The reading at point k is F_k + sigma_k z_k. The standard deviation adds in squares what is named:

    sigma^2 = force^2 + (relative * P)^2 + (stiffness * depth)^2,

with P the contact force and dP/dw the stiffness; the last term is the effective variance of an uncertain
depth, first order in the depth error (Orear 1982, doi:10.1119/1.12972). The z_k have unit variance and are
independent, or, with a correlation time tau, a stationary Gaussian process with correlation
exp(-|t - t'| / tau): AR(1) with rho_k = exp(-(t_k - t_{k-1}) / tau), on regular and irregular times alike.
Its whitening

    e_0 = z_0,   e_k = (z_k - rho_k z_{k-1}) / sqrt(1 - rho_k^2)

is O(n), and the log-likelihood of residuals r is ``log_normalisation - sum(whiten(r / sigma)^2) / 2``.

`Noise` holds one set of numbers. The functions below it take the same numbers with leading batch axes,
for callers that estimate them; the last axis is always that of the points.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np
from scipy import linalg

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError
from underlay.quantities import Part, field_quantities, quantity
from underlay.units import KINDS

__all__ = [
    "Noise",
    "ar1_coefficients",
    "ar1_sample",
    "log_normalisation",
    "standard_deviation",
    "whiten",
]

#: One number for all sets, or one per set: shape () or (...,), the batch axes.
PerSet: TypeAlias = float | FloatArray


@dataclass(frozen=True)
class Noise(Part):
    """What disturbs a force reading; every part is off unless named.

    Parameters
    ----------
    force : float, optional
        Standard deviation of the white force noise (N). None means unknown: an inference estimates it, a
        generator leaves it out.
    relative : float, default 0
        Standard deviation proportional to the contact force (dimensionless).
    correlation_time : float, default 0
        Time constant tau (s) over which the noise stays correlated; zero means independent points.
    depth : float, default 0
        Standard deviation of the depth reading (m), seen in the force through the stiffness.

    Raises
    ------
    InputError
        If a number is negative or not finite, or all that could disturb the reading is zero.

    Examples
    --------
    >>> Noise(force=3e-6, relative=0.02).sigma(np.array([0.0, 2e-4]))
    array([3.e-06, 5.e-06])
    """

    parts: ClassVar[tuple[str, ...]] = ("noise",)

    force: float | None = field(
        default=None, metadata=quantity("force", "noise of the force", bounds=(0.0, np.inf))
    )
    relative: float = field(
        default=0.0, metadata=quantity("dimensionless", "relative noise", bounds=(0.0, np.inf))
    )
    correlation_time: float = field(
        default=0.0, metadata=quantity("time", "correlation time of the noise", bounds=(0.0, np.inf))
    )
    depth: float = field(default=0.0, metadata=quantity("length", "noise of the depth", bounds=(0.0, np.inf)))

    def __post_init__(self) -> None:
        for name, known in field_quantities(self).items():
            given, unit = getattr(self, name), KINDS[known.kind].si or "dimensionless"
            if given is None and name == "force":
                continue
            value = finite(given, f"noise.{name}", unit)
            if value < 0.0:
                raise InputError(f"noise.{name} must be zero or positive ({unit}); got {given!r}")
            object.__setattr__(self, name, value)
        if self.force == 0.0 and self.relative == 0.0 and self.depth == 0.0:
            raise InputError(
                "zero noise: noise.force, noise.relative and noise.depth are all 0, and no measurement is "
                "exact; give one of them, or leave force out (None) to have it estimated"
            )

    def sigma(self, force: FloatArray, stiffness: FloatArray | None = None) -> FloatArray:
        """Standard deviation (N) of the reading.

        Parameters
        ----------
        force : FloatArray
            Contact force (N), (..., n).
        stiffness : FloatArray, optional
            dP/dw (N/m), (..., n); needed when `depth` is not zero.

        Returns
        -------
        FloatArray
            (..., n). It may be a read-only view.

        Raises
        ------
        InputError
            If the white noise is unknown, or the stiffness is needed and missing.
        """
        if self.force is None:
            raise InputError(
                "noise.force is unknown (None): give it a value (N), or a prior so that it is estimated"
            )
        return standard_deviation(
            force, stiffness, force_sd=self.force, relative=self.relative, depth_sd=self.depth
        )

    def whiten(self, standardised: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Independent unit-variance residuals (..., n) from `standardised` ones; see `whiten`."""
        return whiten(standardised, time, self.correlation_time)

    def log_normalisation(self, sigma: FloatArray, time: FloatArray | None = None) -> FloatArray:
        """Logarithm of the Gaussian's normalisation (...); see `log_normalisation`."""
        return log_normalisation(sigma, time, self.correlation_time)

    def sample(
        self, rng: np.random.Generator, sigma: FloatArray, time: FloatArray | None = None
    ) -> FloatArray:
        """Draw noise (N) of standard deviation `sigma` (N), same shape (..., n), at `time` (s), (n,).

        Raises
        ------
        InputError
            If a correlation time is set and `time` is missing or does not increase.
        """
        return sigma * ar1_sample(rng, np.shape(sigma), time, self.correlation_time)


def _is_off(part: PerSet) -> bool:
    """Whether a part of the noise is zero in every set; a fit asks this of single numbers at every step."""
    return part == 0.0 if isinstance(part, float) else not np.any(part)


def standard_deviation(
    force: FloatArray,
    stiffness: FloatArray | None = None,
    *,
    force_sd: PerSet,
    relative: PerSet = 0.0,
    depth_sd: PerSet = 0.0,
) -> FloatArray:
    """Total standard deviation (N), (..., n), for contact forces (N) and stiffnesses (N/m), (..., n).

    `force_sd` (N), `relative` and `depth_sd` (m) are numbers or arrays (...,) over the batch axes. Where
    white noise is alone the result is a read-only broadcast view, which `log_normalisation` knows.

    Raises
    ------
    InputError
        If depth noise is asked for without a stiffness.
    """
    white = np.asarray(force_sd, dtype=np.float64)[..., None]
    with_relative, with_depth = not _is_off(relative), not _is_off(depth_sd)
    if not (with_relative or with_depth):
        return np.broadcast_to(white, np.broadcast_shapes(white.shape, np.shape(force)))
    variance = white * white
    if with_relative:
        variance = variance + np.square(np.asarray(relative)[..., None] * force)
    if with_depth:
        if stiffness is None:
            raise InputError("depth noise acts through the stiffness dP/dw (N/m): pass it")
        variance = variance + np.square(np.asarray(depth_sd)[..., None] * stiffness)
    return np.sqrt(variance)


def whiten(standardised: FloatArray, time: FloatArray | None, correlation_time: PerSet) -> FloatArray:
    """Turn residuals over their standard deviation into independent ones of unit variance, in O(n).

    Parameters
    ----------
    standardised : FloatArray
        Residual / sigma (dimensionless), (..., n).
    time : FloatArray or None
        Times (s), (n,), increasing; not needed when the correlation time is zero.
    correlation_time : float or FloatArray
        tau (s): a number, or (...,) over the batch axes.

    Returns
    -------
    FloatArray
        (..., n); `standardised` itself when the correlation time is zero.

    Raises
    ------
    InputError
        If a correlation time is set and `time` is missing or does not increase.
    """
    if _is_off(correlation_time):
        return standardised
    rho, spread = ar1_coefficients(time, correlation_time)
    white = np.empty(np.broadcast_shapes(standardised.shape, (*rho.shape[:-1], 1)))
    white[..., 0] = standardised[..., 0]
    white[..., 1:] = (standardised[..., 1:] - rho * standardised[..., :-1]) / spread
    return white


def log_normalisation(sigma: FloatArray, time: FloatArray | None, correlation_time: PerSet) -> FloatArray:
    """Logarithm of the Gaussian's normalisation, the AR(1) determinant included.

    - sum log sigma - sum_{k>=1} log(1 - rho_k^2) / 2 - n log(2 pi) / 2.

    Parameters
    ----------
    sigma : FloatArray
        Standard deviations (N), (..., n), positive.
    time, correlation_time
        As in `whiten`.

    Returns
    -------
    FloatArray
        (...,).

    Raises
    ------
    InputError
        If a standard deviation is zero, or as `whiten` does.
    """
    if not (sigma > 0.0).all():
        raise InputError(
            "the noise of some points is zero, so their likelihood is infinite: before contact neither "
            "relative nor depth noise acts; give noise.force too (N)"
        )
    points = sigma.shape[-1]
    if points > 1 and sigma.strides[-1] == 0:
        # The broadcast view of white noise alone: all points of a set have one sigma, one logarithm serves.
        log_sigma = points * np.log(sigma[..., 0])
    else:
        log_sigma = np.log(sigma).sum(axis=-1)
    value = -log_sigma - 0.5 * points * np.log(2.0 * np.pi)
    if not _is_off(correlation_time):
        _, spread = ar1_coefficients(time, correlation_time)
        value = value - np.log(spread).sum(axis=-1)
    return np.asarray(value)


def ar1_sample(
    rng: np.random.Generator, shape: tuple[int, ...], time: FloatArray | None, correlation_time: float
) -> FloatArray:
    """Draw unit-variance noise (..., n), correlated over `correlation_time` (s) along the last axis.

    Raises
    ------
    InputError
        As `whiten` does.
    """
    white = rng.standard_normal(shape)
    if not correlation_time:
        return white
    rho, spread = ar1_coefficients(time, correlation_time)
    white[..., 1:] *= spread
    # z_k - rho_k z_{k-1} = innovation_k is a lower bidiagonal system: one banded solve for every row.
    bands = np.ones((2, shape[-1]))
    bands[1, :-1] = -rho
    bands[1, -1] = 0.0
    columns = white.reshape(-1, shape[-1]).T
    return np.asarray(linalg.solve_banded((1, 0), bands, columns).T.reshape(shape))


def ar1_coefficients(time: FloatArray | None, correlation_time: PerSet) -> tuple[FloatArray, FloatArray]:
    """rho_k and sqrt(1 - rho_k^2) of neighbouring points, each (..., n - 1); raises as `whiten` does."""
    if time is None:
        raise InputError(
            "a correlation time needs the times of the points (s): give the curve a time column or a "
            "sampling rate, or set noise.correlation_time to 0"
        )
    step = np.diff(time)
    if not (step > 0.0).all():
        raise InputError(
            "a correlation time needs increasing times; they do not increase after index "
            f"{int(np.flatnonzero(~(step > 0.0))[0])}"
        )
    tau = np.asarray(correlation_time, dtype=np.float64)[..., None]
    if not (tau > 0.0).all():
        raise InputError(f"a correlation time must be positive (s) in every set; got {float(tau.min())!r}")
    lag = step / tau
    # expm1 keeps 1 - rho^2 exact to rounding when the points are much closer than tau.
    return np.exp(-lag), np.sqrt(-np.expm1(-2.0 * lag))
