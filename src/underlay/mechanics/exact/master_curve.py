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

`RadiusSeries` is the same relation as a series in the contact radius, which becomes a `MasterCurve` by inversion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from math import ceil, cos, exp, expm1, log1p, log10, pi
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


def chebyshev_values(z: FloatArray, count: int) -> FloatArray:
    """Chebyshev polynomials T_0, T_1, ... at `z` in [-1, 1], (..., count); rounding may take z beyond 1.

    By cosines: the recurrence of the polynomials would take a step a term.
    """
    return np.cos(np.multiply.outer(np.arccos(np.minimum(z, 1.0)), np.arange(count)))


def lagrange(x: FloatArray, points: FloatArray) -> FloatArray:
    """Lagrange polynomials of `points` at x, (x, points), as products, which are exact at the points too."""
    weights = np.ones((x.size, points.size))
    for column, point in enumerate(points):
        for other in np.delete(points, column):
            weights[:, column] *= (x - other) / (point - other)
    return weights


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
        basis = chebyshev_values(stretch.z(varpi), varpi.size)
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


_NEWTON_STEPS = 60
_BISECTIONS = 50
# Points of the table per term of the series.
_TABLE_POINTS = 6
# A piece this narrow in z that still has not converged sits on a kink: there the estimate says so.
_NARROWEST = 2.0**-12


class Branch(NamedTuple):
    """Points of the table of varpi(chi) on an interval where both increase; varpi and chi as in `RadiusSeries`.

    varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
    of `ContactProblem.chi`, a/h for a power law.
    """

    chi: FloatArray
    varpi: FloatArray


