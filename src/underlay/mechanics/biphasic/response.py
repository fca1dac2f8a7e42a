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
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from underlay._arrays import FloatArray
from underlay.mechanics.biphasic.elastic_ends import ComplexArray

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
