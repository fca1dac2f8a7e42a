"""Laws by their solver, from an indenter, a layer and a substrate: what most tests of laws begin with."""

from __future__ import annotations

import underlay as ul


def exact_law(
    indenter: ul.Indenter, layer: ul.Layer, substrate: object, *, max_depth: float, rtol: float = 1e-6
) -> ul.ContactLaw:
    return ul.Exact(rtol).build(ul.Contact.of(indenter, layer, substrate), max_depth)


def asymptotic_law(
    indenter: ul.Indenter,
    layer: ul.Layer,
    substrate: object,
    max_depth: float,
    *,
    order: int = 4,
    form: str = "auto",
) -> ul.ContactLaw:
    return ul.Asymptotic(order, form).build(ul.Contact.of(indenter, layer, substrate), max_depth)


def published_law(
    correction: object, indenter: ul.Indenter, layer: ul.Layer, substrate: object, max_depth: float
) -> ul.ContactLaw:
    return ul.Published(correction).build(ul.Contact.of(indenter, layer, substrate), max_depth)
