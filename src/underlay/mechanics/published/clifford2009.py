"""Clifford and Seah (2009): a sphere on a compliant layer on a stiffer elastic base.

P = (4/3) E* sqrt(R) d^(3/2), E* = E*_L + (E*_S - E*_L) P x^n/(1 + P x^n), P = 2.25, n = 1.5,
x = X (E_L/E_S)^(2/3) (1 - 0.22 nu_S^2)/(1 - 1.92 nu_L^2), X = sqrt(R d)/h,

with force P (on the left; the P of the fit is its constant), depth d, sphere radius R, thickness h, L the layer
and S the base. A fit to finite elements. E* is E/(1 - nu^2), so that a small contact gives Hertz's law of the
layer; the ratio inside x is that of Young's moduli. With E* read as Young's modulus the force of the smallest
contact would be too small by 1 - nu_L^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.published.correction import (
    ELASTIC,
    MATERIALS,
    MEASURED_RANGE,
    MODULUS_RATIO,
    Factor,
    LayerContact,
    Limit,
    MeasuredError,
    PublishedCorrection,
)

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
               0.05   0.1  0.2  0.3  0.5  0.7    1  1.3
0.5  0.3  0.3  0.64   1.3  5.7  9.2   13   14   14   14
0.5  0.3  0.5   1.2   1.2  1.2  2.5    3    3    3    3
0.5  0.5  0.3     3   9.1   19   25   28   29   29   29
0.5  0.5  0.5   1.5   5.6   13   16   18   18   18   18
0.7  0.3  0.3  0.32  0.43  2.4  4.2  6.1  6.5  6.5  6.5
0.7  0.3  0.5  0.94   1.5    2  2.6    4  5.5  7.2  8.2
0.7  0.5  0.3     2   5.7   13   17   21   22   22   22
0.7  0.5  0.5  0.54   2.4  5.8  7.7  8.6  8.6  8.6  8.6
  1  0.3  0.3     0     0    0    0    0    0    0    0
  1  0.3  0.5  0.63   1.7  4.2  6.5   11   13   14   14
  1  0.5  0.3   1.3   3.1  6.7  9.5   13   15   16   16
  1  0.5  0.5     0     0    0    0    0    0    0    0
1.5  0.3  0.3  0.32  0.32  1.7  3.4  5.6  6.5  6.6  6.6
1.5  0.3  0.5  0.28   1.7  5.6  9.6   16   19   21   21
1.5  0.5  0.3  0.86   1.2  1.6  2.4  4.9  7.7   11   13
1.5  0.5  0.5  0.28   1.7    5  7.3  8.8  8.8  8.8  8.8
  2  0.3  0.3  0.51  0.51  2.5    5  8.6   11   11   11
  2  0.3  0.5  0.28   1.6  6.2   11   19   23   25   25
  2  0.5  0.3  0.72  0.72  1.3  1.9  1.9    3  7.2  9.9
  2  0.5  0.5  0.35   2.5  7.6   12   15   15   15   15
  4  0.3  0.3  0.86  0.86  3.3  7.2   14   18   20   21
  4  0.3  0.5  0.57   1.3  6.8   13   23   29   34   35
  4  0.5  0.3  0.79   1.1  5.7  9.2   11   11   11   11
  4  0.5  0.5  0.47   3.5   12   19   25   25   25   25
 10  0.3  0.3   1.2   1.2  3.6  8.3   17   22   28   31
 10  0.3  0.5   0.8     1  6.9   14   26   34   42   47
 10  0.5  0.3   0.9   1.7  8.4   15   19   19   19   19
 10  0.5  0.5  0.62   3.9   14   23   32   32   32   32
 30  0.3  0.3   1.3   1.3  3.7  8.7   18   24   32   38
 30  0.3  0.5  0.91  0.91  6.9   14   27   36   46   54
 30  0.5  0.3  0.96   1.9  9.6   17   23   23   23   23
 30  0.5  0.5   0.7     4   15   25   35   36   36   36
100  0.3  0.3   1.3   1.3  3.7  8.8   18   25   33   41
100  0.3  0.5  0.95  0.95  6.8   14   27   37   48   58
100  0.5  0.3  0.99     2   10   18   25   25   25   25
100  0.5  0.5  0.73     4   15   26   37   38   38   38
""",
    ),
)
