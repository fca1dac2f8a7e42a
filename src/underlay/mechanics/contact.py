"""A contact as solvers see it: an indenter, a kernel and a surface modulus, not the materials behind them.

The frictionless contact problem sees the body under the indenter through two things alone: the elastic
constant theta of its surface, and the kernel 1 - L(u) that says how the rest of the body changes the surface
compliance with the wavenumber. So a solver works for every body that has a kernel. Here too stand what a model of
adhesion is (`Adhesion`), what it tabulates, and what it asks of a solver (`BuildsElastic`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.body import Base, Body, Layer, Material, stacked
from underlay.mechanics.contact_law import ContactLaw, OnLaw
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.kernel import Kernel, StackKernel, SubstrateKernel
from underlay.quantities import Part

__all__ = ["Adhesion", "AdhesionTable", "AdhesiveReadings", "Beside", "BuildsElastic", "Contact", "laws_on"]


class BuildsElastic(Protocol):
    """What a model of adhesion asks of a solver: its accuracy, and the law without adhesion."""

    sees_base: ClassVar[bool]

    @property
    def name(self) -> str:
        """Name of the solver in tables and messages."""

    @property
    def tolerance(self) -> float:
        """Relative error against the exact contact problem; zero: no such promise."""

    def law(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Law of a contact up to `max_depth` (m)."""


class AdhesiveReadings(NamedTuple):
    """Contact force (N) and stiffness dP/dw (N/m), (sets, n), and which sets could be read."""

    force: FloatArray
    stiffness: FloatArray
    possible: NDArray[np.bool_]

    @classmethod
    def empty(cls, sets: int, points: int) -> Self:
        """Room for `sets` sets, none of which is read yet."""
        return cls(np.zeros((sets, points)), np.zeros((sets, points)), np.zeros(sets, dtype=bool))


class AdhesionTable(ABC):
    """Contacts of any work of adhesion that differ in one number more at most, for many sets at once."""

    @abstractmethod
    def readings(
        self, work: FloatArray, travel: FloatArray, compliance: FloatArray, ratio: FloatArray | None
    ) -> AdhesiveReadings:
        """Force and stiffness of many sets.

        Parameters
        ----------
        work : FloatArray
            Works of adhesion (J/m^2), (sets,).
        travel : FloatArray
            Travels (m) since contact of the other end of a spring, (sets, n), in the order they are reached.
        compliance : FloatArray
            Of the spring (m/N), (sets,); zero where the depth itself is given.
        ratio : FloatArray or None
            Values of the number on which the contact depends, (sets,); None where it is the same for all.

        Returns
        -------
        AdhesiveReadings
            A set that the table does not reach is not possible here; a caller then asks for a law of its own.
        """

    @abstractmethod
    def pull_offs(self, work: FloatArray, ratio: FloatArray | None) -> FloatArray:
        """Pull-off force (N, positive, load given) and depth (m, depth given), (2, sets); NaN out of reach."""


class Adhesion(Part, ABC):
    """What holds tip and surface together; its numbers stand under ``adhesion.``.

    A concrete class names itself in `model`; scene files know it by that name.
    """

    parts: ClassVar[tuple[str, ...]] = ("adhesion",)
    chosen_by: ClassVar[str] = "model"
    #: Name in scene files.
    model: ClassVar[str] = ""

    @property
    def short_ranged(self) -> Adhesion:
        """The same work of adhesion with an attraction of no range, where the model has one: what JKR says."""
        return self

    def about_range(self, contact: Contact, solver: BuildsElastic) -> str:
        """Say for which range of the attraction the model holds; empty where it does not know."""
        del contact, solver
        return ""

    def table(
        self, contact: Contact, contact_at: Callable[[float], Contact], solver: BuildsElastic
    ) -> AdhesionTable | None:
        """Return contacts like this one at any work of adhesion; None where sets are asked for one by one.

        `contact_at` is the contact at a value of the one number more that may vary, a ratio of moduli.
        """
        del contact, contact_at, solver
        return None

    @abstractmethod
    def law(self, contact: Contact, max_depth: float, solver: BuildsElastic) -> ContactLaw:
        """Law of a contact that sticks, for depths up to `max_depth` (m); `solver` says how the body is solved."""


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

    layer: Material
    base: Material | None

    @classmethod
    def of(cls, layer: Material, base: Base) -> Self | None:
        """Describe a layer on its base; None where either is anisotropic."""
        if not (layer.isotropic and base.isotropic):
            return None
        return cls(layer, base if isinstance(base, Material) else None)


