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
from underlay.inference.assembly import assemble
from underlay.inference.fit_result import Fit, FitStatistics, FitWarning
from underlay.inference.law_bias import law_bias
from underlay.inference.noise_estimate import first_noises, renew
from underlay.inference.objective import Minimum, Objective, weights_at
from underlay.inference.problem import Problem
from underlay.inference.start import scan_starts
from underlay.mechanics.accuracy import Accuracy

__all__ = ["Fit", "FitStatistics", "FitWarning", "fit", "minimise"]

METHODS = ("leastsq", "least_squares")
LOSSES = ("soft_l1", "huber", "cauchy", "arctan")

# lmfit's own tolerances (1.5e-8) let a fit stop where two unit systems differ in the sixth digit.
_TOLERANCE = 1e-8
_MAX_ROUNDS = 12
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
        Fit again with the exact law and a smaller `Accuracy` until the law's own error is below a third of
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
        tighter = found.problem.revised(
            scenes=found.scenes, method="exact", accuracy=Accuracy(min(rtol, _LOOSEST))
        )
        found = _fit_once(tighter, method, robust, "given")
    return found


def _fit_once(problem: Problem, method: str, robust: str | None, start: str) -> Fit:
    began = time.perf_counter()
    solver = "least_squares" if robust else method
    starts = [problem.start] if start == "given" else scan_starts(problem) or [problem.start]
    if robust:
        # The losses of two robust fits with their own scales do not compare: the best of the grid is taken.
        starts = starts[:1]
    outcomes = [_settle(problem, _inside(problem, first), solver, robust) for first in starts]
    objective, minimum = min(outcomes, key=lambda outcome: outcome[0].loss(outcome[1].vector))
    return assemble(
        objective,
        minimum,
        [other.vector for _, other in outcomes if other is not minimum],
        method=solver,
        robust=robust or "none",
        seconds=time.perf_counter() - began,
    )


def _settle(
    problem: Problem, vector: FloatArray, solver: str, robust: str | None
) -> tuple[Objective, Minimum]:
    """Fit from one start, and again while what is learnt of the noise changes the weights."""
    try:
        noises = first_noises(problem, vector)
        objective = Objective(problem, weights_at(problem, vector, noises))
    except InputError as error:
        raise FitError(f"no contact law at the start of the fit: {error}") from error
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
    max_evaluations: int | None = None,
) -> Minimum:
    """Minimise the weighted sum of squares over the active entries, from a scaled start (k,)."""
    active = objective.active
    if not active:
        return Minimum(start, success=True, message="nothing to vary.")
    names = [f"q{i}" for i in active]
    bounds = objective.problem.bounds
    parameters = lmfit.Parameters()
    for name, i in zip(names, active, strict=True):
        parameters.add(name, value=float(start[i]), min=float(bounds[i, 0]), max=float(bounds[i, 1]))

    def vector(current: Any) -> FloatArray:
        full: FloatArray = np.array(start)
        full[active] = [current[name].value for name in names]
        return full

    options: dict[str, Any] = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": 0.0}
    if method == "least_squares":
        options = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": None, "loss": robust or "linear"}
    minimiser = lmfit.Minimizer(
        lambda current: objective.residuals(vector(current)), parameters, max_nfev=max_evaluations
    )
    result = minimiser.minimize(
        method=method,
        Dfun=lambda current: objective.jacobian(vector(current), rough=True)[:, active],
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
