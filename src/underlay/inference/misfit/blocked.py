"""A problem whose curves are taken in blocks, and its model about a vector.

Neighbouring readings of a real instrument shake together, and no noise model of few numbers holds at full rate; a
long quiet approach tells of a noise that is not the noise in contact. A sample that remembers keeps all its
readings: blocks of depths have no history.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.misfit.drift import deepest_of
from underlay.inference.misfit.linearised import Linearised, Part
from underlay.inference.misfit.shapes import Shapes
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.inference.uncertainty.known_errors import KnownError, Pressed, known_errors
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.solver import Solver
from underlay.scene.instrument import Chain, ContactDepth, Frame

__all__ = ["Blocked", "BlockedCurve", "clock_of"]

_MOST_BLOCKS, _LEAST_IN_CONTACT = 400, 50
# Approach that is used, in depths of contact.
_APPROACH = 2.0
_COARSE = 1e-4


@dataclass(frozen=True)
class Blocked:
    """A problem whose curves are taken in blocks.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    curves : tuple of BlockedCurve
        Its curves.
    errors : tuple of KnownError
        What its laws are known to get wrong.
    held : frozenset of int
        Entries of a vector that stay where they are.
    """

    problem: Problem
    curves: tuple[BlockedCurve, ...]
    errors: tuple[KnownError, ...] = ()
    held: frozenset[int] = frozenset()

    @classmethod
    def of(
        cls,
        problem: Problem,
        vector: FloatArray,
        held: frozenset[int] = frozenset(),
        errors: Sequence[KnownError] = (),
    ) -> Blocked:
        """Take the curves in blocks, their contact where it is at a scaled vector (k,).

        `errors` are further ones than those that the laws of its scenes always have.
        """
        physical = problem.physical(vector)
        curves = tuple(BlockedCurve.of(member, physical) for member in problem.members)
        return cls(problem, curves, (*known_errors(problem.base_scenes), *errors), held)

    def released(self) -> Blocked:
        """Return the same with nothing held, and with coarse laws where laws differ: their errors cancel."""
        return replace(self, curves=tuple(curve.coarse() for curve in self.curves), held=frozenset())

    def standing(self, model: Linearised, amounts: FloatArray) -> Blocked:
        """Return the same, the shapes of drift, jump and ramp that have `amounts` (10 + 2,) as a model has them.

        A reading that crosses a step of a jump as the contact point moves would change a sum of squares at once.
        """
        stand = [
            replace(curve, shapes=part.shapes(amounts))
            for curve, part in zip(self.curves, model.parts, strict=True)
        ]
        return replace(self, curves=tuple(stand))

    def linearised(self, vector: FloatArray) -> Linearised:
        """Model about a scaled vector (k,) and amplitudes zero of the known errors.

        Raises
        ------
        InputError
            If there is no law.
        """
        physical = self.problem.physical(vector)
        slopes = np.array(self.problem.space.slopes(physical))
        deviations = np.array([1.0] * len(vector) + [error.deviation for error in self.errors])
        means = np.array([0.0] * len(vector) + [error.mean for error in self.errors])
        precision = np.where(np.arange(len(means)) < len(vector), 0.0, deviations**-2.0)
        pull = -means * precision
        slopes[list(self.held)] = 0.0
        for i, coordinate in enumerate(self.problem.coordinates):
            if coordinate.prior.informative and i not in self.held:
                value, slope = coordinate.prior.penalty(float(physical[i]))
                precision[i] = (slope * slopes[i]) ** 2
                pull[i] = value * slope * slopes[i]
        return Linearised(
            [curve.part(physical, slopes, self.errors) for curve in self.curves],
            precision,
            pull,
            tuple(self.held),
        )


@dataclass(frozen=True)
class BlockedCurve:
    """One curve in blocks: its model at their depths, their forces (N) and times (s), each (n,).

    Its drift, jump and ramp have the `shapes` that are given, and follow the fit otherwise.
    """

    member: Member
    forward: Forward
    force: FloatArray
    time: FloatArray
    is_coarse: bool = False
    shapes: Shapes | None = None

    @classmethod
    def of(cls, member: Member, physical: FloatArray) -> BlockedCurve:
        """Take a curve in blocks, its contact where it is at a physical vector (k,)."""
        curve, contact = member.curve, member.values_at(physical)[ContactDepth.path]
        deepest = float(curve.depth.max()) - contact
        if not deepest > 0.0:
            raise InputError("a curve that never touches has no residuals in contact")
        used = curve.depth >= contact - _APPROACH * deepest
        depth, force = curve.depth[used], curve.force[used]
        time = clock_of(curve)
        if member.forward.history is not None:
            return cls(member, member.forward, curve.force, time)
        in_contact = int(np.count_nonzero(depth > contact))
        size = max(1, min(-(-len(depth) // _MOST_BLOCKS), in_contact // _LEAST_IN_CONTACT))
        # Whole blocks from the deep end: what is left over is far before contact.
        start = len(depth) % size

        def means(values: FloatArray) -> FloatArray:
            return np.asarray(values[start:].reshape(-1, size).mean(axis=1))

        return cls(member, member.forward.moved(means(depth), means(force)), means(force), means(time[used]))

    def coarse(self) -> BlockedCurve:
        """Return the same with laws of a tenth of a thousandth of the force, of its own store.

        Where nothing that is fitted changes the law but by factors, the one that is there serves every place.
        """
        laws = self.forward.laws
        scales = laws.similarity
        if not any(scales.ratio_slopes(path, scales.values) for path in self.member.entries):
            return self
        laws = replace(laws, solver=laws.solver.with_tolerance(_COARSE), store=LawStore())
        return replace(self, forward=replace(self.forward, laws=laws), is_coarse=True)

    def _law_by(self, values: Mapping[str, float], deepest: float, solver: Solver) -> ContactLaw:
        """Law of another solver at `values` up to `deepest` (m), from the same store."""
        return self.forward.solved_by(solver).law(values, deepest)

    def part(self, physical: FloatArray, slopes: FloatArray, errors: tuple[KnownError, ...] = ()) -> Part:
        """Model about a physical vector (k,), whose slopes are dx/dq (k,); raises InputError without a law."""
        values = self.member.values_at(physical)
        entries = list(self.member.entries.values())
        reading, own = self.forward.jacobian(values, tuple(self.member.entries), rough=True)
        columns = np.zeros((len(self.force), len(physical) + len(errors)))
        columns[:, entries] = own * slopes[entries]
        # What a lever and a frame give goes by the model's forces: the measured ones bring their noise.
        bent = self.forward.lever_compliances(values) * reading.force + values[Frame.path] * reading.contact
        depth = self.forward.depth - values[ContactDepth.path] - bent
        deepest_of(depth)
        if errors:
            deepest = max(float(depth.max()), 0.0)
            pressed = Pressed(
                values,
                self.forward.law(values, deepest),
                depth,
                reading.contact,
                reading.stiffness,
                made=partial(self.member.scene_at, physical),
                by=partial(self._law_by, values, deepest),
            )
            columns[:, len(physical) :] = np.column_stack([error.column(pressed) for error in errors])
        scatter = self.member.scatter
        jacobian = columns / scatter
        offsets = Chain.of(values).offset_slopes(depth)
        still = [entry for path, entry in self.member.entries.items() if path in offsets]
        in_force = jacobian.copy()
        in_force[:, [*still, *range(len(physical), columns.shape[1])]] = 0.0
        return Part(
            (reading.force - self.force) / scatter,
            jacobian,
            reading.contact / scatter,
            depth,
            self.time,
            in_force,
            self.shapes,
        )


def clock_of(curve: Curve) -> FloatArray:
    """Times of the readings (s), (n,), increasing; their numbers where there are none."""
    if curve.time is not None and (np.diff(curve.time) > 0.0).all():
        return curve.time
    return np.arange(len(curve.depth), dtype=np.float64)
