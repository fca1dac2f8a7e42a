"""A rounded tip on a biphasic layer: the contact moves, and remembers where it has been.

Pressures are expanded on the *present* disc (see `galerkin`), the past acts by convolution quadrature (`past`), and
the radius of each step is the one at which the edge has no singularity. Steps need no search over nodes, and
no shortcut holds: the kernel ages with the radius, so neither Ting's argument nor a superposed step response
does.

Lengths in any one unit l, times in l^2/c, forces in A44 l^2. Error of the force over the undrained one at the
deepest point, a linear ramp of n steps: 2e-4 (20), 1e-4 (40), of order 1.5. A sudden step of depth is smeared
over the first step: index i then means t = (i + 1/2) dt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.biphasic.equations import ShapeRule, as_drainage, edge_signs, galerkin
from underlay.mechanics.biphasic.material import Skeleton
from underlay.mechanics.biphasic.past import FIRST_RATE, Past, Steps, StepWeights
from underlay.mechanics.biphasic.surface import SurfaceKernel, WavenumberRule, spherical_bessel
from underlay.mechanics.relaxation import Modes

__all__ = [
    "MovedContact",
    "MovingContact",
]

# The force does not change to first order with the radius: 1e-5 in it is 1e-10 in the force.
_RADIUS_TOLERANCE = 1e-5
_MOST_TRIALS = 40
_FIRST_TRIAL = 1.01
# A trial moves the radius by no more than this factor.
_LONGEST = 1.6


class MovedContact(NamedTuple):
    """Forces (A44 l^2) and contact radii (l) at the time steps, (n,): A44 shear modulus, l unit of length."""

    force: FloatArray
    radius: FloatArray


class _State(NamedTuple):
    force: float
    edge: float
    coefficients: FloatArray
    sigma: FloatArray
    water: FloatArray


class _Asked(NamedTuple):
    depth: float
    surface: Callable[[FloatArray], FloatArray]
    past: Past


class _Freed(NamedTuple):
    state: _State
    radius: float
    slope: float


@dataclass(frozen=True, eq=False)
class MovingContact:
    """Contact of a rounded tip whose radius changes with time, solved at even steps of time (module).

    Parameters
    ----------
    skeleton : Skeleton
        Drained skeleton of the layer.
    thickness : float
        h/l, in the unit of length l; inf for a half-space.
    drainage : str
        One of `DRAINAGES`.
    step : float
        Time step dt, in l^2/c, c the diffusivity.
    count : int
        Number of steps.
    terms : int, default 6
        Number of terms of the expansion of the pressures.
    reach : float, default 8
        The largest wavenumber is reach sqrt(1.5/dt) + 45.
    modes : Modes or None
        Relaxation of the skeleton, times in l^2/c.
    """

    skeleton: Skeleton
    thickness: float
    drainage: str
    step: float
    count: int
    terms: int = 6
    reach: float = 8.0
    modes: Modes | None = None

    def __post_init__(self) -> None:
        as_drainage(self.drainage)

    @cached_property
    def rule(self) -> WavenumberRule:
        """Quadrature over wavenumbers, fine enough for contact radii up to 1.1 l, l the unit of length."""
        return WavenumberRule(self.reach * float(np.sqrt(FIRST_RATE / self.step)) + 45.0, width=2.0, points=6)

    @cached_property
    def weights(self) -> StepWeights:
        """Convolution weights by which earlier steps act on later ones."""
        kernel = SurfaceKernel(self.skeleton, self.thickness)
        sealed = self.drainage == "sealed"
        return StepWeights(kernel, self.rule.nodes, self.step, self.count, sealed, self.modes)

    @cached_property
    def _shape(self) -> ShapeRule:
        return ShapeRule(self.terms)

    @property
    def _wet(self) -> bool:
        return self.drainage == "solid"

    def _steps(self, count: int) -> Steps:
        return Steps(self.weights, count, self.terms, self.skeleton.theta_drained, wet=self._wet)

    def run(
        self, depth: FloatArray, surface: Callable[[FloatArray], FloatArray], guess: FloatArray
    ) -> MovedContact:
        """Solve for forces and contact radii under depths at times dt, 2 dt, ...

        Parameters
        ----------
        depth : FloatArray
            Depths (l) at these times, (n,), n up to `count`; zero or less means no contact yet.
        surface : callable
            Shape Phi(r) of the tip: its height (l) above its lowest point at radii r (l).
        guess : FloatArray
            Contact radii (l) of an elastic law at those depths, (n,), from which the search for the radius starts.

        Raises
        ------
        RangeError
            If at no radius the pressure is free of a singularity at the edge.
        """
        n = depth.size
        steps = self._steps(n)
        force, radius = np.zeros(n), np.zeros(n)
        ratios, slope = [1.0], None
        for i in map(int, np.flatnonzero(depth > 0.0)):
            asked = _Asked(float(depth[i]), surface, steps.before(i))
            # The ratio to the elastic radius goes on as it went.
            expected = 2.0 * ratios[-1] - ratios[-2] if len(ratios) > 2 else ratios[-1]
            found, radius[i], slope = self._freed(i, asked, expected * float(guess[i]), slope)
            ratios.append(radius[i] / guess[i])
            force[i] = found.force
            steps.add(i, found.sigma, found.water, found.coefficients, float(radius[i]))
        return MovedContact(force, radius)

    def fixed(self, depth: FloatArray, radius: float) -> FloatArray:
        """Forces (n,) of a flat punch of this radius under depths at dt, 2 dt, ..., to check the quadrature."""
        steps, force = self._steps(depth.size), np.zeros(depth.size)
        for i, w in enumerate(depth):
            found = self._solved(radius, _Asked(float(w), np.zeros_like, steps.before(i)))
            force[i] = found.force
            steps.add(i, found.sigma, found.water, found.coefficients, radius)
        return force

    def _freed(self, index: int, asked: _Asked, guess: float, slope: float | None) -> _Freed:
        """Find the contact radius at which the edge singularity vanishes, by the secant method.

        `guess` is the first radius, `slope` that of the singularity in the radius at the step before, if known.
        """
        now, state = guess, self._solved(guess, asked)
        for _ in range(_MOST_TRIALS):
            trial = now * _FIRST_TRIAL if slope is None else _held_back(now, now - state.edge / slope)
            if slope is not None and abs(trial - now) <= _RADIUS_TOLERANCE * now:
                return _Freed(state, now, slope)
            found = self._solved(trial, asked)
            slope = (found.edge - state.edge) / (trial - now)
            if slope == 0.0:
                break
            now, state = trial, found
        raise RangeError(
            f"no contact radius frees the edge at step {index + 1}: the contact opens or jumps there, which is not "
            "simulated for a draining layer"
        )

    def _solved(self, radius: float, asked: _Asked) -> _State:
        depth, surface, past = asked
        rule, terms = self.rule, self.terms
        values = spherical_bessel(2 * terms, rule.nodes * radius)
        even, odd = values[0::2], values[1::2]
        matrix = galerkin(
            self.weights.kernels[0],
            rule.nodes,
            rule.weights,
            even,
            odd if self._wet else None,
            self.skeleton,
            radius,
            float(self.weights.tails[0]),
        )
        right = -self._shape.moments(surface, radius) - (even * (rule.weights * rule.nodes)) @ past.settled
        right -= past.tail(radius)
        right[0] += depth
        if self._wet:
            right = np.concatenate((right, -(odd * rule.weights) @ past.flow))
        found = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        alpha = found[:terms]
        water: FloatArray = (found[terms:] @ odd) / rule.nodes if self._wet else np.zeros_like(rule.nodes)
        return _State(
            2.0 * np.pi * float(alpha[0]), float(edge_signs(terms) @ alpha), alpha, alpha @ even, water
        )


def _held_back(before: float, trial: float) -> float:
    """Limit a trial radius to within a factor of 1.6 of the radius `before`."""
    return min(max(trial, before / _LONGEST), before * _LONGEST)
