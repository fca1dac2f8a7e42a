"""The asymptotic relations as curves of one parameter: depth, force and contact radius of any convex tip.

A form of the fourth-order model is a curve in depth w, force P and contact radius a:

==============  ===========================================  ===================================  ==========
form            parameter s (m)                              equations                            shapes
==============  ===========================================  ===================================  ==========
``explicit``    half-space radius varpi h at the depth w     w = H(s); P (5.9); a (5.7)           power laws
``parametric``  the contact radius a                         (5.2), (5.3); else (4.14), (4.15)    all
``compliance``  half-space radius at the force P             (8.4), (8.5); else England            all
==============  ===========================================  ===================================  ==========

with h the thickness and H the half-space depth function of the shape. A curve of order n keeps the terms up to
eps^n, eps = s/h. `PowerLawSeries` are three polynomials in eps, whichever the form, from the coefficients in
`blunt`; `ShapeSeries` needs H and its two moments; `PunchSeries` is the flat punch.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import optimize

from underlay._arrays import FloatArray
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.inverse import invert_increasing

# Neighbours of the first grid are 11 % apart, closer than two turning points can be; six divisions of a step
# leave 2e-13 of s.
_STEPS = 88
_DIVISIONS = 7


class ContactSeries(ABC):
    """Depth, force and contact radius as functions of one parameter s (m), positive; all arrays are 1-D.

    s is the contact radius (parametric form), the half-space contact radius at the depth (explicit form) or at the
    force (compliance form); for a flat punch it is the depth.
    """

    shape: Indenter

    @property
    @abstractmethod
    def end(self) -> float:
        """Largest s (m) up to which w and P both increase and the shape is defined; inf where there is none.

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """

    @property
    @abstractmethod
    def radius_end(self) -> float:
        """Largest s (m) up to which the contact radius increases; inf where there is none.

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """

    @abstractmethod
    def start(self, depth: FloatArray) -> FloatArray:
        """First guess of s (m) at `depth` (m).

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """

    @abstractmethod
    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth w (m) and dw/ds at s (m).

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """

    @abstractmethod
    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force P (N) and dP/ds at s (m).

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """

    @abstractmethod
    def radius(self, s: FloatArray) -> FloatArray:
        """Contact radius a (m) at s (m).

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """

    @property
    def is_explicit(self) -> bool:
        """Whether `start` is already the solution of w(s) = depth.

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """
        return False

    def load(self, depth: FloatArray, s: FloatArray) -> FloatArray:
        """Force P (N) at s, given also `depth` = w(s) (m), which may make it cheaper than `force`.

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """
        del depth
        return self.force(s)[0]

    def parameter(self, depth: FloatArray, end: float | None = None) -> FloatArray:
        """Parameter s (m) at which w(s) = `depth` (m), positive and at most w(`end`); a given `end` saves time.

        s is the parameter of the curve: a radius, or for a flat punch the depth.
        """
        start = self.start(depth)
        if self.is_explicit:
            return start
        return invert_increasing(self.depth, depth, start, self.end if end is None else end)


@dataclass(frozen=True)
class PunchSeries(ContactSeries):
    """The flat punch, P = 4 theta a kappa_inf w, whose parameter s is the depth w.

    `kappa` is kappa_inf, the punch's stiffness over that on a half-space, and `theta` the layer's elastic constant
    (Pa).
    """

    shape: Indenter
    theta: float
    kappa: float

    @property
    def is_explicit(self) -> bool:
        """True: the parameter is the depth."""
        return True

    @property
    def end(self) -> float:
        """Infinite: the law is linear."""
        return np.inf

    @property
    def radius_end(self) -> float:
        """Infinite: the contact radius of a flat punch never changes."""
        return np.inf

    def start(self, depth: FloatArray) -> FloatArray:
        """The depth itself (m), which is the parameter."""
        return depth

    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth (m), which is the parameter itself, and its derivative, one."""
        return s, np.ones_like(s)

    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (N), P = 4 theta a kappa_inf w, (9.5) integrated, and dP/ds.

        theta is the layer's elastic constant. Equation numbers are those of Argatov and Sabina.
        """
        stiffness = 4.0 * self.theta * self.shape.max_radius * self.kappa
        return stiffness * s, np.full_like(s, stiffness)

    def radius(self, s: FloatArray) -> FloatArray:
        """Contact radius (m), that of the punch."""
        return np.full_like(s, self.shape.max_radius)


@dataclass(frozen=True)
class PowerLawSeries(ContactSeries):
    """w = A F_2 s^lambda W(s/h), P = theta A F_1 s^(lambda+1) Q(s/h), a = s R(s/h): (5.2), (5.3), (5.7) ...

    W, Q and R are polynomials; F_1 and F_2 are those of (5.4) and (5.5).

    Equation numbers are those of Argatov and Sabina.

    s is the parameter of the curve, a radius.

    Parameters
    ----------
    shape : PowerLawShape
        Phi = A r^lambda.
    theta : float
        The layer's elastic constant (Pa).
    thickness : float
        h (m); inf for a half-space.
    depth_terms, force_terms, radius_terms : tuple of float
        Coefficients of 1, eps, eps^2, ... in W, Q and R, eps = s/h.
    """

    shape: PowerLawShape
    theta: float
    thickness: float
    depth_terms: tuple[float, ...]
    force_terms: tuple[float, ...]
    radius_terms: tuple[float, ...]

    @property
    def is_explicit(self) -> bool:
        """Whether W = 1, so that s is the half-space radius at the depth."""
        return len(self.depth_terms) == 1

    @cached_property
    def end(self) -> float:
        """First turning point (m) of w or P: positive roots of lambda W + eps W' and (lambda+1) Q + eps Q'.

        eps is s/h, the parameter s over the thickness.
        """
        lam = self.shape.exponent
        return self.thickness * min(
            _first_turn(lam, self.depth_terms), _first_turn(lam + 1.0, self.force_terms)
        )

    @cached_property
    def radius_end(self) -> float:
        """First turning point (m) of the contact radius s R(s/h).

        s is the parameter of the curve, a radius.
        """
        return self.thickness * _first_turn(1.0, self.radius_terms)

    def start(self, depth: FloatArray) -> FloatArray:
        """The half-space contact radius (m) at `depth` (m), varpi h of (5.8).

        Equation numbers are those of Argatov and Sabina.
        """
        return self.shape.halfspace_radius(depth)

    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth (m) by (5.3), (8.4), or w = H(s), and dw/ds.

        H(r) is the depth at which the contact radius on a half-space is r. Equation numbers are those of
        Argatov and Sabina.

        s is the parameter of the curve, a radius.
        """
        lam, eps = self.shape.exponent, s / self.thickness
        depth = self.shape.abel(s)
        series, slope = _polynomial(self.depth_terms, eps)
        return depth * series, depth / s * (lam * series + eps * slope)

    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force P (N) at the parameter s (m) by (5.2), (5.9), or that of the half-space, and dP/ds.

        Equation numbers are those of Argatov and Sabina.
        """
        lam, eps = self.shape.exponent, s / self.thickness
        force = 4.0 * self.theta * lam / (lam + 1.0) * self.shape.abel(s)
        series, slope = _polynomial(self.force_terms, eps)
        return force * s * series, force * ((lam + 1.0) * series + eps * slope)

    def load(self, depth: FloatArray, s: FloatArray) -> FloatArray:
        """Force (N) by P = 4 theta lambda/(lambda+1) w s Q/W, without a second power of s.

        The shape is A r^lambda. theta is the layer's elastic constant.

        s is the parameter of the curve, a radius.
        """
        lam = self.shape.exponent
        load = blunt.horner(self.force_terms, s / self.thickness)
        if len(self.depth_terms) > 1:
            load /= blunt.horner(self.depth_terms, s / self.thickness)
        load *= s
        load *= depth
        load *= 4.0 * self.theta * lam / (lam + 1.0)
        return load

    def radius(self, s: FloatArray) -> FloatArray:
        """Contact radius (m) by (5.7), (8.5), or s itself.

        Equation numbers are those of Argatov and Sabina.

        s is the parameter of the curve, a radius.
        """
        return s * blunt.horner(self.radius_terms, s / self.thickness)


def power_law_series(
    shape: PowerLawShape,
    theta: float,
    thickness: float,
    moments: tuple[float, float],
    *,
    order: int,
    form: str,
) -> PowerLawSeries:
    """Build the curve of a power-law shape in the given form and order from the kernel's `moments` (a_0, a_1)."""
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
    """1 and the first `order` coefficients of a series, without zeros at the end."""
    terms = [1.0, *(float(term) for term in series[:order])]
    while terms[-1] == 0.0:
        terms.pop()
    return tuple(terms)


