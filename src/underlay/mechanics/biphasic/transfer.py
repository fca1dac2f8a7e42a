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

Transfer functions of a contact in Laplace space: a flat punch, a skeleton that itself relaxes, and creep.

A transfer function is khat(s) = P/(4 theta_d a w), exact for any history by superposition. Lengths are in units
of the punch's radius a, s in units of c/a^2, c = k_z A33.

Of one relaxation e(t) of all drained moduli (e(0) = 1), the permeability constant, the kernel depends on s/(k A)
and 1/A alone, A any modulus and k the permeability, so with e*(s) = s e^(s)

    khat(s) -> e*(s) khat(s/e*(s)),

exact for every history, drainage and anisotropy (not the product e(t) K(t)). arg(s/e*)
lies between 0 and arg s: a legal contour stays legal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.biphasic.history import Response, invert
from underlay.mechanics.biphasic.material import ComplexArray, Skeleton, punch_factor
from underlay.mechanics.biphasic.surface import BesselRule, Sampled, SurfaceKernel, WavenumberRule
from underlay.mechanics.relaxation import Modes

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


#: Times (a^2/c) of a table.
_SPAN = (1e-3, 30.0)
# Shares of the shortest and longest relaxation time that it reaches to.
_SHORTEST, _LONGEST = 0.02, 20.0


class Transfer(Protocol):
    """Transfer function khat(s) = P/(4 theta_d a w) of a contact, and its limits at s = 0 and infinite s.

    P force, w depth, a radius, theta_d half the drained indentation modulus; s the Laplace variable in c/a^2.
    """

    @property
    def undrained(self) -> float:
        """Value at infinite Laplace variable: normalised stiffness of the undrained elastic contact."""

    @property
    def drained(self) -> float:
        """Value at Laplace variable 0: normalised stiffness of the drained elastic contact."""

    @property
    def eps(self) -> float:
        """Contact radius over thickness, a/h; zero on a half-space."""

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Transfer function, (n,), at Laplace variables s, (n,), in c/a^2: c diffusivity, a contact radius."""


def operational(modes: Modes, s: ComplexArray) -> ComplexArray:
    """Relaxation e(t), a sum of exponentials, as e*(s) = s times its Laplace transform, in the shape of `s`.

    Times of the modes are in the unit of 1/s.
    """
    turned = s[..., None] * modes.times
    return np.asarray(modes.constant + (turned / (1.0 + turned)) @ modes.weights)


@dataclass(frozen=True)
class Relaxing:
    """Transfer function of a draining layer whose skeleton relaxes: e*(s) khat(s/e*(s)), as the module derives.

    Parameters
    ----------
    elastic : Transfer
        Transfer function khat with the instantaneous moduli of the skeleton.
    modes : Modes
        Relaxation e(t) of the moduli, 1 at t = 0; times in a^2/c, c of the instantaneous moduli.
    """

    elastic: Transfer
    modes: Modes

    @property
    def undrained(self) -> float:
        """Value at infinite Laplace variable: the undrained elastic contact with the instantaneous moduli."""
        return self.elastic.undrained

    @property
    def drained(self) -> float:
        """Value at Laplace variable 0: the drained contact, with the moduli left after all relaxation."""
        return self.modes.constant * self.elastic.drained

    @property
    def eps(self) -> float:
        """Contact radius over thickness, a/h."""
        return self.elastic.eps

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Transfer function e*(s) khat(s/e*(s)), (n,), at Laplace variables s (c/a^2), (n,).

        khat is that of the instantaneous moduli, e*(s) the relaxation (`operational`).
        """
        left = operational(self.modes, s)
        return left * self.elastic(s / left)


def span_of(transfer: Transfer) -> tuple[float, float]:
    """First and last time (a^2/c) between which the step response of `transfer` is tabulated."""
    low, high = _SPAN
    if isinstance(transfer, Relaxing):
        times = transfer.modes.times
        low = min(low, _SHORTEST * float(times.min()))
        high = max(high, _LONGEST * float(times.max()))
    return low, high


def relaxation(transfer: Transfer, span: tuple[float, float] | None = None, points: int = 16) -> Response:
    """Response P/(4 theta_d a) to a unit step of depth, for a contact's transfer function; times in a^2/c.

    `span`: first and last time of the table, by default `span_of`; `points`: Laplace variables for 1.5 decades.
    """
    return invert(
        transfer,
        transfer.undrained,
        transfer.drained,
        span or span_of(transfer),
        endless=transfer.eps == 0.0,
        points=points,
    )


