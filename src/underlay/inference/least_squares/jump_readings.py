"""Readings beside a jump of the force that a fit leaves out, since the others do not fix on which side they lie.

Where an adhesive contact breaks, or forms, the force jumps. A reading there is on one side or on the other, and the
sum of squares jumps as soon as the model has it on the wrong one: no search along derivatives gets over that step.
Just before a pull-off the force turns as a square root does, with a slope that has no bound: there standard errors,
which come from slopes, are too small.

The rule: the reading next to the jump on either side is left out where it lies within four standard errors of the
depth of the jump, as all other readings determine that depth. The fit is then made again, until it leaves out what
it left out before. Both readings stay where the two fix the depth of the jump better than all others do: it lies
between them, anywhere, which is a standard deviation of their distance over the root of 12. So it is with a contact
whose modulus and thickness are known only together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit, FitStatistics, FitWarning
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.scene.instrument import Chain
from underlay.units import format_quantity

# Standard errors of the place of a jump within which a reading is left out.
_ERRORS = 4.0
# Length over standard deviation of an even distribution.
_EVEN = 12.0**0.5
# Step of a scaled coordinate for the slope of a jump's place: laws are good to 1e-6.
_STEP = 1e-3


def determined(found: Fit, problem: Problem) -> list[NDArray[np.bool_]]:
    """Which readings of each curve to keep, given a fit that places the jumps of the force.

    Parameters
    ----------
    found : Fit
        A fit to all readings of `problem`, or to some of them.
    problem : Problem
        The problem with all readings.

    Returns
    -------
    list of ndarray of bool (n,)
        One for each curve: False for a reading beside a jump that the other readings leave on either side of it.
    """
    objective = Objective(found.problem, freeze(found.problem, found.vector, found.noises))
    rows = objective.jacobian(found.vector)[:, objective.active]
    begin = np.cumsum([0, *(len(member.force) for member in found.problem.members)])
    physical, kept = found.problem.physical(found.vector), []
    for number, (member, whole) in enumerate(zip(found.problem.members, problem.members, strict=True)):
        keep = np.ones(len(whole.force), dtype=bool)
        for place, slope in _jumps(found, member, objective.active):
            used = member.forward.depth_at(member.values_at(physical))
            others = np.delete(rows, begin[number] + _next_to(used, place), axis=0)
            # The shortest x with J'x = slope: |x|^2 = slope' (J'J)^-1 slope, also where J'J has no inverse.
            error = float(np.linalg.norm(np.linalg.lstsq(others.T, slope, rcond=None)[0]))
            depth = whole.forward.depth_at(member.values_at(physical))
            near = _next_to(depth, place)
            if error < float(np.ptp(depth[near])) / _EVEN:
                keep[near] &= np.abs(depth[near] - place) > _ERRORS * error
        kept.append(keep)
    return kept


def about_left_out(problem: Problem, kept: list[NDArray[np.bool_]]) -> list[FitWarning]:
    """Warnings about readings left out beside a jump, from masks (n,) of those kept, one per curve."""
    warnings = []
    for number, (member, keep) in enumerate(zip(problem.members, kept, strict=True), start=1):
        gone = member.forward.depth[~keep]
        if gone.size:
            which = f"curve {number}: " if len(kept) > 1 else ""
            where = format_quantity(float(gone.mean()), "length")
            what = "1 reading was" if gone.size == 1 else f"{gone.size} readings were"
            warnings.append(
                FitWarning(
                    "jump",
                    f"{which}{what} left out at {where}, beside a jump of the force: the others do not tell on "
                    "which side of it they lie",
                )
            )
    return warnings


def for_all_readings(statistics: FitStatistics, readings: int) -> FitStatistics:
    """Return the statistics with a log-likelihood in which readings left out count as the mean of the others.

    So models which leave out different readings may be compared. `readings` is the number of all readings.
    """
    more = statistics.log_likelihood * (readings / statistics.points - 1.0)
    return replace(
        statistics,
        log_likelihood=statistics.log_likelihood + more,
        aic=statistics.aic - 2.0 * more,
        bic=statistics.bic - 2.0 * more,
    )


def _next_to(depth: FloatArray, place: float) -> NDArray[np.intp]:
    """Indices of the depth readings (m), (n,), next to `place` (m): one on either side of it, if any."""
    apart = depth - place
    sides = (np.where(side, np.abs(apart), np.inf) for side in (apart > 0.0, apart <= 0.0))
    return np.array([side.argmin() for side in sides if np.isfinite(side).any()])


def _jumps(found: Fit, member: Member, active: list[int]) -> list[tuple[float, FloatArray]]:
    """Depth readings (m) at which the force of a curve jumps, each with its slopes.

    The slopes are those of the depth (m) in the scaled parameters `active`.
    """
    places = _places(found.problem, member, found.vector)
    slopes = np.zeros((len(places), len(active)))
    for column, index in enumerate(active):
        moved = _moved(found.problem, member, found.vector, index)
        if len(moved) == len(places):
            slopes[:, column] = (moved - places) / _STEP
    return list(zip(places.tolist(), slopes, strict=True))


def _moved(problem: Problem, member: Member, vector: FloatArray, index: int) -> FloatArray:
    """Depth readings (m) of the jumps after one step in the scaled parameter `index`.

    Where there is no law after the step they are extrapolated from the opposite step.
    """
    step = np.zeros_like(vector)
    step[index] = _STEP
    try:
        return _places(problem, member, vector + step)
    except InputError:
        return 2.0 * _places(problem, member, vector) - _places(problem, member, vector - step)


def _places(problem: Problem, member: Member, vector: FloatArray) -> FloatArray:
    """Depth readings (m) at which the force of a curve jumps, at a scaled vector (k,)."""
    values = member.values_at(problem.physical(vector))
    chain = Chain.of(values)
    deepest = float(chain.travel(member.forward.depth_at(values)).max())
    law = member.forward.law(values, max(deepest, 0.0))
    travels = np.array(law.jump_travels(0.0 if chain.frame is None else chain.frame.compliance))
    return travels if chain.contact is None else travels + chain.contact.depth
