"""A mixture of Student distributions, its weighted draws, and whether they may be believed.

How heavy the tail of importance weights is, and weights with that tail smoothed (PSIS).

Vehtari, Simpson, Gelman, Yao and Gabry (2024), Pareto smoothed importance sampling, Journal of Machine Learning
Research 25(72); the generalised Pareto distribution is fitted after Zhang and Stephens (2009),
doi:10.1198/tech.2009.08017, with the weak prior on its index that the former add.

A mixture of Student distributions: what is laid along the ridges, drawn from and weighed with.

Draws of a mixture, weighed: the posterior they stand for, its evidence, and whether to believe it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy import special
from scipy.stats import qmc

from underlay._arrays import FloatArray
from underlay.inference.ridge.march import Node

__all__ = ["LEVELS", "MOST_COMPONENTS", "Chance", "Mixture", "WeightedDraws", "pareto_fit", "smoothed"]

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


#: Most components of a frozen mixture: with more a proposal costs more than a density.
MOST_COMPONENTS = 1000


#: Degrees of freedom of every component: tails heavier than a posterior's, and a covariance that exists.
_FREEDOM = 5.0


# Widths over those of a slice, and over the gap between nodes; share that is even over the nodes.
_WIDER, _ALONG, _EVEN = 1.2, 0.9, 0.15


# The wide twin of a component, and what it gets of its weight.
_TWIN, _TWIN_SHARE = 1.8, 0.3


# A component learnt from draws keeps what so many of them per parameter would tell it of its old covariance, and is
# given up once fewer than one in a thousand are its own.
_INERTIA, _NEGLIGIBLE = 4.0, 1e-3


# Bits of the numbers that are evenly spread.
_BITS = 30


# Places looked at together: what fits a processor's cache.
_ROWS = 1024


class Chance(Protocol):
    """What is asked of numpy's generators, the new and the old."""

    def standard_normal(self, size: tuple[int, ...]) -> FloatArray:
        """Normal numbers."""

    def chisquare(self, df: float, size: int) -> FloatArray:
        """Chi-squared numbers."""

    def uniform(self, low: float, high: float, size: int) -> FloatArray:
        """Even numbers."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """Student distributions of five degrees of freedom in p dimensions.

    Parameters
    ----------
    weights : FloatArray
        (K,), of sum one.
    places : FloatArray
        (K, p): their middles.
    factors : FloatArray
        (K, p, p): lower Cholesky factors of their scale matrices.
    """

    weights: FloatArray
    places: FloatArray
    factors: FloatArray

    @classmethod
    def along(cls, nodes: Sequence[Node]) -> Mixture:
        """One component a node, wide enough to overlap with its neighbours."""
        mass = special.softmax([node.log_weight for node in nodes])
        wide = [np.column_stack([_WIDER * node.across, _ALONG * node.along]) for node in nodes]
        return cls(
            (1.0 - _EVEN) * mass + _EVEN / len(nodes),
            np.array([node.place for node in nodes]),
            np.linalg.cholesky(np.array([columns @ columns.T for columns in wide])),
        )

    def with_twins(self) -> Mixture:
        """Each component again, wider: for tails that the slices do not tell of."""
        weights = np.concatenate([(1.0 - _TWIN_SHARE) * self.weights, _TWIN_SHARE * self.weights])
        places = np.concatenate([self.places, self.places])
        return Mixture(weights, places, np.concatenate([self.factors, _TWIN * self.factors]))

    def pruned(self) -> Mixture:
        """The heaviest components, as many as there may be."""
        if len(self.weights) <= MOST_COMPONENTS:
            return self
        kept = np.sort(np.argsort(self.weights)[-MOST_COMPONENTS:])
        weights = self.weights[kept] / self.weights[kept].sum()
        return Mixture(weights, self.places[kept], self.factors[kept])

    def widened(self, factor: float) -> Mixture:
        """Every component `factor` times as wide."""
        return Mixture(self.weights, self.places, factor * self.factors)

    def reweighted(self, weights: FloatArray) -> Mixture:
        """The same components with other weights (K,), of sum one."""
        return Mixture(weights, self.places, self.factors)

    def with_more(self, places: FloatArray, factors: FloatArray, share: float) -> Mixture:
        """With components at `places` (m, p) of `factors` (m, p, p) that get `share` of the weight, each alike."""
        fresh = np.full(len(places), share / len(places))
        return Mixture(
            np.concatenate([(1.0 - share) * self.weights, fresh]),
            np.concatenate([self.places, places]),
            np.concatenate([self.factors, factors]),
        )

    def draw(self, count: int, chance: Chance) -> FloatArray:
        """Draw independent places (count, p)."""
        levels = chance.uniform(0.0, 1.0, count)
        normal = chance.standard_normal((count, self.places.shape[1]))
        return self._at(levels, normal, chance.chisquare(_FREEDOM, count))

    def spread(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw places (count, p) that fill the mixture more evenly than independent ones.

        Each is a draw of the mixture. Together they are a scrambled Sobol sequence (Owen 1997,
        doi:10.1214/aos/1031594731), which is at its best where `count` is a power of two.
        """
        points = qmc.Sobol(self.places.shape[1] + 2, bits=_BITS, rng=rng)
        # Middles of the finest cells: no number is 0 or 1.
        levels = points.random_base2((count - 1).bit_length())[:count] + 0.5 ** (_BITS + 1)
        squares: FloatArray = np.asarray(special.chdtri(_FREEDOM, levels[:, 1]), dtype=np.float64)
        normal: FloatArray = np.asarray(special.ndtri(levels[:, 2:]), dtype=np.float64)
        return self._at(levels[:, 0], normal, squares)

    def _at(self, levels: FloatArray, normal: FloatArray, squares: FloatArray) -> FloatArray:
        """Places (n, p) of even numbers (n,) that choose a component, normal (n, p) and chi-squared ones (n,)."""
        edges = np.cumsum(self.weights)
        which = np.searchsorted(edges / edges[-1], levels, side="right").clip(max=len(self.weights) - 1)
        size = np.sqrt(_FREEDOM / squares)
        return np.asarray(
            self.places[which] + size[:, None] * np.einsum("nij,nj->ni", self.factors[which], normal)
        )

    def log_density(self, z: FloatArray) -> FloatArray:
        """Log-density (n,) at places z (n, p)."""
        parts = self._log_parts(z)[0]
        largest = parts.max(axis=1)
        return np.asarray(largest + np.log(np.exp(parts - largest[:, None]).sum(axis=1)))

    def responsibilities(self, z: FloatArray) -> FloatArray:
        """Probability (n, K) that a place z (n, p) is of a component."""
        return np.asarray(special.softmax(self._log_parts(z)[0], axis=1))

    def learnt(self, z: FloatArray, weights: FloatArray) -> Mixture:
        """Return the mixture fitted to weighted draws z (n, p), `weights` (n,) of sum one: one round.

        Population Monte Carlo for Student mixtures: Cappe, Douc, Guillin, Marin and Robert (2008),
        doi:10.1007/s11222-008-9059-x, with covariances that hold to their old values for want of draws.
        """
        parts, squares = self._log_parts(z)
        own = special.softmax(parts, axis=1) * weights[:, None]
        share = own.sum(axis=0)
        kept = np.flatnonzero(share > _NEGLIGIBLE / len(share))
        parameters = z.shape[1]
        counts = 1.0 / np.maximum(np.square(own[:, kept]).sum(axis=0), 1e-300) * share[kept] ** 2
        pull = (_FREEDOM + parameters) / (_FREEDOM + squares[:, kept])
        drawn = own[:, kept] * pull
        places = np.einsum("nk,np->kp", drawn, z) / drawn.sum(axis=0)[:, None]
        inertia = _INERTIA * parameters / (_INERTIA * parameters + counts)
        factors = []
        for k, entry in enumerate(kept):
            off = z - places[k]
            fresh = np.einsum("n,ni,nj->ij", drawn[:, k], off, off) / share[entry]
            old = self.factors[entry] @ self.factors[entry].T
            factors.append(np.linalg.cholesky(inertia[k] * old + (1.0 - inertia[k]) * fresh))
        places = inertia[:, None] * self.places[kept] + (1.0 - inertia[:, None]) * places
        return Mixture(share[kept] / share[kept].sum(), places, np.array(factors))

    @cached_property
    def _whitening(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Inverse factors side by side, (p, K p), the places seen through them, (K p,), and log-constants (K,)."""
        count, parameters = self.places.shape
        inverse: FloatArray = np.asarray(np.linalg.inv(self.factors), dtype=np.float64)
        log_volume = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        constant = (
            special.gammaln(0.5 * (_FREEDOM + parameters))
            - special.gammaln(0.5 * _FREEDOM)
            - 0.5 * parameters * np.log(_FREEDOM * np.pi)
        )
        middles = np.einsum("kij,kj->ki", inverse, self.places).ravel()
        side_by_side: FloatArray = inverse.reshape(count * parameters, parameters).T.copy()
        return side_by_side, middles, constant + np.log(self.weights) - log_volume

    def _log_parts(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Logarithms of the weighted densities, and squared distances, each (n, K)."""
        whiten, middles, constants = self._whitening
        count, parameters = self.places.shape
        squares = np.empty((len(z), count))
        for first in range(0, len(z), _ROWS):
            rows = slice(first, first + _ROWS)
            off = (z[rows] @ whiten - middles).reshape(-1, count, parameters)
            squares[rows] = np.einsum("nki,nki->nk", off, off)
        bell = -0.5 * (_FREEDOM + parameters) * np.log1p(squares / _FREEDOM)
        return constants + bell, squares


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
