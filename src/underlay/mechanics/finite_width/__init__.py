"""Samples of finite width: plugs, wells and slices with free sides.

`compliance` has the compliance that free sides add, `law` the law of a layer with them.
"""

from underlay.mechanics.finite_width.compliance import (
    equivalent_radius,
    is_wide,
    kappa,
    standard_error,
)
from underlay.mechanics.finite_width.law import NarrowLaw, Sides, sides_at, sides_of, why_not_ignored

__all__ = [
    "NarrowLaw",
    "Sides",
    "equivalent_radius",
    "is_wide",
    "kappa",
    "sides_at",
    "sides_of",
    "standard_error",
    "why_not_ignored",
]
