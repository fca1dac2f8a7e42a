"""Integrals over the past, z_k(t) = int exp(-(t - s) / tau_k) dF(s), for all points of a record at once.

`Clock` holds the times of a record in units of every relaxation time tau_k: the part of such integrals that depends
on the times alone. `Memory` adds the weights of a relaxation, and integrates functions F given at the points of the
record. Arrays have the exponentials first and the points last; parameter sets, where there are many, are between
them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.relaxation import Modes, ModesOfSets, Relaxation

# Below, the closed form of g2 loses digits: 3e-15 at 0.3; the series of 12 terms leaves 1e-17 there.
_SERIES_BELOW = 0.3
#: g2(x) = sum_{n >= 1} (-x)^n / n! [2 / (n + 2) - 1 / (n + 1)], the highest power first.
_SERIES = [(2.0 / (n + 2) - 1.0 / (n + 1)) / math.factorial(n) for n in range(12, -1, -1)]
# Of steps this short as many terms of it leave 1e-14.
_SHORT = ((0.03, 8), (0.12, 10))
# Steps that differ by less than this part are one: it moves e(t) by no more.
_EQUAL = 1e-9
# Products of decays smaller than this no longer show beside 1.
_FORGOTTEN = 1e-18
# Relaxation times in a record up to which exp(t / tau) and its inverse stay far inside of what floats hold.
_LONG = 500.0
# Powers of one number are products of two shorter rows of them.
_ROW = 32


def even(x: FloatArray) -> FloatArray:
    """g1(x) = (1 - e^-x)/x: share left after a step of x relaxation times of a load that rose linearly over it."""
    near = x < np.finfo(float).tiny
    if not near.any():
        return np.asarray(-np.expm1(-x) / x)
    safe = np.where(near, 1.0, x)
    return np.where(near, 1.0, -np.expm1(-safe) / safe)


def curved(x: FloatArray, g1: FloatArray) -> FloatArray:
    """g2(x) = 2 [1 - e^-x (1 + x)]/x^2 - g1(x): the same share for the part of a load quadratic in time.

    `g1` is `even(x)`.
    """
    near = x < _SERIES_BELOW
    if near.all():
        longest = float(x.max(initial=0.0))
        count = next((count for short, count in _SHORT if longest < short), len(_SERIES))
        return _polynomial(_SERIES[-count:], -x)
    safe = np.where(near, 1.0, x)
    far = 2.0 * (g1 - np.exp(-safe)) / safe - g1
    return np.where(near, _polynomial(_SERIES, np.where(near, -x, 0.0)), far)


def _polynomial(terms: list[float], x: FloatArray) -> FloatArray:
    """Horner's rule for coefficients of decreasing powers, in place: half the time of `numpy.polyval`."""
    value = np.full_like(x, terms[0])
    for term in terms[1:]:
        value *= x
        value += term
    return value


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of a record in units of every relaxation time.

    Parameters
    ----------
    times : FloatArray
        Relaxation times (s), (K,), or for parameter sets (K, sets, 1).
    time : FloatArray
        Times (s) of the record, (n,), increasing.
    """

    times: FloatArray
    time: FloatArray

    @cached_property
    def tau(self) -> FloatArray:
        """Relaxation times (s) with an axis for the points: (K, 1), or for parameter sets (K, sets, 1)."""
        return self.times[:, None] if self.times.ndim == 1 else self.times

    @cached_property
    def _gaps(self) -> FloatArray:
        """Time steps (s) between points, (n - 1,), or (1,) where all are equal."""
        gaps = self.time[1:] - self.time[:-1]
        if gaps.max() - gaps.min() <= _EQUAL * gaps[0]:
            return np.array([(self.time[-1] - self.time[0]) / len(gaps)])
        return gaps

    @cached_property
    def steps(self) -> FloatArray:
        """Time steps over relaxation times, (K, ..., n - 1), or (K, ..., 1) where all steps are equal."""
        return np.asarray(self._gaps / self.tau)

    @cached_property
    def decay(self) -> FloatArray:
        """Share of an exponential left after each step, exp(-step/tau), of the shape of `steps`."""
        return np.exp(-self.steps)

    @cached_property
    def even(self) -> FloatArray:
        """g1 = (1 - e^-x)/x of each time step of x relaxation times, of the shape of `steps`."""
        return even(self.steps)

    @cached_property
    def curved(self) -> FloatArray:
        """g2 (see `curved`) of each step, of the shape of `steps`."""
        return curved(self.steps, self.even)

    @cached_property
    def _decays(self) -> FloatArray:
        """Share of each exponential left after 0, 1, 2, ... equal steps, (K, ..., n)."""
        count = len(self.time)
        inner = np.exp(-self.steps * np.arange(_ROW))
        outer = np.exp(-self.steps * np.arange(0, count, _ROW))
        powers = outer[..., :, None] * inner[..., None, :]
        return powers.reshape(*self.steps.shape[:-1], -1)[..., :count]

    def since(self, number: int) -> FloatArray:
        """exp(-(t - t_number)/tau) at every point after number `number`, (K, ..., n - number - 1)."""
        later = slice(number + 1, None)
        if self._gaps.size == 1:
            return np.asarray(self._decays[..., 1 : len(self.time) - number])
        return np.asarray(np.exp((self.time[number] - self.time[later]) / self.tau))

    def lags(self, number: int) -> FloatArray:
        """exp(-|t - t_number| / tau) at every point of the record, (K, ..., n)."""
        if self._gaps.size == 1:
            powers = self._decays
            return np.concatenate((powers[..., number:0:-1], powers[..., : len(self.time) - number]), axis=-1)
        return np.asarray(np.exp(-np.abs(self.time - self.time[number]) / self.tau))

    @cached_property
    def _slow(self) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
        """Mask (K, ...) of exponentials whose exp(t/tau) does not overflow, that factor, and its inverse."""
        total = (self.time[-1] - self.time[0]) / self.tau
        slow = total[..., 0] < _LONG
        regular = self._gaps.size == 1
        left = self._decays[slow] if regular else np.exp((self.time[0] - self.time) / self.tau[slow])
        return slow, 1.0 / left, left

    @cached_property
    def _grown_and_left(self) -> tuple[FloatArray, FloatArray] | None:
        """exp(t/tau) and its inverse, each (K, ..., n); None if it would overflow for any exponential."""
        slow, *both = self._slow
        if not slow.all():
            return None
        grown, left = (part.reshape(*slow.shape, -1) for part in both)
        return grown, left

    def summed(self, z: FloatArray) -> FloatArray:
        """Solve z_{n+1} = decay_n z_n + added_n, in place; `z` (K, ..., n) holds z_0 and the terms added.

        z exp(t / tau) is a cumulative sum of the terms. Where that factor would overflow, only the last steps of
        the past matter, and the sum is done in passes that each look back twice as far.
        """
        count = z.shape[-1]
        if self._grown_and_left is not None:
            grown, left = self._grown_and_left
            z *= grown[..., :count]
            np.add.accumulate(z, axis=-1, out=z)
            z *= left[..., :count]
            return z
        slow, *rows = self._slow
        grown, left = (row[:, :count] for row in rows)
        if slow.any():
            z[slow] = np.add.accumulate(z[slow] * grown, axis=-1) * left
        z[~slow] = _doubled(z[~slow], self.decay[~slow][:, : count - 1])
        return z


def _doubled(z: FloatArray, decay: FloatArray) -> FloatArray:
    """Solve the recursion of `Clock.summed` for rows (r, n), in passes that each double how far back they look."""
    factor, reach = np.broadcast_to(decay, (len(z), z.shape[1] - 1)), 1
    while reach < z.shape[1]:
        # The right-hand side is computed before it is stored: no pass sees its own results.
        z[:, reach:] += factor * z[:, :-reach]
        # factor[:, i] is the decay over the `reach` steps that end at point i + reach.
        factor = factor[:, reach:] * factor[:, :-reach]
        reach *= 2
        if factor.max(initial=0.0) < _FORGOTTEN:
            break
    return z


@dataclass(frozen=True, eq=False)
class Memory:
    """Hereditary integrals of a relaxation along a record.

    Parameters
    ----------
    modes : Modes or ModesOfSets
        Of the relaxation.
    clock : Clock
        Times of the record in units of the relaxation times.
    """

    modes: Modes | ModesOfSets
    clock: Clock

    @classmethod
    def of(cls, modes: Modes | ModesOfSets, time: FloatArray) -> Self:
        """Memory of a relaxation with these modes along a record with times (s), (n,), increasing."""
        return cls(modes, Clock(modes.times, time))

    @property
    def time(self) -> FloatArray:
        """Times (s) of the record, (n,)."""
        return self.clock.time

    @property
    def tau(self) -> FloatArray:
        """Relaxation times (s) with an axis for the points: (K, 1), or for parameter sets (K, sets, 1)."""
        return self.clock.tau

    def weighted(self, parts: FloatArray) -> FloatArray:
        """Sum over the exponentials of their weights times `parts` (K, ..., n): shape (..., n)."""
        weights = self.modes.weights
        return np.asarray(weights @ parts if weights.ndim == 1 else (weights * parts).sum(axis=0))

    def integrals(self, values: FloatArray, bend: FloatArray | None = None) -> FloatArray:
        """z_k = int exp(-(t - s)/tau_k) dF(s) at every point, (K, ..., n), of a function F of time.

        Parameters
        ----------
        values : FloatArray
            F at the points, or at the first n of them, (..., n); zero before the first.
        bend : FloatArray, optional
            4 times the excess of F in the middle of each step over the mean of its ends, (..., n - 1);
            without it F is linear between points.
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
        """dz_k / dtau_k at every point, (K, n), of the integrals `z` that `integrals` gives for these arguments.

        With x = step / tau_k it obeys the recursion of z_k with x e^-x z_k - d x g1' - c x g2' over tau_k added,
        where x g1' = e^-x - g1 and x g2' = e^-x - g1 - 2 g2, d is the step of F and c its bend.

        z_k is int exp(-(t - s)/tau_k) dF(s), F the function of time.
        """
        clock, steps = self.clock, slice(values.shape[-1] - 1)
        gap = (clock.decay - clock.even)[..., steps]
        added = (clock.steps * clock.decay)[..., steps] * z[..., :-1] - gap * (
            values[..., 1:] - values[..., :-1]
        )
        if bend is not None:
            added -= (gap - 2.0 * clock.curved[..., steps]) * bend
        added /= self.tau
        return clock.summed(np.concatenate((np.zeros((*added.shape[:-1], 1)), added), axis=-1))

    def faded(self, z: FloatArray, number: int) -> FloatArray:
        """sum_k weight_k z_k at the points after number `number`, (..., n), if nothing is added after it.

        `z`, (K, ...), are the integrals z_k at that point.

        z_k is int exp(-(t - s)/tau_k) dF(s), F the function of time.
        """
        left, weights = self.clock.since(number), self.modes.weights
        return np.asarray(
            (weights * z) @ left if z.ndim == 1 else (weights * z[..., None] * left).sum(axis=0)
        )

    def hereditary(self, values: FloatArray, bend: FloatArray | None = None) -> FloatArray:
        """int e(t - s) dF(s) at every point, (..., n), e the relaxation function; arguments as for `integrals`."""
        force = self.weighted(self.integrals(values, bend))
        force += self.modes.constant * values
        return force


class LastMemory:
    """Cache of the memory of the last record.

    A fit evaluates the same times again and again, with other depths and mostly with other weights.
    """

    def __init__(self) -> None:
        self._last: tuple[Relaxation, Modes, Memory] | None = None

    def of(self, relaxation: Relaxation, time: FloatArray) -> tuple[Modes, Memory]:
        """Modes of a relaxation, and their memory along a record with these times (s), (n,)."""
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
