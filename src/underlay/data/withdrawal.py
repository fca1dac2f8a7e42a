"""Information from the unloading of a curve: its lowest force, by adhesion, and signs of plastic deformation.

An elastic contact unloads along its loading curve. Three readings (`Imprint`) say how far a test is from that: by
how much the unloading curve lies beyond the loading curve at low force; the unloading stiffness over the slope of
the loading curve (one where it is elastic); and the exponent of the loading, which is 2 for a cone, elastic or
plastic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.segments import UNLOADING, one_of_each

# Share of the largest depth that an elastic test may seem to leave: the contact point is not known better.
_LEFT = 0.15
# Stiffness over slope: an elastic test's differ by the noise of a slope.
_STIFFER = 1.2
# Share of the largest force at which the ways in and out are compared.
_LOW = 0.1
# The upper part of the loading, over which slope and exponent are read.
_UPPER = 0.5
_FEWEST = 5
# Metadata: the lowest point of the way out.
_KEY = "withdrawal_lowest"
# Standard deviation over the median size of the differences of neighbours, for normal noise.
_MAD = 1.4826 / 2.0**0.5


@dataclass(frozen=True)
class Imprint:
    """Signs that a test has deformed its sample plastically.

    Parameters
    ----------
    residual : float
        Distance in depth of the unloading from the loading curve at a tenth of the largest force, over the largest
        indentation; NaN without unloading.
    stiffening : float
        Median over the upper half of the loading of the contact stiffness S over the slope dP/dh of force against
        indentation; NaN without a measured stiffness.
    exponent : float
        Exponent d ln P / d ln h of force P against indentation h over the same part.
    """

    residual: float
    stiffening: float
    exponent: float

    @property
    def reason(self) -> str:
        """Why no elastic contact law fits the loading, as a sentence; empty where there is no such sign."""
        said = []
        if self.residual > _LEFT:
            said.append(f"the way out lies {100.0 * self.residual:.0f} % of the depth beyond the way in")
        if self.stiffening > _STIFFER:
            said.append(f"the sample springs back {self.stiffening:.2g} times as stiffly as it was loaded")
        if not said:
            return ""
        return f"{' and '.join(said)} (exponent of the loading {self.exponent:.2f})"


def imprint_of(curve: Curve, contact_depth: float = 0.0) -> Imprint:
    """Look for signs of plastic deformation in a whole test.

    Parameters
    ----------
    curve : Curve
        A curve with its unloading, or with the column ``contact_stiffness``.
    contact_depth : float, default 0
        Depth reading at contact (m).

    Returns
    -------
    Imprint
        All NaN where the loading is too short.
    """
    way_in = curve.loading()
    nothing = Imprint(math.nan, math.nan, math.nan)
    if len(way_in) < _FEWEST:
        return nothing
    depth = way_in.depth - contact_depth
    deepest, largest = float(depth.max()), float(way_in.force.max())
    upper = (depth > _UPPER * deepest) & (way_in.force > 0.0)
    if not (deepest > 0.0 and largest > 0.0 and np.count_nonzero(upper) >= _FEWEST):
        return nothing
    x, y = np.log(depth[upper]), np.log(way_in.force[upper])
    about = x - x.mean()
    spread = float(about @ about)
    if not spread > 0.0:
        return nothing
    exponent = float(about @ y) / spread
    slope = exponent * np.exp(y.mean() + exponent * about) / depth[upper]
    return Imprint(
        _residual(way_in, _way_out(curve), deepest, largest),
        _stiffening(way_in, upper, slope),
        exponent,
    )


def _way_out(curve: Curve) -> Curve:
    """Return the unloading points after the deepest point: of several cycles, the last and deepest."""
    going = curve.segments() == UNLOADING
    return curve.select(going & (np.arange(len(curve)) > int(np.argmax(curve.depth))))


def _residual(way_in: Curve, way_out: Curve, deepest: float, largest: float) -> float:
    """Return how much deeper unloading is than loading at a tenth of the largest force, as a share of the depth.

    `deepest` (m) and `largest` (N) are the largest indentation and force; NaN if the unloading ends before.
    """
    low = _LOW * largest
    if len(way_out) < _FEWEST or not (way_out.force < low).any():
        return math.nan
    back, forth = int(np.argmax(way_out.force < low)), int(np.argmax(way_in.force >= low))
    return float(way_out.depth[back] - way_in.depth[forth]) / deepest


def _stiffening(way_in: Curve, upper: NDArray[np.bool_], slope: FloatArray) -> float:
    """Return the median of the measured contact stiffness over the loading slope (N/m), at the points `upper`.

    NaN where no stiffness was measured.
    """
    if "contact_stiffness" not in way_in.columns:
        return math.nan
    ratio = way_in.columns["contact_stiffness"][upper] / slope
    known = np.isfinite(ratio) & (ratio > 0.0)
    return float(np.median(ratio[known])) if known.any() else math.nan


class Lowest(NamedTuple):
    """The lowest point of an unloading: depth reading (m), force (N), and the scatter of the force there (N)."""

    depth: float
    force: float
    scatter: float


def remembering_withdrawal(part: Curve, whole: Curve) -> Curve:
    """Return `part` with the lowest point of the unloading of `whole`, from which it was cut, in its metadata."""
    lowest = _of_the_points(whole)
    return part if lowest is None else part.with_metadata(**{_KEY: tuple(lowest)})


def lowest_of(curve: Curve) -> Lowest | None:
    """Return the lowest point of a curve's unloading, or that of the curve it is a part of; None if there is none.

    None too for a curve that is all unloading: its force is judged directly.
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
