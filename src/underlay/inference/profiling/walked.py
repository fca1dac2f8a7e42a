"""Profiles to both sides of every optimum that a fit found, and the best fit with one parameter held.

A fit with a parameter held starts from every optimum that the fit found and from a scan.
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.profiling.profile_result import LikelihoodProfile
from underlay.inference.profiling.walk import Walk

# How much better (in t) a point of its own profile must be for a fit not to be the optimum.
_BETTER = 1e-3


def walked(fit: Fit, name: str, highest: float) -> tuple[LikelihoodProfile, FloatArray | None]:
    """Profile of a parameter up to z = sqrt(t) of `highest`, with t the rise of chi-square.

    Returned with it is a scaled vector (k,) that fits better than the fit, None if none was met.
    """
    index = fit.names.index(name)
    below, above = _both_sides(fit, index, fit.vector, highest)
    rise, deepest = min((below.deepest, above.deepest), key=lambda basin: basin[0])
    branches = []
    for other in fit.alternatives:
        left, right = _both_sides(fit, index, other.vector, highest)
        branches.append(_joined(fit, name, left, right))
    return _joined(fit, name, below, above, tuple(branches)), deepest if rise < -_BETTER else None


def _both_sides(fit: Fit, index: int, vector: FloatArray, highest: float) -> list[Walk]:
    """Profile below and above a scaled vector (k,), up to z = sqrt(t) of `highest`, t the rise of chi-square."""
    return [Walk.start(fit, index, vector).go(side, highest).with_bottoms() for side in (-1.0, 1.0)]


def _joined(
    fit: Fit, name: str, below: Walk, above: Walk, branches: tuple[LikelihoodProfile, ...] = ()
) -> LikelihoodProfile:
    index = fit.names.index(name)
    vectors = np.array([*below.vectors[:0:-1], *above.vectors])
    rise = np.maximum(np.array([*below.delta_chi_squares[:0:-1], *above.delta_chi_squares]), 0.0)
    return LikelihoodProfile(
        name=name,
        fit=fit,
        values=read_only(fit.problem.coordinates[index].physical(vectors[:, index])),
        delta_chi_square=read_only(rise),
        vectors=read_only(vectors),
        ends=(below.reason, above.reason),
        branches=branches,
    )


def index_of(fit: Fit, name: str) -> int:
    """Entry of a free parameter in a scaled vector.

    Raises
    ------
    InputError
        If the parameter is not free, or is one of the noise.
    """
    if name not in fit.names:
        raise InputError(f"{name!r} is not free here; free are {', '.join(fit.names)}")
    if name.startswith("noise."):
        raise InputError(
            f"{name!r}: the noise is frozen where a value is held or drawn curves are fitted; "
            "a profile without calibration follows its likelihood"
        )
    return fit.names.index(name)


def delta_chi_square_at(fit: Fit, name: str, value: float) -> float:
    """Rise t of chi-square when a parameter is held at a value (SI), the others fitted again.

    It is counted from the fit, or from a better one that is found when the parameter is free again. The value is
    inside the interval of a level where this is at most `LikelihoodProfile.threshold`; two refits instead of a
    whole profile.

    Parameters
    ----------
    fit : Fit
        The fit of the data.
    name : str
        The parameter that is held.
    value : float
        Its value (SI).

    Raises
    ------
    InputError
        If the parameter is not free, the value is outside its bounds, or no law exists there.
    """
    rise, vector = constrained_fit(fit, name, value)
    return rise - missed(fit, vector)


def missed(fit: Fit, vector: FloatArray) -> float:
    """Change of chi-square, zero or negative, if the fit is made again from a scaled vector (k,).

    Of two optima a fit may have found the higher one only.
    """
    objective = Objective(fit.problem, freeze(fit.problem, fit.vector, fit.noises))
    found = minimise(objective, vector)
    if found is None:
        return 0.0
    return min(objective.square(found.vector) - objective.square(fit.vector), 0.0)


def constrained_fit(
    fit: Fit, name: str, value: float, near: FloatArray | None = None
) -> tuple[float, FloatArray]:
    """Best fit with one parameter held at a value (SI): its rise t of chi-square and its scaled vector (k,).

    Raises as `delta_chi_square_at`.

    Parameters
    ----------
    fit : Fit
        The fit of the data.
    name : str
        The parameter that is held.
    value : float
        Its value (SI).
    near : FloatArray, optional
        Scaled vector (k,) to begin at instead of the optima: the truth of a simulated curve.
    """
    index = index_of(fit, name)
    coordinate = fit.problem.coordinates[index]
    if not coordinate.low <= value <= coordinate.high:
        raise InputError(
            f"{name} = {value!r} is outside its bounds [{coordinate.low!r}, {coordinate.high!r}]"
        )
    q = coordinate.scaled(value)
    walk = Walk.start(fit, index, fit.vector)
    begin = [near] if near is not None else [fit.vector, *(other.vector for other in fit.alternatives)]
    best = None
    for place in begin:
        found = Walk.start(fit, index, place).follow(q)
        if found is not None and (best is None or walk.delta_chi_square(found) < walk.delta_chi_square(best)):
            best = found
    if walk.in_doubt(best):
        best = walk.look_elsewhere(q, best)
    if best is None:
        raise InputError(f"no contact law at {name} = {value!r}")
    return walk.delta_chi_square(best), best.vector
