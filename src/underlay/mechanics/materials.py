"""Elastic materials of the layer and of the substrate.

A transversely isotropic material (axis along the indentation) has five constants, but a frictionless
axisymmetric indentation sees only four combinations of them (`PlaneConstants`), finite at nu = 0.5:

- q = A13/A33,  c = 1/A33,  g = A11 - A13^2/A33,  S = 1/A44  (stiffnesses A_ij, the paper's appendix);
- from engineering constants, with n = E/E': q = n nu'/(1-nu), c = (1 - 2 n nu'^2/(1-nu))/E',
  g = E/(1-nu^2), S = 1/G'.

From them p = sqrt(q^2 + c g), sigma = sqrt(S g - 2q + 2p), and theta = g/(p sigma), which is the paper's
1/(2 pi H): half the indentation modulus. Isotropic: p = 1, sigma = 2, theta = E/(2(1-nu^2)).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, Self, TypeAlias

import numpy as np

from underlay._arrays import FloatArray, finite, positive
from underlay.errors import InputError, MaterialError
from underlay.mechanics.bonds import Bond, as_bond
from underlay.mechanics.relaxation import Relaxation
from underlay.quantities import Part, inlined, no_number, quantity

__all__ = [
    "RIGID",
    "Isotropic",
    "IsotropicLayer",
    "Layer",
    "Material",
    "Rigid",
    "Substrate",
    "TransverselyIsotropic",
    "isotropic_layer",
]

Real: TypeAlias = "float | FloatArray"

# A material declared incompressible may miss zero by the rounding of its own constants.
_ROUNDING = 8.0 * sys.float_info.epsilon

#: Parts of a scene that are made of materials.
_OF_MATERIAL = ("layer", "substrate")


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


def _require_positive_definite(inequalities: dict[str, bool], given: str) -> None:
    failed = [text for text, holds in inequalities.items() if not holds]
    if failed:
        verb = "fails" if len(failed) == 1 else "fail"
        raise MaterialError(f"not positive definite: {' and '.join(failed)} {verb} for {given}")


@dataclass(frozen=True)
class Isotropic(Part):
    """An isotropic elastic material.

    Parameters
    ----------
    E : float
        Young's modulus (Pa), positive.
    nu : float
        Poisson's ratio, in (-1, 0.5]; 0.5 (incompressible) is exact, not a limit.

    Raises
    ------
    MaterialError
        If `E` or `nu` is outside its range.

    Examples
    --------
    >>> Isotropic(E=3e6, nu=0.5).theta
    2000000.0
    """

    parts: ClassVar[tuple[str, ...]] = _OF_MATERIAL

    E: float = field(
        metadata=quantity("pressure", "{part} modulus", symbol="E", bounds=(0.0, np.inf), scales="force")
    )
    nu: float = field(
        metadata=quantity("dimensionless", "Poisson's ratio of the {part}", symbol=r"\nu", bounds=(-1.0, 0.5))
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "E", positive(self.E, "Young's modulus E", "Pa"))
        nu = finite(self.nu, "Poisson's ratio nu", "dimensionless")
        if not (-1.0 < nu <= 0.5):
            raise MaterialError(f"Poisson's ratio nu must be in (-1, 0.5]; got {self.nu!r}")
        object.__setattr__(self, "nu", nu)

    @property
    def plane_constants(self) -> PlaneConstants:
        """What the indentation sees of the material."""
        return isotropic_constants(self.E, self.nu)

    @property
    def theta(self) -> float:
        """theta = E / (2 (1 - nu^2)) (Pa), the paper's elastic constant."""
        return self.E / (2.0 * (1.0 - self.nu) * (1.0 + self.nu))


