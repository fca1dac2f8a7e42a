"""The force after a maximum, by the equal radius on the way in (Ting 1966).

With t1(t) the last earlier time at which the contact had the radius it has at t,

    int_{t1}^t e(t - s) w'(s) ds = 0,    P(t) = int_0^{t1} e(t - s) dP_el(w(s)),

and the contact is lost where the first integral is not positive from the first contact on. t1 depends on the
motion alone: it is the same for every tip and every layer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.response import Elastic
from underlay.mechanics.viscoelastic.loading import loads
from underlay.mechanics.viscoelastic.memory import Memory, curved, even

__all__ = ["EqualRadius", "Unloading", "equal_radius"]

# Rounds of false position, far beyond need, and the part of a step to which it goes.
_ROUNDS = 60
_LAST_DIGITS = 1e-13


@dataclass(frozen=True)
class EqualRadius:
    """Where on the way in the contact had the radii of the way out.

    Parameters
    ----------
    step : ndarray of int (m,)
        Step of the record in which t1 lies, for every point in contact.
    elapsed : FloatArray
        t1 less the beginning of that step (s), (m,).
    depth : FloatArray
        w(t1) (m), (m,), positive.
    held : ndarray of int (m,)
        Numbers of these points, counted from the first of the way out.
    points : int
        How many there are on the way out; those not held have lost contact.
    """

    step: NDArray[np.intp]
    elapsed: FloatArray
    depth: FloatArray
    held: NDArray[np.intp]
    points: int

    @property
    def depths(self) -> FloatArray:
        """w(t1) (m) of every point of the way out, zero without contact."""
        depths = np.zeros(self.points)
        depths[self.held] = self.depth
        return depths


def equal_radius(depth: FloatArray, memory: Memory, turn: int) -> EqualRadius:
    """Find t1 for every point after number `turn`, the last of the way in.

    F(t1) = constant (w - w(t1)) + sum_k weight_k [y_k - exp(-(t - t1) / tau_k) y_k(t1)], with
    y_k(t) = int exp(-(t - s) / tau_k) dw(s), falls as t1 grows: the step is found by halving the record, the time
    by false position in the step.
    """
    y = memory.integrals(depth)
    modes, time = memory.modes, memory.time
    after = slice(turn + 1, None)
    target = modes.constant * depth[after] + modes.weights @ y[:, after]
    clock = time[after]

    def seen(number: NDArray[np.intp], clock: FloatArray) -> FloatArray:
        """constant w(t1) + sum_k weight_k exp(-(t - t1) / tau_k) y_k(t1) with t1 at points of the record."""
        gone = (clock - time[number]) / modes.times[:, None]
        return np.asarray(modes.constant * depth[number] + modes.weights @ (np.exp(-gone) * y[:, number]))

    touching = seen(np.zeros(len(clock), dtype=np.intp), clock) < target
    clock, target = clock[touching], target[touching]
    low, high = np.zeros(len(clock), dtype=np.intp), np.full(len(clock), turn, dtype=np.intp)
    while (high - low > 1).any():
        middle = (low + high) // 2
        later = seen(middle, clock) < target
        low, high = np.where(later, middle, low), np.where(later, high, middle)
    width = time[low + 1] - time[low]
    speed = (depth[low + 1] - depth[low]) / width
    gone, begun = (clock - time[low]) / modes.times[:, None], y[:, low]

    def excess(elapsed: FloatArray) -> FloatArray:
        """The same within a step, less what it must be."""
        part = elapsed / modes.times[:, None]
        inside = np.exp(-part) * begun + even(part) * (speed * elapsed)
        relaxed = modes.weights @ (np.exp(part - gone) * inside)
        return np.asarray(modes.constant * (depth[low] + speed * elapsed) + relaxed - target)

    elapsed = _within(excess, width)
    reached = depth[low] + speed * elapsed
    held = np.flatnonzero(touching)[reached > 0.0]
    keep = reached > 0.0
    return EqualRadius(low[keep], elapsed[keep], reached[keep], held, len(touching))


def _within(excess: Callable[[FloatArray], FloatArray], width: FloatArray) -> FloatArray:
    """Zeros of functions that rise from below zero at 0 to above it at `width`, (m,): false position.

    The weight of an end that stays twice is halved (Dowell and Jarratt 1971): over one step of a record the
    functions are nearly straight, and a few rounds reach the last digits. Where an end has the other sign, the
    nearer end.
    """
    first, last = np.zeros_like(width), width.copy()
    below, above = excess(first), excess(last)
    x = np.where(below >= 0.0, first, last)
    open_ = (below < 0.0) & (above > 0.0)
    was_late = np.zeros_like(open_)
    for _ in range(_ROUNDS):
        proposal = first - below * (last - first) / np.where(open_, above - below, 1.0)
        step = np.where(open_, proposal - x, 0.0)
        x = np.where(open_, proposal, x)
        if (np.abs(step) <= _LAST_DIGITS * width).all():
            break
        value = excess(x)
        late = value > 0.0
        weight = np.where(late == was_late, 0.5, 1.0)
        above, below = np.where(late, value, weight * above), np.where(late, weight * below, value)
        was_late = late
        first, last = np.where(open_ & ~late, x, first), np.where(open_ & late, x, last)
    return x


@dataclass(frozen=True)
class Unloading:
    """The map from an elastic force to that of one motion that grows, rests, and shrinks from then on.

    Parameters
    ----------
    way_in : FloatArray
        Depths (m) up to the last of the way in.
    memory : Memory
        Clock of all points.
    found : EqualRadius
        Of the points after that.
    """

    way_in: FloatArray
    memory: Memory
    found: EqualRadius

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,)."""
        found, modes, w = self.found, self.memory.modes, self.way_in
        begun = Memory(modes, self.memory.time[: len(w)])
        at, middle = loads(elastic, w)
        z = begun.integrals(at, middle)
        n, reached = found.step, found.depth
        ends = elastic(np.concatenate((reached, 0.5 * (w[n] + reached))))
        load, half = ends[: len(n)], ends[len(n) :]
        part = found.elapsed / modes.times[:, None]
        g1 = even(part)
        z1 = np.exp(-part) * z[:, n] + g1 * (load - at[n])
        z1 += curved(part, g1) * (4.0 * half - 2.0 * (load + at[n]))
        gone = (self.memory.time[len(w) + found.held] - begun.time[n] - found.elapsed) / modes.times[:, None]
        force = np.zeros(len(w) + found.points)
        force[: len(w)] = modes.constant * at + modes.weights @ z
        force[len(w) + found.held] = modes.constant * load + modes.weights @ (np.exp(-gone) * z1)
        return force
