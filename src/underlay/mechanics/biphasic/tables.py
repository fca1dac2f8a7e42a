"""Tables of isotropic draining layers that the package ships: a flat punch, and a paraboloid under a ramp and hold.

The flat punch by a/h and nu: all else is exact scaling. Chebyshev points (`Axis`) in eps/(1 + eps), eps = a/h up
to 4, and in nu up to 0.48, for each drainage, times 1e-4 to 100 a^2/c. The ends of a response are the elastic
laws', in a table of their own.

Of a paraboloid three numbers remain besides time: a0/h (a0 the undrained contact radius at the depth held), nu, and
the ramp's duration T = tr c/a0^2, tr in s. Tabulated is what has not drained yet,

    q = (P - P_drained(w))/(P_undrained(w) - P_drained(w)),

with the elastic forces of the present depth, on the ramp over t/tr, in the hold over the time since, from a share
of T to 10 a0^2/c in even ratios: every entry is smooth in ln T. A sphere differs from its paraboloid in the elastic
laws, which are exact, and in q: by 5e-3 at a0 = R/2, as the square of it.

``tests/support/draining_tables.py`` solves for them, measures their errors and writes the files again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError
from underlay.mechanics.biphasic.history import Response


@dataclass(frozen=True)
class Axis:
    """One axis of a table: Chebyshev points of the first kind, for polynomial interpolation in one variable.

    Parameters
    ----------
    low, high : float
        Ends of the interval.
    count : int
        Number of points.
    """

    low: float
    high: float
    count: int

    @cached_property
    def nodes(self) -> FloatArray:
        """Values of the variable at the points, (count,), increasing."""
        x = -np.cos(np.pi * (np.arange(self.count) + 0.5) / self.count)
        return np.asarray(0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * x)

    @cached_property
    def _inverse(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self._polynomials(self.nodes)))

    def _polynomials(self, value: FloatArray) -> FloatArray:
        x = (2.0 * value - self.low - self.high) / (self.high - self.low)
        return np.asarray(np.polynomial.chebyshev.chebvander(x, self.count - 1), dtype=np.float64)

    def covers(self, value: float | FloatArray) -> NDArray[np.bool_]:
        """Whether values lie inside the interval, in the shape of `value`."""
        return np.asarray((self.low <= value) & (value <= self.high))

    def weights(self, value: FloatArray) -> FloatArray:
        """Interpolation weights of the nodes at values (...,): (..., count).

        Raises
        ------
        InputError
            If one is outside.
        """
        outside = value[~self.covers(value)]
        if outside.size:
            raise InputError(f"the table is for {self.low:.6g} to {self.high:.6g}; got {outside[0]:.6g}")
        return np.asarray(self._polynomials(value) @ self._inverse)


@dataclass(frozen=True, eq=False)
class ResponseTable:
    """Table of arrays (here the normalised fall g(t) of a response) over parameters, read by interpolation.

    Parameters
    ----------
    axes : tuple of Axis
        One for each parameter.
    fall : FloatArray
        g at n times, (*counts, n), counts the numbers of nodes; or any other values, (*counts, ...).
    """

    axes: tuple[Axis, ...]
    fall: FloatArray

    @classmethod
    def solved(cls, axes: Sequence[Axis], fall: Callable[..., FloatArray | float]) -> Self:
        """Make the table by calling `fall` with the parameters at every combination of nodes."""
        found = np.array([fall(*map(float, values)) for values in product(*(axis.nodes for axis in axes))])
        return cls(tuple(axes), found.reshape(*(axis.count for axis in axes), *found.shape[1:]))

    def at(self, values: Sequence[float | FloatArray]) -> FloatArray:
        """Interpolate the table at one value for each axis: (n,); or at many, (sets,) each: (sets, n).

        Raises
        ------
        InputError
            If a value is outside its axis.
        """
        sets = np.broadcast_shapes(*(np.shape(value) for value in values))
        found = self.fall
        for axis, value in zip(self.axes, np.broadcast_arrays(*values), strict=True):
            known = found.reshape(*(sets if found is not self.fall else ()), axis.count, -1)
            # Not by a product of matrices: its last bit depends on how many sets there are.
            found = np.einsum("...a,...an->...n", axis.weights(value), known)
        return found.reshape(sets + self.fall.shape[len(self.axes) :])

    def covers(self, values: Sequence[float | FloatArray]) -> NDArray[np.bool_]:
        """Whether all parameters lie inside the table, (sets,)."""
        inside = [axis.covers(value) for axis, value in zip(self.axes, values, strict=True)]
        return np.asarray(np.logical_and.reduce(np.broadcast_arrays(*inside)))


#: Largest error of the punch's normalised fall g anywhere in the table, and of its ends, relative.
PUNCH_ERROR, ENDS_ERROR = 1e-4, 1e-9
#: Largest error of q, on the ramp times the part of P0 reached: of P/P0 it is less.
TIP_ERROR = 1.5e-3
#: Axes of the punch's falls, eps/(1 + eps) and nu, and of its ends: a/h as above, A44/A33 from incompressible to
#: nu = 0. What is left is 1e-10, at the widest contact.
PUNCH_AXES = (Axis(0.0, 0.8, 24), Axis(0.0, 0.48, 11))
ENDS_AXES = (Axis(0.0, 0.8, 36), Axis(0.0, 0.5, 16))
#: Axes of the paraboloid's q: eps/(1 + eps), nu and the logarithm of the ramp's duration.
TIP_AXES = (Axis(0.0, 2.0 / 3.0, 12), Axis(0.0, 0.48, 5), Axis(float(np.log(0.01)), float(np.log(3.0)), 7))
#: a0/h up to which it is read: the table reaches to 2, where its polynomials miss by 3.5e-3.
LARGEST_EPS = 1.0
#: Its times on the ramp and in the hold; the first of the latter over T, and the last over a0^2/c.
ON_RAMP, IN_HOLD, FIRST_LAG, LAST_LAG = 12, 40, 0.02, 10.0
#: The files, in which each drainage is an entry.
PUNCH_FILE, TIP_FILE = (Path(__file__).with_name(f"isotropic_{kind}.npz") for kind in ("punch", "tip"))


@dataclass(frozen=True)
class PunchTable:
    """Table of step responses of a flat punch on isotropic layers, by a/h and Poisson's ratio, for one drainage.

    Parameters
    ----------
    drainage : str
        How water leaves at the tip, one of `DRAINAGES`.
    time : FloatArray
        Times, (n,), in a^2/c, a the radius and c the diffusivity.
    table : ResponseTable
        Normalised falls g, by eps/(1 + eps), eps = a/h, and nu.
    compliances : ResponseTable
        Compliances 4 A44 a w/P of elastic layers, by eps/(1 + eps) and A44/A33.
    """

    drainage: str
    time: FloatArray
    table: ResponseTable
    compliances: ResponseTable

    def covers(self, eps: float | FloatArray, nu: float | FloatArray) -> NDArray[np.bool_]:
        """Whether a/h (`eps`) and Poisson's ratio `nu` are inside the table, for each set."""
        return self.table.covers((eps / (1.0 + eps), nu))

    def ends(self, eps: float | FloatArray, nu: float | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normalised stiffness P/(4 theta_d a w), undrained (just after a step) and drained, for each set.

        P force, w depth, a radius, theta_d half the drained indentation modulus; `eps` = a/h, h the thickness.
        """
        shape, softness = eps / (1.0 + eps), (0.5 - nu) / (1.0 - nu)
        start, end = ((1.0 - nu) / self.compliances.at((shape, share * softness)) for share in (0.0, 1.0))
        return start, end

    def __call__(self, eps: float | FloatArray, nu: float | FloatArray) -> Response:
        """Response of the force to a unit step of depth, P/(4 theta_d a), times in a^2/c; of one set or many.

        P force, a radius, theta_d half the drained indentation modulus, c diffusivity; `eps` = a/h, h thickness.

        Raises
        ------
        InputError
            If a/h (`eps`) or `nu` is outside the table.
        """
        fall = self.table.at((eps / (1.0 + eps), nu))
        start, end = self.ends(eps, nu)
        endless = not np.any(eps)
        if fall.ndim == 1:
            return Response(float(start), float(end), self.time, fall, endless)
        return Response(start[:, None], end[:, None], self.time, fall, endless)


def ramp_nodes() -> FloatArray:
    """Times on the ramp at which the table has values, over the ramp's duration; evenly spaced in their root."""
    return np.linspace(0.15, 1.0, ON_RAMP) ** 2


def hold_lags(ramp: float) -> FloatArray:
    """Times since the end of a ramp of duration `ramp` at which the table has values; both in a0^2/c."""
    return np.geomspace(FIRST_LAG * ramp, LAST_LAG, IN_HOLD)


@dataclass(frozen=True, eq=False)
class RampedTip:
    """Undrained share q of the force under one ramp and hold, interpolated in time.

    q = (P - P_drained)/(P_undrained - P_drained): force P, and the elastic forces at the present depth.

    Parameters
    ----------
    ramp : float
        Duration of the ramp, in a0^2/c: a0 the contact radius (module), c the diffusivity.
    kept : FloatArray
        Values of q at the table's times, (times,).
    """

    ramp: float
    kept: FloatArray

    @cached_property
    def _rising(self) -> CubicSpline:
        return CubicSpline(np.sqrt(ramp_nodes()), self.kept[:ON_RAMP])

    @cached_property
    def _holding(self) -> CubicSpline:
        """Spline of q over the logarithm of the time since the ramp's end, shifted to be finite at that end."""
        lags = np.concatenate(([0.0], hold_lags(self.ramp)))
        return CubicSpline(self._clock(lags), self.kept[ON_RAMP - 1 :])

    def _clock(self, lag: FloatArray) -> FloatArray:
        return np.asarray(np.log(np.sqrt(lag) + np.sqrt(FIRST_LAG * self.ramp)))

    def at(self, time: FloatArray) -> FloatArray:
        """Undrained share q of the force at times (a0^2/c) since the ramp began, at most 10 after its end."""
        found = np.ones(time.shape)
        rising, holding = (time > 0.0) & (time <= self.ramp), time > self.ramp
        found[rising] = self._rising(np.sqrt(time[rising] / self.ramp))
        found[holding] = self._holding(self._clock(time[holding] - self.ramp))
        return found


@dataclass(frozen=True)
class TipTable:
    """Table of ramps and holds of a paraboloid on isotropic layers, for one drainage.

    `table` holds q by eps/(1 + eps), eps = a0/h, by Poisson's ratio and by the logarithm of the ramp's duration.
    """

    drainage: str
    table: ResponseTable

    def covers(self, eps: float, nu: float, ramp: float, end: float) -> bool:
        """Whether the table holds a0/h (`eps`), Poisson's ratio `nu`, ramp duration and the hold's end.

        `ramp` and `end` in a0^2/c: a0 the undrained contact radius at the depth held, h thickness, c diffusivity.
        """
        inside = eps <= LARGEST_EPS and end - ramp <= LAST_LAG and ramp > 0.0
        return inside and bool(self.table.covers((eps / (1.0 + eps), nu, float(np.log(ramp)))))

    def __call__(self, eps: float, nu: float, ramp: float) -> RampedTip:
        """Interpolate at a0/h (`eps`, contact radius over thickness), Poisson's ratio and ramp duration (a0^2/c).

        Raises
        ------
        InputError
            If one of them is outside the table.
        """
        return RampedTip(ramp, self.table.at((eps / (1.0 + eps), nu, float(np.log(ramp)))))


@cache
def shipped_punch(drainage: str) -> PunchTable:
    """Load the table of a flat punch for a `drainage` of "solid" (impervious tip) or "porous"."""
    with np.load(PUNCH_FILE, allow_pickle=False) as stored:
        time, fall, ends = (read_only(stored[name]) for name in ("time", drainage, "ends"))
    return PunchTable(drainage, time, ResponseTable(PUNCH_AXES, fall), ResponseTable(ENDS_AXES, ends))


@cache
def shipped_tip(drainage: str) -> TipTable:
    """Load the table of a paraboloid for a `drainage` of "solid" (impervious tip) or "porous"."""
    with np.load(TIP_FILE, allow_pickle=False) as stored:
        return TipTable(drainage, ResponseTable(TIP_AXES, read_only(stored[drainage])))
