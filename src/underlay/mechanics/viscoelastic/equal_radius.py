"""The last earlier time t1(t) at which the contact had the radius it has at t, for all points of a way out at once.

t1 solves int_{t1}^t e(t - s) w'(s) ds = 0 (Ting 1966). With y_k(t) = int exp(-(t - s) / tau_k) dw(s) this is
F(t1) = V(t), where

    F(t1) = c w(t1) + sum_k weight_k exp(-(t - t1) / tau_k) y_k(t1),   V(t) = c w(t) + sum_k weight_k y_k(t),

and F grows with t1, by e(t - t1) w'(t1). Only decaying exponentials occur.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.viscoelastic.memory import Memory
from underlay.mechanics.viscoelastic.radius_search import Search, at, share_of

__all__ = ["EqualRadius", "equal_radius"]

# Rounds of Newton's method, far beyond need, and the last of its steps over that of the record: what is left after
# it is the square of that, times half a step of the record over the shortest relaxation time.
_ROUNDS = 60
_LAST_STEP = 1e-6
# A step of the record over the shortest relaxation time below which its exponential does not overflow beside what
# is left of older loads.
_LONG_STEP = 300.0


@dataclass(frozen=True)
class EqualRadius:
    """Where on the way in the contact had the radii of the way out.

    The arrays are (m,), for the points of the way out up to the last that is in contact, or (sets, m).

    Parameters
    ----------
    step : ndarray of int
        Step of the record in which t1 lies.
    elapsed : FloatArray
        t1 less the beginning of that step (s).
    share : FloatArray
        The same over that step.
    time : FloatArray
        t1 (s).
    depth : FloatArray
        w(t1) (m), zero without contact.
    held : ndarray of bool
        Which of the points are in contact.
    """

    step: NDArray[np.intp]
    elapsed: FloatArray
    share: FloatArray
    time: FloatArray
    depth: FloatArray
    held: NDArray[np.bool_]

    @property
    def regrowth(self) -> FloatArray:
        """By how much (m) the contact, measured by w(t1), grows again on the way out at most, () or (sets,)."""
        fallen = np.minimum.accumulate(self.depth, axis=-1)
        return np.asarray((self.depth - fallen).max(axis=-1, initial=0.0))


def equal_radius(
    depth: FloatArray, memory: Memory, turn: int, target: FloatArray | None = None
) -> EqualRadius:
    """Find t1 for every point after number `turn`, the last of the way in.

    The step of the record is found by interpolation between some points of the way out, and by trial where that
    misses; the time by Newton's method in the step, over which w is linear.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), (n,), zero before contact but negative after it; or those of many sets, (sets, n).
    memory : Memory
        Their clock.
    turn : int
        Number of the last point of the way in.
    target : FloatArray, optional
        What F is to be at the points of the way out, (m,), for `depth` of the way in alone: with elastic forces in
        the place of depths, the force.
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
    """F within one step of the record for every point of the way out.

    Parameters
    ----------
    memory : Memory
        Clock of all points.
    clock : FloatArray
        Times of the points of the way out (s), (m,).
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

        Over the step it grows by `rise` in all, at the rate `speed` e(t - t1).
        """
        memory, tau, width = self.memory, self.memory.tau, self.width
        constant = memory.modes.constant
        at_low = self.since_turn * self.low_lag
        overflows = bool((width > _LONG_STEP * tau.min()).any())

        def excess(elapsed: FloatArray) -> tuple[FloatArray, FloatArray]:
            """What F has grown, less what it must, and its derivative."""
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
    """Where between 0 and 1 a function has risen by a share of its rise, from its slopes at both ends."""
    usable = (first > 0.0) & (last > 0.0) & (rise > 0.0)
    begin = np.divide(rise, first, out=np.ones_like(rise), where=usable)
    end = np.divide(rise, last, out=np.ones_like(rise), where=usable)
    bent = share + share * (1.0 - share) * ((1.0 - share) * (begin - 1.0) + share * (1.0 - end))
    return np.minimum(np.maximum(bent, 0.0), 1.0)


def _within(
    excess: Callable[[FloatArray], tuple[FloatArray, FloatArray]], width: FloatArray, x: FloatArray
) -> FloatArray:
    """Zeros between 0 and `width`, (..., m), of functions that grow, from `x`: Newton in a shrinking bracket.

    A step that does not halve the one before it is replaced by the middle of the bracket. A function without a
    zero there ends at the nearer end.
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
