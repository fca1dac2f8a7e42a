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

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.inference.fitting.fit_result import Fit
from underlay.inference.least_squares import fit as least_squares_fit
from underlay.inference.problem import Problem
from underlay.inference.profiling.interval import Interval
from underlay.inference.profiling.profile_result import Profile, interval_threshold
from underlay.inference.profiling.walk import Walk

__all__ = ["Interval", "Profile", "interval_threshold", "profile", "rise_at"]

# A fit found to be this much worse (in t) than a point of its own profile was not the optimum.
_BETTER = 1e-3


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
    better = min((below.deepest(), above.deepest()), key=lambda basin: basin[0])
    if better[0] < -_BETTER:
        # The walk met a lower minimum: begin again from there.
        again = _refit(fit, better[1])
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
            rises.append(walk.rise(found))
    if not rises:
        raise InputError(f"no contact law at {name} = {value!r}")
    return min(rises)


def _refit(fit: Fit, vector: FloatArray) -> Fit:
    problem = fit.problem
    moved = problem.revised(scenes=problem.scenes(vector))
    return least_squares_fit(moved, start="given")
