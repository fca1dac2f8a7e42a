"""Inverting increasing relations, many at once, and the depth at given forces of a contact law.

Newton's method in logarithms, kept inside a shrinking bracket. `invert_increasing` begins at given guesses;
`depth_at_loads` must get along with the ends of asymptotic laws, at which the stiffness is zero or infinite,
and has nothing to begin at but the law's range.
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
# Quadratic after the first steps on a smooth law.
_LAW_INVERSE_MAX_STEPS = 60


def invert_increasing(
    relation: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    target: FloatArray,
    start: FloatArray,
    end: float,
) -> FloatArray:
    """Solve y(x) = `target` for x in (0, `end`], elementwise, y increasing there from y(0) = 0.

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

    Returns
    -------
    ndarray, shape (n,)
    """
    goal = np.log(target)
    x = np.log(np.minimum(start, end))
    low = np.full_like(x, -np.inf)
    high = np.full_like(x, np.log(end))
    for _ in range(_MAX_STEPS):
        radius = np.exp(x)
        value, slope = relation(radius)
        error = np.log(value) - goal
        high = np.where(error > 0.0, np.minimum(high, x), high)
        low = np.where(error < 0.0, np.maximum(low, x), low)
        rate = slope * radius / value
        # A flat spot (rate near zero, at a turning point) must not throw the step out of all bounds.
        step = error / np.maximum(rate, 1e-3)
        # No step beyond a factor e: the bracket may still be open.
        proposal = x - np.sign(step) * np.minimum(np.abs(step), 1.0)
        middle = 0.5 * (low + high)
        outside = (proposal >= high) | (proposal <= low)
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
    # From here on depths and forces count from the beginning of the domain, where most laws have no force.
    target = np.log(load - least)
    high = np.full_like(load, np.log(_ceiling(force, float(load.max()), least, domain, beyond)))
    # Power laws have 1 <= dlnP/dlnw <= 2 or so; the bracket only has to exist, not to be tight.
    low = np.full_like(load, np.log(np.finfo(float).tiny))
    x = high.copy()
    for _ in range(_LAW_INVERSE_MAX_STEPS):
        w = np.exp(x)
        found = force(start + w) - least
        error = np.log(found) - target
        high = np.where(error > 0.0, np.minimum(high, x), high)
        low = np.where(error < 0.0, np.maximum(low, x), low)
        miss, slope = error * found, stiffness(start + w) * w
        # An asymptotic law ends where its stiffness is zero (no step: halve the bracket) ...
        step = np.divide(miss, slope, out=np.where(miss == 0.0, 0.0, np.inf), where=slope > 0.0)
        proposal = x - step
        # ... or infinite, where Newton's step is zero: halve then too.
        stuck = (np.abs(step) < 1e-12) & (np.abs(error) > 1e-9)
        outside = (proposal > high) | (proposal < low) | stuck
        proposal = np.where(outside, 0.5 * (low + high), proposal)
        settled = bool((np.abs(proposal - x) <= 4.0 * np.finfo(float).eps * (1.0 + np.abs(x))).all())
        x = proposal
        if settled:
            break
    return np.asarray(start + np.exp(x))


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
