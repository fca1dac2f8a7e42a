"""Source of the contact laws of a forward model: built by a solver, read from tables, and kept.

The range of a law that is solved for is its needed depth rounded up to a power of two: it is then a function of the
parameters alone, not of earlier calls. Where one ratio of moduli or lengths alone varies (`one_ratio`), laws are
read from the tables of `curve_family`.
"""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError, UnderlayWarning
from underlay.inference.model.similarity import Similarity
from underlay.mechanics.contact import AdhesionTable, Contact, IsotropicLayer, Variant
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.curve_family import IsotropicPair, RigidBase
from underlay.mechanics.kernel import Family, Kernel
from underlay.mechanics.solver import Solver
from underlay.quantities import kind_of, replace_values
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene

Number = TypeVar("Number", float, FloatArray)
# Laws that a store keeps; the oldest goes.
_LAWS_KEPT = 128
# Relative tolerance of laws that are subtracted over a step of 1e-3.
_STENCIL_RTOL = 1e-6
# Step in a ratio for differences of kernels, which are known to 1e-14: it gives the derivative to 1e-7.
_KERNEL_STEP = 1e-6
# Factor on the largest depth that a message quotes, which may be rounded up.
_A_HAIR_LESS = 1.0 - 1e-6
# Stands for the logarithm of the layer's thickness, which is no ratio.
_THICKNESS = "ln layer.thickness"
_NOT_TABULATED = RangeError("no table has this law")


@dataclass(frozen=True)
class OneRatio:
    """The one ratio in which the samples of a problem differ: laws come from tables over it (`curve_family`).

    Parameters
    ----------
    family : Family or None
        The layered bodies at any value of the ratio; None where there is only one.
    path, over : str
        Paths of the ratio's numerator and denominator, such as ``"substrate.E"`` and ``"layer.E"``.
    """

    family: Family | None
    path: str = ""
    over: str = ""

    def of(self, values: Mapping[str, Number]) -> Number | float:
        """Value of the ratio at numbers by path; infinite where there is no ratio."""
        return values[self.path] / values[self.over] if self.path else np.inf

    def slope(self, path: str) -> float:
        """d ln(ratio)/d ln(number at `path`): 1, -1 or 0."""
        return float(path == self.path) - float(path == self.over)


@dataclass(frozen=True)
class _OneUnknown:
    """The layered bodies of a scene in which only one modulus or thickness varies.

    Parameters
    ----------
    scene : Scene
        The scene at a ratio of one.
    path : str
        Path of the number that varies.
    unit : float
        Value of that number at a ratio of one (SI).
    """

    scene: Scene
    path: str
    unit: float

    def kernel(self, ratio: float) -> Kernel:
        """Kernel of the body (its surface response by wavenumber) at one value of the ratio."""
        return self.scene.with_values({self.path: ratio * self.unit}).contact.kernel


def one_ratio(similarity: Similarity, body: IsotropicLayer | None, free: Sequence[str]) -> OneRatio | None:
    """Find the one ratio that the free parameters change, under a power-law tip.

    None where they change more than one, or a Poisson's ratio.

    Parameters
    ----------
    similarity : Similarity
        Scaling of the laws.
    body : IsotropicLayer or None
        Body of the reference, where it is an isotropic layer.
    free : sequence of str
        Paths of the parameters that vary.
    """
    if similarity.exponent is None or set(similarity.direct).intersection(free):
        return None
    if body is not None:
        if body.base is None:
            return OneRatio(None)
        return OneRatio(IsotropicPair(body.layer.nu, body.base.nu), "substrate.E", "layer.E")
    over = dict.fromkeys(similarity.moduli[1:], "layer.E") | dict.fromkeys(
        similarity.lengths, "layer.thickness"
    )
    if similarity.moduli[1:]:
        over["layer.E"] = similarity.moduli[1]
    if similarity.lengths:
        over["layer.thickness"] = similarity.lengths[0]
    moving = [path for path in over if path in free]
    if len(moving) != 1 or "layer.E_axial" in similarity.values:
        return None
    path = moving[0]
    unit = similarity.values[over[path]]
    # The moving number is set to a fixed ratio, so that all fits with the same known numbers share one table.
    known = similarity.scene.with_values({path: unit})
    bodies = Scene(known.indenter, known.layer, known.substrate, instrument=Instrument())
    return OneRatio(_OneUnknown(bodies, path, unit), path, over[path])


