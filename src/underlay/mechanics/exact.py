"""The exact contact problem: the Fredholm equation of a layer on a substrate, solved spectrally.

Formula: `punch_solution` (the equation) and `master_curve` (the relation it gives). Assumes a frictionless,
rigid, axisymmetric indenter whose contact is one disc, small strains, and a bonded interface. Range: a/h up
to 20.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.gauss import even_legendre, legendre_rule, power_weights
from underlay.mechanics.indenters import FlatPunch, Indenter, PowerLawShape, abel_factor
from underlay.mechanics.master_curve import (
    Factor,
    MasterCurve,
    RadiusSeries,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
)
from underlay.mechanics.materials import Layer, PlaneConstants, Rigid, Substrate
from underlay.mechanics.punch_solution import PunchSolution, Resolution, slowest_decay, stiffness_ratio

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
    resolution : Resolution
        Nodes of the solution behind the curve.
    radii : int
        Contact radii solved for.
    """

    indenter: Indenter
    theta: float
    thickness: float
    curve: MasterCurve
    resolution: Resolution
    radii: int

    @property
    def _beyond(self) -> str:
        return "the law was solved up to there; build it with a larger max_depth"

    def _force(self, depth: FloatArray) -> FloatArray:
        radius = self.indenter.halfspace_radius(depth)
        factor = self.curve.factor(Factor.FORCE, radius / self.thickness)
        factor *= _halfspace_force(self.indenter, depth, radius)
        factor *= 4.0 * self.theta
        return factor

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
    inner = layer.material.plane_constants
    outer = inner if substrate is None else None if isinstance(substrate, Rigid) else substrate.plane_constants
    pair = (inner, outer)
    top = float(indenter.halfspace_radius(np.array([max_depth]))[0]) / layer.thickness
    decay, ratio = slowest_decay(inner), stiffness_ratio(*pair)
    if top == 0.0 or outer == inner:
        resolution, radii = Resolution(0, 0, 1.0, 1.0), 0
        curve, error = MasterCurve.constant(max(top, 1.0), np.zeros(3)), 0.0
        reason = "exact contact problem, no layer effect: a half-space"
    elif isinstance(indenter, FlatPunch):
        resolution, radii = Resolution.choose(top, rtol, decay, ratio), 1
        log_kappa = float(np.log(PunchSolution.solve(*pair, np.array([top]), resolution).kappa[0]))
        curve, error = MasterCurve.constant(top, np.array([0.0, log_kappa, log_kappa])), 0.3 * rtol
        reason = f"exact contact problem, a/h = {top:.3g}, {resolution.radial} nodes"
    else:
        limit = min(LARGEST_EPS, indenter.max_radius / layer.thickness)
        eps = min(_first_guess(indenter, layer.thickness, max_depth, ratio), limit)
        series, resolution = _solve_series(indenter, layer.thickness, pair, eps, rtol)
        while (reached := series.varpi(np.array([series.stretch.top]))[0]) < top:
            if eps >= limit:
                raise _out_of_range(indenter, layer.thickness, max_depth, float(reached), eps)
            eps = min(1.25 * eps, limit)
            series, resolution = _solve_series(indenter, layer.thickness, pair, eps, rtol)
        curve = MasterCurve.invert(series, top, 0.25 * rtol)
        radii, error = series.coefficients.shape[0], 0.3 * rtol + series.tail + curve.error_estimate
        reason = f"exact contact problem, a/h up to {eps:.3g}, {resolution.radial} nodes, {radii} radii"
    return ExactLaw(
        method="exact",
        reason=reason,
        max_depth=max_depth,
        error_estimate=error,
        indenter=indenter,
        theta=float(inner.theta),
        thickness=layer.thickness,
        curve=curve,
        resolution=resolution,
        radii=radii,
    )


