"""A projected Levenberg-Marquardt search, from several starts at once: it serves every least-squares fit.

The steps are those of Levenberg and Marquardt (Marquardt 1963, doi:10.1137/0111030) in the parameters that are not
at a bound and not solved for; an `Objective` solves for the linear ones. One uphill step is allowed if the next one
leads below where it began: the valleys of these sums of squares are long and bent, and a straight step along one
ends on its side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.least_squares.objective import HAIR, Objective
from underlay.inference.least_squares.projection import Places, Point, acting
from underlay.inference.model.coordinates import SHORTEST

#: A step is cut to this in every scaled coordinate: a factor e^3 of a modulus, three ranges of the curve.
LONGEST = 3.0
# Damping (over columns of unit length) beyond which no step leads down; factors on it after a step that did, and
# after one that did not.
_MOST_DAMPING, _EASIER, _HARDER = 1e8, 0.1, 10.0
# With less damping, two columns that are equal to rounding would make the equations singular.
_LEAST_DAMPING = 1e-13
# Factor on the damping of the step after an uphill one: it then leads down to the bottom of the valley, and not as
# far along again. Else each small step along a bent valley would cost three evaluations, since the next step would
# be too long, and so would the one after it.
_BACK = 100.0
_VENTURE = 100.0  # how much higher than its beginning a step up the side may end
# The model is not computed after a last step. A step longer than this, over which the sum of squares may rise
# again, is not taken as a last one.
_SURE = 0.05
# A last step that should gain less than this share of the sum of squares, a thousandth of a standard error with
# 1000 points, is not made: the model is known where the search stands.
_STILL = 1e-9


def damped_steps(
    places: Places,
    damping: FloatArray,
    active: NDArray[np.bool_],
    low: FloatArray,
    high: FloatArray,
    longest: float = LONGEST,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levenberg-Marquardt steps from s points at once, kept within limits.

    Parameters
    ----------
    places : Places
        Points to step from, with J'r and J'J of the residuals r and their derivatives J.
    damping : FloatArray
        Damping of each search, added to the diagonal of J'J after its columns are scaled to unit length, (s,).
    active : ndarray of bool (k,)
        Parameters that may change.
    low, high : FloatArray
        Lowest and highest change of each scaled parameter, (s, k).
    longest : float
        Largest change of any scaled parameter.

    Returns
    -------
    steps : FloatArray
        Changes of the scaled vectors, (s, k).
    gain : FloatArray
        Fall of the sum of squares that the linearised model predicts for each step, (s,).
    length : FloatArray
        Largest change of a parameter, (s,).
    """
    gradient, normal = places.gradient, places.normal
    norms = np.sqrt(normal.diagonal(axis1=1, axis2=2))
    which = active & acting(norms)
    outward = which & ((low >= 0.0) | (high <= 0.0))
    if outward.any():
        outward &= _outward(gradient, low, high)
        which &= ~outward
    step = _solved(gradient, normal, which, norms, damping)
    if outward.any():
        # A parameter that would leave its limit from here may turn back inside after the others have moved.
        back = outward & ~_outward(gradient + (normal @ step[:, :, None])[:, :, 0], low, high)
        if back.any():
            which |= back
            step = _solved(gradient, normal, which, norms, damping)
    beyond = which & ((step < low) | (step > high))
    at, held = np.zeros_like(step), np.zeros_like(step)
    while beyond.any():
        # The parameter that would pass its limit first stops there, and the others go to their best with it fixed.
        # Stopped all at once they may lead uphill.
        end = np.where(step > 0.0, high, low)
        share = np.divide(end - at, step - at, out=np.full_like(step, np.inf), where=beyond)
        first, over = share.argmin(axis=1), np.asarray(beyond.any(axis=1))
        at += np.where(over, share.min(axis=1), 0.0)[:, None] * (step - at)
        meets = over[:, None] & (np.arange(step.shape[1]) == first[:, None])
        held, which = np.where(meets, end, held), which & ~meets
        moved = gradient + (normal @ held[:, :, None])[:, :, 0]
        step = np.where(over[:, None], held + _solved(moved, normal, which, norms, damping), step)
        beyond = which & ((step < low) | (step > high))
    length = np.abs(step).max(axis=1, initial=0.0)
    if (length > longest).any():
        step *= (longest / np.maximum(length, longest))[:, None]
        length = np.minimum(length, longest)
    if not held.any():
        return step, -np.einsum("sk,sk->s", step, gradient), length
    gain = -np.einsum("sk,sk->s", step, 2.0 * gradient + (normal @ step[:, :, None])[:, :, 0])
    return step, gain, length


