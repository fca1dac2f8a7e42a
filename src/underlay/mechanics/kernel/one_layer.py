"""The kernel 1 - L(u) of one layer: how the base under it changes its surface compliance.

Formula (Hankel space, u = wavenumber times thickness; J = diag(-1, 1); 1 = layer, 2 = substrate):

- surface compliance of a half-space  C = (1/g) [[sigma, q-p], [q-p, p sigma]], zero for a rigid base;
- reflection at the interface         R = (C1 + J C2 J)^-1 J (C1 - C2);
- passage through the layer           E = exp(-u sigma/2) [[ch - sigma sh/2, p sh], [-sh, ch + sigma sh/2]],
  ch = cosh(u d), sh = sinh(u d)/d, d^2 = sigma^2/4 - p (of any sign; p, sigma of the layer);
- step 3: G = E R E and 1 - L = 2 (G22 - det G)/(1 - G11 + G22 - det G), det G = det R exp(-2 sigma u);
- step 4, small u on a soft substrate: L = 2 Y11/det Y - 1, Y = I + J G with the cancellation worked out;
- with friction the whole surface compliance, (C1 - J C1 G) (I + J G)^-1: over that of the layer's half-space it
  lacks 1 - L axially, -2 (G11 + det G)/(1 - G11 + G22 - det G) radially, and 2 G12/(...)/sqrt(p) is added across.

It is the L(u) of (1.6) and of the paper's appendix, for a layer bonded to its base, without the appendix's
division by gamma_1 - gamma_2: real, equal and complex roots and nu = 0.5 are one formula. Identical materials
give R = 0 and therefore L = 1 to the last bit. Erratum of the appendix: a_21 carries a minus,
-(2 gamma_1/Z){...}; as printed, the terms in x_1 y_1 cancel and L is wrong.
"""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.body import PlaneConstants, Real, magnitude

__all__ = ["EQUAL_ROOTS", "compliance", "one_minus_L", "passage"]

#: |d^2|/p below which the two roots count as equal: ch and sh are then exp(-u sigma/2) times 1 and u. The
# rounding of isotropic constants leaves up to 2.0 eps. Error of L at the switch, on a rigid base: 6e-16 with
# equal roots, 4e-16 without; relative, on a base 1e-4 as stiff: 1.4e-15 with, 2.0e-15 without.
EQUAL_ROOTS = 4.0 * np.finfo(float).eps
# det Y at u = 0 below which a substrate counts as soft (E2/E1 about 0.55): step 3 loses the digits of det Y
# where u is small. Relative error of L at the switch: 7e-16 by step 3, 1.1e-15 by step 4.
_SOFT = 0.5
# u max(sigma, 2 sqrt(p)) below which a soft substrate takes step 4. Relative error of L at the switch:
# 1.1e-15 by step 4, 1.2e-15 by step 3; 4e-15 by step 3 where the layer shears easily (G' = 0.03 E).
_SMALL_U = 3.0
# 1/(2k+1)!, 1/(2k+2)! of the series of step 4: at u sigma = 3 the first term left out is 2e-17 of the sum.
_ODD = read_only(np.array([1.0 / factorial(2 * k + 1) for k in range(1, 14)]))
_EVEN = read_only(np.array([1.0 / factorial(2 * k + 2) for k in range(1, 14)]))


class _Interface(NamedTuple):
    """M^-1 = C1 + J C2 J and C1 - C2 of a pair, times the layer's g; floats or (batch, 1).

    C1 and C2 have the same off-diagonal sign, so `m12` is the entry of both matrices.
    """

    p: Real
    sigma2: Real
    sigma: Real
    m11: Real
    m12: Real
    m22: Real
    determinant: Real
    d11: Real
    d22: Real


