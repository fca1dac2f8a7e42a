"""The force after a maximum, by the equal radius on the way in (Ting 1966).

With t1(t) the last earlier time at which the contact had the radius it has at t,

    int_{t1}^t e(t - s) w'(s) ds = 0,    P(t) = int_0^{t1} e(t - s) dP_el(w(s)),

and the contact is lost where the first integral is not positive from the first contact on. t1 depends on the
motion alone: it is the same for every tip and every layer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.response import Elastic
from underlay.mechanics.viscoelastic.loading import ModeSlopes, loads
from underlay.mechanics.viscoelastic.memory import Memory, curved, even

__all__ = ["EqualRadius", "Unloading", "equal_radius"]

# Rounds of Newton's method, far beyond need, and the last of its steps over that of the record: what is left after
# it is the square of that.
_ROUNDS = 60
_LAST_STEP = 1e-7
# A step of the record over the shortest relaxation time below which its exponential does not overflow beside what
# is left of older loads.
_LONG_STEP = 300.0
# Points of the way in that every point of the way out is compared with at once: a product of matrices, which takes
# as long as two rounds of halving do.
_AT_ONCE = 33


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


def equal_radius(
    depth: FloatArray, memory: Memory, turn: int, target: FloatArray | None = None
) -> EqualRadius:
    """Find t1 for every point after number `turn`, the last of the way in.

    F(t1) = constant (w - w(t1)) + sum_k weight_k [y_k - exp(-(t - t1) / tau_k) y_k(t1)], with
    y_k(t) = int exp(-(t - s) / tau_k) dw(s), falls as t1 grows: the step is found by halving the record, the time
    by Newton's method in the step. With a `target` given, (m,), t1 is where constant w(t1) + sum_k weight_k
    exp(-(t - t1) / tau_k) y_k(t1) is that: with elastic forces in the place of depths, the force.
    """
    modes, time = memory.modes, memory.time
    clock = time[turn + 1 :]
    y = memory.integrals(depth) if target is None else Memory(modes, time[: turn + 1]).integrals(depth)
    if target is None:
        target = modes.constant * depth[turn + 1 :] + modes.weights @ y[:, turn + 1 :]
    # exp(-(t - t1) / tau) is the product of what is left at the turn and after it, decaying factors both.
    at_turn = np.exp(-(time[turn] - time[: turn + 1]) / modes.times[:, None]) * y[:, : turn + 1]
    since_turn = modes.weights[:, None] * np.exp(-(clock - time[turn]) / modes.times[:, None])

    def seen(number: NDArray[np.intp], since_turn: FloatArray) -> FloatArray:
        """constant w(t1) + sum_k weight_k exp(-(t - t1) / tau_k) y_k(t1) with t1 at points of the record."""
        return np.asarray(modes.constant * depth[number] + (since_turn * at_turn[:, number]).sum(axis=0))

    # Every point against some of the way in at once, then by halves between two of those.
    some = np.unique(np.linspace(0, turn, _AT_ONCE).astype(np.intp))
    before = modes.constant * depth[some] + since_turn.T @ at_turn[:, some] < target[:, None]
    touching = before[:, 0]
    clock, target, since_turn = clock[touching], target[touching], since_turn[:, touching]
    last = np.minimum(before[touching].sum(axis=1), len(some) - 1)
    low, high = some[last - 1], some[last]
    while (high - low > 1).any():
        middle = (low + high) // 2
        later = seen(middle, since_turn) < target
        low, high = np.where(later, middle, low), np.where(later, high, middle)
    width = time[low + 1] - time[low]
    speed = (depth[low + 1] - depth[low]) / width
    gone = (clock - time[low]) / modes.times[:, None]
    # Of a linear way in, what the step adds to y is tau speed (1 - exp(-elapsed / tau)).
    share = modes.weights[:, None] * speed
    left_at_low, tau = share * np.exp(-gone), modes.times[:, None]
    overflows = bool((width > _LONG_STEP * modes.times.min()).any())
    at_low = seen(low, since_turn)
    missing, rise = target - at_low, seen(high, since_turn) - at_low

    def excess(elapsed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same within a step, less what it must be, and its derivative, speed e(t - t1)."""
        part = elapsed / tau
        if overflows:
            left = share * np.exp(part - gone)
            grown = tau * left * -np.expm1(-part)
        else:
            # exp(part) - 1 times what is left at the beginning of the step.
            more = left_at_low * np.expm1(part)
            left, grown = left_at_low + more, tau * more
        value = modes.constant * speed * elapsed + grown.sum(axis=0) - missing
        return value, modes.constant * speed + left.sum(axis=0)

    # Where the function does not rise, as rounding may have it, from the middle.
    straight = np.divide(missing, rise, out=np.full_like(rise, 0.5), where=rise > 0.0)
    elapsed = _within(excess, width, width * np.minimum(np.maximum(straight, 0.0), 1.0))
    reached = depth[low] + speed * elapsed
    held = np.flatnonzero(touching)[reached > 0.0]
    keep = reached > 0.0
    return EqualRadius(low[keep], elapsed[keep], reached[keep], held, len(touching))


def _within(
    excess: Callable[[FloatArray], tuple[FloatArray, FloatArray]], width: FloatArray, x: FloatArray
) -> FloatArray:
    """Zeros between 0 and `width`, (m,), of functions that grow, from `x`: Newton's method in a shrinking bracket.

    A step that does not halve the one before it is replaced by the middle of the bracket. A function without a
    zero there ends at the nearer end.
    """
    first, last = np.zeros_like(width), width.copy()
    before = width.copy()
    open_ = np.ones(len(width), dtype=bool)
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


