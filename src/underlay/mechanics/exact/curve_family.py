"""Master curves of one power-law tip on bodies that differ in one ratio: tabulated once, and read off.

With Poisson's ratios fixed, the master curve of a layer on a base depends on one number more than varpi, the
half-space radius at the depth over the thickness: the ratio k of the base's modulus to the layer's. So does that of
a stack of which one modulus or thickness is not known. A fit or a sampler asks for thousands of values of k. The
coefficients of the curve are analytic in ln k: in a ratio of moduli the kernel's poles lie where k is negative, at
Im ln k = pi. So Chebyshev polynomials over a span of ln 4 gain a factor of 9 with each term, and half a dozen
solutions serve every ratio in the span, with the derivative in ln k beside them; how many it takes is measured, for
ratios of lengths too.

The spans ("cells") of ratio and of varpi are fixed numbers, not taken from what was asked before: a law is a
function of its parameters alone. Everything here is dimensionless, so one table serves any tip size, thickness
and modulus, and tables are kept for the whole process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, exp, floor, inf, log, log10
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact.contact_problem import ContactProblem, SolvedCurve
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    in_powers,
    monomials,
    shortened,
    truncation_error,
)
from underlay.mechanics.exact.nodes import TABLES, Resolution
from underlay.mechanics.exact.stored_curves import known_curve
from underlay.mechanics.indenters import PowerLaw
from underlay.mechanics.kernel import Family, LayerKernel

# Edges of the cells, at no round number: a ratio or range on an edge would fall on either side of it.
_RATIO_STEP, _RATIO_EDGE = 4.0, 1.37
_RANGE_STEP, _RANGE_EDGE = 2.0, 1.31
#: Number of the span of all bases from that of `_STIFF` on to a rigid one. What they add is analytic in 1/k there:
#: five terms do where ln k takes seven in each of a dozen spans (twelve under an incompressible layer at a/h = 20).
STIFF_END, _STIFF = 10_000, 5
_SMALLEST_RANGE = -6  # varpi up to 0.02: nothing is gained by less
# Shares of rtol: the solutions (which claim up to 0.9 of what they are asked), the interpolation in the ratio, and
# the terms in varpi that are dropped or were never there.
_SHARE_OF_SOLUTIONS, _SHARE_OF_RATIO, _SHARE_OF_PIECE = 0.5, 0.25, 0.25
_NARROWEST = 0.3  # of a piece in z: eight pieces at most
_DIGITS_PER_TERM = 0.9  # log10 of the gain above, a little less
_MOST_RATIOS = 24


class IsotropicPair(NamedTuple):
    """Isotropic layers on isotropic bases of given Poisson's ratios, differing in the ratio of moduli."""

    layer_nu: float
    base_nu: float

    def kernel(self, ratio: float) -> LayerKernel:
        """Kernel of the body whose base has `ratio` times the layer's Young's modulus."""
        return LayerKernel(isotropic_constants(1.0, self.layer_nu), isotropic_constants(ratio, self.base_nu))


class RigidBase(NamedTuple):
    """An isotropic layer of given Poisson's ratio on a rigid base: a family with a single member."""

    layer_nu: float

    def kernel(self, ratio: float) -> LayerKernel:
        """Kernel of the layer on a rigid base; `ratio` is ignored."""
        del ratio
        return LayerKernel(isotropic_constants(1.0, self.layer_nu), None)


class Cell(NamedTuple):
    """Key of one table: the tip's exponent, the family of bodies, the ranges of ratio and depth, and the accuracy.

    Parameters
    ----------
    exponent : float
        Of the tip's power law.
    family : Family
        The bodies, which differ in one ratio k.
    ratio : int
        Number of the range of ln k (`ratio_span`).
    range : int
        Number of the range of varpi, the half-space contact radius at the depth over the thickness (`range_end`).
    rtol : float
        Relative error asked for.
    """

    exponent: float
    family: Family
    ratio: int
    range: int
    rtol: float

    @property
    def log_ratios(self) -> RatioSpan:
        """Range of ln k of the cell.

        k is the ratio in which the bodies of the family differ.
        """
        return ratio_span(self.ratio)

    @property
    def top(self) -> float:
        """Largest varpi of the cell.

        varpi is the half-space contact radius at the depth over the thickness.
        """
        return range_end(self.range)


