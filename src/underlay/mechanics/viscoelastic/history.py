"""A layer's relaxation as the history of a law: chooses the construction for a motion, and gives the force.

`Viscoelastic` is that of one set of parameters. `forces_of_sets` computes the force for one measured motion at many
sets of parameters at once, each with its own contact point and relaxation. Since these motions differ only in where
contact begins, most turn at the same point; those are computed together.

The force of a relaxing layer while the contact grows (Lee and Radok 1960), and after its maximum (Ting 1966).

While the contact does not shrink (`Loading`), with w the depth, P_el the elastic force and e the relaxation
function,

    P(t) = int e(t - s) dP_el(w(s)).

After a maximum (`Unloading`), with t1(t) the last earlier time at which the contact had the radius it has at t,

    int_{t1}^t e(t - s) w'(s) ds = 0,    P(t) = int_0^{t1} e(t - s) dP_el(w(s)),

and the contact is lost where the first integral is not positive from the first contact on. t1 depends on the
motion alone (`equal_radius`): it is the same for every tip and every layer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import ParameterError
from underlay.mechanics.relaxation import ModesOfSets, Relaxation
from underlay.mechanics.response import Elastic, History, Invertible, Motion, Response
from underlay.mechanics.viscoelastic.bed import Bed, crept
from underlay.mechanics.viscoelastic.equal_radius import EqualRadius, at, equal_radius
from underlay.mechanics.viscoelastic.memory import LastMemory, Memory, curved, even
from underlay.quantities import inlined, no_number, numbers_of


class ModeSlopes(NamedTuple):
    """Derivatives of the force (N) in constant, weights and times of a relaxation's modes.

    Parameters
    ----------
    constant : FloatArray
        In the part that does not relax, (n,).
    weights, times : FloatArray
        In the weight and in the time of every exponential, (K, n).
    """

    constant: FloatArray
    weights: FloatArray
    times: FloatArray


@dataclass(frozen=True)
class WayIn:
    """Depths at which the elastic force is needed during loading, and how the results are used.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), zero before contact, (n,), or of many sets (sets, n).
    """

    depth: FloatArray

    @cached_property
    def rest(self) -> int:
        """Index of the point after which no tip moves any more."""
        moved = self._moves[0]
        return int(moved[-1]) + 1 if len(moved) else 0

    @cached_property
    def asked(self) -> FloatArray:
        """Depths (m) at which the elastic force is needed, (..., q): at the points, then in the middle of steps."""
        w = self._moves[1]
        count = w.shape[-1]
        depth = np.empty((*w.shape[:-1], 2 * count - 1))
        depth[..., :count] = w
        np.add(w[..., 1:], w[..., :-1], out=depth[..., count:])
        depth[..., count:] *= 0.5
        return depth

    def moving(self, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Elastic forces (N) up to the point `rest`, (..., r + 1), and their bends for `Memory.integrals`.

        `answers` are the forces at the depths `asked`.
        """
        moved, steps = self._moves[0], self.rest
        at, half = answers[..., : len(moved) + 1], answers[..., len(moved) + 1 :]
        bends = 4.0 * half
        bends -= 2.0 * (at[..., 1:] + at[..., :-1])
        if len(moved) == steps:
            return at, bends
        # Where the tip rests, and before contact, the force is that of the point before.
        held = np.zeros(steps + 1, dtype=np.intp)
        held[moved + 1] = 1
        bend = np.zeros((*at.shape[:-1], steps))
        bend[..., moved] = bends
        return at.take(held.cumsum(), axis=-1), bend

    def read(self, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Elastic forces (N) at all points, (..., n), and their bends, (..., n - 1), from the forces at `asked`.

        The bend of a step is 4 times the excess of the force in its middle over the mean of its ends.
        """
        values, bend = self.moving(answers)
        still = self.depth.shape[-1] - 1 - self.rest
        if not still:
            return values, bend
        held = np.broadcast_to(values[..., -1:], (*values.shape[:-1], still))
        return np.concatenate((values, held), axis=-1), np.concatenate((bend, np.zeros(held.shape)), axis=-1)

    @cached_property
    def _moves(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Indices of the steps in which a tip moves, (m,), and the depths (m) at their ends, (..., m + 1)."""
        moves = self.depth[..., 1:] != self.depth[..., :-1]
        moved = (moves if moves.ndim == 1 else moves.any(axis=0)).nonzero()[0]
        if len(moved) and moved[-1] - moved[0] == len(moved) - 1:
            # None is left out: a slice takes the place of a list.
            return moved, self.depth[..., moved[0] : moved[-1] + 2]
        return moved, np.concatenate((self.depth[..., :1], self.depth[..., 1:].take(moved, axis=-1)), axis=-1)


@dataclass(frozen=True)
class Loading:
    """Force of a relaxing layer for a motion that only grows or rests, or for one such motion per set.

    The elastic force is taken as quadratic in time over each step. Measured on a paraboloid, a ramp over 2.5
    relaxation times, relative to the largest force: 9e-7 with 10 points on the ramp, 2e-8 with 50, 5e-10 with
    200.

    Parameters
    ----------
    depth : FloatArray
        Depths (m), (n,) or (sets, n).
    memory : Memory
        Of the relaxation, along the record.
    """

    depth: FloatArray
    memory: Memory

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), of the shape of the depths, for an elastic force (N) as a function of depth (m)."""
        memory, rest = self.memory, self._way_in.rest
        values, bend = self._way_in.moving(elastic(self._way_in.asked))
        z = memory.integrals(values, bend)
        force = np.empty(self.depth.shape)
        np.multiply(values, memory.modes.constant, out=force[..., : rest + 1])
        force[..., : rest + 1] += memory.weighted(z)
        if rest + 1 < self.depth.shape[-1]:
            force[..., rest + 1 :] = memory.modes.constant * values[..., -1:]
            force[..., rest + 1 :] += memory.faded(z[..., -1], rest)
        return force

    def mode_slopes(self, elastic: Elastic, stiffness: Elastic) -> ModeSlopes:
        """Derivatives of the force in the modes' parameters; `stiffness` is not used here."""
        del stiffness
        memory = self.memory
        at, bend = self._way_in.read(elastic(self._way_in.asked))
        z = memory.integrals(at, bend)
        in_times = memory.integral_slopes(z, at, bend)
        return ModeSlopes(at, z, memory.modes.weights[:, None] * in_times)

    @cached_property
    def _way_in(self) -> WayIn:
        return WayIn(np.maximum(self.depth, 0.0))


