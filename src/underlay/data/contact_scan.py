"""The contact depth at which a baseline turns into a shape: a scan, its error, and that of a doubtful shape.

The linear coefficients are solved for at every contact depth tried, so nothing has to be started or to converge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, hypot, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.foot import SIGNIFICANT, Foot
from underlay.mechanics.contact_law import ContactLaw

__all__ = [
    "BEFORE",
    "ContactEstimate",
    "Points",
    "Scanned",
    "Shape",
    "change_point",
    "power_law",
    "scan",
    "shape_of",
    "with_a_doubtful_shape",
]

#: Columns (n,) that a force is made of, of depths since contact (m), (n,).
Shape = Callable[[FloatArray], tuple[FloatArray, ...]]

# Work is bounded by thinning the foot; its neighbours are correlated anyway.
_MAX_POINTS = 2000
# Contact depths tried on means of neighbouring points, then between two steps on either side of the best, then the
# same on all points; a parabola through the last three ends it.
_COARSE, _FINER, _FINE, _BLOCKS = 41, 13, 5, 80
# Depths at which a shape is asked for the former two: a step of theirs is twice as wide.
_TABLE = 256
_REACH = 2
#: A curve that starts in contact has it in front of its first point, by up to this share of the foot.
BEFORE = 1.0
# Below this share of its square a column is a multiple of others, to rounding.
_NOTHING = 1e-24
# Correlation of neighbouring residuals above which they count as this much correlated: at 0.98 a standard
# error is already widened tenfold.
_MOST_CORRELATED = 0.98

# By how much of a foot a parabola puts contact too late where the force rises with the power 1.5: 0.053, whatever
# the length of the baseline; 0.025 for 1.2, 0.061 for 1.8, nothing for 1 and 2 (a test computes it).
_PARABOLA_SHARE = 0.053

# By how much the exponent of a foot may be off where its law is not the one it was given. Over 150 tests of users'
# ranges whose law was given, and whose law was taken for a half-space's, the median |z| is 0.39 and 0.78, and 0 and
# 1 % lie beyond two errors; the scatter of the three estimators had 0.10 and 0.92, 0 and 21 %.
_EXPONENT_OFF = 0.2
# Points in contact from which on four numbers can be told, and a logarithm of odds beyond which nothing changes.
_LEAST_PRESSED, _CERTAIN = 4, 300.0
# Below this share of the largest eigenvalue a direction of normal equations is none.
_SINGULAR = 1e-15


@dataclass(frozen=True)
class ContactEstimate:
    """One estimate of the contact depth.

    Parameters
    ----------
    method : str
        One of `contact_point.METHODS`.
    depth, uncertainty : float
        Depth reading at contact and its standard error (m).
    """

    method: str
    depth: float
    uncertainty: float


def power_law(exponent: float) -> Shape:
    """The force of a half-space, to a factor."""

    def shape(pressed: FloatArray) -> tuple[FloatArray, ...]:
        return (pressed**exponent,)

    return shape


def shape_of(law: ContactLaw) -> Shape:
    """The force of a law."""

    def shape(pressed: FloatArray) -> tuple[FloatArray, ...]:
        return (np.asarray(law.force(pressed)),)

    return shape


def _parabola(pressed: FloatArray) -> tuple[FloatArray, ...]:
    return (pressed, pressed * pressed)


class Points(NamedTuple):
    """Points of a foot without those pulled below the baseline, thinned, and means of neighbouring ones."""

    depth: FloatArray
    force: FloatArray
    blocks: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, foot: Foot) -> Points:
        """Take them from a foot."""
        x, force = _fitted_points(foot)
        return cls(x, force, _in_blocks(x, force))


class Scanned(NamedTuple):
    """What a scan found: the estimate, and what the shape leaves of the force there (n,), in N."""

    estimate: ContactEstimate
    residual: FloatArray


def scan(method: str, foot: Foot, points: Points, shape: Shape) -> Scanned | None:
    """Contact depth with the least sum of squares; None if no contact depth gives a rise."""
    x, force, blocks = points
    low = x[0] - (0.0 if foot.has_baseline else BEFORE * np.ptp(x))
    high = x[-2]
    tried, rough = _steps(low, high, _COARSE), _read_off(shape, float(x[-1] - low))
    sums = _sums_of_squares(*blocks, tried, rough, foot)
    for part, column, count in ((blocks, rough, _FINER), ((x, force), shape, _FINE)):
        at = int(sums.argmin())
        if not np.isfinite(sums[at]):
            return None
        tried = _steps(tried[max(at - _REACH, 0)], tried[min(at + _REACH, len(tried) - 1)], count)
        sums = _sums_of_squares(*part, tried, column, foot)
    best = _lowest(tried, sums)
    if best is None:
        return None
    # Curvature over a step that changes the sum visibly: the last level's step is too fine for it.
    step = 0.01 * float(np.ptp(x))
    residuals, rising = _solve(x, force, best + step * np.array([0.0, -1.0, 1.0]), shape, foot)
    residual, squares = residuals[0], float(residuals[0] @ residuals[0])
    sides = _sums(residuals, rising)[1:]
    degrees = max(len(x) - 4, 1)
    variance = squares / degrees * _widening(residual)
    rises = [side - squares for side in sides.tolist() if isfinite(side) and side > squares]
    if not rises:
        return None
    curvature = 2.0 * (sum(rises) / len(rises)) / step**2
    return Scanned(ContactEstimate(method, best, sqrt(2.0 * variance / curvature)), residual)


def change_point(foot: Foot, points: Points) -> ContactEstimate | None:
    """Contact by a parabola, with the error that a parabola makes of a foot that is none."""
    scanned = scan("change-point", foot, points, _parabola)
    if scanned is None:
        return None
    found = scanned.estimate
    misshapen = _PARABOLA_SHARE * max(float(foot.depth[-1]) - found.depth, 0.0)
    return replace(found, uncertainty=hypot(found.uncertainty, misshapen))


def with_a_doubtful_shape(foot: Foot, points: Points, shape: Shape, scanned: Scanned) -> float:
    """Standard error (m) of the foot's contact where its law may rise with another power of the depth.

    A foot's own error is that of its law, which has a thickness or a modulus yet to be found: on a thin layer it
    was eight times too small. So the law is right with even odds, or its exponent off by a normal deviate of
    `_EXPONENT_OFF`; the curve weighs the two (the ratio of the density of no change after and before the curve:
    Dickey 1971, Ann. Math. Stat. 42, 204), and the error is the mean square distance of the truth from the
    estimate over both.
    """
    x, force, _ = points
    contact, residual = scanned
    pressed = np.maximum(x - contact.depth, 0.0)
    inside = pressed > 0.0
    if np.count_nonzero(inside) <= _LEAST_PRESSED or not residual.any():
        return contact.uncertainty
    reach = 1e-3 * float(np.ptp(x))
    sides = np.zeros((3, len(x)))
    np.add(pressed, np.array([[0.0], [reach], [-reach]]), out=sides, where=inside)
    P, ahead, behind = shape(np.maximum(sides, 0.0, out=sides).ravel())[0].reshape(3, -1)
    # To first order in baseline, scale, contact and exponent; of the scale's size the last two have a factor.
    fitted = force - residual
    size = float(P @ (fitted - fitted[0])) / float(P @ P)
    columns = np.zeros((4, len(x)))
    columns[0], columns[1] = 1.0, P
    np.subtract(ahead, behind, out=columns[2])
    columns[2] *= size / (2.0 * reach)
    np.log(pressed / pressed.max(), out=columns[3], where=inside)
    columns[3] *= size * P
    if not foot.has_baseline:
        columns = columns[1:]
    variance = float(residual @ residual) / max(len(x) - 4, 1) * _widening(residual)
    lengths = np.sqrt(_products(columns, columns))
    columns /= lengths[:, np.newaxis]
    normal = columns @ columns.T
    normal[-1, -1] += variance / (_EXPONENT_OFF * lengths[-1]) ** 2
    inverse = _inverse(normal)
    shifts = inverse[-2:] @ (columns @ residual) / lengths[-2:]
    (moved, bent), (own, deviation) = (
        values.tolist() for values in (shifts, np.sqrt(variance * np.diagonal(inverse)[-2:]) / lengths[-2:])
    )
    odds = deviation / _EXPONENT_OFF * exp(min(0.5 * (bent / deviation) ** 2, _CERTAIN))
    return sqrt((contact.uncertainty**2 + odds * (own**2 + moved**2)) / (1.0 + odds))


def _inverse(normal: FloatArray) -> FloatArray:
    """Inverse of a symmetric matrix, zero along directions that it does not have."""
    values, vectors = np.linalg.eigh(normal)
    kept = np.abs(values) > _SINGULAR * np.abs(values).max()
    return np.asarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T)


def _read_off(shape: Shape, deepest: float) -> Shape:
    """The same shape, read off a table: what lies between two of its points is off by 1e-6 of the whole."""
    depths = np.linspace(0.0, deepest, _TABLE)
    columns = shape(depths)
    return lambda pressed: tuple(np.interp(pressed, depths, column) for column in columns)


def _steps(low: float, high: float, count: int) -> FloatArray:
    """Contact depths from `low` to `high`, evenly."""
    return np.asarray(low + (high - low) / (count - 1) * np.arange(count))


def _lowest(tried: FloatArray, sums: FloatArray) -> float | None:
    """Contact depth at the bottom of the parabola through the least of the sums (t,) and its neighbours."""
    at = int(np.argmin(sums))
    if not np.isfinite(sums[at]):
        return None
    beside = sums[max(at - 1, 0) : at + 2]
    bend = float(beside[0] - 2.0 * sums[at] + beside[-1])
    if len(beside) < 3 or not (np.isfinite(bend) and bend > 0.0):
        return float(tried[at])
    return float(tried[at] + 0.5 * (tried[at] - tried[at - 1]) * (beside[0] - beside[2]) / bend)


def _in_blocks(x: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means of neighbouring points, in at most so many blocks that a step of the coarse scan holds two."""
    starts = np.linspace(0, len(x), min(_BLOCKS, len(x)), endpoint=False).astype(np.intp)
    sizes = np.diff(starts, append=len(x))
    return np.add.reduceat(x, starts) / sizes, np.add.reduceat(force, starts) / sizes


