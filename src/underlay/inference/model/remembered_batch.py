"""A sample with memory at many parameter sets at once: the elastic forces of all, then the memory of all.

It serves a relaxing layer during loading and unloading, whatever the contact point of a set, and a memory that
gives the forces of many sets itself. Motions without a closed construction, such as a second cycle, and a compliant
frame are computed one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward
from underlay.inference.model.groups import Values
from underlay.mechanics.response import WholeHistory, checked_times
from underlay.mechanics.viscoelastic.history import Viscoelastic, forces_of_sets
from underlay.scene.instrument import SENSITIVITY_RATIO, Chain, ContactDepth, Frame

__all__ = ["remembered_readings"]


class _Read(Protocol):
    """Readings of the elastic sets, as far as the memory needs them."""

    @property
    def contact(self) -> FloatArray:
        """Contact force (N), (sets, n)."""

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Whether each set has a law, (sets,)."""


def remembered_readings(
    forward: Forward, values: Values, sets: int, elastic: Callable[..., _Read]
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.intp]] | None:
    """Forces of all sets of a sample with memory.

    Parameters
    ----------
    forward : Forward
        The compiled scene, with its memory.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    elastic : callable
        Function that computes the readings of a model without memory, as `batched_readings`.

    Returns
    -------
    tuple or None
        Contact force and instrument force (N), each (sets, n), which sets have a law, (sets,), and the rows that
        must be computed one by one; None where that is all of them.
    """
    history, time = forward.history, forward.time
    if isinstance(history, WholeHistory):
        return _whole_readings(history, forward, values, sets)
    if not isinstance(history, Viscoelastic) or time is None or np.any(values[Frame.path]):
        return None
    contact = np.broadcast_to(values[ContactDepth.path], sets)
    depth = np.broadcast_to(forward.depth_at(_upright(values)), (sets, forward.depth.shape[-1]))
    depth = depth - contact[:, None]
    prefix = f"{history.prefix}."
    own = {
        path.removeprefix(prefix): np.broadcast_to(value, sets)
        for path, value in values.items()
        if path.startswith(prefix)
    }
    known = history.relaxation.modes_of(own)
    if known is None:
        return None
    modes, possible = known
    # A modulus that is not finite at once must not meet a sudden step.
    sudden = possible & (depth[:, 0] > 0.0) & (not history.relaxation.bounded)
    asked, left = np.flatnonzero(possible & ~sudden), np.flatnonzero(sudden)
    force = np.zeros(depth.shape)
    if asked.size:
        still = {**values, ContactDepth.path: 0.0, SENSITIVITY_RATIO: 1.0}

        def loads(rows: NDArray[np.intp], w: FloatArray) -> FloatArray:
            of = asked[rows]
            own = {path: v[of] if isinstance(v, np.ndarray) else v for path, v in still.items()}
            same = replace(forward, history=None, time=None, depth=w, bending=None)
            found = elastic(same, own, len(of), stiffness=False)
            possible[of] &= found.possible
            return found.contact

        force[asked], closed = forces_of_sets(modes.of(asked), loads, depth[asked], time)
        left = np.append(left, asked[~closed])
    chain = Chain.of(_upright(values))
    return force, chain.reading(force, forward.depth), possible, left


def _whole_readings(
    history: WholeHistory, forward: Forward, values: Values, sets: int
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.intp]] | None:
    """`remembered_readings` of a memory that gives the force of a whole motion itself.

    None where the memory cannot treat these sets at once.
    """
    chain = Chain.of(_upright(values))
    depth = chain.travel(forward.depth)
    found = history.answers(values, sets, depth, checked_times(forward.time, np.atleast_2d(depth)[0]))
    if found is None:
        return None
    force, answered = found
    return force, chain.reading(force, forward.depth), answered, np.flatnonzero(~answered)


def _upright(values: Values) -> dict[str, float | FloatArray]:
    """The numbers shaped to broadcast over readings: (sets, 1) where they vary."""
    return {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
