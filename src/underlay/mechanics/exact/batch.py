"""The exact contact problem for many parameter sets at once, as samplers and maps need it.

All sets share the contact radii, the nodes and the cosines cos(eps x u): only the weights 1 - L(u) change
with the materials, so one matrix product builds every kernel and one batched solve serves every set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi
from typing import Self

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import RangeError
from underlay.mechanics.exact.contact_curve import (
    SHARE_OF_NODES,
    ContactProblem,
    contact_factors,
    solve_curve,
)
from underlay.mechanics.exact.gauss import EvenRule, even_rule
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    Stretch,
    chebyshev_angles,
    in_powers,
    polynomial,
    truncation_error,
)
from underlay.mechanics.exact.nodes import Resolution, curve_terms
from underlay.mechanics.exact.punch_solution import PunchSolution
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.kernel import one_minus_L
from underlay.mechanics.materials import PlaneConstants

__all__ = ["CurveBatch", "ExactBatch", "thickness_derivative"]

# Depths times sets evaluated at a time: what fits the processor's cache.
_CHUNK = 4096


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
    products : ndarray (wavenumbers, radii (nodes + 1) nodes)
        eps cos(eps x_i u) cos(eps x_j u), with the edge x = 1 as the last i.
    """

    indenter: Indenter
    measure: PowerLawShape
    top: float
    rtol: float
    eps: FloatArray
    rule: EvenRule
    u: FloatArray
    weights: FloatArray
    products: FloatArray

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
            If the contact radius would pass 20 thicknesses, or the end of the indenter's shape.
        """
        problem = ContactProblem.of(indenter, thickness, inner, outer)
        top = float(problem.measure.halfspace_radius(np.array([max_depth]))[0]) / thickness
        solved = solve_curve(problem, top, rtol)
        terms = min(curve_terms(problem.pair, top, problem.measure.exponent, rtol), MOST_TERMS)
        targets = Stretch.to(top, 0.0).v(np.cos(chebyshev_angles(terms)))
        eps = targets * solved.curve.factor(Factor.RADIUS, targets)
        resolution = Resolution.choose(problem.pair, solved.eps, rtol)
        u, weights = resolution.wavenumber_rule()
        rule = even_rule(resolution.radial)
        waves = np.cos(np.multiply.outer(u, np.multiply.outer(eps, rule.with_edge)))
        products = eps[:, None, None] * waves[..., :, None] * waves[..., None, :-1]
        return cls(indenter, problem.measure, top, rtol, eps, rule, u, weights, products.reshape(u.size, -1))

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
        punch = self._punch(inner, outer)
        lengths = np.reshape(np.asarray(thickness, dtype=np.float64), (-1, 1))
        # A set whose radii pass the end of the shape is solved on the thickest layer that fits, and marked.
        thickest = self.indenter.max_radius / float(self.eps.max())
        varpi, logarithms = contact_factors(punch, self.indenter, self.measure, np.minimum(lengths, thickest))
        # As in MasterCurve.through, for every set at once.
        radii = self.eps.size
        reach = np.arcsinh(varpi[:, -1:]) * (2.0 / (1.0 + cos(0.5 * pi / radii)))
        reach = np.maximum(reach, np.arcsinh(self.top))
        angles = np.arccos(2.0 / reach * np.arcsinh(varpi) - 1.0)
        basis = np.cos(angles[..., None] * np.arange(radii))
        coefficients: FloatArray = np.asarray(np.linalg.solve(basis, logarithms), dtype=np.float64)
        errors = SHARE_OF_NODES * self.rtol + truncation_error(coefficients)
        errors = np.where(lengths[:, 0] > thickest, np.inf, errors)
        return CurveBatch(self.measure, self.top, reach, in_powers(coefficients), errors)

    def _punch(self, inner: PlaneConstants, outer: PlaneConstants | None) -> PunchSolution:
        strength = (2.0 / np.pi) * self.weights * np.atleast_2d(one_minus_L(self.u, inner, outer))
        count, radii = self.rule.nodes.size, self.eps.size
        kernel = (strength @ self.products).reshape(-1, radii, count + 1, count)
        matrix = kernel[:, :, :count] * -self.rule.weights
        matrix.reshape(-1, radii, count * count)[:, :, :: count + 1] += 1.0
        sides = np.ones((*kernel.shape[:2], count, 2))
        sides[..., 1] = kernel[:, :, count]
        solved: FloatArray = np.asarray(np.linalg.solve(matrix, sides), dtype=np.float64)
        g = solved[..., 0]
        return PunchSolution(self.eps, self.rule, g, solved[..., 1], g @ self.rule.weights)


@dataclass(frozen=True)
class CurveBatch:
    """Master curves of many parameter sets, one polynomial each.

    Parameters
    ----------
    measure : PowerLawShape
        Shape that measures depth.
    top : float
        Largest varpi.
    lengths : ndarray (sets, 1)
        Length of the variable arcsinh(varpi) of each curve.
    coefficients : ndarray (sets, 3, rows, 4)
        As in `MasterCurve`.
    error_estimate : ndarray (sets,)
        Relative error of each; above the `rtol` of the batch where a set's materials lie too far from those
        it was compiled for: solve such a set alone.
    """

    measure: PowerLawShape
    top: float
    lengths: FloatArray
    coefficients: FloatArray
    error_estimate: FloatArray

    def force(
        self,
        depth: ArrayLike,
        theta: FloatArray,
        thickness: FloatArray,
        abel_coefficient: FloatArray | None = None,
    ) -> FloatArray:
        """Forces (N), shape (sets, n); zero where the depth is not positive.

        Parameters
        ----------
        depth : array_like (n,) or (sets, n)
            Indentation depths (m).
        theta, thickness : ndarray (sets,)
            Elastic constant (Pa) and thickness (m) of the layers.
        abel_coefficient : ndarray (sets,), optional
            A F_2(lambda) of the shapes, where they differ from the compiled one.

        Raises
        ------
        RangeError
            If a depth is beyond what was compiled for.
        """
        exponent = self.measure.exponent
        scale = 4.0 * theta * exponent / (exponent + 1.0)
        return self._evaluate(depth, thickness, abel_coefficient, (Factor.FORCE,), scale, with_depth=True)

    def stiffness(
        self,
        depth: ArrayLike,
        theta: FloatArray,
        thickness: FloatArray,
        abel_coefficient: FloatArray | None = None,
    ) -> FloatArray:
        """dP/dw (N/m), shape (sets, n); arguments and errors as for `force`."""
        factors = (Factor.RADIUS, Factor.STIFFNESS)
        return self._evaluate(depth, thickness, abel_coefficient, factors, 4.0 * theta, with_depth=False)

    def _evaluate(
        self,
        depth: ArrayLike,
        thickness: FloatArray,
        abel_coefficient: FloatArray | None,
        factors: Sequence[Factor],
        scale: FloatArray,
        *,
        with_depth: bool,
    ) -> FloatArray:
        """Half-space radius times the factors times `scale`, and times the depth where asked."""
        w = as_finite(depth, "depth")
        touching = np.maximum(w, 0.0)
        exponent = self.measure.exponent
        if abel_coefficient is None:
            radius, per_set = self.measure.halfspace_radius(touching), np.ones_like(thickness)
        else:
            radius, per_set = touching ** (1.0 / exponent), abel_coefficient ** (-1.0 / exponent)
        radius, w = np.atleast_2d(radius), np.atleast_2d(touching)
        to_varpi = per_set / thickness
        self._check(radius, to_varpi)
        sets, size = thickness.size, radius.shape[-1]
        result = np.empty((sets, size))
        # The sum of the factors' logarithms is one polynomial.
        table = self.coefficients[:, factors[0]]
        for factor in factors[1:]:
            table = table + self.coefficients[:, factor]
        step = max(1, _CHUNK // max(size, 1))
        for start in range(0, sets, step):
            part = slice(start, min(start + step, sets))
            rows = part if radius.shape[0] > 1 else slice(0, 1)
            z = np.arcsinh(radius[rows] * to_varpi[part, None])
            z *= 2.0 / self.lengths[part]
            z -= 1.0
            value = polynomial(table[part], z)
            np.exp(value, out=value)
            value *= radius[rows]
            value *= (scale * per_set)[part, None]
            if with_depth:
                value *= w[rows]
            result[part] = value
        return result

    def _check(self, radius: FloatArray, to_varpi: FloatArray) -> None:
        deepest = float((radius.max(axis=-1) * to_varpi).max(initial=0.0))
        if deepest > self.top * (1.0 + 1e-12):
            raise RangeError(
                f"varpi = {deepest:.6g} is beyond {self.top:.6g}, which the batch was compiled for: compile "
                "it with a larger max_depth or a smaller thickness"
            )


def thickness_derivative(
    force: FloatArray, stiffness: FloatArray, depth: FloatArray, thickness: FloatArray, exponent: float
) -> FloatArray:
    """dP/dh (N/m) at fixed depth and materials, for a power-law shape.

    P/(theta A h^(lambda+1)) depends on varpi alone, and varpi on w and h through w^(1/lambda)/h; hence
    h dP/dh = (lambda+1) P - lambda w dP/dw. All arrays of one shape, or broadcasting.
    """
    return ((exponent + 1.0) * force - exponent * depth * stiffness) / thickness
