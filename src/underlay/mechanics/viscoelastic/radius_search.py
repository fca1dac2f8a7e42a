"""In which step of the record F(t1) reaches its target, for all points of a way out at once; see `equal_radius`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray

__all__ = ["Search", "at", "share_of"]

# Points of the way out that are compared with all of the way in, by a product of matrices, and how many lie between
# two of which the step is known.
_KNOWN, _APART = 24, 64


def at(values: FloatArray, number: NDArray[np.intp]) -> FloatArray:
    """Values (..., n) at the points `number` (m,), or at those (sets, m) of every set."""
    if number.ndim == 1:
        return values.take(number, axis=-1)
    return np.take_along_axis(values, number[None] if values.ndim > number.ndim else number, axis=-1)


def share_of(part: FloatArray, whole: FloatArray) -> FloatArray:
    """A part over the whole, from 0 to 1; the middle where there is no whole, as rounding may have it."""
    share = np.divide(part, whole, out=np.full_like(whole, 0.5), where=whole > 0.0)
    return np.minimum(np.maximum(share, 0.0), 1.0)


@dataclass(frozen=True)
class Search:
    """F at points of the way in, for points of the way out.

    Parameters
    ----------
    weights, constant : FloatArray
        Of the exponentials, (K, 1) or (K, sets, 1), and what does not relax, () or (sets, 1).
    way_in, at_turn : FloatArray
        w and y_k exp(-(t_turn - t) / tau_k) of the way in, (..., n) and (K, ..., n).
    since_turn, target : FloatArray
        exp(-(t - t_turn) / tau_k) and V of the points of the way out, (K, ..., m) and (..., m).
    """

    weights: FloatArray
    constant: FloatArray
    way_in: FloatArray
    at_turn: FloatArray
    since_turn: FloatArray
    target: FloatArray

    def some(self, points: NDArray[np.intp]) -> Search:
        """The search for some points of the way out."""
        since_turn, target = self.since_turn.take(points, axis=-1), self.target.take(points, axis=-1)
        return replace(self, since_turn=since_turn, target=target)

    def brackets(self) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
        """The steps in which F reaches the target: numbers of their ends, each (..., m), and F there."""
        last = self.way_in.shape[-1] - 1
        low = np.minimum(np.maximum(np.floor(self.reached()).astype(np.intp), 0), last - 1)
        for moved in (True, False):
            high = low + 1
            at_low, at_high = self._level(low), self._level(high)
            early, late = at_low >= self.target, at_high < self.target
            missed = early | late
            if not missed.any():
                return low, high, at_low, at_high
            if moved:
                # Mostly the step beside it is the one.
                low = np.minimum(np.maximum(low + late - early, 0), last - 1)
        columns = np.flatnonzero(missed if missed.ndim == 1 else missed.any(axis=0))
        found = self.some(columns)._searched(low[..., columns])  # noqa: SLF001  of the same class
        low[..., columns], high[..., columns], at_low[..., columns], at_high[..., columns] = found
        return low, high, at_low, at_high

    def _searched(
        self, guess: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
        """The same by trial: further and further from the guess, and at last by halves."""
        low, high = np.zeros_like(guess), np.full_like(guess, self.way_in.shape[-1] - 1)
        at_low, at_high, reach = self._level(low), self._level(high), 1
        while True:
            # A bracket of one step is left as it is: there the guess is its lower end.
            guess = np.minimum(np.maximum(guess, low + 1), np.maximum(high - 1, low))
            now = self._level(guess)
            later, inside = now < self.target, guess > low
            up, down = later & inside, ~later & inside
            low, at_low = np.where(up, guess, low), np.where(up, now, at_low)
            high, at_high = np.where(down, guess, high), np.where(down, now, at_high)
            if (high - low <= 1).all():
                return low, high, at_low, at_high
            middle = (low + high) // 2
            guess = np.where(later, np.minimum(low + reach, middle), np.maximum(high - reach, middle))
            reach *= 2

    def _level(self, number: NDArray[np.intp]) -> FloatArray:
        """F at points of the record, (..., m)."""
        parts = at(self.at_turn, number)
        parts *= self.since_turn
        weights = self.weights
        total = weights[:, 0] @ parts if weights.ndim == 2 else (weights * parts).sum(axis=0)
        return np.asarray(self.constant * at(self.way_in, number) + total)

    def reached(self) -> FloatArray:
        """About where F reaches the target, in steps of the record, (..., m).

        Few points of the way out are compared with all of the way in; many lie between some of them.
        """
        count = self.target.shape[-1]
        if count <= _KNOWN:
            return self._compared()
        # Closer together after the turn, where t1 changes most.
        share = np.linspace(0.0, 1.0, max(count // _APART, _KNOWN))
        points = (share * share * (count - 1)).astype(np.intp)
        points = points[np.append(True, points[1:] > points[:-1])]
        some = self.some(points)
        if len(points) <= _KNOWN:
            known = some.reached()
        else:
            low, _, at_low, at_high = some.brackets()
            known = low + share_of(some.target - at_low, at_high - at_low)
        every = np.arange(count)
        before = np.minimum(points.searchsorted(every, side="right"), len(points) - 1) - 1
        between = (every - points[before]) / (points[1:] - points[:-1])[before]
        first = known.take(before, axis=-1)
        return np.asarray(first + between * (known.take(before + 1, axis=-1) - first))

    def _compared(self) -> FloatArray:
        """The same by comparing every point with all of the way in."""
        upright = self.at_turn * self.weights
        if upright.ndim == 2:
            levels = self.since_turn.T @ upright + self.constant * self.way_in
        else:
            levels = self.since_turn.transpose(1, 2, 0) @ upright.transpose(1, 0, 2)
            levels += (self.constant * self.way_in)[:, None, :]
        # The first point at which F is not below the target ends the step.
        high = np.maximum((levels < self.target[..., None]).argmin(axis=-1), 1)[..., None]
        at_low, at_high = (np.take_along_axis(levels, high - back, axis=-1)[..., 0] for back in (1, 0))
        return np.asarray(high[..., 0] - 1 + share_of(self.target - at_low, at_high - at_low))
