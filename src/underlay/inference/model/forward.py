"""The forward model of one curve, compiled once: parameter values in, instrument readings out.

Laws are built at the reference of a `Similarity` and kept in a `LawStore`, so that a fit in which the ratios
stay put builds one law. The range of a stored law is its needed depth rounded up to a power of two: the
reading is then a function of the parameters alone, not of what was asked before. Where only the ratio of two
moduli varies, laws are read off the tables of `curve_family`.
"""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError, UnderlayWarning
from underlay.inference.model.similarity import Similarity, compile_similarity
from underlay.mechanics.accuracy import Accuracy
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.curve_family import range_number
from underlay.mechanics.exact.family_law import FamilyLaw, tabulated_law
from underlay.mechanics.indenters import FlatPunch, PowerLawShape
from underlay.mechanics.materials import Isotropic, Rigid
from underlay.mechanics.published import published_names
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene

__all__ = ["Forward", "LawOptions", "LawStore", "Reading"]

# Differences of laws in ln k and in Poisson's ratio: central, so the truncation is 1e-7 to 1e-6 of the
# derivative, and a law's own error of 1e-6 enters with 1e-3.
_RATIO_STEP = 1e-3
_STENCIL_RTOL = 1e-6
_LAWS_KEPT = 64


@dataclass(frozen=True)
class LawOptions:
    """How laws are built: the keywords of `Scene.contact_law`."""

    accuracy: Accuracy | None = None
    method: str = "auto"
    order: int = 4
    form: str = "auto"

    def build(self, scene: Scene, max_depth: float) -> ContactLaw:
        """Build the law of `scene` up to `max_depth` (m).

        A published correction warns where it leaves its range; a fit passes through such places and reports
        only those of its result, which the law carries itself.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnderlayWarning)
            return scene.contact_law(
                max_depth, accuracy=self.accuracy, method=self.method, order=self.order, form=self.form
            )


@dataclass
class LawStore:
    """The laws built last, or why one could not be, and what is compiled for batches; `built` counts laws.

    Owned by one problem.
    """

    laws: OrderedDict[tuple[object, ...], ContactLaw | RangeError] = field(default_factory=OrderedDict)
    references: list[Scene] = field(default_factory=list)
    refusals: dict[tuple[object, ...], RangeError] = field(default_factory=dict)
    batches: dict[tuple[object, ...], ExactBatch | None] = field(default_factory=dict)
    built: int = 0

    def number(self, reference: Scene) -> int:
        """Short name of a reference scene: equal ones share their laws."""
        if reference not in self.references:
            self.references.append(reference)
        return self.references.index(reference)

    def get(self, key: tuple[object, ...]) -> ContactLaw | RangeError | None:
        """Return a kept law, or None."""
        return self.laws.get(key)

    def keep(self, key: tuple[object, ...], law: ContactLaw | RangeError) -> ContactLaw | RangeError:
        """Keep a law; the oldest goes."""
        self.built += 1
        self.laws[key] = law
        if len(self.laws) > _LAWS_KEPT:
            self.laws.popitem(last=False)
        return law


@dataclass(frozen=True)
class Reading:
    """Contact force P (N), its stiffness dP/dw (N/m) and the instrument's force (N), each (n,)."""

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class ScaledLaw:
    """A reference law seen through the factors of `Similarity`: P(w) = c P_ref(b w)."""

    law: ContactLaw
    b: float
    c: float

    @property
    def max_depth(self) -> float:
        """Largest depth (m)."""
        return self.law.max_depth / self.b

    def force(self, depth: FloatArray) -> FloatArray:
        """P (N), shape of `depth` (m)."""
        return self.c * self.law.force(self.b * depth)

    def stiffness(self, depth: FloatArray) -> FloatArray:
        """dP/dw (N/m), shape of `depth` (m)."""
        return (self.b * self.c) * self.law.stiffness(self.b * depth)

    def ratio_slope(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """dP/d ln k (N) of a law from a table, where the force (N) at `depth` (m) is `force`."""
        if not isinstance(self.law, FamilyLaw):
            raise TypeError(f"a law by {self.law.method!r} has no derivative in the ratio of moduli")
        return self.law.ratio_slope(self.b * depth, force)


@dataclass(frozen=True)
class Forward:
    """One scene, the depth readings of one curve, and what may vary.

    Parameters
    ----------
    similarity : Similarity
        Compiled from the scene.
    depth : FloatArray
        Depth readings (m), (n,).
    options : LawOptions
        How laws are built.
    store : LawStore
        Where they are kept.
    number : int
        Name of the reference in the store.
    tabulated : bool
        Whether nothing but the ratio of two isotropic moduli can change the law of a power-law tip, and the
        exact law is allowed: it is then read off a table.
    """

    similarity: Similarity
    depth: FloatArray
    options: LawOptions
    store: LawStore
    number: int
    tabulated: bool

    @classmethod
    def compile(
        cls, scene: Scene, depth: FloatArray, free: Sequence[str], options: LawOptions, store: LawStore
    ) -> Forward:
        """Compile `scene` for readings `depth` (m) when the parameters at the paths `free` vary."""
        reference = replace(scene, instrument=Instrument())
        similarity = compile_similarity(scene, free, power_law=options.method not in published_names())
        tabulated = _can_be_tabulated(similarity, free, options)
        return cls(similarity, depth, options, store, store.number(reference), tabulated)

    def law(self, values: Mapping[str, float], deepest: float) -> ScaledLaw:
        """Law at `values` (every number of the scene, SI) for tip depths up to `deepest` (m).

        Raises
        ------
        InputError
            If the values are not those of a possible scene, or the law does not reach that deep.
        """
        b, c = self.similarity.factors(values)
        return ScaledLaw(self.reference_law(self.similarity.reduced(values), b * deepest), b, c)

    def law_behind(self, values: Mapping[str, float]) -> ContactLaw:
        """Reference law that the reading at `values` comes from; raises as `law` does."""
        return self.law(values, self._deepest(_instrument(values))).law

    def reading(self, values: Mapping[str, float]) -> Reading:
        """Force and stiffness at every reading; raises as `law` does."""
        instrument = _instrument(values)
        law = self.law(values, self._deepest(instrument))
        # `tip_depth` asks a law for force, stiffness and max_depth, which a scaled law has.
        w = instrument.tip_depth(law, self.depth)  # type: ignore[arg-type]
        contact, stiffness = law.force(w), law.stiffness(w)
        return Reading(contact, stiffness, instrument.reading(self.depth, contact))

    def force(self, values: Mapping[str, float]) -> FloatArray:
        """Force of the instrument (N), (n,), alone; raises as `law` does."""
        instrument = _instrument(values)
        law = self.law(values, self._deepest(instrument))
        w = instrument.tip_depth(law, self.depth)  # type: ignore[arg-type]  # as in `reading`
        return instrument.reading(self.depth, law.force(w))

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], *, rough: bool = False
    ) -> tuple[Reading, FloatArray]:
        """Reading, and the derivative of its force in each parameter (SI) at `paths`, shape (n, k).

        With a compliance C the tip follows w + C P = s, so every derivative at fixed w is divided by
        1 + C P', and dw/dC = -P / (1 + C P'). A `rough` one takes its ratios from one further law instead of
        two: off by 1e-3 of itself, which costs a minimiser nothing.
        """
        instrument = _instrument(values)
        deepest = self._deepest(instrument)
        law = self.law(values, deepest)
        w = instrument.tip_depth(law, self.depth)  # type: ignore[arg-type]  # as in `reading`
        P, S = law.force(w), law.stiffness(w)
        share = 1.0 / (1.0 + instrument.compliance * S) if instrument.compliance else 1.0
        columns = np.empty((len(paths), len(w)))
        ratio_columns: dict[str, FloatArray] = {}
        for row, path in enumerate(paths):
            if path == "instrument.contact_depth":
                columns[row] = -S * share
            elif path == "instrument.compliance":
                columns[row] = -S * P * share
            elif path == "instrument.baseline":
                columns[row] = 1.0
            elif path == "instrument.baseline_slope":
                columns[row] = self.depth
            else:
                columns[row] = share * self._mechanical(
                    path, values, deepest, w, P, S, ratio_columns, rough=rough
                )
        return Reading(P, S, instrument.reading(self.depth, P)), columns.T

    def _mechanical(
        self,
        path: str,
        values: Mapping[str, float],
        deepest: float,
        w: FloatArray,
        P: FloatArray,
        S: FloatArray,
        ratio_columns: dict[str, FloatArray],
        *,
        rough: bool,
    ) -> FloatArray:
        """dP/dp at fixed tip depth: the two factors, then the ratios the parameter moves."""
        log_b, log_c = self.similarity.factor_slopes(path, values)
        derivative = (log_c * P + log_b * np.maximum(w, 0.0) * S) / values[path]
        for ratio, slope in self.similarity.ratio_slopes(path).items():
            if ratio not in ratio_columns:
                law = self.law(values, deepest)
                ratio_columns[ratio] = (
                    law.ratio_slope(w, P)
                    if isinstance(law.law, FamilyLaw)
                    else self._ratio_derivative(ratio, values, deepest, w, rough=rough)
                )
            in_log = ratio not in self.similarity.direct
            derivative = derivative + ratio_columns[ratio] * (slope / values[path] if in_log else slope)
        return derivative

    def _ratio_derivative(
        self, ratio: str, values: Mapping[str, float], deepest: float, w: FloatArray, *, rough: bool
    ) -> FloatArray:
        """dP/d ln k (dP/dk of a direct one) at fixed depth and factors, by a difference of two laws."""
        b, c = self.similarity.factors(values)
        reduced = dict(zip(self.similarity.ratio_paths, self.similarity.reduced(values), strict=True))
        k = reduced[ratio]
        in_log = ratio not in self.similarity.direct
        finer = self._for_differences
        size = _RATIO_STEP
        if ratio.startswith("indenter.") or ratio == "layer.thickness":
            size *= abs(k)

        def force(steps: float) -> FloatArray:
            value = k * np.exp(steps * _RATIO_STEP) if in_log else k + steps * size
            law = finer.reference_law(tuple((reduced | {ratio: value}).values()), b * deepest)
            return law.force(b * w)

        difference = _first_possible(force, _ROUGH_STENCILS if rough else _STENCILS)
        return np.asarray(difference * (c / (_RATIO_STEP if in_log else size)))

    @property
    def _for_differences(self) -> Forward:
        """The same with laws that may be subtracted: of one kind, and not rougher than the step allows."""
        accuracy = self.options.accuracy or Accuracy()
        options = replace(
            self.options,
            method="exact" if self.options.method == "auto" else self.options.method,
            accuracy=Accuracy(min(accuracy.rtol, _STENCIL_RTOL)),
        )
        return replace(self, options=options)

    def _deepest(self, instrument: Instrument) -> float:
        return max(float(self.depth.max()) - instrument.contact_depth, 0.0)

    def reference_law(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law at the reference with these ratios, for its depths up to `depth` (m); kept and used again."""
        law = self._from_table(reduced, depth) if self.tabulated else None
        return law if law is not None else self._solved(reduced, depth)

    def _from_table(self, reduced: tuple[float, ...], depth: float) -> ContactLaw | None:
        """Law read off a table, to the end of the table's range; None where there is none."""
        reference = self.similarity.scene
        tip, layer = reference.indenter, reference.layer
        # What `_can_be_tabulated` found, in a form that types can follow.
        if not (isinstance(tip, PowerLawShape) and isinstance(layer.material, Isotropic)):
            return None
        varpi = float(tip.halfspace_radius(np.array([depth]))[0]) / layer.thickness
        key = (self.number, self.options, self.similarity.length, reduced, "table", range_number(varpi))
        law = self.store.get(key)
        if law is None:
            base = reference.substrate
            found = tabulated_law(
                tip,
                layer=(layer.material.E, layer.material.nu),
                base=(reduced[0], base.nu) if isinstance(base, Isotropic) else None,
                thickness=layer.thickness,
                varpi=varpi,
                rtol=(self.options.accuracy or Accuracy()).rtol,
            )
            if found is None:
                return None
            law = self.store.keep(key, found)
        return law if isinstance(law, ContactLaw) else None

    def _solved(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        octave = float(np.ceil(np.log2(depth))) if depth > 0.0 else -np.inf
        key = (self.number, self.options, self.similarity.length, reduced, octave)
        law = self.store.get(key)
        if law is None:
            law = self.store.keep(key, self._build(reduced, float(np.exp2(octave))))
        if isinstance(law, RangeError):
            raise law
        if depth > law.max_depth:
            raise self._refusal(key, reduced, depth, law)
        return law

    def _refusal(
        self, key: tuple[object, ...], reduced: tuple[float, ...], depth: float, law: ContactLaw
    ) -> RangeError:
        """Why a law ends before `depth` (m), in the words of its solver; asked once for each law."""
        if key not in self.store.refusals:
            try:
                self.options.build(self._scene(reduced), depth)
                words = f"depth {depth:.6g} m is beyond {law.max_depth:.6g} m, where this law ends"
            except RangeError as error:
                words = str(error)
            self.store.refusals[key] = RangeError(words, max_depth=law.max_depth)
        return self.store.refusals[key]

    def _scene(self, reduced: tuple[float, ...]) -> Scene:
        similarity = self.similarity
        return similarity.scene.with_values(dict(zip(similarity.ratio_paths, reduced, strict=True)))

    def _build(self, reduced: tuple[float, ...], depth: float) -> ContactLaw | RangeError:
        """Law up to `depth` (m), or as deep as it reaches; the refusal itself where it reaches nowhere."""
        scene = self._scene(reduced)
        try:
            return self.options.build(scene, depth)
        except RangeError as error:
            if not error.max_depth:
                return error
            # A hair less: the depth a message quotes may be rounded up.
            return self.options.build(scene, error.max_depth * (1.0 - 1e-6))


def _can_be_tabulated(similarity: Similarity, free: Sequence[str], options: LawOptions) -> bool:
    scene = similarity.scene
    return (
        options.method in ("auto", "exact")
        and similarity.exponent is not None
        and not isinstance(scene.indenter, FlatPunch)
        and isinstance(scene.layer.material, Isotropic)
        and isinstance(scene.substrate, Isotropic | Rigid)
        and bool(np.isfinite(scene.layer.thickness))
        and not any(path in similarity.direct for path in free)
    )


def _instrument(values: Mapping[str, float]) -> Instrument:
    return Instrument(**{part.name: values[f"instrument.{part.name}"] for part in fields(Instrument)})


#: (steps, weights) of a difference quotient.
Stencil: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]

_ROUGH_STENCILS: tuple[Stencil, ...] = (((0.0, 1.0), (-1.0, 1.0)), ((0.0, -1.0), (1.0, -1.0)))
# Central, backward and forward differences of second order.
_STENCILS: tuple[Stencil, ...] = (
    ((-1.0, 1.0), (-0.5, 0.5)),
    ((0.0, -1.0, -2.0), (1.5, -2.0, 0.5)),
    ((0.0, 1.0, 2.0), (-1.5, 2.0, -0.5)),
)


def _first_possible(force: Callable[[float], FloatArray], stencils: Sequence[Stencil]) -> FloatArray:
    """Difference quotient per step, by the first stencil that stays inside what is physically possible.

    At nu = 0.5 and at the incompressible limit of an anisotropic material only one side exists.
    """
    problem: InputError | None = None
    for steps, weights in stencils:
        try:
            forces = [force(step) for step in steps]
        except InputError as error:
            problem = error
            continue
        return np.asarray(sum(weight * value for weight, value in zip(weights, forces, strict=True)))
    raise InputError(f"the law has no neighbours to differentiate with: {problem}") from problem
