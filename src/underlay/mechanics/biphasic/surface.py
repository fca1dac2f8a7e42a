"""Surface response of a biphasic layer in Laplace and Hankel space, c(xi, s), and quadrature over xi.

A wave of normal pressure sigma and one of water pressure p on the surface give a settlement W and a flux Pi':

    (W, Pi') = c (sigma, p),   c = [[c11, c12], [c21, c22]],   shear stress zero,

at the base u = 0 and no flux (`SurfaceKernel`). Reciprocity: c12 = -(k_z/s) c21. Three decaying solutions and their
mirror images from the base: growing exponentials do not occur.

Units: lengths in any one unit l, moduli in A44, s in k_z A44/l^2, fluxes of k_z = 1. Measured against a
transfer matrix in 60 digits: 1e-13 typical; 2e-7 for a transversely isotropic skeleton that is exactly
isotropic, at s/(k_z A44 xi^2) below 1e-6 (an isotropic one goes by its closed form).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.biphasic.decaying import decaying
from underlay.mechanics.biphasic.material import ComplexArray, Skeleton

_Number = TypeVar("_Number", np.float64, np.complex128)
# Orders above the last at which Miller's recurrence starts: at x = n + 1 the start is below 1e-17 of j_0.
_ABOVE = 24
# Below this argument the recurrences divide by next to nothing; j_n is its first two terms to 1e-17.
_SMALL = 1e-4
# From this wavenumber on, over 1/h and over the unit's inverse, what comes back from the base is weak, and the
# kernel times a power of xi turns slowly: panels of this width in ln xi, of so many Chebyshev points, leave 8e-7
# in the fall of any response (1e-3 of the kernel where s is nearly negative, which no response hears), in half the
# time of all nodes.
_SMOOTH, _PANEL, _PLACES = 20.0, 1.0, 12
# Nodes solved at once: their matrices stay in the cache.
_AT_ONCE = 4096
# exp(-37) is the rounding of 1: a wave that comes back from the base with less is not felt.
_FORGOTTEN = 37.0
_MIRRORED = np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0])[:, None]
_BASE = [0, 1, 5]
_SHOWN = [1, 5]


def spherical_bessel(count: int, x: FloatArray) -> FloatArray:
    """Spherical Bessel functions j_0(x) ... j_(count-1)(x), (count, n), at arguments `x`, (n,), zero or more.

    `scipy.special.spherical_jn` goes order by order, argument by argument; the moving contact asks for all orders
    at new arguments three times a step, and recurrences over arrays are ten times as fast. Upwards from sin and
    cos where the argument is above the order, downwards (Miller) below; both stable there, 1e-13 of the largest
    value (a test measures).
    """
    found = np.empty((count, x.size))
    large = x > count
    found[:, large] = _upward(count, x[large])
    small = x < _SMALL
    between = ~(large | small)
    found[:, between] = _downward(count, x[between])
    found[:, small] = _series(count, x[small])
    return found


def _upward(count: int, x: FloatArray) -> FloatArray:
    values = np.empty((count, x.size))
    values[0] = np.sin(x) / x
    if count > 1:
        values[1] = (values[0] - np.cos(x)) / x
    for n in range(1, count - 1):
        values[n + 1] = (2 * n + 1) / x * values[n] - values[n - 1]
    return values


def _downward(count: int, x: FloatArray) -> FloatArray:
    """Spherical Bessel functions j_0 ... j_(count-1), (count, n), by downward recurrence (Miller)."""
    top = count + _ABOVE
    values = np.empty((count, x.size))
    # Ratios r_n = j_(n+1)/j_n stay in range where the values themselves would not.
    ratio = np.zeros_like(x)
    ratios = np.empty((top, x.size))
    for n in range(top - 1, -1, -1):
        ratio = 1.0 / ((2 * n + 3) / x - ratio)
        ratios[n] = ratio
    values[0] = np.sin(x) / x
    # j_0 may vanish where j_1 does not: the first two are known.
    if count > 1:
        values[1] = _first(x, values[0])
    for n in range(2, count):
        values[n] = ratios[n - 1] * values[n - 1]
    return values


def _first(x: FloatArray, zeroth: FloatArray) -> FloatArray:
    """Spherical Bessel function j_1(x), (n,), from j_0 (`zeroth`); below 0.5 by its series: no cancellation."""
    square = x * x
    series = (
        x
        / 3.0
        * (1.0 - square / 10.0 * (1.0 - square / 28.0 * (1.0 - square / 54.0 * (1.0 - square / 88.0))))
    )
    return np.where(x < 0.5, series, (zeroth - np.cos(x)) / x)


def _series(count: int, x: FloatArray) -> FloatArray:
    values = np.empty((count, x.size))
    leading = np.ones_like(x)
    for n in range(count):
        values[n] = leading * (1.0 - 0.5 * x * x / (2 * n + 3))
        leading = leading * x / (2 * n + 3)
    return values


@dataclass(frozen=True)
class WavenumberRule:
    """Gauss-Legendre quadrature over wavenumbers (0, end): panels grow geometrically up to 1, then are even.

    Parameters
    ----------
    end : float
        Largest wavenumber, in the inverse of the unit of length.
    width : float, default 2.2
        Width of a panel beyond 1: the integrands oscillate as cos(2 xi).
    points : int, default 6
        Number of Gauss points of a panel.
    first : float, default 0.02
        End of the first panel.
    """

    end: float
    width: float = 2.2
    points: int = 6
    first: float = 0.02

    @cached_property
    def _panels(self) -> FloatArray:
        inner = np.geomspace(self.first, 1.0, 5)
        count = max(int(np.ceil((self.end - 1.0) / self.width)), 1)
        return np.concatenate(([0.0], inner, 1.0 + self.width * np.arange(1, count + 1)))

    @cached_property
    def nodes(self) -> FloatArray:
        """Wavenumbers, (n,), increasing."""
        x, _ = np.polynomial.legendre.leggauss(self.points)
        low, high = self._panels[:-1, None], self._panels[1:, None]
        return np.asarray((0.5 * (low + high) + 0.5 * (high - low) * x).ravel())

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of the nodes, (n,)."""
        _, w = np.polynomial.legendre.leggauss(self.points)
        return np.asarray((0.5 * np.diff(self._panels)[:, None] * w).ravel())

    def up_to(self, end: float) -> int:
        """Number of nodes below the wavenumber `end`."""
        return int(np.searchsorted(self.nodes, end))


