"""Closed-form result where the force is linear in the free parameters: a mixture of Student distributions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.hypotheses import Hypotheses
from underlay.inference.uncertainty.mixture import mixture_quantiles
from underlay.inference.uncertainty.moments import CurveMoments

_SINGULAR = 1e-12  # added to the unit diagonal of a scaled matrix
_JOINT = 48  # number of joint hypotheses of several curves


@dataclass(frozen=True, eq=False)
class Combined:
    """Hypotheses of all curves together.

    Row i of `chosen` (m, curves) has the index of one hypothesis of each curve; `weights` (m,) are the
    probabilities of the rows.
    """

    chosen: NDArray[np.intp]
    weights: FloatArray

    @property
    def rows(self) -> list[NDArray[np.intp]]:
        """Indices of each curve's hypotheses: one array (m,) for each curve."""
        return list(self.chosen.T)


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
        factors = np.array([_root(C) for C in self.covariances])
        z = rng.standard_normal((count, self.means.shape[1]))
        z *= np.sqrt(self.freedom / rng.chisquare(self.freedom, count))[:, None]
        return np.asarray(self.means[own] + np.einsum("nij,nj->ni", factors[own], z))


def combine(hypotheses: Sequence[Hypotheses]) -> Combined:
    """Joint hypotheses of several curves: of one curve its own, of several 48 combinations of equal weight.

    Each curve's hypotheses occur in proportion to their weights, in random orders with a fixed seed, so that
    results repeat.
    """
    if len(hypotheses) == 1:
        own = hypotheses[0].weight
        return Combined(np.arange(len(own))[:, None], own)
    rng = np.random.default_rng(len(hypotheses))
    places = (np.arange(_JOINT) + 0.5) / _JOINT
    chosen = [
        np.searchsorted(np.cumsum(own.weight), rng.permutation(places) * (1 - 1e-12)) for own in hypotheses
    ]
    return Combined(np.column_stack(chosen), np.full(_JOINT, 1.0 / _JOINT))


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


def _root(covariance: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
