"""The foot of a curve: the baseline in front of contact and the beginning of the rise.

What counts as the rise is the *last* climb of the force out of the baseline before the peak, so a dip by
adhesion or a bump in front of it is not taken for contact. The baseline is a line fitted in front of the
rise, near enough that a bent baseline (drag, interference of light) is straight there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, median
from underlay.data.curve import Curve, check_fittable
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import CurveError
from underlay.units import format_quantity

__all__ = ["SIGNIFICANT", "Approach", "Foot", "approach_of", "foot_of"]

#: A force this many standard deviations of noise above the baseline is a force.
SIGNIFICANT = 3.0
# The rise is first placed where the force passes a tenth of its peak. The depth pressed at that point is 0.27
# (ball), 0.46 (cone) to 0.87 (thin layer, force ~ depth^3) of the way from there to the peak.
_TENTH = 0.1
_CLEAR_OF_RISE = 0.5
# Length of the baseline, as a multiple of the way from that point to the peak, and its least points.
_BASELINE_LENGTH = 2.0
_BASELINE_POINTS = 8
# A slope is fitted to a baseline at least this long, in the same measure; else a constant.
_SLOPE_LENGTH = 0.5
# Share of the peak force up to which the foot reaches, tried until it holds enough points.
_FOOT_SHARES = (0.3, 0.6, 1.0)
_FOOT_POINTS = 24
# Below this share of the peak nothing is seen in double precision curves without noise.
_RESOLUTION = 1e-9


@dataclass(frozen=True)
class Approach:
    """The points of a curve up to its peak force, rests in between and retreats left out.

    Parameters
    ----------
    depth, force : ndarray (n,)
        In order of time (m, N); the last point has the peak force.
    """

    depth: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class Foot:
    """The part of a curve that decides where contact is.

    Parameters
    ----------
    depth, force : ndarray (n,)
        Points from the baseline to some way up the rise; force less the baseline (m, N).
    rise : int
        Index of the first point after the last passage through the threshold.
    baseline, baseline_slope : float
        The line in front of the rise, ``baseline + baseline_slope * depth`` (N, N/m).
    noise : float
        Standard deviation of the force about it (N).
    has_baseline : bool
        Whether the curve has a stretch in front of contact at all.
    peak : float
        Peak force above the baseline (N).
    dip : float
        Largest force below the baseline in front of the rise (N), zero or positive.
    """

    depth: FloatArray
    force: FloatArray
    rise: int
    baseline: float
    baseline_slope: float
    noise: float
    has_baseline: bool
    peak: float
    dip: float


def approach_of(curve: Curve) -> Approach:
    """Points of a curve up to its peak force while the indenter goes in, after any rest at the start.

    A curve that holds an unloading and nothing else is read backwards; see `Curve.way_in`.

    Raises
    ------
    CurveError
        If the curve cannot be fitted or never goes in.
    """
    check_fittable(curve)
    labels = curve.segments()
    if (labels == UNLOADING).all():
        curve, labels = curve.way_in(), np.full(len(curve), LOADING)
    going = labels == LOADING
    if not going.any():
        raise CurveError("the indenter never goes in: no loading in the curve")
    first = int(np.argmax(going))
    resting_first = (np.arange(len(curve)) < first) & (labels == HOLD)
    index = np.flatnonzero(going | resting_first)
    last = int(np.argmax(np.where(going[index], curve.force[index], -np.inf)))
    index = index[: last + 1]
    return Approach(curve.depth[index], curve.force[index])


def foot_of(curve: Curve) -> Foot:
    """Find the baseline and the rise of a curve.

    Raises
    ------
    CurveError
        If the curve cannot be fitted, or its force never rises out of the noise.
    """
    approach = approach_of(curve)
    x, force = approach.depth, approach.force
    line, noise, has_baseline = _baseline(x, force)
    above = force - (line[0] + line[1] * x)
    peak = float(above[-1])
    threshold = max(SIGNIFICANT * noise, _RESOLUTION * abs(float(force[-1])))
    if peak <= threshold:
        raise CurveError(
            f"no contact: peak force {format_quantity(peak, 'force')} is within {SIGNIFICANT:.0f} sigma "
            f"({format_quantity(SIGNIFICANT * noise, 'force')}) of the baseline"
        )
    rise = int(np.flatnonzero(above <= threshold)[-1]) + 1 if (above <= threshold).any() else 0
    end = _end_of_foot(above, rise, peak)
    length = float(x[end - 1] - x[max(rise - 1, 0)])
    near = x >= x[rise] - _BASELINE_LENGTH * length
    index = np.flatnonzero(near[:end])
    return Foot(
        x[index],
        above[index],
        int(np.searchsorted(index, rise)),
        float(line[0]),
        float(line[1]),
        noise,
        has_baseline,
        peak,
        float(max(0.0, -above[: rise + 1].min())),
    )


def _end_of_foot(above: FloatArray, rise: int, peak: float) -> int:
    """Index after the last point of the foot."""
    end = len(above)
    for share in _FOOT_SHARES:
        high = np.flatnonzero(above[rise:] >= share * peak)
        end = rise + int(high[0]) + 1
        if end - rise >= _FOOT_POINTS:
            break
    return end


def _baseline(x: FloatArray, force: FloatArray) -> tuple[tuple[float, float], float, bool]:
    """Line in front of the rise, noise about it, and whether there is such a stretch."""
    start = median(force[: max(3, len(force) // 10)])
    below = np.flatnonzero(force < start + _TENTH * (force[-1] - start))
    tenth = int(below[-1]) if below.size else 0
    way = float(x[-1] - x[tenth])
    clear = (np.arange(len(x)) <= tenth) & (x <= x[tenth] - _CLEAR_OF_RISE * way)
    near = clear & (x >= x[tenth] - (_CLEAR_OF_RISE + _BASELINE_LENGTH) * way)
    if np.count_nonzero(near) >= _BASELINE_POINTS:
        sloped = np.ptp(x[near]) >= _SLOPE_LENGTH * way
        line, residual = _robust_line(x[near], force[near], sloped=bool(sloped))
        # The noise is taken over all that is in front of the rise and not only where the line fits best.
        return line, max(_scatter(residual), _sample_noise(force[near])), True
    # No approach: the rest at the start is the baseline, else the first points are.
    resting = x <= x[0] + 0.02 * np.ptp(x)
    count = int(np.argmin(resting)) if not resting.all() else len(x)
    if count >= _BASELINE_POINTS:
        level = median(force[:count])
        return (level, 0.0), max(_scatter(force[:count] - level), _sample_noise(force[:count])), False
    level = median(force[:3])
    return (level, 0.0), _sample_noise(force), False


def _robust_line(x: FloatArray, y: FloatArray, *, sloped: bool) -> tuple[tuple[float, float], FloatArray]:
    """Line through most points: those far off (adhesion, bumps) are left out, three times over."""
    kept: NDArray[np.bool_] = np.ones(len(x), dtype=bool)
    line = (0.0, 0.0)
    residual = y
    for _ in range(4):
        if sloped:
            near, middle = x[kept] - x[kept].mean(), float(y[kept].mean())
            squares = float(near @ near)
            # Points at one depth have no slope.
            slope = float(near @ y[kept]) / squares if squares > 0.0 else 0.0
            line = (middle - slope * float(x[kept].mean()), slope)
        else:
            line = (median(y[kept]), 0.0)
        residual = y - (line[0] + line[1] * x)
        spread = _scatter(residual[kept])
        kept = np.abs(residual) <= SIGNIFICANT * spread if spread > 0.0 else kept
        if np.count_nonzero(kept) < _BASELINE_POINTS // 2:
            break
    return line, residual


def _scatter(values: FloatArray) -> float:
    """Standard deviation, from the median absolute deviation unless most values are equal."""
    spread = float(1.4826 * median(np.abs(values - median(values))))
    # A coarse converter repeats one value; half of them equal would count as no noise at all.
    return spread if spread > 0.0 else float(np.std(values))


def _sample_noise(force: FloatArray) -> float:
    """Standard deviation of white noise, from second differences, which a smooth rise does not enter."""
    if len(force) < 4:
        return 0.0
    return _scatter(np.diff(force, 2)) / float(np.sqrt(6.0))
