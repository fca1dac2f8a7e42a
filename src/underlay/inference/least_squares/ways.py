"""The ways of searches that follow one another: one that comes onto the way of an earlier one need not go on.

Starts that end at the edge of what a start may explore often lie in one long valley. Below each of them the search
would go the same way down it, model for model.
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.least_squares.engine import Ahead

__all__ = ["Ways"]

# A place this near to a way, in every scaled coordinate, is on it: nearer, two minima are one.
_ON_IT = 0.05
# Steps shorter than this are those at a minimum, which lead every way; one along a way makes an angle with it whose
# cosine is at least this.
_LONG, _ALONG = 0.3, 0.9


class Ways:
    """Scaled vectors (k,) at which searches stood, one list for each; to be asked by the next before each step."""

    def __init__(self) -> None:
        self._earlier: list[tuple[FloatArray, float]] = []
        self._own: list[FloatArray] = []
        self._lowest = np.inf

    def begin(self) -> None:
        """Another search begins."""
        if len(self._own) > 1:
            self._earlier.append((np.array(self._own), self._lowest))
        self._own, self._lowest = [], np.inf

    def __call__(self, ahead: Ahead) -> bool:
        """Whether a search stands on the way of an earlier one that went lower, about to go along it."""
        step = ahead.there - ahead.here
        self._own.append(ahead.here)
        self._lowest = ahead.square
        return any(
            lowest <= ahead.square and _leads_along(way, ahead.here, step) for way, lowest in self._earlier
        )


def _leads_along(way: FloatArray, here: FloatArray, step: FloatArray) -> bool:
    """Whether a step (k,) from a place (k,) on a way (n, k) goes the way's own direction."""
    first, along = way[:-1], np.diff(way, axis=0)
    lengths = np.sqrt(np.square(along).sum(axis=1))
    long = lengths > _LONG
    if not long.any():
        return False
    first, along, lengths = first[long], along[long] / lengths[long, None], lengths[long]
    gone = ((here - first) * along).sum(axis=1)
    beside = here - first - np.clip(gone, 0.0, lengths)[:, None] * along
    on_it = (np.abs(beside) <= _ON_IT).all(axis=1)
    return bool((on_it & (along @ step >= _ALONG * np.sqrt(step @ step))).any())
