"""Fits of adhesive contacts: starting points, readings beside a jump of the force, warnings about the pull-off.

A start follows from three features of the curve: the depth of its adhesive dip, the point where it carries no load,
and its top. For each layer modulus of a coarse grid the work of adhesion is the one whose contact pulls as hard as
the dip is deep, and the contact point is the one that puts the unloaded contact where the curve crosses its
baseline. With adhesion the layer's modulus does not scale the force, so it cannot be solved for linearly as `scan`
does.

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

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit, FitStatistics, FitWarning
from underlay.inference.least_squares.fit_warnings import which_curve
from underlay.inference.least_squares.models import freeze, misfit_of, with_values
from underlay.inference.least_squares.objective import Objective
from underlay.inference.model.laws import quiet_law
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.solvers import HalfSpace
from underlay.scene.instrument import Baseline, Chain, ContactDepth
from underlay.scene.scene import Scene
from underlay.units import format_quantity

# Relative tolerance of the laws of a start.
_RTOL = 1e-2
_MODULUS, _WORK = "layer.E", "adhesion.work"
# Moduli tried, over the modulus of a contact without adhesion. With thirteen of them, all of whose starts are
# searched from, the sum of squares of 70 random tips ends lower by more than 0.01 variances in 7, higher in 10.
_MODULI = np.geomspace(0.05, 20.0, 7)
# Works of adhesion tried where the curve shows no dip, over the scene's own.
_WORKS = (0.01, 0.1, 1.0, 10.0)
# Corrections of the work to the dip: pull-off goes with the work to a power near one, so that one of less than a
# third leaves a few per cent.
_CORRECTIONS, _FEW_PER_CENT = 3, 1.0 / 3.0
# Depths at which a law's force is asked for its lowest and its zero.
_POINTS = 200
# Share of the readings that are taken to lie before contact.
_BASELINE_SHARE = 0.05
# Standard errors of the place of a jump within which a reading is left out.
_ERRORS = 4.0
# Length over standard deviation of an even distribution.
_EVEN = 12.0**0.5
# Step of a scaled coordinate for the slope of a jump's place: laws are good to 1e-6.
_STEP = 1e-3


class _Marks(NamedTuple):
    """Features of one curve from which a start is estimated.

    Parameters
    ----------
    baseline : float
        Force (N) before contact.
    pull : float
        Largest force (N) below the baseline, positive; zero if there is none.
    crossing : float
        Largest depth reading (m) at which the force is at or below the baseline.
    top : float
        Largest force (N) above the baseline.
    span : float
        Range of the depth readings (m).
    """

    baseline: float
    pull: float
    crossing: float
    top: float
    span: float


def adhesive_starts(problem: Problem, count: int) -> list[FloatArray]:
    """Starting points of a fit with adhesion, ranked by their misfit.

    Parameters
    ----------
    problem : Problem
        What will be fitted.
    count : int
        Largest number of starts to return.

    Returns
    -------
    list of FloatArray
        Vectors of the scaled parameters, (k,), best first; empty if no candidate has a contact law.
    """
    marks = [_marks(member) for member in problem.members]
    first = problem.members[0]
    moduli = [first.base[_MODULUS]]
    if _MODULUS in first.entries:
        moduli = (_elastic_modulus(first, marks[0]) * _MODULI).tolist()
    ranked: list[tuple[float, FloatArray]] = []
    works = [first.base[_WORK]]
    for modulus in moduli:
        # The pull hardly depends on the modulus: one work leads to the next.
        works = _works(first, marks, modulus, works[-1])
        for work in works:
            vector = _vector(problem, marks, modulus, work)
            if vector is not None and np.isfinite(square := misfit_of(problem, vector)):
                ranked.append((square, vector))
    ranked.sort(key=lambda entry: entry[0])
    return [vector for _, vector in ranked[:count]]


def _marks(member: Member) -> _Marks:
    order = np.argsort(member.forward.depth, kind="stable")
    depth, force = member.forward.depth[order], member.force[order]
    baseline = member.base[Baseline.path]
    if Baseline.path in member.entries:
        baseline = float(np.median(force[: max(3, int(_BASELINE_SHARE * len(force)))]))
    level = force - baseline
    below = np.flatnonzero(level <= 0.0)
    crossing = float(depth[below[-1]]) if below.size else float(depth[0])
    return _Marks(baseline, max(-float(level.min()), 0.0), crossing, float(level.max()), float(np.ptp(depth)))


def _elastic_modulus(member: Member, marks: _Marks) -> float:
    """Layer modulus (Pa) at which a half-space without adhesion carries the curve's top force."""
    bare = Scene(member.scene.indenter, member.scene.layer, member.scene.substrate)
    law = quiet_law(bare, HalfSpace(), marks.span)
    force = float(law.force(min(marks.span, law.max_depth)))
    return member.base[_MODULUS] * max(marks.top, marks.pull) / force


def _works(member: Member, marks: list[_Marks], modulus: float, near: float) -> list[float]:
    """Works of adhesion (J/m^2) to try together with a layer modulus (Pa).

    One value that gives the pull of the curve's dip, sought from `near`; a few multiples of the scene's own value
    where no curve shows a dip; the scene's own value where the work of adhesion is fixed.
    """
    known = member.base[_WORK]
    if _WORK not in member.entries:
        return [known]
    pull = max(mark.pull for mark in marks)
    if not pull > 0.0:
        return [known * factor for factor in _WORKS]
    work = near
    for _ in range(_CORRECTIONS):
        law = _law(member, {_MODULUS: modulus, _WORK: work}, max(mark.span for mark in marks))
        if law is None:
            return [known]
        least = -float(_forces(law, max(mark.span for mark in marks))[1].min())
        if not least > 0.0:
            return [known]
        work *= pull / least
        if abs(pull / least - 1.0) < _FEW_PER_CENT:
            break
    return [work]


