"""The depth reading at which the indenter first touches: three estimators, each with an uncertainty.

* ``foot``: a baseline, followed from the contact depth on by a contact law with a fitted factor.
* ``change-point``: a baseline, followed by a parabola with two fitted coefficients; no contact law.
* ``threshold``: the last depth at which the force passes 3 standard deviations of the noise, extrapolated back
  along the rise that follows to where it starts.

The first two try contact depths on a grid and solve a linear least-squares problem at each, so they need no
starting values and cannot fail to converge; the uncertainty follows from the curvature of the sum of squares,
widened for correlated residuals. That of ``foot`` also allows for a wrong contact law (`with_a_doubtful_shape`).
Forces below the baseline right before the rise (adhesion) are left out of these fits.

Where all curves of a map count depth from one zero, as for a piezo or stage that is not moved in between, the depth
reading of a contact is a height in space: `thickness_of_heights` makes layer thicknesses of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import exp, hypot, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.data.foot import SIGNIFICANT, Foot, foot_of
from underlay.errors import CurveError, InputError
from underlay.mechanics.contact_law import ContactLaw
from underlay.scene.scene import Scene
from underlay.units import format_quantity

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
# Three numbers are told from a foot: contact, size and baseline.
_FEWEST_OF_FOOT = 4
# Below this share of the largest eigenvalue a direction of normal equations is none.
_SINGULAR = 1e-15
#: Names of the estimators, the one used by default first.
METHODS = ("foot", "change-point", "threshold")


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
    """Return the shape of a half-space contact: indentation to the power `exponent`, times a fitted factor."""

    def shape(pressed: FloatArray) -> tuple[FloatArray, ...]:
        return (pressed**exponent,)

    return shape


def shape_of(law: ContactLaw) -> Shape:
    """Return the shape of a contact law: its force (N) at indentations (m), times a factor that is fitted."""

    def shape(pressed: FloatArray) -> tuple[FloatArray, ...]:
        return (np.asarray(law.force(pressed)),)

    return shape


def _parabola(pressed: FloatArray) -> tuple[FloatArray, ...]:
    return (pressed, pressed * pressed)


class Points(NamedTuple):
    """Points near contact that are fitted (m, N), and their means over blocks of neighbours for the coarse scan.

    They are thinned, without those below the baseline; `depth` and `force` have shape (n,).
    """

    depth: FloatArray
    force: FloatArray
    blocks: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, foot: Foot) -> Points:
        """Select the points to fit from the part of a curve near contact."""
        x, force = _fitted_points(foot)
        return cls(x, force, _in_blocks(x, force))


class Scanned(NamedTuple):
    """Result of `scan`: the estimate, and the residuals (N) of its fit at the fitted points (n,)."""

    estimate: ContactEstimate
    residual: FloatArray


def scan(method: str, foot: Foot, points: Points, shape: Shape) -> Scanned | None:
    """Find the contact depth with the smallest sum of squares: coarse on block means, then fine on all points.

    Parameters
    ----------
    method : str
        Name of the estimator, for the estimate.
    foot : Foot
        Baseline and beginning of the rise. A measured baseline is fitted with the rest, an assumed one held fixed.
    points : Points
        The points of `foot` to fit.
    shape : Shape
        Functions of the indentation, with fitted factors, that make up the force after contact.

    Returns
    -------
    Scanned or None
        None if no contact depth gives a rising force, or the sum of squares has no minimum among the depths tried.
    """
    x, force, blocks = points
    low, high = _earliest(foot, points), x[-2]
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
    """Estimate contact as the change from baseline to parabola; None if there is none.

    Its error is widened for a rise that is no parabola.
    """
    scanned = scan("change-point", foot, points, _parabola)
    if scanned is None:
        return None
    found = scanned.estimate
    misshapen = _PARABOLA_SHARE * max(float(foot.depth[-1]) - found.depth, 0.0)
    return replace(found, uncertainty=hypot(found.uncertainty, misshapen))


def with_a_doubtful_shape(foot: Foot, points: Points, shape: Shape, scanned: Scanned) -> float:
    """Return the standard error (m) of the ``foot`` estimate, allowing for a contact law with a wrong exponent.

    The error that `scan` gives assumes that the contact law is right, although thickness and modulus are yet to be
    found: on a thin layer it was eight times too small. Here the law is right with a prior probability of one half;
    otherwise its exponent differs by a normal deviate of standard deviation `_EXPONENT_OFF`. The curve weighs the
    two by their posterior odds (the density of no change after over that before the curve: Dickey 1971, Ann. Math.
    Stat. 42, 204), and the returned error is the root mean square distance of the contact from the estimate under
    both.
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
    (moved, exponent_shift), (own, deviation) = (
        values.tolist() for values in (shifts, np.sqrt(variance * np.diagonal(inverse)[-2:]) / lengths[-2:])
    )
    odds = deviation / _EXPONENT_OFF * exp(min(0.5 * (exponent_shift / deviation) ** 2, _CERTAIN))
    return sqrt((contact.uncertainty**2 + odds * (own**2 + moved**2)) / (1.0 + odds))


