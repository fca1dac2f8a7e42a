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
from scipy import optimize, special

from underlay._arrays import FloatArray
from underlay.inference.misfit.whitener import Whitener

__all__ = ["Competition", "Linearised", "Mixture", "Sizes", "drift_columns", "jump_columns"]

#: Where the steps of a jump stand, as shares of the largest depth: before contact and a little into it.
_STEPS = np.array([-0.15, -0.1, -0.06, -0.03, -0.01, 0.01, 0.04, 0.08])
# Combinations lighter than this together move no quantile by more than a thousandth of a standard deviation.
_LIGHT = 1e-6


@dataclass(frozen=True)
class Sizes:
    """What is weighed: sizes and times on grids, with their prior probabilities.

    Parameters
    ----------
    times : int
        Correlation times, from two steps of time to three times the record, in equal ratios.
    shares : tuple of float
        Variance of the correlated noise over that of the white.
    drifts, jumps : tuple of float
        Size of a drift of the law and of a jump, over the white noise.
    white, exact, smooth : float
        Prior probability that there is no correlated noise, no drift, no jump.
    """

    times: int = 5
    shares: tuple[float, ...] = (0.1, 1.0, 10.0, 100.0, 1000.0)
    drifts: tuple[float, ...] = (1.0, 5.62, 31.6, 178.0, 1000.0)
    jumps: tuple[float, ...] = (1.0, 4.64, 21.5, 100.0)
    white: float = 0.5
    exact: float = 0.9
    smooth: float = 0.5

    def noises(self, time: FloatArray) -> list[tuple[float, float] | None]:
        """Correlated noises (tau, g) for readings at `time` (s), (n,), after None for white noise alone."""
        shortest = 2.0 * float(np.median(np.diff(time)))
        taus = np.geomspace(shortest, 3.0 * float(time[-1] - time[0]), self.times)
        return [None, *((float(tau), share) for tau in taus for share in self.shares)]

    @cached_property
    def columns(self) -> FloatArray:
        """Sizes of drift and jump of every combination, (c, 2)."""
        pairs = [(drift, jump) for drift in (0.0, *self.drifts) for jump in (0.0, *self.jumps)]
        return np.array(pairs)

    def log_prior(self, noises: int) -> FloatArray:
        """Logarithm of the prior probability of every combination, (noises, c)."""
        noise = np.log(_shared(self.white, noises - 1))
        drift = np.log(_shared(self.exact, len(self.drifts)))
        jump = np.log(_shared(self.smooth, len(self.jumps)))
        return np.asarray(noise[:, None] + (drift[:, None] + jump).ravel())


def _shared(first: float, others: int) -> FloatArray:
    return np.concatenate(([first], np.full(others, (1.0 - first) / max(others, 1))))


def drift_columns(force: FloatArray, depth: FloatArray) -> FloatArray:
    """Phi: smooth relative errors of the law that vanish at contact, (n, 3), over the largest force.

    Parameters
    ----------
    force, depth : FloatArray
        Contact force P (N) and indentation depth w (m), (n,); zero before contact.
    """
    share = np.sqrt(np.maximum(depth, 0.0) / depth.max())[:, None]
    order = np.arange(1, 4)
    return np.asarray((force / np.abs(force).max())[:, None] * share**order / order)


def jump_columns(depth: FloatArray) -> FloatArray:
    """Z: steps of the force about contact, (n, 8), for depths w (m), (n,), negative before contact."""
    steps = depth[:, None] > _STEPS * depth.max()
    return np.asarray(steps.astype(float) / np.sqrt(len(_STEPS)))


@dataclass(frozen=True)
class Linearised:
    """A model about the present fit.

    Parameters
    ----------
    residuals : FloatArray
        Model minus data (N), (n,).
    jacobian : FloatArray
        Its derivatives in scaled coordinates, (n, k).
    drift, jump : FloatArray
        `drift_columns` and `jump_columns`, (n, 3) and (n, 8).
    time : FloatArray
        Times of the readings (s), (n,), increasing; their numbers where there are none.
    precision, pull : FloatArray
        Of the priors that are measurements: 1 / sd^2 and (value - mean) / sd^2 of every coordinate, (k,); zero
        where there is none.
    """

    residuals: FloatArray
    jacobian: FloatArray
    drift: FloatArray
    jump: FloatArray
    time: FloatArray
    precision: FloatArray
    pull: FloatArray

    @property
    def columns(self) -> FloatArray:
        """All that is whitened, (n, k + 12): derivatives, drift, jump, residuals."""
        return np.column_stack((self.jacobian, self.drift, self.jump, self.residuals))

    @property
    def offset(self) -> float:
        """Sum of squares of the priors at the present fit."""
        acting = self.precision > 0.0
        return float(np.sum(np.square(self.pull[acting]) / self.precision[acting]))


