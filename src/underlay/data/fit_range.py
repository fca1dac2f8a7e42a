"""The points of a curve within a fit range, given by force above the baseline or by indentation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._given import require_given
from underlay.data.contact_point import find_contact
from underlay.data.curve import Curve
from underlay.errors import CurveError, InputError
from underlay.scene.fit_range import BEYOND, FitRange, Mark
from underlay.scene.scene import Scene
from underlay.units import format_quantity

_REST = 50  # largest number of readings that are kept of what lies beyond the range


class _Zero(NamedTuple):
    """Origin and size of a curve: contact point (m), force without contact (N), largest indentation and force."""

    contact: float
    baseline: float
    deepest: float
    largest: float


def in_range(curve: Curve, wanted: FitRange, scene: Scene, contact_depth: float | None = None) -> Curve:
    """Return the points of a loading or unloading curve within a fit range.

    Depths count from contact, forces from the baseline before it. The points are consecutive in depth: from where
    the curve stays above the lower end of the range to where it first passes the upper one, so that noise leaves no
    gaps.

    Parameters
    ----------
    curve : Curve
        Loading alone, or unloading alone.
    wanted : FitRange
        The range.
    scene : Scene
        Gives the thickness and radius for ranges that are multiples of these.
    contact_depth : float, optional
        Depth reading at contact (m), where it is known; otherwise `find_contact` estimates it.

    Raises
    ------
    CurveError
        If no contact is found, or no point is left.
    InputError
        If the scene has no radius or thickness of which the range is a multiple.

    Examples
    --------
    >>> import numpy as np, underlay as ul
    >>> scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)))
    >>> curve = ul.simulate(scene, np.linspace(0.0, 1e-4, 101))
    >>> part = in_range(curve, FitRange.of("24.5 % of depth", "0.0505 radius"), scene, 0.0)
    >>> bool(np.isclose(part.depth.min(), 2.5e-5)), bool(np.isclose(part.depth.max(), 5e-5))
    (True, True)
    """
    require_given(curve, "curve", Curve)
    if not wanted:
        return curve
    zero = _zero(curve, scene, contact_depth)
    order = np.argsort(curve.depth, kind="stable")
    pressed, forces = curve.depth[order] - zero.contact, curve.force[order] - zero.baseline
    first, last = 0, len(order)
    if wanted.high is not None:
        along = forces if wanted.high.of == "force" else pressed
        beyond = np.flatnonzero(along > _limit(wanted.high, scene, zero))
        last = int(beyond[0]) if beyond.size else last
    if wanted.low is not None:
        along = forces if wanted.low.of == "force" else pressed
        short = np.flatnonzero(~(along >= _limit(wanted.low, scene, zero))[:last])
        first = int(short[-1]) + 1 if short.size else 0
    kept = np.zeros(len(curve), dtype=bool)
    kept[order[first:last]] = True
    if not kept.any():
        raise CurveError(
            f"no point of {curve.metadata.get('name', 'the curve')} is left {wanted}: contact is at a depth "
            f"reading of {format_quantity(zero.contact, 'length')}, the deepest point "
            f"{format_quantity(zero.deepest, 'length')} beyond it under {format_quantity(zero.largest, 'force')}"
        )
    about: dict[str, object] = {"fit_range": str(wanted)}
    rest = order[last + 3 * (len(order) - last) // 4 :]
    if rest.size:
        rest = rest[:: 1 + rest.size // _REST]
        about[BEYOND] = curve.depth[rest].tolist(), curve.force[rest].tolist()
    return curve.select(kept).with_metadata(**about)


def _zero(curve: Curve, scene: Scene, contact_depth: float | None) -> _Zero:
    baseline = scene.instrument.baseline
    if contact_depth is None:
        found = find_contact(curve, scene=scene)
        contact, baseline = found.depth, found.baseline
    else:
        before = curve.force[curve.depth <= contact_depth]
        contact = contact_depth
        baseline = float(np.median(before)) if before.size else baseline
    return _Zero(contact, baseline, float(curve.depth.max()) - contact, float(curve.force.max()) - baseline)


def _limit(mark: Mark, scene: Scene, zero: _Zero) -> float:
    """Return an end of the range as a force (N) above the baseline or an indentation (m), as `mark.of` says."""
    if mark.of in ("force", "depth"):
        return mark.value * (zero.largest if mark.of == "force" else zero.deepest)
    if mark.of == "length":
        return mark.value
    path = {"thickness": "layer.thickness", "radius": "indenter.radius"}[mark.of]
    size = scene.parameters.get(path, np.inf)
    if not np.isfinite(size):
        raise InputError(f"the fit range is a multiple of the {mark.of}, but the scene has none: give {path}")
    return mark.value * size
