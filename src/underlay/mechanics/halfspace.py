"""The half-space law of Galin and Sneddon: no layer effect at all.

Formula: w = H(a) and P = 4 theta (w a - int_0^a H ds), the first terms of (2.13) and (3.2); dP/dw = 4
theta a. Assumes a frictionless, rigid, axisymmetric indenter on a homogeneous half-space. Source: Sneddon
(1965), doi:10.1016/0020-7225(65)90019-4. Hertz's formula is the paraboloid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import CHOSEN_FOR_DEPTH, ContactLaw
from underlay.mechanics.indenters import FlatPunch, Indenter, PowerLawShape

__all__ = ["HalfspaceLaw", "halfspace_law", "largest_halfspace_depth"]


def largest_halfspace_depth(indenter: Indenter) -> float:
    """Depth (m) at which the contact reaches the end of the indenter's shape; inf where it never does."""
    if isinstance(indenter, FlatPunch) or not np.isfinite(indenter.max_radius):
        return np.inf
    return float(indenter.abel(np.array(indenter.max_radius)))


@dataclass(frozen=True, kw_only=True)
class HalfspaceLaw(ContactLaw):
    """Galin-Sneddon contact on a homogeneous half-space.

    Parameters
    ----------
    indenter : Indenter
        Its shape.
    theta : float
        Elastic constant of the half-space (Pa): E / (2 (1 - nu^2)) when isotropic.
    """

    indenter: Indenter
    theta: float

    @property
    def _beyond(self) -> str:
        if self.max_depth < largest_halfspace_depth(self.indenter):
            return CHOSEN_FOR_DEPTH
        return "the contact would reach the end of the indenter's shape; use a larger radius or less depth"

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.indenter.halfspace_radius(depth)

    def _force(self, depth: FloatArray) -> FloatArray:
        radius = self.indenter.halfspace_radius(depth)
        if isinstance(self.indenter, PowerLawShape):
            exponent = self.indenter.exponent
            return 4.0 * self.theta * exponent / (exponent + 1.0) * depth * radius
        return 4.0 * self.theta * (depth * radius - self.indenter.abel_moments(radius)[0])

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return 4.0 * self.theta * self.indenter.halfspace_radius(depth)


def halfspace_law(contact: Contact) -> HalfspaceLaw:
    """Build the law of a half-space of what the indenter touches, whatever is under it."""
    return HalfspaceLaw(
        method="halfspace",
        reason="the layer is taken as a half-space" if contact.layered else "no layer effect: a half-space",
        max_depth=largest_halfspace_depth(contact.indenter),
        error_estimate=0.0,
        indenter=contact.indenter,
        theta=contact.theta,
    )
