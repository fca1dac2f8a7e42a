"""A rounded tip on a biphasic layer: the contact moves, and remembers where it has been.

Pressures are expanded on the *present* disc (see `galerkin`), the past acts by convolution quadrature
(`StepWeights`), and the radius of each step is the one at which the edge has no singularity. Steps need no search
over nodes, and no shortcut holds: the kernel ages with the radius, so neither Ting's argument nor a superposed
step response does.

Lengths in any one unit l, times in l^2/c, forces in A44 l^2. Error of the force over the undrained one at the
deepest point, a linear ramp of n steps: 2e-4 (20), 1e-4 (40), of order 1.5. A sudden step of depth is smeared
over the first step: index i then means t = (i + 1/2) dt.

Convolution quadrature: what the earlier steps of a moving contact still do, from the kernel's transform.

Of a function f at even steps of time and a kernel of Laplace transform c, (c * f)(t_n) = sum_j omega_(n-j) f_j,
with omega_m the coefficients in z of c(delta(z)/dt), delta(z) = (1-z) + (1-z)^2/2 (Lubich 1988, doi
10.1007/BF01398686; BDF2), by one FFT on a circle of radius rho, rho^L = 1e-10, L its length and dt the step.
`StepWeights` are the omega_m of the surface kernel; `Steps` and `Past` sum settlement and flux of the surface,
at every wavenumber.

A history of a rounded tip in steps of time: how fine, how far, and what lies between the steps.

Steps of even length resolve the shortest ramp; once the last ramp is over, levels of ever longer steps go on
through the hold, each from the beginning again: what is left of the ramp's details by then is below the error
of the steps. Each level is solved with half as many steps besides (Richardson; order 1.5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from underlay._arrays import FloatArray
from underlay.errors import InputError, RangeError
from underlay.mechanics.biphasic.history import Polyline
from underlay.mechanics.biphasic.material import ComplexArray, Skeleton
from underlay.mechanics.biphasic.surface import Sampled, SurfaceKernel, WavenumberRule, spherical_bessel
from underlay.mechanics.biphasic.transfer import ShapeRule, as_drainage, edge_signs, galerkin, operational
from underlay.mechanics.relaxation import Modes

#: delta(0): the Laplace variable of the present step is this over dt.
FIRST_RATE = 1.5
# rho^L: wrap-around is below it, rounding is the machine's over it.
_WRAPPED = 1e-10


@dataclass(frozen=True, eq=False)
class StepWeights:
    """Convolution-quadrature weights omega_m of the surface kernel, for even steps of time (module).

    Parameters
    ----------
    kernel : SurfaceKernel
        Surface kernel c(xi, s), xi the wavenumber and s the Laplace variable.
    xi : FloatArray
        Wavenumbers, (nodes,).
    step : float
        Time step dt, in l^2/c: l the unit of length, c the diffusivity.
    count : int
        Number of steps.
    sealed : bool, default False
        Whether no water passes the surface, as in `SurfaceKernel.matrix`.
    modes : Modes or None
        Relaxation of the skeleton, times in l^2/c.
    """

    kernel: SurfaceKernel
    xi: FloatArray
    step: float
    count: int
    sealed: bool = False
    modes: Modes | None = None

    @cached_property
    def _circle(self) -> tuple[int, float, ComplexArray]:
        """Length and radius of the discrete Fourier transform, and the Laplace variables on half of its circle."""
        length = 1 << int(np.ceil(np.log2(2 * (self.count + 1))))
        radius = float(_WRAPPED ** (1.0 / length))
        z = radius * np.exp(-2j * np.pi * np.arange(length // 2 + 1) / length)
        return length, radius, ((1.0 - z) + 0.5 * (1.0 - z) ** 2) / self.step

    def _coefficients(self, values: ComplexArray) -> FloatArray:
        """Power-series coefficients 0 ... count - 1, (count, ...), from values on the half circle, (half, ...)."""
        length, radius, _ = self._circle
        found = np.fft.irfft(values, length, axis=0)[: self.count]
        return np.asarray(found / (radius ** np.arange(self.count)).reshape(-1, *[1] * (values.ndim - 1)))

    @cached_property
    def kernels(self) -> FloatArray:
        """Weights omega_m(xi) of the 2 by 2 surface kernel, (count, nodes, 2, 2)."""
        s = self._circle[2]
        left = np.ones_like(s) if self.modes is None else operational(self.modes, s)
        scaled = s / left * self.kernel.skeleton.A33
        sampled = Sampled(self.xi, self.kernel.thickness)
        xi = sampled.places(self.xi.size)
        values = self.kernel.matrix(np.tile(xi, s.size), np.repeat(scaled, xi.size), sealed=self.sealed)
        values = values.reshape(s.size, xi.size, 2, 2)
        values[:, :, 0] /= left[:, None, None]
        return np.asarray(sampled.read(self._coefficients(values), self.xi.size), dtype=np.float64)

    @cached_property
    def tails(self) -> FloatArray:
        """Weights omega_m, (count,), of theta xi c11 at large wavenumbers xi: 1, 0, 0, ... unless it relaxes.

        There c11, the settlement under pressure, is 1/(theta xi e*(s)), e* the relaxation of the skeleton.
        """
        if self.modes is None:
            return np.asarray(np.eye(1, self.count)[0])
        return self._coefficients(1.0 / operational(self.modes, self._circle[2]))


@dataclass(frozen=True, eq=False)
class Past:
    """Settlement and flux of the surface in one step due to the pressures of the earlier steps.

    Parameters
    ----------
    settled : FloatArray
        Settlement due to earlier steps less its limit at large wavenumbers, (nodes,), by wavenumber.
    flow : FloatArray
        Flux due to earlier steps, (nodes,), by wavenumber.
    kept : FloatArray
        Weight of that limit for each earlier step, (steps,): `StepWeights.tails` over theta; zero where the
        skeleton does not relax.
    coefficients : FloatArray
        Coefficients alpha_n of the pressure in the earlier steps, (steps, terms).
    radii : FloatArray
        Their contact radii, (steps,); zero before contact.
    """

    settled: FloatArray
    flow: FloatArray
    kept: FloatArray
    coefficients: FloatArray
    radii: FloatArray

    def tail(self, radius: float) -> FloatArray:
        """Moments, (terms,), over the present contact of radius `radius` of the limit left out of `settled`.

        j_2n(xi a) is the cosine transform of (-1)^n P_2n(x/a)/a on (0, a), so that the integral over all xi of a
        product of two is pi/2 times that of the polynomials over the smaller disc: exact.
        """
        terms = self.coefficients.shape[1]
        touching = (self.kept != 0.0) & (self.radii > 0.0)
        if not touching.any():
            return np.zeros(terms)
        radii = self.radii[touching]
        y, w = np.polynomial.legendre.leggauss(2 * terms)
        end = np.minimum(radii, radius)
        x = 0.5 * end[:, None] * (y + 1.0)
        signs = edge_signs(terms)
        then = np.polynomial.legendre.legvander(x / radii[:, None], 2 * terms - 2)[..., ::2]
        now = np.polynomial.legendre.legvander(x / radius, 2 * terms - 2)[..., ::2]
        amount = np.einsum("jqn,jn->jq", then, signs * self.coefficients[touching])
        amount *= (self.kept[touching] * end / radii)[:, None] * (0.5 * w)
        return np.asarray(0.5 * np.pi / radius * signs * np.einsum("jqm,jq->m", now, amount))


class Steps:
    """Store of the time steps solved so far, from which the effect of the past on the next is summed.

    Parameters
    ----------
    weights : StepWeights
        Convolution weights.
    count, terms : int
        Number of steps, and of the pressures' coefficients.
    theta : float
        Drained elastic constant over A44 (half the indentation modulus).
    wet : bool
        Whether the tip is impervious, so that there is water pressure under it.
    """

    def __init__(self, weights: StepWeights, count: int, terms: int, theta: float, *, wet: bool) -> None:
        nodes = weights.xi.size
        self._weights, self._theta, self._wet = weights, theta, wet
        self._sigma, self._water = np.zeros((count, nodes)), np.zeros((count, nodes))
        self._coefficients, self._radii = np.zeros((count, terms)), np.zeros(count)

    @cached_property
    def _kernels(self) -> FloatArray:
        """Weights of the surface kernel, (2, 2, count, nodes), c11 without its limit at large wavenumbers."""
        found = np.ascontiguousarray(self._weights.kernels.transpose(2, 3, 0, 1))
        found[0, 0] -= self._weights.tails[:, None] / (self._theta * self._weights.xi)
        return found

    def before(self, index: int) -> Past:
        """Settlement and flux that the steps before step `index` (from 0) cause in that step."""
        then = slice(index, 0, -1)
        pairs = ((0, self._sigma), (1, self._water)) if self._wet else ((0, self._sigma),)
        both = [
            sum(np.einsum("mx,mx->x", self._kernels[row, column, then], of[:index]) for column, of in pairs)
            for row in ((0, 1) if self._wet else (0,))
        ]
        settled = np.asarray(both[0], dtype=np.float64)
        flow = np.asarray(both[1], dtype=np.float64) if self._wet else np.zeros_like(settled)
        kept = self._weights.tails[then] / self._theta
        return Past(settled, flow, kept, self._coefficients[:index], self._radii[:index])

    def add(
        self, index: int, sigma: FloatArray, water: FloatArray, coefficients: FloatArray, radius: float
    ) -> None:
        """Store step `index` (from 0).

        `sigma` and `water` are the Hankel transforms of total and water pressure, (nodes,); `coefficients` the
        alpha_n, (terms,); `radius` the contact radius.
        """
        self._sigma[index], self._water[index] = sigma, water
        self._coefficients[index], self._radii[index] = coefficients, radius


# A radius off by this share leaves 6e-8 of the force under a porous tip and 1e-5 under a solid one (the water's
# pressure follows the radius to first order); ten times less costs a quarter more solutions.
_RADIUS_TOLERANCE = 1e-4
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


# The longest step (l^2/c), and the order in the step.
_LONGEST_STEP, _ORDER = 0.02, 1.5
# Steps of a level, how much coarser the next one is, and the most steps of a history without levels.
_LEVEL_STEPS, _COARSER, _MOST_STEPS = 120, 4, 1600
# The last ramp must be over by this share of the first level.
_SETTLED = 0.25


def between_bends(
    bends: FloatArray, nodes: FloatArray, values: FloatArray, first: float | None, time: FloatArray
) -> FloatArray:
    """Interpolate values at nodes to times, (n,), by cubics in the square root of the time since the last bend.

    `bends` are the times at which the slope of the depth history changes: there the force begins as a series in
    that root. `first` is the value at the first bend, if it is known.
    """
    starts = np.unique(bends)
    found = np.ones(time.shape)  # before the first bend nothing is touched
    for low, high in zip(starts, np.append(starts[1:], np.inf), strict=True):
        mine = (nodes > low * (1.0 + 1e-12)) & (nodes <= high * (1.0 + 1e-9))
        x, y = np.sqrt(nodes[mine] - low), values[mine]
        if first is not None:
            x, y = np.append(0.0, x), np.append(first, y)
        first = float(y[-1]) if y.size else first
        if y.size < 2:  # a ramp within one step of a coarse level: times that a finer one has
            continue
        here = (time > low) & (time <= high * (1.0 + 1e-9))
        found[here] = CubicSpline(x, y)(np.sqrt(time[here] - low))
    return found


@dataclass(frozen=True, eq=False)
class Stepping:
    """Solution of one depth history of a rounded tip in time steps of growing length, in dimensionless units.

    Lengths in a unit l, times in l^2/c (c the diffusivity), forces in A44 l^2 (A44 the axial shear modulus).

    Parameters
    ----------
    skeleton : Skeleton
        Drained skeleton of the layer.
    thickness : float
        h/l; inf for a half-space.
    drainage : str
        One of `DRAINAGES`.
    modes : Modes or None
        Relaxation of the skeleton, times in l^2/c.
    surface : callable
        Shape Phi(r) of the tip: its height above its lowest point at radii r.
    undrained : callable
        Force and contact radius, (n,) each, of the undrained elastic law at depths, (n,).
    depth : Polyline
        The depth history, from time zero.
    steps : int
        Number of time steps of the shortest ramp.
    """

    skeleton: Skeleton
    thickness: float
    drainage: str
    modes: Modes | None
    surface: Callable[[FloatArray], FloatArray]
    undrained: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    depth: Polyline
    steps: int

    @cached_property
    def sudden(self) -> bool:
        """Whether the history is one sudden step and a hold; InputError for a step beside other rises."""
        times = self.depth.jumps[0]
        if times.size and (times.size > 1 or times[0] > 0.0 or self.depth.rises.size):
            raise InputError(
                f"a sudden step at {times[-1]:.3g} a^2/c beside others is not simulated under a rounded tip: give "
                "each rise its duration"
            )
        return bool(times.size)

    @property
    def first(self) -> float | None:
        """Force over the undrained force at the beginning: 1 after a sudden step, else None (not known)."""
        return 1.0 if self.sudden else None

    def until(self, end: float) -> tuple[FloatArray, FloatArray]:
        """Solve to time `end`, or the first ramp's end if later; times, and force over undrained force, (n,)."""
        moved = 0.0 if self.sudden else float(self.depth.bends[0][-1])
        step = end / _LEVEL_STEPS / _COARSER if self.sudden else self._ramp_step
        last = max(end, 0.0 if self.sudden else float(self.depth.bends[0][1]))
        counts = [int(np.ceil(last / step - 1e-9)) + 1]
        if counts[0] > _LEVEL_STEPS and moved <= _SETTLED * _LEVEL_STEPS * step:
            counts = self._levels(counts[0])
        if counts[0] > _MOST_STEPS:
            raise RangeError(
                f"this history needs {counts[0]} steps of time, its shortest rise in {self.steps}, and "
                f"{_MOST_STEPS} is the most that is solved under a rounded tip: take fewer rises at once"
            )
        times, ratios, reached = [], [], 0.0
        for level, count in enumerate(counts):
            dt = step * _COARSER**level
            time, ratio = self._extrapolated(dt, count)
            beyond = time > reached * (1.0 + 1e-9)
            times.append(time[beyond])
            ratios.append(ratio[beyond])
            reached = float(time[-1])
        return np.concatenate(times), np.concatenate(ratios)

    @property
    def _ramp_step(self) -> float:
        """Time step that divides the shortest rise into a whole number of steps."""
        shortest = float(self.depth.rises.min())
        return shortest / max(self.steps, 2 * int(np.ceil(0.5 * shortest / _LONGEST_STEP)))

    @staticmethod
    def _levels(count: int) -> list[int]:
        """Numbers of time steps on levels whose steps are each 4 times as long, in place of `count` fine ones."""
        counts = []
        while count > _LEVEL_STEPS:
            counts.append(_LEVEL_STEPS)
            count = count // _COARSER + 1
        return [*counts, count]

    def _extrapolated(self, step: float, count: int) -> tuple[FloatArray, FloatArray]:
        """Times and force over undrained force, (count,), by Richardson extrapolation from steps dt and 2 dt."""
        time, fine = self._stepped(step, count)
        later, coarse = self._stepped(2.0 * step, count // 2 + 1)
        bends = self.depth.time
        change = between_bends(bends, time, fine, self.first, later) - coarse
        correction = np.asarray(change / (2.0**_ORDER - 1.0), dtype=np.float64)
        none = 0.0 if self.sudden else None
        return time, fine + between_bends(bends, later, correction, none, time)

    def _stepped(self, step: float, count: int) -> tuple[FloatArray, FloatArray]:
        time = np.asarray(step * np.arange(1, count + 1), dtype=np.float64)
        depth = np.maximum(self.depth.at(time), 0.0)
        moving = MovingContact(self.skeleton, self.thickness, self.drainage, step, count, modes=self.modes)
        undrained, radius = self.undrained(depth)
        force = moving.run(depth, self.surface, radius).force
        touching = undrained > 0.0
        ratio = np.where(touching, force, 1.0) / np.where(touching, undrained, 1.0)
        return (time - 0.5 * step if self.sudden else time), ratio
