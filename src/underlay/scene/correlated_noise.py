"""Noise that hangs together over a time: a stationary Gaussian process with correlation exp(-|t - t'| / tau).

Sampled, it is AR(1) with rho_k = exp(-(t_k - t_{k-1}) / tau), on regular and irregular times alike. Its whitening

    e_0 = z_0,   e_k = (z_k - rho_k z_{k-1}) / sqrt(1 - rho_k^2)

is O(n).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from underlay._arrays import FloatArray, PerSet
from underlay.errors import InputError

__all__ = ["ar1_coefficients", "ar1_sample", "ar1_whiten"]


def ar1_whiten(standardised: FloatArray, time: FloatArray | None, correlation_time: PerSet) -> FloatArray:
    """Turn residuals over their standard deviation into independent ones of unit variance, in O(n).

    Parameters
    ----------
    standardised : FloatArray
        Residual / sigma (dimensionless), (..., n).
    time : FloatArray or None
        Times (s), (n,), increasing.
    correlation_time : float or FloatArray
        tau (s), positive: a number, or one per set, (sets, 1).

    Returns
    -------
    FloatArray
        (..., n).

    Raises
    ------
    InputError
        If a correlation time is set and `time` is missing or does not increase.
    """
    rho, spread = ar1_coefficients(time, correlation_time)
    white = np.empty(np.broadcast_shapes(standardised.shape, (*rho.shape[:-1], 1)))
    white[..., 0] = standardised[..., 0]
    white[..., 1:] = (standardised[..., 1:] - rho * standardised[..., :-1]) / spread
    return white


def ar1_sample(
    rng: np.random.Generator, shape: tuple[int, ...], time: FloatArray | None, correlation_time: float
) -> FloatArray:
    """Draw unit-variance noise (..., n), correlated over `correlation_time` (s) along the last axis.

    Raises
    ------
    InputError
        As `ar1_whiten` does.
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
    """rho_k and sqrt(1 - rho_k^2) of neighbouring points, each (..., n - 1); raises as `ar1_whiten` does."""
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
    tau = np.asarray(correlation_time, dtype=np.float64)
    if not (tau > 0.0).all():
        raise InputError(f"a correlation time must be positive (s) in every set; got {float(tau.min())!r}")
    lag = step / tau
    # expm1 keeps 1 - rho^2 exact to rounding when the points are much closer than tau.
    return np.exp(-lag), np.sqrt(-np.expm1(-2.0 * lag))
