"""Master curves of one power-law tip over a range of modulus ratios, tabulated once and read off at once.

With Poisson's ratios fixed, the master curve of a layer on a base depends on one number more than varpi: the
ratio k of the base's modulus to the layer's. A fit or a sampler that varies moduli asks for thousands of
values of k. The coefficients of the curve are analytic in ln k: the kernel's poles lie where k is negative,
at Im ln k = pi. So Chebyshev polynomials over a span of ln 4 gain a factor of 9 with each term, and half a dozen
solutions serve every ratio in the span, with the derivative in ln k beside them.

The spans ("cells") of ratio and of varpi are fixed numbers, not taken from what was asked before: a law is a
function of its parameters alone. Everything here is dimensionless, so one table serves any tip size, thickness
and modulus, and tables are kept for the whole process.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, read_only
from underlay.errors import RangeError
from underlay.mechanics.exact.contact_curve import ContactProblem, SolvedCurve, solve_curve
from underlay.mechanics.exact.curve_batch import CurveBatch
from underlay.mechanics.exact.law import ExactLaw
from underlay.mechanics.exact.master_curve import (
    MOST_TERMS,
    Factor,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
    in_powers,
    monomials,
    polynomial,
    truncation_error,
)
from underlay.mechanics.exact.nodes import Pair, Resolution
from underlay.mechanics.indenters import PowerLaw, PowerLawShape
from underlay.mechanics.materials import isotropic_constants

__all__ = [
    "Cell",
    "CurveFamily",
    "FamilyLaw",
    "curve_family",
    "family_batch",
    "family_law",
    "range_number",
    "ratio_number",
]

# Edges of the cells, at no round number: a ratio or range on an edge would fall on either side of it.
_RATIO_STEP, _RATIO_EDGE = 4.0, 1.37
_RANGE_STEP, _RANGE_EDGE = 2.0, 1.31
_SMALLEST_RANGE = -6  # varpi up to 0.02: nothing is gained by less
# Shares of rtol: the solutions (which claim up to 0.9 of what they are asked), their resampling and the
# interpolation in the ratio.
_SHARE_OF_SOLUTIONS, _SHARE_OF_RATIO = 0.5, 0.3
_DIGITS_PER_TERM = 0.9  # log10 of the gain above, a little less
_MOST_RATIOS = 24
_TABLES_KEPT = 4096


class Cell(NamedTuple):
    """Which table: the tip's exponent, both Poisson's ratios, the spans and the accuracy.

    Parameters
    ----------
    exponent : float
        Of the tip's power law.
    layer_nu : float
        Poisson's ratio of the layer.
    base_nu : float or None
        Of the base; None for a rigid one.
    ratio : int
        Number of the span in ln k; 0 for a rigid base.
    range : int
        Number of the span in varpi.
    rtol : float
        Relative error asked for.
    """

    exponent: float
    layer_nu: float
    base_nu: float | None
    ratio: int
    range: int
    rtol: float

    @classmethod
    def holding(
        cls, exponent: float, layer_nu: float, base_nu: float | None, ratio: float, varpi: float, rtol: float
    ) -> Cell:
        """Cell that holds a modulus ratio (inf: rigid) and a largest varpi."""
        return cls(exponent, layer_nu, base_nu, ratio_number(ratio), range_number(varpi), rtol)

    @property
    def log_ratios(self) -> tuple[float, float]:
        """Ends of the span in ln k."""
        low = log(_RATIO_EDGE) + self.ratio * log(_RATIO_STEP)
        return low, low + log(_RATIO_STEP)

    @property
    def top(self) -> float:
        """Largest varpi."""
        return _RANGE_EDGE * _RANGE_STEP**self.range


def ratio_number(ratio: float) -> int:
    """Number of the span that holds a modulus ratio."""
    return int(_ratio_numbers(np.array([ratio]))[0])


def range_number(varpi: float) -> int:
    """Number of the span that reaches `varpi`."""
    return int(_range_numbers(np.array([varpi]))[0])


def _ratio_numbers(ratio: FloatArray) -> FloatArray:
    rigid = np.isinf(ratio)
    return np.floor(np.log(np.where(rigid, 1.0, ratio / _RATIO_EDGE)) / log(_RATIO_STEP)) * ~rigid


def _range_numbers(varpi: FloatArray) -> FloatArray:
    smallest = _RANGE_EDGE * _RANGE_STEP**_SMALLEST_RANGE
    return np.ceil(np.log(np.maximum(varpi, smallest) / _RANGE_EDGE) / log(_RANGE_STEP))


@dataclass(frozen=True)
class CurveFamily:
    """The three factors against varpi and the modulus ratio, over one cell.

    Parameters
    ----------
    cell : Cell
        Where it holds.
    stretch : Stretch
        Of varpi.
    coefficients : ndarray (ratio terms, 3, rows, 4)
        What `MasterCurve` holds, in powers of the place of ln k in the span.
    error_estimate : float
        Relative error of the three factors, everything included.
    slope_error : float
        Error of the factors' derivatives in ln k.
    resolution : Resolution
        Nodes of the finest solution behind it.
    radii : int
        Contact radii solved for, all ratios together.
    eps : float
        Largest a/h.
    """

    cell: Cell
    stretch: Stretch
    coefficients: FloatArray
    error_estimate: float
    slope_error: float
    resolution: Resolution
    radii: int
    eps: float

    def tables(self, log_ratios: FloatArray) -> FloatArray:
        """Coefficients (sets, 3, rows, 4) of the curves at `log_ratios` (sets,)."""
        count = len(self.coefficients)
        powers = self._position(log_ratios)[:, None] ** np.arange(count)
        flat = powers @ self.coefficients.reshape(count, -1)
        return flat.reshape(-1, *self.coefficients.shape[1:])

    def slopes(self, log_ratio: float) -> FloatArray:
        """d/d ln k of the coefficients, (3, rows, 4), at one ratio."""
        low, high = self.cell.log_ratios
        orders = np.arange(1, len(self.coefficients))
        powers = orders * self._position(np.array([log_ratio])) ** (orders - 1)
        return np.tensordot(powers * (2.0 / (high - low)), self.coefficients[1:], 1)

    def curve(self, log_ratio: float) -> MasterCurve:
        """Master curve at one ratio."""
        table = self.tables(np.array([log_ratio]))
        return MasterCurve(self.stretch, (-1.0, 1.0), table, self.error_estimate)

    def _position(self, log_ratios: FloatArray) -> FloatArray:
        """Place of ln k in the span, in [-1, 1]; zero for a rigid base, which has one curve."""
        if len(self.coefficients) == 1:
            return np.zeros(log_ratios.shape)
        low, high = self.cell.log_ratios
        place = (log_ratios - low) * (2.0 / (high - low)) - 1.0
        if (np.abs(place) > 1.0 + 1e-9).any():
            raise RangeError(
                f"modulus ratios {np.exp(log_ratios.min()):.6g} to {np.exp(log_ratios.max()):.6g} leave the "
                f"table's span {np.exp(low):.6g} to {np.exp(high):.6g}: ask the cell that holds them"
            )
        return place


@lru_cache(maxsize=_TABLES_KEPT)
def curve_family(cell: Cell) -> CurveFamily | None:
    """Table of one cell; None where there is none: beyond 20 thicknesses, at a fold, or out of terms."""
    try:
        return _rigid(cell) if cell.base_nu is None else _elastic(cell, _first_ratios(cell))
    except RangeError:
        return None


def _first_ratios(cell: Cell) -> int:
    return ceil(-log10(_SHARE_OF_RATIO * cell.rtol) / _DIGITS_PER_TERM) + 1


def _rigid(cell: Cell) -> CurveFamily | None:
    solved = _solved(cell, np.inf)
    if len(solved.curve.edges) > 2:
        return None
    return CurveFamily(
        cell=cell,
        stretch=solved.curve.stretch,
        coefficients=solved.curve.coefficients,
        error_estimate=solved.error_estimate,
        slope_error=0.0,
        resolution=solved.resolution,
        radii=solved.radii,
        eps=solved.eps,
    )


def _elastic(cell: Cell, ratios: int) -> CurveFamily | None:
    """Solve at Chebyshev points in ln k, bring the curves to one stretch, and expand; more points if need be."""
    low, high = cell.log_ratios
    angles = chebyshev_angles(ratios)
    log_ratios = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angles)
    solutions = [_solved(cell, float(np.exp(log_ratio))) for log_ratio in log_ratios]
    if any(solved.curve.jumps for solved in solutions):
        return None
    stretch = Stretch.to(cell.top, _pair(cell, float(np.exp(0.5 * (low + high)))).softness)
    resampled, resampling = _resampled([solved.curve for solved in solutions], stretch, cell.rtol)
    if resampled is None:
        return None
    flat = chebyshev_coefficients(resampled.reshape(ratios, -1), angles)
    truncation = float(truncation_error(_at_points(flat, resampled.shape[1:])))
    if truncation > _SHARE_OF_RATIO * cell.rtol:
        return None if 2 * ratios > _MOST_RATIOS else _elastic(cell, ratios + ratios // 2)
    worst = max(solutions, key=lambda solved: solved.error_estimate)
    powers = np.tensordot(monomials(ratios).T, in_powers(flat.reshape(ratios, *resampled.shape[1:])), 1)
    return CurveFamily(
        cell=cell,
        stretch=stretch,
        coefficients=read_only(powers),
        error_estimate=worst.error_estimate + resampling + truncation,
        slope_error=truncation * ratios**2,
        resolution=worst.resolution,
        radii=sum(solved.radii for solved in solutions),
        eps=max(solved.eps for solved in solutions),
    )


def _at_points(flat: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Series in ln k (ratios, points 3) of the factors at the Chebyshev points of varpi."""
    terms = shape[0]
    values = np.cos(np.multiply.outer(chebyshev_angles(terms), np.arange(terms)))
    series = np.einsum("pt,rtf->rpf", values, flat.reshape(-1, *shape))
    return np.asarray(series.reshape(len(flat), -1))


