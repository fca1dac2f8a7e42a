"""A lever so soft that its own noise is in depth and force at once.

Depth = travel - force / k puts the noise of the deflection into both: their second differences, which are blind to
what is smooth, correlate at -1 and give k. There force against travel is the curve to fit, with a compliance 1/k;
the noise is white again. A noise of the force that grows with dP/dw is no way out: slope and contact would be read
at a noisy depth, 0.36 for 3.00 MPa.
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["lever_coordinate"]

_SHARED = -0.97  # correlation of second differences below which depth and force share their noise
_FEWEST = 30  # readings that tell
_ROUNDED = 0.1  # share of second differences that are exactly zero, from which digits decide and not noise
_ALIKE = 1.6  # how far the constants of the record's halves may differ


def lever_coordinate(depth: FloatArray, force: FloatArray) -> float | None:
    """Spring constant (N/m) of a lever whose noise depth and force share; None where they do not.

    Parameters
    ----------
    depth, force : FloatArray
        Readings in order of time (m, N), (n,).

    Returns
    -------
    float or None
        The ratio of the second differences' sizes, where they correlate below -0.97 in the whole record and in each
        of its halves, with constants that agree.
    """
    if len(depth) < _FEWEST:
        return None
    rows = np.diff(np.vstack((depth, force)), 2, axis=1)
    if (np.abs(rows) <= 1e-12 * np.ptp(np.vstack((depth, force)), axis=1)[:, None]).mean(
        axis=1
    ).max() > _ROUNDED:
        return None
    half = rows.shape[1] // 2
    told = [_constant(part) for part in (rows, rows[:, :half], rows[:, half:])]
    found = [k for k in told if k is not None]
    if len(found) < len(told) or max(found) > _ALIKE * min(found):
        return None
    return found[0]


def _constant(rows: FloatArray) -> float | None:
    """Ratio of the sizes of two rows of second differences that correlate below the limit."""
    (xx, xy), (_, yy) = rows @ rows.T
    if not (xx > 0.0 and yy > 0.0) or xy / (xx * yy) ** 0.5 > _SHARED:
        return None
    return float((yy / xx) ** 0.5)
