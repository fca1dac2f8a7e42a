"""Averages of successive readings: fewer rows, with no loss for a force that is smooth in depth.

No block contains the point of contact: averaged across it, a reading is off by 1e-3 of the peak force, which
matters where the noise is small. Near contact none is wider than 3 % of the largest depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["Blocks", "resolution"]

_MOST, _MOST_FINE = 400, 1200  # largest number of blocks of a curve; of a curve that is fast near contact
# Largest width of a block near contact, and the distance that counts as near: shares of the largest depth.
_WIDEST, _NEAR = 0.03, 0.2
_APPROACH = 2.0  # depth before contact that is kept, in largest indentation depths
_REPEATS = 0.2  # share of equal successive readings from which readings are taken as rounded


@dataclass(frozen=True)
class Blocks:
    """Division of a curve into `count` blocks of `size` successive readings, from reading `start` on."""

    start: int
    size: int
    count: int

    @classmethod
    def of(cls, depth: FloatArray, contact: float) -> Blocks:
        """Blocks for readings at `depth` (m), (points,), in order of time; `contact` (m) is the contact point."""
        deepest = float(depth.max()) - contact
        entering = int(np.argmax(depth >= contact)) if deepest > 0.0 else 0
        first = int(np.argmax(depth >= contact - _APPROACH * deepest)) if deepest > 0.0 else 0
        size = _size(depth[first:], contact, deepest)
        start = first + (entering - first) % size
        return cls(start, size, (len(depth) - start) // size)

    def means(self, values: FloatArray) -> FloatArray:
        """Averages over each block, (..., count), of values at the readings, (..., points)."""
        used = values[..., self.start : self.start + self.size * self.count]
        return np.asarray(used.reshape(*used.shape[:-1], self.count, self.size).mean(axis=-1))


def _size(depth: FloatArray, contact: float, deepest: float) -> int:
    most = -(-len(depth) // _MOST)
    near = np.abs(depth - contact) < _NEAR * deepest
    steps = np.abs(np.diff(depth))[near[1:] | near[:-1]]
    if not steps.size or not steps.max() > 0.0:
        return most
    fine = int(min(_WIDEST * deepest / steps.max(), most))
    return max(fine, -(-len(depth) // _MOST_FINE), 1)


def resolution(force: FloatArray) -> float:
    """Step (N) to which the readings are rounded; zero where hardly any successive readings are equal."""
    steps = np.abs(np.diff(force))
    moved = steps > 1e-9 * float(np.ptp(force))
    if moved.mean() > 1.0 - _REPEATS or not moved.any():
        return 0.0
    return float(np.quantile(steps[moved], 0.05))
