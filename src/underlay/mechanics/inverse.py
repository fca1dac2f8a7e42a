"""Inverting increasing relations, many at once, and the depth at given forces of a contact law.

Newton's method in logarithms, kept inside a shrinking bracket. `invert_increasing` begins at given guesses;
`depth_at_loads` has nothing to begin at but the law's range.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError

# Newton takes 4 to 8 steps. At a turning point, where the slope vanishes, each step halves the error and
# rounding of y leaves 1e-8 of x, which 30 steps reach: there x has no more digits to give.
_MAX_STEPS = 80
#: Depths (m), (n,), to forces (N) or stiffnesses (N/m), (n,).
Primitive: TypeAlias = Callable[[FloatArray], FloatArray]


def invert_increasing(
    relation: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    target: FloatArray,
    start: FloatArray,
    end: float,
    least: float = 0.0,
) -> FloatArray:
    """Solve y(x) = `target` for x in (`least`, `end`], elementwise, y increasing there from y(`least`) = 0.

    Newton's method on ln y(ln x), where power laws are straight, kept inside a shrinking bracket.

    Parameters
    ----------
    relation : callable
        Positive x (n,) to (y, dy/dx), each (n,).
    target : ndarray, shape (n,)
        Positive values of y, at most y(`end`).
    start : ndarray, shape (n,)
        Positive first guesses.
    end : float
        Largest x, infinite where the relation has no end.
    least : float, default 0
        Where a smallest x is known, steps may be of any length from the first on.

    Returns
    -------
    ndarray, shape (n,)
    """
    goal = np.log(target)
    x = np.log(np.minimum(start, end))
    low = np.full_like(x, np.log(least) if least else -np.inf)
    high = np.full_like(x, np.log(end))
    # No step beyond a factor e while the bracket may still be open.
    longest = np.inf if least else 1.0
    for _ in range(_MAX_STEPS):
        radius = np.exp(x)
        value, slope = relation(radius)
        error = np.log(value) - goal
        high = np.where(error > 0.0, np.minimum(high, x), high)
        low = np.where(error < 0.0, np.maximum(low, x), low)
        rate = slope * radius / value
        # A flat spot (rate near zero, at a turning point) must not throw the step out of all bounds.
        step = error / np.maximum(rate, 1e-3)
        proposal = x - np.sign(step) * np.minimum(np.abs(step), longest)
        middle = 0.5 * (low + high)
        outside = (proposal >= high) | (proposal <= low)
        if least:
            # The first guess may be the end and the answer. An asymptotic law may end with an infinite slope, where
            # Newton's step is zero: halve the bracket then too.
            still = (np.abs(step) < 1e-12) & (np.abs(error) > 1e-9)
            outside = still | (proposal > high) | (proposal < low)
        proposal = np.where(outside & np.isfinite(middle), middle, np.minimum(proposal, high))
        if (np.abs(proposal - x) <= 2.0 * np.finfo(float).eps * (1.0 + np.abs(x))).all():
            return np.asarray(np.exp(proposal))
        x = proposal
    return np.asarray(np.exp(x))


def depth_at_loads(
    force: Primitive,
    stiffness: Primitive,
    load: FloatArray,
    least: float,
    domain: tuple[float, float],
    beyond: str,
) -> FloatArray:
    """Depths (m), (n,), at which a law that increases over its domain (m) has the forces `load` (N).

    `load` is above `least`, the force at the beginning of the domain; `beyond` says why the law ends.

    Raises
    ------
    RangeError
        If a load is beyond the force at the end of the domain.
    """
    start = domain[0]
    end = _ceiling(force, float(load.max()), least, domain, beyond)

    def relation(w: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force and stiffness, depths and forces counted from the beginning of the domain, where most have none."""
        return force(start + w) - least, stiffness(start + w)

    ends = np.full_like(load, end)
    return np.asarray(
        start + invert_increasing(relation, load - least, ends, end, float(np.finfo(float).tiny))
    )


def _ceiling(force: Primitive, top: float, least: float, domain: tuple[float, float], beyond: str) -> float:
    """A depth (m), counted from the beginning of the domain, whose force is at least `top` (N)."""
    start, end = domain
    if np.isfinite(end):
        largest = float(force(np.array([end]))[0])
        if top - least > (largest - least) * (1.0 + 1e-12):
            raise RangeError(
                f"force {top:.6g} N is beyond {largest:.6g} N, the force at the largest depth that works here, "
                f"{end:.6g} m: {beyond}",
                max_depth=end,
            )
        return end - start
    ceiling = 1.0
    while float(force(np.array([start + ceiling]))[0]) < top:
        ceiling *= 16.0
    return ceiling
