"""The exact contact problem for many parameter sets at once, as samplers and maps need it.

All sets share the contact radii, the nodes x = r/a and u (the wavenumber times the thickness), and so the cosines
cos(eps x u), eps = a/h: only the weights 1 - L(u) change with the materials. One matrix product builds every
integral kernel, and one batched solve serves every set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import RangeError
from underlay.mechanics.body import PlaneConstants
from underlay.mechanics.exact.contact_problem import (
    SHARE_OF_NODES,
    ContactProblem,
    contact_factors,
    solve_curve,
)
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    Stretch,
    chebyshev_angles,
    chebyshev_values,
    growth_beyond,
    in_powers,
    polynomial,
    reach,
    truncation_error,
)
from underlay.mechanics.exact.nodes import curve_terms
from underlay.mechanics.exact.punch_solution import PunchGrid, PunchSolution, proved_resolution
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.kernel import Kernel, LayerKernel

# Depths times sets evaluated at a time: fewer cost more in calls, more leave the processor's second cache.
_CHUNK = 16384
# Products of cosines that a batch may ask for, at some 0.1 s a set, and up to which they are kept, 16 MB, for every
# set to share: more take longer to make and to read again than a set takes that forms its own sums.
_MOST_PRODUCTS, _KEPT_PRODUCTS = 50_000_000, 2_000_000
_MARGIN = 1.06


@dataclass(frozen=True)
class CurveBatch:
    """Master curves of many parameter sets, one polynomial each.

    varpi is the contact radius of `measure` on a half-space at the depth over the thickness.

    Parameters
    ----------
    measure : PowerLawShape
        Power law by which depth is made dimensionless.
    top : float or ndarray (sets,)
        Largest varpi for which the curves hold.
    stretch : Stretch
        The variable of the polynomials, ln(1 + rate varpi), with lengths and rates (sets, 1).
    coefficients : ndarray (sets, 3, rows, 4)
        Logarithms of the three factors (see `Factor`) in powers, laid out as in `MasterCurve`.
    error_estimate : ndarray (sets,)
        Relative error of each; above the `rtol` of the batch where a set's materials lie too far from those
        it was compiled for: solve such a set alone.
    slopes : ndarray (sets, numbers, rows, 4), optional
        d ln P/ds at fixed depth for each parameter s in which neighbouring curves differ, laid out likewise.
    """

    measure: PowerLawShape
    top: float | FloatArray
    stretch: Stretch
    coefficients: FloatArray
    error_estimate: FloatArray
    slopes: FloatArray | None = None

    def part(self, rows: slice | list[int]) -> Self:
        """Curves of the sets given by `rows`, a slice or a list of indices."""
        return type(self)(
            self.measure,
            self.top[rows] if isinstance(self.top, np.ndarray) else self.top,
            self.stretch.part(rows),
            self.coefficients[rows],
            self.error_estimate[rows],
            None if self.slopes is None else self.slopes[rows],
        )

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
            Coefficient c of the half-space relation depth = c radius^lambda of each set's tip (A F_2(lambda) for a
            profile A r^lambda), where tips differ from `measure`.

        Raises
        ------
        RangeError
            If a depth is beyond what was compiled for.
        """
        exponent = self.measure.exponent
        scale = 4.0 * theta * exponent / (exponent + 1.0)
        return self._evaluate(depth, thickness, abel_coefficient, (Factor.FORCE,), scale, with_depth=True)

    def of_one_layer(self, depth: FloatArray, theta: float, thickness: float) -> FloatArray:
        """Forces (N), (sets, n), of sets that share tip and layer and differ only in the body under the layer.

        `depth` (m) is (sets, n), or (1, n) for all; `theta` (Pa) and `thickness` (m) are the layer's. Faster than
        `force` where the sets share one stretched variable, which is then computed once.
        """
        touching, radius, _ = self._half_space(depth, np.full(1, thickness), None)
        varpi = radius / thickness
        if len(varpi) < len(self.stretch.length):
            varpi = np.repeat(varpi, len(self.stretch.length), axis=0)
        value = polynomial(self.coefficients[:, Factor.FORCE], self.stretch.z(varpi))
        np.exp(value, out=value)
        exponent = self.measure.exponent
        value *= radius * touching * (4.0 * theta * exponent / (exponent + 1.0))
        return value

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
        """Half-space radius (m) times the product of `factors` times `scale`, (sets, n).

        `scale` is (sets,); with `with_depth` the result is also multiplied by the depth. The other arguments are
        those of `force`.
        """
        touching, radius, per_set = self._half_space(depth, thickness, abel_coefficient)
        to_varpi = per_set / thickness
        sets, size = thickness.size, radius.shape[-1]
        result = np.empty((sets, size))
        # The sum of the factors' logarithms is one polynomial; the scale is the largest part of its first
        # coefficient.
        table = self.coefficients[:, list(factors)].sum(axis=1)
        table[:, 0, 0] += np.log(scale * per_set)
        step = max(1, _CHUNK // max(size, 1))
        for start in range(0, sets, step):
            part = slice(start, min(start + step, sets))
            rows = part if radius.shape[0] > 1 else slice(0, 1)
            value = polynomial(table[part], self.stretch.part(part).z(radius[rows] * to_varpi[part, None]))
            np.exp(value, out=value)
            value *= radius[rows]
            if with_depth:
                value *= touching[rows]
            result[part] = value
        return result

    def with_slopes(
        self,
        depth: ArrayLike,
        theta: FloatArray,
        thickness: FloatArray,
        abel_coefficient: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Forces (N) and dP/dw (N/m), each (sets, n), and dP/ds (N), (sets, numbers, n), for s of `slopes`.

        Arguments and errors as for `force`. Meant for few sets and depths, where calls cost more than arithmetic:
        one polynomial evaluation serves all three.
        """
        touching, radius, per_set = self._half_space(depth, thickness, abel_coefficient)
        z = self.stretch.z(radius * (per_set / thickness)[:, None])
        own = self.coefficients
        table = np.empty((len(own), 2, *own.shape[2:]))
        table[:, 0] = own[:, Factor.FORCE]
        np.add(own[:, Factor.RADIUS], own[:, Factor.STIFFNESS], out=table[:, 1])
        if self.slopes is not None:
            table = np.concatenate((table, self.slopes), axis=1)
        values = polynomial(table, z[:, None, :])
        np.exp(values[:, :2], out=values[:, :2])
        stiffness = values[:, 1] * ((4.0 * theta * per_set)[:, None] * radius)
        exponent = self.measure.exponent
        force = values[:, 0] * ((4.0 * theta * per_set * exponent / (exponent + 1.0))[:, None] * radius)
        force *= touching
        return force, stiffness, force[:, None] * values[:, 2:]

    def _half_space(
        self, depth: ArrayLike, thickness: FloatArray, abel_coefficient: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Depths in contact and their half-space radii, `depth` and `abel_coefficient` as in `force`.

        Returns
        -------
        tuple of ndarray
            Depths (m), zero where there is no contact, and their half-space radii, each (sets or 1, n), and the
            factors (sets,) on these radii that make them metres.

        Raises
        ------
        RangeError
            If a depth is beyond what was compiled for.
        """
        touching = np.atleast_2d(np.maximum(as_finite(depth, "depth"), 0.0))
        exponent = self.measure.exponent
        if abel_coefficient is None:
            radius, per_set = self.measure.halfspace_radius(touching), np.ones_like(thickness)
        else:
            radius, per_set = touching ** (1.0 / exponent), abel_coefficient ** (-1.0 / exponent)
        self._check(radius, per_set / thickness)
        return touching, radius, per_set

    def _check(self, radius: FloatArray, to_varpi: FloatArray) -> None:
        deepest = radius.max(axis=-1) * to_varpi
        beyond = deepest > np.asarray(self.top) * (1.0 + 1e-12)
        if beyond.any():
            worst = int(np.argmax(beyond))
            top = float(np.broadcast_to(self.top, beyond.shape)[worst])
            raise RangeError(
                f"varpi = {deepest[worst]:.6g} is beyond {top:.6g}, which the batch was compiled for: ask "
                "for less depth, or compile it for more"
            )


def curves_through(
    measure: PowerLawShape,
    varpi: FloatArray,
    logarithms: FloatArray,
    top: float | FloatArray,
    stretch: Stretch,
) -> CurveBatch:
    """Polynomials through given points of many curves; `MasterCurve.through` does this for one curve.

    Parameters
    ----------
    measure : PowerLawShape
        Power law by which depth is made dimensionless.
    varpi : ndarray (sets, n)
        Half-space contact radii at the depths over the thickness: increasing in every row, and close to Chebyshev
        points of the stretched variable.
    logarithms : ndarray (sets, n, 3 + numbers)
        Of the three factors, and columns of derivatives after them: see `CurveBatch.slopes`.
    top : float or ndarray (sets,)
        Largest varpi at which the curves will be evaluated.
    stretch : Stretch
        Gives the rate of the stretched variable ln(1 + rate varpi).

    Returns
    -------
    CurveBatch
        Its error estimates are the truncation errors of the polynomials up to `top`; infinite for a curve whose
        varpi does not increase.
    """
    count = varpi.shape[1]
    last = varpi[:, -1:]
    share = stretch.over(np.asarray(top)).length
    stretch = Stretch(stretch.over(last).length * reach(count), np.full_like(last, stretch.rate))
    # A contact that folds (its depth falls while it grows) is no function of depth: its polynomial is none.
    single = np.all(varpi[:, 1:] > varpi[:, :-1], axis=1)
    basis = chebyshev_values(
        np.where(single[:, None], stretch.z(varpi), np.cos(chebyshev_angles(count))), count
    )
    coefficients: FloatArray = np.asarray(np.linalg.solve(basis, logarithms), dtype=np.float64)
    factors = len(Factor)
    errors = growth_beyond(share / stretch.length[:, 0], count) * truncation_error(
        coefficients[..., :factors]
    )
    tables = in_powers(coefficients)
    return CurveBatch(
        measure,
        top,
        stretch,
        tables[:, :factors],
        np.where(single, errors, np.inf),
        tables[:, factors:],
    )


@dataclass(frozen=True)
class ExactBatch:
    """The exact contact problem of one shape with nodes fixed beforehand, for many sets of materials.

    Compile it once, at the middle of the parameters to come; call `curves` for every batch of materials. varpi is
    the contact radius of `measure` on a half-space at the depth over the thickness.

    Parameters
    ----------
    indenter : Indenter
        Shape; its size may change from set to set through `CurveBatch.force` if it is a power law.
    measure : PowerLawShape
        Power law by which depth is made dimensionless.
    top : float
        Largest varpi.
    rtol : float
        Relative error asked for.
    grid : PunchGrid
        Contact radii over thickness, and the quadrature nodes.
    products : ndarray (wavenumbers, radii (nodes + 1) nodes) or None
        eps cos(eps x_i u) cos(eps x_j u), with eps = a/h, x = r/a and u the wavenumber times the thickness; None
        where they would be too many to keep.
    """

    indenter: Indenter
    measure: PowerLawShape
    top: float
    rtol: float
    grid: PunchGrid
    products: FloatArray | None

    @classmethod
    def compile(
        cls, indenter: Indenter, kernel: Kernel, *, thickness: float, max_depth: float, rtol: float = 1e-6
    ) -> Self:
        """Fix contact radii and nodes, for bodies near that of `kernel`.

        Parameters
        ----------
        indenter : Indenter
            Shape of the tip.
        kernel : Kernel
            1 - L(u) of a typical body.
        thickness : float
            Of the thinnest layer (m).
        max_depth : float
            Largest depth (m).
        rtol : float
            Relative error allowed.

        Raises
        ------
        RangeError
            If the contact radius would pass 20 thicknesses, or the end of the indenter's shape, or the batch
            would not fit into memory.
        """
        problem = ContactProblem.of(indenter, thickness, kernel)
        top = float(problem.measure.halfspace_radius(np.array([max_depth]))[0]) / thickness
        solved = solve_curve(problem, top, rtol)
        terms = min(curve_terms(problem.scales, top, problem.measure.exponent, rtol) + 2, MOST_TERMS)
        # The radii of a power law go a little further, with two terms more, for sets whose contact is narrower: a
        # polynomial soon errs beyond its points.
        margin = _MARGIN if indenter is problem.measure else 1.0
        targets = Stretch.to(margin * top, 0.0).v(np.cos(chebyshev_angles(terms)))
        eps = targets * solved.curve.factor(Factor.RADIUS, targets)
        resolution = proved_resolution(kernel, solved.eps, rtol)
        count, wavenumbers = resolution.radial, resolution.wavenumbers
        count_of_products = wavenumbers * eps.size * count * (count + 1)
        if count_of_products > _MOST_PRODUCTS:
            raise RangeError(
                f"a batch would ask for {wavenumbers} x {eps.size} x {count} x {count + 1} products of waves, "
                f"and the most is {_MOST_PRODUCTS:.0e}: solve one set of materials at a time"
            )
        grid, products = PunchGrid.of(eps, resolution), None
        if count_of_products <= _KEPT_PRODUCTS:
            by_wave = grid.waves.transpose(2, 0, 1)
            products = eps[:, None, None] * by_wave[..., :, None] * by_wave[..., None, :-1]
            products = products.reshape(wavenumbers, -1)
        return cls(indenter, problem.measure, top, rtol, grid, products)

    def curves(
        self, inner: PlaneConstants, outer: PlaneConstants | None, thickness: FloatArray | float = 1.0
    ) -> CurveBatch:
        """Solve for the master curves of a batch of materials.

        Parameters
        ----------
        inner, outer : PlaneConstants
            Of the layer and of the substrate, entries (sets, 1) or floats; `outer` None is rigid.
        thickness : ndarray (sets,), optional
            Of the layers (m): needed only where the indenter is not a power law.
        """
        return self.curves_of(LayerKernel(inner, outer).values(self.u), thickness)

    def curves_of(self, kernels: FloatArray, thickness: FloatArray | float = 1.0) -> CurveBatch:
        """Solve for the master curves of bodies given by 1 - L at the nodes `u`, (sets, wavenumbers).

        `kernels` may be (wavenumbers,) for one body. `thickness` (m), (sets,) or a float, is needed only where the
        indenter is not a power law.
        """
        punch = self._punch(kernels)
        lengths = np.reshape(np.asarray(thickness, dtype=np.float64), (-1, 1))
        # A set whose radii pass the end of the shape is solved on the thickest layer that fits, and marked.
        thickest = self.indenter.max_radius / float(self.grid.eps.max())
        varpi, logarithms = contact_factors(punch, self.indenter, self.measure, np.minimum(lengths, thickest))
        batch = curves_through(self.measure, varpi, logarithms, self.top, Stretch.to(self.top, 0.0))
        errors = SHARE_OF_NODES * self.rtol + batch.error_estimate
        return replace(batch, error_estimate=np.where(lengths[:, 0] > thickest, np.inf, errors))

    @property
    def u(self) -> FloatArray:
        """Nodes in the wavenumber times the thickness, (wavenumbers,)."""
        return self.grid.u

    def _punch(self, kernels: FloatArray) -> PunchSolution:
        grid, sets = self.grid, np.atleast_2d(kernels)
        if self.products is None:
            return grid.solve(sets)
        radii, nodes, _ = grid.waves.shape
        kernel = ((grid.strength * sets) @ self.products).reshape(-1, radii, nodes, nodes - 1)
        return PunchSolution.of_kernel(grid.eps, grid.rule, kernel)[0]
