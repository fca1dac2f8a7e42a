"""How many nodes the exact contact problem takes: in r, in the wavenumber u, and in the contact radius.

The counts are fits, with a margin, to those measured for rigid bases and for ratios of theta between 1e-8
and 1e8, at a/h from 0.2 to 20 and relative errors from 1e-2 to 1e-10.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asinh, ceil, log, log1p, log10
from typing import Self

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import RangeError
from underlay.mechanics.exact.gauss import legendre_rule
from underlay.mechanics.kernel import Scales

__all__ = ["MOST_NODES", "Resolution", "curve_terms", "series_terms", "wanted_terms"]


#: Most nodes in x = r/a times those in u: the cosines of one contact radius, 8 MB of them. An isotropic layer
#: at a/h = 20 and 1e-12 takes 110 x 288, on a base 1e8 times softer 110 x 752.
MOST_NODES = 1_000_000


@dataclass(frozen=True)
class Resolution:
    """Nodes of one solution.

    Parameters
    ----------
    radial : int
        Nodes in x = r/a.
    wavenumbers : int
        Nodes in u: Gauss-Legendre in s, u = first (exp(s) - 1).
    first, reach : float
        Scale of the smallest wavenumbers, and the largest (dimensionless).
    """

    radial: int
    wavenumbers: int
    first: float
    reach: float

    @classmethod
    def choose(cls, scales: Scales, eps: float, rtol: float) -> Self:
        """Nodes for contact radii up to `eps` = a/h at relative error `rtol`.

        Raises
        ------
        RangeError
            If there would be more than `MOST_NODES`, which is said before any is made.
        """
        digits = 0.5 - log10(rtol)
        wide = eps / scales.decay
        radial = ceil(0.55 * wide**1.38 + (0.4 + 0.28 * wide) * digits)
        # The condition of wide contacts on a rigid base grows as wide^3: the tail must be that much smaller.
        reach = 1.15 * digits + 2.0 + 0.5 * log1p(0.1 * wide)
        first, count = _graded(scales, wide, digits, reach)
        if radial * count > MOST_NODES:
            raise RangeError(
                f"the exact law would take {radial:.0f} x {count:.0f} nodes at a/h = {eps:.3g}, and it takes "
                f"{MOST_NODES} of both together at most: with these E, E_axial and G_axial the layer's "
                f"displacements decay as exp(-{scales.decay:.2g} z), so that a contact acts "
                f"{1.0 / scales.decay:.3g} times as wide as it is; "
                "check the moduli and their units, press less deep, or allow a larger rtol"
            )
        return cls(
            radial=max(2, radial),
            wavenumbers=4 * ceil(0.25 * count),
            first=first / scales.decay,
            reach=reach / scales.decay,
        )

    @property
    def size(self) -> int:
        """Cosines that one contact radius takes."""
        return self.radial * self.wavenumbers

    def finer(self) -> Resolution:
        """Twice the nodes, graded finer and reaching further: what a solution is proved with."""
        return Resolution(
            ceil(1.5 * self.radial) + 1, 2 * self.wavenumbers, 0.25 * self.first, 1.2 * self.reach
        )

    def wavenumber_rule(self) -> tuple[FloatArray, FloatArray]:
        """Nodes u and weights (wavenumbers,).

        Of the rules tried (tripling and equal panels, Gauss-Laguerre, this one) the single Gauss rule on an
        exponential variable takes the fewest nodes: 24 instead of 35 at a/h = 2 and 1e-6.
        """
        nodes, weights = legendre_rule(self.wavenumbers)
        half_span = 0.5 * log1p(self.reach / self.first)
        grown = np.exp(half_span * nodes + (half_span + log(self.first)))
        return grown - self.first, half_span * weights * grown


def series_terms(scales: Scales, eps: float, rtol: float) -> int:
    """Contact radii up to `eps` for an expansion in the radius (`RadiusSeries`)."""
    return ceil((0.5 - log10(rtol)) * (1.2 + 0.65 * (asinh(eps) + log1p(scales.softness * eps))))


def curve_terms(scales: Scales, varpi: float, exponent: float, rtol: float) -> int:
    """Contact radii for one polynomial in varpi up to `varpi`: whole blocks of the polynomial evaluated."""
    return 4 * ceil(0.25 * wanted_terms(scales, varpi, exponent, rtol) - 0.02)


def wanted_terms(scales: Scales, varpi: float, exponent: float, rtol: float) -> float:
    """As many as `curve_terms`, not rounded up."""
    digits = 1.0 - log10(rtol)
    if scales.softness == 0.0:
        elastic = 0.12 if scales.ratio < 100.0 else 0.0
        length = asinh(varpi) * (1.0 + 0.12 * scales.firmness + elastic) * (1.0 + 0.25 / exponent)
    else:
        length = 0.42 * (asinh(varpi) + log1p(scales.softness * varpi)) * (1.0 + 0.25 / exponent)
    return digits * (0.8 + length)


# Each step moves the scale by less: after six the node count stands still.
_GRADING_STEPS = 6


def _graded(scales: Scales, wide: float, digits: float, reach: float) -> tuple[float, float]:
    """Scale of the smallest wavenumbers and the number of nodes.

    A pole of L at -x costs exp(-4 n sqrt(x/(first span))) with n nodes on s in [0, span]: the smaller x, the
    finer the grading. The layer's fastest decay is one. A substrate softer than the layer adds one where the
    layer bends, at ratio^(1/3) (0.3 of it where measured), and one at `stretch`, which carries less of the
    kernel; the digits asked of each are fitted.
    """
    first = 1.0 if wide < 4.0 else 3.0
    base = max(2.2 + 0.6 * wide, 1.0 + 1.1 * wide)
    poles = [(0.5 * scales.decay / scales.fastest, digits)]
    if scales.ratio < 1.0:
        poles.append((0.3 * scales.ratio ** (1.0 / 3.0), digits - 0.5 * log10(scales.ratio)))
        small = digits + 1.0 + 0.5 * log10(scales.ratio)
        if small > 0.0:
            poles.append((scales.stretch * scales.decay, small))
    growth = (0.34 if scales.ratio >= 1.0 else 0.5) + 0.13 * wide
    count = digits * (base + growth * max(0.0, -log(first)))
    for _ in range(_GRADING_STEPS):
        finest = min(x * (1.74 * count / wanted) ** 2 for x, wanted in poles) / log1p(reach / first)
        if finest >= first:
            break
        first = finest
        count = digits * (base + growth * max(0.0, -log(first)))
    return first, count
