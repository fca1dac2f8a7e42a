"""Propagation of the minors through one layer, by divided differences, free of equal roots and cancellation.

The five minors y of `recursion` obey y' = A y upwards, as v = xi t grows (wavenumber times thickness). A has the
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
from math import factorial
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.mechanics.body import PlaneConstants, Real

__all__ = ["WAVES", "Waves", "products"]

#: Functions of v.
WAVES = 5
Formula = Callable[[FloatArray, "_Roots", FloatArray], None]

# v max(sigma, 2 sqrt p) below which E_3 and E_4 are Taylor series of v; beyond, their closed forms cancel by a
# factor of 10 at most. Relative error at the switch: 5e-16 by the series, 2e-15 by the closed forms.
_SERIES = 2.0
# The first term left out is 2^22 3!/25! = 2e-18 of the first.
_TERMS = 22
_BLOCKS = 6
# The slower root over sigma/2 below which E_3 and E_4 are written in the roots: the forms in sigma and d lose the
# ratio. At the switch both are right to 1e-15.
_APART = 0.5
# |d^2|/p below which roots that turn count as real: twice what the rounding of isotropic constants leaves.
_ROUNDING = 4.0 * np.finfo(float).eps
_POWERS = read_only(np.arange(_TERMS, dtype=np.float64))


def _sums() -> FloatArray:
    """Matrix from the products (-sigma)^i (4 d^2)^j to the Taylor coefficients of E_3 and E_4, both scaled.

    i < terms and 2 j < terms; sigma and d as in the module's head. The coefficient of v^(k+3) is the sum of
    (-sigma)^i (4 d^2)^j with i + 2 j = k over (k + 3)!, that of v^(2k+4) the sum of sigma^(2i) (4 d^2)^j with i + j
    = k over (2k + 4)!: complete homogeneous sums of the nodes, and of their squares. The columns hold four powers
    of each series in turn.

    E_0 to E_4 are functions of v, the wavenumber times the thickness: the parts of the propagator of
    one layer.
    """
    table = np.zeros((_TERMS, _TERMS // 2, 2, _BLOCKS * 4))
    for i in range(_TERMS):
        for j in range((_TERMS - i + 1) // 2):
            table[i, j, 0, i + 2 * j] = 1.0 / factorial(i + 2 * j + 3)
            if i % 2 == 0:
                table[i, j, 1, i + 2 * j] = 1.0 / factorial(i + 2 * j + 4)
    return np.swapaxes(table.reshape(-1, 2, _BLOCKS, 4), 1, 2).reshape(len(table) * (_TERMS // 2), -1)


_SUMS = read_only(_sums())


def products(of: PlaneConstants, y: Sequence[Real]) -> list[tuple[Real, ...]]:
    """The five vectors that E_0 to E_4 multiply: y, A y, A^2 y and the two products of the module's head.

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them, see
    `waves`.

    Parameters
    ----------
    of : PlaneConstants
        Of the layer.
    y : sequence of five floats or ndarrays
        Minors under the layer.

    Returns
    -------
    list of five tuples
        Five minors each.
    """
    q, c, g, S = of
    p, gap, sigma = of.p, of.p_minus_q, of.sigma
    unit, cross, both, radial, axial = y
    turned, stiff = axial - q * radial, S * g - 2.0 * q
    down, out = c * unit - 2.0 * q * cross + g * both, S * unit + 2.0 * cross
    first = (g * radial, turned, c * radial + S * axial, out, down)
    second = (
        g * out,
        down - q * out,
        c * out + S * down,
        stiff * radial + 2.0 * axial,
        2.0 * p * p * radial + stiff * axial,
    )
    even, odd = 2.0 * ((p * S + c) * unit + 2.0 * gap * cross + g * both), 2.0 * (p * radial + axial)
    third = (g * odd, gap * odd, (c + p * S) * odd, even, p * even)
    grown = even + sigma * odd
    fourth = (g * grown, gap * grown, (c + p * S) * grown, sigma * grown, p * sigma * grown)
    return [tuple(y), first, second, third, fourth]


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
        d = np.sqrt(np.maximum(np.abs(square), np.finfo(float).eps * p))
        kinds = np.where(square < -_ROUNDING * p, 0, np.where(p < _APART * half * (half + d), 1, 2))[
            :, 0
        ].tolist()
        self._kinds: list[tuple[list[int], Formula, _Roots]] = []
        for kind in set(kinds):
            rows = [row for row, own in enumerate(kinds) if own == kind]
            own = (
                (float(root[0, 0]) for root in (p, sigma, d))
                if len(p) == 1
                else (p[rows], sigma[rows], d[rows])
            )
            self._kinds.append((rows, (_turning, _far, _near)[kind], _Roots(*own)))
        self._scale = np.maximum(sigma, 2.0 * np.sqrt(p))
        over = 1.0 / self._scale
        powers = (sigma * -over) ** _POWERS
        pairs = powers[:, :, None] * (4.0 * square * over * over)[:, None] ** _POWERS[: _TERMS // 2]
        self._series = (pairs.reshape(len(p), -1) @ _SUMS).reshape(len(p), -1, 4)

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
        powers = np.empty((len(z), 4, z.shape[1]))
        powers[:, 0], powers[:, 1] = 1.0, z
        square = np.multiply(z, z, out=powers[:, 2])
        np.multiply(square, z, out=powers[:, 3])
        blocks = (self._series @ powers).reshape(len(z), _BLOCKS, 2, -1)
        fourth = (square * square)[:, None]
        series = blocks[:, -1]
        for k in range(_BLOCKS - 2, -1, -1):
            series *= fourth
            series += blocks[:, k]
        start = v * v
        start *= v
        start *= out[:, 0]
        series *= start[:, None]
        series[:, 1] *= v
        np.copyto(out[:, 3:], series, where=near)


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
