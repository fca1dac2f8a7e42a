"""Layers that stiffen, or have a finite width, at many parameter sets: one linear law, corrections as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws_of_sets import SetLaws
from underlay.inference.model.on_law import OnLinear
from underlay.inference.model.parameter_sets import (
    ParameterSets,
    Readings,
    Values,
    set_by_set,
    upright,
    values_of,
)
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.finite_width import Sides, is_wide
from underlay.mechanics.stiffening.factors import FIRST_TOUCH, gent
from underlay.mechanics.stiffening.law import MARGIN, StiffLayer
from underlay.mechanics.stiffening.limits import largest_by_depth, within_reach
from underlay.scene.instrument import Baseline, BaselineSlope, ContactDepth, Frame

# Least depth (m) at which a law is asked of a set that does not press.
_TINY = float(np.sqrt(np.finfo(float).tiny))
# Depth at which sets are asked that go deeper than stiffening is known, over the largest known one: a stand-in
# whose answer is not used.
_SAFE = 0.01
# Laws through which those of sets that differ in one ratio are read, and the widest span of its logarithm: over a
# factor of 2 in thickness, h from 3 to 80 R, force and slope are within 4e-9 of laws right to 1e-8.
_NODES, _WIDEST = 6, float(np.log(2.0))


@dataclass(frozen=True)
class _Between:
    """Linear laws of sets that differ in one ratio, interpolated in that ratio.

    The logarithms of force and contact radius are interpolated by a polynomial through a few laws.

    Parameters
    ----------
    laws : sequence of ContactLaw
        Laws at the interpolation nodes.
    shares : FloatArray
        Weight of each law in each set, (laws, sets, 1).
    """

    laws: Sequence[ContactLaw]
    shares: FloatArray

    @classmethod
    def of(cls, forward: Forward, ratios: Sequence[Any], deepest: float) -> ContactLaw | _Between | None:
        """Law that serves all sets up to `deepest` (m) at the reference; None where they are too far apart.

        `ratios` are those of `ParameterSets`. A single law if no ratio varies between the sets.
        """
        varying = [i for i, ratio in enumerate(ratios) if isinstance(ratio, np.ndarray)]
        if not varying:
            return forward.reference_law(tuple(ratios), deepest)
        own = np.log(ratios[varying[0]])
        low, high = float(own.min()), float(own.max())
        if len(varying) > 1 or high - low > _WIDEST:
            return None
        nodes = chebyshev.chebpts1(_NODES)
        places = np.exp(0.5 * (low + high) + 0.5 * max(high - low, _TINY) * nodes)
        laws = [
            forward.reference_law(tuple(place if i in varying else r for i, r in enumerate(ratios)), deepest)
            for place in places.tolist()
        ]
        there = (2.0 * own - low - high) / max(high - low, _TINY)
        inverse = np.linalg.inv(chebyshev.chebvander(nodes, _NODES - 1))
        return cls(laws, (chebyshev.chebvander(there, _NODES - 1) @ inverse).T[:, :, None])

    def force_and_stiffness(self, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (N) and its derivative in depth (N/m), (sets, n), at depths (m), (sets, n)."""
        found = [law.force_and_stiffness(depth) for law in self.laws]
        force = self._mean([own for own, _ in found])
        return force, force * sum(
            share * slope / own for share, (own, slope) in zip(self.shares, found, strict=True)
        )

    def force(self, depth: FloatArray) -> FloatArray:
        """Force (N), (sets, n), at depths (m), (sets, n)."""
        return self._mean([law.force(depth) for law in self.laws])

    def contact_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m), (sets, n), at depths (m), (sets, n)."""
        return self._mean([law.contact_radius(depth) for law in self.laws])

    def _mean(self, values: Sequence[FloatArray]) -> FloatArray:
        logs = [share * np.log(own) for share, own in zip(self.shares, values, strict=True)]
        return np.asarray(np.exp(np.sum(logs, axis=0)))


@dataclass(frozen=True)
class _Similar:
    """Linear laws of all sets, scaled from one law P: c P(b w), with radius s a(b w), at depths w (..., sets, n).

    Parameters
    ----------
    law : ContactLaw or _Between
        The law of the reference, or interpolated laws.
    b, c, s : FloatArray
        Factors on depth, force and length of each set, (sets, 1).
    """

    law: ContactLaw | _Between
    b: FloatArray
    c: FloatArray
    s: FloatArray

    def force_and_stiffness(self, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (N) and its derivative in depth (N/m) at depths (m), (..., sets, n)."""
        force, slope = self.law.force_and_stiffness(self.b * depth)
        return self.c * force, self.c * self.b * slope

    def force(self, depth: FloatArray) -> FloatArray:
        """Force (N) at depths (m), (..., sets, n)."""
        return np.asarray(self.c * self.law.force(self.b * depth))

    def contact_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m) at depths (m), (..., sets, n)."""
        return np.asarray(self.s * self.law.contact_radius(self.b * depth))


@dataclass(frozen=True)
class _Ready:
    """Sets whose layers are to be pressed.

    Parameters
    ----------
    asked : ParameterSets
        The sets.
    stiff, sides : StiffLayer and Sides, or None
        Their stiffening and sides.
    linear : _Similar
        Their linear laws.
    depth : FloatArray
        Depths (m) in contact, (sets, n); where there is none the largest depth, at which the law exists.
    inside, possible : ndarray of bool
        Where there is contact and the law is known, (sets, n), and which sets are known, (sets, 1).
    """

    asked: ParameterSets
    stiff: StiffLayer | None
    sides: Sides | None
    linear: _Similar
    depth: FloatArray
    inside: NDArray[np.bool_]
    possible: NDArray[np.bool_]

    def readings(self, force: FloatArray, slope: FloatArray) -> Readings:
        """Readings from force (N) and stiffness (N/m) at `depth`."""
        contact, slope = np.where(self.inside, force, 0.0), np.where(self.inside, slope, 0.0)
        return Readings(contact, slope, self.asked.instrument_force(contact), self.possible[:, 0])


def _ready(asked: ParameterSets, on_linear: OnLinear) -> _Ready | None:
    """Make sets ready; None where no linear law serves them together, or reaches so deep."""
    columns = upright(asked.values)
    stiff, sides = on_linear.laws(columns)
    inside = asked.tip > (0.0 if stiff is None else FIRST_TOUCH * stiff.spread)
    deepest = top = np.maximum(asked.deepest[:, None], _TINY)
    possible = np.ones((asked.sets, 1), dtype=bool)
    if stiff is not None:
        stiff, top, possible = _shallow(stiff, top)
        deepest = stiff.asked(top).depth
    linear = _linear(asked, MARGIN * deepest, columns)
    if linear is None:
        return None
    if stiff is not None:
        possible = possible & within_reach(
            stiff.place(deepest, linear.contact_radius(deepest)), stiff.medium, stiff.inverse_limit
        )
        stiff = replace(stiff, inverse_limit=np.where(possible, stiff.inverse_limit, 0.0))
    if sides is not None:
        possible = possible & is_wide(linear.contact_radius(deepest), sides.radius)
    inside = inside & possible
    return _Ready(asked, stiff, sides, linear, np.where(inside, asked.tip, top), inside, possible)


def on_law_readings(
    forward: Forward, values: Values, sets: int, on_linear: OnLinear, *, stiffness: bool
) -> Readings | None:
    """Readings of all parameter sets of a layer that stiffens, or has a finite width.

    None where no linear law serves them together.

    Parameters
    ----------
    forward : Forward
        The compiled scene.
    values : mapping of path to float or FloatArray
        Every number of the scene (SI), (sets,) where it varies.
    sets : int
        How many sets.
    on_linear : OnLinear
        Changes that the layer makes to the linear law.
    stiffness : bool
        Whether the stiffness is computed too.
    """
    # A frame gives way under the whole force: its depths are those of one law at a time.
    if np.any(values[Frame.path]) or forward.depth.ndim > 1:
        return None
    asked = ParameterSets(replace(forward, left_out=None), values, sets)
    groups = _near(asked)
    if len(groups) > 1:
        readings = Readings.empty(sets, forward.depth.shape[-1])
        for rows in groups:
            own_values, count = _of(values, rows), len(rows)
            part = on_law_readings(forward, own_values, count, on_linear, stiffness=stiffness)
            if part is None:
                part = set_by_set(forward, own_values, Readings.empty(count, forward.depth.shape[-1]))
            for whole, own in zip(readings, part, strict=True):
                whole[rows] = own
        return readings
    ready = _ready(asked, on_linear)
    if ready is None:
        return None
    stiff, sides, linear, w = ready.stiff, ready.sides, ready.linear, ready.depth
    if stiffness or sides is not None or stiff is None:
        force, slope = _pressed(stiff, sides, linear, w)
    else:
        force, slope = stiff.force(linear, w), np.zeros(w.shape)
    return ready.readings(force, slope)


def goes_on_one_law(on_linear: OnLinear, paths: Sequence[str]) -> bool:
    """Whether sets that differ in the parameters at `paths` are a layer that stiffens, on one linear law."""
    by_scale = {"layer.E", ContactDepth.path, Baseline.path, BaselineSlope.path}
    own = all(path in by_scale or path.startswith("layer.stiffening.") for path in paths)
    return own and not on_linear.layer.has_sides


def on_law_slopes(
    forward: Forward, values: Values, sets: int, on_linear: OnLinear, paths: Sequence[str]
) -> SetLaws | None:
    """Laws of all sets, with the whole derivatives (SI) at fixed depth in place of those through ratios.

    For parameters of `goes_on_one_law`; None where the linear law does not reach so deep. The other arguments are
    those of `on_law_readings`.
    """
    ready = _ready(ParameterSets(replace(forward, left_out=None), values, sets), on_linear)
    if ready is None or ready.stiff is None:
        return None
    found = ready.stiff.pressed(ready.linear, ready.depth)
    readings, slopes = ready.readings(found.force, found.stiffness), {}
    for path in paths:
        section, _, name = path.rpartition(".")
        if path == "layer.E":
            slopes[path] = readings.contact / ready.asked.column(path)
        elif section == "layer.stiffening":
            slopes[path] = np.where(ready.inside, ready.stiff.slope(name, found), 0.0)
    return SetLaws(readings.contact, readings.stiffness, slopes, readings.possible)


def stiffening_factors(forward: Forward, values: Values, sets: int, on_linear: OnLinear) -> FloatArray:
    """Factor G by which the layer has stiffened at the deepest point of the curve, (sets,).

    Infinite where the relation for stiffening does not reach so deep. Parameters are those of `on_law_readings`.
    """
    asked = ParameterSets(replace(forward, left_out=None), values, sets)
    groups = _near(asked)
    if len(groups) > 1:
        factors = np.empty(sets)
        for rows in groups:
            factors[rows] = stiffening_factors(forward, _of(values, rows), len(rows), on_linear)
        return factors
    columns = upright(values)
    stiff, _ = on_linear.laws(columns)
    if stiff is None:
        return np.ones(sets)
    stiff, top, possible = _shallow(stiff, np.maximum(asked.deepest[:, None], _TINY))
    deepest = stiff.asked(top).depth
    linear = _linear(asked, MARGIN * deepest, columns)
    if linear is None:
        return np.full(sets, np.inf)
    place = stiff.place(deepest, linear.contact_radius(deepest))
    known = possible & within_reach(place, stiff.medium, stiff.inverse_limit)
    factor, _ = gent(place, stiff.medium, np.where(known, stiff.inverse_limit, 0.0))
    return np.asarray(np.where(known, factor.value, np.inf)[:, 0])


def _near(asked: ParameterSets) -> list[NDArray[np.intp]]:
    """Rows of the sets in groups that one interpolated law serves; each alone where more than one ratio varies."""
    varying = [np.log(ratio) for ratio in asked.ratios if isinstance(ratio, np.ndarray)]
    if not varying:
        return [np.arange(asked.sets)]
    if len(varying) > 1:
        return [np.array([row]) for row in range(asked.sets)]
    place = np.floor((varying[0] - np.median(varying[0])) / _WIDEST + 0.5)
    return [np.flatnonzero(place == one) for one in np.unique(place)]


def _of(values: Values, rows: NDArray[np.intp]) -> Values:
    """Numbers of the sets at `rows`, by path; of a single set they are numbers, not arrays."""
    if len(rows) == 1:
        return values_of(values, int(rows[0]))
    return {path: v[rows] if isinstance(v, np.ndarray) else v for path, v in values.items()}


def _linear(asked: ParameterSets, deepest: FloatArray, columns: Mapping[str, Any]) -> _Similar | None:
    """Linear laws of all sets up to depths (m), (sets, 1), by scaling one law.

    None where the sets are too far apart for one law, or the law cannot reach so deep. `columns` are the numbers of
    the scene (SI) by path, (sets, 1) where they vary.
    """
    b, c = (np.asarray(factor)[:, None] for factor in asked.factors)
    s = np.broadcast_to(asked.forward.similarity.length_ratio(columns), (asked.sets, 1))
    try:
        law = _Between.of(asked.forward, asked.ratios, float((b * deepest).max()))
    except InputError:
        return None
    return None if law is None else _Similar(law, b, c, s)


def _shallow(stiff: StiffLayer, top: FloatArray) -> tuple[StiffLayer, FloatArray, NDArray[np.bool_]]:
    """Replace depths beyond the range of the stiffening relation by a shallow one, whose result is not used.

    Parameters
    ----------
    stiff : StiffLayer
        The layer at all sets.
    top : FloatArray
        Largest depth (m) of each set, (sets, 1).

    Returns
    -------
    tuple
        The layer and the depths with those sets replaced, and which sets lie within the range, (sets, 1).
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
    """Force (N) and its derivative in depth (N/m) at depths (m) in contact, (sets, n)."""

    def inner(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        if stiff is None:
            return linear.force_and_stiffness(u)
        found = stiff.pressed(linear, u)
        return found.force, found.stiffness

    if sides is None:
        return inner(depth)
    found = sides.sprung(inner, depth)
    return found.force, found.stiffness