@dataclass(frozen=True)
class BesselRule:
    """Basis functions of the pressures on a contact of radius 1, at the wavenumbers of a quadrature rule.

    They are spherical Bessel functions: j_2n(xi) of the total pressure, j_2n+1(xi) of the water pressure.
    """

    rule: WavenumberRule
    terms: int

    @cached_property
    def _all(self) -> FloatArray:
        return spherical_bessel(2 * self.terms, self.rule.nodes)

    @cached_property
    def even(self) -> FloatArray:
        """Spherical Bessel functions j_2n(xi) of the total pressure, (terms, nodes)."""
        return np.ascontiguousarray(self._all[0::2])

    @cached_property
    def odd(self) -> FloatArray:
        """Spherical Bessel functions j_2n+1(xi) of the water pressure, (terms, nodes)."""
        return np.ascontiguousarray(self._all[1::2])


class Sampled:
    """Fewer wavenumbers at which to compute a kernel, and interpolation from them to all nodes of a rule.

    Where the base matters they are the nodes themselves; at larger wavenumbers the kernel is smooth in ln xi, and
    panels of 12 Chebyshev points suffice.

    Parameters
    ----------
    nodes : FloatArray
        Wavenumbers of the rule, (n,), increasing.
    thickness : float
        Thickness h of the layer, in the unit of length; inf for a half-space.
    """

    def __init__(self, nodes: FloatArray, thickness: float) -> None:
        self._nodes = nodes
        self._first = int(np.searchsorted(nodes, max(1.0, _SMOOTH / thickness)))
        beyond = np.log(nodes[self._first :])
        angles = np.pi * (np.arange(_PLACES) + 0.5) / _PLACES
        inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(np.cos(angles), _PLACES - 1))
        places, self._panels = [nodes[: self._first]], []
        low = float(beyond[0]) if beyond.size else 0.0
        panel = ((beyond - low) / _PANEL).astype(np.intp)
        for number in range(int(panel[-1]) + 1 if beyond.size else 0):
            x = 2.0 * (beyond[panel == number] - low) / _PANEL - 2 * number - 1
            self._panels.append(np.polynomial.chebyshev.chebvander(x, _PLACES - 1) @ inverse)
            places.append(np.exp(low + _PANEL * (number + 0.5 + 0.5 * np.cos(angles))))
        self._places = np.concatenate(places)
        self._ends = self._first + np.cumsum([0, *(len(rows) for rows in self._panels)])

    def places(self, count: int) -> FloatArray:
        """Wavenumbers at which to compute the kernel for the first `count` nodes."""
        whole = int(np.searchsorted(self._ends, count))
        return self._places[: min(count, self._first) + whole * _PLACES]

    def read(self, values: NDArray[_Number], count: int) -> NDArray[_Number]:
        """Interpolate kernels at the wavenumbers `places`, (..., places, 2, 2), to nodes, (..., count, 2, 2)."""
        found = np.empty((*values.shape[:-3], count, 2, 2), dtype=values.dtype)
        found[..., : self._first, :, :] = values[..., : min(count, self._first), :, :]
        for number, rows in enumerate(self._panels):
            first = int(self._ends[number])
            last = min(int(self._ends[number + 1]), count)
            if first >= last:
                break
            start = self._first + number * _PLACES
            here = slice(start, start + _PLACES)
            own = _even(self._places[here], values[..., here, :, :])
            own = rows[: last - first] @ own.reshape(*own.shape[:-2], 4)
            own = own.reshape(*own.shape[:-1], 2, 2)
            found[..., first:last, :, :] = _even(1.0 / self._nodes[first:last], own)
        return found


