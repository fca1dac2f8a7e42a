"""Gavara and Chadwick (2012), the bottom-effect cone correction: a cone on a layer bonded to a rigid base.

P/P_Sneddon = 1 + 1.7795 (2 tan(alpha)/pi^2) d/h + 16 1.7795^2 tan(alpha)^2 (d/h)^2, with force P, depth d,
thickness h, half-angle alpha from the axis.

Both terms as printed are far from the exact contact problem: the linear one is half of the exact 4 a_0
tan(alpha)/pi^2, with a_0 the kernel's first moment, and the quadratic one, for lack of a 1/pi^4, about 78 times
too large.
"""

from __future__ import annotations

import numpy as np

from underlay.mechanics.published.correction import (
    LAYER_NU,
    MEASURED_RANGE,
    RIGID_BONDED,
    LayerContact,
    MeasuredError,
    PolynomialFactor,
    PublishedCorrection,
)

_ALPHA = 1.7795


def _cone(_contact: LayerContact) -> PolynomialFactor:
    return PolynomialFactor((1.0, 2.0 * _ALPHA / np.pi**2, 16.0 * _ALPHA**2))


CONE = PublishedCorrection(
    name="gavara2012",
    indenter="cone",
    substrate=RIGID_BONDED,
    equation="P/P_Sneddon = 1 + 1.7795 (2/pi^2) y + 16 1.7795^2 y^2",
    valid_range=(0.0, 0.035),
    range_basis=MEASURED_RANGE,
    nu_range=(0.5, 0.5),
    assumptions=("linear elasticity, no friction under the tip", "incompressible layer, nu = 0.5"),
    source="Gavara & Chadwick 2012, Nature Nanotechnology 7, 733-736",
    doi="10.1038/nnano.2012.163",
    factor=_cone,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
     0.02  0.04  0.06  0.08  0.1  0.2  0.4  0.6   0.8     1
0.5   1.3   6.4    16    28   44  170  550  980  1400  1700
""",
    ),
)
