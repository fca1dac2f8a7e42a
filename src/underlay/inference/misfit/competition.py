"""Noise, a drifting law, a jump at contact and a creeping baseline, weighed by restricted likelihood.

About the present fit a reading is  F(theta) + Phi u + Z v + t y + e:

- e, white noise of variance s^2 and an Ornstein-Uhlenbeck process on it (`Whitener`);
- Phi u, a law whose relative error grows from nil at contact (`drift.py`), u_j ~ N(0, sigma_drift_j^2) with one
  set of sizes for each kind of drift. They are shares of the force, whatever the noise: laws are wrong by per cents
  on loud curves too;
- Z v, a force that sets in near contact (adhesion, drag, a snap): steps about contact and forces that grow
  toward it, v ~ N(0, s^2 sigma_jump^2 / 8);
- t y, a baseline that creeps in proportion to time, y ~ N(0, sigma_ramp^2), a share of the largest force: a line is
  no Ornstein-Uhlenbeck process, which is rough.

With J = dF/dtheta, A = [Phi sigma_drift / s, Z sigma_jump, t sigma_ramp / s], r = F - data, products under V^-1,

    N = [J A]'[J A] + diag(s^2 / sd^2, 1),   c = [J A]'r + ...,   S = r'r - c'N^-1 c,
    -2 log likelihood = (n - k) log s^2 + S / s^2 + log det V + log det N

(restricted maximum likelihood: Harville 1977, doi:10.1080/01621459.1977.10480998; a discrepancy with a prior:
Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294), where a measured parameter or a known error has its prior's
sd in N, c and S, and s^2 = S / (n - k + number of those). No test decides which of them is there: every combination
on a grid of sizes and times is weighed, and a parameter's interval is that of the mixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS
from underlay.inference.misfit.linearised import Linearised
from underlay.inference.misfit.mixture import Mixture
from underlay.inference.misfit.sizes import Sizes

__all__ = ["Competition"]

# Lighter combinations, hundreds of them, weigh together less than one in a thousand.
_LIGHTEST = 1e-6


@dataclass(frozen=True)
class Competition:
    """The weights of the combinations about one present fit, those left out that weigh nothing.

    Parameters
    ----------
    noises : sequence of (tau, g) or None
        Correlated noises; the first is white noise alone.
    sizes : Sizes
        What was weighed.
    places : NDArray
        Number of the noise and of the amounts of drift, jump and ramp of every combination, (c, 2).
    log_evidence : FloatArray
        Logarithm of prior times likelihood, (c,).
    shift : FloatArray
        Best shift of the coordinates, amplitudes of known errors, and columns of drift, jump and ramp, (c, k + 17).
    covariance : FloatArray
        Of coordinates and amplitudes, (c, k, k).
    variance : FloatArray
        s^2 over the scatter of the curves squared, (c,).
    degrees : int
        n - k.
    """

    noises: Sequence[tuple[float, float] | None]
    sizes: Sizes
    places: NDArray[np.intp]
    log_evidence: FloatArray
    shift: FloatArray
    covariance: FloatArray
    variance: FloatArray
    degrees: int

    @classmethod
    def of(cls, model: Linearised, sizes: Sizes, lightest: float = _LIGHTEST) -> Competition:
        """Weigh every combination about a linearised model; those below the share `lightest` are left out."""
        noises = sizes.noises([part.time for part in model.parts])
        found = _Weighed(model, sizes, *model.products(noises))
        rough, square = found.roughly(sizes.log_prior(len(noises)))
        weights = np.exp(rough - rough.max())
        kept = np.argwhere(np.asarray(weights >= lightest * weights.sum()))
        noise, column = kept.T
        variance = square[noise, column] / found.freedom
        prior = sizes.log_prior(len(noises))[noise, column]
        evidence, shift, covariance, variance = found.closely(noise, column, variance, prior)
        return cls(
            noises, sizes, kept, evidence, shift, covariance, variance, model.readings - len(model.precision)
        )

    @property
    def parameters(self) -> int:
        """Number of coordinates and amplitudes."""
        return int(self.covariance.shape[-1])

    @cached_property
    def weights(self) -> FloatArray:
        """Posterior probability of every combination, (c,)."""
        weights = np.exp(self.log_evidence - self.log_evidence.max())
        return np.asarray(weights / weights.sum())

    @cached_property
    def heaviest(self) -> int:
        """The combination with the largest weight."""
        return int(np.argmax(self.weights))

    @cached_property
    def amounts(self) -> FloatArray:
        """Sizes of drift, jump and ramp of every combination, (c, 8 + 2)."""
        return np.asarray(self.sizes.amounts[self.places[:, 1]])

    @property
    def white(self) -> float:
        """Probability that the noise is white."""
        return float(self.weights[self.places[:, 0] == 0].sum())

    @property
    def exact_law(self) -> float:
        """Probability that the law does not drift."""
        return float(self.weights[(self.amounts[:, :DRIFTS] == 0.0).all(axis=1)].sum())

    @property
    def no_jump(self) -> float:
        """Probability that the force does not jump at contact."""
        return float(self.weights[self.amounts[:, DRIFTS] == 0.0].sum())

    @property
    def level(self) -> float:
        """Probability that the baseline does not creep."""
        return float(self.weights[self.amounts[:, DRIFTS + 1] == 0.0].sum())

    @property
    def steady(self) -> float:
        """Probability that the noise is white and the baseline does not creep."""
        return float(self.weights[(self.places[:, 0] == 0) & (self.amounts[:, DRIFTS + 1] == 0.0)].sum())

    @property
    def mixture(self) -> Mixture:
        """Distribution of coordinates and amplitudes, the combinations averaged by their weights."""
        variances = np.diagonal(self.covariance, axis1=-2, axis2=-1)
        return Mixture(self.weights, self.shift[:, : self.parameters], np.sqrt(variances), self.degrees)


@dataclass(frozen=True)
class _Weighed:
    """The algebra of one linearised model: products of its columns (g, m, m) and log det V (g,) by noise."""

    model: Linearised
    sizes: Sizes
    products: FloatArray
    log_determinants: FloatArray

    @property
    def freedom(self) -> int:
        """n - k, and one for each prior that is a measurement."""
        return self.model.readings - len(self.model.precision) + self.model.measured

    def roughly(self, log_prior: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Log evidence and S of all combinations, (g, c), with s^2 of their noise: what is light is seen here."""
        k, amounts = len(self.model.precision), self.sizes.amounts
        largest = np.broadcast_to(amounts.max(axis=0), (len(self.products), amounts.shape[1]))
        every = np.arange(len(self.products))
        start = self._bordered(every, largest, np.ones(len(every)))
        variance = np.linalg.cholesky(start)[:, -1, -1] ** 2 / self.freedom
        reduced, log_kept = _eliminated(self._bordered(every, None, variance), k)
        scale = self._scale(np.tile(amounts, (len(every), 1)), np.repeat(variance, len(amounts)))[:, k:]
        scale = np.hstack((scale, np.ones((len(scale), 1)))).reshape(len(every), len(amounts), -1)
        square, log_normal = np.empty(scale.shape[:2]), np.empty(scale.shape[:2])
        for alike in self.sizes.alike:
            # Columns of other kinds of drift have no size here.
            used = np.flatnonzero(scale[0, alike].any(axis=0))
            own = scale[:, alike][:, :, used]
            bordered = own[..., :, None] * reduced[:, None, used[:, None], used] * own[..., None, :]
            inner = np.arange(len(used) - 1)
            # The columns came with a size of one over s.
            bordered[..., inner, inner] += 1.0
            root = np.diagonal(np.linalg.cholesky(bordered), axis1=-2, axis2=-1)
            square[:, alike] = root[..., -1] ** 2
            log_normal[:, alike] = log_kept[:, None] + 2.0 * np.log(root[..., :-1]).sum(axis=-1)
        evidence = self._evidence(square, self.log_determinants[:, None], log_normal)
        return log_prior + evidence, square

    def closely(
        self, noise: NDArray[np.intp], column: NDArray[np.intp], variance: FloatArray, log_prior: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Log evidence, shifts, covariances and s^2 of some combinations, (c,), each with its own s^2."""
        k, amounts = len(self.model.precision), self.sizes.amounts[column]
        bordered = self._bordered(noise, amounts, variance)
        normal, gradient = bordered[:, :-1, :-1], bordered[:, :-1, -1]
        inverse = np.linalg.inv(normal)
        solved = np.einsum("cij,cj->ci", inverse, gradient)
        # The last pivot is r'r - c'N^-1 c without the cancellation.
        root = np.diagonal(np.linalg.cholesky(bordered), axis1=-2, axis2=-1)
        square = root[:, -1] ** 2
        log_normal = 2.0 * np.log(root[:, :-1]).sum(axis=-1)
        evidence = log_prior + self._evidence(square, self.log_determinants[noise], log_normal)
        shift = -solved * self._scale(amounts, variance)
        variance = square / self.freedom
        return evidence, shift, inverse[:, :k, :k] * variance[:, None, None], variance

    def _evidence(
        self, square: FloatArray, log_determinant: FloatArray, log_normal: FloatArray
    ) -> FloatArray:
        variance, degrees = square / self.freedom, self.model.readings - len(self.model.precision)
        total = degrees * np.log(variance) + self.freedom + log_determinant + log_normal
        return np.asarray(-0.5 * total)

    def _scale(self, amounts: FloatArray, variance: FloatArray) -> FloatArray:
        return self.sizes.scales(amounts, variance, len(self.model.precision), len(self.model.parts))

    def _bordered(
        self, noise: NDArray[np.intp], amounts: FloatArray | None, variance: FloatArray
    ) -> FloatArray:
        """N with c and r'r beside it, (c, m, m), for noises, amounts (c, 8 + 2) and s^2 (c,).

        Without amounts the columns of the misfits keep their size and have no prior.
        """
        k = len(self.model.precision)
        bordered = np.array(self.products[noise])
        if amounts is not None:
            scale = np.ones(bordered.shape[:2])
            scale[:, :-1] = self._scale(amounts, variance)
            bordered *= scale[:, :, None] * scale[:, None, :]
            inner = np.arange(k, bordered.shape[-1] - 1)
            bordered[:, inner, inner] += 1.0
        among = np.arange(k)
        bordered[:, among, among] += variance[:, None] * self.model.precision
        bordered[:, among, -1] += variance[:, None] * self.model.pull
        bordered[:, -1, among] += variance[:, None] * self.model.pull
        bordered[:, -1, -1] += variance * self.model.offset
        return np.asarray(bordered)


def _eliminated(products: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Products (g, m, m) of columns with the first `count` solved for, and log det of those' own, (g,)."""
    first, cross = products[:, :count, :count], products[:, :count, count:]
    left = products[:, count:, count:] - np.swapaxes(cross, 1, 2) @ np.linalg.solve(first, cross)
    return np.asarray(left), np.asarray(np.linalg.slogdet(first)[1])
