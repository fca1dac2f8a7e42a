"""The elastic laws of many parameter sets, computed together according to which of their ratios vary.

The first way that applies is taken:

1. no ratio varies between the sets: one law of the reference serves them all through `Similarity`'s factors;
2. one ratio alone varies: every set's curve is read from tables over that ratio (`curve_family`);
3. a no-slip contact or a sphere, and one ratio alone varies: the sets are read from a surface over that ratio and
   the depth (`ratio_surface`), which gives forces alone;
4. the tip is no power law and Poisson's ratios stay: the sets are read from tables of the flat punch (`TipSets`);
5. the solver's laws can be computed by `ExactBatch` (an isotropic layer on an isotropic or rigid base), or moduli
   and thicknesses of a stack of layers vary: the sets go through it in groups that share integration nodes.

The groups' limits are fixed numbers, not taken from the sets at hand: the result of a set does not depend on the
other sets of the batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.inference.model.laws import OneRatio
from underlay.inference.model.parameter_sets import ParameterSets
from underlay.inference.model.ratio_surface import surfaces
from underlay.mechanics.body import PlaneConstants, isotropic_constants, transversely_isotropic_constants
from underlay.mechanics.exact.batch import CurveBatch, ExactBatch
from underlay.mechanics.exact.table_laws import TipSets, family_batch
from underlay.mechanics.halfspace import largest_halfspace_depth
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.kernel import Kernel, LayerKernel, StackKernel
from underlay.mechanics.kernel.bodies import sheets_of
from underlay.mechanics.kernel.recursion import Recursion

# Factors within which the ranges of sets lie that share nodes, and their stiffness ratios: the base over the layer,
# and of a stack every ratio of moduli and of thicknesses. Of 32 sets each of a stiff, a soft and a slipping stack,
# at 1e-3 and 1e-6, the largest error was 0.11 of the tolerance.
_RANGE_STEP, _RATIO_STEP, _STACK_RATIO_STEP = 2.0, 4.0, 2.0
# Reach of what is compiled over that asked for: another Poisson's ratio than the scene's bends the relation of
# depth and contact radius, and nodes that stop short leave the polynomial to extrapolate.
_MARGIN = 1.1
# Tolerance of what is compiled over that asked for, so that the sets at the edges of a group keep the promise: the
# largest error seen in 300 sets over E2/E1 from 0.01 to 1000 is then a third of the tolerance, and one set in
# fourteen, on the softest bases, goes alone; without it one in eight.
_SPARE = 0.1
# Share of the depth at which the contact would reach the end of a sphere, beyond which nothing is compiled.
_SHAPE_SHARE = 0.5
# Ratios of a stack that may vary: with more of them a group holds few sets.
_MOST_RATIOS = 4

#: Rows of sets that share nodes, their curves, and half the indentation modulus of each surface (Pa), (rows,).
_Group: TypeAlias = tuple[NDArray[np.intp], CurveBatch, FloatArray]


class SetLaws(NamedTuple):
    """Contact laws of many parameter sets at their depths.

    Parameters
    ----------
    force, stiffness : FloatArray
        Force P (N) and its derivative dP/dw (N/m) in the depth w, (sets, n); the stiffness zero if not asked for.
    through_ratios : mapping of path to FloatArray
        The part of dP/d ln(number) (N) that comes from the ratios of moduli and lengths which the number at that
        path changes, (sets, n); empty if not asked for.
    possible : ndarray of bool (sets,)
        Which sets have a law accurate enough; others may have one when computed alone.
    """

    force: FloatArray
    stiffness: FloatArray
    through_ratios: Mapping[str, FloatArray]
    possible: NDArray[np.bool_]

    @classmethod
    def none_of(cls, asked: ParameterSets) -> SetLaws:
        """Return zeros for the sets, none of which is possible."""
        force, stiffness = np.zeros((2, *asked.tip.shape))
        return cls(force, stiffness, {}, np.zeros(asked.sets, dtype=bool))


def laws_of_sets(asked: ParameterSets, *, stiffness: bool, slopes: bool = False) -> SetLaws | None:
    """Laws of all sets; None where they cannot be computed together.

    Parameters
    ----------
    asked : ParameterSets
        The sets, of a sample without memory, adhesion and corrections.
    stiffness : bool
        Whether the stiffness is asked for.
    slopes : bool, default False
        Whether the stiffness and the derivatives through ratios are asked for.
    """
    table, full = asked.forward.laws.table, stiffness or slopes
    if asked.shared is not None:
        return _by_one_law(asked, asked.shared, stiffness=full)
    if table is not None:
        return _from_tables(asked, table, stiffness=full, slopes=slopes)
    entry = None if full else _entry_of_surfaces(asked)
    if entry is not None:
        return _on_surfaces(asked, entry)
    tips = _sets_of_a_tip(asked)
    if tips is not None:
        return _with_tip_slopes(asked, *tips) if slopes else _from_tip_tables(asked, *tips, stiffness=full)
    groups = None if slopes else _groups(asked)
    return None if groups is None else _in_groups(asked, groups, stiffness=full)


def can_batch_depths(asked: ParameterSets) -> bool:
    """Whether sets with different depth readings can be computed together."""
    return asked.shared is not None or asked.forward.laws.table is not None or _groups(asked) is not None


def _by_one_law(asked: ParameterSets, reduced: tuple[float, ...], *, stiffness: bool) -> SetLaws:
    """Laws of all sets by scaling one law, or one for each range of depth that they need.

    `reduced` are the ratios that all sets share, as `Similarity.reduced` returns them.
    """
    found = SetLaws.none_of(asked)
    b, c = asked.factors
    depth = b * asked.deepest
    spans = asked.forward.laws.spans(depth)
    for span in np.unique(spans):
        rows = np.flatnonzero(spans == span)
        w = b[rows, None] * asked.tip[rows]
        try:
            law = asked.forward.reference_law(reduced, float(depth[rows].max()))
            if stiffness:
                force, slope = law.force_and_stiffness(w)
                found.stiffness[rows] = (b * c)[rows, None] * slope
            else:
                force = law.force(w)
        except InputError:
            # One of them is out of reach: the others are not.
            continue
        found.force[rows] = c[rows, None] * force
        found.possible[rows] = True
    return found


def _from_tables(asked: ParameterSets, table: OneRatio, *, stiffness: bool, slopes: bool) -> SetLaws:
    """Laws of all sets from tables of the exact law over the one ratio that varies."""
    indenter = asked.forward.similarity.scene.indenter
    if not isinstance(indenter, PowerLawShape) or table.family is None:
        raise TypeError(f"no tables over a ratio for {indenter!r}")
    layer_E, nu = asked.column("layer.E")[:, 0], float(asked.values["layer.nu"])
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    curves = family_batch(
        indenter,
        family=table.family,
        ratio=asked.column(table.path)[:, 0] / asked.column(table.over)[:, 0],
        varpi=asked.varpi(thickness),
        rtol=asked.rtol,
        slopes=slopes,
    )
    theta = asked.gain * np.asarray(isotropic_constants(layer_E, nu).theta, dtype=np.float64)
    arguments = (asked.tip, theta, thickness, asked.abel_coefficients())
    possible = curves.error_estimate <= asked.rtol
    if slopes:
        force, slope, in_ratio = curves.with_slopes(*arguments)
        return SetLaws(force, slope, {table.path: in_ratio[:, 0], table.over: -in_ratio[:, 0]}, possible)
    force = curves.force(*arguments)
    return SetLaws(force, curves.stiffness(*arguments) if stiffness else np.zeros_like(force), {}, possible)


def _entry_of_surfaces(asked: ParameterSets) -> int | None:
    """Index of the one ratio that varies, where laws are interpolated over it by surfaces; else None."""
    laws = asked.forward.laws
    varying = [entry for entry, ratio in enumerate(asked.ratios) if isinstance(ratio, np.ndarray)]
    if len(varying) != 1 or not laws.solver.has_surfaces(laws.contact):
        return None
    # For a frictionless contact a surface is worth its cost only if its laws can be read from tables.
    return varying[0] if laws.contact.sticks or laws.tips is not None else None


def _on_surfaces(asked: ParameterSets, entry: int) -> SetLaws:
    """Forces of all sets from surfaces (`RatioSurface`) over the ratio at index `entry`."""
    found = SetLaws.none_of(asked)
    b, c = asked.factors
    found.possible[asked.deepest <= 0.0] = True
    touching = np.flatnonzero(asked.deepest > 0.0)
    ratio, depth = asked.ratios[entry][touching], (b * asked.deepest)[touching]
    for within, numbers, surface in surfaces(asked.forward.laws, entry, asked.ratios, ratio, depth):
        if surface is not None:
            rows = touching[within]
            found.force[rows] = c[rows, None] * surface.force(numbers, b[rows, None] * asked.tip[rows])
            found.possible[rows] = True
    return found


def _sets_of_a_tip(asked: ParameterSets) -> tuple[TipSets, FloatArray] | None:
    """The parameter sets in the form that tables of the flat punch take, for tips that are no power law.

    Returned with them is the tip's unit of length (m) in each set, (sets,). None where there are no tables, or the
    tip has more sizes than one.
    """
    laws, similarity = asked.forward.laws, asked.forward.similarity
    tips = laws.tips
    if tips is None or tips.family is None or len(similarity.lengths) > 1:
        return None
    numbers: dict[str, FloatArray] = {
        path: np.broadcast_to(ratio, asked.sets)
        for path, ratio in zip(similarity.ratio_paths, asked.ratios, strict=True)
    }
    tip, size = laws.contact.indenter.in_its_unit()
    unit = np.full(asked.sets, size)
    for path in similarity.lengths:  # tips of one length are all similar: their unit goes with it
        unit = unit * (numbers[path] / similarity.values[path])
    sets = TipSets(
        tip,
        tips.family,
        numbers[tips.path] / similarity.values[tips.over] if tips.path else None,
        numbers.get("layer.thickness", np.full(asked.sets, laws.contact.thickness)) / unit,
        asked.factors[0] * asked.deepest / unit,
        asked.rtol,
    )
    return sets, unit


def _from_tip_tables(asked: ParameterSets, sets: TipSets, unit: FloatArray, *, stiffness: bool) -> SetLaws:
    """Laws of all sets from tables of the flat punch; `sets` and `unit` are what `_sets_of_a_tip` returned."""
    b, c = (factor[:, None] for factor in asked.factors)
    theta, unit = c * asked.forward.laws.contact.theta, unit[:, None]
    force, slope, possible = sets.forces(b / unit * asked.tip, stiffness=stiffness)
    return SetLaws(theta * unit**2 * force, theta * unit * b * slope, {}, possible)


def _with_tip_slopes(asked: ParameterSets, sets: TipSets, unit: FloatArray) -> SetLaws | None:
    """`_from_tip_tables` with the derivatives through ratios; None where the tables do not give them all."""
    similarity, tips = asked.forward.similarity, asked.forward.laws.tips
    if not similarity.lengths or tips is None or any(asked.varies(path) for path in similarity.direct):
        return None
    b, c = (factor[:, None] for factor in asked.factors)
    theta, unit = c * asked.forward.laws.contact.theta, unit[:, None]
    said, scale = sets.with_slopes(b / unit * asked.tip), theta * unit**2
    known = {tips.path: scale * said.in_ratio, similarity.lengths[0]: scale * said.in_size}
    moved: dict[str, FloatArray] = {}
    for path in (*similarity.moduli, *similarity.lengths, str(similarity.length)):
        ratio_slopes = similarity.ratio_slopes(path, similarity.values)
        if ratio_slopes:
            moved[path] = np.sum([slope * known[ratio] for ratio, slope in ratio_slopes.items()], axis=0)
    return SetLaws(scale * said.force, theta * unit * b * said.stiffness, moved, said.known)


def _in_groups(asked: ParameterSets, groups: Iterator[_Group], *, stiffness: bool) -> SetLaws:
    """Laws of all sets by `ExactBatch`, in the groups of `_groups`."""
    found = SetLaws.none_of(asked)
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    abel = asked.abel_coefficients()
    for rows, curves, theta in groups:
        stiff = asked.gain[rows] * theta
        arguments = (asked.tip[rows], stiff, thickness[rows], None if abel is None else abel[rows])
        try:
            found.force[rows] = curves.force(*arguments)
            if stiffness:
                found.stiffness[rows] = curves.stiffness(*arguments)
        except RangeError:
            # The shape ends before the group's range does: each set knows its own reach.
            continue
        found.possible[rows] = curves.error_estimate <= asked.rtol
    return found


def _groups(asked: ParameterSets) -> Iterator[_Group] | None:
    """Groups of sets that share integration nodes, without those that no law reaches; None where sets have none."""
    similarity, laws = asked.forward.similarity, asked.forward.laws
    fixed_shape = isinstance(laws.contact.indenter, PowerLawShape) or not asked.varies("indenter.radius")
    if fixed_shape and laws.solver.has_batches(laws.contact):
        return _isotropic_groups(asked)
    if not (isinstance(laws.contact.kernel, StackKernel) and laws.solver.has_table(laws.contact)):
        return None
    if similarity.exponent is None or any(asked.varies(path) for path in similarity.direct):
        return None
    numbers = zip(similarity.ratio_paths, asked.ratios, strict=True)
    varying = {path: ratio for path, ratio in numbers if isinstance(ratio, np.ndarray)}
    return _stack_groups(asked, laws.contact.kernel, varying) if 0 < len(varying) <= _MOST_RATIOS else None


def _isotropic_groups(asked: ParameterSets) -> Iterator[_Group]:
    """Groups of sets of an isotropic layer whose stiffness ratio, thickness and range are alike."""
    scene = asked.forward.similarity.scene
    body = scene.contact.isotropic
    if body is None:
        return
    inner = isotropic_constants(asked.column("layer.E"), asked.column("layer.nu"))
    theta = np.asarray(inner.theta)[:, 0]
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    outer, soft = None, np.full(asked.sets, np.inf)
    if "substrate.E" in asked.values:
        outer = isotropic_constants(asked.column("substrate.E"), asked.column("substrate.nu"))
        soft = np.round(np.log(np.asarray(outer.theta)[:, 0] / theta) / np.log(_RATIO_STEP))
    # A sphere is no power law: its thickness counts on its own.
    power = isinstance(scene.indenter, PowerLawShape)
    thin = np.zeros(asked.sets) if power else np.floor(np.log(thickness) / np.log(_RANGE_STEP))
    for key, rows in _alike(soft, _octaves(asked, thickness), thin):
        unit = scene.layer.thickness if power else _RANGE_STEP ** key[2]
        base = None
        if np.isfinite(key[0]) and body.base is not None:
            # The hardest of the group needs the largest contact radius for its range.
            ratio = _RATIO_STEP ** (key[0] + 0.5) * body.layer.theta / body.base.theta
            base = isotropic_constants(ratio * body.base.E, body.base.nu)
        compiled = _compiled(asked, key, partial(LayerKernel, body.layer.plane_constants, base), unit, key[1])
        if compiled is not None:
            under = None if outer is None else _take(outer, rows)
            yield rows, compiled.curves(_take(inner, rows), under, thickness[rows]), theta[rows]


def _stack_groups(
    asked: ParameterSets, stack: StackKernel, varying: Mapping[str, FloatArray]
) -> Iterator[_Group]:
    """Groups of sets of a stack of layers of which all ratios in `varying`, (sets,), and the range are alike.

    The nodes are checked by doubling at the group's middle.
    """
    scene = asked.forward.similarity.scene
    thickness = asked.column("layer.thickness")[:, 0]
    steps = [np.round(np.log(ratio) / np.log(_STACK_RATIO_STEP)) for ratio in varying.values()]
    for key, rows in _alike(*steps, _octaves(asked, thickness)):
        middle = dict(zip(varying, np.power(_STACK_RATIO_STEP, key[:-1]).tolist(), strict=True))

        def kernel(middle: dict[str, float] = middle) -> Kernel:
            return scene.with_values(middle).contact.kernel

        compiled = _compiled(asked, key, kernel, scene.layer.thickness, key[-1])
        if compiled is not None:
            own, theta = _stacked(asked, stack, rows)
            yield rows, compiled.curves_of(own.one_minus_L(compiled.u)), theta


def _octaves(asked: ParameterSets, thickness: FloatArray) -> FloatArray:
    """Logarithm of each set's range over the thickness (m), (sets,), in steps of the grouping."""
    return np.asarray(
        np.ceil(np.log(np.maximum(_MARGIN * asked.varpi(thickness), 1e-3)) / np.log(_RANGE_STEP))
    )


