"""The kernel of one layer bonded to a base: the formula of `recursion`, in closed form where both are isotropic."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.body import Base, Material, PlaneConstants, magnitude
from underlay.mechanics.kernel.kernel import Compliance, Kernel, Scales, lowest, u_rule
from underlay.mechanics.kernel.recursion import Recursion, Sheet, scaled

# On softer bases, in shear, the closed form loses digits: at the switch it errs by 1e-14 of L, the recursion by
# 3e-15. Where 1 - L decays it keeps 1e-14 of it, at any ratio down to there.
_SOFTEST_BASE = 1e-3
# How far p and sigma of an isotropic material are from 1 and 2 by rounding.
_ROUNDING = 8.0 * float(np.finfo(float).eps)


class _OneLayer(Kernel):
    """Kernel of one layer bonded to a base, from the plane constants that a subclass gives."""

    @property
    @abstractmethod
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """Constants q, c, g, S (`PlaneConstants`) of layer and base; None for a rigid base."""

    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,); (nodes,) or (batch, nodes).

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.
        """
        return self._formula(u)

    @cached_property
    def _formula(self) -> Callable[[FloatArray], FloatArray]:
        return isotropic_formula(*self.constants) or self._recursion.one_minus_L

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance under normal and shear load at `u` (nodes,)."""
        return self._recursion.compliance(u)

    @cached_property
    def _recursion(self) -> Recursion:
        """The general formula (`recursion`) for one layer, in units of its constant g."""
        layer, base = self.constants
        sheet = Sheet(scaled(layer, layer.g), thickness=1.0, opening=0.0, sliding=0.0)
        return Recursion((sheet,), None if base is None else scaled(base, layer.g))

    @property
    def coupling(self) -> float:
        """Coupling gamma of the layer, defined at `Kernel.coupling`."""
        return self.constants[0].coupling

    @cached_property
    def scales(self) -> Scales:
        """Characteristic rates and stiffness ratios, from the constants of layer and base."""
        return Scales.of(*self.constants)

    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """Quadrature nodes and weights by `u_rule`; parameters as in `Kernel.rule`."""
        return u_rule(*self.constants, eps_max, rtol, power=power)

    @property
    def contrast(self) -> float:
        """Largest relative difference in compliance of the two materials (`material_contrast`); not for batches."""
        return material_contrast(*self.constants)


@dataclass(frozen=True, eq=False)
class LayerKernel(_OneLayer):
    """The kernel of one layer on one base by their plane constants, or of a batch of such layers.

    Parameters
    ----------
    layer, base : PlaneConstants
        Entries floats, or arrays (batch, 1); the base is bonded, and rigid if None.
    """

    layer: PlaneConstants
    base: PlaneConstants | None

    @property
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """Constants q, c, g, S (`PlaneConstants`) of layer and base, as given."""
        return self.layer, self.base

    @property
    def uniform(self) -> bool:
        """Whether layer and base are the same constants: then the kernel is zero."""
        return self.base is self.layer


@dataclass(frozen=True)
class SubstrateKernel(_OneLayer):
    """The kernel of one layer material on one substrate.

    Parameters
    ----------
    layer : Isotropic or TransverselyIsotropic
        Material of the layer.
    substrate : Isotropic, TransverselyIsotropic or RIGID
        Material of the half-space bonded under it.

    Raises
    ------
    InputError
        If one of them is not such a material.

    Examples
    --------
    >>> from underlay.mechanics.body import RIGID
    >>> from underlay.mechanics.materials import Isotropic
    >>> kernel = SubstrateKernel(Isotropic(E=1.0, nu=0.5), RIGID)
    >>> [round(float(a), 10) for a in kernel.coefficients(2)]
    [1.7702167734, -0.9577692889]
    """

    layer: Material
    substrate: Base

    def __post_init__(self) -> None:
        if not isinstance(self.layer, Material):
            raise InputError(f"the layer material is Isotropic or TransverselyIsotropic; got {self.layer!r}")
        if not isinstance(self.substrate, Base):
            raise InputError(
                f"the substrate is Isotropic, TransverselyIsotropic or rigid; got {self.substrate!r}"
            )

    @property
    def description(self) -> str:
        """Layer and substrate as text, for messages."""
        return f"{self.layer!r} on {self.substrate!r}"

    @cached_property
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """Constants q, c, g, S (`PlaneConstants`) of layer and substrate; None for a rigid substrate."""
        return self.layer.plane_constants, self.substrate.plane_constants

    @property
    def uniform(self) -> bool:
        """Whether layer and substrate are the same material: then the kernel is zero."""
        return self.substrate == self.layer


def isotropic_formula(
    layer: PlaneConstants, base: PlaneConstants | None
) -> Callable[[FloatArray], FloatArray] | None:
    """Closed form of 1 - L(u) for an isotropic layer on an isotropic or rigid base; None where there is none.

    None for anisotropic materials, and for bases more than a thousand times softer than the layer in shear, where
    the form loses digits. With kappa_i = 3 - 4 nu_i, m the layer's shear modulus over the base's, x = exp(-2u), a =
    (1 - m)/(kappa_1 + m) and b = (kappa_1 - m kappa_2)/(1 + m kappa_2) (Burmister 1945, J. Appl. Phys. 16, 89):

        1 - L = x [a (1 + b) + b (1 + a) - 2 a b (1 - x) + 4 a u (1 + u)]
                / {[1 - x + (1 + a) x] [1 - x + (1 + b) x] + 4 a u^2 x},

    u (nodes,) the wavenumber times the thickness.

    1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
    wavenumber times its thickness.
    """
    if not (is_isotropic(layer) and (base is None or is_isotropic(base))):
        return None
    kappa = (3.0 - layer.q) / (1.0 + layer.q)
    ratio, kappa_base = (0.0, 1.0) if base is None else (base.S / layer.S, (3.0 - base.q) / (1.0 + base.q))
    if not -lowest(-ratio) <= 1.0 / _SOFTEST_BASE:
        return None
    a, b = (1.0 - ratio) / (kappa + ratio), (kappa - ratio * kappa_base) / (1.0 + ratio * kappa_base)
    more_a, more_b = (1.0 + kappa) / (kappa + ratio), (1.0 + kappa) / (1.0 + ratio * kappa_base)

    def one_minus_L(u: FloatArray) -> FloatArray:
        x, rest = np.exp(-2.0 * u), -np.expm1(-2.0 * u)
        change = 4.0 * a * u
        above = (a * more_b + b * more_a) - (2.0 * a * b) * rest + change * (1.0 + u)
        return np.asarray(x * above / ((rest + more_a * x) * (rest + more_b * x) + change * u * x))

    return one_minus_L


def is_isotropic(of: PlaneConstants) -> bool:
    """Whether constants, all of a batch, are those of isotropic materials up to rounding."""
    nearest = min(lowest(-magnitude(of.p - 1.0)), lowest(-magnitude(of.sigma - 2.0)))
    return nearest >= -_ROUNDING


def material_contrast(inner: PlaneConstants, outer: PlaneConstants | None) -> float:
    """delta, the largest relative difference in compliance: (1 - delta) C_1 <= C_2 <= (1 + delta) C_1.

    C_1 and C_2 are the 2 x 2 surface compliances of half-spaces of the two materials. Energy is monotone in the
    stiffness of a part, so the layered body is between two half-spaces of moduli E_1/(1 +- delta), and the force at
    a given depth within a relative delta/(1 - delta) of the half-space's, at any contact size. 1 for a rigid
    substrate (`outer` None).
    """
    if outer is None:
        return 1.0
    (a, b, d), (A, B, D) = _compliance(inner), _compliance(outer)
    # Eigenvalues of C_1^-1 (C_2 - C_1) from trace and determinant of the 2 x 2 product.
    x, y, z = A - a, B - b, D - d
    determinant = a * d - b * b
    half_trace = 0.5 * (d * x - 2.0 * b * y + a * z) / determinant
    product = (x * z - y * y) / determinant
    return abs(half_trace) + sqrt(max(half_trace * half_trace - product, 0.0))


def _compliance(constants: PlaneConstants) -> tuple[float, float, float]:
    """C_11, C_12 and C_22 (radial, mixed, axial) of the surface of a half-space (1/Pa)."""
    p, sigma, g = float(constants.p), float(constants.sigma), float(constants.g)
    return sigma / g, -float(constants.p_minus_q) / g, p * sigma / g