def tip_ratio(similarity: Similarity, body: IsotropicLayer | None, free: Sequence[str]) -> OneRatio | None:
    """Find the one ratio of moduli that may vary under a tip that is no power law.

    None where tables do not cover what varies. Parameters are those of `one_ratio`.
    """
    if similarity.exponent is not None or body is None or not similarity.moduli:
        return None
    moving = set(similarity.direct).intersection(free)
    if moving - {"layer.thickness"}:
        return None
    if body.base is None:
        return OneRatio(RigidBase(body.layer.nu))
    return OneRatio(IsotropicPair(body.layer.nu, body.base.nu), "substrate.E", "layer.E")


def quiet_law(scene: Scene, solver: Solver, max_depth: float, bodies: tuple[Variant, ...] = ()) -> ContactLaw:
    """Build the law of a scene without warnings.

    A published correction warns where it leaves its range; a fit passes through such places and reports only those
    of its result, which the law carries itself.

    Parameters
    ----------
    scene : Scene
        The test.
    solver : Solver
        Solver that builds the law.
    max_depth : float
        Depth (m) that the law must reach.
    bodies : tuple of Variant
        Slightly different bodies, from which the law computes its derivatives.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnderlayWarning)
        if not bodies:
            return scene.contact_law(max_depth, solver=solver)
        return solver.law(replace(scene.contact, variants=bodies), max_depth)


@dataclass
class LawStore:
    """Cache of one problem: contact laws, errors of those that could not be built, and compiled batch solvers.

    `built` counts the laws.
    """

    laws: OrderedDict[tuple[object, ...], ContactLaw | RangeError] = field(default_factory=OrderedDict)
    references: list[tuple[object, ...]] = field(default_factory=list)
    refusals: dict[tuple[object, ...], RangeError] = field(default_factory=dict)
    batches: dict[tuple[object, ...], ExactBatch | None] = field(default_factory=dict)
    surfaces: dict[tuple[object, ...], object] = field(default_factory=dict)
    adhesion_tables: dict[tuple[object, ...], AdhesionTable | None] = field(default_factory=dict)
    built: int = 0

    def number(self, reference: tuple[object, ...]) -> int:
        """Number that stands for a reference scene, given by its parts: equal scenes share their laws."""
        if reference not in self.references:
            self.references.append(reference)
        return self.references.index(reference)

    def get(self, key: tuple[object, ...]) -> ContactLaw | RangeError | None:
        """Return the law kept under `key`, or the error of its failed construction, or None."""
        return self.laws.get(key)

    def keep(self, key: tuple[object, ...], law: ContactLaw | RangeError) -> ContactLaw | RangeError:
        """Keep a law, or the error of its failed construction, under `key` and return it; the oldest is dropped."""
        self.built += 1
        self.laws[key] = law
        if len(self.laws) > _LAWS_KEPT:
            self.laws.popitem(last=False)
        return law


@dataclass(frozen=True)
class LawSource:
    """Contact laws of one reference scene at any ratios of its moduli, lengths and Poisson's ratios.

    Parameters
    ----------
    similarity : Similarity
        The reference, and how laws scale from it.
    solver : Solver
        Solver that builds the laws.
    store : LawStore
        Where they are kept.
    number : int
        Number of the reference in the store.
    contact : Contact
        The contact of the reference.
    table : OneRatio or None
        The one ratio that can change the law, where the solver has tables over it.
    tips : OneRatio or None
        The same under a tip that is no power law: its size over the thickness may vary too.
    slope_ratios : tuple of str
        Paths of the ratios in which laws that are solved for give their own derivatives (`Contact.variants`);
        where there are tables, in the order of the tables' derivatives.
    scattered : bool
        Whether laws at ratios far apart are needed, as on a grid: each is then solved for itself.
    rough : bool
        Whether sets of different depths share the law of the deepest: the result of one then depends on the others,
        by less than the law's own error.
    """

    similarity: Similarity
    solver: Solver
    store: LawStore
    number: int
    contact: Contact
    table: OneRatio | None
    tips: OneRatio | None = None
    slope_ratios: tuple[str, ...] = ()
    scattered: bool = False
    rough: bool = False

    @classmethod
    def of(
        cls,
        similarity: Similarity,
        reference: tuple[object, ...],
        free: Sequence[str],
        solver: Solver,
        store: LawStore,
    ) -> LawSource:
        """Source of laws where the parameters at the paths `free` may vary.

        The parts of `reference`, the scene at which the laws are built, identify them in the store.
        """
        contact = similarity.scene.contact
        source = cls(similarity, solver, store, store.number(reference), contact, None)
        return source.varying(free)

    def varying(self, free: Sequence[str]) -> LawSource:
        """Return the source for only the paths `free` varying: the fewer vary, the more laws come from tables."""
        similarity, solver = self.similarity, self.solver
        body = self.contact.isotropic
        table = one_ratio(similarity, body, free) if solver.has_table(self.contact) else None
        tips = tip_ratio(similarity, body, free) if solver.has_tip_tables(self.contact) else None
        return replace(self, table=table, tips=tips, slope_ratios=self._slopes_wanted(table, tips, free))

    def _slopes_wanted(
        self, table: OneRatio | None, tips: OneRatio | None, free: Sequence[str]
    ) -> tuple[str, ...]:
        """Ratios in which laws shall give their derivatives where the paths `free` vary, for `slope_ratios`.

        Empty where the solver gives no such derivatives.
        """
        similarity = self.similarity
        if not self.solver.has_slopes(self.contact):
            return ()
        if tips is not None:
            return tips.path, _THICKNESS
        if table is not None:
            return (table.path,) if table.path in similarity.ratio_paths else ()
        slopes = [similarity.ratio_slopes(path, similarity.values) for path in free]
        return tuple(dict.fromkeys(path for moved in slopes for path in moved))

    @property
    def is_solved(self) -> bool:
        """Whether laws come from the solver, one at a time and with derivatives, and not from tables."""
        return self.table is None and self.tips is None and bool(self.slope_ratios)

    @property
    def know_slopes(self) -> bool:
        """Whether the laws give their derivatives in all ratios that may vary, so that none need differences."""
        return self.table is not None or self.tips is not None or bool(self.slope_ratios)

    @property
    def for_differences(self) -> LawSource:
        """The same source with laws accurate enough to take derivatives from their differences."""
        return replace(self, solver=self.solver.for_differences(_STENCIL_RTOL))

    def law(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Contact law at given ratios of moduli and lengths, for depths up to `depth` (m); kept and used again.

        `reduced` are the ratios as `Similarity.reduced` returns them.

        Raises
        ------
        InputError
            If the ratios are not those of a possible scene, or the law does not reach that deep.
        """
        law = None if self.table is None else self._from_table(self.table, reduced, depth)
        if law is None and self.tips is not None and depth > 0.0:
            said = self._of_tips(self.tips, [reduced], [depth])[0]
            if isinstance(said, RangeError):
                raise said
            law = said
        return law if law is not None else self._solved(reduced, depth)

    def laws_of(
        self, reduced: Sequence[tuple[float, ...]], depths: Sequence[float]
    ) -> list[ContactLaw | None]:
        """Contact laws at several sets of ratios, where computing them together saves work; None for the others.

        `reduced` are the ratios as `Similarity.reduced` returns them, `depths` (m) what each law must reach.
        """
        found: list[ContactLaw | None] = [None] * len(depths)
        rows = [row for row, depth in enumerate(depths) if depth > 0.0]
        if self.tips is not None and len(rows) > 1:
            several = self._of_tips(self.tips, [reduced[row] for row in rows], [depths[row] for row in rows])
            for row, law in zip(rows, several, strict=True):
                found[row] = law if isinstance(law, ContactLaw) else None
        return found

    def side_by_side(
        self, reduced: Sequence[tuple[float, ...]], depth: float
    ) -> Callable[[FloatArray], FloatArray] | None:
        """Function that computes the forces of several laws at once; None where laws must be used one by one.

        Parameters
        ----------
        reduced : sequence of tuple of float
            Ratios of each law, as `Similarity.reduced` returns them.
        depth : float
            Depth (m) that the laws must reach.

        Returns
        -------
        callable or None
            Function from depths (m), (laws, n) or (1, n) for all, to forces (N), (laws, n).
        """
        if self.table is None or self.table.family is None or not (self.scattered and depth > 0.0):
            return None
        values, paths = dict(self.similarity.values), self.similarity.ratio_paths
        ratios = []
        for own in reduced:
            values.update(zip(paths, own, strict=True))
            ratios.append(self.table.of(values))
        return self.solver.side_by_side(self.contact, self.table.family, ratios, depth)

    def for_statements(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law whose range ends at `depth` (m), for error estimates and warnings that depend on its range.

        A law kept for reuse may reach up to twice as deep, where a published correction can leave its own range of
        validity. If the solver's laws do not depend on their range, the kept law is returned. `reduced` are the
        ratios as `Similarity.reduced` returns them.
        """
        law = self.law(reduced, depth)
        if not self.solver.judges_range or depth == 0.0:
            return law
        return quiet_law(self._scene(reduced), self.solver, depth)

    def adhesion_table(self, fixed: Mapping[str, float], varying: str | None) -> AdhesionTable | None:
        """Table of adhesive contact laws for any work of adhesion; None where the adhesion model has none.

        `fixed` are the ratios that stay, by path; `varying` is the path of one ratio of moduli that may vary too.
        """
        key = (self.number, self.solver, self.similarity.length, varying, *fixed.values())
        if key not in self.store.adhesion_tables:
            scene = self.similarity.scene.with_values(fixed)
            contact = scene.contact

            def contact_at(value: float) -> Contact:
                return contact if varying is None else scene.with_values({varying: value}).contact

            table = (
                None if contact.adhesion is None else contact.adhesion.table(contact, contact_at, self.solver)
            )
            self.store.adhesion_tables[key] = table
        return self.store.adhesion_tables[key]

    def spans(self, depth: FloatArray) -> FloatArray:
        """Number of the range that each depth (m), (sets,), belongs to: sets of one range share a law."""
        return np.zeros(depth.shape) if self.rough else self.solver.ranges(self.contact, depth)

    def _from_table(self, table: OneRatio, reduced: tuple[float, ...], depth: float) -> ContactLaw | None:
        """Law with ratios `reduced` read from a table, up to the end of the table's range; None if it has none."""
        similarity = self.similarity
        number = self.solver.table_number(self.contact, depth)
        key = (self.number, self.solver, similarity.length, reduced, "table", number)
        law = self.store.get(key)
        if law is None:
            values = {**similarity.values, **dict(zip(similarity.ratio_paths, reduced, strict=True))}
            found = self.solver.tabulated(
                self.contact, table.family, table.of(values), depth, alone=self.scattered
            )
            if found is None:
                return None
            law = self.store.keep(key, found)
        return law if isinstance(law, ContactLaw) else None

    def _of_tips(
        self, tips: OneRatio, reduced: Sequence[tuple[float, ...]], depths: Sequence[float]
    ) -> list[ContactLaw | RangeError | None]:
        """Laws with several sets of ratios `reduced`, read from the tables of the flat punch up to their end.

        A RangeError in place of a law that cannot reach its depth in `depths` (m); None where there is no table.
        """
        similarity = self.similarity
        found: list[ContactLaw | RangeError | None] = [None] * len(reduced)
        keys, contacts, values = [], [], []
        for ratios, depth in zip(reduced, depths, strict=True):
            numbers = dict(zip(similarity.ratio_paths, ratios, strict=True))
            contact = self.tip_contact(numbers)
            number = self.solver.tip_number(contact, depth)
            keys.append((self.number, self.solver, similarity.length, ratios, "tips", number))
            contacts.append(contact)
            values.append({**similarity.values, **numbers})
        missing = []
        for row, key in enumerate(keys):
            kept = self.store.get(key)
            if kept is None or (isinstance(kept, RangeError) and depths[row] <= (kept.max_depth or 0.0)):
                missing.append(row)
            elif kept is not _NOT_TABULATED:
                found[row] = kept
        if missing and tips.family is not None:
            built = self.solver.tabulated_tips(
                [contacts[row] for row in missing],
                tips.family,
                [float(tips.of(values[row])) for row in missing] if tips.path else None,
                [depths[row] for row in missing],
            )
            for row, law in zip(missing, built, strict=True):
                found[row] = law
                # A law that the tables lack is solved for elsewhere: here only its absence is recorded.
                self.store.keep(keys[row], _NOT_TABULATED if law is None else law)
        return found

    def tip_contact(self, numbers: Mapping[str, float]) -> Contact:
        """The reference's contact with the tip's sizes and the thickness (SI) replaced by `numbers`, by path."""
        prefix = "indenter."
        sizes = {
            path.removeprefix(prefix): value for path, value in numbers.items() if path.startswith(prefix)
        }
        tip: Any = self.contact.indenter  # a frozen dataclass, which its abstract base does not say
        return replace(
            self.contact,
            indenter=replace(tip, **sizes) if sizes else tip,
            thickness=numbers.get("layer.thickness", self.contact.thickness),
        )

    def _solved(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        octave = float(np.ceil(np.log2(depth))) if depth > 0.0 else -np.inf
        key = (self.number, self.solver, self.similarity.length, reduced, octave, self.slope_ratios)
        law = self.store.get(key)
        if law is None:
            law = self.store.keep(key, self._build(reduced, float(np.exp2(octave))))
        if isinstance(law, RangeError) and law.max_depth and depth <= (end := law.max_depth * _A_HAIR_LESS):
            law = self.store.keep(key, self._build(reduced, end))
        if isinstance(law, RangeError):
            raise self._refusal(key, reduced, depth, law) if law.max_depth else law
        if depth > law.max_depth:
            raise self._refusal(key, reduced, depth, law)
        return law

    def _refusal(
        self, key: tuple[object, ...], reduced: tuple[float, ...], depth: float, law: ContactLaw | RangeError
    ) -> RangeError:
        """Error that says, in the solver's words, why a law ends before `depth` (m); made once for each law."""
        if key not in self.store.refusals:
            try:
                quiet_law(self._scene(reduced), self.solver, depth)
                words = f"depth {depth:.6g} m is beyond {law.max_depth:.6g} m, where this law ends"
            except RangeError as error:
                words = str(error)
            self.store.refusals[key] = RangeError(words, max_depth=law.max_depth)
        return self.store.refusals[key]

    def _scene(self, reduced: tuple[float, ...]) -> Scene:
        similarity = self.similarity
        return similarity.scene.with_values(dict(zip(similarity.ratio_paths, reduced, strict=True)))

    def _build(self, reduced: tuple[float, ...], depth: float) -> ContactLaw | RangeError:
        """Law with ratios `reduced` up to `depth` (m), or the error why it does not reach so deep."""
        scene = self._scene(reduced)
        try:
            return quiet_law(scene, self.solver, depth, self._variants(scene, reduced))
        except RangeError as error:
            return error

    def _variants(self, scene: Scene, reduced: tuple[float, ...]) -> tuple[Variant, ...]:
        """Bodies with each of the ratios `slope_ratios` changed by a small step; empty where one cannot exist."""
        found, here = [], scene.contact
        shorter = float(np.exp(-_KERNEL_STEP))
        try:
            for path in self.slope_ratios:
                if path in {"", _THICKNESS}:  # on a rigid base there is no ratio
                    thickness = shorter if path else 1.0
                    found.append(Variant(here.kernel, 0.0, -_KERNEL_STEP, thickness))
                    continue
                entry, in_log = self.similarity.ratio_paths.index(path), path not in self.similarity.direct
                # The step goes down: Poisson's ratio may not exceed one half.
                value, step = reduced[entry], _KERNEL_STEP
                if not in_log and kind_of(path) != "dimensionless":
                    step *= abs(value) or 1.0
                value = value * shorter if in_log else value - step
                there = replace_values(scene, {path: value}, known=self.similarity.values).contact
                if there.thickness != here.thickness or there.indenter != here.indenter:
                    return ()
                found.append(Variant(there.kernel, float(np.log(there.theta / here.theta)), -step))
        except InputError:
            return ()
        return tuple(found)
