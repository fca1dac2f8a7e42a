"""Where the laws of a forward model come from: how they are built, read off tables, and kept.

The range of a law that is solved for is its needed depth rounded up to a power of two: it is then a function of
the parameters alone, not of what was asked before. Where only the ratio of two moduli varies, laws are read off
the tables of `curve_family`.
"""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError, UnderlayWarning
from underlay.inference.model.similarity import Similarity
from underlay.mechanics.accuracy import Accuracy
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.curve_family import range_number, range_numbers
from underlay.mechanics.exact.family_law import tabulated_law
from underlay.mechanics.indenters import FlatPunch, PowerLawShape
from underlay.mechanics.materials import Isotropic, Rigid
from underlay.scene.scene import Scene

__all__ = ["LawOptions", "LawSource", "LawStore"]

_LAWS_KEPT = 64
_RANGES = 4096  # more than there are powers of two
# Laws that are subtracted over a step of 1e-3 must not be rougher than this.
_STENCIL_RTOL = 1e-6


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
class LawSource:
    """Laws of one reference scene at any ratios of its moduli, lengths and Poisson's ratios.

    Parameters
    ----------
    similarity : Similarity
        The reference and what scales.
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
    options: LawOptions
    store: LawStore
    number: int
    tabulated: bool

    @classmethod
    def of(
        cls,
        similarity: Similarity,
        reference: Scene,
        free: Sequence[str],
        options: LawOptions,
        store: LawStore,
    ) -> LawSource:
        """Source for what may vary at the paths `free`; `reference` names its laws in the store."""
        tabulated = _can_be_tabulated(similarity, free, options)
        return cls(similarity, options, store, store.number(reference), tabulated)

    @property
    def for_differences(self) -> LawSource:
        """The same with laws that may be subtracted: of one kind, and not rougher than the step allows."""
        accuracy = self.options.accuracy or Accuracy()
        options = replace(
            self.options,
            method="exact" if self.options.method == "auto" else self.options.method,
            accuracy=Accuracy(min(accuracy.rtol, _STENCIL_RTOL)),
        )
        return replace(self, options=options)

    def law(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law with these ratios for depths up to `depth` (m), kept and used again.

        Raises
        ------
        InputError
            If the ratios are not those of a possible scene, or the law does not reach that deep.
        """
        law = self._from_table(reduced, depth) if self.tabulated else None
        return law if law is not None else self._solved(reduced, depth)

    def for_statements(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law of the same kind that ends at `depth` (m), where its errors and flags depend on the range.

        A kept law reaches up to twice as deep, and a published correction may leave its own range there.
        """
        law = self.law(reduced, depth)
        if self.options.method in ("auto", "exact") or depth == 0.0:
            return law
        return self.options.build(self._scene(reduced), depth)

    def spans(self, depth: FloatArray) -> FloatArray:
        """Numbers of the ranges that depths (m), (sets,), belong to: those of one range share a law."""
        octaves = np.ceil(np.log2(np.maximum(depth, np.finfo(float).tiny)))
        tip, layer = self.similarity.scene.indenter, self.similarity.scene.layer
        if not (self.tabulated and isinstance(tip, PowerLawShape)):
            return octaves
        return octaves + _RANGES * range_numbers(tip.halfspace_radius(depth) / layer.thickness)

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