@dataclass(frozen=True)
class TransverselyIsotropic(Part):
    """A transversely isotropic material whose axis is the direction of indentation.

    Parameters
    ----------
    E, E_axial : float
        Young's moduli (Pa) in the plane of isotropy and along the axis: the paper's E and E'.
    nu : float
        Poisson's ratio in the plane: the paper's nu.
    nu_axial : float
        Lateral contraction under an axial load: the paper's nu'.
    G_axial : float
        Shear modulus (Pa) in planes through the axis: the paper's G'.

    Raises
    ------
    MaterialError
        If the stiffness is not positive definite; the message names each inequality that fails. The
        incompressible limit 1 - nu - 2 (E/E') nu'^2 = 0 is allowed.
    """

    parts: ClassVar[tuple[str, ...]] = _OF_MATERIAL

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

    def __post_init__(self) -> None:
        for name, text in (
            ("E", "in-plane Young's modulus E"),
            ("E_axial", "axial Young's modulus E_axial"),
            ("G_axial", "axial shear modulus G_axial"),
        ):
            object.__setattr__(self, name, positive(getattr(self, name), text, "Pa"))
        for name in ("nu", "nu_axial"):
            object.__setattr__(self, name, finite(getattr(self, name), name, "dimensionless"))
        room = 1.0 - self.nu - 2.0 * (self.E / self.E_axial) * self.nu_axial**2
        _require_positive_definite(
            {
                "-1 < nu < 1": -1.0 < self.nu < 1.0,
                "1 - nu - 2 (E/E_axial) nu_axial^2 >= 0": room >= -_ROUNDING,
            },
            f"nu = {self.nu!r}, nu_axial = {self.nu_axial!r}, E/E_axial = {self.E / self.E_axial:.6g} "
            f"(1 - nu - 2 (E/E_axial) nu_axial^2 is {room:.6g})",
        )

    @classmethod
    def from_stiffness(cls, *, A11: float, A12: float, A13: float, A33: float, A44: float) -> Self:
        """Build the material from its stiffnesses (Pa); `A44` is the shear modulus G'.

        Raises
        ------
        MaterialError
            If the stiffness is not positive definite, naming each inequality that fails.
        InputError
            If a stiffness is not a finite number.
        """
        given = {"A11": A11, "A12": A12, "A13": A13, "A33": A33, "A44": A44}
        A11, A12, A13, A33, A44 = (finite(value, name, "Pa") for name, value in given.items())
        volume = (A11 + A12) * A33 - 2.0 * A13 * A13
        _require_positive_definite(
            {
                "A44 > 0": A44 > 0.0,
                "A33 > 0": A33 > 0.0,
                "A11 > |A12|": abs(A12) < A11,
                "(A11 + A12) A33 > 2 A13^2": volume > 0.0,
            },
            f"A11 = {A11:.6g}, A12 = {A12:.6g}, A13 = {A13:.6g}, A33 = {A33:.6g}, A44 = {A44:.6g}",
        )
        plane = A11 * A33 - A13 * A13
        return cls(
            E=(A11 - A12) * volume / plane,
            E_axial=volume / (A11 + A12),
            nu=(A12 * A33 - A13 * A13) / plane,
            nu_axial=A13 / (A11 + A12),
            G_axial=A44,
        )

    def stiffness(self) -> dict[str, float]:
        """A11, A12, A13, A33, A44 (Pa) of the paper's appendix: the arguments of `from_stiffness`.

        Raises
        ------
        MaterialError
            If the material is incompressible: its stiffnesses are infinite.

        Examples
        --------
        >>> zinc = {"A11": 161e9, "A12": 34.2e9, "A13": 50.1e9, "A33": 61e9, "A44": 38.3e9}
        >>> round(TransverselyIsotropic.from_stiffness(**zinc).stiffness()["A33"] / 1e9, 9)
        61.0
        """
        n = self.E / self.E_axial
        room = 1.0 - self.nu - 2.0 * n * self.nu_axial**2
        if not room > 0.0:
            raise MaterialError(
                "an incompressible material (1 - nu - 2 (E/E_axial) nu_axial^2 = 0) has infinite "
                "stiffnesses; keep its engineering constants"
            )
        bulk = self.E / ((1.0 + self.nu) * room)
        return {
            "A11": bulk * (1.0 - n * self.nu_axial**2),
            "A12": bulk * (self.nu + n * self.nu_axial**2),
            "A13": self.E * self.nu_axial / room,
            "A33": self.E_axial * (1.0 - self.nu) / room,
            "A44": self.G_axial,
        }

    @property
    def plane_constants(self) -> PlaneConstants:
        """What the indentation sees of the material."""
        constants = transversely_isotropic_constants(
            self.E, self.E_axial, self.nu, self.nu_axial, self.G_axial
        )
        # c is 1/A33 >= 0; at the incompressible limit the rounding of the constants may leave -1e-17.
        return constants if constants.c >= 0.0 else constants._replace(c=0.0)

    @property
    def theta(self) -> float:
        """theta (Pa): the paper's 1/(2 pi H)."""
        return float(self.plane_constants.theta)


