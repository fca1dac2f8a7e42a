"""Samples of finite width: plugs, wells and slices with free sides."""

from underlay.mechanics.finite_width.compliance import (
    equivalent_radius,
    is_wide,
    kappa,
    share_of_sides,
    standard_error,
    why_sides_matter,
)
from underlay.mechanics.finite_width.law import NarrowLaw, Sides, sides_at, sides_of

__all__ = [
    "NarrowLaw",
    "Sides",
    "equivalent_radius",
    "is_wide",
    "kappa",
    "share_of_sides",
    "sides_at",
    "sides_of",
    "standard_error",
    "why_sides_matter",
]
