"""The force of any history of depths on a relaxing layer by a bed of springs, and the depth under a given force.

`Bed` is a step-by-step solution; it serves where the closed constructions of `loading` do not hold. `crept` is the
depth under a given force: creep, and recovery after a single maximum of the force.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.relaxation import Modes
from underlay.mechanics.response import Elastic, Invertible
from underlay.mechanics.viscoelastic.equal_radius import EqualRadius, equal_radius
from underlay.mechanics.viscoelastic.memory import Memory, even

# Two cycles of a paraboloid, relative to the largest force against four times as many of both: see the tests.
_SPRINGS = 400
_STEPS = 1600
_LAST_DIGITS = 1e-13
# A rise of the force after its fall by less than this part of the largest is a rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Bed:
    """The force of any motion from a bed of independent springs, each in contact or free.

    The spring at x, the depth at which the elastic contact reaches its radius, is compressed by y >= w - x, w the
    depth, and carries Q = e * dy >= 0 (e the relaxation function, * a convolution in time), one of the two an
    equality. Then

        P(t) = int Q(x, t) P_el''(x) dx = - sum_j [Q_{j+1} - Q_j] / [x_{j+1} - x_j] [P_el(x_{j+1}) - P_el(x_j)]

    for Q linear between the springs x_j: the elastic force P_el is needed at the springs only, and no derivative of
    it. It is of second order in the time steps and in the distance of the springs.

    Parameters
    ----------
    springs : FloatArray
        Depths x_j (m) of the springs, (m,), from zero.
    slopes : FloatArray
        dQ/dx between the springs at every point of time, (n, m - 1).
    """

    springs: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, depth: FloatArray, modes: Modes, time: FloatArray) -> Self:
        """Compute the springs' forces for depths (m), (n,), negative before contact, at `time` (s), (n,)."""
        pieces, clock, path = _refined(time, depth)
        springs = np.linspace(0.0, float(path.max()), _SPRINGS + 1)
        given = path.tolist()
        steps = itertools.islice(_stepped(modes, clock, springs, lambda n, *_: given[n]), 0, None, pieces)
        return cls(springs, np.diff([force for _, force in steps], axis=1) / np.diff(springs))

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,), for an elastic force (N) as a function of depth (m)."""
        return np.asarray(self.slopes @ -np.diff(elastic(self.springs)))


def _refined(time: FloatArray, values: FloatArray) -> tuple[int, FloatArray, FloatArray]:
    """Pieces into which every step of a record is cut, and its times and values with them."""
    pieces = max(int(np.ceil(_STEPS / (len(time) - 1))), 1)
    fine = np.arange((len(time) - 1) * pieces + 1) / pieces
    clock, refined = (np.interp(fine, np.arange(len(time)), of) for of in (time, values))
    return pieces, clock, refined


def depth_under(
    elastic: Elastic, force: FloatArray, modes: Modes, time: FloatArray, deepest: float
) -> FloatArray:
    """Depth (m), (n,), under any forces (N), (n,), zero or more, at times (s), (n,), by the bed of springs.

    `elastic` is the elastic force at depths (m), and `deepest` (m) an upper bound of the result. With c_j the steps
    of the slope of P_el at the springs, P(w) = sum_j c_j Q_j(w), where a spring in contact adds a straight line and
    one out of contact nothing: convex and increasing, so Newton's method ends after some steps.
    """
    pieces, clock, load = _refined(time, force)
    springs = np.linspace(0.0, deepest, _SPRINGS + 1)[:-1]
    slopes = np.diff(elastic(np.append(springs, deepest))) * (len(springs) / deepest)
    stiffness, given = np.diff(slopes, prepend=0.0), load.tolist()

    def under(n: int, compression: FloatArray, standing: FloatArray, rate: float) -> float:
        return _pressed(stiffness, standing - rate * (springs + compression), rate, given[n], deepest)

    return np.array([depth for depth, _ in _stepped(modes, clock, springs, under)])[::pieces]


def _pressed(stiffness: FloatArray, offset: FloatArray, rate: float, target: float, w: float) -> float:
    """Depth (m) at which sum_j stiffness_j max(offset_j + rate w, 0) is `target` (N), by Newton from above.

    `w` (m) is the starting value.
    """
    for _ in range(len(offset)):
        bears = stiffness * (offset + rate * w > 0.0)
        slope = rate * float(bears.sum())
        if not slope > 0.0:
            return w
        lower = (target - float(bears @ offset)) / slope
        if lower >= w * (1.0 - _LAST_DIGITS):
            return lower
        w = lower
    return w


def _stepped(
    modes: Modes, clock: FloatArray, springs: FloatArray, depth: Callable[..., float]
) -> Iterator[tuple[float, FloatArray]]:
    """Iterate over depth (m) and force Q per unit modulus (m) of every spring, (springs,), at every step.

    `depth` gives the depth from the number of the step, the springs' compression before it, what they bear without
    a further one, and how fast that grows with it.
    """
    steps = Memory.of(modes, clock).clock
    shape = (len(modes.times), len(clock) - 1)
    # The first step is sudden: nothing of it is lost.
    decay = np.hstack((np.ones((shape[0], 1)), np.broadcast_to(steps.decay, shape)))
    share = modes.weights[:, None] * np.hstack((np.ones((shape[0], 1)), np.broadcast_to(steps.even, shape)))
    compression, parts = np.zeros(len(springs)), np.zeros((shape[0], len(springs)))
    for n in range(len(clock)):
        parts = parts * decay[:, n, None]
        rate = modes.constant + float(share[:, n].sum())
        standing = modes.constant * compression + parts.sum(axis=0)
        w = depth(n, compression, standing, rate)
        # In contact it follows the tip; where that would pull, it goes where it carries nothing.
        change = np.maximum(w - springs - compression, -standing / rate)
        compression = compression + change
        parts += share[:, n, None] * change
        yield w, np.maximum(standing + rate * change, 0.0)


@dataclass(frozen=True)
class Creep:
    """Creep function j(t) = modes(t) + flow t of a relaxation e, with j * de = 1 (* a convolution in time).

    The weights of its modes are negative. For a relaxation e = c + sum_k weight_k exp(-r_k t) it is a sum of
    exponentials too,

        j(t) = 1 / c - sum_m J_m exp(-q_m t),    H(-q_m) = 0,    J_m = 1 / (q_m H'(-q_m)),
        H(s) = c + sum_k weight_k s / (s + r_k),

    with one q_m below every r_k; without a constant c the lowest is zero and the layer flows,
    j(t) = j_0 + t / eta - ..., eta = sum_k weight_k / r_k.

    Parameters
    ----------
    modes : Modes
        Constant, and retarded parts.
    flow : float
        1 / eta (1/s); zero for a solid.
    """

    modes: Modes
    flow: float

    @classmethod
    def of(cls, modes: Modes) -> Self:
        """Creep function of the relaxation with the given modes."""
        rates, which = np.unique(1.0 / modes.times[modes.weights > 0.0], return_inverse=True)
        weights = np.bincount(which, modes.weights[modes.weights > 0.0], len(rates)).astype(np.float64)
        if not len(rates):
            return cls(Modes(1.0 / modes.constant, np.zeros(1), np.ones(1)), 0.0)
        fluid = not modes.constant > 0.0
        ends = np.concatenate(([0.0], rates))
        spans = list(itertools.pairwise(ends.tolist()))[int(fluid) :]
        q = np.array([_zero(modes.constant, weights, rates, low, high) for low, high in spans])
        slope = (weights * rates / (rates - q[:, None]) ** 2).sum(axis=1)
        parts = 1.0 / (q * slope)
        # At t = 0 the layer answers with 1 / e(0).
        constant = 1.0 / (modes.constant + weights.sum()) + parts.sum()
        flow = 1.0 / float((weights / rates).sum()) if fluid else 0.0
        if not len(q):
            q, parts = np.ones(1), np.zeros(1)
        return cls(Modes(float(constant), -parts, 1.0 / q), flow)

    def __call__(self, time: FloatArray) -> FloatArray:
        """Creep function j(t) at times (s), (n,)."""
        return np.asarray(self.modes(time) + self.flow * time)

    def hereditary(self, values: FloatArray, time: FloatArray) -> FloatArray:
        """int j(t - s) dF(s) at every point, (n,), for F linear between its `values` (n,) at `time` (s)."""
        crept = Memory.of(self.modes, time).hereditary(values)
        if self.flow:
            grown = 0.5 * np.diff(time) * (values[1:] + values[:-1])
            crept = crept + self.flow * np.append(0.0, np.cumsum(grown))
        return np.asarray(crept)


def _zero(constant: float, weights: FloatArray, rates: FloatArray, low: float, high: float) -> float:
    """The root q of H(-q) between two rates `low` and `high` (1/s); H is that of `Creep`."""
    from scipy import optimize  # noqa: PLC0415  as long to load as all of the mechanics; only under load control

    others = (rates != low) & (rates != high)
    at_low, at_high = float(weights[rates == low].sum()), float(weights[rates == high].sum())
    span = high - low

    def scaled(q: float) -> float:
        """H(-q) times the distances of q from both ends of the interval, at which H is infinite."""
        to_high, from_low = (high - q) / span, (q - low) / span if low else 1.0
        rest = constant - float((weights[others] * q / (rates[others] - q)).sum())
        return rest * to_high * from_low + q / span * (at_low * to_high - at_high * from_low)

    return float(optimize.brentq(scaled, low, high, xtol=1e-14 * high, rtol=1e-14))


def crept(law: Invertible, modes: Modes, force: FloatArray, time: FloatArray) -> FloatArray:
    """Depth (m), (n,), under forces (N), (n,), at times (s), (n,).

    While the contact grows, P_el(w(t)) = int j(t - s) dP(s), with j the creep function (Lee and Radok 1960).
    When the force falls, t1 follows from it, P(t) = int_0^{t1} e(t - s) dP_el(w(s)), and the depth from Ting's
    condition, int_{t1}^t e(t - s) dw(s) = 0, step by step. The force is taken as linear between the points; a
    first force above zero is a sudden one. One loading and one unloading go by these closed constructions, any
    other history by the bed of springs.

    t1 is the time during loading at which the contact had the same radius.

    Raises
    ------
    InputError
        If a force is below zero.
    """
    if (force < 0.0).any():
        raise InputError(f"under a given force the tip must be pressed: {force.min():.6g} N is below zero")
    top = float(force.max())
    turn = int(np.flatnonzero(force >= top * (1.0 - _ROUNDING))[-1])
    before, after = np.diff(force[: turn + 1]), np.diff(force[turn:])
    if (before < -_ROUNDING * top).any() or (after > _ROUNDING * top).any():
        # Were the force never taken back, the tip would go deeper.
        most = float(law.depth(Creep.of(modes).hereditary(np.maximum.accumulate(force), time)).max())
        return depth_under(law.force, force, modes, time, most)
    elastic = Creep.of(modes).hereditary(force[: turn + 1], time[: turn + 1])
    way_in = np.asarray(law.depth(elastic))
    if turn == len(force) - 1:
        return way_in
    memory = Memory.of(modes, time)
    found = equal_radius(elastic, memory, turn, force[turn + 1 :])
    return np.concatenate((way_in, _recovered(law, memory, way_in, found)))


def _recovered(law: Invertible, memory: Memory, way_in: FloatArray, found: EqualRadius) -> FloatArray:
    """Depth (m) during unloading, step by step, from the times of equal contact radius."""
    modes, time, turn = memory.modes, memory.time, len(way_in) - 1
    points = len(time) - turn - 1
    reached, clock = np.zeros(points), np.full(points, time[0])
    at, held = np.zeros(points, dtype=np.intp), np.flatnonzero(found.held)
    reached[held] = law.depth(found.depth[held])
    at[held], clock[held] = found.step[held], found.time[held]
    y = Memory.of(modes, time[: turn + 1]).integrals(way_in)
    part = (clock - time[at]) / modes.times[:, None]
    y1 = np.exp(-part) * y[:, at] + even(part) * (reached - way_in[at])
    seen = modes.constant * reached + modes.weights @ (
        np.exp(-(time[turn + 1 :] - clock) / modes.times[:, None]) * y1
    )
    steps = np.diff(time[turn:]) / modes.times[:, None]
    decay, grown = np.exp(-steps), even(steps)
    rates = modes.constant + modes.weights @ grown
    depths, w, now = np.empty(points), float(way_in[-1]), y[:, -1]
    for n in range(points):
        rested = decay[:, n] * now
        change = (seen[n] - modes.constant * w - float(modes.weights @ rested)) / rates[n]
        now = rested + grown[:, n] * change
        w += change
        depths[n] = w
    return depths
