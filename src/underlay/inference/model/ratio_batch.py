"""Many parameter sets of a sample without memory, computed together according to which of their ratios vary."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.inference.model.groups import (
    ParameterSets,
    Readings,
    exact_groups,
    has_stack_batches,
    set_by_set,
    stack_groups,
    stacked,
)
from underlay.inference.model.laws import OneRatio
from underlay.mechanics.body import PlaneConstants, isotropic_constants
from underlay.mechanics.exact.family_law import family_batch
from underlay.mechanics.exact.tip_law import TipSets
from underlay.mechanics.indenters import PowerLawShape

__all__ = ["by_one_law", "by_ratios", "can_batch_depths", "has_exact_batches", "sets_of_a_tip"]


def by_ratios(asked: ParameterSets, empty: Readings, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets, by the second to the seventh of the ways of `forward_batch`, else set by set.

    Parameters
    ----------
    asked : ParameterSets
        The sets.
    empty : Readings
        Zeros of the right shape, into which sets that are computed one by one are written.
    stiffness : bool
        Whether the stiffness is computed too; surfaces (`ratio_surface`) do not give it.
    """
    table, tips = asked.forward.laws.table, sets_of_a_tip(asked)
    entry = None if stiffness else _entry_of_surfaces(asked)
    if asked.shared is not None:
        readings = by_one_law(asked, asked.shared, stiffness=stiffness)
    elif table is not None:
        readings = _from_tables(asked, table, stiffness=stiffness)
    elif entry is not None:
        readings = _on_surfaces(asked, entry)
    elif tips is not None:
        readings = _off_tip_tables(asked, *tips, stiffness=stiffness)
    elif has_exact_batches(asked):
        readings = _in_groups(asked, stiffness=stiffness)
    elif has_stack_batches(asked):
        readings = _in_stack_groups(asked, stiffness=stiffness)
    else:
        readings = set_by_set(asked.forward, asked.values, range(asked.sets), empty)
    return readings


def can_batch_depths(asked: ParameterSets) -> bool:
    """Whether sets with different depth readings can be computed together."""
    tabulated = asked.shared is not None or asked.forward.laws.table is not None
    return tabulated or has_exact_batches(asked) or has_stack_batches(asked)


def by_one_law(asked: ParameterSets, reduced: tuple[float, ...], *, stiffness: bool) -> Readings:
    """Readings of all parameter sets by scaling one law, or one for each range of depth that they need.

    `reduced` are the ratios that all sets share, as `Similarity.reduced` returns them.
    """
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
    return set_by_set(asked.forward, asked.values, alone, readings)


def _from_tables(asked: ParameterSets, table: OneRatio, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets from tables of the exact law over the one ratio that varies.

    Sets that the tables do not cover are computed one by one.
    """
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
    return set_by_set(asked.forward, asked.values, np.flatnonzero(~possible).tolist(), readings)


def sets_of_a_tip(asked: ParameterSets) -> tuple[TipSets, FloatArray] | None:
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


def _off_tip_tables(asked: ParameterSets, sets: TipSets, unit: FloatArray, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets from tables of the flat punch, which serve tips that are no power law.

    Sets that the tables do not cover are computed one by one. `sets` and `unit` are what `sets_of_a_tip` returned.
    """
    b, c = asked.factors
    theta = (c * asked.forward.laws.contact.theta)[:, None]
    unit = unit[:, None]
    force, slope, possible = sets.forces(b[:, None] / unit * asked.tip, stiffness=stiffness)
    contact, slope = theta * unit**2 * force, theta * unit * b[:, None] * slope
    readings = Readings(contact, slope, asked.instrument_force(contact), possible)
    return set_by_set(asked.forward, asked.values, np.flatnonzero(~possible).tolist(), readings)


def has_exact_batches(asked: ParameterSets) -> bool:
    """Whether the sets can be computed by `ExactBatch`: an isotropic layer on an isotropic or rigid base."""
    laws = asked.forward.laws
    fixed_shape = isinstance(laws.contact.indenter, PowerLawShape) or not asked.varies("indenter.radius")
    return fixed_shape and laws.solver.has_batches(laws.contact)


def _in_groups(asked: ParameterSets, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets by `ExactBatch`, in groups of like stiffness ratio and range."""
    readings = Readings.empty(asked.sets, asked.forward.depth.shape[-1])
    inner = isotropic_constants(asked.column("layer.E"), asked.column("layer.nu"))
    theta = np.asarray(inner.theta)[:, 0]
    outer, stiffness_ratio = None, np.full(asked.sets, np.inf)
    if "substrate.E" in asked.values:
        outer = isotropic_constants(asked.column("substrate.E"), asked.column("substrate.nu"))
        stiffness_ratio = np.asarray(outer.theta)[:, 0] / theta
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    abel = asked.abel_coefficients()
    alone: list[int] = []
    for rows, compiled in exact_groups(asked, stiffness_ratio, thickness):
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
    return set_by_set(asked.forward, asked.values, alone, readings)


def _in_stack_groups(asked: ParameterSets, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets of a stack of layers by `ExactBatch`, in groups of like ratios and range."""
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
    return set_by_set(asked.forward, asked.values, alone, readings)


def _entry_of_surfaces(asked: ParameterSets) -> int | None:
    """Index of the one ratio that varies, where laws are interpolated over it by surfaces; else None."""
    laws = asked.forward.laws
    varying = [entry for entry, ratio in enumerate(asked.ratios) if isinstance(ratio, np.ndarray)]
    if len(varying) != 1 or not laws.solver.has_surfaces(laws.contact):
        return None
    # For a frictionless contact a surface is worth its cost only if its laws can be read from tables.
    return varying[0] if laws.contact.sticks or laws.tips is not None else None


def _on_surfaces(asked: ParameterSets, entry: int) -> Readings:
    """Readings of all parameter sets from surfaces (`RatioSurface`) over the ratio at index `entry`.

    Sets without a surface are computed one by one.
    """
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
    return set_by_set(asked.forward, asked.values, alone, readings)


def _take(constants: PlaneConstants, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane elastic constants of the sets at `rows`, entries (rows, 1)."""
    return PlaneConstants(*(np.asarray(entry)[rows] for entry in constants))
