"""The paper's appendix as printed, with the sign of a_21 corrected, and its isotropic form; in mpmath.

Only a cross-check: it divides by gamma_1 - gamma_2 (equal roots are 0/0) and by stiffnesses that nu = 0.5
makes infinite, which high precision survives where double precision does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath as mp


@dataclass(frozen=True)
class AppendixConstants:
    """H, m_1, gamma_1, gamma_2 of one material, from its stiffnesses A_ij."""

    H: Any
    m: Any
    gamma_1: Any
    gamma_2: Any

    @classmethod
    def from_stiffness(cls, A11: Any, A13: Any, A33: Any, A44: Any) -> AppendixConstants:
        # gamma^4 A11 A44 - gamma^2 [A11 A33 - A13 (A13 + 2 A44)] + A33 A44 = 0
        a, b, c = A11 * A44, A11 * A33 - A13 * (A13 + 2 * A44), A33 * A44
        root = mp.sqrt(mp.mpc(b * b - 4 * a * c))
        gamma_1, gamma_2 = mp.sqrt((b + root) / (2 * a)), mp.sqrt((b - root) / (2 * a))
        return cls(
            H=(gamma_1 + gamma_2) * A11 / (2 * mp.pi * (A11 * A33 - A13**2)),
            m=(A11 * gamma_1**2 - A44) / (A13 + A44),
            gamma_1=gamma_1,
            gamma_2=gamma_2,
        )


def stiffness(E: Any, E_axial: Any, nu: Any, nu_axial: Any, G_axial: Any) -> tuple[Any, Any, Any, Any]:
    """A11, A13, A33, A44 by the appendix's formulas, evaluated in the precision of the context."""
    E, E_axial, nu, nu_axial = mp.mpf(E), mp.mpf(E_axial), mp.mpf(nu), mp.mpf(nu_axial)
    n = E / E_axial
    room = 1 - nu - 2 * n * nu_axial**2
    return (
        E * (1 - n * nu_axial**2) / ((1 + nu) * room),
        E * nu_axial / room,
        E_axial * (1 - nu) / room,
        mp.mpf(G_axial),
    )


def kernel_L(u: Any, one: AppendixConstants, two: AppendixConstants, *, sign_of_a21: int = -1) -> Any:
    """L(u) = 1 + 2 M/N of the appendix; `sign_of_a21` +1 is the printed, wrong one."""
    H = two.H * (one.m - 1) / (one.H * (two.m - 1))
    step_1, step_2 = one.gamma_1 - one.gamma_2, two.gamma_1 - two.gamma_2
    g = step_1 / step_2
    g1_1, g2_1 = one.gamma_1 / step_1, one.gamma_2 / step_1
    g1_2, g2_2 = two.gamma_1 / step_2, two.gamma_2 / step_2
    straight = two.gamma_1 - two.m * two.gamma_2
    squared = two.gamma_1 - two.m**2 * two.gamma_2
    mixed = (one.m - 1) * (two.m - 1)
    Z = (
        H**2 * step_1 * (g1_2 - two.m**2 * g2_2)
        - g
        * H
        / step_2
        * (
            mixed * (one.gamma_1 * one.gamma_2 + two.gamma_1 * two.gamma_2)
            + 2 * straight * (one.gamma_1 - one.m * one.gamma_2)
        )
        + g**2 * (one.gamma_1 - one.m**2 * one.gamma_2)
    )
    a11 = 1 + 2 * one.gamma_1 / Z * (
        (-(H**2) * squared + g * H * (2 * straight + mixed * one.gamma_2)) / step_2 - g**2
    )
    off_diagonal = (
        g**2 * one.m - g * H * (g1_2 - two.m * g2_2) * (one.m + 1) + H**2 * (g1_2 - two.m**2 * g2_2)
    )
    a12 = 2 * one.gamma_2 / Z * off_diagonal
    a21 = sign_of_a21 * 2 * one.gamma_1 / Z * off_diagonal
    a22 = 1 + 2 * one.gamma_2 / Z * (
        (H**2 * squared - g * H * (2 * one.m * straight - mixed * one.gamma_1)) / step_2 + g**2 * one.m**2
    )
    x, y = mp.exp(-u / one.gamma_1), mp.exp(-u / one.gamma_2)
    cross = (g1_1 * a12 - g2_1 * a21) * x * y
    product = (a12 * a21 - a11 * a22) * x**2 * y**2
    M = -cross - g1_1 * a11 * x**2 + g2_1 * a22 * y**2 - product
    N = 1 + 2 * cross + (g1_1 + g2_1) * (a11 * x**2 - a22 * y**2) + product
    return mp.re(1 + 2 * M / N)


def isotropic_L(u: Any, E_ratio: Any, nu_1: Any, nu_2: Any) -> Any:
    """L = 1 - 2 exp(-2u) (d1 + d2 exp(-2u))/(1 + d3 exp(-2u) + d2 exp(-4u)); `E_ratio` E1/E2, 0: rigid."""
    u, nu_1, nu_2 = mp.mpf(u), mp.mpf(nu_1), mp.mpf(nu_2)
    kappa_1, kappa_2 = 3 - 4 * nu_1, 3 - 4 * nu_2
    m = mp.mpf(E_ratio) * (1 + nu_2) / (1 + nu_1)
    a, b = (1 - m) / (kappa_1 + m), (kappa_1 - m * kappa_2) / (1 + m * kappa_2)
    d1, d2, d3 = (a + b) / 2 + 2 * a * u * (1 + u), a * b, a + b + 4 * a * u**2
    x = mp.exp(-2 * u)
    return 1 - 2 * x * (d1 + d2 * x) / (1 + d3 * x + d2 * x * x)


def rigid_isotropic_L(u: Any, nu: Any) -> Any:
    """L = (2 kappa sinh 2u - 4u)/(2 kappa cosh 2u + 1 + kappa^2 + 4u^2), kappa = 3 - 4 nu."""
    u, kappa = mp.mpf(u), 3 - 4 * mp.mpf(nu)
    return (2 * kappa * mp.sinh(2 * u) - 4 * u) / (2 * kappa * mp.cosh(2 * u) + 1 + kappa**2 + 4 * u**2)
