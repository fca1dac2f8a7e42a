"""A flat punch with full friction, in functions natural to a half-space, and a contact that grows and sticks.

Points under the tip do not slide once they are touched, so the contact depends on how it grew: every increment
is that of a flat punch of the current contact radius. `Basis` are the functions in which a half-space under such
a punch is the identity; in them `StuckPunch` is a small system for any body, solved at many contact radii;
`Growth` adds up the punches of a shape. Lengths are in thicknesses, eps = a/h is the contact radius a over the
thickness h, theta the surface's elastic constant and gamma its coupling of shear with axial displacement
(`Kernel.coupling`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atanh, ceil, pi, sinh, sqrt
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.exact.master_curve import (
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    chebyshev_values,
)
from underlay.mechanics.exact.nodes import Resolution, even_legendre, even_rule
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.kernel import Kernel

ComplexArray = NDArray[np.complex128]
# V_n falls as exp(-n alpha), y = cosh(alpha), and P_n grows so: where n alpha is more than this for the last n it
# is found by ratios from above, elsewhere by P_n. Error at the switch, of V_n up to 20: 2e-14 for 12 functions,
# 4e-13 for 40, 6e-12 for 140 by P_n, and 1e-14 by the ratios.
_SWITCH = 4.0
# Ratios are started where exp(-2 n alpha) has fallen by so many natural logarithms from the last n wanted.
_SETTLED = 28.0
# Orders of a transform: half of rho, where Bessel functions of that order begin to fall, so many cube roots of rho
# over which they fall, and so many more. Right to 4e-12 for rho up to 150.
_FALL, _BEYOND = 2.0, 5
# Nodes of the rule inside the contact and orders of the Legendre polynomials beside them that are ready-made: their
# products with 24 functions are integrated to 1e-12.
_READY_NODES, _READY_ORDERS = 128, 32
_READY_REACH = 3.0
# The error is what the last sixth of the terms of D in s does, two at least. Against growths of twice the terms, at
# a/h of 1 to 20 on rigid, stiff and soft bases, this is from 0.5 to 30 times the error.
_LAST = 6


class EndRule(NamedTuple):
    """Quadrature on (0, 1): nodes, their distances from 1 (`rest`), and weights, dense at both ends."""

    nodes: FloatArray
    rest: FloatArray
    weights: FloatArray


def end_rule(count: int, reach: float = 3.2) -> EndRule:
    """Tanh-sinh rule of `count` nodes, for integrands smooth inside (0, 1) and singular at its ends.

    What lies beyond `reach` is below exp(-pi sinh(reach)): 2e-17 for 3.2.
    """
    k = np.linspace(-reach, reach, count)
    far = np.exp(-pi * np.sinh(k))
    nodes = 1.0 / (1.0 + far)
    rest = far * nodes
    return EndRule(nodes, rest, (k[1] - k[0]) * pi * np.cosh(k) * nodes * rest)


#: Rules of a growth's integral by their counts, for errors of 1e-3 to 1e-6.
GROWTH_RULES = {count: end_rule(count) for count in (26, 29, 32, 35)}


# Finding a rule takes longer than a contact solved with it: these are constants, and their counts the ones taken.
_READY_RULES = {count: even_rule(count) for count in (16, 20, 24, _READY_ORDERS)}


_READY = end_rule(_READY_NODES, _READY_REACH)


_READY_LEGENDRE = even_legendre(_READY.nodes, _READY_ORDERS)


class Transform(NamedTuple):
    """Nodes y (nodes,) and weights (nodes, modes) by which cos(rho y) and sin(rho y) give A_n and B_n.

    A_n and B_n are the cosine and sine transforms of the functions of `Basis`.
    """

    nodes: FloatArray
    even: FloatArray
    odd: FloatArray

    def __call__(self, rho: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A_n and B_n (transforms of the `Basis`) at `rho`: each (*rho.shape, modes)."""
        # Both by the tangent of the half angle, which is one function in place of two.
        half = np.tan(np.multiply.outer(0.5 * rho, self.nodes))
        square = half * half
        scale = 1.0 / (1.0 + square)
        return ((1.0 - square) * scale) @ self.even, (2.0 * half * scale) @ self.odd


