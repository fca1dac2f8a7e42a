"""The paper's exact integral relations (sections 1 to 4), and its hemispherical indenter (section 6).

From a known or approximate contact pressure the relations give the depth (2.13), the force (3.4) and the
polar moment (4.8) for any convex indenter; the asymptotic model follows by
expanding their kernels in sigma = rho/h and alpha = a/h, a the contact radius and h the thickness. Integrals
over the wavenumber u are sums: `weight` holds the quadrature weights times 1 - L(u) at the nodes `u`. Integrals
over the contact are sums too: `load` holds p(rho) rho times the quadrature weights at the nodes `rho`, p the
pressure.

The formulas of section 6, from `halfspace_load` on, are in alpha = a/R and mu = R/h, R the sphere's radius. Its
three integrals enter through `Sphere`, whose forms keep their digits for small alpha; with Lambda(alpha) = (1 +
alpha^2) ln((1 + alpha)/(1 - alpha)) - 2 alpha,

    Lambda = 4 (alpha H - int_0^alpha H) / R^2      on a half-space P = theta R^2 Lambda (6.9).

A law for a `Sphere` comes from `asymptotic_law`: its parametric form is (6.3), (6.4), its compliance form
England's expansion (6.10), (6.11). Source of the latter: England (1962), as cited by the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial
from typing import NamedTuple

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.mechanics.asymptotic.blunt import kernel_terms
from underlay.mechanics.body import Base, Layer, Real
from underlay.mechanics.indenters import Indenter, Sphere
from underlay.mechanics.inverse import invert_increasing
from underlay.mechanics.kernel import SubstrateKernel

_UNIT = Sphere(1.0)


class PressedLayer(NamedTuple):
    """A layer in the form the integrals need: theta (Pa), thickness h (m), nodes u, and weights times 1 - L(u).

    theta is the layer's elastic constant. 1 - L(u) is the relative change of surface compliance by what
    is under the top layer, u the wavenumber times its thickness.
    """

    theta: float
    thickness: float
    u: FloatArray
    weight: FloatArray

    @classmethod
    def of(cls, layer: Layer, substrate: Base, largest_radius: float, rtol: float = 1e-13) -> PressedLayer:
        """Layer with the quadrature for contact radii up to `largest_radius` (m) at error `rtol`."""
        kernel = SubstrateKernel(layer.material, substrate)
        u, weight = kernel.rule(largest_radius / layer.thickness, rtol)
        return cls(layer.material.theta, layer.thickness, u, weight * kernel.values(u))


def S_0(sigma: FloatArray, tau: float, u: FloatArray, weight: FloatArray) -> FloatArray:
    """S_0(sigma, tau) of (2.12): int_0^inf [1 - L] J_0(sigma u) cos(tau u) du, shape of `sigma` (n,).

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness. Equation numbers are those of Argatov and Sabina.
    """
    return np.asarray(special.j0(np.outer(sigma, u)) @ (weight * np.cos(tau * u)))


def S_2(sigma: FloatArray, alpha: float, u: FloatArray, weight: FloatArray) -> FloatArray:
    """S_2(sigma, alpha) of (3.3): int_0^inf [1 - L] J_0(sigma u) sin(alpha u)/u du, shape of `sigma` (n,).

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness. Equation numbers are those of Argatov and Sabina.
    """
    return np.asarray(special.j0(np.outer(sigma, u)) @ (weight * alpha * _sinc(alpha * u)))


def S_2_tilde(sigma: FloatArray, alpha: float, u: FloatArray, weight: FloatArray) -> FloatArray:
    """S~_2(sigma, alpha) of (3.5): S_2 with sin(alpha u)/u - alpha cos(alpha u) in place of sin(alpha u)/u.

    Equation numbers are those of Argatov and Sabina.
    """
    return np.asarray(
        special.j0(np.outer(sigma, u)) @ (weight * alpha * (_sinc(alpha * u) - np.cos(alpha * u)))
    )


def S_4(sigma: FloatArray, alpha: float, u: FloatArray, weight: FloatArray) -> FloatArray:
    """S_4(sigma, alpha) of (4.9): int_0^inf [1 - L] J_0(sigma u) b(alpha u) du, shape of `sigma` (n,).

    b(z), the brace of (4.9), is int_0^1 x^2 cos(z x) dx = j_0(z) - 2 j_1(z)/z.

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness. Equation numbers are those of Argatov and Sabina.
    """
    z = alpha * u
    brace = _sinc(z) - 2.0 * special.spherical_jn(1, z) / z
    return np.asarray(special.j0(np.outer(sigma, u)) @ (weight * brace))


def S_0_coefficient(i: int, j: int, a_m: float) -> float:
    """b_ij^(0) of (4.1) from the moment a_m, m = i + j: the coefficient of sigma^(2i) alpha^(2j) in S_0.

    Equation numbers are those of Argatov and Sabina.
    """
    scale = float(2 ** (2 * j) * factorial(i + j) ** 2)
    return scale / (factorial(i) ** 2 * factorial(2 * j)) * a_m


def S_2_tilde_coefficient(i: int, j: int, a_m: float) -> float:
    """b~_ij^(2) of (4.2) from the moment a_m, m = i + j: that of sigma^(2i) alpha^(2j+1) in S~_2.

    Equation numbers are those of Argatov and Sabina.
    """
    scale = float(2 ** (2 * j + 1) * j * factorial(i + j) ** 2)
    return -scale / (factorial(i) ** 2 * factorial(2 * j + 1)) * a_m


def contact_pressure(
    slope_over_s: Callable[[FloatArray], FloatArray], contact_radius: float, r: FloatArray, nodes: int = 64
) -> FloatArray:
    """Contact pressure p(r) (Pa) of (2.8) from the auxiliary function V of (2.11).

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    slope_over_s : callable
        V'(s)/s as a function of s (m), an array of any shape; V is even, so that this is smooth at zero.
    contact_radius : float
        a (m).
    r : ndarray, shape (n,)
        Radii (m) in [0, a].
    nodes : int, default 64
        Gauss-Legendre nodes in t, s^2 = r^2 + t^2, which removes the root from the integral.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    reach = np.sqrt((contact_radius - r) * (contact_radius + r))[:, None]
    t = 0.5 * reach * (x + 1.0)
    return np.asarray(
        -(slope_over_s(np.sqrt(r[:, None] ** 2 + t**2)) * (0.5 * reach * w)).sum(axis=1) / np.pi
    )


