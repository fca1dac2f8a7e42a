"""Segments of a test from its motion: loading, hold, unloading.

The motion is replaced by the polyline that stays within a tolerance of it (Douglas & Peucker 1973,
doi:10.3138/FM57-6770-U75U-7727, here splitting the piece with the largest deviation first). Each piece of the
polyline is then moving or at rest, by its speed relative to the speed at which most of the travel is done. A
polyline needs no uniform sampling, and a suitable tolerance makes it insensitive to noise (`noise_of`, `reach`),
vibration (`wobble_of`) and quantisation (`step_of`).

Depth alone cannot distinguish the holds of a stiff sample from its slow loading and unloading; a force can, as
there it changes together with the depth (`segments_from_motion`).
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, median

# Stairs repeat this share of their readings, on so many levels: fewer are the steps of a test.
_REPEATED, _LEVELS = 0.25, 20
# Reversals above this fraction of the range are never taken for vibration.
_VIBRATION = 0.1
# One small reversal is no vibration: a stiff sample comes back so little.
_FEWEST_SWINGS = 3
LOADING = "loading"
HOLD = "hold"
UNLOADING = "unloading"
# A piece slower than this fraction of the speed of travel rests. Under a load ramp on a Hertz contact the
# depth slows down as t**(-1/3), to a fifth of its speed at 1 % of the ramp: 0.1 keeps that as loading.
_REST_SPEED = 0.1
# Tolerance of the polyline, as a fraction of the range of the motion, and in steps of a motion in stairs. In noise
# it grows with the number of readings.
_TOLERANCE = 0.01
_STEPS = 1.5
# A change by fewer standard deviations of the noise is none.
_NOISE = 4.0
# White noise above the tolerance is averaged down over as many points as that takes, but never over more than
# this part of the curve: corners would be rounded.
_SMOOTHED = 20
# A slow piece that goes back while the force falls by this fraction of its range is unloading. One that goes in
# while it rises so, and by more than noise, is loading, as after an approach ten times as fast.
_CHANGE = 0.05
# Cycles of a stiff sample, as of KLA's tungsten and made ones: each lets go of this share of its force at least,
# over so many readings, along lines to this share of it, and depth and force share this part of their variance.
# Changes are told from noise by so many standard deviations.
_LETS_GO, _FEWEST, _STRAIGHT, _SHARED, _CLEAR = 0.3, 5, 0.05, 0.5, 4.0
# A rest changes neither by this share.
_REST = 0.05
# A hold of a file in which depth and force rise by this share of their ranges is a ramp: the one that was met rose
# by two thirds, and the creep of gels under a held force leaves the force where it was.
_RAMP = 0.05
#: A depth that goes back by less than this share of its range rests: by a public curve on mica, 1.4 % goes back.
LEAST_BACK = 5e-3
# More corners than any protocol has (two a cycle), and readings looked at for them, in two seconds; bounds the work
# on a file of spikes.
_MAX_PIECES, _LOOKED_AT = 10_000, 300_000_000


def noise_of(motion: FloatArray) -> float:
    """Return the standard deviation of white noise in a motion (n,), from second differences."""
    second = np.diff(motion, 2)
    return float(1.4826 * median(np.abs(second)) / np.sqrt(6.0))


def reach(count: int) -> float:
    """Return the largest deviation of noisy readings from a line, in standard deviations, for `count` readings.

    The largest of n deviates is at sqrt(2 ln n), and the line itself may end on such a reading, hence twice that.
    With a constant of four, ramps of 24,000 readings with 0.5 % of noise were split into hundreds of pieces.
    """
    return 2.0 * float(np.sqrt(2.0 * np.log(count)))


def step_of(motion: FloatArray) -> float:
    """Return the step of a motion that a converter or the digits of a file have quantised; else zero."""
    jumps = np.abs(np.diff(motion))
    rests = jumps == 0.0
    if np.count_nonzero(rests) < _REPEATED * len(jumps) or rests.all():
        return 0.0
    levels = np.unique(motion[:-1][rests])
    return float(median(jumps[~rests])) if len(levels) >= _LEVELS else 0.0


def moving_mean(motion: FloatArray, width: int) -> FloatArray:
    """Return the mean over `width` points about each point, (n,), with the end values repeated beyond the ends."""
    before = width // 2
    padded = np.pad(motion, (before, width - 1 - before), mode="edge")
    total = np.cumsum(np.concatenate(([0.0], padded)))
    mean: FloatArray = (total[width:] - total[:-width]) / width
    return mean


def wobble_of(heights: FloatArray) -> float:
    """Return the height of the largest reversal that is vibration and not part of the test.

    `heights` are the corners of the motion. Reversals of a test are a good part of its range, those of vibration
    are small and many; a gap by a factor of three separates them. Zero if there is no such gap.
    """
    directions = np.sign(np.diff(heights))
    turns = np.flatnonzero(directions[1:] != directions[:-1]) + 1
    reversals = np.sort(np.abs(np.diff(heights[[0, *turns, len(heights) - 1]])))[::-1]
    small = reversals[1:] < _VIBRATION * np.ptp(heights)
    gap = reversals[:-1] >= 3.0 * reversals[1:]
    first = np.flatnonzero(small & gap)
    if not first.size or len(reversals) - 1 - first[0] < _FEWEST_SWINGS:
        return 0.0
    return float(reversals[first[0] + 1])


def segments_from_motion(
    motion: FloatArray, time: FloatArray | None = None, force: FloatArray | None = None
) -> NDArray[np.str_]:
    """Label every point of a motion as loading, hold or unloading.

    A stiff sample recovers so little that its unloading is as slow as a hold, and a slow loading after a fast
    approach is too. The force tells them apart: in loading and unloading it changes together with the depth, which
    it does not in a hold: under constant load the depth alone creeps, and at constant depth it does not change.

    Parameters
    ----------
    motion : ndarray (n,)
        Depth, or better the position of the actuator, growing into the sample (m).
    time : ndarray (n,), optional
        Time (s). Without it, or where it decreases, as when every segment starts at zero, the index of the
        reading is used.
    force : ndarray (n,), optional
        Force, positive in compression (N).

    Returns
    -------
    ndarray (n,) of str
        ``"loading"``, ``"hold"`` or ``"unloading"``.
    """
    n = len(motion)
    finite = all(np.isfinite(values).all() for values in (motion, time) if values is not None)
    if n < 3 or not finite or _only_loads(motion, time):
        return one_label(LOADING, n)
    clock = np.arange(n, dtype=np.float64) if time is None or goes_back(time) else time
    if np.ptp(clock) <= 0.0:
        return one_label(LOADING, n)
    measured, noise = motion, noise_of(motion)
    extent = float(np.ptp(motion))
    least = _TOLERANCE * extent
    if (
        extent <= 2.0 * _NOISE * noise or least == 0.0
    ):  # no more than noise, or rounding, swings to both sides
        return one_label(HOLD, n)
    farthest, step = reach(n), step_of(motion)
    wanted = (farthest * noise / least) ** 2
    width = int(min(wanted, n / _SMOOTHED))
    if width > 1:
        motion, noise = moving_mean(motion, width), noise / np.sqrt(width)
    tolerance = max(least, farthest * noise, _STEPS * step)
    splits = _splits(clock, motion, tolerance)
    corners = _corners(splits, n)
    wobble = wobble_of(motion[corners])
    if wobble > tolerance:
        tolerance = wobble
        # The worst come first: those of a wider tolerance are the first of them.
        corners = _corners(itertools.takewhile(lambda split: split[0] > wobble, splits), n)
    if force is not None and not np.isfinite(force).all():
        force = None
    same_sense = None if force is None else _same_sense(force, motion, corners, tolerance)
    pieces = _pieces(clock, motion, corners, tolerance, same_sense, max(width, 1))
    if all(label == LOADING for _, _, label in pieces):
        return one_label(LOADING, n)
    labels: NDArray[np.str_] = np.full(n, LOADING, dtype="<U9")
    for first, last, label in pieces:
        labels[first : last + 1] = label
    if force is not None:
        _end_holds(labels, clock, force)
        _split_holds(labels, clock, measured, force)
        _load_to_the_peak(labels, motion, force, max(_NOISE * noise, LEAST_BACK * extent))
    return labels


def _same_sense(
    force: FloatArray, motion: FloatArray, corners: list[int], tolerance: float
) -> NDArray[np.bool_]:
    """Return for each piece between corners whether force and motion both rise or both fall, beyond noise."""
    whole = max(float(np.ptp(force)), np.finfo(float).tiny)
    pressed, moved = np.diff(force[corners]) / whole, np.diff(motion[corners])
    clear = max(_CHANGE, _NOISE * noise_of(force) / whole)
    return ((pressed < -_CHANGE) & (moved < -tolerance)) | ((pressed > clear) & (moved > tolerance))


def _end_holds(labels: NDArray[np.str_], clock: FloatArray, force: FloatArray) -> None:
    """Correct `labels` in place: a hold ends where the force begins to fall towards the unloading.

    The depth of a stiff sample shows the unloading only later.
    """
    for (first, turn, label), (_, last, after) in itertools.pairwise(runs_of(labels)):
        if (label, after) != (HOLD, UNLOADING) or clock[last - 1] <= clock[first]:
            continue
        x, y = clock[first:last] - clock[first], force[first:last]
        # Above the straight line to the end, and farthest where the way out begins.
        above = y - y[0] - x * ((y[-1] - y[0]) / x[-1])
        corner = first + int(above.argmax())
        if corner < turn and above.max() > _CHANGE * float(np.ptp(y)):
            labels[corner + 1 : turn] = UNLOADING


def _load_to_the_peak(labels: NDArray[np.str_], motion: FloatArray, force: FloatArray, clear: float) -> None:
    """Correct `labels` in place: a depth that goes back by more than `clear` while the force rises is loading too.

    So it does over the upper half of the rise where a lever is said to bend more than it travels. A force with the
    wrong sign rises to its peak out of contact, as high as at the start.
    """
    top = int(force.argmax())
    before = np.flatnonzero(labels[:top] == LOADING)
    below = np.flatnonzero(force[:top] <= 0.5 * (force[top] + force[0]))
    if labels[top] != LOADING and before.size and below.size and motion[below[-1]] - motion[top] > clear:
        labels[before[-1] : top + 1] = LOADING


def _split_holds(labels: NDArray[np.str_], clock: FloatArray, motion: FloatArray, force: FloatArray) -> None:
    """Correct `labels` in place: find load cycles of a stiff sample within a hold.

    In a cycle the force falls and rises by much and the depth by little with it; at a held depth the force may fall
    too, but the depth does not decrease with it.
    """
    noise, rough, stairs = noise_of(motion), noise_of(force), step_of(force) > 0.0
    for first, last, run in runs_of(labels):
        y = force[first:last]
        if run == LOADING or last - first < 2 * _FEWEST or np.ptp(y) <= _LETS_GO * np.abs(y).max():
            continue
        span = float(np.ptp(motion[first:last]))
        tolerance = max(_STRAIGHT * float(np.ptp(y)), reach(last - first) * rough)
        corners = _corners(_splits(clock[first:last], y, tolerance), last - first)
        for start, end in itertools.pairwise(corners):
            x, f = motion[first + start : first + end + 1], y[start : end + 1]
            pressed, moved = float(f[-1] - f[0]), float(x[-1] - x[0])
            clear = abs(pressed) > max(_LETS_GO * float(np.abs(f).max()), _CLEAR * rough)
            still = abs(pressed) <= max(_REST * float(np.abs(f).max()), _CLEAR * rough)
            if run == UNLOADING:
                if stairs:  # a rest of few digits is one step of them
                    break
                # The rest at the peak, which a wide tolerance took with the way out.
                if (
                    still
                    and start == 0
                    and abs(moved) <= max(_REST * span, _CLEAR * noise)
                    and len(f) >= _FEWEST
                ):
                    labels[first : first + end] = HOLD
            elif clear and moved * pressed > 0.0 and abs(moved) > _CLEAR * noise and _is_linear(x, f):
                label = LOADING if pressed > 0.0 else UNLOADING
                labels[first + start + (start > 0) : first + end + 1] = label


def _is_linear(x: FloatArray, y: FloatArray) -> bool:
    """Whether two columns (n,) are nearly proportional, up to a constant."""
    if len(x) < _FEWEST:
        return False
    x, y = x - x.mean(), y - y.mean()
    return bool((x @ y) ** 2 > _SHARED * float(x @ x) * float(y @ y))


def against_motion(
    labels: NDArray[np.str_], depth: FloatArray, time: FloatArray | None, force: FloatArray
) -> tuple[NDArray[np.str_], tuple[str, ...]]:
    """Return a file's segment labels, corrected where it calls a hold what is clearly loading by the motion.

    Parameters
    ----------
    labels : ndarray (n,) of str
        Labels of the file.
    depth, force : ndarray (n,)
        Depth (m) and force (N).
    time : ndarray (n,), optional
        Time (s).

    Returns
    -------
    tuple
        Labels (n,), and a note for each hold that was corrected.
    """
    extent, whole = float(np.ptp(depth)), float(np.ptp(force))
    found, notes = labels, []
    motion: NDArray[np.str_] | None = None
    for first, last, label in runs_of(labels):
        if label != HOLD or np.ptp(depth[first:last]) <= _RAMP * extent:
            continue
        motion = segments_from_motion(depth, time, force) if motion is None else motion
        part = np.flatnonzero(motion[first:last] == LOADING) + first
        # A creep goes in as well, under a force that is held.
        if not part.size or np.ptp(depth[part]) <= _RAMP * extent or np.ptp(force[part]) <= _RAMP * whole:
            continue
        found = found.copy() if found is labels else found
        found[first:last] = motion[first:last]
        notes.append(
            f"the file calls points {first + 1} to {last} a hold, but the indenter goes in by "
            f"{100.0 * float(np.ptp(depth[part])) / extent:.0f} % of its way there: the motion decides"
        )
    return found, tuple(notes)


def goes_back(time: FloatArray) -> bool:
    """Whether the time decreases between two readings."""
    return bool((time[1:] < time[:-1]).any())


def one_label(label: str, count: int) -> NDArray[np.str_]:
    """Return a read-only array (count,) of the same label, stored once: a million copies would take 36 MB."""
    once = np.array(label, dtype="<U9")
    once.flags.writeable = False
    # What `np.broadcast_to` makes, in a twentieth of its time.
    return np.ndarray((count,), once.dtype, once, strides=(0,))


def one_of_each(labels: NDArray[np.str_]) -> NDArray[np.str_]:
    """Return labels as they are, (n,), or a single one, (1,), if they were made by `one_label`."""
    return labels[:1] if labels.strides == (0,) else labels


def runs_of(labels: NDArray[np.str_]) -> list[tuple[int, int, str]]:
    """Return first index, end (exclusive) and label of each run of equal labels, in order."""
    one = one_of_each(labels)
    ends = [0, *(np.flatnonzero(one[1:] != one[:-1]) + 1).tolist(), len(labels)]
    return [
        (first, last, str(one[min(first, len(one) - 1)]))
        for first, last in itertools.pairwise(ends)
        if last > first
    ]


def label_pieces(
    depth: FloatArray, starts: NDArray[np.intp], known: Mapping[int, str] | None = None
) -> NDArray[np.str_]:
    """Label the pieces into which a file divides a curve, each as a whole.

    Parameters
    ----------
    depth : ndarray (n,)
        Depth, growing into the sample (m).
    starts : ndarray (m + 1,) of int
        First index of each piece, and n.
    known : mapping of int to str, optional
        Labels that the file gives, by the first index of the piece.

    Returns
    -------
    ndarray (n,) of str
        Labels; a piece without one in `known` is loading if it ends deeper than it starts, else unloading.
    """
    labels: NDArray[np.str_] = np.empty(len(depth), dtype="<U9")
    for first, last in itertools.pairwise(starts):
        deeper = depth[last - 1] >= depth[first]
        labels[first:last] = (known or {}).get(int(first), LOADING if deeper else UNLOADING)
    return labels


def _only_loads(motion: FloatArray, time: FloatArray | None) -> bool:
    """Whether the motion increases throughout and never slowly, as in most curves: then all of it is loading."""
    speed = motion[1:] - motion[:-1]
    if speed.min() <= 0.0:
        return False
    if time is not None:
        ticks = time[1:] - time[:-1]
        if ticks.min() <= 0.0:
            return False
        speed /= ticks
    return bool(speed.min() >= _REST_SPEED * speed.max())


def _corners(splits: Iterable[tuple[float, int]], count: int) -> list[int]:
    """Return the indices of a polyline's corners, in order, with both ends of the `count` points.

    `splits` are (deviation, index), as of `_splits`.
    """
    return sorted({0, count - 1, *(index for _, index in splits)})


def _splits(clock: FloatArray, motion: FloatArray, tolerance: float) -> list[tuple[float, int]]:
    """Return (deviation, index) of the corners of a polyline within `tolerance` of the motion.

    The piece with the largest deviation is split first, at the point where it deviates most.
    """
    splits: list[tuple[float, int]] = []
    worst: list[tuple[float, int, int, int]] = []

    def propose(first: int, last: int) -> None:
        if last - first < 2:
            return
        x = clock[first : last + 1]
        y = motion[first : last + 1]
        run = x[-1] - x[0]
        # In place: most pieces are short, and calls are what they cost.
        miss = x - x[0]
        miss *= (y[-1] - y[0]) / run if run > 0.0 else 0.0
        miss += y[0]
        miss -= y
        np.abs(miss, out=miss)
        split = int(miss.argmax())
        if miss[split] > tolerance and 0 < split < last - first:
            heapq.heappush(worst, (-float(miss[split]), first, first + split, last))

    propose(0, len(motion) - 1)
    looked_at = 0
    while worst and len(splits) + 2 < _MAX_PIECES and looked_at < _LOOKED_AT:
        miss, first, split, last = heapq.heappop(worst)
        looked_at += last - first
        splits.append((-miss, split))
        propose(first, split)
        propose(split, last)
    return splits


def _pieces(
    clock: FloatArray,
    motion: FloatArray,
    corners: list[int],
    tolerance: float,
    same_sense: NDArray[np.bool_] | None,
    width: int,
) -> list[tuple[int, int, str]]:
    """Return first index, last index and label of each piece between corners.

    `same_sense` says for each piece whether force and motion change together; `width` is the number of points over
    which the motion was averaged.
    """
    ends = np.array(corners)
    run = np.diff(clock[ends])
    rise = np.diff(motion[ends])
    # A step within one clock tick is as fast as the fastest piece that took time.
    timed = run > 0.0
    speed = np.full(len(run), np.inf)
    speed[timed] = np.abs(rise[timed]) / run[timed]
    resting = speed < _REST_SPEED * _speed_of_travel(speed, np.abs(rise))
    if same_sense is not None:
        resting &= ~same_sense
    # A piece no higher than the tolerance between two resting ones is a wobble of the hold.
    low = np.abs(rise) <= tolerance
    calm = resting | low
    for i in np.flatnonzero(low & ~resting):
        before = calm[i - 1] if i > 0 else True
        after = calm[i + 1] if i + 1 < len(calm) else True
        resting[i] = before and after
    labels = np.where(resting, HOLD, np.where(rise > 0.0, LOADING, UNLOADING))
    found: list[tuple[int, int, str]] = []
    for k, label in enumerate(labels):
        first, last = int(ends[k]) + (k > 0), int(ends[k + 1])
        if 0 < k < len(labels) - 1 and _is_turn(labels[k - 1 : k + 2]):
            # Half of it at the speed of either side is what a turn is rounded by.
            rounded = 0.5 * run[k] * min(speed[k - 1], speed[k + 1])
            if rounded <= tolerance or ends[k + 1] - ends[k] <= width:
                part = motion[first : last + 1]
                turn = first + int(part.argmax() if labels[k - 1] == LOADING else part.argmin())
                found += [(first, turn, str(labels[k - 1])), (turn + 1, last, str(labels[k + 1]))]
                continue
        found.append((first, last, str(label)))
    return [piece for piece in found if piece[0] <= piece[1]]


def _is_turn(labels: NDArray[np.str_]) -> bool:
    """Whether the middle one of three pieces is a hold between loading and unloading, in either order."""
    before, here, after = labels
    return bool(here == HOLD and {str(before), str(after)} == {LOADING, UNLOADING})


def _speed_of_travel(speed: FloatArray, travel: FloatArray) -> float:
    """Return the speed at or above which half of the travel is done, from speed and travel of each piece."""
    order = np.argsort(speed)[::-1]
    done = np.cumsum(travel[order])
    chosen = speed[order][int(np.searchsorted(done, 0.5 * done[-1]))]
    finite = speed[np.isfinite(speed)]
    return float(chosen) if np.isfinite(chosen) else float(finite.max(initial=0.0))
