"""Johnson, Kendall and Roberts on any layer, explicit in the contact radius, and how short-ranged it must be.

Formula: drop f(1) = 0 in the contact problem of `punch_solution`. With the radius a and the depth w given,
the solution is f = f_el + (w - w_el(a)) g, g the flat punch's, w_el and P_el depth and force without adhesion.
At the edge the surface is the layer's: the energy release rate of a shrinking contact is G = theta f(1)^2/(pi a),
and G = dgamma, the work of adhesion, gives

    w(a) = w_el(a) - q,   P(a) = P_el(a) - 4 theta a kappa q,   q = sqrt(pi a dgamma/theta)/g(1),

and with eps = a/h, kappa = int_0^1 g dx and d(eps kappa)/d eps = g(1)^2

    dP/da = 4 theta (a kappa dw/da - g(1)^2 q),   dP/d ln dgamma at fixed w = -2 pi a dgamma/(dw/da).

On a half-space g = kappa = 1: Johnson, Kendall and Roberts (1971), Proc. R. Soc. A 324, 301. The flat punch
(w_el = P_el = 0): Kendall (1971), J. Phys. D 4, 1186.

Assumes what the elastic law assumes, and an attraction whose range is short against the gap outside of the contact:
`range_limit` gives the longest range, from one state of an attraction of finite range (`maugis_state`). The contact
is lost where its branch of equilibria ends: dw/da = 0 under depth control, dP/da = 0 under load control, dP/da + k
dw/da = 0 behind a spring k.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.optimize import brentq

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.adhesion.adhesive_law import STATES, AdhesiveBranch, AdhesiveLaw, BranchPoint
from underlay.mechanics.adhesion.jkr_table import JKRTable
from underlay.mechanics.adhesion.radius_relation import (
    RadiusRelation,
    kernel_rule,
    largest_radius,
    solve_relation,
)
from underlay.mechanics.contact import Adhesion, AdhesionTable, BuildsElastic, Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.law import ExactPunchLaw, exact_punch_law
from underlay.mechanics.exact.nodes import legendre_rule
from underlay.quantities import one_of, quantity
from underlay.units import format_quantity

# 40 nodes reach 12 digits at a/h = 0.5 and 1; twice as many for wide contacts.
_NODES, _WIDE_NODES, _WIDE = 40, 80, 3.0
_RTOL = 1e-12
# Rings searched; one of the radius itself is far beyond what JKR could stand for.
_NARROWEST, _WIDEST = 1e-7, 1.0
# To which ln of the ring and of the stress are found: a thousandth, and far below that.
_RING_CLOSE, _STRESS_CLOSE = 1e-3, 1e-9
_STEP = 2.0  # of the search for the stress, in its logarithm
#: Declaration of a work of adhesion.
WORK = quantity("surface energy", "work of adhesion", symbol=r"\Delta\gamma", bounds=(0.0, np.inf))
# The half-space is a closed form: only interpolation has an error.
_HALFSPACE_RTOL = 1e-9
# Of the reference radius: the branch's end is at 0.3 of it and more for every shape tried.
_SMALLEST = 1e-3
# What is said of the range of the attraction: to this accuracy, for this share of the force.
_RANGE_RTOL, _RANGE_SHARE = 1e-4, 0.05
# The radius ends at one of so many steps of an octave of the thickness, and is widened by this until the contact is
# wide enough.
_PER_OCTAVE = 4
_WIDEN = 2.0**0.5
# Factors on the radius that are tried together for the width of a contact on a half-space.
_WIDTHS = 1.1 ** np.arange(32)


class MaugisState(NamedTuple):
    """One equilibrium: depth w (m), force P (N), and the separation delta (m) at the radius `outer` c (m).

    The attraction acts on the ring between contact radius and c.
    """

    depth: float
    force: float
    separation: float
    outer: float


def maugis_state(contact: Contact, radius: float, outer: float, stress: float) -> MaugisState:
    """One state of a contact with a constant attraction of finite range, after Maugis and Dugdale, on any layer.

    A constant attraction sigma0 acts outside of the contact, on a < r < c, up to the separation delta at r = c,
    so that the work of adhesion is sigma0 delta. Extend f to (0, c): on (a, c) it is known,

        f(s) = -(sigma0/theta) sqrt(c^2 - s^2),

    and on (0, a), with K f = (2/(pi h)) int K(x/h, y/h) f dy over (0, c),

        f(x) = w - H(x) + (K f)(x),   f(a) = -(sigma0/theta) sqrt(c^2 - a^2)   (no singularity: this gives w),
        P = 4 theta int_0^c f ds,
        delta = (2/pi) int_a^c [f - K f - w + H](s) ds/sqrt(c^2 - s^2).

    Given a and c all is explicit; given delta, c is a root. The annulus has nodes s = sqrt(c^2 - (c^2 - a^2)
    t^2), t those of Gauss and Legendre on (0, 1), which takes out both square roots. On a half-space: Maugis
    (1992), J. Colloid Interface Sci. 150, 243.

    theta is the elastic constant of the surface.

    Parameters
    ----------
    contact : Contact
        A rounded or pointed tip on its body.
    radius, outer : float
        Contact radius a and outer radius c of the attraction (m).
    stress : float
        Attraction sigma0 (Pa).
    """
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


class RangeLimit(NamedTuple):
    """Longest range of the attraction (m) for which JKR holds, and the relative width (c - a)/a of its ring.

    The attraction acts on the ring between the contact radius a and the radius c.
    """

    separation: float
    ring: float


def range_limit(contact: Contact, work: float, radius: float, elastic: float, share: float) -> RangeLimit:
    """Longest range of the attraction at which adhesion adds to the force what JKR says, within `share`.

    An attraction that ends at the separation delta acts on a ring of the width c - a around the contact, and JKR is
    the limit of a narrow ring. How narrow it must be depends on the layer, which the usual Tabor number, formed
    with the tip's radius and the modulus alone, does not take into account. Without load a paraboloid allows a ring
    of 0.054 for 5 % on a half-space; on an incompressible bonded layer 0.041 at a/h = 1.6 and 0.032 at a/h = 4.9.
    Pressed so that adhesion is small against the load it is less still.

    Parameters
    ----------
    contact : Contact
        A rounded or pointed tip on its body.
    work : float
        Work of adhesion (J/m^2).
    radius : float
        Contact radius (m) at which JKR has no load.
    elastic : float
        Force (N) of the contact of this radius without adhesion, which JKR's adhesion cancels there.
    share : float
        Deviation allowed, as a share of `elastic`.

    Returns
    -------
    RangeLimit
        The largest range that can be solved, where that still meets `share`.
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
    """Attraction (Pa) for which a ring out to `outer` (m) gives this work of adhesion (J/m^2)."""

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


