"""Damped steps of Levenberg and Marquardt, of several searches at once, that keep between their ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.least_squares.places import Places
from underlay.inference.least_squares.projection import acting

__all__ = ["LONGEST", "damped_steps"]

#: A step is cut to this in every scaled coordinate: a factor e^3 of a modulus, three ranges of the curve.
LONGEST = 3.0


def damped_steps(
    places: Places, damping: FloatArray, active: NDArray[np.bool_], low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Steps (s, k) no further than `low` and `high` (s, k), what each should gain (s,), and its length (s,).

    That is the largest change of an entry.
    """
    gradient, normal = places.gradient, places.normal
    norms = np.sqrt(normal.diagonal(axis1=1, axis2=2))
    which = active & acting(norms)
    outward = which & ((low >= 0.0) | (high <= 0.0))
    if outward.any():
        outward &= _outward(gradient, low, high)
        which &= ~outward
    step = _solved(gradient, normal, which, norms, damping)
    if outward.any():
        # What pulls out of its end here may pull back in from where the others go.
        back = outward & ~_outward(gradient + (normal @ step[:, :, None])[:, :, 0], low, high)
        if back.any():
            which |= back
            step = _solved(gradient, normal, which, norms, damping)
    beyond = which & ((step < low) | (step > high))
    held = np.zeros(0)
    if beyond.any():
        step, held = _kept_inside(places, step, beyond, which, norms, damping, low, high)
    length = np.abs(step).max(axis=1, initial=0.0)
    if (length > LONGEST).any():
        step *= (LONGEST / np.maximum(length, LONGEST))[:, None]
        length = np.minimum(length, LONGEST)
    if not held.any():
        return step, -np.einsum("sk,sk->s", step, gradient), length
    gain = -np.einsum("sk,sk->s", step, 2.0 * gradient + (normal @ step[:, :, None])[:, :, 0])
    return step, gain, length


def _outward(gradient: FloatArray, low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Which entries stand at an end and are pulled out of it, or not at all, by J'r (s, k)."""
    return ((low >= 0.0) & (gradient >= 0.0)) | ((high <= 0.0) & (gradient <= 0.0))


def _kept_inside(
    places: Places,
    step: FloatArray,
    beyond: NDArray[np.bool_],
    which: NDArray[np.bool_],
    norms: FloatArray,
    damping: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Steps (s, k) between `low` and `high`, and those of the entries that are held there, zero for the others."""
    at, held, free = np.zeros_like(step), np.zeros_like(step), which
    while beyond.any():
        # What would leave its ends first stays there, and the others go to where they are best beside it. From
        # there the sum falls on: held all at once they may pull each other uphill.
        end = np.where(step > 0.0, high, low)
        share = np.divide(end - at, step - at, out=np.full_like(step, np.inf), where=beyond)
        first, over = share.argmin(axis=1), np.asarray(beyond.any(axis=1))
        at += np.where(over, share.min(axis=1), 0.0)[:, None] * (step - at)
        meets = over[:, None] & (np.arange(step.shape[1]) == first[:, None])
        held, free = np.where(meets, end, held), free & ~meets
        moved = places.gradient + (places.normal @ held[:, :, None])[:, :, 0]
        again = held + _solved(moved, places.normal, free, norms, damping)
        step = np.where(over[:, None], again, step)
        beyond = free & ((step < low) | (step > high))
    return step, held


def _solved(
    gradient: FloatArray, normal: FloatArray, which: NDArray[np.bool_], norms: FloatArray, damping: FloatArray
) -> FloatArray:
    """Damped steps (s, k) of the entries `which` (s, k), from J'r (s, k) and J'J (s, k, k); the others rest."""
    scale, diagonal, downhill = norms, 1.0 + damping[:, None], gradient
    rest = not which.all()
    if rest:
        # An entry that rests has a row of its own, and no gradient.
        scale, diagonal = np.where(which, norms, 1.0), np.where(which, diagonal, 1.0)
        downhill = np.where(which, gradient, 0.0)
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    if rest:
        scaled = np.where(which[:, :, None] & which[:, None, :], scaled, 0.0)
    count = scaled.shape[1]
    scaled.reshape(-1, count * count)[:, :: count + 1] = diagonal
    return -np.linalg.solve(scaled, (downhill / scale)[:, :, None])[:, :, 0] / scale
