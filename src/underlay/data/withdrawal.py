"""What the way out of a curve says of adhesion: its lowest force, kept where the way in alone is fitted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay.data.curve import Curve
from underlay.data.segments import UNLOADING, one_of_each

__all__ = ["Lowest", "lowest_of", "remembering_withdrawal"]

_KEY = "withdrawal_lowest"
# Standard deviation over the median size of the differences of neighbours, for normal noise.
_MAD = 1.4826 / 2.0**0.5


class Lowest(NamedTuple):
    """The lowest point of a way out: depth (m), force (N), and the scatter of the force there (N)."""

    depth: float
    force: float
    scatter: float


def remembering_withdrawal(part: Curve, whole: Curve) -> Curve:
    """Return a part of `whole` with the lowest point of the way out of `whole` in its metadata."""
    lowest = _of_the_points(whole)
    return part if lowest is None else part.with_metadata(**{_KEY: tuple(lowest)})


def lowest_of(curve: Curve) -> Lowest | None:
    """Lowest point of a curve's way out, or of that of the curve it is a part of; None where it has none.

    Nor has a curve that only comes back: its force is judged as it stands.
    """
    kept = curve.metadata.get(_KEY)
    return Lowest(*kept) if kept is not None else _of_the_points(curve)


def _of_the_points(curve: Curve) -> Lowest | None:
    if not (one_of_each(curve.segments()) == UNLOADING).any():
        return None
    out = curve.unloading()
    if len(out) == len(curve):
        return None
    at = int(np.argmin(out.force))
    # Its own scatter: the noise in front of contact is no measure where the tip jumped in.
    scatter = _MAD * float(np.median(np.abs(np.diff(out.force)))) if len(out) > 1 else 0.0
    return Lowest(float(out.depth[at]), float(out.force[at]), scatter)
