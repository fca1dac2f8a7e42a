"""Mixtures of Student distributions: those of a fit whose force is linear in what is free, quantiles, draws.

Also the Pareto k that says how far the weights of draws can be trusted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtr, stdtr

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.hypotheses import Hypotheses
from underlay.inference.uncertainty.moments import CurveMoments

_GRID, _ROUNDS = 17, 6  # places in a bracket; number of brackets, each a sixteenth of the one before
_NORMAL = 300.0  # degrees of freedom from which a Student distribution is taken as normal: 1e-3 of a quantile
_SINGULAR = 1e-12  # added to the unit diagonal of a scaled matrix
_JOINT = 48  # number of joint hypotheses of several curves


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


def student_draws(count: int, q: int, freedom: float, rng: np.random.Generator) -> FloatArray:
    """Draws (count, q) of the standard Student distribution in q dimensions."""
    z = rng.standard_normal((count, q))
    z *= np.sqrt(freedom / rng.chisquare(freedom, count))[:, None]
    return np.asarray(z)


def log_student(square: FloatArray, log_det: FloatArray, q: int, freedom: float) -> FloatArray:
    """Log-density of a Student distribution in q dimensions.

    `square` are squared distances from its middle in its own deviations, `log_det` the logarithm of the determinant
    of its Cholesky factor.
    """
    constant = gammaln(0.5 * (freedom + q)) - gammaln(0.5 * freedom) - 0.5 * q * np.log(freedom * np.pi)
    return np.asarray(constant - log_det - 0.5 * (freedom + q) * np.log1p(square / freedom))


class Combined(NamedTuple):
    """Joint hypotheses of all curves, m of them.

    `rows` has the indices (m,) of each curve's hypotheses, `weights` (m,) are the probabilities.
    """

    rows: list[NDArray[np.intp]]
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Mixture:
    """Student distributions of the scaled vector: weights (m,), means (m, k), covariances (m, k, k).

    `freedom` are their degrees of freedom, the same for all.
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    freedom: float

    def quantiles(self, index: int, shares: FloatArray) -> FloatArray:
        """Quantiles (q,) of entry `index` of the vector, at the probabilities `shares` (q,)."""
        deviations = np.sqrt(self.covariances[:, index, index])
        return mixture_quantiles(self.means[:, index], deviations, self.weights, self.freedom, shares)

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations (k,) of the whole mixture about its mean."""
        off = self.means - self.weights @ self.means
        own = np.diagonal(self.covariances, axis1=1, axis2=2)
        return np.asarray(np.sqrt(self.weights @ (own + off * off)))

    def draws(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Random vectors (count, k) from the mixture."""
        own = rng.choice(len(self.weights), count, p=self.weights)
        values, vectors = np.linalg.eigh(self.covariances)
        factors = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
        z = student_draws(count, self.means.shape[1], self.freedom, rng)
        return np.asarray(self.means[own] + np.einsum("nij,nj->ni", factors[own], z))


def combine(hypotheses: Sequence[Hypotheses]) -> Combined:
    """Joint hypotheses of several curves: of one curve its own, of several 48 combinations of equal weight.

    Each curve's hypotheses occur in proportion to their weights, in random orders with a fixed seed, so that
    results repeat.
    """
    if len(hypotheses) == 1:
        own = hypotheses[0].weight
        return Combined([np.arange(len(own))], own)
    rng = np.random.default_rng(len(hypotheses))
    places = (np.arange(_JOINT) + 0.5) / _JOINT
    chosen = [
        np.searchsorted(np.cumsum(own.weight), rng.permutation(places) * (1 - 1e-12)) for own in hypotheses
    ]
    return Combined(chosen, np.full(_JOINT, 1.0 / _JOINT))


def linear_mixture(
    moments: Sequence[CurveMoments],
    combined: Combined,
    vector: FloatArray,
    free: NDArray[np.bool_],
    freedom: float,
    prior_precision: FloatArray,
    bent: Callable[[FloatArray], Sequence[FloatArray]],
) -> Mixture:
    """Mixture of Student distributions of the scaled vector about the optimum, one for each hypothesis.

    Parameters
    ----------
    moments : sequence of CurveMoments
        Moments of each curve.
    combined : Combined
        Hypotheses of all curves together, m of them.
    vector : FloatArray
        Scaled vector of the optimum, (k,).
    free : ndarray of bool (k,)
        Entries that vary; the others stay at the optimum.
    freedom : float
        Degrees of freedom of the noise's variance.
    prior_precision : FloatArray
        Curvature of the priors in the scaled vector, (k,): zero for flat ones.
    bent : callable
        Nonlinear part of each curve's force (n,) for a step (k,) from the optimum: force less its linearisation.
        Where hypotheses correct the value it is called once, for the mean step, and scaled by the square of each
        step.
    """
    kept = np.flatnonzero(free)
    rows = combined.rows
    information, covariance, offset = (
        sum(getattr(own, what)[row] for own, row in zip(moments, rows, strict=True))
        for what in ("information", "covariance", "offset")
    )
    information = information[:, kept[:, None], kept]
    gain = _inverses(information + np.diag(prior_precision[kept]))
    count, k = len(combined.weights), len(vector)
    means, covariances = np.tile(vector, (count, 1)), np.zeros((count, k, k))
    steps = np.zeros((count, k))
    steps[:, kept] = np.einsum("mij,mj->mi", gain, offset[:, kept])
    mean = combined.weights @ steps
    if mean.any():
        mean /= combined.weights[steps.any(axis=1)].sum()
        curves = zip(moments, bent(mean), rows, strict=True)
        grown = np.square(steps @ mean / (mean @ mean))
        for own, beyond, row in curves:
            missed = own.along(beyond)[row][:, kept]
            steps[:, kept] -= grown[:, None] * np.einsum("mij,mj->mi", gain, missed)
    means += steps
    # As a square: rounding must not make the variance of what is hardly determined negative.
    roots = gain @ _roots(covariance[:, kept[:, None], kept] + np.diag(prior_precision[kept]))
    covariances[:, kept[:, None], kept] = roots @ np.swapaxes(roots, 1, 2)
    return Mixture(combined.weights, means, covariances, freedom)


def _inverses(matrices: FloatArray) -> FloatArray:
    """Inverses (m, k, k) of symmetric, perhaps nearly singular matrices, regularised at unit diagonal."""
    scale, scaled = _at_unit_diagonal(matrices)
    return np.asarray(np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :]))


def _roots(matrices: FloatArray) -> FloatArray:
    """Roots R (m, k, k) of such matrices, R R'. A negative eigenvalue is a zero but for rounding."""
    scale, scaled = _at_unit_diagonal(matrices)
    values, vectors = np.linalg.eigh(scaled)
    return np.asarray(scale[:, :, None] * vectors * np.sqrt(np.maximum(values, _SINGULAR))[:, None])


def _at_unit_diagonal(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Roots (m, k) of the diagonals of matrices (m, k, k), and the matrices scaled by them and regularised."""
    scale = np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))
    scaled = matrices / (scale[:, :, None] * scale[:, None, :])
    return scale, scaled + _SINGULAR * np.eye(matrices.shape[1])
