"""Columns of all that may disturb a curve: misfit smooth in depth, step at contact, ramp, turn, line.

Each family has a few columns with normally distributed amplitudes, whose size `hypotheses` states. With P the
contact force, w the depth of the tip and w_max the largest:

    misfit   P eps(v) and dP/dw eta(v), v = sqrt(w / w_max): a relative error eps of the force, and a local shift
             eta of the depth, as a gradual contact makes; both with correlation exp(-|dv| / 0.5), six columns each
    step     eight steps about contact, each a ramp .02 to .05 of the depth wide: sharp ones make the likelihood
             discontinuous
    ramp     a baseline that drifts linearly in time
    line     interference fringes or vibration: sine and cosine of the frequency that is strongest in the residual
    turn     a baseline with a kink: linear in time but for one place: the likeliest, or one of two that
             are nearly as likely and change the modulus most
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.tree import Tangent

_TINY = np.finfo(float).tiny
_LENGTH, _RANK, _GRID = 0.5, 6, 201  # of a misfit: correlation length in v, columns, places of its table
# Middles and widths of the steps about contact, over the largest depth.
_PLACES = np.array([-0.15, -0.1, -0.06, -0.03, -0.01, 0.01, 0.04, 0.08])
_WIDTHS = np.array([0.05, 0.045, 0.035, 0.025, 0.02, 0.025, 0.035, 0.05])
_SLOWEST = 1.25  # least number of periods of a line in the record
_FREQUENCIES = 96  # number of frequencies that are tried for a line
_TURNS = 96  # number of places in the record that are tried for a turn
#: Families of columns of which a hypothesis has one at most.
FAMILIES = ("relative", "shift", "line", "turn", "turn that softens", "turn that stiffens")
LINE, TURN = FAMILIES.index("line"), FAMILIES.index("turn")


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of one curve: the model's derivatives, all disturbances, and the residual, in units of the rows.

    Parameters
    ----------
    values : FloatArray
        Columns (n, m): d force / d vector (k of them), then steps, ramp, turn, misfits, line, and last the
        residual.
    law, step, ramp, turn, residual : slice
        Which of the columns these are; `law` are the derivatives.
    families : tuple of slice
        Columns of each misfit, then of the line, then of each turn; see `FAMILIES`.
    v : FloatArray
        Root of the relative depth, sqrt(w / w_max), (n,); zero before contact.
    turn_share : float
        Share of the places in time at which a turn is about as likely as at the best one.
    """

    values: FloatArray
    law: slice
    step: slice
    ramp: slice
    turn: slice
    families: tuple[slice, ...]
    residual: slice
    v: FloatArray
    turn_share: float

    @classmethod
    def of(cls, tangent: Tangent, measured: FloatArray, baseline: NDArray[np.bool_]) -> Columns:
        """Columns for a model linearised as `tangent`, and the rows measured (n,).

        `baseline` (k,) says which derivatives are those of the instrument's baseline: a ramp or a turn is what
        they leave of it, else a free slope of the baseline would be as uncertain as the ramp beside it.
        """
        share = tangent.penetration / max(float(tangent.penetration.max()), _TINY)
        v = np.sqrt(np.clip(share, 0.0, 1.0))
        n, residual = len(measured), measured - tangent.force
        turns, turn_share = _turns(residual, tangent.columns, tangent.contact)
        drifts = np.hstack((np.linspace(-1.0, 1.0, n)[:, None], turns))
        flat = tangent.columns[:, baseline]
        drifts = drifts - flat @ np.linalg.lstsq(flat, drifts, rcond=None)[0]
        # Of the force P and of dP/dw, each scaled to 1 at its largest; zeros where no reading is in contact.
        pressed = (tangent.contact, tangent.stiffness)
        basis = _smooth_basis(v)
        misfits = [basis * (a / max(float(np.abs(a).max()), _TINY))[:, None] for a in pressed]
        parts = [
            tangent.columns,
            _steps(share),
            drifts[:, :1],
            drifts[:, 1:],
            *misfits,
            _line(residual, tangent.columns),
            residual[:, None],
        ]
        ends = np.cumsum([0, *(part.shape[1] for part in parts)])
        places = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        law, step, ramp, turn, *families, last = places
        alone = [slice(i, i + 1) for i in range(turn.start, turn.stop)]
        return cls(np.hstack(parts), law, step, ramp, turn, (*families, *alone), last, v, turn_share)