class Beside(NamedTuple):
    """A body a small step away from that of a contact, in one number.

    Parameters
    ----------
    kernel : Kernel
        Of that body.
    log_theta : float
        ln of its theta over the contact's.
    step : float
        Of the number, small enough for a difference of kernels to be their derivative.
    thickness : float, default 1
        Its thickness over the contact's: the kernel is one of u, the wavenumber times its own.
    """

    kernel: Kernel
    log_theta: float
    step: float
    thickness: float = 1.0


def laws_on(
    indenter: Indenter, layer: Layer, base: Body | None, beside: Mapping[str, bool] | None = None
) -> tuple[OnLaw, ...]:
    """What a layer puts on the law of linear elasticity, from the inside out.

    Raises
    ------
    InputError
        If it is not known for this contact, or beside what else the test has (`Stiffening.on`).
    """
    found: list[OnLaw] = []
    if layer.stiffening is not None:
        found.append(layer.stiffening.on(indenter, layer, base, beside or {}))
    if layer.has_sides:
        # Not loaded for a layer without sides.
        from underlay.mechanics.finite_width import sides_of  # noqa: PLC0415  see above

        found.append(sides_of(layer, base, beside or {}))
    return tuple(found)


@dataclass(frozen=True)
class Contact:
    """One indenter on one body.

    Parameters
    ----------
    indenter : Indenter
        Its shape.
    kernel : Kernel
        1 - L(u) of the body, u the wavenumber times `thickness`.
    theta : float
        Elastic constant of the surface (Pa): E / (2 (1 - nu^2)) when isotropic.
    thickness : float, default inf
        Length that makes wavenumbers dimensionless (m): the thickness of the top layer; inf where nothing is
        under it.
    isotropic : IsotropicLayer or None
        The body in engineering constants, where it is an isotropic layer on an isotropic or rigid base; None
        for any other body. Formulas from the literature need it; a solver of the contact problem does not.
    adhesion : Adhesion or None
        What holds tip and surface together; None where nothing does. Solvers know nothing of it: the law of a
        contact with adhesion is built by `Adhesion.law`.
    friction : str
        One of `FRICTIONS`; ``"unknown"`` is computed as ``"none"``.
    beside : tuple of Beside
        Bodies towards which the law's derivatives are wanted; a solver that cannot tell them leaves them aside.
    on_law : tuple of OnLaw
        What is put on the law of linear elasticity, from the inside out; solvers know nothing of it.
    """

    indenter: Indenter
    kernel: Kernel
    theta: float
    thickness: float = np.inf
    isotropic: IsotropicLayer | None = None
    adhesion: Adhesion | None = None
    friction: str = "none"
    beside: tuple[Beside, ...] = ()
    on_law: tuple[OnLaw, ...] = ()

    @classmethod
    def of(cls, indenter: Indenter, layer: Layer, substrate: Body | None) -> Self:
        """Contact with a layer on a substrate or on further layers; None continues the layer."""
        if layer.linear is not layer:
            linear = cls.of(indenter, layer.linear, substrate)
            return replace(linear, on_law=laws_on(indenter, layer, substrate))
        material, thickness = layer.material, layer.thickness
        if substrate is None or thickness == np.inf:
            thickness, substrate = np.inf, material
        layer, under, base = layer.held, tuple(lower.held for lower in substrate.layers), substrate.base
        if under or (layer.bond != "bonded" and np.isfinite(thickness)):
            return cls(indenter, StackKernel((layer, *under), base), material.theta, thickness)
        return cls(
            indenter,
            SubstrateKernel(material, base),
            material.theta,
            thickness,
            IsotropicLayer.of(material, base),
        )

    def simplified(self, max_depth: float, allowed: float) -> tuple[Self, str]:
        """Join the layers of a stack that contacts up to `max_depth` (m) cannot tell apart, and say which.

        The relative change of force, contact radius and stiffness is at most `allowed`; the words are empty where
        nothing is joined.
        """
        found = self.kernel.simpler(float(self.varpi(np.array([max_depth]))[0]), allowed)
        if found is None:
            return self, ""
        top, *under = found.layers
        return type(self).of(self.indenter, top, stacked(under, found.base)), "; ".join(found.said)

    @property
    def sticks(self) -> bool:
        """Whether points of the surface stick to the tip where they touch it."""
        return self.friction == "stuck"

    @property
    def layered(self) -> bool:
        """Whether something under the surface differs from it."""
        return not self.kernel.uniform and bool(np.isfinite(self.thickness))

    def varpi(self, depth: FloatArray) -> FloatArray:
        """Half-space contact radius over thickness at depths (m), same shape; zero without a layer."""
        return self.indenter.halfspace_radius(depth) / self.thickness
