"""Integrals over the past, z_k(t) = int exp(-(t - s) / tau_k) dF(s), for all points of a record at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.relaxation import Modes

__all__ = ["Memory", "curved", "even"]

# Below, the closed form of g2 loses digits: 3e-15 at 0.3; the series of 12 terms leaves 1e-17 there.
_SERIES_BELOW = 0.3
#: g2(x) = sum_{n >= 1} (-x)^n / n! [2 / (n + 2) - 1 / (n + 1)], the highest power first.
_SERIES = [(2.0 / (n + 2) - 1.0 / (n + 1)) / math.factorial(n) for n in range(12, -1, -1)]
# Below this the first terms of it do: the next is 1e-17 of the first.
_SHORT, _SHORT_TERMS = 0.03, 9
# Steps that differ by less than this part are one: it moves e(t) by no more.
_EQUAL = 1e-9
# Products of decays smaller than this no longer show beside 1.
_FORGOTTEN = 1e-18


def even(x: FloatArray) -> FloatArray:
    """g1(x) = (1 - e^-x) / x: what is left of a load that rose evenly over a step of x relaxation times."""
    near = x < np.finfo(float).tiny
    safe = np.where(near, 1.0, x)
    return np.where(near, 1.0, -np.expm1(-safe) / safe)


def curved(x: FloatArray, g1: FloatArray) -> FloatArray:
    """g2(x) = 2 [1 - e^-x (1 + x)] / x^2 - g1(x): the same of the part quadratic in time."""
    near = x < _SERIES_BELOW
    if near.all():
        # Of steps this short the higher powers are below the rounding of the first.
        terms = _SERIES[-_SHORT_TERMS:] if x.max(initial=0.0) < _SHORT else _SERIES
        return np.asarray(np.polyval(terms, -x), dtype=np.float64)
    safe = np.where(near, 1.0, x)
    far = 2.0 * (g1 - np.exp(-safe)) / safe - g1
    return np.where(near, np.polyval(_SERIES, np.where(near, -x, 0.0)), far)


@dataclass(frozen=True)
class Memory:
    """The record's clock in units of every relaxation time.

    Parameters
    ----------
    modes : Modes
        Of the relaxation.
    time : FloatArray
        Times (s), (n,), increasing.
    """

    modes: Modes
    time: FloatArray

    @cached_property
    def steps(self) -> FloatArray:
        """Steps over relaxation times, (K, n - 1), or (K, 1) where all steps are equal."""
        steps = np.diff(self.time)
        if np.ptp(steps) <= _EQUAL * steps[0]:
            steps = np.array([(self.time[-1] - self.time[0]) / len(steps)])
        return np.asarray(steps / self.modes.times[:, None])

    @cached_property
    def decay(self) -> FloatArray:
        """What is left after each step, of the shape of `steps`."""
        return np.exp(-self.steps)

    @cached_property
    def even(self) -> FloatArray:
        """g1 of each step, of the shape of `steps`."""
        return even(self.steps)

    @cached_property
    def curved(self) -> FloatArray:
        """g2 of each step, of the shape of `steps`."""
        return curved(self.steps, self.even)

    def integrals(self, values: FloatArray, middle: FloatArray | None = None) -> FloatArray:
        """z_k at every point, (K, n), of a function of time.

        Parameters
        ----------
        values : FloatArray
            At the points, (n,), or (K, n) where every exponential has a function of its own; it was zero before
            the first.
        middle : FloatArray, optional
            At the middle of each step, (..., n - 1); without it the function is linear between points.
        """
        added = self.even * np.diff(values)
        if middle is not None:
            added += self.curved * (4.0 * middle - 2.0 * (values[..., 1:] + values[..., :-1]))
        return self._summed(added, values[..., 0])

    def integral_slopes(
        self, z: FloatArray, values: FloatArray, middle: FloatArray | None = None
    ) -> FloatArray:
        """dz_k / dtau_k at every point, (K, n), of the integrals `z` of these values, as in `integrals`.

        With x = step / tau_k it obeys the recursion of z_k with x e^-x z_k - d x g1' - c x g2' over tau_k added,
        where x g1' = e^-x - g1 and x g2' = e^-x - g1 - 2 g2.
        """
        bent = self.decay - self.even
        added = self.steps * self.decay * z[:, :-1] - bent * np.diff(values)
        if middle is not None:
            added -= (bent - 2.0 * self.curved) * (4.0 * middle - 2.0 * (values[1:] + values[:-1]))
        return self._summed(added / self.modes.times[:, None], np.zeros(()))

    def hereditary(self, values: FloatArray, middle: FloatArray | None = None) -> FloatArray:
        """int e(t - s) dF(s) at every point, (n,); the arguments are those of `integrals`."""
        return np.asarray(self.modes.constant * values + self.modes.weights @ self.integrals(values, middle))

    def _summed(self, added: FloatArray, start: FloatArray) -> FloatArray:
        """Solve z_{n+1} = decay_n z_n + added_n from z_0 = `start`, (K, n).

        Only decaying factors occur, so no step is too long or too short.
        """
        z = np.empty((added.shape[0], added.shape[1] + 1))
        z[:, 0], z[:, 1:] = start, added
        if self.steps.shape[1] == 1:
            return _filtered(z, self.decay[:, 0])
        factor, reach = self.decay, 1
        # Each of log2(n) passes doubles how far back a point has seen.
        while reach < z.shape[1]:
            # The right-hand side is computed before it is stored: no pass sees its own results.
            z[:, reach:] += factor * z[:, :-reach]
            # factor[:, i] is the decay over the `reach` steps that end at point i + reach.
            factor = factor[:, reach:] * factor[:, :-reach]
            reach *= 2
            if factor.max(initial=0.0) < _FORGOTTEN:
                break
        return z


def _filtered(z: FloatArray, decay: FloatArray) -> FloatArray:
    """The same for equal steps, a filter for each row: four times as fast."""
    from scipy.signal import lfilter  # noqa: PLC0415  as long to load as all of the mechanics; only here

    for row, factor in zip(z, decay, strict=True):
        row[:] = lfilter([1.0], [1.0, -factor], row)
    return z
