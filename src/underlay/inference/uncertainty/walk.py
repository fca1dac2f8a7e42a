"""Points along the ridge of a fit's likelihood: one coordinate is stepped, the others are optimised at each step.

At each value of the coordinate the others minimise the deviation from the fitted model or, for hypotheses with a
force step, ramp or turn, from the readings corrected for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.density import Density, Place
from underlay.inference.uncertainty.tree import NothingDrawnError, tangents

_FIRST, _SHORTEST = 0.5, 0.1  # first and shortest step along a ridge, in standard deviations
_LONGEST = 1.0  # longest step, in the scaled coordinate
_MOST, _DROP = 22, 8.0  # largest number of nodes on a side; nats below the maximum where a side ends
# Gauss-Newton's method for the other entries: most steps; share of a standard deviation below which it ends;
# longest step.
_STEPS, _SETTLED, _STRIDE = 4, 0.1, 0.7
_BENDS, _VISIBLE = 4, 0.3  # most directions in which the model curves; their least size in noise deviations


@dataclass(frozen=True, eq=False)
class Node:
    """A scaled vector (k,) on the ridge, and the curves linearised there."""

    vector: FloatArray
    places: Sequence[Place]


@dataclass(frozen=True, eq=False)
class Path:
    """The least-squares problem that places a ridge's nodes.

    Parameters
    ----------
    density : Density
        Density of the scaled vector.
    bounds : FloatArray
        Bounds (k, 2) of the scaled vector.
    misses : sequence of FloatArray
        Residuals (n,) of each curve at least squares; zero where nodes approximate the fitted model.
    without : sequence of FloatArray
        Columns (n, q) of each curve (step, ramp, turn) that are projected out of its rows.
    priors : FloatArray
        Curvature (k,) of the priors.
    """

    density: Density
    bounds: FloatArray
    misses: Sequence[FloatArray]
    without: Sequence[FloatArray]
    priors: FloatArray

    def node(self, vector: FloatArray) -> Node | None:
        """Linearise all curves at a vector (k,); None where no contact law exists."""
        found = tangents([curve.model for curve in self.density.curves], vector)
        if found is None:
            return None
        places = [curve.place(own) for curve, own in zip(self.density.curves, found, strict=True)]
        return Node(vector, places) if all(place is not None for place in places) else None  # type: ignore[arg-type]

    def settled(self, vector: FloatArray, coordinate: int | None) -> Node | None:
        """Node with `coordinate` held and the others optimised, from a vector (k,) near it; None without a law.

        A step beyond the last contact law is halved: where the optimum lies beyond, the node is beside that edge.
        """
        node = self.node(vector)
        if node is None:
            return None
        for _ in range(_STEPS):
            step, deviations = self._step(node, coordinate)
            step = step * min(1.0, _STRIDE / max(float(np.abs(step).max()), 1e-300))
            ahead = None
            while ahead is None:
                there = np.clip(node.vector + step, self.bounds[:, 0] + 1e-6, self.bounds[:, 1] - 1e-6)
                if (np.abs(there - node.vector) <= _SETTLED * deviations + 1e-9).all():
                    return node
                ahead, step = self.node(there), 0.5 * step
            node = ahead
        return node

    def _step(self, node: Node, coordinate: int | None) -> tuple[FloatArray, FloatArray]:
        k = len(node.vector)
        moving = [i for i in self.density.kept if i != coordinate]
        normal, pull = np.diag(self.priors), self.priors * (self.density.likelihood.fit.vector - node.vector)
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


def walk(
    path: Path, start: FloatArray, coordinate: int, deviation: float, level: Callable[[Node], float]
) -> list[Node]:
    """Points along a ridge to both sides, until the evidence has dropped by 8 nats or a bound is reached.

    Parameters
    ----------
    path : Path
        The least-squares problem of the other entries.
    start : FloatArray
        Scaled vector (k,) to begin at.
    coordinate : int
        The entry of the vector that is stepped.
    deviation : float
        Standard deviation of that entry, scaled.
    level : callable
        Logarithm of the evidence at a node.

    Returns
    -------
    list of Node
        In order of the coordinate.

    Raises
    ------
    NothingDrawnError
        If there is no contact law at the start.
    """
    first = path.settled(np.clip(start, path.bounds[:, 0] + 1e-6, path.bounds[:, 1] - 1e-6), coordinate)
    if first is None:
        raise NothingDrawnError("no contact law at the optimum of a fit")
    top = level(first)
    sides = []
    for sign in (-1.0, 1.0):
        nodes, top = _one_side(path, first, coordinate, sign, deviation, level, top)
        sides.append(nodes)
    return [*reversed(sides[0]), first, *sides[1]]


def _one_side(
    path: Path,
    first: Node,
    coordinate: int,
    sign: float,
    deviation: float,
    level: Callable[[Node], float],
    top: float,
) -> tuple[list[Node], float]:
    low, high = path.bounds[coordinate] + np.array([1e-6, -1e-6])
    shortest = min(_SHORTEST * deviation, 0.04)
    step = float(np.clip(_FIRST * deviation, shortest, 0.25))
    nodes: list[Node] = []
    before = [first.vector]
    while len(nodes) < _MOST:
        here = before[-1]
        ahead = here.copy()
        if len(before) > 1:
            ahead += (here - before[-2]) / (here[coordinate] - before[-2][coordinate]) * sign * step
        ahead[coordinate] = np.clip(here[coordinate] + sign * step, low, high)
        ahead = np.clip(ahead, path.bounds[:, 0] + 1e-6, path.bounds[:, 1] - 1e-6)
        if abs(ahead[coordinate] - here[coordinate]) < 1e-9:
            break
        node = path.settled(ahead, coordinate)
        if node is None:
            if step <= shortest:
                break
            step *= 0.5
            continue
        nodes.append(node)
        missed = float(np.abs(np.delete(node.vector - ahead, coordinate)).max(initial=0.0))
        step = float(
            np.clip(step * (1.6 if missed < 0.03 else 0.7 if missed > 0.15 else 1.0), shortest, _LONGEST)
        )
        evidence = level(node)
        top = max(top, evidence)
        if evidence < top - _DROP or not low < node.vector[coordinate] < high:
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
