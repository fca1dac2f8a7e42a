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

# Steps from which on it takes less time to interpolate their middles than to ask the law.
_MANY = 256
# A step is interpolated where its neighbours are at most twice as long or short, and four steps and more from first
# contact: the cubic is then off by 5e-3 of the bend of w^(3/2), itself 1e-2 of the force there; ten steps from
# it by 1e-3 of 3e-3.
_ALIKE, _FROM_CONTACT = 2.0, 4.0


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
    def _moved(self) -> NDArray[np.intp]:
        """Numbers of the steps in which a tip moves, (m,)."""
        moves = self.depth[..., 1:] != self.depth[..., :-1]
        return np.flatnonzero(moves if moves.ndim == 1 else moves.any(axis=0))

    @cached_property
    def _points(self) -> FloatArray:
        """Depths (m) before the first and after each of those steps, (..., m + 1)."""
        if len(self._moved) == self.depth.shape[-1] - 1:
            return self.depth
        return np.concatenate((self.depth[..., :1], self.depth[..., self._moved + 1]), axis=-1)

    @cached_property
    def _split(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
        """Steps that are asked in their middle, and that are interpolated; and for which set which, (..., m)."""
        w, count = self._points, len(self._moved)
        across = np.zeros((*w.shape[:-1], count), dtype=bool)
        if w.ndim == 1 and count < _MANY:
            return np.arange(count), np.arange(0), across
        step = w[..., 1:] - w[..., :-1]
        before, own, after = step[..., :-2], step[..., 1:-1], step[..., 2:]
        least, most = np.minimum(before, after), np.maximum(before, after)
        far = w[..., :-3] > _FROM_CONTACT * own
        across[..., 1:-1] = (_ALIKE * least > own) & (most < _ALIKE * own) & far
        if w.ndim == 1:
            return np.flatnonzero(~across), np.flatnonzero(across), across
        return np.flatnonzero(~across.all(axis=0)), np.flatnonzero(across.any(axis=0)), across

    @cached_property
    def _cubic(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What the changes of the force in a step, the one before and the one after weigh in its bend.

        Through the four points about a step h the cubic has, with a and c the steps beside it and s the slopes,
        bend = -h^2 [D + (D' - D) (h / 2 + a) / (a + h + c)],
        D = (s - s_before) / (a + h), D' = (s_after - s) / (h + c).
        """
        step = self._points[..., 1:] - self._points[..., :-1]
        among = self._split[1]
        before, own, after = step[..., among - 1], step[..., among], step[..., among + 1]
        if step.ndim > 1:
            # Where this set is not interpolated it may not even move.
            moves = self._split[2][..., among]
            before, own, after = (np.where(moves, part, 1.0) for part in (before, own, after))
        late = (0.5 * own + before) / (before + own + after)
        first, last = own * (1.0 - late) / (before + own), own * late / (own + after)
        return last - first, first * own / before, -last * own / after

    @cached_property
    def asked(self) -> FloatArray:
        """Depths (m) at which the elastic force is asked, (..., q)."""
        w, exact = self._points, self._split[0]
        return np.concatenate((w, 0.5 * (w[..., exact] + w[..., exact + 1])), axis=-1)

    def read(self, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces (N) at all points, (..., n), and their bend in each step (see `Memory.integrals`)."""
        moved, (exact, among, across) = self._moved, self._split
        at, half = answers[..., : len(moved) + 1], answers[..., len(moved) + 1 :]
        change = at[..., 1:] - at[..., :-1]
        bends = np.empty_like(change)
        if among.size:
            own, before, after = self._cubic
            found = own * change[..., among]
            found += before * change[..., among - 1]
            found += after * change[..., among + 1]
            bends[..., among] = found
        known = 4.0 * half - 2.0 * (at[..., exact] + at[..., exact + 1])
        bends[..., exact] = known if at.ndim == 1 else np.where(across[..., exact], bends[..., exact], known)
        if len(moved) == self.depth.shape[-1] - 1:
            return at, bends
        # Where the tip rests, and before contact, the force is that of the point before.
        last_moved = np.zeros(self.depth.shape[-1], dtype=np.intp)
        last_moved[moved + 1] = 1
        bend = np.zeros((*at.shape[:-1], self.depth.shape[-1] - 1))
        bend[..., moved] = bends
        return at[..., np.cumsum(last_moved)], bend


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
        return self.memory.hereditary(*self._loads(elastic))

    def mode_slopes(self, elastic: Elastic, stiffness: Elastic) -> ModeSlopes:
        """d force / d number of the modes; the elastic stiffness (N/m) is not asked here."""
        del stiffness
        memory = self.memory
        at, bend = self._loads(elastic)
        z = memory.integrals(at, bend)
        in_times = memory.integral_slopes(z, at, bend)
        return ModeSlopes(at, z, memory.modes.weights[:, None] * in_times)

    @cached_property
    def _way_in(self) -> WayIn:
        return WayIn(np.maximum(self.depth, 0.0))

    def _loads(self, elastic: Elastic) -> tuple[FloatArray, FloatArray]:
        return self._way_in.read(elastic(self._way_in.asked))