def _fitted_points(foot: Foot) -> tuple[FloatArray, FloatArray]:
    """Points of the foot without those pulled below the baseline, thinned."""
    kept = (
        foot.force >= -SIGNIFICANT * foot.noise if foot.noise > 0.0 else np.ones(len(foot.force), dtype=bool)
    )
    x, force = foot.depth[kept], foot.force[kept]
    stride = -(-len(x) // _MAX_POINTS)
    return x[::-stride][::-1], force[::-stride][::-1]


def _columns(x: FloatArray, contacts: FloatArray, shape: Shape) -> list[FloatArray]:
    """What the shape is made of, each (t, n + 1) for contact depths (t,): the last point is one before contact."""
    pressed = np.maximum(np.append(x, -np.inf) - contacts[:, np.newaxis], 0.0)
    return [column.reshape(pressed.shape) for column in shape(pressed.ravel())]


def _solve(
    x: FloatArray, force: FloatArray, contacts: FloatArray, shape: Shape, foot: Foot
) -> tuple[FloatArray, FloatArray]:
    """Residuals (t, n) of the best linear coefficients for each contact depth (t,), and the rises they give (t,).

    By modified Gram-Schmidt: a column that is a multiple of those before it has nothing left and takes no part. A
    baseline that was measured is adjusted with the rest, by taking the means away; one that was assumed is kept.
    """
    n = len(x)
    residual = (force - force.mean() if foot.has_baseline else force)[np.newaxis]
    rises = np.zeros(len(contacts))
    used: list[tuple[FloatArray, FloatArray]] = []
    for column in _columns(x, contacts, shape):
        # What a column has before anything is taken from it: that and what is left.
        rest, taken = column, np.zeros(len(contacts))
        if foot.has_baseline:
            mean = np.add.reduce(column[:, :n], axis=1) / n
            taken += n * mean * mean
            rest = column - mean[:, np.newaxis]
        for other, square in used:
            product = _products(other[:, :n], rest[:, :n])
            amount = product / square
            taken += amount * product
            rest = rest - amount[:, np.newaxis] * other
        inside = rest[:, :n]
        own = _products(inside, inside)
        # What rounding leaves of a column is no direction.
        own = np.where(own > _NOTHING * (own + taken), own, np.inf)
        amount = _products(inside, residual) / own
        residual = residual - amount[:, np.newaxis] * inside
        rises += amount * (rest[:, -2] - rest[:, -1])
        used.append((rest, own))
    return residual, rises


def _products(one: FloatArray, other: FloatArray) -> FloatArray:
    """Scalar products (t,) over the points; of what is the same for all, (1, n), too."""
    return np.asarray(np.einsum("ti,ti->t", one, other))


def _sums_of_squares(
    x: FloatArray, force: FloatArray, contacts: FloatArray, shape: Shape, foot: Foot
) -> FloatArray:
    return _sums(*_solve(x, force, contacts, shape, foot))


def _sums(residuals: FloatArray, rises: FloatArray) -> FloatArray:
    """Sums of squares (t,), infinite where the force would fall."""
    return np.where(rises > 0.0, _products(residuals, residuals), np.inf)


def _widening(residual: FloatArray) -> float:
    """Factor on the variance for residuals correlated as a first-order process."""
    power = float(residual @ residual)
    if power <= 0.0 or len(residual) < 3:
        return 1.0
    correlation = float(residual[1:] @ residual[:-1]) / power
    # Anticorrelated residuals would narrow the interval; that is not claimed.
    held = min(max(correlation, 0.0), _MOST_CORRELATED)
    return (1.0 + held) / (1.0 - held)
