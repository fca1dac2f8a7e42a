"""A layer's relaxation as the history of a law: chooses the construction for a motion, and gives the force.

`Viscoelastic` is that of one set of parameters. `forces_of_sets` computes the force for one measured motion at many
sets of parameters at once, each with its own contact point and relaxation. Since these motions differ only in where
contact begins, most turn at the same point; those are computed together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import ParameterError
from underlay.mechanics.relaxation import ModesOfSets, Relaxation
from underlay.mechanics.response import Elastic, History, Invertible, Motion, Response
from underlay.mechanics.viscoelastic.bed import Bed, crept
from underlay.mechanics.viscoelastic.equal_radius import equal_radius
from underlay.mechanics.viscoelastic.loading import Loading, Unloading
from underlay.mechanics.viscoelastic.memory import LastMemory, Memory
from underlay.quantities import inlined, no_number, numbers_of

__all__ = [
    "RIPPLES",
    "SUDDEN",
    "ElasticOfSets",
    "Viscoelastic",
    "ViscoelasticMotion",
    "forces_of_sets",
    "led_in",
    "resolved_times",
    "turns",
]

#: A motion counts as growing while it falls back from its deepest point by no more than this part of it, first
#: none, then the noise of a depth reading. The springs that lift off there hold less than the square of it:
#: measured against the bed, whose own error is 1e-5, 3e-5 of the largest force at ripples of up to 2.8e-3.
RIPPLES = (0.0, 3e-3)
_ROUNDING = 1e-9
#: A sudden step as a share of the first one: what relaxes within it is as small a part of the force.
SUDDEN = 1e-7
#: Elastic forces (N), (rows, q), of the sets `rows` at depths (m), (rows, q).
ElasticOfSets: TypeAlias = Callable[[NDArray[np.intp], FloatArray], FloatArray]


def resolved_times(time: FloatArray) -> tuple[float, float]:
    """Shortest and longest relaxation time (s) that a record can determine: its sampling step and its length."""
    return float(np.median(np.diff(time))), float(time[-1] - time[0])


@dataclass(frozen=True)
class Viscoelastic(History):
    """Relaxation of a layer, as the history of a law.

    Parameters
    ----------
    relaxation : Relaxation
        How its modulus falls.
    last : LastMemory, optional
        Cache of what depends only on the times of a record and of the relaxation.
    """

    parts: ClassVar[tuple[str, ...]] = ("layer",)
    prefix: ClassVar[str] = "layer.relaxation"

    relaxation: Relaxation = field(metadata=inlined())
    last: LastMemory = field(default_factory=LastMemory, compare=False, repr=False, metadata=no_number())

    def force(self, elastic: Elastic, depth: FloatArray, time: FloatArray) -> FloatArray:
        """Force (N), (n,), of depths since contact (m), (n,), at times (s), (n,).

        A record that begins in contact begins with a sudden step to its first depth, or, where the modulus is
        not finite at once, with a rise to it within one sampling step.
        """
        return self.prepared(depth, time)(elastic)

    def prepared(self, depth: FloatArray, time: FloatArray) -> ViscoelasticMotion:
        """The map from an elastic force to `force` for one motion: depths (m) and times (s), each (n,)."""
        if len(depth) < 2 or depth.max() <= 0.0:
            return ViscoelasticMotion(self, depth, time, None)
        begun = depth[0] > 0.0
        if begun and not self.relaxation.bounded:
            # It came in within one step: a sudden one would be resisted without end.
            form = self._form(*led_in(depth, time, 1.0))
        else:
            form = self._form(depth, time)
            begun = begun and not isinstance(form, Loading)
            if begun:
                # The contact shrinks back through the radii of the sudden step, which must have a time.
                form = self._form(*led_in(depth, time, SUDDEN))
        return ViscoelasticMotion(self, depth, time, form, first=int(begun))

    def _form(self, depth: FloatArray, time: FloatArray) -> Loading | Unloading | Bed:
        """The simplest construction that is valid for depths (m) at times (s), each (n,)."""
        modes, memory = self.last.of(self.relaxation, time)
        for ripple in RIPPLES:
            found = _closed(depth, memory, ripple)
            if found is not None:
                return found
        return Bed.of(depth, modes, time)

    def depth(self, law: Invertible, force: FloatArray, time: FloatArray) -> FloatArray:
        """Depth (m), (n,), under compressive forces (N), (n,), at times (s), (n,)."""
        if len(force) < 2:
            return np.asarray(law.depth(force))
        return crept(law, self.last.of(self.relaxation, time)[0], force, time)

    def require_told(self, free: Sequence[str], time: FloatArray) -> None:
        """Raise if a free relaxation time, or the fraction at one, lies outside the times a record can determine.

        Raises
        ------
        ParameterError
            With the range of times that it can.
        """
        shortest, longest = resolved_times(time)
        known = numbers_of(self.relaxation, self.prefix)
        for path in free:
            of_time = path.replace(".fractions[", ".times[")
            if path not in known or ".times[" not in of_time:
                continue
            value = known[of_time].value
            if not shortest <= value <= longest:
                what = "start it there, or leave it fixed" if of_time == path else "leave the fraction fixed"
                raise ParameterError(
                    f"{of_time} is {value:.4g} s, and this record tells times from its sampling, {shortest:.3g} s, "
                    f"to its length, {longest:.4g} s: {what}"
                )

    def dynamic_modulus(self, frequency: FloatArray, longest: float) -> FloatArray:
        """Complex dynamic modulus E*(i omega) over E at angular frequencies omega (1/s), same shape.

        `longest` (s) is how long the oscillation lasts. The stiffness of a micro-oscillation is this times the
        elastic stiffness at the depth held.
        """
        omega = np.asarray(frequency, dtype=np.float64)
        modes = self.relaxation.modes(float(1.0 / omega.max()), longest)
        turned = 1j * omega[..., None] * modes.times
        return np.asarray(modes.constant + (turned / (1.0 + turned)) @ modes.weights)


@dataclass(frozen=True)
class ViscoelasticMotion(Motion):
    """A motion of a relaxing layer, and the construction that is valid for it.

    Parameters
    ----------
    form : Loading, Unloading, Bed or None
        The construction; None without contact.
    first : int, default 0
        Number of points added before the record, which are removed from results.
    """

    form: Loading | Unloading | Bed | None = None
    first: int = 0

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), (n,), of the relaxing layer for an elastic force as a function of depth."""
        if self.form is None:
            return np.asarray(elastic(np.maximum(self.depth, 0.0)))
        return self.form(elastic)[self.first :]

    def slopes(self, paths: Sequence[str], law: Response) -> Mapping[str, FloatArray]:
        """Derivatives of the force, (n,), in the relaxation's parameters, given by their `paths`."""
        if self.form is None or not paths:
            return {path: np.zeros(len(self.depth)) for path in paths}
        relaxation, prefix = self.history.relaxation, self.history.prefix  # type: ignore[attr-defined]  # a Viscoelastic
        known = None if isinstance(self.form, Bed) else relaxation.mode_slopes(self.form.memory.modes)
        if known is None or isinstance(self.form, Bed):
            return super().slopes(paths, law)
        along = self.form.mode_slopes(law.force, law.stiffness)
        found = {}
        for path in paths:
            change = known[path.removeprefix(f"{prefix}.")]
            slope = change.constant * along.constant + change.weights @ along.weights
            found[path] = (slope + change.times @ along.times)[self.first :]
        return found


