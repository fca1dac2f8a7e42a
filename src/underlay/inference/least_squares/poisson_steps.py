"""Steps of a layer's Poisson's ratio up towards one half, in a number that the force is nearly straight in.

A bonded layer that is thin beside the contact answers with its modulus of compression without side strain, which
grows with 1/(1 - 2 nu) until the layer gives way sideways instead. Where a curve tells Poisson's ratio at all it
does so by that; a step that is straight in nu leads too far up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.members import Member

__all__ = ["PoissonSteps", "Risen"]

_NU = "layer.nu"
# What is left of 1 - 2 nu where a layer gives way sideways. Between nu = 0.4 and 0.5 the logarithm of the exact
# force is straight in ln(room) with 0.2 of contacts a third as wide as the layer is thick, 0.17 at 0.8, 0.1 at 1.5.
_SIDEWAYS = 0.13


@dataclass(frozen=True)
class PoissonSteps:
    """The free Poisson's ratios of isotropic layers, m of them.

    A step is measured so that it begins as one of the scaled entry does.

    Parameters
    ----------
    entries : ndarray of int (m,)
        Where they are in a scaled vector.
    reference, scale : FloatArray
        Of their coordinates, (m,).
    """

    entries: NDArray[np.intp]
    reference: FloatArray
    scale: FloatArray

    @classmethod
    def of(cls, members: Sequence[Member], coordinates: Sequence[Coordinate]) -> Self | None:
        """Of the curves of a problem; None where there is none.

        The in-plane ratio of a transversely isotropic layer goes up to one, and tells something else.
        """
        others = {
            m.entries[_NU] for m in members if _NU in m.entries and not m.scene.layer.material.isotropic
        }
        found = {i: c for i, c in enumerate(coordinates) if c.path == _NU and i not in others}
        if not found:
            return None
        reference, scale = np.array([[c.reference, c.scale or 1.0] for c in found.values()]).T
        return cls(np.array(list(found)), reference, scale)

    def at(self, vectors: FloatArray) -> Risen:
        """How steps from scaled vectors (s, k) go."""
        room = 1.0 - 2.0 * (self.reference + self.scale * vectors[:, self.entries]) + _SIDEWAYS
        return Risen(self.entries, room / (2.0 * self.scale))


class Risen(NamedTuple):
    """Steps of the `entries` (m,) from where so much `room` (s, m) is left, in their scaled coordinates.

    Up they are straight in ln(room).
    """

    entries: NDArray[np.intp]
    room: FloatArray

    def straight(self, changes: FloatArray) -> FloatArray:
        """Steps (s, k) that lead to `changes` (s, k) of scaled vectors; overwrites them."""
        change = changes[:, self.entries]
        changes[:, self.entries] = np.where(change > 0.0, -self.room * np.log1p(-change / self.room), change)
        return changes

    def taken(self, steps: FloatArray, longest: float) -> FloatArray:
        """Changes (s, k) of scaled vectors that steps (s, k) lead to; none is longer than its step."""
        del longest
        step = steps[:, self.entries]
        result = steps.copy()
        result[:, self.entries] = np.where(step > 0.0, -self.room * np.expm1(-step / self.room), step)
        return result
