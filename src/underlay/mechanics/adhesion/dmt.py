"""Derjaguin, Muller and Toporov: attraction outside of a contact that adhesion does not deform.

Formula: P = P_el(w) - 2 pi R dgamma, a = a_el(w). The attraction acts across the gap of the undeformed shapes
(Derjaguin's approximation), so that the layer does not enter. Range: tips whose apex is a paraboloid, and an
attraction that reaches far against the elastic deformation at the edge. On a thin incompressible layer JKR's
pull-off, up to 3 pi R dgamma, passes this one: the order known from the half-space is reversed. Behind a spring the
tip is one that was pressed in and is withdrawn: it holds on until the depth is zero.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError
from underlay.mechanics.adhesion.jkr import WORK
from underlay.mechanics.contact import Adhesion, BuildsElastic, Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Paraboloid, Sphere

__all__ = ["DMT", "DMTLaw"]


@dataclass(frozen=True, kw_only=True)
class DMTLaw(ContactLaw):
    """An elastic law less a constant attraction while there is contact.

    Parameters
    ----------
    elastic : ContactLaw
        The law without adhesion.
    attraction : float
        The pull (N, positive): 2 pi R dgamma.
    """

    elastic: ContactLaw
    attraction: float

    def work_slope(self, depth: FloatArray) -> FloatArray:
        """dP/d ln dgamma (N) at fixed depth, (n,), at depths (m)."""
        return np.where(depth > 0.0, -self.attraction, 0.0)

    @property
    def nodes(self) -> int | None:
        """Those of the elastic law."""
        return self.elastic.nodes

    @property
    def _beyond(self) -> str:
        return self.elastic._beyond  # noqa: SLF001  the law behind this one

    @property
    def _least_force(self) -> float:
        return -self.attraction

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.elastic._force(depth) - self.attraction  # noqa: SLF001  as above

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.elastic._contact_radius(depth)  # noqa: SLF001  as above

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return self.elastic._stiffness(depth)  # noqa: SLF001  as above


@dataclass(frozen=True)
class DMT(Adhesion):
    """Long-ranged adhesion of a paraboloid or sphere, as Derjaguin, Muller and Toporov take it.

    Parameters
    ----------
    work : float
        Work of adhesion (J/m^2), positive.
    """

    model: ClassVar[str] = "dmt"

    work: float = field(metadata=WORK)

    def __post_init__(self) -> None:
        object.__setattr__(self, "work", positive(self.work, "work of adhesion", "J/m^2"))

    def law(self, contact: Contact, max_depth: float, solver: BuildsElastic) -> ContactLaw:
        """Build the law for depths up to `max_depth` (m).

        Raises
        ------
        InputError
            If the tip's apex is not a paraboloid.
        """
        tip = contact.indenter
        if not isinstance(tip, Paraboloid | Sphere):
            raise InputError(
                f"DMT has no pull-off force for a {type(tip).__name__}: 2 pi R work holds for a paraboloid or a "
                "sphere; use JKR(work), or Maugis(work, range) for an attraction of finite range"
            )
        attraction = 2.0 * float(np.pi) * tip.radius * self.work
        elastic = _elastic(replace(contact, adhesion=None), max_depth, attraction, tip.radius, solver)
        return DMTLaw(
            method=elastic.method,
            reason=f"DMT; {elastic.reason}",
            max_depth=elastic.max_depth,
            error_estimate=elastic.error_estimate,
            warnings=elastic.warnings,
            elastic=elastic,
            attraction=attraction,
        )


def _elastic(
    contact: Contact, max_depth: float, attraction: float, radius: float, solver: BuildsElastic
) -> ContactLaw:
    """Elastic law that reaches `max_depth` (m), and the depth at which it balances the attraction (N)."""
    balanced = (3.0 * attraction / (8.0 * contact.theta * np.sqrt(radius))) ** (2.0 / 3.0)  # on a half-space
    depth = max(max_depth, float(balanced))
    law = solver.law(contact, depth)
    while float(law.force(depth)) < attraction:
        depth *= 2.0
        law = solver.law(contact, depth)
    return law
