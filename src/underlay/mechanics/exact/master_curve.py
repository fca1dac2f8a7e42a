"""The master curve: force, contact radius and stiffness of one tip on one pair of materials, without dimensions.

With varpi = a_half(w)/h, a_half the contact radius on a half-space at the same depth w (5.8) and h the
thickness, three factors say all: a/a_half, P/P_half and kappa_inf = (dP/dw)/(4 theta a), with contact radius a,
force P and the layer's elastic constant theta. They are 1 at varpi = 0. For a power-law shape of exponent
lambda they depend on varpi, lambda and the ratios of the materials only: one curve serves any modulus, any
thickness and any number of depths.

The logarithms of the factors are smooth, and are held as polynomials in

    t(v) = ln(1 + rate v),   rate = 2 + softness,

which straightens both the growth at large v and, for a substrate softer than the layer, the rapid change at
v = 1/softness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import cos, exp, expm1, log1p, pi
from typing import Any, NamedTuple, Self

import numpy as np

from underlay._arrays import FloatArray

# Of a base as stiff as the layer or stiffer. Rates of 1, 2 and 4 take 29, 28 and 29 terms for 1e-7 up to varpi = 5,
# in the mean of paraboloids and cones on four bodies; 0.5 takes 31 and 10 takes 33.
_STIFF_RATE = 2.0
# Coefficients per row of the evaluated polynomial: sum_j z^(4j) (c_j0 + c_j1 z + c_j2 z^2 + c_j3 z^3).
_BLOCK = 4
# Depths evaluated at a time: the powers of so many fit the processor's cache.
_CHUNK = 2048
# Powers of z lose (1 + sqrt 2)^n / rho^n of relative accuracy against Chebyshev polynomials, rho > 1.8 the
# rate at which a piece's coefficients fall: below 1e-12 for 24 terms, and far below with the usual rho > 3.
MOST_TERMS = 24
#: Most terms that are told in powers at all. The widest contacts of spheres take so many at 1e-6, where rho is 1.7
#: and 2e-9 is lost.
MOST_IN_POWERS = 44


class Factor(IntEnum):
    """Columns of a master curve: contact radius over, force over, and stiffness over that of the half-space.

    RADIUS is a/a_half and FORCE P/P_half at the same depth, a_half and P_half those of the half-space of the
    layer's material; STIFFNESS is kappa_inf = (dP/dw)/(4 theta a), theta the layer's elastic constant.
    """

    RADIUS = 0
    FORCE = 1
    STIFFNESS = 2


@dataclass(frozen=True)
class Stretch:
    """The variable t(v) = ln(1 + rate v) on [0, length], mapped linearly to z in [-1, 1]; v is varpi or chi.

    `length` and `rate` are floats, or (sets, 1) for many curves at once.

    varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
    of `ContactProblem.chi`, a/h for a power law.
    """

    length: Any
    rate: Any

    @classmethod
    def to(cls, top: Any, softness: float) -> Stretch:
        """Variable for v in [0, `top`] on a body of the given `Scales.softness`, which sets the rate."""
        return cls(0.0, _STIFF_RATE + softness).over(top)

    @classmethod
    def of_all(cls, stretches: Sequence[Stretch]) -> Self:
        """Join the variables of many curves into one with lengths and rates (sets, 1)."""
        return cls(*(np.array([[getattr(one, name)] for one in stretches]) for name in ("length", "rate")))

    def over(self, top: Any) -> Stretch:
        """Variable for v in [0, `top`] with the same rate."""
        log = np.log1p if isinstance(top, np.ndarray) else log1p
        return Stretch(log(self.rate * top), self.rate)

    def part(self, rows: slice | list[int]) -> Stretch:
        """Variables of some of many curves, `rows` a slice or a list of indices."""
        return Stretch(self.length[rows], self.rate[rows])

    def z(self, v: FloatArray) -> FloatArray:
        """Map v to z in [-1, 1], the variable of the polynomials: linear in ln(1 + rate v)."""
        t: FloatArray = self.rate * v
        np.log1p(t, out=t)
        t *= 2.0 / self.length
        t -= 1.0
        return t

    def dz(self, v: FloatArray) -> FloatArray:
        """Derivative dz/dv at v."""
        return np.asarray((2.0 / self.length) * self.rate / (1.0 + self.rate * v))

    def v(self, z: FloatArray) -> FloatArray:
        """Map z back to v."""
        return np.asarray(np.expm1((0.5 * self.length) * (z + 1.0)) / self.rate)


def chebyshev_angles(count: int) -> FloatArray:
    """Angles of `count` Chebyshev points z = cos(angle), from z near -1 to z near 1."""
    return np.asarray((np.pi / (2 * count)) * np.arange(2 * count - 1, 0, -2), dtype=np.float64)


def chebyshev_coefficients(values: FloatArray, angles: FloatArray) -> FloatArray:
    """Coefficients (..., count, columns) of the interpolants of `values`, alike, at the Chebyshev points."""
    count = angles.size
    scale = np.full((count, 1), 2.0 / count)
    scale[0] = 1.0 / count
    return np.asarray(scale * (np.cos(np.arange(count)[:, None] * angles) @ values), dtype=np.float64)


def _monomial_table(count: int) -> FloatArray:
    """Matrix (count, count) whose row k has the coefficients of the Chebyshev polynomial T_k in powers of z."""
    table = np.zeros((count, count))
    table[0, 0] = table[1, 1] = 1.0
    for k in range(2, count):
        table[k, 1:] = 2.0 * table[k - 1, :-1]
        table[k] -= table[k - 2]
    return table


_MONOMIALS = _monomial_table(MOST_IN_POWERS)


def monomials(count: int) -> FloatArray:
    """Matrix (count, count): row k has the coefficients of T_k in powers; `count` at most `MOST_IN_POWERS`."""
    return _MONOMIALS[:count, :count]


def in_powers(coefficients: FloatArray) -> FloatArray:
    """Convert Chebyshev coefficients (..., terms, 3) to powers of z, (..., 3, rows, 4), for `polynomial`."""
    terms = coefficients.shape[-2]
    rows = -(-terms // _BLOCK)
    table = np.swapaxes(coefficients, -1, -2) @ _MONOMIALS[:terms, : rows * _BLOCK]
    return table.reshape(*table.shape[:-1], rows, _BLOCK)


def truncation_error(coefficients: FloatArray) -> FloatArray:
    """Estimated truncation error of Chebyshev interpolants, from how their coefficients (..., terms, columns) fall.

    The ratio of the last two to the two before gives the rate; the terms left out, and their aliases, are then
    within three times the sum of a geometric series. A rate of 0.9 and more is taken as 0.9.
    """
    sizes = np.abs(coefficients[..., -4:, :]).max(axis=-1)
    last, before = sizes[..., 2] + sizes[..., 3], sizes[..., 0] + sizes[..., 1]
    rate = np.minimum(last / np.maximum(before, np.finfo(float).tiny), 0.9)
    return np.asarray(3.0 * last * rate / (1.0 - rate))


def shortened(coefficients: FloatArray, allowed: float) -> tuple[int, float]:
    """Number of terms to keep of series (..., terms, columns), and the sum of the terms dropped, at most `allowed`.

    Terms are dropped from the end in fours, the row length of the tables of `polynomial`.
    """
    sizes = np.abs(coefficients).max(axis=-1)
    sizes = sizes.reshape(-1, sizes.shape[-1]).max(axis=0).tolist() if sizes.ndim > 1 else sizes.tolist()
    kept, left_out = len(sizes), 0.0
    while kept > _BLOCK:
        row = (kept - 1) // _BLOCK * _BLOCK
        more = left_out + sum(sizes[row:kept])
        if more > allowed:
            break
        kept, left_out = row, more
    return kept, left_out


def reach(count: int) -> float:
    """Length of an interval of `count` Chebyshev points over the length up to its last point.

    That point is at z = cos(pi/(2 count)).
    """
    return 2.0 / (1.0 + cos(0.5 * pi / count))


def growth_beyond(share: FloatArray | float, count: int) -> FloatArray:
    """Growth of the error of an interpolant of `count` terms at `share` times the length of its interval.

    It is that of the first Chebyshev polynomial left out; inside the interval (`share` up to 1) it is one.
    """
    return np.asarray(np.cosh(count * np.arccosh(np.maximum(2.0 * share - 1.0, 1.0))))


@dataclass(frozen=True)
class MasterCurve:
    """The three factors of `Factor` against varpi, the half-space contact radius at the depth over the thickness.

    Parameters
    ----------
    stretch : Stretch
        The variable of the polynomials, ln(1 + rate varpi), up to the largest varpi.
    edges : tuple of pieces + 1 floats
        Ends of the pieces in z, from -1 to 1.
    coefficients : ndarray (pieces, 3, rows, 4)
        Of each factor's logarithm (and after these of d ln P/ds at fixed depth, one for each of
        `ContactProblem.variants`), in powers of the piece's own variable in [-1, 1]: entry (j, i) of the last
        two axes goes with power 4 j + i.
    error_estimate : float
        Largest truncation error of the logarithms.
    jumps : tuple of floats
        Varpi at which the contact radius jumps; nearly always none.
    """

    stretch: Stretch
    edges: tuple[float, ...]
    coefficients: FloatArray
    error_estimate: float
    jumps: tuple[float, ...] = ()

    @classmethod
    def through(
        cls, varpi: FloatArray, logarithms: FloatArray, wanted: Stretch, allowed: float
    ) -> MasterCurve:
        """Return the curve of one polynomial through given points, for varpi in the interval of `wanted`.

        varpi is the half-space contact radius at the depth over the thickness.

        Parameters
        ----------
        varpi : ndarray (n,)
            Increasing, and in z close to Chebyshev points: others make the interpolation unstable, which the
            error estimate then shows.
        logarithms : ndarray (n, 3)
            Of the factors, and columns of derivatives after them.
        wanted : Stretch
            Covers [0, largest varpi at which the curve will be evaluated].
        allowed : float
            Error up to which last terms may be dropped: see `of_pieces`.
        """
        stretch = Stretch(wanted.over(varpi[-1]).length * reach(varpi.size), wanted.rate)
        angles = np.arccos(stretch.z(varpi))
        basis = np.cos(np.multiply.outer(angles, np.arange(varpi.size)))
        coefficients: FloatArray = np.asarray(np.linalg.solve(basis, logarithms), dtype=np.float64)
        share = wanted.length / stretch.length
        growth = float(growth_beyond(share, varpi.size)) if share > 1.0 else 1.0
        return cls.of_pieces(stretch, [-1.0, 1.0], [coefficients], allowed, growth=growth)

    @classmethod
    def of_pieces(
        cls,
        stretch: Stretch,
        edges: list[float],
        pieces: list[FloatArray],
        allowed: float,
        jumps: tuple[float, ...] = (),
        growth: float = 1.0,
    ) -> MasterCurve:
        """Return the curve made of Chebyshev coefficients (terms, 3), one array per piece.

        `edges` are the ends of the pieces in z. `growth` is the factor by which the error of the last piece grows
        where it is evaluated beyond its points. As long as the error stays within `allowed` the last terms are
        dropped, four at a time.
        """
        stacked = np.array(pieces)
        error = growth * float(truncation_error(stacked[..., : len(Factor)]).max())
        kept, left_out = shortened(growth * stacked, allowed - error)
        table = in_powers(stacked[:, :kept])
        table.flags.writeable = False
        return cls(stretch, tuple(edges), table, error + left_out, jumps)

    def factor(self, which: Factor, varpi: FloatArray) -> FloatArray:
        """One of the three factors, `which`, at `varpi` (n,).

        The three factors are contact radius, force and stiffness over the half-space's.
        """
        return np.exp(self.logarithm(which, varpi))

    def logarithm(self, which: Factor, varpi: FloatArray) -> FloatArray:
        """Natural logarithm of one of the three factors, `which`, at `varpi` (n,).

        The three factors are contact radius, force and stiffness over the half-space's.
        """
        return self.pieces(1.0, self.coefficients[:, which, None]).at(varpi, 0)

    def pieces(self, unit: float, tables: FloatArray) -> Pieces:
        """Polynomials of x = varpi/unit, for fast evaluation, from tables laid out like `coefficients`.

        `tables` is (pieces, columns, rows, 4).

        varpi is the half-space contact radius at the depth over the thickness.
        """
        half_span = 0.5 * self.stretch.length
        orders = np.arange(float(tables[0, 0].size)).reshape(-1, _BLOCK)
        variables, turned = [], []
        for low, high, table in zip(self.edges, self.edges[1:], tables, strict=False):
            # A piece's own variable is (z - middle)/half, and z + 1 = ln(1 + rate varpi)/half_span.
            shift = -half_span * (1.0 + 0.5 * (low + high))
            variables.append((expm1(shift), self.stretch.rate * unit * exp(shift)))
            turned.append(table * (1.0 / (half_span * 0.5 * (high - low))) ** orders)
        ends = self.stretch.v(np.array(self.edges[1:-1])) / unit if len(turned) > 1 else np.empty(0)
        return Pieces(ends, variables, turned)


class Pieces(NamedTuple):
    """Piecewise polynomials in y = ln(1 + shift + slope x), another polynomial on each interval of x.

    Parameters
    ----------
    ends : ndarray (pieces - 1,)
        Values of x where one interval ends and the next begins.
    variables : list of (float, float)
        shift and slope of each piece, such that y is zero in the middle of the piece.
    tables : list of ndarray (columns, rows, 4)
        Coefficients in powers of y, laid out as in `MasterCurve.coefficients`.
    """

    ends: FloatArray
    variables: list[tuple[float, float]]
    tables: list[FloatArray]

    def at(self, x: FloatArray, columns: slice | int = slice(None)) -> FloatArray:
        """Values at x (n,) of the chosen columns: (columns, n), or (n,) for one column given by its number."""
        if x.size <= _CHUNK and len(self.tables) == 1:
            return self._piece(0, x, columns)
        value = np.empty((*self.tables[0][columns].shape[:-2], x.size))
        for start in range(0, x.size, _CHUNK):
            some, into = x[start : start + _CHUNK], value[..., start : start + _CHUNK]
            if len(self.tables) == 1:
                into[...] = self._piece(0, some, columns)
                continue
            piece = np.searchsorted(self.ends, some)
            for number in range(len(self.tables)):
                here = piece == number
                into[..., here] = self._piece(number, some[here], columns)
        return value

    def _piece(self, number: int, x: FloatArray, columns: slice | int) -> FloatArray:
        shift, slope = self.variables[number]
        powers = np.empty((_BLOCK, x.size))
        y = np.multiply(slope, x, out=powers[1])
        y += shift
        np.log1p(y, out=y)
        return _polynomial(self.tables[number][columns], powers)


def polynomial(table: FloatArray, z: FloatArray) -> FloatArray:
    """Evaluate polynomials in z (..., n): sum_j z^(4j) sum_i table[..., j, i] z^i, `table` (..., rows, 4).

    One matrix product for the powers below four, then Horner's rule in z^4.
    """
    powers = np.empty((*z.shape[:-1], _BLOCK, z.shape[-1]))
    powers[..., 1, :] = z
    return _polynomial(table, powers)


def _polynomial(table: FloatArray, powers: FloatArray) -> FloatArray:
    """Evaluate the sum of `polynomial`, given `powers` (..., 4, n) with z in row 1; fills the other rows."""
    powers[..., 0, :] = 1.0
    z = powers[..., 1, :]
    square = np.multiply(z, z, out=powers[..., 2, :])
    np.multiply(square, z, out=powers[..., 3, :])
    if table.ndim == 2:
        rows = np.dot(table, powers)
    else:
        # Row by row, so that what Horner adds up lies together in memory.
        lead = table.shape[:-2] if z.ndim == 1 else np.broadcast_shapes(table.shape[:-2], z.shape[:-1])
        rows = np.empty((table.shape[-2], *lead, z.shape[-1]))
        np.matmul(table, powers, out=rows.transpose(*range(1, len(lead) + 1), 0, len(lead) + 1))
    total: FloatArray = rows[-1]
    if len(rows) > 1:
        fourth = np.multiply(square, square, out=square)
        for row in rows[-2::-1]:
            total *= fourth
            total += row
    return total
