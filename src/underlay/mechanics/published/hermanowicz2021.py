"""Hermanowicz (2021): a paraboloid on an incompressible layer of any thickness, bonded to a rigid base.

P = E/(1-nu^2) (h^3/R) G(l), l = R d/h^2 = X^2 (radius R, depth d, thickness h);
l < 0.4: G = (4/3) l^(3/2) (1 + 1.10534 l^(1/2) + 1.60675 l + 1.60183 l^(3/2));
otherwise G = 0.61579 - 3.11432 l^(1/2) + 6.69297 l - 7.17028 l^(3/2) + 8.22767 l^2 + (pi/2) l^3.

Minimax fits to the exact contact problem, joined to the thin-layer limit. At the switch, X = 0.6325, the
force is 0.082 % above the exact one from below and 0.052 % from above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from underlay._arrays import FloatArray
from underlay.mechanics.published.correction import (
    LAYER_NU,
    RIGID_BONDED,
    Factor,
    LayerContact,
    MeasuredError,
    PublishedCorrection,
)

_SWITCH = np.sqrt(0.4)
_THICK = (1.0, 1.10534, 1.60675, 1.60183)
# G of the thin branch in powers of X, X^5 absent.
_THIN = (0.61579, -3.11432, 6.69297, -7.17028, 8.22767, 0.0, 0.5 * np.pi)


@dataclass(frozen=True)
class _HermanowiczFactor(Factor):
    def value(self, u: FloatArray) -> FloatArray:
        thin = np.maximum(u, _SWITCH)
        return np.where(
            u < _SWITCH,
            polynomial.polyval(u, _THICK),
            0.75 * polynomial.polyval(thin, _THIN) / thin**3,
        )

    def slope(self, u: FloatArray) -> FloatArray:
        thin = np.maximum(u, _SWITCH)
        above = polynomial.polyval(thin, _THIN)
        above_slope = polynomial.polyval(thin, polynomial.polyder(_THIN))
        return np.where(
            u < _SWITCH,
            polynomial.polyval(u, polynomial.polyder(_THICK)),
            0.75 * (above_slope - 3.0 * above / thin) / thin**3,
        )


def _sphere(_contact: LayerContact) -> _HermanowiczFactor:
    return _HermanowiczFactor()


SPHERE = PublishedCorrection(
    name="hermanowicz2021",
    indenter="sphere",
    substrate=RIGID_BONDED,
    equation=(
        "P = E/(1-nu^2) (h^3/R) G(l), l = X^2; "
        "l < 0.4: G = (4/3) l^1.5 (1 + 1.10534 l^0.5 + 1.60675 l + 1.60183 l^1.5); "
        "otherwise G = 0.61579 - 3.11432 l^0.5 + 6.69297 l - 7.17028 l^1.5 + 8.22767 l^2 + (pi/2) l^3"
    ),
    valid_range=(0.0, np.inf),
    range_basis="stated by the source: layers of arbitrary thickness",
    nu_range=(0.5, 0.5),
    assumptions=(
        "linear elasticity, no friction under the tip",
        "incompressible layer, nu = 0.5",
        "d much smaller than R",
    ),
    source="Hermanowicz 2021, International Journal of Mechanical Sciences 193, 106138",
    doi="10.1016/j.ijmecsci.2020.106138",
    factor=_sphere,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.1    0.2    0.3    0.4    0.5    0.6    0.8      1    1.2    1.5
0.5  0.082  0.082  0.082  0.082  0.082  0.082  0.082  0.082  0.082  0.082
""",
    ),
)
