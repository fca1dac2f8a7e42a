"""The forward model for many parameter sets at once, as a sampler asks for it.

Seven ways, the first that applies:

1. something adheres, and of the ratios only that of the work of adhesion may vary: the sets are read off the
   adhesion's own table (`Adhesion.table`), a frame's compliance included;
2. no ratio varies between the sets: one law of the reference serves them all through `Similarity`'s factors;
3. one ratio alone varies: every set's curve is read off the table of its cell (`curve_family`);
4. a tip sticks to the surface or is a sphere, and one ratio alone varies: the sets are read off a surface in it and
   the depth (`ratio_surface`);
5. the solver says that `ExactBatch` gives its laws (an isotropic layer on an isotropic or rigid base): the sets
   go through it, in groups whose stiffness ratio and range are alike;
6. moduli and thicknesses of a stack vary: through `ExactBatch` too, in groups of like ratios;
7. otherwise set by set, through `Forward.reading`: so DMT and a flat punch that sticks, a law and 1 to 2 ms a set,
   and Maugis, two tenths of a second.

A sample that remembers goes one of these ways with its elastic force, and then through its memory (see
`remembered_batch.py`).

A set's answer does not depend on the company it is asked in: a chain can be repeated bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.inference.model.exact_groups import exact_groups
from underlay.inference.model.forward import Forward
from underlay.inference.model.parameter_sets import ParameterSets, Values, values_of
from underlay.inference.model.stack_groups import has_stack_batches, stack_groups, stacked
from underlay.inference.model.tables import OneRatio
from underlay.mechanics.contact import AdhesionTable
from underlay.mechanics.exact.family_batch import family_batch
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.plane_constants import PlaneConstants, isotropic_constants
from underlay.scene.chain import Frame

# A lever's tip is where it is to this share of the depths.
_SETTLED, _MOST_STEPS = 1e-9, 50

__all__ = ["Readings", "batched_pull_offs", "batched_readings", "by_one_law", "has_batches"]


class Readings(NamedTuple):
    """Contact force (N), stiffness (N/m), instrument force (N), (sets, n), and which sets exist."""

    contact: FloatArray
    stiffness: FloatArray
    force: FloatArray
    possible: NDArray[np.bool_]

    @classmethod
    def empty(cls, sets: int, points: int) -> Readings:
        """Room for `sets` sets, none of which exists yet."""
        contact, stiffness, force = (np.zeros((sets, points)) for _ in range(3))
        return cls(contact, stiffness, force, np.zeros(sets, dtype=bool))


def batched_readings(forward: Forward, values: Values, sets: int, *, stiffness: bool = True) -> Readings:
    """Model of one curve at many parameter sets.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many.
    stiffness : bool, default True
        Without it the stiffness is left zero, for a likelihood that does not ask.

    Returns
    -------
    Readings
        A set without a law does not exist; its row is zero.
    """
    empty = Readings.empty(sets, forward.depth.shape[-1])
    if forward.bends(values):
        return _bending(forward, values, empty)
    if forward.history is not None:
        return _remembered(forward, values, empty, stiffness=stiffness)
    if forward.left_out is not None:
        return _with_left_out(forward, values, empty, stiffness=stiffness)
    if _is_shaped_by_lengths(forward):
        return _one_by_one(forward, values, range(sets), empty)
    return _of_this_depth(forward, values, empty, stiffness=stiffness)


def has_batches(forward: Forward, values: Values, sets: int) -> bool:
    """Whether sets of a sample without memory or adhesion go through compiled batches of the exact law."""
    elsewhere = forward.history is not None or forward.similarity.energies or forward.laws.table is not None
    gives = forward.bends(values) or bool(np.any(values[Frame.path]))
    if elsewhere or _is_shaped_by_lengths(forward) or gives:
        return False
    asked = ParameterSets(forward, values, sets)
    return asked.shared is None and _has_exact_batches(asked)


def _of_this_depth(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """All sets of a sample whose force depends on the depth alone."""
    sets = len(empty.possible)
    if forward.similarity.energies:
        return _sticking(forward, values, sets)
    if np.any(values[Frame.path]):
        return _one_by_one(forward, values, range(sets), empty)
    return _of_ratios(ParameterSets(forward, values, sets), empty, stiffness=stiffness)


def _of_ratios(asked: ParameterSets, empty: Readings, *, stiffness: bool) -> Readings:
    """All sets by what of their ratios varies."""
    table = asked.forward.laws.table
    entry = None if stiffness else _entry_of_surfaces(asked)
    if asked.shared is not None:
        readings = by_one_law(asked, asked.shared, stiffness=stiffness)
    elif table is not None:
        readings = _from_tables(asked, table, stiffness=stiffness)
    elif entry is not None:
        readings = _on_surfaces(asked, entry)
    elif _has_exact_batches(asked):
        readings = _in_groups(asked, stiffness=stiffness)
    elif has_stack_batches(asked):
        readings = _in_stack_groups(asked, stiffness=stiffness)
    else:
        readings = _one_by_one(asked.forward, asked.values, range(asked.sets), empty)
    return readings


def _bending(forward: Forward, values: Values, empty: Readings) -> Readings:
    """All sets of a lever that bends beyond what was taken off; what goes set by set otherwise does so here."""
    sets = len(empty.possible)
    if forward.left_out is not None or _is_shaped_by_lengths(forward):
        return _one_by_one(forward, values, range(sets), empty)
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    beyond = np.broadcast_to(forward.lever_compliances(values), sets)
    offset = asked.instrument_force(np.zeros(asked.tip.shape))
    unbent = replace(forward, depth=forward.depth - beyond[:, None] * offset, bending=None, is_unbent=True)
    gives = {**values, Frame.path: values[Frame.path] + beyond}
    if forward.similarity.energies:
        found = _sticking(unbent, gives, sets)
    elif _is_in_company(asked):
        found = _given_way(unbent, gives, empty)
    else:
        found = _one_by_one(unbent, gives, range(sets), empty)
    return found._replace(force=asked.instrument_force(found.contact))


def _is_in_company(asked: ParameterSets) -> bool:
    """Whether sets that differ in their depths go together."""
    tabulated = asked.shared is not None or asked.forward.laws.table is not None
    return tabulated or _has_exact_batches(asked) or has_stack_batches(asked)


def _given_way(forward: Forward, values: Values, empty: Readings) -> Readings:
    """All sets of a frame or lever of a compliance (m/N), (sets,), of either sign, by Newton's method (`Frame`)."""
    sets = len(empty.possible)
    compliance = np.broadcast_to(values[Frame.path], sets)[:, None]
    stiff = {**values, Frame.path: 0.0}
    told = np.array(np.broadcast_to(forward.depth, empty.contact.shape))
    depth, is_open = told.copy(), np.ones(sets, dtype=bool)
    small = _SETTLED * np.ptp(told, axis=1)
    for _ in range(_MOST_STEPS):
        found = _of_ratios(
            ParameterSets(replace(forward, depth=depth), stiff, sets), _emptied(empty), stiffness=True
        )
        share = 1.0 + compliance * found.stiffness
        stands = found.possible & (share > 0.0).all(axis=1)
        step = np.zeros_like(depth)
        step[stands] = ((depth - told + compliance * found.contact) / share)[stands]
        is_open &= stands & (np.abs(step).max(axis=1) > small)
        if not is_open.any():
            break
        # A set that has settled stays: its answer does not depend on the company.
        depth -= np.where(is_open[:, None], step, 0.0)
    return found._replace(possible=stands & ~is_open)


