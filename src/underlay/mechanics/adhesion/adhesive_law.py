"""The law of an adhesive tip: its equilibria by contact radius, and the stable part of them by depth.

A model of adhesion gives depth w and force P of a contact of given radius a, `AdhesiveBranch.at`. Which of these
equilibria are stable depends on what is controlled: the depth (a branch ends at dw/da = 0), the load (dP/da = 0),
or the far end of a spring, a cantilever of stiffness k (dP/da + k dw/da = 0). With y what is controlled (depth,
force, or travel of the spring's end), `stable_path` inverts y(a) to a(y), and `AdhesiveLaw` is force against depth
along it.

Pulled off slowly, a contact follows y(a) inwards from its widest until y has a minimum: from there it can only jump
to the next narrower contact at the same y, or come off. So the stable contact at y is the widest of those with y(a)
= y: the pieces of the curve at which y is below all that lies outside of them.

At the minimum y - y_end grows as (a - a_end)^2: in x = arcsinh(sqrt((y - y_end)/|y_end|)) the radius is smooth
and is interpolated by cubic splines.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from underlay._arrays import ArrayLike, FloatArray, as_finite, finite
from underlay.errors import InputError, RangeError
from underlay.mechanics.contact_law import ContactLaw, ContactState

#: Radii (m), (n,), to y, dy/da, and a further number that is to be interpolated too.
Curve: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
# Knots per unit of ln a, at a relative error of 1e-6: cubic splines of functions whose scale is one.
_DENSITY, _DENSITY_RTOL = 60.0, 1e-6
_FEWEST = 24
# Points of Chebyshev between two points of the grid, at which the slope there is asked, and the matrix from values
# at them to the coefficients of the polynomial, highest power first.
_NODES = np.cos(np.pi * (np.arange(10) + 0.5) / 10)
_TO_POWERS = np.linalg.inv(np.vander(_NODES))
# Points of the search for minima, per decade of the radius.
_PER_DECADE = 60
#: Which states a law takes: see `JKR`.
STATES = ("separating", "approaching", "cycle")
# Points of the equilibria that a picture draws.
_DRAWN = 600


class Jump(NamedTuple):
    """A jump, at the value `at` of y, from contact radius `outer` to `inner` (m); zero where the tip comes off.

    y is the variable of `stable_path`: depth, force or travel.
    """

    at: float
    outer: float
    inner: float


@dataclass(frozen=True)
class _Piece:
    """One stable piece: y from its minimum `end`, at contact radius `radius`, up to `top`.

    y is the controlled quantity: depth, force, or travel of the spring's far end.
    """

    end: float
    top: float
    radius: float
    scale: float
    spline: CubicSpline

    def place(self, y: FloatArray) -> FloatArray:
        return np.arcsinh(np.sqrt((y - self.end) / self.scale))

    def rate(self, x: FloatArray) -> FloatArray:
        """dy/dx, x the variable of the splines."""
        return np.asarray(self.scale * np.sinh(2.0 * x))


@dataclass(frozen=True)
class StablePath:
    """Stable contacts: ln a and a further number, interpolated in y in [`end`, `top`]; see `stable_path`.

    y is the controlled quantity: depth, force, or travel of the spring's far end.
    """

    pieces: tuple[_Piece, ...]
    jumps: tuple[Jump, ...]

    @property
    def end(self) -> float:
        """Smallest y at which there is contact.

        y is the controlled quantity: depth, force, or travel of the spring's far end.
        """
        return self.pieces[-1].end

    @property
    def end_radius(self) -> float:
        """Contact radius (m) at y = `end`.

        y is the controlled quantity: depth, force, or travel of the spring's far end.
        """
        return self.pieces[-1].radius

    @property
    def top(self) -> float:
        """Largest y of the path.

        y is the controlled quantity: depth, force, or travel of the spring's far end.
        """
        return self.pieces[0].top

    def radius(self, y: FloatArray) -> FloatArray:
        """Contact radius (m), (n,), at y (n,) in [`end`, `top`].

        y is the controlled quantity: depth, force, or travel of the spring's far end.
        """
        return np.asarray(np.exp(self.values(y)[0][:, 0]))

    def values(self, y: FloatArray, *, slopes: bool = False) -> tuple[FloatArray, FloatArray]:
        """ln a and the further number at y (n,), and their derivatives in y, each (n, 2).

        The derivatives are zero unless `slopes` is true.

        y is the controlled quantity: depth, force, or travel of the spring's far end.
        """
        found = np.empty((y.size, 2))
        slope = np.zeros_like(found)
        for number, piece in enumerate(self.pieces):
            here = slice(None) if len(self.pieces) == 1 else self._belongs(y, number)
            x = piece.place(y[here])
            found[here] = piece.spline(x)
            if slopes:
                slope[here] = piece.spline(x, 1) / piece.rate(x)[:, None]
        return found, slope

    def _belongs(self, y: FloatArray, number: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        piece, last = self.pieces[number], number == len(self.pieces) - 1
        return (y <= piece.top) & ((y > piece.end) | last)


def stable_path(curve: Curve, grid: FloatArray, rtol: float = 1e-6) -> StablePath:
    """Find the stable pieces of y(a) on `grid` and interpolate them; y is what is controlled (module's head).

    Parameters
    ----------
    curve : callable
        Radii (m), (n,), to y, dy/da, and a further number that is to be interpolated.
    grid : FloatArray
        Radii (m), increasing, fine enough to resolve every minimum of y; from the last inwards y must decrease.
    rtol : float
        Relative error of the interpolation.

    Raises
    ------
    RangeError
        If y has no minimum on `grid`.
    """
    y = curve(grid)[0]
    outside = np.append(np.minimum.accumulate(y[::-1])[::-1][1:], np.inf)
    stable = y < outside
    starts = np.flatnonzero(stable & ~np.concatenate(([False], stable[:-1])))[::-1]
    pieces, jumps = [], []
    upper, last = float(grid[-1]), grid.size - 1
    for start in starts:
        lower = _minimum(curve, grid, int(start))
        piece = _piece(curve, lower, upper, rtol)
        pieces.append(piece)
        last = int(start) - 1
        while last >= 0 and not stable[last]:
            last -= 1
        # The next piece begins where y has come down to the minimum again.
        upper = _crossing(curve, piece.end, grid[last], grid[last + 1]) if last >= 0 else 0.0
        jumps.append(Jump(piece.end, lower, upper))
    return StablePath(tuple(pieces), tuple(jumps))


def _piece(curve: Curve, lower: float, upper: float, rtol: float) -> _Piece:
    span = float(np.log(upper / lower))
    count = _FEWEST + int(span * _DENSITY * (_DENSITY_RTOL / rtol) ** 0.25)
    radius = lower * np.exp(np.linspace(0.0, span, count))
    radius[-1] = upper
    y, _, further = curve(radius)
    end = float(y[0])
    scale = abs(end) or float(y[-1] - end)
    x = np.arcsinh(np.sqrt((y - end) / scale))
    spline = CubicSpline(x, np.column_stack((np.log(radius), further)))
    return _Piece(end, float(y[-1]), lower, scale, spline)


def _minimum(curve: Curve, grid: FloatArray, start: int) -> float:
    """Radius (m) of the minimum of y near grid point `start`.

    y is the controlled quantity: depth, force, or travel of the spring's far end.
    """
    if start == 0:
        raise RangeError(
            f"the contact holds down to the smallest radius that is solved for, {grid[0]:.4g} m: it has no "
            "pull-off of its own, as with DMT; an attraction that reaches so far calls for DMT(work)"
        )
    # On a stretch this short the slope is a polynomial to rounding: one call in place of one for each step.
    low, high = np.log(grid[start - 1]), np.log(grid[min(start + 1, grid.size - 1)])
    slopes = curve(np.exp(low + 0.5 * (high - low) * (_NODES + 1.0)))[1]
    powers = (_TO_POWERS @ (slopes / np.abs(slopes).max())).tolist()

    def slope(at: float) -> float:
        return float(reduce(lambda total, power: total * at + power, powers))

    place = brentq(slope, -1.0, 1.0, xtol=1e-15, rtol=1e-14)
    return float(np.exp(low + 0.5 * (high - low) * (place + 1.0)))


def _crossing(curve: Curve, level: float, low: float, high: float) -> float:
    """Radius (m) between `low` and `high` at which y is `level`.

    y is the controlled quantity: depth, force, or travel of the spring's far end.
    """

    def excess(radius: float) -> float:
        return float(curve(np.array([radius]))[0][0]) - level

    return float(brentq(excess, low, high, xtol=1e-15 * high, rtol=1e-14))


class BranchPoint(NamedTuple):
    """Equilibria at given contact radii, each (n,): w (m), P (N), dw/da (dimensionless), dP/da (N/m)."""

    depth: FloatArray
    force: FloatArray
    depth_slope: FloatArray
    force_slope: FloatArray


class AdhesiveBranch(ABC):
    """Equilibria of an adhesive contact, stable or not, for contact radii from `start` to `end` (m).

    A concrete class also holds `reference` (m), the radius at which the depth is zero on a half-space: the scale
    of the contact; and `nodes`, the radial nodes of the solution behind it, where there is one.
    """

    start: float
    end: float
    reference: float
    nodes: int | None

    @abstractmethod
    def at(self, radius: FloatArray) -> BranchPoint:
        """Depth, force and their slopes at radii (m), (n,)."""

    def work_slope(self, radius: FloatArray) -> FloatArray | None:
        """dP/d ln(work of adhesion) (N) at fixed depth, at radii (m), (n,); None: use finite differences."""
        del radius
        return None

    @cached_property
    def force_scale(self) -> float:
        """Magnitude of the force (N) at the contact radius `reference`, by which forces are made dimensionless."""
        return abs(float(self.at(np.array([self.reference])).force[0]))

    def path(self, compliance: float, rtol: float) -> StablePath:
        """Stable states behind a spring of this compliance C (m/N): 0 for depth control, inf for load control.

        The path's variable is the travel w + C P (m) of the spring's other end; under load control the force (N).
        Next to ln a it holds arcsinh(P/scale), scale being `force_scale`.
        """
        span = float(np.log(self.end / self.start))
        grid = self.start * np.exp(np.linspace(0.0, span, 2 + int(_PER_DECADE * span / np.log(10.0))))
        grid[-1] = self.end

        def curve(radius: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            here = self.at(radius)
            further = np.arcsinh(here.force / self.force_scale)
            if compliance == np.inf:
                return here.force, here.force_slope, further
            travel = here.depth + compliance * here.force
            return travel, here.depth_slope + compliance * here.force_slope, further

        return stable_path(curve, grid, rtol)


def in_touch(states: str, travel: FloatArray, end: float | FloatArray) -> NDArray[np.bool_]:
    """Whether there is contact at travels (..., n), given in the order they are reached; it is lost at `end`.

    `states` is one of `STATES`.
    """
    if states == "approaching":
        return np.asarray(travel > 0.0)
    if states == "separating":
        return np.asarray(travel > end)
    # In between the last that happened counts: a touch at zero, or the loss at `end`.
    event = np.where(travel > 0.0, 1, np.where(travel <= end, -1, 0))
    last = np.maximum.accumulate(np.where(event != 0, np.arange(travel.shape[-1]), -1), axis=-1)
    return np.asarray((last >= 0) & (np.take_along_axis(event, np.maximum(last, 0), axis=-1) > 0))


@dataclass(frozen=True, kw_only=True)
class AdhesiveLaw(ContactLaw):
    """Law of a rounded or pointed adhesive tip; its domain begins at the pull-off.

    Parameters
    ----------
    branch : AdhesiveBranch
        All equilibria.
    path : StablePath
        Those that are stable under depth control.
    rtol : float
        Relative error of interpolations.
    states : str
        One of `STATES`: which of several states at one depth is taken (see `JKR`).
    """

    branch: AdhesiveBranch
    path: StablePath
    rtol: float
    states: str = "separating"

    # --- what adhesion adds ------------------------------------------------------------------------------

    @property
    def pull_off_force(self) -> float:
        """Largest tension (N, positive) that the contact bears under load control."""
        return -self.load_path.end

    @property
    def pull_off_depth(self) -> float:
        """Depth (m, mostly negative) at which the contact is lost under depth control."""
        return self.path.end

    @cached_property
    def zero_load_radius(self) -> float:
        """Contact radius (m) in equilibrium without load."""
        return float(self.load_path.radius(np.zeros(1))[0])

    @cached_property
    def load_path(self) -> StablePath:
        """States that are stable under load control, by force (N)."""
        return self.branch.path(np.inf, self.rtol)

    @property
    def jumps(self) -> tuple[Jump, ...]:
        """Depths (m) at which the contact radius jumps during withdrawal without being lost; mostly none."""
        return tuple(jump for jump in self.path.jumps if jump.inner)

    def pull_off(self, compliance: float = 0.0) -> ContactState:
        """State in which the tip comes off, behind a spring of `compliance` (m/N).

        Zero is depth control, inf load control.
        """
        path = self._behind(compliance)
        here = self.branch.at(np.array([path.end_radius]))
        return ContactState(float(here.depth[0]), float(here.force[0]), path.end_radius)

    def jump_in(self, compliance: float = 0.0) -> ContactState:
        """State (depth, force, radius) right after first contact, behind a spring of `compliance` (m/N)."""
        path = self._behind(compliance)
        radius = path.radius(np.zeros(1))
        here = self.branch.at(radius)
        return ContactState(float(here.depth[0]), float(here.force[0]), float(radius[0]))

    def jump_travels(self, compliance: float = 0.0) -> tuple[float, ...]:
        """Travels (m) at which the contact jumps, behind a spring of `compliance` (m/N).

        Several where a film folds, so that depth is not a single-valued function of radius.
        """
        touch, lost = (0.0,), tuple(jump.at for jump in self._behind(compliance).jumps)
        return {"approaching": touch, "separating": lost, "cycle": (*touch, *lost)}[self.states]

    def equilibria(self, max_depth: float) -> tuple[FloatArray, FloatArray]:
        """Depths (m) and forces (N), each (n,), of all equilibria up to `max_depth` (m), stable or not.

        From a tenth of the pull-off's contact radius outwards.
        """
        widest = float(self.path.radius(np.array([max_depth]))[0])
        narrowest = max(0.1 * self.path.end_radius, self.branch.start)
        radius = np.geomspace(narrowest, widest, _DRAWN)
        radius[0], radius[-1] = narrowest, widest  # to the last bit: beyond its ends a branch is not solved
        here = self.branch.at(radius)
        return here.depth, here.force

    def work_slope(self, depth: FloatArray) -> FloatArray | None:
        """dP/d ln(work of adhesion) (N) at fixed depths (m), (n,); zero without contact.

        None where the model does not provide it.
        """
        slope, here = np.zeros_like(depth), self._touching(depth)
        values, _ = self.path.values(depth[here], slopes=True)
        known = self.branch.work_slope(np.exp(values[:, 0]))
        if known is None:
            return None
        slope[here] = known
        return slope

    # --- what every law does -----------------------------------------------------------------------------

    @property
    def domain(self) -> tuple[float, float]:
        """Depths (m) of the law: from where contact is lost (zero for an approach) to `max_depth`."""
        return (0.0 if self.states == "approaching" else self.path.end), self.max_depth

    @property
    def nodes(self) -> int | None:
        """Number of radial nodes of the elastic solution; None on a half-space."""
        return self.branch.nodes

    def depth(self, force: ArrayLike) -> FloatArray:
        """Depth (m) at forces (N) under load control: that of the widest contact with this force.

        Raises
        ------
        InputError
            If a force is below the pull-off.
        RangeError
            If a force is beyond that at `max_depth`.
        """
        load = as_finite(force, "force")
        flat, path = np.atleast_1d(load).ravel(), self.load_path
        if (flat < path.end).any():
            raise InputError(
                f"no contact bears {flat.min():.6g} N: the tip comes off at {path.end:.6g} N when the load is given"
            )
        most = float(self.force(self.max_depth))
        if (flat > most * (1.0 + 1e-12)).any():
            raise RangeError(
                f"force {flat.max():.6g} N is beyond {most:.6g} N, the force at the largest depth that works "
                f"here, {self.max_depth:.6g} m: {self._beyond}",
                max_depth=self.max_depth,
            )
        depth: FloatArray = self.branch.at(path.radius(flat)).depth.reshape(load.shape)[()]
        return depth

    def tip_depth(self, travel: FloatArray, compliance: float) -> FloatArray:
        """Depth (m) behind a spring of this compliance (m/N) at travels (m), (n,); the travel if out of contact.

        A negative compliance is that of a cantilever which bends less than was subtracted from the readings.
        """
        path = self.branch.path(compliance, self.rtol) if compliance < 0.0 else self._behind(compliance)
        here = in_touch(self.states, travel, path.end)
        depth = np.array(travel, dtype=np.float64)
        if here.any():
            depth[here] = self.branch.at(path.radius(depth[here])).depth
        return depth

    _beyond: ClassVar[str] = "the law was solved up to there; ask for less depth, or build it for more"

    def _behind(self, compliance: float) -> StablePath:
        if compliance == 0.0:
            return self.path
        if compliance == np.inf:
            return self.load_path
        if not finite(compliance, "compliance", "m/N") > 0.0:
            raise InputError(f"compliance must be zero or more (m/N); got {compliance!r}")
        return self.branch.path(compliance, self.rtol)

    def _touching(self, depth: FloatArray) -> NDArray[np.bool_]:
        return in_touch(self.states, depth, self.path.end)

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.branch.force_scale * np.sinh(self.path.values(depth)[0][:, 1])

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.path.radius(depth)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return np.asarray(self._force_and_stiffness(depth)[1])

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        values, slopes = self.path.values(depth, slopes=True)
        scale = self.branch.force_scale
        return np.stack((scale * np.sinh(values[:, 1]), scale * np.cosh(values[:, 1]) * slopes[:, 1]))
