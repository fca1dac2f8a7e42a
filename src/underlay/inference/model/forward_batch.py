"""The forward model for many parameter sets at once, as a sampler needs it.

The sets are computed in one of eight ways, the first that applies:

1. the contact is adhesive, and of the ratios only that of the work of adhesion may vary: the sets are read from
   a table of adhesive laws (`sticking`), a frame's compliance included;
2. no ratio varies between the sets: one law of the reference serves them all through `Similarity`'s factors; 3. one
ratio alone varies: every set's curve is read from tables over that ratio (`curve_family`); 4. a no-slip contact or
a sphere, and one ratio alone varies: the sets are read from a surface over that ratio and
   the depth (`ratio_surface`);
5. the tip is no power law and Poisson's ratios stay: the sets are read from tables of the flat punch (`TipSets`);
6. the solver's laws can be computed by `ExactBatch` (an isotropic layer on an isotropic or rigid base): the sets
   go through it, in groups whose stiffness ratio and range are alike;
7. moduli and thicknesses of a stack of layers vary: through `ExactBatch` too, in groups of like ratios; 8.
otherwise set by set, through `Forward.reading`: so DMT and a flat punch without slip, a law and 1 to 2 ms a set,
   and Maugis, two tenths of a second.

The second to the seventh are in `ratio_batch.py`, the last is `groups.set_by_set`. For a sample with memory the
elastic force is computed in one of these ways, and then the memory applied (`remembered_readings`). With a
compliant frame, or a cantilever that bends by other than what was subtracted, the depth of the tip is found by
Newton's method (`_given_way`).

The result of a set does not depend on the other sets of the batch: a chain can be repeated bit by bit.

Laws with corrections for friction and finite strain, at many parameter sets.

The frictionless and the no-slip law are computed in batches, and then combined by the sizes of each set.

A sample with memory at many parameter sets at once: the elastic forces of all, then the memory of all.

It serves a relaxing layer during loading and unloading, whatever the contact point of a set, and a memory that
gives the forces of many sets itself. Motions without a closed construction, such as a second cycle, and a compliant
frame are computed one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.model.forward import Forward, LeftOutLaws
from underlay.inference.model.groups import ParameterSets, Readings, Values, is_shaped_by_lengths, set_by_set
from underlay.inference.model.on_law import OnLinear
from underlay.inference.model.ratio_batch import by_ratios, can_batch_depths
from underlay.mechanics.contact import AdhesionTable
from underlay.mechanics.response import WholeHistory, checked_times
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH
from underlay.scene.instrument import SENSITIVITY_RATIO, Chain, ContactDepth, Frame


class _Read(Protocol):
    """Readings of the elastic sets, as far as the memory needs them."""

    @property
    def contact(self) -> FloatArray:
        """Contact force (N), (sets, n)."""

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Whether each set has a law, (sets,)."""


def remembered_readings(
    forward: Forward, values: Values, sets: int, elastic: Callable[..., _Read]
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.intp]] | None:
    """Forces of all sets of a sample with memory.

    Parameters
    ----------
    forward : Forward
        The compiled scene, with its memory.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    elastic : callable
        Function that computes the readings of a model without memory, as `batched_readings`.

    Returns
    -------
    tuple or None
        Contact force and instrument force (N), each (sets, n), which sets have a law, (sets,), and the rows that
        must be computed one by one; None where that is all of them.
    """
    history, time = forward.history, forward.time
    if isinstance(history, WholeHistory):
        return _whole_readings(history, forward, values, sets)
    from underlay.mechanics.viscoelastic.history import Viscoelastic, forces_of_sets  # noqa: PLC0415  few scenes

    if not isinstance(history, Viscoelastic) or time is None or np.any(values[Frame.path]):
        return None
    contact = np.broadcast_to(values[ContactDepth.path], sets)
    depth = np.broadcast_to(forward.depth_at(_upright(values)), (sets, forward.depth.shape[-1]))
    depth = depth - contact[:, None]
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
        still = {**values, ContactDepth.path: 0.0, SENSITIVITY_RATIO: 1.0}

        def loads(rows: NDArray[np.intp], w: FloatArray) -> FloatArray:
            of = asked[rows]
            own = {path: v[of] if isinstance(v, np.ndarray) else v for path, v in still.items()}
            same = replace(forward, history=None, time=None, depth=w, bending=None)
            found = elastic(same, own, len(of), stiffness=False)
            possible[of] &= found.possible
            return found.contact

        force[asked], closed = forces_of_sets(modes.of(asked), loads, depth[asked], time)
        left = np.append(left, asked[~closed])
    chain = Chain.of(_upright(values))
    return force, chain.reading(force, forward.depth), possible, left


