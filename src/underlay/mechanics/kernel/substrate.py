"""The kernel of one layer bonded to a base, as an object: see `recursion` for the formula."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import sqrt

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.body import Base, Material, PlaneConstants
from underlay.mechanics.kernel.kernel import Compliance, Kernel, Scales, u_rule
from underlay.mechanics.kernel.recursion import Recursion, Sheet, scaled

__all__ = ["LayerKernel", "SubstrateKernel", "coefficients", "material_contrast"]


@dataclass(frozen=True, eq=False)
class LayerKernel(Kernel):
    """The kernel of one layer on one base by their plane constants, or of a batch of such layers.

    Parameters
    ----------
    layer, base : PlaneConstants
        Entries floats, or arrays (batch, 1); `base` None is a bonded rigid one.
    """

    layer: PlaneConstants
    base: PlaneConstants | None

    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,); (nodes,) or (batch, nodes)."""
        return _bonded(self.layer, self.base).one_minus_L(u)

    @cached_property
    def scales(self) -> Scales:
        """Where it bends."""
        return Scales.of(self.layer, self.base)

    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """See `u_rule`."""
        return u_rule(self.layer, self.base, eps_max, rtol, power=power)

    @property
    def uniform(self) -> bool:
        """Whether the base continues the layer: the kernel is zero."""
        return self.base is self.layer

    @property
    def contrast(self) -> float:
        """How much the two materials differ; see `material_contrast`. Of one pair only."""
        return material_contrast(self.layer, self.base)


def coefficients(
    layer: PlaneConstants, substrate: PlaneConstants | None, count: int, rtol: float = 1e-15
) -> FloatArray:
    """a_0, a_1, ... (1.8) of a layer on a base by their plane constants; (count,) or (batch, count)."""
    return LayerKernel(layer, substrate).moments(count, rtol)


@dataclass(frozen=True)
class SubstrateKernel(Kernel):
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
                f"the substrate is Isotropic, TransverselyIsotropic or RIGID; got {self.substrate!r}"
            )

    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,)."""
        return self._recursion.one_minus_L(u)

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance in every direction at `u` (nodes,)."""
        return self._recursion.compliance(u)

    @cached_property
    def _recursion(self) -> Recursion:
        return _bonded(*self.constants)

    @property
    def coupling(self) -> float:
        """Gamma of the layer."""
        return self.constants[0].coupling

    @cached_property
    def scales(self) -> Scales:
        """Where it bends."""
        return Scales.of(*self.constants)

    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """See `u_rule`."""
        return u_rule(*self.constants, eps_max, rtol, power=power)

    @property
    def description(self) -> str:
        """Layer and substrate."""
        return f"{self.layer!r} on {self.substrate!r}"

    @cached_property
    def constants(self) -> tuple[PlaneConstants, PlaneConstants | None]:
        """What is seen of the layer and of the substrate; None where it is rigid."""
        return self.layer.plane_constants, self.substrate.plane_constants

    @property
    def uniform(self) -> bool:
        """Whether the substrate continues the layer: the kernel is zero."""
        return self.substrate == self.layer

    @property
    def contrast(self) -> float:
        """How much the two materials differ; see `material_contrast`."""
        return material_contrast(*self.constants)


def _bonded(layer: PlaneConstants, base: PlaneConstants | None) -> Recursion:
    """The recursion through one layer, in units of its g."""
    sheet = Sheet(scaled(layer, layer.g), thickness=1.0, opening=0.0, sliding=0.0)
    return Recursion((sheet,), None if base is None else scaled(base, layer.g))


def material_contrast(inner: PlaneConstants, outer: PlaneConstants | None) -> float:
    """How much two materials differ: delta with (1 - delta) C_1 <= C_2 <= (1 + delta) C_1.

    Energy is monotone in the stiffness of a part, so the layered body is between two half-spaces of moduli
    E_1/(1 +- delta), and the force at a given depth within a relative delta/(1 - delta) of the half-space's, at
    any contact size. 1 for a rigid substrate.
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
    """C_11, C_12 and C_22 of a half-space (1/Pa)."""
    p, sigma, g = float(constants.p), float(constants.sigma), float(constants.g)
    return sigma / g, -float(constants.p_minus_q) / g, p * sigma / g
