"""Laws by their solver, from an indenter, a layer and a substrate: what most tests of laws begin with."""

from __future__ import annotations

from underlay.mechanics.body import Base, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.solvers import Asymptotic, Exact, Published


def exact_law(
    indenter: Indenter, layer: Layer, substrate: Base | None, *, max_depth: float, rtol: float = 1e-6
) -> ContactLaw:
    return Exact(rtol).build(Contact.of(indenter, layer, substrate), max_depth)


def asymptotic_law(
    indenter: Indenter,
    layer: Layer,
    substrate: Base | None,
    max_depth: float,
    *,
    order: int = 4,
    form: str = "auto",
) -> ContactLaw:
    return Asymptotic(order, form).build(Contact.of(indenter, layer, substrate), max_depth)


def published_law(
    correction: object, indenter: Indenter, layer: Layer, substrate: Base, max_depth: float
) -> ContactLaw:
    return Published(correction).build(Contact.of(indenter, layer, substrate), max_depth)
