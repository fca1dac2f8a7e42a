"""The forward model of one curve, compiled once: parameter values in, instrument readings out.

The tip's depth follows from the reading by the links of the instrument (`Chain`: contact depth, frame, baseline),
the force from the depth by a contact law and the sample's memory, and the force reading from that by the links
again. Laws are built for the reference scene of a `Similarity` and scaled (`laws.py`), so that a fit in which the
ratios of moduli and lengths stay fixed needs one law. Corrections for effects that a law neglects, where their
sizes are numbers of the scene, are added here (`LeftOutLaws`); what a layer changes in the law of linear elasticity
is in `on_law.py`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np

from underlay._arrays import ArrayLike, FloatArray
from underlay.errors import RangeError
from underlay.inference.model.law_slopes import STENCILS, LawSlopes, first_possible, force_scale
from underlay.inference.model.laws import LawSource, LawStore
from underlay.inference.model.on_law import OnLinear
from underlay.inference.model.similarity import Similarity, compile_similarity
from underlay.mechanics.contact_law import ContactLaw, ScaledLaw
from underlay.mechanics.discrepancy import DiscrepantLaw, excess_of, further_of, require_measured
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.response import (
    Elastic,
    History,
    Remembered,
    Response,
    WholeHistory,
    checked_times,
)
from underlay.mechanics.solver import Solver
from underlay.quantities import kind_of, replace_values
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH
from underlay.scene.instrument import FURTHER, SENSITIVITY_RATIO, SPRING_CONSTANT, Chain, ContactDepth, Frame
from underlay.scene.scene import Scene

# Largest depth at which a contact radius is looked up, over that of the curve; beyond it stays constant.
_FURTHER = 4.0
# Relative (of a ratio: absolute) step of a difference of laws, each right to 1e-6.
_STEP = 1e-3
# Parts of a scene that its laws know nothing of.
_READING = frozenset({"instrument", "lever"})


@dataclass(frozen=True)
class TipOverPowerLaw:
    """Approximate force of a sphere from that of its paraboloid: quicker to compute, for searches.

    The law of a power-law tip comes from tables. dP/dw, the slope of force P against depth w, depends on the
    contact radius alone, whatever the tip, and at one radius the depths and the forces of two tips have nearly the
    same ratio on every body. So the power law is evaluated where it has the tip's radius on a half-space, and its
    force multiplied by the ratio there. Of a sphere with a/R up to 0.7 (a the contact radius, R that of the tip)
    the force is off by up to 2 % where a/h is 0.7, by 4 % where it is 2, h the thickness (the ratio at one depth: 9
    and 12 %).

    Parameters
    ----------
    tip, power_law : Indenter
        The tip, and the power-law indenter used in its place.
    """

    tip: Indenter
    power_law: Indenter

    def seen(self, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depths (m) at which to evaluate the power law for depths (m) of the tip, and factors on its force.

        Both have the shape of `depth`; the factor is one out of contact. The power law's stiffness there is nearly
        that of the tip.
        """
        asked, ratio = np.array(depth), np.ones(depth.shape)
        touching = depth > 0.0
        w = depth[touching]
        radius = self.tip.halfspace_radius(w)
        same = self.power_law.abel(radius)
        asked[touching] = same
        ratio[touching] = self.tip.halfspace_force(w, radius) / self.power_law.halfspace_force(same, radius)
        return asked, ratio

    def stiffness(
        self, asked: FloatArray, ratio: FloatArray, force: FloatArray, stiffness: FloatArray
    ) -> FloatArray:
        """Derivative (N/m) of the tip's force in its depth, from the power law's force (N) and stiffness (N/m).

        `asked` (m) and `ratio` are what `seen` returned; all arrays have the same shape.
        """
        touching = asked > 0.0
        w, factor = asked[touching], ratio[touching]
        radius = self.power_law.halfspace_radius(w)
        share = factor * self.power_law.abel_slope(radius) / self.tip.abel_slope(radius)
        # The factor's own derivative: on a half-space both forces rise with 4 theta a.
        rising = radius * (1.0 - share) / self.power_law.halfspace_force(w, radius)
        slope = np.zeros(asked.shape)
        slope[touching] = share * stiffness[touching] + rising * force[touching]
        return slope

    def slope(self, path: str, slopes: LawSlopes) -> FloatArray:
        """Derivative (n,) of the tip's force in the parameter at `path` (SI), at fixed depths.

        `slopes` holds the tip's depths, and the law of the power-law indenter.
        """
        asked, ratio = self.seen(slopes.w)
        P, S, in_ratios = slopes.law.with_slopes(asked)
        inner = replace(slopes, w=asked, P=P, S=S, in_ratios=in_ratios)
        return np.asarray(ratio * inner.of(path))