@dataclass(frozen=True)
class Basis:
    """Functions e_0 ... e_(N-1) of one coupling, in which a half-space under a tip that sticks is the identity.

    With w and u the axial and radial displacement under a punch, p^ and q^ the cosine transform of the pressure and
    the sine transform of the shear, f = p^ (even) and g = q^ (odd) solve, for a half-space of coupling gamma,

        F + i gamma H F = w,   F = f + i g,   H F(x) = (1/pi) pv int_-1^1 F(t)/(t - x) dt,

    whose solutions are Z = ((1+y)/(1-y))^(i eta), eta = artanh(gamma)/pi, times polynomials. Those orthogonal
    in its energy are Jacobi polynomials of index (-i eta, i eta), of a real recurrence:

        P_0 = 1,  P_1 = y - i eta,  (n+1) P_(n+1) = (2n+1) y P_n - (n + eta^2/n) P_(n-1),    e_n = i^n N_n Z P_n,
        N_n^2 = (2n+1)/(sqrt(1-gamma^2) Pi prod_(k<=n) (1 + eta^2/k^2)),   Pi = pi eta/sinh(pi eta).

    Transforms, and what e_n leaves outside the contact (y = 1/t > 1, X = ((y+1)/(y-1))^(i eta)):

        A_n(rho) = int_0^1 Re e_n cos(rho y) dy,   B_n(rho) = int_0^1 Im e_n sin(rho y) dy,
        V_n(y) = sqrt(1-gamma^2) Re{i^n N_n [conj P_n(y) - X P_n(y)]}
               = (2 gamma/pi) int_0^1 Im e_n t/(y^2 - t^2) dt.

    A_n + B_n and A_n - B_n are Coulomb functions (DLMF 33), spherical Bessel functions where gamma = 0.

    Parameters
    ----------
    gamma : float
        Coupling of the surface: of shear with axial displacement.
    eta : float
        artanh(gamma)/pi.
    norms : ndarray (modes,)
        N_n.
    load : float
        b_0 = N_0 Pi: the unit displacement is b_0 e_0.
    rule : EndRule
        Nodes inside the contact.
    even, odd : ndarray (modes, nodes)
        Re e_n and y Im e_n at them, times the weights.
    """

    gamma: float
    eta: float
    norms: FloatArray
    load: float
    rule: EndRule
    even: FloatArray
    odd: FloatArray

    @classmethod
    def of(cls, gamma: float, modes: int, rho: float) -> Self:
        """Basis of `modes` functions for the coupling `gamma`, whose transforms will be needed up to `rho`."""
        eta = atanh(gamma) / pi
        whole = pi * eta / sinh(pi * eta) if eta else 1.0
        n = np.arange(modes)
        shrink = np.multiply.accumulate(1.0 + (eta / np.maximum(n, 1)) ** 2 * (n > 0))
        norms = np.sqrt((2 * n + 1) / (sqrt(1.0 - gamma * gamma) * whole * shrink))
        load, orders = float(norms[0]) * whole, _orders(rho)
        rule = _READY if max(orders, modes) <= _READY_ORDERS else end_rule(80 + 3 * orders + modes)
        bare = cls(gamma, eta, norms, load, rule, norms[:, None], norms[:, None])
        inside = bare.values(rule) * rule.weights
        return replace(bare, even=inside.real, odd=inside.imag * rule.nodes)

    @property
    def halfspace(self) -> float:
        """kappa of a half-space, b_0^2: Mossakovskii's (1-nu) ln(3-4nu)/(1-2nu) when isotropic.

        kappa is the punch's stiffness over that of a frictionless one on a half-space.

        The functions are defined at `Basis`.
        """
        return self.load * self.load

    def values(self, rule: EndRule) -> ComplexArray:
        """e_n at the nodes of a rule on (0, 1), (modes, nodes).

        The functions are defined at `Basis`.
        """
        turned = np.exp(1j * self.eta * (np.log1p(rule.nodes) - np.log(rule.rest)))
        return self._scaled(self._polynomials(rule.nodes) * turned)

    @property
    def at_edge(self) -> ComplexArray:
        """e_n / Z at the edge, y = 1: (modes,).

        The functions are defined at `Basis`.
        """
        return self._scaled(self._polynomials(np.ones(1)))[:, 0]

    def transform(self, rho: float) -> Transform:
        """Nodes and weights that give A_n and B_n up to `rho`, by product integration.

        cos(rho y) and sin(rho y)/y are interpolated by even polynomials at the nodes of a Gauss-Legendre rule, and
        these integrated against e_n.

        The functions are defined at `Basis`.
        """
        count = _orders(rho)
        rule = _READY_RULES.get(count) or even_rule(count)
        ready = self.rule is _READY
        legendre = _READY_LEGENDRE[:, :count] if ready else even_legendre(self.rule.nodes, count)
        even, odd = (half @ legendre @ rule.projection for half in (self.even, self.odd))
        return Transform(rule.nodes, even.T, (odd / rule.nodes).T)

    def outside(self, rule: EndRule) -> FloatArray:
        """V_n(1/t) at the nodes t of a rule, (modes, nodes).

        The functions are defined at `Basis`.
        """
        left = np.zeros((self.norms.size, rule.nodes.size))
        if not self.gamma:
            return left
        y, turn = 1.0 / rule.nodes, self.eta * (np.log1p(rule.nodes) - np.log(rule.rest))
        alpha = np.arcsinh(np.sqrt(rule.rest * (1.0 + rule.nodes)) * y)
        far, scale = self.norms.size * alpha > _SWITCH, sqrt(1.0 - self.gamma**2)
        own = self._polynomials(y[~far])
        left[:, ~far] = scale * self._scaled(own.conj() - np.exp(1j * turn[~far]) * own).real
        # Re i^n (1 - X), X = exp(i turn), of even and of odd n but for the sign.
        sides = np.stack((2.0 * np.sin(0.5 * turn[far]) ** 2, np.sin(turn[far])))
        falling = self._falling(y[far], alpha[far])
        falling = (falling.reshape(-1, *sides.shape) * sides).reshape(falling.shape)[: len(left)]
        signs = np.array([1.0, 1.0, -1.0, -1.0])[np.arange(self.norms.size) % 4]
        left[:, far] = (scale * signs * self.norms)[:, None] * falling
        return left

    def _falling(self, y: FloatArray, alpha: FloatArray) -> FloatArray:
        """Minimal (decaying) solution of the recurrence of V_n at y = cosh(alpha), over its first term.

        Shape (modes, nodes), with one row more if the number of modes is odd.

        The functions are defined at `Basis`.
        """
        count = self.norms.size + self.norms.size % 2
        found = np.ones((count, y.size))
        ratio = np.exp(-alpha)
        for n in range(count + ceil(0.5 * _SETTLED / float(alpha.min())), 0, -1):
            ratio = (n + self.eta**2 / n) / ((2 * n + 1) * y - (n + 1) * ratio)
            if n < count:
                found[n] = ratio
        return np.multiply.accumulate(found, axis=0)

    def _scaled(self, polynomials: ComplexArray) -> ComplexArray:
        """Rows of `polynomials` times i^n N_n.

        The functions are defined at `Basis`.
        """
        phases = np.array([1.0, 1j, -1.0, -1j])[np.arange(self.norms.size) % 4]
        return np.asarray((phases * self.norms)[:, None] * polynomials)

    def _polynomials(self, y: FloatArray) -> ComplexArray:
        """P_n(y), (modes, nodes), by upward recurrence.

        The functions are defined at `Basis`.
        """
        found = np.empty((self.norms.size + 1, y.size), dtype=np.complex128)
        found[0], found[1] = 1.0, y - 1j * self.eta
        for n in range(1, self.norms.size - 1):
            found[n + 1] = ((2 * n + 1) * y * found[n] - (n + self.eta**2 / n) * found[n - 1]) / (n + 1)
        return found[:-1]


