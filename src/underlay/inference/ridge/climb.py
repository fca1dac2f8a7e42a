"""Newton's method in a plane: the top of a density in it, and its width there.

Only values are known, many at a time. Derivatives are differences over about one standard deviation in a basis
that is whitened again after every step; it begins small and grows, so that no place is asked for that lies far
beyond the posterior, where a density costs most.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["Density", "Slice", "climb", "derivatives", "small_basis"]

Density = Callable[[FloatArray], FloatArray]

_MAX_STEPS = 40
# Steps in a row that gain nothing: a bent density never has the widths that were measured before.
_PATIENCE = 2
# First columns, in standard deviations of the prior, and the longest: a little more than the prior's own.
_FIRST, _LONGEST = 1e-3, 1.2
_GROWTH = 4.0
# Precision of a column by which it is taken to have its length.
_SETTLED = 0.5
# Bend of a column that leaves the support: it becomes half as long.
_LOST = 4.0
_SHARES = 2.0 ** -np.arange(6.0)


class Slice(NamedTuple):
    """The top of a density in a plane.

    Parameters
    ----------
    place : FloatArray
        (p,).
    basis : FloatArray
        (p, m): ``place + basis @ y`` with normal y is the density in the plane, near its top.
    log_density : float
        At the top.
    moved : float
        How far it was from where the search began, in standard deviations.
    """

    place: FloatArray
    basis: FloatArray
    log_density: float
    moved: float

    @property
    def log_mass(self) -> float:
        """Logarithm of the density's integral over the plane, were it normal; but for (2 pi)^(m/2)."""
        if not self.basis.shape[1]:
            return self.log_density
        _, log_volume = np.linalg.slogdet(self.basis.T @ self.basis)
        return self.log_density + 0.5 * float(log_volume)


def small_basis(parameters: int) -> FloatArray:
    """Basis (p, p) to begin with where nothing is known of the widths."""
    return _FIRST * np.eye(parameters)


def climb(
    density: Density,
    start: FloatArray,
    basis: FloatArray,
    tolerance: float = 1e-3,
    max_steps: int = _MAX_STEPS,
) -> Slice | None:
    """Climb from `start` (p,) to the nearest top in the plane that the columns of `basis` (p, m) span.

    Parameters
    ----------
    density : callable
        Log-density (n,) at places (n, p); -inf where there is none.
    start, basis
        Where to begin, and about one standard deviation along each column.
    tolerance : float, default 1e-3
        What may be left to gain, in units of the log-density.
    max_steps : int, default 40
        Most steps.

    Returns
    -------
    Slice or None
        None where the density vanishes at the start.
    """
    place, top, idle = start, -np.inf, 0
    for _ in range(max_steps):
        top, gradient, hessian = derivatives(density, place, basis, lost=_LOST)
        if not np.isfinite(top):
            return None
        if not basis.shape[1]:
            break
        curvature, directions = np.linalg.eigh(-hessian)
        turned = basis @ directions
        longest = np.linalg.norm(turned, axis=0) / _LONGEST
        # A direction the density does not bend in, or bends upwards in, grows until it does or to the prior.
        precision = np.maximum(curvature, np.maximum(longest**2, _GROWTH**-2))
        slope = directions.T @ gradient
        to_gain = 0.5 * float(np.sum(slope**2 / precision))
        candidates = place + _SHARES[:, None] * (turned @ (slope / precision))
        basis = turned / np.sqrt(precision)
        values = density(candidates)
        best = int(np.argmax(values))
        # A basis that still grows has not looked as far as there may be something to gain.
        grows = bool((precision <= 1.01 * _GROWTH**-2).any())
        idle = 0 if grows or values[best] - top > tolerance else idle + 1
        if values[best] > top:
            place, top = candidates[best], float(values[best])
        settled = bool((np.abs(np.log(precision)) < _SETTLED).all())
        if idle >= _PATIENCE or (settled and to_gain < tolerance):
            break
    steps = np.linalg.lstsq(basis, place - start, rcond=None)[0] if basis.shape[1] else np.zeros(1)
    return Slice(place, basis, top, float(np.linalg.norm(steps)))


def derivatives(
    density: Density, place: FloatArray, basis: FloatArray, *, lost: float
) -> tuple[float, FloatArray, FloatArray]:
    """Log-density at a place, its gradient (m,) and Hessian (m, m) in units of the basis' columns.

    A column that leaves the density's support on one side tells nothing of the slope; its bend is taken as `lost`.
    A pair that leaves it tells nothing of the correlation.
    """
    columns = basis.shape[1]
    pairs = list(combinations(range(columns), 2))
    unit = np.eye(columns)
    offsets = np.concatenate([unit, [unit[i] + unit[j] for i, j in pairs]]) if pairs else unit
    steps = offsets @ basis.T
    values = density(np.concatenate([place[None], place + steps, place - steps]))
    top = float(values[0])
    if not np.isfinite(top):
        return top, np.zeros(columns), np.zeros((columns, columns))
    up, down = values[1 : 1 + len(offsets)] - top, values[1 + len(offsets) :] - top
    inside = np.isfinite(up) & np.isfinite(down)
    even = np.where(inside, np.add(up, down, where=inside, out=np.zeros_like(up)), -lost)
    odd = np.subtract(up, down, where=inside, out=np.zeros_like(up))
    hessian = np.diag(even[:columns])
    for pair, (i, j) in enumerate(pairs, start=columns):
        if inside[pair]:
            hessian[i, j] = hessian[j, i] = 0.5 * (even[pair] - even[i] - even[j])
    return top, 0.5 * odd[:columns], hessian
