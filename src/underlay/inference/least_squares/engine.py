"""The engine: a projected Levenberg-Marquardt search that serves every least-squares fit of the program.

The steps are those of Levenberg and Marquardt (Marquardt 1963, doi:10.1137/0111030) in the parameters that are
not at a bound and not solved for; an `Objective` solves for the linear ones. One step up the side of a valley is
allowed if the next one leads further down than where it began: the valleys of these problems are long and bent.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.projection import Point, acting

__all__ = ["FINE", "Begun", "GiveUp", "Minimum", "Search", "descend", "descend_together", "minimise"]

#: Asked before each step with the steps made, the best point and the vector proposed: whether to leave it.
GiveUp: TypeAlias = Callable[[int, Point, FloatArray], bool]

_MOST_DAMPING, _EASIER, _HARDER = 1e8, 0.1, 10.0
# Below this the damping of two columns that are one to rounding would be rounding itself.
_LEAST_DAMPING = 1e-13
_VENTURE = 10.0  # how much higher than its beginning a step up the side may end
# A step is cut to this in every scaled coordinate: a factor e^3 of a modulus, three ranges of the curve.
_LONGEST = 3.0
# Steps shorter than this in every coordinate move nothing that a curve could tell.
_SHORTEST = 1e-10


@dataclass(frozen=True)
class Search:
    """How long and how exactly to search.

    Parameters
    ----------
    steps : int
        Most models to ask for.
    settled : float
        A step that should lower the sum of squares by less than this share of it is taken as what its linear
        model says, and is the last.
    damping : float
        Of the first step, on columns of unit length.
    """

    steps: int = 60
    settled: float = 1e-7
    damping: float = 1e-5


#: Of all points: the last step is within some hundredths of a standard error, what it leaves within a thousandth.
FINE = Search()


@dataclass(frozen=True)
class Minimum:
    """Where a search stopped.

    Parameters
    ----------
    point : Point
        The lowest one that was asked for.
    vector : FloatArray
        Scaled, (k,): that, and the last step.
    success : bool
        Whether it met its tolerance.
    message : str
        What it says.
    """

    point: Point
    vector: FloatArray
    success: bool
    message: str


def minimise(objective: Objective, start: FloatArray, search: Search = FINE) -> Minimum | None:
    """Minimise between the problem's bounds from a scaled start (k,); None if no law is there."""
    low, high = objective.problem.bounds.T
    begin = objective.point(np.clip(start, low, high), low, high)
    return None if begin is None else descend(objective, begin, low, high, search)


def descend(
    objective: Objective, best: Point, low: FloatArray, high: FloatArray, search: Search
) -> Minimum | None:
    """Search below a point, between `low` and `high` (k,)."""
    return descend_together(objective, [Begun(best, low, high)], search)[0]


class Begun(NamedTuple):
    """Where a search begins, and between which ends (k,) it stays."""

    point: Point
    low: FloatArray
    high: FloatArray


def descend_together(
    objective: Objective,
    begun: Sequence[Begun],
    search: Search,
    give_up: GiveUp | None = None,
    ended: Callable[[Begun, Minimum], None] | None = None,
) -> list[Minimum | None]:
    """Search below several points in lock-step, so that what one law takes serves a law of each.

    None in the place of a search that `give_up` left; `ended` is told of every other as soon as it ends.
    """
    active = np.zeros(len(objective.problem.coordinates), dtype=bool)
    active[objective.active] = True
    found: list[Minimum | None] = [None] * len(begun)
    searches = {i: _search(*one, active, search, give_up) for i, one in enumerate(begun)}
    answers: dict[int, Point | None] = dict.fromkeys(searches)
    while searches:
        proposed = {}
        for i, steps in list(searches.items()):
            try:
                proposed[i] = steps.send(answers[i])
            except StopIteration as stop:
                found[i] = stop.value
                del searches[i]
                if ended is not None and stop.value is not None:
                    ended(begun[i], stop.value)
        objective.prepare(list(proposed.values()))
        answers = {i: objective.point(vector, begun[i].low, begun[i].high) for i, vector in proposed.items()}
    return found


def _search(
    best: Point,
    low: FloatArray,
    high: FloatArray,
    active: NDArray[np.bool_],
    search: Search,
    give_up: GiveUp | None,
) -> Generator[FloatArray, Point | None, Minimum | None]:
    """One search: it yields the vectors (k,) that it proposes and is sent their points."""
    now, ventured, damping = best, False, search.damping
    for count in range(search.steps):
        step, gain = _step(now, damping, active, low, high)
        proposed = np.clip(now.vector + step, low, high)
        if give_up is not None and give_up(count, best, proposed):
            return None
        if not ventured and (gain <= search.settled * best.square or np.abs(step).max() <= _SHORTEST):
            return Minimum(best, proposed, success=True, message="the next step gains nothing")
        there = yield proposed
        change = np.inf if there is None else there.square - best.square
        if there is not None and change < 0.0:
            now = best = there
            ventured, damping = False, max(_EASIER * damping, _LEAST_DAMPING)
        elif there is not None and not ventured and there.square < _VENTURE * best.square:
            now, ventured = there, True
        else:
            now, ventured, damping = best, False, _HARDER * damping
        if abs(change) <= search.settled * best.square:
            return Minimum(best, best.vector, success=True, message="the last step gained nothing")
        if damping > _MOST_DAMPING:
            return Minimum(best, best.vector, success=True, message="no step leads further down")
    return Minimum(best, best.vector, success=False, message=f"not settled after {search.steps} steps")


def _step(
    point: Point, damping: float, active: NDArray[np.bool_], low: FloatArray, high: FloatArray
) -> tuple[FloatArray, float]:
    """Step (k,), where entries that would leave their bounds rest, and what it should gain."""
    normal, gradient = point.normal, point.gradient
    diagonal = np.diag(normal)
    acts = active & acting(np.sqrt(diagonal))
    inside = ((point.vector > low) | (gradient < 0.0)) & ((point.vector < high) | (gradient > 0.0))
    step = np.zeros(len(diagonal))
    which = np.flatnonzero(acts & inside)
    if which.size:
        scale = np.sqrt(diagonal[which])
        scaled = normal[which[:, None], which] / (scale[:, None] * scale)
        scaled.flat[:: which.size + 1] += damping
        step[which] = -np.linalg.solve(scaled, gradient[which] / scale) / scale
        longest = np.abs(step).max()
        if longest > _LONGEST:
            step *= _LONGEST / longest
    return step, float(-step @ gradient)
