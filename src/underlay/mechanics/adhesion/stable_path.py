"""The stable part of a curve y(a) whose parameter is the contact radius, turned round into a(y).

Pulled off slowly, a contact follows y(a) inwards from its widest until y has a minimum: there it has nowhere to
go but to the next narrower contact at the same y, or off. So the stable contact at y is the widest of those
with y(a) = y: the pieces of the curve at which y is below all that lies outside of them.

At the minimum y - y_end grows as (a - a_end)^2: in x = arcsinh(sqrt((y - y_end)/|y_end|)) the radius is smooth
and cubic splines give it back. What y is (depth, force, or the travel of a spring's other end) is the caller's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from underlay._arrays import FloatArray
from underlay.errors import RangeError

__all__ = ["Curve", "Jump", "StablePath", "stable_path"]

#: Radii (m), (n,), to (y, dy/da).
Curve: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
#: Radii (m), (n,), to further columns that are to be interpolated too, (n, k).
Columns: TypeAlias = Callable[[FloatArray], FloatArray]

# Knots per unit of ln a, at a relative error of 1e-6: cubic splines of functions whose scale is one.
_DENSITY, _DENSITY_RTOL = 60.0, 1e-6
_FEWEST = 24
# Points of Chebyshev between two points of the grid, at which the slope there is asked.
_NODES = 10


class Jump(NamedTuple):
    """Where the contact jumps from one radius to a smaller one, or off (`inner` zero)."""

    at: float
    outer: float
    inner: float


@dataclass(frozen=True)
class _Piece:
    """One piece: y from `end`, a minimum at the radius `radius`, up to `top`."""

    end: float
    top: float
    radius: float
    scale: float
    spline: CubicSpline

    def place(self, y: FloatArray) -> FloatArray:
        return np.arcsinh(np.sqrt((y - self.end) / self.scale))

    def rate(self, x: FloatArray) -> FloatArray:
        """dy/dx."""
        return np.asarray(self.scale * np.sinh(2.0 * x))


@dataclass(frozen=True)
class StablePath:
    """Radius, and what else was asked to be interpolated, against y in [`end`, `top`]."""

    pieces: tuple[_Piece, ...]
    jumps: tuple[Jump, ...]

    @property
    def end(self) -> float:
        """Smallest y at which there is contact."""
        return self.pieces[-1].end

    @property
    def end_radius(self) -> float:
        """Contact radius (m) there."""
        return self.pieces[-1].radius

    @property
    def top(self) -> float:
        """Largest y."""
        return self.pieces[0].top

    def radius(self, y: FloatArray) -> FloatArray:
        """Contact radius (m), (n,), at y (n,) in [`end`, `top`]."""
        return np.asarray(np.exp(self.values(y)[0][:, 0]))

    def values(self, y: FloatArray, *, slopes: bool = False) -> tuple[FloatArray, FloatArray]:
        """ln a and the further columns, (n, 1 + k), at y (n,), and their derivatives in y (zero unless asked)."""
        found = np.empty((y.size, self.pieces[0].spline.c.shape[-1]))
        slope = np.zeros_like(found)
        for number, piece in enumerate(self.pieces):
            here = slice(None) if len(self.pieces) == 1 else self._belongs(y, number)
            x = piece.place(y[here])
            found[here] = piece.spline(x)
            if slopes:
                slope[here] = piece.spline(x, 1) / piece.rate(x)[:, None]
        return found, slope

    def _belongs(self, y: FloatArray, number: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        piece, last = self.pieces[number], number == len(self.pieces) - 1
        return (y <= piece.top) & ((y > piece.end) | last)


def stable_path(
    curve: Curve, grid: FloatArray, columns: Columns | None = None, rtol: float = 1e-6
) -> StablePath:
    """Find the stable pieces of y(a) on `grid` and interpolate them.

    Parameters
    ----------
    curve : callable
        Radii (m), (n,), to (y, dy/da).
    grid : FloatArray
        Radii (m), increasing, fine enough to show every minimum of y; from the last inwards y must decrease.
    columns : callable, optional
        Radii (m), (n,), to further columns (n, k).
    rtol : float
        Relative error of the interpolation.

    Raises
    ------
    RangeError
        If y has no minimum on `grid`.
    """
    y = curve(grid)[0]
    outside = np.append(np.minimum.accumulate(y[::-1])[::-1][1:], np.inf)
    stable = y < outside
    starts = np.flatnonzero(stable & ~np.concatenate(([False], stable[:-1])))[::-1]
    pieces, jumps = [], []
    upper, last = float(grid[-1]), grid.size - 1
    for start in starts:
        lower = _minimum(curve, grid, int(start))
        piece = _piece(curve, lower, upper, columns, rtol)
        pieces.append(piece)
        last = int(start) - 1
        while last >= 0 and not stable[last]:
            last -= 1
        # The next piece begins where y has come down to the minimum again.
        upper = _crossing(curve, piece.end, grid[last], grid[last + 1]) if last >= 0 else 0.0
        jumps.append(Jump(piece.end, lower, upper))
    return StablePath(tuple(pieces), tuple(jumps))


def _piece(curve: Curve, lower: float, upper: float, columns: Columns | None, rtol: float) -> _Piece:
    span = float(np.log(upper / lower))
    count = _FEWEST + int(span * _DENSITY * (_DENSITY_RTOL / rtol) ** 0.25)
    radius = lower * np.exp(np.linspace(0.0, span, count))
    radius[-1] = upper
    y = curve(radius)[0]
    end = float(y[0])
    scale = abs(end) or float(y[-1] - end)
    x = np.arcsinh(np.sqrt((y - end) / scale))
    further = () if columns is None else (columns(radius),)
    return _Piece(
        end, float(y[-1]), lower, scale, CubicSpline(x, np.column_stack((np.log(radius), *further)))
    )


def _minimum(curve: Curve, grid: FloatArray, start: int) -> float:
    """Radius of the minimum of y next to grid point `start`."""
    if start == 0:
        raise RangeError(
            f"the contact holds down to the smallest radius that is solved for, {grid[0]:.4g} m: it has no "
            "pull-off of its own, as with DMT; an attraction that reaches so far calls for DMT(work)"
        )
    # On a stretch this short the slope is a polynomial to rounding: one call in place of one for each step.
    low, high = np.log(grid[start - 1]), np.log(grid[min(start + 1, grid.size - 1)])
    nodes = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
    slope = np.polynomial.Polynomial.fit(
        nodes, curve(np.exp(low + 0.5 * (high - low) * (nodes + 1.0)))[1], _NODES - 1
    )
    place = brentq(slope, -1.0, 1.0, xtol=1e-15, rtol=1e-14)
    return float(np.exp(low + 0.5 * (high - low) * (place + 1.0)))


def _crossing(curve: Curve, level: float, low: float, high: float) -> float:
    """Radius between `low` and `high` at which y is `level`."""

    def excess(radius: float) -> float:
        return float(curve(np.array([radius]))[0][0]) - level

    return float(brentq(excess, low, high, xtol=1e-15 * high, rtol=1e-14))
