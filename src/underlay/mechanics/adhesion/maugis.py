"""Attraction of finite range: Maugis-Dugdale, and Derjaguin-Muller-Toporov outside a Hertzian contact.

`Maugis` takes a constant stress up to a separation, on any layer, and is the reference for JKR. One state, for a
contact radius a and an attraction out to radius c, is `maugis_state`; here are those of a given work of adhesion
and range, and the branch they make. No energy release rate enters, so its limit for c -> a, which is JKR, is an
independent check of `jkr`. And (c - a)/a tells whether JKR may be used (`range_limit`): a Tabor number formed with
R and E* alone does not on a thin layer. `DMT` is the other limit, attraction outside of a contact that adhesion
does not deform.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.adhesion.adhesive_law import AdhesiveBranch, AdhesiveLaw, BranchPoint
from underlay.mechanics.adhesion.jkr import (
    JKR,
    WORK,
    MaugisState,
    elastic_tolerance,
    jkr_branch,
    maugis_state,
)
from underlay.mechanics.adhesion.radius_relation import largest_radius
from underlay.mechanics.contact import Adhesion, BuildsElastic, Contact
from underlay.mechanics.contact_law import ContactLaw, LawOnLaw
from underlay.quantities import quantity

# The curve of a law: solved at so many radii in each decade, and interpolated to about 1e-6.
_PER_DECADE = 24
_CURVE_RTOL = 1e-6
# Of JKR's reference radius; the branch of a short range ends at 0.3 of it and more.
_SMALLEST = 0.1
# Annuli searched, as (c - a)/a, and the step of the search in its logarithm.
_NARROWEST, _WIDEST = 1e-12, 1e3
_STEP = 0.7
_NEAR = 1e-2  # where the first search begins


@dataclass(frozen=True)
class Maugis(Adhesion):
    """Adhesion of finite range: a constant attraction up to a separation, after Maugis and Dugdale.

    Meant as a reference: each contact radius is a solution of its own, and a law takes a good part of a second. In
    a scene it also decides whether JKR would do; see `Scene.effects`.

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
        """JKR with the same work of adhesion."""
        return JKR(self.work)

    @property
    def stress(self) -> float:
        """Attraction sigma0 (Pa), work of adhesion over range."""
        return self.work / self.range

    def state(self, contact: Contact, radius: float, near: float = _NEAR) -> MaugisState:
        """Equilibrium of a contact of radius a = `radius` (m); c is the outer radius of the attraction.

        `near` is the value of (c - a)/a at which the search for c begins.

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
        """Build the law of a tip being withdrawn, for depths up to `max_depth` (m), at relative error 1e-6.

        Raises
        ------
        InputError
            If the tip is a flat punch.
        RangeError
            As `state`.
        """
        elastic_tolerance(solver)
        if contact.indenter.has_edge:
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
    """Equilibria of Maugis and Dugdale, interpolated in ln a; the spline's columns are depth (m) and force (N)."""

    spline: CubicSpline
    start: float
    end: float
    reference: float
    nodes: int | None = None

    def at(self, radius: FloatArray) -> BranchPoint:
        """States at radii (m), (n,), within the branch."""
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
    """Interval in which an increasing function changes sign, found by growing steps from `start`."""
    low = high = min(start, highest)
    step, lowest = _STEP, float(np.log(_NARROWEST))
    while high < highest and excess(high) < 0.0:
        low, high, step = high, min(high + step, highest), 2.0 * step
    while low > lowest and excess(low) > 0.0:
        low, high, step = max(low - step, lowest), low, 2.0 * step
    return low, high


@dataclass(frozen=True, kw_only=True)
class DMTLaw(LawOnLaw):
    """An elastic law minus a constant attraction while in contact; see `DMT`.

    Parameters
    ----------
    inner : ContactLaw
        The law without adhesion.
    attraction : float
        The pull (N, positive): 2 pi R dgamma, with tip radius R and work of adhesion dgamma.
    """

    attraction: float

    def work_slope(self, depth: FloatArray) -> FloatArray:
        """dP/d ln(work of adhesion) (N) at fixed depths (m), (n,)."""
        return np.where(depth > 0.0, -self.attraction, 0.0)

    @property
    def _least_force(self) -> float:
        return -self.attraction

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.inner._force(depth) - self.attraction  # noqa: SLF001  as above

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.inner._contact_radius(depth)  # noqa: SLF001  as above

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return self.inner._stiffness(depth)  # noqa: SLF001  as above


@dataclass(frozen=True)
class DMT(Adhesion):
    """Long-ranged adhesion of a paraboloid or sphere, after Derjaguin, Muller and Toporov.

    P = P_el(w) - 2 pi R dgamma, a = a_el(w), with R the radius of the tip and dgamma the work of adhesion:
    attraction outside of a contact that adhesion does not deform. It acts across the gap of the undeformed
    shapes (Derjaguin's approximation), so that the layer does not enter. Range: tips whose apex is a
    paraboloid, and an attraction that reaches far against the elastic deformation at the edge. On a thin
    incompressible layer JKR's pull-off, up to 3 pi R dgamma, exceeds this one: the order known from the
    half-space is reversed. The tip is taken as one being withdrawn: behind a spring, contact lasts
    until the depth is zero.

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
        radius = contact.indenter.curvature_radius
        if radius is None:
            raise InputError(
                f"DMT has no pull-off force for a {type(contact.indenter).__name__}: 2 pi R work holds for a "
                "paraboloid or a sphere; use JKR(work), or Maugis(work, range) for an attraction of finite range"
            )
        attraction = 2.0 * float(np.pi) * radius * self.work
        elastic = _elastic(replace(contact, adhesion=None), max_depth, attraction, radius, solver)
        return DMTLaw.over(elastic, reason=f"DMT; {elastic.reason}", inner=elastic, attraction=attraction)


def _elastic(
    contact: Contact, max_depth: float, attraction: float, radius: float, solver: BuildsElastic
) -> ContactLaw:
    """Elastic law up to `max_depth` (m) or deeper, where that is needed to balance the attraction (N)."""
    balanced = (3.0 * attraction / (8.0 * contact.theta * np.sqrt(radius))) ** (2.0 / 3.0)  # on a half-space
    depth = max(max_depth, float(balanced))
    law = solver.law(contact, depth)
    while float(law.force(depth)) < attraction:
        depth *= 2.0
        law = solver.law(contact, depth)
    return law
