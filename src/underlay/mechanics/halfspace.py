"""The half-space law of Galin and Sneddon: no layer effect at all.

Formula: w = H(a) and P = 4 theta (w a - int_0^a H ds), the first terms of (2.13) and (3.2); dP/dw = 4 theta a,
with depth w, force P, contact radius a, H the half-space depth function of the shape and theta the elastic
constant of the half-space. Assumes a frictionless, rigid, axisymmetric indenter on a homogeneous half-space.
Source: Sneddon (1965), doi:10.1016/0020-7225(65)90019-4. Hertz's formula is the paraboloid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import CHOSEN_FOR_DEPTH, ContactLaw
from underlay.mechanics.indenters import Indenter

# The layer's effect on force, contact radius and stiffness at a given depth. Over contrast: a theorem bounds that
# on the force by about 1, the others move by up to twice as much. Over contrast times varpi over the decay rate,
# where that is small: at most 1.6 for 400 random pairs of isotropic and anisotropic materials, flat punch to
# cone. Both are measured again in tests/test_solvers.py.
_CONTRAST_MARGIN, _SHALLOW_MARGIN = 4.0, 2.0
_LARGEST_SHALLOW = 0.02


def largest_halfspace_depth(indenter: Indenter) -> float:
    """Depth (m) at which the contact reaches the end of the indenter's shape; inf where it never does."""
    if indenter.has_edge or not np.isfinite(indenter.max_radius):
        return np.inf
    return float(indenter.abel(np.array(indenter.max_radius)))


def layer_effect(contact: Contact, max_depth: float) -> float:
    """Bound on the relative change of force, radius and stiffness by what is under the surface.

    Holds for depths up to `max_depth` (m); zero for a half-space.
    """
    if not contact.layered or not max_depth > 0.0:
        return 0.0
    contrast = contact.kernel.contrast
    varpi = float(contact.varpi(np.array([min(max_depth, largest_halfspace_depth(contact.indenter))]))[0])
    shallow = contrast * _SHALLOW_MARGIN * varpi / contact.kernel.decay
    anywhere = contrast * _CONTRAST_MARGIN
    return min(anywhere, shallow) if shallow <= _LARGEST_SHALLOW else anywhere


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
        return 4.0 * self.theta * self.indenter.halfspace_force(depth, self.indenter.halfspace_radius(depth))

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        radius = self.indenter.halfspace_radius(depth)
        return 4.0 * self.theta * np.stack((self.indenter.halfspace_force(depth, radius), radius))

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return 4.0 * self.theta * self.indenter.halfspace_radius(depth)


def halfspace_law(contact: Contact, max_depth: float = 0.0) -> HalfspaceLaw:
    """Build the law of a half-space of the surface's material, ignoring what is under it.

    It reaches to the end of the indenter's shape; its error estimate is for depths up to `max_depth` (m).
    """
    return HalfspaceLaw(
        method="halfspace",
        reason="the layer is taken as a half-space" if contact.layered else "no layer effect: a half-space",
        max_depth=largest_halfspace_depth(contact.indenter),
        error_estimate=layer_effect(contact, max_depth),
        indenter=contact.indenter,
        theta=contact.theta,
    )
