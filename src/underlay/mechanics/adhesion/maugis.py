"""Maugis and Dugdale on any layer: an attraction of constant stress and finite range. The reference for JKR.

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

Nothing here knows of energy release rates: that its limit for c -> a is JKR is an independent check of `jkr`.
And (c - a)/a says whether JKR may be used. On a thin incompressible layer the range must be nearly ten times
shorter for the same error than on a half-space: a Tabor number formed with R and E* alone does not tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.adhesion.adhesive_law import AdhesiveLaw
from underlay.mechanics.adhesion.branch import AdhesiveBranch, BranchPoint
from underlay.mechanics.adhesion.jkr import JKR, WORK, elastic_tolerance, jkr_branch
from underlay.mechanics.adhesion.radius_relation import kernel_rule, largest_radius
from underlay.mechanics.contact import Adhesion, BuildsElastic, Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.gauss import legendre_rule
from underlay.mechanics.indenters import FlatPunch
from underlay.quantities import quantity

__all__ = ["Maugis", "MaugisState", "maugis_state"]

# 40 nodes reach 12 digits at a/h = 0.5 and 1; twice as many for wide contacts.
_NODES, _WIDE_NODES, _WIDE = 40, 80, 3.0
_RTOL = 1e-12
# The curve of a law: solved at so many radii in each decade, and interpolated to about 1e-6.
_PER_DECADE = 24
_CURVE_RTOL = 1e-6
# Of JKR's reference radius; the branch of a short range ends at 0.3 of it and more.
_SMALLEST = 0.1
# Annuli searched, as (c - a)/a, and the step of the search in its logarithm.
_NARROWEST, _WIDEST = 1e-12, 1e3
_STEP = 0.7
_NEAR = 1e-2  # where the first search begins


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


@dataclass(frozen=True)
class Maugis(Adhesion):
    """Adhesion of finite range: a constant attraction up to a separation, after Maugis and Dugdale.

    A reference: each contact radius is a solution of its own, and a law takes a good part of a second. In a
    scene it also answers whether JKR would do; see `Scene.effects`.

    Parameters
    ----------
    work : float
        Work of adhesion (J/m^2), positive.
    range : float
        Separation (m) up to which the attraction acts, positive.
    """

    model: ClassVar[str] = "maugis"

    work: float = field(metadata=WORK)
    range: float = field(
        metadata=quantity("length", "range of the attraction", symbol=r"\delta_c", bounds=(0.0, np.inf))
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "work", positive(self.work, "work of adhesion", "J/m^2"))
        object.__setattr__(self, "range", positive(self.range, "range of the attraction", "m"))

    @property
    def short_ranged(self) -> JKR:
        """JKR with the same work."""
        return JKR(self.work)

    @property
    def stress(self) -> float:
        """Attraction sigma0 (Pa)."""
        return self.work / self.range

    def state(self, contact: Contact, radius: float, near: float = _NEAR) -> MaugisState:
        """Equilibrium of a contact of this radius (m); the search begins at (c - a)/a = `near`.

        Raises
        ------
        RangeError
            If the attraction would reach beyond the end of the shape or 20 thicknesses.
        """
        widest = min(largest_radius(contact) / radius - 1.0, _WIDEST)

        def excess(log_share: float) -> float:
            outer = radius * (1.0 + np.exp(log_share))
            return maugis_state(contact, radius, outer, self.stress).separation - self.range

        low, high = _bracket(excess, float(np.log(near)), float(np.log(widest)))
        if excess(high) < 0.0:
            raise RangeError(
                f"around a contact of radius {radius:.4g} m an attraction of range {self.range:.4g} m "
                f"reaches beyond {radius * (1.0 + widest):.4g} m, where the solution or the indenter's shape ends"
            )
        share = float(np.exp(brentq(excess, low, high, xtol=1e-12, rtol=1e-13)))
        return maugis_state(contact, radius, radius * (1.0 + share), self.stress)

    def law(self, contact: Contact, max_depth: float, solver: BuildsElastic) -> ContactLaw:
        """Build the law of the withdrawn tip for depths up to `max_depth` (m), to 1e-6.

        Raises
        ------
        InputError
            If the tip is a flat punch.
        RangeError
            As `state`.
        """
        elastic_tolerance(solver)
        if isinstance(contact.indenter, FlatPunch):
            raise InputError(
                "Maugis(work, range) takes rounded and pointed tips; use JKR(work) for a flat punch"
            )
        body = contact if solver.sees_base else replace(contact, thickness=np.inf)
        deepest = max(max_depth, 0.0)
        near = jkr_branch(body, self.work, deepest, _CURVE_RTOL)
        branch = _branch(self, body, near.reference, near.end)
        path = branch.path(0.0, _CURVE_RTOL)
        zone = self.state(body, path.end_radius).outer / path.end_radius - 1.0
        jkr = near.path(np.inf, _CURVE_RTOL).end
        law = AdhesiveLaw(
            method="exact" if body.layered else "halfspace",
            reason="",
            max_depth=deepest,
            error_estimate=_CURVE_RTOL,
            branch=branch,
            path=path,
            rtol=_CURVE_RTOL,
        )
        reason = (
            f"Maugis-Dugdale: at pull-off the attraction acts on a ring of (c - a)/a = {zone:.2g}, and the "
            f"pull-off force is {100.0 * (-law.pull_off_force / jkr - 1.0):+.2g} % from JKR's"
        )
        return replace(law, reason=reason)


@dataclass(frozen=True)
class _MaugisBranch(AdhesiveBranch):
    """States of Maugis and Dugdale, interpolated in ln a; depth and force are the two columns."""

    spline: CubicSpline
    start: float
    end: float
    reference: float
    nodes: int | None = None

    def at(self, radius: FloatArray) -> BranchPoint:
        """See `AdhesiveBranch`."""
        place = np.log(radius)
        values, slopes = self.spline(place), self.spline(place, 1) / radius[:, None]
        return BranchPoint(values[:, 0], values[:, 1], slopes[:, 0], slopes[:, 1])


def _branch(adhesion: Maugis, contact: Contact, reference: float, end: float) -> _MaugisBranch:
    start = _SMALLEST * reference
    radii = np.geomspace(start, end, 2 + int(_PER_DECADE * np.log10(end / start)))
    radii[0], radii[-1] = start, end
    table, near = np.empty((radii.size, 2)), _NEAR
    for row, radius in zip(table, radii.tolist(), strict=True):
        state = adhesion.state(contact, radius, near)
        row[:], near = (state.depth, state.force), state.outer / radius - 1.0
    return _MaugisBranch(CubicSpline(np.log(radii), table), start, end, reference)


def _bracket(excess: Callable[[float], float], start: float, highest: float) -> tuple[float, float]:
    """Ends between which an increasing function changes its sign, by growing steps from `start`."""
    low = high = min(start, highest)
    step, lowest = _STEP, float(np.log(_NARROWEST))
    while high < highest and excess(high) < 0.0:
        low, high, step = high, min(high + step, highest), 2.0 * step
    while low > lowest and excess(low) > 0.0:
        low, high, step = max(low - step, lowest), low, 2.0 * step
    return low, high
