"""Numbers for what a contact law leaves out: friction, finite strain, and friction in large strains.

The force is P (1 + s (P_stuck/P - 1) + A e + B g), with P the law without friction in small strains, P_stuck that
of a tip without slip, e the computed relative excess of the force by finite strain, and g that by friction in large
strains alone (`mechanics/finite_strain`); s = 0 is frictionless, s = 1 is without slip, A = 1 is a neo-Hookean
layer, and B the size of what friction adds to it beyond s. None is known: they are parameters with priors
(`free_model_error`), or left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from underlay._arrays import FloatArray, finite
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepancy import (
    DiscrepantLaw,
    finite_strain_excess,
    friction_in_large_strains,
    require_measured,
)
from underlay.mechanics.solver import Solver
from underlay.quantities import Part, field_quantities, quantity

#: Paths of the three numbers s, A and B.
FRICTION_PATH, FINITE_STRAIN_PATH = "discrepancy.friction", "discrepancy.finite_strain"
BOTH_PATH = "discrepancy.friction_in_large_strains"


@dataclass(frozen=True)
class Discrepancy(Part):
    """Sizes of friction and finite strain beyond the contact law of a scene.

    Parameters
    ----------
    friction : float
        Share of the effect of full friction: 0 is frictionless, 1 without slip.
    finite_strain : float
        Effect of finite strain, over that of a neo-Hookean layer; zero where its shape is not known.
    friction_in_large_strains : float, default 0
        Effect of friction that appears in large strains only; zero where its shape is not known.
    """

    parts: ClassVar[tuple[str, ...]] = ("discrepancy",)

    friction: float = field(
        metadata=quantity("dimensionless", "share of full friction", symbol="s", natural_scale=0.5)
    )
    finite_strain: float = field(
        metadata=quantity(
            "dimensionless", "finite strain over the neo-Hookean one", symbol="A", natural_scale=0.5
        )
    )

    friction_in_large_strains: float = field(
        default=0.0,
        metadata=quantity(
            "dimensionless",
            "what friction adds in large strains over the measured shape",
            symbol="B",
            natural_scale=0.5,
        ),
    )

    def __post_init__(self) -> None:
        for name in field_quantities(self):
            object.__setattr__(self, name, finite(getattr(self, name), f"discrepancy {name}", ""))

    def law(self, contact: Contact, solver: Solver, build: Callable[[Solver], ContactLaw]) -> DiscrepantLaw:
        """Law of a contact with this discrepancy; `build` makes the frictionless or stuck law of a solver.

        The law raises `InputError` at depths where the effect of large strains was not computed.

        Raises
        ------
        InputError
            If the solver has no law for a tip without slip.
        """
        free = build(solver)
        sticks = build(solver.without_slip) if self.friction or self.friction_in_large_strains else None

        def excess(depth: FloatArray) -> FloatArray:
            require_measured(contact, float(depth.max()), FINITE_STRAIN_PATH)
            return finite_strain_excess(contact, depth, free.contact_radius(depth))

        def further(stuck: FloatArray, slides: FloatArray, depth: FloatArray) -> FloatArray:
            require_measured(contact, float(depth.max()), BOTH_PATH)
            return friction_in_large_strains(contact, stuck, slides, depth)

        return DiscrepantLaw.of(
            free, sticks, (self.friction, self.finite_strain, self.friction_in_large_strains), excess, further
        )
