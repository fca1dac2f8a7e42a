"""The depth under a given force: creep, and recovery after a single maximum of the force.

While the contact grows, P_el(w(t)) = int j(t - s) dP(s), with j the creep function of e, J * dE = 1 (Lee and Radok
1960). For e = c + sum_k weight_k exp(-r_k t) it is a sum of exponentials too,

    j(t) = 1 / c - sum_m J_m exp(-q_m t),    H(-q_m) = 0,    J_m = 1 / (q_m H'(-q_m)),
    H(s) = c + sum_k weight_k s / (s + r_k),

with one q_m below every r_k; without a constant c the lowest is zero and the layer flows,
j(t) = j_0 + t / eta - ..., eta = sum_k weight_k / r_k.

When the force falls, t1 follows from it, P(t) = int_0^{t1} e(t - s) dP_el(w(s)), and the depth from Ting's
condition, int_{t1}^t e(t - s) dw(s) = 0, step by step.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.relaxation import Modes
from underlay.mechanics.response import Invertible
from underlay.mechanics.viscoelastic.bed import depth_under
from underlay.mechanics.viscoelastic.clock import even
from underlay.mechanics.viscoelastic.equal_radius import EqualRadius, equal_radius
from underlay.mechanics.viscoelastic.memory import Memory

__all__ = ["Creep", "crept"]

# A rise of the force after its fall by less than this part of the largest is a rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Creep:
    """Creep function j(t) = modes(t) + flow t, with J * dE = 1; the weights of its modes are negative.

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
        """Creep function of a relaxation."""
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
        """j(t) at times (s), (n,)."""
        return np.asarray(self.modes(time) + self.flow * time)

    def hereditary(self, values: FloatArray, time: FloatArray) -> FloatArray:
        """int j(t - s) dF(s) at every point, (n,), of a function linear between the points."""
        crept = Memory.of(self.modes, time).hereditary(values)
        if self.flow:
            grown = 0.5 * np.diff(time) * (values[1:] + values[:-1])
            crept = crept + self.flow * np.append(0.0, np.cumsum(grown))
        return np.asarray(crept)


def _zero(constant: float, weights: FloatArray, rates: FloatArray, low: float, high: float) -> float:
    """The q between two rates at which H(-q) = 0: there it falls from above zero to below."""
    from scipy import optimize  # noqa: PLC0415  as long to load as all of the mechanics; only under load control

    others = (rates != low) & (rates != high)
    at_low, at_high = float(weights[rates == low].sum()), float(weights[rates == high].sum())
    span = high - low

    def scaled(q: float) -> float:
        """H(-q) times the distances to the ends of the span, at which it is infinite."""
        to_high, from_low = (high - q) / span, (q - low) / span if low else 1.0
        rest = constant - float((weights[others] * q / (rates[others] - q)).sum())
        return rest * to_high * from_low + q / span * (at_low * to_high - at_high * from_low)

    return float(optimize.brentq(scaled, low, high, xtol=1e-14 * high, rtol=1e-14))


def crept(law: Invertible, modes: Modes, force: FloatArray, time: FloatArray) -> FloatArray:
    """Depth (m), (n,), under forces (N), (n,).

    The force is taken as linear between the points; a first force above zero is a sudden one. One loading and one
    unloading go by the closed constructions, any other history by the bed of springs.

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
    """Depth (m) on the way out, from the times of equal radius: one step after the other."""
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
