"""Least-squares fit of a problem: start, search, settle, judge.

A problem is compiled into weighted residuals, of all its readings and of blocks of neighbouring ones. `scan` finds
starts from the data alone; `candidates` searches from each on the blocks and keeps the minima that may be the
optimum; `settle` goes on from those on all readings, estimating the noise again where it was not given; and `judge`
makes the result of the best: standard errors, second optima, and warnings.

Standard errors are those of the delta method: the inverse of J'J in scaled parameters, times (dx/dq)^2, with J the
derivatives of the whitened residuals, q a scaled parameter and x its value in SI.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay._threads import one_thread
from underlay.errors import FitError, InputError
from underlay.inference.least_squares.adhesive import about_left_out, determined, for_all_readings
from underlay.inference.least_squares.candidates import EXPLAINED, ONE_PLACE, candidates
from underlay.inference.least_squares.engine import Ahead
from underlay.inference.least_squares.fit_result import Fit, FitWarning
from underlay.inference.least_squares.judge import judge
from underlay.inference.least_squares.models import LOSSES
from underlay.inference.least_squares.scan import LIKELY, Start, scan
from underlay.inference.least_squares.scan_curve import blocked_objective, power_law_objective
from underlay.inference.least_squares.settle import METHODS, Minimiser, Optimum, by_lmfit, settle
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.answer import PointwiseModulus
from underlay.mechanics.solvers import Exact
from underlay.units import format_quantity

# Steps shorter than the first (scaled coordinates) are those at a minimum, which lead in any direction; a step
# along a path makes an angle with it whose cosine is at least the second.
_LONG, _ALONG = 0.3, 0.9
# Refits with a tighter law that `refine` makes at most.
_MAX_REFINEMENTS = 4
# Standard error, relative, up to which a curve alone knows a number of the sample; the difference (in ln) of two
# such numbers, and the number of its standard deviations, from which the curves contradict each other.
_KNOWN_ALONE, _APART, _EXCLUDED = 0.2, 0.1, 5.0
# Share of a standard error by which the law's own error may move a parameter.
_LAW_SHARE = 1.0 / 3.0
# Relative tolerances of the law that `refine` may ask for.
_TIGHTEST, _LOOSEST = 1e-12, 1e-2
# Readings up to which one start is searched from without blocks: there is nothing to choose from, and a step costs
# 1.2 times one on blocks with 1000 readings, twice with 3000.
_FEW_POINTS = 2000
# Steps of a first search on all readings from the best start: along a valley without an end blocks are less work.
_QUICKLY = 5
# A start from which a search goes further than this in a scaled coordinate was no good one.
_FAR = 6.0
# Times that the readings beside a jump are chosen at most; the second mostly confirms the first.
_MAX_PASSES = 4


@one_thread()
def fit(
    problem: Problem,
    method: str = "leastsq",
    robust: str | None = None,
    *,
    start: str = "scan",
    refine: bool = False,
) -> Fit:
    """Fit the free parameters of a problem to its curves.

    Parameters
    ----------
    problem : Problem
        What is fitted.
    method : {"leastsq", "least_squares"}
        Minimiser of lmfit, Levenberg-Marquardt (MINPACK) or trust region: `Fit.lmfit` runs it from the optimum, and
        its optimum is taken where this program's own search did not converge.
    robust : {"soft_l1", "huber", "cauchy", "arctan"}, optional
        Loss that makes outliers count less; uses ``"least_squares"``.
    start : {"scan", "given"}
        Start from the data alone (see `scan.py`), or from the scene's own values.
    refine : bool
        Fit again with the exact law and a smaller tolerance until the law's own error is below a third of every
        standard error it would move.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If `method`, `robust` or `start` is not one of these words.
    FitError
        If no start has a contact law.
    """
    require_given(problem, "problem", Problem)
    _check(method, robust, start)
    lmfit = Minimiser("least_squares" if robust else method, robust)
    found = _fit_once(problem, lmfit, start)
    for _ in range(_MAX_REFINEMENTS if refine else 0):
        worst = law_bias(found)
        if worst <= _LAW_SHARE:
            break
        rtol = max(_TIGHTEST, found.statistics.law_error * _LAW_SHARE / worst * 0.3)
        tighter = found.problem.revised(scenes=found.scenes, solver=Exact(min(rtol, _LOOSEST)))
        found = _fit_once(tighter, lmfit, "given")
    if len(problem.members) > 1:
        found = replace(found, warnings=(*found.warnings, *_contradictions(problem)))
    return found


@one_thread()
def quick_fit(problem: Problem, *, start: str = "scan") -> Fit:
    """Fit as `fit` does, but without lmfit: for the thousands of fits of maps, simulated curves and rival models.

    Parameters
    ----------
    problem, start
        As in `fit`.

    Raises
    ------
    FitError
        If no start has a contact law.
    """
    return _fit_once(problem, None, start)


def pointwise_modulus(
    result: Fit | Problem, *, curve: int = 0, points: int = 30, level: float = 0.95
) -> PointwiseModulus:
    """Compute the modulus of the layer separately at every depth of a curve.

    It is the fit's modulus, times the ratio of the elastic moduli by which data and fitted model are reproduced
    there. For an elastic sample that is the modulus by which the force is reproduced; what a sample with memory has
    relaxed by then is in both.

    Parameters
    ----------
    result : Fit or Problem
        Gives contact point, baseline and everything but the layer's modulus; a problem is fitted first.
    curve : int, default 0
        Which curve of a joint fit.
    points : int, default 30
        Largest number of depths; each uses eight points of the curve or more.
    level : float, default 0.95
        Confidence of the intervals. They include the noise of the points about each depth and the uncertainty of
        the fitted parameters, under the noise that `Fit.interval` assumes.

    Returns
    -------
    PointwiseModulus
        Depths at which the interval is narrower than twice the modulus, which excludes the first after contact.

    Raises
    ------
    InputError
        If the tip adheres, or the curve is not one of the fit.
    CurveError
        If the modulus is determined at no depth.

    Examples
    --------
    >>> import numpy as np, underlay as ul
    >>> scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4), ul.RIGID)
    >>> curve = ul.synthesize(scene, np.linspace(0.0, 1e-4, 400), ul.Noise(force=1e-4), rng=0)
    >>> fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, noise=ul.Noise(force=1e-4)))
    >>> found = ul.pointwise_modulus(fit)
    >>> bool(np.all(np.abs(found.apparent.modulus[10:] / 1e6 - 1.0) < 0.01))
    True
    >>> bool(found.apparent_halfspace.modulus[-1] > 2e6)
    True
    """
    require_given(result, "result", Fit, Problem)
    found = fit(result) if isinstance(result, Problem) else result
    return found.modulus_by_depth(curve, points, level)


def _contradictions(problem: Problem) -> Iterator[FitWarning]:
    """Warn of shared numbers of the sample that single curves of a joint fit, each fitted alone, exclude."""
    alone = list(_each_alone(problem))
    for path in (name for name in problem.shared if name.startswith(("layer.", "substrate."))):
        known = [
            (found.values[path], found.stderr[path] / found.values[path])
            for found in alone
            if path in found.names and 0.0 < found.stderr[path] < _KNOWN_ALONE * found.values[path]
        ]
        if len(known) < 2:
            continue
        low, high = min(known), max(known)
        apart = float(np.log(high[0] / low[0]))
        if apart > max(_APART, _EXCLUDED * float(np.hypot(low[1], high[1]))):
            ends = (
                format_quantity(value, problem.base_scenes[0].quantities[path].kind)
                for value, _ in (low, high)
            )
            yield FitWarning(
                "contradiction",
                f"the curves contradict each other: alone they give {path} from {' to '.join(ends)}",
            )


def _each_alone(problem: Problem) -> Iterator[Fit]:
    """Each curve of a joint problem fitted alone, without those that tell too little for that."""
    for number, member in enumerate(problem.members):
        entries = (*member.entries.values(), *member.noise_entries.values())
        free = {problem.coordinates[entry].path: problem.coordinates[entry].prior for entry in entries}
        noise = member.noise if problem.noise_is_stated else None
        try:
            yield quick_fit(
                Problem(
                    problem.base_scenes[number], problem.curves[number], free, noise, solver=problem.solver
                )
            )
        except (InputError, FitError):
            continue


def _fit_once(problem: Problem, lmfit: Minimiser | None, start: str) -> Fit:
    """Fit once with the problem's own solver: scan for starts, search, settle on all readings, judge.

    `lmfit` is None for a fit without it; `start` as in `fit`.
    """
    began = time.perf_counter()
    places: Sequence[FloatArray] = [problem.start]
    if start == "scan":
        # A little inside the bounds: on one the transformed gradient of lmfit's bounded search is zero. Open bounds
        # are any distance apart, closed ones a hundredth of it at most.
        low, high = problem.bounds.T
        room = 0.01 * np.minimum(high - low, 1.0)
        starts = [
            Start(np.minimum(np.maximum(place, low + room), high - room), misfit)
            for place, misfit in scan(problem)
        ]
        robust = lmfit is not None and lmfit.loss is not None
        alone = None if robust else _explaining(problem, starts)
        if alone is not None:
            return _judged(lmfit, [alone], began)
        places = _descend(problem, [place for place, _ in starts], robust=robust) or places
    found = _settled(problem, lmfit, places, began)
    if problem.adheres:
        return _without_undetermined(found, lmfit, began)
    return found


def _without_undetermined(found: Fit, lmfit: Minimiser | None, began: float) -> Fit:
    """Fit again without the readings beside a jump of the force that the other readings cannot place.

    Repeated until the readings left out stay the same. `began` is the clock (s) at the start of the fit.
    """
    problem = found.problem
    used = [np.ones(len(member.force), dtype=bool) for member in problem.members]
    for _ in range(_MAX_PASSES):
        kept = determined(found, problem)
        same = all(np.array_equal(one, other) for one, other in zip(kept, used, strict=True))
        if same or sum(map(np.count_nonzero, kept)) <= len(problem.coordinates):
            break
        used = kept
        left = problem.revised(
            curves=[curve.select(keep) for curve, keep in zip(problem.curves, kept, strict=True)],
            noise=[m.noise.of_readings(keep) for m, keep in zip(problem.members, kept, strict=True)]
            if problem.noise_is_stated
            else None,
        )
        values = [found.values, *(other.values for other in found.alternatives)]
        found = _settled(left, lmfit, [left.vector(each) for each in values], began)
    return replace(
        found,
        warnings=(*found.warnings, *about_left_out(problem, used)),
        statistics=for_all_readings(found.statistics, problem.n_points),
    )


def _settled(problem: Problem, lmfit: Minimiser | None, places: Sequence[FloatArray], began: float) -> Fit:
    """Fit all readings from several starts, scaled vectors (k,), and make the result of the best optimum.

    `began` is the clock (s) at the start of the fit. Raises FitError where no start has a contact law.
    """
    robust = lmfit if lmfit is not None and lmfit.loss else None
    visited = VisitedPaths() if len(places) > 1 else None
    settled = []
    for place in places:
        if visited is not None:
            visited.begin()
        if (optimum := settle(problem, place, robust, give_up=visited)) is not None:
            settled.append(optimum)
            if problem.adheres and robust is None and optimum.success and _explains(optimum):
                # The starts of an adhesive contact are points of one valley: nothing of its dip is left to explain.
                break
    if not settled:
        raise _no_law(problem)
    return _judged(lmfit, settled, began)


def _explaining(problem: Problem, starts: Sequence[Start]) -> Optimum | None:
    """Optimum reached from the best start, if it explains the data and every other start is far worse.

    None otherwise: all starts must then be searched from.
    """
    others = [misfit for _, misfit in starts[1:]]
    if not others or min(others) <= LIKELY or problem.n_points > _FEW_POINTS or not _has_blocks(problem):
        return None
    start = starts[0].vector
    found = settle(
        problem,
        start,
        steps=_QUICKLY,
        give_up=lambda ahead: bool((np.abs(ahead.there - start) > _FAR).any()),
    )
    return found if found is not None and found.success and _explains(found) else None


def _explains(found: Optimum) -> bool:
    """Whether the model leaves hardly more of the curves than their scatter."""
    problem = found.objective.problem
    models = found.objective.asked.models(problem.physical(found.vector))
    square = sum(
        float(np.square(model - member.force).sum()) / member.scatter**2
        for model, member in zip(models, problem.members, strict=True)
    )
    return square <= EXPLAINED * problem.n_points


def _judged(lmfit: Minimiser | None, settled: Sequence[Optimum], began: float) -> Fit:
    """Make the result of the best of some optima, `began` being the clock (s) at the start of the fit.

    Where lmfit is given it runs from that optimum if the search did not converge, or ended on a plateau.
    """
    robust = lmfit is not None and lmfit.loss is not None
    best = settled[0]
    if len(settled) > 1:
        best = min(settled, key=lambda optimum: optimum.objective.loss(optimum.vector))
    others = [other.vector for other in settled if other is not best]
    if lmfit is not None and not robust:
        # Where the engine settled, lmfit moves nothing by 2e-3 of a standard error (tests/test_engine.py):
        # `Fit.lmfit` asks it when that is read, and nobody waits for what he does not read.
        # On a plateau there is more than one place to stop at: there its optimum is taken.
        best = replace(best, minimiser=lmfit)
        if best.objective.active and not (best.success and not _on_a_plateau(best)):
            best = by_lmfit(best.objective, lmfit, best.vector)
    return judge(best, others, seconds=time.perf_counter() - began, state=_stated)


def _on_a_plateau(best: Optimum) -> bool:
    """Whether some scaled parameter could change by 1 and the residuals, in all, by less than one sigma."""
    columns = best.triangle[:, best.objective.active]
    return bool(((columns * columns).sum(axis=0) < 1.0).any())


def _stated(found: Fit) -> Any:
    # Answers of most fits of a map are never read: the module is loaded with the first that is.
    from underlay.inference.uncertainty.statement import Statement  # noqa: PLC0415

    return Statement(found, partial(quick_fit, start="given"))


def _descend(problem: Problem, starts: Sequence[FloatArray], *, robust: bool) -> Sequence[FloatArray]:
    """Search from the starts on block averages of the curves, to choose where to go on with all readings.

    Returns scaled vectors (k,) of minima that may be the optimum, best first; the starts themselves where blocks
    are no help. With `robust` blocks are medians.
    """
    is_short = problem.n_points <= _FEW_POINTS and not robust
    # Without blocks every start is fitted to all points.
    if not starts or (len(starts) == 1 and is_short) or not _has_blocks(problem):
        return starts
    by_power_laws = power_law_objective(problem, robust=robust)
    if by_power_laws is not None:
        starts = [entry.vector for entry in candidates(by_power_laws, starts)] or starts
        if len(starts) == 1 and is_short:
            return starts
    found = candidates(blocked_objective(problem, robust=robust), starts)
    # Robust fits of different scale do not compare by their losses: only the best is taken further.
    return [entry.vector for entry in (found[:1] if robust else found)] or starts


def _has_blocks(problem: Problem) -> bool:
    """Whether neighbouring readings may be averaged: not where the force depends on time, or jumps."""
    return all(member.scene.is_elastic for member in problem.members)


def _no_law(problem: Problem) -> FitError:
    """Build the error of a fit whose starts have no contact law, with the solver's reason at the scene's values."""
    try:
        problem.residuals(problem.start)
    except InputError as error:
        return FitError(f"no contact law at the start of the fit: {error}")
    return FitError("no start of the scan has a contact law: put the scene's values close to those expected")


def _check(method: str, robust: str | None, start: str) -> None:
    for word, value, allowed in (("method", method, METHODS), ("start", start, ("scan", "given"))):
        if value not in allowed:
            raise InputError(f"unknown {word} {value!r}; known: {', '.join(allowed)}")
    if robust is not None and robust not in LOSSES:
        raise InputError(f"unknown robust loss {robust!r}; known: {', '.join(LOSSES)}, or None")


def law_bias(fit: Fit) -> float:
    """Largest shift of a parameter, over its standard error, due to the law's estimated relative error.

    A relative error of the force at every depth shifts the scaled parameters, to first order, by C J' V^-1 P times
    it, with C their covariance, V the squares of the noise's standard deviations, P the contact force and J its
    derivatives in them. A modulus that scales the force takes all of it. Correlation of the noise is left out: a
    shift of the mean hardly depends on it.
    """
    problem, physical = fit.problem, fit.problem.physical(fit.vector)
    slopes = problem.space.slopes(physical)
    total = np.zeros(len(slopes))
    for member, sigma in zip(problem.members, fit.sigmas, strict=True):
        reading, columns = member.jacobian(physical)
        total += (columns * slopes / sigma[:, None]).T @ (reading.contact / sigma)
    shifts, deviation = fit.scaled_covariance @ total, np.sqrt(np.diag(fit.scaled_covariance))
    fixed = deviation > 0.0
    relative = np.abs(shifts[fixed]) * fit.statistics.law_error / deviation[fixed]
    return float(relative.max(initial=0.0))


class VisitedPaths:
    """Paths of successive searches: a `GiveUp` callback that ends a search which joins an earlier one's path.

    Starts that end at the edge of what a start may explore often lie in one long valley. Below each of them the
    search would go the same way down it, evaluation for evaluation. The scaled vectors (k,) of every step are kept,
    and compared before each step of a later search.
    """

    def __init__(self) -> None:
        self._earlier: list[tuple[FloatArray, float]] = []
        self._own: list[FloatArray] = []
        self._lowest = np.inf

    def begin(self) -> None:
        """Close the path of the last search, before the next one begins."""
        if len(self._own) > 1:
            self._earlier.append((np.array(self._own), self._lowest))
        self._own, self._lowest = [], np.inf

    def __call__(self, ahead: Ahead) -> bool:
        """Whether a search lies on the path of an earlier one that went lower, and its next step goes along it."""
        step = ahead.there - ahead.here
        self._own.append(ahead.here)
        self._lowest = ahead.square
        return any(
            lowest <= ahead.square and _leads_along(way, ahead.here, step) for way, lowest in self._earlier
        )


def _leads_along(way: FloatArray, here: FloatArray, step: FloatArray) -> bool:
    """Whether a scaled vector (k,) lies on a path (n, k) and a step (k,) from it goes in the path's direction."""
    first, along = way[:-1], np.diff(way, axis=0)
    lengths = np.sqrt(np.square(along).sum(axis=1))
    long = lengths > _LONG
    if not long.any():
        return False
    first, along, lengths = first[long], along[long] / lengths[long, None], lengths[long]
    gone = ((here - first) * along).sum(axis=1)
    offset = here - first - np.clip(gone, 0.0, lengths)[:, None] * along
    on_it = (np.abs(offset) <= ONE_PLACE).all(axis=1)
    return bool((on_it & (along @ step >= _ALONG * np.sqrt(step @ step))).any())
