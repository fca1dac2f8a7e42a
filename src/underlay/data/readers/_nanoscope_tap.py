"""The taps of a PeakForce capture: the drive is a sine, of which the file holds the amplitude and the turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.readers._nanoscope_header import Header
from underlay.data.segments import LOADING, UNLOADING
from underlay.errors import FileFormatError

__all__ = ["Tap", "tap_of"]

# The turn of the drive: the first that is not zero.
_TURNS = ("Sync Distance QNM", "Sync Distance New", "Sync Distance")


@dataclass(frozen=True)
class Tap:
    """One period of the drive.

    Parameters
    ----------
    points : int
        Points of a period, beginning on the way in.
    turn : float
        Point at which the drive is deepest.
    amplitude : float
        Of the drive (m).
    period : float or None
        Time of one tap (s), if it is written.
    """

    points: int
    turn: float
    amplitude: float
    period: float | None

    @property
    def travel(self) -> FloatArray:
        """Travel of the drive (m), (points,), in the order of time: amplitude times the cosine about the turn."""
        phase = 2.0 * np.pi * (np.arange(self.points) - self.turn) / self.points
        return np.asarray(self.amplitude * np.cos(phase))

    @property
    def time(self) -> FloatArray | None:
        """Time (s), (points,)."""
        return None if self.period is None else np.linspace(0.0, self.period, self.points, endpoint=False)

    @property
    def labels(self) -> NDArray[np.str_]:
        """Labels of the points of this tap; past the far end of its travel the way in of the next one begins."""
        last = min(int(self.turn + self.points / 2) + 1, self.points)
        return np.where(np.arange(last) <= self.turn, LOADING, UNLOADING).astype("<U9")


def tap_of(header: Header, points: int, hold: int) -> Tap | None:
    """Return what the header says of a capture's taps of so many points; None where the file holds ramps.

    Raises
    ------
    FileFormatError
        If it says too little, or the drive turns elsewhere than on its way in.
    """
    scan = header.section("Ciao scan list")
    if scan.text("PeakForce Capture") != "Allow" or scan.text("Operating mode") != "Image":
        return None
    amplitude = scan.length("Peak Force Amplitude")
    turn = next((number for name in _TURNS if (number := scan.number(name))), 0.0)
    turn *= points / (scan.number("Sample Points") or points)
    if hold or not amplitude > 0.0 or not 1.0 < turn < points / 2:
        raise FileFormatError(
            f"{header.source.name} is a capture whose drive of {1e9 * amplitude:g} nm turns at point {turn:g} of "
            f"{points}: it should turn on its way in, and be larger than zero"
        )
    kilohertz = scan.number("PFT Freq")
    return Tap(points, turn, amplitude, 1e-3 / abs(kilohertz) if kilohertz else None)
