"""The asymptotic curve of a power-law indenter: three polynomials in eps, whichever the form.

Formulas: (5.2), (5.3), (5.7), (5.9), (8.4), (8.5), from the coefficients in `blunt`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.asymptotic.series import ContactSeries
from underlay.mechanics.indenters import PowerLawShape

__all__ = ["PowerLawSeries", "power_law_series"]


@dataclass(frozen=True)
class PowerLawSeries(ContactSeries):
    """w = A F_2 s^lambda W(s/h), P = theta A F_1 s^(lambda+1) Q(s/h), a = s R(s/h): (5.2), (5.3), (5.7) ...

    Parameters
    ----------
    shape : PowerLawShape
        Phi = A r^lambda.
    theta : float
        The layer's elastic constant (Pa).
    thickness : float
        h (m); inf for a half-space.
    depth_terms, force_terms, radius_terms : tuple of float
        Coefficients of 1, eps, eps^2, ... in W, Q and R.
    """

    shape: PowerLawShape
    theta: float
    thickness: float
    depth_terms: tuple[float, ...]
    force_terms: tuple[float, ...]
    radius_terms: tuple[float, ...]

    @property
    def is_explicit(self) -> bool:
        """W = 1: s is the half-space radius at the depth."""
        return len(self.depth_terms) == 1

    @cached_property
    def end(self) -> float:
        """First turning point of w or P: positive roots of lambda W + eps W' and (lambda+1) Q + eps Q'."""
        lam = self.shape.exponent
        return self.thickness * min(
            _first_turn(lam, self.depth_terms), _first_turn(lam + 1.0, self.force_terms)
        )

    @cached_property
    def radius_end(self) -> float:
        """First turning point of s R(s/h)."""
        return self.thickness * _first_turn(1.0, self.radius_terms)

    def start(self, depth: FloatArray) -> FloatArray:
        """The half-space radius, varpi h of (5.8)."""
        return self.shape.halfspace_radius(depth)

    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(5.3), (8.4), or w = H(s)."""
        lam, eps = self.shape.exponent, s / self.thickness
        depth = self.shape.abel(s)
        series, slope = _polynomial(self.depth_terms, eps)
        return depth * series, depth / s * (lam * series + eps * slope)

    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(5.2), (5.9), or the half-space force."""
        lam, eps = self.shape.exponent, s / self.thickness
        force = 4.0 * self.theta * lam / (lam + 1.0) * self.shape.abel(s)
        series, slope = _polynomial(self.force_terms, eps)
        return force * s * series, force * ((lam + 1.0) * series + eps * slope)

    def load(self, depth: FloatArray, s: FloatArray) -> FloatArray:
        """P = 4 theta lambda/(lambda+1) w s Q/W: no second power of s."""
        lam = self.shape.exponent
        load = _horner(self.force_terms, s / self.thickness)
        if len(self.depth_terms) > 1:
            load /= _horner(self.depth_terms, s / self.thickness)
        load *= s
        load *= depth
        load *= 4.0 * self.theta * lam / (lam + 1.0)
        return load

    def radius(self, s: FloatArray) -> FloatArray:
        """(5.7), (8.5), or s."""
        return s * _horner(self.radius_terms, s / self.thickness)


def power_law_series(
    shape: PowerLawShape,
    theta: float,
    thickness: float,
    moments: tuple[float, float],
    *,
    order: int,
    form: str,
) -> PowerLawSeries:
    """Build the curve of a power-law shape in the given form and order from (a_0, a_1)."""
    lam, none = shape.exponent, (0.0, 0.0, 0.0, 0.0)
    c = float(blunt.kernel_terms(*moments)[1])
    if form == "explicit":
        depth: blunt.Series = none
        force = blunt.force_coefficients(lam, *moments)
        radius = blunt.radius_coefficients(lam, *moments)
    elif form == "parametric":
        depth = blunt.parametric_depth_coefficients(lam, *moments)
        force, radius = (0.0, 0.0, -c, 0.0), none
    else:
        depth = blunt.compliance_depth_coefficients(lam, *moments)
        force, radius = none, (0.0, 0.0, c / (lam + 1.0), 0.0)
    return PowerLawSeries(
        shape, theta, thickness, _terms(depth, order), _terms(force, order), _terms(radius, order)
    )


def _terms(series: blunt.Series, order: int) -> tuple[float, ...]:
    """Return 1 and the coefficients kept, without the zeros at the end."""
    terms = [1.0, *(float(term) for term in series[:order])]
    while terms[-1] == 0.0:
        terms.pop()
    return tuple(terms)


def _horner(terms: tuple[float, ...], x: FloatArray) -> FloatArray:
    """Polynomial with coefficients of 1, x, x^2, ..."""
    value = np.full_like(x, terms[-1])
    for term in reversed(terms[:-1]):
        value *= x
        value += term
    return value


def _polynomial(terms: tuple[float, ...], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and derivative by Horner's rule."""
    value = np.full_like(x, terms[-1])
    slope = np.zeros_like(x)
    for term in reversed(terms[:-1]):
        slope = slope * x + value
        value = value * x + term
    return value, slope


def _first_turn(power: float, terms: tuple[float, ...]) -> float:
    """Smallest positive eps at which eps^power (t_0 + t_1 eps + ...) stops increasing; inf if none."""
    rates = [(power + n) * term for n, term in enumerate(terms)]
    if min(rates) >= 0.0:
        return np.inf
    roots = np.roots(rates[::-1])
    real = roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0.0)]
    return float(real.min()) if real.size else np.inf
