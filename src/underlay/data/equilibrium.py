"""Equilibrium points of stepwise stress-relaxation tests.

Cartilage and gels are fitted with their equilibrium (or instantaneous) modulus. An equilibrium point is the mean
over the last part of a hold, with its standard error and a check that the force had stopped relaxing.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.data.segments import HOLD, LOADING, goes_back, runs_of
from underlay.errors import CurveError, InputError

_LEAST_POINTS = 4
# A hold is at rest if the force drifts, over the part that is averaged, by less than this share of itself,
# or by no more than its noise explains (3 standard errors).
_DRIFT = 0.01
_SIGNIFICANT = 3.0
_MOST_CORRELATED = 0.98
# The end of a hold is known to the tolerance of the segments only: this share of it is left out there, so
# that no reading of the next ramp gets in.
_MARGIN = 0.02


@dataclass(frozen=True)
class EquilibriumPoints:
    """The equilibrium points of a test, one per hold.

    Parameters
    ----------
    depth, force, time : ndarray (m,)
        Means over the last part of each hold (m, N, s); time is None if the curve has none.
    force_standard_error : ndarray (m,)
        Standard error of the mean force (N), widened for correlated readings.
    drift : ndarray (m,)
        Change of the force over the averaged part (N).
    stationary : tuple of bool
        Whether the force had stopped changing, up to 1 % or its noise.
    """

    depth: FloatArray
    force: FloatArray
    time: FloatArray | None
    force_standard_error: FloatArray
    drift: FloatArray
    stationary: tuple[bool, ...]


def equilibrium_points(
    depth: FloatArray,
    force: FloatArray,
    time: FloatArray | None,
    segment: NDArray[np.str_],
    *,
    share: float = 0.1,
) -> EquilibriumPoints:
    """Average depth and force over the end of each hold that follows loading.

    Parameters
    ----------
    depth, force, time : ndarray (n,)
        The curve (m, N, s).
    segment : ndarray (n,) of str
        Labels of its points.
    share : float
        Fraction of each hold that is averaged, at its end, in time; in points where there is no time or it is not
        increasing. The last 2 % of a hold are left out.

    Raises
    ------
    InputError
        If `share` is not in (0, 1].
    CurveError
        If there is no hold after loading, or one is too short to average.
    """
    if not 0.0 < share <= 1.0:
        raise InputError(f"share must be in (0, 1]; got {share!r}")
    holds = _holds_after_loading(segment)
    if not holds:
        raise CurveError(
            "no hold after loading: equilibrium points need a relaxation test; fit the loading instead"
        )
    rows, times = [], []
    for number, (first, last) in enumerate(holds, start=1):
        recorded = None if time is None or goes_back(time[first:last]) else time[first:last]
        clock = np.arange(first, last, dtype=np.float64) if recorded is None else recorded
        margin = _MARGIN * (clock[-1] - clock[0])
        end = (clock >= clock[-1] - margin - share * (clock[-1] - clock[0])) & (clock <= clock[-1] - margin)
        if np.count_nonzero(end) < _LEAST_POINTS:
            raise CurveError(
                f"hold {number} has {np.count_nonzero(end)} points in its last {share:.0%}; at least "
                f"{_LEAST_POINTS} are needed: average a larger share"
            )
        times.append(np.nan if time is None else float(time[first:last][end].mean()))
        rows.append(_average(clock[end], depth[first:last][end], force[first:last][end]))
    table = np.array([row[:4] for row in rows])
    return EquilibriumPoints(
        depth=table[:, 0],
        force=table[:, 1],
        time=None if time is None else np.array(times),
        force_standard_error=table[:, 2],
        drift=table[:, 3],
        stationary=tuple(bool(row[4]) for row in rows),
    )


def _holds_after_loading(segment: NDArray[np.str_]) -> list[tuple[int, int]]:
    """Return the first index and the end (exclusive) of each hold that follows a loading."""
    return [
        (first, last)
        for (_, _, before), (first, last, label) in itertools.pairwise(runs_of(segment))
        if (before, label) == (LOADING, HOLD)
    ]


def _average(
    clock: FloatArray, depth: FloatArray, force: FloatArray
) -> tuple[float, float, float, float, bool]:
    centred = clock - clock.mean()
    spread = float(centred @ centred)
    slope = float(centred @ force) / spread if spread > 0.0 else 0.0
    mean = float(force.mean())
    residual = force - mean - slope * centred
    power = float(residual @ residual)
    correlation = float(residual[1:] @ residual[:-1]) / power if power > 0.0 else 0.0
    # Anticorrelated readings would narrow the error; that is not claimed.
    held = min(max(correlation, 0.0), _MOST_CORRELATED)
    variance = power / (len(force) - 2) * (1.0 + held) / (1.0 - held)
    drift = slope * float(clock[-1] - clock[0])
    drift_error = np.sqrt(variance / spread) * float(clock[-1] - clock[0]) if spread > 0.0 else 0.0
    still = abs(drift) <= max(_DRIFT * abs(mean), _SIGNIFICANT * drift_error)
    return (
        float(depth.mean()),
        mean,
        float(np.sqrt(variance / len(force))),
        drift,
        bool(still),
    )
