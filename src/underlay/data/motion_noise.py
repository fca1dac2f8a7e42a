"""What keeps a motion from being a line: noise and how far it reaches, vibration, the stairs of a few digits."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, median

__all__ = ["moving_mean", "noise_of", "reach", "step_of", "wobble_of"]

# Stairs repeat this share of their readings, on so many levels: fewer are the steps of a test.
_REPEATED, _LEVELS = 0.25, 20
# Reversals above this fraction of the range are never taken for vibration.
_VIBRATION = 0.1
# One small reversal is no vibration: a stiff sample comes back so little.
_FEWEST_SWINGS = 3


def noise_of(motion: FloatArray) -> float:
    """Standard deviation of white noise, from second differences: a smooth motion leaves none."""
    second = np.diff(motion, 2)
    return float(1.4826 * median(np.abs(second)) / np.sqrt(6.0))


def reach(count: int) -> float:
    """How far noise takes readings off a line, in its standard deviations, at most.

    The largest of n is at sqrt(2 ln n), and the line itself ends on the largest of an earlier piece. With four in
    its place, ramps of 24,000 readings with 0.5 % of noise fell into hundreds of pieces.
    """
    return 2.0 * float(np.sqrt(2.0 * np.log(count)))


def step_of(motion: FloatArray) -> float:
    """Step of a motion that goes in stairs, as the digits of a file or a converter make them; else zero."""
    jumps = np.abs(np.diff(motion))
    rests = jumps == 0.0
    if np.count_nonzero(rests) < _REPEATED * len(jumps) or rests.all():
        return 0.0
    levels = np.unique(motion[:-1][rests])
    return float(median(jumps[~rests])) if len(levels) >= _LEVELS else 0.0


def moving_mean(motion: FloatArray, width: int) -> FloatArray:
    """Mean over `width` points about each, with the ends held."""
    before = width // 2
    padded = np.pad(motion, (before, width - 1 - before), mode="edge")
    total = np.cumsum(np.concatenate(([0.0], padded)))
    mean: FloatArray = (total[width:] - total[:-width]) / width
    return mean


def wobble_of(heights: FloatArray) -> float:
    """Height of the largest reversal that is vibration and not a step of the test.

    Reversals of a test are a good part of its range, those of vibration are small and many; a gap by a
    factor of three between the two kinds tells them apart. Zero if there is no such gap.
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
