"""The kernel L(u) by a 4 x 4 transfer matrix in high precision, from the equilibrium equations alone.

With u_r = U(z) J1(k r), u_z = W(z) J0(k r), sigma_rz = T J1, sigma_zz = N J0, equilibrium and Hooke's law of
a transversely isotropic material give y' = k A y for y = (U, W, T/k, N/k), A constant. The layer is
exp(k h A); the half-space below keeps the two decaying solutions (or U = W = 0 when it is rigid). L is the
ratio of the surface displacement W under a unit load to that of a half-space of the layer's material. Nothing
of the closed form under test is used: the materials enter through their compliance matrices.
"""

from __future__ import annotations

from itertools import product
from math import isqrt
from typing import Any

import mpmath as mp

import underlay as ul
from underlay.mechanics.body import Rigid

#: Digits that are left after the growth of exp(k h A) has taken its share.
DIGITS = 50


def compliance_matrix(material: ul.Isotropic | ul.TransverselyIsotropic) -> tuple[Any, Any]:
    """Strains (rr, tt, zz) from stresses, and the shear compliance 1/G'; the doubles given are exact."""
    if isinstance(material, ul.Isotropic):
        E, nu = mp.mpf(material.E), mp.mpf(material.nu)
        E_axial, nu_axial, shear = E, nu, 2 * (1 + nu) / E
    else:
        E, nu = mp.mpf(material.E), mp.mpf(material.nu)
        E_axial, nu_axial = mp.mpf(material.E_axial), mp.mpf(material.nu_axial)
        shear = 1 / mp.mpf(material.G_axial)
    cross = -nu_axial / E_axial
    return mp.matrix([[1 / E, -nu / E, cross], [-nu / E, 1 / E, cross], [cross, cross, 1 / E_axial]]), shear


def system_matrix(material: ul.Isotropic | ul.TransverselyIsotropic) -> Any:
    """A of y' = k A y: the compliance is inverted in the plane only, so nu = 0.5 is no special case."""
    compliance, shear = compliance_matrix(material)
    in_plane = compliance[:2, :2] ** -1
    # in-plane stresses = in_plane (in-plane strains - compliance[:2, 2] N)
    poisson = in_plane * compliance[:2, 2]
    coupling = -poisson[0]
    axial = compliance[2, 2] - (compliance[2, :2] * poisson)[0]
    # W' = axial N + (compliance[2,:2] in_plane) (in-plane strains), whose trace is k U J0.
    dilation = (compliance[2, :2] * in_plane)[0]
    return mp.matrix(
        [
            [0, 1, shear, 0],
            [dilation, 0, 0, axial],
            [in_plane[0, 0], 0, 0, coupling],
            [0, 0, -1, 0],
        ]
    )


def root_constants(A: Any) -> tuple[Any, Any]:
    """p and sigma of the characteristic polynomial (x^2 + p)^2 - sigma^2 x^2 of A, from its invariants."""
    square = A * A
    p = mp.sqrt(mp.det(A))
    return p, mp.sqrt(sum(square[i, i] for i in range(4)) / 2 + 2 * p)


def decaying_impedance(A: Any) -> Any:
    """(T, N)/k = Z (U, W) of the half-space z > 0: the range of A^2 - sigma A + p, whatever the roots are."""
    p, sigma = root_constants(A)
    space = A * A - sigma * A + p * mp.eye(4)
    # Two of its columns span the decaying solutions; take the pair that is farthest from parallel.
    pairs = [(i, j) for i in range(4) for j in range(i)]
    i, j = max(pairs, key=lambda c: abs(_minor(space, c[0], c[1])))
    displacement = mp.matrix([[space[0, i], space[0, j]], [space[1, i], space[1, j]]])
    stress = mp.matrix([[space[2, i], space[2, j]], [space[3, i], space[3, j]]])
    return stress * displacement**-1


def _minor(space: Any, i: int, j: int) -> Any:
    return space[0, i] * space[1, j] - space[0, j] * space[1, i]


