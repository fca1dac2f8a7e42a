"""The forward model for many parameter sets at once, as a sampler needs it.

The elastic laws of the sets are computed together by `laws_of_sets`, of an adhesive contact by a table of adhesive
laws (`AdhesionTable`), and where neither is possible set by set, through `Forward.reading`: so DMT and a flat punch
without slip, a law and 1 to 2 ms a set, and Maugis, two tenths of a second. On them follow, for all sets together
where that is possible: corrections for friction and finite strain, which combine the frictionless and the no-slip
law; the memory of the sample, on the forces of the elastic sets or by itself; and a compliant frame, or a
cantilever that bends by other than what was subtracted, whose depths are found by Newton's method.

The derivatives serve a search from many starts, whose time goes into calls and not arithmetic. They need laws that
give theirs (`laws_of_sets`, and a layer that stiffens on one law); all else goes one by one (`Forward.jacobian`).

The result of a set does not depend on the other sets of the batch: a chain can be repeated bit by bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward, LeftOutLaws
from underlay.inference.model.law_slopes import slope_by_factors
from underlay.inference.model.laws_of_sets import SetLaws, can_batch_depths, laws_of_sets
from underlay.inference.model.on_law import OnLinear
from underlay.inference.model.parameter_sets import (
    ParameterSets,
    Readings,
    Values,
    is_shaped_by_lengths,
    set_by_set,
    upright,
)
from underlay.mechanics.contact import AdhesionTable
from underlay.mechanics.response import WholeHistory, checked_times
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH
from underlay.scene.instrument import Chain, ContactDepth, Frame


def batched_readings(forward: Forward, values: Values, sets: int, *, stiffness: bool = True) -> Readings:
    """Model of one curve at many parameter sets.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    stiffness : bool, default True
        Whether to compute the contact stiffness; it is left zero otherwise.

    Returns
    -------
    Readings
        Its `possible` is False for a set without a law, whose row is zero.
    """
    found = _together(forward, values, sets, stiffness=stiffness)
    if found is None:
        return set_by_set(forward, values, Readings.empty(sets, forward.depth.shape[-1]), stiffness=stiffness)
    return found


def _together(forward: Forward, values: Values, sets: int, *, stiffness: bool) -> Readings | None:
    """Readings of all sets, the most of them computed together; None where each must be computed alone."""
    if forward.bends(values):
        return _bending(forward, values, sets)
    if forward.history is not None:
        return None if stiffness else _remembered(forward, values, sets)
    if forward.left_out is not None:
        return _with_left_out(forward, values, sets, forward.left_out, stiffness=stiffness)
    if is_shaped_by_lengths(forward):
        return None
    if forward.similarity.energies:
        return _sticking(forward, values, sets)
    return _of_this_depth(forward, values, sets, stiffness=stiffness)


def _of_this_depth(forward: Forward, values: Values, sets: int, *, stiffness: bool) -> Readings | None:
    """Readings of all sets of a sample whose force depends on depth alone; None where each must be alone."""
    # The links give travel and offsets only: the deflection of the frame is found for all sets here.
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    if not np.any(values[Frame.path]):
        return _elastic(asked, stiffness=stiffness)
    if not can_batch_depths(asked):
        return None
    found = _given_way(forward, values, sets)
    return found._replace(force=asked.instrument_force(found.contact))


def _elastic(asked: ParameterSets, *, stiffness: bool) -> Readings | None:
    """`_of_this_depth` without a frame; sets that the laws computed together leave out are computed one by one."""
    laws = laws_of_sets(asked, stiffness=stiffness)
    if laws is None:
        return None
    readings = Readings(laws.force, laws.stiffness, asked.instrument_force(laws.force), laws.possible)
    return set_by_set(asked.forward, asked.values, readings)


def _remembered(forward: Forward, values: Values, sets: int) -> Readings | None:
    """Readings of all sets of a sample with memory, without stiffness; None where that is each alone.

    A relaxing layer is served during loading and unloading, whatever the contact point of a set, and a memory that
    gives the forces of many sets itself. Motions without a closed construction, such as a second cycle, and a
    compliant frame are computed one by one.
    """
    if isinstance(forward.history, WholeHistory):
        found = _whole_histories(forward.history, forward, values, sets)
    else:
        found = _relaxing(forward, values, sets)
    if found is None:
        return None
    contact, possible, left = found
    possible[left] = False
    force = Chain.of(upright(values)).reading(contact, forward.depth)
    readings = Readings(contact, np.zeros_like(contact), force, possible)
    return set_by_set(forward, values, readings, left.tolist(), stiffness=False)


#: Contact force (N), (sets, n), which sets have a law, (sets,), and rows that must be computed one by one.
_Forces: TypeAlias = tuple[FloatArray, NDArray[np.bool_], NDArray[np.intp]]


def _whole_histories(history: WholeHistory, forward: Forward, values: Values, sets: int) -> _Forces | None:
    """Forces of a memory that gives the force of a whole motion itself; None where it cannot treat many sets."""
    depth = Chain.of(upright(values)).travel(forward.depth)
    found = history.answers(values, sets, depth, checked_times(forward.time, np.atleast_2d(depth)[0]))
    if found is None:
        return None
    force, answered = found
    return force, answered, np.flatnonzero(~answered)


def _relaxing(forward: Forward, values: Values, sets: int) -> _Forces | None:
    """Forces of relaxing layers, elastic first and then the memory of all sets; None where not possible."""
    from underlay.mechanics.viscoelastic.history import Viscoelastic, forces_of_sets  # noqa: PLC0415  few scenes

    history, time = forward.history, forward.time
    if not isinstance(history, Viscoelastic) or time is None or np.any(values[Frame.path]):
        return None
    contact = np.broadcast_to(values[ContactDepth.path], sets)
    depth = np.broadcast_to(forward.depth, (sets, forward.depth.shape[-1])) - contact[:, None]
    prefix = f"{history.prefix}."
    own = {
        path.removeprefix(prefix): np.broadcast_to(value, sets)
        for path, value in values.items()
        if path.startswith(prefix)
    }
    known = history.relaxation.modes_of(own)
    if known is None:
        return None
    modes, possible = known
    # A modulus that is not finite at once must not meet a sudden step.
    sudden = possible & (depth[:, 0] > 0.0) & (not history.relaxation.bounded)
    asked, left = np.flatnonzero(possible & ~sudden), np.flatnonzero(sudden)
    force = np.zeros(depth.shape)
    if asked.size:
        still = {**values, ContactDepth.path: 0.0}

        def loads(rows: NDArray[np.intp], w: FloatArray) -> FloatArray:
            of = asked[rows]
            own = {path: v[of] if isinstance(v, np.ndarray) else v for path, v in still.items()}
            same = replace(forward, history=None, time=None, depth=w)
            found = batched_readings(same, own, len(of), stiffness=False)
            possible[of] &= found.possible
            return found.contact

        force[asked], closed = forces_of_sets(modes.of(asked), loads, depth[asked], time)
        left = np.append(left, asked[~closed])
    return force, possible, left


def _with_left_out(
    forward: Forward, values: Values, sets: int, left_out: LeftOutLaws | OnLinear, *, stiffness: bool
) -> Readings | None:
    """Readings of all sets of a law with corrections; None where each must be computed alone."""
    if isinstance(left_out, OnLinear):
        from underlay.inference.model.on_law_batch import on_law_readings  # noqa: PLC0415  few scenes

        return on_law_readings(forward, values, sets, left_out, stiffness=stiffness)
    if stiffness or np.any(values[Frame.path]):
        # A frame gives way under the whole force: its depths are those of one law at a time.
        return None
    bare = replace(forward, left_out=None)
    slides = batched_readings(bare, values, sets, stiffness=False)
    sticks = batched_readings(bare.solved_by(bare.laws.solver.without_slip), values, sets, stiffness=False)
    asked, columns = ParameterSets(bare, values, sets), upright(values)
    free, held = slides.contact, sticks.contact
    strained = columns[FINITE_STRAIN_PATH] * left_out.excess(forward, columns, asked.tip)
    strained = strained + columns[BOTH_PATH] * left_out.further(columns, held, free, asked.tip)
    contact = free + columns[FRICTION_PATH] * (held - free) + free * strained
    possible = slides.possible & sticks.possible
    return Readings(contact, np.zeros_like(contact), asked.instrument_force(contact), possible)


# Newton's method ends where the tip's depth changes by less than this share of the range of depth, or after so many
# steps.
_SETTLED, _MOST_STEPS = 1e-9, 50


def _sticking(forward: Forward, values: Values, sets: int) -> Readings | None:
    """Readings of all sets of an adhesive contact from its table of laws, a frame included; None without one."""
    # The table solves for the tip's depth itself: the links give travel and offsets only.
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    table, work, ratio = _adhesion_table(asked)
    if table is None:
        return None
    b, c = asked.factors
    compliance = np.broadcast_to(b * c * values[Frame.path], (sets,))
    found = table.readings(work, b[:, None] * asked.tip, compliance, ratio)
    contact, stiffness = c[:, None] * found.force, (b * c)[:, None] * found.stiffness
    readings = Readings(contact, stiffness, asked.instrument_force(contact), found.possible)
    return set_by_set(forward, values, readings)


def _adhesion_table(asked: ParameterSets) -> tuple[AdhesionTable | None, FloatArray, FloatArray | None]:
    """Table of the sets' adhesive laws, None if there is none, with the places at which to read it.

    These are the works of adhesion (sets,), scaled as by `Similarity.reduced`, and the ratio of moduli (sets,) that
    varies, None where none does.
    """
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
    """Pull-off force (N) and depth (m) of many parameter sets, each (sets,); None without a table for all of them.

    Parameters are those of `batched_readings`.
    """
    if not forward.similarity.energies or is_shaped_by_lengths(forward):
        return None
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    table, work, ratio = _adhesion_table(asked)
    if table is None:
        return None
    b, c = asked.factors
    force, depth = table.pull_offs(work, ratio)
    return (c * force, depth / b) if np.isfinite(force + depth).all() else None


def _bending(forward: Forward, values: Values, sets: int) -> Readings | None:
    """Readings of all sets with a cantilever that bends by other than its calibration assumed.

    What was subtracted from the depths for its bending is then wrong. None where sets of unlike depths cannot be
    computed together.
    """
    if forward.left_out is not None or is_shaped_by_lengths(forward):
        return None
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    beyond = np.broadcast_to(forward.lever_compliances(values), sets)
    offset = asked.instrument_force(np.zeros(asked.tip.shape))
    rigid = replace(forward, depth=forward.depth - beyond[:, None] * offset, bending=None, is_rigid=True)
    gives = {**values, Frame.path: values[Frame.path] + beyond}
    if forward.similarity.energies:
        found = _sticking(rigid, gives, sets)
    else:
        found = _given_way(rigid, gives, sets) if can_batch_depths(asked) else None
    return None if found is None else found._replace(force=asked.instrument_force(found.contact))


def _given_way(forward: Forward, values: Values, sets: int) -> Readings:
    """Readings of all parameter sets with a frame or cantilever in series, by Newton's method (`Frame`).

    The compliance in `values` (m/N), (sets,), may have either sign.
    """
    compliance = np.broadcast_to(values[Frame.path], sets)[:, None]
    stiff = {**values, Frame.path: 0.0}
    reading = np.array(np.broadcast_to(forward.depth, (sets, forward.depth.shape[-1])))
    depth, is_open = reading.copy(), np.ones(sets, dtype=bool)
    small = _SETTLED * np.ptp(reading, axis=1)
    for _ in range(_MOST_STEPS):
        found = batched_readings(replace(forward, depth=depth), stiff, sets)
        share = 1.0 + compliance * found.stiffness
        stands = found.possible & (share > 0.0).all(axis=1)
        step = np.zeros_like(depth)
        step[stands] = ((depth - reading + compliance * found.contact) / share)[stands]
        is_open &= stands & (np.abs(step).max(axis=1) > small)
        if not is_open.any():
            break
        # A set that has converged is not moved further, so that its result does not depend on the other sets.
        depth -= np.where(is_open[:, None], step, 0.0)
    return found._replace(possible=stands & ~is_open)


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
    return Frame.path not in paths and not np.any(values[Frame.path])


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
    if on_law is None:
        laws = laws_of_sets(asked, stiffness=True, slopes=True)
    else:
        from underlay.inference.model.on_law_batch import on_law_slopes  # noqa: PLC0415  as above

        laws = on_law_slopes(forward, values, sets, on_law, paths)
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


def _slope(asked: ParameterSets, path: str, laws: SetLaws) -> FloatArray:
    """Derivative of the force in the parameter at `path` (SI), (sets, n), at fixed tip depth."""
    similarity = asked.forward.similarity
    total = slope_by_factors(similarity, path, asked.values, asked.tip, laws.force, laws.stiffness)
    if path in laws.through_ratios:
        total += laws.through_ratios[path]
    return np.asarray(total / asked.column(path))
