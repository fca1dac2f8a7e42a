"""The contact equations on a disc, in a basis that knows the singularity at the edge.

On a contact of radius a the total pressure and, under an impervious tip, the water pressure of the surface
are

    sigma = sum alpha_n (1-x^2)^(-1/2) P_2n(sqrt(1-x^2))/C_n  <->  alpha_n j_2n(xi a),   C_n = (-1)^n P_2n(0),
    p     = sum beta_n (...)                                  <->  beta_n j_2n+1(xi a)/xi,

x = r/a, P_2n Legendre polynomials, j_n spherical Bessel functions and c11 ... c22 the surface kernel
(`SurfaceKernel`). Settlement and flux under the tip are tested with the same functions:

    A11 = int j_2m j_2n (xi c11 - 1/theta) dxi + delta pi/(2 (4n+1) a theta),   A12 = int j_2m j_2n+1 c12 dxi,
    A22 = int j_2m+1 j_2n+1 (c22/xi + rho) dxi - delta pi rho/(2 (4n+3) a),     A21 = int j_2m+1 j_2n c21 dxi,

theta the drained constant, rho = sqrt(k_r/k_z) and delta one where m = n, else zero: what is taken off is the
end of large xi, and its integral is known. Outside the contact there is no pressure and the water leaves
freely; ``"porous"`` lets it leave through the tip too; ``"sealed"`` nowhere. The force is P = 2 pi alpha_0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.biphasic.elastic_ends import ComplexArray
from underlay.mechanics.biphasic.material import Skeleton

#: How water leaves: not through the tip, through tip and surface, or nowhere at the surface (an intact skin).
DRAINAGES = ("solid", "porous", "sealed")


def as_drainage(given: str) -> str:
    """Return `given` if it is one of `DRAINAGES`, the ways in which water leaves at the tip.

    Raises
    ------
    InputError
        If it is not.
    """
    if given not in DRAINAGES:
        raise InputError(
            f'drainage of the tip must be one of {", ".join(map(repr, DRAINAGES))}; got {given!r}: "solid" lets no '
            'water through the tip, "porous" does'
        )
    return given


def galerkin(
    kernel: ComplexArray | FloatArray,
    xi: FloatArray,
    weights: FloatArray,
    even: FloatArray,
    odd: FloatArray | None,
    skeleton: Skeleton,
    radius: float = 1.0,
    tail: float = 1.0,
) -> ComplexArray | FloatArray:
    """Galerkin matrix of the contact equations (module), (terms, terms); twice as large under an impervious tip.

    Parameters
    ----------
    kernel : ndarray (nodes, 2, 2)
        Surface kernel c(xi), at one Laplace variable (complex) or for one time step (real).
    xi, weights : FloatArray
        Wavenumbers and quadrature weights, (nodes,).
    even, odd : FloatArray
        Spherical Bessel functions j_2n(xi a) and j_2n+1(xi a), (terms, nodes); `odd` is None unless the tip is
        impervious.
    skeleton : Skeleton
        Drained skeleton, for the limits of the kernel at large xi.
    radius : float, default 1
        Contact radius a.
    tail : float, default 1
        Factor on 1/theta in that limit: for a relaxing skeleton the inverse of its relative modulus e.
    """
    terms = np.arange(len(even))
    soft = tail / skeleton.theta_drained
    settled = (even * (weights * (xi * kernel[:, 0, 0] - soft))) @ even.T
    settled += np.diag(0.5 * np.pi * soft / ((4 * terms + 1) * radius))
    if odd is None:
        return settled
    rho = skeleton.seepage
    lifted = (even * (weights * kernel[:, 0, 1])) @ odd.T
    flowing = (odd * (weights * kernel[:, 1, 0])) @ even.T
    held = (odd * (weights * (kernel[:, 1, 1] / xi + rho))) @ odd.T
    held -= np.diag(0.5 * np.pi * rho / ((4 * terms + 3) * radius))
    return np.block([[settled, lifted], [flowing, held]])


def edge_signs(terms: int) -> FloatArray:
    """Signs (-1)^n, (terms,): weights with which the pressure coefficients alpha_n sum to the edge singularity."""
    return np.where(np.arange(terms) % 2, -1.0, 1.0)


@dataclass(frozen=True)
class ShapeRule:
    """Right-hand side of the contact equations from the shape of the tip.

    Parameters
    ----------
    terms : int
        Number of terms of the expansion of the pressures.
    """

    terms: int

    @cached_property
    def _rule(self) -> tuple[FloatArray, FloatArray]:
        """Values sqrt(1 - y^2) at the Gauss nodes y, (nodes,), and weights times P_2m(y)/C_m, (nodes, terms)."""
        y, w = np.polynomial.legendre.leggauss(4 * self.terms)
        y, w = 0.5 * (y + 1.0), 0.5 * w
        tested = np.polynomial.legendre.legvander(y, 2 * self.terms - 2)[:, ::2]
        at_zero = np.polynomial.legendre.legvander(np.zeros(1), 2 * self.terms - 2)[0, ::2]
        return np.sqrt(1.0 - y * y), w[:, None] * tested / (edge_signs(self.terms) * at_zero)

    def moments(self, surface: Callable[[FloatArray], FloatArray], radius: float) -> FloatArray:
        """Moments int_0^1 Phi(a sqrt(1 - y^2)) P_2m(y)/C_m dy, (terms,), of a tip's shape Phi(r), `surface`.

        a is the contact radius `radius`, P_2m a Legendre polynomial, C_m = (-1)^m P_2m(0).
        Of a paraboloid a^2/(2R) (2/3, -4/15, 0, ...); exact for smooth shapes to rounding.
        """
        x, tested = self._rule
        return np.asarray(surface(radius * x) @ tested)