def _out_of_range(
    indenter: Indenter, thickness: float, depth: float, varpi: float, eps: float
) -> RangeError:
    deepest = float(indenter.abel(np.array([varpi * thickness]))[0])
    end = (
        "the end of the indenter's shape; use a larger radius or less depth"
        if eps < LARGEST_EPS
        else f"a/h = {LARGEST_EPS:g}, the thinnest layer that is solved for; use less depth"
    )
    return RangeError(
        f"depth {depth:.6g} m is beyond the largest that works here, {deepest:.6g} m, where the contact "
        f"reaches {end}",
        max_depth=deepest,
    )


def _first_guess(indenter: Indenter, thickness: float, depth: float, ratio: float) -> float:
    """Contact radius over thickness at `depth`, a little too large.

    With w = s(eps) H(a), s falls no faster than for an incompressible layer on a rigid base: first order in
    eps, s = 1/(1 + c eps) with c = (2 a_0/pi) lambda/(lambda+1), and never below the thin-layer limit
    s = 2/((lambda+2) F_2). A softer substrate raises s above 1.
    """
    exponent = indenter.exponent if isinstance(indenter, PowerLawShape) else 2.0
    floor = 2.0 / ((exponent + 2.0) * abel_factor(exponent))
    slope = max(0.0, 1.0 - 1.0 / ratio) * 1.127 * exponent / (exponent + 1.0)
    radius = float(indenter.halfspace_radius(np.array([depth]))[0])
    for _ in range(6):
        share = max(floor, 1.0 / (1.0 + slope * radius / thickness))
        radius = float(indenter.halfspace_radius(np.array([depth / share]))[0])
    return min(1.02 * radius, indenter.max_radius) / thickness


def _solve_series(
    indenter: Indenter,
    thickness: float,
    pair: tuple[PlaneConstants, PlaneConstants | None],
    eps: float,
    rtol: float,
) -> tuple[RadiusSeries, Resolution]:
    """Solve at Chebyshev points up to `eps` and expand the three logarithms."""
    ratio = stiffness_ratio(*pair)
    softness = 0.0 if ratio >= 1.0 else ratio ** (-2.0 / 3.0) - 1.0
    stretch = Stretch(eps, softness)
    digits = 0.5 - np.log10(rtol)
    angles = chebyshev_angles(int(np.ceil(digits * (1.2 + 0.6 * stretch.length))))
    radii = stretch.v(np.cos(angles))
    resolution = Resolution.choose(eps, rtol, slowest_decay(pair[0]), ratio)
    punch = PunchSolution.solve(*pair, radii, resolution)
    lengths = radii * thickness
    shape = indenter.abel(lengths)
    if isinstance(indenter, PowerLawShape):
        weights = power_weights(punch.x, punch.weights, indenter.exponent)
    else:
        weights = _shape_weights(indenter, punch, lengths) / shape[:, None]
    depth, force = punch.depth_and_force(weights)
    depth *= shape
    halfspace = indenter.halfspace_radius(depth)
    values = np.empty((radii.size, 3))
    values[:, 0] = halfspace / lengths
    values[:, 1] = force * shape * lengths / _halfspace_force(indenter, depth, halfspace)
    values[:, 2] = punch.kappa
    return RadiusSeries(stretch, chebyshev_coefficients(np.log(values), angles)), resolution


def _shape_weights(indenter: Indenter, punch: PunchSolution, lengths: FloatArray) -> FloatArray:
    """Weights (radii, nodes) of int_0^1 H(a x) p(x) dx for any shape, at contact radii `lengths` (m).

    A smooth step bunches the nodes at both ends, where H may be |x|^lambda or nearly singular.
    """
    s, weights = legendre_rule(40)
    s = 0.5 * (s + 1.0)
    fine = s**3 * (10.0 - s * (15.0 - 6.0 * s))
    weights = 0.5 * weights * 30.0 * (s * (1.0 - s)) ** 2
    count = punch.x.size
    project = even_legendre(fine, count) @ (
        (4.0 * np.arange(count) + 1.0)[:, None] * (even_legendre(punch.x, count).T * punch.weights)
    )
    return (indenter.abel(np.multiply.outer(lengths, fine)) * weights) @ project