def _inverse(normal: FloatArray) -> FloatArray:
    """Return the pseudo-inverse of a symmetric matrix (k, k)."""
    values, vectors = np.linalg.eigh(normal)
    kept = np.abs(values) > _SINGULAR * np.abs(values).max()
    return np.asarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T)


def _earliest(foot: Foot, points: Points) -> float:
    """Return the smallest depth reading (m) that a scan tries as contact."""
    return float(points.depth[0] - (0.0 if foot.has_baseline else BEFORE * np.ptp(points.depth)))


def _read_off(shape: Shape, deepest: float) -> Shape:
    """Return a shape interpolated in a table up to `deepest` (m), to 1e-6 of its largest value."""
    depths = np.linspace(0.0, deepest, _TABLE)
    columns = shape(depths)
    return lambda pressed: tuple(np.interp(pressed, depths, column) for column in columns)


def _steps(low: float, high: float, count: int) -> FloatArray:
    """Return `count` evenly spaced contact depths (m) from `low` to `high`."""
    return np.asarray(low + (high - low) / (count - 1) * np.arange(count))


def _lowest(tried: FloatArray, sums: FloatArray) -> float | None:
    """Return the contact depth (m) at the minimum of the parabola through three sums of squares.

    They are the smallest and its neighbours; `tried` and `sums` are (t,). None where no sum is finite.
    """
    at = int(np.argmin(sums))
    if not np.isfinite(sums[at]):
        return None
    neighbours = sums[max(at - 1, 0) : at + 2]
    bend = float(neighbours[0] - 2.0 * sums[at] + neighbours[-1])
    if len(neighbours) < 3 or not (np.isfinite(bend) and bend > 0.0):
        return float(tried[at])
    return float(tried[at] + 0.5 * (tried[at] - tried[at - 1]) * (neighbours[0] - neighbours[2]) / bend)


