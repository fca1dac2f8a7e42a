"""For each point of unloading, the last earlier time t1(t) at which the contact had the same radius.

t1 solves int_{t1}^t e(t - s) w'(s) ds = 0 (Ting 1966), with w the depth and e = c + sum_k weight_k exp(-t / tau_k)
the relaxation function. With y_k(t) = int exp(-(t - s) / tau_k) dw(s) this is F(t1) = V(t), where

    F(t1) = c w(t1) + sum_k weight_k exp(-(t - t1) / tau_k) y_k(t1),   V(t) = c w(t) + sum_k weight_k y_k(t),

and F grows with t1, by e(t - t1) w'(t1). Only decaying exponentials occur. `Search` finds in which step of the
record F(t1) reaches its target, and `equal_radius` where in the step. "Way in" and "way out" are loading and
unloading: the points up to the last maximum of the depth, and those after it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.viscoelastic.memory import Memory

# Points of the way out that are compared with all of the way in, by a product of matrices, and how many lie between
# two of which the step is known.
_KNOWN, _APART = 24, 64
# Rounds of Newton's method, far beyond need, and the last of its steps over that of the record: what is left after
# it is the square of that, times half a step of the record over the shortest relaxation time.
_ROUNDS = 60
_LAST_STEP = 1e-6
# A step of the record over the shortest relaxation time below which its exponential does not overflow beside what
# is left of older loads.
_LONG_STEP = 300.0


def at(values: FloatArray, number: NDArray[np.intp]) -> FloatArray:
    """Entries of `values` (..., n) at the indices `number` (m,), or (sets, m) for each set its own."""
    if number.ndim == 1:
        return values.take(number, axis=-1)
    return np.take_along_axis(values, number[None] if values.ndim > number.ndim else number, axis=-1)


def share_of(part: FloatArray, whole: FloatArray) -> FloatArray:
    """part/whole, limited to [0, 1]; 0.5 where `whole` is not positive, as rounding may make it."""
    share = np.divide(part, whole, out=np.full_like(whole, 0.5), where=whole > 0.0)
    return np.minimum(np.maximum(share, 0.0), 1.0)


@dataclass(frozen=True)
class Search:
    """Search for the time t1 at which F (module's head) reaches its target, for all points of unloading.

    t1 is the time during loading at which the contact had the same radius.

    Parameters
    ----------
    weights, constant : FloatArray
        Of the exponentials, (K, 1) or (K, sets, 1), and the part that does not relax, () or (sets, 1).
    way_in, at_turn : FloatArray
        w and y_k exp(-(t_turn - t) / tau_k) during loading, (..., n) and (K, ..., n).
    since_turn, target : FloatArray
        exp(-(t - t_turn) / tau_k) and V at the points of unloading, (K, ..., m) and (..., m).
    """

    weights: FloatArray
    constant: FloatArray
    way_in: FloatArray
    at_turn: FloatArray
    since_turn: FloatArray
    target: FloatArray

    def some(self, points: NDArray[np.intp]) -> Search:
        """The search for a selection of the points of unloading, by their indices."""
        since_turn, target = self.since_turn.take(points, axis=-1), self.target.take(points, axis=-1)
        return replace(self, since_turn=since_turn, target=target)

    def brackets(self) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
        """Indices of both ends of the step in which F reaches the target, each (..., m), and F at these ends."""
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
        """Steps as `brackets` returns them, by trial: ever further from the guess `guess`, then by bisection."""
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
        """F at the points of loading with these indices, (..., m)."""
        parts = at(self.at_turn, number)
        parts *= self.since_turn
        weights = self.weights
        total = weights[:, 0] @ parts if weights.ndim == 2 else (weights * parts).sum(axis=0)
        return np.asarray(self.constant * at(self.way_in, number) + total)

    def reached(self) -> FloatArray:
        """Approximate place where F reaches the target, as a fractional index of the record, (..., m).

        Some points of unloading are compared with all of loading; the others are interpolated between these.
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
        """Places as `reached` returns them, by comparing every point of unloading with all points of loading."""
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


@dataclass(frozen=True)
class EqualRadius:
    """Times t1 during loading at which the contact had the radii it has during unloading.

    The arrays are (m,), for the points of unloading up to the last that is in contact, or (sets, m).

    Parameters
    ----------
    step : ndarray of int
        Index of the step of the record in which t1 lies.
    elapsed : FloatArray
        Time (s) from the beginning of that step to t1.
    share : FloatArray
        The same over the length of the step.
    time : FloatArray
        t1 (s).
    depth : FloatArray
        w(t1) (m), zero without contact.
    held : ndarray of bool
        Whether the point is in contact.
    """

    step: NDArray[np.intp]
    elapsed: FloatArray
    share: FloatArray
    time: FloatArray
    depth: FloatArray
    held: NDArray[np.bool_]

    @property
    def regrowth(self) -> FloatArray:
        """Largest amount (m) by which the contact, measured by w(t1), grows again in unloading; () or (sets,).

        t1 is the time during loading at which the contact had the same radius.
        """
        fallen = np.minimum.accumulate(self.depth, axis=-1)
        return np.asarray((self.depth - fallen).max(axis=-1, initial=0.0))


def equal_radius(
    depth: FloatArray, memory: Memory, turn: int, target: FloatArray | None = None
) -> EqualRadius:
    """Find t1 for every point after number `turn`, the last of loading.

    The step of the record is found by interpolation between some points of unloading, and by trial where that
    misses; the time by Newton's method in the step, over which w is linear.

    t1 is the time during loading at which the contact had the same radius.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), (n,), zero before contact but negative after it; or those of many sets, (sets, n).
    memory : Memory
        Of the relaxation, along the record.
    turn : int
        Index of the last point of loading.
    target : FloatArray, optional
        Values that F must reach at the points of unloading, (m,); `depth` then has the loading alone. Used with
        elastic forces in place of depths, where the target is the force.
    """
    modes, time = memory.modes, memory.time
    way_in = depth[..., : turn + 1]
    if target is None:
        y = memory.integrals(depth)
        target = modes.constant * depth[..., turn + 1 :] + memory.weighted(y[..., turn + 1 :])
    else:
        y = memory.integrals(way_in)
    # exp(-(t - t1) / tau) is the product of what is left at the turn and after it, decaying factors both.
    lags = memory.clock.lags(turn)
    before_turn, since_turn = lags[..., : turn + 1], lags[..., turn + 1 :]
    at_turn = before_turn * y[..., : turn + 1]
    at_first = modes.constant * way_in[..., :1] + memory.weighted(since_turn * at_turn[..., :1])
    touching = at_first < target
    last = int(np.flatnonzero(touching if touching.ndim == 1 else touching.any(axis=0)).max(initial=-1)) + 1
    if not last:
        none = np.zeros((*way_in.shape[:-1], 0))
        return EqualRadius(none.astype(np.intp), none, none, none, none, none.astype(bool))
    touching, target, since_turn = touching[..., :last], target[..., :last], since_turn[..., :last]
    weights = modes.weights[:, None] if modes.weights.ndim == 1 else modes.weights
    search = Search(weights, np.asarray(modes.constant), way_in, at_turn, since_turn, target)
    low, high, at_low, at_high = search.brackets()
    clock = time[turn + 1 : turn + 1 + last]
    within = _Step(
        memory, clock, since_turn, at(before_turn, low), at(before_turn, high), time[low], time[high]
    )
    start = at(way_in, low)
    speed = (at(way_in, high) - start) / within.width
    elapsed = within.solved(target - at_low, at_high - at_low, speed)
    reached = start + speed * elapsed
    held = touching & (reached > 0.0)
    reached, share = np.where(held, reached, 0.0), elapsed / within.width
    return EqualRadius(low, elapsed, share, within.begins + elapsed, reached, held)


@dataclass(frozen=True)
class _Step:
    """F (module's head) within one step of the record for every point of unloading.

    Parameters
    ----------
    memory : Memory
        Of the relaxation, along the record.
    clock : FloatArray
        Times of the points of unloading (s), (m,).
    since_turn : FloatArray
        exp(-(t - t_turn) / tau), (K, ..., m).
    low_lag, high_lag : FloatArray
        exp(-(t_turn - t_i) / tau) at the two ends of the step, (K, ..., m).
    begins, ends : FloatArray
        Times of these (s), (..., m).
    """

    memory: Memory
    clock: FloatArray
    since_turn: FloatArray
    low_lag: FloatArray
    high_lag: FloatArray
    begins: FloatArray
    ends: FloatArray

    @cached_property
    def width(self) -> FloatArray:
        """Lengths of the steps (s)."""
        return self.ends - self.begins

    def solved(self, missing: FloatArray, rise: FloatArray, speed: FloatArray) -> FloatArray:
        """Time (s) from the beginning of the step to where F has grown by `missing`.

        Over the step F grows by `rise` in all, at the rate `speed` e(t - t1), `speed` being dw/dt (m/s).

        t1 is the time during loading at which the contact had the same radius.
        """
        memory, tau, width = self.memory, self.memory.tau, self.width
        constant = memory.modes.constant
        at_low = self.since_turn * self.low_lag
        overflows = bool((width > _LONG_STEP * tau.min()).any())

        def excess(elapsed: FloatArray) -> tuple[FloatArray, FloatArray]:
            """Growth of F since the beginning of the step minus the growth wanted, and its derivative in time."""
            part = elapsed / tau
            if overflows:
                left = np.exp(part - (self.clock - self.begins) / tau)
                grown = left * -np.expm1(-part)
            else:
                # exp(part) - 1 times what is left at the beginning of the step.
                grown = at_low * np.expm1(part)
                left = at_low + grown
            rate = constant + memory.weighted(left)
            return speed * (constant * elapsed + memory.weighted(tau * grown)) - missing, speed * rate

        first = speed * (constant + memory.weighted(at_low)) * width
        last = speed * (constant + memory.weighted(self.since_turn * self.high_lag)) * width
        start = _inverse_cubic(share_of(missing, rise), rise, first, last)
        return _within(excess, width, width * start)


def _inverse_cubic(share: FloatArray, rise: FloatArray, first: FloatArray, last: FloatArray) -> FloatArray:
    """Place in [0, 1] at which a function has risen by `share` of its `rise`, from its slopes at both ends."""
    usable = (first > 0.0) & (last > 0.0) & (rise > 0.0)
    begin = np.divide(rise, first, out=np.ones_like(rise), where=usable)
    end = np.divide(rise, last, out=np.ones_like(rise), where=usable)
    place = share + share * (1.0 - share) * ((1.0 - share) * (begin - 1.0) + share * (1.0 - end))
    return np.minimum(np.maximum(place, 0.0), 1.0)


def _within(
    excess: Callable[[FloatArray], tuple[FloatArray, FloatArray]], width: FloatArray, x: FloatArray
) -> FloatArray:
    """Roots in [0, `width`], (..., m), of increasing functions, by Newton's method in brackets, from `x`.

    A step that does not halve the one before it is replaced by the middle of the bracket. A function without a
    root there ends at the nearer end.
    """
    first, last = np.zeros_like(width), width.copy()
    before = width.copy()
    open_ = np.ones(width.shape, dtype=bool)
    for _ in range(_ROUNDS):
        value, slope = excess(x)
        low = value < 0.0
        first, last = np.where(low, x, first), np.where(low, last, x)
        step = np.divide(value, slope, out=np.zeros_like(value), where=slope > 0.0)
        newton = np.minimum(np.maximum(x - step, first), last)
        quick = 2.0 * np.abs(newton - x) <= before
        proposal = np.where(quick, newton, 0.5 * (first + last))
        before = np.abs(proposal - x)
        x = np.where(open_, proposal, x)
        open_ &= before > _LAST_STEP * width
        if not open_.any():
            break
    return x
