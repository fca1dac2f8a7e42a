"""The flat punch on a layer at many contact radii: the one solution that serves every indenter.

With contact radius a, thickness h, eps = a/h, x = r/a, depth w, force P, theta the layer's elastic constant and
K(s, t) = int_0^inf [1 - L(u)] cos(su) cos(tu) du, the contact problem of a shape with the half-space depth H is

    f(x) = w - H(ax) + (2 eps/pi) int_0^1 K(eps x, eps y) f(y) dy,   f(1) = 0,   P = 4 theta a int_0^1 f dx.

The operator is self-adjoint and does not know the shape. Let g solve it with right-hand side 1 (the flat
punch) and rho with right-hand side (2 eps/pi) K(eps, eps x), the row of the resolvent at the edge. For every
shape with half-space depth function H,

    f_H(1) = H(a) + int rho H dx,   g(1) = 1 + int rho dx,   w = f_H(1)/g(1),
    P = 4 theta a [w int g dx - int H(ax) g dx],   dP/dw = 4 theta a int g dx = 4 theta a kappa_inf(eps).

A step of 1 - L(u), from one body to another beside it, moves the force at fixed depth by

    dP = 4 theta a (2 eps/pi) int_0^inf d[1 - L(u)] g^(u) f^(u) du,   v^(u) = int_0^1 v(x) cos(eps u x) dx:

the contact radius moves too, but P is stationary in it where f(1) = 0, and the operator is self-adjoint. Where the
contact grows by da, f grows by dw g and its zero moves to a + da: with lengths,

    g(1) dw/da = H'(a) + (H(a)/a) (2 eps^2/pi) int_0^inf [1 - L(u)] u sin(eps u) f^(u) du/H(a).

The kernel is smooth and even, so Nystrom's method on the positive half of a Gauss-Legendre rule converges
geometrically; it factorises over the wavenumbers u, so that a matrix product builds it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.exact.nodes import EvenRule, Resolution, even_rule
from underlay.mechanics.kernel import Kernel

# What a doubling may still change, of the relative error asked for; radii, over the largest, at which it is
# watched; and no more doublings than this: 64 times the nodes.
_SHARE_OF_DOUBLING = 0.3
_WATCHED = np.array([0.03, 0.3, 1.0])
_MOST_DOUBLINGS = 5
# Counts were fitted up to this a/h over the slowest decay. Beyond, where roots turn, they ask for too much: 0.5 of
# the radial nodes and 0.7 of the wavenumbers left 2e-6 and 1e-6 of six materials at 57 to 90, asked for 1e-6.
_WIDEST_FITTED, _LEANER_RADII, _LEANER_WAVES = 20.0, 0.6, 0.8
# Below this a doubling changes the solution by the rounding of its equations.
_ROUNDING = 2e-13


@dataclass(frozen=True)
class PunchGrid:
    """Contact radii, quadrature nodes and their cosines: the part of a solution that is the same on any body.

    Parameters
    ----------
    eps : ndarray (radii,)
        Contact radii over the layer's thickness.
    rule : EvenRule
        Nodes r/a and weights.
    u, strength : ndarray (wavenumbers,)
        Nodes in the wavenumber times the thickness, and their weights times 2/pi.
    waves : ndarray (radii, nodes and edge, wavenumbers)
        cos(eps x u), x = r/a. (Kept, since computing it is two thirds of the time of a solution.)
    turned : ndarray (radii, wavenumbers, nodes)
        `waves` without the edge, last two axes swapped and contiguous, for matrix products.
    """

    eps: FloatArray
    rule: EvenRule
    u: FloatArray
    strength: FloatArray
    waves: FloatArray
    turned: FloatArray

    @classmethod
    def of(cls, eps: FloatArray, resolution: Resolution) -> Self:
        """Place the nodes that `resolution` counts at contact radii over thickness `eps` (radii,)."""
        rule, (u, weights) = even_rule(resolution.radial), resolution.wavenumber_rule()
        waves = np.cos(np.multiply.outer(np.multiply.outer(eps, rule.with_edge), u))
        turned = np.ascontiguousarray(waves[:, : resolution.radial].transpose(0, 2, 1))
        return cls(eps, rule, u, (2.0 / np.pi) * weights, waves, turned)

    def solve(self, values: FloatArray, shape_weights: FloatArray | None = None) -> PunchSolution:
        """Solve the flat punch at all radii, on one body or on each of several.

        Parameters
        ----------
        values : ndarray (wavenumbers,) or (bodies, wavenumbers)
            1 - L of the bodies at the nodes `u`.
        shape_weights : ndarray, optional
            Weights of an indenter's shape, as `PunchSolution.depth_and_force` takes them. If given (for one body
            only), the result also has `in_kernel` and `bend`.
        """
        eps, rule, count = self.eps, self.rule, self.rule.nodes.size
        if values.ndim > 1:
            # Body by body: the waves of all, weighted, may not fit into memory.
            return PunchSolution.of_kernel(eps, rule, np.stack([self._kernel(one)[0] for one in values]))[0]
        kernel, spread = self._kernel(values)
        if shape_weights is None:
            return PunchSolution.of_kernel(eps, rule, kernel)[0]
        inside = self.waves[:, :count]
        shape_wave = _transform(np.broadcast_to(shape_weights, (eps.size, count)), inside)
        side = (inside @ (spread * shape_wave)[:, :, None])[:, :, 0]
        found, own = PunchSolution.of_kernel(eps, rule, kernel, side)
        # f = w g - f_H, and f_H is H and what was solved for.
        g_wave = _transform(found.g * rule.weights, inside)
        shape_wave += _transform(own * rule.weights, inside)
        f_wave = found.depth_and_force(shape_weights)[0][:, None] * g_wave - shape_wave
        slope = spread * eps[:, None] * self.u * np.sin(np.multiply.outer(eps, self.u))
        return replace(
            found,
            in_kernel=np.multiply.outer(eps, self.strength) * g_wave * f_wave,
            bend=(slope * f_wave).sum(axis=1),
        )

    def _kernel(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(2 eps/pi) K at the nodes, (radii, nodes and edge, nodes), on one body, and the weights of its sum.

        `values` are 1 - L at the nodes u; the weights of the sum over u, (radii, wavenumbers), are eps times
        `strength` times `values`.

        eps is a/h, contact radius over thickness. 1 - L(u) is the relative change of surface compliance by
        what is under the top layer, u the wavenumber times its thickness.
        """
        spread = np.multiply.outer(self.eps, self.strength * values)
        return (self.waves * spread[:, None, :]) @ self.turned, spread


