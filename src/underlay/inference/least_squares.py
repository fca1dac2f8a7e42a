"""Least squares through lmfit, started from the data and answered with what the fit does not know.

Standard errors are those of the delta method: the inverse of J'J in scaled coordinates, times (dx/dq)^2.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import lmfit
import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError, InputError
from underlay.inference.fitting.assembly import assemble
from underlay.inference.fitting.fit_result import Fit, FitStatistics, FitWarning
from underlay.inference.fitting.law_bias import law_bias
from underlay.inference.fitting.noise_estimate import first_noises, renew
from underlay.inference.fitting.objective import Minimum, Objective, weights_at
from underlay.inference.fitting.rough import rough_minima
from underlay.inference.fitting.start import scan_starts
from underlay.inference.problem import Problem
from underlay.mechanics.solvers import Exact

__all__ = ["Fit", "FitStatistics", "FitWarning", "fit", "minimise"]

METHODS = ("leastsq", "least_squares")
LOSSES = ("soft_l1", "huber", "cauchy", "arctan")

# lmfit's own tolerances (1.5e-8) let a fit stop where two unit systems differ in the sixth digit.
_TOLERANCE = 1e-8
# An entry whose column is this small beside the largest does not act any more (a base so stiff that it might
# be rigid). Levenberg and Marquardt measure a step by the columns: that entry's is then without end, the law
# refuses it, and the steps of all entries shrink below the tolerance before that one is short enough.
_IDLE = 0.01 * _TOLERANCE
_MAX_ROUNDS = 12
# From a start that the scan found ten evaluations are usual; a valley without an end takes hundreds.
_MOST_EVALUATIONS = 300
_MAX_REFINEMENTS = 4
_LAW_SHARE = 1.0 / 3.0  # of a standard error that the law's own error may move a parameter by
_TIGHTEST, _LOOSEST = 1e-12, 1e-2


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
        lmfit's minimiser: Levenberg-Marquardt (MINPACK) or trust region.
    robust : {"soft_l1", "huber", "cauchy", "arctan"}, optional
        Loss that makes outliers count less; uses ``"least_squares"``.
    start : {"scan", "given"}
        From the data alone (see `start.py`), or from the scene's own values.
    refine : bool
        Fit again with the exact law and a smaller tolerance until the law's own error is below a third of
        every standard error it would move.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If a word is not one of these.
    FitError
        If no start has a contact law.
    """
    _check(method, robust, start)
    found = _fit_once(problem, method, robust, start)
    for _ in range(_MAX_REFINEMENTS if refine else 0):
        worst = law_bias(found)
        if worst <= _LAW_SHARE:
            break
        rtol = max(_TIGHTEST, found.statistics.law_error * _LAW_SHARE / worst * 0.3)
        tighter = found.problem.revised(scenes=found.scenes, solver=Exact(min(rtol, _LOOSEST)))
        found = _fit_once(tighter, method, robust, "given")
    return found


def _fit_once(problem: Problem, method: str, robust: str | None, start: str) -> Fit:
    began = time.perf_counter()
    solver = "least_squares" if robust else method
    starts = [problem.start] if start == "given" else _scanned(problem, robust)
    settled = [_settle(problem, _inside(problem, first), solver, robust) for first in starts]
    outcomes = [outcome for outcome in settled if outcome is not None]
    if not outcomes:
        raise _no_law(problem)
    objective, minimum = outcomes[0]
    if len(outcomes) > 1:
        objective, minimum = min(outcomes, key=lambda outcome: outcome[0].loss(outcome[1].vector))
    return assemble(
        objective,
        minimum,
        [other.vector for _, other in outcomes if other is not minimum],
        method=solver,
        robust=robust or "none",
        seconds=time.perf_counter() - began,
    )


def _no_law(problem: Problem) -> FitError:
    """Why nothing could be computed: what the law says at the scene's own values."""
    try:
        problem.residuals(problem.start)
    except InputError as error:
        return FitError(f"no contact law at the start of the fit: {error}")
    return FitError(
        "no start of the scan has a contact law: pass start='given' to begin at the scene's values"
    )


