"""The force of any history at all: a bed of springs that relax, each in contact or free by itself.

The spring at x, the depth at which the elastic contact reaches its radius, is pressed by y >= w - x and carries
Q = e * dy >= 0, one of the two an equality. Then

    P(t) = int Q(x, t) P_el''(x) dx = - sum_j [Q_{j+1} - Q_j] / [x_{j+1} - x_j] [P_el(x_{j+1}) - P_el(x_j)]

for Q linear between the springs x_j: the elastic force is asked at the springs and nothing of its derivatives.
It is a step-by-step solution of second order in the steps and in the distance of the springs; it serves where the
closed constructions of `loading` and `unloading` do not hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.relaxation import Modes
from underlay.mechanics.response import Elastic
from underlay.mechanics.viscoelastic.clock import even
from underlay.mechanics.viscoelastic.memory import Memory

__all__ = ["Bed", "depth_under"]

# Two cycles of a paraboloid, relative to the largest force against four times as many of both: see the tests.
_SPRINGS = 400
_STEPS = 1600
_LAST_DIGITS = 1e-13


@dataclass(frozen=True)
class Bed:
    """The map from an elastic force to that of one motion, whatever it is.

    Parameters
    ----------
    springs : FloatArray
        Depths (m) of the springs, (m,), from zero.
    slopes : FloatArray
        dQ/dx between the springs at every point, (n, m - 1).
    """

    springs: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, depth: FloatArray, modes: Modes, time: FloatArray) -> Self:
        """Follow depths (m), (n,), negative before contact, at `time` (s), (n,)."""
        pieces = max(int(np.ceil(_STEPS / (len(depth) - 1))), 1)
        fine = np.arange((len(depth) - 1) * pieces + 1) / pieces
        clock = np.interp(fine, np.arange(len(depth)), time)
        path = np.interp(fine, np.arange(len(depth)), depth)
        springs = np.linspace(0.0, float(path.max()), _SPRINGS + 1)
        forces = _stepped(path, modes, clock, springs)[::pieces]
        return cls(springs, np.diff(forces, axis=1) / np.diff(springs))

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,)."""
        return np.asarray(self.slopes @ -np.diff(elastic(self.springs)))


def depth_under(
    elastic: Elastic, force: FloatArray, modes: Modes, time: FloatArray, deepest: float
) -> FloatArray:
    """Depth (m), (n,), under any forces (N), (n,), zero or more, that never reach beyond `deepest` (m).

    With c_j the steps of the slope of P_el at the springs, P(w) = sum_j c_j Q_j(w), where a spring in contact adds
    a straight line and one out of contact nothing: convex and increasing, so Newton's method ends after some steps.
    """
    pieces = max(int(np.ceil(_STEPS / (len(force) - 1))), 1)
    fine = np.arange((len(force) - 1) * pieces + 1) / pieces
    clock, load = (np.interp(fine, np.arange(len(force)), values) for values in (time, force))
    springs = np.linspace(0.0, deepest, _SPRINGS + 1)[:-1]
    slopes = np.diff(elastic(np.append(springs, deepest))) * (len(springs) / deepest)
    stiffness = np.diff(slopes, prepend=0.0)
    steps = np.diff(clock) / modes.times[:, None]
    decay, share = np.exp(-steps), modes.weights[:, None] * even(steps)
    at_once = modes.constant + float(modes.weights.sum())
    w = _pressed(stiffness, -at_once * springs, at_once, float(load[0]), deepest)
    compression = np.maximum(w - springs, 0.0)
    parts, depths = modes.weights[:, None] * compression, np.empty(len(load))
    depths[0] = w
    for n, target in enumerate(load[1:].tolist()):
        parts = parts * decay[:, n, None]
        rate = modes.constant + float(share[:, n].sum())
        standing = modes.constant * compression + parts.sum(axis=0)
        w = _pressed(stiffness, standing - rate * (springs + compression), rate, target, deepest)
        change = np.maximum(w - springs - compression, -standing / rate)
        compression = compression + change
        parts += share[:, n, None] * change
        depths[n + 1] = w
    return depths[::pieces]


def _pressed(stiffness: FloatArray, offset: FloatArray, rate: float, target: float, w: float) -> float:
    """Depth w (m) at which sum_j stiffness_j max(offset_j + rate w, 0) is `target` (N), from above."""
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


def _stepped(path: FloatArray, modes: Modes, clock: FloatArray, springs: FloatArray) -> FloatArray:
    """Q of every spring at every step, (n, springs), per unit modulus (m)."""
    memory = Memory.of(modes, clock)
    shape = (len(modes.times), len(path) - 1)
    decay = np.broadcast_to(memory.clock.decay, shape)
    even = np.broadcast_to(modes.weights[:, None] * memory.clock.even, shape)
    compression = np.maximum(path[0] - springs, 0.0)
    parts = modes.weights[:, None] * compression
    forces = np.empty((len(path), len(springs)))
    forces[0] = modes.constant * compression + parts.sum(axis=0)
    for n, w in enumerate(path[1:]):
        parts = parts * decay[:, n, None]
        rate = modes.constant + even[:, n].sum()
        standing = modes.constant * compression + parts.sum(axis=0)
        # In contact it follows the tip; where that would pull, it goes where it carries nothing.
        change = np.maximum(w - springs - compression, -standing / rate)
        compression = compression + change
        parts += even[:, n, None] * change
        forces[n + 1] = np.maximum(standing + rate * change, 0.0)
    return forces
