"""A sample that remembers at many parameter sets at once: the elastic forces of all, then the memory of all.

It serves a relaxing layer along a motion that grows or rests, whatever the contact point of a set. On the way out
the equal radius of every set is its own, and the sets go one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward
from underlay.inference.model.parameter_sets import Values
from underlay.mechanics.relaxation import ModesOfSets
from underlay.mechanics.viscoelastic.history import Viscoelastic
from underlay.scene.chain import Chain, ContactDepth, Frame

__all__ = ["remembered_readings"]


class _Read(Protocol):
    """What is read of the elastic sets."""

    @property
    def contact(self) -> FloatArray:
        """Contact force (N), (sets, n)."""

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Which sets exist."""


def remembered_readings(
    forward: Forward, values: Values, sets: int, elastic: Callable[..., _Read]
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]] | None:
    """Contact force, stiffness (zero), instrument force, each (sets, n), and which sets exist.

    None where the sets do not share a way. `elastic` reads a forward model without memory, as `batched_readings`.
    """
    history, time = forward.history, forward.time
    if not isinstance(history, Viscoelastic) or time is None or np.any(values[Frame.path]):
        return None
    contact = np.broadcast_to(values[ContactDepth.path], sets)
    depth = forward.depth
    # A motion that only grows from the deepest contact on does so from any.
    if not depth.max() > contact.max() or not history.only_grows(depth - contact.max()):
        return None
    if depth[0] > contact.min() and not history.relaxation.bounded:
        return None
    prefix = f"{history.prefix}."
    own = {
        path.removeprefix(prefix): np.broadcast_to(value, sets)
        for path, value in values.items()
        if path.startswith(prefix)
    }
    modes = history.relaxation.modes_of(own)
    if modes is None:
        return None
    moved = np.flatnonzero(np.diff(depth))
    asked = np.concatenate((depth[:1], depth[moved + 1], 0.5 * (depth[moved + 1] + depth[moved])))
    found = elastic(replace(forward, history=None, time=None, depth=asked), values, sets, stiffness=False)
    last = np.zeros(len(depth), dtype=np.intp)
    last[moved + 1] = 1
    at = found.contact[:, np.cumsum(last)]
    middle = at[:, 1:].copy()
    middle[:, moved] = found.contact[:, len(moved) + 1 :]
    possible = found.possible & modes.possible
    force = np.zeros((sets, len(depth)))
    if possible.any():
        kept = ModesOfSets(
            modes.constant[possible], modes.weights[possible], modes.times[possible], modes.possible[possible]
        )
        force[possible] = history.loaded(kept, at[possible], middle[possible], time)
    chain = Chain.of({path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()})
    return force, np.zeros_like(force), chain.reading(force, depth), possible
