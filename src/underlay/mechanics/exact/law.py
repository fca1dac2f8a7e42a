"""The exact contact law: the Fredholm equation of a layer on a substrate, solved to a relative error.

Formula: `punch_solution` has the equation, `master_curve` the relation it gives. Assumes a frictionless,
rigid, axisymmetric indenter whose contact is one disc, small strains, and a bonded interface. Range: contact
radii up to 20 thicknesses, and up to the end of the indenter's shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact import Contact
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.contact_problem import LARGEST_EPS, ContactProblem
from underlay.mechanics.exact.master_curve import Factor, MasterCurve, Pieces
from underlay.mechanics.exact.nodes import Resolution
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution
from underlay.mechanics.exact.stored_curves import known_curve
from underlay.mechanics.indenters import PowerLawShape


@dataclass(frozen=True, kw_only=True)
class ExactLaw(ContactLaw):
    """Contact law of a rounded or pointed indenter, from the master curve of its exact contact problem.

    Parameters
    ----------
    measure : PowerLawShape
        Shape whose half-space law the factors of the curve multiply: the indenter, where it is a power law.
    theta : float
        Elastic constant of the layer (Pa).
    thickness : float
        Thickness of the layer (m); on a half-space any length, by which the curve was made dimensionless.
    curve : MasterCurve
        The dimensionless relation. It holds for any `theta`, and any `thickness` if the indenter is a power
        law: replace those to use it again.
    resolution : Resolution
        Nodes of the solution behind the curve.
    """

    measure: PowerLawShape
    theta: float
    thickness: float
    curve: MasterCurve
    resolution: Resolution

    @property
    def nodes(self) -> int:
        """Number of radial nodes of the solution."""
        return self.resolution.radial

    @property
    def known_slopes(self) -> int:
        """Number of derivatives dP/ds known, one for each of `Contact.variants`; zero where the relation folds."""
        return int(self.curve.coefficients.shape[1]) - len(Factor)

    _beyond: ClassVar[str] = "the law was solved up to there; ask for less depth, or build it for more"

    @cached_property
    def _by_root(self) -> Pieces:
        """Polynomials in root = w^(1/lambda), w the depth, lambda the exponent of `measure`: fast to evaluate.

        Columns, with all dimensional constants of this contact included: ln P/(w root), ln (dP/dw)/root, the
        derivatives d ln P/ds, and ln a/root.
        """
        unit, own = self.measure.unit_radius, self.curve.coefficients
        # The factors stand in the order of radius, force, stiffness.
        tables = np.concatenate((own[:, 1:], own[:, :1]), axis=1)
        tables[:, 1] += own[:, 0]
        stiffness = math.log(4.0 * self.theta * unit)
        force = stiffness + math.log(self.measure.exponent / (self.measure.exponent + 1.0))
        tables[..., 0, 0] += [force, stiffness, *[0.0] * self.known_slopes, math.log(unit)]
        return self.curve.pieces(unit / self.thickness, tables)

    def _root(self, depth: FloatArray) -> FloatArray:
        return np.asarray(depth ** (1.0 / self.measure.exponent))

    def _force(self, depth: FloatArray) -> FloatArray:
        root = self._root(depth)
        force = self._by_root.at(root, 0)
        np.exp(force, out=force)
        force *= root
        force *= depth
        return force

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        return self._rows(depth, 2)

    def _with_slopes(self, depth: FloatArray) -> FloatArray:
        return self._rows(depth, 2 + self.known_slopes)

    def _rows(self, depth: FloatArray, count: int) -> FloatArray:
        """The first `count` rows of force (N), dP/dw (N/m) and the known derivatives dP/ds (N): (count, n)."""
        root = self._root(depth)
        rows = self._by_root.at(root, slice(count))
        both = rows[:2]
        np.exp(both, out=both)
        both *= root
        both[0] *= depth
        rows[2:] *= both[0]
        return rows

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        root = self._root(depth)
        return root * np.exp(self._by_root.at(root, -1))

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        root = self._root(depth)
        return root * np.exp(self._by_root.at(root, 1))


@dataclass(frozen=True, kw_only=True)
class ExactPunchLaw(ContactLaw):
    """The exact contact problem of a flat punch: force proportional to depth, P = 4 theta a kappa_inf w.

    theta is the layer's elastic constant, kappa_inf the stiffness over that on a half-space (9.5).

    Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    radius : float
        Of the punch (m).
    incremental : float
        dP/dw (N/m), (9.1).
    resolution : Resolution
        Nodes of the solution.
    edge : float, optional
        g(1), the solution at the edge (`punch_solution`), from which the stress intensity for adhesion follows. NaN
        where adhesion is not possible: together with friction it is refused.
    lowest : float, default 0
        Depth (m) at which the punch comes off, whether depth or load is given: negative where it adheres.
    """

    radius: float
    incremental: float
    resolution: Resolution
    edge: float = math.nan
    lowest: float = 0.0

    @property
    def domain(self) -> tuple[float, float]:
        """Depths (m) of the law: from where the punch comes off to `max_depth`."""
        return self.lowest, self.max_depth

    def work_slope(self, depth: FloatArray) -> FloatArray:
        """Derivative of the force in the logarithm of the work of adhesion (N) at fixed depths (n,): zero.

        The work of adhesion of a flat punch moves only the depth at which it comes off.
        """
        return np.zeros_like(depth)

    @property
    def nodes(self) -> int:
        """Number of radial nodes of the solution."""
        return self.resolution.radial

    _beyond: ClassVar[str] = "the law was asked for up to there; ask for less depth, or build it for more"

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.incremental * depth

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return np.full_like(depth, self.radius)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return np.full_like(depth, self.incremental)


def exact_law(contact: Contact, max_depth: float, rtol: float = 1e-6) -> ContactLaw:
    """Solve the contact problem for depths up to `max_depth`.

    Parameters
    ----------
    contact : Contact
        Of any shape. A half-space goes through the same equations, with a kernel of zero.
    max_depth : float
        Largest depth (m), positive.
    rtol : float, default 1e-6
        Relative error allowed in force, contact radius and stiffness.

    Returns
    -------
    ExactLaw or ExactPunchLaw

    Raises
    ------
    RangeError
        If the contact radius would pass 20 thicknesses, or the end of the indenter's shape.

    Examples
    --------
    >>> from underlay.mechanics.indenters import Paraboloid
    >>> from underlay.mechanics.body import Layer, RIGID
    >>> from underlay.mechanics.materials import Isotropic
    >>> contact = Contact.of(Paraboloid(1e-3), Layer(Isotropic(3e6, 0.5), 1e-3), RIGID)
    >>> law = exact_law(contact, max_depth=6e-4)
    >>> f"{law.force(5.594154855625e-4):.5f}"  # a/h = 1: P = 7.522667... theta A a^3
    '7.52267'
    """
    indenter = contact.indenter
    if indenter.has_edge:
        return exact_punch_law(contact, max_depth, rtol)
    problem, top = without_dimensions(contact, max_depth)
    length = problem.thickness
    solved = known_curve(problem, top, rtol)
    reason = (
        f"exact contact problem, solved for a/h up to {solved.eps:.3g}, {solved.resolution.radial} nodes"
        if contact.thickness < np.inf
        else "exact contact problem of a half-space"
    )
    if solved.curve.jumps:
        first = float(problem.measure.abel(np.array([solved.curve.jumps[0] * length]))[0])
        reason += (
            f"; the film wraps the indenter in a jump at depth {first:.4g} m, near which one disc is rough"
        )
    return ExactLaw(
        method="exact",
        reason=reason,
        max_depth=max_depth,
        error_estimate=solved.error_estimate,
        measure=problem.measure,
        theta=contact.theta,
        thickness=length,
        curve=solved.curve,
        resolution=solved.resolution,
    )


def without_dimensions(contact: Contact, max_depth: float) -> tuple[ContactProblem, float]:
    """The problem behind a contact, and the largest varpi for depths up to `max_depth` (m).

    varpi is the half-space contact radius at the depth over the thickness; a half-space has that radius itself for
    its thickness.
    """
    indenter, deepest = contact.indenter, np.array([max_depth])
    length = contact.thickness
    if length == np.inf:
        length = float(indenter.halfspace_radius(deepest)[0])
    problem = ContactProblem.of(indenter, length, contact.kernel, contact.variants)
    return problem, float(problem.measure.halfspace_radius(deepest)[0]) / length


def punch_width(contact: Contact) -> float:
    """a/h of a flat punch; RangeError where it is more than 20."""
    eps = contact.indenter.max_radius / contact.thickness
    if eps > LARGEST_EPS:
        raise RangeError(
            f"the punch's radius is {eps:.4g} layer thicknesses, and {LARGEST_EPS:g} is the most that works "
            "here: use a smaller punch or, for contacts wider still, the half-space law of the substrate"
        )
    return eps


def exact_punch_law(contact: Contact, max_depth: float, rtol: float = 1e-6) -> ExactPunchLaw:
    """Solve the contact problem of a flat punch; parameters and errors as for `exact_law`."""
    radius, eps = contact.indenter.max_radius, punch_width(contact)
    resolution = proved_resolution(contact.kernel, eps, rtol)
    punch = PunchSolution.solve(contact.kernel, np.array([eps]), resolution)
    return ExactPunchLaw(
        method="exact",
        reason=f"exact contact problem, a/h = {eps:.3g}, {resolution.radial} nodes",
        max_depth=max_depth,
        error_estimate=0.3 * rtol,
        radius=radius,
        incremental=4.0 * contact.theta * radius * float(punch.kappa[0]),
        edge=1.0 + float(punch.rho[0] @ punch.rule.weights),
        resolution=resolution,
    )
