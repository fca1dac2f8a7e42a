"""Depth, force and flat-punch factors of the elastic contact against its radius, as adhesion needs them.

For a contact of radius a (the notation of `punch_solution`, eps = a/h),

    w_el(a), P_el(a)      depth and force of the contact without adhesion, f(1) = 0,
    kappa(eps)            int_0^1 g dx, the flat punch's stiffness over that on a half-space,
    g(1; eps)             the flat punch's solution at the edge, which sets the stress intensity there.

They are related exactly, for every kernel:

    d(eps kappa)/d eps = g(1)^2,     dP_el/da = 4 theta a kappa dw_el/da.

On a half-space g = kappa = 1. On a layer the logarithms of the four, over those of the half-space, are smooth
in eps and become Chebyshev series. So does [g(1) dw_el/da - H'(a)] a/H(a), an integral over the contact: a measured
tip has corners in its curvature, and the derivative of a series of w_el/H is right to 1e-3 where w_el is to 1e-6.
No other module of `adhesion` imports the exact solver of rounded tips.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, contact_factors, weights_over_depth
from underlay.mechanics.exact.master_curve import (
    Factor,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    chebyshev_values,
    truncation_error,
)
from underlay.mechanics.exact.nodes import TABLES, even_rule, series_terms
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution
from underlay.mechanics.indenters import Indenter, PowerLawShape

# Of the tolerance asked: nodes and truncation both stay below, and derivatives lose a digit.
_SHARE = 0.03
_FINEST = 1e-12
_MOST_TERMS = 400


class AtRadius(NamedTuple):
    """The elastic contact at given contact radii, each entry (n,)."""

    depth: FloatArray
    """w_el (m)."""
    depth_slope: FloatArray
    """dw_el/da (dimensionless)."""
    force: FloatArray
    """P_el (N)."""
    kappa: FloatArray
    """The flat punch's factor kappa."""
    edge: FloatArray
    """g(1)."""
    edge_rate: FloatArray
    """d ln g(1)/da (1/m)."""


@dataclass(frozen=True)
class RadiusRelation:
    """Elastic contact by its radius a: the half-space's relation, times factors where there is a layer.

    On a half-space w = H(a), P = 4 theta (a H - int_0^a H ds) (2.13), (3.2); H(r) is the depth at which the contact
    radius on a half-space is r. Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    indenter : Indenter
        Its shape.
    theta : float
        Elastic constant of the surface (Pa).
    thickness : float, default inf
        Of the layer (m).
    series : RadiusFactors, optional
        The factors on a layer; None on a half-space.
    """

    indenter: Indenter
    theta: float
    thickness: float = np.inf
    series: RadiusFactors | None = None

    @property
    def error_estimate(self) -> float:
        """Relative error of depth, force and punch factors: zero on a half-space."""
        return 0.0 if self.series is None else self.series.error_estimate

    @property
    def nodes(self) -> int | None:
        """Number of radial nodes of the solution; None on a half-space."""
        return None if self.series is None else self.series.nodes

    def at(self, radius: FloatArray) -> AtRadius:
        """Depth, force and punch factors at radii (m), (n,), positive and within those solved for."""
        depth, one = self.indenter.abel(radius), np.ones_like(radius)
        force = 4.0 * self.theta * self.indenter.halfspace_force(depth, radius)
        slope = self.indenter.abel_slope(radius)
        if self.series is None:
            return AtRadius(depth, slope, force, one, one, np.zeros_like(radius))
        eps, stretch, coefficients = radius / self.thickness, self.series.stretch, self.series.coefficients
        both = chebyshev_values(stretch.z(eps), len(coefficients)) @ coefficients
        factors, bend = np.exp(both[:, :4]), both[:, 4]
        edge, edge_rate = factors[:, 3], both[:, 5] * stretch.dz(eps) / self.thickness
        slope = (slope + bend * depth / radius) / edge
        return AtRadius(depth * factors[:, 0], slope, force * factors[:, 1], factors[:, 2], edge, edge_rate)


def largest_radius(contact: Contact) -> float:
    """Largest contact radius (m) that can be solved for: the end of the shape, or 20 thicknesses."""
    return min(contact.indenter.max_radius, LARGEST_EPS * contact.thickness if contact.layered else np.inf)


