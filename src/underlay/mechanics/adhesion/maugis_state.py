"""One state of a contact with a constant attraction of finite range, after Maugis and Dugdale, on any layer.

Formula: a constant attraction sigma0 acts outside of the contact, on a < r < c, up to the separation delta at
r = c, so that the work of adhesion is sigma0 delta. Extend f to (0, c): on (a, c) it is known,

    f(s) = -(sigma0/theta) sqrt(c^2 - s^2),

and on (0, a), with K f = (2/(pi h)) int K(x/h, y/h) f dy over (0, c),

    f(x) = w - H(x) + (K f)(x),   f(a) = -(sigma0/theta) sqrt(c^2 - a^2)   (no singularity: this gives w),
    P = 4 theta int_0^c f ds,
    delta = (2/pi) int_a^c [f - K f - w + H](s) ds/sqrt(c^2 - s^2).

Given a and c all is explicit; given delta, c is a root. The annulus has nodes s = sqrt(c^2 - (c^2 - a^2) t^2), t
those of Gauss and Legendre on (0, 1), which takes out both square roots. On a half-space: Maugis (1992), J.
Colloid Interface Sci. 150, 243.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay.mechanics.adhesion.radius_relation import kernel_rule
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.gauss import legendre_rule

__all__ = ["MaugisState", "maugis_state"]

# 40 nodes reach 12 digits at a/h = 0.5 and 1; twice as many for wide contacts.
_NODES, _WIDE_NODES, _WIDE = 40, 80, 3.0
_RTOL = 1e-12


class MaugisState(NamedTuple):
    """One equilibrium: depth w (m), force P (N), separation delta (m) at the radius `outer` c (m)."""

    depth: float
    force: float
    separation: float
    outer: float


def maugis_state(contact: Contact, radius: float, outer: float, stress: float) -> MaugisState:
    """Solve for a contact of `radius` a (m), attraction `stress` sigma0 (Pa) out to the radius `outer` c (m)."""
    count = _WIDE_NODES if outer > _WIDE * contact.thickness else _NODES
    nodes, weights = legendre_rule(count)
    t, gauss = 0.5 * (nodes + 1.0), 0.5 * weights
    pull, span = stress / contact.theta, (outer - radius) * (outer + radius)
    x, s = radius * t, np.sqrt(outer**2 - span * t**2)
    annulus = gauss * span * t / s
    known = -pull * np.sqrt(span) * t
    waves, strength = kernel_rule(contact, outer, _RTOL)
    inside, ring = np.cos(np.multiply.outer(x, waves)), np.cos(np.multiply.outer(s, waves))
    edge = np.cos(radius * waves)
    # What the known part does everywhere: one sum over the wavenumbers.
    of_ring = strength * (ring.T @ (annulus * known))
    matrix = np.eye(count) - (inside * strength) @ inside.T * (radius * gauss)
    shape = contact.indenter.abel(x)
    unit, rest = np.linalg.solve(matrix, np.column_stack((np.ones(count), inside @ of_ring - shape))).T
    of_unit, of_rest = (strength * (inside.T @ (radius * gauss * part)) for part in (unit, rest))
    deepest = float(contact.indenter.abel(np.array(radius)))
    at_edge = -deepest + float(edge @ (of_rest + of_ring))
    depth = (-pull * np.sqrt(span) - at_edge) / (1.0 + float(edge @ of_unit))
    f = depth * unit + rest
    force = 4.0 * contact.theta * float(radius * gauss @ f + annulus @ known)
    gap = known - ring @ (depth * of_unit + of_rest + of_ring) - depth + contact.indenter.abel(s)
    separation = (2.0 / np.pi) * float(np.sqrt(span) * ((gauss / s) @ gap))
    return MaugisState(float(depth), force, separation, outer)
