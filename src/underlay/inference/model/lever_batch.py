"""Many parameter sets of a lever that bends beyond what was taken off: where its tip is, by Newton's method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from underlay.inference.model.adhesion_batch import sticking
from underlay.inference.model.batch_readings import Readings, is_shaped_by_lengths, set_by_set
from underlay.inference.model.forward import Forward
from underlay.inference.model.parameter_sets import ParameterSets, Values
from underlay.inference.model.ratio_batch import by_ratios, goes_together
from underlay.scene.chain import Frame

__all__ = ["bending"]

# A tip is where it is to this share of the depths.
_SETTLED, _MOST_STEPS = 1e-9, 50


def bending(forward: Forward, values: Values, empty: Readings) -> Readings:
    """All sets of a lever that bends beyond what was taken off; what goes set by set otherwise does so here."""
    sets = len(empty.possible)
    if forward.left_out is not None or is_shaped_by_lengths(forward):
        return set_by_set(forward, values, range(sets), empty)
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    beyond = np.broadcast_to(forward.lever_compliances(values), sets)
    offset = asked.instrument_force(np.zeros(asked.tip.shape))
    unbent = replace(forward, depth=forward.depth - beyond[:, None] * offset, bending=None, is_unbent=True)
    gives = {**values, Frame.path: values[Frame.path] + beyond}
    if forward.similarity.energies:
        found = sticking(unbent, gives, sets)
    elif goes_together(asked):
        found = _given_way(unbent, gives, empty)
    else:
        found = set_by_set(unbent, gives, range(sets), empty)
    return found._replace(force=asked.instrument_force(found.contact))


def _given_way(forward: Forward, values: Values, empty: Readings) -> Readings:
    """All sets of a frame or lever of a compliance (m/N), (sets,), of either sign, by Newton's method (`Frame`)."""
    sets = len(empty.possible)
    compliance = np.broadcast_to(values[Frame.path], sets)[:, None]
    stiff = {**values, Frame.path: 0.0}
    told = np.array(np.broadcast_to(forward.depth, empty.contact.shape))
    depth, is_open = told.copy(), np.ones(sets, dtype=bool)
    small = _SETTLED * np.ptp(told, axis=1)
    for _ in range(_MOST_STEPS):
        found = by_ratios(
            ParameterSets(replace(forward, depth=depth), stiff, sets),
            Readings.empty(*empty.contact.shape),
            stiffness=True,
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
