"""The forward model of one curve, compiled once: parameter values in, instrument readings out.

Laws belong to the reference of a `Similarity` (`laws.py`), so that a fit in which the ratios stay put needs one
law.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from underlay._arrays import ArrayLike, FloatArray
from underlay.inference.model.law_slopes import LawSlopes, force_scale
from underlay.inference.model.laws import LawSource, LawStore
from underlay.inference.model.left_out_laws import LeftOutLaws
from underlay.inference.model.similarity import Similarity, compile_similarity
from underlay.inference.model.tip_over_power_law import TipOverPowerLaw
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.response import Elastic, History, Remembered, Response, checked_times
from underlay.mechanics.scaled_law import ScaledLaw
from underlay.mechanics.solver import Solver
from underlay.quantities import replace_values
from underlay.scene.chain import Chain, ContactDepth, Frame
from underlay.scene.lever import FURTHER, SENSITIVITY_RATIO, SPRING_CONSTANT
from underlay.scene.scene import Scene

__all__ = ["Forward", "Reading"]

# Parts of a scene that its laws know nothing of.
_READING = frozenset({"instrument", "lever"})


@dataclass(frozen=True)
class Reading:
    """Contact force P (N), its stiffness dP/dw (N/m) and the instrument's force (N), each (n,).

    And whether derivatives that came along are rough ones (`Forward.jacobian`).
    """

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray
    is_rough: bool = False


@dataclass(frozen=True)
class Forward:
    """One scene, the depth readings of one curve, and what may vary.

    Parameters
    ----------
    similarity : Similarity
        Compiled from the scene.
    depth : FloatArray
        Depth readings (m), (n,); or, for a batch alone, those of every set, (sets, n).
    laws : LawSource
        Where its laws come from.
    history : History or None
        What the sample remembers.
    time : FloatArray or None
        Times of the readings (s), (n,), for a sample that remembers.
    bending : FloatArray or None
        What was taken off the depth readings for the bending of a lever (m), (n,).
    left_out : LeftOutLaws or None
        What the law leaves out, where its sizes are numbers of the scene.
    is_unbent : bool
        Whether the depths are without what a lever bends beyond what was taken off: of a batch alone.
    over : TipOverPowerLaw or None
        The tip, where the laws are those of its power law: to search with, and for `jacobian` alone.
    """

    similarity: Similarity
    depth: FloatArray
    laws: LawSource
    history: History | None = None
    time: FloatArray | None = None
    bending: FloatArray | None = None
    left_out: LeftOutLaws | None = None
    is_unbent: bool = False
    over: TipOverPowerLaw | None = None

    @classmethod
    def compile(
        cls,
        scene: Scene,
        depth: FloatArray,
        free: Sequence[str],
        solver: Solver,
        store: LawStore,
        time: FloatArray | None = None,
        force: FloatArray | None = None,
    ) -> Forward:
        """Compile `scene` for readings `depth` (m) at `time` (s) when the parameters at the paths `free` vary.

        A lever is told the `force` readings (N), (n,).
        """
        elastic = scene.elastic
        if elastic.discrepancy is not None:
            elastic = replace(elastic, discrepancy=None)
        reference = tuple(
            getattr(elastic, name) for name in elastic.__dataclass_fields__ if name not in _READING
        )
        similarity = compile_similarity(elastic, free, scaling=solver.scaling)
        laws = LawSource.of(similarity, reference, free, solver, store)
        told = None if scene.discrepancy is None else LeftOutLaws.of(scene, depth, free)
        timed = time if scene.memory is not None else None
        lever = similarity.scene.lever
        bending = None if lever is None or force is None else lever.bending(force)
        return cls(similarity, depth, laws, scene.memory, timed, bending, told)

    def solved_by(self, solver: Solver) -> Forward:
        """Return the same with laws of another solver that scale alike, kept beside its own."""
        return replace(self, laws=replace(self.laws, solver=solver, table=None, tips=None, beside=()))

    def moved(self, depth: FloatArray, force: FloatArray, laws: LawSource | None = None) -> Forward:
        """Return the same for other depth readings (m), force readings (N), (n,), and `laws`, if given."""
        lever = self.similarity.scene.lever
        bending = None if lever is None else lever.bending(force)
        return replace(self, depth=depth, bending=bending, laws=laws or self.laws)

    def of_set(self, row: int) -> Forward:
        """Return the same for the depths of one set, where every set has its own, (sets, n)."""
        return self if self.depth.ndim == 1 else replace(self, depth=self.depth[row])

    def depth_at(self, values: Mapping[str, Any]) -> FloatArray:
        """Depth readings (m) by the lever's sensitivity in `values`: (n,), or (sets, n) of numbers (sets, 1).

        By the measured forces, noise and all: a search begins with it, `reading` asks the model's own force.
        """
        if self.bending is None:
            return self.depth
        return np.asarray(self.depth - (values[SENSITIVITY_RATIO] - 1.0) * self.bending)

    def law(self, values: Mapping[str, float], deepest: float) -> ContactLaw:
        """Law at `values` (every number of the scene, SI) for tip depths up to `deepest` (m).

        Raises
        ------
        InputError
            If the values are not those of a possible scene, or the law does not reach that deep.
        """
        return (
            self.bare_law(values, deepest)
            if self.left_out is None
            else self.left_out.law(self, values, deepest)
        )

    def bare_law(self, values: Mapping[str, float], deepest: float) -> ScaledLaw:
        """Return the same without what it leaves out; raises as `law` does."""
        b, c = self.similarity.factors(values)
        law = self.reference_law(self.similarity.reduced(values), b * deepest)
        return ScaledLaw.of(law, b, c, self.similarity.length_ratio(values))

    def prepare(self, values: Sequence[Mapping[str, float]]) -> None:
        """Make ready the laws at several sets of `values`, as `LawSource.laws_of` does."""
        depths = [self.similarity.factors(one)[0] * self._deepest(*self._chain(one)) for one in values]
        self.laws.laws_of([self.similarity.reduced(one) for one in values], depths)

    def is_tabulated(self, values: Mapping[str, float]) -> bool:
        """Whether the law at `values` is read off a table, and says its derivatives itself."""
        b, _ = self.similarity.factors(values)
        return self.laws.is_tabulated(
            self.similarity.reduced(values), b * self._deepest(*self._chain(values))
        )

    def law_behind(self, values: Mapping[str, float]) -> ContactLaw:
        """Law that the reading at `values` comes from, for what it says of itself; raises as `law` does."""
        b, _ = self.similarity.factors(values)
        return self.laws.for_statements(
            self.similarity.reduced(values), b * self._deepest(*self._chain(values))
        )

    def reading(self, values: Mapping[str, float], *, stiffness: bool = True) -> Reading:
        """Force and stiffness at every reading; raises as `law` does.

        Without `stiffness` a sample that remembers is not asked for it: it is zero.
        """
        chain, depth = self._chain(values)
        law = self.law(values, self._deepest(chain, depth))
        w = self._tip_depth(chain, law, depth)
        if self.history is not None:
            contact = self._remembered(law, self.history, values).force(w, self.time)
            slope = law.stiffness(w) if stiffness else np.zeros_like(contact)
            return Reading(contact, slope, chain.reading(contact, self.depth))
        contact, slope = law.force_and_stiffness(w)
        return Reading(contact, slope, chain.reading(contact, self.depth))

    def force(self, values: Mapping[str, float]) -> FloatArray:
        """Force of the instrument (N), (n,), alone; raises as `law` does."""
        chain, depth = self._chain(values)
        law: Response = self.law(values, self._deepest(chain, depth))
        w = self._tip_depth(chain, law, depth)
        if self.history is not None:
            law = self._remembered(law, self.history, values)
        return chain.reading(law.force(w, self.time), self.depth)

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], *, rough: bool = False
    ) -> tuple[Reading, FloatArray]:
        """Reading, and the derivative of its force in each parameter (SI) at `paths`, shape (n, k).

        Every link says its own (`chain.py`); what moves the law's force goes through the links behind it. A
        `rough` derivative takes its ratios from one further law instead of two: off by 1e-3 of itself, which
        costs a minimiser nothing.
        """
        chain, depth = self._chain(values, paths)
        deepest = self._deepest(chain, depth)
        law = self.law(values, deepest)
        w = self._tip_depth(chain, law, depth)
        P, S, told = self._with_slopes(law, w)
        columns = chain.offset_slopes(self.depth)
        if beyond := self._lever_compliance(values):
            kept = 1.0 - beyond * chain.at_fixed_travel(S, S)
            columns = {path: column * kept for path, column in columns.items()}
        slopes = LawSlopes(self.similarity, self.laws, values, law, deepest, w, P, S, told, rough)
        if self.history is not None:
            P = self._through_history(self.history, slopes, paths, columns)
        for path in paths:
            if path in columns:
                continue
            if path == ContactDepth.path:
                columns[path] = chain.at_fixed_travel(-S, S)
            elif path == Frame.path:
                columns[path] = chain.at_fixed_travel(-P * S, S)
            else:
                columns[path] = chain.at_fixed_travel(self._slope(path, slopes), S)
        if SENSITIVITY_RATIO in paths:
            bending = chain.reading(P, self.depth) / values[SPRING_CONSTANT]
            columns[SENSITIVITY_RATIO] = columns[SENSITIVITY_RATIO] - chain.at_fixed_travel(S * bending, S)
        reading = Reading(P, S, chain.reading(P, self.depth), slopes.are_rough)
        rows = np.empty((len(paths), len(w)))
        for row, path in enumerate(paths):
            rows[row] = columns[path]
        return reading, rows.T

    def _with_slopes(self, law: ContactLaw, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        if self.over is None:
            return law.with_slopes(w)
        asked, ratio = self.over.seen(w)
        P, S, told = law.with_slopes(asked)
        return ratio * P, self.over.stiffness(asked, ratio, P, S), told

    def _remembered(self, law: Response, history: History, values: Mapping[str, float]) -> Remembered:
        """The law seen through the history with the numbers of `values`."""
        own = {path: value for path, value in values.items() if self._remembers(path)}
        return Remembered(law, replace_values(history, own, history.prefix))

    def _remembers(self, path: str) -> bool:
        """Whether a number is one of the history."""
        return self.history is not None and path.startswith(f"{self.history.prefix}.")

    def _slope(self, path: str, slopes: LawSlopes) -> FloatArray:
        """dP/dp (n,) at fixed depth of the tip."""
        if self.left_out is not None:
            return self.left_out.slope(self, path, slopes.values, slopes.deepest, slopes.w)
        return slopes.of(path) if self.over is None else self.over.slope(path, slopes)

    def _through_history(
        self, history: History, slopes: LawSlopes, paths: Sequence[str], columns: dict[str, FloatArray]
    ) -> FloatArray:
        """Force (N), (n,), that a history makes of the law's; its derivatives are added to `columns`.

        The law's own derivatives go through the history as the law's force does.
        """
        values, w, law = slopes.values, slopes.w, slopes.law
        history, time = self._remembered(law, history, values).history, checked_times(self.time, w)
        through, kept = history.prepared(w, time), _Kept(law)
        force = through(kept.force)

        def slope(path: str) -> Elastic:
            def of(x: FloatArray) -> FloatArray:
                P, S, told = kept.with_slopes(x)
                return self._slope(path, replace(slopes, w=x, P=P, S=S, told=told))

            return of

        own = [path for path in paths if self._remembers(path)]
        columns |= through.slopes(own, kept)
        for path in paths:
            if path == ContactDepth.path and path not in columns:
                columns[path] = through(lambda x: -kept.stiffness(x))
            elif path not in columns:
                scale = force_scale(self.similarity, path, values)
                columns[path] = through(slope(path)) if scale is None else scale * force
        return force

    def _chain(self, values: Mapping[str, float], free: Sequence[str] = ()) -> tuple[Chain, FloatArray]:
        """Links of `values`, and the readings (m) that they are asked for.

        What a lever bends beyond what was taken off goes with the model's reading, as a frame's compliance does.
        With the measured one its noise would be in the depth too, and more of it taken for bending makes residuals
        smaller: each reading pulls at the sensitivity by its share of stiffness, dP/dw / k.
        """
        chain, beyond = Chain.of(values, free), self._lever_compliance(values)
        if not beyond:
            return chain, self.depth
        offset = chain.reading(np.zeros_like(self.depth), self.depth)
        return chain.with_compliance(values[Frame.path] + beyond), self.depth - beyond * offset

    def _lever_compliance(self, values: Mapping[str, float]) -> float:
        """(sigma - 1) / k (m/N) of a lever whose sensitivity is off; zero without one."""
        return float(self.lever_compliances(values))

    def lever_compliances(self, values: Mapping[str, Any]) -> Any:  # a number, or one per set
        """(sigma - 1) / k (m/N) of a lever whose sensitivity is off, of each set of numbers; zero without one."""
        if self.similarity.scene.lever is None or self.is_unbent:
            return 0.0
        return (values[SENSITIVITY_RATIO] - 1.0) / values[SPRING_CONSTANT]

    def bends(self, values: Mapping[str, Any]) -> bool:
        """Whether a lever bends otherwise than what was taken off, in any set of numbers."""
        return bool(np.any(self.lever_compliances(values)))

    def _tip_depth(self, chain: Chain, law: Response, depth: FloatArray) -> FloatArray:
        """Depth of the tip (m) at readings (m); raises RangeError where a lever gives way."""
        w = chain.tip_depth(law, depth)
        if chain.frame is not None and chain.frame.compliance < 0.0:
            chain.frame.require_standing(law.stiffness(w))
        return w

    def _deepest(self, chain: Chain, depth: FloatArray) -> float:
        """Largest depth (m) that a law is asked for at readings (m)."""
        deepest = max(float(chain.travel(np.asarray(depth.max()))), 0.0)
        return FURTHER * deepest if chain.frame is not None and chain.frame.compliance < 0.0 else deepest

    def reference_law(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law at the reference with these ratios, for its depths up to `depth` (m)."""
        return self.laws.law(reduced, depth)


class _Kept(Response):
    """A law that remembers what it answered to the depths asked last: several derivatives ask the same."""

    def __init__(self, law: ContactLaw) -> None:
        self.law, self.max_depth = law, law.max_depth
        self._answers: dict[bytes, tuple[FloatArray, FloatArray, FloatArray]] = {}

    def with_slopes(self, depth: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `ContactLaw.with_slopes`."""
        key = depth.tobytes()
        if key not in self._answers:
            self._answers[key] = self.law.with_slopes(depth)
        return self._answers[key]

    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force (N), (n,)."""
        del time
        return self.with_slopes(np.asarray(depth))[0]

    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Stiffness (N/m), (n,)."""
        del time
        return self.with_slopes(np.asarray(depth))[1]
