"""The flat punch on the layer at many contact radii: the one solution that serves every indenter.

With eps = a/h, x = r/a and K(s, t) = int_0^inf [1 - L(u)] cos(su) cos(tu) du, the contact problem is

    f(x) = w - H(ax) + (2 eps/pi) int_0^1 K(eps x, eps y) f(y) dy,   f(1) = 0,   P = 4 theta a int_0^1 f dx.

The operator is self-adjoint and does not know the shape. Let g solve it with right-hand side 1 (the flat
punch) and rho with right-hand side (2 eps/pi) K(eps, eps x), the row of the resolvent at the edge. For every
shape with half-space depth function H,

    f_H(1) = H(a) + int rho H dx,   g(1) = 1 + int rho dx,   w = f_H(1)/g(1),
    P = 4 theta a [w int g dx - int H(ax) g dx],   dP/dw = 4 theta a int g dx = 4 theta a kappa_inf(eps).

The kernel is smooth and even, so Nystrom's method on the positive half of a Gauss-Legendre rule converges
geometrically; it factorises over the wavenumbers u, so that a matrix product builds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log, log1p
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.gauss import even_rule, legendre_rule
from underlay.mechanics.kernel import one_minus_L
from underlay.mechanics.materials import PlaneConstants

__all__ = ["PunchSolution", "Resolution", "slowest_decay", "stiffness_ratio"]


def slowest_decay(layer: PlaneConstants) -> float:
    """Smallest decay rate of the layer's displacements with depth: 1 when isotropic."""
    half = 0.5 * layer.sigma
    square = half * half - layer.p
    return float(np.min(np.where(square > 0.0, layer.p / (half + np.sqrt(np.abs(square))), half)))


def stiffness_ratio(layer: PlaneConstants, substrate: PlaneConstants | None) -> float:
    """theta of the substrate over theta of the layer; inf when rigid; the smallest of a batch."""
    return np.inf if substrate is None else float(np.min(substrate.theta / layer.theta))


@dataclass(frozen=True)
class Resolution:
    """How many nodes a solution takes.

    Parameters
    ----------
    radial : int
        Nodes in x = r/a.
    wavenumbers : int
        Nodes in u, spaced exponentially: u = first (exp(s) - 1).
    first, reach : float
        Scale of the smallest u and the largest u (dimensionless).
    """

    radial: int
    wavenumbers: int
    first: float
    reach: float

    @classmethod
    def choose(cls, eps: float, rtol: float, decay: float, ratio: float) -> Self:
        """Nodes for contact radii up to `eps` = a/h at relative error `rtol`.

        The counts are fits, with a margin, to those measured for rigid, stiffer and softer substrates (ratio
        of theta 1e-3 to 1e3) and a/h up to 20; `decay` is `slowest_decay`, which scales all lengths.
        """
        digits = -np.log10(rtol) + 0.5
        wide = eps / decay
        radial = ceil(0.55 * wide**1.38 + (0.4 + 0.28 * wide) * digits)
        first = min(1.0, ratio ** (1.0 / 3.0), max(ratio, 1e-300) ** (-1.0 / 3.0) if ratio < np.inf else 1.0)
        count = digits * (1.8 + 0.85 * wide - 0.8 * log(first))
        return cls(
            radial=max(2, radial),
            wavenumbers=4 * ceil(count / 4.0),
            first=first / decay,
            reach=(1.15 * digits + 2.0) / decay,
        )

    def refined(self) -> Resolution:
        """Return a resolution about half as fine again in every direction."""
        return Resolution(
            self.radial + max(2, self.radial // 3),
            self.wavenumbers + 4 * max(1, self.wavenumbers // 12),
            self.first,
            1.2 * self.reach,
        )

    def wavenumber_rule(self) -> tuple[FloatArray, FloatArray]:
        """Nodes u and weights."""
        nodes, weights = legendre_rule(self.wavenumbers)
        span = log1p(self.reach / self.first)
        grown = self.first * np.exp((0.5 * span) * (nodes + 1.0))
        return grown - self.first, (0.5 * span) * weights * grown


@dataclass(frozen=True)
class PunchSolution:
    """The flat punch at contact radii eps = a/h, on one pair of materials.

    Parameters
    ----------
    eps : ndarray (radii,)
        Contact radii over the layer's thickness.
    x, weights : ndarray (nodes,)
        Nodes r/a and weights of `even_rule`.
    g, rho : ndarray (..., radii, nodes)
        Solution for a unit right-hand side, and the resolvent's row at the edge.
    kappa : ndarray (..., radii)
        kappa_inf(eps) = int_0^1 g dx, the flat punch's factor (9.5).
    """

    eps: FloatArray
    x: FloatArray
    weights: FloatArray
    g: FloatArray
    rho: FloatArray
    kappa: FloatArray

    @classmethod
    def solve(
        cls, layer: PlaneConstants, substrate: PlaneConstants | None, eps: FloatArray, resolution: Resolution
    ) -> Self:
        """Solve for all `eps` in one batch."""
        u, weights_u = resolution.wavenumber_rule()
        x, weights = even_rule(resolution.radial)
        count = x.size
        waves = np.cos((eps[:, None] * np.append(x, 1.0))[:, :, None] * u)
        strength = (2.0 / np.pi) * weights_u * one_minus_L(u, layer, substrate)
        kernel = (waves * (eps[:, None, None] * strength)) @ waves.transpose(0, 2, 1)
        matrix = np.eye(count) - kernel[:, :count, :count] * weights
        sides = np.ones((eps.size, count, 2))
        sides[:, :, 1] = kernel[:, :count, count]
        solved = np.linalg.solve(matrix, sides)
        g = solved[:, :, 0]
        return cls(eps=eps, x=x, weights=weights, g=g, rho=solved[:, :, 1], kappa=g @ weights)

    def depth_and_force(self, shape_weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """w/H(a) and P/(4 theta a H(a)) for a shape, each (..., radii).

        Parameters
        ----------
        shape_weights : ndarray (nodes,) or (radii, nodes)
            Weights v with sum v_i p(x_i) = int_0^1 H(a x)/H(a) p(x) dx for smooth even p.
        """
        edge = 1.0 + self.rho @ self.weights
        if shape_weights.ndim == 1:
            rho_shape, g_shape = self.rho @ shape_weights, self.g @ shape_weights
        else:
            rho_shape = (self.rho * shape_weights).sum(axis=-1)
            g_shape = (self.g * shape_weights).sum(axis=-1)
        depth = (1.0 + rho_shape) / edge
        return depth, depth * self.kappa - g_shape
