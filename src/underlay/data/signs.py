"""Sign conventions of curves: depth must grow into the sample and force be positive in compression.

No sign is changed unasked: a curve with reversed signs gets a note, or is refused with the key of a scene file that
reverses them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, median
from underlay.data.curve import Curve
from underlay.data.segments import HOLD, LOADING, UNLOADING, noise_of, runs_of, segments_from_motion
from underlay.errors import CurveError
from underlay.units import format_quantity

# A sign is judged on the first motion over this share of the depth's range.
_LONG = 0.3
# The force changes over it by this share of its own range, and goes on changing at its end: a bent or sloping
# baseline in front of a contact turns round before the end.
_CHANGE, _END = 0.5, 0.1
# Below this share of its change, the force a curve begins with is none.
_NONE = 0.1
_NOISE = 10.0
# Over the first fifth of the travel (about each end of it, this share) the force of a stiffening contact that is
# made changes by less than half a fifth of its change (a ball 9 %), of one that is withdrawn by a fifth or more.
_EARLY, _ABOUT, _FLAT = 0.2, 0.08, 0.1
_NOTE = "read as written, with what looks like the wrong sign of"
_NOTE_END = (
    ": the first motion of a test goes into the sample, and the force rises over it. Fits from a scene file ask "
    "about it; in Python give columns with a minus, such as '-h (um)' for the depth"
)
_FEWEST = 8


def flipped(curve: Curve, columns: Iterable[str]) -> Curve:
    """Return the curve with the sign of ``"depth"``, ``"force"`` or both reversed.

    Where the segment labels follow from the depth as it was before, loading and unloading are exchanged.
    """
    turned = {name: -getattr(curve, name) for name in columns}
    if not turned:
        return curve
    if turned.keys() == {"depth"}:
        # What turns is the travel: the bending of a lever is taken off it either way.
        turned["depth"] = turned["depth"] - 2.0 * _bending(curve)
    rules: Mapping[str, Any] = curve.metadata.get("sign_rules") or {}
    new_rules = {name: f"turned, as asked; before: {rules.get(name, 'as given')}" for name in turned}
    told = curve.metadata.get("notes") or ()
    notes = tuple(note for note in told if not (note.startswith(_NOTE) and note.endswith(_NOTE_END)))
    found = replace(curve, **turned).with_metadata(sign_rules={**rules, **new_rules}, notes=notes)
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
    """Raise an error for a curve whose depth or force has the wrong sign.

    The first motion of a test goes into the sample and the force rises over it. A file has the opposite sign if its
    depth falls while the force rises, its force falls while the depth rises, or both fall from zero force.

    Raises
    ------
    CurveError
        Names the column and the key of a scene file that reverses it.
    """
    if found := _reversed(curve):
        raise CurveError(_reversal_message(curve, *found))


def reversed_columns(curve: Curve) -> tuple[str, ...]:
    """Return the names of the columns (``"depth"``, ``"force"``) whose signs look reversed; mostly none."""
    found = None if _plainly_right(curve) else _reversed(curve)
    return () if found is None else found[0]


def sign_note(curve: Curve) -> tuple[str, ...]:
    """Return a note on columns whose signs look reversed, or an empty tuple; `flipped` removes the note."""
    if _plainly_right(curve) or not (found := _reversed(curve)):
        return ()
    return (f"{_NOTE} {' and '.join(found[0])}{_NOTE_END}",)


def _bending(curve: Curve) -> FloatArray | float:
    """Bending of the lever (m), (n,), that was taken off the travel to make the depth; zero where none was."""
    stiffness = curve.metadata.get("spring_constant") if curve.metadata.get("bending_taken_off") else None
    return curve.force / stiffness if stiffness else 0.0


def _plainly_right(curve: Curve) -> bool:
    """Whether the reading whose force differs most from the first one has a larger force and a larger travel."""
    farthest = int(np.abs(curve.force - curve.force[0]).argmax())
    travel = curve.depth + _bending(curve)
    return bool(curve.force[farthest] > curve.force[0] and travel[farthest] > travel[0])


def _reversed(curve: Curve) -> tuple[tuple[str, ...], float, FloatArray] | None:
    """Return the columns with the wrong sign, change of force (N) over the first motion, and its depths (m), (n,).

    None where the signs are right or cannot be told.
    """
    # A lever that is said to bend too far turns the depth round, and never the travel.
    depth, force = curve.depth + _bending(curve), curve.force
    if len(curve) < _FEWEST or not (np.isfinite(depth).all() and np.isfinite(force).all()):
        return None
    way = _first_motion(replace(curve, depth=depth))
    if way is None:
        return None
    depth, force = depth[way], force[way]
    goes_in, (start, end) = bool(depth[-1] > depth[0]), _ends(force)
    if goes_in and end >= start:
        return None  # as nearly every curve is
    change = _change(force)
    if change == 0.0 or goes_in == (change > 0.0):
        if (
            change < 0.0
            and not goes_in
            and (abs(start) <= _NONE * -change or _begins_flat(depth, force, change))
        ):
            return ("depth", "force"), change, depth
        return None
    return ("force",) if change < 0.0 else ("depth",), change, depth


def _begins_flat(depth: FloatArray, force: FloatArray, change: float) -> bool:
    """Whether force and depth, both falling, begin out of contact: the force then changes little at first.

    A contact that is withdrawn is stiffest at first, one that is made is stiffest last.
    """
    travel = (depth - depth[0]) / (depth[-1] - depth[0])
    early = force[(travel >= _EARLY - _ABOUT) & (travel <= _EARLY + _ABOUT)]
    at_first = force[travel <= _ABOUT]
    return bool(early.size and at_first.size) and (median(early) - median(at_first)) / change < _FLAT


def _first_motion(curve: Curve) -> slice | None:
    """Return the first run of points that moves in one direction over a good part of the depth.

    None if there is none. The file's labels say where runs end, but not their direction, as their sign may be
    reversed too. Where they do not separate loading from unloading, the labels from the motion are used.
    """
    stated = curve.segment
    labels = curve.segments() if stated is None else stated
    found = _first_long(curve.depth, labels)
    if found is None and stated is not None:
        return _first_long(curve.depth, segments_from_motion(curve.depth, curve.time, curve.force))
    return found


def _first_long(depth: FloatArray, labels: NDArray[np.str_]) -> slice | None:
    """Return the first run of one label, other than hold, over a good part of the depth; None if there is none."""
    extent = float(depth.max() - depth.min())
    for first, last, label in runs_of(labels):
        long = last - first >= _FEWEST and abs(depth[last - 1] - depth[first]) >= _LONG * extent
        if label != HOLD and long and extent > 0.0:
            return slice(first, last)
    return None


def _ends(force: FloatArray) -> tuple[float, float]:
    """Return the medians of the first and the last tenth of the force (N)."""
    tenth = max(3, len(force) // 10)
    return median(force[:tenth]), median(force[-tenth:])


def _change(force: FloatArray) -> float:
    """Return the change of the force (N) from beginning to end; zero if it is small or stops before the end."""
    tenth = max(3, len(force) // 10)
    (start, end), before = _ends(force), median(force[-2 * tenth : -tenth])
    change = end - start
    clear = abs(change) > max(_CHANGE * float(np.ptp(force)), _NOISE * noise_of(force))
    goes_on = (end - before) * change > _END * change * change * tenth / len(force)
    return change if clear and goes_on else 0.0


def _reversal_message(curve: Curve, columns: tuple[str, ...], change: float, depth: FloatArray) -> str:
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
