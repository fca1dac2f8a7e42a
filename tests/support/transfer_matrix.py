"""The kernel L(u) by a 4 x 4 transfer matrix in high precision, from the equilibrium equations alone.

With u_r = U(z) J1(k r), u_z = W(z) J0(k r), sigma_rz = T J1, sigma_zz = N J0, equilibrium and Hooke's law of
a transversely isotropic material give y' = k A y for y = (U, W, T/k, N/k), A constant. The layer is
exp(k h A); the half-space below keeps the two decaying solutions (or U = W = 0 when it is rigid). L is the
ratio of the surface displacement W under a unit load to that of a half-space of the layer's material. Nothing
of the closed form under test is used: the materials enter through their compliance matrices.
"""

from __future__ import annotations

from math import isqrt
from typing import Any

import mpmath as mp

from underlay.mechanics.body import Rigid
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic

#: Digits that are left after the growth of exp(k h A) has taken its share.
DIGITS = 50


def compliance_matrix(material: Isotropic | TransverselyIsotropic) -> tuple[Any, Any]:
    """Strains (rr, tt, zz) from stresses, and the shear compliance 1/G'; the doubles given are exact."""
    if isinstance(material, Isotropic):
        E, nu = mp.mpf(material.E), mp.mpf(material.nu)
        E_axial, nu_axial, shear = E, nu, 2 * (1 + nu) / E
    else:
        E, nu = mp.mpf(material.E), mp.mpf(material.nu)
        E_axial, nu_axial = mp.mpf(material.E_axial), mp.mpf(material.nu_axial)
        shear = 1 / mp.mpf(material.G_axial)
    cross = -nu_axial / E_axial
    return mp.matrix([[1 / E, -nu / E, cross], [-nu / E, 1 / E, cross], [cross, cross, 1 / E_axial]]), shear


def system_matrix(material: Isotropic | TransverselyIsotropic) -> Any:
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

    def __init__(self, layer: Isotropic | TransverselyIsotropic, substrate: Any) -> None:
        self.layer, self.substrate = layer, substrate
        with mp.workdps(DIGITS):
            self.sigma = float(root_constants(system_matrix(layer))[1])

    def L(self, u: float) -> Any:
        """L(u) as an mpf."""
        # The two growing solutions differ by at most exp(sigma u): what solving for the surface cancels.
        with mp.workdps(int(DIGITS + self.sigma * u / mp.log(10)) + 20):
            A = system_matrix(self.layer)
            through = exponential(mp.mpf(u) * A)
            # Rows of the condition at the interface, on the state below the surface.
            if isinstance(self.substrate, Rigid):
                condition = mp.matrix([[1, 0, 0, 0], [0, 1, 0, 0]])
            else:
                Z = decaying_impedance(system_matrix(self.substrate))
                condition = mp.matrix([[-Z[0, 0], -Z[0, 1], 1, 0], [-Z[1, 0], -Z[1, 1], 0, 1]])
            # y(0) = (U, W, 0, -1): solve for U, W.
            rows = condition * through
            surface = mp.lu_solve(rows[:, :2], rows[:, 3])
            halfspace = mp.lu_solve(decaying_impedance(A), mp.matrix([0, -1]))
            return surface[1] / halfspace[1]


def exponential(A: Any) -> Any:
    """exp(A) by its Taylor series after scaling, squared back."""
    size = mp.mnorm(A, 1)
    halvings = isqrt(mp.mp.prec) // 2 + max(0, int(mp.ceil(mp.log(size, 2))))
    with mp.extradps(halvings // 3 + 10):
        scaled = A / 2**halvings
        result = mp.eye(4) + scaled
        term, k = scaled, 1
        while mp.mnorm(term, 1) > mp.eps:
            k += 1
            term = term * scaled / k
            result = result + term
        for _ in range(halvings):
            result = result * result
    return result
