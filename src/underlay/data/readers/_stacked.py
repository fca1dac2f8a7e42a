"""Several tests one below the other in one table: where each of them begins.

Blank rows, a row of names that is repeated, a clock that is set back or a leap of the depth mark where a test may
begin; that the depth begins again there, and goes in again, tells it from the next segment of one test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, median

__all__ = ["beginnings", "stacked_note"]

# A test has so many readings, and goes in by this share of the depths of all; a depth that goes on does not leap by
# as much between two readings. The published tables in which this was met (public AFM and Instron exports) have 60
# readings a test and more.
_FEWEST, _WAY = 8, 0.3
# Where rows mark it, a leap is one of this many steps.
_STEPS, _SMALL = 10.0, 0.1
# Blank rows between all rows mark nothing.
_DENSE = 0.25


def beginnings(
    depth: FloatArray,
    time: FloatArray | None,
    breaks: Sequence[int],
    clocks: Callable[[], Iterable[FloatArray]],
) -> list[int]:
    """Rows at which a test begins, the first among them: ``[0]`` for a table of one.

    Parameters
    ----------
    depth, time : ndarray (n,)
        As read; NaN where there is none.
    breaks : sequence of int
        Rows before which something else than readings stands.
    clocks : callable
        The other columns of numbers, asked for only where the depth comes back and goes in again.
    """
    count = len(depth)
    if count < 2 * _FEWEST:
        return [0]
    goes_on = time is None or not (time[1:] < time[:-1]).any()
    if not breaks and goes_on and (depth[1:] >= depth[:-1]).all():  # as most curves do
        return [0]
    filled = _filled(depth)
    extent = float(np.ptp(filled))
    if not extent > 0.0:
        return [0]
    motion = _Motion(filled, extent)
    leaps = [row for row in motion.leaps() if time is None or _stopped(time, row)]
    marked = [row for row in breaks if 0 < row < count] if len(breaks) < _DENSE * count else []
    certain = {row for row in marked if motion.begins(row)} | {row for row in leaps if motion.goes_in(row)}
    found = [time] if time is not None else (clocks() if not certain and motion.comes_back() else [])
    for clock in found:
        certain |= _set_back(clock, motion)
    return _apart(sorted(certain), count)


def stacked_note(rows: Sequence[int]) -> str:
    """What to say of tests one below the other that begin at these rows (from 0)."""
    where = ", ".join(str(row + 1) for row in rows[1:6])
    more = ", ..." if len(rows) > 6 else ""
    return (
        f"the table holds {len(rows)} tests one below the other: the depth begins again in row "
        f"{where}{more}; each is read as a test of its own"
    )


class _Motion:
    """A depth, and which way it first goes."""

    def __init__(self, depth: FloatArray, extent: float) -> None:
        self.start = median(depth[:3])
        far = int(np.abs(depth - self.start).argmax())
        self.into = 1.0 if depth[far] >= self.start else -1.0
        self.depth, self.extent = self.into * depth, extent
        self.start *= self.into
        moved = np.abs(np.diff(depth))
        self.step = median(moved[moved > 0.0]) if (moved > 0.0).any() else 0.0

    def leaps(self) -> list[int]:
        """Rows to which the depth came back in one step, as no motion does."""
        back = -np.diff(self.depth)
        far = back > max(_WAY * self.extent, 0.5 * _STEPS * self.step)
        return [int(row) + 1 for row in np.flatnonzero(far)]

    def goes_in(self, row: int) -> bool:
        """Whether the depth goes in from a row on, before it is far behind it."""
        ahead = self.depth[row:] - self.depth[row]
        far = np.flatnonzero(np.abs(ahead) > _WAY * self.extent)
        return bool(far.size and ahead[far[0]] > 0.0)

    def begins(self, row: int) -> bool:
        """Whether the depth begins again at a row that something marks."""
        leap = abs(self.depth[row] - self.depth[row - 1])
        near = abs(self.depth[row] - self.start) <= _WAY * self.extent
        again = near or leap > max(_SMALL * self.extent, _STEPS * self.step)
        return again and self.goes_in(row) and bool(np.ptp(self.depth[:row]) > _WAY * self.extent)

    def comes_back(self) -> bool:
        """Whether the depth is near its start again after it was far, and goes in once more."""
        pressed = self.depth - self.start
        far = np.flatnonzero(pressed > 0.5 * self.extent)
        if not far.size:
            return False
        near = np.flatnonzero(pressed[far[0] :] < _SMALL * self.extent)
        return bool(near.size) and bool((pressed[far[0] + near[0] :] > 0.5 * self.extent).any())


def _stopped(time: FloatArray, row: int) -> bool:
    """Whether a clock was set back or stood still for long before a row: one that goes on is of one test."""
    ticks = np.diff(_filled(time))
    return bool(ticks[row - 1] <= 0.0 or ticks[row - 1] > _STEPS * median(ticks))


def _set_back(clock: FloatArray, motion: _Motion) -> set[int]:
    """Rows at which a clock and the depth begin again; none of a clock that each segment sets back."""
    if not np.isfinite(clock).any():
        return set()
    ticks = np.diff(_filled(clock))
    rows = [int(row) + 1 for row in np.flatnonzero(ticks < 0.0)]
    # What falls as often as that is a reading and no clock.
    if not rows or len(rows) * _FEWEST > len(clock):
        return set()
    begun = {row for row in rows if motion.begins(row)}
    return begun if len(begun) == len(rows) else set()


def _filled(values: FloatArray) -> FloatArray:
    """Values with the last one before it for each that is missing."""
    there = np.isfinite(values)
    if there.all():
        return values
    if not there.any():
        return np.zeros(len(values))
    last: NDArray[np.intp] = np.maximum.accumulate(np.where(there, np.arange(len(values)), 0))
    last[: int(there.argmax())] = int(there.argmax())
    return values[last]


def _apart(rows: Sequence[int], count: int) -> list[int]:
    """Rows that leave enough readings for a test on either side."""
    kept = [0]
    for row in rows:
        if row - kept[-1] >= _FEWEST and count - row >= _FEWEST:
            kept.append(row)
    return kept