class TransferMatrixKernel:
    """L(u) of one pair; `digits` 50 hold after cancellation."""

    def __init__(self, layer: ul.Isotropic | ul.TransverselyIsotropic, substrate: Any) -> None:
        self.layer, self.substrate = layer, substrate
        self._parts: dict[int, tuple[Any, Any, Any]] = {}
        with mp.workdps(DIGITS):
            self.sigma = float(root_constants(system_matrix(layer))[1])

    def _at(self, digits: int) -> tuple[Any, Any, Any]:
        """A of the layer, the condition on the state below it, and its half-space's answer, in so many digits."""
        if digits not in self._parts:
            with mp.workdps(digits):
                A = system_matrix(self.layer)
                if isinstance(self.substrate, Rigid):
                    condition = mp.matrix([[1, 0, 0, 0], [0, 1, 0, 0]])
                else:
                    Z = decaying_impedance(system_matrix(self.substrate))
                    condition = mp.matrix([[-Z[0, 0], -Z[0, 1], 1, 0], [-Z[1, 0], -Z[1, 1], 0, 1]])
                halfspace = mp.lu_solve(decaying_impedance(A), mp.matrix([0, -1]))
                self._parts[digits] = A, condition, halfspace
        return self._parts[digits]

    def L(self, u: float) -> Any:
        """L(u) as an mpf."""
        # The two growing solutions differ by at most exp(sigma u): what solving for the surface cancels. Digits by
        # the hundred: few wavenumbers need materials of their own.
        digits = 100 * int(mp.ceil((DIGITS + self.sigma * u / mp.log(10) + 20) / 100))
        A, condition, halfspace = self._at(digits)
        with mp.workdps(digits):
            # y(0) = (U, W, 0, -1): solve for U, W.
            rows = condition * exponential(mp.mpf(u) * A)
            surface = mp.lu_solve(rows[:, :2], rows[:, 3])
            return surface[1] / halfspace[1]


def exponential(A: Any) -> Any:
    """exp(A) by Taylor series after scaling, doubled back.

    Equilibrium couples (U, N) to (W, T) and these to (U, N): with the blocks X and Y of A, all is said by
    C = cosh(sqrt(B)) and S = sinh(sqrt(B))/sqrt(B) of B = X Y, series in B. B is 2 x 2 and B^2 = t B - d, its trace
    and determinant: every power is a pair (a, b), a + b B.
    """
    odd, even = (1, 2), (0, 3)
    X, Y = (mp.matrix([[A[i, j] for j in to] for i in at]) for at, to in ((even, odd), (odd, even)))
    halvings = isqrt(mp.mp.prec) // 2 + max(0, int(mp.ceil(mp.log(mp.mnorm(A, 1), 2))))
    # An error of C near one grows fourfold with each doubling.
    with mp.extradps(2 * halvings // 3 + 10):
        B = X * Y / mp.mpf(4) ** halvings
        trace, determinant, size = B[0, 0] + B[1, 1], mp.det(B), mp.mnorm(B, 1)

        def times(one: Any, two: Any) -> Any:
            square = one[1] * two[1]
            return (
                one[0] * two[0] - square * determinant,
                one[0] * two[1] + one[1] * two[0] + square * trace,
            )

        C = S = term = (mp.mpf(1), mp.mpf(0))
        k = 0
        while abs(term[0]) + abs(term[1]) * size > mp.eps:
            k += 2
            step = k * (k - 1)
            term = (-term[1] * determinant / step, (term[0] + term[1] * trace) / step)
            C = (C[0] + term[0], C[1] + term[1])
            S = (S[0] + term[0] / (k + 1), S[1] + term[1] / (k + 1))
        for _ in range(halvings):
            square, S = times(C, C), times(S, C)
            C = (2 * square[0] - 1, 2 * square[1])
        C, S = (a * mp.eye(2) + b * B for a, b in (C, S))
        blocks = ((even, even, C), (even, odd, S * X), (odd, even, Y * S), (odd, odd, X**-1 * C * X))
        result = mp.zeros(4)
        for at, to, block in blocks:
            for i, j in product(range(2), repeat=2):
                result[at[i], to[j]] = block[i, j]
    return result
