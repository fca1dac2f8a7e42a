"""Where the laws of a forward model come from: built, read off tables, and kept.

The range of a law that is solved for is its needed depth rounded up to a power of two: it is then a function of
the parameters alone, not of what was asked before. Where one ratio alone varies (`one_ratio`), laws are read off
the tables of `curve_family`.
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
from underlay.mechanics.contact import AdhesionTable, Beside, Contact, IsotropicLayer
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.curve_family import IsotropicPair, RigidBase
from underlay.mechanics.kernel import Family, Kernel
from underlay.mechanics.solver import Solver
from underlay.quantities import kind_of, replace_values
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene

__all__ = ["LawSource", "LawStore", "OneRatio", "one_ratio", "quiet_law", "tip_ratio"]

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
    """The one ratio in which the bodies of a problem differ: their laws are then read off tables (`curve_family`).

    Parameters
    ----------
    family : Family or None
        The bodies; None where there is one alone.
    path, over : str
        Paths of the number and of that which it is divided by.
    """

    family: Family | None
    path: str = ""
    over: str = ""

    def of(self, values: Mapping[str, Number]) -> Number | float:
        """Value of the ratio."""
        return values[self.path] / values[self.over] if self.path else np.inf

    def slope(self, path: str) -> float:
        """d ln(ratio)/d ln(number at `path`)."""
        return float(path == self.path) - float(path == self.over)


@dataclass(frozen=True)
class _OneUnknown:
    """The bodies of a scene of which one modulus or thickness is not known.

    Parameters
    ----------
    scene : Scene
        The scene at a ratio of one.
    path : str
        Path of the number that is not known.
    unit : float
        Value of that number at a ratio of one (SI).
    """

    scene: Scene
    path: str
    unit: float

    def kernel(self, ratio: float) -> Kernel:
        """Kernel at one ratio."""
        return self.scene.with_values({self.path: ratio * self.unit}).contact.kernel


def one_ratio(similarity: Similarity, body: IsotropicLayer | None, free: Sequence[str]) -> OneRatio | None:
    """Find the one ratio that the free parameters move; None where they move more, or a Poisson's ratio.

    Parameters
    ----------
    similarity : Similarity
        What scales out of the laws.
    body : IsotropicLayer or None
        Body of the reference, where it is an isotropic layer.
    free : sequence of str
        Paths that vary.
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
    # Whatever the numbers that a fit starts from and stands at: one table for one known rest.
    known = similarity.scene.with_values({path: unit})
    bodies = Scene(known.indenter, known.layer, known.substrate, instrument=Instrument())
    return OneRatio(_OneUnknown(bodies, path, unit), path, over[path])


def tip_ratio(similarity: Similarity, body: IsotropicLayer | None, free: Sequence[str]) -> OneRatio | None:
    """Find the bodies under a tip that is no power law; None where tables are not for what varies.

    `body` as in `one_ratio`.
    """
    if similarity.exponent is not None or body is None or not similarity.moduli:
        return None
    moving = set(similarity.direct).intersection(free)
    if moving - {"layer.thickness"}:
        return None
    if body.base is None:
        return OneRatio(RigidBase(body.layer.nu))
    return OneRatio(IsotropicPair(body.layer.nu, body.base.nu), "substrate.E", "layer.E")