@dataclass(frozen=True)
class PunchSolution:
    """Solution for the flat punch at contact radii eps = a/h, on one body or several.

    theta is the layer's elastic constant. Equation numbers are those of Argatov and Sabina.

    Parameters
    ----------
    eps : ndarray (radii,)
        Contact radii over the layer's thickness.
    rule : EvenRule
        Nodes r/a and weights.
    g, rho : ndarray (..., radii, nodes)
        At the nodes: the solution for a unit right-hand side, and the resolvent's row at the edge (module's head).
    kappa : ndarray (..., radii)
        kappa_inf(eps) = int_0^1 g dx, the flat punch's stiffness over that on a half-space (9.5).
    in_kernel : ndarray (radii, wavenumbers), optional
        d[P/(4 theta a H(a))]/d[1 - L(u)] at fixed depth, at the nodes in u, where a shape with half-space depth H
        was given.
    bend : ndarray (radii,)
        [g(1) dw/da - H'(a)] a/H(a), where a shape was given; else empty.
    """

    eps: FloatArray
    rule: EvenRule
    g: FloatArray
    rho: FloatArray
    kappa: FloatArray
    in_kernel: FloatArray | None = None
    bend: FloatArray = field(default_factory=lambda: np.empty(0))

    @classmethod
    def solve(
        cls, body: Kernel, eps: FloatArray, resolution: Resolution, shape_weights: FloatArray | None = None
    ) -> PunchSolution:
        """Solve on one body at radii `eps` = a/h (radii,) with the nodes of `resolution`; see `PunchGrid.solve`."""
        grid = PunchGrid.of(eps, resolution)
        return grid.solve(body.values(grid.u), shape_weights)

    @classmethod
    def of_kernel(
        cls, eps: FloatArray, rule: EvenRule, kernel: FloatArray, side: FloatArray | None = None
    ) -> tuple[Self, FloatArray]:
        """Solve the discretised equation with kernel (2 eps/pi) K, (..., radii, nodes and edge, nodes).

        Returns the solution for the punch and, (..., radii, nodes), that for the further right-hand side `side` at
        the nodes (meaningless without one).

        eps is a/h, contact radius over thickness.
        """
        count = rule.nodes.size
        matrix = kernel[..., :count, :] * -rule.weights
        matrix.reshape(-1, count * count)[:, :: count + 1] += 1.0
        sides = np.ones((*matrix.shape[:-1], 2 if side is None else 3))
        sides[..., 1] = kernel[..., count, :]
        if side is not None:
            sides[..., 2] = side
        solved: FloatArray = np.asarray(np.linalg.solve(matrix, sides), dtype=np.float64)
        g = solved[..., 0]
        return cls(eps=eps, rule=rule, g=g, rho=solved[..., 1], kappa=g @ rule.weights), solved[..., -1]

    def depth_and_force(self, shape_weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth and force of an indenter with half-space depth H: w/H(a) and P/(4 theta a H(a)), each (..., radii).

        theta is the layer's elastic constant.

        Parameters
        ----------
        shape_weights : ndarray (nodes,) or (radii, nodes)
            Weights v with sum v_i p(x_i) = int_0^1 H(a x)/H(a) p(x) dx for smooth even p.
        """
        edge = 1.0 + self.rho @ self.rule.weights
        if shape_weights.ndim == 1:
            rho_shape, g_shape = self.rho @ shape_weights, self.g @ shape_weights
        else:
            rho_shape = (self.rho * shape_weights).sum(axis=-1)
            g_shape = (self.g * shape_weights).sum(axis=-1)
        depth = (1.0 + rho_shape) / edge
        return depth, depth * self.kappa - g_shape


def _transform(weighted: FloatArray, waves: FloatArray) -> FloatArray:
    """Integrals v^(u) = int_0^1 v(x) cos(eps u x) dx, (radii, wavenumbers).

    `weighted` is v at the nodes x times the quadrature weights, (radii, nodes).

    eps is a/h, contact radius over thickness.
    """
    return np.asarray((weighted[:, None, :] @ waves)[:, 0])


def proved_resolution(body: Kernel, eps: float, rtol: float) -> Resolution:
    """Node counts for contact radii up to `eps` = a/h at relative error `rtol`.

    The fitted counts hold for one layer on a base and are taken as they are; for any other body they are a first
    guess, and doubled until depth and force of a flat punch and of a paraboloid no longer change.

    Raises
    ------
    RangeError
        If they still change after the last doubling.
    """
    resolution = Resolution.choose(body.scales, eps, rtol)
    if body.scales.charted:
        return resolution
    much = eps > _WIDEST_FITTED * body.scales.decay
    if much:
        rtol *= 0.1
        resolution = Resolution.choose(body.scales, eps, rtol).scaled(_LEANER_RADII, _LEANER_WAVES)
    allowed = max(_SHARE_OF_DOUBLING * rtol, _ROUNDING)
    for _ in range(_MOST_DOUBLINGS):
        finer = resolution.finer(0.5 if much else 1.0)
        values, proof = _watched(body, eps, resolution, finer)
        change = float(np.abs(values / proof - 1.0).max())
        if change <= allowed:
            return resolution
        resolution = finer
    raise RangeError(
        f"the contact on this body does not settle: with {resolution.wavenumbers} wavenumbers it still changes by "
        f"{change:.1g}, and {allowed:.1g} is allowed; ask for a larger rtol, or leave out what is far stiffer or "
        "softer than the rest"
    )


def _watched(body: Kernel, eps: float, *resolutions: Resolution) -> list[FloatArray]:
    """kappa, depth and force of a paraboloid's contacts, (3, radii), at each of some node counts.

    One call of the kernel for all of them: for so few nodes calls cost more than arithmetic.
    """
    grids = [PunchGrid.of(eps * _WATCHED, resolution) for resolution in resolutions]
    values = np.split(
        body.values(np.concatenate([grid.u for grid in grids])),
        np.cumsum([grid.u.size for grid in grids[:-1]]),
    )
    found = []
    for grid, own in zip(grids, values, strict=True):
        punch = grid.solve(own)
        found.append(np.stack([punch.kappa, *punch.depth_and_force(grid.rule.power_weights(2.0))]))
    return found
