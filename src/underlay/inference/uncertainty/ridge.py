"""The reading where the force is not straight in what is free: weighted draws along the ridge.

A walk from the optimum lays nodes along the ridge (`walk`); at each of them every hypothesis has its
distribution of the other entries (`proposal`). Draws come from their interpolation and are weighed by the
density itself (`density`); further rounds follow where one ridge does not hold them (`adapt`). Interval,
posterior, map row and corner plot are read from these draws; Pareto's k says whether they can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, logsumexp

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.adapt import Kernels, Pool
from underlay.inference.uncertainty.density import Density
from underlay.inference.uncertainty.proposal import Proposal, conditionals
from underlay.inference.uncertainty.tree import NothingDrawnError, noise_entries, straight
from underlay.inference.uncertainty.walk import Node, Path, bends_of, walk

if TYPE_CHECKING:
    from underlay.inference.uncertainty.weighed import Weighed

_DRAWS, _ROUNDS = 1000, 6  # draws of a round; further rounds at most
_TRUSTED, _ENOUGH = 0.7, 300.0  # Pareto k below which, and effective draws from which, draws are trusted
_SECOND = 0.02  # weight from which hypotheses that correct the value have a ridge of their own
_LEAST = 0.01  # share of draws that a hypothesis gets at least
_BINS = 24  # bins in six deviations of the draws; in the one at a bound the density there is asked
_HELD = 1e-9  # deviation below which an entry was held, on a bound


@dataclass(frozen=True, eq=False)
class RidgePath:
    """Points along a ridge of the density, with the covariance across it.

    A ridge is the curve on which one entry of the scaled vector, the coordinate, is stepped and the others are
    optimal; here as the most probable hypothesis about noise and disturbances has them.

    Parameters
    ----------
    vectors : FloatArray
        Scaled vectors of the points, (p, k), in order of the coordinate.
    levels : FloatArray
        Log-density (`Density.log`) at these, (p,).
    covariances : FloatArray
        Covariance of the other entries at a fixed coordinate, (p, k, k); zero for the coordinate itself.
    """

    vectors: FloatArray
    levels: FloatArray
    covariances: FloatArray

    @classmethod
    def of(cls, density: Density, proposal: Proposal) -> RidgePath:
        """Make the path from the nodes of the proposal distribution along that ridge."""
        low, high = density.likelihood.fit.problem.bounds.T
        vectors = np.tile(proposal.rest, (len(proposal.nodes), 1))
        covariances = np.zeros((*vectors.shape, vectors.shape[1]))
        others = proposal.entries
        for vector, covariance, node in zip(vectors, covariances, proposal.nodes, strict=True):
            heaviest = int(np.argmax(node.evidence))
            vector[proposal.coordinate], vector[others] = node.place, node.middles[heaviest]
            covariance[np.ix_(others, others)] = node.factors[heaviest] @ node.factors[heaviest].T
        vectors = np.clip(vectors, low, high)
        return cls(vectors, density.log(vectors), covariances)

    def edge(self, top: float, drop: float) -> FloatArray:
        """Scaled vectors (m, k) at the edge of the region whose log-density is at least `top - drop`.

        They include the extremes of every entry.

        Across the ridge the density is normal. Along it, between a point within and one beyond, the square root of
        the drop is interpolated linearly, as is exact for a parabola.
        """
        lost = top - self.levels
        inside = lost <= drop
        deviations = np.sqrt(np.diagonal(self.covariances[inside], axis1=1, axis2=2))
        scale = np.sqrt(2.0 * (drop - lost[inside]))[:, None] / np.where(deviations > 0.0, deviations, np.inf)
        # Where entry i is at its extreme the others follow by their covariance with it: a row for each i.
        across = self.covariances[inside] * scale[:, :, None]
        middle = self.vectors[inside][:, None]
        found = [
            np.concatenate((middle - across, middle + across), axis=1).reshape(-1, self.vectors.shape[1])
        ]
        root = np.sqrt(lost)
        for i in np.flatnonzero((inside[1:] != inside[:-1]) & np.isfinite(root[1:] + root[:-1])):
            share = (drop**0.5 - root[i]) / (root[i + 1] - root[i])
            found.append((self.vectors[i] + share * (self.vectors[i + 1] - self.vectors[i]))[None])
        return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class Ridge:
    """Weighted draws of the scaled vector from the density of a fit, begun along one or several ridges.

    Parameters
    ----------
    draws, weights : FloatArray
        Scaled vectors (m, k), and their weights (m,), which sum to 1.
    log_density : FloatArray
        `Density.log` of the draws, (m,).
    log_evidence : float
        Logarithm of the integral of the density: the mean of the weights before they sum to 1.
    pareto, effective : float
        Pareto k of the weights; effective number of draws.
    coordinate : int
        The entry along which the ridge was walked.
    ends : tuple of float
        Log-density at the first and at the last node of the ridges, other entries integrated out, less its maximum.
    bounds : FloatArray
        Bounds of the scaled vector, (k, 2).
    rounds : int
        Number of further rounds of draws.
    failed : int
        Number of draws inside the bounds that have no contact law.
    source : Source
        Distribution of the first round of draws.
    paths : sequence of RidgePath
        One for each ridge.
    """

    draws: FloatArray
    weights: FloatArray
    log_density: FloatArray
    log_evidence: float
    pareto: float
    effective: float
    coordinate: int
    ends: tuple[float, float]
    bounds: FloatArray
    rounds: int
    failed: int
    source: Source
    paths: Sequence[RidgePath]

    def edge(self, level: float) -> FloatArray:
        """Scaled vectors (m, k) at the edge of the confidence region of `level` (0.95, say), for one parameter.

        The region is where the log-density is within half the chi-square quantile of its maximum on the ridges.
        """
        drop = 0.5 * float(chdtri(1.0, 1.0 - level))
        top = max(float(path.levels.max()) for path in self.paths)
        found = np.concatenate([path.edge(top, drop) for path in self.paths])
        return np.asarray(np.clip(found, self.bounds[:, 0], self.bounds[:, 1]))

    def open_ends(self, index: int, level: float) -> tuple[bool, bool]:
        """Whether the interval of entry `index` at confidence `level` is open below and above.

        An end is open if at a bound, or where the walk along the ridge stopped, the likelihood is still within half
        the chi-square quantile of its maximum.
        """
        drop = 0.5 * float(chdtri(1.0, 1.0 - level))
        low, high = (self._at_bound(index, side, drop) for side in (0, 1))
        if index == self.coordinate:
            return low or self.ends[0] > -drop, high or self.ends[1] > -drop
        return low, high

    def _at_bound(self, index: int, side: int, drop: float) -> bool:
        """Whether the histogram of the draws of entry `index` at a bound is within `drop` nats of its maximum.

        `side` is 0 for the lower bound, 1 for the upper. A priori the density is even between bounds.
        """
        values, bound = self.draws[:, index], self.bounds[index, side]
        if not np.isfinite(bound):
            return False
        width = 6.0 * float(np.sqrt(self.weights @ (values - self.weights @ values) ** 2)) / _BINS
        bins = np.floor(np.abs(values - bound) / max(width, 1e-300))
        near = bins < 2 * _BINS
        density = np.bincount(bins[near].astype(int), weights=self.weights[near], minlength=1)
        return bool(density[0] > np.exp(-drop) * density.max() and density[0] > 0.0)


@dataclass(frozen=True, eq=False)
class Ridges:
    """Ridges of a likelihood, along which the first draws are made: the density, and nodes on each ridge.

    Parameters
    ----------
    density : Density
        Density of the scaled vector, with directions in which the model curves along the ridge.
    coordinate : int
        Index of the entry along which the ridges were walked.
    groups : sequence of sequence of int
        Indices of the hypotheses about noise and disturbances that share a ridge.
    nodes : sequence of sequence of Node
        Nodes of each group, in order of the coordinate.
    """

    density: Density
    coordinate: int
    groups: Sequence[Sequence[int]]
    nodes: Sequence[Sequence[Node]]

    @classmethod
    def of(cls, likelihood: Weighed) -> Ridges:
        """Walk the ridges of a likelihood along its least determined non-linear entry.

        Raises
        ------
        NothingDrawnError
            If no ridge could be walked.
        """
        groups = _groups(likelihood)
        for coordinate in _coordinates(likelihood):
            density, nodes = _paths(likelihood, coordinate, groups)
            if min(len(own) for own in nodes) > 1:
                return cls(density, coordinate, groups, nodes)
        raise NothingDrawnError("no ridge could be walked from the optimum of a fit")

    @property
    def proposals(self) -> list[Proposal]:
        """Proposal distributions along the ridges, one for each group of hypotheses."""
        low, high = self.density.likelihood.fit.problem.bounds[self.coordinate]
        return [
            Proposal.of(self.density, own, self.coordinate, chosen, (float(low), float(high)))
            for own, chosen in zip(self.nodes, self.groups, strict=True)
        ]


def draw(ridges: Ridges, rng: np.random.Generator, count: int = _DRAWS) -> Ridge:
    """Draw from a density by importance sampling along its ridges, and in further rounds until weights are sound.

    Sound means Pareto k below 0.7 and more than 300 effective draws; there are at most six further rounds.

    Parameters
    ----------
    ridges : Ridges
        Ridges along which the first round is drawn.
    rng : numpy Generator
        Random generator.
    count : int
        Number of draws of a round.

    Raises
    ------
    NothingDrawnError
        If no draw has a density.
    """
    density, proposals = ridges.density, ridges.proposals
    fit = density.likelihood.fit
    source = Source.of(proposals, fit)
    pool = Pool.begin(density.log, source.log_density, source.draw(count, rng))
    paths = [RidgePath.of(density, proposal) for proposal in proposals]
    if not (np.isfinite(pool.levels).any() and any(np.isfinite(path.levels).any() for path in paths)):
        raise NothingDrawnError(
            "no draw along the ridge of the likelihood has a contact law within the bounds"
        )
    rounds, entries = 0, np.concatenate((density.kept, source.noise))
    while rounds < _ROUNDS and not (pool.pareto < _TRUSTED and pool.effective > _ENOUGH):
        kernels = Kernels.about(pool.vectors, pool.log_weights, entries, rng)
        pool.add(kernels.log_density, kernels.draw(count, fit.vector, rng))
        rounds += 1
    bounds = fit.problem.bounds
    inside = ((pool.vectors >= bounds[:, 0]) & (pool.vectors <= bounds[:, 1])).all(axis=1)
    return Ridge(
        draws=pool.vectors,
        weights=pool.weights,
        log_density=pool.levels,
        log_evidence=float(logsumexp(pool.log_weights) - np.log(len(pool.vectors))),
        pareto=pool.pareto,
        effective=pool.effective,
        coordinate=ridges.coordinate,
        ends=_ends(proposals),
        bounds=bounds,
        rounds=rounds,
        failed=int((inside & ~np.isfinite(pool.levels)).sum()),
        source=source,
        paths=paths,
    )


def _coordinates(likelihood: Weighed) -> list[int]:
    """Indices of the entries along which a ridge may be walked, best first.

    These are entries in which the force is non-linear: the substrate's modulus, then by falling standard deviation.
    """
    problem, deviations = likelihood.fit.problem, likelihood.mixture.deviations
    deviations = np.where(deviations > _HELD, deviations, np.inf)
    bent = [int(i) for i in likelihood.entries if not straight(problem)[i]]
    base = [i for i in bent if problem.coordinates[i].path == "substrate.E"]
    order = sorted((i for i in bent if i not in base), key=lambda i: -deviations[i])
    return [*base, *order] or [int(i) for i in likelihood.entries]


def _groups(likelihood: Weighed) -> list[list[int]]:
    """Group the hypotheses (indices) that share a ridge: those without and those with a correction of the value.

    A correction is a step or ramp of the force or a turn of the baseline; one group if such are improbable.
    """
    every = list(range(len(likelihood.combined.weights)))
    if len(likelihood.states) > 1:
        return [every]
    own = likelihood.states[0].hypotheses
    if own.probability(own.corrects) < _SECOND:
        return [every]
    parts = (np.flatnonzero(~own.corrects).tolist(), np.flatnonzero(own.corrects).tolist())
    return [part for part in parts if part]


def _paths(
    likelihood: Weighed, coordinate: int, groups: Sequence[Sequence[int]]
) -> tuple[Density, list[list[Node]]]:
    """Walk the ridge of each group of hypotheses along entry `coordinate`: the density, and nodes of each ridge.

    The density gets the directions in which the model curves along the first ridge.
    """
    plain = Density.of(likelihood)
    nodes = _walked(plain, coordinate, groups[0])
    density = Density.of(likelihood, bends_of(nodes, plain))
    return density, [nodes, *(_walked(density, coordinate, chosen) for chosen in groups[1:])]


def _walked(density: Density, coordinate: int, chosen: Sequence[int]) -> list[Node]:
    likelihood = density.likelihood
    fit, bounds = likelihood.fit, likelihood.fit.problem.bounds
    heaviest = chosen[int(np.argmax(likelihood.combined.weights[list(chosen)]))]
    moments, settled = [curve.moments for curve in density.curves], None
    misses = [np.zeros_like(own.residual) for own in moments]
    without = [np.zeros((len(own.residual), 0)) for own in moments]
    correcting = len(moments) == 1 and bool(likelihood.states[0].hypotheses.corrects[heaviest])
    if correcting:
        misses, without = [moments[0].residual], [moments[0].basis @ moments[0].taken[heaviest]]
    path = Path(density, bounds, misses, without, likelihood.priors)
    if correcting:
        settled = path.settled(_near(fit.vector, likelihood.mixture.means[heaviest]), None)

    def level(node: Node) -> float:
        found = conditionals(density, [node], coordinate, chosen)[0]
        return float(logsumexp(found.evidence))

    deviation = float(likelihood.mixture.deviations[coordinate])
    deviation = deviation if deviation > _HELD else 1.0
    # Where the correction leads to a place without a law, the walk begins at least squares.
    return walk(path, fit.vector if settled is None else settled.vector, coordinate, deviation, level)


def _near(vector: FloatArray, other: FloatArray) -> FloatArray:
    """Move from `vector` towards `other` (k,), by at most 1 in any scaled entry (a factor e)."""
    step = other - vector
    return np.asarray(vector + step * min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-300)))


@dataclass(frozen=True, eq=False)
class Source:
    """Mixture of the proposals of several ridges, each hypothesis in proportion to its evidence.

    `shares` are the probabilities of the hypotheses of all proposals. Parameters of a stated noise (entries
    `noise`) are drawn independently: normal of mean `middle` and Cholesky factor `factor`, from the fit's
    covariance.
    """

    proposals: Sequence[Proposal]
    shares: FloatArray
    noise: NDArray[np.intp]
    middle: FloatArray
    factor: FloatArray

    @classmethod
    def of(cls, proposals: Sequence[Proposal], fit: Any) -> Source:
        """Mix the proposals of the ridges of a fit; each hypothesis gets a share of at least 1 %."""
        noise = noise_entries(fit.problem)
        own = fit.scaled_covariance[noise[:, None], noise]
        factor = np.linalg.cholesky(own + 1e-12 * np.eye(len(noise)))
        logs = np.concatenate([own.shares for own in proposals])
        shares = np.maximum(np.exp(logs - logsumexp(logs)), _LEAST)
        return cls(proposals, shares / shares.sum(), noise, fit.vector[noise], factor)

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw scaled parameter vectors, (count, k), from the proposals along every ridge."""
        places = (np.arange(count) + rng.uniform()) / count
        own = np.minimum(np.searchsorted(np.cumsum(self.shares), places), len(self.shares) - 1)
        first, vectors = 0, []
        for proposal in self.proposals:
            last = first + len(proposal.shares)
            vectors.append(proposal.draw(own[(own >= first) & (own < last)] - first, rng))
            first = last
        drawn = np.vstack(vectors)
        drawn[:, self.noise] = self.middle + rng.standard_normal((count, len(self.noise))) @ self.factor.T
        return drawn

    def log_density(self, vectors: FloatArray) -> FloatArray:
        """Log-density, (n,), of this distribution at scaled vectors (n, k)."""
        logs = np.hstack([proposal.log_densities(vectors) for proposal in self.proposals])
        z = np.linalg.solve(self.factor, (vectors[:, self.noise] - self.middle).T)
        beside = -0.5 * (z * z).sum(axis=0) - np.log(np.diagonal(self.factor)).sum()
        beside -= 0.5 * len(self.noise) * np.log(2.0 * np.pi)
        return np.asarray(logsumexp(logs + np.log(self.shares), axis=1) + beside)


def _ends(proposals: Sequence[Proposal]) -> tuple[float, float]:
    """Log-evidence of all hypotheses at the first and at the last nodes of the ridges, less the largest on any."""
    levels = [[float(logsumexp(node.evidence)) for node in own.nodes] for own in proposals]
    top = max(max(own) for own in levels)
    return max(own[0] for own in levels) - top, max(own[-1] for own in levels) - top
