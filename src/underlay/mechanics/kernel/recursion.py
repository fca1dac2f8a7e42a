"""The compliance of a stack's surface, 1 - L(u) first: the five minors of its solutions, carried up from the base.

With xi the wavenumber, v = xi t in a layer of thickness t, and below every interface (displacement) = -C
(stress over xi), C = [[C11, C12], [C12, C22]] (radial, axial) symmetric, the compliance obeys a Riccati equation
in depth. In the minors y = f (1, -C12, det C, C11, C22), f any factor, it is linear (Dunkin 1965, Bull. Seismol.
Soc. Am. 55, 335), y' = A y upwards, in q, c, g, S of the layer:

    y0' = g y11,           y12' = y22 - q y11,     yD' = c y11 + S y22,
    y11' = S y0 + 2 y12,   y22' = c y0 - 2 q y12 + g yD.

det C is carried, not formed: what is lost by subtraction in 2 x 2 matrices, where a soft layer lies between stiff
ones, never arises. With p, sigma as in `one_layer` and d^2 = sigma^2/4 - p the eigenvalues of A are 0, +-sigma and
+-2d, so that the passage through a layer, y <- exp(v A) y, is

- thick layers, times exp(-sigma v), with P = A^2 (A^2 - 4 d^2)/(4 p sigma^2) and Q = 1 - P:
  (P + A P/sigma)/2 + exp(-2 sigma v) (P - A P/sigma)/2 + exp(-sigma v) Q + ch sh A Q + sh^2 A^2 Q/2;
- thin layers, v sigma < 2: its Taylor series, which keeps the powers of v that start late.

At an interface with springs C <- C + xi diag(1/k_shear, 1/k_normal), and where it slips C11 -> inf: both are
linear in y. On top 1 - L = (C_1,22 y0 - y22)/(C_1,22 y0): the first term of the thick passage is absent from the
numerator, exactly, so that it keeps its digits where it decays. With friction C11 and C12 are wanted too: they are
the other minors over y0.

Constants and thicknesses may be (sets, 1): all sets go up together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import factorial, inf

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.body import PlaneConstants, Real
from underlay.mechanics.kernel.kernel import Compliance
from underlay.mechanics.kernel.one_layer import EQUAL_ROOTS, passage

__all__ = ["Recursion", "Sheet", "scaled"]

# The minors: f, -f C12, f det C, f C11, f C22.
_UNIT, _CROSS, _BOTH, _RADIAL, _AXIAL = range(5)
# v sigma below which a layer is thin.
_THIN = 0.6
# Terms of the series: the first left out is below 0.6^16/16! = 1e-17.
_TERMS = 16
_EVEN = _TERMS // 2
_FACTORIALS = np.array([1.0 / factorial(k) for k in range(_TERMS)])
# 1, exp(-2 sigma v), exp(-sigma v), ch sh, sh^2.
_WAVES = 5
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
        """Whether its lower face slides freely."""
        return bool(self.sliding == inf)

    @cached_property
    def sprung(self) -> bool:
        """Whether its lower face gives way in proportion to the stress."""
        return self.opening != 0.0 or not (self.sliding == 0.0 or self.slips)

    @cached_property
    def roots(self) -> tuple[Real, Real]:
        """Product p and sum sigma of the decay roots."""
        return self.constants.p, self.constants.sigma


class Recursion:
    """The recursion through given sheets, compiled: only the wavenumbers are left open.

    Parameters
    ----------
    sheets : tuple of Sheet
        From the top down.
    base : PlaneConstants or None
        As for the sheets; None is rigid.
    """

    def __init__(self, sheets: tuple[Sheet, ...], base: PlaneConstants | None) -> None:
        self._sheets = sheets[::-1]
        self._base = _halfspace_minors(base)
        constants = _constants(self._sheets)
        self._functions = _Functions(self._sheets, constants)
        tables = _passages(constants)
        self._whole = tables[..., -1, :, :, :]
        top = _seen(self._whole, sheets[0])
        self._tables = [*np.moveaxis(tables[..., :-1, :, :, :], -4, 0), top]
        # Where the lowest interface does not know the wavenumber, neither does what is below the first passage.
        self._fed = not sheets[-1].sprung
        if self._fed:
            below = _opened(np.zeros(1), sheets[-1], self._base)
            self._tables[0] = (np.swapaxes(below, -1, -2)[..., None, :, :] @ self._tables[0])[..., 0, :]

    def one_minus_L(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,) of zero or more.

        Returns
        -------
        array (nodes,) or (sets, nodes)
            Relative error below 1e-13 for the stacks of tests/test_stacks.py, contrasts up to 1e8: 2e-14 seen.
        """
        u, functions = self._at(u)
        if self._fed and len(self._sheets) == 1:
            y = self._tables[0] @ functions[..., 0, :, :]
        else:
            below = self._under_the_top(u, functions)
            y = _applied(self._tables[-1], functions[..., -1, :, :], below)
        return np.asarray(y[..., 0, :] / y[..., 1, :])

    def compliance(self, u: FloatArray) -> Compliance:
        """Change of the surface's compliance in every direction at `u` (nodes,) of zero or more.

        The axial entry keeps its digits where it decays; the others are differences with the half-space's, right
        to the rounding of that.
        """
        axial = self.one_minus_L(u)
        u, functions = self._at(u)
        minors = _applied(self._whole, functions[..., -1, :, :], self._under_the_top(u, functions))
        of = self._sheets[-1].constants
        unit, theta = minors[..., _UNIT, :], of.g / (of.p * of.sigma)
        radial = 1.0 - theta * of.p * minors[..., _RADIAL, :] / unit
        mixed = theta * of.p**0.5 * (of.p_minus_q / of.g - minors[..., _CROSS, :] / unit)
        return Compliance(np.asarray(radial), np.asarray(mixed), axial)

    def _at(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Wavenumbers that can be computed at, and the sheets' functions there."""
        if any(sheet.slips for sheet in self._sheets):
            u = np.maximum(u, _NEAREST)
        return u, self._functions(u)

    def _under_the_top(self, u: FloatArray, functions: FloatArray) -> FloatArray:
        """Minors above the interface under the sheet on top."""
        y = self._base
        for number, sheet in enumerate(self._sheets[:-1]):
            basis, table = functions[..., number, :, :], self._tables[number]
            fed = number == 0 and self._fed
            y = table @ basis if fed else _applied(table, basis, _opened(u, sheet, y))
            if number:  # any factor will do; one or two passages cannot grow beyond all numbers
                y = y / y.max(axis=-2, keepdims=True)
        return _opened(u, self._sheets[-1], y)


def scaled(of: PlaneConstants, g: Real) -> PlaneConstants:
    """Plane constants in units of `g`."""
    return PlaneConstants(of.q, of.c * g, of.g / g, of.S * g)


def _applied(table: FloatArray, basis: FloatArray, y: FloatArray) -> FloatArray:
    """Rows of a table (..., rows, 5, functions) times its functions (..., functions, nodes) and minors."""
    *sets, rows, minors, functions = table.shape
    passage = table.reshape(*sets, rows * minors, functions) @ basis
    passage = passage.reshape(*passage.shape[:-2], rows, minors, -1)
    passage *= y[..., None, :, :]
    return np.asarray(np.add.reduce(passage, axis=-2))


class _Functions:
    """Of every sheet, powers of v where it is thin, its waves where it is thick.

    The even powers come first, then the odd ones; the waves are 1, exp(-2 sigma v), exp(-sigma v), ch sh, sh^2.
    """

    def __init__(self, sheets: tuple[Sheet, ...], constants: PlaneConstants) -> None:
        p, sigma = constants.p, constants.sigma
        self._thicknesses = _in_rows([sheet.thickness for sheet in sheets])
        self._limits = _THIN / (sigma * self._thicknesses)
        self._p, self._sigma = p, sigma
        self._equal = bool((np.abs(0.25 * sigma * sigma - p) <= EQUAL_ROOTS * p).all())

    def __call__(self, u: FloatArray) -> FloatArray:
        """At `u` (nodes,): (..., sheets, functions, nodes)."""
        v = u * self._thicknesses
        thin = (u < self._limits).astype(np.float64)
        functions = np.empty((*v.shape[:-1], _TERMS + _WAVES, v.shape[-1]))
        even, waves = functions[..., :_EVEN, :], functions[..., _TERMS:, :]
        small = v * thin
        even[..., 0, :], even[..., 1:, :] = thin, (small * small)[..., None, :]
        np.multiply.accumulate(even, axis=-2, out=even)
        np.multiply(even, small[..., None, :], out=functions[..., _EVEN:_TERMS, :])
        # What is thin is no wave: every wave but the first carries a factor that is made zero there.
        thick = np.subtract(1.0, thin, out=waves[..., 0, :])
        decay = np.exp(v * -self._sigma, out=waves[..., 2, :])
        decay *= thick
        np.multiply(decay, decay, out=waves[..., 1, :])
        if self._equal:
            np.multiply(decay, v, out=waves[..., 3, :])
            np.multiply(waves[..., 3, :], v, out=waves[..., 4, :])
        else:
            ch, sh = passage(v, self._p, self._sigma * self._sigma, self._sigma)
            sh *= thick
            np.multiply(ch, sh, out=waves[..., 3, :])
            np.multiply(sh, sh, out=waves[..., 4, :])
        return functions


def _constants(sheets: tuple[Sheet, ...]) -> PlaneConstants:
    """Of all sheets, entries (..., sheets, 1)."""
    return PlaneConstants(*(_in_rows(column) for column in zip(*(s.constants for s in sheets), strict=True)))


def _in_rows(of_sheets: Sequence[Real]) -> FloatArray:
    """One number of every sheet, (sheets, 1) or (sets, sheets, 1)."""
    if not any(isinstance(number, np.ndarray) for number in of_sheets):
        return np.array(of_sheets, dtype=np.float64)[:, None]
    return np.stack(np.broadcast_arrays(*of_sheets), axis=-2)


def _passages(constants: PlaneConstants) -> FloatArray:
    """exp(v A) of sheets with constants (..., 1): the part (..., 5, 5, functions) of each function of v."""
    A = _generators(constants)
    powers = np.empty((_TERMS, *A.shape))
    powers[0], powers[1] = np.eye(5), A
    done = 2
    while done < _TERMS:
        more = min(done, _TERMS - done)
        np.matmul(powers[1] @ powers[done - 1], powers[:more], out=powers[done : done + more])
        done += more
    table = np.empty((*A.shape, _TERMS + _WAVES))
    series = np.moveaxis(powers, 0, -1) * _FACTORIALS
    table[..., :_EVEN], table[..., _EVEN:_TERMS] = series[..., ::2], series[..., 1::2]
    p, sigma = (np.asarray(root)[..., None] for root in (constants.p, constants.sigma))
    P = (powers[4] - (sigma * sigma - 4.0 * p) * powers[2]) / (4.0 * p * sigma * sigma)
    Q = powers[0] - P
    turned = A @ P / sigma
    for k, wave in enumerate((P + turned, P - turned, 2.0 * Q, 2.0 * A @ Q, powers[2] @ Q), _TERMS):
        np.multiply(wave, 0.5, out=table[..., k])
    return table


def _seen(table: FloatArray, top: Sheet) -> FloatArray:
    """Rows that give C_22 y0 - y22 and C_22 y0, C that of a half-space of the sheet on top."""
    p, sigma = top.roots
    unit = np.asarray(p * sigma / top.constants.g)[..., None] * table[..., _UNIT, :, :]
    rows = np.stack([unit - table[..., _AXIAL, :, :], unit], axis=-3)
    # Such a half-space is the growing wave: nothing of it is left in the difference.
    rows[..., 0, :, _TERMS] = 0.0
    return rows


def _generators(constants: PlaneConstants) -> FloatArray:
    """A, (..., 5, 5), of constants (..., 1)."""
    q, c, g, S = constants
    A = np.zeros((*np.shape(g)[:-1], 5, 5))
    for row, column, entry in (
        (_UNIT, _RADIAL, g), (_CROSS, _RADIAL, -q), (_BOTH, _RADIAL, c), (_BOTH, _AXIAL, S),
        (_RADIAL, _UNIT, S), (_AXIAL, _UNIT, c), (_AXIAL, _CROSS, -2.0 * q), (_AXIAL, _BOTH, g),
    ):  # fmt: skip
        A[..., row, column] = np.asarray(entry)[..., 0]
    A[..., _CROSS, _AXIAL], A[..., _RADIAL, _CROSS] = 1.0, 2.0
    return A


def _halfspace_minors(base: PlaneConstants | None) -> FloatArray:
    """Minors (..., 5, 1) of a half-space; of a rigid one all but the first vanish."""
    if base is None:
        return np.array([[1.0], [0.0], [0.0], [0.0], [0.0]])
    g, axial = base.g, base.p * base.sigma / base.g
    # det C = (p sigma^2 - (p - q)^2)/g^2 without the difference.
    minors = np.array([g / g, base.p_minus_q / g, (base.p * base.S + base.c) / g, base.sigma / g, axial])
    return minors.reshape(5, 1) if minors.ndim == 1 else np.moveaxis(minors, 0, -2)


def _opened(u: FloatArray, sheet: Sheet, y: FloatArray) -> FloatArray:
    """Minors (..., 5, nodes or 1) above the interface under a sheet, of those below."""
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
