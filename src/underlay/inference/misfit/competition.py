"""Noise, a drifting law and a jump at contact, weighed against each other by restricted likelihood.

About the present fit a reading is  F(theta) + Phi u + Z v + e:

- e, white noise of variance s^2 and an Ornstein-Uhlenbeck process on it (`Whitener`);
- Phi u, a law whose relative error is a smooth function of the contact radius and nil at contact (finite strain,
  a base that is not what the scene says): Phi_j = P (w / w_max)^(j/2) / j, j = 1, 2, 3, u ~ N(0, sigma_drift^2);
- Z v, a force that sets in near contact (adhesion, drag, a snap): steps about the contact point,
  v ~ N(0, sigma_jump^2 / 8).

With J = dF/dtheta, A = [Phi sigma_drift / s, Z sigma_jump / s] and r = F - data, all whitened,

    N = [J A]'[J A] + diag(0, 1),   c = [J A]'r,   S = r'r - c'N^-1 c,
    -2 log likelihood = (n - k) log S + log det V + log det N

(restricted maximum likelihood: Harville 1977, doi:10.1080/01621459.1977.10480998; a discrepancy with a prior:
Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294). No test decides which of them is there: every combination on
a grid of sizes and times is weighed, and a parameter's interval is that of the mixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.misfit.sizes import Sizes

__all__ = ["Competition"]

# Combinations lighter than this together move no quantile by more than a thousandth of a standard deviation.
_LIGHT = 1e-6
# Each repetition of s^2 gains a factor of about n.
_REPEATS = 2


@dataclass(frozen=True)
class Competition:
    """The weights of all combinations about one present fit.

    Parameters
    ----------
    noises : list of (tau, g) or None
        Correlated noises; the first is white noise alone.
    sizes : Sizes
        What was weighed.
    log_evidence : FloatArray
        Logarithm of prior times likelihood, (noises, c).
    shift : FloatArray
        Best shift of the coordinates and of the columns of drift and jump, (noises, c, k + 11).
    normal : FloatArray
        N, (noises, c, m, m).
    white_variance : FloatArray
        s^2 over the scatter of the curves squared, (noises, c).
    degrees, parameters : int
        n - k and k.
    """

    noises: Sequence[tuple[float, float] | None]
    sizes: Sizes
    log_evidence: FloatArray
    shift: FloatArray
    normal: FloatArray
    white_variance: FloatArray
    degrees: int
    parameters: int

    @classmethod
    def of(cls, model: Linearised, sizes: Sizes) -> Competition:
        """Weigh every combination about a linearised model."""
        noises = sizes.noises([part.time for part in model.parts])
        pairs = [model.gram(noise) for noise in noises]
        grams = np.array([gram for gram, _ in pairs])
        log_determinants = np.array([log_determinant for _, log_determinant in pairs])
        k = len(model.precision)
        scale = sizes.scales(k, len(model.parts))
        normal = scale[:, :, None] * grams[:, None, :-1, :-1] * scale[:, None, :]
        normal += np.diag(np.r_[np.zeros(k), np.ones(scale.shape[1] - k)])
        gradient, square = scale * grams[:, None, :-1, -1], grams[:, None, -1, -1]
        degrees = model.readings - k
        measured = int(np.count_nonzero(model.precision))
        solved, variance, left = _solved(normal, gradient, square, degrees)
        for _ in range(_REPEATS if measured else 0):
            # A measurement weighs s^2 against the readings: s^2 is found by repetition.
            pulled, pulling = np.array(normal), np.array(gradient)
            pulled[..., range(k), range(k)] += variance[..., None] * model.precision
            pulling[..., :k] += variance[..., None] * model.pull
            offset = square + variance * model.offset
            solved, variance, left = _solved(pulled, pulling, offset, degrees + measured)
        if measured:
            normal = pulled
        log_normal = np.linalg.slogdet(normal)[1]
        likelihood = degrees * np.log(variance) + left / variance + log_determinants[:, None] + log_normal
        evidence = sizes.log_prior(len(noises)) - 0.5 * likelihood
        return cls(noises, sizes, evidence, np.asarray(-solved * scale), normal, variance, degrees, k)

    @cached_property
    def weights(self) -> FloatArray:
        """Posterior probability of every combination, (noises, c)."""
        weights = np.exp(self.log_evidence - self.log_evidence.max())
        return np.asarray(weights / weights.sum())

    @cached_property
    def heaviest(self) -> tuple[int, int]:
        """The combination with the largest weight."""
        noise, column = np.unravel_index(int(np.argmax(self.weights)), self.weights.shape)
        return int(noise), int(column)

    @property
    def white(self) -> float:
        """Probability that the noise is white."""
        return float(self.weights[0].sum())

    @property
    def exact_law(self) -> float:
        """Probability that the law does not drift."""
        return float(self.weights[:, self.sizes.columns[:, 0] == 0.0].sum())

    @property
    def no_jump(self) -> float:
        """Probability that the force does not jump at contact."""
        return float(self.weights[:, self.sizes.columns[:, 1] == 0.0].sum())

    @property
    def kept(self) -> NDArray[np.bool_]:
        """The combinations that weigh something, (noises, c)."""
        return np.asarray(self.weights > _LIGHT)

    def covariance(self, kept: NDArray[np.bool_]) -> FloatArray:
        """Covariance of the coordinates for the combinations marked in `kept` (noises, c), (g, k, k)."""
        k = self.parameters
        inverse = np.linalg.inv(self.normal[kept])[:, :k, :k]
        return np.asarray(inverse * self.white_variance[kept][:, None, None])

    @cached_property
    def mixture(self) -> Mixture:
        """Distribution of the coordinates, the combinations averaged by their weights."""
        kept = self.kept
        variances = np.diagonal(self.covariance(kept), axis1=-2, axis2=-1)
        weights = self.weights[kept]
        shift = self.shift[kept][:, : self.parameters]
        return Mixture(weights / weights.sum(), shift, np.sqrt(variances), self.degrees)


def _solved(
    normal: FloatArray, gradient: FloatArray, square: FloatArray, degrees: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """N^-1 c, the variance s^2 = S / degrees, and S."""
    solved = np.linalg.solve(normal, gradient[..., None])[..., 0]
    left = square - np.einsum("gci,gci->gc", gradient, solved)
    return np.asarray(solved), np.asarray(left / degrees), np.asarray(left)
