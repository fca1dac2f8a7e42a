"""Many parameter sets of a sample without memory, computed together according to which of their ratios vary.

Laws that differ in one number, interpolated by a polynomial surface in that number and the depth.

For a no-slip contact, whose laws cost most, and for a sphere, whose size over the thickness no scaling removes.
Where of all ratios of a scene one alone varies between parameter sets (Poisson's ratio, a modulus of the base, a
radius over a thickness), the law of the reference is built at a few values of it, and ln(P/w^(1+1/p)) is a
polynomial in that number and in w^(1/p), to which the contact radius is proportional at first; P is the force at
the depth w, p the exponent of the tip's shape. Cells of the number and ranges of the depth are fixed, so that the
result of a set does not depend on the other sets of the batch. Where the number is a length of the tip, depths are
counted in it: a sphere ends on its own scale, and a curve's depth is known on it. The error of a surface is
measured at values and depths between its own, and one that is off by more than the tolerance is not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.polynomial import chebyshev
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
from underlay.inference.model.laws import LawSource, OneRatio
from underlay.mechanics.body import PlaneConstants, isotropic_constants
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.exact.table_laws import TipSets, family_batch
from underlay.mechanics.indenters import PowerLawShape
from underlay.quantities import kind_of

# Widths and edges of cells, of logarithms and of Poisson's ratios; 0.5 is an edge, beyond which nothing is solved.
_LOG_CELL, _LOG_EDGE = np.log(2.0), np.log(1.37)
_CELL, _EDGE = 0.1, 0.5
# Numbers of values and of terms in depth that are tried one after the other.
_VALUES, _TERMS = (6, 10, 16), (16, 32, 64)
# Places in the cell, in [-1, 1], and depths over the largest at which a surface is judged.
_JUDGED, _JUDGED_DEPTHS = np.array([-0.86, 0.31]), np.linspace(0.02, 0.99, 29) ** 2
# Shares of the tolerance: error of the laws behind a surface, and error that it may show where it is judged.
_SPARE, _SEEN = 0.2, 0.5


@dataclass(frozen=True)
class RatioSurface:
    """ln(P/w^(1+1/p)) over one cell of the varying number and depths w up to `reach`.

    P is the force at the depth w, p the exponent of the tip's shape.

    Parameters
    ----------
    low, high : float
        Ends of the cell, in the number or its logarithm.
    reach : float
        Largest depth of the reference (m), or over the tip's length if `in_lengths`.
    power : float
        1/p.
    in_lengths : bool
        Whether the number is a length of the tip, in which depths are counted, and not in metres.
    coefficients : ndarray (values, terms)
        Chebyshev coefficients in the place in the cell and in (w/reach)^(1/p), each mapped to [-1, 1].
    """

    low: float
    high: float
    reach: float
    power: float
    in_lengths: bool
    coefficients: FloatArray

    @classmethod
    def of(
        cls, source: LawSource, entry: int, ratios: tuple[float, ...], cell: float, octave: float
    ) -> Self | None:
        """Compute the surface of one cell of the varying ratio; None where that fails.

        It fails where a law of the cell does not exist, or the error exceeds the tolerance.

        Parameters
        ----------
        source : LawSource
            Source of the laws.
        entry : int
            Index of the ratio that varies.
        ratios : tuple of float
            As `Similarity.reduced` returns them; the entry that varies is not used.
        cell : float
            Number of the cell.
        octave : float
            Binary logarithm of the largest depth, as in `reach`.
        """
        width, edge = _cells(source, entry)
        low, high, reach = edge + (cell - 1.0) * width, edge + cell * width, float(np.exp2(octave))
        tolerance = source.solver.tolerance
        finer = replace(source, solver=source.solver.with_tolerance(_SPARE * tolerance), table=None)
        in_lengths = source.similarity.ratio_paths[entry] in source.similarity.lengths
        power = 1.0 / (source.similarity.exponent or 2.0)

        def logs(places: Sequence[float], shares: FloatArray) -> FloatArray:
            """ln(P/w^(1+1/p)), (places, n), at places in [-1, 1] in the cell and depths w as `shares` (n,).

            The shares are those of the largest depth.
            """
            numbers = [0.5 * (low + high + place * (high - low)) for place in places]
            values = [float(np.exp(number)) if _in_log(source, entry) else number for number in numbers]
            reduced = [(*ratios[:entry], value, *ratios[entry + 1 :]) for value in values]
            reaches = [reach * value if in_lengths else reach for value in values]
            finer.laws_of(reduced, reaches)
            asked = zip(reduced, reaches, strict=True)
            return np.array([_logs(finer.law(own, deep), deep * shares, power) for own, deep in asked])

        judged = _JUDGED_DEPTHS**power
        try:
            judge = logs(_JUDGED.tolist(), _JUDGED_DEPTHS)
            for values, terms in product(_VALUES, _TERMS):
                known = logs(_nodes(values).tolist(), (0.5 + 0.5 * _nodes(terms)) ** (1.0 / power))
                coefficients = _coefficients(_coefficients(known).T).T
                found = cls(low, high, reach, power, in_lengths, coefficients)
                off = found.logs(_JUDGED, np.tile(judged, (len(_JUDGED), 1))) - judge
                if np.abs(off).max() <= _SEEN * tolerance:
                    return found
        except InputError:
            return None
        return None

    def logs(self, place: FloatArray, root: FloatArray) -> FloatArray:
        """ln(P/w^(1+1/p)), (sets, n), at places in the cell (sets,) in [-1, 1] and (w/reach)^(1/p), (sets, n).

        P is the force at the depth w, p the exponent of the tip's shape.
        """
        # Not by a product of matrices: its last bit depends on how many sets there are.
        table = chebyshev.chebvander(place, len(self.coefficients) - 1)
        own = (table[:, :, None] * self.coefficients).sum(axis=1)
        z = 2.0 * root - 1.0
        return np.asarray(chebyshev.chebval(z, own.T[:, :, None], tensor=False))

    def force(self, number: FloatArray, depth: FloatArray) -> FloatArray:
        """Force (N), (sets, n), at values (sets,) of the number and depths (m) of the reference, (sets, n).

        The values are logarithms where the cell is one of logarithms.
        """
        place = 2.0 * (number - self.low) / (self.high - self.low) - 1.0
        reach = self.reach * np.exp(number)[:, None] if self.in_lengths else self.reach
        inside = np.where(depth > 0.0, depth, reach)
        # A square root costs a tenth of another power.
        root = inside**self.power
        force = np.exp(self.logs(place, root / reach**self.power)) * inside * root
        return np.where(depth > 0.0, force, 0.0)


def surfaces(
    source: LawSource, entry: int, ratios: tuple[float, ...], value: FloatArray, depth: FloatArray
) -> list[tuple[NDArray[np.intp], FloatArray, RatioSurface | None]]:
    """Assign sets to the surfaces that cover them, and compute missing surfaces.

    Parameters
    ----------
    source : LawSource
        Source of the laws.
    entry : int
        Index of the ratio that varies.
    ratios : tuple of float
        As `Similarity.reduced`; the entry that varies is not used.
    value : FloatArray
        Value of that ratio in each set, (sets,).
    depth : FloatArray
        Largest depth (m) of each set at the reference, (sets,), positive.

    Returns
    -------
    list of (ndarray of int, FloatArray, RatioSurface or None)
        Rows of the sets of one surface, their values as `RatioSurface.force` takes them, and the surface, None
        where there is none.
    """
    width, edge = _cells(source, entry)
    number = np.log(value) if _in_log(source, entry) else value
    in_lengths = source.similarity.ratio_paths[entry] in source.similarity.lengths
    scaled_depth = depth / value if in_lengths else depth
    keys = np.column_stack((np.ceil((number - edge) / width), np.ceil(np.log2(scaled_depth))))
    others = (*ratios[:entry], *ratios[entry + 1 :])
    kept = source.store.surfaces
    found = []
    for cell, octave in np.unique(keys, axis=0).tolist():
        rows = np.flatnonzero((keys == (cell, octave)).all(axis=1))
        key = (source.number, source.solver, entry, others, cell, octave)
        if key not in kept:
            kept[key] = RatioSurface.of(source, entry, ratios, cell, octave)
        surface = kept[key]
        found.append((rows, number[rows], surface if isinstance(surface, RatioSurface) else None))
    return found


def _in_log(source: LawSource, entry: int) -> bool:
    """Whether the ratio at index `entry` is interpolated in its logarithm: not a Poisson's ratio."""
    path = source.similarity.ratio_paths[entry]
    return path not in source.similarity.direct or kind_of(path) != "dimensionless"


def _cells(source: LawSource, entry: int) -> tuple[float, float]:
    """Width of the interpolation cells of the ratio at index `entry`, and one of their edges.

    Both are in the ratio or its logarithm, see `_in_log`.
    """
    return (_LOG_CELL, _LOG_EDGE) if _in_log(source, entry) else (_CELL, _EDGE)


def _nodes(count: int) -> FloatArray:
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def _logs(law: ContactLaw, depth: FloatArray, power: float) -> FloatArray:
    return np.asarray(np.log(law.force(depth) / depth ** (1.0 + power)))


def _coefficients(values: FloatArray) -> FloatArray:
    """Chebyshev coefficients (n, m) of the columns of values (n, m) at the Chebyshev nodes."""
    count = len(values)
    vander = chebyshev.chebvander(_nodes(count), count - 1)
    vander[:, 0] *= 0.5
    return np.asarray((2.0 / count) * vander.T @ values)


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
