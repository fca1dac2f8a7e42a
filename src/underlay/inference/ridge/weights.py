"""Draws of a mixture, weighed: the posterior they stand for, its evidence, and whether to believe it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.inference.ridge.pareto import smoothed

__all__ = ["LEVELS", "WeightedDraws"]

#: Quantiles whose error decides whether there are draws enough: the ends of a 95 % interval and the median.
LEVELS = (0.025, 0.5, 0.975)


@dataclass(frozen=True, eq=False)
class WeightedDraws:
    """Draws of a frozen mixture and what they weigh.

    Parameters
    ----------
    z : FloatArray
        (n, p), where the prior is a standard normal.
    vectors : FloatArray
        (n, p): the same, scaled; nan where the weight is zero.
    log_target, log_proposal : FloatArray
        (n,): logarithms of the posterior, unnormalised, and of the mixture.
    """

    z: FloatArray
    vectors: FloatArray
    log_target: FloatArray
    log_proposal: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[WeightedDraws]) -> WeightedDraws:
        """All draws of several batches of one mixture."""
        arrays = [(part.z, part.vectors, part.log_target, part.log_proposal) for part in parts]
        return cls(*(np.concatenate(entries) for entries in zip(*arrays, strict=True)))

    @property
    def log_weights(self) -> FloatArray:
        """ln(posterior / mixture), (n,)."""
        return np.asarray(self.log_target - self.log_proposal)

    @cached_property
    def _smoothed(self) -> tuple[FloatArray, float]:
        return smoothed(self.log_weights)

    @property
    def k_hat(self) -> float:
        """Tail index of the weights."""
        return self._smoothed[1]

    @cached_property
    def weights(self) -> FloatArray:
        """Smoothed weights (n,), of sum one."""
        return np.asarray(special.softmax(self._smoothed[0]))

    @property
    def effective(self) -> float:
        """Kish's effective sample size, (sum w)^2 / sum w^2."""
        return float(1.0 / np.square(self.weights).sum())

    @property
    def log_evidence(self) -> tuple[float, float]:
        """Logarithm of the posterior's integral, and its standard error."""
        count = len(self.z)
        value = float(special.logsumexp(self._smoothed[0])) - float(np.log(count))
        return value, float(np.sqrt(max(1.0 / self.effective - 1.0 / count, 0.0)))

    @cached_property
    def _ranked(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Kept values in rising order, with their weights and the weight up to each, each (m, p)."""
        kept = np.flatnonzero(self.weights > 0.0)
        values, weights = self.vectors[kept], self.weights[kept]
        order = np.argsort(values, axis=0)
        ranked = weights[order]
        return np.take_along_axis(values, order, axis=0), ranked, np.cumsum(ranked, axis=0)

    @cached_property
    def deviations(self) -> FloatArray:
        """Standard deviations (p,) of the posterior, scaled."""
        values, weights, _ = self._ranked
        means = (weights * values).sum(axis=0)
        return np.asarray(np.sqrt((weights * np.square(values - means)).sum(axis=0)))

    def quantiles(self, levels: Sequence[float] = LEVELS) -> FloatArray:
        """Quantiles of the posterior, (levels, p), scaled."""
        values, _, upto = self._ranked
        return np.array([_at(values, upto, np.full(values.shape[1], level)) for level in levels])

    def quantile_errors(self) -> FloatArray:
        """Monte Carlo errors of the quantiles at `LEVELS`, (levels, p), in standard deviations of the posterior."""
        values, weights, upto = self._ranked
        squares = np.cumsum(np.square(weights), axis=0)
        total = squares[-1]
        errors = []
        for level in LEVELS:
            below = _at(squares, upto, np.full(values.shape[1], level))
            # sum w^2 (1[x < q] - level)^2
            share = np.sqrt((1.0 - level) ** 2 * below + level**2 * (total - below))
            ends = [_at(values, upto, np.clip(level + sign * share, 0.0, 1.0)) for sign in (1.0, -1.0)]
            errors.append(0.5 * (ends[0] - ends[1]) / self.deviations)
        return np.array(errors)

    def resampled(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Rows (count,) drawn systematically by weight, in chance order."""
        levels = (np.arange(count) + rng.random()) / count
        rows = np.searchsorted(np.cumsum(self.weights), levels).clip(max=len(self.z) - 1)
        return np.asarray(rng.permutation(rows))

    def upper_point(self, share: float = 0.99) -> float:
        """Log-weight above which 1 - `share` of the posterior lies."""
        order = np.argsort(self.log_weights)
        upto = np.cumsum(self.weights[order])
        return float(self.log_weights[order][min(int(np.searchsorted(upto, share)), len(order) - 1)])


def _at(values: FloatArray, upto: FloatArray, level: FloatArray) -> FloatArray:
    """`values` (n, p) where the weight up to them, (n, p), reaches `level` (p,)."""
    return np.array([np.interp(level[i], upto[:, i], values[:, i]) for i in range(values.shape[1])])