def _emptied(room: Readings) -> Readings:
    return Readings.empty(*room.contact.shape)


def _remembered(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """All sets of a sample that remembers: together where they can, else one by one."""
    # Not loaded for a sample that does not remember.
    from underlay.inference.model.remembered_batch import remembered_readings  # noqa: PLC0415  see above

    sets = len(empty.possible)
    together = None if stiffness else remembered_readings(forward, values, sets, batched_readings)
    if together is not None:
        contact, force, possible, left = together
        possible[left] = False
        readings = Readings(contact, empty.stiffness, force, possible)
        return _one_by_one(forward, values, left.tolist(), readings, stiffness=False)
    return _one_by_one(forward, values, range(sets), empty, stiffness=stiffness)


def _with_left_out(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """All sets of a law with what it leaves out: together where they can, else one by one."""
    # Not loaded for a scene without it.
    from underlay.inference.model.left_out_batch import left_out_readings  # noqa: PLC0415  see above

    sets = len(empty.possible)
    found = None if stiffness else left_out_readings(forward, values, sets, _forces)
    return _one_by_one(forward, values, range(sets), empty) if found is None else Readings(*found)


def _forces(forward: Forward, values: Values, sets: int) -> Readings:
    return batched_readings(forward, values, sets, stiffness=False)


def _is_shaped_by_lengths(forward: Forward) -> bool:
    """Whether the tip's shape varies otherwise than through one coefficient."""
    return any(path.startswith(("indenter.", "layer.thickness")) for path in forward.similarity.direct)


def _one_by_one(
    forward: Forward, values: Values, rows: Iterable[int], readings: Readings, *, stiffness: bool = True
) -> Readings:
    """Put the readings of some sets into `readings`; a set without a law is left out."""
    for row in rows:
        try:
            one = forward.of_set(row).reading(values_of(values, row), stiffness=stiffness)
        except InputError:
            continue
        readings.contact[row], readings.stiffness[row] = one.contact, one.stiffness
        readings.force[row] = one.force
        readings.possible[row] = True
    return readings


def _sticking(forward: Forward, values: Values, sets: int) -> Readings:
    """All sets off the tables of their adhesion; those that these do not reach, or that have none, one by one."""
    # A table solves for the tip's depth itself: the chain is asked for travel and offsets alone.
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    table, work, ratio = _adhesion_table(asked)
    if table is None:
        return _one_by_one(forward, values, range(sets), Readings.empty(sets, forward.depth.shape[-1]))
    b, c = asked.factors
    compliance = np.broadcast_to(b * c * values[Frame.path], (sets,))
    found = table.readings(work, b[:, None] * asked.tip, compliance, ratio)
    contact, stiffness = c[:, None] * found.force, (b * c)[:, None] * found.stiffness
    readings = Readings(contact, stiffness, asked.instrument_force(contact), found.possible)
    return _one_by_one(forward, values, np.flatnonzero(~found.possible).tolist(), readings)


def _adhesion_table(asked: ParameterSets) -> tuple[AdhesionTable | None, FloatArray, FloatArray | None]:
    """Table of the sets' adhesion, if they have one, their works, and their ratio of moduli where it varies."""
    similarity = asked.forward.similarity
    ratios = dict(zip(similarity.ratio_paths, asked.ratios, strict=True))
    work = np.broadcast_to(ratios.pop(similarity.energies[0]), (asked.sets,))
    varying = [path for path, ratio in ratios.items() if isinstance(ratio, np.ndarray)]
    if len(varying) > 1 or not set(varying) <= set(similarity.moduli):
        return None, work, None
    fixed = {path: float(ratio) for path, ratio in ratios.items() if path not in varying}
    table = asked.forward.laws.adhesion_table(fixed, varying[0] if varying else None)
    return table, work, np.asarray(ratios[varying[0]]) if varying else None


def batched_pull_offs(forward: Forward, values: Values, sets: int) -> tuple[FloatArray, FloatArray] | None:
    """Pull-off force (N) and depth (m) of many parameter sets, each (sets,); None without a table for them all."""
    if not forward.similarity.energies or _is_shaped_by_lengths(forward):
        return None
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    table, work, ratio = _adhesion_table(asked)
    if table is None:
        return None
    b, c = asked.factors
    force, depth = table.pull_offs(work, ratio)
    return (c * force, depth / b) if np.isfinite(force + depth).all() else None


def by_one_law(asked: ParameterSets, reduced: tuple[float, ...], *, stiffness: bool) -> Readings:
    """All sets through one law, another only where the range it needs belongs to another span."""
    readings = Readings.empty(asked.sets, asked.forward.depth.shape[-1])
    b, c = asked.factors
    depth = b * asked.deepest
    spans = asked.forward.laws.spans(depth)
    alone: list[int] = []
    for span in np.unique(spans):
        rows = np.flatnonzero(spans == span)
        try:
            law = asked.forward.reference_law(reduced, float(depth[rows].max()))
            w = b[rows, None] * asked.tip[rows]
            if stiffness:
                force, slope = law.force_and_stiffness(w)
                readings.stiffness[rows] = (b * c)[rows, None] * slope
            else:
                force = law.force(w)
            readings.contact[rows] = c[rows, None] * force
        except InputError:
            # One of them is out of reach: the others are not.
            alone += rows.tolist()
            continue
        readings.possible[rows] = True
    readings = readings._replace(force=asked.instrument_force(readings.contact))
    return _one_by_one(asked.forward, asked.values, alone, readings)


def _from_tables(asked: ParameterSets, table: OneRatio, *, stiffness: bool) -> Readings:
    """All sets through the tables of the exact law; those without a table one by one."""
    scene = asked.forward.similarity.scene
    if not isinstance(scene.indenter, PowerLawShape):
        raise TypeError(f"only power-law tips are tabulated, not {scene.indenter!r}")
    if table.family is None:
        raise TypeError("one body alone needs no table of many")
    layer_E, nu = asked.column("layer.E")[:, 0], float(asked.values["layer.nu"])
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    # On a rigid base no ratio varies: there one law serves all.
    curves = family_batch(
        scene.indenter,
        family=table.family,
        ratio=asked.column(table.path)[:, 0] / asked.column(table.over)[:, 0],
        varpi=asked.varpi(thickness),
        rtol=asked.rtol,
    )
    theta = asked.gain * np.asarray(isotropic_constants(layer_E, nu).theta, dtype=np.float64)
    arguments = (asked.tip, theta, thickness, asked.abel_coefficients())
    contact = curves.force(*arguments)
    slopes = curves.stiffness(*arguments) if stiffness else np.zeros_like(contact)
    possible = curves.error_estimate <= asked.rtol
    readings = Readings(contact, slopes, asked.instrument_force(contact), possible)
    return _one_by_one(asked.forward, asked.values, np.flatnonzero(~possible).tolist(), readings)


def _has_exact_batches(asked: ParameterSets) -> bool:
    """Whether the exact law of an isotropic layer on an isotropic or rigid base may be taken."""
    laws = asked.forward.laws
    fixed_shape = isinstance(laws.contact.indenter, PowerLawShape) or not asked.varies("indenter.radius")
    return fixed_shape and laws.solver.has_batches(laws.contact)


def _in_groups(asked: ParameterSets, *, stiffness: bool) -> Readings:
    """All sets through compiled batches of the exact law."""
    readings = Readings.empty(asked.sets, asked.forward.depth.shape[-1])
    inner = isotropic_constants(asked.column("layer.E"), asked.column("layer.nu"))
    theta = np.asarray(inner.theta)[:, 0]
    outer, hardness = None, np.full(asked.sets, np.inf)
    if "substrate.E" in asked.values:
        outer = isotropic_constants(asked.column("substrate.E"), asked.column("substrate.nu"))
        hardness = np.asarray(outer.theta)[:, 0] / theta
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    abel = asked.abel_coefficients()
    alone: list[int] = []
    for rows, compiled in exact_groups(asked, hardness, thickness):
        if compiled is None:
            alone += rows.tolist()
            continue
        base = None if outer is None else _take(outer, rows)
        curves = compiled.curves(_take(inner, rows), base, thickness[rows])
        stiff = asked.gain[rows] * theta[rows]
        arguments = (asked.tip[rows], stiff, thickness[rows], None if abel is None else abel[rows])
        try:
            readings.contact[rows] = curves.force(*arguments)
            if stiffness:
                readings.stiffness[rows] = curves.stiffness(*arguments)
        except RangeError:
            # The shape ends before the group's range does: each set knows its own reach.
            alone += rows.tolist()
            continue
        fine = np.broadcast_to(curves.error_estimate <= asked.rtol, rows.size)
        readings.possible[rows[fine]] = True
        alone += rows[~fine].tolist()
    readings = readings._replace(force=asked.instrument_force(readings.contact))
    return _one_by_one(asked.forward, asked.values, alone, readings)


def _in_stack_groups(asked: ParameterSets, *, stiffness: bool) -> Readings:
    """All sets of a stack through compiled batches of the exact law."""
    readings = Readings.empty(asked.sets, asked.forward.depth.shape[-1])
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    abel = asked.abel_coefficients()
    alone: list[int] = []
    for rows, compiled in stack_groups(asked):
        if compiled is None:
            alone += rows.tolist()
            continue
        kernel, theta = stacked(asked, rows)
        curves = compiled.curves_of(kernel.one_minus_L(compiled.u))
        stiff = asked.gain[rows] * theta
        arguments = (asked.tip[rows], stiff, thickness[rows], None if abel is None else abel[rows])
        readings.contact[rows] = curves.force(*arguments)
        if stiffness:
            readings.stiffness[rows] = curves.stiffness(*arguments)
        fine = np.broadcast_to(curves.error_estimate <= asked.rtol, rows.size)
        readings.possible[rows[fine]] = True
        alone += rows[~fine].tolist()
    readings = readings._replace(force=asked.instrument_force(readings.contact))
    return _one_by_one(asked.forward, asked.values, alone, readings)


def _entry_of_surfaces(asked: ParameterSets) -> int | None:
    """Number of the one ratio that varies, where the laws are read off surfaces in it; else None."""
    laws = asked.forward.laws
    varying = [entry for entry, ratio in enumerate(asked.ratios) if isinstance(ratio, np.ndarray)]
    if len(varying) != 1 or not laws.solver.has_surfaces(laws.contact):
        return None
    # Of a tip that slides the laws of a surface are read off its tables, or it is dearer than what it saves.
    return varying[0] if laws.contact.sticks or laws.tips is not None else None


def _on_surfaces(asked: ParameterSets, entry: int) -> Readings:
    """All sets off surfaces; those without one by one."""
    # Not loaded for laws that have tables.
    from underlay.inference.model.ratio_surface import surfaces  # noqa: PLC0415  see above

    readings = Readings.empty(asked.sets, asked.forward.depth.shape[-1])
    b, c = asked.factors
    touching = np.flatnonzero(asked.deepest > 0.0)
    found = surfaces(
        asked.forward.laws, entry, asked.ratios, asked.ratios[entry][touching], (b * asked.deepest)[touching]
    )
    readings.possible[asked.deepest <= 0.0] = True
    for within, numbers, surface in found:
        if surface is not None:
            rows = touching[within]
            readings.contact[rows] = c[rows, None] * surface.force(numbers, b[rows, None] * asked.tip[rows])
            readings.possible[rows] = True
    readings = readings._replace(force=asked.instrument_force(readings.contact))
    alone = np.flatnonzero(~readings.possible).tolist()
    return _one_by_one(asked.forward, asked.values, alone, readings)


def _take(constants: PlaneConstants, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane constants of some of the sets, entries (rows, 1)."""
    return PlaneConstants(*(np.asarray(entry)[rows] for entry in constants))
