"""Least squares through lmfit, started from the data and answered with what the fit does not know."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import lmfit
import numpy as np

from underlay._arrays import FloatArray
from underlay.data.noise import Noise
from underlay.errors import FitError, InputError
from underlay.inference.fit_result import Fit, assemble
from underlay.inference.objective import Objective, Weights, weights_at
from underlay.inference.problem import Problem
from underlay.inference.start import scan_starts

__all__ = ["fit", "minimise"]

METHODS = ("leastsq", "least_squares")
_LOSSES = ("soft_l1", "huber", "cauchy", "arctan")


@dataclass(frozen=True)
class Minimum:
    """Where a minimiser stopped: scaled vector (k,), sum of squares, and what it says."""

    vector: FloatArray
    cost: float
    success: bool
    message: str


def fit(problem: Problem, method: str = "leastsq", robust: str | None = None, start: str = "scan") -> Fit:
    """Fit the free parameters of a problem."""
    began = time.perf_counter()
    noises = [member.noise for member in problem.members]
    best: Minimum | None = None
    starts = [problem.start] if start == "given" else [*scan_starts(problem, 1), problem.start][:1]
    objective = Objective(problem, weights_at(problem, starts[0], noises))
    for vector in starts:
        found = minimise(objective, vector, method=method, robust=robust)
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    return assemble(problem, objective, best, seconds=time.perf_counter() - began)


def minimise(
    objective: Objective, start: FloatArray, *, method: str = "leastsq", robust: str | None = None
) -> Minimum:
    """Minimise the weighted sum of squares from a scaled start (k,)."""
    problem = objective.problem
    parameters = lmfit.Parameters()
    for i, (value, (low, high)) in enumerate(zip(start, problem.bounds, strict=True)):
        parameters.add(f"q{i}", value=value, min=low, max=high)

    def vector(current: Any) -> FloatArray:
        return np.array([current[f"q{i}"].value for i in range(len(start))])

    minimiser = lmfit.Minimizer(lambda current: objective.residuals(vector(current)), parameters)
    result = minimiser.minimize(method=method, Dfun=lambda current: objective.jacobian(vector(current)))
    return Minimum(vector(result.params), float(result.chisqr), bool(result.success), str(result.message))
