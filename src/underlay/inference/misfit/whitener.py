"""White noise and an Ornstein-Uhlenbeck process together: products under the inverse of their variance, in O(n).

The variance of the readings is s^2 V with V = 1 + g K and K_ij = exp(-|t_i - t_j| / tau). W, the whitening of an
AR(1) process on the same times, is lower bidiagonal and W K W' = 1, so that

    V^-1 = W' T^-1 W,   T = W W' + g 1,   log det V = log det T - 2 log det W,

where T is tridiagonal and positive definite. W does not depend on g. No difference of large numbers occurs at any g
or tau. (The same structure as in Rybicki and Press 1995, doi:10.1103/PhysRevLett.74.1060.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from underlay._arrays import FloatArray
from underlay.scene.noise import ar1_coefficients

__all__ = ["Whitener"]


@dataclass(frozen=True)
class Whitener:
    """Correlation time of a noise: what products under V^-1 are made of, for every share g of the process.

    Parameters
    ----------
    correlation, spread : FloatArray
        rho_i = exp(-(t_i - t_{i-1}) / tau) and sqrt(1 - rho_i^2), (n - 1,).
    diagonal, beside : FloatArray
        Of W W', (n,) and (n - 1,).
    log_determinant : float
        Of W^-2.
    """

    correlation: FloatArray
    spread: FloatArray
    diagonal: FloatArray
    beside: FloatArray
    log_determinant: float

    @classmethod
    def of(cls, time: FloatArray, correlation_time: float) -> Whitener:
        """Prepare a process with the correlation time tau (s), read at times (s), (n,); raises as `several`."""
        return cls.several(time, [correlation_time])[0]

    @classmethod
    def several(cls, time: FloatArray, correlation_times: Sequence[float]) -> list[Whitener]:
        """Prepare processes with several correlation times (s), read at the same times (s), (n,).

        Raises
        ------
        InputError
            If the times do not increase or a correlation time is not positive.
        """
        rho, spread = ar1_coefficients(time, np.array(correlation_times)[:, None])
        first = np.ones((len(rho), 1))
        diagonal = np.hstack((first, (1.0 + rho * rho) / (spread * spread)))
        beside = -rho / (spread * np.hstack((first, spread[:, :-1])))
        log_determinants = 2.0 * np.log(spread).sum(axis=1)
        return [
            cls(*each) for each in zip(rho, spread, diagonal, beside, log_determinants.tolist(), strict=True)
        ]

    def ahead(self, columns: FloatArray) -> FloatArray:
        """W times columns (n, m)."""
        moved = np.empty(columns.shape, order="F")
        moved[0] = columns[0]
        moved[1:] = (columns[1:] - self.correlation[:, None] * columns[:-1]) / self.spread[:, None]
        return moved

    def inverse(self, ahead: FloatArray, share: float) -> tuple[FloatArray, FloatArray]:
        """T^-1 times what `ahead` made of columns (n, m), for a share g of the process, and the pivots of T, (n,).

        For columns X and Y, ``ahead(X).T @ inverse(ahead(Y), g)[0]`` is X' V^-1 Y; log det V is the sum of the
        pivots' logarithms and `log_determinant`.
        """
        pivots, lower, _ = lapack.dpttrf(self.diagonal + share, self.beside)
        solved, _ = lapack.dpttrs(pivots, lower, ahead)
        return solved, pivots

    def inverse_times(self, columns: FloatArray, share: float) -> tuple[FloatArray, float]:
        """V^-1 times columns (n, m), for a share g of the process, and log det V."""
        solved, pivots = self.inverse(self.ahead(columns), share)
        solved[1:] /= self.spread[:, None]
        solved[:-1] -= self.correlation[:, None] * solved[1:]
        return solved, float(np.log(pivots).sum()) + self.log_determinant

    def recursion(self, share: float) -> FloatArray:
        """alpha, beta, gamma (3, n) of e = D^(-1/2) L^-1 W r, T = L D L', for a share g of the process.

        e_i = alpha_i r_i + beta_i r_(i-1) + gamma_i e_(i-1), and r' V^-1 r = e'e.
        """
        pivots, lower, _ = lapack.dpttrf(self.diagonal + share, self.beside)
        root = np.sqrt(pivots)
        alpha = 1.0 / (np.concatenate(([1.0], self.spread)) * root)
        beta = -np.concatenate(([0.0], self.correlation)) * alpha
        gamma = np.concatenate(([0.0], -lower * root[:-1] / root[1:]))
        return np.array([alpha, beta, gamma])
