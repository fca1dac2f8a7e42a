"""A measured tip: radii and heights, interpolated so that every integral of it is exact.

Between the points runs a piecewise quadratic spline with one extra knot in each interval (Schumaker (1983),
doi:10.1137/0720057). It passes through every point, has a continuous slope and keeps the shape: heights that
increase convexly give a curve that does. The slope Phi' is then a polygon; with k_j its jumps and c_j its
changes of inclination at the knots t_j,

    Phi'(s) = m + sum_j k_j [s > t_j] + sum_j c_j (s - t_j)_+ ,
    H(r) = (pi/2) m r + sum_j k_j r acos(t_j/r) + sum_j c_j r [sqrt(r^2 - t_j^2) - t_j acos(t_j/r)],

and the moments of H integrate in the same way: no quadrature, rounding error only.

Slopes at the points: the inclination of the parabola through each point and its neighbours (a weighted mean
of the two chords, hence between them), so that a paraboloid and a cone are reproduced exactly; at the apex
the same parabola, but never below zero. In an interval whose chord has the slope d, the slope runs from its
left value to d at the extra knot and on to its right value. A corner, where straight runs of points meet,
leaves no room for a continuous slope in a convex curve: there, and only there, the slope jumps (the k_j).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray, as_finite, read_only
from underlay.errors import InputError
from underlay.mechanics.exact.master_curve import chebyshev_angles, chebyshev_coefficients, monomials
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.inverse import invert_increasing
from underlay.quantities import quantity

_FEWEST_POINTS = 4
# Radii from which on a table is asked in place of the sums, and its terms: see `_Table`.
_MANY, _TERMS = 200, 16
# Chords may decrease by this much of the steepest one: the rounding of heights written with 10 digits.
_ROUNDING = 1e-10
# The slope changes on either side of a chord may differ by this factor; beyond, the point is a corner. On a
# smooth tip the factor is the ratio of neighbouring curvatures, of order one.
_CORNER = 100.0


@dataclass(frozen=True, eq=False)
class Profile(Indenter):
    """A measured, convex, axisymmetric tip.

    Parameters
    ----------
    r : array_like, shape (n,)
        Radii (m) from the axis, strictly increasing, the first zero; at least four.
    height : array_like, shape (n,)
        Height (m) of the tip's surface above its apex at those radii; a constant offset is removed. Must
        increase, with slopes that do not decrease (convex).

    Raises
    ------
    InputError
        If there are too few points, radii are out of order, or heights are not increasing and convex; the
        message names the first offending radius.

    Examples
    --------
    >>> r = np.linspace(0.0, 1e-6, 6)
    >>> tip = Profile(r, r**2 / (2 * 5e-6))  # a paraboloid of 5 um, exactly
    >>> f"{tip.abel(np.array(4e-7)):.6e}"  # H = r^2/R
    '3.200000e-08'
    """

    shape: ClassVar[str] = "profile"

    r: FloatArray = field(metadata=quantity("length", "radii of the {part}"))
    height: FloatArray = field(metadata=quantity("length", "heights of the {part}"))

    def __post_init__(self) -> None:
        r, height = as_finite(self.r, "profile radii r"), as_finite(self.height, "profile heights")
        _check(r, height)
        object.__setattr__(self, "r", read_only(r))
        object.__setattr__(self, "height", read_only(height - height[0]))

    def __eq__(self, other: object) -> bool:
        """Whether both have the same radii and heights."""
        return (
            isinstance(other, Profile)
            and np.array_equal(self.r, other.r)
            and np.array_equal(self.height, other.height)
        )

    def __hash__(self) -> int:
        """Hash of radii and heights."""
        return hash((self.r.tobytes(), self.height.tobytes()))

    @property
    def max_radius(self) -> float:
        """The last radius measured (m)."""
        return float(self.r[-1])

    @cached_property
    def _polygon(self) -> _Polygon:
        return _slope_polygon(self.r, self.height)

    def surface(self, radius: FloatArray) -> FloatArray:
        """Phi(r) (m) of the interpolant at `radius` (m), any shape of array."""
        p, x = self._polygon, np.asarray(radius, dtype=np.float64)
        corners = np.maximum(x[..., None] - p.corner_radii, 0.0) @ p.corners
        bends = np.maximum(x[..., None] - p.bend_radii, 0.0) ** 2 @ p.bends
        return np.asarray(p.apex * x + corners + 0.5 * bends)

    @cached_property
    def _table(self) -> _Table:
        return _Table.of(self)

    def abel(self, radius: FloatArray) -> FloatArray:
        """H(r) (m) of the interpolant at `radius` (m): exact for few radii, by a table to 1e-12 for many.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        many = np.size(radius) >= _MANY and np.max(radius) <= self.max_radius
        return self._table.depth(np.asarray(radius)) if many else self._abel(radius)

    def _abel(self, radius: FloatArray) -> FloatArray:
        """H(r) (m), by the sums of the module's head.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        p, x = self._polygon, np.asarray(radius, dtype=np.float64)
        corner, bend = _Triangle(x, p.corner_radii), _Triangle(x, p.bend_radii)
        depth = corner.angle @ p.corners + (bend.leg - bend.t * bend.angle) @ p.bends
        return np.asarray(x * (0.5 * np.pi * p.apex + depth))

    def abel_slope(self, radius: FloatArray) -> FloatArray:
        """H'(r), computed as `abel` is; it grows without bound towards a corner from outside.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        many = np.size(radius) >= _MANY and np.max(radius) <= self.max_radius
        return self._table.slope(np.asarray(radius)) if many else self._abel_slope(radius)

    def _abel_slope(self, radius: FloatArray) -> FloatArray:
        """H'(r), by the derivative of the sums of the module's head.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        p, x = self._polygon, np.asarray(radius, dtype=np.float64)
        corner, bend = _Triangle(x, p.corner_radii), _Triangle(x, p.bend_radii)
        outside = np.divide(corner.t, corner.leg, out=np.zeros_like(corner.leg), where=corner.leg > 0.0)
        bends = (2.0 * bend.leg - bend.t * bend.angle) @ p.bends
        return np.asarray(0.5 * np.pi * p.apex + (corner.angle + outside) @ p.corners + bends)

    def abel_moments(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(int_0^a H ds, int_0^a H s^2 ds) (m^2, m^4) for a = `radius` (m), exact for the interpolant."""
        p, x = self._polygon, np.asarray(radius, dtype=np.float64)
        corner, bend = _Triangle(x, p.corner_radii), _Triangle(x, p.bend_radii)
        first = 0.25 * np.pi * p.apex * x**2
        first = first + corner.first @ p.corners + (bend.leg**3 / 3.0 - bend.t * bend.first) @ p.bends
        second_of_bends = bend.leg**5 / 5.0 + bend.t**2 * bend.leg**3 / 3.0 - bend.t * bend.second
        second = 0.125 * np.pi * p.apex * x**4 + corner.second @ p.corners + second_of_bends @ p.bends
        return np.asarray(first), np.asarray(second)

    def halfspace_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m) on a half-space at `depth` (m), the inverse of `abel`, by Newton's method."""
        end = self.max_radius
        last = float(self.abel(np.array(end)))
        target = np.asarray(depth, dtype=np.float64)
        flat = np.atleast_1d(target).ravel()
        # A depth computed with a sum in another order may exceed the last one by rounding.
        if (flat > last * (1.0 + 1e-12)).any():
            raise InputError(
                f"depth {flat.max():.6g} m is beyond {last:.6g} m, where the contact on a half-space reaches "
                f"the last measured radius, {end:.6g} m; measure the tip further out"
            )
        table = self._table
        # Between knots H is nearly straight, and a power below the first.
        start = np.exp(np.interp(np.log(flat), table.log_depths, table.log_radii))
        start = np.where(flat < table.depths[1], table.knots[1] * np.sqrt(flat / table.depths[1]), start)
        radius = invert_increasing(lambda x: (self.abel(x), self.abel_slope(x)), flat, start, end)
        return np.asarray(radius.reshape(target.shape))


