"""Quantiles of mixtures and of weighted draws, and the Pareto k that says how far weights can be trusted."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, stdtr

from underlay._arrays import FloatArray

_GRID, _ROUNDS = 17, 6  # places in a bracket; number of brackets, each a sixteenth of the one before
_NORMAL = 300.0  # degrees of freedom from which a Student distribution is taken as normal: 1e-3 of a quantile


def mixture_quantiles(
    means: FloatArray, deviations: FloatArray, weights: FloatArray, freedom: float, shares: FloatArray
) -> FloatArray:
    """Quantiles (q,) of a mixture of m Student distributions, by bracketing.

    Parameters
    ----------
    means, deviations, weights : FloatArray
        Of the distributions: means, scales, and weights that sum to 1, (m,) each.
    freedom : float
        Their degrees of freedom.
    shares : FloatArray
        Probabilities below the quantiles, (q,).
    """
    deviations = np.maximum(deviations, np.finfo(float).tiny)
    reach = 12.0 if freedom > 12 else 60.0
    low = np.full(len(shares), float((means - reach * deviations).min()))
    high = np.full(len(shares), float((means + reach * deviations).max()))
    rows = np.arange(len(shares))
    for _ in range(_ROUNDS):
        x = np.linspace(low, high, _GRID, axis=1)
        z = (x[..., None] - means) / deviations
        below = (ndtr(z) if freedom > _NORMAL else stdtr(freedom, z)) @ weights
        at = np.clip((below < shares[:, None]).sum(axis=1), 1, _GRID - 1)
        low, high = x[rows, at - 1], x[rows, at]
    return np.asarray(0.5 * (low + high))


def weighted_quantiles(values: FloatArray, weights: FloatArray, shares: FloatArray) -> FloatArray:
    """Quantiles (q,) at the probabilities `shares` (q,) of values (m,) with weights (m,) that sum to 1."""
    order = np.argsort(values, kind="stable")
    ranked = weights[order]
    return np.interp(shares, np.cumsum(ranked) - 0.5 * ranked, values[order])


def pareto_shape(log_weights: FloatArray) -> float:
    """Shape k of a generalised Pareto distribution of the largest weights; above 0.7 they cannot be trusted.

    Zhang and Stephens (2009), doi:10.1198/tech.2009.08017, with the prior of Vehtari et al. (2024), JMLR 25(72).
    """
    finite = log_weights[np.isfinite(log_weights)]
    tail = int(min(0.2 * len(finite), 3.0 * len(finite) ** 0.5))
    if tail < 5:
        return float("inf")
    ranked = np.sort(np.exp(finite - finite.max()))
    excess = np.maximum(ranked[-tail:] - ranked[-tail - 1], 1e-300)
    m = 30 + int(tail**0.5)
    b = 1.0 - np.sqrt(m / (np.arange(1, m + 1) - 0.5))
    b = b / (3.0 * excess[int(tail / 4 + 0.5) - 1]) + 1.0 / excess[-1]
    k = np.log1p(-b[:, None] * excess).mean(axis=1)
    profile = tail * (np.log(np.maximum(-b / k, 1e-300)) - k - 1.0)
    weight = 1.0 / np.exp(np.minimum(profile - profile[:, None], 700.0)).sum(axis=1)
    chosen = float(b @ weight / weight.sum())
    shape = float(np.log1p(-chosen * excess).mean())
    return (tail * shape + 5.0) / (tail + 10.0)
