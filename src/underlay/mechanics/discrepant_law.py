"""A law with what it leaves out put in: a share of full friction, and finite strain of a given size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.contact_law import ContactLaw

__all__ = ["DiscrepantLaw"]

# Relative step of the slope of the excess, to smaller depths alone: the law ends at its largest. Second order.
_STEP = 1e-3


@dataclass(frozen=True, kw_only=True)
class DiscrepantLaw(ContactLaw):
    """P + s (P_stuck - P) + A P e.

    Parameters
    ----------
    free : ContactLaw
        Without friction, in small strains.
    sticks : ContactLaw or None
        Of a tip that sticks; None where the share is zero.
    friction, finite_strain : float
        s and A.
    excess : callable
        e at depths (m), (n,).
    """

    free: ContactLaw
    sticks: ContactLaw | None
    friction: float
    finite_strain: float
    excess: Callable[[FloatArray], FloatArray]

    @classmethod
    def of(
        cls,
        free: ContactLaw,
        sticks: ContactLaw | None,
        friction: float,
        finite_strain: float,
        excess: Callable[[FloatArray], FloatArray],
    ) -> Self:
        """Put a share of friction and a size of finite strain into a law."""
        laws = [free] if sticks is None else [free, sticks]
        return cls(
            method=free.method,
            reason=f"{free.reason}; {friction:.3g} of full friction, {finite_strain:.3g} of finite strain",
            max_depth=min(law.max_depth for law in laws),
            error_estimate=max(law.error_estimate for law in laws),
            warnings=free.warnings,
            free=free,
            sticks=sticks,
            friction=friction,
            finite_strain=finite_strain,
            excess=excess,
        )

    @property
    def nodes(self) -> int | None:
        """Those of the law without friction."""
        return self.free.nodes

    def _force(self, depth: FloatArray) -> FloatArray:
        force = self.free.force(depth)
        found = force if self.sticks is None else force + self.friction * (self.sticks.force(depth) - force)
        return found + self.finite_strain * force * self.excess(depth) if self.finite_strain else found

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        force, slope = self.free.force_and_stiffness(depth)
        found = (
            slope if self.sticks is None else slope + self.friction * (self.sticks.stiffness(depth) - slope)
        )
        if not self.finite_strain:
            return found
        here, before, far = (self.excess(depth * (1.0 - k * _STEP)) for k in (0.0, 1.0, 2.0))
        rising = (1.5 * here - 2.0 * before + 0.5 * far) / (_STEP * depth)
        return found + self.finite_strain * (slope * here + force * rising)

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return np.asarray(self.free.contact_radius(depth))

    @property
    def _beyond(self) -> str:
        law = (
            self.free if self.sticks is None or self.free.max_depth <= self.sticks.max_depth else self.sticks
        )
        return law._beyond  # noqa: SLF001  own class