def _polynomial(terms: tuple[float, ...], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and derivative of the polynomial with coefficients `terms` of 1, x, x^2, ..."""
    value = np.full_like(x, terms[-1])
    slope = np.zeros_like(x)
    for term in reversed(terms[:-1]):
        slope = slope * x + value
        value = value * x + term
    return value, slope


def _first_turn(power: float, terms: tuple[float, ...]) -> float:
    """Smallest positive eps at which eps^power (t_0 + t_1 eps + ...) stops increasing; inf if none.

    eps is s/h, the parameter s over the thickness.
    """
    rates = [(power + n) * term for n, term in enumerate(terms)]
    if min(rates) >= 0.0:
        return np.inf
    roots = np.roots(rates[::-1])
    real = roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0.0)]
    return float(real.min()) if real.size else np.inf


@dataclass(frozen=True)
class ShapeSeries(ContactSeries):
    """The parametric or compliance curve of any convex shape; b and c are zero where the order drops them.

    Parametric form: (4.14), (4.15); the errata behind them: (4.5) has + P_2 a_1/h^2, and (4.12) follows by
    substituting (4.10).

    Compliance form: dP/dw = 4 theta a kappa_inf holds exactly, 1/kappa_inf is 1 - b eps - c eps^3 + O(eps^5),
    and (4.13) gives a(P); integrating dw = dP (1 - b eps - c eps^3)/(4 theta a) with the half-space radius s as
    parameter, N(s) = s H(s) - int_0^s H, b = 2 a_0/pi and c = 8 a_1/(3 pi):

        P = 4 theta N,
        w = H - (b/h) N - (c/h^3) [s^3 H - (s^2/2) int_0^s H - (3/2) int_0^s H r^2 dr],
        a = s + (c/h^3) s^2 N / H'.

    It is England's expansion (6.10), (6.11) for a sphere and (8.4), (8.5) for a power law. The a_0 term is exact
    in it (a shift of the surface proportional to the force), which is why it stays good on soft substrates.

    eps is a/h, contact radius over thickness. a_0 and a_1 are moments of the kernel (1.8). Equation
    numbers are those of Argatov and Sabina.

    Parameters
    ----------
    shape : Indenter
        Its shape.
    theta, thickness : float
        Elastic constant (Pa) and thickness h (m) of the layer.
    b, c, cross : float
        2 a_0/pi, 8 a_1/(3 pi), and their product where the fourth order keeps it, else 0.
    by_force : bool
        Compliance form if true, parametric if false.
    """

    shape: Indenter
    theta: float
    thickness: float
    b: float
    c: float
    cross: float
    by_force: bool

    @property
    def is_explicit(self) -> bool:
        """Whether no effect of the base is kept, so that s is the half-space radius.

        s is the parameter of the curve, a radius.
        """
        return self.b == 0.0 and self.c == 0.0

    @cached_property
    def end(self) -> float:
        """First zero (m) of dw/ds or dP/ds, by repeated subdivision of the interval that holds it."""
        last = self.shape.max_radius
        if self.is_explicit:
            return last
        # w and P turn, if at all, where a correction of order b eps or c eps^3 reaches one.
        reach = min(last, self.thickness * 8.0 * max(1.0, 1.0 / max(abs(self.b), abs(self.c))))
        grid = reach * np.geomspace(1e-4, 1.0, _STEPS + 1)
        low = 0.0
        for _ in range(_DIVISIONS):
            falling = self._least_rate(grid) <= 0.0
            if not falling.any():
                return last
            first = int(np.argmax(falling))
            low = float(grid[first - 1]) if first else low
            grid = np.linspace(low, float(grid[first]), _STEPS + 1)[1:]
        return low

    @cached_property
    def radius_end(self) -> float:
        """s (m) at which the compliance form's contact radius stops increasing, or passes the shape's end.

        s is the parameter of the curve, a radius.
        """
        last, widest = self.end, self.shape.max_radius
        if not self.by_force or self.c == 0.0:
            return last
        if self.c > 0.0:
            if not np.isfinite(widest) or self.radius(np.array([last]))[0] <= widest:
                return last
            inside = widest * np.finfo(float).eps
            return float(
                optimize.brentq(lambda s: float(self.radius(np.array([s]))[0]) - widest, inside, last)
            )
        grid = min(last, 8.0 * self.thickness) * np.geomspace(1e-4, 1.0, _STEPS)
        radius = self.radius(grid)
        if (np.diff(radius) > 0.0).all():
            return last
        top = int(np.argmax(np.diff(radius) <= 0.0))
        found = optimize.minimize_scalar(
            lambda s: -float(self.radius(np.array([s]))[0]),
            bounds=(grid[max(top - 1, 0)], grid[min(top + 2, _STEPS - 1)]),
            method="bounded",
            options={"xatol": 1e-10 * self.thickness},
        )
        return float(found.x)

    def start(self, depth: FloatArray) -> FloatArray:
        """The half-space contact radius (m) at `depth` (m), at most that at the end of the shape."""
        last = self.shape.abel(np.array(self.shape.max_radius))
        return self.shape.halfspace_radius(np.minimum(depth, last))

    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth w (m) at the parameter s (m) by (4.15), or by the compliance form of the class, and dw/ds.

        Equation numbers are those of Argatov and Sabina.
        """
        h, b, c = self.thickness, self.b, self.c
        H, slope = self.shape.abel(s), self.shape.abel_slope(s)
        first, second = self.shape.abel_moments(s)
        N = s * H - first
        if self.by_force:
            third = s**3 * H - 0.5 * s**2 * first - 1.5 * second
            third_slope = s**3 * slope + s * N
            return (
                H - b / h * N - c / h**3 * third,
                slope - b / h * s * slope - c / h**3 * third_slope,
            )
        third = 0.5 * s**3 * H - 1.5 * second + 1.5 * s**2 * N
        third_slope = 2.0 * s**3 * slope + 3.0 * s * N
        return (
            H - b / h * N - c / h**3 * third + self.cross / h**4 * s**3 * N,
            slope
            - b / h * s * slope
            - c / h**3 * third_slope
            + self.cross / h**4 * (3.0 * s**2 * N + s**4 * slope),
        )

    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force P (N) at the parameter s (m) by (4.14), or that of the half-space (3.2), and dP/ds.

        Equation numbers are those of Argatov and Sabina.
        """
        H, slope = self.shape.abel(s), self.shape.abel_slope(s)
        N = s * H - self.shape.abel_moments(s)[0]
        if self.by_force:
            return 4.0 * self.theta * N, 4.0 * self.theta * s * slope
        factor = 1.0 - self.c * (s / self.thickness) ** 3
        return (
            4.0 * self.theta * factor * N,
            4.0 * self.theta * (factor * s * slope - 3.0 * self.c * s**2 / self.thickness**3 * N),
        )

    def radius(self, s: FloatArray) -> FloatArray:
        """Contact radius (m) at the parameter s (m): s itself, or a = s + (c/h^3) s^2 N/H'.

        The latter in the compliance form, with the symbols of the class's docstring.
        """
        if not self.by_force or self.c == 0.0:
            return s
        N = s * self.shape.abel(s) - self.shape.abel_moments(s)[0]
        return s + self.c / self.thickness**3 * s**2 * N / self.shape.abel_slope(s)

    def _least_rate(self, s: FloatArray) -> FloatArray:
        """The smaller of dw/ds and dP/ds, each over its half-space value; zero at a turning point.

        w is the depth, P the force and s the parameter of the curve (m).
        """
        slope = self.shape.abel_slope(s)
        depth_rate = self.depth(s)[1] / slope
        if self.by_force:
            return depth_rate
        return np.minimum(depth_rate, self.force(s)[1] / (4.0 * self.theta * s * slope))