def one_minus_L(u: FloatArray, layer: PlaneConstants, substrate: PlaneConstants | None) -> FloatArray:
    """Evaluate 1 - L(u) without checks: the hot path of the solvers.

    Parameters
    ----------
    u : array (nodes,)
        Dimensionless wavenumbers, zero or more.
    layer, substrate : PlaneConstants
        Entries floats, or arrays (batch, 1); `substrate` None is a bonded rigid base.

    Returns
    -------
    array (nodes,) or (batch, nodes)
        Absolute error of L below 1e-14; relative error of L below 1e-13 where the substrate is softer.
    """
    pair = _interface(layer, substrate)
    p, sigma = pair.p, pair.sigma
    r11, r12, r21, r22, det_r = _reflection(pair)
    ch, sh = passage(u, p, pair.sigma2, sigma)
    ch2, chsh, sh2 = ch * ch, ch * sh, sh * sh
    # G22 and G22 - G11, with E = ch + sh [[-k, p], [-1, k]] multiplied out.
    k, w, spread = 0.5 * sigma, p * r21 - r12, r22 - r11
    det_g = det_r * np.exp(-2.0 * sigma * u)
    g22 = r22 * ch2 + (w + sigma * r22) * chsh + (k * (k * r22 + w) - p * r11) * sh2
    g22_g11 = spread * ch2 + sigma * (r11 + r22) * chsh + ((k * k + p) * spread + sigma * w) * sh2
    numerator, denominator = 2.0 * (g22 - det_g), 1.0 + g22_g11 - det_g
    # The denominator is det Y: 4 C1_11 C1_22/det(C1 + J C2 J) at u = 0.
    soft = _is_soft(pair)
    if _holds_for_none(soft):
        return numerator / denominator
    small = soft & (np.maximum(sigma, 2.0 * p**0.5) * u < _SMALL_U)
    # Where step 4 takes over, its value stands over 1: there the denominator may have rounded to zero.
    value = numerator / np.where(small, 1.0, denominator)
    nodes = small if small.ndim == 1 else small.any(axis=0)
    recovered = _soft_small_u(u[nodes], pair, ch2[..., nodes], chsh[..., nodes], sh2[..., nodes])
    value[..., nodes] = np.where(small[..., nodes], recovered, value[..., nodes])
    return value


