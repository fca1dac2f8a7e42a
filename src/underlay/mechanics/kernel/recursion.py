"""Compliance of a stack's surface, 1 - L(u) first: the five minors of its solutions, carried up from the base.

With xi the wavenumber, v = xi t in a layer of thickness t, and below every interface (displacement) = -C
(stress over xi), C = [[C11, C12], [C12, C22]] (radial, axial) symmetric, the compliance obeys a Riccati equation
in depth. In the minors y = f (1, -C12, det C, C11, C22), f any factor, named (y0, y12, yD, y11, y22), it is linear
(Dunkin 1965, Bull. Seismol. Soc. Am. 55, 335), y' = A y upwards, in the constants q, c, g, S of the layer
(`PlaneConstants`):

    y0' = g y11,           y12' = y22 - q y11,     yD' = c y11 + S y22,
    y11' = S y0 + 2 y12,   y22' = c y0 - 2 q y12 + g yD.

det C is carried, not formed: what is lost by subtraction in 2 x 2 matrices, where a soft layer lies between stiff
ones, never arises. The passage through a layer is y <- exp(v A) y.

At an interface with springs C <- C + xi diag(1/k_shear, 1/k_normal), and where it slips C11 -> inf: both are
linear in y. On top 1 - L = (C_1,22 y0 - y22)/(C_1,22 y0), C_1 the compliance of a half-space of the layer on top:
that is the growing wave, and leaves nothing in the numerator, so that it is taken out of y under the layer first
and its function, absent, does not spoil the digits where the numerator decays. The same material all the way down
gives zero to the last bit. With friction C11 and C12 are wanted too: they are the other minors over y0.

It is the L(u) of (1.6) and of the paper's appendix for one layer bonded to its base, without the appendix's
division by gamma_1 - gamma_2: real, equal and complex roots and nu = 0.5 are one formula. Erratum of the appendix:
a_21 carries a minus, -(2 gamma_1/Z){...}; as printed, the terms in x_1 y_1 cancel and L is wrong.

Constants and thicknesses may be (sets, 1): all sets go up together.

Propagation of the minors through one layer, by divided differences, free of equal roots and cancellation.

The five minors y obey y' = A y upwards, as v = xi t grows (wavenumber times thickness). A has the
eigenvalues 0, +-2d and +-sigma, with p and sigma the product and the sum of the layer's decay roots and d^2 =
sigma^2/4 - p of any sign. Newton's form of exp(v A) with the nodes 0, 2d, -2d, -sigma, sigma, in this order, is

    exp(-sigma v) exp(v A) = E_0 + E_1 A + E_2 A^2 + E_3 A (A^2 - 4 d^2) + E_4 A (A^2 - 4 d^2) (A + sigma),

E_k = exp(-sigma v) times divided differences of exp(v x), all but the first positive where the roots are real:

    E_0 = exp(-sigma v),  E_1 = ch sh,  E_2 = sh^2/2,  E_3 = (E_0 (1 - E_0) - sigma E_1 + sigma^2 E_2)/(4 p sigma),
    E_4 = (e - sh) (e + sh)/(8 p),   e = (1 - E_0)/sigma,  sh = exp(-sigma v/2) sinh(d v)/d,  ch alike.

Only decaying exponentials occur. E_k starts as v^k: entries of the propagator that start late keep their digits in
thin layers. Written out, with w_e = (p S + c) y0 + 2 (p - q) y12 + g yD and w_o = p y11 + y22,

    A (A^2 - 4 d^2) y = 2 (g w_o, (p - q) w_o, (c + p S) w_o, w_e, p w_e),
    A (A^2 - 4 d^2) (A + sigma) y = 2 (w_e + sigma w_o) (g, p - q, c + p S, sigma, p sigma):

no entry is a difference, and the last is the growing wave alone, the minors of a half-space.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import factorial, inf
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.body import PlaneConstants, Real
from underlay.mechanics.kernel.kernel import Compliance

#: Functions of v.
WAVES = 5
Formula = Callable[[FloatArray, "_Roots", FloatArray], None]

# v max(sigma, 2 sqrt p) below which E_3 and E_4 are Taylor series of v; beyond, their closed forms cancel by a
# factor of 10 at most. Relative error at the switch: 5e-16 by the series, 2e-15 by the closed forms.
_SERIES = 2.0
# The first term left out is 2^22 3!/25! = 2e-18 of the first.
_TERMS = 22
# The slower root over sigma/2 below which E_3 and E_4 are written in the roots: the forms in sigma and d lose the
# ratio. At the switch both are right to 1e-15.
_APART = 0.5
# |d^2|/p below which roots that turn count as real: twice what the rounding of isotropic constants leaves.
_EPSILON = float(np.finfo(float).eps)
_ROUNDING = 4.0 * _EPSILON
_POWERS = read_only(np.arange(_TERMS, dtype=np.float64))


def _sums() -> FloatArray:
    """Matrix from the products (-sigma)^i (4 d^2)^j to the Taylor coefficients of E_3 and E_4, both scaled.

    i < terms and 2 j < terms; sigma and d as in the module's head. The coefficient of v^(k+3) is the sum of
    (-sigma)^i (4 d^2)^j with i + 2 j = k over (k + 3)!, that of v^(2k+4) the sum of sigma^(2i) (4 d^2)^j with i + j
    = k over (2k + 4)!: complete homogeneous sums of the nodes, and of their squares. The columns hold the powers of
    the one series, then those of the other.

    E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
    one layer.
    """
    table = np.zeros((_TERMS, _TERMS // 2, 2, _TERMS))
    for i in range(_TERMS):
        for j in range((_TERMS - i + 1) // 2):
            table[i, j, 0, i + 2 * j] = 1.0 / factorial(i + 2 * j + 3)
            if i % 2 == 0:
                table[i, j, 1, i + 2 * j] = 1.0 / factorial(i + 2 * j + 4)
    return table.reshape(len(table) * (_TERMS // 2), -1)


_SUMS = read_only(_sums())
_UNIT_MATRIX = read_only(np.eye(5))


def passage(of: FloatArray) -> FloatArray:
    """The matrices that E_0 to E_4 multiply: 1, A, A^2 and the two products of the module's head.

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them (see the
    module).

    Parameters
    ----------
    of : ndarray (7, ...)
        q, c, g, S, p, p - q and sigma of the layers (`PlaneConstants`).

    Returns
    -------
    ndarray (..., 5, 5, 5)
        By minor above the layer, minor below it, and function.
    """
    q, c, g, S, p, gap, sigma = of
    matrices = np.zeros((*g.shape, 5, 5, WAVES))
    unit, A, twice, third, fourth = (matrices[..., number] for number in range(WAVES))
    unit[...] = _UNIT_MATRIX
    A[..., 0, 3] = A[..., 4, 2] = g
    A[..., 2, 3] = A[..., 4, 0] = c
    A[..., 2, 4] = A[..., 3, 0] = S
    A[..., 4, 1] = -2.0 * q
    A[..., 1, 3] = -q
    A[..., 1, 4], A[..., 3, 1] = 1.0, 2.0
    np.matmul(A, A, out=twice)
    # The third product is two columns times the rows 2 w_o and 2 w_e.
    columns, rows = np.zeros((2, *g.shape, 2, 5))
    stiff = p * S + c
    columns[..., 0, 0] = g
    columns[..., 0, 1] = gap
    columns[..., 0, 2] = stiff
    columns[..., 1, 3], columns[..., 1, 4] = 1.0, p
    rows[..., 0, 3], rows[..., 0, 4] = p, 1.0
    rows[..., 1, 0] = stiff
    rows[..., 1, 1] = 2.0 * gap
    rows[..., 1, 2] = g
    rows *= 2.0
    np.matmul(columns.swapaxes(-1, -2), rows, out=third)
    rate = sigma[..., None]
    column, row = columns[..., 0, :] + rate * columns[..., 1, :], rows[..., 1, :] + rate * rows[..., 0, :]
    np.multiply(column[..., :, None], row[..., None, :], out=fourth)
    return matrices


class _Roots(NamedTuple):
    """Product p and sum sigma of the decay roots, and d = sqrt|sigma^2/4 - p|; floats, or (rows, 1).

    Displacements at wavenumber xi decay with depth z as exp(-root xi z).
    """

    p: Real
    sigma: Real
    d: Real


class Waves:
    """The functions E_0 to E_4 (module's head) of layers with given decay roots, to be called at v.

    E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
    one layer. Displacements at wavenumber xi decay with depth z as exp(-root xi z).

    Parameters
    ----------
    p, sigma : array (rows, 1)
        Product and sum of the decay roots of each layer.
    """

    def __init__(self, p: FloatArray, sigma: FloatArray) -> None:
        half = 0.5 * sigma
        square = half * half - p
        # Nearer to equal than its rounding d^2 is not known, and nothing here needs it.
        d = np.sqrt(np.maximum(np.abs(square), _EPSILON * p))
        kinds = ((square >= -_ROUNDING * p) * (1 + (p >= _APART * half * (half + d))))[:, 0].tolist()
        self._kinds: list[tuple[list[int], Formula, _Roots]] = []
        for kind in set(kinds):
            rows = [row for row, own in enumerate(kinds) if own == kind]
            found: Sequence[Real] = p, sigma, d
            if len(p) == 1:
                found = float(p[0, 0]), float(sigma[0, 0]), float(d[0, 0])
            elif len(rows) < len(p):
                found = p[rows], sigma[rows], d[rows]
            self._kinds.append((rows, (_turning, _far, _near)[kind], _Roots(*found)))
        self._scale = np.maximum(sigma, 2.0 * np.sqrt(p))
        over = 1.0 / self._scale
        powers = (sigma * -over) ** _POWERS
        pairs = powers[:, :, None] * (4.0 * square * over * over)[:, None] ** _POWERS[: _TERMS // 2]
        self._series = (pairs.reshape(len(p), -1) @ _SUMS).reshape(len(p), 2, _TERMS)

    def __call__(self, v: FloatArray) -> FloatArray:
        """E_0 to E_4, (rows, 5, nodes), at `v` (rows, nodes), wavenumber times thickness, zero or more.

        E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
        one layer.
        """
        found = np.empty((len(v), WAVES, v.shape[1]))
        for rows, formula, roots in self._kinds:
            if len(v) == 1:
                formula(v[0], roots, found[0])
            elif len(rows) == len(v):
                formula(v, roots, found.transpose(1, 0, 2))
            else:
                part = np.empty((WAVES, len(rows), v.shape[1]))
                formula(v[rows], roots, part)
                found[rows] = part.transpose(1, 0, 2)
        self._start(v, found)
        return found

    def _start(self, v: FloatArray, out: FloatArray) -> None:
        """Replace E_3 and E_4 in `out` by their Taylor series where v is small.

        E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
        one layer.
        """
        z = self._scale * v
        near = (z < _SERIES)[:, None]
        np.minimum(z, _SERIES, out=z)
        series = self._series @ _powers(z, _TERMS)
        start = v * v
        start *= v
        start *= out[:, 0]
        series *= start[:, None]
        series[:, 1] *= v
        np.copyto(out[:, 3:], series, where=near)


def _powers(x: FloatArray, count: int) -> FloatArray:
    """The first `count` powers of x (rows, n), from 1 on: (rows, count, n)."""
    powers = np.empty((len(x), count, x.shape[1]))
    powers[:, 0], powers[:, 1:] = 1.0, x[:, None]
    return np.multiply.accumulate(powers, axis=1, out=powers)


def _turning(v: FloatArray, roots: _Roots, out: FloatArray) -> None:
    """E_0 to E_4 for complex decay roots, written to `out` (5, ...).

    E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
    one layer. Displacements at wavenumber xi decay with depth z as exp(-root xi z).
    """
    p, sigma, d = roots
    decay, phase = np.exp(-0.5 * sigma * v), d * v
    sh = decay * np.sin(phase) / d
    e = np.expm1(-sigma * v) / -sigma
    out[0], out[1], out[2] = decay * decay, decay * np.cos(phase) * sh, 0.5 * sh * sh
    _last(p, sigma, sh, e, out)


def _near(v: FloatArray, roots: _Roots, out: FloatArray) -> None:
    """E_0 to E_4 for real roots whose ratio is not small, written to `out` (5, ...).

    E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
    one layer.
    """
    p, sigma, d = roots
    slow, fallen = np.exp(-p / (0.5 * sigma + d) * v), np.expm1((-2.0 * d) * v)
    sh = slow * fallen / (-2.0 * d)
    out[0], out[1], out[2] = slow * slow * (1.0 + fallen), (slow - d * sh) * sh, 0.5 * sh * sh
    _last(p, sigma, sh, (1.0 - out[0]) / sigma, out)


def _last(p: Real, sigma: Real, sh: FloatArray, e: FloatArray, out: FloatArray) -> None:
    """E_3 and E_4 from E_0 to E_2, sh and e of the module's head, written to `out`.

    E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
    one layer.
    """
    out[3] = (out[0] * e - out[1] + sigma * out[2]) * (0.25 / p)
    out[4] = (e - sh) * (e + sh) * (0.125 / p)


def _far(v: FloatArray, roots: _Roots, out: FloatArray) -> None:
    """E_0 to E_4 for real roots m << M, with h = sigma/2 and p = m M divided out.

    With x = exp(-2 d v): E_3 = exp(-2 m v) {x^2 (1 - exp(-2 m v))/m + (1 - x) [h - x (3 h - 2 m)]/(2 d^2)}/(8 h M),
    e - sh = [(1 + exp(-M v)) (1 - exp(-m v)) M - (1 - exp(-M v)) (1 + exp(-m v)) m]/(4 h d).
    """
    p, sigma, d = roots
    h = 0.5 * sigma
    fast = h + d
    low = p / fast
    slow, x, gap = np.exp(-low * v), np.exp((-2.0 * d) * v), -np.expm1((-2.0 * d) * v)
    sh, e, twice = slow * gap / (2.0 * d), -np.expm1(-sigma * v) / sigma, slow * slow
    out[0] = np.exp(-sigma * v)
    out[1] = twice * gap * (1.0 + x) / (4.0 * d)
    out[2] = 0.5 * sh * sh
    third = x * x * (-np.expm1((-2.0 * low) * v) / low) + gap * (h - x * (3.0 * h - 2.0 * low)) / (
        2.0 * d * d
    )
    out[3] = twice * third / (8.0 * h * fast)
    fallen, rest = -np.expm1(-fast * v), np.exp(-fast * v)
    parted = (1.0 + rest) * (-np.expm1(-low * v) / low) - fallen * (1.0 + slow) / fast
    out[4] = parted * (e + sh) / (32.0 * h * d)


# The minors: f, -f C12, f det C, f C11, f C22.
_UNIT, _CROSS, _BOTH, _RADIAL, _AXIAL = range(5)
# Stands for u = 0, where a layer that slips divides zero by zero: 1 - L is continuous there, and this is below
# the rounding of any term it is added to.
_NEAREST = 1e-100


@dataclass(frozen=True)
class Sheet:
    """One layer, made dimensionless by the thickness t_1 and the constant g_1 of the layer on top.

    Parameters
    ----------
    constants : PlaneConstants
        c and S times g_1, g over g_1; floats, or arrays (sets, 1).
    thickness : float or ndarray (sets, 1)
        Over t_1.
    opening, sliding : float
        Compliances of its lower face, g_1/(t_1 k_normal) and g_1/(t_1 k_shear): zero bonded, infinite free.
    """

    constants: PlaneConstants
    thickness: Real
    opening: float
    sliding: float

    @cached_property
    def slips(self) -> bool:
        """Whether its lower face slides without friction."""
        return bool(self.sliding == inf)

    @cached_property
    def sprung(self) -> bool:
        """Whether its lower face opens or slides in proportion to the stress."""
        return self.opening != 0.0 or not (self.sliding == 0.0 or self.slips)


class Recursion:
    """1 - L(u) and the other surface compliances of given layers on a base, as a function of the wavenumber.

    What does not depend on the wavenumber is computed once, at construction.

    Parameters
    ----------
    sheets : tuple of Sheet
        From the top down.
    base : PlaneConstants or None
        In the same units as the sheets; None is rigid.
    """

    def __init__(self, sheets: tuple[Sheet, ...], base: PlaneConstants | None) -> None:
        self._sheets = sheets[::-1]
        of = _in_rows([(*_seven(sheet.constants), sheet.thickness) for sheet in self._sheets])
        self._thicknesses, self._lead = of[-1], of.shape[1:-1]
        self._waves = Waves(of[4].reshape(-1, 1), of[6].reshape(-1, 1))
        minors = _halfspace_minors(base), _halfspace_minors(sheets[0].constants)
        self._base, self._growing = _in_rows(list(zip(*minors, strict=True)))
        self._passages = passage(of[:7, ..., 0])
        top = self._passages[..., -1, :, :, :]
        self._unit = top[..., :1, :, :]
        # The last function is the growing wave, which leaves nothing.
        seen = (self._growing[..., 1:, :, None] * self._unit - top[..., 1:, :, :])[..., :-1]
        self._seen = np.ascontiguousarray(seen)

    def one_minus_L(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,) of zero or more.

        1 - L(u) is the relative change of surface compliance by what is under the top layer, u the
        wavenumber times its thickness.

        Returns
        -------
        array (nodes,) or (sets, nodes)
            Absolute error of L below 1e-14, relative error where it is large below 1e-13, of every material on
            every base of tests/studies/torture.py.
        """
        u, functions = self._at(u)
        axial = self._missing(u, functions, slice(_AXIAL - 1, None))
        return np.asarray(axial[..., 0, :] / self._growing[..., _AXIAL, :])

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance (radial, mixed, axial) at `u` (nodes,) of zero or more.

        Every entry keeps its relative accuracy where it decays.
        """
        u, functions = self._at(u)
        missing = self._missing(u, functions, slice(None))
        cross, radial, axial = (missing[..., k - 1, :] for k in (_CROSS, _RADIAL, _AXIAL))
        of = self._sheets[-1].constants
        mixed = cross * of.theta * of.p**0.5
        return Compliance(
            np.asarray(radial / self._growing[..., _RADIAL, :]),
            np.asarray(mixed),
            np.asarray(axial / self._growing[..., _AXIAL, :]),
        )

    def _missing(self, u: FloatArray, functions: FloatArray, rows: slice) -> FloatArray:
        """Minors of a half-space's growing wave minus the body's, over the body's first: (..., rows, nodes).

        The half-space is of the top layer's material. `functions` are the E_k of all sheets at `u`; `rows` selects
        among the minors after the first.

        Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
        E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them (see the
        module).
        """
        top, part = functions[..., -1, :, :], functions[..., -1, :-1, :]
        below = self._under_the_top(u, functions)
        change = below - below[..., :1, :] * self._growing
        return _applied(self._seen[..., rows, :, :], part, change) / _applied(self._unit, top, below)

    def _at(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Wavenumbers and the functions E_k of each sheet there; with slip zero becomes a tiny number.

        E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
        one layer.
        """
        if any(sheet.slips for sheet in self._sheets):
            u = np.maximum(u, _NEAREST)
        v = (u * self._thicknesses).reshape(-1, u.size)
        return u, self._waves(v).reshape(*self._lead, WAVES, u.size)

    def _under_the_top(self, u: FloatArray, functions: FloatArray) -> FloatArray:
        """Minors just above the interface under the top sheet, (..., 5, nodes or 1), up to a common factor.

        Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
        """
        y = self._base
        for number, sheet in enumerate(self._sheets[:-1]):
            y = _applied(
                self._passages[..., number, :, :, :], functions[..., number, :, :], _opened(u, sheet, y)
            )
            if number:  # any factor will do; one or two passages cannot grow beyond all numbers
                y = y / y.max(axis=-2, keepdims=True)
        return _opened(u, self._sheets[-1], y)


def scaled(of: PlaneConstants, g: Real) -> PlaneConstants:
    """Plane constants made dimensionless by a stiffness `g` (Pa)."""
    return PlaneConstants(of.q, of.c * g, of.g / g, of.S * g)


def _applied(table: FloatArray, basis: FloatArray, y: FloatArray) -> FloatArray:
    """Rows of the propagator from a table (..., rows, 5, functions), its functions, times the minors y.

    `basis` (..., functions, nodes) are the functions E_k; the result is (..., rows, nodes).

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them (see the
    module).
    """
    *sets, rows, minors, functions = table.shape
    passage = table.reshape(*sets, rows * minors, functions) @ basis
    passage = passage.reshape(*passage.shape[:-2], rows, minors, -1)
    passage *= y[..., None, :, :]
    return np.asarray(np.add.reduce(passage, axis=-2))


def _seven(of: PlaneConstants) -> tuple[Real, ...]:
    """q, c, g, S, p, p - q and sigma, as `passage` takes them."""
    return (*of, of.p, of.p_minus_q, of.sigma)


def _in_rows(of_sheets: Sequence[Sequence[Real]]) -> FloatArray:
    """Numbers of sheets as (numbers, sheets, 1), or (numbers, sets, sheets, 1) where some are (sets, 1)."""
    flat = [number for own in of_sheets for number in own]
    if not any(isinstance(number, np.ndarray) for number in flat):
        return np.array(of_sheets, dtype=np.float64).T[..., None]
    stacked = np.stack(np.broadcast_arrays(*flat))
    return stacked.reshape(len(of_sheets), -1, *stacked.shape[1:]).transpose(1, 2, 0, 3)


def _halfspace_minors(base: PlaneConstants | None) -> tuple[Real, ...]:
    """Minors of the surface of a half-space, floats or (sets, 1): the first is 1, the others 0 if rigid.

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    """
    if base is None:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    g, p, gap, sigma = base.g, base.p, base.p_minus_q, base.sigma
    # det C = (p sigma^2 - (p - q)^2)/g^2 without the difference.
    return g / g, gap / g, (p * base.S + base.c) / g, sigma / g, p * sigma / g


def _opened(u: FloatArray, sheet: Sheet, y: FloatArray) -> FloatArray:
    """Minors (..., 5, nodes or 1) above the interface under a sheet (springs, slip), from those below.

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    """
    if sheet.sprung:
        y = y + np.zeros_like(u * sheet.opening)
        y[..., _AXIAL, :] += sheet.opening * u * y[..., _UNIT, :]
        y[..., _BOTH, :] += sheet.opening * u * y[..., _RADIAL, :]
    if sheet.slips:
        free = np.zeros_like(y)
        free[..., _RADIAL, :], free[..., _BOTH, :] = y[..., _UNIT, :], y[..., _AXIAL, :]
        return free
    if sheet.sprung:
        y[..., _RADIAL, :] += sheet.sliding * u * y[..., _UNIT, :]
        y[..., _BOTH, :] += sheet.sliding * u * y[..., _AXIAL, :]
    return y
