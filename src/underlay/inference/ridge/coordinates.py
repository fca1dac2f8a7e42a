"""Coordinates in which the prior of a problem is a standard normal.

z_i = Phi^-1(F_i(x_i)), with F_i the prior's distribution function cut to what is physically possible. There are
no bounds in z, a parameter that the data ignore is normal, and one that is open to a side ends as softly as the
normal does. The posterior is L(x(z)) N(z; 0, I), whose integral is the evidence.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.problem import Problem

__all__ = ["FARTHEST", "PriorNormal", "Target", "log_normal"]

#: Farthest z of any parameter: 6e-14 of a prior lies beyond, and the distribution function is 1 to three digits of
#: what is left of it.
FARTHEST = 7.5

_LOG_2PI = float(np.log(2.0 * np.pi))


def log_normal(z: FloatArray) -> FloatArray:
    """Log-density (...) of a standard normal at z (..., p)."""
    return np.asarray(-0.5 * np.square(z).sum(axis=-1) - 0.5 * z.shape[-1] * _LOG_2PI)


class PriorNormal:
    """The way between the scaled vectors of a problem and z.

    Parameters
    ----------
    problem : Problem
        With a proper prior for every parameter.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._priors = [c.prior.truncated(c.low, c.high) for c in problem.coordinates]
        self.size = len(self._priors)

    def scaled(self, z: FloatArray) -> FloatArray:
        """Scaled vectors (m, p) at z (m, p)."""
        share = special.ndtr(z)
        values = np.column_stack([prior.quantile(share[:, i]) for i, prior in enumerate(self._priors)])
        return self._problem.space.scaled(values)

    def normal(self, vectors: FloatArray) -> FloatArray:
        """Coordinates z (m, p) at scaled vectors (m, p); infinite where the prior ends."""
        values = self._problem.physical(vectors)
        shares = [prior.probability_below(values[:, i]) for i, prior in enumerate(self._priors)]
        return np.asarray(special.ndtri(np.column_stack(shares)))

    def factors(self, vectors: FloatArray, covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places z (m, p) and lower factors (m, p, p) there of covariances (m, p, p) of scaled vectors (m, p).

        Those that reach beyond the priors are left out.
        """
        reach = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
        if not len(vectors):
            return vectors, covariances
        ends = [self.normal(vectors + side * reach) for side in (-1.0, 0.0, 1.0)]
        inside = np.isfinite(ends).all(axis=(0, 2)) & (np.abs(ends) < FARTHEST).all(axis=(0, 2))
        slopes = ((ends[2] - ends[0]) / (2.0 * reach))[inside]
        scaled = slopes[:, :, None] * covariances[inside] * slopes[:, None, :]
        lower: FloatArray = np.asarray(np.linalg.cholesky(scaled), dtype=np.float64)
        return ends[1][inside], lower

    def log_slope(self, vectors: FloatArray, z: FloatArray) -> FloatArray:
        """ln |dz/dq| (m,) at scaled vectors (m, p), whose coordinates are `z`."""
        # The part of a prior beyond what is physically possible is a constant factor, alike everywhere.
        return np.asarray(self._problem.log_prior(vectors) - log_normal(z))


class Target:
    """ln L(x(z)) + ln N(z; 0, I) as a callable (m, p) -> (m,): -inf where no law exists, or too far out.

    Parameters
    ----------
    coordinates : PriorNormal
        The way to scaled vectors.
    problem : Problem
        Whose posterior it is.
    density : callable
        Log-posterior (m,) of scaled vectors (m, p), never nan, -inf where it fails.
    """

    def __init__(
        self, coordinates: PriorNormal, problem: Problem, density: Callable[[FloatArray], FloatArray]
    ) -> None:
        self.coordinates = coordinates
        self._problem, self._density = problem, density
        self.evaluations = 0

    def __call__(self, z: FloatArray) -> FloatArray:
        """Log-density (m,) at z (m, p)."""
        values = np.full(len(z), -np.inf)
        near = np.flatnonzero((np.abs(z) < FARTHEST).all(axis=1))
        if not near.size:
            return values
        vectors = self.coordinates.scaled(z[near])
        prior = self._problem.log_prior(vectors)
        # Rounding may put the quantile of a bounded prior a hair beyond its end.
        inside = np.isfinite(prior)
        self.evaluations += int(inside.sum())
        if inside.any():
            likelihood = self._density(vectors[inside]) - prior[inside]
            values[near[inside]] = likelihood + log_normal(z[near[inside]])
        return values
