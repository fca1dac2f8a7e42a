"""How heavy the tail of importance weights is, and weights with that tail smoothed (PSIS).

Vehtari, Simpson, Gelman, Yao and Gabry (2024), Pareto smoothed importance sampling, Journal of Machine Learning
Research 25(72); the generalised Pareto distribution is fitted after Zhang and Stephens (2009),
doi:10.1198/tech.2009.08017, with the weak prior on its index that the former add.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from underlay._arrays import FloatArray

__all__ = ["pareto_fit", "smoothed"]

# Fewest weights that a tail is fitted to, and how many count as one, of n: the smaller of n / 5 and 3 sqrt(n).
_FEWEST = 5
# Grid of Zhang and Stephens: so many points more than the root of the number of exceedances.
_GRID, _PRIOR_POINTS = 30, 3.0
# The index is drawn to one half with the weight of ten exceedances.
_PULL, _PULLED_TO = 10.0, 0.5


def pareto_fit(excess: FloatArray) -> tuple[float, float]:
    """Index and scale of the generalised Pareto distribution of `excess` (n,), positive and in rising order.

    scipy's maximum likelihood does not serve: it searches for minutes where the index is below -1/2, and it is
    biased for the fifty numbers that a tail has.
    """
    count = len(excess)
    points = _GRID + int(np.sqrt(count))
    quartile = excess[int(count / 4.0 + 0.5) - 1]
    theta = 1.0 / excess[-1] + (1.0 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))) / (
        _PRIOR_POINTS * quartile
    )
    index = np.log1p(-theta[:, None] * excess).mean(axis=1)
    likelihood = count * (np.log(-theta / index) - index - 1.0)
    best = float(special.softmax(likelihood) @ theta)
    k = float(np.log1p(-best * excess).mean())
    scale = -k / best
    return (count * k + _PULL * _PULLED_TO) / (count + _PULL), scale


def smoothed(log_weights: FloatArray) -> tuple[FloatArray, float]:
    """Smooth the tail of weights.

    Parameters
    ----------
    log_weights : FloatArray
        (n,); -inf for a weight of zero.

    Returns
    -------
    log_weights : FloatArray
        (n,): the largest replaced by what their Pareto distribution expects in their ranks, none above the
        largest there was.
    index : float
        Its index, k-hat: the mean of the weights converges at a useful rate below 0.7, its variance exists below
        0.5. Inf where there are too few weights to tell.
    """
    count = int(np.isfinite(log_weights).sum())
    tail = int(np.ceil(min(0.2 * count, 3.0 * np.sqrt(count))))
    if tail < _FEWEST:
        return log_weights, float("inf")
    order = np.argsort(log_weights, kind="stable")
    top = order[-tail:]
    largest = log_weights[top[-1]]
    cut = np.exp(log_weights[order[-tail - 1]] - largest)
    excess = np.exp(log_weights[top] - largest) - cut
    if not excess[int(tail / 4.0 + 0.5) - 1] > 0.0:
        # Equal weights have no tail.
        return log_weights, float("-inf") if excess[-1] <= 0.0 else float("inf")
    k, scale = pareto_fit(excess)
    levels = (np.arange(tail) + 0.5) / tail
    expected = cut + scale * np.expm1(-k * np.log1p(-levels)) / k
    result = log_weights.copy()
    result[top] = np.minimum(np.log(expected), 0.0) + largest
    return result, k