def _scanned(problem: Problem, robust: str | None) -> list[FloatArray]:
    """Starts from the data alone, those that may be the optimum, best first; the scene's own if there is none."""
    starts = [_inside(problem, first) for first in scan_starts(problem)]
    if any(member.forward.history is not None for member in problem.members):
        # The scan takes the sample for elastic, and blocks of neighbouring depths have no time: every start of
        # the scan is fitted to all points.
        return starts or [problem.start]
    found = (
        [entry.vector for entry in rough_minima(problem, starts, robust=robust is not None)] if starts else []
    )
    # Robust fits of different scale do not compare by their losses: only the best is taken further.
    return (found[:1] if robust else found) or starts or [problem.start]


def _settle(
    problem: Problem, vector: FloatArray, solver: str, robust: str | None
) -> tuple[Objective, Minimum] | None:
    """Fit from one start, and again while what is learnt of the noise changes the weights.

    None if there is no contact law at the start.
    """
    try:
        objective = Objective(problem, weights_at(problem, vector, first_noises(problem, vector)))
    except InputError:
        return None
    if not objective.exists(vector):
        return None
    minimum = minimise(objective, vector, method=solver, robust=robust)
    for _ in range(_MAX_ROUNDS):
        renewal = renew(objective, minimum.vector, robust=robust is not None)
        objective.weights = renewal.weights
        minimum = replace(minimum, vector=renewal.vector)
        if renewal.settled:
            break
        minimum = minimise(objective, minimum.vector, method=solver, robust=robust)
    return objective, minimum


def minimise(
    objective: Objective,
    start: FloatArray,
    *,
    method: str = "leastsq",
    robust: str | None = None,
    max_evaluations: int = _MOST_EVALUATIONS,
) -> Minimum:
    """Minimise the weighted sum of squares over the active entries, from a scaled start (k,)."""
    active = objective.active
    if not active:
        return Minimum(start, success=True, message="nothing to vary.")
    names = [f"q{i}" for i in active]
    low, high = objective.problem.bounds.T
    parameters: Any = [
        lmfit.Parameter(name, value=float(start[i]), min=float(low[i]), max=float(high[i]))
        for name, i in zip(names, active, strict=True)
    ]
    if method == "least_squares":
        # leastsq takes the list as it is and spares itself a copy, with its interpreter of expressions.
        parameters, named = lmfit.Parameters(), parameters
        parameters.add_many(*named)

    def vector(current: Any) -> FloatArray:
        full: FloatArray = np.array(start)
        full[active] = [current[name].value for name in names]
        return full

    def jacobian(current: Any) -> FloatArray:
        columns = objective.jacobian(vector(current), rough=True)[:, active]
        norms = np.linalg.norm(columns, axis=0)
        # The minimiser leaves an entry whose column is zero where it is.
        return np.where(norms > _IDLE * norms.max(), columns, 0.0)

    options: dict[str, Any] = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": 0.0}
    if method == "least_squares":
        options = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": None, "loss": robust or "linear"}
    minimiser = lmfit.Minimizer(
        lambda current: objective.residuals(vector(current)), parameters, max_nfev=max_evaluations
    )
    result = minimiser.minimize(
        method=method,
        Dfun=jacobian,
        **options,
    )
    return Minimum(vector(result.params), bool(result.success), str(result.message))


def _check(method: str, robust: str | None, start: str) -> None:
    for word, value, allowed in (("method", method, METHODS), ("start", start, ("scan", "given"))):
        if value not in allowed:
            raise InputError(f"unknown {word} {value!r}; known: {', '.join(allowed)}")
    if robust is not None and robust not in LOSSES:
        raise InputError(f"unknown robust loss {robust!r}; known: {', '.join(LOSSES)}, or None")


def _inside(problem: Problem, vector: FloatArray) -> FloatArray:
    """Start a little inside the bounds: on one, the transformed gradient of a bounded search is zero."""
    low, high = problem.bounds.T
    room = np.where(np.isfinite(high - low), 0.01 * np.minimum(high - low, 1.0), 0.01)
    return np.asarray(np.minimum(np.maximum(vector, low + room), high - room))
