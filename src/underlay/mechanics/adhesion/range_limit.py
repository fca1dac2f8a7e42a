"""How short an attraction must reach for JKR to hold: its answer in metres, and as (c - a)/a.

An attraction that ends at the separation delta (`maugis`) acts on a ring of the width c - a around the contact,
and JKR is the limit of a narrow ring. How narrow it must be depends on the layer, which the usual Tabor number,
formed with the tip's radius and the modulus alone, does not know. Without load a paraboloid allows a ring of 0.054
for 5 % on a half-space; on an incompressible bonded layer 0.041 at a/h = 1.6 and 0.032 at a/h = 4.9. Pressed so
that adhesion is small against the load it is less still.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from underlay.mechanics.adhesion.maugis_state import maugis_state
from underlay.mechanics.adhesion.radius_relation import largest_radius
from underlay.mechanics.contact import Contact

__all__ = ["RangeLimit", "range_limit"]

# Rings searched; one of the radius itself is far beyond what JKR could stand for.
_NARROWEST, _WIDEST = 1e-7, 1.0
# To which ln of the ring and of the stress are found: a thousandth, and far below that.
_RING_CLOSE, _STRESS_CLOSE = 1e-3, 1e-9
_STEP = 2.0  # of the search for the stress, in its logarithm


class RangeLimit(NamedTuple):
    """Longest range of the attraction (m), and the ring (c - a)/a that it acts on."""

    separation: float
    ring: float


def range_limit(contact: Contact, work: float, radius: float, elastic: float, share: float) -> RangeLimit:
    """Longest range at which what adhesion adds to the force is JKR's within `share`.

    Parameters
    ----------
    contact : Contact
        A rounded or pointed tip on its body.
    work : float
        Work of adhesion (J/m^2).
    radius : float
        Contact radius (m) at which JKR has no load.
    elastic : float
        Force (N) of the contact of this radius without adhesion: what JKR takes away there.
    share : float
        What is allowed, of `elastic`.

    Returns
    -------
    RangeLimit
        The end of what can be solved where that is not yet too long.
    """
    widest = min(_WIDEST, 0.999 * (largest_radius(contact) / radius - 1.0))

    def excess(log_ring: float) -> float:
        outer = radius * (1.0 + float(np.exp(log_ring)))
        stress = _stress(contact, work, radius, outer)
        return abs(maugis_state(contact, radius, outer, stress).force) / elastic - share

    low, high = float(np.log(_NARROWEST)), float(np.log(widest))
    log_ring = high if excess(high) < 0.0 else float(brentq(excess, low, high, xtol=_RING_CLOSE))
    ring = float(np.exp(log_ring))
    return RangeLimit(work / _stress(contact, work, radius, radius * (1.0 + ring)), ring)


def _stress(contact: Contact, work: float, radius: float, outer: float) -> float:
    """Attraction (Pa) with which a ring out to `outer` (m) does this work of adhesion (J/m^2)."""

    def excess(log_stress: float) -> float:
        stress = float(np.exp(log_stress))
        return log_stress + float(np.log(maugis_state(contact, radius, outer, stress).separation / work))

    # What a narrow ring takes: delta goes with sigma0 (c - a)/theta.
    low = high = 0.5 * float(np.log(work * contact.theta / (outer - radius)))
    while excess(low) > 0.0:
        low -= _STEP
    while excess(high) < 0.0:
        high += _STEP
    return float(np.exp(brentq(excess, low, high, xtol=_STRESS_CLOSE)))
