"""The flat punch that sticks: straight down to a pull-off at which it comes off at once.

Formula: `jkr_law` with w_el = P_el = 0 and the radius fixed, P = 4 theta a kappa w down to
w = -sqrt(pi a dgamma/theta)/g(1). On a half-space: Kendall (1971), J. Phys. D 4, 1186.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.adhesion.radius_relation import largest_radius, punch_factors
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw

__all__ = ["AdhesivePunchLaw", "adhesive_punch_law"]


@dataclass(frozen=True, kw_only=True)
class AdhesivePunchLaw(ContactLaw):
    """A flat punch with adhesion.

    Parameters
    ----------
    radius : float
        Of the punch (m).
    incremental : float
        dP/dw (N/m).
    pull_off_depth : float
        Depth (m), negative, at which it comes off, whether depth or load is given.
    """

    radius: float
    incremental: float
    pull_off_depth: float

    @property
    def pull_off_force(self) -> float:
        """Tension (N, positive) at which it comes off."""
        return -self.incremental * self.pull_off_depth

    @property
    def zero_load_radius(self) -> float:
        """The punch's (m)."""
        return self.radius

    @property
    def domain(self) -> tuple[float, float]:
        """From the pull-off to `max_depth` (m)."""
        return self.pull_off_depth, self.max_depth

    def work_slope(self, depth: FloatArray) -> FloatArray:
        """dP/d ln dgamma (N) at fixed depth: zero, the work moves the pull-off alone."""
        return np.zeros_like(depth)

    @property
    def _beyond(self) -> str:
        return "the law was asked for up to there; build it with a larger max_depth"

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.incremental * depth

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return np.full_like(depth, self.radius)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return np.full_like(depth, self.incremental)


def adhesive_punch_law(contact: Contact, work: float, max_depth: float, rtol: float) -> AdhesivePunchLaw:
    """Build the law of a punch on `contact`'s body.

    Raises
    ------
    RangeError
        If the punch is wider than 20 thicknesses.
    """
    radius = contact.indenter.max_radius
    if radius > 20.0 * contact.thickness and contact.layered:
        raise RangeError(
            f"the punch's radius is {radius / contact.thickness:.4g} layer thicknesses, and "
            f"{largest_radius(contact) / contact.thickness:g} is the most that works here: use a smaller punch or, "
            "for contacts wider still, the half-space law of the substrate"
        )
    kappa, edge = punch_factors(contact, radius, rtol)
    return AdhesivePunchLaw(
        method="exact" if contact.layered else "halfspace",
        reason="JKR (Kendall) with a flat punch",
        max_depth=max_depth,
        error_estimate=rtol if contact.layered else 0.0,
        radius=radius,
        incremental=4.0 * contact.theta * radius * kappa,
        pull_off_depth=-float(np.sqrt(np.pi * radius * work / contact.theta)) / edge,
    )
