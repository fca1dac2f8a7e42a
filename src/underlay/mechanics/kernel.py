"""The substrate kernel 1 - L(u): how the base under a layer changes its surface compliance.

Placeholder path: steps 1-3 of the stable form; see the module's successor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from underlay._arrays import FloatArray
from underlay.mechanics.materials import Material, PlaneConstants, Rigid, Substrate

__all__ = ["SubstrateKernel"]


def one_minus_L(u: FloatArray, layer: PlaneConstants, substrate: PlaneConstants | None) -> FloatArray:
    """1 - L(u); constants scalar, or (batch, 1) against u (nodes,)."""
    p, sigma = layer.p, layer.sigma
    c11, c12, c22 = sigma / layer.g, (layer.q - p) / layer.g, p * sigma / layer.g
    if substrate is None:
        b11 = b12 = b22 = 0.0
    else:
        p2, sigma2 = substrate.p, substrate.sigma
        b11, b12, b22 = sigma2 / substrate.g, (substrate.q - p2) / substrate.g, p2 * sigma2 / substrate.g
    m11, m12, m22 = c11 + b11, c12 - b12, c22 + b22
    determinant = m11 * m22 - m12 * m12
    d11, d12, d21, d22 = -(c11 - b11), -(c12 - b12), c12 - b12, c22 - b22
    r11 = (m22 * d11 - m12 * d21) / determinant
    r12 = (m22 * d12 - m12 * d22) / determinant
    r21 = (m11 * d21 - m12 * d11) / determinant
    r22 = (m11 * d22 - m12 * d12) / determinant
    d2 = 0.25 * sigma * sigma - p
    d = np.sqrt(np.abs(d2))
    real_root = d2 >= 0.0
    slow = np.where(real_root, p / (0.5 * sigma + d), 0.5 * sigma)
    fade = np.exp(-slow * u)
    sh = np.where(real_root, special.exprel(-2.0 * d * u), np.sinc(d * u / np.pi)) * u * fade
    ch = np.where(real_root, 1.0 + 0.5 * np.expm1(-2.0 * d * u), np.cos(d * u)) * fade
    e11, e12, e21, e22 = ch - 0.5 * sigma * sh, p * sh, -sh, ch + 0.5 * sigma * sh
    f11, f12 = r11 * e11 + r12 * e21, r11 * e12 + r12 * e22
    f21, f22 = r21 * e11 + r22 * e21, r21 * e12 + r22 * e22
    g11 = e11 * f11 + e12 * f21
    g22 = e21 * f12 + e22 * f22
    det = (r11 * r22 - r12 * r21) * np.exp(-2.0 * sigma * u)
    return 2.0 * (g22 - det) / (1.0 - g11 + g22 - det)


@dataclass(frozen=True)
class SubstrateKernel:
    """The kernel of one layer material on one substrate."""

    layer: Material
    substrate: Substrate

    def one_minus_L(self, u: FloatArray) -> FloatArray:
        """1 - L(u), any shape."""
        base = None if isinstance(self.substrate, Rigid) else self.substrate.plane_constants
        return one_minus_L(np.asarray(u, dtype=np.float64), self.layer.plane_constants, base)
