"""Biphasic materials: an elastic skeleton filled with water that drains through it.

Linear theory of incompressible constituents (Biot 1941, doi 10.1063/1.1712886; Mow, Kuei, Lai and Armstrong
1980, doi 10.1115/1.3138202): total stress = stress of the skeleton - p, and div(k grad p) = d(div u)/dt, with the
water pressure p, the permeability k and the displacement u. Not
in the model: permeability that changes with strain, finite strain, a skeleton stiffer in tension than in
compression (the in-plane modulus of a transversely isotropic one is then an effective number).

Elastic laws see the *drained* skeleton; `undrained` is the material while no water has moved.

Elastic ends of every drainage: the library's own laws of the undrained and of the drained skeleton.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import finite, positive
from underlay.errors import MaterialError
from underlay.mechanics.body import Material, PlaneConstants
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.indenters import FlatPunch, Indenter
from underlay.mechanics.kernel import LayerKernel
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.quantities import quantity

_PERMEABILITY = "m^4/(N s)"


@dataclass(frozen=True)
class Skeleton:
    """Dimensionless constants of the drained skeleton that enter an axisymmetric indentation of a biphasic layer.

    Moduli are in units of the shear modulus A44 and permeabilities in units of the axial one, k_z. With times in
    units of a^2/c, c = k_z A33, and lengths in units of a, four numbers remain.

    Parameters
    ----------
    A11, A13, A33 : float
        Stiffnesses of the drained skeleton over its axial shear modulus A44 (dimensionless).
    permeability_ratio : float, default 1
        Radial over axial permeability k_r/k_z.
    isotropic : bool, default False
        Whether skeleton and permeability are isotropic; the kernel has a closed form then.
    """

    A11: float
    A13: float
    A33: float
    permeability_ratio: float = 1.0
    isotropic: bool = False

    @classmethod
    def of_poisson_ratio(cls, nu: float) -> Skeleton:
        """Make the isotropic skeleton of Poisson's ratio `nu`: A33 = 2 (1 - nu)/(1 - 2 nu) shear moduli."""
        confined = 2.0 * (1.0 - nu) / (1.0 - 2.0 * nu)
        return cls(confined, confined - 2.0, confined, isotropic=True)

    @cached_property
    def drained(self) -> PlaneConstants:
        """`PlaneConstants` of the drained skeleton, those that an indentation sees; moduli in units of A44."""
        return PlaneConstants(self.A13 / self.A33, 1.0 / self.A33, self.A11 - self.A13**2 / self.A33, 1.0)

    @cached_property
    def undrained(self) -> PlaneConstants:
        """`PlaneConstants` of the skeleton while no water has moved: q = 1, c = 0, g = A11 + A33 - 2 A13, S = 1.

        Moduli are in units of the axial shear modulus A44.
        """
        return PlaneConstants(1.0, 0.0, self.A11 + self.A33 - 2.0 * self.A13, 1.0)

    @cached_property
    def theta_drained(self) -> float:
        """Half the indentation modulus of the drained skeleton, over A44."""
        return float(self.drained.theta)

    @cached_property
    def theta_undrained(self) -> float:
        """Half the indentation modulus while no water has moved, over A44: sqrt((A11 + A33 - 2 A13)/A44)."""
        return float(self.undrained.theta)

    @property
    def seepage(self) -> float:
        """Root of radial over axial permeability: surface flux over wavenumber times pressure, for short waves."""
        return sqrt(self.permeability_ratio)


class BiphasicMaterial(Material):
    """A material that drains: a skeleton, its permeability, and the two elastic materials it relaxes between."""

    drains: ClassVar[bool] = True

    permeability: float

    @property
    @abstractmethod
    def drained(self) -> Material:
        """The elastic material when the water has gone: the skeleton."""

    @property
    @abstractmethod
    def undrained(self) -> Material:
        """The elastic material while no water has moved: incompressible, with the skeleton's shear moduli."""

    @property
    @abstractmethod
    def skeleton(self) -> Skeleton:
        """Dimensionless constants of the drained skeleton, from which the surface kernel is computed."""

    @property
    @abstractmethod
    def aggregate_modulus(self) -> float:
        """H_A = A33 (Pa): stiffness of the drained skeleton in confined compression along the axis."""

    @property
    @abstractmethod
    def shear_modulus(self) -> float:
        """A44 (Pa): shear modulus in planes through the axis."""

    @property
    def diffusivity(self) -> float:
        """Diffusivity of the pressure (m^2/s): axial permeability times aggregate modulus."""
        return self.permeability * self.aggregate_modulus

    @property
    def plane_constants(self) -> PlaneConstants:
        """Plane constants of the drained skeleton, which is what an indentation sees in the long run."""
        return self.drained.plane_constants

    def drainage_time(self, length: float) -> float:
        """Drainage time length^2/c (s) of a contact of radius `length` (m), c the diffusivity of the pressure."""
        return positive(length, "length", "m") ** 2 / self.diffusivity


