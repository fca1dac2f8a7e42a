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

from dataclasses import dataclass

import numpy as np
from scipy import interpolate, stats

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.inference.fitting.fit_result import Fit
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.problem import Problem
from underlay.inference.profile_walk import Walk
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

__all__ = ["Interval", "Profile", "interval_threshold", "profile", "rise_at"]

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
    below, above = (Walk.start(fit, index).go(direction) for direction in (-1.0, 1.0))
    better = min((below, above), key=lambda walk: walk.lowest)
    if better.lowest < -_BETTER:
        # The walk passed through a lower minimum: begin again from there.
        again = _refit(fit, better.vectors[int(np.argmin(better.rises))])
        if again.statistics.chi_square < fit.statistics.chi_square:
            return profile(again, name)
    branches = []
    for other in fit.alternatives:
        left, right = (Walk.start(fit, index, other.vector).go(direction) for direction in (-1.0, 1.0))
        branches.append(_joined(fit, name, left, right))
    return _joined(fit, name, below, above, tuple(branches))


def _joined(fit: Fit, name: str, below: Walk, above: Walk, branches: tuple[Profile, ...] = ()) -> Profile:
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
        walk = Walk.start(fit, index, optimum)
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
