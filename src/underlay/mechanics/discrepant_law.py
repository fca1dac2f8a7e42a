"""A law with what it leaves out put in: a share of full friction, and large strains with and without friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.contact_law import ContactLaw

__all__ = ["DiscrepantLaw"]

# Relative step of the slope of what large strains add, second order, to smaller depths alone: the law ends at its
# largest.
_STEP = 1e-3


@dataclass(frozen=True, kw_only=True)
class DiscrepantLaw(ContactLaw):
    """P + s (P_stuck - P) + P (A e + B g).

    Parameters
    ----------
    free : ContactLaw
        Without friction, in small strains.
    sticks : ContactLaw or None
        Of a tip that sticks; None where s and B are zero.
    friction, finite_strain, both : float
        s, A and B.
    excess : callable
        e at depths (m), (n,).
    further : callable
        g of the forces P_stuck and P (N) at depths (m), each (n,).
    """

    free: ContactLaw
    sticks: ContactLaw | None
    friction: float
    finite_strain: float
    both: float
    excess: Callable[[FloatArray], FloatArray]
    further: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]

    @classmethod
    def of(
        cls,
        free: ContactLaw,
        sticks: ContactLaw | None,
        sizes: tuple[float, float, float],
        excess: Callable[[FloatArray], FloatArray],
        further: Callable[[FloatArray, FloatArray, FloatArray], FloatArray],
    ) -> Self:
        """Put s, A and B into a law."""
        friction, finite_strain, both = sizes
        laws = [free] if sticks is None else [free, sticks]
        return cls(
            method=free.method,
            reason=(
                f"{free.reason}; {friction:.3g} of full friction, {finite_strain:.3g} of finite strain, "
                f"{both:.3g} of friction in large strains"
            ),
            max_depth=min(law.max_depth for law in laws),
            error_estimate=max(law.error_estimate for law in laws),
            warnings=free.warnings,
            free=free,
            sticks=sticks,
            friction=friction,
            finite_strain=finite_strain,
            both=both,
            excess=excess,
            further=further,
        )

    @property
    def nodes(self) -> int | None:
        """Those of the law without friction."""
        return self.free.nodes

    def _force(self, depth: FloatArray) -> FloatArray:
        force = self.free.force(depth)
        found = force if self.sticks is None else force + self.friction * (self.sticks.force(depth) - force)
        return found + force * self._strained(depth) if self.finite_strain or self.both else found

    def _strained(self, depth: FloatArray) -> FloatArray:
        """A e + B g at depths (m), (n,)."""
        found = self.finite_strain * self.excess(depth) if self.finite_strain else np.zeros_like(depth)
        if self.sticks is not None and self.both:
            found = found + self.both * self.further(self.sticks.force(depth), self.free.force(depth), depth)
        return np.asarray(found)

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        force, slope = self.free.force_and_stiffness(depth)
        found = (
            slope if self.sticks is None else slope + self.friction * (self.sticks.stiffness(depth) - slope)
        )
        if not (self.finite_strain or self.both):
            return found
        here, before, far = (self._strained(depth * (1.0 - k * _STEP)) for k in (0.0, 1.0, 2.0))
        rising = (1.5 * here - 2.0 * before + 0.5 * far) / (_STEP * depth)
        return found + slope * here + force * rising

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return np.asarray(self.free.contact_radius(depth))

    @property
    def _beyond(self) -> str:
        law = (
            self.free if self.sticks is None or self.free.max_depth <= self.sticks.max_depth else self.sticks
        )
        return law._beyond  # noqa: SLF001  own class
