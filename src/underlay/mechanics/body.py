"""What a tip is pressed into: a layer on a body, which is a half-space or further layers on one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from underlay._arrays import positive
from underlay.errors import InputError
from underlay.mechanics.bonds import Bond, as_bond
from underlay.mechanics.plane_constants import PlaneConstants
from underlay.mechanics.relaxation import Relaxation
from underlay.quantities import Part, inlined, no_number, quantity

__all__ = ["RIGID", "Base", "Body", "Layer", "Material", "Rigid"]


class Body(Part, ABC):
    """What a layer stands on: a half-space, or further layers on one."""

    parts: ClassVar[tuple[str, ...]] = ("layer", "substrate")

    #: Further layers, from the top down; none of a half-space.
    layers: Sequence[Layer] = ()

    @property
    @abstractmethod
    def base(self) -> Base:
        """The half-space that all stands on; of a half-space itself."""

    @abstractmethod
    def on(self, base: Base) -> Body:
        """Return the body with another half-space under it."""

    @property
    @abstractmethod
    def in_plane(self) -> Body:
        """The body with each anisotropic material replaced by the isotropic one of its in-plane E and nu."""

    @property
    def bonded(self) -> Body:
        """The body without slip and springs between its layers."""
        return self


class Base(Body):
    """A half-space of one material, or one that does not deform."""

    #: Whether its constants are those of an isotropic material; a rigid base has none and fits any.
    isotropic: ClassVar[bool] = False

    @property
    @abstractmethod
    def plane_constants(self) -> PlaneConstants | None:
        """What the indentation sees of it; None where it does not deform."""

    @staticmethod
    @abstractmethod
    def constants_of(**numbers: Any) -> PlaneConstants | None:
        """`plane_constants` from the numbers of its fields, each a float or an array (sets,)."""

    @property
    def base(self) -> Self:
        """Itself."""
        return self

    def on(self, base: Base) -> Base:
        """Return the other half-space."""
        return base

    @property
    @abstractmethod
    def in_plane(self) -> Base:
        """The isotropic material of its in-plane E and nu."""


class Material(Base):
    """An elastic material, of a layer or of a half-space.

    To add one: a frozen dataclass that derives from it, its constants declared in its fields, ``E`` and ``nu`` (in
    the plane of the surface) among them.
    """

    E: float
    nu: float

    @property
    @abstractmethod
    def plane_constants(self) -> PlaneConstants:
        """What the indentation sees of the material."""

    @property
    @abstractmethod
    def in_plane(self) -> Material:
        """The isotropic material of its in-plane E and nu."""

    @property
    def theta(self) -> float:
        """theta (Pa): the paper's 1/(2 pi H)."""
        return float(self.plane_constants.theta)

    def relaxed_in_shear(self, kept: float) -> Material | None:
        """Return the material with this share of its shear modulus and all of its bulk modulus; None if unknown."""
        del kept
        return None


@dataclass(frozen=True)
class Rigid(Base):
    """A base that does not deform; the layer is bonded to it."""

    isotropic: ClassVar[bool] = True

    @staticmethod
    def constants_of(**numbers: Any) -> None:
        """None: it has no numbers."""
        del numbers

    @property
    def plane_constants(self) -> None:
        """None: nothing of it is seen but that it stands still."""
        return

    @property
    def in_plane(self) -> Self:
        """Itself."""
        return self

    @property
    def choice(self) -> dict[str, Any]:
        """Rigid: it has no moduli to be known by."""
        return {"rigid": True}

    def __repr__(self) -> str:
        return "RIGID"


#: A bonded rigid base.
RIGID = Rigid()


@dataclass(frozen=True)
class Layer(Part):
    """A layer of uniform thickness.

    Parameters
    ----------
    material : Isotropic or TransverselyIsotropic
        What it is made of.
    thickness : float, default inf
        Thickness h (m), positive; infinite means a half-space.
    bond : "bonded", "slip", "unknown" or Spring, default "bonded"
        How its lower face holds to what is under it: without gap and slip, without gap and friction, or by
        springs. An unknown one is computed as bonded, and a fit says what slip would give.
    relaxation : Relaxation, optional
        How its modulus falls with time, e.g. `Prony`; without one it is elastic and no time is asked for.

    Raises
    ------
    InputError
        If a part is of the wrong kind, or shear alone relaxes in a layer that is not incompressible.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer", "substrate")

    material: Material = field(metadata=inlined())
    thickness: float = field(
        default=np.inf,
        metadata=quantity("length", "{part} thickness", symbol="h", bounds=(0.0, np.inf), scales="length"),
    )
    bond: Bond = field(default="bonded", metadata=no_number())
    relaxation: Relaxation | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.material, Material):
            raise InputError(
                f"a layer is made of Isotropic or TransverselyIsotropic material; got {self.material!r}"
            )
        if self.thickness != np.inf:
            object.__setattr__(self, "thickness", positive(self.thickness, "layer thickness", "m"))
        as_bond(self.bond)
        if self.relaxation is not None:
            _check_relaxation(self.relaxation, self.material)

    @property
    def held(self) -> Layer:
        """The layer as it is computed: bonded where nobody knows."""
        return replace(self, bond="bonded") if self.bond == "unknown" else self

    @property
    def in_plane(self) -> Layer:
        """The layer of an isotropic material with its in-plane E and nu."""
        return replace(self, material=self.material.in_plane)


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
