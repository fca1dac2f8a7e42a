"""Steps of a base's modulus in a number that the force is nearly straight in.

Of the ratio k of base to layer, the force goes nearly with a power of k where the base is soft, and with its
compliance 1/k where it is stiff: with u = -ln(1 + 1/k) at both ends. A step that is straight in ln k leads far too
far down from a stiff base, and up towards a rigid one it never arrives.
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

__all__ = ["BaseSteps", "Bent", "bent"]

_BASE, _LAYER = "substrate.E", "layer.E"


@dataclass(frozen=True)
class BaseSteps:
    """The free moduli of bases, m of them, and those of the layers on them.

    A step is measured so that it begins as one of the scaled entry, ln E2, does.

    Parameters
    ----------
    bases : ndarray of int (m,)
        Their entries in a scaled vector.
    layers : ndarray of int (m,)
        Those of the layers' moduli; any where they are known.
    free : FloatArray
        One where that modulus is free, zero where it is known, (m,).
    at_start : FloatArray
        ln k of the scene's own numbers, (m,).
    """

    bases: NDArray[np.intp]
    layers: NDArray[np.intp]
    free: FloatArray
    at_start: FloatArray

    @classmethod
    def of(cls, members: Sequence[Member], coordinates: Sequence[Coordinate]) -> Self | None:
        """Of the curves of a problem; None where no base's modulus is free."""
        found: dict[int, tuple[int, float, float]] = {}
        for member in members:
            base, layer = (member.entries.get(path) for path in (_BASE, _LAYER))
            if base is None or _LAYER not in member.base:
                continue
            known = member.base[_LAYER] if layer is None else coordinates[layer].reference
            at_start = float(np.log(coordinates[base].reference / known))
            found.setdefault(base, (layer or 0, float(layer is not None), at_start))
        if not found:
            return None
        layers, free, start = zip(*found.values(), strict=True)
        return cls(np.array(list(found)), np.array(layers), np.array(free), np.array(start))

    def at(self, vectors: FloatArray) -> Bent:
        """How steps from scaled vectors (s, k) go."""
        log_ratio = vectors[:, self.bases] - self.free * vectors[:, self.layers] + self.at_start
        inverse = np.exp(-log_ratio)
        return Bent(self.bases, log_ratio, -np.log1p(inverse), inverse / (1.0 + inverse))


class Bent(NamedTuple):
    """Steps of the entries `bases` (m,) from ln k: u there, and du/d(ln k) = 1 / (1 + k), each (s, m).

    Up from a soft base they are straight in the logarithm: u would lead beyond what is as good as rigid.
    """

    bases: NDArray[np.intp]
    log_ratio: FloatArray
    u: FloatArray
    slope: FloatArray

    def straight(self, changes: FloatArray) -> FloatArray:
        """Steps (s, k) that lead to `changes` (s, k), which may be infinite, of scaled vectors; overwrites them."""
        change = changes[:, self.bases]
        steps = (bent(self.log_ratio + change) - self.u) / self.slope
        changes[:, self.bases] = np.where(self._up_from_soft(change), change, steps)
        return changes

    def taken(self, steps: FloatArray, longest: float) -> FloatArray:
        """Changes (s, k) of scaled vectors that steps (s, k) lead to, of a base's at most `longest`."""
        step = steps[:, self.bases]
        # Beyond a rigid base there is nothing.
        there = np.minimum(self.u + self.slope * step, bent(self.log_ratio + longest))
        change = np.where(self._up_from_soft(step), step, -np.log(np.expm1(-there)) - self.log_ratio)
        result = steps.copy()
        result[:, self.bases] = np.where(step == 0.0, 0.0, np.clip(change, -longest, longest))
        return result

    def _up_from_soft(self, change: FloatArray) -> NDArray[np.bool_]:
        return (self.log_ratio < 0.0) & (change > 0.0)


def bent(log_ratio: FloatArray) -> FloatArray:
    """Number u = -ln(1 + 1/k) of ln k that the force is nearly straight in."""
    return np.asarray(-np.logaddexp(0.0, -log_ratio))
