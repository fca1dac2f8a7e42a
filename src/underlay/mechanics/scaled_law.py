"""One law seen through the factors of similarity: what a fit in which the ratios stay put asks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import ArrayLike, FloatArray
from underlay.mechanics.contact_law import ContactLaw, ContactState

__all__ = ["ScaledLaw"]


@dataclass(frozen=True, kw_only=True)
class ScaledLaw(ContactLaw):
    """The law of a similar contact: P(w) = c P_ref(b w), a(w) = s a_ref(b w).

    Parameters
    ----------
    law : ContactLaw
        The reference.
    b, c, s : float
        Factors of depth, force and contact radius.
    """

    law: ContactLaw
    b: float
    c: float
    s: float

    @classmethod
    def of(cls, law: ContactLaw, b: float, c: float, s: float) -> Self:
        """See `law` through these factors, all positive."""
        return cls(
            method=law.method,
            reason=law.reason,
            max_depth=law.max_depth / b,
            error_estimate=law.error_estimate,
            warnings=law.warnings,
            law=law,
            b=b,
            c=c,
            s=s,
        )

    @property
    def domain(self) -> tuple[float, float]:
        """That of the reference, in depths (m) of this contact."""
        return self.law.domain[0] / self.b, self.max_depth

    @property
    def nodes(self) -> int | None:
        """Those of the reference."""
        return self.law.nodes

    @property
    def known_slopes(self) -> int:
        """As the reference."""
        return self.law.known_slopes

    def work_slope(self, depth: FloatArray) -> FloatArray | None:
        """As the reference: the slope goes with the force."""
        slope = self.law.work_slope(self.b * depth)
        return None if slope is None else self.c * slope

    @property
    def pull_off_force(self) -> float:
        """That of the reference (N)."""
        return self.c * self.law.pull_off_force

    @property
    def zero_load_radius(self) -> float:
        """That of the reference (m)."""
        return self.s * self.law.zero_load_radius

    def pull_off(self, compliance: float = 0.0) -> ContactState:
        """As the reference."""
        return self._here(self.law.pull_off(self.b * self.c * compliance))

    def jump_in(self, compliance: float = 0.0) -> ContactState:
        """As the reference."""
        return self._here(self.law.jump_in(self.b * self.c * compliance))

    def jump_travels(self, compliance: float = 0.0) -> tuple[float, ...]:
        """Those of the reference."""
        return tuple(travel / self.b for travel in self.law.jump_travels(self.b * self.c * compliance))

    def equilibria(self, max_depth: float) -> tuple[FloatArray, FloatArray]:
        """Those of the reference."""
        depth, force = self.law.equilibria(self.b * max_depth)
        return depth / self.b, self.c * force

    def _here(self, there: ContactState) -> ContactState:
        return ContactState(there.depth / self.b, self.c * there.force, self.s * there.radius)

    def depth(self, force: ArrayLike) -> FloatArray:
        """See `ContactLaw.depth`; the reference's own inverse."""
        return np.asarray(self.law.depth(np.asarray(force, dtype=np.float64) / self.c) / self.b)

    def tip_depth(self, travel: FloatArray, compliance: float) -> FloatArray | None:
        """As the reference: b w + (b c C) P_ref = b s."""
        w = self.law.tip_depth(self.b * travel, self.b * self.c * compliance)
        return None if w is None else w / self.b

    def _touching(self, depth: FloatArray) -> NDArray[np.bool_]:
        return self.law._touching(self.b * depth)  # noqa: SLF001  as below

    @property
    def _least_force(self) -> float:
        return self.c * self.law._least_force  # noqa: SLF001  as below

    @property
    def _beyond(self) -> str:
        return self.law._beyond  # noqa: SLF001  the law this one is a picture of

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.c * self.law._force(self.b * depth)  # noqa: SLF001  as above

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.s * self.law._contact_radius(self.b * depth)  # noqa: SLF001  as above

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return (self.b * self.c) * self.law._stiffness(self.b * depth)  # noqa: SLF001  as above

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        both = self.law._force_and_stiffness(self.b * depth)  # noqa: SLF001  as above
        both[0] *= self.c
        both[1] *= self.b * self.c
        return both

    def _with_slopes(self, depth: FloatArray) -> FloatArray:
        rows = self.law._with_slopes(self.b * depth)  # noqa: SLF001  as above
        rows *= self.c
        rows[1] *= self.b
        return rows
