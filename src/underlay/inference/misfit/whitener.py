"""White noise and an Ornstein-Uhlenbeck process together, whitened in O(n).

The variance of the readings is s^2 V with V = 1 + g K and K_ij = exp(-|t_i - t_j| / tau). W, the whitening of an
AR(1) process on the same times, is lower bidiagonal and W K W' = 1, so that

    V = W^-1 (W W' + g 1) W^-T,

where W W' + g 1 is tridiagonal and positive definite. With its Cholesky factor C the matrix C^-1 W whitens V, and
log det V = 2 log det C - 2 log det W. No difference of large numbers occurs at any g or tau. (The same structure as
in Rybicki and Press 1995, doi:10.1103/PhysRevLett.74.1060.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from underlay._arrays import FloatArray
from underlay.scene.correlated_noise import ar1_coefficients

__all__ = ["Whitener"]


@dataclass(frozen=True)
class Whitener:
    """Turns residuals with the variance V = 1 + g K into independent ones of unit variance.

    Parameters
    ----------
    correlation, spread : FloatArray
        rho_i = exp(-(t_i - t_{i-1}) / tau) and sqrt(1 - rho_i^2), (n - 1,).
    factor : FloatArray
        The unit lower bidiagonal L of W W' + g 1 = L D L', banded, (2, n).
    deviation : FloatArray
        Square roots of D, (n,).
    log_determinant : float
        log det V.
    """

    correlation: FloatArray
    spread: FloatArray
    factor: FloatArray
    deviation: FloatArray
    log_determinant: float

    @classmethod
    def of(cls, time: FloatArray, correlation_time: float, share: float) -> Whitener:
        """Whitening of white noise of unit variance and a process of variance `share` (g) on top.

        Parameters
        ----------
        time : FloatArray
            Times (s) of the readings, (n,), increasing.
        correlation_time : float
            tau (s), positive.
        share : float
            Variance g of the correlated part over that of the white part, positive.

        Raises
        ------
        InputError
            If the times do not increase or tau is not positive.
        """
        rho, spread = ar1_coefficients(time, correlation_time)
        scale = np.concatenate(([1.0], spread))
        diagonal = np.concatenate(([1.0], (1.0 + rho * rho) / (spread * spread))) + share
        beside = -rho / (spread * scale[:-1])
        pivots, lower, _ = lapack.dpttrf(diagonal, beside)
        factor = np.ones((2, len(diagonal)))
        factor[1, :-1], factor[1, -1] = lower, 0.0
        log_determinant = float(np.log(pivots).sum() + 2.0 * np.log(spread).sum())
        return cls(rho, spread, factor, np.sqrt(pivots), log_determinant)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Whitened columns, (n, m) as given."""
        ahead = np.empty_like(columns, order="F")
        ahead[0] = columns[0]
        ahead[1:] = (columns[1:] - self.correlation[:, None] * columns[:-1]) / self.spread[:, None]
        solved, _ = lapack.dtbtrs(self.factor, ahead, uplo="L", diag="U", overwrite_b=True)
        return np.asarray(solved / self.deviation[:, None])