@dataclass(frozen=True)
class JKR(Adhesion):
    """Short-ranged adhesion of Johnson, Kendall and Roberts, on any body.

    Parameters
    ----------
    work : float
        Work of adhesion (J/m^2), positive: the energy it takes to separate one square metre.
    branch : str, default "separating"
        Which states a law takes. ``"separating"``: the tip was pressed in and is withdrawn; there is contact
        down to the pull-off. ``"approaching"``: there is none before the tip touches at depth zero and jumps
        in. ``"cycle"``: depths are given in the order in which they are reached; contact begins at zero and
        ends at the pull-off.

    Examples
    --------
    >>> import underlay as ul
    >>> tip, gel = ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e4, 0.5))
    >>> law = ul.Scene(tip, gel, adhesion=ul.JKR(work=1e-3)).contact_law(1e-5)
    >>> round(law.pull_off_force / (3.141592653589793 * 1e-3 * 1e-3), 9)  # over pi R work
    1.5
    """

    model: ClassVar[str] = "jkr"

    work: float = field(metadata=WORK)
    branch: str = field(default="separating", metadata=one_of(*STATES))

    def __post_init__(self) -> None:
        object.__setattr__(self, "work", positive(self.work, "work of adhesion", "J/m^2"))
        if self.branch not in STATES:
            raise InputError(f"unknown branch {self.branch!r} of adhesion; known: {', '.join(STATES)}")

    def law(self, contact: Contact, max_depth: float, solver: BuildsElastic) -> ContactLaw:
        """Build the law for depths up to `max_depth` (m), and at least up to the contact without load.

        Raises
        ------
        InputError
            If `solver` is neither the exact law nor the half-space.
        RangeError
            If the contact would be wider than 20 thicknesses, or reach the end of the indenter's shape.
        """
        deepest, rtol = max(max_depth, 0.0), elastic_tolerance(solver)
        body = _body(contact, solver)
        if contact.indenter.has_edge:
            return _punch(body, self.work, deepest, rtol)
        branch = jkr_branch(body, self.work, deepest, rtol)
        path = branch.path(0.0, rtol)
        reason = f"JKR on the {'exact contact problem' if body.layered else 'half-space'}"
        if body.layered:
            reason += f", solved for a/h up to {branch.end / body.thickness:.3g}"
        for jump in path.jumps:
            if jump.inner:
                reason += (
                    f"; withdrawn, the contact jumps at depth {jump.at:.4g} m from radius {jump.outer:.4g} m to "
                    f"{jump.inner:.4g} m"
                )
        return AdhesiveLaw(
            method="exact" if body.layered else "halfspace",
            reason=reason,
            max_depth=deepest,
            error_estimate=branch.relation.error_estimate + rtol,
            branch=branch,
            path=path,
            rtol=rtol,
            states=self.branch,
        )

    def about_range(self, contact: Contact, solver: BuildsElastic) -> str:
        """Sentence on how short-ranged the attraction must be for JKR to hold in this contact, by `range_limit`.

        Empty for a flat punch.
        """
        if contact.indenter.has_edge:
            return ""
        body = _body(contact, solver)
        branch = jkr_branch(body, self.work, 0.0, _RANGE_RTOL)
        radius = branch.path(np.inf, _RANGE_RTOL).radius(np.zeros(1))
        elastic = float(branch.relation.at(radius).force[0])
        limit = range_limit(body, self.work, float(radius[0]), elastic, _RANGE_SHARE)
        where = f" at a/h = {radius[0] / body.thickness:.3g}" if body.layered else ""
        return (
            f"none is declared; JKR is right to {100.0 * _RANGE_SHARE:g} % (of what adhesion adds to the force of "
            f"the unloaded contact) for an attraction that ends within "
            f"{format_quantity(limit.separation, 'length')} of the surface, (c - a)/a = {limit.ring:.2g}{where}; "
            "Maugis(work, range) computes with one that reaches further"
        )

    def table(
        self, contact: Contact, contact_at: Callable[[float], Contact], solver: BuildsElastic
    ) -> AdhesionTable | None:
        """Table of such contacts at any work of adhesion (see `Adhesion.table`); None for a flat punch."""
        if contact.indenter.has_edge:
            return None
        return JKRTable(
            lambda value: _body(contact_at(value), solver),
            _body(contact, solver),
            self.branch,
            elastic_tolerance(solver),
        )


