"""Long et al. (2011): a sphere on a gel bonded to a rigid base, finite elements with large deformation.

P/P_Hertz = (1 + 1.15 X + a w + b w^2)/(1 + 2.3 w), w = X^3, X = sqrt(R d)/h (radius R, depth d, thickness h);
R/h > 2: a = 9.5, b = 4.212; otherwise a = 10.05 - 0.63 sqrt(h/R) (3.1 + h^2/R^2), b = 4.8 - 4.23 h^2/R^2.

A fit to neo-Hookean calculations with a true sphere. Against linear elasticity and a paraboloid the branch
for R/h > 2 is within 2 % up to X = 0.75; the other one is up to 33 % lower at the source's largest depths,
where d is as large as R. The two branches differ by up to 9 % where they meet, at R/h = 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.published.correction import (
    DEPTH_OVER_RADIUS,
    DEPTH_RATIO,
    LAYER_NU,
    RADIUS_RATIO,
    RIGID_BONDED,
    Factor,
    LayerContact,
    Limit,
    MeasuredError,
    PublishedCorrection,
)


@dataclass(frozen=True)
class _LongFactor(Factor):
    a: float
    b: float

    def value(self, u: FloatArray) -> FloatArray:
        w = u**3
        return np.asarray((1.0 + 1.15 * u + self.a * w + self.b * w * w) / (1.0 + 2.3 * w))

    def slope(self, u: FloatArray) -> FloatArray:
        w, w_slope = u**3, 3.0 * u * u
        below = 1.0 + 2.3 * w
        above_slope = 1.15 + (self.a + 2.0 * self.b * w) * w_slope
        return np.asarray((above_slope - self.value(u) * 2.3 * w_slope) / below)


def _sphere(contact: LayerContact) -> _LongFactor:
    if contact.radius_ratio > 2.0:
        return _LongFactor(9.5, 4.212)
    thickness_ratio = 1.0 / contact.radius_ratio
    return _LongFactor(
        10.05 - 0.63 * np.sqrt(thickness_ratio) * (3.1 + thickness_ratio**2),
        4.8 - 4.23 * thickness_ratio**2,
    )


SPHERE = PublishedCorrection(
    name="long2011",
    indenter="sphere",
    substrate=RIGID_BONDED,
    equation=(
        "P/P_Hertz = (1 + 1.15 X + a w + b w^2)/(1 + 2.3 w), w = X^3; R/h > 2: a = 9.5, b = 4.212; "
        "otherwise a = 10.05 - 0.63 sqrt(h/R) (3.1 + h^2/R^2), b = 4.8 - 4.23 h^2/R^2"
    ),
    # sqrt(12.7 * 0.6): the largest X that the source's ranges of R/h and d/h allow.
    valid_range=(0.0, 2.76),
    range_basis="stated by the source: 0.3 <= R/h <= 12.7, d/h <= min(0.6, R/h)",
    nu_range=(0.5, 0.5),
    assumptions=(
        "neo-Hookean, incompressible layer, large deformation",
        "a true sphere",
    ),
    source="Long, Hall, Wu & Hui 2011, Biophysical Journal 101, 643-650",
    doi="10.1016/j.bpj.2011.06.049",
    further_limits=(
        Limit(RADIUS_RATIO, 0.3, 12.7),
        Limit(DEPTH_RATIO, 0.0, 0.6),
        Limit(DEPTH_OVER_RADIUS, 0.0, 1.0),
    ),
    factor=_sphere,
    # Rows at R/h; against linear elasticity and a paraboloid; inf beyond the source's depths.
    measured_error=MeasuredError.from_table(
        (LAYER_NU, RADIUS_RATIO),
        """
             0.1  0.2  0.3  0.4  0.5  0.6  0.8    1  1.2  1.5
0.5    0.3   2.1   11   30  inf  inf  inf  inf  inf  inf  inf
0.5    0.5   1.2  4.8   11   21   34  inf  inf  inf  inf  inf
0.5      1  0.82  2.5  4.1  6.2  9.4   15  inf  inf  inf  inf
0.5    1.5  0.75    2  2.7  3.3  4.6    7   15  inf  inf  inf
0.5      2  0.72  1.8  2.1  2.2  2.7  4.2  9.4   15  inf  inf
0.5  2.001  0.64  1.2  1.2  1.2  1.9    2    2  6.1  inf  inf
0.5   12.7  0.64  1.2  1.2  1.2  1.9    2    2  6.1  8.6    9
""",
    ),
)
