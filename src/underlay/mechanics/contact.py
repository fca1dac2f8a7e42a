"""A contact as solvers see it: an indenter, a kernel and a surface modulus, not the materials behind them.

The frictionless contact problem depends on the body under the indenter through two things alone: the elastic
constant theta of its surface, and the kernel 1 - L(u) that says how the rest of the body changes the surface
compliance with the wavenumber. So a solver works for every body that has a kernel. This module also has the
interfaces of adhesion models: `Adhesion`, the tables they make, and what they need of a solver (`BuildsElastic`).
"""

from __future__ import annotations

import warnings
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


class BuildsElastic(Protocol):
    """What an adhesion model needs of a solver: its accuracy, and the law without adhesion."""

    sees_base: ClassVar[bool]

    @property
    def name(self) -> str:
        """Name of the solver in tables and messages."""

    @property
    def tolerance(self) -> float:
        """Relative error against the exact contact problem; zero where the solver promises none."""

    def law(self, contact: Contact, max_depth: float) -> ContactLaw:
        """Law of a contact without adhesion for depths up to `max_depth` (m)."""


class AdhesiveReadings(NamedTuple):
    """Contact force (N) and stiffness dP/dw (N/m), each (sets, n), and a mask (sets,) of the sets computed."""

    force: FloatArray
    stiffness: FloatArray
    possible: NDArray[np.bool_]

    @classmethod
    def empty(cls, sets: int, points: int) -> Self:
        """Arrays of zeros for `sets` sets of `points` points, none of them computed yet."""
        return cls(np.zeros((sets, points)), np.zeros((sets, points)), np.zeros(sets, dtype=bool))


class AdhesionTable(ABC):
    """Table of adhesive contacts: any work of adhesion, and a range of one ratio of the body where that varies.

    It gives force and stiffness of many parameter sets at once.
    """

    @abstractmethod
    def readings(
        self, work: FloatArray, travel: FloatArray, compliance: FloatArray, ratio: FloatArray | None
    ) -> AdhesiveReadings:
        """Force and stiffness of many sets at given travels.

        Parameters
        ----------
        work : FloatArray
            Works of adhesion (J/m^2), (sets,).
        travel : FloatArray
            Depth plus the spring's deflection (m), since contact, (sets, n), in the order they are reached.
        compliance : FloatArray
            Of the spring (m/N), (sets,); zero where the depth itself is given.
        ratio : FloatArray or None
            Values of the ratio on which the contact depends, (sets,); None where it is the same for all.

        Returns
        -------
        AdhesiveReadings
            Sets outside the table's range are marked as not possible; the caller then builds a law for each.
        """

    @abstractmethod
    def pull_offs(self, work: FloatArray, ratio: FloatArray | None) -> FloatArray:
        """Pull-off force (N, positive, under load control) and depth (m, under depth control), (2, sets).

        For works of adhesion (J/m^2) and values of the ratio, each (sets,); NaN outside the table's range.
        """


class Adhesion(Part, ABC):
    """Model of the adhesion between tip and surface; its parameters have paths that begin with ``adhesion.``.

    A concrete class names itself in `model`; scene files know it by that name.
    """

    parts: ClassVar[tuple[str, ...]] = ("adhesion",)
    chosen_by: ClassVar[str] = "model"
    #: Name in scene files.
    model: ClassVar[str] = ""

    @property
    def short_ranged(self) -> Adhesion:
        """The model with the same work of adhesion and an attraction of zero range (JKR), where it has a range."""
        return self

    def about_range(self, contact: Contact, solver: BuildsElastic) -> str:
        """Sentence on the range of the attraction for which the model holds in this contact; "" if unknown."""
        del contact, solver
        return ""

    def table(
        self, contact: Contact, contact_at: Callable[[float], Contact], solver: BuildsElastic
    ) -> AdhesionTable | None:
        """Table of contacts like this one at any work of adhesion; None where the model has none.

        `contact_at` maps a value of the one ratio of moduli that may vary to the contact there.
        """
        del contact, contact_at, solver
        return None

    @abstractmethod
    def law(self, contact: Contact, max_depth: float, solver: BuildsElastic) -> ContactLaw:
        """Law of an adhesive contact for depths up to `max_depth` (m); `solver` gives the law without adhesion."""


