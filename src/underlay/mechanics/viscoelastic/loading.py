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
    def _moves(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Numbers of the steps in which a tip moves, (m,), and depths (m) before and after each, (..., m + 1)."""
        moves = self.depth[..., 1:] != self.depth[..., :-1]
        moved = (moves if moves.ndim == 1 else moves.any(axis=0)).nonzero()[0]
        if _is_run(moved):
            return moved, self.depth[..., moved[0] : moved[-1] + 2]
        return moved, np.concatenate((self.depth[..., :1], self.depth[..., 1:].take(moved, axis=-1)), axis=-1)

    @cached_property
    def _split(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]] | None:
        """Steps that are asked in their middle, and that are interpolated; and for which set which, (..., m).

        None where all are asked.
        """
        moved, w = self._moves
        if w.ndim == 1 and len(moved) < _MANY:
            return None
        across = np.zeros((*w.shape[:-1], len(moved)), dtype=bool)
        step = w[..., 1:] - w[..., :-1]
        before, own, after = step[..., :-2], step[..., 1:-1], step[..., 2:]
        least, most = np.minimum(before, after), np.maximum(before, after)
        far = w[..., :-3] > _FROM_CONTACT * own
        across[..., 1:-1] = (_ALIKE * least > own) & (most < _ALIKE * own) & far
        if w.ndim == 1:
            return np.flatnonzero(~across), np.flatnonzero(across), across
        return np.flatnonzero(~across.all(axis=0)), np.flatnonzero(across.any(axis=0)), across

    def _cubic(
        self, split: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What the changes of the force in a step, the one before and the one after weigh in its bend, (..., q).

        Through the four points about a step h the cubic has, with a and c the steps beside it and s the slopes,
        bend = -h^2 [D + (D' - D) (h / 2 + a) / (a + h + c)],
        D = (s - s_before) / (a + h), D' = (s_after - s) / (h + c).
        """
        (_, w), (_, among, across) = self._moves, split
        step = w[..., 1:] - w[..., :-1]
        before, own, after = (step.take(among + beside, axis=-1) for beside in (-1, 0, 1))
        if step.ndim > 1:
            # Where this set is not interpolated it may not even move.
            before, own, after = (np.where(across[..., among], part, 1.0) for part in (before, own, after))
        late = (0.5 * own + before) / (before + own + after)
        first, last = own * (1.0 - late) / (before + own), own * late / (own + after)
        return last - first, first * own / before, -last * own / after

    @cached_property
    def asked(self) -> FloatArray:
        """Depths (m) at which the elastic force is asked, (..., q)."""
        w, split = self._moves[1], self._split
        first, second = w[..., :-1], w[..., 1:]
        if split is not None:
            first, second = first.take(split[0], axis=-1), second.take(split[0], axis=-1)
        return np.concatenate((w, 0.5 * (first + second)), axis=-1)

    def read(self, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces (N) at all points, (..., n), and their bend in each step (see `Memory.integrals`)."""
        moved, split, steps = self._moves[0], self._split, self.depth.shape[-1] - 1
        at, half = answers[..., : len(moved) + 1], answers[..., len(moved) + 1 :]
        bends = (
            4.0 * half - 2.0 * (at[..., 1:] + at[..., :-1]) if split is None else self._bends(at, half, split)
        )
        if len(moved) == steps:
            return at, bends
        # Where the tip rests, and before contact, the force is that of the point before.
        bend = np.zeros((*at.shape[:-1], steps))
        if _is_run(moved):
            run = slice(moved[0], moved[-1] + 1)
            bend[..., run] = bends
            force = np.empty((*at.shape[:-1], steps + 1))
            force[..., : run.start], force[..., run.stop :] = at[..., :1], at[..., -1:]
            force[..., run.start : run.stop + 1] = at
            return force, bend
        held = np.zeros(steps + 1, dtype=np.intp)
        held[moved + 1] = 1
        bend[..., moved] = bends
        return at.take(held.cumsum(), axis=-1), bend

    def _bends(
        self,
        at: FloatArray,
        half: FloatArray,
        split: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]],
    ) -> FloatArray:
        """Bend in the steps that move, of which some are interpolated."""
        exact, among, across = split
        change, bends = at[..., 1:] - at[..., :-1], np.empty((*at.shape[:-1], at.shape[-1] - 1))
        parts = zip(self._cubic(split), (0, -1, 1), strict=True)
        bends[..., among] = sum(part * change.take(among + beside, axis=-1) for part, beside in parts)
        known = 4.0 * half - 2.0 * (at.take(exact, axis=-1) + at.take(exact + 1, axis=-1))
        bends[..., exact] = known if at.ndim == 1 else np.where(across[..., exact], bends[..., exact], known)
        return bends


def _is_run(numbers: NDArray[np.intp]) -> bool:
    """Whether numbers in order (m,) leave none out: slices then take the place of lists of them."""
    return len(numbers) > 0 and int(numbers[-1] - numbers[0]) == len(numbers) - 1


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
