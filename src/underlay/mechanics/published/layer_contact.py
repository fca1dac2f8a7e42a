"""What a published formula sees of a test: the tip's one length, the layer's thickness, two materials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.body import Material
from underlay.mechanics.halfspace import HalfspaceLaw
from underlay.mechanics.indenters import Cone, FlatPunch, Indenter, Paraboloid, Sphere

__all__ = ["KINDS", "LayerContact", "kind_of", "tip_of"]

#: The three kinds of indenter the literature corrects for, and the library's indenters of each kind.
KINDS = {
    "sphere": (Paraboloid, Sphere),
    "cone": (Cone,),
    "flat punch": (FlatPunch,),
}


def kind_of(indenter: Indenter) -> str | None:
    """Name `indenter` as the literature does, None where it has no correction for such a shape."""
    for kind, shapes in KINDS.items():
        if isinstance(indenter, shapes):
            return kind
    return None


def tip_of(indenter: Indenter) -> Paraboloid | Cone | FlatPunch:
    """Give the tip that a correction was made for: a true sphere becomes the paraboloid of its radius.

    Raises
    ------
    InputError
        If the literature has no correction for the shape.
    """
    if isinstance(indenter, Sphere):
        return Paraboloid(indenter.radius)
    if isinstance(indenter, Paraboloid | Cone | FlatPunch):
        return indenter
    raise InputError(f'no published correction is for {indenter!r}; the solver "exact" takes every shape')


@dataclass(frozen=True, kw_only=True)
class LayerContact:
    """One indenter on one layer and base, in the terms of the published corrections.

    Parameters
    ----------
    indenter : Paraboloid, Cone or FlatPunch
        Depth is measured from first contact and a cone's half-angle from its axis, in radians. The
        literature's sphere is Hertz's paraboloid.
    thickness : float
        Layer thickness h (m), finite.
    layer : Material
        Material of the layer.
    base : Material or None
        What the layer lies on; None is rigid.
    """

    indenter: Paraboloid | Cone | FlatPunch
    thickness: float
    layer: Material
    base: Material | None

    @property
    def halfspace(self) -> HalfspaceLaw:
        """The force without the base: Hertz's, Sneddon's or Boussinesq's law, E/(1 - nu^2) of the layer."""
        return HalfspaceLaw(
            method="halfspace",
            reason="the layer alone, as if endlessly thick",
            max_depth=np.inf,
            error_estimate=np.inf,
            indenter=self.indenter,
            theta=self.layer.theta,
        )

    @property
    def exponent(self) -> float:
        """The power q of u ~ d^q: 1/2 for a sphere, 1 for a cone, 0 for a flat punch."""
        if isinstance(self.indenter, Paraboloid):
            return 0.5
        return 1.0 if isinstance(self.indenter, Cone) else 0.0

    def variable(self, depth: FloatArray) -> FloatArray:
        """Measure the contact against the layer as the literature does; shape of `depth` (m).

        X = sqrt(R d)/h for a sphere, y = d tan(half-angle)/h for a cone, eps = a/h for a flat punch.
        """
        if isinstance(self.indenter, Paraboloid):
            return np.asarray(np.sqrt(self.indenter.radius * depth) / self.thickness)
        if isinstance(self.indenter, Cone):
            return np.asarray(depth * np.tan(self.indenter.half_angle) / self.thickness)
        return np.full_like(depth, self.indenter.radius / self.thickness)

    def size_at(self, depth: float) -> float:
        """Give `variable` at one depth (m)."""
        return float(self.variable(np.array([depth]))[0])

    @property
    def radius_ratio(self) -> float:
        """R/h or a/h; a cone has none."""
        if isinstance(self.indenter, Cone):
            raise TypeError("a cone has no radius")
        return self.indenter.radius / self.thickness

    @property
    def elastic_base(self) -> Material:
        """The base, known to be elastic."""
        if self.base is None:
            raise TypeError("the base is rigid")
        return self.base

    @property
    def modulus_ratio(self) -> float:
        """Young's modulus of the base over that of the layer, inf for a rigid base."""
        return np.inf if self.base is None else self.base.E / self.layer.E

    @property
    def reduced_modulus_ratio(self) -> float:
        """E/(1 - nu^2) of the base over that of the layer, inf for a rigid base."""
        return np.inf if self.base is None else self.base.theta / self.layer.theta
