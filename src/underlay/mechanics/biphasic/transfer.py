"""Transfer functions of a contact in Laplace space: a flat punch, a skeleton that itself relaxes, and creep.

A transfer function is khat(s) = P/(4 theta_d a w), exact for any history by superposition. Lengths are in units
of the punch's radius a, s in units of c/a^2, c = k_z A33.

Of one relaxation e(t) of all drained moduli (e(0) = 1), the permeability constant, the kernel depends on s/(k A)
and 1/A alone, A any modulus and k the permeability, so with e*(s) = s e^(s)

    khat(s) -> e*(s) khat(s/e*(s)),

exact for every history, drainage and anisotropy (not the product e(t) K(t)). arg(s/e*)
lies between 0 and arg s: a legal contour stays legal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from underlay.errors import InputError
from underlay.mechanics.biphasic.elastic_ends import ComplexArray, punch_factor
from underlay.mechanics.biphasic.equations import as_drainage, galerkin
from underlay.mechanics.biphasic.material import Skeleton
from underlay.mechanics.biphasic.response import Response, invert
from underlay.mechanics.biphasic.surface import BesselRule, Sampled, SurfaceKernel, WavenumberRule
from underlay.mechanics.relaxation import Modes

#: Times (a^2/c) of a table.
_SPAN = (1e-3, 30.0)
# Shares of the shortest and longest relaxation time that it reaches to.
_SHORTEST, _LONGEST = 0.02, 20.0


class Transfer(Protocol):
    """Transfer function khat(s) = P/(4 theta_d a w) of a contact, and its limits at s = 0 and infinite s.

    P force, w depth, a radius, theta_d half the drained indentation modulus; s the Laplace variable in c/a^2.
    """

    @property
    def undrained(self) -> float:
        """Value at infinite Laplace variable: normalised stiffness of the undrained elastic contact."""

    @property
    def drained(self) -> float:
        """Value at Laplace variable 0: normalised stiffness of the drained elastic contact."""

    @property
    def eps(self) -> float:
        """Contact radius over thickness, a/h; zero on a half-space."""

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Transfer function, (n,), at Laplace variables s, (n,), in c/a^2: c diffusivity, a contact radius."""


def operational(modes: Modes, s: ComplexArray) -> ComplexArray:
    """Relaxation e(t), a sum of exponentials, as e*(s) = s times its Laplace transform, in the shape of `s`.

    Times of the modes are in the unit of 1/s.
    """
    turned = s[..., None] * modes.times
    return np.asarray(modes.constant + (turned / (1.0 + turned)) @ modes.weights)