def creep(transfer: Transfer, span: tuple[float, float] | None = None, points: int = 16) -> Response:
    """Response 4 theta_d a w to a unit step of load, for a contact's transfer function; arguments as `relaxation`.

    Raises
    ------
    InputError
        If the moduli relax to zero, so that the depth grows without end.
    """
    if not transfer.drained > 0.0:
        raise InputError("a skeleton that relaxes to nothing creeps without end; leave some of its modulus")
    return invert(
        lambda s: 1.0 / transfer(s),
        1.0 / transfer.undrained,
        1.0 / transfer.drained,
        span or span_of(transfer),
        endless=transfer.eps == 0.0,
        points=points,
    )


@dataclass(frozen=True)
class PunchTransfer:
    """Transfer function khat(s) = P/(4 theta_d a w) of a flat punch on a biphasic layer (module).

    Parameters
    ----------
    skeleton : Skeleton
        Drained skeleton of the layer.
    eps : float
        Radius over thickness, a/h; zero for a half-space.
    drainage : str
        One of `DRAINAGES`.
    terms : int, default 10
        Number of terms of the expansion of the pressures.
    reach : float, default 8
        The largest wavenumber (1/a) is reach sqrt(s a^2/c) + 40.
    points : int, default 6
        Gauss points of each panel of wavenumbers. With the defaults khat is within 3e-6, up to s = 1e4 c/a^2.
    """

    skeleton: Skeleton
    eps: float
    drainage: str
    terms: int = 10
    reach: float = 8.0
    points: int = 6

    def __post_init__(self) -> None:
        as_drainage(self.drainage)

    @cached_property
    def undrained(self) -> float:
        """Transfer function at infinite Laplace variable, from the exact elastic law of the undrained skeleton."""
        skeleton = self.skeleton
        return punch_factor(skeleton.undrained, self.eps) * skeleton.theta_undrained / skeleton.theta_drained

    @cached_property
    def drained(self) -> float:
        """Transfer function at Laplace variable 0, from the exact elastic law of the drained skeleton."""
        return punch_factor(self.skeleton.drained, self.eps)

    @cached_property
    def kernel(self) -> SurfaceKernel:
        """Surface kernel of the layer; lengths in units of the punch radius."""
        return SurfaceKernel(self.skeleton, np.inf if self.eps == 0.0 else 1.0 / self.eps)

    def end(self, s: complex) -> float:
        """Largest wavenumber (over 1/a, a the radius) that matters at the Laplace variable s (c/a^2)."""
        return float(self.reach * np.sqrt(abs(s)) + 40.0)

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Transfer function, (n,), at Laplace variables s (c/a^2), (n,), with one call of the kernel for all."""
        ends = [self.end(value) for value in s]
        basis = BesselRule(WavenumberRule(max(ends), points=self.points), self.terms)
        sampled = Sampled(basis.rule.nodes, self.kernel.thickness)
        counts = [basis.rule.up_to(end) for end in ends]
        asked = [sampled.places(count) for count in counts]
        sizes = [places.size for places in asked]
        at = np.repeat(s * self.skeleton.A33, sizes)
        kernel = self.kernel.matrix(np.concatenate(asked), at, sealed=self.drainage == "sealed")
        starts = pairwise(np.cumsum([0, *sizes]))
        parts = [
            sampled.read(kernel[low:high], count) for (low, high), count in zip(starts, counts, strict=True)
        ]
        return np.array([self._factor(part, basis) for part in parts])

    def _factor(self, kernel: ComplexArray, basis: BesselRule) -> complex:
        here = slice(len(kernel))
        odd = basis.odd[:, here] if self.drainage == "solid" else None
        rule = basis.rule
        matrix = galerkin(
            kernel, rule.nodes[here], rule.weights[here], basis.even[:, here], odd, self.skeleton
        )
        sunk = np.zeros(len(matrix))
        sunk[0] = 1.0
        force = 2.0 * np.pi * np.linalg.solve(matrix, sunk)[0]
        return complex(force / (4.0 * self.skeleton.theta_drained))
