"""A distribution to draw from: along the ridge by each hypothesis' evidence, across it Student about its middle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.special import gammaln, logsumexp

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.density import Density, Local
from underlay.inference.uncertainty.tree import log_prior
from underlay.inference.uncertainty.walk import Node

_CELLS = 300  # cells of the coordinate along the ridge
# Share of the draws that goes evenly to all cells; power of the evidence for the others.
_EVEN, _SOFTER = 0.03, 0.9
_DEEPEST = -30.0  # nats below the top at which the evidence is cut off
_BEYOND = 0.25  # how far past the last node draws go, over the last gap between nodes
_FREEDOM, _WIDER = 5.0, 1.2  # degrees of freedom across the ridge; factor on the variance there
_PROMISED = 4.0  # nats that a hypothesis may gain beside a node: further the continuation is not straight


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


def conditionals(
    density: Density, nodes: Sequence[Node], coordinate: int, chosen: Sequence[int]
) -> list[Conditional]:
    """Return the `Conditional` at each node for the hypotheses `chosen`, with entry `coordinate` held fixed."""
    return [_conditional(density.local(node.places), density, node, coordinate, chosen) for node in nodes]


def _conditional(
    local: Local, density: Density, node: Node, coordinate: int, chosen: Sequence[int]
) -> Conditional:
    kept = density.kept
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
    evidence = np.maximum(np.minimum(level + gain, local.best[chosen]), level) + 0.5 * log_det
    evidence += float(log_prior(density.likelihood.fit.problem, node.vector[None])[0])
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
        found = conditionals(density, nodes, coordinate, chosen)
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
        z = rng.standard_normal((len(own), len(self.entries)))
        z *= np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, len(own)))[:, None]
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
        q = len(self.entries)
        log_det = np.log(np.diagonal(factors, axis1=2, axis2=3)).sum(axis=2)
        constant = (
            gammaln(0.5 * (_FREEDOM + q)) - gammaln(0.5 * _FREEDOM) - 0.5 * q * np.log(_FREEDOM * np.pi)
        )
        across = constant - log_det - 0.5 * (_FREEDOM + q) * np.log1p((z * z).sum(axis=2) / _FREEDOM)
        return np.where(inside[:, None], along + across, -np.inf)

    def _across(self, place: FloatArray, own: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Means (n, h, q) and Cholesky factors (n, h, q, q) across the ridge.

        `place` (n,) are values of the coordinate, `own` (n, h) or (n, 1) indices of hypotheses.
        """
        places = np.array([node.place for node in self.nodes])
        middles = self._middles(place, places)
        index = np.clip(np.searchsorted(places, place) - 1, 0, len(places) - 2)
        share = np.clip((place - places[index]) / (places[index + 1] - places[index]), 0.0, 1.0)
        factors = np.array([node.factors for node in self.nodes])
        left, right = factors[index[:, None], own], factors[index[:, None] + 1, own]
        share = share[:, None, None, None]
        rows = np.arange(len(place))[:, None]
        return middles[rows, own], _WIDER**0.5 * ((1.0 - share) * left + share * right)

    def _middles(self, place: FloatArray, places: FloatArray) -> FloatArray:
        values = np.array([node.middles for node in self.nodes])
        spline = CubicSpline if len(places) > 3 else PchipInterpolator
        return np.asarray(spline(places, values, axis=0)(place))