class RatioSpan(NamedTuple):
    """A range of ratios k, and the variable on [-1, 1] in which curves are expanded over it.

    The variable is linear in ln k, or in 1/k where the range ends at a rigid base (`high` infinite).

    k is the ratio in which the bodies of the family differ.

    Parameters
    ----------
    low, high : float
        Its ends in ln k.
    """

    low: float
    high: float

    def place(self, log_ratios: FloatArray) -> FloatArray:
        """Map ln k to the variable on [-1, 1].

        k is the ratio in which the bodies of the family differ.
        """
        if self.high == inf:
            return np.asarray(1.0 - 2.0 * np.exp(self.low - log_ratios))
        return (log_ratios - self.low) * (2.0 / (self.high - self.low)) - 1.0

    def slope(self, log_ratio: float) -> float:
        """Derivative of the variable with respect to ln k.

        k is the ratio in which the bodies of the family differ.
        """
        return 2.0 * exp(self.low - log_ratio) if self.high == inf else 2.0 / (self.high - self.low)

    def ratios(self, places: FloatArray) -> FloatArray:
        """Ratios k at values of the variable: inverse of `place`."""
        if self.high == inf:
            return np.asarray(2.0 * exp(self.low) / (1.0 - places))
        return np.asarray(np.exp(0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * places))

    @property
    def middle(self) -> float:
        """The ratio k in the middle of the range."""
        return float(self.ratios(np.array(0.0)))


def ratio_span(number: int) -> RatioSpan:
    """Range of modulus ratios with a given number, as `ratio_number` or `end_numbers` counts them."""
    low = log(_RATIO_EDGE) + (_STIFF if number == STIFF_END else number) * log(_RATIO_STEP)
    return RatioSpan(low, inf if number == STIFF_END else low + log(_RATIO_STEP))


def ratio_number(ratio: float) -> int:
    """Number of the range of ratios (each a factor of four) that holds a modulus ratio base over layer."""
    return floor(log(ratio / _RATIO_EDGE) / log(_RATIO_STEP))


def range_number(varpi: float) -> int:
    """Number of the smallest range of depths that reaches `varpi`, half-space contact radius over thickness."""
    return ceil(log(max(varpi, range_end(_SMALLEST_RANGE)) / _RANGE_EDGE) / log(_RANGE_STEP))


def ratio_numbers(ratio: FloatArray) -> FloatArray:
    """Numbers (sets,), as whole floats, of the ranges that hold modulus ratios: `ratio_number` for arrays."""
    return np.asarray(np.floor(np.log(ratio / _RATIO_EDGE) / log(_RATIO_STEP)), dtype=np.float64)


def end_numbers(ratio: FloatArray) -> FloatArray:
    """`ratio_numbers`, except that the stiffest bases, up to a rigid one, share the range number `STIFF_END`."""
    number = ratio_numbers(ratio)
    return np.where(number < _STIFF, number, STIFF_END)