def _in_blocks(x: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the means of depth (m) and force (N) over at most 80 blocks of neighbouring points.

    A step of the coarse scan holds two blocks.
    """
    starts = np.linspace(0, len(x), min(_BLOCKS, len(x)), endpoint=False).astype(np.intp)
    sizes = np.diff(starts, append=len(x))
    return np.add.reduceat(x, starts) / sizes, np.add.reduceat(force, starts) / sizes


def _fitted_points(foot: Foot) -> tuple[FloatArray, FloatArray]:
    """Return depth (m) and force (N) of the points near contact, thinned, without those below the baseline."""
    kept = (
        foot.force >= -SIGNIFICANT * foot.noise if foot.noise > 0.0 else np.ones(len(foot.force), dtype=bool)
    )
    x, force = foot.depth[kept], foot.force[kept]
    stride = max(-(-len(x) // _MAX_POINTS), 1)
    return x[::-stride][::-1], force[::-stride][::-1]


def _columns(x: FloatArray, contacts: FloatArray, shape: Shape) -> list[FloatArray]:
    """Return the functions that make up the force, each (t, n + 1), for t contact depths at n points.

    The last column is of a point before contact.
    """
    pressed = np.maximum(np.append(x, -np.inf) - contacts[:, np.newaxis], 0.0)
    return [column.reshape(pressed.shape) for column in shape(pressed.ravel())]


def _solve(
    x: FloatArray, force: FloatArray, contacts: FloatArray, shape: Shape, foot: Foot
) -> tuple[FloatArray, FloatArray]:
    """Fit the factors of the shape for each contact depth (t,): residuals (t, n), and rise of the force (N), (t,).

    By modified Gram-Schmidt orthogonalisation; a column that is linearly dependent on those before it takes no
    part. A measured baseline is fitted with the rest, by subtracting means; an assumed one is held fixed.
    """
    n = len(x)
    residual = (force - force.mean() if foot.has_baseline else force)[np.newaxis]
    rises = np.zeros(len(contacts))
    used: list[tuple[FloatArray, FloatArray]] = []
    for column in _columns(x, contacts, shape):
        # What a column has before anything is taken from it: that and what is left.
        rest, removed = column, np.zeros(len(contacts))
        if foot.has_baseline:
            mean = np.add.reduce(column[:, :n], axis=1) / n
            removed += n * mean * mean
            rest = column - mean[:, np.newaxis]
        for other, square in used:
            product = _products(other[:, :n], rest[:, :n])
            amount = product / square
            removed += amount * product
            rest = rest - amount[:, np.newaxis] * other
        inside = rest[:, :n]
        own = _products(inside, inside)
        # What rounding leaves of a column is no direction.
        own = np.where(own > _NOTHING * (own + removed), own, np.inf)
        amount = _products(inside, residual) / own
        residual = residual - amount[:, np.newaxis] * inside
        rises += amount * (rest[:, -2] - rest[:, -1])
        used.append((rest, own))
    return residual, rises


def _products(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the scalar products (t,) of rows over the points; either may have a single row, (1, n)."""
    return np.asarray(np.einsum("ti,ti->t", one, other))


def _sums_of_squares(
    x: FloatArray, force: FloatArray, contacts: FloatArray, shape: Shape, foot: Foot
) -> FloatArray:
    return _sums(*_solve(x, force, contacts, shape, foot))


def _sums(residuals: FloatArray, rises: FloatArray) -> FloatArray:
    """Return the sums of squares (t,); infinite where the fitted force would fall with depth."""
    return np.where(rises > 0.0, _products(residuals, residuals), np.inf)


def _widening(residual: FloatArray) -> float:
    """Return the factor on the variance for residuals correlated as a first-order autoregressive process."""
    power = float(residual @ residual)
    if power <= 0.0 or len(residual) < 3:
        return 1.0
    correlation = float(residual[1:] @ residual[:-1]) / power
    # Anticorrelated residuals would narrow the interval; that is not claimed.
    held = min(max(correlation, 0.0), _MOST_CORRELATED)
    return (1.0 + held) / (1.0 - held)


@dataclass(frozen=True)
class ContactPoint:
    """The contact depth of a curve.

    Parameters
    ----------
    depth, uncertainty : float
        Depth reading at contact and its standard error (m), by `method`. The error of ``foot`` allows for a contact
        law with another exponent, that of the others includes the scatter between all estimators.
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
        """Standard deviation (m) between the estimators: large where they do not see one plain contact."""
        return float(np.std([estimate.depth for estimate in self.estimates]))


def find_contact(
    curve: Curve, method: str = "auto", *, scene: Scene | None = None, exponent: float = 1.5
) -> ContactPoint:
    """Estimate the depth reading at which the indenter first touches.

    Parameters
    ----------
    curve : Curve
        The curve, with its approach before contact if it was recorded.
    method : str
        One of `METHODS`; "auto" takes the first that gives an estimate.
    scene : Scene, optional
        Its contact law is fitted after contact. Without it a power law is.
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
    require_given(curve, "curve", Curve)
    if method != "auto" and method not in METHODS:
        raise InputError(f"no contact method {method!r}; there are auto, {', '.join(METHODS)}")
    if not (np.isfinite(exponent) and 0.5 <= exponent <= 5.0):
        raise InputError(f"the exponent of the foot must be between 0.5 and 5; got {exponent!r}")
    foot = foot_of(curve)
    law = None if scene is None else scene.contact_law(reach_of(foot))
    return contact_of(foot, law, method, exponent=exponent)


def reach_of(foot: Foot) -> float:
    """Return the indentation (m) up to which a contact law is needed to fit the part of a curve near contact."""
    return (1.0 + BEFORE) * float(np.ptp(foot.depth))


def contact_of(foot: Foot, law: ContactLaw | None, method: str = "auto", *, exponent: float) -> ContactPoint:
    """Estimate the contact depth where `foot_of` was already called for the curve; see `find_contact`.

    Parameters
    ----------
    foot : Foot
        The baseline and the beginning of the rise.
    law : ContactLaw or None
        Contact law to fit, valid up to `reach_of`; without one a power law is fitted.
    method : str
        One of `METHODS`; "auto" takes the first that gives an estimate.
    exponent : float
        Exponent of that power law.

    Raises
    ------
    CurveError
        If the method gives no estimate.
    """
    points = Points.of(foot)
    if len(points.depth) < _FEWEST_OF_FOOT or not points.depth[-1] > points.depth[0]:
        raise CurveError(
            f"no contact found: the depth does not grow over the {len(points.depth)} readings before the force "
            "rises; leave the curve out if the tip did not reach the sample, else check which column is the depth, "
            "and its sign"
        )
    # Of a tip too small for all that was travelled the law ends before the first contact that is tried.
    reaches = law is not None and points.depth[-1] - _earliest(foot, points) <= law.max_depth
    shape = shape_of(law) if law is not None and reaches else power_law(exponent)
    by_foot = scan("foot", foot, points, shape)
    tried = (
        None if by_foot is None else by_foot.estimate,
        # Without a stretch in front of contact there is no change to find.
        change_point(foot, points) if foot.has_baseline else None,
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
    if by_foot is not None and contact is by_foot.estimate:
        return replace(found, uncertainty=with_a_doubtful_shape(foot, points, shape, by_foot))
    # These know nothing of a shape: they differ by what theirs do.
    return replace(found, uncertainty=float(np.hypot(contact.uncertainty, found.scatter)))


def _threshold(foot: Foot, exponent: float) -> ContactEstimate | None:
    """Estimate contact from the depth where the force passes 3 standard deviations of the noise.

    The indentation that a power law needs for that force is subtracted. None where the force never passes.
    """
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


# --- thickness from contacts beside the sample


# Least ratio of the directions of a plane for which it is one and no line: the sine of one degree.
_LEAST_SINE = 0.017


class Thicknesses(NamedTuple):
    """Thickness (m) at every curve, its standard uncertainty (m), each (curves,), and whether the plane is tilted.

    On the bare substrate the thickness is how far the plane misses the contact.
    """

    thickness: FloatArray
    error: FloatArray
    is_tilted: bool


def thickness_of_heights(
    height: FloatArray, error: FloatArray, bare: NDArray[np.bool_], places: Sequence[tuple[float, ...]]
) -> Thicknesses:
    """Layer thickness from the depths at which curves meet the sample, and the bare substrate beside it.

    The surface of the substrate is the least-squares plane through the contacts of at least three curves on it, if
    all curves have places and these are not on a line; otherwise it is taken as level.

    Parameters
    ----------
    height, error : FloatArray
        Depth of contact from the common zero, growing into the sample, and its standard uncertainty (m), (curves,).
    bare : ndarray of bool (curves,)
        Which curves are on the bare substrate; at least one.
    places : sequence of tuple of float
        Position (x, y) (m) of every curve; empty where it is not known.

    Returns
    -------
    Thicknesses
        Its error has that of the contact point, and that of the plane: of its contact points, or as these scatter
        about it where that is more.
    """
    terms = _terms(places, bare)
    plane, _, _, _ = np.linalg.lstsq(terms[bare], height[bare], rcond=None)
    thickness = terms @ plane - height
    freedom = int(bare.sum()) - terms.shape[1]
    scatter = float(np.sqrt(np.sum(thickness[bare] ** 2) / freedom)) if freedom > 0 else 0.0
    reach = np.einsum("ij,jk,ik->i", terms, np.linalg.inv(terms[bare].T @ terms[bare]), terms)
    of_plane = max(scatter, float(np.sqrt(np.mean(error[bare] ** 2)))) * np.sqrt(reach)
    return Thicknesses(thickness, np.hypot(error, of_plane), terms.shape[1] > 1)


def _terms(places: Sequence[tuple[float, ...]], bare: NDArray[np.bool_]) -> FloatArray:
    """Return the design matrix (curves, 1 or 3) of the substrate's height: a constant and, for a plane, x and y.

    `bare` marks the curves on the substrate; a plane needs at least three of them that are not on a line.
    """
    level = np.ones((len(places), 1))
    # A plane has three corners.
    if bare.sum() < 3 or not all(places):
        return level
    across = np.array(places, dtype=float)
    across -= across[bare].mean(axis=0)
    directions = np.linalg.svd(across[bare], compute_uv=False)
    return np.hstack((level, across)) if directions[1] > _LEAST_SINE * directions[0] else level
