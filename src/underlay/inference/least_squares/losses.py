"""Robust losses: what a minimiser lowers in place of the sum of squares, and what that does to standard errors.

They are those of `scipy.optimize.least_squares`, of the square z = r^2 of a whitened residual.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["LOSSES", "SQUARES", "Loss", "robust_inflation"]


class Loss(NamedTuple):
    """One loss, each a function of z (n,).

    Parameters
    ----------
    rho : callable
        What is summed.
    weight : callable
        rho'(z).
    slope : callable
        d(r rho'(r^2))/dr.
    """

    rho: Callable[[FloatArray], FloatArray]
    weight: Callable[[FloatArray], FloatArray]
    slope: Callable[[FloatArray], FloatArray]


#: Least squares.
SQUARES = Loss(lambda z: z, np.ones_like, np.ones_like)

#: The others, by name.
LOSSES = {
    "soft_l1": Loss(
        lambda z: 2.0 * (np.sqrt(1.0 + z) - 1.0), lambda z: (1.0 + z) ** -0.5, lambda z: (1.0 + z) ** -1.5
    ),
    "huber": Loss(
        lambda z: np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0),
        lambda z: 1.0 / np.sqrt(np.maximum(z, 1.0)),
        lambda z: np.where(z <= 1.0, 1.0, 0.0),
    ),
    "cauchy": Loss(np.log1p, lambda z: 1.0 / (1.0 + z), lambda z: (1.0 - z) / (1.0 + z) ** 2),
    "arctan": Loss(
        np.arctan, lambda z: 1.0 / (1.0 + z * z), lambda z: (1.0 - 3.0 * z * z) / (1.0 + z * z) ** 2
    ),
}


def robust_inflation(residuals: FloatArray, loss: str | None) -> float:
    """Factor on the covariance of an M-estimator, E[psi^2] / E[psi']^2 over its residuals.

    Huber (1981), Robust Statistics, eq. 7.6.8 (doi:10.1002/0471725250), with psi(r) = r rho'(r^2); one for least
    squares.
    """
    if loss is None:
        return 1.0
    z, known = residuals * residuals, LOSSES[loss]
    return float(np.mean(z * known.weight(z) ** 2) / np.mean(known.slope(z)) ** 2)
