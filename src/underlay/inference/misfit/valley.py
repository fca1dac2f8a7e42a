"""The profile of a parameter under one combination of noise, drift and jump.

Where the model is far from linear over an interval (a thickness that is free, a base that might be rigid) the
interval of the linearised model is not enough. Here the parameter is held, and all others, the drift and the jump
are fitted again: T = z^2 is the rise of the whitened sum of squares over its variance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import interpolate

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.descent import Combination, Place, descend

__all__ = ["FARTHEST", "Valley", "crossing"]

_STEP = 1.2  # in z
_STEEPEST = 1.6
_GROWTH = 2.0
_FIRST = 0.25  # the longest first step, in a scaled coordinate
#: As far as a profile is walked, in a scaled coordinate: a factor of 150, or five times the range of the curve.
FARTHEST = 5.0
# A law that nothing tabulates costs some 50 ms: so many places on the way, and steps of a descent to each.
_MOST_STEPS, _DESCENT = 10, 6
_SHORTEST = 0.02
# A path that would have to rise so much steeper than it did on its last step ends open where the laws do.
_STEEPER = 2.0
# Shares of a step that went too far.
_LEAST, _MOST = 0.2, 0.7


@dataclass(frozen=True)
class Valley:
    """One combination and its optimum."""

    blocked: Blocked
    combination: Combination
    optimum: Place
    _beyond: dict[tuple[int, float], Place] = field(default_factory=dict, init=False)

    def z(self, place: Place) -> float:
        """Root of the rise of a place above the optimum."""
        return math.sqrt(max(place.square - self.optimum.square, 0.0) / self.optimum.variance)

    def held(self, index: int, q: float, start: FloatArray) -> Place | None:
        """Best place with an entry at `q`, from a scaled vector (k,); None where there is no law."""
        here = self.optimum.vector
        begin = np.clip(start, here - FARTHEST, here + FARTHEST)
        begin[index] = q
        low, high = self.blocked.problem.bounds.T
        try:
            return descend(self.blocked, np.clip(begin, low, high), self.combination, index, _DESCENT)
        except InputError:
            return None

    def agrees(self, index: int, q: float, z: float, within: float) -> bool:
        """Whether the profile's z at `q` is the one expected, to a share `within`."""
        low, high = self.blocked.problem.bounds[index]
        if not low <= q <= high or abs(q - float(self.optimum.vector[index])) > FARTHEST:
            return False
        gone = q - float(self.optimum.vector[index])
        place = self.held(index, q, self.optimum.vector + self._tangent(index) * gone)
        if place is None:
            return False
        # A path that is walked that way comes by here.
        self._beyond[index, math.copysign(1.0, gone)] = place
        return abs(self.z(place) - z) <= within * z

    def end(self, index: int, direction: float, z: float) -> float:
        """Where the profile first reaches `z`, going one way: scaled; infinite where it does not.

        Raises
        ------
        InputError
            If there is no law at the optimum.
        """
        return crossing(*self.path(index, direction, z), z, direction)

    def path(self, index: int, direction: float, highest: float) -> tuple[FloatArray, FloatArray]:
        """Scaled values of an entry from the optimum one way, (m,), and z at each, until that is `highest`.

        Raises
        ------
        InputError
            If there is no law at the optimum.
        """
        here = float(self.optimum.vector[index])
        bound = self.blocked.problem.bounds[index][1 if direction > 0.0 else 0]
        room = min(abs(bound - here), FARTHEST)
        vectors, heights = [self.optimum.vector], [0.0]
        tangent = self._tangent(index)
        step = min(_STEP * self._deviation(index), _FIRST)
        tried = self._beyond.get((index, direction))
        beyond = None if tried is None else (tried.vector, self.z(tried))
        if beyond is not None:
            step = min(step, _MOST * abs(float(beyond[0][index]) - here))
        for _ in range(_MOST_STEPS):
            gone = abs(float(vectors[-1][index]) - here)
            step = min(step, room - gone)
            if step <= 1e-9 * (1.0 + gone):
                break
            begin = _ahead(vectors, index, step) if gone else vectors[0] + direction * step * tangent
            place = self.held(index, here + direction * (gone + step), begin)
            height = math.inf if place is None else max(self.z(place), heights[-1])
            if place is None and not self._may_reach(highest, heights, vectors, index, step):
                break
            if height - heights[-1] > _STEEPEST and step > _SHORTEST:
                # What was found too far ahead serves where the path comes near it.
                beyond = beyond if place is None else (place.vector, height)
                step *= max(_LEAST, min(_STEP / (height - heights[-1]), _MOST))
                continue
            if place is None:
                break
            vectors.append(place.vector)
            heights.append(height)
            if beyond is not None and beyond[1] - height <= _STEEPEST:
                vectors.append(beyond[0])
                heights.append(max(beyond[1], height))
                beyond = None
            if heights[-1] >= highest:
                break
            step = abs(float(vectors[-1][index] - vectors[-2][index]))
            slope = (heights[-1] - heights[-2]) / step
            step = min(_STEP / slope, _GROWTH * step) if slope > 0.0 else _GROWTH * step
            if beyond is not None:
                step = min(step, _MOST * abs(float(beyond[0][index] - vectors[-1][index])))
        return np.array([vector[index] for vector in vectors]), np.array(heights)

    @staticmethod
    def _may_reach(
        highest: float, heights: list[float], vectors: list[FloatArray], index: int, room: float
    ) -> bool:
        """Whether a path could still rise to `highest` before the laws end, `room` further on.

        It would have to rise more than twice as steeply as on its last step: then its end is an open one.
        """
        if len(heights) < 2:
            return True
        slope = (heights[-1] - heights[-2]) / abs(float(vectors[-1][index] - vectors[-2][index]))
        return heights[-1] + _STEEPER * slope * room >= highest

    @cached_property
    def _covariance(self) -> FloatArray:
        return np.asarray(np.linalg.pinv(self.optimum.normal) * self.optimum.variance)

    def _deviation(self, index: int) -> float:
        own = float(self._covariance[index, index])
        return math.sqrt(own) if own > 0.0 else 1.0

    def _tangent(self, index: int) -> FloatArray:
        """d others / d entry along the profile at the optimum."""
        column = self._covariance[index]
        tangent = column / column[index] if column[index] > 0.0 else np.zeros(len(column))
        tangent[index] = 1.0
        return np.asarray(tangent)


def _ahead(vectors: list[FloatArray], index: int, step: float) -> FloatArray:
    """Where the others would be, along the last step."""
    moved = vectors[-1] - vectors[-2]
    return np.asarray(vectors[-1] + moved * (step / abs(float(moved[index]))))


def crossing(q: FloatArray, z: FloatArray, height: float, direction: float) -> float:
    """Where z first reaches a height along a path (m,) that goes one way; infinite where it does not."""
    reached = np.flatnonzero(z >= height)
    if not reached.size:
        return direction * math.inf
    q, z = q[: reached[0] + 1], z[: reached[0] + 1]
    fraction = (height - z[-2]) / (z[-1] - z[-2])
    if len(q) < 3:
        return float(q[-2] + fraction * (q[-1] - q[-2]))
    distance = np.abs(q - q[0])
    inside = interpolate.PchipInterpolator(distance, z)
    roots = [root for root in inside.solve(height, extrapolate=False) if root >= distance[-2]]
    found = roots[0] if roots else distance[-2] + fraction * (distance[-1] - distance[-2])
    return float(q[0] + np.sign(q[-1] - q[0]) * found)
