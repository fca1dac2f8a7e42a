"""How far the half-space law and the asymptotic model are from the exact contact problem, in a few numbers.

What `method="auto"` decides by: force, contact radius and stiffness of a law at one depth against the
expansion taken two orders further than the paper's. That expansion is the compliance form with the next two
terms of the displacement-force relation (`asymptotic_error`),

    w = A F_2 s^lambda (1 + d_1 eps + d_3 eps^3 + d_5 eps^5 + d_6 eps^6),    eps = s/h,

P the half-space force at s, and the contact radius that dP/dw = 4 theta a kappa_inf(a/h) (9.3) then asks for,
a = s (1 + r_3 eps^3 + r_5 eps^5 + r_6 eps^6), where e_n are the d_n of the flat punch and c = 8 a_1/(3 pi):

    r_3 = c/(lambda+1),   r_5 = e_5 - d_5 (lambda+5)/lambda,
    r_6 = r_3^2 - 2 c r_3 + e_6 - d_6 (lambda+6)/lambda.

Everything is in plain floats at a handful of depths: a decision takes microseconds beside the moments of the
kernel.
"""

from __future__ import annotations

from math import inf, isfinite, log
from typing import NamedTuple, TypeAlias

import numpy as np

from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.asymptotic.error import Moments, fifth_coefficient, sixth_coefficient

__all__ = ["EXTENDED", "HALFSPACE", "Relation", "relation", "series_error"]

#: Names of the two relations beside the forms of the asymptotic model.
HALFSPACE, EXTENDED = "halfspace", "extended"

_Terms: TypeAlias = tuple[float, ...]

# The extended relation has an error too. Half of what its two terms change covers it: over 75 pairs of
# materials, four exponents and a/h = 0.01 to 1.1, wherever the estimate is below 1e-2, it is 0.97 to 8 times
# the largest of the true errors of force, radius and stiffness, and 1 to 2 times it in the median.
_SHARE = 0.5
# An error may pass through zero on its way to the deepest point.
_FRACTIONS = (1.0, 0.7)
# No law is closer than the rounding of its powers.
_ROUNDING = 1e-14
_NEWTON_STEPS = 30


class Relation(NamedTuple):
    """Force, contact radius and stiffness at one depth, each over its half-space value."""

    force: float
    radius: float
    stiffness: float

    def distance(self, other: Relation) -> float:
        """Largest relative difference from `other`."""
        return max(abs(mine / its - 1.0) for mine, its in zip(self, other, strict=True))


def relation(exponent: float, form: str, moments: Moments, varpi: float) -> Relation | None:
    """Evaluate a power-law shape at the depth whose half-space radius is `varpi` h.

    Parameters
    ----------
    exponent : float
        The paper's lambda; inf for a flat punch, for which `varpi` is a/h.
    form : str
        ``"explicit"``, ``"parametric"``, ``"compliance"`` (fourth order), `HALFSPACE` or `EXTENDED`.
    moments : (a_0, a_1, a_2)
        Of the kernel (1.8).
    varpi : float
        Depth measure (5.8).

    Returns
    -------
    Relation or None
        None where the form has no root or no positive value.
    """
    a_0, a_1, _ = moments
    if form == HALFSPACE:
        return Relation(1.0, 1.0, 1.0)
    if not isfinite(exponent):
        return _punch(form, moments, varpi)
    if form == "explicit":
        force, slope = _horner(_terms(blunt.force_coefficients(exponent, a_0, a_1)), varpi)
        radius, _ = _horner(_terms(blunt.radius_coefficients(exponent, a_0, a_1)), varpi)
        return _positive(Relation(force, radius, force + varpi * slope / (exponent + 1.0)))
    depth_terms, force_terms, radius_terms = _curve(exponent, form, moments)
    eps = _root(exponent, depth_terms, varpi)
    if eps is None:
        return None
    depth, depth_slope = _horner(depth_terms, eps)
    force, force_slope = _horner(force_terms, eps)
    radius, _ = _horner(radius_terms, eps)
    growth = eps / varpi
    slope_ratio = (force + eps * force_slope / (exponent + 1.0)) / (depth + eps * depth_slope / exponent)
    return _positive(Relation(growth ** (exponent + 1.0) * force, growth * radius, growth * slope_ratio))


