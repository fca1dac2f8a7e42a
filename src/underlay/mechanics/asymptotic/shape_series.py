"""The asymptotic curve of any convex axisymmetric indenter, from H and its two moments.

Parametric form: (4.14), (4.15); the errata behind them: (4.5) has + P_2 a_1/h^2, and (4.12) follows by
substituting (4.10).

The compliance form for any shape. dP/dw = 4 theta a kappa_inf holds exactly, 1/kappa_inf is 1 - b eps -
c eps^3 + O(eps^5), and (4.13) gives a(P); integrating dw = dP (1 - b eps - c eps^3)/(4 theta a) with the
half-space radius s as parameter, N(s) = s H(s) - int_0^s H, b = 2 a_0/pi and c = 8 a_1/(3 pi):

    P = 4 theta N,
    w = H - (b/h) N - (c/h^3) [s^3 H - (s^2/2) int_0^s H - (3/2) int_0^s H r^2 dr],
    a = s + (c/h^3) s^2 N / H'.

It is England's expansion (6.10), (6.11) for a sphere and (8.4), (8.5) for a power law. The a_0 term is exact
in it (a shift of the surface proportional to the force), which is why it stays good on soft substrates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import optimize

from underlay._arrays import FloatArray
from underlay.mechanics.asymptotic.series import ContactSeries
from underlay.mechanics.indenters import Indenter

__all__ = ["ShapeSeries"]


@dataclass(frozen=True)
class ShapeSeries(ContactSeries):
    """The parametric or compliance curve of any shape; b and c are zero where the order drops them.

    Parameters
    ----------
    shape : Indenter
        Its shape.
    theta, thickness : float
        Elastic constant (Pa) and thickness h (m) of the layer.
    b, c, cross : float
        2 a_0/pi, 8 a_1/(3 pi), and their product where the fourth order keeps it, else 0.
    by_force : bool
        Compliance form if true, parametric if false.
    """

    shape: Indenter
    theta: float
    thickness: float
    b: float
    c: float
    cross: float
    by_force: bool

    @property
    def is_explicit(self) -> bool:
        """No layer effect kept: s is the half-space radius."""
        return self.b == 0.0 and self.c == 0.0

    @cached_property
    def end(self) -> float:
        """First zero of dw/ds or dP/ds, by repeated division of the step in which the first one lies."""
        last = self.shape.max_radius
        if self.is_explicit:
            return last
        # w and P turn, if at all, where a correction of order b eps or c eps^3 reaches one.
        reach = min(last, self.thickness * 8.0 * max(1.0, 1.0 / max(abs(self.b), abs(self.c))))
        grid = reach * np.geomspace(1e-4, 1.0, _STEPS + 1)
        low = 0.0
        for _ in range(_DIVISIONS):
            falling = self._least_rate(grid) <= 0.0
            if not falling.any():
                return last
            first = int(np.argmax(falling))
            low = float(grid[first - 1]) if first else low
            grid = np.linspace(low, float(grid[first]), _STEPS + 1)[1:]
        return low

    @cached_property
    def radius_end(self) -> float:
        """Where the expanded contact radius of the compliance form stops increasing, or passes the shape's end."""
        last, widest = self.end, self.shape.max_radius
        if not self.by_force or self.c == 0.0:
            return last
        if self.c > 0.0:
            if not np.isfinite(widest) or self.radius(np.array([last]))[0] <= widest:
                return last
            inside = widest * np.finfo(float).eps
            return float(
                optimize.brentq(lambda s: float(self.radius(np.array([s]))[0]) - widest, inside, last)
            )
        grid = min(last, 8.0 * self.thickness) * np.geomspace(1e-4, 1.0, _STEPS)
        radius = self.radius(grid)
        if (np.diff(radius) > 0.0).all():
            return last
        top = int(np.argmax(np.diff(radius) <= 0.0))
        found = optimize.minimize_scalar(
            lambda s: -float(self.radius(np.array([s]))[0]),
            bounds=(grid[max(top - 1, 0)], grid[min(top + 2, _STEPS - 1)]),
            method="bounded",
            options={"xatol": 1e-10 * self.thickness},
        )
        return float(found.x)

    def start(self, depth: FloatArray) -> FloatArray:
        """The half-space radius; over a soft base the depth may pass the half-space's last one."""
        last = self.shape.abel(np.array(self.shape.max_radius))
        return self.shape.halfspace_radius(np.minimum(depth, last))

    def depth(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(4.15), or the compliance form of the module's docstring."""
        h, b, c = self.thickness, self.b, self.c
        H, slope = self.shape.abel(s), self.shape.abel_slope(s)
        first, second = self.shape.abel_moments(s)
        N = s * H - first
        if self.by_force:
            third = s**3 * H - 0.5 * s**2 * first - 1.5 * second
            third_slope = s**3 * slope + s * N
            return (
                H - b / h * N - c / h**3 * third,
                slope - b / h * s * slope - c / h**3 * third_slope,
            )
        third = 0.5 * s**3 * H - 1.5 * second + 1.5 * s**2 * N
        third_slope = 2.0 * s**3 * slope + 3.0 * s * N
        return (
            H - b / h * N - c / h**3 * third + self.cross / h**4 * s**3 * N,
            slope
            - b / h * s * slope
            - c / h**3 * third_slope
            + self.cross / h**4 * (3.0 * s**2 * N + s**4 * slope),
        )

    def force(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(4.14), or the half-space force (3.2)."""
        H, slope = self.shape.abel(s), self.shape.abel_slope(s)
        N = s * H - self.shape.abel_moments(s)[0]
        if self.by_force:
            return 4.0 * self.theta * N, 4.0 * self.theta * s * slope
        factor = 1.0 - self.c * (s / self.thickness) ** 3
        return (
            4.0 * self.theta * factor * N,
            4.0 * self.theta * (factor * s * slope - 3.0 * self.c * s**2 / self.thickness**3 * N),
        )

    def radius(self, s: FloatArray) -> FloatArray:
        """The parameter itself, or a = s + (c/h^3) s^2 N/H'."""
        if not self.by_force or self.c == 0.0:
            return s
        N = s * self.shape.abel(s) - self.shape.abel_moments(s)[0]
        return s + self.c / self.thickness**3 * s**2 * N / self.shape.abel_slope(s)

    def _least_rate(self, s: FloatArray) -> FloatArray:
        """The smaller of dw/ds and dP/ds, each over its half-space value."""
        slope = self.shape.abel_slope(s)
        depth_rate = self.depth(s)[1] / slope
        if self.by_force:
            return depth_rate
        return np.minimum(depth_rate, self.force(s)[1] / (4.0 * self.theta * s * slope))


# Neighbours of the first grid are 11 % apart, closer than two turning points can be; six divisions of a step
# leave 2e-13 of s.
_STEPS = 88
_DIVISIONS = 7