class BuildsBare(Protocol):
    """Interface to laws of linear elasticity, without corrections for what they neglect: `Forward` has it."""

    @property
    def laws(self) -> LawSource:
        """Source of the contact laws."""

    def bare_law(self, values: Mapping[str, float], deepest: float) -> ContactLaw:
        """Law of linear elasticity at numbers `values` (SI, by path) for depths up to `deepest` (m)."""

    def solved_by(self, solver: Solver) -> Self:
        """Return the same model with laws of another solver."""


@dataclass(frozen=True)
class LeftOutLaws:
    """Corrections of a contact law for friction and finite strain, where their sizes are numbers of the scene.

    The force is P + s (P_stuck - P) + P (A e + B g). P and P_stuck are the forces of the frictionless and of the
    no-slip contact, s is the share of full friction, A and B the sizes of finite strain alone and of both effects
    together (`scene/discrepancy.py`). g is the measured function of both forces and the depth; e is that of depth
    over thickness and contact radius over tip radius. The radius is taken from the law of the scene's own ratios,
    scaled: where Poisson's ratio moves, e is off by less than a tenth of itself, and its size is known to a half.

    Parameters
    ----------
    values : mapping of path to float
        Every number of the scene (SI).
    deepest : float
        Depth (m) that the curve reaches.
    strains : bool
        Whether a size of finite strain, A or B, is not zero or may vary.
    """

    values: Mapping[str, float]
    deepest: float
    strains: bool

    @classmethod
    def of(cls, scene: Scene, depth: FloatArray, free: Collection[str]) -> Self:
        """Prepare the corrections for depth readings (m), (n,), when the parameters at the paths `free` vary.

        Raises
        ------
        InputError
            If finite strain has a size, or is free, and its effect has not been measured for this contact.
        """
        deepest = max(float(depth.max()) - scene.instrument.contact_depth, 0.0)
        values = scene.parameters
        strains = [path for path in (FINITE_STRAIN_PATH, BOTH_PATH) if values.get(path) or path in free]
        if strains:
            require_measured(scene.contact, deepest, strains[0])
        return cls(values, deepest, bool(strains))

    def law(self, forward: BuildsBare, values: Mapping[str, float], deepest: float) -> DiscrepantLaw:
        """Corrected law at numbers `values` (SI, by path) for depths up to `deepest` (m)."""
        free = forward.bare_law(values, deepest)
        sticks = self.sticking(forward).bare_law(values, deepest)

        def excess(depth: FloatArray) -> FloatArray:
            return self.excess(forward, values, depth)

        def further(stuck: FloatArray, slides: FloatArray, depth: FloatArray) -> FloatArray:
            return self.further(values, stuck, slides, depth)

        sizes = (values[FRICTION_PATH], values[FINITE_STRAIN_PATH], values[BOTH_PATH])
        return DiscrepantLaw.of(free, sticks, sizes, excess, further)

    @staticmethod
    def sticking(forward: BuildsBare) -> BuildsBare:
        """Return the same model with laws of a no-slip contact."""
        return forward.solved_by(forward.laws.solver.without_slip)

    def slope(self, forward: BuildsBare, path: str, slopes: LawSlopes) -> FloatArray:
        """Derivative (n,) of the force in the parameter at `path` (SI), at fixed tip depths."""
        values, deepest, w = slopes.values, slopes.deepest, slopes.w
        law = self.law(forward, values, deepest)
        if law.sticks is not None and path == FRICTION_PATH:
            return np.asarray(law.sticks.force(w) - law.free.force(w))
        if path == FINITE_STRAIN_PATH:
            return np.asarray(law.free.force(w) * law.excess(w))
        if law.sticks is not None and path == BOTH_PATH:
            slides = law.free.force(w)
            return np.asarray(slides * law.further(law.sticks.force(w), slides, w))
        size = _STEP if kind_of(path) == "dimensionless" else _STEP * abs(values[path])

        def force(steps: float) -> FloatArray:
            return self.law(forward, {**values, path: values[path] + steps * size}, deepest).force(w)

        return np.asarray(first_possible(force, STENCILS) / size)

    def excess(self, forward: BuildsBare, values: Mapping[str, Any], depth: FloatArray) -> FloatArray:
        """Relative excess e of the force by finite strain at depths (m), (n,).

        (sets, n) for many parameter sets, whose varying numbers in `values` are (sets, 1).
        """
        if not self.strains:
            return np.zeros_like(depth)
        own = self.values
        tip, h = values["indenter.radius"], values.get("layer.thickness", np.inf)
        # Contacts are similar at equal w R/h^2 on a layer, and at equal w/R on a half-space, w being the depth.
        layered = np.isfinite(own.get("layer.thickness", np.inf))
        length = h / own["layer.thickness"] if layered else tip / own["indenter.radius"]
        stretch = length**2 / (tip / own["indenter.radius"])
        law = self._known(forward)
        inside = np.clip(depth / stretch, 0.0, law.max_depth)
        return excess_of(values["layer.nu"], depth / h, length * law.contact_radius(inside) / tip)

    def further(
        self, values: Mapping[str, Any], sticks: FloatArray, free: FloatArray, depth: FloatArray
    ) -> FloatArray:
        """Function g, by which friction and finite strain act together, at depths (m) with the forces (N) there.

        `sticks` and `free` are the forces of the no-slip and the frictionless contact. All are (n,), or (sets, n)
        where the numbers in `values` are (sets, 1).
        """
        if not self.strains:
            return np.zeros_like(depth)
        return further_of(
            sticks, free, depth, values["indenter.radius"], values.get("layer.thickness", np.inf)
        )

    def _known(self, forward: BuildsBare) -> ContactLaw:
        """Law of the scene's own numbers, always built up to the same depth, whatever is asked of it."""
        deepest = max(_FURTHER * self.deepest, np.finfo(float).tiny)
        try:
            return forward.bare_law(self.values, deepest)
        except RangeError as error:
            return forward.bare_law(self.values, error.max_depth or self.deepest)


