"""Where the indenter first touches: three estimators, each with an uncertainty.

* ``foot``: the baseline turns into the foot of a contact law with free stiffness.
* ``change-point``: the baseline turns into a parabola with free coefficients; no contact law.
* ``threshold``: the depth of the last passage through 3 standard deviations of the noise, carried back by
  the rise that follows to where it starts.

The first two scan the contact depth and solve for the linear coefficients, so nothing has to be started or
to converge; the uncertainty is the curvature of the sum of squares, widened for correlated residuals.
Forces below the baseline right before the rise (adhesion) are left out of these fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.foot import SIGNIFICANT, Foot, foot_of
from underlay.errors import CurveError, InputError
from underlay.mechanics.contact_law import ContactLaw
from underlay.scene.scene import Scene
from underlay.units import format_quantity

__all__ = ["METHODS", "ContactEstimate", "ContactPoint", "contact_of", "find_contact", "reach_of"]

#: Names of the estimators, the one used by default first.
METHODS = ("foot", "change-point", "threshold")

# Work is bounded by thinning the foot; its neighbours are correlated anyway.
_MAX_POINTS = 2000
# Contact depths tried on means of neighbouring points, then between two steps on either side of the best, then the
# same on all points; a parabola through the last three ends it.
_COARSE, _FINER, _FINE, _BLOCKS = 61, 13, 9, 120
_REACH = 2
# A curve that starts in contact has it in front of its first point, by up to this share of the foot.
_BEFORE = 1.0
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

_Shape = Callable[[FloatArray], tuple[FloatArray, ...]]


@dataclass(frozen=True)
class ContactEstimate:
    """One estimate of the contact depth.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    depth, uncertainty : float
        Depth reading at contact and its standard error (m).
    """

    method: str
    depth: float
    uncertainty: float


@dataclass(frozen=True)
class ContactPoint:
    """The contact depth of a curve.

    Parameters
    ----------
    depth, uncertainty : float
        By the estimator `method` (m). The uncertainty of a foot's holds that its law may rise with another power,
        that of others the scatter of all estimators.
    method : str
        One of `METHODS`.
    estimates : tuple of ContactEstimate
        All estimators that gave one.
    baseline, baseline_slope : float
        Force in front of contact, ``baseline + baseline_slope * depth`` (N, N/m).
    noise : float
        Standard deviation of the force about the baseline (N).
    notes : tuple of str
        Reservations, such as adhesion before contact.
    """

    depth: float
    uncertainty: float
    method: str
    estimates: tuple[ContactEstimate, ...]
    baseline: float
    baseline_slope: float
    noise: float
    notes: tuple[str, ...] = ()

    @property
    def scatter(self) -> float:
        """Standard deviation (m) of all estimates: large where there is more to see than a contact."""
        return float(np.std([estimate.depth for estimate in self.estimates]))


def find_contact(
    curve: Curve, method: str = "auto", *, scene: Scene | None = None, exponent: float = 1.5
) -> ContactPoint:
    """Estimate the depth reading at which the indenter touches.

    Parameters
    ----------
    curve : Curve
        With its approach, if it has one.
    method : str
        One of `METHODS`; "auto" takes the first that gives an estimate.
    scene : Scene, optional
        Its contact law shapes the foot. Without it the foot is a power law.
    exponent : float
        Exponent of that power law: 1.5 for a ball, 2 for a cone, 1 for a flat punch.

    Returns
    -------
    ContactPoint
        The estimate with its uncertainty, and those of all estimators.

    Raises
    ------
    CurveError
        If the curve cannot be fitted, or its force never rises out of the noise.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(-2e-6, 2e-6, 401)
    >>> noise = 1e-15 * np.random.default_rng(1).standard_normal(401)
    >>> contact = find_contact(Curve(x, 1e-3 * np.clip(x - 5e-7, 0.0, None) ** 1.5 + noise))
    >>> abs(contact.depth - 5e-7) < 1e-9
    True
    """
    if method != "auto" and method not in METHODS:
        raise InputError(f"no contact method {method!r}; there are auto, {', '.join(METHODS)}")
    if not (np.isfinite(exponent) and 0.5 <= exponent <= 5.0):
        raise InputError(f"the exponent of the foot must be between 0.5 and 5; got {exponent!r}")
    foot = foot_of(curve)
    law = None if scene is None else scene.contact_law(reach_of(foot))
    return contact_of(foot, law, method, exponent=exponent)


def reach_of(foot: Foot) -> float:
    """Depth (m) that a law must reach to shape a foot."""
    return (1.0 + _BEFORE) * float(np.ptp(foot.depth))


def contact_of(foot: Foot, law: ContactLaw | None, method: str = "auto", *, exponent: float) -> ContactPoint:
    """`find_contact` of a curve's foot, which a law shapes, or without one a power law.

    Raises
    ------
    CurveError
        If the method gives none.
    """
    shape = _power_law(exponent) if law is None else _shape_of(law)
    tried = (
        _scan("foot", foot, shape),
        # Without a stretch in front of contact there is no change to find.
        _change_point(foot) if foot.has_baseline else None,
        _threshold(foot, exponent),
    )
    estimates = tuple(estimate for estimate in tried if estimate is not None)
    chosen = [estimate for estimate in estimates if method in {"auto", estimate.method}]
    if not chosen:
        raise CurveError(f"no contact found by {method}: the force does not rise as from a contact")
    contact = chosen[0]
    found = ContactPoint(
        depth=contact.depth,
        uncertainty=contact.uncertainty,
        method=contact.method,
        estimates=estimates,
        baseline=foot.baseline,
        baseline_slope=foot.baseline_slope,
        noise=foot.noise,
        notes=_notes(foot),
    )
    if contact.method == "foot":
        return replace(found, uncertainty=_with_a_doubtful_shape(foot, shape, contact))
    # These know nothing of a shape: they differ by what theirs do.
    return replace(found, uncertainty=float(np.hypot(contact.uncertainty, found.scatter)))


def _power_law(exponent: float) -> _Shape:
    def shape(pressed: FloatArray) -> tuple[FloatArray, ...]:
        return (pressed**exponent,)

    return shape


def _shape_of(law: ContactLaw) -> _Shape:
    def shape(pressed: FloatArray) -> tuple[FloatArray, ...]:
        return (np.asarray(law.force(pressed)),)

    return shape


def _parabola(pressed: FloatArray) -> tuple[FloatArray, ...]:
    return (pressed, pressed * pressed)


def _scan(method: str, foot: Foot, shape: _Shape) -> ContactEstimate | None:
    """Contact depth with the least sum of squares; None if no contact depth gives a rise."""
    x, force = _fitted_points(foot)
    low = x[0] - (0.0 if foot.has_baseline else _BEFORE * np.ptp(x))
    high = x[-2]
    blocks, whole = _in_blocks(x, force), (x, force)
    tried = np.linspace(low, high, _COARSE)
    sums = _sums_of_squares(*blocks, tried, shape, foot)
    for points, count in ((blocks, _FINER), (whole, _FINE)):
        at = int(np.argmin(sums))
        if not np.isfinite(sums[at]):
            return None
        tried = np.linspace(tried[max(at - _REACH, 0)], tried[min(at + _REACH, len(tried) - 1)], count)
        sums = _sums_of_squares(*points, tried, shape, foot)
    best = _lowest(tried, sums)
    if best is None:
        return None
    # Curvature over a step that changes the sum visibly: the last level's step is too fine for it.
    step = 0.01 * float(np.ptp(x))
    residuals, _ = _solve(x, force, np.array([best]), shape, foot)
    residual, squares = residuals[0], float(residuals[0] @ residuals[0])
    sides = _sums_of_squares(x, force, best + step * np.array([-1.0, 1.0]), shape, foot)
    degrees = max(len(x) - 4, 1)
    variance = squares / degrees * _widening(residual)
    rises = [side - squares for side in sides if np.isfinite(side) and side > squares]
    if not rises:
        return None
    curvature = 2.0 * float(np.mean(rises)) / step**2
    return ContactEstimate(method, best, float(np.sqrt(2.0 * variance / curvature)))


def _change_point(foot: Foot) -> ContactEstimate | None:
    """Contact by a parabola, with the error that a parabola makes of a foot that is none."""
    found = _scan("change-point", foot, _parabola)
    if found is None:
        return None
    misshapen = _PARABOLA_SHARE * max(float(foot.depth[-1]) - found.depth, 0.0)
    return replace(found, uncertainty=float(np.hypot(found.uncertainty, misshapen)))


def _with_a_doubtful_shape(foot: Foot, shape: _Shape, contact: ContactEstimate) -> float:
    """Standard error (m) of the foot's contact where its law may rise with another power of the depth.

    A foot's own error is that of its law, which has a thickness or a modulus yet to be found: on a thin layer it
    was eight times too small. So the law is right with even odds, or its exponent off by a normal deviate of
    `_EXPONENT_OFF`; the curve weighs the two (the ratio of the density of no change after and before the curve:
    Dickey 1971, Ann. Math. Stat. 42, 204), and the error is the mean square distance of the truth from the
    estimate over both.
    """
    x, force = _fitted_points(foot)
    pressed = np.maximum(x - contact.depth, 0.0)
    (P,) = shape(pressed)
    (residual,), _ = _solve(x, force, np.array([contact.depth]), shape, foot)
    if np.count_nonzero(pressed) <= _LEAST_PRESSED or not residual.any():
        return contact.uncertainty
    reach = 1e-3 * float(np.ptp(x))
    (ahead,), (behind,) = (
        shape(np.maximum(pressed + side, 0.0) * (pressed > 0.0)) for side in (reach, -reach)
    )
    share = np.where(pressed > 0.0, pressed, pressed.max()) / pressed.max()
    # To first order in baseline, scale, contact and exponent; of the scale's size the last two have a factor.
    fitted = force - residual
    size = float(P @ (fitted - fitted[0])) / float(P @ P)
    columns = np.column_stack((P, size * (ahead - behind) / (2.0 * reach), size * P * np.log(share)))
    if foot.has_baseline:
        columns = np.column_stack((np.ones(len(x)), columns))
    variance = float(residual @ residual) / max(len(x) - 4, 1) * _widening(residual)
    lengths = np.linalg.norm(columns, axis=0)
    columns = columns / lengths
    normal = columns.T @ columns
    normal[-1, -1] += variance / (_EXPONENT_OFF * lengths[-1]) ** 2
    inverse = np.linalg.pinv(normal, hermitian=True)
    (moved, bent), (own, deviation) = (
        values[-2:] / lengths[-2:]
        for values in (inverse @ (columns.T @ residual), np.sqrt(variance * np.diagonal(inverse)))
    )
    odds = deviation / _EXPONENT_OFF * np.exp(min(0.5 * (bent / deviation) ** 2, _CERTAIN))
    squares = np.array([contact.uncertainty**2, own**2 + moved**2])
    return float(np.sqrt(np.average(squares, weights=[1.0, odds])))


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


def _columns(x: FloatArray, contacts: FloatArray, shape: _Shape, foot: Foot) -> list[FloatArray]:
    """What the force is made of, each (t, n + 1) for contact depths (t,): the last point is one before contact."""
    pressed = np.maximum(np.append(x, -np.inf) - contacts[:, np.newaxis], 0.0)
    columns = [column.reshape(pressed.shape) for column in shape(pressed.ravel())]
    # A baseline that was measured is adjusted with the rest; one that was assumed is kept.
    return [np.ones(pressed.shape), *columns] if foot.has_baseline else columns


def _solve(
    x: FloatArray, force: FloatArray, contacts: FloatArray, shape: _Shape, foot: Foot
) -> tuple[FloatArray, FloatArray]:
    """Residuals (t, n) of the best linear coefficients for each contact depth (t,), and the rises they give (t,).

    By modified Gram-Schmidt: a column that is a multiple of those before it has nothing left and takes no part.
    """
    fitted = np.zeros((len(contacts), len(x) + 1))
    used: list[tuple[FloatArray, FloatArray]] = []
    for column in _columns(x, contacts, shape, foot):
        rest = column
        for other, square in used:
            rest = rest - (_products(other, rest) / square)[:, np.newaxis] * other
        own = _products(rest, rest)
        # What rounding leaves of a column is no direction.
        own = np.where(own > _NOTHING * _products(column, column), own, np.inf)
        fitted = fitted + (_products(rest, force - fitted[:, :-1]) / own)[:, np.newaxis] * rest
        used.append((rest, own))
    return force - fitted[:, :-1], fitted[:, -2] - fitted[:, -1]


def _products(one: FloatArray, other: FloatArray) -> FloatArray:
    """Scalar products (t,) over the points, without the one before contact."""
    n = one.shape[-1] - 1
    return np.asarray(np.einsum("ti,ti->t", one[:, :n], other[:, :n]))


def _sums_of_squares(
    x: FloatArray, force: FloatArray, contacts: FloatArray, shape: _Shape, foot: Foot
) -> FloatArray:
    residuals, rises = _solve(x, force, contacts, shape, foot)
    return np.where(rises > 0.0, np.einsum("ti,ti->t", residuals, residuals), np.inf)


def _widening(residual: FloatArray) -> float:
    """Factor on the variance for residuals correlated as a first-order process."""
    power = float(residual @ residual)
    if power <= 0.0 or len(residual) < 3:
        return 1.0
    correlation = float(residual[1:] @ residual[:-1]) / power
    # Anticorrelated residuals would narrow the interval; that is not claimed.
    held = min(max(correlation, 0.0), _MOST_CORRELATED)
    return (1.0 + held) / (1.0 - held)


def _threshold(foot: Foot, exponent: float) -> ContactEstimate | None:
    """Depth of the passage through the threshold, less the depth a power law needs to reach it."""
    level = SIGNIFICANT * foot.noise
    x, force = foot.depth, foot.force
    if foot.rise >= len(x):
        return None
    first = float(x[foot.rise])
    if level <= 0.0:  # no noise: the passage is contact, to a sample
        before = float(x[max(foot.rise - 1, 0)])
        return ContactEstimate("threshold", before, max(first - before, np.spacing(abs(first))))
    higher = np.flatnonzero(force[foot.rise :] >= 4.0 * level)
    if not higher.size:
        return ContactEstimate("threshold", first, float(x[-1]) - first)
    gap = max(float(x[foot.rise + higher[0]]) - first, 0.0)
    pressed = gap / (4.0 ** (1.0 / exponent) - 1.0)
    # Noise moves the passage by sigma over the slope of the rise there, pressed / (3 exponent), at both
    # levels; the exponent itself (1 to 2) moves the way back by a third of the gap either way.
    scatter = np.hypot(pressed / (SIGNIFICANT * exponent) * 2.0, gap / 3.0)
    spacing = first - float(x[max(foot.rise - 1, 0)])
    return ContactEstimate("threshold", first - pressed, float(np.hypot(scatter, spacing)))


def _notes(foot: Foot) -> tuple[str, ...]:
    notes = []
    if foot.dip > 2.0 * SIGNIFICANT * foot.noise and foot.dip > 0.01 * foot.peak:
        dip = format_quantity(foot.dip, "force")
        notes.append(
            f"the force dips by {dip} before contact: a bent baseline, or adhesion: fit it with adhesion, "
            '[adhesion] with model = "jkr" in a scene file'
        )
    if not foot.has_baseline:
        notes.append("the curve has no stretch in front of contact: its baseline is assumed, not measured")
    return tuple(notes)
