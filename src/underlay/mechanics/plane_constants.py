"""What an indentation sees of an elastic material: four combinations of its constants.

A transversely isotropic material (axis along the indentation) has five constants, but a frictionless
axisymmetric indentation sees only four combinations of them (`PlaneConstants`), finite at nu = 0.5:

- q = A13/A33,  c = 1/A33,  g = A11 - A13^2/A33,  S = 1/A44  (stiffnesses A_ij, the paper's appendix);
- from engineering constants, with n = E/E': q = n nu'/(1-nu), c = (1 - 2 n nu'^2/(1-nu))/E',
  g = E/(1-nu^2), S = 1/G'.

From them p = sqrt(q^2 + c g), sigma = sqrt(S g - 2q + 2p), and theta = g/(p sigma), which is the paper's
1/(2 pi H): half the indentation modulus. Isotropic: p = 1, sigma = 2, theta = E/(2(1-nu^2)).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["PlaneConstants", "Real", "isotropic_constants", "magnitude", "transversely_isotropic_constants"]

Real: TypeAlias = "float | FloatArray"


def magnitude(value: Real) -> Real:
    """|value|; keeps a float a float, which the scalar paths of the kernel live on."""
    return np.abs(value) if isinstance(value, np.ndarray) else abs(value)


class PlaneConstants(NamedTuple):
    """What an axisymmetric indentation sees of a material; each entry a float or an array (batch,).

    q is dimensionless; c and S are compliances (1/Pa); g is a stiffness (Pa).
    """

    q: Real
    c: Real
    g: Real
    S: Real

    @property
    def p(self) -> Real:
        """Product of the two decay roots of the material (dimensionless)."""
        return (self.q * self.q + self.c * self.g) ** 0.5

    @property
    def p_minus_q(self) -> Real:
        """p - q, zero or more, without the cancellation of the difference."""
        size = magnitude(self.q)
        return self.c * self.g / (self.p + size) + (size - self.q)

    @property
    def sigma(self) -> Real:
        """Sum of the two decay roots of the material (dimensionless)."""
        return (self.S * self.g + 2.0 * self.p_minus_q) ** 0.5

    @property
    def theta(self) -> Real:
        """The paper's elastic constant theta (Pa): half the indentation modulus."""
        return self.g / (self.p * self.sigma)

    @property
    def coupling(self) -> float:
        """gamma of the surface, of one material: what a shear moves axially, (1 - 2 nu)/(2 (1 - nu)) isotropic."""
        return float(self.p_minus_q / (self.sigma * self.p**0.5))


def isotropic_constants(E: Real, nu: Real) -> PlaneConstants:
    """Plane constants of isotropic materials; `E` (Pa) and `nu` may be arrays of one shape."""
    return PlaneConstants(
        q=nu / (1.0 - nu),
        c=(1.0 + nu) * (1.0 - 2.0 * nu) / (E * (1.0 - nu)),
        g=E / ((1.0 - nu) * (1.0 + nu)),
        S=2.0 * (1.0 + nu) / E,
    )


def transversely_isotropic_constants(
    E: Real, E_axial: Real, nu: Real, nu_axial: Real, G_axial: Real
) -> PlaneConstants:
    """Plane constants from the paper's engineering constants E, E', nu, nu', G'; arrays allowed."""
    n = E / E_axial
    return PlaneConstants(
        q=n * nu_axial / (1.0 - nu),
        c=(1.0 - 2.0 * n * nu_axial * nu_axial / (1.0 - nu)) / E_axial,
        g=E / ((1.0 - nu) * (1.0 + nu)),
        S=1.0 / G_axial,
    )
