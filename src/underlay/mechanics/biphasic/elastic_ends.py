"""Elastic ends of every drainage: the library's own laws of the undrained and of the drained skeleton."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay.mechanics.body import PlaneConstants
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.indenters import FlatPunch, Indenter
from underlay.mechanics.kernel import LayerKernel

ComplexArray: TypeAlias = NDArray[np.complex128]

# Of the ends of a response, whose own error is 1e-5 of them.
_RTOL = 1e-10


def elastic_law(
    constants: PlaneConstants, indenter: Indenter, thickness: float, max_depth: float, rtol: float = _RTOL
) -> ContactLaw:
    """Exact contact law of an elastic layer on a bonded rigid base, or of a half-space.

    Parameters
    ----------
    constants : PlaneConstants
        Elastic constants of the layer; forces are in the unit of its moduli times an area.
    indenter : Indenter
        The tip.
    thickness : float
        Thickness of the layer; inf for a half-space.
    max_depth : float
        Largest depth of the law.
    rtol : float, optional
        Relative error of the law.
    """
    base = None if np.isfinite(thickness) else constants
    contact = Contact(indenter, LayerKernel(constants, base), float(constants.theta), thickness)
    return exact_law(contact, max_depth, rtol)


def punch_factor(constants: PlaneConstants, eps: float, rtol: float = _RTOL) -> float:
    """Force of a flat punch on an elastic layer on a rigid base over that on a half-space: P/(4 theta a w).

    P force, w depth, theta half the indentation modulus, a radius; `eps` = a/h, radius over thickness, may be zero.
    """
    if eps == 0.0:
        return 1.0
    force = float(elastic_law(constants, FlatPunch(1.0), 1.0 / eps, 1.0, rtol).force(1.0))
    return force / (4.0 * float(constants.theta))
