"""Steps of a profile outwards from every optimum of a fit, and the best fit with one parameter held.

With t the rise of chi-square, steps are of about half a unit of z = sqrt(t), in which a profile is nearly straight.
A fit with a parameter held starts from every optimum that the fit found and from a scan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.inference.least_squares.engine import Ahead, Minimum, Search, minimise
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.projection import Point
from underlay.inference.least_squares.scan import LIKELY, scan
from underlay.inference.problem import Problem
from underlay.inference.profiling.profile_result import HIGHEST, LikelihoodProfile
from underlay.scene.noise import Noise

_STEP = 0.5  # step in z: monotone cubics through these steps place a crossing to 1e-3 standard deviations
# A rise of z in one step beyond which the step is taken again, shorter.
_STEEPEST = 2.0 * _STEP
# Evaluations after which a step is judged, and the rise of z beyond which it is then taken again: how much too far
# it went need not be known, and where chi-square is steep a law takes long to compute.
_QUICK, _FAR_TOO_STEEP = 6, 2.0 * _STEEPEST
_GROWTH = 2.0  # a flattening profile is walked in steps at most this much longer each time
# Farthest that a walk goes, in scaled coordinates, from the optimum and from the scene's own value: a factor 1.6e5,
# or twelve times the range of the curve.
_FARTHEST = 12.0
_ROUNDED = 1e-9  # distance at which a walk is at its end: sums of steps are rounded
_MOST_STEPS = 60  # steps of a walk to one side
# Precision of the place where the laws end, as a share of the first step (a tenth of a standard deviation) and of
# the way.
_WALL, _WALL_SHARE = 0.2, 0.05
# Models without a law in one search after which it ends: what it looks for lies beyond the end of the laws.
_MOST_REFUSED = 8
# Distance (scaled coordinates) of two values of the parameter that are one.
_SAME = 1e-9
# Standard deviations by which an entry on a plateau moves all readings together, per unit, at most.
_FLAT = 3e-2
# Rise t below which a value is inside every interval of 68 % or more, wherever the others would be better.
_DOUBTED = 1.0
# How much better (in t) a point of its own profile must be for a fit not to be the optimum.
_DEEPER = 1e-3
_BETTER = 0.01  # gain in t that matters: less changes no interval by a hundredth of its width
# The search of a step. The noise is frozen, so a sum of squares is a rise of t. A step that should gain less than
# 2e-3 is the last: where t is 3.84 that moves an end by 3e-4 of its distance, and along a plateau many such steps
# may follow one another.
_FINE = Search(steps=60, least=2e-3)
# The search from a start elsewhere, and the rise over what it competes with within which it must then be.
_ROUGH, _MAY_BE = Search(steps=8, settled=1e-4, damping=1e-2), 30.0
# Distance (scaled coordinates) of a start of the scan from where the others are within which it ends where they
# are.
_SAME_PLACE = 0.3
# Scaled coordinate (a factor of 20) at which a search for a way off a plateau that has gone back towards it ends.
_BACK_TO_PLATEAU = 3.0


@dataclass(frozen=True, eq=False)
class Walk:
    """Points of a profile from the optimum to one side, the other parameters fitted at each.

    Parameters
    ----------
    fit : Fit
        The fit.
    index : int
        Entry of the profiled parameter in a scaled vector.
    objective : Objective
        Residuals with that parameter held and the noise frozen.
    base : float
        Sum of squares of the fit.
    vectors : list of FloatArray
        Scaled vectors (k,) of the points, from the start outwards.
    delta_chi_squares : list of float
        Rise of chi-square above the fit at each.
    reason : str
        Why the profile ends: ``"data"``, ``"bound"``, ``"law"`` or ``"none"``.
    """

    fit: Fit
    index: int
    objective: Objective
    base: float
    vectors: list[FloatArray]
    delta_chi_squares: list[float]
    reason: str = "none"

    @classmethod
    def start(cls, fit: Fit, index: int, vector: FloatArray) -> Walk:
        """Begin a profile at the optimum or another scaled vector (k,), with the noise of the fit frozen."""
        noise = freeze(fit.problem, fit.vector, fit.noises)
        objective = Objective(fit.problem, noise, held=frozenset({index}))
        base = objective.square(fit.vector)
        rise = objective.square(vector) - base
        return cls(fit, index, objective, base, [np.array(vector)], [rise])

    @property
    def deepest(self) -> tuple[float, FloatArray]:
        """Smallest rise of chi-square met, and its scaled vector (k,).

        The rise is below zero if the fit was not the optimum.
        """
        lowest = int(np.argmin(self.delta_chi_squares))
        return self.delta_chi_squares[lowest], self.vectors[lowest]

    def with_bottoms(self) -> Walk:
        """Return the profile with its local minima added, found with the parameter free.

        Steps are long where a profile is flat: without its minimum a basin would be read too narrow, and a deeper
        optimum in it missed.
        """
        free = Objective(self.fit.problem, self.objective.noise)
        q = [float(vector[self.index]) for vector in self.vectors]
        vectors, rises = list(self.vectors), list(self.delta_chi_squares)
        # From the far end, so that the places before an insertion keep their numbers.
        for i in range(len(rises) - 2, 0, -1):
            if not self.delta_chi_squares[i - 1] > self.delta_chi_squares[i] < self.delta_chi_squares[i + 1]:
                continue
            found = minimise(free, self.vectors[i], _FINE)
            if found is None:
                continue
            bottom, rise = found.point.vector, self.delta_chi_square(found.point)
            here = float(bottom[self.index])
            if rise < self.delta_chi_squares[i] and min(q[i - 1], q[i + 1]) < here < max(q[i - 1], q[i + 1]):
                away, known = abs(here - q[0]), abs(q[i] - q[0])
                # A bottom that was stood on already, to rounding, takes the place of that step.
                stays = 0 if abs(away - known) <= _SAME else 1
                place = i + 1 if stays and away > known else i
                vectors[place : place + 1 - stays] = [bottom]
                rises[place : place + 1 - stays] = [rise]
        return replace(self, vectors=vectors, delta_chi_squares=rises)

    def go(self, direction: float, highest: float = HIGHEST) -> Walk:
        """Step outwards until z = sqrt(t) exceeds `highest`, or the parameter or the contact law ends.

        t is the rise of chi-square, `direction` 1 or -1. Where the other parameters turn out at that end to fit
        better elsewhere, the profile is made again with a search at every step.
        """
        walk = self._gone(direction, highest, watchful=False)
        return walk if walk.reason != "lost" else self._gone(direction, highest, watchful=True)

    def _gone(self, direction: float, highest: float, *, watchful: bool) -> Walk:
        """Make the profile once, from its starting point.

        The reason of its end is ``"lost"`` if only there a better fit of the other parameters was found. With
        `watchful` such a fit is looked for at every step.
        """
        walk = replace(self, vectors=self.vectors[:1], delta_chi_squares=self.delta_chi_squares[:1])

        def settled(q: float, found: Point) -> Point | None:
            rise = walk.delta_chi_square(found)
            if rise <= highest**2 and not (watchful and walk.in_doubt(found)):
                return found
            other = walk.look_elsewhere(q, found) or found
            return other if watchful or walk.delta_chi_square(other) >= rise - _BETTER else None

        def follow(q: float) -> Point | None:
            return walk.follow(q, rough=True)

        places = walk.vectors, walk.delta_chi_squares
        reason = outwards(walk.fit, walk.index, walk.base, places, direction, highest, follow, settled)
        return replace(walk, reason=reason)

    def delta_chi_square(self, found: Point) -> float:
        """Rise t of chi-square at a point, above the fit."""
        return found.square - self.base

    def in_doubt(self, found: Point | None) -> bool:
        """Whether a better fit of the other parameters than `found` could still change an interval."""
        return found is None or self.delta_chi_square(found) > _DOUBTED

    def look_elsewhere(self, q: float, found: Point | None) -> Point | None:
        """Fit the other parameters with the profiled one held at q (scaled), starting from a scan.

        Returns `found`, the fit known so far, if that is no better.
        """
        pinned = _with(self.vectors[-1] if found is None else found.vector, self.index, q)
        low, high = self.fit.problem.bounds.T
        for start in _starts_with_held(self.fit.problem, self.index, pinned):
            if found is not None and (np.abs(start - found.vector) < _SAME_PLACE).all():
                continue
            begin = _with(np.clip(start, low, high), self.index, q)
            other = self._minimised(begin, _ROUGH, found)
            if other is None or (found is not None and other.square > found.square + _MAY_BE):
                continue
            other = self._minimised(other.vector, known=found)
            if other is not None and (found is None or other.square < found.square):
                found = other
        return found

    def follow(self, q: float, most_steps: int = _FINE.steps, *, rough: bool = False) -> Point | None:
        """Fit the other parameters with the profiled one held at q (scaled).

        It starts where the last two steps point. A `rough` result is enough where the step went so far that it will
        be taken again. None where no law exists.
        """
        start = np.array(self.vectors[-1])
        if len(self.vectors) > 1:
            moved = self.vectors[-1] - self.vectors[-2]
            start = start + moved * (q - start[self.index]) / moved[self.index]
        else:
            start = start + self._tangent() * (q - start[self.index])
        # A parameter without effect would be extrapolated further and further: it is kept within these limits.
        last = self.vectors[-1]
        start = np.clip(start, np.minimum(last, -_FARTHEST), np.maximum(last, _FARTHEST))
        low, high = self.fit.problem.bounds.T
        for candidate in (np.clip(start, low, high), last):
            begin = _with(candidate, self.index, q)
            if self.objective.exists(begin):
                search = replace(_FINE, steps=most_steps)
                found = self._roughly(begin) if rough else self._minimised(begin, search)
                # Where the last two steps point may be too far ahead, among places that have no law.
                if found is not None:
                    return found
        return None

    def _roughly(self, begin: FloatArray) -> Point | None:
        """Fit the other parameters from a scaled vector (k,), but stop early if the step was clearly too long.

        None where no law exists.
        """
        quick = self._search(begin, replace(_FINE, steps=_QUICK))
        if quick is None or quick.success:
            return None if quick is None else self._off_plateau(quick.point)
        climb = _root(self.delta_chi_square(quick.point)) - _root(self.delta_chi_squares[-1])
        if climb > _FAR_TOO_STEEP:
            return quick.point
        return self._minimised(quick.point.vector)

    def _minimised(
        self, start: FloatArray, search: Search = _FINE, known: Point | None = None
    ) -> Point | None:
        """Fit the other parameters from a scaled vector (k,), with the profiled one held.

        Parameters without effect at the end are tried again from the scene's values. None where no law exists, or
        the search leads to the point `known`.
        """
        found = self._search(start, search, known)
        return None if found is None else self._off_plateau(found.point)

    def _search(
        self, start: FloatArray, search: Search, known: Point | None = None, plateau: int | None = None
    ) -> Minimum | None:
        """Fit the other parameters from a scaled vector (k,); gives the lowest point whose model was computed.

        None where no law exists, or the search leads to the point `known`; a parameter `plateau` without effect
        there may then have any large value.
        """
        refused = self.objective.failures + _MOST_REFUSED

        def leaves(ahead: Ahead) -> bool:
            if self.objective.failures > refused:
                return True
            if known is None or ahead.square < known.square:
                return False
            there = np.abs(ahead.there - known.vector) < _SAME_PLACE
            if plateau is not None:
                there[plateau] |= ahead.there[plateau] * np.sign(known.vector[plateau]) >= _BACK_TO_PLATEAU
            return bool(there.all())

        return minimise(self.objective, start, search, leaves)

    def _off_plateau(self, found: Point) -> Point:
        """Fit again with each parameter that has no effect set to the scene's value, and keep the better fit.

        A minimiser finds no way back from the middle of a plateau: a base left rigid there would stay so, and the
        profile of the thickness would miss that a thinner layer on a softer base fits as well.
        """
        for i in self._flat(found):
            other = self._search(_with(found.vector, i, 0.0), _ROUGH, found, i)
            # Only what does not lead back to the plateau is worth an exact search.
            if other is not None and i not in self._flat(other.point):
                other = self._search(other.point.vector, _FINE, found, i)
            else:
                other = None
            if other is None:
                # Steps along a plateau are cut short, and those of the other parameters with them, which then stop
                # too early.
                held = replace(self.objective, held=self.objective.held | {i})
                other = minimise(held, found.vector, _FINE)
            if other is not None and other.point.square < found.square:
                found = other.point
        return found

    def _flat(self, found: Point) -> list[int]:
        """Entries of the parameters that have no effect at a point."""
        norms = np.sqrt(np.diagonal(found.normal))
        return [i for i in self.objective.active if norms[i] < _FLAT]

    def _tangent(self) -> FloatArray:
        """Derivatives of all scaled parameters (k,) in the profiled one along the profile at the optimum.

        From the covariance of the fit.
        """
        column = np.array(self.fit.scaled_covariance[self.index])
        own = column[self.index]
        tangent: FloatArray = column / own if own > 0.0 else np.zeros_like(column)
        tangent[self.index] = 1.0
        return tangent


def outwards(
    fit: Fit,
    index: int,
    base: float,
    places: tuple[list[FloatArray], list[float]],
    direction: float,
    highest: float,
    follow: Callable[[float], Any],
    settled: Callable[[float, Any], Any] = lambda _, found: found,
) -> str:
    """Step from the last place of a profile outwards, until z = sqrt(t) exceeds `highest` or the way ends.

    Parameters
    ----------
    fit : Fit
        The fit.
    index : int
        Entry of the profiled parameter in a scaled vector.
    base : float
        What the `square` of a place is at t = 0.
    places : (list of FloatArray, list of float)
        Scaled vectors (k,) and their t; the places of the way are appended.
    direction : float
        1 or -1.
    highest : float
        The largest z.
    follow : callable
        The place with the parameter held at a scaled value: its `vector` (k,) and its `square`, which is base + t;
        None where no law exists.
    settled : callable
        A place that is kept, from the scaled value and what `follow` gave; None gives up.

    Returns
    -------
    str
        Why it ends: ``"data"``, ``"bound"``, ``"law"``, ``"none"``, or ``"lost"`` where `settled` gave up.
    """
    vectors, rises = places
    here = float(vectors[0][index])
    room = abs(fit.problem.bounds[index][1 if direction > 0.0 else 0] - here)
    deviation = float(np.sqrt(fit.scaled_covariance[index, index]))
    step = first = _STEP * deviation if 0.0 < deviation < 1.0 else 0.1
    wall = np.inf
    for _ in range(_MOST_STEPS):
        last = float(vectors[-1][index])
        travelled = abs(last - here)
        is_far = direction * last >= _FARTHEST - _ROUNDED
        at_wall = wall - travelled <= _WALL * first + _WALL_SHARE * travelled
        # Far out on a plateau it is the range of floating-point numbers that ends, and not that of the laws.
        if at_wall and not is_far:
            return "law"
        # A profile that stays flat ends there: nothing is computed further out.
        left = _FARTHEST - min(travelled, direction * last)
        # Half the way to where there was no law, once that is known.
        step = min(step, room - travelled, 0.5 * (wall - travelled), left if left > _ROUNDED else np.inf)
        if step <= 1e-12 * (1.0 + travelled):
            return "bound"
        # From an optimum far out on a plateau (a base that might be rigid) the profile goes all the way back.
        if is_far and (at_wall or travelled >= _FARTHEST - _ROUNDED):
            return "none"
        q = here + direction * (travelled + step)
        found = follow(q)
        if found is None:
            wall = travelled + step
            continue
        climb = _root(found.square - base) - _root(rises[-1])
        if climb > _STEEPEST and step > 1e-3 * first:
            # A valley that lies open at the optimum and closes further on: its curvature there, or the slope of the
            # last step, foretold too long a step, and there is nothing to read between; or a second basin lies
            # within it.
            step *= max(_STEP / climb, 0.1)
            continue
        found = settled(q, found)
        if found is None:
            return "lost"
        vectors.append(found.vector)
        rises.append(found.square - base)
        if rises[-1] > highest**2:
            return "data"
        # Half a unit of z, from the slope of z over the last step.
        slope = abs(_root(rises[-1]) - _root(rises[-2])) / step
        step = min(_STEP / slope, _GROWTH * step) if slope > 0.0 else _GROWTH * step
    return "none"


def _root(rise: float) -> float:
    return float(np.sqrt(max(rise, 0.0)))


def _with(vector: FloatArray, index: int, q: float) -> FloatArray:
    changed = np.array(vector)
    changed[index] = q
    return changed


def _starts_with_held(problem: Problem, index: int, vector: FloatArray) -> list[FloatArray]:
    """Starts (k,) of the other parameters with entry `index` held at its value in `vector` (k,).

    Where thin and soft competes with thick and stiff, the valley of the optimum can fold back in the parameter that
    is held: a step along it then leads to a bad fit while the other side of the fold explains the data well. Only a
    scan finds that side. The other entries of `vector` are one more point of it. Empty where nothing else is free,
    or no point of the scan has a law.
    """
    others = {
        coordinate.name: coordinate.prior
        for i, coordinate in enumerate(problem.coordinates)
        if i != index and i not in problem.noise_entries
    }
    if not others:
        return []
    try:
        held = problem.revised(free=others, scenes=problem.scenes(vector), noise=Noise())
    except InputError:
        # The value cannot be a scene's: a contact beyond the last point, an impossible material.
        return []
    known = problem.values(vector)
    # The profile explains the data nearly as well as the fit does: a start that is far worse leads no lower.
    likely = [start.vector for start in scan(held) if start.misfit <= LIKELY]
    return [problem.vector(known | held.values(start)) for start in likely]


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
    return _joined(fit, name, below, above, tuple(branches)), deepest if rise < -_DEEPER else None


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

    Raises
    ------
    InputError
        If the parameter is not free, the value is outside its bounds, or no law exists there.
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
