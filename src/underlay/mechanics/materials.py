"""Elastic materials: isotropic, and transversely isotropic about the direction of indentation."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from underlay._arrays import finite, positive
from underlay.errors import MaterialError
from underlay.mechanics.body import (
    Material,
    PlaneConstants,
    isotropic_constants,
    transversely_isotropic_constants,
)
from underlay.quantities import quantity

# A material declared incompressible may miss zero by the rounding of its own constants.
_ROUNDING = 8.0 * sys.float_info.epsilon
_INCOMPRESSIBLE = 0.5


def _require_positive_definite(inequalities: dict[str, bool], given: str) -> None:
    failed = [text for text, holds in inequalities.items() if not holds]
    if failed:
        verb = "fails" if len(failed) == 1 else "fail"
        raise MaterialError(f"not positive definite: {' and '.join(failed)} {verb} for {given}")


@dataclass(frozen=True)
class Isotropic(Material):
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

    isotropic: ClassVar[bool] = True

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

    @staticmethod
    def constants_of(**numbers: Any) -> PlaneConstants:
        """Plane constants from E (Pa) and nu, each a float or an array (sets,)."""
        return isotropic_constants(**numbers)

    @property
    def plane_constants(self) -> PlaneConstants:
        """The constants q, c, g, S on which an axisymmetric indentation depends."""
        return isotropic_constants(self.E, self.nu)

    @property
    def theta(self) -> float:
        """theta = E / (2 (1 - nu^2)) (Pa), the paper's elastic constant."""
        return self.E / (2.0 * (1.0 - self.nu) * (1.0 + self.nu))

    @property
    def in_plane(self) -> Self:
        """The material itself, which is isotropic."""
        return self

    def relaxed_in_shear(self, kept: float) -> Isotropic:
        """The material with `kept` times its shear modulus and the same bulk modulus."""
        if self.nu == _INCOMPRESSIBLE:
            return Isotropic(kept * self.E, self.nu)
        shear = 0.5 * kept * self.E / (1.0 + self.nu)
        bulk = self.E / (3.0 * (1.0 - 2.0 * self.nu))
        nu = (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear))
        return Isotropic(2.0 * shear * (1.0 + nu), nu)


@dataclass(frozen=True)
class TransverselyIsotropic(Material):
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

    @staticmethod
    def constants_of(**numbers: Any) -> PlaneConstants:
        """Plane constants from the values of its fields by name, each a float or an array (sets,)."""
        return transversely_isotropic_constants(**numbers)

    @property
    def plane_constants(self) -> PlaneConstants:
        """The constants q, c, g, S on which an axisymmetric indentation depends."""
        constants = transversely_isotropic_constants(
            self.E, self.E_axial, self.nu, self.nu_axial, self.G_axial
        )
        # c is 1/A33 >= 0; at the incompressible limit the rounding of the constants may leave -1e-17.
        return constants if constants.c >= 0.0 else constants._replace(c=0.0)

    @property
    def in_plane(self) -> Isotropic:
        """The isotropic material with its in-plane E and nu; a nu above 0.5 becomes 0.5."""
        return Isotropic(self.E, min(self.nu, _INCOMPRESSIBLE))