@dataclass(frozen=True)
class Reading:
    """Prediction of the forward model for one curve at one set of parameters.

    Parameters
    ----------
    contact : FloatArray
        Contact force P (N), (n,).
    stiffness : FloatArray
        Its derivative dP/dw (N/m) in the tip's depth w, (n,).
    force : FloatArray
        Force reading of the instrument (N), (n,).
    is_rough : bool
        Whether derivatives computed with it are less exact ones (`Forward.jacobian`).
    """

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray
    is_rough: bool = False


@dataclass(frozen=True)
class Forward:
    """The forward model of one scene at the depth readings of one curve.

    Parameters
    ----------
    similarity : Similarity
        Scaling of the laws, compiled from the scene.
    depth : FloatArray
        Depth readings (m), (n,); or, in batches only, those of every parameter set, (sets, n).
    laws : LawSource
        Source of its contact laws.
    history : History or None
        Memory of the sample (viscoelastic, poroelastic).
    time : FloatArray or None
        Times of the readings (s), (n,), for a sample with memory.
    bending : FloatArray or None
        Deflection of the cantilever that was subtracted from the depth readings (m), (n,).
    left_out : LeftOutLaws, OnLinear or None
        Corrections of the law of linear elasticity, where their sizes are numbers of the scene.
    is_rigid : bool
        Whether the depths are already without the cantilever's further bending: in batches only.
    over : TipOverPowerLaw or None
        The tip, where the laws are those of its power law: for searches, and in `jacobian` only.
    """

    similarity: Similarity
    depth: FloatArray
    laws: LawSource
    history: History | None = None
    time: FloatArray | None = None
    bending: FloatArray | None = None
    left_out: LeftOutLaws | OnLinear | None = None
    is_rigid: bool = False
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

        Laws come from `solver` and are kept in `store`. A scene with a cantilever needs the `force` readings (N),
        (n,), too.
        """
        elastic = scene.elastic
        if elastic.discrepancy is not None:
            elastic = replace(elastic, discrepancy=None)
        if elastic.layer.linear is not elastic.layer:
            elastic = replace(elastic, layer=elastic.layer.linear)
        reference = tuple(
            getattr(elastic, name) for name in elastic.__dataclass_fields__ if name not in _READING
        )
        if isinstance(scene.memory, WholeHistory):
            free = [path for path in free if path in elastic.parameters]
        similarity = compile_similarity(elastic, free, scaling=solver.scaling)
        laws = LawSource.of(similarity, reference, free, solver, store)
        left_out: LeftOutLaws | OnLinear | None = None
        if scene.discrepancy is not None:
            left_out = LeftOutLaws.of(scene, depth, free)
        elif scene.layer.linear is not scene.layer:
            left_out = OnLinear.of(scene, similarity.gain)
        timed = time if scene.memory is not None else None
        lever = similarity.scene.lever
        bending = None if lever is None or force is None else lever.bending(force)
        return cls(similarity, depth, laws, scene.memory, timed, bending, left_out)

    def solved_by(self, solver: Solver) -> Forward:
        """Return the model with laws of another solver that scale in the same way, stored apart from its own."""
        return replace(self, laws=replace(self.laws, solver=solver, table=None, tips=None, slope_ratios=()))

    def moved(self, depth: FloatArray, force: FloatArray, laws: LawSource | None = None) -> Forward:
        """Return the model for other depth readings (m) and force readings (N), each (n,).

        `laws` replaces the source of its laws, if given.
        """
        lever = self.similarity.scene.lever
        bending = None if lever is None else lever.bending(force)
        return replace(self, depth=depth, bending=bending, laws=laws or self.laws)

    def of_set(self, row: int) -> Forward:
        """Return the model for the depths of one parameter set, where every set has its own, (sets, n)."""
        return self if self.depth.ndim == 1 else replace(self, depth=self.depth[row])

    def depth_at(self, values: Mapping[str, Any]) -> FloatArray:
        """Depth readings (m) corrected for the cantilever's sensitivity in `values`, from the measured forces.

        (n,), or (sets, n) where numbers are (sets, 1). The measured forces bring their noise along, so this only
        starts a search; `reading` uses the model's own force.
        """
        if self.bending is None:
            return self.depth
        return np.asarray(self.depth - (values[SENSITIVITY_RATIO] - 1.0) * self.bending)

    def law(self, values: Mapping[str, float], deepest: float) -> ContactLaw:
        """Contact law at `values` (every number of the scene, SI) for tip depths up to `deepest` (m).

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
        """Law of linear elasticity at `values`, without corrections for what it neglects; raises as `law` does."""
        b, c = self.similarity.factors(values)
        law = self.reference_law(self.similarity.reduced(values), b * deepest)
        return ScaledLaw.of(law, b, c, self.similarity.length_ratio(values))

    def law_behind(self, values: Mapping[str, float]) -> ContactLaw:
        """Contact law of the reading at `values`, for its error estimate and its validity warnings.

        Raises as `law` does.
        """
        if isinstance(self.left_out, OnLinear):
            return self.law(values, self._deepest(*self._chain(values)))
        b, _ = self.similarity.factors(values)
        return self.laws.for_statements(
            self.similarity.reduced(values), b * self._deepest(*self._chain(values))
        )

    def reading(self, values: Mapping[str, float], *, stiffness: bool = True) -> Reading:
        """Contact force, stiffness and force reading at every depth reading; raises as `law` does.

        `values` are all numbers of the scene (SI) by path. Without `stiffness` it is left zero.
        """
        chain, depth = self._chain(values)
        if isinstance(self.history, WholeHistory):
            return self._whole(self.history.at(values), chain, stiffness=stiffness)
        law = self.law(values, self._deepest(chain, depth))
        w = self._tip_depth(chain, law, depth)
        if self.history is None and stiffness:
            contact, slope = law.force_and_stiffness(w)
        else:
            pressed: Response = law
            if self.history is not None:
                pressed = self._remembered(law, self.history, values)
            contact = pressed.force(w, self.time)
            slope = law.stiffness(w) if stiffness else np.zeros_like(contact)
        return Reading(contact, slope, chain.reading(contact, self.depth))

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], *, rough: bool = False
    ) -> tuple[Reading, FloatArray]:
        """Model, and the derivative of its force reading in each parameter (SI) at `paths`, shape (n, k).

        Every link of the instrument gives its own derivative (`Chain`); what moves the law's force is passed
        through the links after it. With `rough`, derivatives in ratios of moduli and lengths come from one further
        law instead of two: off by 1e-3 of themselves, which does not slow a minimiser.
        """
        chain, depth = self._chain(values, paths)
        if isinstance(self.history, WholeHistory):
            return self._whole_jacobian(self.history.at(values), chain, paths)
        deepest = self._deepest(chain, depth)
        law = self.law(values, deepest)
        w = self._tip_depth(chain, law, depth)
        P, S, in_ratios = self._with_slopes(law, w)
        columns = chain.offset_slopes(self.depth)
        if beyond := self._lever_compliance(values):
            kept = 1.0 - beyond * chain.at_fixed_travel(S, S)
            columns = {path: column * kept for path, column in columns.items()}
        slopes = LawSlopes(self.similarity, self.laws, values, law, deepest, w, P, S, in_ratios, rough)
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

    def _whole(self, history: WholeHistory, chain: Chain, *, stiffness: bool = True) -> Reading:
        """Reading of a sample whose memory gives the force of a whole motion itself, without a frame in series."""
        w = chain.travel(self.depth)
        contact = history.answer(w, checked_times(self.time, w))
        slope = history.stiffness(w, contact) if stiffness else np.zeros_like(contact)
        return Reading(contact, slope, chain.reading(contact, self.depth))

    def _whole_jacobian(
        self, history: WholeHistory, chain: Chain, paths: Sequence[str]
    ) -> tuple[Reading, FloatArray]:
        """`jacobian` of a sample whose memory gives the force of a whole motion itself."""
        reading, columns = self._whole(history, chain), chain.offset_slopes(self.depth)
        own = [path for path in paths if path not in columns]
        w = chain.travel(self.depth)
        columns |= history.slopes(own, w, checked_times(self.time, w))
        return reading, np.stack([columns[path] for path in paths], axis=1)

    def _with_slopes(self, law: ContactLaw, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        if self.over is None:
            return law.with_slopes(w)
        asked, ratio = self.over.seen(w)
        P, S, in_ratios = law.with_slopes(asked)
        return ratio * P, self.over.stiffness(asked, ratio, P, S), in_ratios

    def _remembered(self, law: Response, history: History, values: Mapping[str, float]) -> Remembered:
        """The elastic law combined with the memory, whose numbers are taken from `values`."""
        own = {path: value for path, value in values.items() if self._remembers(path)}
        return Remembered(law, replace_values(history, own, history.prefix))

    def _remembers(self, path: str) -> bool:
        """Whether the parameter at `path` is one of the sample's memory."""
        return self.history is not None and path.startswith(f"{self.history.prefix}.")

    def _slope(self, path: str, slopes: LawSlopes) -> FloatArray:
        """Derivative (n,) of the contact force in the parameter at `path` (SI), at fixed depth of the tip."""
        if self.left_out is not None:
            return self.left_out.slope(self, path, slopes)
        return slopes.of(path) if self.over is None else self.over.slope(path, slopes)

    def _through_history(
        self, history: History, slopes: LawSlopes, paths: Sequence[str], columns: dict[str, FloatArray]
    ) -> FloatArray:
        """Force (N), (n,), of the sample with memory; its derivatives at `paths` are added to `columns`.

        The derivatives of the elastic law are passed through the memory as its force is.
        """
        values, w, law = slopes.values, slopes.w, slopes.law
        history, time = self._remembered(law, history, values).history, checked_times(self.time, w)
        through, kept = history.prepared(w, time), _Kept(law)
        force = through(kept.force)

        def slope(path: str) -> Elastic:
            def of(x: FloatArray) -> FloatArray:
                P, S, in_ratios = kept.with_slopes(x)
                return self._slope(path, replace(slopes, w=x, P=P, S=S, in_ratios=in_ratios))

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
        """Links of the instrument at `values`, and the depth readings (m), (n,), to start from.

        A cantilever's bending beyond what was subtracted from the depths follows the model's force, as a frame's
        compliance does. With the measured force its noise would be in the depth too, and more of it taken for
        bending makes residuals smaller: each reading pulls at the sensitivity by its share of stiffness, dP/dw / k,
        with P the force, w the tip's depth and k the spring constant.
        """
        chain, beyond = Chain.of(values, free), self._lever_compliance(values)
        if not beyond:
            return chain, self.depth
        offset = chain.reading(np.zeros_like(self.depth), self.depth)
        return chain.with_compliance(values[Frame.path] + beyond), self.depth - beyond * offset

    def _lever_compliance(self, values: Mapping[str, float]) -> float:
        """Compliance (sigma - 1) / k (m/N) that a cantilever adds if its sensitivity is off; zero without one.

        sigma is the ratio of the true sensitivity to the calibrated one and k the spring constant.
        """
        return float(self.lever_compliances(values))

    def lever_compliances(self, values: Mapping[str, Any]) -> Any:  # a number, or one per set
        """Compliance (sigma - 1) / k (m/N) that a cantilever adds if its sensitivity is off, of each parameter set.

        sigma is the ratio of the true sensitivity to the calibrated one and k the spring constant; zero without a
        cantilever.
        """
        if self.similarity.scene.lever is None or self.is_rigid:
            return 0.0
        return (values[SENSITIVITY_RATIO] - 1.0) / values[SPRING_CONSTANT]

    def bends(self, values: Mapping[str, Any]) -> bool:
        """Whether the cantilever bends by other than what was subtracted from the depths, in any parameter set."""
        return bool(np.any(self.lever_compliances(values)))

    def _tip_depth(self, chain: Chain, law: Response, depth: FloatArray) -> FloatArray:
        """Depth of the tip (m) at depth readings (m), (n,).

        Raises RangeError where the cantilever would give way faster than the sample resists.
        """
        w = chain.tip_depth(law, depth)
        if chain.frame is not None and chain.frame.compliance < 0.0:
            chain.frame.require_standing(law.stiffness(w))
        return w

    def _deepest(self, chain: Chain, depth: FloatArray) -> float:
        """Largest tip depth (m) that a law must reach for the readings (m)."""
        deepest = max(float(chain.travel(np.asarray(depth.max()))), 0.0)
        return FURTHER * deepest if chain.frame is not None and chain.frame.compliance < 0.0 else deepest

    def reference_law(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law of the reference scene with ratios `reduced` (see `Similarity.reduced`), up to `depth` (m) there."""
        return self.laws.law(reduced, depth)


class _Kept(Response):
    """A law that keeps its results at depths already computed: several derivatives need the same ones."""

    def __init__(self, law: ContactLaw) -> None:
        self.law, self.max_depth = law, law.max_depth
        self._answers: dict[bytes, tuple[FloatArray, FloatArray, FloatArray]] = {}

    def with_slopes(self, depth: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Force (N), stiffness (N/m) and further derivatives at depths (m), as `ContactLaw.with_slopes`."""
        key = depth.tobytes()
        if key not in self._answers:
            self._answers[key] = self.law.with_slopes(depth)
        return self._answers[key]

    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force (N), (n,), at depths (m)."""
        del time
        return self.with_slopes(np.asarray(depth))[0]

    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Stiffness dP/dw (N/m), (n,), at depths (m)."""
        del time
        return self.with_slopes(np.asarray(depth))[1]