@dataclass(frozen=True)
class Mixture:
    """Student-t distributions of the scaled parameters, one for each combination that weighs something.

    Parameters
    ----------
    weights : FloatArray
        They sum to one, (g,).
    shift : FloatArray
        Of the parameters from the present fit, (g, k).
    deviation : FloatArray
        Standard deviations, (g, k).
    degrees : int
        Degrees of freedom.
    """

    weights: FloatArray
    shift: FloatArray
    deviation: FloatArray
    degrees: int

    def probability_below(self, entry: int, value: float) -> float:
        """Probability that parameter `entry` has shifted by less than `value`."""
        scaled = (value - self.shift[:, entry]) / self.deviation[:, entry]
        return float(self.weights @ special.stdtr(self.degrees, scaled))

    def quantile(self, entry: int, probability: float) -> float:
        """Shift of parameter `entry` (scaled coordinates) below which `probability` lies."""
        own = self.shift[:, entry] + self.deviation[:, entry] * special.stdtrit(self.degrees, probability)
        low, high = float(own.min()), float(own.max())
        if not high - low > 1e-12 * max(abs(low), abs(high)):
            return low
        found = optimize.brentq(
            lambda value: self.probability_below(entry, value) - probability,
            low,
            high,
            xtol=1e-9 * (high - low),
        )
        return float(found)


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
    covariance : FloatArray
        Of the coordinates, (noises, c, k, k).
    white_variance : FloatArray
        s^2 (N^2), (noises, c).
    degrees : int
        n - k.
    """

    noises: Sequence[tuple[float, float] | None]
    sizes: Sizes
    log_evidence: FloatArray
    shift: FloatArray
    covariance: FloatArray
    white_variance: FloatArray
    degrees: int

    @classmethod
    def of(cls, model: Linearised, sizes: Sizes) -> Competition:
        """Weigh every combination about a linearised model."""
        noises = sizes.noises(model.time)
        grams, log_determinants = _grams(model, noises)
        n, k = model.jacobian.shape
        scale = np.ones((len(sizes.columns), grams.shape[-1] - 1))
        scale[:, k : k + model.drift.shape[1]] = sizes.columns[:, :1]
        scale[:, k + model.drift.shape[1] :] = sizes.columns[:, 1:]
        normal = scale[:, :, None] * grams[:, None, :-1, :-1] * scale[:, None, :]
        gradient = scale * grams[:, None, :-1, -1]
        square = grams[:, None, -1, -1]
        added = np.ones(scale.shape[1])
        added[:k] = 0.0
        normal += np.diag(added)
        degrees = n - k
        measured = int(np.count_nonzero(model.precision))
        variance = np.zeros(normal.shape[:2])
        for _ in range(3 if measured else 1):
            # A measurement weighs s^2 against the points: with it s^2 is found by repetition.
            N, c = np.array(normal), np.array(gradient)
            index = np.arange(k)
            N[..., index, index] += variance[..., None] * model.precision
            c[..., :k] += variance[..., None] * model.pull
            solved = np.linalg.solve(N, c[..., None])[..., 0]
            left = square + variance * model.offset - np.einsum("gci,gci->gc", c, solved)
            variance = left / (degrees + (measured if variance.any() else 0))
        _, log_normal = np.linalg.slogdet(N)
        likelihood = -0.5 * (
            degrees * np.log(variance) + left / variance + log_determinants[:, None] + log_normal
        )
        inverse = np.linalg.inv(N)[..., :k, :k]
        return cls(
            noises,
            sizes,
            likelihood + sizes.log_prior(len(noises)),
            -solved * scale,
            np.asarray(inverse * variance[..., None, None]),
            variance,
            degrees,
        )

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

    @cached_property
    def mixture(self) -> Mixture:
        """Distribution of the coordinates, the combinations averaged by their weights."""
        k = self.covariance.shape[-1]
        kept = self.weights > _LIGHT
        variances = np.diagonal(self.covariance[kept], axis1=-2, axis2=-1)
        weights = self.weights[kept]
        return Mixture(weights / weights.sum(), self.shift[kept][:, :k], np.sqrt(variances), self.degrees)


def _grams(model: Linearised, noises: Sequence[tuple[float, float] | None]) -> tuple[FloatArray, FloatArray]:
    """Products of all whitened columns, (noises, m, m), and log det V, (noises,)."""
    columns = model.columns
    grams, log_determinants = [columns.T @ columns], [0.0]
    for noise in noises:
        if noise is None:
            continue
        whitener = Whitener.of(model.time, *noise)
        whitened = whitener.whiten(columns)
        grams.append(whitened.T @ whitened)
        log_determinants.append(whitener.log_determinant)
    return np.array(grams), np.array(log_determinants)