def _resampled(curves: list[MasterCurve], stretch: Stretch, rtol: float) -> tuple[FloatArray | None, float]:
    """Chebyshev coefficients (curves, terms, 3) on one stretch, and their truncation error."""
    allowed = 0.5 * _SHARE_OF_RATIO * rtol
    for terms in range(8, MOST_TERMS + 1, 4):
        angles = chebyshev_angles(terms)
        varpi = stretch.v(np.cos(angles))
        values = np.stack([np.column_stack([c.logarithm(f, varpi) for f in Factor]) for c in curves], axis=1)
        flat = chebyshev_coefficients(values.reshape(terms, -1), angles)
        error = float(truncation_error(flat))
        if error <= allowed:
            return np.moveaxis(flat.reshape(terms, len(curves), len(Factor)), 1, 0), error
    return None, np.inf


def _solved(cell: Cell, ratio: float) -> SolvedCurve:
    """Exact curve at one ratio, of a tip w = A F_2 a^lambda of any size on a layer of unit thickness."""
    inner = isotropic_constants(1.0, cell.layer_nu)
    outer = None if cell.base_nu is None else isotropic_constants(ratio, cell.base_nu)
    problem = ContactProblem.of(PowerLaw(cell.exponent, 1.0), 1.0, inner, outer)
    share = 1.0 if outer is None else _SHARE_OF_SOLUTIONS
    return solve_curve(problem, cell.top, share * cell.rtol)


