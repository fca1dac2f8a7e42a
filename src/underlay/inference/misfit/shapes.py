"""What drift, jump and ramp would add to the readings of one curve, for amplitudes of one each."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.misfit.drift import DRIFTS

__all__ = ["JUMPS", "RAMPS", "Shapes", "acting_columns", "jump_columns", "ramp_column"]

# Where the steps of a jump stand, as shares of the largest depth, before contact and a little into it; and the gaps
# over which a force that grows toward contact does so (drag, attraction: no step is felt that far out).
_STEPS, _GAPS = np.array([-0.06, -0.03, -0.01, 0.01, 0.04]), np.array([0.03, 0.1, 0.3])
#: Columns of a force that sets in near contact.
JUMPS = len(_STEPS) + len(_GAPS)
#: Columns of a baseline that creeps.
RAMPS = 1
_WIDTHS = np.array([1] * DRIFTS + [JUMPS, RAMPS])


def jump_columns(depth: FloatArray) -> FloatArray:
    """Z: forces that set in near contact, (n, 8), for depths w (m), (n,), negative before contact.

    Steps about contact, and exponentials of the gap that stay at their largest from contact on.
    """
    share = depth[:, None] / depth.max()
    steps = share > _STEPS
    grown = np.exp(np.minimum(share, 0.0) / _GAPS)
    return np.asarray(np.hstack((steps, grown)) / np.sqrt(JUMPS))


def ramp_column(force: FloatArray, time: FloatArray, at: FloatArray | None = None) -> FloatArray:
    """Return a baseline that creeps by the largest of the forces P (n,) over the times (s), (n,): (n, 1).

    At these times, or at others, (m,): (m, 1).
    """
    passed = ((time if at is None else at) - time[0]) / (time[-1] - time[0])
    return np.asarray(float(np.abs(force).max()) * passed[:, None])


def acting_columns(amounts: FloatArray, curves: int) -> NDArray[np.intp]:
    """Which of the `amounts` (10 + 2,) is that of each column of drift, jump, ramp of all curves that has one."""
    acting = np.flatnonzero(amounts > 0.0)
    return np.tile(np.repeat(acting, _WIDTHS[acting]), curves)


class Shapes(NamedTuple):
    """Columns of what acts: drifts as shares of the force, (n, d), and jump and ramp in its unit, (n, m)."""

    drift: FloatArray
    fixed: FloatArray

    @classmethod
    def of(cls, shares: FloatArray, acting: NDArray[np.bool_], jump: FloatArray, ramp: FloatArray) -> Self:
        """Drifts as `shares` of the force (n, d); of jump (n, 8) and ramp (n, 1) those that are `acting` (2,)."""
        fixed = [columns for columns, acts in zip((jump, ramp), acting.tolist(), strict=True) if acts]
        return cls(shares, np.hstack([np.empty((len(shares), 0)), *fixed]))
