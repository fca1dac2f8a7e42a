"""The one knob: how close to the exact contact problem, and which solver keeps it.

`contact_law` is the door to the mechanics: it builds the law a caller names, or with ``method="auto"``
the cheapest one that keeps `Accuracy`, and says which and why.
"""

from __future__ import annotations

from dataclasses import dataclass

from underlay._arrays import finite
from underlay.errors import InputError
from underlay.mechanics.asymptotic.law import asymptotic_law
from underlay.mechanics.automatic import automatic_law, halfspace_law
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.materials import Layer, Substrate
from underlay.mechanics.published import PublishedCorrection, published_law, published_names

__all__ = ["Accuracy", "contact_law"]

METHODS = ("auto", "halfspace", "asymptotic", "exact")


@dataclass(frozen=True)
class Accuracy:
    """How close a law must stay to the exact contact problem.

    Parameters
    ----------
    rtol : float, default 1e-6
        Relative error allowed in force, contact radius and stiffness, between 1e-12 and 0.5. For fitting,
        a tenth of the relative noise is enough; tighter costs little with the exact law.
    """

    rtol: float = 1e-6

    def __post_init__(self) -> None:
        rtol = finite(self.rtol, "rtol", "relative error")
        if not (1e-12 <= rtol <= 0.5):
            raise InputError(f"rtol must be between 1e-12 and 0.5; got {self.rtol!r}")
        object.__setattr__(self, "rtol", rtol)


def contact_law(
    indenter: Indenter,
    layer: Layer,
    substrate: Substrate | None = None,
    *,
    max_depth: float,
    accuracy: Accuracy | None = None,
    method: str | PublishedCorrection = "auto",
    order: int = 4,
    form: str = "auto",
) -> ContactLaw:
    """Build the law of an indenter on a layer on a substrate.

    Parameters
    ----------
    indenter : Indenter
        Its shape.
    layer : Layer
        Material and thickness.
    substrate : material, RIGID or None
        What the layer is bonded to; None for a half-space of the layer.
    max_depth : float
        Largest indentation depth (m) that will be asked.
    accuracy : Accuracy, optional
        How close to the exact contact problem; used by ``"exact"`` and ``"auto"``.
    method : str or PublishedCorrection, default "auto"
        ``"halfspace"``, ``"asymptotic"``, ``"exact"``, the name of a published correction (see
        `published_corrections`) or one of your own, or ``"auto"``: the cheapest that keeps `accuracy`.
    order, form
        Of the asymptotic law; see `asymptotic_law`.

    Returns
    -------
    ContactLaw
        With `method`, `reason`, `error_estimate` and `max_depth`.

    Raises
    ------
    RangeError
        If the law cannot reach `max_depth`.
    InputError
        If the method is unknown or a published correction does not cover this contact.
    """
    wanted = accuracy or Accuracy()
    deepest = finite(max_depth, "max_depth", "m")
    if method == "auto":
        return automatic_law(indenter, layer, substrate, deepest, wanted.rtol)
    if method == "halfspace":
        return halfspace_law(indenter, layer)
    if method == "asymptotic":
        return asymptotic_law(indenter, layer, substrate, deepest, order=order, form=form)
    if method == "exact":
        return exact_law(indenter, layer, substrate, max_depth=deepest, rtol=wanted.rtol)
    if isinstance(method, PublishedCorrection) or method in published_names():
        if substrate is None:
            raise InputError(
                f"{method} needs a substrate; got None. method='halfspace' is the law without one"
            )
        return published_law(method, indenter, layer, substrate, deepest)
    raise InputError(f"unknown method {method!r}; known: {', '.join((*METHODS, *published_names()))}")
