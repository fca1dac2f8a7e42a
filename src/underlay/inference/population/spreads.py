"""Priors of spreads, and the grid over which they are summed out.

A spread is the standard deviation of ln of the parameter among the units of a level: 0.2 is 20 %. Priors:
half-Cauchy of scale 0.3 between animals (Gelman 2006, doi 10.1214/06-BA117A) and half-t with four degrees of
freedom and scale 0.5 among curves of one animal, chosen by coverage for three to ten animals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["BETWEEN", "WITHIN", "SpreadGrid", "SpreadPrior", "Windows", "spread_windows", "weighted_grid"]

LogLikelihood: TypeAlias = Callable[[tuple[FloatArray, ...]], FloatArray]
#: Per level, outermost first: ln of the smallest and the largest spread that count.
Windows: TypeAlias = tuple[tuple[float, float], ...]

_SMALLEST, _LARGEST = 1e-3, 5.0
# Nodes per axis: while it is looked for where the posterior is, and for the sums.
_FIRST = 9
_NODES = {1: (32,), 2: (24, 16), 3: (14, 12, 12)}
_MOST = 10
# What lies this far below the largest is left out: a share of 1e-5.
_NEGLIGIBLE = 12.0
_PASSES = 6


@dataclass(frozen=True)
class SpreadPrior:
    """Half-t prior of a spread: scale, and degrees of freedom (1 is half-Cauchy)."""

    scale: float
    freedom: float

    def log_density(self, spread: FloatArray) -> FloatArray:
        """Logarithm of the density but for its constant."""
        power = 0.5 * (self.freedom + 1.0)
        result: FloatArray = -power * np.log1p((spread / self.scale) ** 2 / self.freedom)
        return result


BETWEEN, WITHIN = SpreadPrior(0.3, 1.0), SpreadPrior(0.5, 4.0)


@dataclass(frozen=True)
class SpreadGrid:
    """Posterior of the spreads, outermost level first, on a grid.

    Parameters
    ----------
    nodes : tuple of FloatArray
        Spreads per level.
    weights : FloatArray
        Posterior probability of every combination, one axis per level; sums to one.
    log_evidence : float
        Logarithm of what was summed, but for the priors' constants.
    """

    nodes: tuple[FloatArray, ...]
    weights: FloatArray
    log_evidence: float

    def quantile(self, level: int, shares: FloatArray) -> FloatArray:
        """Quantiles of one spread; zero where they lie below the smallest that is told apart."""
        weights = self._marginal(level)
        log_nodes = np.log(self.nodes[level])
        edges = 0.5 * (log_nodes[1:] + log_nodes[:-1])
        below = np.cumsum(weights)
        places = np.exp(np.interp(shares, below, [*edges, log_nodes[-1]]))
        at_least = self.nodes[level][0] <= _SMALLEST * 1.01
        return np.where(at_least & (shares < below[0]), 0.0, places)

    def probability_below(self, level: int, spread: float) -> float:
        """Posterior probability that one spread is smaller."""
        log_nodes = np.log(self.nodes[level])
        edges = [*(0.5 * (log_nodes[1:] + log_nodes[:-1])), log_nodes[-1]]
        return float(np.interp(np.log(spread), edges, np.cumsum(self._marginal(level)), left=0.0, right=1.0))

    def _marginal(self, level: int) -> FloatArray:
        others = tuple(axis for axis in range(self.weights.ndim) if axis != level)
        result: FloatArray = self.weights.sum(axis=others)
        return result


def spread_windows(log_likelihood: LogLikelihood, priors: Sequence[SpreadPrior]) -> Windows:
    """Find where the posterior of the spreads is: for each level, in ln of its spread, where it is all but nothing.

    Parameters
    ----------
    log_likelihood : callable
        Of a tuple of nodes per level: the logarithm of the likelihood at all combinations, to a log unit or so.
    priors : sequence of SpreadPrior
        One per level, outermost first.
    """
    windows: Windows = ((math.log(_SMALLEST), math.log(_LARGEST)),) * len(priors)
    for _ in range(_PASSES):
        log_nodes = [np.linspace(low, high, _FIRST) for low, high in windows]
        found = _log_posterior(log_likelihood, log_nodes, priors)
        narrowed = tuple(_window(found, axis, log_nodes[axis]) for axis in range(len(priors)))
        shrunk = any(
            high - low < 0.6 * (b - a) for (low, high), (a, b) in zip(narrowed, windows, strict=True)
        )
        windows = narrowed
        if not shrunk:
            break
    return windows


def weighted_grid(
    log_likelihood: LogLikelihood, priors: Sequence[SpreadPrior], windows: Windows
) -> SpreadGrid:
    """Weigh a grid over the windows of the spreads, outermost level first."""
    counts = _NODES.get(len(priors), (_MOST,) * len(priors))
    log_nodes = [np.linspace(low, high, count) for (low, high), count in zip(windows, counts, strict=True)]
    found = _log_posterior(log_likelihood, log_nodes, priors)
    log_cell = sum(
        np.log(_cells(nodes)).reshape([-1 if axis == here else 1 for axis in range(len(priors))])
        for here, nodes in enumerate(log_nodes)
    )
    log_weights = found + log_cell
    largest = log_weights.max()
    weights = np.exp(log_weights - largest)
    total = weights.sum()
    return SpreadGrid(
        tuple(np.exp(nodes) for nodes in log_nodes), weights / total, float(largest + np.log(total))
    )


def _log_posterior(
    log_likelihood: LogLikelihood,
    log_nodes: Sequence[FloatArray],
    priors: Sequence[SpreadPrior],
) -> FloatArray:
    """Density per unit of ln spread at all combinations."""
    nodes = tuple(np.exp(at) for at in log_nodes)
    found = log_likelihood(nodes)
    for axis, (at, prior) in enumerate(zip(nodes, priors, strict=True)):
        along = [-1 if other == axis else 1 for other in range(len(priors))]
        found = found + (prior.log_density(at) + np.log(at)).reshape(along)
    return found


def _cells(log_nodes: FloatArray) -> FloatArray:
    """Trapezoidal width of each node; the smallest spread stands for all below it too."""
    step = log_nodes[1] - log_nodes[0]
    cells = np.full(len(log_nodes), step)
    cells[[0, -1]] *= 0.5
    if log_nodes[0] <= np.log(_SMALLEST) + 1e-9:
        cells[0] += 1.0
    return cells


def _window(found: FloatArray, axis: int, log_nodes: FloatArray) -> tuple[float, float]:
    others = tuple(other for other in range(found.ndim) if other != axis)
    along = found.max(axis=others)
    kept = np.flatnonzero(along > along.max() - _NEGLIGIBLE)
    low, high = max(kept[0] - 1, 0), min(kept[-1] + 1, len(log_nodes) - 1)
    return float(log_nodes[low]), float(log_nodes[high])
