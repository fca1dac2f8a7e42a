"""Spectra of correlated noise of equally spaced rows, whose covariance a cosine transform makes diagonal.

A reflecting Ornstein-Uhlenbeck process is diagonal in the DCT-II: of n rows with white noise of variance 1 and a
correlated part of variance g and correlation time tau (in rows), the coefficients k have the variances

    lambda_k = 1 + g (1 - rho^2) / ((1 - rho)^2 + rho mu_k),  mu_k = 4 sin^2(pi k / 2n),  rho = exp(-1 / tau),

so that many noises are evaluated by one matrix product. Slow fluctuations of the baseline are a spectrum too: that
of a Matern 3/2 process with a correlation length of a tenth of the record or more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from underlay._arrays import FloatArray

_CORRELATED = 0.2  # prior probability of correlated noise
_SLOW = 0.1  # prior probability of slow fluctuations
_SIZES = (0.3, 3.0, 30.0, 300.0)  # variances of the correlated part, in that of the white part
_WIGGLES = (9.0, 90.0, 900.0)  # variances of the slow fluctuations, in the same unit
_WIGGLE_LENGTHS = (0.1, 0.4, 1.6)  # correlation lengths of the slow fluctuations, in lengths of the record
_TIMES = 6  # number of correlation times, from two rows to three records
_SHORT = 3.0  # variance up to which noise correlated over two rows is treated as white
# Growths that are tried: standard deviation of the noise at the largest stiffness over that before contact, less
# one.
_GROWTHS = np.concatenate(([0.0], np.geomspace(0.1, 300.0, 30)))
_GAIN = 3.0  # least gain of log-likelihood for noise that grows with the stiffness
_OVERLAP = 1.94  # factor by which overlapping second differences of white noise overstate their number


@dataclass(frozen=True, eq=False)
class NoiseTable:
    """Spectra of the noises that are tried for a curve, in units of the white part's variance.

    Parameters
    ----------
    spectra : FloatArray
        Variances lambda of the cosine coefficients, (noises, n); the first noise is white.
    log_prior : FloatArray
        Logarithms of their prior probabilities, (noises,).
    is_short : ndarray of bool
        Whether a noise is hardly correlated from row to row: white, or correlated over two rows and small,
        (noises,).
    """

    spectra: FloatArray
    log_prior: FloatArray
    is_short: NDArray[np.bool_]


def cosines(columns: FloatArray) -> FloatArray:
    """Cosine coefficients of columns (n, m): orthonormal DCT-II down each."""
    return np.asarray(dct(columns, axis=0, norm="ortho"))


def white_table(n: int) -> NoiseTable:
    """Table with white noise of n rows alone, for noise of a stated size."""
    return NoiseTable(np.ones((1, n)), np.zeros(1), np.ones(1, dtype=bool))


def noise_table(n: int) -> NoiseTable:
    """Table of white noise, correlated noise and slow fluctuations for n rows."""
    white, correlated, wiggles = np.ones((1, n)), _ornstein_uhlenbeck(n), _matern(n)
    shares = [1.0 - _CORRELATED - _SLOW] + [_CORRELATED / len(correlated)] * len(correlated)
    shares += [_SLOW / len(wiggles)] * len(wiggles)
    short = np.zeros(len(shares), dtype=bool)
    # The shortest correlation time of each size that is not larger than `_SHORT`.
    short[[0, *(1 + i * _TIMES for i, g in enumerate(_SIZES) if g <= _SHORT)]] = True
    return NoiseTable(np.vstack((white, correlated, wiggles)), np.log(shares), short)


def _ornstein_uhlenbeck(n: int) -> FloatArray:
    mu = 4.0 * np.sin(0.5 * np.pi * np.arange(n) / n) ** 2
    rho = np.exp(-1.0 / np.geomspace(2.0, 3.0 * n, _TIMES))[:, None]
    shapes = (1.0 - rho**2) / ((1.0 - rho) ** 2 + rho * mu)
    return np.concatenate([1.0 + g * shapes for g in _SIZES])


def _matern(n: int) -> FloatArray:
    """Spectra (noises, n) of white noise of variance 1 and a Matern 3/2 process of each length and size."""
    frequency = np.pi * np.arange(n) * np.array(_WIGGLE_LENGTHS)[:, None] / 3.0**0.5
    shapes = 1.0 / (1.0 + frequency**2) ** 2
    shapes *= n / shapes.sum(axis=1, keepdims=True)
    return np.concatenate([1.0 + size * shapes for size in _WIGGLES])


def growth(residual: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Relative variances (n,), of mean 1, of noise that grows with the stiffness dP/dw; ones where it does not.

    The growth is estimated from second differences of the residual (n,), which a smooth misfit hardly affects, and
    is used only where it raises their log-likelihood by more than 3.
    """
    if len(residual) < 60:
        return np.ones(len(residual))
    square = np.diff(residual, 2) ** 2
    share = stiffness / stiffness.max()
    variances = (1.0 + _GROWTHS[:, None] * share[1:-1]) ** 2
    log_likelihood = len(square) * np.log((square / variances).mean(axis=1)) + np.log(variances).sum(axis=1)
    log_likelihood = -0.5 * log_likelihood / _OVERLAP - 2.0 * np.log1p(np.log1p(_GROWTHS))
    best = int(np.argmax(log_likelihood))
    if not log_likelihood[best] - log_likelihood[0] > _GAIN:
        return np.ones(len(residual))
    variance = (1.0 + _GROWTHS[best] * share) ** 2
    return np.asarray(variance / variance.mean())