@dataclass(frozen=True)
class _Table:
    """H(r) and its slope between knots, as polynomials in the root of the distance from the previous knot.

    H(r) is the depth at which the contact radius on a half-space is r. Outside a knot t it grows by (x - t)^(3/2)
    and whole powers, at a corner by (x - t)^(1/2): polynomials in 2 ((x - t)/(next t - t))^(1/2) - 1, whose terms
    fall by 3.3 and more where no interval is more than twice the one before it. Beyond a corner H' is computed from
    the exact sums.

    Parameters
    ----------
    tip : Profile
        The tip.
    knots, depths : ndarray (knots,)
        Radii (m) from zero to the last, and H (m) at them.
    log_radii, log_depths : ndarray (knots - 1,)
        Logarithms of these, without the apex.
    depth_terms, slope_terms : ndarray (terms, intervals)
        Coefficients of the polynomials for H and H', by power.
    cornered : ndarray (intervals,)
        Whether H' is unbounded at the beginning of the interval.
    """

    tip: Profile
    knots: FloatArray
    depths: FloatArray
    log_radii: FloatArray
    log_depths: FloatArray
    depth_terms: FloatArray
    slope_terms: FloatArray
    cornered: NDArray[np.bool_]

    @classmethod
    def of(cls, tip: Profile) -> _Table:
        """Fit the polynomials to exact values of H and H' at Chebyshev points of every interval."""
        p = tip._polygon  # noqa: SLF001  the table is a part of the tip
        knots = _graded(np.unique(np.concatenate(([0.0], p.corner_radii, p.bend_radii, tip.r))))
        knots = knots[knots <= tip.max_radius]
        angles = chebyshev_angles(_TERMS)
        t = 0.5 + 0.5 * np.cos(angles)
        x = knots[:-1] + np.multiply.outer(t * t, np.diff(knots))
        depths = tip._abel(knots)  # noqa: SLF001  as above
        powers = monomials(_TERMS).T
        return cls(
            tip,
            knots,
            depths,
            np.log(knots[1:]),
            np.log(depths[1:]),
            powers @ chebyshev_coefficients(np.stack([tip._abel(row) for row in x]), angles),  # noqa: SLF001  as above
            powers @ chebyshev_coefficients(np.stack([tip._abel_slope(row) for row in x]), angles),  # noqa: SLF001  as above
            np.isin(knots[:-1], p.corner_radii),
        )

    def depth(self, radius: FloatArray) -> FloatArray:
        """H (m), the half-space depth, at radii (m) up to the last knot."""
        value, interval = self._value(radius, self.depth_terms)
        return np.where(interval == 0, self._apex(radius)[0], value)

    def slope(self, radius: FloatArray) -> FloatArray:
        """H' at radii (m) up to the last knot.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        value, interval = self._value(radius, self.slope_terms)
        beyond = self.cornered[interval]
        if beyond.any():
            value[beyond] = self.tip._abel_slope(radius[beyond])  # noqa: SLF001  the table is a part of the tip
        return np.where(interval == 0, self._apex(radius)[1], value)

    def _apex(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """H and H' up to the first knot, in closed form, where polynomials would lose relative accuracy.

        H(r) is the depth at which the contact radius on a half-space is r.
        """
        p = self.tip._polygon  # noqa: SLF001  as above
        level, bend = 0.5 * np.pi * p.apex, float(p.bends[p.bend_radii == 0.0].sum())
        return radius * (level + bend * radius), level + 2.0 * bend * radius

    def _value(self, radius: FloatArray, terms: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        interval = np.searchsorted(self.knots[1:-1], radius, side="right")
        start = self.knots[interval]
        z = 2.0 * np.sqrt((radius - start) / (self.knots[interval + 1] - start)) - 1.0
        value = terms[-1][interval]
        for own in terms[-2::-1]:
            value *= z
            value += own[interval]
        return value, interval


def _graded(knots: FloatArray) -> FloatArray:
    """Knots with others inserted, so that no interval is more than twice as long as the one before it."""
    found = knots[:2].tolist()
    for knot in knots[2:].tolist():
        while knot - found[-1] > 2.0 * (found[-1] - found[-2]):
            found.append(found[-1] + 2.0 * (found[-1] - found[-2]))
        found.append(knot)
    return np.array(found)


class _Polygon(NamedTuple):
    """The slope Phi' of the interpolating spline: piecewise linear, with jumps at corners.

    `apex` is its value at the apex; `corners` its jumps, at `corner_radii` (m); `bends` its changes of inclination
    (1/m), at `bend_radii` (m).
    """

    apex: float
    corners: FloatArray
    corner_radii: FloatArray
    bends: FloatArray
    bend_radii: FloatArray


class _Triangle:
    """The right triangle of hypotenuse x (..., 1) and side t (knots,); knots outside the contact shrink to 0.

    `angle` is acos(t/x), `leg` is sqrt(x^2 - t^2); `first` and `second` are int_t^x r acos(t/r) dr and
    int_t^x r^3 acos(t/r) dr.
    """

    def __init__(self, x: FloatArray, knots: FloatArray) -> None:
        hypotenuse = x[..., None]
        self.t = np.minimum(knots, hypotenuse)
        self.leg = np.sqrt((hypotenuse - self.t) * (hypotenuse + self.t))
        # The arctangent keeps its digits where t is close to x; acos does not.
        self.angle = np.arctan2(self.leg, self.t)
        self._square = hypotenuse**2

    @property
    def first(self) -> FloatArray:
        return np.asarray(0.5 * (self._square * self.angle - self.t * self.leg))

    @property
    def second(self) -> FloatArray:
        rest = self.t * (self.leg**3 / 3.0 + self.t**2 * self.leg)
        return np.asarray(0.25 * (self._square**2 * self.angle - rest))


def _check(r: FloatArray, height: FloatArray) -> None:
    """Raise InputError unless radii and heights (m) are those of a convex tip, naming the first bad radius."""
    if r.ndim != 1 or r.shape != height.shape:
        raise InputError(
            f"a profile needs radii and heights in one row each, of equal length; got shapes {r.shape} and "
            f"{height.shape}"
        )
    if r.size < _FEWEST_POINTS:
        raise InputError(f"a profile needs at least {_FEWEST_POINTS} points; got {r.size}")
    if r[0] != 0.0:
        raise InputError(
            f"a profile starts at its apex, r = 0; the first radius is {r[0]:.6g} m (subtract the apex's "
            "position and keep one flank)"
        )
    _refuse(np.diff(r) <= 0.0, r, "radii must increase strictly")
    chords = np.diff(height) / np.diff(r)
    _refuse(chords <= 0.0, r, "heights must increase (a flat end is a FlatPunch)")
    _refuse(
        np.diff(chords) < -_ROUNDING * np.abs(chords).max(),
        r,
        "the tip is not convex: its slope decreases; smooth the data or take fewer points",
    )


def _refuse(wrong: NDArray[np.bool_], r: FloatArray, rule: str) -> None:
    if wrong.any():
        index = int(np.argmax(wrong)) + 1
        raise InputError(f"profile: {rule}; first at r = {r[index]:.6g} m (point {index})")


def _slope_polygon(r: FloatArray, height: FloatArray) -> _Polygon:
    """Slope Phi' of the interpolating spline, from radii and heights (m) of the points.

    p and q are the changes of slope on either side of each chord; each interval gets one extra knot.
    """
    width = np.diff(r)
    # Chords that decrease within _ROUNDING are lifted to their neighbour, so that p and q are never negative.
    chord = np.maximum.accumulate(np.diff(height) / width)
    change = np.diff(chord) / (width[:-1] + width[1:])
    after, before = width[:-1] * change, width[1:] * change
    # At the ends the parabola of the next point is continued, at the apex not below a level tangent.
    q_full = np.append(after, before[-1])
    p_full = np.insert(before, 0, min(after[0], chord[0]))
    p, q = np.minimum(p_full, _CORNER * q_full), np.minimum(q_full, _CORNER * p_full)
    corners = np.append((p_full - p)[1:], 0.0) + (q_full - q)
    at_corner = corners > 0.0
    # The slope runs from d - p through d to d + q; int Phi' over the interval is right with the knot here.
    span = p + q
    share = np.divide(q, span, out=np.full_like(span, 0.5), where=span > 0.0)
    left, right = share * width, (1.0 - share) * width
    inclination = np.column_stack([_ratio(p, left), _ratio(q, right)]).ravel()
    knots = np.column_stack([r[:-1], r[:-1] + left]).ravel()
    bends = np.diff(inclination, prepend=0.0)
    is_bend = bends != 0.0
    return _Polygon(
        apex=float(chord[0] - p[0]),
        corners=corners[at_corner],
        corner_radii=r[1:][at_corner],
        bends=bends[is_bend],
        bend_radii=knots[is_bend],
    )


def _ratio(rise: FloatArray, run: FloatArray) -> FloatArray:
    """rise/run elementwise, zero where the rise is zero."""
    return np.divide(rise, run, out=np.zeros_like(rise), where=rise > 0.0)