def depth_from_pressure(
    indenter: Indenter, contact_radius: float, pressed: PressedLayer, rho: FloatArray, load: FloatArray
) -> float:
    """Depth w (m) at which the pressure vanishes at the edge of the contact, (2.13).

    `rho` (m) and `load` are nodes and weighted pressures, as in the module's head.

    Equation numbers are those of Argatov and Sabina.
    """
    theta, h, u, weight = pressed
    kernel = S_0(rho / h, contact_radius / h, u, weight)
    return float(indenter.abel(np.array(contact_radius)) - kernel @ load / (theta * h))


def force_from_pressure(
    indenter: Indenter, contact_radius: float, pressed: PressedLayer, rho: FloatArray, load: FloatArray
) -> float:
    """Contact force P (N) from the pressure, without the depth: (3.4).

    `rho` (m) and `load` are nodes and weighted pressures, as in the module's head.

    Equation numbers are those of Argatov and Sabina.
    """
    theta, h, u, weight = pressed
    a = np.array(contact_radius)
    halfspace = a * indenter.abel(a) - indenter.abel_moments(a)[0]
    kernel = S_2_tilde(rho / h, contact_radius / h, u, weight)
    return float(4.0 * theta * halfspace + 4.0 * (kernel @ load))


def polar_moment(V: FloatArray, s: FloatArray, weights: FloatArray) -> float:
    """Polar moment P_2 = 4 int_0^a V(s) s^2 ds (N m^2) of (4.8), from V at nodes `s` (m) with `weights`.

    Equation numbers are those of Argatov and Sabina.
    """
    return float(4.0 * (weights @ (V * s**2)))


