"""The surface of a stack in every direction: one symmetric 2 x 2 compliance, carried up from the base.

`recursion` carries minors in its place, for 1 - L alone: a law with friction needs the shear as well.

With xi the wavenumber, v = xi t in a layer of thickness t, and below every interface (displacement) = -C
(stress over xi), C = [[C11, C12], [C12, C22]] (radial, axial), p, q, g, S, c, sigma and the C_i of a half-space
of each material as in `one_layer`, J = diag(-1, 1):

- at an interface with springs, C <- C + xi diag(1/k_shear, 1/k_normal); slip is C11 -> inf, taken as the limit;
- through a thin layer (v sigma < 1), transfer: T = exp(v N) in blocks T_uu, T_ut, T_tu, T_tt,
  C <- (T_uu + C T_tu)^-1 (T_ut + C T_tt);
- through any other, reflection: M = (C_i + J C J)^-1, D = diag(-C_i11, C_i22), E the passage of `one_layer`,
  Y = I - J E J E + 2 J E (M D) E,  C <- 2 diag(C_i) Y^-1 - J C_i J.

On top, transfer gives 1 - L = 1 - C22/C_1,22; reflection R = M J (C_1 - C), G = E R E,
1 - L = 2 (G22 - det G)/(1 - G11 + G22 - det G), which keeps its digits where it decays.

The powers of N close on themselves, N^4 = (sigma^2 - 2p) N^2 - p^2, so T = a_0 + a_1 N + a_2 N^2 + a_3 N^3 with
four series in v. Recursions of this kind: Thomson 1950 and Haskell 1953 (transfer), Kennett 1983 (reflection).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.kernel.kernel import Compliance
from underlay.mechanics.kernel.one_layer import passage
from underlay.mechanics.plane_constants import PlaneConstants

__all__ = ["Sheet", "scaled", "stack_compliance"]

# v sigma below which a layer is passed by transfer. Reflection alone loses every digit in a soft layer between
# stiff ones (a glue 1e-8 as stiff, 0.01 as thick: 5 % of 1 - L), transfer alone in thick layers, where it grows
# as exp(v). At the switch both hold 1e-13 or better for the stacks of tests/test_stack_kernel.py.
_THIN = 1.0
# Terms of the even and odd series in v: the first left out is below (v sigma)^20/20! = 4e-19.
_TERMS = 10
_EVEN = np.array([1.0 / factorial(2 * k) for k in range(_TERMS)])
_ODD = np.array([1.0 / factorial(2 * k + 1) for k in range(_TERMS)])
# Stands for u = 0, where a layer that slips divides zero by zero: 1 - L is continuous there, and this is below
# the rounding of any term it is added to.
_NEAREST = 1e-100


@dataclass(frozen=True)
class Sheet:
    """One layer, made dimensionless by the thickness t_1 and the constant g_1 of the layer on top.

    Parameters
    ----------
    constants : PlaneConstants
        Floats: c and S times g_1, g over g_1.
    thickness : float
        Over t_1.
    opening, sliding : float
        Compliances of its lower face, g_1/(t_1 k_normal) and g_1/(t_1 k_shear): zero bonded, infinite free.
    """

    constants: PlaneConstants
    thickness: float
    opening: float
    sliding: float

    @cached_property
    def roots(self) -> tuple[float, float]:
        """Product p and sum sigma of the decay roots."""
        return float(self.constants.p), float(self.constants.sigma)

    @cached_property
    def halfspace(self) -> tuple[float, float, float]:
        """C_i11, C_i12 and C_i22."""
        return _halfspace(self.constants)

    @cached_property
    def series(self) -> FloatArray:
        """T in powers of v^2, (16, terms); the odd entries are without their factor v.

        Rows: radial displacement, normal stress, axial displacement, shear stress, as they stand above the
        layer; columns, in each row: what stands below of radial displacement, normal stress, axial
        displacement, shear stress. So the odd entries are two blocks.
        """
        q, c, g, S = (float(entry) for entry in self.constants)
        p, sigma = self.roots
        trace, alpha, beta = sigma * sigma - 2.0 * p, [1.0], [0.0]
        for _ in range(_TERMS - 1):
            alpha, beta = [*alpha, -p * p * beta[-1]], [*beta, alpha[-1] + trace * beta[-1]]
        shear, cross, mixed = S * g - q, c + S * q, g * c + S * g * q - q * q
        # Coefficients of (1, N^2) in the even entries and of (N, N^3) in the odd ones.
        even = [
            (1.0, shear),
            (0.0, cross),
            (0.0, -g),
            (1.0, -q),
            (1.0, -q),
            (0.0, -cross),
            (0.0, g),
            (1.0, shear),
        ]
        odd = [
            (1.0, shear), (S, S * shear - cross), (0.0, -g), (-1.0, -shear),
            (-q, -mixed), (c, -q * (cross + c)), (g, g * (shear - q)), (q, mixed),
        ]  # fmt: skip
        evens = np.array(even) @ np.array([_EVEN * alpha, _EVEN * beta])
        odds = np.array(odd) @ np.array([_ODD * alpha, _ODD * beta])
        table = np.empty((4, 4, _TERMS))
        table[:2, :2], table[:2, 2:] = evens[:4].reshape(2, 2, -1), odds[:4].reshape(2, 2, -1)
        table[2:, :2], table[2:, 2:] = odds[4:].reshape(2, 2, -1), evens[4:].reshape(2, 2, -1)
        return read_only(table.reshape(16, _TERMS))


class _Compliance(NamedTuple):
    """C of what is below; `c11` is infinite (a float) where the face above slips."""

    c11: FloatArray | float
    c12: FloatArray | float
    c22: FloatArray | float

    def at(self, nodes: NDArray[np.bool_]) -> _Compliance:
        """Those of some of the nodes."""
        return _Compliance(*(c[nodes] if isinstance(c, np.ndarray) else c for c in self))


def stack_compliance(u: FloatArray, sheets: tuple[Sheet, ...], base: PlaneConstants | None) -> Compliance:
    """Change of the surface's compliance in every direction at `u` (nodes,).

    Sheets go from the top down, on a base (None: rigid). The axial entry keeps its digits where it decays; the
    others are differences with the half-space's, right to the rounding of that.
    """
    u = np.where(u == 0.0, _NEAREST, u)
    top = sheets[0]
    below = _under_the_top(u, sheets, base)
    (p, sigma), surface = top.roots, _above(u, top, below)
    theta = top.constants.g / (p * sigma)
    axial = np.asarray(1.0 - surface.c22 / top.halfspace[2])
    thick = u * sigma >= _THIN
    axial[thick] = _echo(u[thick], top, below.at(thick))
    radial = 1.0 - (theta * p) * surface.c11
    mixed = (theta * p**0.5) * (surface.c12 - top.halfspace[1])
    return Compliance(np.asarray(radial), np.asarray(mixed), axial)


def scaled(of: PlaneConstants, g: float) -> PlaneConstants:
    """Plane constants in units of `g`."""
    return PlaneConstants(float(of.q), float(of.c * g), float(of.g / g), float(of.S * g))


def _under_the_top(u: FloatArray, sheets: tuple[Sheet, ...], base: PlaneConstants | None) -> _Compliance:
    """C under the sheet on top, its interface included."""
    below = _Compliance(0.0, 0.0, 0.0) if base is None else _Compliance(*_halfspace(base))
    for sheet in reversed(sheets[1:]):
        below = _above(u, sheet, _opened(u, sheet, below))
    return _opened(u, sheets[0], below)


def _halfspace(of: PlaneConstants) -> tuple[float, float, float]:
    p, sigma, g = float(of.p), float(of.sigma), float(of.g)
    return sigma / g, -float(of.p_minus_q) / g, p * sigma / g


def _opened(u: FloatArray, sheet: Sheet, below: _Compliance) -> _Compliance:
    """C with what the interface under a sheet gives way."""
    c11, c12, c22 = below
    if sheet.opening:
        c22 = c22 + u * sheet.opening
    if sheet.sliding == inf:
        return _Compliance(inf, 0.0, c22)
    return _Compliance(c11 + u * sheet.sliding if sheet.sliding else c11, c12, c22)


def _above(u: FloatArray, sheet: Sheet, below: _Compliance) -> _Compliance:
    """C on top of a sheet."""
    v = u * sheet.thickness
    thin = v * sheet.roots[1] < _THIN
    if thin.all():
        return _transferred(v, sheet, below)
    if not thin.any():
        return _reflected(v, sheet, below)
    both = np.empty((3, u.size))
    both[:, thin] = _transferred(v[thin], sheet, below.at(thin))
    both[:, ~thin] = _reflected(v[~thin], sheet, below.at(~thin))
    return _Compliance(*both)


def _seen(u: FloatArray, top: Sheet, below: _Compliance) -> FloatArray:
    """1 - L, seen from the surface of the sheet on top."""
    thin = u * top.roots[1] < _THIN
    values = np.empty(u.size)
    if thin.any():
        surface = _transferred(u[thin], top, below.at(thin)).c22
        values[thin] = 1.0 - surface / top.halfspace[2]
    if not thin.all():
        values[~thin] = _echo(u[~thin], top, below.at(~thin))
    return values


def _transferred(v: FloatArray, sheet: Sheet, below: _Compliance) -> _Compliance:
    powers = np.empty((_TERMS, v.size))
    powers[0], powers[1:] = 1.0, v * v
    np.multiply.accumulate(powers, axis=0, out=powers)
    T = (sheet.series @ powers).reshape(4, 4, v.size)
    T[:2, 2:] *= v
    T[2:, :2] *= v
    radial, pressed, axial, sheared = T
    c11, c12, c22 = below
    if _slips(below):
        # No shear stress below: the first row of T_uu + C T_tu, over C11.
        first = sheared
    else:
        first = radial + c11 * sheared + c12 * pressed
        axial = axial + c12 * sheared
    A, F, B, E = first
    Z, H, D, G = axial + c22 * pressed
    scale = 1.0 / (A * D - B * Z)
    new12 = 0.5 * ((D * F - B * H) + (A * G - E * Z)) * scale
    return _Compliance((D * E - B * G) * scale, new12, (A * H - F * Z) * scale)


class _Interface(NamedTuple):
    """M = (C_i + J C J)^-1, and m12, C_i11 - C_11, C_i22 - C_22 and the determinant it was inverted by."""

    n11: FloatArray | float
    n12: FloatArray | float
    n22: FloatArray | float
    m12: FloatArray | float
    d11: FloatArray | float
    d22: FloatArray | float
    whole: FloatArray | float


def _interface(sheet: Sheet, below: _Compliance) -> _Interface:
    """Of a face that does not slip freely."""
    (c11, c12, c22), (b11, b12, b22) = sheet.halfspace, below
    m11, m12, m22 = c11 + b11, c12 - b12, c22 + b22
    # det(C_i + J C J): of these terms only the two determinants can lose digits, and then they are the smallest.
    whole = (c11 * c22 - c12 * c12) + (b11 * b22 - b12 * b12) + c11 * b22 + c22 * b11 + 2.0 * c12 * b12
    scale = 1.0 / whole
    return _Interface(m22 * scale, -m12 * scale, m11 * scale, m12, c11 - b11, c22 - b22, whole)


def _passage(v: FloatArray, sheet: Sheet) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """E(v), row by row."""
    p, sigma = sheet.roots
    ch, sh = passage(v, p, sigma * sigma, sigma)
    step = (0.5 * sigma) * sh
    return ch - step, p * sh, -sh, ch + step


def _reflected(v: FloatArray, sheet: Sheet, below: _Compliance) -> _Compliance:
    """C above by Y = I - J E J E + 2 J E Q E, Q = M D."""
    c11, c12, c22 = sheet.halfspace
    n11: FloatArray | float
    n12: FloatArray | float
    n22: FloatArray | float
    e11, e12, e21, e22 = _passage(v, sheet)
    if _slips(below):
        n11, n12, n22 = 0.0, 0.0, 1.0 / (c22 + below.c22)
    else:
        n11, n12, n22 = _interface(sheet, below)[:3]
    q11, q12, q21, q22 = n11 * (-2.0 * c11), n12 * (2.0 * c22), n12 * (-2.0 * c11), n22 * (2.0 * c22)
    x11, x12 = q11 * e11 + q12 * e21, q11 * e12 + q12 * e22
    x21, x22 = q21 * e11 + q22 * e21, q21 * e12 + q22 * e22
    # I - J E J E + 2 J E Q E, the two products with E taken together.
    y11 = 1.0 - e11 * (e11 + x11) + e12 * (e21 - x21)
    y12 = e12 * (e22 - x22) - e11 * (e12 + x12)
    y21 = e21 * (e11 + x11) - e22 * (e21 - x21)
    y22 = 1.0 + e21 * (e12 + x12) - e22 * (e22 - x22)
    scale = 2.0 / (y11 * y22 - y12 * y21)
    new12 = c12 - (c11 * y12 + c22 * y21) * (0.5 * scale)
    return _Compliance(c11 * y22 * scale - c11, new12, c22 * y11 * scale - c22)


def _echo(v: FloatArray, sheet: Sheet, below: _Compliance) -> FloatArray:
    """1 - L by R = M J (C_i - C) and G = E R E."""
    e11, e12, e21, e22 = _passage(v, sheet)
    if _slips(below):
        c22 = sheet.halfspace[2]
        r22 = det_r = (c22 - below.c22) / (c22 + below.c22)
        g11, g22 = e11 * e11 + r22 * e12 * e21, e21 * e12 + r22 * e22 * e22
    else:
        n11, n12, n22, m12, d11, d22, whole = _interface(sheet, below)
        r11, r12 = n12 * m12 - n11 * d11, n12 * d22 - n11 * m12
        r21, r22 = n22 * m12 - n12 * d11, n22 * d22 - n12 * m12
        det_r = (m12 * m12 - d11 * d22) / whole
        g11 = e11 * (r11 * e11 + r12 * e21) + e12 * (r21 * e11 + r22 * e21)
        g22 = e21 * (r11 * e12 + r12 * e22) + e22 * (r21 * e12 + r22 * e22)
    det_g = det_r * np.exp((-2.0 * sheet.roots[1]) * v)
    echo = g22 - det_g
    return np.asarray(2.0 * echo / (1.0 - g11 + echo))


def _slips(below: _Compliance) -> bool:
    return isinstance(below.c11, float) and below.c11 == inf