def solve_relation(contact: Contact, radius: float, rtol: float) -> RadiusRelation:
    """Solve the elastic contact for radii up to `radius` (m), at most `largest_radius`, at error `rtol`.

    The result gives depth, force and the flat punch's factors by contact radius; solutions are cached.
    """
    if not contact.layered:
        return RadiusRelation(contact.indenter, contact.theta)
    last, fine = radius / contact.thickness, max(_SHARE * rtol, _FINEST)
    own = (
        contact.indenter.exponent
        if isinstance(contact.indenter, PowerLawShape)
        else (contact.indenter, contact.thickness)
    )
    try:
        hash(contact.kernel)
    except TypeError:  # a material of one's own
        series = RadiusFactors.solve(contact, last, fine)
    else:
        series = TABLES.get(
            ("radius relation", contact.kernel, own, last, fine),
            lambda: RadiusFactors.solve(contact, last, fine),
        )
    return RadiusRelation(contact.indenter, contact.theta, contact.thickness, series)


@dataclass(frozen=True)
class RadiusFactors:
    """Chebyshev series in eps = a/h of a layer's relation over the half-space's, for tips of any size.

    kappa is the flat punch's stiffness over that on a half-space. H(r) is the depth at which the
    contact radius on a half-space is r.

    Parameters
    ----------
    stretch : Stretch
        The variable ln(1 + rate eps).
    coefficients : ndarray (terms, 6)
        Chebyshev coefficients of ln(w_el/H), ln(P_el/P_half), ln kappa, ln g(1), [g(1) dw_el/da - H'] a/H, and of
        the derivative of ln g(1).
    error_estimate : float
        Of the logarithms.
    nodes : int
        Number of radial nodes of the solution.
    """

    stretch: Stretch
    coefficients: FloatArray
    error_estimate: float
    nodes: int

    @classmethod
    def solve(cls, contact: Contact, last: float, fine: float) -> Self:
        """Solve for eps = a/h up to `last`, at relative error `fine`."""
        body, measure = contact.kernel, contact.indenter.power_law
        halfspace = RadiusRelation(contact.indenter, contact.theta)
        resolution = proved_resolution(body, last, fine)
        stretch, terms = Stretch.to(last, body.scales.softness), series_terms(body.scales, last, fine)
        while True:
            angles = chebyshev_angles(terms)
            eps = stretch.v(np.cos(angles))
            shape = weights_over_depth(
                contact.indenter, measure, even_rule(resolution.radial), eps * contact.thickness
            )
            punch = PunchSolution.solve(body, eps, resolution, shape)
            varpi, logarithms = contact_factors(punch, contact.indenter, measure, contact.thickness)
            half = halfspace.at(eps * contact.thickness)
            measured = varpi * contact.thickness
            depth = measure.abel(measured)
            scale = 4.0 * contact.theta * measure.exponent / (measure.exponent + 1.0)
            force = np.log(scale * measured * depth / half.force) + logarithms[:, Factor.FORCE]
            edge = np.log1p(punch.rho @ punch.rule.weights)
            columns = (np.log(depth / half.depth), force, logarithms[:, Factor.STIFFNESS], edge, punch.bend)
            coefficients = chebyshev_coefficients(np.column_stack(columns), angles)
            error = float(truncation_error(coefficients))
            if error <= fine or 2 * terms > _MOST_TERMS:
                slopes = np.append(np.polynomial.chebyshev.chebder(coefficients[:, 3]), 0.0)
                both = read_only(np.column_stack((coefficients, slopes)))
                return cls(stretch, both, error + fine, resolution.radial)
            terms += terms // 2


def kernel_rule(contact: Contact, radius: float, rtol: float) -> tuple[FloatArray, FloatArray]:
    """Wavenumbers k (1/m) and weights c with (2/(pi h)) K(x/h, y/h) = sum c cos(kx) cos(ky).

    K is the kernel of the contact problem (`punch_solution`); for x and y up to `radius` (m), at error `rtol`.
    Empty on a half-space.
    """
    if not contact.layered:
        return np.empty(0), np.empty(0)
    resolution = proved_resolution(contact.kernel, radius / contact.thickness, rtol)
    u, weights = resolution.wavenumber_rule()
    strength = (2.0 / (np.pi * contact.thickness)) * weights * contact.kernel.values(u)
    return u / contact.thickness, strength
