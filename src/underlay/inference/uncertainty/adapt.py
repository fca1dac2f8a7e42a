"""Adaptive importance sampling, for posteriors that are flat in two directions, which draws along one ridge miss.

Adaptive multiple importance sampling (Cornuet et al. 2012, doi:10.1111/j.1467-9469.2011.00756.x): each round places
Student kernels about the draws so far, and all draws are weighed by the mixture of all distributions that were
drawn from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

from underlay._arrays import FloatArray
from underlay.inference.model.coordinates import SHORTEST
from underlay.inference.uncertainty.mixture import pareto_shape

_KERNELS, _NEIGHBOURS = 32, 0.12  # number of kernels; share of the weight whose draws set a kernel's width
_FREEDOM, _WIDER = 5.0, 1.1  # degrees of freedom of a kernel; factor on its width
_FEWEST = 60.0  # least effective number of draws for kernels: weights are flattened until it is reached
_ROOTS = np.geomspace(1.0, 0.05, 24)  # powers of the weights that are tried for that


@dataclass(frozen=True, eq=False)
class Kernels:
    """A mixture of equally likely Student kernels in some entries of the scaled vector.

    Parameters
    ----------
    entries : ndarray of int
        Indices, (q,), of the entries of the vector that are drawn.
    centres, factors : FloatArray
        Centres (c, q) of the c kernels, and Cholesky factors (c, q, q) of their covariances.
    """

    entries: NDArray[np.intp]
    centres: FloatArray
    factors: FloatArray

    @classmethod
    def about(
        cls, draws: FloatArray, log_weights: FloatArray, entries: NDArray[np.intp], rng: np.random.Generator
    ) -> Kernels:
        """Place kernels about weighted draws (n, k), in the entries (q,) that are to be drawn."""
        weights = _evened(log_weights)
        points = draws[:, entries]
        middle = weights @ points
        off = points - middle
        whole = np.linalg.cholesky(_regular(off.T @ (off * weights[:, None])))
        standard = np.linalg.solve(whole, off.T).T
        places = (np.arange(_KERNELS) + rng.uniform()) / _KERNELS
        chosen = np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
        factors = [_local(standard, weights, standard[i]) for i in chosen]
        return cls(entries, points[chosen], np.asarray(_WIDER * whole @ np.array(factors), dtype=np.float64))

    def draw(self, count: int, rest: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draw vectors (count, k); the entries without kernels are those of `rest` (k,)."""
        own = np.arange(count) % len(self.centres)
        z = rng.standard_normal((count, len(self.entries)))
        z *= np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, count))[:, None]
        vectors = np.tile(rest, (count, 1))
        vectors[:, self.entries] = self.centres[own] + np.einsum("nij,nj->ni", self.factors[own], z)
        return vectors

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) of the mixture of kernels at vectors (n, k)."""
        q = len(self.entries)
        inverse = np.linalg.inv(self.factors)
        off = vectors[:, None, self.entries] - self.centres
        z = np.einsum("cij,ncj->nci", inverse, off, optimize=True)
        log_det = np.log(np.abs(np.diagonal(self.factors, axis1=1, axis2=2))).sum(axis=1)
        constant = (
            gammaln(0.5 * (_FREEDOM + q)) - gammaln(0.5 * _FREEDOM) - 0.5 * q * np.log(_FREEDOM * np.pi)
        )
        each = constant - log_det - 0.5 * (_FREEDOM + q) * np.log1p((z * z).sum(axis=2) / _FREEDOM)
        return np.asarray(logsumexp(each, axis=1) - np.log(len(self.centres)))


def _local(standard: FloatArray, weights: FloatArray, centre: FloatArray) -> FloatArray:
    """Cholesky factor (q, q) of the covariance of the draws nearest to a point, in standard coordinates."""
    square = ((standard - centre) ** 2).sum(axis=1)
    order = np.argsort(square)
    last = int(np.searchsorted(np.cumsum(weights[order]), _NEIGHBOURS)) + 1
    near = order[: max(last, 4 * standard.shape[1])]
    own = weights[near] / weights[near].sum()
    off = standard[near] - own @ standard[near]
    return np.asarray(np.linalg.cholesky(_regular(off.T @ (off * own[:, None]))), dtype=np.float64)


def _regular(covariance: FloatArray) -> FloatArray:
    floor = 1e-6 * np.diagonal(covariance) + SHORTEST**2
    return covariance + np.diag(floor)


def _evened(log_weights: FloatArray) -> FloatArray:
    """Normalised weights (n,) raised to a power of at most 1, the largest that leaves 60 effective draws."""
    for power in _ROOTS:
        evened = power * log_weights
        weights = np.exp(evened - logsumexp(evened))
        if 1.0 / float(weights @ weights) >= _FEWEST:
            break
    return np.asarray(weights)


@dataclass(eq=False)
class Pool:
    """Importance-weighted draws of several rounds, with the distributions that they were drawn from.

    Parameters
    ----------
    target : callable
        Log-density (n,) of vectors (n, k), which the draws shall represent.
    vectors, levels : FloatArray
        Draws (n, k) so far, and their log-density (n,) by `target`.
    sources : list
        Log-densities of the distributions that draws came from, and how many draws each gave.
    proposed : list of FloatArray
        Log-density (n,) of all draws under each source.
    """

    target: Callable[[FloatArray], FloatArray]
    vectors: FloatArray
    levels: FloatArray
    sources: list[tuple[Callable[[FloatArray], FloatArray], int]] = field(default_factory=list)
    proposed: list[FloatArray] = field(default_factory=list)

    @classmethod
    def begin(
        cls,
        target: Callable[[FloatArray], FloatArray],
        source: Callable[[FloatArray], FloatArray],
        vectors: FloatArray,
    ) -> Pool:
        """Start a pool with the draws (n, k) of one distribution; `target` and `source` are log-densities."""
        return cls(target, vectors, target(vectors), [(source, len(vectors))], [source(vectors)])

    def add(self, source: Callable[[FloatArray], FloatArray], vectors: FloatArray) -> None:
        """Add draws (n, k) from a further source, whose log-density is `source`."""
        self.proposed = [
            np.concatenate((proposed, known(vectors)))
            for proposed, (known, _) in zip(self.proposed, self.sources, strict=True)
        ]
        self.vectors = np.vstack((self.vectors, vectors))
        self.levels = np.concatenate((self.levels, self.target(vectors)))
        self.sources.append((source, len(vectors)))
        self.proposed.append(source(self.vectors))

    @property
    def log_weights(self) -> FloatArray:
        """Logarithms of the importance weights of the draws, (n,), not normalised."""
        counts = np.array([count for _, count in self.sources], dtype=np.float64)
        shares = np.log(counts / counts.sum())
        return np.asarray(self.levels - logsumexp(np.array(self.proposed) + shares[:, None], axis=0))

    @property
    def weights(self) -> FloatArray:
        """Importance weights of the draws, (n,), summing to 1."""
        logs = self.log_weights
        return np.asarray(np.exp(logs - logsumexp(logs)))

    @property
    def effective(self) -> float:
        """Kish's effective number of draws, 1 over the sum of the squared weights."""
        weights = self.weights
        return 1.0 / float(weights @ weights)

    @property
    def pareto(self) -> float:
        """Pareto k of the importance weights; above 0.7 they cannot be trusted."""
        return pareto_shape(self.log_weights)
