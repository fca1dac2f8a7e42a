"""What a law may leave out that grows with depth or with time in contact: the columns of a drift, and their sizes.

A drift is a relative error of the law that is nil at contact:

- smooth in the contact radius, P s^j / j with s = (w / w_max)^(1/2) and j = 1 to 4: finite strain, a base that is
  not what the scene says;
- the force that a layer loses which relaxes while it is pressed, integral of exp(-(t - t') / tau) dP(t') - P (Lee
  and Radok 1960), for times tau from a twenty-fifth of the time since contact to all of it;
- where a scene says half-space, a base after all: P (1.133 x + 1.283 x^2 + 0.769 x^3 + 0.0975 x^4), x = 1.5 s, of a
  rigid one under an incompressible layer (Dimitriadis et al. 2002, equation 12), and P (1 / (1 + 4 s) - 1), which
  falls toward the force of a far softer one.

A force that fades does not grow (`evidence.py`): columns that go with time could otherwise take the growth of the
force upon themselves, leave the law flat, and so make little of the noise of the depth.

Each kind of drift is one Gaussian family of sizes, and the kinds compete. A family of many directions costs a clean
curve less width than one of few: its probability falls with each direction that is not seen.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError

__all__ = [
    "BENT",
    "DRIFTS",
    "FADING",
    "FAR_BASE",
    "NEAR_BASE",
    "RELAXING",
    "SMOOTH",
    "deepest_of",
    "drift_shares",
]

_POWERS = np.arange(1.0, 5.0)
# Over the time from contact to the end of the curve.
_TIMES = np.array([0.04, 0.1, 0.3, 1.0])
# Degree of the polynomial in time that the depth is taken to follow.
_COURSE = 3
_RIGID, _WIDE, _SOFT = (1.133, 1.283, 0.769, 0.0975), 1.5, 4.0
#: Columns of a drift: smooth, relaxing, and for a rigid and a soft base.
DRIFTS = len(_POWERS) + len(_TIMES) + 2
#: Those of a force that fades among them.
FADING = slice(len(_POWERS), len(_POWERS) + len(_TIMES))

# Sizes of the columns of one kind of drift each, as shares of the force.
#: A law that drifts smoothly, in three half powers of the depth or in four.
SMOOTH = (0.3, 0.3, 0.3, 0.0, *(0.0,) * 6)
BENT = (0.3, 0.3, 0.3, 0.3, *(0.0,) * 6)
#: A layer that relaxes.
RELAXING = (*(0.0,) * 4, 0.2, 0.3, 0.3, 0.5, 0.0, 0.0)
#: A base under a half-space: far down, to first order in contact radius over thickness, or near.
FAR_BASE = (0.3, *(0.0,) * 9)
NEAR_BASE = (0.3, 0.3, *(0.0,) * 6, 0.5, 1.0)


def drift_shares(depth: FloatArray, time: FloatArray, wanted: NDArray[np.bool_] | None = None) -> FloatArray:
    """Relative errors of the law that vanish at contact, (n, 10).

    Parameters
    ----------
    depth : FloatArray
        Indentation depth w (m), (n,), negative before contact.
    time : FloatArray
        Of the readings (s), increasing, (n,).
    wanted : NDArray, optional
        Whether a column is, (10,): those alone are returned, all by default.

    Raises
    ------
    InputError
        If no depth is in contact.
    """
    wanted = np.ones(DRIFTS, dtype=bool) if wanted is None else wanted
    share = np.sqrt(np.maximum(depth, 0.0) / deepest_of(depth))[:, None]
    found = [np.empty((len(depth), 0))]
    if wanted[: FADING.start].any():
        found.append((share**_POWERS / _POWERS)[:, wanted[: FADING.start]])
    if wanted[FADING].any():
        found.append(_lost(depth, time)[:, wanted[FADING]])
    if wanted[FADING.stop :].any():
        wide = _WIDE * share
        bases = np.hstack((wide * polynomial.polyval(wide, _RIGID), 1.0 / (1.0 + _SOFT * share) - 1.0))
        found.append(bases[:, wanted[FADING.stop :]])
    return np.hstack(found)


def deepest_of(depth: FloatArray) -> float:
    """Largest of depths w (m), (n,); raises InputError if none is in contact."""
    deepest = float(depth.max())
    if not deepest > 0.0:
        raise InputError("a curve that never touches has no drift with depth")
    return deepest


def _lost(depth: FloatArray, time: FloatArray) -> FloatArray:
    """Share of the force added (it is negative) where all of it relaxes, with each of the times, (n, 4).

    Which share of the force is left is found of depths that follow a cubic in time, pressed with w^(3/2). Were it
    found of the readings, a large loss would put a moving average of the law in the place of the law, and so
    explain the noise of the depth.
    """
    touch = int(np.argmax(depth > 0.0))
    since = np.maximum(time - time[touch], 0.0)[:, None]
    if not since[-1] > 0.0:
        return np.zeros((len(depth), len(_TIMES)))
    terms = min(_COURSE, len(time) - touch - 1)
    basis, _ = np.linalg.qr(polynomial.polyvander(2.0 * since[touch:, 0] / since[-1] - 1.0, terms))
    course = basis @ (basis.T @ depth[touch:])
    rises = np.diff(np.maximum(course, 0.0) ** 1.5, prepend=0.0)[:, None]
    passed = since[touch:] / (since[-1] * _TIMES)
    middle = passed - 0.5 * np.diff(passed, axis=0, prepend=0.0)
    left, all_of_it = np.cumsum(np.exp(middle) * rises, axis=0) * np.exp(-passed), np.cumsum(rises, axis=0)
    lost = np.zeros((len(depth), len(_TIMES)))
    np.divide(left - all_of_it, all_of_it, out=lost[touch:], where=all_of_it > 0.0)
    return lost