@dataclass(frozen=True)
class Biphasic(BiphasicMaterial):
    """An isotropic skeleton filled with water.

    Parameters
    ----------
    E : float
        Young's modulus of the drained skeleton (Pa), positive.
    nu : float
        Its Poisson's ratio, in (-1, 0.5): at 0.5 no water moves and nothing relaxes.
    permeability : float
        k (m^4/(N s)), positive; cartilage has about 1e-15.

    Raises
    ------
    MaterialError
        If a number is outside its range.

    Examples
    --------
    >>> cartilage = Biphasic(E=0.4e6, nu=0.1, permeability=1e-15)
    >>> f"{cartilage.aggregate_modulus:.6g} {cartilage.undrained.E:.6g}"
    '409091 545455'
    """

    isotropic: ClassVar[bool] = True

    E: float = field(
        metadata=quantity("pressure", "{part} modulus", symbol="E", bounds=(0.0, np.inf), scales="force")
    )
    nu: float = field(
        metadata=quantity("dimensionless", "Poisson's ratio of the {part}", symbol=r"\nu", bounds=(-1.0, 0.5))
    )
    permeability: float = field(
        metadata=quantity("permeability", "permeability of the {part}", symbol="k", bounds=(0.0, np.inf))
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "E", positive(self.E, "Young's modulus E", "Pa"))
        nu = finite(self.nu, "Poisson's ratio nu", "dimensionless")
        if not -1.0 < nu < 0.5:
            raise MaterialError(
                f"Poisson's ratio nu of a draining skeleton must be in (-1, 0.5); got {self.nu!r}: at 0.5 no water "
                "moves and nothing relaxes, take Isotropic"
            )
        object.__setattr__(self, "nu", nu)
        object.__setattr__(self, "permeability", positive(self.permeability, "permeability", _PERMEABILITY))

    @staticmethod
    def constants_of(**numbers: Any) -> PlaneConstants:
        """Plane constants of the drained skeleton; the permeability does not enter."""
        return Isotropic.constants_of(E=numbers["E"], nu=numbers["nu"])

    @cached_property
    def drained(self) -> Isotropic:
        """The elastic material of the skeleton alone, with the same E and nu."""
        return Isotropic(self.E, self.nu)

    @cached_property
    def undrained(self) -> Isotropic:
        """The elastic material before water flows: incompressible, with the same shear modulus G, so E = 3 G."""
        return Isotropic(3.0 * self.shear_modulus, 0.5)

    @cached_property
    def skeleton(self) -> Skeleton:
        """Dimensionless constants of the drained skeleton, from which the surface kernel is computed."""
        return Skeleton.of_poisson_ratio(self.nu)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E/(2 (1 + nu)) (Pa)."""
        return 0.5 * self.E / (1.0 + self.nu)

    @property
    def aggregate_modulus(self) -> float:
        """Aggregate modulus H_A = E (1 - nu)/((1 + nu)(1 - 2 nu)) (Pa)."""
        return self.E * (1.0 - self.nu) / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))

    @property
    def in_plane(self) -> Self:
        """The material itself, being isotropic."""
        return self


@dataclass(frozen=True)
class BiphasicTransverse(BiphasicMaterial):
    """A transversely isotropic skeleton, its axis along the indentation, filled with water.

    Parameters
    ----------
    E, E_axial : float
        Young's moduli (Pa) of the drained skeleton in the plane of the surface and along the axis: E1 and E3.
    nu : float
        Poisson's ratio in the plane: nu12.
    nu_axial : float
        Lateral contraction under an axial load: nu31.
    G_axial : float
        Shear modulus (Pa) in planes through the axis: G13 = A44.
    permeability : float
        Along the axis, k_z (m^4/(N s)), positive.
    permeability_ratio : float, default 1
        Radial over axial permeability k_r/k_z, positive.

    Raises
    ------
    MaterialError
        If the stiffness is not positive definite; the message names each inequality that fails. The incompressible
        limit 1 - nu - 2 (E/E_axial) nu_axial^2 = 0 is refused: nothing drains.
    """

    E: float = field(
        metadata=quantity("pressure", "{part} modulus", symbol="E", bounds=(0.0, np.inf), scales="force")
    )
    E_axial: float = field(
        metadata=quantity(
            "pressure", "axial modulus of the {part}", symbol="E'", bounds=(0.0, np.inf), scales="force"
        )
    )
    nu: float = field(
        metadata=quantity("dimensionless", "Poisson's ratio of the {part}", symbol=r"\nu", bounds=(-1.0, 1.0))
    )
    nu_axial: float = field(
        metadata=quantity("dimensionless", "axial Poisson's ratio of the {part}", symbol=r"\nu'")
    )
    G_axial: float = field(
        metadata=quantity(
            "pressure", "axial shear modulus of the {part}", symbol="G'", bounds=(0.0, np.inf), scales="force"
        )
    )
    permeability: float = field(
        metadata=quantity("permeability", "permeability of the {part}", symbol="k", bounds=(0.0, np.inf))
    )
    permeability_ratio: float = field(
        default=1.0,
        metadata=quantity(
            "dimensionless", "permeability ratio of the {part}", symbol="k_r/k_z", bounds=(0.0, np.inf)
        ),
    )

    def __post_init__(self) -> None:
        elastic = TransverselyIsotropic(self.E, self.E_axial, self.nu, self.nu_axial, self.G_axial)
        for name in ("E", "E_axial", "nu", "nu_axial", "G_axial"):
            object.__setattr__(self, name, getattr(elastic, name))
        if not self._room > 0.0:
            raise MaterialError(
                "a draining skeleton is compressible: 1 - nu - 2 (E/E_axial) nu_axial^2 must be above zero; got "
                f"{self._room:.3g}, where no water moves and nothing relaxes"
            )
        object.__setattr__(self, "permeability", positive(self.permeability, "permeability", _PERMEABILITY))
        ratio = positive(self.permeability_ratio, "permeability_ratio", "dimensionless")
        object.__setattr__(self, "permeability_ratio", ratio)

    @property
    def _room(self) -> float:
        return 1.0 - self.nu - 2.0 * (self.E / self.E_axial) * self.nu_axial**2

    @staticmethod
    def constants_of(**numbers: Any) -> PlaneConstants:
        """Plane constants of the drained skeleton; the permeabilities do not enter."""
        elastic = {name: numbers[name] for name in ("E", "E_axial", "nu", "nu_axial", "G_axial")}
        return TransverselyIsotropic.constants_of(**elastic)

    @cached_property
    def drained(self) -> TransverselyIsotropic:
        """The elastic material of the skeleton."""
        return TransverselyIsotropic(self.E, self.E_axial, self.nu, self.nu_axial, self.G_axial)

    @cached_property
    def undrained(self) -> TransverselyIsotropic:
        """The elastic material before water flows: incompressible, same in-plane and axial shear moduli."""
        A = self._stiffness
        shear = 0.5 * (A["A11"] - A["A12"])
        axial = A["A33"] - 2.0 * A["A13"] + 0.5 * (A["A11"] + A["A12"])
        plane = 4.0 * shear * axial / (shear + axial)
        return TransverselyIsotropic(plane, axial, 1.0 - 0.5 * plane / axial, 0.5, self.G_axial)

    @cached_property
    def _stiffness(self) -> dict[str, float]:
        return self.drained.stiffness()

    @cached_property
    def skeleton(self) -> Skeleton:
        """Dimensionless constants of the drained skeleton, from which the surface kernel is computed."""
        A = self._stiffness
        shear = A["A44"]
        return Skeleton(A["A11"] / shear, A["A13"] / shear, A["A33"] / shear, self.permeability_ratio)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus A44 = G_axial (Pa) in planes that contain the axis."""
        return self.G_axial

    @property
    def aggregate_modulus(self) -> float:
        """Aggregate modulus H_A = A33 (Pa)."""
        return self._stiffness["A33"]

    @property
    def in_plane(self) -> Isotropic:
        """The isotropic elastic material with the in-plane E and nu of the drained skeleton."""
        return self.drained.in_plane


