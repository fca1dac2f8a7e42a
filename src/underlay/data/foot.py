"""The foot of a curve, from which contact is estimated: the baseline before contact and the beginning of the rise.

The rise is taken as the *last* time before the peak that the force leaves the baseline, so that a dip by adhesion
or a bump in front of it is not taken for contact. The baseline is a line fitted in front of the rise, close enough
to it that a curved baseline (drag, interference of light) is straight there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, median
from underlay.data.curve import Curve, check_fittable
from underlay.data.segments import HOLD, LEAST_BACK, LOADING, UNLOADING
from underlay.errors import CurveError
from underlay.units import format_quantity

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
# A snap to the sample falls by this share of the rise within a fiftieth of the points in front of it, and by so
# many standard deviations: the menisci of public Bioindenter and AFM curves fall by 2 to 100 %.
_SNAP, _SNAP_WITHIN, _SNAP_NOISE = 0.01, 50, 12.0
# Readings in steps repeat this share of their values, on so many levels that are whole steps apart.
_REPEATED, _FEWEST_LEVELS, _WHOLE = 0.25, 8, 0.05
# The depth goes back over the upper half of the rise by `LEAST_BACK`, and by more where the spring constant is not
# known, over so many points; noise that two columns share is this part of their variance; a ratio
# of bending to travel below the last is a calibration's own error. By a public curve on mica: 1.4 %, 20 points,
# 0.95, 1.38.
_UNKNOWN, _FEWEST_RISING, _SHARED, _RIGHT = 4.0, 5, 0.7, 1.05
# No two sensitivities of one lever are as far apart as this, which is less than a step from unit to unit.
_ANOTHER_UNIT = 30.0
# Below this share of the peak nothing is seen in double precision curves without noise.
_RESOLUTION = 1e-9


@dataclass(frozen=True)
class Approach:
    """The loading points of a curve up to its peak force, without holds in between and retreats.

    Parameters
    ----------
    depth, force : ndarray (n,)
        Depth readings (m) and forces (N) in order of time; the last point has the peak force.
    """

    depth: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class Foot:
    """The part of a curve from which contact is estimated: baseline and beginning of the rise.

    Parameters
    ----------
    depth, force : ndarray (n,)
        Depth readings (m), and forces less the baseline (N), from the baseline to some way up the rise.
    rise : int
        Index of the first point after the force last passes the noise threshold.
    baseline, baseline_slope : float
        Line in front of the rise, ``baseline + baseline_slope * depth`` (N, N/m).
    noise : float
        Standard deviation of the force about it (N).
    has_baseline : bool
        Whether the curve has points in front of contact to which the line was fitted.
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
    """Return the loading points of a curve up to its peak force, including a hold at the start.

    A curve that is all unloading is read backwards; see `Curve.way_in`.

    Raises
    ------
    CurveError
        If the curve cannot be fitted or has no loading.
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
    """Find the baseline of a curve and where its force begins to rise from it.

    Raises
    ------
    CurveError
        If the curve cannot be fitted, or its force never rises out of the noise.
    """
    check_fittable(curve)
    require_going_in(curve)
    approach = approach_of(curve)
    x, force = approach.depth, approach.force
    line, noise, has_baseline = _baseline(x, force)
    noise = max(noise, converter_noise(curve.force))
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
    near = x >= x[rise] - _BASELINE_LENGTH * abs(length)
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
    """Return the index after the last point used to find contact: where the force reaches 30 % of its peak.

    It is 60 or 100 % if there are fewer than 24 points up to there. `above` is the force less the baseline (N),
    `rise` the index where it starts to rise.
    """
    end = len(above)
    for share in _FOOT_SHARES:
        high = np.flatnonzero(above[rise:] >= share * peak)
        if not high.size:  # beyond what doubles hold
            break
        end = rise + int(high[0]) + 1
        if end - rise >= _FOOT_POINTS:
            break
    return end


def _baseline(x: FloatArray, force: FloatArray) -> tuple[tuple[float, float], float, bool]:
    """Fit the line in front of the rise.

    Returns the line (value, slope) in N and N/m, the noise about it (N), and whether there are enough points in
    front of contact; without them the first points are taken as a constant baseline.
    """
    start = median(force[: max(3, len(force) // 10)])
    below = np.flatnonzero(force < start + _TENTH * (force[-1] - start))
    tenth = int(below[-1]) if below.size else 0
    snap = _snap(force[: tenth + 1], float(force[-1]) - start)
    way = float(x[-1] - x[tenth])
    if snap is None:
        clear = (np.arange(len(x)) <= tenth) & (x <= x[tenth] - _CLEAR_OF_RISE * way)
        near = clear & (x >= x[tenth] - (_CLEAR_OF_RISE + _BASELINE_LENGTH) * way)
    else:
        # What a meniscus or an adhesive tip pulls at is no baseline: it lies in front of the snap.
        near = np.arange(len(x)) < snap
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


def _snap(force: FloatArray, rise: float) -> int | None:
    """Return the index of the last point before the force drops suddenly in front of the rise; None if it does not.

    `rise` is the height of the rise (N).
    """
    width = max(1, len(force) // _SNAP_WITHIN)
    if len(force) < _BASELINE_POINTS + 2 * width:
        return None
    falls = force[:-width] - force[width:]
    at = int(falls.argmax())
    noise = _sample_noise(force)
    if not falls[at] > max(_SNAP_NOISE * noise, _SNAP * rise) or at < _BASELINE_POINTS:
        return None
    # It stays down, as a spike does not, and what went down before it is no baseline that slopes.
    below, above = force[at + width : at + 3 * width + 1], force[max(at - 2 * width, 0) : at + 1]
    quarters = [median(part) for part in np.array_split(force[:at], 4)]
    stays = median(below) < median(above) - 0.5 * falls[at]
    return at if stays and max(quarters) - min(quarters) < 0.5 * falls[at] else None


def converter_noise(force: FloatArray) -> float:
    """Return the standard deviation (N) of rounding by a converter or few digits: step / sqrt(12), Bennett 1948.

    Zero where the readings are not in steps. Repeated readings alone do not show steps: many files have one single
    value for no force.
    """
    extent = float(np.ptp(force))
    if len(force) < _FEWEST_LEVELS or not extent > 0.0:
        return 0.0
    levels = np.unique(force)
    if len(force) - len(levels) < _REPEATED * len(force) or len(levels) < _FEWEST_LEVELS:
        return 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    # Whole multiples of one step, to the digits that are written.
    off = np.abs(steps / step - np.rint(steps / step))
    return step / float(np.sqrt(12.0)) if off.max() < _WHOLE else 0.0


def require_going_in(curve: Curve) -> None:
    """Raise an error for a curve whose depth decreases while its force rises.

    The cantilever then seems to bend more than it is moved, as with a wrong sensitivity.

    Raises
    ------
    CurveError
        The message states by how much more, if the spring constant is known or follows from the noise that depth
        and force share.
    """
    # Up to the largest force in order of time: such a motion may be called a way out.
    end = int(np.argmax(curve.force)) + 1
    x, force = curve.depth[:end], curve.force[:end]
    half = 0.5 * (float(curve.force[end - 1]) + median(force[: max(3, end // 10)]))
    below = np.flatnonzero(force <= half)
    if not below.size or end - below[-1] < _FEWEST_RISING:
        return
    part = slice(int(below[-1]), None)
    stiffness = curve.metadata.get("spring_constant") or _shared_stiffness(x, force)
    back = float(x[part][0] - x[-1])
    least = LEAST_BACK * float(np.ptp(x)) * (1.0 if stiffness else _UNKNOWN)
    if back <= max(least, 2.0 * SIGNIFICANT * _sample_noise(x)):
        return
    # A depth with the wrong sign goes back all along, and the travel with it.
    known = stiffness if curve.metadata.get("bending_taken_off") else None
    goes_in = bool(known) and x[-1] - x[0] + (force[-1] - force[0]) / known > 0.0
    if x[part][0] - x[0] < back and not goes_in:
        return
    if force[-1] - force[part][0] <= 2.0 * SIGNIFICANT * _sample_noise(force):
        return
    ratio = 0.0
    if stiffness:
        bending = (force[part] - force[part][0]) / stiffness
        moved = float(x[-1] - x[part][0] + bending[-1])
        ratio = float(bending[-1]) / moved if moved > 0.0 else 0.0
        # A calibration that is right to a few per cent is right: rigid samples take no better one.
        if 0.0 < ratio < _RIGHT:
            return
    more = f", {ratio:.2f} nm per nm of travel" if ratio > 1.0 else ""
    fault = f"too large by {100.0 * (ratio - 1.0):.0f} % at least" if ratio > 1.0 else "too large"
    cause = f"Its sensitivity (nm/V) looks {fault}: calibrate it again"
    if ratio > _ANOTHER_UNIT:
        cause = f"Its spring constant or the unit of the force looks wrong, {ratio:.0f} times: check both"
    raise CurveError(
        f"the depth goes back by {format_quantity(back, 'length')} while the force rises: the lever is said to "
        f"bend more than it travels{more}, which no sample does. {cause} on a rigid sample, where deflection "
        "follows travel one to one"
    )


def _shared_stiffness(x: FloatArray, force: FloatArray) -> float | None:
    """Estimate the spring constant (N/m) from the noise that depth and force share; None if they share none.

    Noise of a deflection enters the force (N), (n,), and, with the opposite sign, the depth `x` (m), (n,).
    """
    depth, push = np.diff(x, 2), np.diff(force, 2)
    shared, own, other = float(depth @ push), float(push @ push), float(depth @ depth)
    if not own * other > 0.0 or shared >= 0.0 or shared * shared < _SHARED * own * other:
        return None
    return -own / shared


def _robust_line(x: FloatArray, y: FloatArray, *, sloped: bool) -> tuple[tuple[float, float], FloatArray]:
    """Fit a line to most points, leaving out outliers (adhesion, bumps) in up to four passes.

    Returns (value, slope), with slope zero unless `sloped`, and the residuals of all points (n,).
    """
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
    """Return the standard deviation from the median absolute deviation; the plain one if most values are equal."""
    spread = float(1.4826 * median(np.abs(values - median(values))))
    # A coarse converter repeats one value; half of them equal would count as no noise at all.
    return spread if spread > 0.0 else float(np.std(values))


def _sample_noise(force: FloatArray) -> float:
    """Return the standard deviation of white noise (N) from second differences, which a smooth rise leaves out."""
    if len(force) < 4:
        return 0.0
    return _scatter(np.diff(force, 2)) / float(np.sqrt(6.0))