def _vector(problem: Problem, marks: list[_Marks], modulus: float, work: float) -> FloatArray | None:
    """Vector (k,) of the scaled parameters for a modulus (Pa) and a work of adhesion (J/m^2); None without a law.

    The contact point of each curve is set so that its law carries no load where the curve crosses its baseline.
    """
    found = np.zeros(len(problem.coordinates))
    for member, mark in zip(problem.members, marks, strict=True):
        values = {_MODULUS: modulus, _WORK: work, Baseline.path: mark.baseline}
        if ContactDepth.path in member.entries:
            law = _law(member, values, mark.span)
            if law is None:
                return None
            depths, forces = _forces(law, mark.span)
            pulling = np.flatnonzero(forces <= 0.0)
            unloaded = float(depths[pulling[-1]]) if pulling.size else 0.0
            values[ContactDepth.path] = mark.crossing - unloaded
        found = with_values(problem, member, values, found)
    return found


def _law(member: Member, values: dict[str, float], deepest: float) -> ContactLaw | None:
    own = {path: value for path, value in values.items() if path in member.base}
    try:
        return quiet_law(
            member.scene.with_values(own), member.forward.laws.solver.with_tolerance(_RTOL), deepest
        )
    except InputError:
        return None


def _forces(law: ContactLaw, deepest: float) -> tuple[FloatArray, FloatArray]:
    """Depths (m) over the domain of an adhesive law, and its forces (N) there; zeros for an empty domain.

    A law without an end, as DMT's of a half-space, is taken to the depth `deepest` (m).
    """
    start, end = law.domain
    end = end if np.isfinite(end) else deepest
    depths = np.linspace(start, max(end, -start), _POINTS)[1:]
    depths = depths[depths <= law.max_depth]
    if not depths.size:
        return np.zeros(1), np.zeros(1)
    # On the way out: on its way in a tip sticks from its touch on only.
    return depths, law.force(depths[::-1])[::-1]


def about_adhesion(problem: Problem, vector: FloatArray) -> Iterator[FitWarning]:
    """Warnings about adhesive curves that end before the pull-off or lie beyond it; none without adhesion."""
    for number, member in enumerate(problem.members):
        text = _about(member, problem.physical(vector)) if member.scene.adhesion is not None else ""
        if text:
            yield FitWarning("pull-off", which_curve(number, len(problem.members)) + text)


def _about(member: Member, physical: FloatArray) -> str:
    values = member.values_at(physical)
    chain = Chain.of(values)
    law = member.forward.law(values, max(float(chain.travel(member.forward.depth_at(values)).max()), 0.0))
    tip = chain.tip_depth(law, member.forward.depth_at(values))
    first = law.domain[0]
    if not (tip > first).any():
        return (
            f"every point lies beyond the pull-off of the fitted contact, {format_quantity(first, 'length')}: "
            "modulus and work of adhesion do not act on the curve"
        )
    if first < 0.0 and float(tip.min()) > first:
        return (
            f"the curve ends at {format_quantity(float(tip.min()), 'length')}, before the pull-off at "
            f"{format_quantity(first, 'length')} that the fit expects: the work of adhesion is known from the "
            "shape of the loaded curve alone, together with the contact point; it is only known that the contact "
            "bears the smallest force measured"
        )
    return ""


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


def about_left_out(problem: Problem, kept: list[NDArray[np.bool_]]) -> Iterator[FitWarning]:
    """Warnings about readings left out beside a jump, from masks (n,) of those kept, one per curve."""
    for number, (member, keep) in enumerate(zip(problem.members, kept, strict=True)):
        gone = member.forward.depth[~keep]
        if gone.size:
            where = format_quantity(float(gone.mean()), "length")
            what = "1 reading was" if gone.size == 1 else f"{gone.size} readings were"
            yield FitWarning(
                "jump",
                f"{which_curve(number, len(kept))}{what} left out at {where}, beside a jump of the force: the "
                "others do not tell on which side of it they lie",
            )


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

    The slopes are those of the depth (m) in the scaled parameters `active`. Where there is no law a step away they
    come from the opposite step.
    """
    problem, vector = found.problem, found.vector
    places = _places(problem, member, vector)
    slopes = np.zeros((len(places), len(active)))
    for column, step in enumerate(_STEP * np.eye(len(vector))[active]):
        try:
            moved = _places(problem, member, vector + step)
        except InputError:
            moved = 2.0 * places - _places(problem, member, vector - step)
        if len(moved) == len(places):
            slopes[:, column] = (moved - places) / _STEP
    return list(zip(places.tolist(), slopes, strict=True))


def _places(problem: Problem, member: Member, vector: FloatArray) -> FloatArray:
    """Depth readings (m) at which the force of a curve jumps, at a scaled vector (k,)."""
    values = member.values_at(problem.physical(vector))
    chain = Chain.of(values)
    deepest = float(chain.travel(member.forward.depth_at(values)).max())
    law = member.forward.law(values, max(deepest, 0.0))
    travels = np.array(law.jump_travels(0.0 if chain.frame is None else chain.frame.compliance))
    return travels if chain.contact is None else travels + chain.contact.depth
