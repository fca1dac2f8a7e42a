"""Layers that stiffen, or have sides, at many parameter sets: one linear law, factors of each set as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward import Forward
from underlay.inference.model.groups import ParameterSets, Readings, Values, set_by_set, values_of
from underlay.inference.model.on_law import OnLinear
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.finite_width import Sides, is_wide
from underlay.mechanics.stiffening import (
    FIRST_TOUCH,
    MARGIN,
    StiffLayer,
    gent,
    largest_by_depth,
    within_reach,
)
from underlay.scene.instrument import Frame

__all__ = ["on_law_readings", "stiffening_factors"]

# Least depth (m) at which a law is asked of a set that does not press.
_TINY = float(np.sqrt(np.finfo(float).tiny))
# Depth at which sets are asked that go deeper than stiffening is known, over the largest known one: a stand-in
# whose answer is not used.
_SAFE = 0.01


@dataclass(frozen=True)
class _Similar:
    """The linear laws of all sets, c P(b w) of one law P; depths w are (..., sets, n)."""

    law: ContactLaw
    b: FloatArray
    c: FloatArray
    s: FloatArray

    def force_and_stiffness(self, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (N) and dP/dw (N/m)."""
        force, slope = self.law.force_and_stiffness(self.b * depth)
        return self.c * force, self.c * self.b * slope

    def force(self, depth: FloatArray) -> FloatArray:
        """Force (N)."""
        return np.asarray(self.c * self.law.force(self.b * depth))

    def contact_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m)."""
        return np.asarray(self.s * self.law.contact_radius(self.b * depth))


def on_law_readings(
    forward: Forward, values: Values, sets: int, on_linear: OnLinear, *, stiffness: bool
) -> Readings:
    """Readings of all sets of a layer that stiffens, or has sides: together where one linear law serves them.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    on_linear : OnLinear
        What the layer puts on the linear law.
    stiffness : bool
        Whether the stiffness is asked for.
    """
    readings = Readings.empty(sets, forward.depth.shape[-1])
    asked = ParameterSets(replace(forward, left_out=None), values, sets)
    # A frame gives way under the whole force: its depths are those of one law at a time.
    if asked.shared is None or np.any(values[Frame.path]):
        return set_by_set(forward, values, range(sets), readings)
    upright: Any = {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
    stiff, sides = on_linear.laws(upright)
    w, inside = asked.tip, asked.tip > (0.0 if stiff is None else FIRST_TOUCH * stiff.spread)
    # Depths before contact are not asked for: they stand where the deepest is, which is.
    top = np.maximum(asked.deepest[:, None], _TINY)
    deepest, possible = top, np.ones((sets, 1), dtype=bool)
    if stiff is not None:
        stiff, top, possible = _shallow(stiff, top)
        deepest, inside = stiff.asked(top).depth, inside & possible
    linear = _linear(asked, asked.shared, MARGIN * deepest, upright)
    if linear is None:
        return set_by_set(forward, values, range(sets), readings)
    if stiff is not None:
        possible = possible & within_reach(
            stiff.place(deepest, linear.contact_radius(deepest)), stiff.medium, stiff.inverse_limit
        )
        stiff = replace(stiff, inverse_limit=np.where(possible, stiff.inverse_limit, 0.0))
    if sides is not None:
        possible = possible & is_wide(linear.contact_radius(deepest), sides.radius)
    w = np.where(inside, w, top)
    if stiffness or sides is not None or stiff is None:
        force, slope = _pressed(stiff, sides, linear, w)
    else:
        force, slope = stiff.force(linear, w), np.zeros(w.shape)
    contact = np.where(inside & possible, force, 0.0)
    return Readings(
        contact, np.where(inside & possible, slope, 0.0), asked.instrument_force(contact), possible[:, 0]
    )


def stiffening_factors(forward: Forward, values: Values, sets: int, on_linear: OnLinear) -> FloatArray:
    """G at the deepest point of the curve, (sets,); infinite where stiffening is not known so far."""
    asked = ParameterSets(replace(forward, left_out=None), values, sets)
    if asked.shared is None:
        rows = [values_of(values, row) for row in range(sets)]
        return np.array([_factors(forward, row, 1, on_linear)[0] for row in rows])
    return _factors(forward, values, sets, on_linear)


def _factors(forward: Forward, values: Values, sets: int, on_linear: OnLinear) -> FloatArray:
    asked = ParameterSets(replace(forward, left_out=None), values, sets)
    upright: Any = {path: v[:, None] if isinstance(v, np.ndarray) else v for path, v in values.items()}
    stiff, _ = on_linear.laws(upright)
    if stiff is None:
        return np.ones(sets)
    stiff, top, possible = _shallow(stiff, np.maximum(asked.deepest[:, None], _TINY))
    deepest = stiff.asked(top).depth
    linear = _linear(asked, tuple(asked.ratios), MARGIN * deepest, upright)
    if linear is None:
        return np.full(sets, np.inf)
    place = stiff.place(deepest, linear.contact_radius(deepest))
    known = possible & within_reach(place, stiff.medium, stiff.inverse_limit)
    factor, _ = gent(place, stiff.medium, np.where(known, stiff.inverse_limit, 0.0))
    return np.asarray(np.where(known, factor.value, np.inf)[:, 0])


def _linear(
    asked: ParameterSets, ratios: tuple[float, ...], deepest: FloatArray, upright: Any
) -> _Similar | None:
    """The linear laws of all sets up to depths (m), (sets, 1); None where one of them is out of reach."""
    b, c = (np.asarray(factor)[:, None] for factor in asked.factors)
    s = np.broadcast_to(asked.forward.similarity.length_ratio(upright), (asked.sets, 1))
    try:
        law = asked.forward.reference_law(ratios, float((b * deepest).max()))
    except InputError:
        return None
    return _Similar(law, b, c, s)


def _shallow(stiff: StiffLayer, top: FloatArray) -> tuple[StiffLayer, FloatArray, NDArray[np.bool_]]:
    """The layer and largest depths (m), (sets, 1), with sets that go deeper than is known asked at a shallow depth.

    Third is which sets are known as deep as they go, (sets, 1).
    """
    reach = largest_by_depth(stiff.radius, stiff.thickness)
    known = stiff.asked(top).depth <= reach
    if known.all():
        return stiff, top, known
    if np.any(stiff.spread):
        stiff = replace(stiff, spread=np.where(known, stiff.spread, _SAFE * reach))
    return stiff, np.where(known, top, _SAFE * reach), known


def _pressed(
    stiff: StiffLayer | None, sides: Sides | None, linear: _Similar, depth: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force (N) and dP/dw (N/m) at depths (m) in contact, (sets, n)."""

    def inner(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        if stiff is None:
            return linear.force_and_stiffness(u)
        found = stiff.pressed(linear, u)
        return found.force, found.stiffness

    if sides is None:
        return inner(depth)
    found = sides.sprung(inner, depth)
    return found.force, found.stiffness