def _even(xi: FloatArray, kernel: NDArray[_Number]) -> NDArray[_Number]:
    """Replace c11 and c22 of kernels (..., n, 2, 2) by the smoother xi c11 and c22/xi; with 1/xi it undoes that."""
    scale = np.ones((xi.size, 2, 2))
    scale[:, 0, 0], scale[:, 1, 1] = xi, 1.0 / xi
    return np.asarray(kernel * scale, dtype=kernel.dtype)


@dataclass(frozen=True)
class SurfaceKernel:
    """Surface kernel c(xi, s) of a layer on a bonded, sealed, rigid base, or of a half-space.

    xi is the wavenumber, s the Laplace variable; c gives settlement and flux of normal and water pressure (module).

    Parameters
    ----------
    skeleton : Skeleton
        Drained skeleton of the layer.
    thickness : float
        Thickness h, in the unit of length; inf for a half-space.
    """

    skeleton: Skeleton
    thickness: float

    def matrix(self, xi: FloatArray, s: ComplexArray, *, sealed: bool = False) -> ComplexArray:
        """Kernel c, (n, 2, 2), at positive wavenumbers `xi`, (n,), and Laplace variables `s`, (n,).

        If `sealed`, the flux through the surface is prescribed instead of the water pressure, so that c11 is the
        settlement of a surface that lets no water out.
        """
        found = np.empty((xi.size, 2, 2), dtype=np.complex128)
        for start in range(0, xi.size, _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            found[part] = self._solved(xi[part], s[part], sealed=sealed)
        return found

    def _solved(self, xi: FloatArray, s: ComplexArray, *, sealed: bool) -> ComplexArray:
        solutions = decaying(self.skeleton, s / xi**2)
        given = [2, 3, 5 if sealed else 4]
        everywhere = np.ones(xi.size, dtype=bool)
        surface = solutions.at(np.zeros_like(xi), everywhere)
        scale = np.abs(surface).max(axis=1, keepdims=True)
        surface /= scale
        felt = 2.0 * self.thickness * xi * solutions.slowest < _FORGOTTEN
        if felt.any():
            here, there = (surface[felt], solutions.at(xi[felt] * self.thickness, felt) / scale[felt])
            # What comes back: the mirror images that make the base stand still.
            back = np.linalg.solve((_MIRRORED * here)[:, _BASE], -there[:, _BASE])
            surface[felt] += (_MIRRORED * there) @ back
        loads = np.zeros((xi.size, 3, 2), dtype=np.complex128)
        loads[:, 1, 0], loads[:, 2, 1] = -1.0, 1.0
        found = np.asarray(surface[:, _SHOWN] @ np.linalg.solve(surface[:, given], loads))
        found[:, 0] /= xi[:, None]
        found[:, 1] *= xi[:, None]
        if not sealed:
            # Reciprocity: the flux of a pressed surface is a small difference at small s, the settlement at large.
            quick = np.abs(s) > xi * xi
            found[~quick, 1, 0] = -(s * found[:, 0, 1])[~quick]
            found[quick, 0, 1] = -found[quick, 1, 0] / s[quick]
        return found