@dataclass(frozen=True)
class Rigid:
    """A base that does not deform; the layer is bonded to it."""

    @property
    def plane_constants(self) -> None:
        """None: nothing of it is seen but that it stands still."""
        return

    def __repr__(self) -> str:
        return "RIGID"


#: A bonded rigid base.
RIGID = Rigid()

Material: TypeAlias = Isotropic | TransverselyIsotropic
Substrate: TypeAlias = Isotropic | TransverselyIsotropic | Rigid


@dataclass(frozen=True)
class Layer(Part):
    """A layer of uniform thickness.

    Parameters
    ----------
    material : Isotropic or TransverselyIsotropic
        What it is made of.
    thickness : float, default inf
        Thickness h (m), positive; infinite means a half-space.
    bond : "bonded", "slip" or Spring, default "bonded"
        How its lower face holds to what is under it: without gap and slip, without gap and friction, or by
        springs.
    relaxation : Relaxation, optional
        How its modulus falls with time, e.g. `Prony`; without one it is elastic and no time is asked for.

    Raises
    ------
    InputError
        If a part is of the wrong kind, or shear alone relaxes in a layer that is not incompressible.
    """

    parts: ClassVar[tuple[str, ...]] = _OF_MATERIAL

    material: Material = field(metadata=inlined())
    thickness: float = field(
        default=np.inf,
        metadata=quantity("length", "{part} thickness", symbol="h", bounds=(0.0, np.inf), scales="length"),
    )
    bond: Bond = field(default="bonded", metadata=no_number())
    relaxation: Relaxation | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.material, Isotropic | TransverselyIsotropic):
            raise InputError(
                f"a layer is made of Isotropic or TransverselyIsotropic material; got {self.material!r}"
            )
        if self.thickness != np.inf:
            object.__setattr__(self, "thickness", positive(self.thickness, "layer thickness", "m"))
        as_bond(self.bond)
        if self.relaxation is not None:
            _check_relaxation(self.relaxation, self.material)


def _check_relaxation(relaxation: Relaxation, material: Material) -> None:
    if not isinstance(relaxation, Relaxation):
        raise InputError(f"a layer's relaxation must be a Relaxation such as Prony; got {relaxation!r}")
    compressible = material.plane_constants.c > 0.0
    if relaxation.relaxes == "shear" and compressible:
        raise InputError(
            "shear alone cannot relax in a compressible layer here: Poisson's ratio would rise in time, and a "
            "constant one misses the force by 1 % (nu = 0.49, half of the shear modulus relaxing) to 30 % "
            '(nu = 0.3); take nu = 0.5, or relaxes = "shear_and_bulk"'
        )


@dataclass(frozen=True)
class IsotropicLayer:
    """A layer and its base in engineering constants, as formulas of the literature need them.

    Parameters
    ----------
    layer : Isotropic
        What the layer is made of.
    base : Isotropic or None
        What it is bonded to; None is rigid.
    """

    layer: Isotropic
    base: Isotropic | None


def isotropic_layer(layer: Material, base: Substrate) -> IsotropicLayer | None:
    """Describe a layer on its base; None where either is anisotropic."""
    if not (isinstance(layer, Isotropic) and isinstance(base, Isotropic | Rigid)):
        return None
    return IsotropicLayer(layer, base if isinstance(base, Isotropic) else None)
