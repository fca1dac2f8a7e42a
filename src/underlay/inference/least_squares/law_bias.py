"""How far a contact law's own error could move the parameters fitted with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from underlay._arrays import FloatArray

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.problem import Problem

__all__ = ["law_bias", "shift_of_the_law"]


def law_bias(fit: Fit) -> float:
    """Largest shift over standard error, over the parameters, if the force is off by the law's error."""
    shifts = shift_of_the_law(fit.problem, fit.vector, fit.scaled_covariance, fit.sigmas)
    deviation = np.sqrt(np.diag(fit.scaled_covariance))
    fixed = deviation > 0.0
    relative = np.abs(shifts[fixed]) * fit.statistics.law_error / deviation[fixed]
    return float(relative.max(initial=0.0))


def shift_of_the_law(
    problem: Problem, vector: FloatArray, covariance: FloatArray, sigmas: tuple[FloatArray, ...]
) -> FloatArray:
    """Shift (k,) of the scaled parameters per unit of relative error of the force at every depth.

    First order: C J' V^-1 P, with P the contact force. A modulus that scales the force takes all of it.
    Correlation of the noise is left out: a shift of the mean hardly depends on it.
    """
    physical = problem.physical(vector)
    slopes = problem.space.slopes(physical)
    total = np.zeros(len(vector))
    for member, sigma in zip(problem.members, sigmas, strict=True):
        reading, columns = member.jacobian(physical)
        total += (columns * slopes / sigma[:, None]).T @ (reading.contact / sigma)
    return np.asarray(covariance @ total)
