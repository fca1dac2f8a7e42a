"""The quantities of a test that a published correction sets ranges for, or was measured at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from underlay.mechanics.published.layer_contact import LayerContact

__all__ = [
    "BASE_NU",
    "DEPTH_OVER_RADIUS",
    "DEPTH_RATIO",
    "LAYER_NU",
    "MATERIALS",
    "MODULUS_RATIO",
    "RADIUS_RATIO",
    "VARIABLES",
    "Quantity",
]


@dataclass(frozen=True)
class Quantity:
    """A dimensionless number of a test, with its name.

    Parameters
    ----------
    name : str
        What it is, as a reader says it.
    of : callable
        Its value from a `LayerContact` and the largest depth (m).
    """

    name: str
    of: Callable[[LayerContact, float], float] = field(repr=False)


#: The contact size that a factor depends on, by kind of indenter.
VARIABLES = {
    "sphere": Quantity("X = sqrt(R d)/h", lambda contact, depth: contact.size_at(depth)),
    "cone": Quantity("y = d tan(half-angle)/h", lambda contact, depth: contact.size_at(depth)),
    "flat punch": Quantity("eps = a/h", lambda contact, depth: contact.size_at(depth)),
}
LAYER_NU = Quantity("nu of the layer", lambda contact, _depth: contact.layer.nu)
BASE_NU = Quantity("nu of the base", lambda contact, _depth: contact.elastic_base.nu)
MODULUS_RATIO = Quantity("E of the base over E of the layer", lambda contact, _depth: contact.modulus_ratio)
RADIUS_RATIO = Quantity("R/h", lambda contact, _depth: contact.radius_ratio)
DEPTH_RATIO = Quantity("d/h", lambda contact, depth: depth / contact.thickness)
DEPTH_OVER_RADIUS = Quantity("d/R", lambda contact, depth: depth / (contact.radius_ratio * contact.thickness))

#: What the error of a correction for an elastic base is measured at.
MATERIALS = (MODULUS_RATIO, LAYER_NU, BASE_NU)