def _alike(*numbers: FloatArray) -> Iterator[tuple[tuple[float, ...], NDArray[np.intp]]]:
    """Rows of the sets that share all of their numbers, (sets,) each, with these numbers."""
    keys = np.column_stack(numbers)
    for key in np.unique(keys, axis=0):
        yield tuple(key.tolist()), np.flatnonzero((keys == key).all(axis=1))


def _compiled(
    asked: ParameterSets,
    key: tuple[float, ...],
    kernel: Callable[[], Kernel],
    thickness: float,
    octave: float,
) -> ExactBatch | None:
    """Solver compiled for one group, kept in the problem's store; None where no law reaches so deep.

    Parameters
    ----------
    asked : ParameterSets
        All sets.
    key : tuple of float
        Numbers that the sets of the group share.
    kernel : callable
        Function that gives the kernel at the group's middle or harder end.
    thickness : float
        Thickness of the layer (m).
    octave : float
        Logarithm of the group's range over the thickness, in steps of the grouping.
    """
    laws, indenter = asked.forward.laws, asked.forward.similarity.scene.indenter
    kept = laws.store.batches
    if (laws.number, key) not in kept:
        deep = float(indenter.power_law.abel(np.array(_RANGE_STEP**octave * thickness)))
        depth = min(deep, _SHAPE_SHARE * largest_halfspace_depth(indenter))
        try:
            kept[laws.number, key] = ExactBatch.compile(
                indenter, kernel(), thickness=thickness, max_depth=depth, rtol=_SPARE * asked.rtol
            )
        except InputError:
            kept[laws.number, key] = None
    return kept[laws.number, key]


