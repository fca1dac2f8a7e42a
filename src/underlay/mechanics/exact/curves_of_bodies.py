"""Master curves of one power-law tip on several bodies that are much alike: of one table, solved together.

Beside a solution of few nodes the calls and the cosines cost most. Bodies of one span of a table take the same
contact radii and nodes, those of the most demanding of them: one batch then serves them all. Where little accuracy
is asked for, curves that were stored do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.exact.contact_curve import (
    SHARE_OF_CURVE,
    SHARE_OF_NODES,
    SOFT,
    RadiusGuess,
    solve_curve,
)
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, ContactProblem, contact_factors
from underlay.mechanics.exact.curve_batch import curves_through
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    Stretch,
    chebyshev_angles,
)
from underlay.mechanics.exact.nodes import Resolution, wanted_terms
from underlay.mechanics.exact.punch_solution import PunchSolution
from underlay.mechanics.exact.stored_curves import STORED_ERROR, stored_curves
from underlay.mechanics.indenters import PowerLaw
from underlay.mechanics.kernel import Kernel

__all__ = ["Logarithms", "SolvedCurves", "solve_curves"]

#: Logarithms of the factors of all curves at varpi (n,), shape (curves, 3, n).
Logarithms: TypeAlias = Callable[[FloatArray], FloatArray]


class SolvedCurves(NamedTuple):
    """Curves of several bodies, and how they were found: what `SolvedCurve` says, of the worst of them."""

    logarithms: Logarithms
    resolution: Resolution
    radii: int
    eps: float
    error_estimate: float


def solve_curves(bodies: Sequence[Kernel], exponent: float, top: float, rtol: float) -> SolvedCurves | None:
    """Curves of a tip w = A F_2 a^lambda of any size on bodies under a layer of unit thickness, up to `top`.

    Parameters
    ----------
    bodies : sequence of Kernel
        With the layer.
    exponent : float
        Of the tip's power law.
    top : float
        Largest varpi.
    rtol : float
        Relative error of each.

    Returns
    -------
    SolvedCurves or None
        None where one of them folds.

    Raises
    ------
    RangeError
        If a contact radius would pass 20 thicknesses.
    """
    for way in (_stored, _together):
        found = way(bodies, exponent, top, rtol)
        if found is not None:
            return found
    return _one_by_one(bodies, exponent, top, rtol)


def _stored(bodies: Sequence[Kernel], exponent: float, top: float, rtol: float) -> SolvedCurves | None:
    """Read the curves off those of the file; None where it does not hold all of them."""
    series = stored_curves(bodies, exponent, top, rtol)
    if series is None:
        return None
    widest = series.logarithms(np.array([top]))[:, Factor.RADIUS].max()
    eps = float(np.exp(widest)) * top
    return SolvedCurves(series.logarithms, series.resolution, series.radii, eps, STORED_ERROR)


def _together(bodies: Sequence[Kernel], exponent: float, top: float, rtol: float) -> SolvedCurves | None:
    """Solve at radii that `RadiusGuess` places; None where that will not do, or takes too many."""
    scales = [body.scales for body in bodies]
    if not all(one.charted and one.softest > SOFT for one in scales):
        return None
    tip = PowerLaw(exponent, 1.0)
    points = np.array([top])
    # The widest contact of them: beside it the others' points reach further than they are asked for.
    guess = max(
        (RadiusGuess.of(one, exponent) for one in scales), key=lambda one: float(one.radius(points)[0])
    )
    softness = max(one.softness for one in scales)
    # No whole blocks: the curves are expanded again. What an error is estimated from is four terms.
    terms = max(4, ceil(max(wanted_terms(one, top, exponent, rtol) for one in scales)))
    while terms <= MOST_TERMS:
        eps = guess.radius(Stretch.to(top, softness).v(np.cos(chebyshev_angles(terms))))
        last = float(guess.radius(points)[0])
        if last >= LARGEST_EPS:
            return None
        resolution = max(
            (Resolution.choose(one, last, rtol) for one in scales),
            key=lambda one: (one.radial, one.wavenumbers),
        )
        punch = PunchSolution.solve_all(bodies, eps, resolution)
        varpi, logarithms = contact_factors(punch, tip, tip, 1.0)
        batch = curves_through(tip, varpi, logarithms, top, softness)
        truncated = float(batch.error_estimate.max())
        if truncated <= SHARE_OF_CURVE * rtol:
            error = SHARE_OF_NODES * rtol + truncated
            return SolvedCurves(batch.logarithms, resolution, terms * len(bodies), last, error)
        terms += 2
    return None


def _one_by_one(bodies: Sequence[Kernel], exponent: float, top: float, rtol: float) -> SolvedCurves | None:
    tip = PowerLaw(exponent, 1.0)
    solved = [solve_curve(ContactProblem.of(tip, 1.0, body), top, rtol) for body in bodies]
    if any(one.curve.jumps for one in solved):
        return None
    curves = [one.curve for one in solved]
    worst = max(solved, key=lambda one: one.error_estimate)
    return SolvedCurves(
        lambda varpi: np.array([[curve.logarithm(which, varpi) for which in Factor] for curve in curves]),
        worst.resolution,
        sum(one.radii for one in solved),
        max(one.eps for one in solved),
        worst.error_estimate,
    )