@dataclass(frozen=True)
class Unloading:
    """Force of a relaxing layer for a motion that grows or rests up to a turning point and then shrinks.

    For many parameter sets whose motions turn at the same point, arrays have the sets before the points.

    Parameters
    ----------
    path : FloatArray
        Depths (m) of all points, negative before contact, (..., n).
    turn : int
        Index of the last point of loading.
    memory : Memory
        Of the relaxation, along the record.
    found : EqualRadius
        Times of equal radius for the points of unloading.
    """

    path: FloatArray
    turn: int
    memory: Memory
    found: EqualRadius

    def __call__(self, elastic: Elastic) -> FloatArray:
        """Force (N), of the shape of the depths, for an elastic force (N) as a function of depth (m)."""
        memory, found = self.memory, self.found
        values, bend, load = self._loads(elastic)
        z = memory.integrals(values, bend)
        force = np.zeros(self.path.shape)
        force[..., : self.turn + 1] = memory.modes.constant * values + memory.weighted(z)
        z1 = self._at_equal_radius(z, values, bend, load)
        z1 *= self._left
        out = memory.modes.constant * load + memory.weighted(z1)
        force[..., self._out] = out if found.held.all() else np.where(found.held, out, 0.0)
        return force

    def mode_slopes(self, elastic: Elastic, stiffness: Elastic) -> ModeSlopes:
        """Derivatives of the force in the modes' parameters, from the elastic force (N) and stiffness k (N/m).

        t1 moves with e(t) so that its condition holds. Both force and condition change with t1 by e(t - t1), so
        dP = int_0^{t1} de(t - s) dP_el + k(w(t1)) int_{t1}^t de(t - s) dw.

        t1 is the time during loading at which the contact had the same radius.
        """
        modes, found, count = self.memory.modes, self.found, self.path.shape[-1]
        n, tau, way_in = found.step, self.memory.tau, slice(self.turn + 1)
        values, bend, load = self._loads(elastic)
        z = self.memory.integrals(values, bend)
        in_time = self.memory.integral_slopes(z, values, bend)
        gap = self._past - self._even
        in_time1 = self._past * (in_time[:, n] + self._part / tau * z[:, n]) - gap / tau * (load - values[n])
        in_time1 -= (gap - 2.0 * self._curved) / tau * self._bend_within(bend)
        z1 = self._at_equal_radius(z, values, bend, load)
        y, y1, y_time, y_time1 = self._travelled
        left, out, k = self._left, self._out, stiffness(found.depth)
        gone = (self.memory.time[out] - found.time) / tau**2
        constant, weights, times = np.zeros(count), np.zeros((len(tau), count)), np.zeros((len(tau), count))
        constant[way_in], weights[:, way_in], times[:, way_in] = values, z, in_time
        constant[out] = np.where(found.held, load + k * (self.path[out] - found.depth), 0.0)
        weights[:, out] = np.where(found.held, left * z1 + k * (y[:, out] - left * y1), 0.0)
        later = left * (in_time1 + gone * z1) + k * (y_time[:, out] - left * (y_time1 + gone * y1))
        times[:, out] = np.where(found.held, later, 0.0)
        return ModeSlopes(constant, weights, modes.weights[:, None] * times)

    def _loads(self, elastic: Elastic) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Elastic forces (N) during loading, their bend in each step, and those at t1, from a single call.

        The bend of a step is 4 times the excess of the force in its middle over the mean of its ends; t1 is the
        time during loading at which the contact had the same radius.
        """
        way_in = self._way_in
        answers = elastic(np.concatenate((way_in.asked, self.found.depth), axis=-1))
        count = way_in.asked.shape[-1]
        return *way_in.read(answers[..., :count]), answers[..., count:]

    def _at_equal_radius(
        self, z: FloatArray, values: FloatArray, bend: FloatArray, load: FloatArray
    ) -> FloatArray:
        """Integrals z_k of the elastic force up to t1, (K, ..., m).

        t1 is the time during loading at which the contact had the same radius. z_k is int exp(-(t -
        s)/tau_k) dP_el(s), P_el the elastic force.
        """
        z1 = at(z, self.found.step)
        z1 *= self._past
        z1 += self._even * (load - at(values, self.found.step))
        z1 += self._curved * self._bend_within(bend)
        return z1

    def _bend_within(self, bend: FloatArray) -> FloatArray:
        """Bend of the elastic force over the part of its step before t1.

        The bend of a step is 4 times the excess of the force in its middle over the mean of its ends; t1 is the
        time during loading at which the contact had the same radius.
        """
        return np.asarray(at(bend, self.found.step) * self.found.share**2)

    @cached_property
    def _way_in(self) -> WayIn:
        return WayIn(np.maximum(self.path[..., : self.turn + 1], 0.0))

    @cached_property
    def _travelled(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """y_k at every point and at t1, (K, n) and (K, m), and the derivatives of both in tau_k.

        t1 is the time during loading at which the contact had the same radius. y_k is int exp(-(t -
        s)/tau_k) dw(s), w the depth.
        """
        found, tau = self.found, self.memory.tau
        n = found.step
        path = np.array(self.path)
        path[: self.turn + 1] = np.maximum(path[: self.turn + 1], 0.0)
        y = self.memory.integrals(path)
        in_time = self.memory.integral_slopes(y, path)
        rise = found.depth - path[n]
        y1 = self._past * y[:, n] + self._even * rise
        in_time1 = self._past * (in_time[:, n] + self._part / tau * y[:, n])
        return y, y1, in_time, in_time1 - (self._past - self._even) / tau * rise

    @property
    def _out(self) -> slice:
        """Slice of the points of unloading up to the last in contact."""
        return slice(self.turn + 1, self.turn + 1 + self.found.depth.shape[-1])

    @cached_property
    def _part(self) -> FloatArray:
        """Time from the beginning of its step to t1, over every relaxation time, (K, ..., m).

        t1 is the time during loading at which the contact had the same radius.
        """
        return np.asarray(self.found.elapsed / self.memory.tau)

    @cached_property
    def _past(self) -> FloatArray:
        """exp(-`_part`), (K, ..., m)."""
        return np.exp(-self._part)

    @cached_property
    def _even(self) -> FloatArray:
        """g1 (see `memory.even`) of `_part`, (K, ..., m)."""
        return even(self._part)

    @cached_property
    def _curved(self) -> FloatArray:
        """g2 (see `memory.curved`) of `_part`, (K, ..., m)."""
        return curved(self._part, self._even)

    @cached_property
    def _left(self) -> FloatArray:
        """exp(-(t - t1) / tau), (K, ..., m).

        t1 is the time during loading at which the contact had the same radius.
        """
        return np.exp((self.found.time - self.memory.time[self._out]) / self.memory.tau)


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