@dataclass(frozen=True)
class Unloading:
    """The map from an elastic force to that of one motion that grows, rests, and shrinks from then on.

    Parameters
    ----------
    path : FloatArray
        Depths (m) of all points, negative before contact, (n,).
    turn : int
        Number of the last point of the way in.
    memory : Memory
        Clock of all points.
    found : EqualRadius
        Of the points after that.
    """

    path: FloatArray
    turn: int
    memory: Memory
    found: EqualRadius

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,)."""
        modes = self.memory.modes
        at, _, z, load, z1 = self._integrals(elastic)
        force = np.zeros(len(self.path))
        force[: len(at)] = modes.constant * at + modes.weights @ z
        force[self._held] = modes.constant * load + modes.weights @ (self._left * z1)
        return force

    def mode_slopes(self, elastic: Elastic, stiffness: Elastic) -> ModeSlopes:
        """d force / d number of the modes, from the elastic force (N) and stiffness k (N/m).

        t1 moves with e(t) so that its condition holds. Both force and condition change with t1 by e(t - t1), so
        dP = int_0^{t1} de(t - s) dP_el + k(w(t1)) int_{t1}^t de(t - s) dw.
        """
        modes, found, count = self.memory.modes, self.found, len(self.path)
        n, tau = found.step, modes.times[:, None]
        at, (middle, load, half), z, _, z1 = self._integrals(elastic)
        in_time = self._begun.integral_slopes(z, at, middle)
        rise, bend = load - at[n], 4.0 * half - 2.0 * (load + at[n])
        bent = self._past - self._even
        in_time1 = self._past * (in_time[:, n] + self._part / tau * z[:, n]) - bent / tau * rise
        in_time1 -= (bent - 2.0 * self._curved) / tau * bend
        y, y1, y_time, y_time1 = self._travelled
        left, gone, held, k = self._left, self._gone, self._held, stiffness(found.depth)
        constant, weights, times = np.zeros(count), np.zeros((len(tau), count)), np.zeros((len(tau), count))
        constant[: len(at)], weights[:, : len(at)], times[:, : len(at)] = at, z, in_time
        constant[held] = load + k * (self.path[held] - found.depth)
        weights[:, held] = left * z1 + k * (y[:, held] - left * y1)
        later = left * (in_time1 + gone / tau * z1)
        times[:, held] = later + k * (y_time[:, held] - left * (y_time1 + gone / tau * y1))
        return ModeSlopes(constant, weights, modes.weights[:, None] * times)

    def _integrals(
        self, elastic: Elastic
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray], FloatArray, FloatArray, FloatArray]:
        """Forces on the way in, (middle of steps, at t1, half way to t1), z on the way in, force and z at t1."""
        found, way_in = self.found, self.path[: self.turn + 1]
        at, middle = loads(elastic, way_in)
        z = self._begun.integrals(at, middle)
        n, reached = found.step, found.depth
        ends = elastic(np.concatenate((reached, np.maximum(0.5 * (way_in[n] + reached), 0.0))))
        load, half = ends[: len(n)], ends[len(n) :]
        z1 = self._past * z[:, n] + self._even * (load - at[n])
        z1 += self._curved * (4.0 * half - 2.0 * (load + at[n]))
        return at, (middle, load, half), z, load, z1

    @cached_property
    def _travelled(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """y_k at every point and at t1, (K, n) and (K, m), and their derivatives in tau_k."""
        found, tau = self.found, self.memory.modes.times[:, None]
        n = found.step
        path = np.array(self.path)
        path[: self.turn + 1] = np.maximum(path[: self.turn + 1], 0.0)
        y = self.memory.integrals(path)
        in_time = self.memory.integral_slopes(y, path)
        rise = found.depth - path[n]
        y1 = self._past * y[:, n] + self._even * rise
        in_time1 = self._past * (in_time[:, n] + self._part / tau * y[:, n])
        return y, y1, in_time, in_time1 - (self._past - self._even) / tau * rise

    @cached_property
    def _begun(self) -> Memory:
        """Clock of the way in."""
        return Memory(self.memory.modes, self.memory.time[: self.turn + 1])

    @property
    def _held(self) -> NDArray[np.intp]:
        """Numbers of the points of the way out that are in contact."""
        return self.turn + 1 + self.found.held

    @cached_property
    def _part(self) -> FloatArray:
        """Time from the beginning of its step to t1, over every relaxation time, (K, m)."""
        return np.asarray(self.found.elapsed / self.memory.modes.times[:, None])

    @cached_property
    def _past(self) -> FloatArray:
        """exp(-part), (K, m)."""
        return np.exp(-self._part)

    @cached_property
    def _even(self) -> FloatArray:
        """g1 of `_part`, (K, m)."""
        return even(self._part)

    @cached_property
    def _curved(self) -> FloatArray:
        """g2 of `_part`, (K, m)."""
        return curved(self._part, self._even)

    @cached_property
    def _gone(self) -> FloatArray:
        """Time from t1 on, over every relaxation time, (K, m)."""
        time, found = self.memory.time, self.found
        since = time[self._held] - time[found.step] - found.elapsed
        return np.asarray(since / self.memory.modes.times[:, None])

    @cached_property
    def _left(self) -> FloatArray:
        """exp(-gone), (K, m)."""
        return np.exp(-self._gone)
