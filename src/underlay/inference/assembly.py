"""From an optimum to a `Fit`: covariance, what has no error bar and why, statistics, warnings."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.inference.diagnostics import ResidualDiagnostics, diagnose
from underlay.inference.fit_result import Fit, FitStatistics
from underlay.inference.fit_warnings import warnings_of
from underlay.inference.objective import Minimum, Objective
from underlay.inference.problem import Problem
from underlay.inference.provenance import provenance
from underlay.mechanics.contact_law import ContactLaw
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity

__all__ = ["assemble"]

# Closer than this to a bound (scaled coordinates) counts as on it; lmfit's bounded search approaches a bound
# quadratically and stops about 1e-6 away.
_ON_BOUND = 1e-4
# A direction whose singular value is below this times the largest is lost in the rounding and in the
# finite differences of the Jacobian.
_SINGULAR = 1e-9


def assemble(objective: Objective, minimum: Minimum, *, method: str, robust: str, seconds: float) -> Fit:
    """Make the result of a fit from where its minimiser stopped."""
    problem, vector = objective.problem, minimum.vector
    residuals, jacobian = objective.residuals(vector), objective.jacobian(vector)
    bounds_hit = _bounds_hit(problem, vector, objective.active)
    covariance, reasons = scaled_covariance(objective, jacobian, bounds_hit)
    slopes = problem.slopes(vector)
    stderr = {
        name: float("inf") if name in reasons else float(np.sqrt(covariance[i, i]) * abs(slopes[i]))
        for i, name in enumerate(problem.names)
    }
    diagnostics = _diagnostics(problem, vector, residuals)
    law = _worst_law(problem, vector)
    statistics = _statistics(
        objective, minimum, residuals[: problem.n_points], law, method=method, robust=robust, seconds=seconds
    )
    physical = problem.physical(vector)
    return Fit(
        problem=problem,
        vector=read_only(vector),
        values=problem.values(vector),
        stderr=stderr,
        scaled_covariance=read_only(covariance),
        covariance=read_only(covariance * np.outer(slopes, slopes)),
        no_error_bars=reasons,
        bounds_hit=bounds_hit,
        noises=objective.weights.noises,
        residuals=tuple(
            read_only(member.force - member.reading(physical).force) for member in problem.members
        ),
        diagnostics=diagnostics,
        statistics=statistics,
        warnings=warnings_of(problem, law, reasons, bounds_hit, covariance, diagnostics, statistics),
        provenance=provenance(problem.curves),
    )


def scaled_covariance(
    objective: Objective, jacobian: FloatArray, bounds_hit: dict[str, str]
) -> tuple[FloatArray, dict[str, str]]:
    """Covariance (k, k) in scaled coordinates, and the parameters without error bars with the reason.

    A parameter on a bound is taken as known there; a direction the data do not fix takes the error bars of
    the parameters it is made of, and of no others.
    """
    names = objective.problem.names
    reasons = {name: f"on its {bound}: no error bar there" for name, bound in bounds_hit.items()}
    covariance = np.zeros((len(names), len(names)))
    kept = [i for i in objective.active if names[i] not in reasons]
    while kept:
        _, singular, directions = np.linalg.svd(jacobian[:, kept], full_matrices=False)
        lost = directions[singular <= _SINGULAR * singular[0]]
        if not len(lost):
            covariance[np.ix_(kept, kept)] = (directions.T / singular**2) @ directions
            break
        # A parameter that takes part in a lost direction by more than a hundredth is not fixed.
        part = np.sqrt(np.square(lost).sum(axis=0))
        gone = [i for i, weight in zip(kept, part, strict=True) if weight > 0.01]
        for i in gone:
            others = ", ".join(names[j] for j in gone if j != i)
            reasons[names[i]] = (
                f"not fixed by these data: only a combination with {others} acts"
                if others
                else "not fixed by these data: it does not change the model here"
            )
        kept = [i for i in kept if i not in gone]
    return covariance, reasons


def _bounds_hit(problem: Problem, vector: FloatArray, active: list[int]) -> dict[str, str]:
    hit = {}
    for i in active:
        coordinate, (low, high) = problem.coordinates[i], problem.bounds[i]
        width = min(high - low, 1.0)
        for side, end, value in (("lower", low, coordinate.low), ("upper", high, coordinate.high)):
            if abs(vector[i] - end) < _ON_BOUND * width:
                hit[coordinate.name] = f"{side} bound {format_quantity(value, kind_of(coordinate.path))}"
    return hit


def _diagnostics(
    problem: Problem, vector: FloatArray, residuals: FloatArray
) -> tuple[ResidualDiagnostics, ...]:
    ends = np.cumsum([len(member.force) for member in problem.members])
    physical = problem.physical(vector)
    return tuple(
        diagnose(whitened, member.force - member.reading(physical).force)
        for member, whitened in zip(problem.members, np.split(residuals, ends), strict=False)
    )


def _worst_law(problem: Problem, vector: FloatArray) -> ContactLaw:
    """Law at the optimum with the largest estimated error, over the curves."""
    physical = problem.physical(vector)
    laws = [member.law(physical) for member in problem.members]
    return max(laws, key=lambda law: law.error_estimate)


def _statistics(
    objective: Objective,
    minimum: Minimum,
    residuals: FloatArray,
    law: ContactLaw,
    *,
    method: str,
    robust: str,
    seconds: float,
) -> FitStatistics:
    problem = objective.problem
    n, k = problem.n_points, len(problem.names)
    chi_square = float(residuals @ residuals)
    log_likelihood, parts = 0.0, np.split(residuals, np.cumsum([len(m.force) for m in problem.members]))
    estimated = 0
    for member, noise, sigma, own in zip(
        problem.members, objective.weights.noises, objective.weights.sigmas, parts, strict=False
    ):
        size = 1.0
        if member.scale_is_unknown:
            # The likelihood is largest at S / n; sigma was estimated with n - k.
            estimated += 1
            size = float(np.sqrt(own @ own / len(own)))
        normalisation = float(noise.log_normalisation(size * sigma, member.curve.time))
        log_likelihood += normalisation - 0.5 * float(own @ own) / size**2
    counted = k + estimated
    return FitStatistics(
        points=n,
        parameters=k,
        chi_square=chi_square,
        reduced_chi_square=chi_square / (n - k),
        log_likelihood=log_likelihood,
        aic=2.0 * counted - 2.0 * log_likelihood,
        bic=counted * float(np.log(n)) - 2.0 * log_likelihood,
        evaluations=objective.evaluations,
        failures=objective.failures,
        laws_built=problem.store.built,
        seconds=seconds,
        success=minimum.success,
        stopped=minimum.message,
        method=method,
        robust=robust,
        law_method=law.method,
        law_reason=law.reason,
        law_error=law.error_estimate,
        noise_estimated=estimated > 0,
    )
