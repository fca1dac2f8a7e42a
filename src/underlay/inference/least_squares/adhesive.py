"""Starting points for fits of adhesive contacts, and warnings about curves that do not show the pull-off.

A start follows from three features of the curve: the depth of its adhesive dip, the point where it carries no load,
and its top. For each layer modulus of a coarse grid the work of adhesion is the one whose contact pulls as hard as
the dip is deep, and the contact point is the one that puts the unloaded contact where the curve crosses its
baseline. With adhesion the layer's modulus does not scale the force, so it cannot be solved for linearly as `scan`
does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import FitWarning
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
            if vector is not None and np.isfinite(misfit := _misfit(problem, vector)):
                ranked.append((misfit, vector))
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
        for path, entry in member.entries.items():
            if path in values:
                coordinate = problem.coordinates[entry]
                found[entry] = coordinate.scaled(min(max(values[path], coordinate.low), coordinate.high))
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


def _misfit(problem: Problem, vector: FloatArray) -> float:
    """Sum over the curves of their squared residuals over the squared range of force; inf where no law exists."""
    physical, total = problem.physical(vector), 0.0
    for member in problem.members:
        values = member.values_at(physical)
        try:
            model = member.forward.reading(values, stiffness=False).force
        except InputError:
            return np.inf
        total += float(((model - member.force) ** 2).sum()) / float(np.ptp(member.force)) ** 2
    return total


def about_adhesion(problem: Problem, vector: FloatArray) -> list[FitWarning]:
    """Warnings about adhesive curves that end before the pull-off or lie beyond it; none without adhesion."""
    sticking = [(n, m) for n, m in enumerate(problem.members, start=1) if m.scene.adhesion is not None]
    physical = problem.physical(vector)
    warnings = []
    for number, member in sticking:
        text = _about(member, physical)
        if text:
            which = f"curve {number}: " if len(problem.members) > 1 else ""
            warnings.append(FitWarning("pull-off", which + text))
    return warnings


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