def _smooth_basis(v: FloatArray) -> FloatArray:
    """Columns (n, rank) that span a smooth random function of v, the root of the relative depth, 0 <= v <= 1.

    Principal components of a stationary process with correlation exp(-|dv| / 0.5), by interpolation in a table;
    their squares sum to 1 or slightly less.
    """
    place = np.clip(v, 0.0, 1.0) * (_GRID - 1)
    low = np.minimum(place.astype(int), _GRID - 2)
    table, share = _eigenvectors(), (place - low)[:, None]
    return np.asarray(table[low] * (1.0 - share) + table[low + 1] * share)


@lru_cache(maxsize=1)
def _eigenvectors() -> FloatArray:
    v = np.linspace(0.0, 1.0, _GRID)
    values, vectors = np.linalg.eigh(np.exp(-np.abs(v[:, None] - v) / _LENGTH))
    return np.asarray(vectors[:, : -_RANK - 1 : -1] * np.sqrt(values[: -_RANK - 1 : -1]))


def _steps(share: FloatArray) -> FloatArray:
    """Columns (n, 8) of steps about contact, at depths of the tip over the largest, (n,)."""
    rise = (share[:, None] - _PLACES) / _WIDTHS + 0.5
    return np.asarray(np.clip(rise, 0.0, 1.0) / len(_PLACES) ** 0.5)


def _line(residual: FloatArray, law: FloatArray) -> FloatArray:
    """Sine and cosine (n, 2) of the frequency that explains most of the residual (n,) beside `law` (n, k)."""
    n = len(residual)
    frequencies = np.geomspace(_SLOWEST, 0.45 * n, _FREQUENCIES)
    phase = 2.0 * np.pi * frequencies * (np.arange(n)[:, None] + 0.5) / n
    q, _ = np.linalg.qr(law)
    sine, cosine = (wave - q @ (q.T @ wave) for wave in (np.sin(phase), np.cos(phase)))
    a, b, c = ((x * y).sum(axis=0) for x, y in ((sine, sine), (cosine, cosine), (sine, cosine)))
    s, t = residual @ sine, residual @ cosine
    best = int(np.argmax((b * s * s - 2.0 * c * s * t + a * t * t) / np.maximum(a * b - c * c, 1e-9 * n * n)))
    return np.column_stack((np.sin(phase[:, best]), np.cos(phase[:, best])))


def _turns(residual: FloatArray, law: FloatArray, pressing: FloatArray) -> tuple[FloatArray, float]:
    """Columns (n, 3) of a baseline with a kink, 2 |t - t0|, at the likeliest time t0 and at two others.

    The others are those, of all that are nearly as likely, with which the modulus is lowest and highest: where the
    law can bend to any turn, that is what is not known. Also returned is the mean likelihood of all places
    relative to the best: choosing the best place is no evidence for a turn, and this share corrects for it. Nearly
    as likely means at least e^(-3/2) with white noise; three places so far apart, with equal priors, have the mean
    and the variance of a normal distribution of t0.
    """
    n, places = len(residual), np.linspace(0.0, 1.0, _TURNS + 2)[1:-1]
    turns = 2.0 * np.abs(np.linspace(0.0, 1.0, n)[:, None] - places)
    turns -= turns.mean(axis=0)
    q, _ = np.linalg.qr(law)
    left = turns - q @ (q.T @ turns)
    own = residual - q @ (q.T @ residual)
    lengths, seen = np.maximum((left * left).sum(axis=0), 1e-9), own @ left
    squares = own @ own - seen**2 / lengths
    # With as many readings as parameters nothing is left that a turn could explain.
    squares = np.maximum(squares, max(1e-12 * float(own @ own), _TINY))
    behind = 0.5 * n * np.log(squares / squares.min())
    best, near = int(np.argmin(behind)), np.flatnonzero(behind <= 1.5)
    # Of the law's columns the one most like the contact force is that of the modulus.
    likeness = np.abs(pressing @ law) / np.maximum(np.sqrt((law * law).sum(axis=0)), _TINY)
    moves = np.linalg.pinv(law)[int(np.argmax(likeness))] @ turns[:, near] * (seen / lengths)[near]
    chosen = [best, near[int(np.argmin(moves))], near[int(np.argmax(moves))]]
    return turns[:, chosen], float(np.exp(-behind).mean())
