"""The profile of a parameter under one combination of noise, drift and jump.

Where the model is far from linear over an interval (a thickness that is free, a base that might be rigid) the
interval of the linearised model is not enough. Here the parameter is held, and all others, the drift and the jump
are fitted again: T = z^2 is the rise of the whitened sum of squares over its variance. A place on the profile says
its slope as well, so that cubics between few places are the profile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import optimize

from underlay.errors import InputError
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.descent import Combination, Place, descend

__all__ = ["FARTHEST", "Path", "Valley"]

# In z: as far as one step goes, and rises that are still one.
_STEP, _STEEPEST = 2.2, 2.8
# A step aims so much further than it has to reach: between stops a cubic is sure, and a profile may flatten.
_FURTHER = 1.2
# What is left of z, and of the way over what has been gone, where the last slope says how it goes on.
_LITTLE, _NEAR = 0.3, 0.25
_GROWTH = 2.0
_FIRST = 0.5  # the longest first step, in a scaled coordinate
#: As far as a profile is walked, in a scaled coordinate: a factor of 150, or five times the range of the curve.
FARTHEST = 5.0
# A law that nothing tabulates costs some 50 ms: so many places on the way, and steps of a descent to each.
_MOST_STEPS, _DESCENT = 10, 6
_SHORTEST = 0.02
# A path that would have to rise so much steeper than it did on its last step ends open where the laws do.
_STEEPER = 2.0
# Shares of a step that went too far.
_LEAST, _MOST = 0.2, 0.7
# Of z: two parabolas that differ by no more, each through one slope less than the cubic, leave it right to a part.
_ALIKE = 0.1


class Stop(NamedTuple):
    """A place on a path, how far that is from the optimum, its z, and how z rises there."""

    place: Place
    gone: float
    z: float
    slope: float


@dataclass(frozen=True)
class Path:
    """A profile from the optimum one way: its stops, the optimum the first, and the way (-1 or 1)."""

    start: float
    direction: float
    stops: list[Stop]

    def crossing(self, height: float) -> float:
        """Where z first reaches a height, scaled; infinite where it does not."""
        last = self.first_at(height)
        if last is None:
            return self.direction * math.inf
        return self.start + self.direction * self._between(last, height)

    def is_settled(self, height: float) -> bool:
        """Whether the cubic about a height is sure: two parabolas say nearly the same."""
        last = self.first_at(height)
        if last is None:
            return True
        low, high = self.stops[last - 1], self.stops[last]
        wide = high.gone - low.gone
        share = (self._between(last, height) - low.gone) / wide
        bend = (low.slope + high.slope) * wide - 2.0 * (high.z - low.z)
        return abs(bend) * share * (1.0 - share) * max(share, 1.0 - share) <= _ALIKE

    def first_at(self, height: float) -> int | None:
        """Number of the first stop at a height or above it."""
        return next((number for number, stop in enumerate(self.stops) if number and stop.z >= height), None)

    def _between(self, last: int, height: float) -> float:
        """How far from the optimum the height is reached between a stop and the one before it."""
        low, high = self.stops[last - 1], self.stops[last]
        wide, rise = high.gone - low.gone, high.z - low.z
        # Slopes of up to three secants leave a cubic monotone (Fritsch and Carlson 1980, doi:10.1137/0717021).
        first, final = (min(max(stop.slope * wide, 0.0), 3.0 * rise) for stop in (low, high))

        def missing(share: float) -> float:
            bent = (first + final - 2.0 * rise) * share + 3.0 * rise - 2.0 * first - final
            return low.z + share * (first + share * bent) - height

        return low.gone + wide * (optimize.brentq(missing, 0.0, 1.0) if missing(1.0) > 0.0 else 1.0)


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

    def held(self, index: int, q: float, near: Place) -> Place | None:
        """Best place with an entry at `q`, from a place near by; None where there is no law."""
        here = self.optimum.vector
        begin = near.vector + near.tangent(index) * (q - float(near.vector[index]))
        begin = np.clip(begin, here - FARTHEST, here + FARTHEST)
        begin[index] = q
        begin = np.clip(begin, *self.blocked.problem.bounds.T)
        try:
            return descend(self.blocked, begin, self.combination, index, _DESCENT, misfits=near.misfits)
        except InputError:
            return None

    def agrees(self, index: int, q: float, z: float, within: float) -> bool:
        """Whether the profile's z at `q` is the one expected, to a share `within`."""
        low, high = self.blocked.problem.bounds[index]
        if not low <= q <= high or abs(q - float(self.optimum.vector[index])) > FARTHEST:
            return False
        place = self.held(index, q, self.optimum)
        if place is None:
            return False
        # A path that is walked that way comes by here.
        self._beyond[index, math.copysign(1.0, q - float(self.optimum.vector[index]))] = place
        return abs(self.z(place) - z) <= within * z

    def end(self, index: int, direction: float, z: float) -> float:
        """Where the profile first reaches `z`, going one way: scaled; infinite where it does not.

        Raises
        ------
        InputError
            If there is no law at the optimum.
        """
        return self.path(index, direction, z).crossing(z)

    def path(self, index: int, direction: float, highest: float) -> Path:
        """Profile of an entry from the optimum one way, until z is `highest`.

        Raises
        ------
        InputError
            If there is no law at the optimum.
        """
        here = float(self.optimum.vector[index])
        bound = self.blocked.problem.bounds[index][1 if direction > 0.0 else 0]
        room = min(abs(bound - here), FARTHEST)
        steepness = math.sqrt(max(self.optimum.curvature(index), 0.0) / self.optimum.variance)
        stops = [Stop(self.optimum, 0.0, 0.0, steepness)]
        tried = self._beyond.get((index, direction))
        beyond = None if tried is None else self._stop(index, tried, stops[0])
        longest = _FIRST
        for _ in range(_MOST_STEPS):
            last = stops[-1]
            step = min(self._length(last, highest), longest, room - last.gone)
            if beyond is not None and beyond.z - last.z <= _STEEPEST:
                stop: Stop | None = beyond
                beyond = None
            elif step <= 1e-9 * (1.0 + last.gone):
                break
            else:
                if beyond is not None:
                    step = min(step, _MOST * (beyond.gone - last.gone))
                place = self.held(index, here + direction * (last.gone + step), last.place)
                if place is None and not self._may_reach(highest, stops, step):
                    break
                stop = None if place is None else self._stop(index, place, last)
            rise = math.inf if stop is None else stop.z - last.z
            if rise > _STEEPEST and step > _SHORTEST:
                # What was found too far ahead serves where the path comes near it.
                beyond = stop or beyond
                longest = step * max(_LEAST, min(_STEP / rise, _MOST))
                continue
            if stop is None:
                break
            stops.append(stop)
            longest = _GROWTH * (stop.gone - last.gone)
            left = self._little_left(stop, highest)
            if left < min(room - stop.gone, _NEAR * stop.gone):
                stops.append(self._onwards(index, stop, direction * left, highest))
            if stops[-1].z >= highest:
                break
        return self._settled(index, Path(here, direction, stops), highest)

    def _settled(self, index: int, path: Path, height: float) -> Path:
        """Return the path with a further stop where a height is reached, if the cubic there is not sure."""
        if path.is_settled(height):
            return path
        after = path.first_at(height)
        place = (
            None if after is None else self.held(index, path.crossing(height), path.stops[after - 1].place)
        )
        if after is None or place is None:
            return path
        stop = self._stop(index, place, path.stops[after - 1])
        return Path(path.start, path.direction, [*path.stops[:after], stop, *path.stops[after:]])

    def _stop(self, index: int, place: Place, last: Stop) -> Stop:
        """A place as the next stop: z does not fall, and does not rise where it would."""
        way = float(place.vector[index]) - float(self.optimum.vector[index])
        z = self.z(place)
        if z <= last.z:
            return Stop(place, abs(way), last.z, 0.0)
        slope = math.copysign(float(place.gradient[index]), way * float(place.gradient[index]))
        return Stop(place, abs(way), z, slope / (z * self.optimum.variance))

    @staticmethod
    def _length(last: Stop, highest: float) -> float:
        """Length of the step that should reach what is wanted, and no further than one step goes."""
        rise = min(_FURTHER * (highest - last.z), _STEP)
        return rise / last.slope if last.slope > 0.0 else math.inf

    @staticmethod
    def _little_left(last: Stop, highest: float) -> float:
        """How far it is to a height that lies little above a stop; infinite where it lies further above."""
        if not 0.0 < highest - last.z <= _LITTLE or not last.slope > 0.0:
            return math.inf
        return (highest - last.z) / last.slope

    @staticmethod
    def _onwards(index: int, last: Stop, step: float, highest: float) -> Stop:
        """Where a path reaches a height a little beyond a stop, as the linear model has it there."""
        place = last.place.moved(last.place.vector + step * last.place.tangent(index))
        return Stop(place, last.gone + abs(step), highest, last.slope)

    @staticmethod
    def _may_reach(highest: float, stops: list[Stop], room: float) -> bool:
        """Whether a path could still rise to `highest` before the laws end, `room` further on.

        It would have to rise more than twice as steeply as on its last step: then its end is an open one.
        """
        if len(stops) < 2:
            return True
        before, last = stops[-2:]
        slope = (last.z - before.z) / (last.gone - before.gone)
        return last.z + _STEEPER * slope * room >= highest