def led_in(depth: FloatArray, time: FloatArray, share: float) -> tuple[FloatArray, FloatArray]:
    """The motion (depths (..., n) and times (n,)) with a point of zero depth added before it.

    The rise from first contact to the first depth takes `share` times the first sampling step.
    """
    before = np.zeros((*depth.shape[:-1], 1))
    return np.concatenate((before, depth), axis=-1), np.append(time[0] - share * (time[1] - time[0]), time)


def turns(depth: FloatArray, ripple: float) -> tuple[NDArray[np.intp], FloatArray, NDArray[np.bool_]]:
    """Index of the turning point of depths (..., n), the fall back allowed (m), and whether they grow up to it.

    Each is (...,). `ripple` is the fall back allowed during loading, as a share of the largest depth.
    """
    w = np.maximum(depth, 0.0)
    deepest = w.max(axis=-1, keepdims=True)
    allowed = (ripple + _ROUNDING) * deepest
    turn = w.shape[-1] - 1 - (w >= deepest - allowed)[..., ::-1].argmax(axis=-1)
    back = np.maximum.accumulate(w, axis=-1) - w > allowed
    # The first to fall back, if any does, comes after the turn.
    first = np.where(back.any(axis=-1), back.argmax(axis=-1), w.shape[-1])
    return np.asarray(turn), allowed[..., 0], np.asarray(first > turn)


