"""Rough fits: which of several starts may be the optimum, and where it is nearly.

Every curve is taken in blocks of neighbouring points, so that a step costs a fraction of what it costs the fit
itself. The steps are those of Levenberg and Marquardt (Marquardt 1963, doi:10.1137/0111030), with the linear
parameters solved for beside them. One step up the side of a valley is allowed if the next one leads further
down than where it began: the valleys of these problems are long and bent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.fitting.blocked_squares import BlockedSquares, Point
from underlay.inference.problem import Problem

__all__ = ["RoughMinimum", "rough_minima"]

_MOST_STEPS = 12
# Nothing explains the data better than down to their scatter. Once one start does, another that is not among
# those that may be the optimum after so many steps is given up.
_PATIENCE = 3
# A step that lowers the sum of squares by less than this share came from within a fifth of a standard error of
# the blocks; what is left is far less.
_SETTLED = 1e-3
_FIRST_DAMPING, _MOST_DAMPING, _EASIER, _HARDER = 1e-5, 1e6, 0.1, 10.0
_VENTURE = 10.0  # how much higher than its beginning a step up the side may end
# Two minima closer than this in every scaled coordinate are one, and a start whose next step leads within two
# standard errors of a minimum that explains the data is on its way there; a rise of chi-square by 30 in the
# blocks is not undone by looking at every point.
_ONE_PLACE, _ON_THE_WAY, _MAY_BE = 0.05, 2.0, 30.0


@dataclass(frozen=True)
class RoughMinimum:
    """Where a rough fit stopped.

    Parameters
    ----------
    square : float
        Sum of squares over the blocks.
    vector : FloatArray
        Scaled, (k,).
    normal : FloatArray
        J'J over the variance of a block's residual, (k, k); None where the minimum does not explain the data.
    at_edge : bool
        Whether it would have gone further than a start may.
    """

    square: float
    vector: FloatArray
    normal: FloatArray | None
    at_edge: bool

    @cached_property
    def deviation(self) -> FloatArray:
        """Standard errors (k,), scaled; zero where there are none."""
        if self.normal is None:
            return np.zeros(len(self.vector))
        inverse = np.linalg.pinv(self.normal, hermitian=True)
        return np.asarray(np.sqrt(np.maximum(np.diag(inverse), 0.0)))


def rough_minima(problem: Problem, starts: Sequence[FloatArray], *, robust: bool) -> list[RoughMinimum]:
    """Fit the starts (scaled vectors (k,)) roughly and keep those that may be the optimum, best first.

    Blocks are averages, whose optimum is nearly that of all points, or medians where the fit is robust. Numbers
    of the noise stay. Empty if no start has a law.
    """
    surface = BlockedSquares.of(problem, robust=robust)
    points = [(*surface.box(start), surface.point(start, *surface.box(start))) for start in starts]
    enough = np.inf
    found: list[RoughMinimum] = []
    for low, high, point in sorted(points, key=lambda entry: np.inf if entry[2] is None else entry[2].square):
        if point is not None:
            minimum = _descend(surface, point, low, high, enough, found)
            if minimum is None:
                continue
            found.append(minimum)
            if minimum.square <= surface.explained:
                enough = min(enough, minimum.square * (1.0 + _MAY_BE / surface.degrees))
    found.sort(key=lambda entry: entry.square)
    return _distinct(found, surface)


def _distinct(found: list[RoughMinimum], surface: BlockedSquares) -> list[RoughMinimum]:
    """Those, best first, that may be the optimum and are not on the way to a better one."""
    kept: list[RoughMinimum] = []
    for entry in found:
        best = found[0]
        unit = best.square / surface.degrees
        may_be = entry.square - best.square <= _MAY_BE * unit
        # Beyond the edge is the place of another start; none is better than one that explains the data.
        leaves = entry is not best and entry.at_edge and best.square <= surface.explained
        if may_be and not leaves and not _near(entry.vector, kept):
            kept.append(entry)
    return kept


def _near(vector: FloatArray, minima: Sequence[RoughMinimum]) -> bool:
    """Whether a vector is one with a minimum, or on the way to it."""
    return any(
        bool((np.abs(vector - other.vector) <= np.maximum(_ONE_PLACE, _ON_THE_WAY * other.deviation)).all())
        for other in minima
    )


def _descend(
    surface: BlockedSquares,
    best: Point,
    low: FloatArray,
    high: FloatArray,
    enough: float,
    known: Sequence[RoughMinimum],
) -> RoughMinimum | None:
    """Minimum below a point; None where it is clear that there is none but those `known`.

    `enough` is the sum of squares above which one of them has left this one behind.
    """
    now, ventured, damping = best, False, _FIRST_DAMPING
    for count in range(_MOST_STEPS):
        if count >= _PATIENCE and best.square > enough:
            return None
        step, gain = _step(now, damping, low, high)
        proposed = np.clip(now.at + step, low, high)
        if _near(proposed, known):
            return None
        if not ventured and gain <= _SETTLED * best.square:
            # So short a step is what its linear model says.
            best = replace(best, at=proposed)
            break
        there = surface.point(proposed, low, high)
        change = np.inf if there is None else there.square - best.square
        if there is not None and change < 0.0:
            now = best = there
            ventured, damping = False, _EASIER * damping
        elif there is not None and not ventured and there.square < _VENTURE * best.square:
            now, ventured = there, True
        else:
            now, ventured, damping = best, False, _HARDER * damping
        if abs(change) <= _SETTLED * best.square or damping > _MOST_DAMPING:
            break
    bounds = surface.bounds.T
    at_edge = ((best.at <= low) & (low > bounds[0])) | ((best.at >= high) & (high < bounds[1]))
    normal = None
    if best.square <= surface.explained:
        normal = (best.jacobian.T @ best.jacobian) * (surface.degrees / best.square)
    return RoughMinimum(best.square, best.at, normal, bool(at_edge[surface.reach > 0.0].any()))


def _step(point: Point, damping: float, low: FloatArray, high: FloatArray) -> tuple[FloatArray, float]:
    """Step (k,), where entries that would leave their bounds rest, and what it should gain."""
    normal = point.jacobian.T @ point.jacobian
    gradient = point.jacobian.T @ point.residuals
    diagonal = np.diag(normal)
    moves = (diagonal > 0.0) & ((point.at > low) | (gradient < 0.0)) & ((point.at < high) | (gradient > 0.0))
    step = np.zeros(len(diagonal))
    which = np.flatnonzero(moves)
    if which.size:
        scale = np.sqrt(diagonal[which])
        scaled = normal[np.ix_(which, which)] / (scale[:, None] * scale)
        scaled.flat[:: which.size + 1] += damping
        step[which] = -np.linalg.solve(scaled, gradient[which] / scale) / scale
    return step, float(-step @ gradient)
