"""The force after a maximum, by the equal radius on the way in (Ting 1966).

With t1(t) the last earlier time at which the contact had the radius it has at t,

    int_{t1}^t e(t - s) w'(s) ds = 0,    P(t) = int_0^{t1} e(t - s) dP_el(w(s)),

and the contact is lost where the first integral is not positive from the first contact on. t1 depends on the
motion alone: it is the same for every tip and every layer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.mechanics.response import Elastic
from underlay.mechanics.viscoelastic.loading import loads
from underlay.mechanics.viscoelastic.memory import Memory, curved, even

__all__ = ["EqualRadius", "equal_radius", "unloading_force"]

# Halvings of one step: to the last bit.
_HALVINGS = 54


@dataclass(frozen=True)
class EqualRadius:
    """Where on the way in the contact had the radii of the way out.

    Parameters
    ----------
    step : ndarray of int (m,)
        Step of the record in which t1 lies.
    elapsed : FloatArray
        t1 less the beginning of that step (s), (m,).
    depth : FloatArray
        w(t1) (m), (m,), not negative.
    touching : ndarray of bool (m,)
        Whether there is contact at all.
    """

    step: NDArray[np.intp]
    elapsed: FloatArray
    depth: FloatArray
    touching: NDArray[np.bool_]


def equal_radius(depth: FloatArray, memory: Memory, turn: int) -> EqualRadius:
    """Find t1 for every point after number `turn`, the last of the way in.

    F(t1) = constant (w - w(t1)) + sum_k weight_k [y_k - exp(-(t - t1) / tau_k) y_k(t1)], with
    y_k(t) = int exp(-(t - s) / tau_k) dw(s), falls as t1 grows: the step is found by halving the record, the time
    by halving the step.
    """
    y = memory.integrals(depth)
    modes, time = memory.modes, memory.time
    after = slice(turn + 1, None)
    target = modes.constant * depth[after] + modes.weights @ y[:, after]

    def seen(number: NDArray[np.intp], elapsed: FloatArray) -> FloatArray:
        """constant w(t1) + sum_k weight_k exp(-(t - t1) / tau_k) y_k(t1), (m,)."""
        part = elapsed / modes.times[:, None]
        speed = (depth[number + 1] - depth[number]) / (time[number + 1] - time[number])
        y1 = np.exp(-part) * y[:, number] + even(part) * speed * elapsed
        gone = (time[after] - time[number] - elapsed) / modes.times[:, None]
        return np.asarray(
            modes.constant * (depth[number] + speed * elapsed) + modes.weights @ (np.exp(-gone) * y1)
        )

    low, high = np.zeros(target.shape, dtype=np.intp), np.full(target.shape, turn, dtype=np.intp)
    nothing = np.zeros(target.shape)
    while (high - low > 1).any():
        middle = (low + high) // 2
        later = seen(middle, nothing) < target
        low, high = np.where(later, middle, low), np.where(later, high, middle)
    width = time[low + 1] - time[low]
    first, last = np.zeros(target.shape), width.copy()
    for _ in range(_HALVINGS):
        half = 0.5 * (first + last)
        later = seen(low, half) < target
        first, last = np.where(later, half, first), np.where(later, last, half)
    elapsed = 0.5 * (first + last)
    reached = depth[low] + (depth[low + 1] - depth[low]) * (elapsed / width)
    # Lost for good where not even the first contact lies late enough.
    touching = (reached > 0.0) & (seen(np.zeros_like(low), nothing) < target)
    return EqualRadius(low, elapsed, np.where(touching, reached, 0.0), touching)


def unloading_force(
    elastic: Elastic, depth: FloatArray, memory: Memory, turn: int, found: EqualRadius
) -> FloatArray:
    """Force (N) of every point after number `turn`, (m,): a history that grew to there and shrinks since."""
    modes, time = memory.modes, memory.time
    at, middle = loads(elastic, depth)
    z = memory.integrals(at, middle)
    n, reached = found.step, found.depth
    begin = np.maximum(depth[n], 0.0)
    ends = elastic(np.concatenate((reached, 0.5 * (begin + reached))))
    load, half = ends[: len(n)], ends[len(n) :]
    part = found.elapsed / modes.times[:, None]
    g1 = even(part)
    z1 = np.exp(-part) * z[:, n] + g1 * (load - at[n])
    z1 += curved(part, g1) * (4.0 * half - 2.0 * (load + at[n]))
    gone = (time[turn + 1 :] - time[n] - found.elapsed) / modes.times[:, None]
    force = modes.constant * load + modes.weights @ (np.exp(-gone) * z1)
    return np.asarray(np.where(found.touching, force, 0.0))