def _closed(depth: FloatArray, memory: Memory, ripple: float) -> Loading | Unloading | None:
    """Lee and Radok's construction up to the deepest point and Ting's after it; None where they do not hold."""
    if (depth[1:] >= depth[:-1]).all():
        return Loading(depth, memory)
    at, allowed, grows = turns(depth, ripple)
    turn = int(at)
    if not grows:
        return None
    if turn == len(depth) - 1:
        return Loading(depth, memory)
    # Before contact the motion does not count, and after it the tip may leave the surface.
    way = np.concatenate((np.maximum(depth[: turn + 1], 0.0), depth[turn + 1 :]))
    found = equal_radius(way, memory, turn)
    return Unloading(depth, turn, memory, found) if found.regrowth <= allowed else None


def forces_of_sets(
    modes: ModesOfSets, elastic: ElasticOfSets, depth: FloatArray, time: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces (N), (sets, n), and a mask (sets,) of sets for which a closed construction holds; others are zero.

    Parameters
    ----------
    modes : ModesOfSets
        Of the relaxations, whose instantaneous modulus is finite.
    elastic : callable
        Elastic forces (N), (rows, q), from row numbers of sets and depths (m), (rows, q).
    depth : FloatArray
        Depths since contact (m), (sets, n), negative before it.
    time : FloatArray
        Times (s), (n,), increasing.
    """
    force, known = np.zeros(depth.shape), np.asarray((depth <= 0.0).all(axis=1))
    begun = depth[:, 0] > 0.0
    for ripple in RIPPLES:
        turn, allowed, grows = turns(depth, ripple)
        ready = grows & ~known
        for group in {(int(turn[row]), bool(begun[row])) for row in np.flatnonzero(ready)}:
            rows = np.flatnonzero(ready & (turn == group[0]) & (begun == group[1]))
            found, closed = _by_turn(modes.of(rows), elastic, rows, depth[rows], time, *group, allowed[rows])
            force[rows[closed]], known[rows[closed]] = found[closed], True
    return force, known


def _by_turn(
    modes: ModesOfSets,
    elastic: ElasticOfSets,
    rows: NDArray[np.intp],
    depth: FloatArray,
    time: FloatArray,
    turn: int,
    begun: bool,
    allowed: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Forces (N), (rows, n), of sets whose motions turn at point `turn`, and for which of them they are valid.

    Valid means that the contact shrinks from there on, but for `allowed` (m). `begun`: the record begins in
    contact.
    """

    def asked(w: FloatArray) -> FloatArray:
        return elastic(rows, w)

    if turn == len(time) - 1:
        return Loading(depth, Memory.of(modes, time))(asked), np.ones(len(rows), dtype=bool)
    if begun:
        # The contact shrinks back through the radii of the sudden step, which must have a time.
        depth, time = led_in(depth, time, SUDDEN)
        turn += 1
    memory = Memory.of(modes, time)
    way = np.concatenate((np.maximum(depth[:, : turn + 1], 0.0), depth[:, turn + 1 :]), axis=1)
    found = equal_radius(way, memory, turn)
    force = Unloading(depth, turn, memory, found)(asked)
    return force[:, int(begun) :], found.regrowth <= allowed
