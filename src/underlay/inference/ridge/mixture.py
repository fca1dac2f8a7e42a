"""A mixture of Student distributions: what is laid along the ridges, drawn from and weighed with."""

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

__all__ = ["MOST_COMPONENTS", "Chance", "Mixture"]

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