def _stacked(
    asked: ParameterSets, stack: StackKernel, rows: NDArray[np.intp]
) -> tuple[Recursion, FloatArray]:
    """Kernel of the stack for some of the sets, and half the indentation modulus of its surface (Pa), (rows,)."""
    parts = ["layer", *(f"substrate.layers[{number}]" for number in range(len(stack.layers) - 1))]
    constants = [_constants(asked, part, rows) for part in parts]
    base = None if stack.base.plane_constants is None else _constants(asked, "substrate", rows)
    thicknesses = [asked.column(f"{part}.thickness")[rows] for part in parts]
    bonds = [layer.bond for layer in stack.layers]
    return Recursion(*sheets_of(constants, base, thicknesses, bonds)), np.asarray(constants[0].theta)[:, 0]


def _constants(asked: ParameterSets, part: str, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane elastic constants of one layer or of the base, for some of the sets, entries (rows, 1).

    `part` is the path of the layer or base, such as ``"layer"``.
    """
    axial = f"{part}.E_axial" in asked.values
    names = ("E", "E_axial", "nu", "nu_axial", "G_axial") if axial else ("E", "nu")
    numbers = [asked.column(f"{part}.{name}")[rows] for name in names]
    return (transversely_isotropic_constants if axial else isotropic_constants)(*numbers)


def _take(constants: PlaneConstants, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane elastic constants of the sets at `rows`, entries (rows, 1)."""
    return PlaneConstants(*(np.asarray(entry)[rows] for entry in constants))
