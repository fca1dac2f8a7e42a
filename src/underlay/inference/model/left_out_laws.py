"""What a law leaves out, where its sizes are numbers of the scene: at one set of numbers, or at many.

The force is P + s (P_stuck - P) + P (A e + B g). P and P_stuck are laws of the same numbers by two solvers, g the
measured function of both and the depth; e is that of depth over thickness and contact radius over tip radius. The
radius is that of the scene's own
ratios, seen through the sizes: where Poisson's ratio moves, e is off by less than a tenth of itself, and its size
is known to a half.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.inference.model.laws import LawSource
from underlay.inference.model.stencils import STENCILS, first_possible
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.discrepant_law import DiscrepantLaw
from underlay.mechanics.finite_strain import excess_of, further_of, require_measured
from underlay.mechanics.solver import Solver
from underlay.scene.discrepancy import BOTH_PATH, FINITE_STRAIN_PATH, FRICTION_PATH
from underlay.scene.parameters import kind_of
from underlay.scene.scene import Scene

__all__ = ["BuildsBare", "LeftOutLaws"]

# The contact radius is looked up as far as so many times the depth of the curve, and constant beyond.
_FURTHER = 4.0
# Relative (of a ratio: absolute) step of a difference of laws, each right to 1e-6.
_STEP = 1e-3


class BuildsBare(Protocol):
    """What gives laws without what they leave out: a `Forward`."""

    @property
    def laws(self) -> LawSource:
        """Where they come from."""

    def bare_law(self, values: Mapping[str, float], deepest: float) -> ContactLaw:
        """Law at `values` for depths up to `deepest` (m)."""

    def solved_by(self, solver: Solver) -> Self:
        """Return the same with laws of another solver."""


@dataclass(frozen=True)
class LeftOutLaws:
    """What the law of one scene leaves out.

    Parameters
    ----------
    values : mapping of path to float
        Every number of the scene (SI).
    deepest : float
        Depth (m) that the curve reaches.
    strains : bool
        Whether a size of what large strains add is not zero, or may vary.
    """

    values: Mapping[str, float]
    deepest: float
    strains: bool

    @classmethod
    def of(cls, scene: Scene, depth: FloatArray, free: Collection[str]) -> Self:
        """Prepare for depth readings (m), (n,), when the parameters at the paths `free` vary.

        Raises
        ------
        InputError
            If finite strain is of a size, or free, and its shape is not known there.
        """
        deepest = max(float(depth.max()) - scene.instrument.contact_depth, 0.0)
        values = scene.parameters
        strains = [path for path in (FINITE_STRAIN_PATH, BOTH_PATH) if values.get(path) or path in free]
        if strains:
            require_measured(scene.contact, deepest, strains[0])
        return cls(values, deepest, bool(strains))

    def law(self, forward: BuildsBare, values: Mapping[str, float], deepest: float) -> DiscrepantLaw:
        """Law at `values` for depths up to `deepest` (m)."""
        free = forward.bare_law(values, deepest)
        sticks = self.sticking(forward).bare_law(values, deepest)

        def excess(depth: FloatArray) -> FloatArray:
            return self.excess(forward, values, depth)

        def further(stuck: FloatArray, slides: FloatArray, depth: FloatArray) -> FloatArray:
            return self.further(values, stuck, slides, depth)

        sizes = (values[FRICTION_PATH], values[FINITE_STRAIN_PATH], values[BOTH_PATH])
        return DiscrepantLaw.of(free, sticks, sizes, excess, further)

    @staticmethod
    def sticking(forward: BuildsBare) -> BuildsBare:
        """Return the same contacts with a tip that sticks."""
        return forward.solved_by(forward.laws.solver.without_slip)

    def slope(
        self, forward: BuildsBare, path: str, values: Mapping[str, float], deepest: float, w: FloatArray
    ) -> FloatArray:
        """dP/dp (SI) of the parameter at `path` at fixed tip depths `w` (m), (n,)."""
        law = self.law(forward, values, deepest)
        if law.sticks is not None and path == FRICTION_PATH:
            return np.asarray(law.sticks.force(w) - law.free.force(w))
        if path == FINITE_STRAIN_PATH:
            return np.asarray(law.free.force(w) * law.excess(w))
        if law.sticks is not None and path == BOTH_PATH:
            slides = law.free.force(w)
            return np.asarray(slides * law.further(law.sticks.force(w), slides, w))
        size = _STEP if kind_of(path) == "dimensionless" else _STEP * abs(values[path])

        def force(steps: float) -> FloatArray:
            return self.law(forward, {**values, path: values[path] + steps * size}, deepest).force(w)

        return np.asarray(first_possible(force, STENCILS) / size)

    def excess(self, forward: BuildsBare, values: Mapping[str, Any], depth: FloatArray) -> FloatArray:
        """Return e at depths (m), (n,), or (sets, n) of numbers (sets, 1)."""
        if not self.strains:
            return np.zeros_like(depth)
        own = self.values
        tip, h = values["indenter.radius"], values.get("layer.thickness", np.inf)
        # Similar contacts: of one h^2/R on a layer, of one R on a half-space.
        layered = np.isfinite(own.get("layer.thickness", np.inf))
        length = h / own["layer.thickness"] if layered else tip / own["indenter.radius"]
        stretch = length**2 / (tip / own["indenter.radius"])
        law = self._known(forward)
        inside = np.clip(depth / stretch, 0.0, law.max_depth)
        return excess_of(values["layer.nu"], depth / h, length * law.contact_radius(inside) / tip)

    def further(
        self, values: Mapping[str, Any], sticks: FloatArray, free: FloatArray, depth: FloatArray
    ) -> FloatArray:
        """Return g at depths (m) with forces (N), each (n,), or (sets, n) of numbers (sets, 1)."""
        if not self.strains:
            return np.zeros_like(depth)
        return further_of(
            sticks, free, depth, values["indenter.radius"], values.get("layer.thickness", np.inf)
        )

    def _known(self, forward: BuildsBare) -> ContactLaw:
        """Law of the scene's own numbers, of one range whatever is asked."""
        deepest = max(_FURTHER * self.deepest, np.finfo(float).tiny)
        try:
            return forward.bare_law(self.values, deepest)
        except RangeError as error:
            return forward.bare_law(self.values, error.max_depth or self.deepest)
