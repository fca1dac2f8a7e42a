"""Compliance of a stack's surface, 1 - L(u) first: the five minors of its solutions, carried up from the base.

With xi the wavenumber, v = xi t in a layer of thickness t, and below every interface (displacement) = -C
(stress over xi), C = [[C11, C12], [C12, C22]] (radial, axial) symmetric, the compliance obeys a Riccati equation
in depth. In the minors y = f (1, -C12, det C, C11, C22), f any factor, named (y0, y12, yD, y11, y22), it is linear
(Dunkin 1965, Bull. Seismol. Soc. Am. 55, 335), y' = A y upwards, in the constants q, c, g, S of the layer
(`PlaneConstants`):

    y0' = g y11,           y12' = y22 - q y11,     yD' = c y11 + S y22,
    y11' = S y0 + 2 y12,   y22' = c y0 - 2 q y12 + g yD.

det C is carried, not formed: what is lost by subtraction in 2 x 2 matrices, where a soft layer lies between stiff
ones, never arises. `waves` is the passage through a layer, y <- exp(v A) y.

At an interface with springs C <- C + xi diag(1/k_shear, 1/k_normal), and where it slips C11 -> inf: both are
linear in y. On top 1 - L = (C_1,22 y0 - y22)/(C_1,22 y0), C_1 the compliance of a half-space of the layer on top:
that is the growing wave, and leaves nothing in the numerator, so that it is taken out of y under the layer first
and its function, absent, does not spoil the digits where the numerator decays. The same material all the way down
gives zero to the last bit. With friction C11 and C12 are wanted too: they are the other minors over y0.

It is the L(u) of (1.6) and of the paper's appendix for one layer bonded to its base, without the appendix's
division by gamma_1 - gamma_2: real, equal and complex roots and nu = 0.5 are one formula. Erratum of the appendix:
a_21 carries a minus, -(2 gamma_1/Z){...}; as printed, the terms in x_1 y_1 cancel and L is wrong.

Constants and thicknesses may be (sets, 1): all sets go up together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.body import PlaneConstants, Real
from underlay.mechanics.kernel.kernel import Compliance
from underlay.mechanics.kernel.waves import WAVES, Waves, products

__all__ = ["Recursion", "Sheet", "scaled"]

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

    @cached_property
    def roots(self) -> tuple[Real, Real]:
        """Product p and sum sigma of the decay roots.

        Displacements at wavenumber xi decay with depth z as exp(-root xi z).
        """
        return self.constants.p, self.constants.sigma


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
        self._sheets, under = sheets[::-1], _halfspace_minors(base)
        columns = [(*sheet.roots, sheet.thickness) for sheet in self._sheets]
        p, sigma, thick = np.broadcast_arrays(*(_in_rows(column) for column in zip(*columns, strict=True)))
        self._lead, self._thicknesses = p.shape[:-1], thick
        self._waves = Waves(p.reshape(-1, 1), sigma.reshape(-1, 1))
        growing = _halfspace_minors(sheets[0].constants)
        self._growing = _in_rows(growing)
        # Where the lowest interface does not know the wavenumber, neither does what is below the first passage.
        self._fed = not sheets[-1].sprung
        self._base = _in_rows(under)
        if self._fed:
            under = _slid(under) if sheets[-1].slips else under
            self._lowest = _parts(sheets[-1].constants, under)
        self._alone = self._fed and len(sheets) == 1
        if self._alone:
            change = [own - under[_UNIT] * grown for own, grown in zip(under, growing, strict=True)]
            parts = _parts(sheets[0].constants, change)
            self._seen = (self._growing[..., 1:, :] * parts[..., :1, :] - parts[..., 1:, :])[..., :-1]
            self._unit = self._lowest[..., :1, :]
        else:
            self._tables = _passages(self._sheets)
            table = self._tables[-1]
            unit = table[..., :1, :, :]
            self._seen = (self._growing[..., 1:, :, None] * unit - table[..., 1:, :, :])[..., :-1]
            self._unit = unit

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
        E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them, see
        `waves`.
        """
        top, part = functions[..., -1, :, :], functions[..., -1, :-1, :]
        if self._alone:
            return np.asarray(self._seen[..., rows, :] @ part / (self._unit @ top))
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
            basis = functions[..., number, :, :]
            if number == 0 and self._fed:
                y = self._lowest @ basis
            else:
                y = _applied(self._tables[number], basis, _opened(u, sheet, y))
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
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them, see
    `waves`.
    """
    *sets, rows, minors, functions = table.shape
    passage = table.reshape(*sets, rows * minors, functions) @ basis
    passage = passage.reshape(*passage.shape[:-2], rows, minors, -1)
    passage *= y[..., None, :, :]
    return np.asarray(np.add.reduce(passage, axis=-2))


def _parts(of: PlaneConstants, y: Sequence[Real]) -> FloatArray:
    """Minors above a sheet, by function E_k, from minors y below that do not depend on u: (..., 5, functions).

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them, see
    `waves`.
    """
    parts = products(of, y)
    if not isinstance(of.g, np.ndarray):
        return np.array(parts).T
    return _table(parts, (len(of.g), 5, 1))[..., 0, :]


def _passages(sheets: Sequence[Sheet]) -> FloatArray:
    """Propagators of the sheets by function E_k: minors above from minors below, (sheets, ..., 5, 5, functions).

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them, see
    `waves`.
    """
    of = PlaneConstants(*(_in_rows(column) for column in zip(*(s.constants for s in sheets), strict=True)))
    table = _table(products(of, list(np.eye(5))), (*_in_rows([s.roots[0] for s in sheets]).shape[:-1], 5, 5))
    return np.moveaxis(table, -4, 0)


def _table(parts: Sequence[Sequence[Real]], shape: tuple[int, ...]) -> FloatArray:
    """Five minors for each function E_k, each (..., columns), as one array (..., 5, columns, functions).

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    E_0 to E_4 are the functions of wavenumber times thickness by which a layer transmits them, see
    `waves`.
    """
    table = np.empty((*shape, WAVES))
    for k, part in enumerate(parts):
        for row, entry in enumerate(part):
            table[..., row, :, k] = entry
    return table


def _in_rows(of_sheets: Sequence[Real]) -> FloatArray:
    """Stack one number per sheet as rows: (rows, 1), or (sets, rows, 1) where numbers are arrays (sets, 1)."""
    if not any(isinstance(number, np.ndarray) for number in of_sheets):
        return np.array(of_sheets, dtype=np.float64)[:, None]
    return np.stack(np.broadcast_arrays(*of_sheets), axis=-2)


def _halfspace_minors(base: PlaneConstants | None) -> tuple[Real, ...]:
    """Minors of the surface of a half-space, floats or (sets, 1): the first is 1, the others 0 if rigid.

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    """
    if base is None:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    g, p, gap, sigma = base.g, base.p, base.p_minus_q, base.sigma
    # det C = (p sigma^2 - (p - q)^2)/g^2 without the difference.
    return g / g, gap / g, (p * base.S + base.c) / g, sigma / g, p * sigma / g


def _slid(minors: Sequence[Real]) -> tuple[Real, ...]:
    """Minors above an interface that slides without friction, from those below.

    Minors: 1, -C12, det C, C11, C22 times a common factor, C the surface compliance (radial, axial).
    """
    return 0.0, 0.0, minors[_AXIAL], minors[_UNIT], 0.0


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