def _pair(cell: Cell, ratio: float) -> Pair:
    inner = isotropic_constants(1.0, cell.layer_nu)
    return Pair.of(inner, None if cell.base_nu is None else isotropic_constants(ratio, cell.base_nu))


@dataclass(frozen=True, kw_only=True)
class FamilyLaw(ExactLaw):
    """An exact law read off a table, which knows its derivative in the modulus ratio.

    Parameters
    ----------
    family : CurveFamily
        The table.
    log_ratio : float
        ln(E of the base / E of the layer).
    """

    family: CurveFamily
    log_ratio: float

    def ratio_slope(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/d ln k (N) at fixed depth (m), (n,), where the force (N) is `force`; zero out of contact."""
        varpi = self.measure.halfspace_radius(np.maximum(depth, 0.0)) / self.thickness
        table = self.family.slopes(self.log_ratio)[Factor.FORCE]
        return force * polynomial(table, self.family.stretch.z(varpi))


def family_law(
    indenter: PowerLawShape,
    *,
    layer_E: float,
    layer_nu: float,
    thickness: float,
    base: tuple[float, float] | None,
    varpi: float,
    rtol: float,
) -> FamilyLaw | None:
    """Exact law of a power-law tip on an isotropic layer, from the table of its cell; None if there is none.

    Parameters
    ----------
    indenter : PowerLawShape
        The tip.
    layer_E, layer_nu : float
        Of the layer (Pa, dimensionless).
    thickness : float
        Of the layer (m).
    base : (E, nu) or None
        Of the base; None is rigid.
    varpi : float
        Half-space contact radius over thickness that must be reached; the law goes to the end of the cell.
    rtol : float
        Relative error allowed.
    """
    ratio, base_nu = (np.inf, None) if base is None else (base[0] / layer_E, base[1])
    cell = Cell.holding(indenter.exponent, layer_nu, base_nu, ratio, varpi, rtol)
    family = curve_family(cell)
    if family is None or family.error_estimate > rtol:
        return None
    log_ratio = log(ratio) if base is not None else np.inf
    return FamilyLaw(
        method="exact",
        reason=f"exact contact problem, a/h up to {family.eps:.3g}, tabulated over the modulus ratio"
        if base is not None
        else f"exact contact problem, a/h up to {family.eps:.3g}, {family.resolution.radial} nodes",
        max_depth=float(indenter.abel(np.array([cell.top * thickness]))[0]),
        error_estimate=family.error_estimate,
        measure=indenter,
        theta=float(isotropic_constants(layer_E, layer_nu).theta),
        thickness=thickness,
        curve=family.curve(log_ratio),
        resolution=family.resolution,
        radii=family.radii,
        family=family,
        log_ratio=log_ratio,
    )


def family_batch(
    indenter: PowerLawShape,
    *,
    layer_nu: float,
    base_nu: float | None,
    ratio: FloatArray,
    varpi: FloatArray,
    rtol: float,
) -> CurveBatch:
    """Master curves of many parameter sets, each from the table of its cell.

    Parameters
    ----------
    indenter : PowerLawShape
        The tip; its size may change from set to set through `CurveBatch.force`.
    layer_nu, base_nu : float
        Poisson's ratios; `base_nu` None is rigid.
    ratio, varpi : ndarray (sets,)
        Modulus of the base over that of the layer (inf: rigid), and the largest varpi.
    rtol : float
        Relative error asked for.

    Returns
    -------
    CurveBatch
        With an infinite error estimate where there is no table.
    """
    spans, ranges = _ratio_numbers(ratio), _range_numbers(varpi)
    families: list[CurveFamily | None] = []
    members: list[NDArray[np.intp]] = []
    for span, reach in sorted(set(zip(spans.tolist(), ranges.tolist(), strict=True))):
        cell = Cell(indenter.exponent, layer_nu, base_nu, int(span), int(reach), rtol)
        families.append(curve_family(cell))
        members.append(np.flatnonzero((spans == span) & (ranges == reach)))
    rows = max((family.coefficients.shape[2] for family in families if family is not None), default=1)
    table = np.zeros((ratio.size, len(Factor), rows, 4))
    lengths, softness = np.ones((ratio.size, 1)), np.zeros((ratio.size, 1))
    top, errors = np.full(ratio.size, np.inf), np.full(ratio.size, np.inf)
    log_ratio = np.log(ratio)
    for family, here in zip(families, members, strict=True):
        if family is None:
            continue
        table[here, :, : family.coefficients.shape[2]] = family.tables(log_ratio[here])
        lengths[here], softness[here] = family.stretch.length, family.stretch.softness
        top[here], errors[here] = family.cell.top, family.error_estimate
    return CurveBatch(indenter, top, lengths, softness, table, errors)