@dataclass(frozen=True)
class JKRBranch(AdhesiveBranch):
    """Every equilibrium of one contact, stable or not, by its contact radius.

    Parameters
    ----------
    relation : RadiusRelation
        The elastic contact.
    work : float
        Work of adhesion dgamma (J/m^2).
    end, reference : float
        Largest radius (m), and that of zero depth on a half-space; see `AdhesiveBranch`.
    """

    relation: RadiusRelation
    work: float
    end: float
    reference: float

    @property
    def start(self) -> float:  # type: ignore[override]  # a plain attribute elsewhere
        """Smallest contact radius (m), far below that of pull-off."""
        return _SMALLEST * self.reference

    @property
    def nodes(self) -> int | None:  # type: ignore[override]  # as above
        """Number of radial nodes of the elastic solution; None on a half-space."""
        return self.relation.nodes

    def at(self, radius: FloatArray) -> BranchPoint:
        """Depth, force and their slopes at radii (m), (n,), positive and at most `end`, in closed form."""
        theta, elastic = self.relation.theta, self.relation.at(radius)
        q = np.sqrt(np.pi * radius * self.work / theta) / elastic.edge
        slope = elastic.depth_slope - q * (0.5 / radius - elastic.edge_rate)
        stiffness = 4.0 * theta * radius * elastic.kappa
        force_slope = stiffness * slope - 4.0 * theta * elastic.edge**2 * q
        return BranchPoint(elastic.depth - q, elastic.force - stiffness * q, slope, force_slope)

    def work_slope(self, radius: FloatArray) -> FloatArray:
        """dP/d ln(work of adhesion) (N) at fixed depth, at radii a (m), (n,): -2 pi a dgamma da/dw."""
        return -2.0 * np.pi * self.work * radius / self.at(radius).depth_slope


def _body(contact: Contact, solver: BuildsElastic) -> Contact:
    """The contact that the solver solves: a half-space where it ignores what is under the surface."""
    return contact if solver.sees_base else replace(contact, thickness=np.inf)


