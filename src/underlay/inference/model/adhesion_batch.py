"""Many parameter sets of a tip that adheres, off the tables of its adhesion."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.model.batch_readings import Readings, is_shaped_by_lengths, set_by_set
from underlay.inference.model.forward import Forward
from underlay.inference.model.parameter_sets import ParameterSets, Values
from underlay.mechanics.contact import AdhesionTable
from underlay.scene.chain import Frame

__all__ = ["batched_pull_offs", "sticking"]


def sticking(forward: Forward, values: Values, sets: int) -> Readings:
    """All sets off the tables of their adhesion; those that these do not reach, or that have none, one by one."""
    # A table solves for the tip's depth itself: the chain is asked for travel and offsets alone.
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
    if not forward.similarity.energies or is_shaped_by_lengths(forward):
        return None
    asked = ParameterSets(forward, {**values, Frame.path: 0.0}, sets)
    table, work, ratio = _adhesion_table(asked)
    if table is None:
        return None
    b, c = asked.factors
    force, depth = table.pull_offs(work, ratio)
    return (c * force, depth / b) if np.isfinite(force + depth).all() else None
