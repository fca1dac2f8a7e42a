"""The posterior of a mean on places of its logarithm, its quantiles, and that of a difference of two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["Density"]

# Share of the largest below which a place holds nothing, and places of a difference.
_NOTHING, _DIFFERENCES = 1e-10, 1602


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
        at = np.linspace(low, high, _DIFFERENCES)
        differences = (mine[:, None] - theirs[None, :]).ravel()
        cells = np.rint((differences - low) / (at[1] - at[0])).astype(int)
        shares = np.bincount(cells, np.outer(own, others).ravel(), minlength=len(at))
        return Density(at, np.asarray(shares, dtype=np.float64))
