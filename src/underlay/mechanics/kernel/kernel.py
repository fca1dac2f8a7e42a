"""What every kernel answers: all that a solver asks of the body under an indenter.

To add a body, derive from `Kernel` and implement `values`, `scales`, `rule`, `contrast` and `uniform`: every
solver of the contact problem then takes it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import factorial
from typing import NamedTuple, Protocol

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import InputError
from underlay.mechanics.body import Base, Layer
from underlay.mechanics.kernel.scales import Scales

__all__ = ["Compliance", "Family", "Kernel", "Layers"]

_MOST_COEFFICIENTS = 12


class Layers(NamedTuple):
    """Layers from the top down, their base, and which were joined, in words."""

    layers: tuple[Layer, ...]
    base: Base
    said: tuple[str, ...] = ()


class Compliance(NamedTuple):
    """How the body changes the surface's compliance in every direction, each (nodes,).

    With theta and p those of the surface, C the 2 x 2 compliance of the surface of the body (radial, axial) per
    wavenumber and gamma its coupling: `radial` is 1 - theta p C_11, `mixed` theta sqrt(p) C_12 + gamma, `axial`
    1 - theta C_22, which is 1 - L.
    """

    radial: FloatArray
    mixed: FloatArray
    axial: FloatArray


class Kernel(ABC):
    """1 - L(u) of one body, or of many of one kind at once; u is the wavenumber times the thickness on top."""

    @abstractmethod
    def values(self, u: FloatArray) -> FloatArray:
        """1 - L at `u` (nodes,) of zero or more, (nodes,) or (batch, nodes), without checks: the hot path."""

    @property
    @abstractmethod
    def scales(self) -> Scales:
        """Where it bends: what node counts depend on.

        Raises
        ------
        RangeError
            If the body is too soft somewhere for 1 - L to be told from rounding.
        """

    @abstractmethod
    def rule(self, eps_max: float, rtol: float, *, power: int = 0) -> tuple[FloatArray, FloatArray]:
        """Nodes and weights (n,) on [0, inf) for int [1 - L(u)] u^power cos(s u) cos(t u) du, s, t <= `eps_max`."""

    @property
    @abstractmethod
    def contrast(self) -> float:
        """How much the body differs from a half-space of its surface, in compliance.

        With delta the contrast, its energy is between those of half-spaces (1 +- delta) times as compliant.
        """

    @property
    @abstractmethod
    def uniform(self) -> bool:
        """Whether nothing under the surface differs from it: the kernel is zero."""

    def compliance(self, u: FloatArray) -> Compliance:
        """What a tip that sticks feels of the body, at `u` (nodes,) of zero or more.

        Raises
        ------
        InputError
            If this kernel knows the axial compliance alone.
        """
        del u
        raise InputError(
            f"{type(self).__name__} says nothing of shear: friction needs its compliance in shear and its coupling"
        )

    @property
    def coupling(self) -> float:
        """gamma = (p - q)/(sigma sqrt p) of the surface, (1 - 2 nu)/(2 (1 - nu)) when isotropic.

        Raises as `compliance` does.
        """
        raise InputError(
            f"{type(self).__name__} says nothing of shear: friction needs its compliance in shear and its coupling"
        )

    def simpler(self, eps: float, allowed: float) -> Layers | None:
        """Return a body of fewer layers that contacts cannot tell from this one; None where there is none.

        Parameters
        ----------
        eps : float
            Largest contact radius over the thickness on top.
        allowed : float
            Relative change of force, contact radius and stiffness, all that is joined together.
        """
        del eps, allowed
        return None

    @property
    def description(self) -> str:
        """What the body is, for messages."""
        return repr(self)

    @property
    def decay(self) -> float:
        """Slowest rate at which displacements decay below the surface, per wavenumber; 1 when isotropic."""
        return self.scales.decay

    def one_minus_L(self, u: ArrayLike) -> FloatArray:
        """1 - L(u), shape of `u` (wavenumber times thickness, dimensionless, zero or more).

        Raises
        ------
        InputError
            If a `u` is negative or not finite.
        """
        nodes = as_finite(u, "u")
        if (nodes < 0.0).any():
            raise InputError(f"the kernel needs u of zero or more; got {nodes.min():.6g}")
        flat = np.atleast_1d(nodes).ravel()
        return self.values(flat).reshape(nodes.shape)[()]

    def coefficients(self, count: int) -> FloatArray:
        """a_0, a_1, ... of (1.7) by (1.8), `count` of them, to near machine precision; array (count,).

        Raises
        ------
        InputError
            If `count` is not in 1..12; each asymptotic order needs a_m only up to m = 1.
        """
        if not 1 <= count <= _MOST_COEFFICIENTS:
            raise InputError(f"count of coefficients must be in 1..{_MOST_COEFFICIENTS}; got {count!r}")
        return self.moments(count)

    def moments(self, count: int, rtol: float = 1e-15) -> FloatArray:
        """a_m = (-1)^m/((2m)!!)^2 int_0^inf [1 - L(u)] u^(2m) du (1.8), m < `count`, without checks.

        Parameters
        ----------
        count : int
            Number of coefficients.
        rtol : float
            Wanted error of the integrals.

        Returns
        -------
        array (count,) or (batch, count)
        """
        u, weights = self.rule(0.0, rtol, power=2 * count - 2)
        powers = weights[:, None] * u[:, None] ** (2.0 * np.arange(count))
        scale = [(-1.0) ** m / (2.0**m * factorial(m)) ** 2 for m in range(count)]
        return self.values(u) @ powers * scale


class Family(Protocol):
    """Bodies that differ in one positive number; hashable, since equal ones share their tables."""

    def kernel(self, ratio: float) -> Kernel:
        """Kernel of the body at one value of the number.

        Raises
        ------
        InputError
            If there is no such body.
        """

    def __hash__(self) -> int: ...
