"""The reading where the force is not straight in what is free: weighted draws along the ridge.

A walk from the optimum lays nodes along the ridge (`Walk`); at each of them every hypothesis has its
distribution of the other entries (`proposal`). Draws come from their interpolation and are weighed by the
density itself (`density`); further rounds follow where one ridge does not hold them (`proposal`). Interval,
posterior, map row and corner plot are read from these draws; Pareto's k says whether they can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, logsumexp

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.density import Density, Node
from underlay.inference.uncertainty.proposal import Kernels, Pool, Proposal, conditional
from underlay.inference.uncertainty.tree import NothingDrawnError, noise_entries, straight, tangents

_DRAWS, _ROUNDS = 1000, 6  # draws of a round; further rounds at most
_TRUSTED, _ENOUGH = 0.7, 300.0  # Pareto k below which, and effective draws from which, draws are trusted
_SECOND = 0.02  # weight from which hypotheses that correct the value have a ridge of their own
_LEAST = 0.01  # share of draws that a hypothesis gets at least
_BINS = 24  # bins in six deviations of the draws; in the one at a bound the density there is asked
_HELD = 1e-9  # deviation below which an entry was held, on a bound
_FIRST, _SHORTEST = 0.5, 0.1  # first and shortest step along a ridge, in standard deviations
_LONGEST = 1.0  # longest step, in the scaled coordinate
_MOST, _DROP = 22, 8.0  # largest number of nodes on a side; nats below the maximum where a side ends
# Gauss-Newton's method for the other entries: most steps; share of a standard deviation below which it ends;
# longest step.
_STEPS, _SETTLED, _STRIDE = 4, 0.1, 0.7
_BENDS, _VISIBLE = 4, 0.3  # most directions in which the model curves; their least size in noise deviations


@dataclass(frozen=True, eq=False)
class Walk:
    """The walk along the ridge that some hypotheses share, with one coordinate stepped and the others optimised.

    At each value of the coordinate the others minimise the deviation from the fitted model or, for hypotheses with
    a force step, ramp or turn, from the readings corrected for it.

    Parameters
    ----------
    density : Density
        Density of the scaled vector.
    coordinate : int
        The entry of the vector that is stepped.
    chosen : sequence of int
        The hypotheses.
    misses : sequence of FloatArray
        Residuals (n,) of each curve at least squares; zero where nodes approximate the fitted model.
    without : sequence of FloatArray
        Columns (n, q) of each curve (step, ramp, turn) that are projected out of its rows.
    """

    density: Density
    coordinate: int
    chosen: Sequence[int]
    misses: Sequence[FloatArray]
    without: Sequence[FloatArray]

    def nodes(self, start: FloatArray) -> list[Node]:
        """Points to both sides, until the evidence has dropped by 8 nats or a bound is reached.

        In order of the coordinate, from a scaled vector (k,) near the ridge.

        Raises
        ------
        NothingDrawnError
            If there is no contact law at the start.
        """
        first = self.settled(self._inside(start), self.coordinate)
        if first is None:
            raise NothingDrawnError("no contact law at the optimum of a fit")
        top = self._level(first)
        below, top = self._one_side(first, -1.0, top)
        above, _ = self._one_side(first, 1.0, top)
        return [*reversed(below), first, *above]

    def settled(self, vector: FloatArray, coordinate: int | None) -> Node | None:
        """Node with `coordinate` held and the others optimised, from a vector (k,) near it; None without a law.

        A step beyond the last contact law is halved: where the optimum lies beyond, the node is beside that edge.
        """
        node = self._node(vector)
        if node is None:
            return None
        for _ in range(_STEPS):
            step, deviations = self._step(node, coordinate)
            step = step * min(1.0, _STRIDE / max(float(np.abs(step).max()), 1e-300))
            ahead = None
            while ahead is None:
                there = self._inside(node.vector + step)
                if (np.abs(there - node.vector) <= _SETTLED * deviations + 1e-9).all():
                    return node
                ahead, step = self._node(there), 0.5 * step
            node = ahead
        return node

    def _inside(self, vector: FloatArray) -> FloatArray:
        """The vector (k,) moved inside its bounds."""
        low, high = self.density.likelihood.fit.problem.bounds.T
        return np.asarray(np.clip(vector, low + 1e-6, high - 1e-6))

    def _level(self, node: Node) -> float:
        """Logarithm of the evidence of the hypotheses at a node, the other entries integrated out."""
        return float(logsumexp(conditional(self.density, node, self.coordinate, self.chosen).evidence))

    def _node(self, vector: FloatArray) -> Node | None:
        """Linearise all curves at a vector (k,); None where no contact law exists."""
        found = tangents([curve.model for curve in self.density.curves], vector)
        if found is None:
            return None
        places = [curve.place(own) for curve, own in zip(self.density.curves, found, strict=True)]
        return Node(vector, places) if all(place is not None for place in places) else None  # type: ignore[arg-type]

    def _step(self, node: Node, coordinate: int | None) -> tuple[FloatArray, FloatArray]:
        k, priors = len(node.vector), self.density.likelihood.priors
        moving = [i for i in self.density.kept if i != coordinate]
        normal, pull = np.diag(priors), priors * (self.density.likelihood.fit.vector - node.vector)
        for place, miss, out in zip(node.places, self.misses, self.without, strict=True):
            law = place.columns - out @ (out.T @ place.columns)
            normal = normal + law.T @ place.columns
            pull = pull + law.T @ (place.fallen + miss)
        scale = np.sqrt(np.diagonal(normal))[moving]
        scaled = normal[np.ix_(moving, moving)] / scale / scale[:, None] + 1e-11 * np.eye(len(moving))
        inverse = np.linalg.inv(scaled) / scale / scale[:, None]
        step, deviations = np.zeros(k), np.full(k, np.inf)
        step[moving], deviations[moving] = inverse @ pull[moving], np.sqrt(np.diagonal(inverse))
        return step, deviations

    def _one_side(self, first: Node, sign: float, top: float) -> tuple[list[Node], float]:
        """Nodes to one side of the first, and the largest evidence so far, `top` before."""
        i, likelihood = self.coordinate, self.density.likelihood
        low, high = likelihood.fit.problem.bounds[i] + np.array([1e-6, -1e-6])
        deviation = float(likelihood.mixture.deviations[i])
        deviation = deviation if deviation > _HELD else 1.0
        shortest = min(_SHORTEST * deviation, 0.04)
        step = float(np.clip(_FIRST * deviation, shortest, 0.25))
        nodes: list[Node] = []
        before = [first.vector]
        while len(nodes) < _MOST:
            here = before[-1]
            ahead = here.copy()
            if len(before) > 1:
                ahead += (here - before[-2]) / (here[i] - before[-2][i]) * sign * step
            ahead[i] = np.clip(here[i] + sign * step, low, high)
            ahead = self._inside(ahead)
            if abs(ahead[i] - here[i]) < 1e-9:
                break
            node = self.settled(ahead, i)
            if node is None:
                if step <= shortest:
                    break
                step *= 0.5
                continue
            nodes.append(node)
            missed = float(np.abs(np.delete(node.vector - ahead, i)).max(initial=0.0))
            stretch = 1.6 if missed < 0.03 else 0.7 if missed > 0.15 else 1.0
            step = float(np.clip(step * stretch, shortest, _LONGEST))
            evidence = self._level(node)
            top = max(top, evidence)
            if evidence < top - _DROP or not low < node.vector[i] < high:
                break
            before.append(node.vector)
        return nodes, top


def bends_of(nodes: Sequence[Node], density: Density) -> list[FloatArray]:
    """Orthonormal columns (n, p) of each curve that span the nonlinear change of its model along a ridge.

    A ridge is the path of `nodes` along which the likelihood changes little; only changes larger than the noise are
    kept.
    """
    found = []
    for i, curve in enumerate(density.curves):
        fallen = np.array([node.places[i].fallen for node in nodes]).T
        law = curve.moments.basis[:, : len(nodes[0].vector)]
        acting = law[:, np.abs(law).max(axis=0) > 0.0]
        q, _ = np.linalg.qr(acting)
        left = fallen - q @ (q.T @ fallen)
        u, sizes, _ = np.linalg.svd(left, full_matrices=False)
        found.append(u[:, :_BENDS][:, sizes[:_BENDS] > _VISIBLE])
    return found


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
    pareto : float
        Pareto k of the weights.
    coordinate : int
        The entry along which the ridge was walked.
    ends : tuple of float
        Log-density at the first and at the last node of the ridges, other entries integrated out, less its maximum.
    bounds : FloatArray
        Bounds of the scaled vector, (k, 2).
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
    coordinate: int
    ends: tuple[float, float]
    bounds: FloatArray
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
    def of(cls, likelihood: Any) -> Ridges:
        """Walk the ridges of a likelihood along its least determined non-linear entry.

        Raises
        ------
        NothingDrawnError
            If no ridge could be walked.
        """
        groups = _groups(likelihood)
        for coordinate in _coordinates(likelihood):
            plain = Density.of(likelihood)
            nodes = [_walked(plain, coordinate, groups[0])]
            # With the directions in which the model curves along the first ridge.
            density = Density.of(likelihood, bends_of(nodes[0], plain))
            nodes += [_walked(density, coordinate, chosen) for chosen in groups[1:]]
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
    entries = np.concatenate((density.kept, source.noise))
    for _ in range(_ROUNDS):
        if pool.pareto < _TRUSTED and pool.effective > _ENOUGH:
            break
        kernels = Kernels.about(pool.vectors, pool.log_weights, entries, rng)
        pool.add(kernels.log_density, kernels.draw(count, fit.vector, rng))
    levels = [[float(logsumexp(node.evidence)) for node in own.nodes] for own in proposals]
    top, bounds = max(max(own) for own in levels), fit.problem.bounds
    inside = ((pool.vectors >= bounds[:, 0]) & (pool.vectors <= bounds[:, 1])).all(axis=1)
    return Ridge(
        draws=pool.vectors,
        weights=pool.weights,
        log_density=pool.levels,
        log_evidence=float(logsumexp(pool.log_weights) - np.log(len(pool.vectors))),
        pareto=pool.pareto,
        coordinate=ridges.coordinate,
        ends=(max(own[0] for own in levels) - top, max(own[-1] for own in levels) - top),
        bounds=bounds,
        failed=int((inside & ~np.isfinite(pool.levels)).sum()),
        source=source,
        paths=paths,
    )


def _coordinates(likelihood: Any) -> list[int]:
    """Indices of the entries along which a ridge may be walked, best first.

    These are entries in which the force is non-linear: the substrate's modulus, then by falling standard deviation.
    """
    problem, deviations = likelihood.fit.problem, likelihood.mixture.deviations
    deviations = np.where(deviations > _HELD, deviations, np.inf)
    bent = [int(i) for i in likelihood.entries if not straight(problem)[i]]
    base = [i for i in bent if problem.coordinates[i].path == "substrate.E"]
    order = sorted((i for i in bent if i not in base), key=lambda i: -deviations[i])
    return [*base, *order] or [int(i) for i in likelihood.entries]


def _groups(likelihood: Any) -> list[list[int]]:
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


def _walked(density: Density, coordinate: int, chosen: Sequence[int]) -> list[Node]:
    """Walk along the ridge of the hypotheses `chosen`."""
    likelihood, vector = density.likelihood, density.likelihood.fit.vector
    heaviest = chosen[int(np.argmax(likelihood.combined.weights[list(chosen)]))]
    moments = [curve.moments for curve in density.curves]
    if len(moments) == 1 and likelihood.states[0].hypotheses.corrects[heaviest]:
        own = moments[0]
        path = Walk(density, coordinate, chosen, [own.residual], [own.basis @ own.taken[heaviest]])
        step = likelihood.mixture.means[heaviest] - vector
        # By at most 1 in any scaled entry (a factor e).
        near = vector + step * min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-300))
        settled = path.settled(near, None)
        # Where the correction leads to a place without a law, the walk begins at least squares.
        return path.nodes(vector if settled is None else settled.vector)
    misses = [np.zeros_like(own.residual) for own in moments]
    return Walk(density, coordinate, chosen, misses, [np.zeros((len(own), 0)) for own in misses]).nodes(
        vector
    )


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
