"""A shape over a thickness, on a body: what is asked of it, and its solution at given contact radii."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.contact import Beside
from underlay.mechanics.exact.gauss import EvenRule, even_legendre, even_rule, legendre_rule
from underlay.mechanics.exact.master_curve import Factor
from underlay.mechanics.exact.nodes import Resolution
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution
from underlay.mechanics.exact.tables import TABLES
from underlay.mechanics.indenters import Indenter, PowerLaw, PowerLawShape, Sphere, abel_factor
from underlay.mechanics.kernel import Kernel, Scales
from underlay.mechanics.plane_constants import Real

__all__ = ["LARGEST_EPS", "UNEVEN", "ContactProblem", "contact_factors", "depth_measure"]

#: Largest contact radius over thickness that is solved for.
LARGEST_EPS = 20.0

# Towards a sphere's equator the coefficients fall unevenly, and a pole is near: up to 8 times the
# estimate was measured, over layers of R/3 to 10 R on bases of 0.03 of the layer's modulus to rigid.
UNEVEN = 8.0
# Gauss nodes of int H p dx for a shape that is not a power law: the sphere's H is analytic, a measured tip's
# has corners in its derivatives.
_SMOOTH_NODES, _MEASURED_NODES = 40, 240
# Cosines beyond which contacts are solved for octave by octave of their radii, at most so many: a film on a base
# 1e6 times softer takes 79 x 440 for each of a hundred radii at a/h = 20, and 10 x 60 at a/h = 2.
_MUCH, _MOST_OCTAVES = 500_000, 5.0


@dataclass(frozen=True)
class ContactProblem:
    """A shape over a thickness, on a body.

    Parameters
    ----------
    indenter : Indenter
        Any shape but the flat punch.
    measure : PowerLawShape
        Power law that measures depth: varpi is its half-space radius over the thickness.
    thickness : float
        Of the layer (m).
    kernel : Kernel
        Of the body.
    scales : Scales
        Its own: what the node counts depend on.
    beside : tuple of Beside
        Bodies towards which derivatives are wanted.
    """

    indenter: Indenter
    measure: PowerLawShape
    thickness: float
    kernel: Kernel
    scales: Scales
    beside: tuple[Beside, ...] = ()

    @classmethod
    def of(
        cls, indenter: Indenter, thickness: float, kernel: Kernel, beside: tuple[Beside, ...] = ()
    ) -> Self:
        """Build the problem."""
        return cls(indenter, depth_measure(indenter), thickness, kernel, kernel.scales, beside)

    @property
    def end(self) -> float:
        """Largest chi: a/h = 20, or the end of the shape."""
        return self.chi(min(self.indenter.max_radius / self.thickness, LARGEST_EPS))

    @property
    def unevenness(self) -> float:
        """Factor on estimated truncation errors."""
        return 1.0 if self.indenter is self.measure else UNEVEN

    def chi(self, eps: float) -> float:
        """Radius over thickness at which the measure has the half-space depth H(a) of the indenter.

        It stands for the contact radius in every expansion: where a sphere's H grows without bound, chi does
        too, and varpi(chi) stays smooth.
        """
        if self.indenter is self.measure:
            return eps
        depth = self.indenter.abel(np.array([eps * self.thickness]))
        return float(self.measure.halfspace_radius(depth)[0]) / self.thickness

    def eps(self, chi: FloatArray) -> FloatArray:
        """Contact radius over thickness at `chi`, within the shape."""
        if self.indenter is self.measure:
            return chi
        deepest = self.indenter.abel(np.array(self.indenter.max_radius))
        depth = np.minimum(self.measure.abel(chi * self.thickness), deepest)
        return np.minimum(self.indenter.halfspace_radius(depth), self.indenter.max_radius) / self.thickness

    def guess(self, chi: float, rtol: float) -> Resolution:
        """Nodes for radii up to `chi`, as they were fitted to one layer on a base."""
        return Resolution.choose(self.scales, float(self.eps(np.array([chi]))[0]), rtol)

    def resolution(self, chi: float, rtol: float) -> Resolution:
        """Nodes for radii up to `chi`, proved where they were not fitted to bodies of this kind."""
        return proved_resolution(self.kernel, float(self.eps(np.array([chi]))[0]), rtol)

    def solve(
        self, chi: FloatArray, resolution: Resolution, rtol: float | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Varpi (radii,) and the logarithms of the three factors (radii, 3) at radii `chi`.

        After these, a column each, d ln P/ds at fixed depth towards the bodies beside. With the relative error
        `rtol` for which `resolution` was chosen, narrow contacts among many take the fewer nodes that do for them.
        """
        eps = self.eps(chi)
        if rtol is None or not self.scales.charted or eps.size * resolution.size < _MUCH:
            return self._solved(eps, resolution)
        octaves = np.minimum(np.floor(np.log2(eps.max() / eps)), _MOST_OCTAVES)
        varpi, columns = np.empty(eps.size), np.empty((eps.size, len(Factor) + len(self.beside)))
        for octave in np.unique(octaves):
            rows = octaves == octave
            own = (
                resolution if octave == 0.0 else Resolution.choose(self.scales, float(eps[rows].max()), rtol)
            )
            varpi[rows], columns[rows] = self._solved(eps[rows], own)
        return varpi, columns

    def _solved(self, eps: FloatArray, resolution: Resolution) -> tuple[FloatArray, FloatArray]:
        """The same at contact radii `eps` over the thickness."""
        if not self.beside:
            punch = PunchSolution.solve(self.kernel, eps, resolution)
            return contact_factors(punch, self.indenter, self.measure, self.thickness)
        weights = _weights_over_depth(
            self.indenter, self.measure, even_rule(resolution.radial), eps * self.thickness
        )
        u = resolution.wavenumber_rule()[0]
        here, there = self.kernel.values(u), [body.kernel.values(u * body.thickness) for body in self.beside]
        punch = PunchSolution.solve(self.kernel, eps, resolution, weights, values=here)
        varpi, logarithms = contact_factors(punch, self.indenter, self.measure, self.thickness)
        steps = np.array([body.step for body in self.beside])
        moved = punch.in_kernel @ ((np.array(there) - here).T / steps)
        moved /= punch.depth_and_force(weights)[1][:, None]
        moved += np.array([body.log_theta for body in self.beside]) / steps
        return varpi, np.concatenate((logarithms, moved), axis=1)