def _orders(rho: float) -> int:
    """Number of even Legendre polynomials needed to represent cos(rho y)."""
    count = _BEYOND + ceil(0.5 * rho + _FALL * rho ** (1.0 / 3.0))
    return next((ready for ready in _READY_RULES if count <= ready), count + count % 2)


@dataclass(frozen=True)
class StuckPunch:
    """The flat punch with full friction at contact radii eps = a/h on one body: a small system in `Basis`.

    With rho = eps u and (m11, m12, m22) the body's change of a half-space's compliance at the wavenumber u
    (times the thickness; `Compliance`), the coefficients c of the field for a unit displacement solve

        S_mn = (2 eps/pi) int_0^inf [m22 A_m A_n + m11 B_m B_n - m12 (A_m B_n + B_m A_n)] du,
        (1 - S) c = b_0 e_0,    kappa = b_0 c_0,    P = 4 theta a kappa w.

    S is symmetric and 1 - S positive definite; kappa is variational: its error is the square of the field's.

    theta is the layer's elastic constant. kappa is the punch's stiffness over that of a frictionless
    one on a half-space.

    Parameters
    ----------
    eps : ndarray (radii,)
        Contact radii over the layer's thickness.
    basis : Basis
        Its functions.
    fields : ndarray (radii, modes)
        Coefficients c.
    u, weights : ndarray (wavenumbers,)
        Nodes of the integrals over u, with 2/pi in the weights.
    change : ndarray (radii, wavenumbers)
        m22 f^ - m12 g^ over the radius: the transform of what the body adds to the displacement of a half-space.
    """

    eps: FloatArray
    basis: Basis
    fields: FloatArray
    u: FloatArray
    weights: FloatArray
    change: FloatArray

    @classmethod
    def solve(cls, body: Kernel, eps: FloatArray, modes: int, resolution: Resolution) -> Self:
        """Solve at radii over thickness `eps` (radii,) with `modes` functions and the nodes of `resolution`."""
        u, weights = resolution.wavenumber_rule()
        weights = (2.0 / np.pi) * weights
        radial, mixed, axial = body.compliance(u)
        rho = np.multiply.outer(eps, u)
        basis = Basis.of(body.coupling, modes, float(rho.max()))
        even, odd = basis.transform(float(rho.max()))(rho)
        strength = (eps[:, None] * weights)[:, :, None]
        # What the body adds, axially and radially, to the displacement under each function.
        down = axial[:, None] * even - mixed[:, None] * odd
        out = radial[:, None] * odd - mixed[:, None] * even
        matrix = -(even.transpose(0, 2, 1) @ (strength * down) + odd.transpose(0, 2, 1) @ (strength * out))
        matrix.reshape(eps.size, modes * modes)[:, :: modes + 1] += 1.0
        side = np.zeros((eps.size, modes, 1))
        side[:, 0, 0] = basis.load
        fields = np.asarray(np.linalg.solve(matrix, side)[:, :, 0], dtype=np.float64)
        return cls(eps, basis, fields, u, weights, (down @ fields[:, :, None])[:, :, 0])

    @property
    def kappa(self) -> FloatArray:
        """kappa (radii,): P/(4 theta a w), and (dP/dw)/(4 theta a) of every indenter with full friction.

        theta is the layer's elastic constant.
        """
        return self.basis.load * self.fields[:, 0]

    @property
    def edge(self) -> FloatArray:
        """|phi(1)|^2 (radii,), phi the field over Z: d(eps kappa)/d eps = kappa_half (1 - gamma^2) |phi(1)|^2.

        kappa is the punch's stiffness over that of a frictionless one on a half-space.
        """
        return np.abs(self.fields @ self.basis.at_edge) ** 2

    def body_transform(self, eps: FloatArray) -> FloatArray:
        """Abel transform of what the body adds to the punches' displacement, at radii `eps` (n,): (radii, n)."""
        return (self.change * self.weights * self.eps[:, None]) @ np.cos(np.multiply.outer(self.u, eps))


