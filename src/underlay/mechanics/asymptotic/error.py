"""How far the asymptotic model is from the exact contact problem: an estimate from the terms left out.

The displacement-force relation has, in powers of eps = s/h with s the half-space radius at the force, the
exact first-order correction of every moment a_m: the complementary energy changes by half the work of the
half-space pressure p against the perturbed compliance (1.5), (1.7),

    w = d/dP [ U_halfspace(P) - (1/(4 pi theta h)) sum_m (a_m/h^(2m)) int int p p |x - y|^(2m) dx dy ],

which gives the paper's a_0 and a_1 terms of (8.4) and, from int int p p |x - y|^4 = 2 P P_4 + 4 P_2^2, the
first term the paper leaves out, d_5 eps^5. The next is -(a_1 terms)^2 eps^6.

The estimate is the distance of a form to the fourth-order compliance form plus these two terms of the latter.
Against brute-force solutions of 13 pairs of materials (rigid to 1000 times softer; equal moduli with other
Poisson's ratios), four shapes, a/h = 0.05 to 1, all forms and orders, it was 0.5 to 120 times the error, 1.1
times in the median and below 5 times in 19 cases of 20 (tests/test_asymptotic.py).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.asymptotic.series import ContactSeries
from underlay.mechanics.plane_constants import Real

__all__ = ["Moments", "fifth_coefficient", "force_error", "omitted_terms", "punch_error", "sixth_coefficient"]

#: (a_0, a_1, a_2) of (1.8).
Moments: TypeAlias = tuple[float, float, float]


def fifth_coefficient(exponent: Real, a_2: Real) -> Real:
    """d_5 of w = A F_2 s^lambda (1 + d_1 eps + d_3 eps^3 + d_5 eps^5 + ...); flat punch: -256 a_2/(45 pi)."""
    # In 1/(lambda + 1), so that the flat punch, lambda = inf, needs no case of its own.
    v = 1.0 / (exponent + 1.0)
    squares = 16.0 / 15.0 / (1.0 + 4.0 * v) + 16.0 / 9.0 / (1.0 + 2.0 * v) ** 2
    return -2.0 * a_2 / np.pi * squares * (1.0 - v) * (1.0 + 2.0 * v)


def sixth_coefficient(a_1: Real) -> Real:
    """d_6 for a flat punch, -64 a_1^2/(45 pi^2); taken for every shape."""
    return -64.0 * a_1**2 / (45.0 * np.pi**2)


def omitted_terms(exponent: Real, a_1: Real, a_2: Real, eps: Real) -> Real:
    """|d_5| eps^5 + |d_6| eps^6: the compliance form's error in depth, relative to the half-space depth."""
    return np.abs(fifth_coefficient(exponent, a_2)) * eps**5 + np.abs(sixth_coefficient(a_1)) * eps**6


def punch_error(kappa: float, eps: float, moments: Moments) -> float:
    """Estimate the relative error of a flat punch's `kappa` at eps = a/h; infinite where nothing is left."""
    a_0, a_1, a_2 = moments
    inverse = 1.0 / blunt.kappa_infinity(eps, a_0, a_1, form="compliance")
    omitted = omitted_terms(np.inf, a_1, a_2, eps)
    if not inverse > omitted:
        return np.inf
    return float(abs(kappa * inverse - 1.0) + omitted / inverse)


def force_error(
    series: ContactSeries,
    compliance: ContactSeries,
    thickness: float,
    moments: Moments,
    depth: float,
) -> float:
    """Estimate the largest relative error of `series` in force for depths up to `depth` (m).

    Parameters
    ----------
    series : ContactSeries
        The curve in question.
    compliance : ContactSeries
        The fourth-order compliance curve of the same shape and materials.
    thickness : float
        h (m).
    moments : (a_0, a_1, a_2)
        Moments of the kernel (1.8).
    depth : float
        Largest depth (m).

    Returns
    -------
    float
        The estimate; infinite where the compliance curve itself has ended.
    """
    s = _sampled(compliance, depth)
    if s is None:
        return np.inf
    (w, depth_slope), (reference, force_slope) = compliance.depth(s), compliance.force(s)
    exponent, halfspace_depth = _exponent_and_depth(compliance, s)
    omitted = halfspace_depth * omitted_terms(exponent, moments[1], moments[2], s / thickness)
    own = omitted * force_slope / (depth_slope * reference)
    distance = np.abs(series.load(w, series.parameter(w)) / reference - 1.0)
    return float(np.max(distance + own))


# The error can pass through zero on its way up; four depths see it on either side.
_FRACTIONS = np.array([0.25, 0.5, 0.75, 1.0])
# The half-space radius at the depth, times this, is where the compliance curve's parameter is looked for: on
# a base 1e8 times softer a cone's is 1e-4 of it, on a rigid one twice it.
_SEARCH = np.geomspace(1e-6, 8.0, 81)


def _sampled(compliance: ContactSeries, depth: float) -> FloatArray | None:
    """Parameters of the compliance curve at fractions of `depth` (m), to 0.5 %; None beyond its end.

    The error is estimated at the depths of these parameters, so that they need not be exact, and no equation
    is solved.
    """
    s = compliance.start(np.array([depth]))[0] * _SEARCH
    s = s[s < compliance.end]
    if np.isfinite(compliance.end):
        s = np.append(s, compliance.end)
    w = compliance.depth(s)[0]
    if w[-1] < depth:
        return None
    # High powers of the smallest radii underflow to zero.
    seen = w > 0.0
    log_s = np.interp(np.log(depth * _FRACTIONS), np.log(w[seen]), np.log(s[seen]))
    return np.asarray(np.exp(log_s))


def _exponent_and_depth(curve: ContactSeries, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Exponent of the power law that fits the shape at s, dlnH/dlns, and H(s) (m)."""
    shape = curve.shape
    H = shape.abel(s)
    return s * shape.abel_slope(s) / H, H
