"""Distributions to draw from, and the weights of the draws.

Along the ridge draws go by each hypothesis' evidence, across it Student about its middle. Draws along one ridge
miss posteriors that are flat in two directions. There adaptive multiple importance sampling follows (Cornuet et al.
2012, doi:10.1111/j.1467-9469.2011.00756.x): each round places Student kernels about the draws so far, and all draws
are weighed by the mixture of all distributions that were drawn from.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.special import logsumexp

from underlay._arrays import FloatArray
from underlay.inference.model.coordinates import SHORTEST
from underlay.inference.uncertainty.density import Density, Node
from underlay.inference.uncertainty.mixture import log_student, pareto_shape, student_draws

_CELLS = 300  # cells of the coordinate along the ridge
# Share of the draws that goes evenly to all cells; power of the evidence for the others.
_EVEN, _SOFTER = 0.03, 0.9
_DEEPEST = -30.0  # nats below the top at which the evidence is cut off
_BEYOND = 0.25  # how far past the last node draws go, over the last gap between nodes
_FREEDOM, _WIDER = (
    5.0,
    1.2,
)  # degrees of freedom of all distributions; factor on the variance across the ridge
_PROMISED = 4.0  # nats that a hypothesis may gain beside a node: further the continuation is not straight
_KERNELS, _NEIGHBOURS = 32, 0.12  # number of kernels; share of the weight whose draws set a kernel's width
_BROADER = 1.1  # factor on the width of a kernel
_FEWEST = 60.0  # least effective number of draws for kernels: weights are flattened until it is reached
_ROOTS = np.geomspace(1.0, 0.05, 24)  # powers of the weights that are tried for that


@dataclass(frozen=True, eq=False)
class Conditional:
    """Normal approximation across the ridge at one node, for each of m hypotheses about noise and disturbances.

    `place` is the value of the coordinate there, `evidence` (m,) the log of the density integrated over the q other
    entries, `middles` (m, q) their means and `factors` (m, q, q) the Cholesky factors of their covariances.
    """

    place: float
    evidence: FloatArray
    middles: FloatArray
    factors: FloatArray


def conditional(density: Density, node: Node, coordinate: int, chosen: Sequence[int]) -> Conditional:
    """Return the `Conditional` at a node for the hypotheses `chosen`, with entry `coordinate` held fixed."""
    local, kept = density.local(node.places), density.kept
    others = np.flatnonzero(kept != coordinate)
    priors = density.likelihood.priors[kept]
    away = priors * (density.likelihood.fit.vector - node.vector)[kept]
    low, high = density.likelihood.fit.problem.bounds[kept].T
    normal = local.normal[chosen] + np.diag(priors)
    normal, pull = normal[:, others[:, None], others], (local.pull[chosen] + away)[:, others]
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), np.finfo(float).tiny))
    scaled = normal / scale[:, :, None] / scale[:, None, :] + 1e-10 * np.eye(len(others))
    covariance = np.linalg.inv(scaled) / scale[:, :, None] / scale[:, None, :]
    step = np.einsum("mij,mj->mi", covariance, pull)
    log_det = -np.linalg.slogdet(scaled)[1] - 2.0 * np.log(scale).sum(axis=1)
    # A straight continuation may promise more than a hypothesis can give.
    gain = np.minimum(0.5 * np.einsum("mi,mi->m", pull, step), _PROMISED)
    level = local.level[chosen]
    evidence = np.maximum(np.minimum(level + gain, density.height[chosen]), level) + 0.5 * log_det
    evidence += float(density.likelihood.fit.problem.log_prior(node.vector[None])[0])
    reach = np.maximum(np.abs(step).max(axis=1, initial=0.0), 1e-300)
    step = step * np.minimum(1.0, 1.0 / reach)[:, None]
    symmetric = 0.5 * (covariance + np.swapaxes(covariance, 1, 2))
    middle = np.clip(node.vector[kept][others] + step, low[others], high[others])
    factors = np.asarray(np.linalg.cholesky(symmetric), dtype=np.float64)
    return Conditional(float(node.vector[coordinate]), evidence, middle, factors)


@dataclass(frozen=True, eq=False)
class Proposal:
    """Proposal distribution of importance sampling along one ridge, for m hypotheses.

    The coordinate along the ridge has a histogram, the other entries a Student distribution about the ridge.

    Parameters
    ----------
    entries : FloatArray
        Indices of the entries of the scaled vector that are drawn across the ridge, (q,).
    coordinate : int
        Index of the entry along the ridge.
    edges : FloatArray
        Edges of the cells of the histogram of the coordinate, (cells + 1,).
    cells : FloatArray
        Probability of each cell under each hypothesis, (m, cells).
    shares : FloatArray
        Logarithms of the probabilities of the hypotheses, (m,); they are normalised together with other ridges'.
    nodes : list of Conditional
        Nodes between which means and factors are interpolated.
    rest : FloatArray
        Scaled vector (k,) that gives the entries that are not drawn.
    """

    entries: NDArray[np.intp]
    coordinate: int
    edges: FloatArray
    cells: FloatArray
    shares: FloatArray
    nodes: list[Conditional]
    rest: FloatArray

    @classmethod
    def of(
        cls,
        density: Density,
        nodes: Sequence[Node],
        coordinate: int,
        chosen: Sequence[int],
        bounds: tuple[float, float],
    ) -> Proposal:
        """Make the proposal of the hypotheses `chosen` from nodes on a ridge; `bounds` limit the coordinate."""
        found = [conditional(density, node, coordinate, chosen) for node in nodes]
        places = np.array([own.place for own in found])
        low = max(places[0] - _BEYOND * (places[1] - places[0]), bounds[0])
        high = min(places[-1] + _BEYOND * (places[-1] - places[-2]), bounds[1])
        edges = np.linspace(low, high, _CELLS + 1)
        evidence = np.array([own.evidence for own in found]).T
        top = evidence.max()
        spline = CubicSpline if len(places) > 3 else PchipInterpolator
        at = spline(places, np.maximum(evidence - top, _DEEPEST), axis=1)(0.5 * (edges[1:] + edges[:-1]))
        at = np.minimum(at, 0.5)
        log_shares = logsumexp(at, axis=1) + np.log(edges[1] - edges[0])
        cells = np.exp(_SOFTER * (at - at.max(axis=1, keepdims=True)))
        cells = (1.0 - _EVEN) * cells / cells.sum(axis=1, keepdims=True) + _EVEN / _CELLS
        entries = density.kept[density.kept != coordinate]
        return cls(entries, coordinate, edges, cells, top + log_shares, found, density.likelihood.fit.vector)

    def draw(self, own: NDArray[np.intp], rng: np.random.Generator) -> FloatArray:
        """Draw scaled vectors (n, k), the i-th under the hypothesis of index `own[i]`."""
        u = rng.uniform(size=len(own))
        cumulated = np.cumsum(self.cells, axis=1)
        cell = np.minimum((cumulated[own] < u[:, None]).sum(axis=1), _CELLS - 1)
        place = self.edges[cell] + (self.edges[1] - self.edges[0]) * rng.uniform(size=len(own))
        middles, factors = self._across(place, own[:, None])
        z = student_draws(len(own), len(self.entries), _FREEDOM, rng)
        vectors = np.tile(self.rest, (len(own), 1))
        vectors[:, self.coordinate] = place
        vectors[:, self.entries] = middles[:, 0] + np.einsum("nij,nj->ni", factors[:, 0], z)
        return vectors

    def log_densities(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n, m) of the proposal at scaled vectors (n, k), under each of the m hypotheses."""
        place, width = vectors[:, self.coordinate], self.edges[1] - self.edges[0]
        cell = np.floor((place - self.edges[0]) / width).astype(int)
        inside = (cell >= 0) & (cell < _CELLS)
        along = np.log(self.cells[:, np.clip(cell, 0, _CELLS - 1)] / width).T
        every = np.broadcast_to(np.arange(len(self.cells)), (len(place), len(self.cells)))
        middles, factors = self._across(place, every)
        off = vectors[:, None, self.entries] - middles
        z = np.linalg.solve(factors, off[..., None])[..., 0]
        log_det = np.log(np.diagonal(factors, axis1=2, axis2=3)).sum(axis=2)
        across = log_student((z * z).sum(axis=2), log_det, len(self.entries), _FREEDOM)
        return np.where(inside[:, None], along + across, -np.inf)

    def _across(self, place: FloatArray, own: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Means (n, h, q) and Cholesky factors (n, h, q, q) across the ridge.

        `place` (n,) are values of the coordinate, `own` (n, h) or (n, 1) indices of hypotheses.
        """
        places = np.array([node.place for node in self.nodes])
        spline = CubicSpline if len(places) > 3 else PchipInterpolator
        middles = spline(places, np.array([node.middles for node in self.nodes]), axis=0)(place)
        index = np.clip(np.searchsorted(places, place) - 1, 0, len(places) - 2)
        share = np.clip((place - places[index]) / (places[index + 1] - places[index]), 0.0, 1.0)
        factors = np.array([node.factors for node in self.nodes])
        left, right = factors[index[:, None], own], factors[index[:, None] + 1, own]
        share = share[:, None, None, None]
        rows = np.arange(len(place))[:, None]
        return middles[rows, own], _WIDER**0.5 * ((1.0 - share) * left + share * right)


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
        return cls(
            entries, points[chosen], np.asarray(_BROADER * whole @ np.array(factors), dtype=np.float64)
        )

    def draw(self, count: int, rest: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draw vectors (count, k); the entries without kernels are those of `rest` (k,)."""
        own = np.arange(count) % len(self.centres)
        z = student_draws(count, len(self.entries), _FREEDOM, rng)
        vectors = np.tile(rest, (count, 1))
        vectors[:, self.entries] = self.centres[own] + np.einsum("nij,nj->ni", self.factors[own], z)
        return vectors

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density (n,) of the mixture of kernels at vectors (n, k)."""
        off = vectors[:, None, self.entries] - self.centres
        z = np.einsum("cij,ncj->nci", np.linalg.inv(self.factors), off, optimize=True)
        log_det = np.log(np.abs(np.diagonal(self.factors, axis1=1, axis2=2))).sum(axis=1)
        each = log_student((z * z).sum(axis=2), log_det, len(self.entries), _FREEDOM)
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
