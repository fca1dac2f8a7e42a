"""Inverting increasing relations, many at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["invert_increasing"]

# Newton takes 4 to 8 steps. At a turning point, where the slope vanishes, each step halves the error and
# rounding of y leaves 1e-8 of x, which 30 steps reach: there x has no more digits to give.
_MAX_STEPS = 80


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