def elastic_tolerance(solver: BuildsElastic) -> float:
    """Relative error of a solver that adhesion can be computed with.

    Raises
    ------
    InputError
        If it is neither the exact law nor the half-space: adhesion acts at the edge of the contact, which
        corrections of the force do not describe.
    """
    if solver.tolerance > 0.0:
        return solver.tolerance
    if not solver.sees_base:
        return _HALFSPACE_RTOL
    raise InputError(
        f"adhesion stands on the exact contact problem or on the half-space, not on {solver.name}: its formula "
        "says nothing of the edge of the contact; use the solver 'exact', 'auto' or 'halfspace'"
    )


def jkr_branch(contact: Contact, work: float, max_depth: float, rtol: float) -> JKRBranch:
    """Equilibria from a vanishing contact radius up to one at `max_depth` (m) and without tension.

    Raises
    ------
    RangeError
        If no solution is that wide.
    """
    measure = contact.indenter.power_law
    widest = largest_radius(contact)
    # H(a) = sqrt(pi a work/theta) for the power law of the apex.
    drop = float(np.sqrt(np.pi * work / contact.theta)) / measure.abel_coefficient
    reference = min(drop ** (1.0 / (measure.exponent - 0.5)), widest)
    end = _halfspace_end(contact, work, max_depth, reference, widest)
    if contact.layered:
        # Works that are tried one after the other then share what was solved.
        end = min(
            contact.thickness
            * 2.0 ** (np.ceil(_PER_OCTAVE * np.log2(end / contact.thickness)) / _PER_OCTAVE),
            widest,
        )
    while True:
        relation = solve_relation(contact, end, rtol)
        branch = JKRBranch(relation, work, end, reference)
        last = branch.at(np.array([end]))
        # On a film that folds the widest contact is beyond the fold, where depth and force increase again.
        grows = last.depth_slope[0] > 0.0 and last.force_slope[0] > 0.0
        if grows and last.depth[0] >= max_depth and last.force[0] >= 0.0:
            return branch
        if end >= widest:
            raise _too_wide(branch, contact, max_depth)
        end = min(_WIDEN * end, widest)


def _punch(contact: Contact, work: float, max_depth: float, rtol: float) -> ExactPunchLaw:
    """Kendall's flat punch: the elastic law down to w = -q (module's head), where it comes off at once."""
    law = exact_punch_law(contact, max_depth, rtol)
    pull = float(np.sqrt(np.pi * law.radius * work / contact.theta)) / law.edge
    return replace(law, reason=f"JKR with a flat punch (Kendall); {law.reason}", lowest=-pull)


def _halfspace_end(contact: Contact, work: float, max_depth: float, reference: float, widest: float) -> float:
    """Contact radius (m) on a half-space of the layer's material at `max_depth` (m) and without tension.

    `reference` is the radius of zero depth, `widest` the largest allowed (m).
    """
    halfspace = RadiusRelation(contact.indenter, contact.theta)
    end = min(1.2 * reference, widest)
    while end < widest:
        ends = np.minimum(end * _WIDTHS, widest)
        here = JKRBranch(halfspace, work, widest, reference).at(ends)
        wide = (here.depth >= max_depth) & (here.force >= 0.0)
        if wide.any():
            return float(ends[np.argmax(wide)])
        end = float(ends[-1])
    return widest


def _too_wide(branch: JKRBranch, contact: Contact, asked: float) -> RangeError:
    """RangeError for a contact that is not wide enough, with the largest depth or work of adhesion possible."""
    edge = np.array([branch.end])
    last, elastic = branch.at(edge), branch.relation.at(edge)
    shape = contact.indenter.max_radius <= largest_radius(contact)
    why = (
        "the contact reaches the end of the indenter's shape; use a larger radius"
        if shape
        else "the contact radius is 20 thicknesses; use a thicker layer or the half-space law of the substrate"
    )
    if last.force[0] < 0.0:
        # What adhesion takes from the force goes with the root of the work.
        most = branch.work * float(elastic.force[0] / (elastic.force[0] - last.force[0])) ** 2
        return RangeError(
            f"a work of adhesion of {branch.work:.4g} J/m^2 draws the tip in until {why}, or declare no more than "
            f"{most:.4g} J/m^2"
        )
    return RangeError(
        f"depth {asked:.6g} m is beyond the largest that works here, {last.depth[0]:.6g} m: there {why}",
        max_depth=float(last.depth[0]),
    )
