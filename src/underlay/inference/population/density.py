"""The posterior of a mean on places of its logarithm, its quantiles, and that of a difference of two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["Density"]

# Share of the largest below which a place holds nothing, and places of a difference.
_NOTHING, _DIFFERENCES = 1e-10, 1600


@dataclass(frozen=True)
class Density:
    """Posterior density of ln of a mean over places (x,), and its share per cell."""

    x: FloatArray
    shares: FloatArray

    def quantile(self, shares: FloatArray) -> FloatArray:
        """Quantiles, same shape as `shares`; infinite where the density still stands at the end of the places."""
        below = np.cumsum(self.shares)
        edges = np.concatenate([0.5 * (self.x[1:] + self.x[:-1]), [self.x[-1]]])
        places = np.interp(shares, below, edges)
        places = np.where(shares < below[0], -np.inf, places)
        return np.where(shares > below[-2], np.inf, places)

    @property
    def _held(self) -> tuple[FloatArray, FloatArray]:
        """Places from the first to the last that holds anything, and their shares."""
        some = np.flatnonzero(self.shares > _NOTHING * self.shares.max())
        held = slice(some[0], some[-1] + 1)
        return self.x[held], self.shares[held]

    def minus(self, other: Density) -> Density:
        """Density of the difference of two independent ones."""
        (mine, own), (theirs, others) = self._held, other._held
        low, high = mine[0] - theirs[-1], mine[-1] - theirs[0]
        step = (high - low) / _DIFFERENCES
        shares = np.convolve(_evenly(mine, own, step), _evenly(-theirs[::-1], others[::-1], step))
        return Density(low + step * np.arange(len(shares)), shares)


def _evenly(x: FloatArray, shares: FloatArray, step: float) -> FloatArray:
    """Shares of even places from the first on: each goes to its two neighbours, so that the mean stays."""
    cells = (x - x[0]) / step
    below = cells.astype(int)
    part = cells - below
    size = int(below[-1]) + 2
    lower = np.bincount(below, shares * (1.0 - part), size)
    upper = np.bincount(below + 1, shares * part, size)
    return np.asarray(lower + upper, dtype=np.float64)
