"""The force while the contact does not shrink: P(t) = int e(t - s) dP_el(w(s)) (Lee and Radok 1960)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.response import Elastic
from underlay.mechanics.viscoelastic.memory import Memory

__all__ = ["Loading", "ModeSlopes", "WayIn"]


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


@dataclass(frozen=True)
class WayIn:
    """Where an elastic force is asked on the way in, and what is read off the answers.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), zero before contact, (n,), or of many sets (sets, n).
    """

    depth: FloatArray

    @cached_property
    def rest(self) -> int:
        """Number of the point from which on the tips rest."""
        moved = self._moves[0]
        return int(moved[-1]) + 1 if len(moved) else 0

    @cached_property
    def asked(self) -> FloatArray:
        """Depths (m) at which the elastic force is asked, (..., q): of the points, then in the middle of steps."""
        w = self._moves[1]
        count = w.shape[-1]
        depth = np.empty((*w.shape[:-1], 2 * count - 1))
        depth[..., :count] = w
        np.add(w[..., 1:], w[..., :-1], out=depth[..., count:])
        depth[..., count:] *= 0.5
        return depth

    def moving(self, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces (N) up to the point of rest, (..., r + 1), and their bend in each step of `Memory.integrals`."""
        moved, steps = self._moves[0], self.rest
        at, half = answers[..., : len(moved) + 1], answers[..., len(moved) + 1 :]
        bends = 4.0 * half
        bends -= 2.0 * (at[..., 1:] + at[..., :-1])
        if len(moved) == steps:
            return at, bends
        # Where the tip rests, and before contact, the force is that of the point before.
        held = np.zeros(steps + 1, dtype=np.intp)
        held[moved + 1] = 1
        bend = np.zeros((*at.shape[:-1], steps))
        bend[..., moved] = bends
        return at.take(held.cumsum(), axis=-1), bend

    def read(self, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same for all points, (..., n) and (..., n - 1)."""
        values, bend = self.moving(answers)
        still = self.depth.shape[-1] - 1 - self.rest
        if not still:
            return values, bend
        held = np.broadcast_to(values[..., -1:], (*values.shape[:-1], still))
        return np.concatenate((values, held), axis=-1), np.concatenate((bend, np.zeros(held.shape)), axis=-1)

    @cached_property
    def _moves(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Numbers of the steps in which a tip moves, (m,), and depths (m) before and after each, (..., m + 1)."""
        moves = self.depth[..., 1:] != self.depth[..., :-1]
        moved = (moves if moves.ndim == 1 else moves.any(axis=0)).nonzero()[0]
        if len(moved) and moved[-1] - moved[0] == len(moved) - 1:
            # None is left out: a slice takes the place of a list.
            return moved, self.depth[..., moved[0] : moved[-1] + 2]
        return moved, np.concatenate((self.depth[..., :1], self.depth[..., 1:].take(moved, axis=-1)), axis=-1)


@dataclass(frozen=True)
class Loading:
    """The map from an elastic force to that of one motion which only grows or rests, or of one for each set.

    The elastic force is taken as quadratic in time over each step. Measured on a paraboloid, a ramp over 2.5
    relaxation times, relative to the largest force: 9e-7 with 10 points on the ramp, 2e-8 with 50, 5e-10 with
    200.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), (n,) or (sets, n).
    memory : Memory
        Their clock.
    """

    depth: FloatArray
    memory: Memory

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), of the shape of the depths."""
        memory, rest = self.memory, self._way_in.rest
        values, bend = self._way_in.moving(elastic(self._way_in.asked))
        z = memory.integrals(values, bend)
        force = np.empty(self.depth.shape)
        np.multiply(values, memory.modes.constant, out=force[..., : rest + 1])
        force[..., : rest + 1] += memory.weighted(z)
        if rest + 1 < self.depth.shape[-1]:
            force[..., rest + 1 :] = memory.modes.constant * values[..., -1:]
            force[..., rest + 1 :] += memory.faded(z[..., -1], rest)
        return force

    def mode_slopes(self, elastic: Elastic, stiffness: Elastic) -> ModeSlopes:
        """d force / d number of the modes; the elastic stiffness (N/m) is not asked here."""
        del stiffness
        memory = self.memory
        at, bend = self._way_in.read(elastic(self._way_in.asked))
        z = memory.integrals(at, bend)
        in_times = memory.integral_slopes(z, at, bend)
        return ModeSlopes(at, z, memory.modes.weights[:, None] * in_times)

    @cached_property
    def _way_in(self) -> WayIn:
        return WayIn(np.maximum(self.depth, 0.0))
