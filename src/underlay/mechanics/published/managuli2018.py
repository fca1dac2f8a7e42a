"""Managuli and Roy (2018): a cone on a layer bonded to a rigid base, nu = 0.5.

P/P_Sneddon = 1 + 4 C d/h + 20 C^2 (d/h)^2, C = 1.7795 tan(alpha)/pi^2, with depth d, thickness h, alpha from
the axis.
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

_C = 1.7795 / np.pi**2


def _cone(_contact: LayerContact) -> PolynomialFactor:
    return PolynomialFactor((1.0, 4.0 * _C, 20.0 * _C**2))


CONE = PublishedCorrection(
    name="managuli2018",
    indenter="cone",
    substrate=RIGID_BONDED,
    equation="P/P_Sneddon = 1 + 4 C y + 20 C^2 y^2, C = 1.7795/pi^2",
    valid_range=(0.0, 0.5),
    range_basis=MEASURED_RANGE,
    nu_range=(0.5, 0.5),
    assumptions=("linear elasticity, no friction under the tip", "incompressible layer, nu = 0.5"),
    source=(
        "Managuli & Roy 2018, Asymptotical correction of bottom substrate effect arising in AFM indentation "
        "of thin samples and adherent cells using conical tips, Experimental Techniques"
    ),
    doi="10.1007/s40799-018-0268-8",
    factor=_cone,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.1   0.2  0.3  0.4  0.5  0.6  0.8   1  1.2  1.5
0.5  0.014  0.29  1.1  2.6  4.9  7.8   15  23   29   37
""",
    ),
)