ComplexArray: TypeAlias = NDArray[np.complex128]

# Of the ends of a response, whose own error is 1e-5 of them.
_RTOL = 1e-10


def elastic_law(
    constants: PlaneConstants, indenter: Indenter, thickness: float, max_depth: float, rtol: float = _RTOL
) -> ContactLaw:
    """Exact contact law of an elastic layer on a bonded rigid base, or of a half-space.

    Parameters
    ----------
    constants : PlaneConstants
        Elastic constants of the layer; forces are in the unit of its moduli times an area.
    indenter : Indenter
        The tip.
    thickness : float
        Thickness of the layer; inf for a half-space.
    max_depth : float
        Largest depth of the law.
    rtol : float, optional
        Relative error of the law.
    """
    base = None if np.isfinite(thickness) else constants
    contact = Contact(indenter, LayerKernel(constants, base), float(constants.theta), thickness)
    return exact_law(contact, max_depth, rtol)


def punch_factor(constants: PlaneConstants, eps: float, rtol: float = _RTOL) -> float:
    """Force of a flat punch on an elastic layer on a rigid base over that on a half-space: P/(4 theta a w).

    P force, w depth, theta half the indentation modulus, a radius; `eps` = a/h, radius over thickness, may be zero.
    """
    if eps == 0.0:
        return 1.0
    force = float(elastic_law(constants, FlatPunch(1.0), 1.0 / eps, 1.0, rtol).force(1.0))
    return force / (4.0 * float(constants.theta))