def range_numbers(varpi: FloatArray) -> FloatArray:
    """Numbers (sets,), as whole floats, of the ranges that reach varpi (sets,): `range_number` for arrays.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    smallest = _RANGE_EDGE * _RANGE_STEP**_SMALLEST_RANGE
    return np.ceil(np.log(np.maximum(varpi, smallest) / _RANGE_EDGE) / log(_RANGE_STEP))


def range_end(number: int) -> float:
    """Largest varpi of the range with a given number.

    varpi is the half-space contact radius at the depth over the thickness.
    """
    return _RANGE_EDGE * _RANGE_STEP**number


@dataclass(frozen=True)
class CurveFamily:
    """The three factors of a master curve against varpi and the modulus ratio k, over one cell.

    varpi is the half-space contact radius at the depth over the thickness.

    Parameters
    ----------
    cell : Cell
        Tip, bodies, and the ranges for which the table holds.
    stretch, edges
        As in `MasterCurve`.
    coefficients : ndarray (ratio terms, pieces, 3, rows, 4)
        The coefficients of `MasterCurve` as polynomials, in powers of the variable of `RatioSpan`.
    error_estimate : float
        Relative error of the three factors, everything included.
    resolution : Resolution
        Nodes of the finest solution behind it.
    eps : float
        Largest a/h.
    """

    cell: Cell
    stretch: Stretch
    edges: tuple[float, ...]
    coefficients: FloatArray
    error_estimate: float
    resolution: Resolution
    eps: float

    def tables(self, log_ratios: FloatArray) -> FloatArray:
        """Coefficients (sets, pieces, 3, rows, 4) of the master curves at ln k = `log_ratios` (sets,).

        k is the ratio in which the bodies of the family differ.
        """
        count = len(self.coefficients)
        powers = self._position(log_ratios)[:, None] ** np.arange(count)
        flat = powers @ self.coefficients.reshape(count, -1)
        return flat.reshape(-1, *self.coefficients.shape[1:])

    def curve(self, log_ratio: float) -> MasterCurve:
        """Master curve at one ln k, with its derivative d ln P/d ln k at fixed depth as a fourth column.

        k is the ratio in which the bodies of the family differ.
        """
        orders = np.arange(len(self.coefficients))
        powers = np.zeros((2, orders.size))
        powers[0] = self._position(np.array([log_ratio])) ** orders
        powers[1, 1:] = orders[1:] * powers[0, :-1] * self.cell.log_ratios.slope(log_ratio)
        flat = powers @ self.coefficients.reshape(orders.size, -1)
        own, slopes = flat.reshape(2, *self.coefficients.shape[1:])
        table = np.concatenate((own, slopes[:, Factor.FORCE, None]), axis=1)
        return MasterCurve(self.stretch, self.edges, table, self.error_estimate)

    def _position(self, log_ratios: FloatArray) -> FloatArray:
        """Values in [-1, 1] of the variable of `RatioSpan` at ln k; RangeError outside the range of the cell.

        k is the ratio in which the bodies of the family differ.
        """
        low, high = span = self.cell.log_ratios
        place = span.place(log_ratios)
        if (np.abs(place) > 1.0 + 1e-9).any():
            raise RangeError(
                f"ratios {np.exp(log_ratios.min()):.6g} to {np.exp(log_ratios.max()):.6g} leave the "
                f"table's span {np.exp(low):.6g} to {np.exp(high):.6g}: ask the cell that holds them"
            )
        return place


def solved_alone(
    exponent: float, family: Family, ratio: float, reach: int, rtol: float
) -> SolvedCurve | None:
    """Curve of a power-law tip on one body of a family, cached; None beyond a/h = 20, or at a fold.

    `ratio` is the body's ratio k, `reach` the number of the range of varpi, the half-space contact radius at the
    depth over the thickness.
    """

    def solved() -> SolvedCurve | None:
        problem = ContactProblem.of(PowerLaw(exponent, 1.0), 1.0, family.kernel(ratio))
        try:
            found = known_curve(problem, range_end(reach), rtol)
        except RangeError:
            return None
        return None if found.curve.jumps else found

    return TABLES.get(("alone", exponent, family, ratio, reach, rtol), solved)


def curve_family(cell: Cell) -> CurveFamily | None:
    """Table of one cell, cached; None where none can be made.

    None: contact radii beyond 20 thicknesses, a fold, too many terms, or parameters that are no possible body.
    """
    return TABLES.get(("family", cell), lambda: _tabulated(cell))


def _tabulated(cell: Cell) -> CurveFamily | None:
    try:
        return _expanded(cell, first_ratios(_SHARE_OF_RATIO * cell.rtol))
    except InputError:
        return None


def first_ratios(error: float) -> int:
    """Number of ratios to solve at first, where the interpolation between them may err by `error`."""
    return ceil(-log10(error) / _DIGITS_PER_TERM) + 1


def _expanded(cell: Cell, ratios: int) -> CurveFamily | None:
    """Solve at `ratios` Chebyshev points in ln k, resample the curves on one variable, and expand in ln k.

    Starts again with more points where the interpolation errs by too much; None where that would be too many.

    k is the ratio in which the bodies of the family differ.
    """
    span = cell.log_ratios
    angles = chebyshev_angles(ratios)
    tip, share = PowerLaw(cell.exponent, 1.0), _SHARE_OF_SOLUTIONS * cell.rtol
    bodies = [cell.family.kernel(ratio) for ratio in span.ratios(np.cos(angles)).tolist()]
    # With all their terms but the least: each would leave out others, which the interpolation in ln k would find.
    solved = [known_curve(ContactProblem.of(tip, 1.0, body), cell.top, share, 0.01) for body in bodies]
    if any(one.curve.jumps for one in solved):
        return None
    worst = max(solved, key=lambda one: one.error_estimate)
    stretch = Stretch.to(cell.top, cell.family.kernel(span.middle).scales.softness)
    pieces = _pieces([one.curve for one in solved], stretch, (-1.0, 1.0), cell.rtol)
    if pieces is None:
        return None
    expanded = [chebyshev_coefficients(piece.values.reshape(ratios, -1), angles) for piece in pieces]
    truncation = max(
        float(truncation_error(_at_points(flat, piece.values.shape[1:])))
        for flat, piece in zip(expanded, pieces, strict=True)
    )
    if truncation > _SHARE_OF_RATIO * cell.rtol:
        return None if 2 * ratios > _MOST_RATIOS else _expanded(cell, ratios + ratios // 2)
    powers = [
        np.tensordot(monomials(ratios).T, in_powers(flat.reshape(piece.values.shape)), 1)
        for flat, piece in zip(expanded, pieces, strict=True)
    ]
    table = np.zeros((ratios, len(pieces), len(Factor), max(power.shape[2] for power in powers), 4))
    for number, power in enumerate(powers):
        table[:, number, :, : power.shape[2]] = power
    return CurveFamily(
        cell=cell,
        stretch=stretch,
        edges=(*(piece.ends[0] for piece in pieces), 1.0),
        coefficients=read_only(table),
        error_estimate=worst.error_estimate + max(piece.left_out for piece in pieces) + truncation,
        resolution=worst.resolution,
        eps=max(one.eps for one in solved),
    )


def _at_points(flat: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Values (ratios, 3 x points) at the Chebyshev points of varpi, of series in ln k of the factors' coefficients.

    `shape` is (terms, 3), that of the coefficients of one piece, which `flat` has flattened.

    varpi is the half-space contact radius at the depth over the thickness.

    k is the ratio in which the bodies of the family differ.
    """
    terms = shape[0]
    values = np.cos(np.multiply.outer(chebyshev_angles(terms), np.arange(terms)))
    series = np.einsum("pt,rtf->rpf", values, flat.reshape(-1, *shape))
    return np.asarray(series.reshape(len(flat), -1))