def _outward(gradient: FloatArray, low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Which parameters (s, k) are at a limit that steepest descent would leave outwards or not at all.

    `gradient` is J'r, half the gradient of the sum of squares of residuals r with derivatives J; `low` and `high`
    are the changes that are still allowed, all (s, k).
    """
    return ((low >= 0.0) & (gradient >= 0.0)) | ((high <= 0.0) & (gradient <= 0.0))


def _solved(
    gradient: FloatArray, normal: FloatArray, which: NDArray[np.bool_], norms: FloatArray, damping: FloatArray
) -> FloatArray:
    """Damped least-squares steps (s, k) of the entries `which` (s, k), zero for the others.

    They solve (J'J + damping) step = -J'r, with r the residuals and J their derivatives. `gradient` is J'r (s, k),
    `normal` J'J (s, k, k), `norms` the roots of its diagonal, by which columns are scaled before the `damping` (s,)
    is added.
    """
    scale, diagonal, downhill = norms, 1.0 + damping[:, None], gradient
    rest = not which.all()
    if rest:
        # An entry that does not vary gets a row of the unit matrix, and no gradient.
        scale, diagonal = np.where(which, norms, 1.0), np.where(which, diagonal, 1.0)
        downhill = np.where(which, gradient, 0.0)
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    if rest:
        scaled = np.where(which[:, :, None] & which[:, None, :], scaled, 0.0)
    count = scaled.shape[1]
    scaled.reshape(-1, count * count)[:, :: count + 1] = diagonal
    return -np.linalg.solve(scaled, (downhill / scale)[:, :, None])[:, :, 0] / scale


class Ahead(NamedTuple):
    """The step that a search is about to make, as `GiveUp` callbacks receive it.

    Parameters
    ----------
    row : int
        Number of the search, where several run together.
    steps : int
        Steps made so far.
    square : float
        Lowest sum of squares so far.
    promised : float
        Sum of squares after the step, as the linearised model predicts it.
    here, there : FloatArray
        Scaled vectors (k,): of the lowest sum of squares so far, and where the step leads.
    """

    row: int
    steps: int
    square: float
    promised: float
    here: FloatArray
    there: FloatArray


#: Callback before each step: whether to abandon the search.
GiveUp: TypeAlias = Callable[[Ahead], bool]


@dataclass(frozen=True)
class Search:
    """Limits of a search: how many steps it makes, and when it ends.

    A last step is added to the parameters without computing the model there.

    Parameters
    ----------
    steps : int
        Largest number of steps, one evaluation of the model each.
    settled : float
        A step that should lower the sum of squares by less than this share of it is the last.
    least : float
        A step that should lower the sum of squares by less than this is the last.
    damping : float
        Damping of the first step, on columns of unit length.
    endless : float
        A search ends with a step of the largest allowed length that lowers the sum of squares by less than this
        share: the sum falls on and on with nothing to be gained.
    walled : float
        After a step was rejected because there is no contact law where it led, the next step down is the last if it
        gains less than this share of the sum of squares: the search creeps along the limit of the laws, where each
        law costs most.
    swinging : float
        After an uphill step and the next one led no lower, the next step down is the last if it gains less than
        this share of the sum of squares: the search oscillates about the bottom of a long valley.
    straight : float
        A short undamped step is the last if the curvature of the models over it is estimated to be worth less than
        this share of a standard error.
    longest : float
        A step is cut to this in every scaled coordinate.
    """

    steps: int = 60
    settled: float = 2e-7
    least: float = 0.0
    damping: float = 1e-5
    endless: float = 0.0
    walled: float = 0.0
    swinging: float = 0.0
    straight: float = 0.0
    longest: float = LONGEST

    def is_little(self, gain: FloatArray, square: FloatArray) -> NDArray[np.bool_]:
        """Whether reductions `gain` (s,) of sums of squares `square` (s,) are too small to continue."""
        return np.asarray(gain <= np.maximum(self.settled * square, self.least))


#: The search on all readings: its last step is within some hundredths of a standard error, what it leaves within a
#: thousandth. Damped less, fits take some 5 % less time, and those of a law that sticks end in one of its lesser
#: minima.
FINE = Search(walled=1e-5, straight=5e-4)


@dataclass(frozen=True)
class Minimum:
    """The end of a search.

    Parameters
    ----------
    point : Point
        The point of lowest sum of squares among those where the model was computed.
    vector : FloatArray
        Scaled vector (k,): that of `point` plus the last step, after which the model is not computed.
    success : bool
        Whether the search met its tolerance.
    message : str
        Why it ended.
    """

    point: Point
    vector: FloatArray
    success: bool
    message: str


def minimise(
    objective: Objective, start: FloatArray, search: Search = FINE, give_up: GiveUp | None = None
) -> Minimum | None:
    """Minimise the sum of squares within the problem's bounds, from one start.

    Parameters
    ----------
    objective : Objective
        Residuals and derivatives.
    start : FloatArray
        Scaled vector to begin at, (k,).
    search : Search
        Limits of the search.
    give_up : callable, optional
        Called with an `Ahead` before each step; the search is abandoned where it returns True.

    Returns
    -------
    Minimum or None
        None if there is no contact law at the start, or the search was abandoned.
    """
    low, high = (end[None] for end in objective.problem.bounds.T)
    begin = objective.places(np.clip(start[None], low, high), low, high)
    return descend(objective, begin, low, high, search, give_up)[0] if np.isfinite(begin.square[0]) else None


def descend(
    objective: Objective,
    begin: Places,
    low: FloatArray,
    high: FloatArray,
    search: Search = FINE,
    give_up: GiveUp | None = None,
    ended: Callable[[int, Minimum], None] | None = None,
) -> list[Minimum | None]:
    """Minimise the sum of squares from s points together, one step of every search at a time.

    Parameters
    ----------
    objective : Objective
        Residuals and derivatives.
    begin : Places
        Points to begin at, s of them.
    low, high : FloatArray
        Limits of each search in the scaled parameters, (s, k).
    search : Search
        Limits on steps and accuracy.
    give_up : callable, optional
        Called with an `Ahead` before each step of each search; that search is abandoned where it returns True.
    ended : callable, optional
        Called with the row and the `Minimum` of each search that was not abandoned, as soon as it ends.

    Returns
    -------
    list of Minimum or None
        One for each point; None for an abandoned search.
    """
    active = np.zeros(len(objective.problem.coordinates), dtype=bool)
    active[objective.active] = True
    found: list[Minimum | None] = [None] * len(begin.square)
    still = np.zeros(len(found), dtype=bool)
    damping = np.full(len(found), search.damping)
    here = Running(np.arange(len(found)), begin, begin, still, still, still, damping, low, high)

    def end(i: int, words: str, vector: FloatArray | None = None, *, success: bool = True) -> None:
        """Record that search `i` of those that run ended, at its best point or at `vector`."""
        best, row = here.best.point(i), int(here.rows[i])
        found[row] = minimum = Minimum(best, best.vector if vector is None else vector, success, words)
        if ended is not None:
            ended(row, minimum)

    for count in range(search.steps):
        proposed, promised, last = here.proposed(active, search, objective)
        going = _going(here, count, proposed, promised, last, give_up, end)
        if not going.all():
            here, proposed = here.part(going), proposed[going]
        if not len(here.rows):
            break
        here, why = here.moved(objective.places(proposed, here.low, here.high), search)
        for i, words in enumerate(why):
            if words:
                end(i, words)
        if any(why):
            here = here.part(np.array([not words for words in why]))
    else:
        for i in range(len(here.rows)):
            end(i, f"not settled after {search.steps} steps", success=False)
    return found


def _going(
    here: Running,
    count: int,
    proposed: FloatArray,
    promised: FloatArray,
    last: NDArray[np.bool_],
    give_up: GiveUp | None,
    end: Callable[[int, str, FloatArray], None],
) -> NDArray[np.bool_]:
    """Which of s searches go on (s,) to the vectors `proposed` (s, k); those whose step is the last end there.

    `count` steps were made so far, and sums of squares `promised` (s,) are predicted. One search after the other:
    what one of them ends with may lead `give_up` to abandon the next.
    """
    going = ~last
    for i, row in enumerate(here.rows.tolist()):
        square, vector = float(here.best.square[i]), here.best.vector[i]
        if give_up and give_up(Ahead(row, count, square, float(promised[i]), vector, proposed[i])):
            going[i] = False
        elif last[i]:
            end(i, "the next step gains nothing", proposed[i])
    return going


class Running(NamedTuple):
    """State of the s searches that have not ended.

    Parameters
    ----------
    rows : ndarray of int (s,)
        Numbers of these searches among all that `descend` was given.
    now, best : Places
        Point from which each search steps next, and its point of lowest sum of squares.
    ventured : ndarray of bool (s,)
        Searches whose last step was an allowed uphill one, so that `now` is above `best`.
    refused : ndarray of bool (s,)
        Searches of which a step since their last success led to where there is no contact law.
    swung : ndarray of bool (s,)
        Searches of which an uphill step and the one after it led no lower.
    damping : FloatArray
        Current damping, (s,).
    low, high : FloatArray
        Limits of the scaled parameters, (s, k).
    """

    rows: NDArray[np.intp]
    now: Places
    best: Places
    ventured: NDArray[np.bool_]
    refused: NDArray[np.bool_]
    swung: NDArray[np.bool_]
    damping: FloatArray
    low: FloatArray
    high: FloatArray

    def part(self, which: NDArray[np.bool_]) -> Running:
        """State of some of the searches, chosen by a mask (s,)."""
        return Running._make(own[which] for own in self)

    def proposed(
        self, active: NDArray[np.bool_], search: Search, objective: Objective
    ) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Next step of every search.

        Returns
        -------
        there : FloatArray
            Scaled vectors to go to, (s, k).
        promised : FloatArray
            Sums of squares that the linearised models predict there, (s,).
        last : ndarray of bool (s,)
            Steps so small that the search ends with them, without computing the model.
        """
        here = self.now.vector
        low, high = self.low - here, self.high - here
        for course in objective.courses:
            low, high = course.straight(here, low), course.straight(here, high)
        step, gain, length = damped_steps(self.now, self.damping, active, low, high, search.longest)
        little = search.is_little(gain, self.best.square)
        little |= length <= SHORTEST
        if search.straight and not little.all() and (length <= HAIR).any():
            plain, its_gain, straight = self._straight(active, low, high, search.straight, objective.points)
            step, gain = np.where(straight[:, None], plain, step), np.where(straight, its_gain, gain)
            little |= straight
        made = gain > _STILL * self.best.square
        if not made.all():
            step = np.where(made[:, None], step, 0.0)
        change = step
        for course in objective.courses:
            change = course.changes(here, change, search.longest)
        there = np.minimum(np.maximum(here + change, self.low), self.high)
        return there, self.now.square - gain, little & ~self.ventured & ((length <= _SURE) | ~made)

    def _straight(
        self, active: NDArray[np.bool_], low: FloatArray, high: FloatArray, share: float, points: int
    ) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Undamped steps, and which of them are short enough for the linearised model to be as good as the model.

        The curvature of the models over a step is estimated by its length times the sum over the parameters of the
        change that each makes, without cancelling.

        Parameters
        ----------
        active : ndarray of bool (k,)
            Parameters that vary.
        low, high : FloatArray
            Limits of the steps, (s, k).
        share : float
            Largest curvature, in standard errors.
        points : int
            Number of readings.

        Returns
        -------
        tuple
            Steps (s, k), the falls of the sum of squares that they predict (s,), and the mask (s,).
        """
        least = np.full(len(self.rows), _LEAST_DAMPING)
        step, gain, length = damped_steps(self.now, least, active, low, high)
        norms = np.sqrt(self.now.normal.diagonal(axis1=1, axis2=2))
        curved = length * (norms * np.abs(step)).sum(axis=1)
        return step, gain, (length <= HAIR) & (curved <= share * np.sqrt(self.best.square / points))

    def moved(self, there: Places, search: Search) -> tuple[Self, list[str]]:
        """Update the state after the models were computed at `there`.

        Returns
        -------
        tuple of Running and list of str
            The new state, and why each search ended, empty where it goes on.
        """
        change = there.square - self.best.square
        lower = change < 0.0
        ventured = ~lower & ~self.ventured & (there.square < _VENTURE * self.best.square)
        best = self.best.replaced(lower, there)
        now = best if not ventured.any() else best.replaced(ventured, there)
        own = np.where(self.ventured, self.damping / _BACK, self.damping)
        factor = np.where(lower, _EASIER, np.where(ventured, _BACK, _HARDER))
        damping = np.maximum(factor * own, _LEAST_DAMPING)
        endless = lower & (-change <= search.endless * best.square)
        if endless.any():
            # An uphill step and the one that leads back down count as one step along the valley.
            endless &= np.abs(there.vector - self.best.vector).max(axis=1) >= search.longest
        endless |= lower & self.refused & (-change <= search.walled * best.square)
        endless |= lower & self.swung & (-change <= search.swinging * best.square)
        little, stuck = search.is_little(np.abs(change), best.square), damping > _MOST_DAMPING
        reasons = (
            (little, "the last step gained nothing"),
            (endless, "the valley goes on and gains nothing"),
            (stuck, "no step leads further down"),
        )
        why = [next((words for flags, words in reasons if flags[i]), "") for i in range(len(little))]
        refused = (there.square == np.inf) | (self.refused & ~lower)
        swung = ~lower & (self.ventured | self.swung)
        found = self._replace(
            now=now, best=best, ventured=ventured, refused=refused, swung=swung, damping=damping
        )
        return found, why
