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


def _contact_size(contact: LayerContact, depth: float) -> float:
    return contact.size_at(depth)


def _layer_nu(contact: LayerContact, _depth: float) -> float:
    return contact.layer.nu


def _base_nu(contact: LayerContact, _depth: float) -> float:
    return contact.elastic_base.nu


def _modulus_ratio(contact: LayerContact, _depth: float) -> float:
    return contact.modulus_ratio


def _radius_ratio(contact: LayerContact, _depth: float) -> float:
    return contact.radius_ratio


def _depth_ratio(contact: LayerContact, depth: float) -> float:
    return depth / contact.thickness


def _depth_over_radius(contact: LayerContact, depth: float) -> float:
    return depth / (contact.radius_ratio * contact.thickness)


#: The contact size that a factor depends on, by kind of indenter.
VARIABLES = {
    "sphere": Quantity("X = sqrt(R d)/h", _contact_size),
    "cone": Quantity("y = d tan(half-angle)/h", _contact_size),
    "flat punch": Quantity("eps = a/h", _contact_size),
}
LAYER_NU = Quantity("nu of the layer", _layer_nu)
BASE_NU = Quantity("nu of the base", _base_nu)
MODULUS_RATIO = Quantity("E of the base over E of the layer", _modulus_ratio)
RADIUS_RATIO = Quantity("R/h", _radius_ratio)
DEPTH_RATIO = Quantity("d/h", _depth_ratio)
DEPTH_OVER_RADIUS = Quantity("d/R", _depth_over_radius)

#: What the error of a correction for an elastic base is measured at.
MATERIALS = (MODULUS_RATIO, LAYER_NU, BASE_NU)
