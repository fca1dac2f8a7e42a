"""Clifford and Seah (2009): a sphere on a compliant layer on a stiffer elastic base.

P = (4/3) E* sqrt(R) d^(3/2), E* = E*_L + (E*_S - E*_L) P x^n/(1 + P x^n), P = 2.25, n = 1.5,
x = X (E_L/E_S)^(2/3) (1 - 0.22 nu_S^2)/(1 - 1.92 nu_L^2).

A fit to finite elements. E* is E/(1 - nu^2), so that a small contact gives Hertz's law of the layer; the
ratio inside x is that of Young's moduli. With E* read as Young's modulus the force of the smallest contact
would be too small by 1 - nu_L^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.published.correction import ELASTIC, MEASURED_RANGE, PublishedCorrection
from underlay.mechanics.published.factor import Factor
from underlay.mechanics.published.layer_contact import LayerContact
from underlay.mechanics.published.limits import Limit
from underlay.mechanics.published.measured_error import MeasuredError
from underlay.mechanics.published.quantities import MATERIALS, MODULUS_RATIO

__all__ = ["SPHERE"]

_P, _N, _M = 2.25, 1.5, 2.0 / 3.0


@dataclass(frozen=True)
class _CliffordFactor(Factor):
    contrast: float
    scale: float

    def value(self, u: FloatArray) -> FloatArray:
        weight = _P * (self.scale * u) ** _N
        return np.asarray(1.0 + self.contrast * weight / (1.0 + weight))

    def slope(self, u: FloatArray) -> FloatArray:
        weight = _P * (self.scale * u) ** _N
        weight_slope = _P * _N * self.scale**_N * u ** (_N - 1.0)
        return np.asarray(self.contrast * weight_slope / (1.0 + weight) ** 2)


def _sphere(contact: LayerContact) -> _CliffordFactor:
    layer, base = contact.layer, contact.elastic_base
    poisson = (1.0 - 0.22 * base.nu**2) / (1.0 - 1.92 * layer.nu**2)
    return _CliffordFactor(
        contrast=contact.reduced_modulus_ratio - 1.0,
        scale=(layer.E / base.E) ** _M * poisson,
    )


SPHERE = PublishedCorrection(
    name="clifford2009",
    indenter="sphere",
    substrate=ELASTIC,
    equation=(
        "P = (4/3) E* sqrt(R) d^1.5, E* = E*_L + (E*_S - E*_L) 2.25 x^1.5/(1 + 2.25 x^1.5), "
        "x = X (E_L/E_S)^(2/3) (1 - 0.22 nu_S^2)/(1 - 1.92 nu_L^2)"
    ),
    valid_range=(0.0, 0.23),
    range_basis=MEASURED_RANGE + " at E_S/E_L = 10, nu = 0.3",
    nu_range=(0.0, 0.5),
    assumptions=(
        "a compliant layer on a stiffer base",
        "linear elasticity, no friction under the tip",
        "d much smaller than R",
    ),
    source="Clifford & Seah 2009, Nanotechnology 20, 145708",
    doi="10.1088/0957-4484/20/14/145708",
    further_limits=(Limit(MODULUS_RATIO, 1.0, np.inf),),
    factor=_sphere,
    measured_error=MeasuredError.from_table(
        MATERIALS,
        """
0.05 0.1 0.2 0.3 0.5 0.7 1 1.3
0.5 0.3 0.3 0 0 0 0 0 0 0 0
0.7 0.3 0.3 0 0 0 0 0 0 0 0
1 0.3 0.3 0 0 0 0 0 0 0 0
1.5 0.3 0.3 0 0 0 0 0 0 0 0
2 0.3 0.3 0 0 0 0 0 0 0 0
4 0.3 0.3 0 0 0 0 0 0 0 0
10 0.3 0.3 0 0 0 0 0 0 0 0
30 0.3 0.3 0 0 0 0 0 0 0 0
100 0.3 0.3 0 0 0 0 0 0 0 0
0.5 0.3 0.5 0 0 0 0 0 0 0 0
0.7 0.3 0.5 0 0 0 0 0 0 0 0
1 0.3 0.5 0 0 0 0 0 0 0 0
1.5 0.3 0.5 0 0 0 0 0 0 0 0
2 0.3 0.5 0 0 0 0 0 0 0 0
4 0.3 0.5 0 0 0 0 0 0 0 0
10 0.3 0.5 0 0 0 0 0 0 0 0
30 0.3 0.5 0 0 0 0 0 0 0 0
100 0.3 0.5 0 0 0 0 0 0 0 0
0.5 0.5 0.3 0 0 0 0 0 0 0 0
0.7 0.5 0.3 0 0 0 0 0 0 0 0
1 0.5 0.3 0 0 0 0 0 0 0 0
1.5 0.5 0.3 0 0 0 0 0 0 0 0
2 0.5 0.3 0 0 0 0 0 0 0 0
4 0.5 0.3 0 0 0 0 0 0 0 0
10 0.5 0.3 0 0 0 0 0 0 0 0
30 0.5 0.3 0 0 0 0 0 0 0 0
100 0.5 0.3 0 0 0 0 0 0 0 0
0.5 0.5 0.5 0 0 0 0 0 0 0 0
0.7 0.5 0.5 0 0 0 0 0 0 0 0
1 0.5 0.5 0 0 0 0 0 0 0 0
1.5 0.5 0.5 0 0 0 0 0 0 0 0
2 0.5 0.5 0 0 0 0 0 0 0 0
4 0.5 0.5 0 0 0 0 0 0 0 0
10 0.5 0.5 0 0 0 0 0 0 0 0
30 0.5 0.5 0 0 0 0 0 0 0 0
100 0.5 0.5 0 0 0 0 0 0 0 0
""",
    ),
)
