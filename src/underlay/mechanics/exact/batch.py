"""The exact contact problem for many parameter sets at once, as samplers and maps need it.

All sets share the contact radii, the nodes and the cosines cos(eps x u): only the weights 1 - L(u) change
with the materials, so one matrix product builds every kernel and one batched solve serves every set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.exact.contact_curve import SHARE_OF_NODES, solve_curve
from underlay.mechanics.exact.contact_problem import ContactProblem, contact_factors
from underlay.mechanics.exact.curve_batch import CurveBatch, curves_through
from underlay.mechanics.exact.gauss import EvenRule, even_rule
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    Stretch,
    chebyshev_angles,
)
from underlay.mechanics.exact.nodes import curve_terms
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.kernel import Kernel, LayerKernel
from underlay.mechanics.plane_constants import PlaneConstants

__all__ = ["ExactBatch", "thickness_derivative"]

# Products of cosines that a batch may ask for, at some 0.1 s a set, and up to which they are kept, 16 MB, for every
# set to share: more take longer to make and to read again than a set takes that forms its own sums.
_MOST_PRODUCTS, _KEPT_PRODUCTS = 50_000_000, 2_000_000
_MARGIN = 1.06


@dataclass(frozen=True)
class ExactBatch:
    """The exact contact problem of one shape, compiled for parameter sets up to a largest varpi.

    Compile it once, at the middle of the parameters to come; call `curves` for every batch of materials.

    Parameters
    ----------
    indenter : Indenter
        Shape; its size may change from set to set through `CurveBatch.force` if it is a power law.
    measure : PowerLawShape
        Power law that measures depth.
    top : float
        Largest varpi.
    rtol : float
        Relative error asked for.
    eps : ndarray (radii,)
        Contact radii over thickness.
    rule : EvenRule
        Nodes in r/a.
    u, weights : ndarray (wavenumbers,)
        Nodes and weights in u.
    waves : ndarray (radii, wavenumbers, nodes + 1)
        sqrt(eps) cos(eps x_i u), with the edge x = 1 as the last i.
    products : ndarray (wavenumbers, radii (nodes + 1) nodes) or None
        eps cos(eps x_i u) cos(eps x_j u); None where they would be too many to keep.
    """

    indenter: Indenter
    measure: PowerLawShape
    top: float
    rtol: float
    eps: FloatArray
    rule: EvenRule
    u: FloatArray
    weights: FloatArray
    waves: FloatArray
    products: FloatArray | None

    @classmethod
    def compile(
        cls,
        indenter: Indenter,
        inner: PlaneConstants,
        outer: PlaneConstants | None,
        *,
        thickness: float,
        max_depth: float,
        rtol: float = 1e-6,
    ) -> Self:
        """Place the nodes, for materials near `inner` on `outer` (None: rigid).

        Parameters
        ----------
        thickness : float
            Of the thinnest layer (m).
        max_depth : float
            Largest depth (m).

        Raises
        ------
        RangeError
            If the contact radius would pass 20 thicknesses, or the end of the indenter's shape, or the batch
            would not fit into memory.
        """
        kernel = LayerKernel(inner, outer)
        return cls.compile_for(indenter, kernel, thickness=thickness, max_depth=max_depth, rtol=rtol)

    @classmethod
    def compile_for(
        cls, indenter: Indenter, kernel: Kernel, *, thickness: float, max_depth: float, rtol: float = 1e-6
    ) -> Self:
        """Place the nodes for bodies near that of `kernel`; otherwise as `compile`."""
        problem = ContactProblem.of(indenter, thickness, kernel)
        top = float(problem.measure.halfspace_radius(np.array([max_depth]))[0]) / thickness
        solved = solve_curve(problem, top, rtol)
        terms = min(curve_terms(problem.scales, top, problem.measure.exponent, rtol) + 1, MOST_TERMS)
        # The radii of a power law go a little further, with a term more, for sets whose contact is narrower: a
        # polynomial soon errs beyond its points.
        margin = _MARGIN if indenter is problem.measure else 1.0
        targets = Stretch.to(margin * top, 0.0).v(np.cos(chebyshev_angles(terms)))
        eps = targets * solved.curve.factor(Factor.RADIUS, targets)
        resolution = proved_resolution(kernel, solved.eps, rtol)
        u, weights = resolution.wavenumber_rule()
        rule = even_rule(resolution.radial)
        count = rule.nodes.size
        count_of_products = u.size * eps.size * count * (count + 1)
        if count_of_products > _MOST_PRODUCTS:
            raise RangeError(
                f"a batch would ask for {u.size} x {eps.size} x {count} x {count + 1} products of waves, and the "
                f"most is {_MOST_PRODUCTS:.0e}: solve one set of materials at a time"
            )
        waves = np.cos(np.multiply.outer(eps, np.multiply.outer(u, rule.with_edge)))
        waves *= np.sqrt(eps)[:, None, None]
        products = None
        if count_of_products <= _KEPT_PRODUCTS:
            by_wave = np.ascontiguousarray(waves.transpose(1, 0, 2))
            products = (by_wave[..., :, None] * by_wave[..., None, :-1]).reshape(u.size, -1)
        return cls(indenter, problem.measure, top, rtol, eps, rule, u, weights, waves, products)

    def curves(
        self, inner: PlaneConstants, outer: PlaneConstants | None, thickness: FloatArray | float = 1.0
    ) -> CurveBatch:
        """Solve for a batch of materials.

        Parameters
        ----------
        inner, outer : PlaneConstants
            Of the layer and of the substrate, entries (sets, 1) or floats; `outer` None is rigid.
        thickness : ndarray (sets,), optional
            Of the layers (m): needed only where the indenter is not a power law.
        """
        return self.curves_of(LayerKernel(inner, outer).values(self.u), thickness)

    def curves_of(self, kernels: FloatArray, thickness: FloatArray | float = 1.0) -> CurveBatch:
        """Solve for a batch of bodies by their 1 - L at `u`, (sets, wavenumbers) or (wavenumbers,)."""
        punch = self._punch(kernels)
        lengths = np.reshape(np.asarray(thickness, dtype=np.float64), (-1, 1))
        # A set whose radii pass the end of the shape is solved on the thickest layer that fits, and marked.
        thickest = self.indenter.max_radius / float(self.eps.max())
        varpi, logarithms = contact_factors(punch, self.indenter, self.measure, np.minimum(lengths, thickest))
        batch = curves_through(self.measure, varpi, logarithms, self.top)
        errors = SHARE_OF_NODES * self.rtol + batch.error_estimate
        return replace(batch, error_estimate=np.where(lengths[:, 0] > thickest, np.inf, errors))

    def _punch(self, kernels: FloatArray) -> PunchSolution:
        strength = (2.0 / np.pi) * self.weights * np.atleast_2d(kernels)
        count, radii = self.rule.nodes.size, self.eps.size
        if self.products is not None:
            kernel = (strength @ self.products).reshape(-1, radii, count + 1, count)
        else:
            sums = [self.waves.transpose(0, 2, 1) @ (self.waves[..., :-1] * one[:, None]) for one in strength]
            kernel = np.array(sums)
        matrix = kernel[:, :, :count] * -self.rule.weights
        matrix.reshape(-1, radii, count * count)[:, :, :: count + 1] += 1.0
        sides = np.ones((*kernel.shape[:2], count, 2))
        sides[..., 1] = kernel[:, :, count]
        solved: FloatArray = np.asarray(np.linalg.solve(matrix, sides), dtype=np.float64)
        g = solved[..., 0]
        return PunchSolution(self.eps, self.rule, g, solved[..., 1], g @ self.rule.weights)


def thickness_derivative(
    force: FloatArray, stiffness: FloatArray, depth: FloatArray, thickness: FloatArray, exponent: float
) -> FloatArray:
    """dP/dh (N/m) at fixed depth and materials, for a power-law shape.

    P/(theta A h^(lambda+1)) depends on varpi alone, and varpi on w and h through w^(1/lambda)/h; hence
    h dP/dh = (lambda+1) P - lambda w dP/dw. All arrays of one shape, or broadcasting.
    """
    return ((exponent + 1.0) * force - exponent * depth * stiffness) / thickness
