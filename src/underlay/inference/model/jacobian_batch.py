"""The forward model with its derivatives at several parameter sets at once, for a search from many starts.

The time of a search's step goes into calls, not arithmetic; here the same calls serve every start. Of three ways
the first that applies is taken: no ratio of moduli or lengths varies, and one law serves all; one ratio varies, and
the sets are read from tables over it, which give the derivative in it; tables of the flat punch give the laws of a
tip that is no power law. Layers that stiffen go on the first (`on_law_batch`). Samples with memory, other
corrections or adhesion, and compliant frames, go one by one (`Forward.jacobian`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward
from underlay.inference.model.groups import ParameterSets, Values
from underlay.inference.model.law_slopes import slope_by_factors
from underlay.inference.model.laws import OneRatio
from underlay.inference.model.on_law import OnLinear
from underlay.inference.model.ratio_batch import by_one_law, sets_of_a_tip
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact.table_laws import TipSets, family_batch
from underlay.mechanics.indenters import PowerLawShape
from underlay.scene.instrument import ContactDepth, Frame


class Jacobians(NamedTuple):
    """Force readings and their derivatives at many parameter sets.

    Parameters
    ----------
    force : FloatArray
        Force of the instrument (N), (sets, n).
    columns : FloatArray
        Its derivatives in k parameters (SI), (sets, k, n).
    possible : ndarray of bool (sets,)
        Which sets were computed.
    """

    force: FloatArray
    columns: FloatArray
    possible: NDArray[np.bool_]


class _Laws(NamedTuple):
    """Contact laws of many parameter sets at their depths.

    Parameters
    ----------
    force, stiffness : FloatArray
        Force P (N) and its derivative dP/dw (N/m) in the depth w, (sets, n).
    through_ratios : mapping of path to FloatArray
        The part of dP/d ln(number) (N) that comes from the ratios of moduli and lengths which the number at that
        path changes, (sets, n).
    possible : ndarray of bool (sets,)
        Which sets have a law accurate enough.
    """

    force: FloatArray
    stiffness: FloatArray
    through_ratios: Mapping[str, FloatArray]
    possible: NDArray[np.bool_]


def can_batch_jacobians(forward: Forward, values: Values, paths: Sequence[str]) -> bool:
    """Whether sets that differ in the parameters at `paths` can be computed together; `values` are all numbers."""
    if forward.history is not None or forward.bending is not None or forward.similarity.energies:
        return False
    if isinstance(forward.left_out, OnLinear):
        # Not loaded for a scene without it.
        from underlay.inference.model.on_law_batch import goes_on_one_law  # noqa: PLC0415  see above

        if not goes_on_one_law(forward.left_out, paths):
            return False
    elif forward.left_out is not None:
        return False
    return Frame.path not in paths and not _acts(values[Frame.path])


def _acts(value: float | FloatArray) -> bool:
    return bool(value.any() if isinstance(value, np.ndarray) else value)


def batched_jacobians(forward: Forward, values: Values, sets: int, paths: Sequence[str]) -> Jacobians | None:
    """Model of one curve at many parameter sets, and its derivatives in the parameters at `paths`.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    paths : sequence of str
        Free parameters.

    Returns
    -------
    Jacobians or None
        A set that is not possible here may be so when computed alone. None where the sets cannot be computed
        together.
    """
    if not can_batch_jacobians(forward, values, paths):
        return None
    asked = ParameterSets(forward, values, sets)
    over, ratio = forward.over, np.ones(())
    if over is not None:
        asked.tip, ratio = over.seen(asked.tip)
    on_law = forward.left_out if isinstance(forward.left_out, OnLinear) else None
    laws = _laws(asked) if on_law is None else _on_law(forward, values, sets, on_law, paths)
    if laws is None:
        return None
    stiffness = (
        laws.stiffness if over is None else over.stiffness(asked.tip, ratio, laws.force, laws.stiffness)
    )
    offsets = asked.chain.offset_slopes(forward.depth)
    columns = np.empty((sets, len(paths), laws.force.shape[-1]))
    for row, path in enumerate(paths):
        if path in offsets:
            columns[:, row] = offsets[path]
        elif path == ContactDepth.path:
            np.negative(stiffness, out=columns[:, row])
        else:
            slope = laws.through_ratios[path] if on_law is not None else _slope(asked, path, laws)
            columns[:, row] = slope if over is None else ratio * slope
    contact = laws.force if over is None else ratio * laws.force
    return Jacobians(asked.instrument_force(contact), columns, laws.possible)


def _on_law(
    forward: Forward, values: Values, sets: int, on_law: OnLinear, paths: Sequence[str]
) -> _Laws | None:
    """Laws of a layer that stiffens; `through_ratios` are the whole derivatives (SI)."""
    from underlay.inference.model.on_law_batch import on_law_slopes  # noqa: PLC0415  as in `goes_together`

    found = on_law_slopes(forward, values, sets, on_law, paths)
    if found is None:
        return None
    readings, slopes = found
    return _Laws(readings.contact, readings.stiffness, slopes, readings.possible)


def _laws(asked: ParameterSets) -> _Laws | None:
    laws = asked.forward.laws
    if asked.shared is not None:
        readings = by_one_law(asked, asked.shared, stiffness=True)
        return _Laws(readings.contact, readings.stiffness, {}, readings.possible)
    if laws.table is not None and laws.table.family is not None:
        return _tabulated(asked, laws.table)
    sets = sets_of_a_tip(asked)
    if sets is None or any(
        isinstance(asked.values[path], np.ndarray) for path in asked.forward.similarity.direct
    ):
        return None
    return _of_tips(asked, *sets)


def _of_tips(asked: ParameterSets, sets: TipSets, unit: FloatArray) -> _Laws | None:
    """Laws of all sets from the tables of the flat punch; None where the tip has no size.

    `unit` (m), (sets,), is the length in which `sets` counts the tip.
    """
    similarity, tips = asked.forward.similarity, asked.forward.laws.tips
    if not similarity.lengths or tips is None:
        return None
    b, c = (factor[:, None] for factor in asked.factors)
    unit = unit[:, None]
    said = sets.with_slopes(b / unit * asked.tip)
    theta = c * asked.forward.laws.contact.theta
    scale = theta * unit**2
    known = {tips.path: scale * said.in_ratio, similarity.lengths[0]: scale * said.in_size}
    moved: dict[str, FloatArray] = {}
    for path in (*similarity.moduli, *similarity.lengths, str(similarity.length)):
        ratio_slopes = similarity.ratio_slopes(path, similarity.values)
        if ratio_slopes:
            moved[path] = np.sum([slope * known[ratio] for ratio, slope in ratio_slopes.items()], axis=0)
    return _Laws(scale * said.force, theta * unit * b * said.stiffness, moved, said.known)


def _slope(asked: ParameterSets, path: str, laws: _Laws) -> FloatArray:
    """Derivative of the force in the parameter at `path` (SI), (sets, n), at fixed tip depth."""
    similarity = asked.forward.similarity
    total = slope_by_factors(similarity, path, asked.values, asked.tip, laws.force, laws.stiffness)
    if path in laws.through_ratios:
        total += laws.through_ratios[path]
    return np.asarray(total / asked.column(path))


def _tabulated(asked: ParameterSets, table: OneRatio) -> _Laws | None:
    """Laws of all sets from the tables over the one ratio that varies."""
    indenter = asked.forward.similarity.scene.indenter
    if not isinstance(indenter, PowerLawShape) or table.family is None:
        return None
    thickness = np.ascontiguousarray(asked.column("layer.thickness")[:, 0])
    curves = family_batch(
        indenter,
        family=table.family,
        ratio=asked.column(table.path)[:, 0] / asked.column(table.over)[:, 0],
        varpi=asked.varpi(thickness),
        rtol=asked.rtol,
        slopes=True,
    )
    of_one_pascal = float(isotropic_constants(1.0, float(asked.values["layer.nu"])).theta)
    theta = asked.gain * asked.column("layer.E")[:, 0] * of_one_pascal
    force, stiffness, slopes = curves.with_slopes(asked.tip, theta, thickness, asked.abel_coefficients())
    moved = {table.path: slopes[:, 0], table.over: -slopes[:, 0]}
    return _Laws(force, stiffness, moved, curves.error_estimate <= asked.rtol)
