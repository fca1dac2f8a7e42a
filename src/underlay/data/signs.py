"""Is the depth positive into the sample, and the force in compression? If not, say so; turn what is asked."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from underlay._arrays import FloatArray, median
from underlay.data.curve import Curve
from underlay.data.segments import HOLD, LOADING, UNLOADING, segments_from_motion
from underlay.errors import CurveError
from underlay.units import format_quantity

__all__ = ["flipped", "require_signs"]

# A sign is judged on the first motion over this share of the depth's range.
_LONG = 0.3
# The force changes over it by this share of its own range, and goes on changing at its end: a bent or sloping
# baseline in front of a contact turns round before the end.
_CHANGE, _END = 0.5, 0.1
# Below this share of its change, the force a curve begins with is none.
_NONE = 0.1
_NOISE = 10.0
_FEWEST = 8


def flipped(curve: Curve, columns: Iterable[str]) -> Curve:
    """Return the curve with the sign of ``"depth"``, ``"force"`` or both turned.

    Segments that were told from a motion that is now the other way round change places.
    """
    turned = {name: -getattr(curve, name) for name in columns}
    if not turned:
        return curve
    rules: Mapping[str, Any] = curve.metadata.get("sign_rules") or {}
    told = {name: f"turned, as asked; before: {rules.get(name, 'as given')}" for name in turned}
    found = replace(curve, **turned).with_metadata(sign_rules={**rules, **told})
    labels = found.segment
    if "depth" not in turned or labels is None:
        return found
    steps = np.diff(found.depth)
    going_in = (labels[1:] == LOADING) & (labels[:-1] == LOADING)
    if not steps[going_in].sum() < 0.0:
        return found
    swapped = np.where(labels == LOADING, UNLOADING, np.where(labels == UNLOADING, LOADING, HOLD))
    return replace(found, segment=swapped)


def require_signs(curve: Curve) -> None:
    """Refuse a curve whose depth or force has the wrong sign.

    The first motion of a test goes into the sample and the force rises over it. Depth falling while the force
    rises, force falling while the depth rises, or both falling from no force at all are each one way in which
    a file has the other convention.

    Raises
    ------
    CurveError
        Names the column and the key of a scene file that turns it.
    """
    depth, force = curve.depth, curve.force
    if len(curve) < _FEWEST or not (np.isfinite(depth).all() and np.isfinite(force).all()):
        return
    way = _first_motion(curve)
    if way is None:
        return
    moved, change, start = float(np.ptp(depth[way])), _change(force[way]), _start(force[way])
    if change == 0.0 or (moved > 0.0 and depth[way][-1] > depth[way][0]) == (change > 0.0):
        reversed_both = change < 0.0 and abs(start) <= _NONE * abs(change) and depth[way][-1] < depth[way][0]
        if not reversed_both:
            return
        raise CurveError(_told(curve, ("depth", "force"), change, depth[way]))
    raise CurveError(_told(curve, ("force",) if change < 0.0 else ("depth",), change, depth[way]))


def _first_motion(curve: Curve) -> slice | None:
    """The first run of points that goes one way over a good part of the depth."""
    told = curve.segment is not None  # the file's own labels may be of the other sign
    labels = segments_from_motion(curve.depth, curve.time, curve.force) if told else curve.segments()
    ends = np.concatenate(([0], np.flatnonzero(labels[1:] != labels[:-1]) + 1, [len(labels)]))
    extent = float(np.ptp(curve.depth))
    for first, last in itertools.pairwise(ends.tolist()):
        long = last - first >= _FEWEST and abs(curve.depth[last - 1] - curve.depth[first]) >= _LONG * extent
        if labels[first] != HOLD and long and extent > 0.0:
            return slice(first, last)
    return None


def _start(force: FloatArray) -> float:
    return median(force[: max(3, len(force) // 10)])


def _change(force: FloatArray) -> float:
    """Change of the force (N) from the beginning to the end; zero where it is not one that goes on to the end."""
    tenth = max(3, len(force) // 10)
    start, before, end = (
        median(part) for part in (force[:tenth], force[-2 * tenth : -tenth], force[-tenth:])
    )
    change = end - start
    noise = float(1.4826 * median(np.abs(np.diff(force, 2))) / np.sqrt(6.0))
    clear = abs(change) > max(_CHANGE * float(np.ptp(force)), _NOISE * noise)
    goes_on = (end - before) * change > _END * change * change * tenth / len(force)
    return change if clear and goes_on else 0.0


def _told(curve: Curve, columns: tuple[str, ...], change: float, depth: FloatArray) -> str:
    name = curve.metadata.get("name")
    verb = "rises" if change > 0.0 else "falls"
    way = "grows" if depth[-1] > depth[0] else "falls"
    keys = ", ".join(f'"{column}"' for column in columns)
    which = " and ".join(columns)
    signs = "signs of {} are" if len(columns) > 1 else "sign of the {} is"
    return (
        f"{f'curve {name!r}' if name else 'the curve'}: the {signs.format(which)} reversed: the force {verb} by "
        f"{format_quantity(abs(change), 'force')} while the depth {way} from "
        f"{format_quantity(float(depth[0]), 'length')} to {format_quantity(float(depth[-1]), 'length')}; depth "
        "grows into the sample and force is positive in compression. Turn it with "
        f"flip = [{keys}] in [curve] of the scene file; flip = [] says that the signs are right"
    )
