"""The forward model for many parameter sets at once, as a sampler asks for it.

Seven ways, the first that applies:

1. something adheres, and of the ratios only that of the work of adhesion may vary: the sets are read off the
   adhesion's own table (`adhesion_batch.py`), a frame's compliance included;
2. no ratio varies between the sets: one law of the reference serves them all through `Similarity`'s factors;
3. one ratio alone varies: every set's curve is read off the table of its cell (`curve_family`);
4. a tip sticks to the surface or is a sphere, and one ratio alone varies: the sets are read off a surface in it and
   the depth (`ratio_surface`);
5. the solver says that `ExactBatch` gives its laws (an isotropic layer on an isotropic or rigid base): the sets
   go through it, in groups whose stiffness ratio and range are alike;
6. moduli and thicknesses of a stack vary: through `ExactBatch` too, in groups of like ratios;
7. otherwise set by set, through `Forward.reading`: so DMT and a flat punch that sticks, a law and 1 to 2 ms a set,
   and Maugis, two tenths of a second.

Ways 2 to 6 are those of `ratio_batch.py`, and the last is that of `batch_readings.py`. A sample that remembers
goes one of these ways with its elastic force, and then through its memory (see `remembered_batch.py`); under a
lever that bends further they find where its tip is (`lever_batch.py`).

A set's answer does not depend on the company it is asked in: a chain can be repeated bit by bit.
"""

from __future__ import annotations

import numpy as np

from underlay.inference.model.adhesion_batch import sticking
from underlay.inference.model.batch_readings import Readings, is_shaped_by_lengths, set_by_set
from underlay.inference.model.forward import Forward
from underlay.inference.model.lever_batch import bending
from underlay.inference.model.parameter_sets import ParameterSets, Values
from underlay.inference.model.ratio_batch import by_ratios, has_exact_batches
from underlay.scene.chain import Frame

__all__ = ["batched_readings", "has_batches"]


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
        return bending(forward, values, empty)
    if forward.history is not None:
        return _remembered(forward, values, empty, stiffness=stiffness)
    if forward.left_out is not None:
        return _with_left_out(forward, values, empty, stiffness=stiffness)
    if is_shaped_by_lengths(forward):
        return set_by_set(forward, values, range(sets), empty)
    return _of_this_depth(forward, values, empty, stiffness=stiffness)


def has_batches(forward: Forward, values: Values, sets: int) -> bool:
    """Whether sets of a sample without memory or adhesion go through compiled batches of the exact law."""
    elsewhere = forward.history is not None or forward.similarity.energies or forward.laws.table is not None
    gives = forward.bends(values) or bool(np.any(values[Frame.path]))
    if elsewhere or is_shaped_by_lengths(forward) or gives:
        return False
    asked = ParameterSets(forward, values, sets)
    return asked.shared is None and has_exact_batches(asked)


def _of_this_depth(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """All sets of a sample whose force depends on the depth alone."""
    sets = len(empty.possible)
    if forward.similarity.energies:
        return sticking(forward, values, sets)
    if np.any(values[Frame.path]):
        return set_by_set(forward, values, range(sets), empty)
    return by_ratios(ParameterSets(forward, values, sets), empty, stiffness=stiffness)


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
        return set_by_set(forward, values, left.tolist(), readings, stiffness=False)
    return set_by_set(forward, values, range(sets), empty, stiffness=stiffness)


def _with_left_out(forward: Forward, values: Values, empty: Readings, *, stiffness: bool) -> Readings:
    """All sets of a law with what it leaves out: together where they can, else one by one."""
    # Not loaded for a scene without it.
    from underlay.inference.model.left_out_batch import left_out_readings  # noqa: PLC0415  see above

    sets = len(empty.possible)
    found = None if stiffness else left_out_readings(forward, values, sets, _forces)
    return set_by_set(forward, values, range(sets), empty) if found is None else Readings(*found)


def _forces(forward: Forward, values: Values, sets: int) -> Readings:
    return batched_readings(forward, values, sets, stiffness=False)