def polar_moment_from_pressure(
    indenter: Indenter,
    contact_radius: float,
    depth: float,
    pressed: PressedLayer,
    rho: FloatArray,
    load: FloatArray,
) -> float:
    """Polar moment P_2 (N m^2) from depth and pressure: the unnumbered form after (4.8), with S_4 of (4.9).

    `rho` (m) and `load` are nodes and weighted pressures, as in the module's head.

    Equation numbers are those of Argatov and Sabina.
    """
    theta, h, u, weight = pressed
    a = contact_radius
    shape = a**3 / 3.0 * depth - float(indenter.abel_moments(np.array(a))[1])
    return float(8.0 * theta * shape + 8.0 * a**3 / h * (S_4(rho / h, a / h, u, weight) @ load))


def _sinc(z: FloatArray) -> FloatArray:
    """sin(z)/z, 1 at zero."""
    return np.asarray(np.sinc(z / np.pi))


def halfspace_load(alpha: FloatArray) -> FloatArray:
    """P/(theta R^2) on a half-space at alpha = a/R: Lambda of (6.9).

    theta is the layer's elastic constant. Equation numbers are those of Argatov and Sabina.
    """
    return np.asarray(4.0 * (alpha * _UNIT.abel(alpha) - _UNIT.abel_moments(alpha)[0]))


def halfspace_alpha(load: FloatArray) -> FloatArray:
    """alpha_0 = a/R on a half-space: the root of (6.9) for P/(theta R^2) = `load`, positive, (n,).

    theta is the layer's elastic constant. Equation numbers are those of Argatov and Sabina.
    """
    # Lambda = (8/3) alpha^3 for small alpha and less than that cubed root's value for any.
    start = np.minimum(np.cbrt(0.375 * load), 0.9)
    return invert_increasing(_load_and_slope, load, start, _UNIT.max_radius)


def parametric_load(alpha: FloatArray, mu: Real, a_1: Real) -> FloatArray:
    """P/(theta R^2) of (6.3) at alpha = a/R, with mu = R/h and the kernel's moment a_1.

    theta is the layer's elastic constant. Equation numbers are those of Argatov and Sabina.
    """
    c = kernel_terms(0.0, a_1)[1]
    return halfspace_load(alpha) * (1.0 - c * (mu * alpha) ** 3)


def parametric_depth(alpha: FloatArray, mu: Real, a_0: Real, a_1: Real) -> FloatArray:
    """w/R of (6.4), depth over radius, at alpha = a/R, with mu = R/h and the moments a_0, a_1.

    Equation numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    H, load = _UNIT.abel(alpha), halfspace_load(alpha)
    third = 0.5 * alpha**3 * H - 1.5 * _UNIT.abel_moments(alpha)[1] + 0.375 * alpha**2 * load
    return np.asarray(H - mu * b / 4.0 * load - mu**3 * c * third + mu**4 * b * c / 4.0 * alpha**3 * load)


def england_radius(alpha_0: FloatArray, mu: Real, a_1: Real) -> FloatArray:
    """a/R of (6.10) from alpha_0, the half-space contact radius at the force over R; mu = R/h.

    With alpha_3 of (6.8); alpha_1 = alpha_2 = alpha_4 = 0 (6.7).

    Equation numbers are those of Argatov and Sabina.
    """
    c = kernel_terms(0.0, a_1)[1]
    slope = _UNIT.abel_slope(alpha_0)
    return np.asarray(alpha_0 + mu**3 * c / 4.0 * alpha_0**2 * halfspace_load(alpha_0) / slope)


def england_depth(alpha_0: FloatArray, mu: Real, a_0: Real, a_1: Real) -> FloatArray:
    """w/R of (6.11) from alpha_0, the half-space contact radius at the force over R; mu = R/h.

    Equation numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    first, second = _UNIT.abel_moments(alpha_0)
    H = _UNIT.abel(alpha_0)
    third = alpha_0**3 * H - 0.5 * alpha_0**2 * first - 1.5 * second
    return np.asarray(H - mu * b / 4.0 * halfspace_load(alpha_0) - mu**3 * c * third)


def _load_and_slope(alpha: FloatArray) -> tuple[FloatArray, FloatArray]:
    return halfspace_load(alpha), np.asarray(4.0 * alpha * _UNIT.abel_slope(alpha))