@dataclass(frozen=True)
class RadiusSeries:
    """Depth, force and stiffness as Chebyshev series in the contact radius, the solver's own variable.

    varpi, the measure of depth, is the half-space contact radius at that depth over the thickness h.

    H(r) is the depth at which the contact radius on a half-space is r.

    Parameters
    ----------
    stretch : Stretch
        Of chi: a/h, or for a shape that is not a power law the radius over h at which the shape that measures
        depth has the same H(a).
    coefficients : ndarray (terms, 4 + slopes)
        Chebyshev coefficients in z(chi) of ln(eps/chi) with eps = a/h, ln(P/P_half), ln(kappa_inf), of d ln P/ds at
        fixed depth for each parameter s of `ContactProblem.variants`, and last of ln(varpi/chi).
    """

    stretch: Stretch
    coefficients: FloatArray

    @property
    def error_estimate(self) -> float:
        """Estimated truncation error of the four logarithms (the derivatives are left out)."""
        slopes = slice(len(Factor), -1)
        return float(truncation_error(np.delete(self.coefficients, slopes, axis=1)))

    def values(self, chi: FloatArray) -> FloatArray:
        """Columns of `coefficients` evaluated at `chi` (n,): shape (n, 4 + slopes).

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        return chebyshev_values(self.stretch.z(chi), len(self.coefficients)) @ self.coefficients

    def varpi(self, chi: FloatArray) -> FloatArray:
        """Dimensionless depth varpi (n,) at `chi` (n,).

        varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
        of `ContactProblem.chi`, a/h for a power law.
        """
        return chi * np.exp(self.values(chi)[:, -1])

    def radius(self, varpi: FloatArray, branch: Branch) -> FloatArray:
        """chi (n,) at `varpi` (n,) on one branch, by Newton's method within the brackets of its table.

        chi is the radius variable of `ContactProblem.chi`, a/h for a power law.
        """
        series = self.coefficients[:, -1]
        derivative = np.polynomial.chebyshev.chebder(series)
        index = np.searchsorted(branch.varpi, varpi).clip(1, branch.chi.size - 1)
        low, high = branch.chi[index - 1], branch.chi[index]
        chi = np.interp(varpi, branch.varpi, branch.chi)
        for _ in range(_NEWTON_STEPS):
            waves = chebyshev_values(self.stretch.z(chi), len(series))
            slope = waves[:, :-1] @ derivative
            error = waves @ series + np.log(chi / varpi)
            low, high = np.where(error < 0.0, chi, low), np.where(error > 0.0, chi, high)
            proposal = chi - error * chi / (1.0 + chi * slope * self.stretch.dz(chi))
            # An end of the bracket is as good as what is inside: a step to rounding ends there, and halving the
            # bracket would send it back out (31 steps in place of 5).
            proposal = np.where((proposal >= low) & (proposal <= high), proposal, 0.5 * (low + high))
            step = np.abs(proposal - chi)
            chi = proposal
            if (step <= 1e-13 * chi).all():
                break
        return chi

    def branches(self) -> list[Branch]:
        """Intervals on which varpi(chi) increases: one, unless the relation folds.

        varpi is the half-space contact radius at the depth over the thickness. chi is the radius variable
        of `ContactProblem.chi`, a/h for a power law.
        """
        count = _TABLE_POINTS * self.coefficients.shape[0]
        chi = np.append(0.0, self.stretch.v(np.linspace(-1.0, 1.0, count)[1:]))
        varpi = np.append(0.0, self.varpi(chi[1:]))
        rising = np.diff(varpi) > 0.0
        turns = np.flatnonzero(np.diff(rising.astype(np.int8)))
        bounds = [0, *(int(turn) + 1 for turn in turns), chi.size - 1]
        return [
            Branch(chi[start : stop + 1], varpi[start : stop + 1])
            for start, stop in pairwise(bounds)
            if rising[start]
        ]

    def inverted(self, top: float, rtol: float) -> MasterCurve:
        """Invert the relation: the master curve for varpi in [0, `top`], at truncation error `rtol`.

        It has as many pieces as that takes. A cone on a stiff film over a soft base folds: over some depths three
        contact radii satisfy the equations. The contact then jumps from disc to disc where both carry the same
        force, since of all contact areas the true one carries the largest load (Barber 1974,
        doi:10.1243/03093247V094230).

        varpi is the half-space contact radius at the depth over the thickness.
        """
        stretch = self.stretch.over(top)
        ends, branches = [0.0], self.branches()
        for lower, upper in pairwise(branches):
            ends.append(self._crossing(lower, upper))
        jumps = [end for end in ends[1:] if end < top]
        spans = zip([*ends[: len(jumps) + 1]], [*jumps, top], branches, strict=False)
        pieces: list[tuple[float, FloatArray]] = []
        for start, stop, branch in spans:
            low, high = stretch.z(np.array([start, stop]))
            pieces += self._pieces(stretch, float(low), float(high), branch, rtol)
        edges = [*(low for low, _ in pieces), 1.0]
        return MasterCurve.of_pieces(stretch, edges, [piece for _, piece in pieces], rtol, tuple(jumps))

    def _crossing(self, lower: Branch, upper: Branch) -> float:
        """varpi at which two overlapping branches carry the same force, by bisection: there the radius jumps.

        varpi is the half-space contact radius at the depth over the thickness.
        """
        low, high = float(upper.varpi[0]), float(lower.varpi[-1])
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            at = np.array([middle])
            forces = [self.values(self.radius(at, branch))[0, Factor.FORCE] for branch in (lower, upper)]
            low, high = (low, middle) if forces[1] > forces[0] else (middle, high)
        return 0.5 * (low + high)

    def _pieces(
        self, stretch: Stretch, start: float, stop: float, branch: Branch, rtol: float
    ) -> list[tuple[float, FloatArray]]:
        """Start in z and Chebyshev coefficients of each piece of one branch, halved until `rtol` is met.

        `start` and `stop` are the ends of the branch in z, the variable of `stretch` on [-1, 1].
        """
        length = 0.5 * (stop - start) * stretch.length
        count = ceil((1.0 - log10(rtol) * (1.2 + 0.75 * length)) / MOST_TERMS)
        angles = chebyshev_angles(MOST_TERMS)
        points = np.cos(angles)
        ends = np.linspace(start, stop, count + 1)
        low, high = ends[:-1], ends[1:]
        done: dict[float, FloatArray] = {}
        while low.size:
            # All at once: calls, not their arithmetic, are what a piece costs.
            varpi = stretch.v((0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * points).ravel())
            chi = self.radius(varpi, branch)
            logarithms = self.values(chi)[:, :-1]
            logarithms[:, Factor.RADIUS] += np.log(chi / varpi)
            pieces = chebyshev_coefficients(logarithms.reshape(low.size, MOST_TERMS, -1), angles)
            coarse = (truncation_error(pieces[..., : len(Factor)]) > rtol) & (high - low > _NARROWEST)
            done |= {float(low[i]): pieces[i] for i in np.flatnonzero(~coarse)}
            low, high = low[coarse], high[coarse]
            middle = 0.5 * (low + high)
            low, high = np.concatenate((low, middle)), np.concatenate((middle, high))
        return sorted(done.items())
