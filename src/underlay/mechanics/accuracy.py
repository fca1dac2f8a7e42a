"""The one knob: how close to the exact contact problem, and which solver keeps it.

`contact_law` is the door to the mechanics: it builds the law a caller names, or with ``method="auto"``
the cheapest one that keeps `Accuracy`, and says which and why.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import as_finite, finite
from underlay.errors import InputError
from underlay.mechanics.asymptotic import asymptotic_law
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.halfspace import HalfspaceLaw, largest_halfspace_depth
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.materials import Layer, Substrate

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
    method: str = "auto",
    order: int = 4,
    form: str = "auto",
) -> ContactLaw:
    """Build the law of an indenter on a layer on a substrate, for depths up to `max_depth` (m)."""
    deepest = as_finite(max_depth, "max_depth")
    no_layer = substrate is None or substrate == layer.material or not np.isfinite(layer.thickness)
    if method == "halfspace" or (method == "auto" and no_layer):
        return halfspace_law(indenter, layer)
    if method in ("asymptotic", "auto"):
        return asymptotic_law(indenter, layer, substrate, float(deepest), order=order, form=form)
    raise InputError(f"unknown method {method!r}; known: {', '.join(METHODS)}")


def halfspace_law(indenter: Indenter, layer: Layer) -> HalfspaceLaw:
    """Build the law of a half-space of the layer's material."""
    return HalfspaceLaw(
        method="halfspace",
        reason="no layer effect: the layer is a half-space",
        max_depth=largest_halfspace_depth(indenter),
        error_estimate=0.0,
        indenter=indenter,
        theta=layer.material.theta,
    )
