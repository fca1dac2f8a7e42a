"""The response to a unit step as a table in time, by Laplace inversion, and what ramps and steps make of it.

f(t) = end + (start - end) g(t), g from 1 to 0, and its integral K(t) = end t + (start - end) I(t), I =
int_0^t g. A piecewise linear history of any length is a sum of K, its jumps a sum of f: superposition is
exact. t g is a cubic spline in ln t (12 a decade: 3e-6) and I the integral of that spline.

Where the table ends: below it 1 - g follows the power of t that it has there (the edge drains first, so it is
not exactly a half); above it g falls as it does at the end, as t^(-1/2) on a half-space and exponentially on
a layer.

The table comes from the Laplace transform F by `invert`: for a window t0 <= t <= t1 of times from a few shared
points on a hyperbola,

    f(t) = Im sum_k exp(z_k t) F(z_k) w_k,   z(u) = mu (1 + sin(iu - alpha))

with weights w_k (Weideman and Trefethen 2007, doi 10.1090/S0025-5718-07-01945-X): F is asked for at n points,
whatever the number of times.

Piecewise linear histories of depth or load: ramps, holds and sudden steps, and what a response makes of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from underlay._arrays import ArrayLike, FloatArray, as_finite, read_only
from underlay.errors import InputError
from underlay.mechanics.biphasic.material import ComplexArray

# Decades of time that one contour serves, and what an end is kept off the open interval of its angle.
_DECADES = 1.5
_OFF = 1e-3
_PER_DECADE = 12
# The power below the table is that over its first half decade.
_EARLY = 3.0


@dataclass(frozen=True)
class Contour:
    """Contour of numerical inverse Laplace transform for times in [start, end]: a hyperbola (module).

    Parameters
    ----------
    start, end : float
        Shortest and longest time that it serves, positive.
    z, weights : ComplexArray
        Laplace variables on the contour and quadrature weights, (n,).
    """

    start: float
    end: float
    z: ComplexArray
    weights: ComplexArray

    @classmethod
    def of(cls, start: float, end: float, count: int) -> Self:
        """Make the hyperbola of `count` points whose angle minimises the error for times in [start, end]."""
        ratio = end / start

        def spread(alpha: float) -> float:
            return float(
                np.arccosh(
                    ((np.pi - 2.0 * alpha) * ratio + 4.0 * alpha - np.pi)
                    / ((4.0 * alpha - np.pi) * np.sin(alpha))
                )
            )

        def slowness(alpha: float) -> float:
            return -(np.pi**2 - 2.0 * np.pi * alpha) / spread(alpha)

        bounds = (0.25 * np.pi + _OFF, 0.5 * np.pi - _OFF)
        alpha = float(minimize_scalar(slowness, bounds=bounds, method="bounded").x)
        step = spread(alpha) / count
        size = (4.0 * np.pi * alpha - np.pi**2) / spread(alpha) * count / end
        u = (np.arange(count) + 0.5) * step
        z = size * (1.0 + np.sin(1j * u - alpha))
        slope = 1j * size * np.cos(1j * u - alpha)
        return cls(start, end, z, slope * step / np.pi)

    def invert(self, transform: ComplexArray, time: FloatArray) -> FloatArray:
        """Function f at times, (t,), from its Laplace transform F at the points `z`, (n,)."""
        return np.asarray((np.exp(np.multiply.outer(time, self.z)) @ (self.weights * transform)).imag)


def windows(start: float, end: float, count: int) -> list[Contour]:
    """Contours of inverse Laplace transform for times in [start, end], `count` points for every 1.5 decades."""
    number = max(int(np.ceil(np.log10(end / start) / _DECADES - 1e-9)), 1)
    ends = np.geomspace(start, end, number + 1)
    return [Contour.of(float(low), float(high), count) for low, high in pairwise(ends)]


@dataclass(frozen=True, eq=False)
class Response:
    """Response f(t) to a unit step as a table: from `start` at once to `end` in the long run; one layer or many.

    Parameters
    ----------
    start, end : float or FloatArray
        Values of f at time zero and at infinite time; (sets, 1) for many layers.
    time : FloatArray
        Times of the table, (n,), in geometric progression.
    fall : FloatArray
        Normalised fall g = (f - end)/(start - end) at these times, (n,) or (sets, n).
    endless : bool, default False
        Whether g falls as t^(-1/2) in the long run: on a half-space.
    unit : float or FloatArray, default 1
        Unit of the table's times, in the unit of the times passed to `step` and `ramp` (s); (sets, 1) for many
        layers.
    """

    start: float | FloatArray
    end: float | FloatArray
    time: FloatArray
    fall: FloatArray
    endless: bool = False
    unit: float | FloatArray = 1.0

    def scaled(self, factor: float | FloatArray, unit: float | FloatArray) -> Self:
        """Return this response with values times `factor` and with `unit` (s) as the unit of the table's times."""
        return replace(self, start=factor * self.start, end=factor * self.end, unit=unit)

    def step(self, time: FloatArray) -> FloatArray:
        """Response f at times since a unit step, (m,): (m,) or (sets, m); zero before it, `start` at time zero."""
        t = np.asarray(time, dtype=np.float64) / self.unit
        after = self.end + (self.start - self.end) * self.g(np.maximum(t, 0.0))
        return np.where(t < 0.0, 0.0, after)

    def ramp(self, time: FloatArray) -> FloatArray:
        """Response at times since a unit step of the rate: K, the integral of f from 0; shapes as of `step`."""
        t = np.maximum(np.asarray(time, dtype=np.float64) / self.unit, 0.0)
        return np.asarray(self.unit * (self.end * t + (self.start - self.end) * self.integral(t)))

    def g(self, t: FloatArray) -> FloatArray:
        """Normalised fall g, (m,) or (sets, m), at times t >= 0 in the table's unit: from 1 at zero to 0."""
        first, last = self.time[0], self.time[-1]
        lost, power = self._early
        early = 1.0 - lost * (np.minimum(t, first) / first) ** power
        within = np.minimum(np.maximum(t, first), last)
        inside = self._on_spline(self._spline.c, within) / within
        late = _upright(self.fall[..., -1]) * self._late(np.maximum(t, last))[0]
        return np.where(t < first, early, np.where(t > last, late, inside))

    def integral(self, t: FloatArray) -> FloatArray:
        """Integral I of the normalised fall g from 0 to t, (m,) or (sets, m), t in the table's unit of time."""
        first, last = self.time[0], self.time[-1]
        lost, power = self._early
        x = np.minimum(t, first)
        early = x * (1.0 - lost / (1.0 + power) * (x / first) ** power)
        inside = self._on_spline(self._integral_pieces, np.minimum(np.maximum(t, first), last))
        late = _upright(self.fall[..., -1]) * self._late(np.maximum(t, last))[1]
        return np.asarray(early + inside + late)

    def _on_spline(self, pieces: FloatArray, t: FloatArray) -> FloatArray:
        """Evaluate a spline in ln t at times inside the table; `pieces`: coefficients, (powers, n - 1, ...)."""
        knots = np.log(self.time)
        x = np.log(t)
        place = (x - knots[0]) * ((knots.size - 1) / (knots[-1] - knots[0]))
        piece = np.minimum(place.astype(np.intp), knots.size - 2)
        off = x - knots[piece]
        at = (piece, np.arange(len(self.fall))[:, None]) if self.fall.ndim > 1 else (piece,)
        value = pieces[0][at]
        for power in pieces[1:]:
            value = value * off + power[at]
        return np.asarray(value)

    @cached_property
    def _spline(self) -> CubicSpline:
        """Cubic spline of the product t g(t) over ln t."""
        return CubicSpline(np.log(self.time), self.time * self.fall, axis=-1)

    @cached_property
    def _integral_pieces(self) -> FloatArray:
        """Spline coefficients of the integral of g from the first time of the table, as a function of ln t."""
        return np.asarray(self._spline.antiderivative().c)

    @cached_property
    def _early(self) -> tuple[FloatArray, FloatArray]:
        """1 - g at the first time of the table, and the power of t by which it is extrapolated to earlier times."""
        later = int(np.searchsorted(self.time, _EARLY * self.time[0]))
        lost, more = (_upright(1.0 - self.fall[..., node]) for node in (0, later))
        return lost, np.log(more / lost) / np.log(self.time[later] / self.time[0])

    def _late(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Extrapolation beyond the table: g over its last value, and the integral of that from the last time."""
        last, end = self.time[-1], _upright(self.fall[..., -1])
        x = t / last
        if self.endless:
            return x**-0.5, 2.0 * last * (np.sqrt(x) - 1.0)
        # d(t g)/d ln t = t (g + dg/d ln t)
        slope = _upright(self._spline(np.log(last), 1)) / last - end
        # Drained to the error of the table, nothing is left to fall.
        falls = (slope < 0.0) & (end > 0.0)
        rate = np.where(falls, -slope, 1.0) / np.where(falls, end, 1.0)
        return falls * np.exp(-rate * (x - 1.0)), falls * (-last / rate * np.expm1(-rate * (x - 1.0)))


def _upright(numbers: FloatArray) -> FloatArray:
    """Give numbers of many sets, (sets,), the shape (sets, 1), to combine them with times; floats are unchanged."""
    return np.asarray(numbers)[..., None] if np.ndim(numbers) else numbers


def table_times(span: tuple[float, float], per_decade: int = _PER_DECADE) -> FloatArray:
    """Times of a table in geometric progression from the first to the last of `span`."""
    return np.geomspace(*span, int(np.ceil(per_decade * np.log10(span[1] / span[0]) - 1e-9)) + 1)


def invert(
    transfer: Callable[[ComplexArray], ComplexArray],
    start: float,
    end: float,
    span: tuple[float, float],
    *,
    endless: bool = False,
    points: int = 16,
) -> Response:
    """Compute the step response f whose transfer function is `transfer`: s times the Laplace transform of f.

    Parameters
    ----------
    transfer : callable
        Transfer function at Laplace variables, (n,). The normalised fall is inverted, never the transfer function
        itself.
    start, end : float
        Its values at infinite s and at s = 0, which are those of f at once and in the long run.
    span : (float, float)
        First and last time of the table.
    endless : bool, optional
        Whether g falls as t^(-1/2) in the long run.
    points : int, default 16
        Laplace values for each window of a decade and a half; error of g: 12: 1e-4, 16: 1e-5.
    """
    contours = windows(*span, points)
    values = transfer(np.concatenate([contour.z for contour in contours])).reshape(len(contours), points)
    time = table_times(span)
    fall = np.empty(time.size)
    for contour, part in zip(contours, (values - end) / (start - end), strict=True):
        mine = (time >= contour.start * (1.0 - 1e-9)) & (time <= contour.end * (1.0 + 1e-9))
        fall[mine] = contour.invert(part / contour.z, time[mine])
    return Response(start, end, time, fall, endless)


# Entries of a table of lags that are worked on at once.
_AT_ONCE = 2_000_000
# Slopes below this share of the largest are the rounding of a straight line.
_STRAIGHT = 1e-12
# A record is followed to so many times its ripple, and to these shares of its depth: what superposes exactly, and
# what a moving contact goes by (its force takes the depths themselves: its memory alone is this coarse).
_RIPPLES, _EXACT, _COARSE = 6.0, 1e-5, 2e-3
# What rests for less than this share of the ramps beside it does not rest.
_SHORT = 0.1
# A ramp whose record begins this near to the surface, over its largest depth, began on it.
_FOOT = 0.1
# The median of |second difference| of white noise of deviation 1: sqrt(6) times 0.6745.
_SECOND_DIFFERENCE = 1.6522


@dataclass(frozen=True, eq=False)
class Polyline:
    """A piecewise linear history: zero before the first knot, linear between knots, constant after the last.

    Parameters
    ----------
    time : array_like (m,)
        Times of the knots (s), not decreasing; two equal ones are a sudden step.
    value : array_like (m,)
        Depths (m) or loads (N) at the knots; if the first is not zero, the history begins with a step.

    Raises
    ------
    InputError
        If shapes differ, or the times decrease.
    """

    time: FloatArray
    value: FloatArray

    def __post_init__(self) -> None:
        time, value = (
            as_finite(self.time, "times of a history"),
            as_finite(self.value, "values of a history"),
        )
        if time.ndim != 1 or time.shape != value.shape or time.size == 0:
            raise InputError(f"a history needs one time a value, (m,); got {time.shape} and {value.shape}")
        back = np.flatnonzero(np.diff(time) < 0.0)
        if back.size:
            raise InputError(f"the times of a history must not fall back; they do at index {back[0] + 1}")
        object.__setattr__(self, "time", read_only(time))
        object.__setattr__(self, "value", read_only(value))

    @classmethod
    def thinned(cls, time: ArrayLike, value: ArrayLike, tolerance: float) -> Self:
        """Approximate a record (n,) by few of its points, to within `tolerance` (Douglas and Peucker 1973)."""
        t, w = as_finite(time, "time"), as_finite(value, "value")
        kept = np.zeros(t.size, dtype=bool)
        kept[[0, -1]] = True
        pending = [(0, t.size - 1)]
        while pending:
            low, high = pending.pop()
            if high <= low + 1:
                continue
            line = np.interp(t[low : high + 1], [t[low], t[high]], [w[low], w[high]])
            off = np.abs(w[low : high + 1] - line)
            worst = int(off.argmax())
            if off[worst] > tolerance:
                kept[low + worst] = True
                pending += [(low, low + worst), (low + worst, high)]
        return cls(t[kept], w[kept])

    @property
    def in_contact(self) -> Self:
        """Return this history from first contact on, negative depths set to zero and knots added at crossings."""
        t, w = self.time, self.value
        crossing = np.flatnonzero(w[:-1] * w[1:] < 0.0)
        share = w[crossing] / (w[crossing] - w[crossing + 1])
        when = t[crossing] + share * (t[crossing + 1] - t[crossing])
        t, w = np.insert(t, crossing + 1, when), np.insert(w, crossing + 1, 0.0)
        touching = np.flatnonzero(w > 0.0)
        first = max(int(touching[0]) - 1, 0) if touching.size else 0
        return type(self)(t[first:], np.maximum(w[first:], 0.0))

    def at(self, time: ArrayLike) -> FloatArray:
        """Value at times (s), shape of `time`; at a sudden step the value after it."""
        t = as_finite(time, "time")
        after = np.searchsorted(self.time, t, side="right")
        low, high = np.maximum(after - 1, 0), np.minimum(after, self.time.size - 1)
        gap = self.time[high] - self.time[low]
        share = np.where(gap > 0.0, t - self.time[low], 0.0) / np.where(gap > 0.0, gap, 1.0)
        value = self.value[low] + share * (self.value[high] - self.value[low])
        return np.where(after == 0, 0.0, value)

    @cached_property
    def jumps(self) -> tuple[FloatArray, FloatArray]:
        """Times (s) and sizes (in the unit of the values) of the sudden steps, (k,) each."""
        times, values = (np.concatenate((self.time[:1], self.time)), np.concatenate(([0.0], self.value)))
        sudden = (np.diff(times) == 0.0) & (np.diff(values) != 0.0)
        return times[1:][sudden], np.diff(values)[sudden]

    @cached_property
    def bends(self) -> tuple[FloatArray, FloatArray]:
        """Times (s) at which the slope changes, and the changes (unit of the values per s), (k,) each."""
        slopes = self._slopes
        change = np.concatenate((slopes, [0.0])) - np.concatenate(([0.0], slopes))
        has_bend = np.abs(change) > _STRAIGHT * np.abs(slopes).max(initial=0.0)
        return self._ends[has_bend], change[has_bend]

    @cached_property
    def _long(self) -> NDArray[np.bool_]:
        return np.diff(self.time) > 0.0

    @cached_property
    def _slopes(self) -> FloatArray:
        return np.asarray(np.diff(self.value)[self._long] / np.diff(self.time)[self._long])

    @cached_property
    def _ends(self) -> FloatArray:
        """Times (s) that bound the linear pieces: the beginning of the first, and the end of each."""
        return np.concatenate((self.time[:1], self.time[1:][self._long]))

    @property
    def rises(self) -> FloatArray:
        """Durations (s) of the linear pieces on which the value changes, up or down."""
        return np.asarray(np.diff(self._ends)[self._slopes != 0.0])

    def superposed(self, response: Response, time: ArrayLike) -> FloatArray:
        """Exact response to this history, (n,), at times (s), of the linear system with this unit-step response."""
        t = as_finite(time, "time")
        total = np.zeros(t.shape)
        for (starts, sizes), answer in ((self.jumps, response.step), (self.bends, response.ramp)):
            if not (starts.size and t.size):
                continue
            chunk = max(_AT_ONCE // starts.size, 1)
            for first in range(0, t.size, chunk):
                lags = np.subtract.outer(t[first : first + chunk], starts)
                total[first : first + chunk] += answer(lags.ravel()).reshape(lags.shape) @ sizes
        return total

    def superposed_above(
        self, level: FloatArray, response: Response, time: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Responses of many systems to this history less a level of each (its contact depth), from contact on.

        A set is one system with its own level and response, for example one parameter vector of a fit.

        Parameters
        ----------
        level : FloatArray
            Value of the history at first contact, (sets,).
        response : Response
            Unit-step responses of as many sets.
        time : FloatArray
            Times (s), (n,).

        Returns
        -------
        (FloatArray, ndarray of bool)
            Responses, (sets, n), and mask (sets,) of those computed: not where the history falls below the level
            again, or has a sudden step.
        """
        t, above = self.time, self.value - level[:, None]
        touching = above > 0.0
        first = touching.argmax(axis=1)
        rows, began = np.arange(level.size), np.maximum(first - 1, 0)
        # Before its first contact a set may be anywhere below.
        served = (touching | (np.arange(t.size) < first[:, None])).all(axis=1) & (np.diff(t) > 0.0).all()
        if not served.any() or t.size < 2:
            return np.zeros((level.size, time.size)), np.zeros(level.size, dtype=bool)
        rate = self._slopes[np.minimum(began, t.size - 2)]
        at_once = np.where(first == 0, above[:, 0], 0.0)
        start = np.where(first == 0, t[0], t[first] - above[rows, first] / np.where(rate > 0.0, rate, 1.0))
        total = rate[:, None] * response.ramp(time - start[:, None])
        if at_once.any():
            total += at_once[:, None] * response.step(time - t[0])
        for when, change in zip(*self.bends, strict=True):
            later = (when >= t[first]) & (when > t[0])
            if later.any():
                total += (later * change)[:, None] * response.ramp(time - when)
        return total, served


def followed(depth: FloatArray, time: FloatArray) -> Polyline:
    """Approximate a record of depths (m) at times (s), (n,) each, by a polyline to within its own noise."""
    return Polyline.thinned(time, depth, _tolerance(depth, _EXACT))


def ramps_and_holds(depth: FloatArray, time: FloatArray) -> Polyline:
    """Approximate a record of depths (m) at times (s), (n,) each, by ramps and holds.

    Neighbouring rises become one ramp: the line of the largest of them, from the level before it to the one after.
    """
    tolerance = _tolerance(depth, _COARSE)
    line = Polyline.thinned(time, depth, tolerance)
    t, w = line.time, line.value
    turns = np.sign(np.diff(w)) * (np.abs(np.diff(w)) > 2.0 * tolerance)
    long = np.diff(t)
    for i in range(1, turns.size - 1):
        # A ripple within a ramp is no hold.
        if turns[i - 1] > 0.0 < turns[i + 1] and long[i] < _SHORT * (long[i - 1] + long[i + 1]):
            turns[i] = 1.0
    ends = np.flatnonzero(np.diff(turns)) + 1
    knots = [(float(t[0]), float(w[0]))]
    if 0.0 < w[0] < _FOOT * w.max() and turns.size and turns[0] > 0.0:
        knots = [(-np.inf, 0.0)]
    for first, last in pairwise([0, *ends.tolist(), turns.size]):
        part = slice(first, last + 1)
        knots += _ramp(t[part], w[part], knots[-1]) if turns[first] > 0.0 else []
        if turns[first] <= 0.0:
            knots.append((float(t[last]), float(w[last]) if turns[first] < 0.0 else knots[-1][1]))
    known = [(when, level) for when, level in knots if np.isfinite(when)]
    return Polyline(*np.array(known).T)


def _ramp(t: FloatArray, w: FloatArray, before: tuple[float, float]) -> list[tuple[float, float]]:
    """Both ends (time, depth) of the ramp that replaces rising knots `t`, `w`, (m,), after the knot `before`."""
    main = int(np.argmax(np.diff(w)))
    slope = (w[main + 1] - w[main]) / (t[main + 1] - t[main])
    start = max(float(t[main] + (before[1] - w[main]) / slope), before[0])
    end = min(float(t[main] + (w[-1] - w[main]) / slope), float(t[-1]))
    return [(start, before[1]), (max(end, start), float(w[-1]))]


def _tolerance(depth: FloatArray, share: float) -> float:
    """Tolerance (m) for approximating a record of depths (m): 6 times its noise, at least `share` of its peak."""
    second = np.abs(np.diff(depth, 2))
    ripple = float(np.median(second)) / _SECOND_DIFFERENCE if second.size else 0.0
    return max(_RIPPLES * ripple, share * float(np.abs(depth).max()))


def ramp_and_hold(value: float, duration: float) -> Polyline:
    """Return the history that rises linearly from zero to `value` in `duration` (s) and stays; 0 s is a step.

    Raises
    ------
    InputError
        If the duration is negative.
    """
    if duration < 0.0:
        raise InputError(f"a ramp lasts zero or more (s); got {duration!r}")
    return Polyline(np.array([0.0, duration]), np.array([0.0, value]))
