"""The sizes and times of noise, drift and jump that are weighed, and how likely each is before the test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.misfit.linearised import DRIFTS, JUMPS

__all__ = ["Sizes"]


@dataclass(frozen=True)
class Sizes:
    """What is weighed: sizes and times on grids, with their prior probabilities.

    Parameters
    ----------
    times : int
        Correlation times, from two steps of time to three times the record, in equal ratios.
    shares : tuple of float
        Variance of the correlated noise over that of the white.
    drifts, jumps : tuple of float
        Size of a drift of the law and of a jump, over the white noise.
    white, exact, smooth : float
        Prior probability that there is no correlated noise, no drift, no jump.
    """

    times: int = 5
    shares: tuple[float, ...] = (0.1, 1.0, 10.0, 100.0, 1000.0)
    drifts: tuple[float, ...] = (1.0, 5.62, 31.6, 178.0, 1000.0)
    jumps: tuple[float, ...] = (1.0, 4.64, 21.5, 100.0)
    white: float = 0.5
    exact: float = 0.9
    smooth: float = 0.5

    def noises(self, times: Sequence[FloatArray]) -> list[tuple[float, float] | None]:
        """Correlated noises (tau, g) for curves read at `times` (s), after None for white noise alone."""
        shortest = 2.0 * min(float(np.median(np.diff(time))) for time in times)
        longest = 3.0 * max(float(time[-1] - time[0]) for time in times)
        taus = np.geomspace(shortest, longest, self.times)
        return [None, *((float(tau), share) for tau in taus for share in self.shares)]

    @cached_property
    def columns(self) -> FloatArray:
        """Sizes of drift and jump of every combination, (c, 2)."""
        pairs = [(drift, jump) for drift in (0.0, *self.drifts) for jump in (0.0, *self.jumps)]
        return np.array(pairs)

    @staticmethod
    def scale(sizes: tuple[float, float], parameters: int, curves: int) -> FloatArray:
        """Factors on the columns of `Linearised.gram`, residuals left out, for one (drift, jump), (m - 1,)."""
        own = np.repeat(sizes, (DRIFTS, JUMPS))
        return np.concatenate((np.ones(parameters), np.tile(own, curves)))

    def scales(self, parameters: int, curves: int) -> FloatArray:
        """`scale` of every combination, (c, m - 1)."""
        return np.array([self.scale((drift, jump), parameters, curves) for drift, jump in self.columns])

    def scales_of(self, number: int) -> tuple[float, float]:
        """Drift and jump of one combination."""
        drift, jump = self.columns[number]
        return float(drift), float(jump)

    def log_prior(self, noises: int) -> FloatArray:
        """Logarithm of the prior probability of every combination, (noises, c)."""
        noise = np.log(_shared(self.white, noises - 1))
        drift = np.log(_shared(self.exact, len(self.drifts)))
        jump = np.log(_shared(self.smooth, len(self.jumps)))
        return np.asarray(noise[:, None] + (drift[:, None] + jump).ravel())


def _shared(first: float, others: int) -> FloatArray:
    return np.concatenate(([first], np.full(others, (1.0 - first) / max(others, 1))))
