"""Where the ridges of a posterior are looked for: optima of a fit, and what else its scan of the data offers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import FitError
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.blocks import blocked_objective
from underlay.inference.least_squares.candidates import candidates
from underlay.inference.least_squares.scan import Landscape
from underlay.inference.problem import Problem

__all__ = ["Starts", "optima"]

# Starts asked of the scan: every local minimum of its grid that was ever seen; and the best of its other places.
_STARTS, _PLACES = 12, 24


class Starts(NamedTuple):
    """Where to look for ridges, in scaled vectors (parameters,).

    Parameters
    ----------
    optima : list of FloatArray
        The best fit, then the others.
    places : list of FloatArray
        Of the scan, best first: no optima, but where the rest was fitted to the data.
    """

    optima: list[FloatArray]
    places: list[FloatArray]


def optima(problem: Problem) -> Starts:
    """Optima of a fit and what its scan offers."""
    try:
        found = fit(problem)
    except FitError:
        return Starts([problem.start], [])
    # By their values: a fit with adhesion may have left out a reading, and its coordinates have its curve's scale.
    values = [found.values, *(other.values for other in found.alternatives)]
    scanned = _scanned(problem)
    return Starts([*(problem.vector(each) for each in values), *scanned.optima], scanned.places)


def _scanned(problem: Problem) -> Starts:
    """Minima on blocks of the curves below every start of the scan that may be an optimum, and the scan's places.

    A fit keeps those that the data hardly reject; a posterior has room for one that is worse and wide, and for a
    ridge that bends back where no minimum is.
    """
    if any(member.forward.history is not None or member.scene.adhesion for member in problem.members):
        # Blocks of neighbouring depths have no time, and no jump.
        return Starts([], [])
    low, high = problem.bounds.T
    landscape = Landscape.of(problem)
    starts, places = (
        [np.clip(landscape.vector(place), low, high) for place in chosen]
        for chosen in (landscape.minima(_STARTS), landscape.places()[:_PLACES])
    )
    minima = candidates(blocked_objective(problem, robust=False), starts)
    return Starts([entry.vector for entry in minima], places)
