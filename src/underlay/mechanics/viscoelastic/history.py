"""A layer's relaxation as the history of a law: which construction holds for a motion, and the force by it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError, ParameterError
from underlay.mechanics.body import Body, Layer
from underlay.mechanics.relaxation import Relaxation
from underlay.mechanics.response import Elastic, History
from underlay.mechanics.viscoelastic.bed import Bed
from underlay.mechanics.viscoelastic.loading import Loading
from underlay.mechanics.viscoelastic.memory import Memory
from underlay.mechanics.viscoelastic.unloading import Unloading, equal_radius
from underlay.quantities import inlined, numbers_of

__all__ = ["Viscoelastic", "require_still_base"]

# A motion counts as growing while it falls back from its deepest point by no more than this part of it, first
# none, then the noise of a depth reading. The springs that lift off there hold less than the square of it:
# measured against the bed, whose own error is 1e-5, 3e-5 of the largest force at ripples of up to 2.8e-3.
_RIPPLES = (0.0, 3e-3)
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Viscoelastic(History):
    """What a relaxing layer remembers.

    Parameters
    ----------
    relaxation : Relaxation
        How its modulus falls.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer",)
    prefix: ClassVar[str] = "layer.relaxation"

    relaxation: Relaxation = field(metadata=inlined())

    def force(self, elastic: Elastic, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), of depths since contact (m), (n,), at times (s), (n,).

        A record that begins in contact begins with a sudden step to its first depth, or, where the modulus is
        not finite at once, with a rise to it within one sampling step.
        """
        return self.prepared(depth, time)(elastic)

    def prepared(self, depth: FloatArray, time: FloatArray) -> Callable[[Elastic], FloatArray]:
        """The map from an elastic force to `force` for one motion."""
        if len(depth) < 2 or not (depth > 0.0).any():
            return lambda elastic: np.asarray(elastic(np.maximum(depth, 0.0)))
        if depth[0] > 0.0 and not self.relaxation.bounded:
            # It came in within one step: a sudden one would be resisted without end.
            longer = self.prepared(np.append(0.0, depth), np.append(2.0 * time[0] - time[1], time))
            return lambda elastic: longer(elastic)[1:]
        modes = self.relaxation.modes(float(np.diff(time).min()), float(time[-1] - time[0]))
        memory = Memory(modes, time)
        for ripple in _RIPPLES:
            found = _closed(depth, memory, ripple)
            if found is not None:
                return found
        return Bed.of(depth, modes, time)

    def require_told(self, free: Sequence[str], time: FloatArray) -> None:
        """Refuse a free relaxation time outside what the record spans, from its sampling to its length.

        Raises
        ------
        ParameterError
            With the times that the record can tell.
        """
        shortest, longest = float(np.median(np.diff(time))), float(time[-1] - time[0])
        for path in free:
            if path not in (known := numbers_of(self.relaxation, self.prefix)) or ".times[" not in path:
                continue
            value = known[path].value
            if not shortest <= value <= longest:
                raise ParameterError(
                    f"{path} is {value:.4g} s, and this record tells times from its sampling, {shortest:.3g} s, to "
                    f"its length, {longest:.4g} s: start it there, or leave it fixed"
                )

    def slopes(
        self, paths: Sequence[str], elastic: Elastic, depth: FloatArray, time: FloatArray
    ) -> Mapping[str, FloatArray]:
        """d force / d number, (n,), at its own `paths`; the elastic force is asked once for equal depths."""
        known: dict[bytes, FloatArray] = {}

        def kept(x: FloatArray) -> FloatArray:
            key = x.tobytes()
            if key not in known:
                known[key] = elastic(x)
            return known[key]

        return super().slopes(paths, kept, depth, time)

    def dynamic_modulus(self, frequency: FloatArray, longest: float) -> FloatArray:
        """E*(i omega) / E, complex, at angular frequencies (1/s) of a small oscillation that lasts `longest` (s).

        The stiffness of a micro-oscillation is this times the elastic stiffness at the depth held.
        """
        omega = np.asarray(frequency, dtype=np.float64)
        modes = self.relaxation.modes(float(1.0 / omega.max()), longest)
        turned = 1j * omega[..., None] * modes.times
        return np.asarray(modes.constant + (turned / (1.0 + turned)) @ modes.weights)


def _closed(depth: FloatArray, memory: Memory, ripple: float) -> Callable[[Elastic], FloatArray] | None:
    """Lee and Radok up to the last deepest point and Ting after it; None where they do not hold."""
    w = np.maximum(depth, 0.0)
    allowed = (ripple + _ROUNDING) * w.max()
    turn = int(np.flatnonzero(w >= w.max() - allowed)[-1])
    if (np.maximum.accumulate(w[: turn + 1]) - w[: turn + 1] > allowed).any():
        return None
    if turn == len(w) - 1:
        return Loading(w, memory)
    # Before contact the motion does not count, and after it the tip may leave the surface.
    path = np.concatenate((w[: turn + 1], depth[turn + 1 :]))
    found = equal_radius(path, memory, turn)
    if (found.depths - np.minimum.accumulate(found.depths) > allowed).any():
        return None
    return Unloading(w[: turn + 1], memory, found)


# A base this much stiffer than the layer is as good as rigid: the kernel of the unrelaxed layer then serves all
# times, since relaxing only brings the layer closer to a rigid base.
_AS_GOOD_AS_RIGID = 1e3


def require_still_base(layer: Layer, substrate: Body | None) -> None:
    """Refuse a relaxing layer on a base that its kernel ages with.

    Raises
    ------
    InputError
        If the base is elastic and less than 1000 times stiffer than the layer at once. The force by moduli at the
        current time (quasi-elastic) would be wrong by 2 % where half of the modulus relaxes, 29 % where nine
        tenths do (nu = 0.5, base as stiff as the layer).
    """
    if layer.relaxation is None or layer.thickness == np.inf or substrate is None:
        return
    below = [*(deeper.material for deeper in substrate.layers), substrate.base]
    elastic = [part.plane_constants for part in below if part.plane_constants is not None]
    ratio = min((float(plane.theta) / layer.material.theta for plane in elastic), default=np.inf)
    if ratio >= _AS_GOOD_AS_RIGID:
        return
    half = layer.relaxation.equilibrium >= 0.5
    size = "2 %" if half else "11 to 29 % (measured where nine tenths of it relax)"
    raise InputError(
        f"a layer that relaxes on an elastic base only {ratio:.3g} times stiffer is not simulated: its force by "
        f"the moduli of the moment would be up to {size} too low in a hold; a base 1000 times stiffer, a rigid "
        "one, or none at all is exact"
    )
