"""The scales of a kernel: where in the wavenumber it bends, and how the contact answers."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any, Self

import numpy as np

from underlay.errors import RangeError
from underlay.mechanics.plane_constants import PlaneConstants

__all__ = ["SOFTEST", "Scales"]

# The node counts were fitted to roots that decay without turning, and hold where they turn up to this share of the
# rate at which they decay: beyond, the poles of L stand too near to the real axis (measured on 6000 materials).
_MOST_TURN = 0.5
#: Smallest theta of a part over that of the layer: below, the layer bends in the rounding of 1 - L.
SOFTEST = 1e-20


def lowest(value: Any) -> float:
    """Smallest of a batch, or the float itself."""
    return float(value.min()) if isinstance(value, np.ndarray) else float(value)


@dataclass(frozen=True)
class Scales:
    """What the node counts need to know of a body (of the worst of a batch).

    Parameters
    ----------
    decay : float
        Slowest decay rate of the surface layer's displacements with depth; 1 when isotropic. It scales lengths.
    fastest : float
        Fastest decay rate.
    ratio : float
        theta of what is under the layer over theta of the layer, the smallest of a batch; inf when rigid.
    stretch : float
        Wavenumber below which a softer base lets the layer stretch with it.
    firmness : float
        How incompressible the layer is: 1 at nu = 0.5, 0 at nu = 0.3 and below.
    stiffest, softest : float
        theta of the stiffest and of the softest of what is under the layer over theta of the layer; inf when
        rigid. An interface on springs is as soft as can be.
    charted : bool
        Whether node counts were fitted to bodies of this kind; others are proved by doubling.
    """

    decay: float
    fastest: float
    ratio: float
    stretch: float
    firmness: float
    stiffest: float
    softest: float
    charted: bool = True

    @classmethod
    def of(cls, layer: PlaneConstants, substrate: PlaneConstants | None) -> Self:
        """Read them off the constants of one layer on a base, floats or (batch, 1).

        Raises
        ------
        RangeError
            If the substrate is more than 1e20 times softer than the layer.
        """
        half, p = 0.5 * layer.sigma, layer.p
        square = half * half - p
        spread = (square * (square > 0.0)) ** 0.5
        slow = p / (half + spread)
        decay = min(lowest(slow), lowest(half))
        fastest = -lowest(-(half + spread))
        charted = lowest(square + (_MOST_TURN * half) ** 2) >= 0.0
        # (p - q)/p is 0 for an incompressible material and 4/7 for nu = 0.3.
        firmness = max(0.0, 1.0 - 1.75 * lowest(layer.p_minus_q / p))
        if substrate is None:
            return cls(decay, fastest, inf, inf, firmness, inf, inf, charted)
        ratio = lowest(substrate.theta / layer.theta)
        if not ratio >= SOFTEST:
            raise RangeError(
                f"the substrate is {ratio:.3g} times as stiff as the layer, and the exact law ends at "
                f"{SOFTEST:g}: check the units of the moduli; a layer on nothing carries no load"
            )
        stretch = lowest(substrate.g / (layer.g * substrate.sigma))
        return cls(decay, fastest, ratio, stretch, firmness, ratio, ratio, charted)

    @property
    def softness(self) -> float:
        """Inverse of the a/h at which a softer substrate is first felt; 0 for a stiffer one."""
        return 0.0 if self.ratio >= 1.0 else self.ratio ** (-2.0 / 3.0) - 1.0
