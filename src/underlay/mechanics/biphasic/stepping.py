"""A history of a rounded tip in steps of time: how fine, how far, and what lies between the steps.

Steps of even length resolve the shortest ramp; once the last ramp is over, levels of ever longer steps go on
through the hold, each from the beginning again: what is left of the ramp's details by then is below the error
of the steps. Each level is solved with half as many steps besides (Richardson; order 1.5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.mechanics.biphasic.history import Polyline
from underlay.mechanics.biphasic.material import Skeleton
from underlay.mechanics.biphasic.moving import MovingContact
from underlay.mechanics.relaxation import Modes

# The longest step (l^2/c), and the order in the step.
_LONGEST_STEP, _ORDER = 0.02, 1.5
# Steps of a level, how much coarser the next one is, and the most steps of a history without levels.
_LEVEL_STEPS, _COARSER, _MOST_STEPS = 120, 4, 1600
# The last ramp must be over by this share of the first level.
_SETTLED = 0.25


def between_bends(
    bends: FloatArray, nodes: FloatArray, values: FloatArray, first: float | None, time: FloatArray
) -> FloatArray:
    """Interpolate values at nodes to times, (n,), by cubics in the square root of the time since the last bend.

    `bends` are the times at which the slope of the depth history changes: there the force begins as a series in
    that root. `first` is the value at the first bend, if it is known.
    """
    starts = np.unique(bends)
    found = np.ones(time.shape)  # before the first bend nothing is touched
    for low, high in zip(starts, np.append(starts[1:], np.inf), strict=True):
        mine = (nodes > low * (1.0 + 1e-12)) & (nodes <= high * (1.0 + 1e-9))
        x, y = np.sqrt(nodes[mine] - low), values[mine]
        if first is not None:
            x, y = np.append(0.0, x), np.append(first, y)
        first = float(y[-1]) if y.size else first
        if y.size < 2:  # a ramp within one step of a coarse level: times that a finer one has
            continue
        here = (time > low) & (time <= high * (1.0 + 1e-9))
        found[here] = CubicSpline(x, y)(np.sqrt(time[here] - low))
    return found


@dataclass(frozen=True, eq=False)
class Stepping:
    """Solution of one depth history of a rounded tip in time steps of growing length, in dimensionless units.

    Lengths in a unit l, times in l^2/c (c the diffusivity), forces in A44 l^2 (A44 the axial shear modulus).

    Parameters
    ----------
    skeleton : Skeleton
        Drained skeleton of the layer.
    thickness : float
        h/l; inf for a half-space.
    drainage : str
        One of `DRAINAGES`.
    modes : Modes or None
        Relaxation of the skeleton, times in l^2/c.
    surface : callable
        Shape Phi(r) of the tip: its height above its lowest point at radii r.
    undrained : callable
        Force and contact radius, (n,) each, of the undrained elastic law at depths, (n,).
    depth : Polyline
        The depth history, from time zero.
    steps : int
        Number of time steps of the shortest ramp.
    """

    skeleton: Skeleton
    thickness: float
    drainage: str
    modes: Modes | None
    surface: Callable[[FloatArray], FloatArray]
    undrained: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    depth: Polyline
    steps: int

    @cached_property
    def sudden(self) -> bool:
        """Whether the history is one sudden step and a hold; InputError for a step beside other rises."""
        times = self.depth.jumps[0]
        if times.size and (times.size > 1 or times[0] > 0.0 or self.depth.rises.size):
            raise InputError(
                f"a sudden step at {times[-1]:.3g} a^2/c beside others is not simulated under a rounded tip: give "
                "each rise its duration"
            )
        return bool(times.size)

    @property
    def first(self) -> float | None:
        """Force over the undrained force at the beginning: 1 after a sudden step, else None (not known)."""
        return 1.0 if self.sudden else None

    def until(self, end: float) -> tuple[FloatArray, FloatArray]:
        """Solve to time `end`, or the first ramp's end if later; times, and force over undrained force, (n,)."""
        moved = 0.0 if self.sudden else float(self.depth.bends[0][-1])
        step = end / _LEVEL_STEPS / _COARSER if self.sudden else self._ramp_step
        last = max(end, 0.0 if self.sudden else float(self.depth.bends[0][1]))
        counts = [int(np.ceil(last / step - 1e-9)) + 1]
        if counts[0] > _LEVEL_STEPS and moved <= _SETTLED * _LEVEL_STEPS * step:
            counts = self._levels(counts[0])
        if counts[0] > _MOST_STEPS:
            raise RangeError(
                f"this history needs {counts[0]} steps of time, its shortest rise in {self.steps}, and "
                f"{_MOST_STEPS} is the most that is solved under a rounded tip: take fewer rises at once"
            )
        times, ratios, reached = [], [], 0.0
        for level, count in enumerate(counts):
            dt = step * _COARSER**level
            time, ratio = self._extrapolated(dt, count)
            beyond = time > reached * (1.0 + 1e-9)
            times.append(time[beyond])
            ratios.append(ratio[beyond])
            reached = float(time[-1])
        return np.concatenate(times), np.concatenate(ratios)

    @property
    def _ramp_step(self) -> float:
        """Time step that divides the shortest rise into a whole number of steps."""
        shortest = float(self.depth.rises.min())
        return shortest / max(self.steps, 2 * int(np.ceil(0.5 * shortest / _LONGEST_STEP)))

    @staticmethod
    def _levels(count: int) -> list[int]:
        """Numbers of time steps on levels whose steps are each 4 times as long, in place of `count` fine ones."""
        counts = []
        while count > _LEVEL_STEPS:
            counts.append(_LEVEL_STEPS)
            count = count // _COARSER + 1
        return [*counts, count]

    def _extrapolated(self, step: float, count: int) -> tuple[FloatArray, FloatArray]:
        """Times and force over undrained force, (count,), by Richardson extrapolation from steps dt and 2 dt."""
        time, fine = self._stepped(step, count)
        later, coarse = self._stepped(2.0 * step, count // 2 + 1)
        bends = self.depth.time
        change = between_bends(bends, time, fine, self.first, later) - coarse
        correction = np.asarray(change / (2.0**_ORDER - 1.0), dtype=np.float64)
        none = 0.0 if self.sudden else None
        return time, fine + between_bends(bends, later, correction, none, time)

    def _stepped(self, step: float, count: int) -> tuple[FloatArray, FloatArray]:
        time = np.asarray(step * np.arange(1, count + 1), dtype=np.float64)
        depth = np.maximum(self.depth.at(time), 0.0)
        moving = MovingContact(self.skeleton, self.thickness, self.drainage, step, count, modes=self.modes)
        undrained, radius = self.undrained(depth)
        force = moving.run(depth, self.surface, radius).force
        touching = undrained > 0.0
        ratio = np.where(touching, force, 1.0) / np.where(touching, undrained, 1.0)
        return (time - 0.5 * step if self.sudden else time), ratio