def _whole_readings(
    history: WholeHistory, forward: Forward, values: Values, sets: int
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.intp]] | None:
    """`remembered_readings` of a memory that gives the force of a whole motion itself.

    None where the memory cannot treat these sets at once.
    """
    chain = Chain.of(_upright(values))
    depth = chain.travel(forward.depth)
    found = history.answers(values, sets, depth, checked_times(forward.time, np.atleast_2d(depth)[0]))
    if found is None:
        return None
    force, answered = found
    return force, chain.reading(force, forward.depth), answered, np.flatnonzero(~answered)


def _upright(values: Values) -> dict[str, float | FloatArray]:
    """The numbers shaped to broadcast over readings: (sets, 1) where they vary."""
    return {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}


#: Contact force (N), stiffness (N/m), instrument force (N), (sets, n), and which sets exist, (sets,).
Found = tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]


def left_out_readings(
    forward: Forward, values: Values, sets: int, batched: Callable[[Forward, Values, int], Found]
) -> Found | None:
    """Readings of all parameter sets of a law with corrections; None where they must be computed one by one.

    Parameters
    ----------
    forward : Forward
        Forward model with corrections of its law (`LeftOutLaws`).
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    batched : callable
        Function that computes the readings of a model without corrections; without stiffness.

    Returns
    -------
    tuple or None
        Contact force (N), stiffness (N/m, left zero) and instrument force (N), each (sets, n), and which sets have
        a law.
    """
    left_out = forward.left_out
    if not isinstance(left_out, LeftOutLaws) or np.any(values[Frame.path]):
        # A frame gives way under the whole force: its depths are those of one law at a time.
        return None
    bare = replace(forward, left_out=None)
    free, _, _, exists = batched(bare, values, sets)
    sticks, _, _, also = batched(bare.solved_by(bare.laws.solver.without_slip), values, sets)
    asked = ParameterSets(bare, values, sets)
    upright: Any = {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
    strained = upright[FINITE_STRAIN_PATH] * left_out.excess(forward, upright, asked.tip)
    strained = strained + upright[BOTH_PATH] * left_out.further(upright, sticks, free, asked.tip)
    contact = free + upright[FRICTION_PATH] * (sticks - free) + free * strained
    return contact, np.zeros_like(contact), asked.instrument_force(contact), exists & also


# Newton's method ends where the tip's depth changes by less than this share of the range of depth, or after so many
# steps.
_SETTLED, _MOST_STEPS = 1e-9, 50


def sticking(forward: Forward, values: Values, sets: int) -> Readings:
    """Readings of all parameter sets of an adhesive contact from its table of laws; one by one where it has none.

    `values` are all numbers of the scene (SI) by path, (sets,) where they vary.
    """
    # The table solves for the tip's depth itself: the links give travel and offsets only.
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    table, work, ratio = _adhesion_table(asked)
    if table is None:
        return set_by_set(forward, values, range(sets), Readings.empty(sets, forward.depth.shape[-1]))
    b, c = asked.factors
    compliance = np.broadcast_to(b * c * values[Frame.path], (sets,))
    found = table.readings(work, b[:, None] * asked.tip, compliance, ratio)
    contact, stiffness = c[:, None] * found.force, (b * c)[:, None] * found.stiffness
    readings = Readings(contact, stiffness, asked.instrument_force(contact), found.possible)
    return set_by_set(forward, values, np.flatnonzero(~found.possible).tolist(), readings)


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


def bending(forward: Forward, values: Values, empty: Readings) -> Readings:
    """Readings of all parameter sets with a cantilever that bends by other than its calibration assumed.

    What was subtracted from the depths for its bending is then wrong. Computed together where sets of unlike depths
    can be, else one by one. `empty` is a `Readings` of zeros that gives the shape.
    """
    sets = len(empty.possible)
    if forward.left_out is not None or is_shaped_by_lengths(forward):
        return set_by_set(forward, values, range(sets), empty)
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    beyond = np.broadcast_to(forward.lever_compliances(values), sets)
    offset = asked.instrument_force(np.zeros(asked.tip.shape))
    rigid = replace(forward, depth=forward.depth - beyond[:, None] * offset, bending=None, is_rigid=True)
    gives = {**values, Frame.path: values[Frame.path] + beyond}
    if forward.similarity.energies:
        found = sticking(rigid, gives, sets)
    elif can_batch_depths(asked):
        found = _given_way(rigid, gives, empty)
    else:
        found = set_by_set(rigid, gives, range(sets), empty)
    return found._replace(force=asked.instrument_force(found.contact))


def _given_way(forward: Forward, values: Values, empty: Readings) -> Readings:
    """Readings of all parameter sets with a frame or cantilever in series, by Newton's method (`Frame`).

    The compliance in `values` (m/N), (sets,), may have either sign. `empty` is a `Readings` of zeros that gives the
    shape.
    """
    sets = len(empty.possible)
    compliance = np.broadcast_to(values[Frame.path], sets)[:, None]
    stiff = {**values, Frame.path: 0.0}
    reading = np.array(np.broadcast_to(forward.depth, empty.contact.shape))
    depth, is_open = reading.copy(), np.ones(sets, dtype=bool)
    small = _SETTLED * np.ptp(reading, axis=1)
    for _ in range(_MOST_STEPS):
        found = by_ratios(
            ParameterSets(replace(forward, depth=depth), stiff, sets),
            Readings.empty(*empty.contact.shape),
            stiffness=True,
        )
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
    empty = Readings.empty(sets, forward.depth.shape[-1])
    if forward.bends(values):
        return bending(forward, values, empty)
    if forward.history is not None:
        return _remembered(forward, values, empty, stiffness=stiffness)
    if forward.left_out is not None:
        return _with_left_out(forward, values, empty, stiffness=stiffness)
    if is_shaped_by_lengths(forward):
        return set_by_set(forward, values, range(sets), empty)
    return _of_this_depth(forward, values, empty, stiffness=stiffness)


def _of_this_depth(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets of a sample without memory, whose force depends on depth alone."""
    sets = len(empty.possible)
    if forward.similarity.energies:
        return sticking(forward, values, sets)
    # The links give travel and offsets only: the deflection of the frame is found for all sets here.
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    if not np.any(values[Frame.path]):
        return by_ratios(asked, empty, stiffness=stiffness)
    if not can_batch_depths(asked):
        return set_by_set(forward, values, range(sets), empty)
    found = _given_way(forward, values, empty)
    return found._replace(force=asked.instrument_force(found.contact))


def _remembered(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets of a sample with memory, together if possible, else one by one."""
    sets = len(empty.possible)
    remembered = None if stiffness else remembered_readings(forward, values, sets, batched_readings)
    if remembered is not None:
        contact, force, possible, left = remembered
        possible[left] = False
        readings = Readings(contact, empty.stiffness, force, possible)
        return set_by_set(forward, values, left.tolist(), readings, stiffness=False)
    return set_by_set(forward, values, range(sets), empty, stiffness=stiffness)


def _with_left_out(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """Readings of all parameter sets of a law with corrections, together if possible, else one by one."""
    sets = len(empty.possible)
    if isinstance(forward.left_out, OnLinear):
        from underlay.inference.model.on_law_batch import on_law_readings  # noqa: PLC0415  few scenes

        return on_law_readings(forward, values, sets, forward.left_out, stiffness=stiffness)
    found = None if stiffness else left_out_readings(forward, values, sets, _forces)
    return set_by_set(forward, values, range(sets), empty) if found is None else Readings(*found)


def _forces(forward: Forward, values: Values, sets: int) -> Readings:
    return batched_readings(forward, values, sets, stiffness=False)