@dataclass(frozen=True)
class IsotropicLayer:
    """A layer and its base in engineering constants, as formulas of the literature need them.

    Parameters
    ----------
    layer : Isotropic
        Material of the layer.
    base : Isotropic or None
        Material it is bonded to; None is rigid.
    """

    layer: Material
    base: Material | None

    @classmethod
    def of(cls, layer: Material, base: Base) -> Self | None:
        """Layer and base in engineering constants; None where either is anisotropic."""
        if not (layer.isotropic and base.isotropic):
            return None
        return cls(layer, base if isinstance(base, Material) else None)


class Variant(NamedTuple):
    """A body that differs from a contact's by a small step in one parameter s, for the derivative in s.

    Parameters
    ----------
    kernel : Kernel
        Of that body.
    log_theta : float
        ln of its elastic constant theta over the contact's.
    step : float
        The step in s, small enough for a difference of kernels to be their derivative.
    thickness : float, default 1
        Its thickness over the contact's: the kernel is one of u, the wavenumber times its own.
    """

    kernel: Kernel
    log_theta: float
    step: float
    thickness: float = 1.0


def laws_on(
    indenter: Indenter, layer: Layer, base: Body | None, effects: Mapping[str, bool] | None = None
) -> tuple[OnLaw, ...]:
    """Modifications of the linear elastic law for a layer: stiffening, then free sides; inner ones first.

    Parameters
    ----------
    indenter : Indenter
        Shape of the tip.
    layer : Layer
        The layer, which may stiffen or have free sides.
    base : Body or None
        What it stands on.
    effects : mapping, optional
        Other effects of the test, by name (friction, adhesion, history, ...), each with whether it is present.

    Raises
    ------
    InputError
        If a modification is not known for this contact, or not together with one of these effects.
    """
    found: list[OnLaw] = []
    if layer.stiffening is not None:
        found.append(layer.stiffening.on(indenter, layer, base, effects or {}))
    if layer.has_sides:
        # Not loaded for a layer without sides.
        from underlay.mechanics.finite_width import sides_of  # noqa: PLC0415  see above

        found.append(sides_of(layer, base, effects or {}))
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
        Model of the adhesion; None without adhesion. Solvers ignore it: the law of a
        contact with adhesion is built by `Adhesion.law`.
    friction : str
        One of `FRICTIONS`; ``"unknown"`` is computed as ``"none"``.
    variants : tuple of Variant
        Bodies a small step away in one parameter each, for derivatives of the force; solvers without such
        derivatives ignore them.
    on_law : tuple of OnLaw
        Modifications of the linear elastic law, inner ones first; solvers ignore them.
    """

    indenter: Indenter
    kernel: Kernel
    theta: float
    thickness: float = np.inf
    isotropic: IsotropicLayer | None = None
    adhesion: Adhesion | None = None
    friction: str = "none"
    variants: tuple[Variant, ...] = ()
    on_law: tuple[OnLaw, ...] = ()

    @classmethod
    def of(cls, indenter: Indenter, layer: Layer, substrate: Body | None) -> Self:
        """Contact with a layer on a substrate or on further layers; `substrate` None: the layer is a half-space."""
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
        """The contact with layers merged that depths up to `max_depth` (m) cannot tell apart, and a message.

        The relative change of force, contact radius and stiffness is at most `allowed`. The message names the
        layers merged; it is empty where none are.
        """
        found = self.kernel.simpler(float(self.varpi(np.array([max_depth]))[0]), allowed)
        if found is None:
            return self, ""
        top, *under = found.layers
        return type(self).of(self.indenter, top, stacked(under, found.base)), "; ".join(found.said)

    @property
    def beside(self) -> tuple[Variant, ...]:
        """The bodies of `variants`.

        .. deprecated:: 0.2
            Use `variants`.
        """
        warnings.warn("Contact.beside is now Contact.variants", DeprecationWarning, stacklevel=2)
        return self.variants

    @property
    def sticks(self) -> bool:
        """Whether there is full friction: no point of the surface slides along the tip."""
        return self.friction == "stuck"

    @property
    def layered(self) -> bool:
        """Whether the body differs from a half-space of the surface's material."""
        return not self.kernel.uniform and bool(np.isfinite(self.thickness))

    def varpi(self, depth: FloatArray) -> FloatArray:
        """Half-space contact radius over thickness at depths (m), same shape; zero without a layer."""
        return self.indenter.halfspace_radius(depth) / self.thickness
