"""The result of a fit from its optimum: standard errors, missing error bars, second optima, statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import log
from typing import Any

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.inference.least_squares.adhesive import about_adhesion
from underlay.inference.least_squares.diagnostics import correlated
from underlay.inference.least_squares.fit_result import Alternative, Fit, FitStatistics, FitWarning
from underlay.inference.least_squares.fit_warnings import (
    against_priors,
    ignored_sides,
    over_correlated,
    too_deep,
    warnings_of,
    without_contact,
)
from underlay.inference.least_squares.models import robust_inflation
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.settle import Optimum, noise_covariance
from underlay.inference.problem import Problem
from underlay.mechanics.contact_law import ContactLaw
from underlay.quantities import kind_of
from underlay.units import format_quantity

# Closer than this to a bound (scaled coordinates) counts as on it; lmfit's bounded search approaches a bound
# quadratically and stops about 1e-6 away.
_ON_BOUND = 1e-4
# A direction whose singular value is below this times the largest is lost in the rounding and in the
# finite differences of the Jacobian.
_SINGULAR = 1e-9
# Two minima within this share of a standard error are one; a rise of chi-square beyond 3.4^2 is rejected
# at 99.9 %.
_SAME, _REJECTED = 0.3, 11.6
# Two minima between which chi-square rises no more than this lie on one plateau or in one valley.
_HILL = 0.01
# Name of the minimiser where lmfit had no part.
_ENGINE = "projected Levenberg-Marquardt"


def times_told_by(problem: Problem) -> list[tuple[float, float]]:
    """Shortest and longest relaxation time (s) that each relaxing curve can show: its time step and its length."""
    clocks = [
        member.curve.time
        for member in problem.members
        if member.scene.layer.relaxation is not None and member.curve.time is not None
    ]
    if not clocks:
        return []
    # Not loaded for a sample that does not relax.
    from underlay.mechanics.viscoelastic.history import resolved_times  # noqa: PLC0415  see above

    return [resolved_times(clock) for clock in clocks]


def about_relaxation(problem: Problem, vector: FloatArray) -> Iterator[FitWarning]:
    """Warnings of relaxation times outside the range that the curves can show; none without relaxation."""
    ranges = times_told_by(problem)
    for name, value in problem.values(vector).items() if ranges else ():
        low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
        if ".relaxation.times[" in name and not low <= value <= high:
            yield FitWarning(
                "relaxation-time",
                f"{name} ended at {format_quantity(value, 'time')}, and the record tells times from "
                f"{format_quantity(low, 'time')}, its sampling, to {format_quantity(high, 'time')}, its length: "
                "fix it there, or leave this term out",
            )


def judge(
    optimum: Optimum,
    others: Sequence[FloatArray] = (),
    *,
    seconds: float,
    state: Callable[[Fit], Any],
) -> Fit:
    """Make the result of a fit from its best optimum.

    Parameters
    ----------
    optimum : Optimum
        The best one, settled on all readings.
    others : sequence of FloatArray
        Scaled vectors (k,) of the optima of other starts.
    seconds : float
        Time that the fit took.
    state : callable
        Function that makes the answers and the verdict of the fit, called when they are first read.
    """
    objective, vector = optimum.objective, optimum.vector
    problem = objective.problem
    physical = problem.physical(vector)
    residuals = objective.residuals(vector)
    bounds_hit = _bounds_hit(problem, vector, objective.active)
    covariance, reasons = scaled_covariance(objective, optimum.triangle, bounds_hit)
    covariance *= robust_inflation(residuals, optimum.loss_function)
    if problem.noise_entries:
        entries = sorted(problem.noise_entries)
        own = noise_covariance(problem, vector)
        covariance[np.ix_(entries, entries)] = own if np.isfinite(own).all() else 0.0
        if not np.isfinite(own).all():
            reasons |= {problem.names[i]: "these data do not fix the noise: give it a prior" for i in entries}
    slopes = problem.space.slopes(physical)
    deviation_scaled = np.sqrt(covariance.diagonal())
    deviation = deviation_scaled * np.abs(slopes)
    stderr = {
        name: float("inf") if name in reasons else float(error)
        for name, error in zip(problem.names, deviation, strict=True)
    }
    forces = tuple(
        read_only(member.force - model)
        for member, model in zip(problem.members, objective.asked.models(physical), strict=True)
    )
    # After the readings come the residuals of the priors.
    whitened = np.split(residuals, np.cumsum([len(force) for force in forces]))[:-1]
    alternatives = _alternatives(objective, vector, deviation_scaled, others)
    related = [correlated(own, force) for own, force in zip(whitened, forces, strict=True)]
    asked = objective.asked.asked_for(physical)
    laws = [member.law(asked) for member in problem.members]
    law = max(laws, key=lambda law: law.error_estimate)
    statistics = _statistics(optimum, whitened, law, seconds)
    return Fit(
        problem=problem,
        vector=read_only(vector),
        values=dict(zip(problem.names, physical.tolist(), strict=True)),
        stderr=stderr,
        scaled_covariance=read_only(covariance),
        covariance=read_only(covariance * slopes[:, None] * slopes),
        no_error_bars=reasons,
        bounds_hit=bounds_hit,
        noises=objective.noise.models,
        residuals=forces,
        whitened=tuple(read_only(own) for own in whitened),
        statistics=statistics,
        warnings=(
            *without_contact(problem, forces),
            *too_deep(problem, physical),
            *ignored_sides(problem, physical, laws),
            *against_priors(problem, physical),
            *over_correlated(objective.noise.models, whitened),
            *(about_adhesion(problem, vector) if problem.adheres else ()),
            *about_relaxation(problem, vector),
            *warnings_of(problem, laws, reasons, bounds_hit, covariance, related, statistics, alternatives),
        ),
        state=state,
        alternatives=alternatives,
        _lmfit=optimum.lmfit,
    )


def scaled_covariance(
    objective: Objective, triangle: FloatArray, bounds_hit: dict[str, str]
) -> tuple[FloatArray, dict[str, str]]:
    """Covariance (k, k) of the scaled parameters, and the parameters without error bars with the reason.

    A parameter on a bound is taken as known there. Where the data do not fix a combination of parameters, those
    that take part in it have no error bar, and all others keep theirs.

    Parameters
    ----------
    objective : Objective
        At the optimum.
    triangle : FloatArray
        R of the QR decomposition of the residuals' derivatives, (k, k).
    bounds_hit : dict of str to str
        Parameters on a bound, with which.
    """
    names = objective.problem.names
    reasons = {name: f"on its {bound}: no error bar there" for name, bound in bounds_hit.items()}
    covariance = np.zeros((len(names), len(names)))
    kept = [i for i in objective.active if names[i] not in reasons]
    while kept:
        _, singular, directions = np.linalg.svd(triangle[:, kept], full_matrices=False)
        lost = directions[singular <= _SINGULAR * singular[0]]
        if not len(lost):
            rows = np.array(kept)
            # numpy.ix_ takes longer than so small a product.
            covariance[rows[:, None], rows] = (directions.T / singular**2) @ directions
            break
        # A parameter that takes part in a lost direction by more than a hundredth is not fixed.
        part = np.sqrt(np.square(lost).sum(axis=0))
        gone = [i for i, weight in zip(kept, part, strict=True) if weight > 0.01]
        for i in gone:
            others = ", ".join(names[j] for j in gone if j != i)
            reasons[names[i]] = (
                f"not determined by these data: only a combination with {others} acts"
                if others
                else "not determined by these data: it does not change the model here"
            )
        kept = [i for i in kept if i not in gone]
    return covariance, reasons


def _alternatives(
    objective: Objective, vector: FloatArray, deviation: FloatArray, others: Sequence[FloatArray]
) -> tuple[Alternative, ...]:
    """Other optima whose rise of chi-square is below 11.6, each once and separated from the best by a higher ridge.

    Parameters
    ----------
    objective : Objective
        With the noise of the best optimum.
    vector, deviation : FloatArray
        Scaled vector of the best optimum, and standard errors of the scaled parameters, (k,).
    others : sequence of FloatArray
        Scaled vectors (k,) of the optima of other starts.
    """
    base = objective.square(vector)
    found: list[Alternative] = []
    for other in others:
        known = [(vector, 0.0), *((entry.vector, entry.delta_chi_square) for entry in found)]
        if any((np.abs(other - there) <= _SAME * (deviation + 1e-6)).all() for there, _ in known):
            continue
        rise = objective.square(other) - base
        if rise < _REJECTED and not any(
            _joined(objective, other, there, base + max(rise, at) + _HILL) for there, at in known
        ):
            found.append(Alternative(read_only(other), objective.problem.values(other), max(rise, 0.0)))
    return tuple(sorted(found, key=lambda entry: entry.delta_chi_square))


def _bounds_hit(problem: Problem, vector: FloatArray, active: list[int]) -> dict[str, str]:
    hit = {}
    for i in active:
        coordinate, (low, high) = problem.coordinates[i], problem.bounds[i]
        width = min(high - low, 1.0)
        for side, end, value in (("lower", low, coordinate.low), ("upper", high, coordinate.high)):
            if abs(vector[i] - end) < _ON_BOUND * width:
                hit[coordinate.name] = f"{side} bound {format_quantity(value, kind_of(coordinate.path))}"
    return hit


def _joined(objective: Objective, one: FloatArray, other: FloatArray, top: float) -> bool:
    """Whether the sum of squares stays at or below `top` on the straight line between two scaled vectors (k,)."""
    return all(objective.square(one + share * (other - one)) <= top for share in (0.5, 0.25, 0.75))


def _statistics(
    optimum: Optimum, whitened: list[FloatArray], law: ContactLaw, seconds: float
) -> FitStatistics:
    objective, problem = optimum.objective, optimum.objective.problem
    n, k = problem.n_points, len(problem.names)
    squares = [float(own @ own) for own in whitened]
    log_likelihood, estimated = 0.0, 0
    for member, noise, sigma, square in zip(
        problem.members, objective.noise.models, objective.noise.sigmas, squares, strict=True
    ):
        points, size = len(member.force), 1.0
        if member.scale_is_unknown:
            # The likelihood is largest at S / n; sigma was estimated with n - k.
            estimated += 1
            size = max((square / points) ** 0.5, np.finfo(float).tiny)
        normalisation = float(noise.log_normalisation(size * sigma, member.curve.time))
        log_likelihood += normalisation - 0.5 * square / size**2
    if problem.common is not None:
        log_likelihood -= problem.common.log_determinant
    counted = k + estimated
    return FitStatistics(
        points=n,
        parameters=k,
        chi_square=sum(squares),
        # As many numbers as readings leave nothing to judge by.
        reduced_chi_square=sum(squares) / (n - k) if n > k else float("nan"),
        log_likelihood=log_likelihood,
        aic=2.0 * counted - 2.0 * log_likelihood,
        bic=counted * log(n) - 2.0 * log_likelihood,
        evaluations=objective.evaluations,
        failures=objective.failures,
        laws_built=problem.store.built,
        seconds=seconds,
        success=optimum.success,
        stopped=optimum.message,
        method=_ENGINE if optimum.minimiser is None else optimum.minimiser.method,
        robust=optimum.loss_function or "none",
        law_method=law.method,
        law_reason=law.reason,
        law_error=law.error_estimate,
        noise_estimated=estimated > 0,
    )