def series_error(
    form: str,
    exponents: tuple[float, ...],
    moments: Moments,
    varpi: float,
    *,
    stop_above: float = inf,
) -> float:
    """Estimate the largest relative error of force, radius and stiffness for depths up to `varpi`.

    Parameters
    ----------
    form : str
        As in `relation`.
    exponents : tuple of float
        Exponents the shape has, locally, on the way; one for a power law.
    moments, varpi
        As in `relation`.
    stop_above : float, optional
        Once the estimate is above this, return it as it is.

    Returns
    -------
    float
        The estimate; infinite where the expansion has ended.
    """
    worst = _ROUNDING
    for exponent in exponents:
        for fraction in _FRACTIONS:
            here = fraction * varpi
            extended = relation(exponent, EXTENDED, moments, here)
            compliance = relation(exponent, "compliance", moments, here)
            own = relation(exponent, form, moments, here)
            if extended is None or compliance is None or own is None:
                return inf
            worst = max(worst, own.distance(extended) + _SHARE * compliance.distance(extended))
            if worst > stop_above:
                return worst
    return worst


def _curve(exponent: float, form: str, moments: Moments) -> tuple[_Terms, _Terms, _Terms]:
    """Coefficients of 1, eps, eps^2, ... in w, P and a of a form that is a curve in eps."""
    a_0, a_1, a_2 = moments
    c = float(blunt.kernel_terms(a_0, a_1)[1])
    if form == "parametric":
        depth = _terms(blunt.parametric_depth_coefficients(exponent, a_0, a_1))
        return depth, (1.0, 0.0, 0.0, -c), (1.0,)
    depth = _terms(blunt.compliance_depth_coefficients(exponent, a_0, a_1))
    r_3 = c / (exponent + 1.0)
    if form == "compliance":
        return depth, (1.0,), (1.0, 0.0, 0.0, r_3)
    d_5, d_6 = float(fifth_coefficient(exponent, a_2)), float(sixth_coefficient(a_1))
    r_5 = float(fifth_coefficient(inf, a_2)) - d_5 * (exponent + 5.0) / exponent
    r_6 = r_3 * r_3 - 2.0 * c * r_3 + d_6 - d_6 * (exponent + 6.0) / exponent
    return (*depth, d_5, d_6), (1.0,), (1.0, 0.0, 0.0, r_3, 0.0, r_5, r_6)


def _punch(form: str, moments: Moments, eps: float) -> Relation | None:
    a_0, a_1, a_2 = moments
    if form == EXTENDED:
        b, c = blunt.kernel_terms(a_0, a_1)
        d_5, d_6 = float(fifth_coefficient(inf, a_2)), float(sixth_coefficient(a_1))
        inverse, _ = _horner((1.0, -float(b), 0.0, -float(c), 0.0, d_5, d_6), eps)
        kappa = 1.0 / inverse if inverse > 0.0 else 0.0
    elif form == "explicit":
        kappa, _ = _horner(_terms(blunt.kappa_infinity_coefficients(a_0, a_1)), eps)
    else:
        kappa = float(blunt.kappa_infinity(np.float64(eps), a_0, a_1, form=form))
    return _positive(Relation(kappa, 1.0, kappa))


def _terms(series: blunt.Series) -> _Terms:
    """1 and the coefficients of a series, as floats."""
    return (1.0, *(float(term) for term in series))


def _positive(values: Relation) -> Relation | None:
    return values if all(0.0 < value < inf for value in values) else None


def _root(exponent: float, terms: _Terms, varpi: float) -> float | None:
    """Solve eps W(eps)^(1/lambda) = varpi by Newton's method on logarithms; None where there is no root."""
    eps = varpi
    for _ in range(_NEWTON_STEPS):
        value, slope = _horner(terms, eps)
        rate = 1.0 + eps * slope / (exponent * value) if value > 0.0 else 0.0
        if not rate > 0.0:
            return None
        step = (log(eps / varpi) + log(value) / exponent) * eps / rate
        if not step < eps:
            return None
        eps -= step
        if abs(step) <= 1e-13 * eps:
            return eps
    return None


def _horner(terms: _Terms, x: float) -> tuple[float, float]:
    """Value and derivative of terms[0] + terms[1] x + ..."""
    value = slope = 0.0
    for term in reversed(terms):
        slope = slope * x + value
        value = value * x + term
    return float(value), float(slope)