def chebyshev_radii(stretch: Stretch, count: int) -> FloatArray:
    """Radii over the thickness at the Chebyshev points of the variable `stretch`, increasing: (count,)."""
    return stretch.v(np.cos(chebyshev_angles(count)))


@dataclass(frozen=True)
class Growth:
    """A contact that grows with full friction, in ratios that are smooth down to a = 0.

    Every increment is a stuck punch of the radius s that the contact has by then. After Abel's transform, with
    H(x) the half-space depth function of the shape and lengths in thicknesses,

        int_0^x D(s, x) w'(s) ds = H(x),    P = 4 theta int_0^a s kappa(s) w'(s) ds,
        D(s, x) = 1 - sum_n c_n(s) V_n(x/s) + (2/pi) int_0^inf [m22 f^_s - m12 g^_s] cos(u x) du,

    with c_n and the last integral from `StuckPunch` and V_n from `Basis`. D is bounded; on a half-space it is
    cos(eta ln((x+s)/(x-s))). By collocation at Chebyshev radii, with
    w'(s) = H'(s) b(s), b a polynomial in the variable of `Stretch`; c(s) is interpolated in it too. dP/dw is
    4 theta a kappa(a) for every shape, and also the first slope of unloading.

    theta is the layer's elastic constant.

    Parameters
    ----------
    stretch : Stretch
        The variable ln(1 + rate a/h).
    coefficients : ndarray (terms, 4)
        Chebyshev coefficients in it of kappa, w/H(a), P/(4 theta a H(a)) and b = w'/H'.
    error : float
        Relative error of w/H and P: the change by the last terms of D in s and by halving the steps of its
        integral.
    """

    stretch: Stretch
    coefficients: FloatArray
    error: float

    @classmethod
    def solve(
        cls, punch: StuckPunch, stretch: Stretch, indenter: Indenter, thickness: float, steps: int
    ) -> Self:
        """Grow by the `punch` solutions at Chebyshev radii of `stretch`, with `steps` quadrature nodes.

        `thickness` (m) is that of the layer.
        """
        radii, count = punch.eps, punch.eps.size
        rule, angles = GROWTH_RULES.get(steps) or end_rule(steps), chebyshev_angles(count)
        # T_k at s = x t, (terms, radii x, steps), and interpolation from values at the radii.
        table = _chebyshev(stretch.z(np.multiply.outer(radii, rule.nodes)), count)
        to_terms = chebyshev_coefficients(np.eye(count), angles)
        bonds = (to_terms @ punch.body_transform(radii))[:, :, None]
        if punch.basis.gamma:
            bonds = bonds - (to_terms @ punch.fields @ punch.basis.outside(rule))[:, None, :]
        head = count - max(2, count // _LAST)
        last = (table[head:] * bonds[head:]).sum(axis=0)
        bond = 1.0 + (table[:head] * bonds[:head]).sum(axis=0) + last
        weights = rule.weights * _share_of_growth(indenter, radii * thickness, rule.nodes)
        inverse = np.linalg.inv((table * (weights * bond)).sum(axis=2).T)
        rate, kappa = inverse.sum(axis=1), to_terms @ punch.kappa
        flat = table.reshape(count, -1)
        carried = rule.nodes * (kappa @ flat).reshape(bond.shape)

        def grown(rates: FloatArray) -> tuple[FloatArray, FloatArray]:
            """Contributions of growth `rates` (..., terms) at every step, and their w/H and P (..., 2, radii)."""
            steps = weights * (rates @ flat).reshape(*rates.shape[:-1], *bond.shape)
            return steps, np.stack((steps.sum(axis=-1), (steps * carried).sum(axis=-1)), axis=-2)

        steps_grown, both = grown(rate)
        # What of H is missed without the last terms and by every other step; and, to first order, what that does.
        missed = [(steps_grown * last).sum(axis=1), 2.0 * (steps_grown * bond)[:, ::2].sum(axis=1) - 1.0]
        terms, halved = np.abs(grown(np.array(missed) @ inverse.T)[1] / both).max(axis=(1, 2))
        # The rule doubles its digits where it doubles its steps.
        error = float(terms + halved * halved)
        return cls(stretch, np.column_stack((kappa, to_terms @ both.T, rate)), error)

    def values(self, eps: FloatArray) -> FloatArray:
        """kappa, w/H, P/(4 theta a H) and w'/H' (n, 4) at contact radii over thickness `eps` (n,).

        theta is the layer's elastic constant.
        """
        return chebyshev_values(self.stretch.z(eps), len(self.coefficients)) @ self.coefficients


def _chebyshev(z: FloatArray, count: int) -> FloatArray:
    """Chebyshev polynomials T_k(z), k < `count` (at least two): (count, *z.shape)."""
    table = np.empty((count, *z.shape))
    table[0], table[1] = 1.0, z
    twice = 2.0 * z
    for k in range(2, count):
        np.multiply(twice, table[k - 1], out=table[k])
        table[k] -= table[k - 2]
    return table


def _share_of_growth(indenter: Indenter, lengths: FloatArray, nodes: FloatArray) -> FloatArray:
    """x H'(x t)/H(x), H the half-space depth of the indenter, at x = `lengths` (m) and t = `nodes`.

    Shape (radii, nodes), or (1, nodes) for a power law.
    """
    if isinstance(indenter, PowerLawShape):
        return np.asarray(indenter.exponent * nodes ** (indenter.exponent - 1.0))[None, :]
    slope = indenter.abel_slope(np.multiply.outer(lengths, nodes))
    return np.asarray(slope * (lengths / indenter.abel(lengths))[:, None])
