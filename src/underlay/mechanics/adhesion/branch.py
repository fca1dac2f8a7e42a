"""Every equilibrium of a contact that sticks, with its radius as the variable, and the stable ones of them.

A model of adhesion says depth and force of a contact of given radius, `AdhesiveBranch.at`. Which of these
contacts are there depends on what is held: the depth (a branch ends at dw/da = 0), the load (dP/da = 0), or the
far end of a spring, a cantilever of stiffness k (dP/da + k dw/da = 0).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.adhesion.stable_path import StablePath, stable_path

__all__ = ["AdhesiveBranch", "BranchPoint"]

# Points of the search for minima, per decade of the radius.
_PER_DECADE = 60


class BranchPoint(NamedTuple):
    """States of given contact radii, each (n,): w (m), P (N), dw/da (dimensionless), dP/da (N/m)."""

    depth: FloatArray
    force: FloatArray
    depth_slope: FloatArray
    force_slope: FloatArray


class AdhesiveBranch(ABC):
    """Equilibria from the radius `start` to `end` (m).

    A concrete class also holds `reference` (m), the radius at which the depth is zero on a half-space: the scale
    of the contact; and `nodes`, the radial nodes of the solution behind it, where there is one.
    """

    start: float
    end: float
    reference: float
    nodes: int | None

    @abstractmethod
    def at(self, radius: FloatArray) -> BranchPoint:
        """States at radii (m), (n,)."""

    def work_slope(self, radius: FloatArray, radius_slope: FloatArray) -> FloatArray | None:
        """dP/d ln(work) (N) at fixed depth, (n,), at radii a (m) with da/dw; None: a caller takes differences."""
        del radius, radius_slope
        return None

    @cached_property
    def force_scale(self) -> float:
        """Size of the force (N) at the reference radius."""
        return abs(float(self.at(np.array([self.reference])).force[0]))

    def path(self, compliance: float, rtol: float) -> StablePath:
        """Stable states behind a spring of this compliance (m/N): 0 for a given depth, inf for a given load.

        The path's variable is the travel w + C P (m) of the spring's other end; the force (N) for a given load.
        Next to ln a it holds arcsinh(P/scale).
        """
        count = 2 + int(_PER_DECADE * np.log10(self.end / self.start))
        grid = np.geomspace(self.start, self.end, count)
        grid[0], grid[-1] = self.start, self.end

        def curve(radius: FloatArray) -> tuple[FloatArray, FloatArray]:
            here = self.at(radius)
            if compliance == np.inf:
                return here.force, here.force_slope
            travel = here.depth + compliance * here.force
            return travel, here.depth_slope + compliance * here.force_slope

        def column(radius: FloatArray) -> FloatArray:
            return np.asarray(np.arcsinh(self.at(radius).force / self.force_scale)[:, None])

        return stable_path(curve, grid, column, rtol)
