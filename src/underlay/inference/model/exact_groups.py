"""Parameter sets gathered so that each group shares the nodes of one `ExactBatch`.

The groups' limits are fixed numbers, not taken from the sets at hand: a set's answer does not depend on the
company it is asked in.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.inference.model.parameter_sets import ParameterSets
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.contact_problem import depth_measure
from underlay.mechanics.halfspace import largest_halfspace_depth
from underlay.mechanics.indenters import PowerLawShape
from underlay.mechanics.plane_constants import isotropic_constants

__all__ = ["exact_groups"]

# Sets share nodes when their stiffness ratios lie within this factor, and their ranges within the second.
_RATIO_STEP = 4.0
_RANGE_STEP = 2.0
# What is compiled reaches this much further than asked: another Poisson's ratio than the scene's bends the
# relation of depth and contact radius, and nodes that stop short leave the polynomial to extrapolate.
_MARGIN = 1.1
# Compiled this much finer than asked, so that the sets at the edges of a group keep the promise: the largest
# error seen in 300 sets over E2/E1 from 0.01 to 1000 is then a third of the tolerance, and one set in
# fourteen, on the softest bases, goes alone; without it one in eight.
_SPARE = 0.1
# No further than this share of the depth at which the contact would reach the end of a sphere.
_SHAPE_SHARE = 0.5


def exact_groups(
    sets: ParameterSets, hardness: FloatArray, thickness: FloatArray
) -> Iterator[tuple[NDArray[np.intp], ExactBatch | None]]:
    """Rows whose stiffness ratio, thickness and range are alike, with what is compiled for them."""
    tops = sets.varpi(thickness)
    soft = np.where(np.isfinite(hardness), np.round(np.log(hardness) / np.log(_RATIO_STEP)), np.inf)
    ranges = np.ceil(np.log(np.maximum(_MARGIN * tops, 1e-3)) / np.log(_RANGE_STEP))
    # A sphere is no power law: its thickness counts on its own.
    power = isinstance(sets.forward.similarity.scene.indenter, PowerLawShape)
    thin = np.zeros(sets.sets) if power else np.floor(np.log(thickness) / np.log(_RANGE_STEP))
    keys = np.column_stack([soft, ranges, thin])
    for key in np.unique(keys, axis=0):
        rows = np.flatnonzero((keys == key).all(axis=1))
        yield rows, _compiled(sets, float(key[0]), float(key[1]), None if power else float(key[2]))


def _compiled(sets: ParameterSets, soft: float, octave: float, thin: float | None) -> ExactBatch | None:
    """What is compiled for a group, kept in the problem's store; None where no law reaches it."""
    forward = sets.forward
    scene, store = forward.similarity.scene, forward.laws.store
    key = ("batch", forward.laws.number, soft, octave, thin)
    if key in store.batches:
        return store.batches[key]
    body = scene.contact.isotropic
    if body is None:
        return None
    thickness = scene.layer.thickness if thin is None else _RANGE_STEP**thin
    radius = _RANGE_STEP**octave * thickness
    reach = _SHAPE_SHARE * largest_halfspace_depth(scene.indenter)
    depth = min(float(depth_measure(scene.indenter).abel(np.array(radius))), reach)
    outer = None
    if np.isfinite(soft) and body.base is not None:
        # The hardest of the group needs the largest contact radius for its range.
        ratio = _RATIO_STEP ** (soft + 0.5) * body.layer.theta / body.base.theta
        outer = isotropic_constants(ratio * body.base.E, body.base.nu)
    try:
        compiled = ExactBatch.compile(
            scene.indenter,
            body.layer.plane_constants,
            outer,
            thickness=thickness,
            max_depth=depth,
            rtol=_SPARE * sets.rtol,
        )
    except RangeError:
        compiled = None
    store.batches[key] = compiled
    return compiled
