"""Integrals over the past, z_k(t) = int exp(-(t - s) / tau_k) dF(s), for all points of a record at once.

Arrays have the exponentials first and the points last; between them, where many parameter sets are asked at once,
the sets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.relaxation import Modes, ModesOfSets, Relaxation
from underlay.mechanics.viscoelastic.clock import Clock

__all__ = ["LastMemory", "Memory"]


@dataclass(frozen=True, eq=False)
class Memory:
    """The exponentials of a relaxation along a record.

    Parameters
    ----------
    modes : Modes or ModesOfSets
        Of the relaxation.
    clock : Clock
        The record's, in units of their times.
    """

    modes: Modes | ModesOfSets
    clock: Clock

    @classmethod
    def of(cls, modes: Modes | ModesOfSets, time: FloatArray) -> Self:
        """Along a record of these times (s), (n,), increasing."""
        return cls(modes, Clock(modes.times, time))

    @property
    def time(self) -> FloatArray:
        """Times (s) of the record, (n,)."""
        return self.clock.time

    @property
    def tau(self) -> FloatArray:
        """Relaxation times (s) beside points, (K, 1), or of sets (K, sets, 1)."""
        return self.clock.tau

    def weighted(self, parts: FloatArray) -> FloatArray:
        """sum_k weight_k parts_k, (..., n)."""
        weights = self.modes.weights
        return np.asarray(weights @ parts if weights.ndim == 1 else (weights * parts).sum(axis=0))

    def integrals(self, values: FloatArray, bend: FloatArray | None = None) -> FloatArray:
        """z_k at every point, (K, ..., n), of a function of time.

        Parameters
        ----------
        values : FloatArray
            At the points, or at the first n of them, (..., n); it was zero before the first.
        bend : FloatArray, optional
            4 times what the function has in the middle of each step over the mean of its ends, (..., n - 1);
            without it the function is linear between points.
        """
        clock, steps = self.clock, slice(values.shape[-1] - 1)
        z = np.empty((len(clock.times), *values.shape))
        z[..., 0] = values[..., 0]
        np.multiply(clock.even[..., steps], values[..., 1:] - values[..., :-1], out=z[..., 1:])
        if bend is not None:
            z[..., 1:] += clock.curved[..., steps] * bend
        return clock.summed(z)

    def integral_slopes(
        self, z: FloatArray, values: FloatArray, bend: FloatArray | None = None
    ) -> FloatArray:
        """dz_k / dtau_k at every point, (K, n), of the integrals `z` of these values, as in `integrals`.

        With x = step / tau_k it obeys the recursion of z_k with x e^-x z_k - d x g1' - c x g2' over tau_k added,
        where x g1' = e^-x - g1 and x g2' = e^-x - g1 - 2 g2.
        """
        clock, steps = self.clock, slice(values.shape[-1] - 1)
        bent = (clock.decay - clock.even)[..., steps]
        added = (clock.steps * clock.decay)[..., steps] * z[..., :-1] - bent * (
            values[..., 1:] - values[..., :-1]
        )
        if bend is not None:
            added -= (bent - 2.0 * clock.curved[..., steps]) * bend
        added /= self.tau
        return clock.summed(np.concatenate((np.zeros((*added.shape[:-1], 1)), added), axis=-1))

    def faded(self, z: FloatArray, number: int) -> FloatArray:
        """sum_k weight_k z_k at the points after number `number`, (..., n), of what z_k, (K, ...), it was there."""
        left, weights = self.clock.since(number), self.modes.weights
        return np.asarray(
            (weights * z) @ left if z.ndim == 1 else (weights * z[..., None] * left).sum(axis=0)
        )

    def hereditary(self, values: FloatArray, bend: FloatArray | None = None) -> FloatArray:
        """int e(t - s) dF(s) at every point, (..., n); the arguments are those of `integrals`."""
        force = self.weighted(self.integrals(values, bend))
        force += self.modes.constant * values
        return force


class LastMemory:
    """The memory of the record that was asked last.

    A fit asks for the same times again and again, with other depths and mostly with other weights.
    """

    def __init__(self) -> None:
        self._last: tuple[Relaxation, Modes, Memory] | None = None

    def of(self, relaxation: Relaxation, time: FloatArray) -> tuple[Modes, Memory]:
        """The modes of a relaxation and their memory, along a record of these times (s), (n,)."""
        clock = None
        if self._last is not None and np.array_equal(self._last[2].time, time):
            known, modes, memory = self._last
            if known is relaxation:
                return modes, memory
            clock = memory.clock
        shortest, longest = float((time[1:] - time[:-1]).min()), float(time[-1] - time[0])
        modes = relaxation.modes(shortest, longest)
        if clock is None or not np.array_equal(clock.times, modes.times):
            clock = Clock(modes.times, time.copy())
        memory = Memory(modes, clock)
        self._last = relaxation, modes, memory
        return modes, memory