def quiet_law(scene: Scene, solver: Solver, max_depth: float, beside: tuple[Beside, ...] = ()) -> ContactLaw:
    """Build the law of a scene without warnings.

    A published correction warns where it leaves its range; a fit passes through such places and reports only
    those of its result, which the law carries itself.

    Parameters
    ----------
    scene : Scene
        The test.
    solver : Solver
        What builds the law.
    max_depth : float
        Depth (m) up to which it is needed.
    beside : tuple of Beside
        Bodies a step away, towards which the law says its derivatives.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnderlayWarning)
        if not beside:
            return scene.contact_law(max_depth, solver=solver)
        return solver.law(replace(scene.contact, beside=beside), max_depth)


@dataclass
class LawStore:
    """The laws built last, or why one could not be, and what is compiled for batches; `built` counts laws.

    Owned by one problem.
    """

    laws: OrderedDict[tuple[object, ...], ContactLaw | RangeError] = field(default_factory=OrderedDict)
    references: list[tuple[object, ...]] = field(default_factory=list)
    refusals: dict[tuple[object, ...], RangeError] = field(default_factory=dict)
    batches: dict[tuple[object, ...], ExactBatch | None] = field(default_factory=dict)
    surfaces: dict[tuple[object, ...], object] = field(default_factory=dict)
    adhesion_tables: dict[tuple[object, ...], AdhesionTable | None] = field(default_factory=dict)
    built: int = 0

    def number(self, reference: tuple[object, ...]) -> int:
        """Short name of a reference scene, given its parts: equal ones share their laws."""
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
    solver : Solver
        What builds them.
    store : LawStore
        Where they are kept.
    number : int
        Name of the reference in the store.
    contact : Contact
        The contact of the reference.
    table : OneRatio or None
        The one ratio that can change the law, where the solver reads such laws off a table.
    tips : OneRatio or None
        The one ratio of a tip that is no power law: its size over the thickness may vary too.
    beside : tuple of str
        Paths of the ratios in which laws that are solved for say their own derivatives (`Contact.beside`); beside
        tables in the order of the tables' own.
    scattered : bool
        Whether it is asked for ratios far apart, as a grid holds them: each is solved for itself.
    rough : bool
        Whether sets of unlike depths share the law of the deepest: what one says then depends on the others,
        by less than the law's own error.
    """

    similarity: Similarity
    solver: Solver
    store: LawStore
    number: int
    contact: Contact
    table: OneRatio | None
    tips: OneRatio | None = None
    beside: tuple[str, ...] = ()
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
        """Source for what may vary at the paths `free`; the parts of the `reference` name its laws in the store."""
        contact = similarity.scene.contact
        source = cls(similarity, solver, store, store.number(reference), contact, None)
        return source.varying(free)

    def varying(self, free: Sequence[str]) -> LawSource:
        """Return the source where only the paths `free` vary: tables serve more the fewer these are."""
        similarity, solver = self.similarity, self.solver
        body = self.contact.isotropic
        table = one_ratio(similarity, body, free) if solver.has_table(self.contact) else None
        tips = tip_ratio(similarity, body, free) if solver.has_tip_tables(self.contact) else None
        return replace(self, table=table, tips=tips, beside=self._slopes_wanted(table, tips, free))

    def _slopes_wanted(
        self, table: OneRatio | None, tips: OneRatio | None, free: Sequence[str]
    ) -> tuple[str, ...]:
        """What `beside` is where the paths `free` vary; nothing where the solver's laws say no slopes."""
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
        """Whether each law is solved for by itself, its derivatives with it."""
        return self.table is None and self.tips is None and bool(self.beside)

    @property
    def know_slopes(self) -> bool:
        """Whether the laws say their derivatives in what may vary: no further law is needed for them."""
        return self.table is not None or self.tips is not None or bool(self.beside)

    @property
    def for_differences(self) -> LawSource:
        """The source with laws that may be subtracted: of one kind, and not rougher than the step allows."""
        return replace(self, solver=self.solver.for_differences(_STENCIL_RTOL))

    def law(self, reduced: tuple[float, ...], depth: float) -> ContactLaw:
        """Law with these ratios for depths up to `depth` (m), kept and used again.

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
        """Laws with these ratios for depths (m) that are less work all at once; None for every other."""
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
        """Forces (N), (laws, n), of these ratios' laws at depths (m) up to `depth`, (laws, n) or (1, n) for all.

        None where the laws are asked one by one.
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
        """Law of the same kind that ends at `depth` (m), where its errors and flags depend on the range.

        A kept law reaches up to twice as deep, and a published correction may leave its own range there.
        """
        law = self.law(reduced, depth)
        if not self.solver.judges_range or depth == 0.0:
            return law
        return quiet_law(self._scene(reduced), self.solver, depth)

    def adhesion_table(self, fixed: Mapping[str, float], varying: str | None) -> AdhesionTable | None:
        """Table of laws at any work of adhesion, at these ratios; None where there is none.

        `varying` is the path of one ratio of moduli more that may vary.
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
        """Numbers of the ranges that depths (m), (sets,), belong to: those of one range share a law."""
        return np.zeros(depth.shape) if self.rough else self.solver.ranges(self.contact, depth)

    def _from_table(self, table: OneRatio, reduced: tuple[float, ...], depth: float) -> ContactLaw | None:
        """Law read off a table, to the end of the table's range; None where there is none."""
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
        """Laws read off the tables of the flat punch, to the end of their range, or why there are none so deep.

        None where there is no table.
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
                # What the tables do not have is asked for elsewhere: only that is kept.
                self.store.keep(keys[row], _NOT_TABULATED if law is None else law)
        return found

    def tip_contact(self, numbers: Mapping[str, float]) -> Contact:
        """The reference's contact with a tip and a layer of these sizes."""
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
        key = (self.number, self.solver, self.similarity.length, reduced, octave, self.beside)
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
        """Why a law ends before `depth` (m), in the words of its solver; asked once for each law."""
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
        """Law up to `depth` (m), or why it does not reach so deep."""
        scene = self._scene(reduced)
        try:
            return quiet_law(scene, self.solver, depth, self._bodies_beside(scene, reduced))
        except RangeError as error:
            return error

    def _bodies_beside(self, scene: Scene, reduced: tuple[float, ...]) -> tuple[Beside, ...]:
        """Bodies a step away in each of the ratios `beside`; none where one of them does not exist."""
        found, here = [], scene.contact
        shorter = float(np.exp(-_KERNEL_STEP))
        try:
            for path in self.beside:
                if path in {"", _THICKNESS}:  # on a rigid base there is no ratio
                    thickness = shorter if path else 1.0
                    found.append(Beside(here.kernel, 0.0, -_KERNEL_STEP, thickness))
                    continue
                entry, in_log = self.similarity.ratio_paths.index(path), path not in self.similarity.direct
                # Downwards: there is nothing beyond a Poisson's ratio of one half.
                value, step = reduced[entry], _KERNEL_STEP
                if not in_log and kind_of(path) != "dimensionless":
                    step *= abs(value) or 1.0
                value = value * shorter if in_log else value - step
                there = replace_values(scene, {path: value}, known=self.similarity.values).contact
                if there.thickness != here.thickness or there.indenter != here.indenter:
                    return ()
                found.append(Beside(there.kernel, float(np.log(there.theta / here.theta)), -step))
        except InputError:
            return ()
        return tuple(found)