def compliance(
    u: FloatArray, layer: PlaneConstants, substrate: PlaneConstants | None
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Change of the surface's compliance, radial, mixed and axial, each (nodes,), at `u` (nodes,) of one pair.

    None on a soft substrate, where it loses digits at small u. Absolute error below 1e-14.
    """
    pair = _interface(layer, substrate)
    if _is_soft(pair):
        return None
    p, sigma = pair.p, pair.sigma
    r11, r12, r21, r22, det_r = _reflection(pair)
    ch, sh = passage(u, p, pair.sigma2, sigma)
    ch2, chsh, sh2 = ch * ch, ch * sh, sh * sh
    # G = E R E with E = ch + sh [[-k, p], [-1, k]] multiplied out.
    k, w = 0.5 * sigma, p * r21 - r12
    det_g = det_r * np.exp(-2.0 * sigma * u)
    g11 = r11 * ch2 + (w - sigma * r11) * chsh + (k * (k * r11 - w) - p * r22) * sh2
    g12 = r12 * ch2 + p * (r11 + r22) * chsh + (p * (k * (r22 - r11) + p * r21) - k * k * r12) * sh2
    g22 = r22 * ch2 + (w + sigma * r22) * chsh + (k * (k * r22 + w) - p * r11) * sh2
    scale = 2.0 / (1.0 + (g22 - g11) - det_g)
    return -scale * (g11 + det_g), scale * g12 / p**0.5, scale * (g22 - det_g)


def _is_soft(pair: _Interface) -> bool | NDArray[np.bool_]:
    """Whether the substrate is so soft that step 3 loses digits at small u."""
    return 4.0 * pair.p * pair.sigma2 < _SOFT * pair.determinant


def _reflection(pair: _Interface) -> tuple[Real, Real, Real, Real, Real]:
    """R, row by row, and its determinant."""
    m12, scale = pair.m12, 1.0 / pair.determinant
    return (
        -(pair.m22 * pair.d11 + m12 * m12) * scale,
        -m12 * (pair.m22 + pair.d22) * scale,
        m12 * (pair.d11 + pair.m11) * scale,
        (m12 * m12 + pair.m11 * pair.d22) * scale,
        (m12 * m12 - pair.d11 * pair.d22) * scale,
    )


def _interface(layer: PlaneConstants, substrate: PlaneConstants | None) -> _Interface:
    p, gap = layer.p, layer.p_minus_q
    sigma2 = layer.S * layer.g + 2.0 * gap
    sigma = sigma2**0.5
    c22 = p * sigma
    det_c = layer.g * (p * layer.S + layer.c)
    if substrate is None:
        return _Interface(p, sigma2, sigma, sigma, -gap, c22, det_c, sigma, c22)
    ratio = layer.g / substrate.g
    p_b, gap_b = substrate.p, substrate.p_minus_q
    b11 = ratio * (substrate.S * substrate.g + 2.0 * gap_b) ** 0.5
    b22, s_b = p_b * b11, ratio * gap_b
    # A sum of terms none of which is negative: p - q >= 0 for every stable material.
    determinant = (
        det_c
        + ratio * layer.g * (p_b * substrate.S + substrate.c)
        + sigma * b22
        + c22 * b11
        + 2.0 * gap * s_b
    )
    return _Interface(
        p, sigma2, sigma, sigma + b11, s_b - gap, c22 + b22, determinant, sigma - b11, c22 - b22
    )


def passage(u: FloatArray, p: Real, sigma2: Real, sigma: Real) -> tuple[FloatArray, FloatArray]:
    """ch and sh times exp(-u sigma/2), with decaying exponentials only; `sigma2` is sigma^2."""
    half = 0.5 * sigma
    d2 = 0.25 * sigma2 - p
    equal = EQUAL_ROOTS * p
    if _holds_for_none(magnitude(d2) > equal):
        ch = np.exp(-half * u)
        return ch, u * ch
    if _holds_for_none(d2 <= 0.0):
        return _real_roots(u, p, half, d2**0.5)
    if _holds_for_none(d2 >= 0.0):
        return _complex_roots(u, half, (-d2) ** 0.5)
    # A batch with both kinds: each formula is evaluated for all, away from its own 0/0.
    d = np.maximum(magnitude(d2), equal) ** 0.5
    real, turning = _real_roots(u, p, half, d), _complex_roots(u, half, d)
    return np.where(d2 > 0.0, real[0], turning[0]), np.where(d2 > 0.0, real[1], turning[1])


def _holds_for_none(condition: bool | NDArray[np.bool_]) -> bool:
    """Whether a condition on one material, or on each of a batch, holds nowhere."""
    return not (condition.any() if isinstance(condition, np.ndarray) else condition)


def _real_roots(u: FloatArray, p: Real, half: Real, d: Real) -> tuple[FloatArray, FloatArray]:
    decay = np.exp(-p / (half + d) * u)
    sh = np.expm1((-2.0 * d) * u) * decay / (-2.0 * d)
    return decay - d * sh, sh


def _complex_roots(u: FloatArray, half: Real, d: Real) -> tuple[FloatArray, FloatArray]:
    decay, phase = np.exp(-half * u), d * u
    return decay * np.cos(phase), decay * np.sin(phase) / d


def _soft_small_u(
    u: FloatArray, pair: _Interface, ch2: FloatArray, chsh: FloatArray, sh2: FloatArray
) -> FloatArray:
    """1 - L = 2 (1 - Y11/det Y), Y = (I - J E J E) + 2 J E (M D) E, every entry without cancellation.

    R = 2 M D - J with D = diag(-C1_11, C1_22), so this is the same law; Y12 = p Y21 by reciprocity.
    """
    p, sigma = pair.p, pair.sigma
    k, scale = 0.5 * sigma, 2.0 * sigma / pair.determinant
    # Q = 2 M D
    q11, q21, q22 = -pair.m22 * scale, pair.m12 * scale, pair.m11 * p * scale
    w = 2.0 * p * q21
    x = sigma * u
    x11 = sigma * (chsh - k * sh2) - np.expm1(-x)
    y11 = x11 - q11 * ch2 - (w - sigma * q11) * chsh - (k * (k * q11 - w) - p * q22) * sh2
    y22 = (
        np.exp(-x) * _remainder(u, p, pair.sigma2, sigma)
        + q22 * ch2
        + (w + sigma * q22) * chsh
        + (k * (k * q22 + w) - p * q11) * sh2
    )
    y21 = q21 * ch2 - (q11 + q22) * chsh + (sigma + k * (q11 - q22) - (k * k + p) * q21) * sh2
    return 2.0 - 2.0 * y11 / (y11 * y22 - p * y21 * y21)


def _remainder(u: FloatArray, p: Real, sigma2: Real, sigma: Real) -> FloatArray:
    """exp(u sigma) X22 by its series, X = I - J E J E: of order u^3, its lower terms cancelled by hand.

    sum_{k>=1} q_k [sigma u^(2k+1)/(2k+1)! + sigma^2 u^(2k+2)/(2k+2)!], q_1 = 4 p,
    q_{k+1} = sigma^2 q_k + 4 p (sigma^2 - 4 p)^k.
    """
    difference = sigma2 - 4.0 * p
    term = power = 4.0 * p
    terms = [term]
    for _ in range(_ODD.size - 1):
        power = power * difference
        term = sigma2 * term + power
        terms.append(term)
    # (terms,), or (batch, terms) from entries (batch, 1).
    q = np.concatenate(terms, axis=1) if isinstance(term, np.ndarray) else np.array(terms)
    x = sigma * u
    powers = np.empty((_ODD.size, u.size))
    powers[:] = u * u
    np.multiply.accumulate(powers, axis=0, out=powers)
    return x * ((q * _ODD) @ powers + x * ((q * _EVEN) @ powers))
