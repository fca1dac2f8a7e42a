"""The exact contact problem: the Fredholm equation of a layer on a substrate, solved spectrally.

Formula: `punch_solution` (the equation) and `master_curve` (the relation it gives). Assumes a frictionless,
rigid, axisymmetric indenter whose contact is one disc, small strains, and a bonded interface. Range: a/h up
to 20.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact_nodes import Pair, Resolution, curve_terms, series_terms
from underlay.mechanics.gauss import EvenRule, even_legendre, legendre_rule
from underlay.mechanics.indenters import FlatPunch, Indenter, PowerLawShape, abel_factor
from underlay.mechanics.master_curve import (
    MOST_TERMS,
    Factor,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
)
from underlay.mechanics.materials import Layer, PlaneConstants, Rigid, Substrate
from underlay.mechanics.punch_solution import PunchSolution
from underlay.mechanics.radius_series import RadiusSeries

__all__ = ["LARGEST_EPS", "ExactLaw", "exact_law"]

#: Largest contact radius over thickness that is solved for.
LARGEST_EPS = 20.0


@dataclass(frozen=True, kw_only=True)
class ExactLaw(ContactLaw):
    """The exact contact problem of one indenter, layer and substrate.

    Parameters
    ----------
    indenter : Indenter
        Its shape.
    theta : float
        Elastic constant of the layer (Pa).
    thickness : float
        Of the layer (m).
    curve : MasterCurve
        The dimensionless relation.
    resolution : Resolution or None
        Nodes of the solution behind the curve; None where there is no layer effect.
    """

    indenter: Indenter
    theta: float
    thickness: float
    curve: MasterCurve
    resolution: Resolution | None

    @property
    def _beyond(self) -> str:
        return "the law was solved up to there; build it with a larger max_depth"

    def _force(self, depth: FloatArray) -> FloatArray:
        radius = self.indenter.halfspace_radius(depth)
        force = self.curve.factor(Factor.FORCE, radius / self.thickness)
        force *= _halfspace_force(self.indenter, depth, radius)
        force *= 4.0 * self.theta
        return force

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        radius = self.indenter.halfspace_radius(depth)
        return radius * self.curve.factor(Factor.RADIUS, radius / self.thickness)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        radius = self.indenter.halfspace_radius(depth)
        varpi = radius / self.thickness
        kappa = self.curve.factor(Factor.STIFFNESS, varpi) * self.curve.factor(Factor.RADIUS, varpi)
        return (4.0 * self.theta) * radius * kappa


def _halfspace_force(indenter: Indenter, depth: FloatArray, radius: FloatArray) -> FloatArray:
    """P/(4 theta) on a half-space at `depth` (m), where the contact radius is `radius` (m)."""
    if isinstance(indenter, PowerLawShape):
        return (indenter.exponent / (indenter.exponent + 1.0)) * depth * radius
    return depth * radius - indenter.abel_moments(radius)[0]


def exact_law(
    indenter: Indenter,
    layer: Layer,
    substrate: Substrate | None,
    *,
    max_depth: float,
    rtol: float = 1e-6,
) -> ExactLaw:
    """Solve the contact problem for depths up to `max_depth` (m) at relative error `rtol`.

    Raises
    ------
    RangeError
        If the contact radius would pass 20 thicknesses, or the end of the indenter's shape.
    """
    problem = _Problem.of(indenter, layer, substrate)
    top = float(indenter.halfspace_radius(np.array([max_depth]))[0]) / layer.thickness
    if top == 0.0 or problem.outer == problem.inner:
        resolution, curve = None, MasterCurve.constant(max(top, 1.0), np.zeros(3))
        error, reason = 0.0, "exact contact problem, no layer effect: a half-space"
    elif isinstance(indenter, FlatPunch):
        resolution = Resolution.choose(problem.pair, top, rtol)
        punch = PunchSolution.solve(problem.inner, problem.outer, np.array([top]), resolution)
        log_kappa = float(np.log(punch.kappa[0]))
        curve, error = MasterCurve.constant(top, np.array([0.0, log_kappa, log_kappa])), 0.3 * rtol
        reason = f"exact contact problem, a/h = {top:.3g}, {resolution.radial} nodes"
    else:
        curve, resolution, eps = _solve_curve(problem, max_depth, top, rtol)
        error = 0.3 * rtol + curve.error_estimate
        reason = f"exact contact problem, a/h up to {eps:.3g}, {resolution.radial} nodes"
    return ExactLaw(
        method="exact",
        reason=reason,
        max_depth=max_depth,
        error_estimate=error,
        indenter=indenter,
        theta=float(problem.inner.theta),
        thickness=layer.thickness,
        curve=curve,
        resolution=resolution,
    )


@dataclass(frozen=True)
class _Problem:
    """A shape over a thickness, and what the solver needs of the materials."""

    indenter: Indenter
    thickness: float
    inner: PlaneConstants
    outer: PlaneConstants | None
    pair: Pair

    @classmethod
    def of(cls, indenter: Indenter, layer: Layer, substrate: Substrate | None) -> Self:
        inner = layer.material.plane_constants
        outer = inner if substrate is None else None
        if not isinstance(substrate, Rigid | None):
            outer = substrate.plane_constants
        return cls(indenter, layer.thickness, inner, outer, Pair.of(inner, outer))

    @property
    def exponent(self) -> float:
        """Lambda of the shape, or of the paraboloid where the shape is not a power law."""
        return self.indenter.exponent if isinstance(self.indenter, PowerLawShape) else 2.0

    def solve(self, eps: FloatArray, resolution: Resolution) -> tuple[FloatArray, FloatArray]:
        """Varpi (radii,) and the logarithms of the three factors (radii, 3) at contact radii `eps`."""
        punch = PunchSolution.solve(self.inner, self.outer, eps, resolution)
        factors = np.empty((eps.size, len(Factor)))
        factors[:, Factor.STIFFNESS] = punch.kappa
        if isinstance(self.indenter, PowerLawShape):
            exponent = self.indenter.exponent
            depth, force = punch.depth_and_force(punch.rule.power_weights(exponent))
            swell = depth ** (1.0 / exponent)
            factors[:, Factor.RADIUS] = 1.0 / swell
            factors[:, Factor.FORCE] = (1.0 + 1.0 / exponent) * force / (depth * swell)
            return eps * swell, np.log(factors, out=factors)
        lengths = eps * self.thickness
        shape = self.indenter.abel(lengths)
        weights = _shape_weights(self.indenter, punch.rule, lengths) / shape[:, None]
        depth, force = punch.depth_and_force(weights)
        depth *= shape
        halfspace = self.indenter.halfspace_radius(depth)
        factors[:, Factor.RADIUS] = lengths / halfspace
        factors[:, Factor.FORCE] = force * shape * lengths / _halfspace_force(self.indenter, depth, halfspace)
        return halfspace / self.thickness, np.log(factors, out=factors)


def _solve_curve(
    problem: _Problem, max_depth: float, top: float, rtol: float
) -> tuple[MasterCurve, Resolution, float]:
    """Solve for varpi up to `top`; also returns the resolution and the largest eps."""
    guess = _RadiusGuess.of(problem)
    end = min(problem.indenter.max_radius / problem.thickness, LARGEST_EPS)
    eps = guess.eps(top)
    if eps > end:
        eps = end
        _check_reach(problem, max_depth, top, end, rtol)
    if problem.pair.ratio > _SOFT:
        terms = curve_terms(problem.pair, top, problem.exponent, rtol)
        while terms <= MOST_TERMS:
            resolution = Resolution.choose(problem.pair, eps, rtol)
            targets = Stretch(top, 0.0).v(np.cos(chebyshev_angles(terms)))
            varpi, logarithms = problem.solve(guess.eps(targets) * (eps / guess.eps(top)), resolution)
            if varpi[-1] < _SHORT * targets[-1] and eps < end:
                eps = min(1.1 * eps * targets[-1] / varpi[-1], end)
                continue
            curve = MasterCurve.through(varpi, logarithms, top)
            if curve.error_estimate <= 0.6 * rtol:
                return curve, resolution, eps
            terms += 4
    elif eps > _FAR:
        coarse = _solve_series(problem, eps, _COARSE)[0]
        branches = coarse.branches()
        if len(branches) == 1 and branches[0].varpi[-1] > top:
            eps = min(eps, 1.05 * float(coarse.radius(np.array([top]), branches[0])[0]))
    while True:
        series, resolution = _solve_series(problem, eps, rtol)
        if eps == end or series.varpi(np.array([eps]))[0] >= top:
            return series.inverted(top, 0.25 * rtol), resolution, eps
        eps = min(1.25 * eps, end)


def _solve_series(problem: _Problem, eps: float, rtol: float) -> tuple[RadiusSeries, Resolution]:
    """Solve at Chebyshev points up to `eps` and expand in the radius."""
    stretch = Stretch(eps, problem.pair.softness)
    resolution = Resolution.choose(problem.pair, eps, rtol)
    angles = chebyshev_angles(series_terms(problem.pair, eps, rtol))
    _, logarithms = problem.solve(stretch.v(np.cos(angles)), resolution)
    # The series holds ln(varpi/eps), the curve ln(eps/varpi).
    logarithms[:, Factor.RADIUS] *= -1.0
    return RadiusSeries(stretch, chebyshev_coefficients(logarithms, angles)), resolution


def _check_reach(problem: _Problem, max_depth: float, top: float, end: float, rtol: float) -> None:
    """Raise if varpi = `top` asks for a contact radius beyond `end` thicknesses."""
    last = float(problem.solve(np.array([end]), Resolution.choose(problem.pair, end, rtol))[0][0])
    if last < top:
        deepest = float(problem.indenter.abel(np.array([last * problem.thickness]))[0])
        if end < LARGEST_EPS:
            why = (
                "there the contact reaches the end of the indenter's shape; use a larger radius or less depth"
            )
        else:
            why = (
                f"there the contact radius is {LARGEST_EPS:g} thicknesses; use less depth, or for contacts as "
                "wide as that the half-space law of the substrate"
            )
        raise RangeError(
            f"depth {max_depth:.6g} m is beyond the largest that works here, {deepest:.6g} m: {why}",
            max_depth=deepest,
        )


# Points that stop this much short of the wanted range would leave the polynomial to extrapolate.
_SHORT = 0.99
# A substrate softer than the layer makes contacts smaller than the guess: beyond this a/h it pays to look first.
_FAR = 0.5
_COARSE = 1e-2
# Below this ratio of theta, varpi(eps) bends too much for points placed without knowing it.
_SOFT = 0.3


@dataclass(frozen=True)
class _RadiusGuess:
    """Contact radius against varpi, a little too large: eps = varpi (1 + gain rate varpi/(1 + rate varpi)).

    The gain is that of a thin incompressible layer on a rigid base, a = (F_2 (lambda+2)/2)^(1/lambda) a_half;
    the rate is fitted. An incompressible layer on a rigid base is met within 3 %; nothing goes beyond it.
    """

    gain: float
    rate: float

    @classmethod
    def of(cls, problem: _Problem) -> Self:
        exponent = problem.exponent
        gain = (0.5 * abel_factor(exponent) * (exponent + 2.0)) ** (1.0 / exponent) - 1.0
        gain *= 0.66 + 0.34 * problem.pair.firmness
        return cls(gain * max(0.0, 1.0 - 1.0 / problem.pair.ratio), 0.72 * (2.0 / exponent) ** 0.4)

    def eps(self, varpi: Any) -> Any:
        share = self.rate * varpi
        return varpi * (1.0 + self.gain * share / (1.0 + share))


def _shape_weights(indenter: Indenter, rule: EvenRule, lengths: FloatArray) -> FloatArray:
    """Weights (radii, nodes) of int_0^1 H(a x) p(x) dx for any shape, at contact radii `lengths` (m).

    A smooth step bunches the nodes at both ends, where H may be |x|^lambda or nearly singular.
    """
    s, weights = legendre_rule(40)
    s = 0.5 * (s + 1.0)
    fine = s**3 * (10.0 - s * (15.0 - 6.0 * s))
    weights = 0.5 * weights * 30.0 * (s * (1.0 - s)) ** 2
    project = even_legendre(fine, rule.nodes.size) @ rule.projection
    return (indenter.abel(np.multiply.outer(lengths, fine)) * weights) @ project
