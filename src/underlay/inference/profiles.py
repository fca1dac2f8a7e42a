"""Profile likelihood: how far a parameter can go before the data object, all others following it.

For each value of the parameter the others are fitted again; with frozen noise the rise of the weighted sum
of squares is t = S(q) - S_min, and an interval is where t stays below the quantile of chi-square with one
degree of freedom, or of F(1, n - k) where the size of the noise was estimated. Unlike a standard error this
can end at one side and never at the other, and it says so.

The profile is walked from the optimum in steps of about half a standard deviation of z = sqrt(t), in which
it is nearly straight, and read between the steps by monotone interpolation. lmfit's `conf_interval` looks
for two crossings and fails where one does not exist.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import interpolate, stats

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.inference.fitting.fit_result import Fit
from underlay.inference.fitting.objective import Minimum, Objective, Weights, weights_at
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.least_squares import minimise
from underlay.inference.problem import Problem
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

__all__ = ["Interval", "Profile", "interval_threshold", "profile", "rise_at"]

_STEP = 0.5  # in z: monotone cubics through these steps place a crossing to 1e-3 standard deviations
_HIGHEST = 3.4  # z of a 99.9 % interval, and a little more
_STEEPEST = 2.0 * _STEP  # a rise of z in one step beyond which the step is taken again, shorter
_GROWTH = 3.0  # a flattening profile is walked in steps at most this much longer each time
# In scaled coordinates, from the optimum and from the scene's own value: a factor 1.6e5, or twelve times the
# range of the curve.
_FARTHEST = 12.0
_MOST_STEPS = 60
_MOST_EVALUATIONS = 200  # of one refit; from a neighbour ten are usual
# An entry that moves all readings together by less than this many standard deviations per unit lies on a plateau.
_FLAT = 1e-3
# A fit found to be this much worse (in t) than a point of its own profile was not the optimum.
_BETTER = 1e-3


@dataclass(frozen=True)
class Interval:
    """Confidence interval of one parameter (SI); infinite where the data set no end.

    Parameters
    ----------
    name : str
        The parameter.
    level : float
        Confidence, e.g. 0.95.
    low, high : float
        Ends (SI): -inf or inf where the data set none. Where a bound given by the caller or the reach of the
        law ends it, that value.
    low_reason, high_reason : str
        ``"data"``, ``"bound"`` (the caller's), ``"law"`` (no contact law beyond), or ``"none"``.
    """

    name: str
    level: float
    low: float
    high: float
    low_reason: str
    high_reason: str

    def __str__(self) -> str:
        kind = kind_of(self.name.partition("[")[0])
        low, high = format_quantity(self.low, kind), format_quantity(self.high, kind)
        at = f"({100.0 * self.level:g} %)"
        has_low, has_high = self.low_reason == "data", self.high_reason == "data"
        if has_low and has_high:
            return f"{self.name} between {low} and {high} {at}"
        if has_low:
            limit = self._limit(self.high_reason, high)
            return f"{self.name} > {low} {at}; no upper bound from these data{limit}"
        if has_high:
            limit = self._limit(self.low_reason, low)
            return f"{self.name} < {high} {at}; no lower bound from these data{limit}"
        return f"{self.name} is not bounded by these data {at}"

    @staticmethod
    def _limit(reason: str, value: str) -> str:
        words = {"bound": f", only its own limit {value}", "law": f", as far as the law reaches ({value})"}
        return words.get(reason, "")


@dataclass(frozen=True, eq=False)
class Profile:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    name : str
        The parameter.
    fit : Fit
        The optimum it starts from; a better one than was handed in, if the walk found one.
    values : FloatArray
        Values of the parameter (SI), (m,), increasing.
    rise : FloatArray
        t at each, (m,): zero at the optimum.
    vectors : FloatArray
        Scaled vectors with the other parameters fitted, (m, k).
    ends : tuple of str
        Why the walk ended below and above: ``"data"``, ``"bound"``, ``"law"`` or ``"none"``.
    branches : tuple of Profile
        The same about every other optimum of the fit, t still measured from the best.
    """

    name: str
    fit: Fit
    values: FloatArray
    rise: FloatArray
    vectors: FloatArray
    ends: tuple[str, str]
    branches: tuple[Profile, ...] = ()

    def threshold(self, level: float) -> float:
        """t that bounds an interval of this confidence.

        Raises
        ------
        InputError
            If the level is not between 0 and 0.999.
        """
        return interval_threshold(self.fit, level)

    def interval(self, level: float = 0.95) -> Interval:
        """Values the data do not reject at this level; see `Interval` for ends that are not there.

        With a second optimum that is not rejected it is the hull of both.
        """
        z = float(np.sqrt(self.threshold(level)))
        parts = [self, *(branch for branch in self.branches if np.sqrt(branch.rise.min()) <= z)]
        low, low_reason = min((part.end(z, upper=False) for part in parts), key=lambda end: end[0])
        high, high_reason = max((part.end(z, upper=True) for part in parts), key=lambda end: end[0])
        return Interval(self.name, level, low, high, low_reason, high_reason)

    def end(self, z: float, *, upper: bool) -> tuple[float, str]:
        """Where the values below `z` end on one side (SI), and why: a reason as in `Interval`."""
        index = self.fit.names.index(self.name)
        coordinate = self.fit.problem.coordinates[index]
        best = int(np.argmin(self.rise))
        outwards = slice(best, None) if upper else slice(best, None, -1)
        q, reason = self.vectors[outwards, index], self.ends[int(upper)]
        crossing = _crossing(q, np.sqrt(self.rise[outwards]), z)
        if crossing is not None:
            return float(coordinate.physical(np.asarray(crossing))), "data"
        if reason == "bound":
            return coordinate.high if upper else coordinate.low, "bound"
        if reason == "law":
            return float(coordinate.physical(q[-1])), "law"
        return (np.inf if upper else -np.inf), "none"


def interval_threshold(fit: Fit, level: float) -> float:
    """Rise t that bounds an interval: chi-square's quantile, F's where the noise was estimated.

    Raises
    ------
    InputError
        If the level is not between 0 and 0.999.
    """
    if not 0.0 < level <= 0.999:
        raise InputError(f"level must be above 0 and at most 0.999; got {level!r}")
    if fit.statistics.noise_estimated or fit.problem.noise_entries:
        return float(stats.f.ppf(level, 1, fit.statistics.points - fit.statistics.parameters))
    return float(stats.chi2.ppf(level, 1))


def profile(problem: Problem | Fit, name: str) -> Profile:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    problem : Problem or Fit
        What is asked; a problem is fitted first.
    name : str
        The parameter, as in `Problem.names`; not one of the noise's.

    Raises
    ------
    InputError
        If the parameter is not free, or is the noise's.
    """
    fit = least_squares_fit(problem) if isinstance(problem, Problem) else problem
    if name not in fit.names:
        raise InputError(f"{name!r} is not free here; free are {', '.join(fit.names)}")
    if name.startswith("noise."):
        raise InputError(
            f"{name!r}: profiles freeze the noise; take its standard error, or sample the posterior"
        )
    index = fit.names.index(name)
    below, above = (_Walk.start(fit, index).go(direction) for direction in (-1.0, 1.0))
    better = min((below, above), key=lambda walk: walk.lowest)
    if better.lowest < -_BETTER:
        # The walk passed through a lower minimum: begin again from there.
        again = _refit(fit, better.vectors[int(np.argmin(better.rises))])
        if again.statistics.chi_square < fit.statistics.chi_square:
            return profile(again, name)
    branches = []
    for other in fit.alternatives:
        left, right = (_Walk.start(fit, index, other.vector).go(direction) for direction in (-1.0, 1.0))
        branches.append(_joined(fit, name, left, right))
    return _joined(fit, name, below, above, tuple(branches))


def _joined(fit: Fit, name: str, below: _Walk, above: _Walk, branches: tuple[Profile, ...] = ()) -> Profile:
    index = fit.names.index(name)
    vectors = np.array([*below.vectors[:0:-1], *above.vectors])
    rise = np.maximum(np.array([*below.rises[:0:-1], *above.rises]), 0.0)
    return Profile(
        name=name,
        fit=fit,
        values=read_only(fit.problem.coordinates[index].physical(vectors[:, index])),
        rise=read_only(rise),
        vectors=read_only(vectors),
        ends=(below.reason, above.reason),
        branches=branches,
    )


def rise_at(fit: Fit, name: str, value: float) -> float:
    """T of one value (SI): how much the sum of squares rises when the parameter is held there.

    The value is inside the interval of a level where this is at most `Profile.threshold`; one refit
    instead of a walk.

    Raises
    ------
    InputError
        If the parameter is not free, the value is outside its bounds, or no law exists there.
    """
    if name not in fit.names:
        raise InputError(f"{name!r} is not free here; free are {', '.join(fit.names)}")
    index = fit.names.index(name)
    coordinate = fit.problem.coordinates[index]
    if not coordinate.low <= value <= coordinate.high:
        raise InputError(
            f"{name} = {value!r} is outside its bounds [{coordinate.low!r}, {coordinate.high!r}]"
        )
    rises = []
    for optimum in (fit.vector, *(other.vector for other in fit.alternatives)):
        walk = _Walk.start(fit, index, optimum)
        found = walk.fit_at(coordinate.scaled(value))
        if found is not None:
            rises.append(float(np.square(walk.objective.residuals(found.vector)).sum()) - walk.base)
    if not rises:
        raise InputError(f"no contact law at {name} = {value!r}")
    return min(rises)


def _refit(fit: Fit, vector: FloatArray) -> Fit:
    problem = fit.problem
    moved = problem.revised(scenes=problem.scenes(vector))
    return least_squares_fit(moved, start="given")


def _crossing(q: FloatArray, z: FloatArray, level: float) -> float | None:
    """Outermost place where z passes `level`, walking outwards; None if it never does for good."""
    last = int(np.flatnonzero(z <= level)[-1])
    if last == len(z) - 1:
        return None
    # z is made increasing before it is inverted: beyond a second minimum only the last rise counts.
    above = np.flatnonzero(z[:last] > level)
    rise = slice(int(above[-1]) + 1 if len(above) else 0, last + 2)
    rising = np.maximum.accumulate(z[rise])
    kept = np.concatenate([[True], np.diff(rising) > 0.0])
    if kept.sum() < 3:
        return float(np.interp(level, rising[kept], q[rise][kept]))
    return float(interpolate.PchipInterpolator(rising[kept], q[rise][kept])(level))


@dataclass(frozen=True, eq=False)
class _Walk:
    """Steps of a profile from the optimum to one side."""

    fit: Fit
    index: int
    objective: Objective
    base: float
    vectors: list[FloatArray]
    rises: list[float]
    reason: str = "none"

    @classmethod
    def start(cls, fit: Fit, index: int, vector: FloatArray | None = None) -> _Walk:
        """Stand at the optimum, or another one, with the noise of the fit frozen."""
        weights: Weights = weights_at(fit.problem, fit.vector, fit.noises)
        objective = Objective(fit.problem, weights, held=frozenset({index}))
        base = float(np.square(objective.residuals(fit.vector)).sum())
        if vector is None:
            return cls(fit, index, objective, base, [np.array(fit.vector)], [0.0])
        rise = float(np.square(objective.residuals(vector)).sum()) - base
        return cls(fit, index, objective, base, [np.array(vector)], [rise])

    @property
    def lowest(self) -> float:
        """Smallest t met: below zero if the fit was not the optimum."""
        return min(self.rises)

    def go(self, direction: float) -> _Walk:
        """Walk until the rise ends every interval, or the parameter or the law does."""
        bound = self.fit.problem.bounds[self.index][1 if direction > 0.0 else 0]
        here = float(self.vectors[0][self.index])
        room = abs(bound - here)
        step = self._first_step()
        for _ in range(_MOST_STEPS):
            travelled = abs(float(self.vectors[-1][self.index]) - here)
            step = min(step, room - travelled)
            if step <= 1e-12 * (1.0 + travelled):
                return replace(self, reason="bound")
            # An optimum far out on a plateau (a base that might be rigid) is walked back from all the way.
            if travelled >= _FARTHEST and direction * float(self.vectors[-1][self.index]) >= _FARTHEST:
                return replace(self, reason="none")
            failures = self.objective.failures
            found = self.fit_at(here + direction * (travelled + step))
            if found is None or self._is_wall(failures, found):
                if step < 1e-3 * self._first_step():
                    return replace(self, reason="law")
                step *= 0.25
                continue
            rise = float(np.square(self.objective.residuals(found.vector)).sum()) - self.base
            climb = float(np.sqrt(max(rise, 0.0)) - np.sqrt(max(self.rises[-1], 0.0)))
            if climb > _STEEPEST and step > 1e-3 * self._first_step():
                # A valley that lies open at the optimum and closes further on: its curvature there, or the
                # slope of the last step, foretold too long a step, and there is nothing to read between.
                step *= max(_STEP / climb, 0.1)
                continue
            self.vectors.append(found.vector)
            self.rises.append(rise)
            if self.rises[-1] > _HIGHEST**2:
                return replace(self, reason="data")
            step = self._next_step(step)
        return replace(self, reason="none")

    def _is_wall(self, failures: int, found: Minimum) -> bool:
        """Whether no law exists at the place the minimiser stopped."""
        if self.objective.failures == failures:
            return False
        before = self.objective.failures
        self.objective.residuals(found.vector)
        return self.objective.failures > before

    def _first_step(self) -> float:
        deviation = float(np.sqrt(self.fit.scaled_covariance[self.index, self.index]))
        return _STEP * deviation if 0.0 < deviation < 1.0 else 0.1

    def _next_step(self, step: float) -> float:
        """Step for half a unit more of z, from the slope of the last one."""
        z = np.sqrt(np.maximum(self.rises[-2:], 0.0))
        slope = (z[1] - z[0]) / step
        return min(_STEP / slope, _GROWTH * step) if slope > 0.0 else _GROWTH * step

    def fit_at(self, q: float) -> Minimum | None:
        """Others fitted with the parameter at q, starting where the last two steps point."""
        start = np.array(self.vectors[-1])
        if len(self.vectors) > 1:
            moved = self.vectors[-1] - self.vectors[-2]
            start = start + moved * (q - start[self.index]) / moved[self.index]
        else:
            start = start + self._tangent() * (q - start[self.index])
        low, high = self.fit.problem.bounds.T
        start = np.clip(start, low, high)
        start[self.index] = q
        for candidate in (start, _with(self.vectors[-1], self.index, q)):
            failures = self.objective.failures
            self.objective.residuals(candidate)
            if self.objective.failures == failures:
                found = minimise(self.objective, candidate, max_evaluations=_MOST_EVALUATIONS)
                return self._off_plateau(found)
        return None

    def _off_plateau(self, found: Minimum) -> Minimum:
        """Try again with an entry that does not act at the scene's own value, and keep the better.

        A minimiser finds no way back from the middle of a plateau: a base left rigid there would stay so,
        and the profile of the thickness would not know that a thinner layer on a softer base answers alike.
        """
        for i in self.objective.active:
            begin = _with(found.vector, i, 0.0)
            if not self._is_flat(found.vector, i) or not self.objective.exists(begin):
                continue
            other = minimise(self.objective, begin, max_evaluations=_MOST_EVALUATIONS)
            found = min(
                (found, other), key=lambda each: float(np.square(self.objective.residuals(each.vector)).sum())
            )
        return found

    def _is_flat(self, vector: FloatArray, index: int) -> bool:
        if not self.objective.exists(vector):
            return False
        columns = self.objective.jacobian(vector, rough=True)
        return float(np.linalg.norm(columns[:, index])) < _FLAT

    def _tangent(self) -> FloatArray:
        """d others / d parameter along the profile at the optimum, from the covariance."""
        column = np.array(self.fit.scaled_covariance[self.index])
        own = column[self.index]
        tangent: FloatArray = column / own if own > 0.0 else np.zeros_like(column)
        tangent[self.index] = 1.0
        return tangent


def _with(vector: FloatArray, index: int, q: float) -> FloatArray:
    changed = np.array(vector)
    changed[index] = q
    return changed
