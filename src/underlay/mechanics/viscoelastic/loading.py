"""The force while the contact does not shrink: P(t) = int e(t - s) dP_el(w(s)) (Lee and Radok 1960)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.response import Elastic
from underlay.mechanics.viscoelastic.memory import Memory

__all__ = ["Loading", "ModeSlopes", "loads"]


class ModeSlopes(NamedTuple):
    """d force / d number of the modes of a relaxation.

    Parameters
    ----------
    constant : FloatArray
        In what never relaxes, (n,).
    weights, times : FloatArray
        In the weight and in the time of every exponential, (K, n).
    """

    constant: FloatArray
    weights: FloatArray
    times: FloatArray


def loads(elastic: Elastic, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Elastic force (N) at depths (m), (n,), and at the middle of each step, (n - 1,), in one call."""
    # Where the tip rests, and before contact, the force is that of the point before.
    w = np.maximum(depth, 0.0)
    moved = np.flatnonzero(np.diff(w))
    asked = np.concatenate((w[:1], w[moved + 1], np.maximum(0.5 * (depth[moved + 1] + depth[moved]), 0.0)))
    found = elastic(asked)
    at, half = found[: len(moved) + 1], found[len(moved) + 1 :]
    last = np.zeros(len(w), dtype=np.intp)
    last[moved + 1] = 1
    values = at[np.cumsum(last)]
    middle = values[1:].copy()
    middle[moved] = half
    return values, middle


@dataclass(frozen=True)
class Loading:
    """The map from an elastic force to that of one motion which only grows or rests.

    The elastic force is taken as quadratic in time over each step. Measured on a paraboloid, a ramp over 2.5
    relaxation times, relative to the largest force: 9e-7 with 10 points on the ramp, 2e-8 with 50, 5e-10 with
    200.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), (n,).
    memory : Memory
        Their clock.
    """

    depth: FloatArray
    memory: Memory

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,)."""
        return self.memory.hereditary(*loads(elastic, self.depth))

    def mode_slopes(self, elastic: Elastic, stiffness: Elastic) -> ModeSlopes:
        """d force / d number of the modes; the elastic stiffness (N/m) is not asked here."""
        del stiffness
        memory = self.memory
        at, middle = loads(elastic, self.depth)
        z = memory.integrals(at, middle)
        in_times = memory.integral_slopes(z, at, middle)
        return ModeSlopes(at, z, memory.modes.weights[:, None] * in_times)