@dataclass(frozen=True)
class Relaxing:
    """Transfer function of a draining layer whose skeleton relaxes: e*(s) khat(s/e*(s)), as the module derives.

    Parameters
    ----------
    elastic : Transfer
        Transfer function khat with the instantaneous moduli of the skeleton.
    modes : Modes
        Relaxation e(t) of the moduli, 1 at t = 0; times in a^2/c, c of the instantaneous moduli.
    """

    elastic: Transfer
    modes: Modes

    @property
    def undrained(self) -> float:
        """Value at infinite Laplace variable: the undrained elastic contact with the instantaneous moduli."""
        return self.elastic.undrained

    @property
    def drained(self) -> float:
        """Value at Laplace variable 0: the drained contact, with the moduli left after all relaxation."""
        return self.modes.constant * self.elastic.drained

    @property
    def eps(self) -> float:
        """Contact radius over thickness, a/h."""
        return self.elastic.eps

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Transfer function e*(s) khat(s/e*(s)), (n,), at Laplace variables s (c/a^2), (n,).

        khat is that of the instantaneous moduli, e*(s) the relaxation (`operational`).
        """
        left = operational(self.modes, s)
        return left * self.elastic(s / left)


def span_of(transfer: Transfer) -> tuple[float, float]:
    """First and last time (a^2/c) between which the step response of `transfer` is tabulated."""
    low, high = _SPAN
    if isinstance(transfer, Relaxing):
        times = transfer.modes.times
        low = min(low, _SHORTEST * float(times.min()))
        high = max(high, _LONGEST * float(times.max()))
    return low, high


def relaxation(transfer: Transfer, span: tuple[float, float] | None = None, points: int = 16) -> Response:
    """Response P/(4 theta_d a) to a unit step of depth, for a contact's transfer function; times in a^2/c.

    `span`: first and last time of the table, by default `span_of`; `points`: Laplace variables for 1.5 decades.
    """
    return invert(
        transfer,
        transfer.undrained,
        transfer.drained,
        span or span_of(transfer),
        endless=transfer.eps == 0.0,
        points=points,
    )


def creep(transfer: Transfer, span: tuple[float, float] | None = None, points: int = 16) -> Response:
    """Response 4 theta_d a w to a unit step of load, for a contact's transfer function; arguments as `relaxation`.

    Raises
    ------
    InputError
        If the moduli relax to zero, so that the depth grows without end.
    """
    if not transfer.drained > 0.0:
        raise InputError("a skeleton that relaxes to nothing creeps without end; leave some of its modulus")
    return invert(
        lambda s: 1.0 / transfer(s),
        1.0 / transfer.undrained,
        1.0 / transfer.drained,
        span or span_of(transfer),
        endless=transfer.eps == 0.0,
        points=points,
    )


@dataclass(frozen=True)
class PunchTransfer:
    """Transfer function khat(s) = P/(4 theta_d a w) of a flat punch on a biphasic layer (module).

    Parameters
    ----------
    skeleton : Skeleton
        Drained skeleton of the layer.
    eps : float
        Radius over thickness, a/h; zero for a half-space.
    drainage : str
        One of `DRAINAGES`.
    terms : int, default 10
        Number of terms of the expansion of the pressures.
    reach : float, default 8
        The largest wavenumber (1/a) is reach sqrt(s a^2/c) + 40.
    points : int, default 6
        Gauss points of each panel of wavenumbers. With the defaults khat is within 3e-6, up to s = 1e4 c/a^2.
    """

    skeleton: Skeleton
    eps: float
    drainage: str
    terms: int = 10
    reach: float = 8.0
    points: int = 6

    def __post_init__(self) -> None:
        as_drainage(self.drainage)

    @cached_property
    def undrained(self) -> float:
        """Transfer function at infinite Laplace variable, from the exact elastic law of the undrained skeleton."""
        skeleton = self.skeleton
        return punch_factor(skeleton.undrained, self.eps) * skeleton.theta_undrained / skeleton.theta_drained

    @cached_property
    def drained(self) -> float:
        """Transfer function at Laplace variable 0, from the exact elastic law of the drained skeleton."""
        return punch_factor(self.skeleton.drained, self.eps)

    @cached_property
    def kernel(self) -> SurfaceKernel:
        """Surface kernel of the layer; lengths in units of the punch radius."""
        return SurfaceKernel(self.skeleton, np.inf if self.eps == 0.0 else 1.0 / self.eps)

    def end(self, s: complex) -> float:
        """Largest wavenumber (over 1/a, a the radius) that matters at the Laplace variable s (c/a^2)."""
        return float(self.reach * np.sqrt(abs(s)) + 40.0)

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Transfer function, (n,), at Laplace variables s (c/a^2), (n,), with one call of the kernel for all."""
        ends = [self.end(value) for value in s]
        basis = BesselRule(WavenumberRule(max(ends), points=self.points), self.terms)
        sampled = Sampled(basis.rule.nodes, self.kernel.thickness)
        counts = [basis.rule.up_to(end) for end in ends]
        asked = [sampled.places(count) for count in counts]
        sizes = [places.size for places in asked]
        at = np.repeat(s * self.skeleton.A33, sizes)
        kernel = self.kernel.matrix(np.concatenate(asked), at, sealed=self.drainage == "sealed")
        starts = pairwise(np.cumsum([0, *sizes]))
        parts = [
            sampled.read(kernel[low:high], count) for (low, high), count in zip(starts, counts, strict=True)
        ]
        return np.array([self._factor(part, basis) for part in parts])

    def _factor(self, kernel: ComplexArray, basis: BesselRule) -> complex:
        here = slice(len(kernel))
        odd = basis.odd[:, here] if self.drainage == "solid" else None
        rule = basis.rule
        matrix = galerkin(
            kernel, rule.nodes[here], rule.weights[here], basis.even[:, here], odd, self.skeleton
        )
        sunk = np.zeros(len(matrix))
        sunk[0] = 1.0
        force = 2.0 * np.pi * np.linalg.solve(matrix, sunk)[0]
        return complex(force / (4.0 * self.skeleton.theta_drained))
