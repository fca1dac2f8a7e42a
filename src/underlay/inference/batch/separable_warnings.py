"""What to beware of in a separable fit: the words of `least_squares.fit`, where there is cause for any."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.batch.separable_search import SeparableFit
from underlay.inference.least_squares.diagnostics import correlated
from underlay.inference.least_squares.fit_result import FitStatistics
from underlay.inference.least_squares.fit_warnings import warnings_of
from underlay.inference.problem import Problem
from underlay.mechanics.published import published_names

__all__ = ["separable_warnings"]

# The screens below pass every fit that `fit_warnings` could warn of, and a few more; published
# corrections warn of their range. Runs fewer than expected
# by this many standard deviations have a probability of 6e-3; a warning needs 1e-3.
_FEW_RUNS = -2.5
# A warning needs 0.99, and a standard error of one unit of a scaled coordinate.
_CORRELATED, _WIDE = 0.98, 0.5


def separable_warnings(found: SeparableFit, problem: Callable[[], Problem]) -> tuple[str, ...]:
    """Return the warnings of `warnings_of`; `problem` is asked for only where one is possible.

    Parameters
    ----------
    found : SeparableFit
        The optimum.
    problem : callable
        Builds the problem that was solved.
    """
    deviation = np.sqrt(np.diag(found.covariance))
    correlation = np.abs(found.covariance / (deviation[:, None] * deviation))
    np.fill_diagonal(correlation, 0.0)
    harmless = (
        correlation.max() < _CORRELATED
        and found.law_error < found.scaled_errors[found.modulus] < _WIDE
        and max(found.scaled_errors) < _WIDE
        and _runs_score(found.residuals) > _FEW_RUNS
        and found.law_method not in published_names()
    )
    if harmless:
        return ()
    made = problem()
    vector = made.vector(dict(zip(made.names, found.values.tolist(), strict=True)))
    law, slopes = made.members[0].law(made.physical(vector)), made.slopes(vector)
    scaled = found.covariance / np.outer(slopes, slopes)
    related = correlated(found.residuals / found.noise, found.residuals)
    warnings = warnings_of(made, [law], {}, {}, scaled, (related,), _statistics(found, made), ())
    return tuple(str(warning) for warning in warnings)


def _runs_score(residuals: FloatArray) -> float:
    """Runs of one sign less the expected number, in standard deviations."""
    above = residuals > 0.0
    n, positive = len(above), int(np.count_nonzero(above))
    expected = 1.0 + 2.0 * positive * (n - positive) / n
    variance = (expected - 1.0) * (expected - 2.0) / (n - 1.0)
    if not variance > 0.0:
        return 0.0
    runs = 1 + int(np.count_nonzero(above[1:] != above[:-1]))
    return (runs - expected) / float(np.sqrt(variance))


def _statistics(found: SeparableFit, problem: Problem) -> FitStatistics:
    n, k = len(found.residuals), len(found.values)
    estimated = problem.members[0].scale_is_unknown
    chi_square = found.sum_of_squares / found.noise**2
    # The likelihood is largest at S / n; the noise was estimated with n - k.
    variance = found.sum_of_squares / n if estimated else found.noise**2
    log_likelihood = -0.5 * n * float(np.log(2.0 * np.pi * variance)) - 0.5 * found.sum_of_squares / variance
    counted = k + estimated
    return FitStatistics(
        points=n,
        parameters=k,
        chi_square=chi_square,
        reduced_chi_square=chi_square / (n - k),
        log_likelihood=log_likelihood,
        aic=2.0 * counted - 2.0 * log_likelihood,
        bic=counted * float(np.log(n)) - 2.0 * log_likelihood,
        evaluations=found.steps,
        failures=0,
        laws_built=0,
        seconds=0.0,
        success=True,
        stopped="the contact moves no more",
        method="variable projection",
        robust="none",
        law_method=found.law_method,
        law_reason="",
        law_error=found.law_error,
        noise_estimated=estimated,
    )
