"""The master curve: force, contact radius and stiffness of one tip on one pair of materials, without dimensions.

With varpi = a_half(w)/h, a_half the contact radius on a half-space at the same depth w (5.8) and h the
thickness, three factors say all: a/a_half, P/P_half and kappa_inf = (dP/dw)/(4 theta a), with contact radius a,
force P and the layer's elastic constant theta. They are 1 at varpi = 0. For a power-law shape of exponent
lambda they depend on varpi, lambda and the ratios of the materials only: one curve serves any modulus, any
thickness and any number of depths.

The logarithms of the factors are smooth, and are held as polynomials in

    t(v) = arcsinh(v) + ln(1 + softness v),

which straightens both the growth at large v and, for a substrate softer than the layer, the rapid change at
v = 1/softness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from math import asinh, cos, log1p, pi
from typing import Any, Self

import numpy as np

from underlay._arrays import FloatArray

__all__ = [
    "MOST_IN_POWERS",
    "MOST_TERMS",
    "Factor",
    "MasterCurve",
    "Stretch",
    "chebyshev_angles",
    "chebyshev_coefficients",
    "growth_beyond",
    "in_powers",
    "monomials",
    "piecewise",
    "polynomial",
    "reach",
    "truncation_error",
]

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
    """Columns of the curve: the three factors."""

    RADIUS = 0
    FORCE = 1
    STIFFNESS = 2


@dataclass(frozen=True)
class Stretch:
    """The variable t(v) = arcsinh(v) + ln(1 + softness v) on [0, length], mapped to z in [-1, 1].

    Of many curves at once, their lengths and softness are (sets, 1).
    """

    length: Any
    softness: Any

    @classmethod
    def to(cls, top: float, softness: float) -> Self:
        """Cover v in [0, top]."""
        return cls(asinh(top) + log1p(softness * top), softness)

    @classmethod
    def of_all(cls, stretches: Sequence[Stretch]) -> Self:
        """Stretches of many curves as one, lengths and softness (sets, 1)."""
        return cls(
            *(np.array([[getattr(one, name)] for one in stretches]) for name in ("length", "softness"))
        )

    def part(self, rows: slice | list[int]) -> Stretch:
        """Stretch of some rows of many curves."""
        return Stretch(self.length[rows], self.softness[rows])

    def t(self, v: FloatArray) -> FloatArray:
        """Map v to t."""
        t: FloatArray = np.arcsinh(v)
        if self.softness if isinstance(self.softness, float) else self.softness.any():
            t += np.log1p(self.softness * v)
        return t

    def z(self, v: FloatArray) -> FloatArray:
        """Map v to z."""
        t = self.t(v)
        t *= 2.0 / self.length
        t -= 1.0
        return t

    def dz(self, v: FloatArray) -> FloatArray:
        """dz/dv."""
        bend = 1.0 / np.sqrt(1.0 + v * v) + self.softness / (1.0 + self.softness * v)
        return np.asarray((2.0 / self.length) * bend)

    def v(self, z: FloatArray) -> FloatArray:
        """Inverse of `z`."""
        # With q = v + sqrt(1 + v^2), exp(t) = q (1 + softness v) is quadratic in q: solved for q - 1, which is
        # small where v is.
        grown = np.expm1((0.5 * self.length) * (z + 1.0))
        linear = 1.0 + self.softness
        above = 2.0 * grown / (linear + np.sqrt(linear * linear + 2.0 * self.softness * grown))
        return np.asarray(above * (above + 2.0) / (2.0 * (above + 1.0)), dtype=np.float64)


def chebyshev_angles(count: int) -> FloatArray:
    """Angles of the Chebyshev points z = cos(angle), from z near -1 to z near 1."""
    return np.asarray((np.pi / (2 * count)) * np.arange(2 * count - 1, 0, -2), dtype=np.float64)


def chebyshev_coefficients(values: FloatArray, angles: FloatArray) -> FloatArray:
    """Coefficients (..., count, columns) of the interpolants of `values` at the Chebyshev points."""
    count = angles.size
    scale = np.full((count, 1), 2.0 / count)
    scale[0] = 1.0 / count
    return np.asarray(scale * (np.cos(np.arange(count)[:, None] * angles) @ values), dtype=np.float64)


def _monomial_table(count: int) -> FloatArray:
    """Row k: the coefficients of T_k in powers of z."""
    table = np.zeros((count, count))
    table[0, 0] = table[1, 1] = 1.0
    for k in range(2, count):
        table[k, 1:] = 2.0 * table[k - 1, :-1]
        table[k] -= table[k - 2]
    return table


_MONOMIALS = _monomial_table(MOST_IN_POWERS)


def monomials(count: int) -> FloatArray:
    """Coefficients (count, count) of T_0 ... T_(count - 1), one a row, in powers; at most `MOST_IN_POWERS`."""
    return _MONOMIALS[:count, :count]


def in_powers(coefficients: FloatArray) -> FloatArray:
    """Turn Chebyshev coefficients (..., terms, 3) into powers of z (..., 3, rows, 4) for `polynomial`."""
    terms = coefficients.shape[-2]
    rows = -(-terms // _BLOCK)
    table = np.swapaxes(coefficients, -1, -2) @ _MONOMIALS[:terms, : rows * _BLOCK]
    return table.reshape(*table.shape[:-1], rows, _BLOCK)


def truncation_error(coefficients: FloatArray) -> FloatArray:
    """Error of a Chebyshev interpolant, from how its coefficients (..., terms, columns) fall.

    The last four give the rate, pair against pair; the terms left out, and their aliases, are then within
    three times the sum of a geometric series. A rate of 0.9 and more is taken as 0.9.
    """
    sizes = np.abs(coefficients[..., -4:, :]).max(axis=-1)
    last, before = sizes[..., 2] + sizes[..., 3], sizes[..., 0] + sizes[..., 1]
    # last/(last + before) is rate/(1 + rate): no division by zero but where all four vanish, exactly.
    share = np.minimum(last / np.maximum(last + before, np.finfo(float).tiny), 0.9 / 1.9)
    rate = share / (1.0 - share)
    return np.asarray(3.0 * last * rate / (1.0 - rate))


def reach(count: int) -> float:
    """Length of the interval of `count` Chebyshev points over that up to the last, at z = cos(pi/2n)."""
    return 2.0 / (1.0 + cos(0.5 * pi / count))


def growth_beyond(share: FloatArray, count: int) -> FloatArray:
    """How much the error of an interpolant of `count` terms grows at `share` times the length of its interval.

    The first term left out grows as the Chebyshev polynomial that it is; inside the interval it is one.
    """
    return np.asarray(np.cosh(count * np.arccosh(np.maximum(2.0 * share - 1.0, 1.0))))


@dataclass(frozen=True)
class MasterCurve:
    """The three factors against varpi.

    Parameters
    ----------
    stretch : Stretch
        Of varpi, up to the largest.
    edges : tuple of pieces + 1 floats
        Ends of the pieces in z, from -1 to 1.
    coefficients : ndarray (pieces, 3, rows, 4)
        Of each factor's logarithm (and after these of d ln P/ds at fixed depth, one for each of
        `ContactProblem.beside`), in powers of the piece's own variable in [-1, 1]: entry (j, i) of the last
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
    def constant(cls, top: float, logarithms: FloatArray) -> MasterCurve:
        """Return the curve of factors that do not depend on varpi."""
        table = np.zeros((1, len(Factor), 1, _BLOCK))
        table[0, :, 0, 0] = logarithms
        return cls(Stretch.to(top, 0.0), (-1.0, 1.0), table, 0.0)

    @classmethod
    def through(cls, varpi: FloatArray, logarithms: FloatArray, top: float, softness: float) -> MasterCurve:
        """Return the polynomial through given points, for varpi in [0, `top`].

        Parameters
        ----------
        varpi : ndarray (n,)
            Increasing, and in z close to Chebyshev points: others make the interpolation unstable, which the
            error estimate then shows.
        logarithms : ndarray (n, 3)
            Of the factors, and columns of derivatives after them.
        """
        stretch = Stretch(Stretch.to(float(varpi[-1]), softness).length * reach(varpi.size), softness)
        angles = np.arccos(stretch.z(varpi))
        basis = np.cos(np.multiply.outer(angles, np.arange(varpi.size)))
        coefficients: FloatArray = np.asarray(np.linalg.solve(basis, logarithms), dtype=np.float64)
        growth = growth_beyond(np.array(Stretch.to(top, softness).length / stretch.length), varpi.size)
        return cls.of_pieces(stretch, [-1.0, 1.0], [coefficients], growth=float(growth))

    @classmethod
    def of_pieces(
        cls,
        stretch: Stretch,
        edges: list[float],
        pieces: list[FloatArray],
        jumps: tuple[float, ...] = (),
        growth: float = 1.0,
    ) -> MasterCurve:
        """Return the curve of the given Chebyshev coefficients (terms, 3), one array per piece.

        `growth` is by how much the last piece errs more where it is asked for beyond its points.
        """
        stacked = np.array(pieces)
        table = in_powers(stacked)
        table.flags.writeable = False
        error = growth * float(truncation_error(stacked[..., : len(Factor)]).max())
        return cls(stretch, tuple(edges), table, error, jumps)

    def factor(self, which: Factor, varpi: FloatArray) -> FloatArray:
        """One of the factors at `varpi` (n,)."""
        if varpi.size <= _CHUNK:
            return self._factor(which, varpi)
        result = np.empty_like(varpi)
        for start in range(0, varpi.size, _CHUNK):
            result[start : start + _CHUNK] = self._factor(which, varpi[start : start + _CHUNK])
        return result

    def with_slopes(self, varpi: FloatArray, slopes: FloatArray) -> FloatArray:
        """P/P_half, (dP/dw)/(4 theta a_half), and what tables (pieces, numbers, rows, 4) of `slopes` say there.

        At `varpi` (n,), as rows (2 + numbers, n): one polynomial for all.
        """
        own, count = self.coefficients, slopes.shape[1]
        tables = np.empty((len(own), 2 + count, *own.shape[2:]))
        tables[:, 0] = own[:, Factor.FORCE]
        np.add(own[:, Factor.RADIUS], own[:, Factor.STIFFNESS], out=tables[:, 1])
        tables[:, 2:] = slopes
        rows = np.empty((2 + count, varpi.size))
        for start in range(0, varpi.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            rows[:, part] = piecewise(self.edges, tables, self.stretch.z(varpi[part]))
        np.exp(rows[:2], out=rows[:2])
        return rows

    def _factor(self, which: Factor, varpi: FloatArray) -> FloatArray:
        logarithm = self.logarithm(which, varpi)
        return np.exp(logarithm, out=logarithm)

    def logarithm(self, which: Factor, varpi: FloatArray) -> FloatArray:
        """Logarithm of one of the factors at `varpi` (n,), all of them at a time."""
        return piecewise(self.edges, self.coefficients[:, which], self.stretch.z(varpi))


def piecewise(edges: Sequence[float], tables: FloatArray, z: FloatArray) -> FloatArray:
    """Evaluate polynomials `tables` (pieces, ..., rows, 4) of the pieces between `edges` at z (n,), (..., n)."""
    if len(edges) == 2:
        return polynomial(tables[0], z)
    value = np.empty((*tables.shape[1:-2], z.size))
    piece = np.searchsorted(edges[1:-1], z)
    for index, (low, high) in enumerate(pairwise(edges)):
        here = piece == index
        value[..., here] = polynomial(tables[index], (z[here] - 0.5 * (low + high)) * (2.0 / (high - low)))
    return value


def polynomial(table: FloatArray, z: FloatArray) -> FloatArray:
    """Evaluate sum_j z^(4j) sum_i table[..., j, i] z^i at z (..., n): one product, then Horner in z^4."""
    powers = np.empty((*z.shape[:-1], _BLOCK, z.shape[-1]))
    powers[..., 0, :] = 1.0
    powers[..., 1, :] = z
    square = np.multiply(z, z, out=powers[..., 2, :])
    np.multiply(square, z, out=powers[..., 3, :])
    if table.ndim == 2:
        rows = table @ powers
    else:
        # Row by row, so that what Horner adds up lies together in memory.
        lead = table.shape[:-2] if z.ndim == 1 else np.broadcast_shapes(table.shape[:-2], z.shape[:-1])
        rows = np.empty((table.shape[-2], *lead, z.shape[-1]))
        np.matmul(table, powers, out=rows.transpose(*range(1, len(lead) + 1), 0, len(lead) + 1))
    total: FloatArray = rows[-1]
    if len(rows) > 1:
        fourth = square * square
        for row in rows[-2::-1]:
            total *= fourth
            total += row
    return total
