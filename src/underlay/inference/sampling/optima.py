"""Where the ridges of a posterior are looked for: optima of a fit, and what else its scan of the data offers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.blocks import blocked_objective
from underlay.inference.least_squares.candidates import candidates
from underlay.inference.least_squares.scan import scan
from underlay.inference.problem import Problem

__all__ = ["optima"]

# Starts asked of the scan: every local minimum of its grid that was ever seen.
_STARTS = 12


def optima(problem: Problem, start: Mapping[str, float] | None) -> list[FloatArray]:
    """Scaled vectors (parameters,), the best fit first; `start` alone (SI, by name) where it is given."""
    if start is not None:
        return [problem.vector(start)]
    try:
        found = fit(problem)
    except FitError:
        return [problem.start]
    # By their values: a fit with adhesion may have left out a reading, and its coordinates have its curve's scale.
    values = [found.values, *(other.values for other in found.alternatives)]
    return [*(problem.vector(each) for each in values), *_scanned(problem)]


def _scanned(problem: Problem) -> list[FloatArray]:
    """Minima on blocks of the curves below every start of the scan that may be an optimum.

    A fit keeps those that the data hardly reject; a posterior has room for one that is worse and wide.
    """
    if any(member.forward.history is not None or member.scene.adhesion for member in problem.members):
        # Blocks of neighbouring depths have no time, and no jump.
        return []
    low, high = problem.bounds.T
    starts = [np.clip(place, low, high) for place in scan(problem, _STARTS)]
    return [entry.vector for entry in candidates(blocked_objective(problem, robust=False), starts)]