class _Piece(NamedTuple):
    """One piece of all curves: ends in z, Chebyshev coefficients (curves, terms, 3), and their error."""

    ends: tuple[float, float]
    values: FloatArray
    left_out: float


def _pieces(
    curves: Sequence[MasterCurve], stretch: Stretch, ends: tuple[float, float], rtol: float
) -> list[_Piece] | None:
    """Resample curves on one variable, in as few pieces as the accuracy allows; None if it takes too many."""
    piece = _resampled(curves, stretch, ends, rtol)
    if piece.left_out <= _SHARE_OF_PIECE * rtol:
        return [piece]
    low, high = ends
    if high - low < _NARROWEST:
        return None
    middle = 0.5 * (low + high)
    below = _pieces(curves, stretch, (low, middle), rtol)
    above = _pieces(curves, stretch, (middle, high), rtol)
    return None if below is None or above is None else below + above


def _resampled(
    curves: Sequence[MasterCurve], stretch: Stretch, ends: tuple[float, float], rtol: float
) -> _Piece:
    """One piece of the curves on one variable, with at most `MOST_TERMS` terms, negligible last ones dropped."""
    low, high = ends
    angles = chebyshev_angles(MOST_TERMS)
    varpi = stretch.v(0.5 * (low + high) + 0.5 * (high - low) * np.cos(angles))
    logarithms = np.array([[curve.logarithm(which, varpi) for which in Factor] for curve in curves])
    values = np.moveaxis(logarithms, -1, 0)
    flat = chebyshev_coefficients(values.reshape(MOST_TERMS, -1), angles)
    error = float(truncation_error(flat))
    kept, missing = shortened(flat, _SHARE_OF_PIECE * rtol - error)
    terms = np.moveaxis(flat[:kept].reshape(kept, *values.shape[1:]), 1, 0)
    return _Piece(ends, terms, error + missing)
