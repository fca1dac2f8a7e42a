"""Several places of a search at once: their sums of squares with derivatives, what is linear solved for at each.

Steps of a search from one start cost calls, not arithmetic: as many calls serve all starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.least_squares.projection import LinearDirections, Point

__all__ = ["Places", "Rows", "projected"]


class Rows(NamedTuple):
    """One curve's part of several places.

    Parameters
    ----------
    residuals : FloatArray
        Whitened, (s, n).
    derivatives : FloatArray
        Of the residuals in the scaled entries that the curve reads, (s, own, n).
    entries : ndarray of int (own,) or None
        Which those are; None where they are all, in order.
    """

    residuals: FloatArray
    derivatives: FloatArray
    entries: NDArray[np.intp] | None


@dataclass(frozen=True)
class Places:
    """What `Point` says of one place, of several: the first axis is theirs.

    Parameters
    ----------
    vector : FloatArray
        Scaled, (s, k).
    square : FloatArray
        Sum of squares, (s,); infinite where there is no law.
    gradient : FloatArray
        J'r, (s, k).
    normal : FloatArray
        J'J, (s, k, k).
    """

    vector: FloatArray
    square: FloatArray
    gradient: FloatArray
    normal: FloatArray

    @classmethod
    def of(cls, points: Sequence[Point | None], vectors: FloatArray) -> Self:
        """Gather places; None is one without a law, at its row of `vectors` (s, k)."""
        count, k = vectors.shape
        places = cls(np.array(vectors), np.full(count, np.inf), np.zeros((count, k)), np.zeros((count, k, k)))
        for row, point in enumerate(points):
            if point is not None:
                places.vector[row], places.square[row] = point.vector, point.square
                places.gradient[row], places.normal[row] = point.gradient, point.normal
        return places

    def point(self, row: int) -> Point:
        """One of them."""
        return Point(self.vector[row], float(self.square[row]), self.gradient[row], self.normal[row])

    def part(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Some of them."""
        return type(self)(self.vector[rows], self.square[rows], self.gradient[rows], self.normal[rows])

    def replaced(self, which: NDArray[np.bool_], other: Self) -> Self:
        """These, with those of `other` at the rows `which` (s,)."""
        if not which.any():
            return self
        if which.all():
            return other
        return type(self)(
            np.where(which[:, None], other.vector, self.vector),
            np.where(which, other.square, self.square),
            np.where(which[:, None], other.gradient, self.gradient),
            np.where(which[:, None, None], other.normal, self.normal),
        )


def projected(
    curves: Sequence[Rows], prior: Places, linear: LinearDirections, low: FloatArray, high: FloatArray
) -> Places:
    """Places with what is linear taken to its best, where that is within the ends (s, k).

    Parameters
    ----------
    curves : sequence of Rows
        What every curve says at the places' vectors.
    prior : Places
        What the priors say there: infinite squares where there is no law.
    linear : LinearDirections
        What is solved for.
    """
    gradient, normal, square = prior.gradient, prior.normal.copy(), prior.square
    for curve in curves:
        J = curve.derivatives
        own = J @ J.swapaxes(-1, -2)
        if curve.entries is None:
            normal += own
        else:
            normal[:, curve.entries[:, None], curve.entries] += own
    gradient, square = _against(curves, [curve.residuals for curve in curves], prior)
    step = linear.steps(Places(prior.vector, square, gradient, normal), low, high)
    if step is None:
        return Places(prior.vector, square, gradient, normal)
    # From the residuals, not from their products: a small sum of squares keeps its digits.
    residuals = []
    for curve in curves:
        along = step.along if curve.entries is None else step.along[:, curve.entries]
        residuals.append(curve.residuals + (along[:, None] @ curve.derivatives)[:, 0])
    gradient, square = _against(curves, residuals, prior, step.grown)
    grown = step.grown[:, :, None] * step.grown[:, None, :]
    normal = (normal - prior.normal) * grown + prior.normal
    return Places(prior.vector + step.change, square, gradient, normal)


def _against(
    curves: Sequence[Rows], residuals: Sequence[FloatArray], prior: Places, grown: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """J'r (s, k), its derivatives grown by factors (s, k), and r'r (s,), with what the priors add."""
    gradient, square = np.zeros(prior.gradient.shape), prior.square.copy()
    for curve, r in zip(curves, residuals, strict=True):
        square += np.einsum("sn,sn->s", r, r)
        own = (curve.derivatives @ r[:, :, None])[:, :, 0]
        if curve.entries is None:
            gradient += own
        else:
            gradient[:, curve.entries] += own
    if grown is not None:
        gradient *= grown
    return gradient + prior.gradient, square
