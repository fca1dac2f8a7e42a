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
from underlay.mechanics.viscoelastic.memory import Memory

__all__ = ["Bed"]

# Two cycles of a paraboloid, relative to the largest force against four times as many of both: see the tests.
_SPRINGS = 400
_STEPS = 1600


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
        forces = _stepped(path, Memory(modes, clock), springs)[::pieces]
        return cls(springs, np.diff(forces, axis=1) / np.diff(springs))

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,)."""
        return np.asarray(self.slopes @ -np.diff(elastic(self.springs)))


def _stepped(path: FloatArray, memory: Memory, springs: FloatArray) -> FloatArray:
    """Q of every spring at every step, (n, springs), per unit modulus (m)."""
    modes = memory.modes
    shape = (len(modes.times), len(path) - 1)
    decay = np.broadcast_to(memory.decay, shape)
    even = np.broadcast_to(modes.weights[:, None] * memory.even, shape)
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