def contact_factors(
    punch: PunchSolution,
    indenter: Indenter,
    measure: PowerLawShape,
    thickness: Real,
    lengths: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Varpi (..., radii) and the logarithms of the three factors (..., radii, 3).

    `thickness` (m) is a float, or (batch, 1) with a batch of solutions; `lengths` are the contact radii (m), where
    fewer than there are solutions.
    """
    exponent = measure.exponent
    factors = np.empty((*punch.kappa.shape, len(Factor)))
    factors[..., Factor.STIFFNESS] = punch.kappa
    if lengths is None:
        lengths = punch.eps * thickness
    depth, force = punch.depth_and_force(_weights_over_depth(indenter, measure, punch.rule, lengths))
    if indenter is measure:
        swell = depth ** (1.0 / exponent)
        factors[..., Factor.RADIUS] = 1.0 / swell
        factors[..., Factor.FORCE] = (1.0 + 1.0 / exponent) * force / (depth * swell)
        return punch.eps * swell, np.log(factors, out=factors)
    shape = indenter.abel(lengths)
    depth = depth * shape
    radius = measure.halfspace_radius(depth)
    factors[..., Factor.RADIUS] = lengths / radius
    factors[..., Factor.FORCE] = (1.0 + 1.0 / exponent) * force * shape * lengths / (depth * radius)
    return radius / thickness, np.log(factors, out=factors)


def depth_measure(indenter: Indenter) -> PowerLawShape:
    """Power law whose half-space radius measures depth: the indenter itself, or the apex of another shape.

    Raises
    ------
    InputError
        If the shape is no power law and never ends: nothing says how near its apex is.
    """
    if isinstance(indenter, PowerLawShape):
        return indenter
    if isinstance(indenter, Sphere):
        return indenter.apex
    if not np.isfinite(indenter.max_radius):
        name = type(indenter).__name__
        raise InputError(
            f"{name}.max_radius is {indenter.max_radius!r}, and {name} is no power law: the exact law measures "
            "such a shape up to its largest contact radius. Give the class a finite max_radius (m), e.g. the "
            "radius at which the shank begins, or derive it from PowerLawShape"
        )
    near, far = indenter.abel(indenter.max_radius * np.array([1e-6, 2e-6])).tolist()
    exponent = max(1.0, round(float(np.log2(far / near))))
    deepest = float(indenter.abel(np.array(indenter.max_radius)))
    return PowerLaw(exponent, deepest / (abel_factor(exponent) * indenter.max_radius**exponent))


def _weights_over_depth(
    indenter: Indenter, measure: PowerLawShape, rule: EvenRule, lengths: FloatArray
) -> FloatArray:
    """Weights of int_0^1 H(a x)/H(a) p(x) dx at contact radii `lengths` (m): of a power law (nodes,), for all."""
    if indenter is measure:
        return rule.power_weights(measure.exponent)
    return _shape_weights(indenter, rule, lengths) / indenter.abel(lengths)[..., None]


def _shape_weights(indenter: Indenter, rule: EvenRule, lengths: FloatArray) -> FloatArray:
    """Weights (..., radii, nodes) of int_0^1 H(a x) p(x) dx for any shape, at contact radii `lengths` (m).

    A smooth step bunches the nodes at both ends, where H may be |x|^lambda or nearly singular; p has degree
    2 n - 2, up to n half waves squeezed by two, and takes its share of them.
    """
    count = rule.nodes.size
    nodes = (_SMOOTH_NODES if isinstance(indenter, Sphere) else _MEASURED_NODES) + 4 * count
    fine, project = TABLES.get(("shape", nodes, count), lambda: _shape_rule(nodes, rule))
    return indenter.abel(np.multiply.outer(lengths, fine)) @ project


def _shape_rule(nodes: int, rule: EvenRule) -> tuple[FloatArray, FloatArray]:
    """Nodes x (nodes,), and their weights times the projection on the rule's (nodes, rule)."""
    s, weights = legendre_rule(nodes)
    s = 0.5 * (s + 1.0)
    fine = s**3 * (10.0 - s * (15.0 - 6.0 * s))
    weights = 15.0 * weights * (s * (1.0 - s)) ** 2
    project = even_legendre(fine, rule.nodes.size) @ rule.projection
    return read_only(fine), read_only(weights[:, None] * project)
