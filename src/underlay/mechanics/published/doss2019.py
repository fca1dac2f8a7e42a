"""Doss et al. (2019): a sphere on an incompressible layer on an incompressible elastic base.

P/P_Hertz = (q + 1)/(q (E_L/E_S)^A + 1), q = 0.85 X + 3.36 X^2, A = min(1, 0.72 - 0.34 X + 0.51 X^2),

with X = sqrt(R d)/h (radius R, depth d, thickness h) and E_L, E_S Young's moduli of layer and base. A fit to finite
elements. The exponent stops at 1, reached at X = 1.146: from there a very large contact
feels the base alone; the stiffness has a small step at that depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.published.correction import (
    BASE_NU,
    ELASTIC,
    MATERIALS,
    Factor,
    LayerContact,
    Limit,
    MeasuredError,
    PublishedCorrection,
)


@dataclass(frozen=True)
class _DossFactor(Factor):
    softness: float

    def value(self, u: FloatArray) -> FloatArray:
        q = 0.85 * u + 3.36 * u * u
        return np.asarray((q + 1.0) / (q * self.softness ** self._exponent(u) + 1.0))

    def slope(self, u: FloatArray) -> FloatArray:
        q, q_slope = 0.85 * u + 3.36 * u * u, 0.85 + 6.72 * u
        exponent = self._exponent(u)
        exponent_slope = np.where(exponent < 1.0, -0.34 + 1.02 * u, 0.0)
        power = self.softness**exponent
        below = q * power + 1.0
        below_slope = power * (q_slope + q * np.log(self.softness) * exponent_slope)
        return np.asarray((q_slope - (q + 1.0) * below_slope / below) / below)

    @staticmethod
    def _exponent(u: FloatArray) -> FloatArray:
        return np.minimum(1.0, 0.72 - 0.34 * u + 0.51 * u * u)


def _sphere(contact: LayerContact) -> _DossFactor:
    return _DossFactor(softness=contact.layer.E / contact.elastic_base.E)


SPHERE = PublishedCorrection(
    name="doss2019",
    indenter="sphere",
    substrate=ELASTIC,
    equation=(
        "P/P_Hertz = (q + 1)/(q (E_L/E_S)^A + 1), q = 0.85 X + 3.36 X^2, A = min(1, 0.72 - 0.34 X + 0.51 X^2)"
    ),
    valid_range=(0.0, 0.8),
    range_basis="measured: within 7 % of the exact contact law there, for E_S/E_L from 0.1 to 1000",
    nu_range=(0.5, 0.5),
    assumptions=(
        "incompressible layer and base, nu = 0.5",
        "linear elasticity, no friction under the tip",
        "d much smaller than R",
    ),
    source="Doss, Rahmani Eliato, Lin & Ros 2019, Soft Matter 15, 1776-1784",
    doi="10.1039/C8SM02121J",
    further_limits=(Limit(BASE_NU, 0.5, 0.5),),
    factor=_sphere,
    measured_error=MeasuredError.from_table(
        MATERIALS,
        """
                0.05   0.1  0.2  0.3  0.5  0.7    1  1.3
 0.1  0.5  0.5   5.3   6.4  6.4  6.4  6.4  6.4   22   36
 0.3  0.5  0.5   2.4   3.5  4.1  4.4  5.1  5.1  7.5   17
 0.5  0.5  0.5   1.2   1.9  2.4  2.8  3.5  3.5  3.5  8.3
 0.7  0.5  0.5  0.55  0.87  1.2  1.5  1.9    2    2    4
   1  0.5  0.5     0     0    0    0    0    0    0    0
 1.5  0.5  0.5  0.48  0.77  1.1  1.4  2.1  2.3  2.3  3.6
   2  0.5  0.5  0.72   1.2  1.7  2.2  3.4  3.8  3.8  5.5
   4  0.5  0.5   1.1   1.7  2.4  3.1  5.2  6.3  6.3  7.9
  10  0.5  0.5   1.2   1.8  2.2  2.6  4.8  6.6  6.6  7.2
  30  0.5  0.5   1.1   1.6  1.6  1.6  2.1  3.8  3.9    4
 100  0.5  0.5   1.1   1.3  1.3  1.3  1.3  1.3  1.3  1.6
1000  0.5  0.5  0.92   1.1  1.1  2.1    4  4.1  4.1  4.1
""",
    ),
)
