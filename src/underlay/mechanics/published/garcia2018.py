"""Garcia and Garcia (2018): sphere, cone and flat punch on a layer bonded to a rigid base, nu = 0.5.

Fourth-order expansions of the exact contact problem, with the contact radius corrected for the base: the
best polynomials in use. The prefactor keeps the layer's own E/(1 - nu^2).
"""

from __future__ import annotations

from underlay.mechanics.published.correction import (
    LAYER_NU,
    MEASURED_RANGE,
    RIGID_BONDED,
    LayerContact,
    MeasuredError,
    PolynomialFactor,
    PublishedCorrection,
)

_SOURCE = "Garcia & Garcia 2018, Biophysical Journal 114, 2923-2932"
_DOI = "10.1016/j.bpj.2018.05.012"
_ASSUMPTIONS = ("linear elasticity, no friction under the tip", "incompressible layer, nu = 0.5")


def _sphere(_contact: LayerContact) -> PolynomialFactor:
    return PolynomialFactor((1.0, 1.133, 1.497, 1.469, 0.755))


def _cone(_contact: LayerContact) -> PolynomialFactor:
    return PolynomialFactor((1.0, 0.721, 0.650, 0.491, 0.225))


def _punch(_contact: LayerContact) -> PolynomialFactor:
    return PolynomialFactor((1.0, 1.133, 1.283, 0.598, -0.291))


SPHERE = PublishedCorrection(
    name="garcia2018",
    indenter="sphere",
    substrate=RIGID_BONDED,
    equation="P/P_Hertz = 1 + 1.133 X + 1.497 X^2 + 1.469 X^3 + 0.755 X^4",
    valid_range=(0.0, 0.75),
    range_basis=MEASURED_RANGE,
    nu_range=(0.5, 0.5),
    assumptions=(*_ASSUMPTIONS, "d much smaller than R"),
    source=_SOURCE,
    doi=_DOI,
    factor=_sphere,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.1   0.2   0.3   0.4   0.5  0.6  0.8   1  1.2  1.5
0.5  0.065  0.12  0.15  0.27  0.72  1.8  6.5  15   26   45
""",
    ),
)

CONE = PublishedCorrection(
    name="garcia2018",
    indenter="cone",
    substrate=RIGID_BONDED,
    equation="P/P_Sneddon = 1 + 0.721 y + 0.650 y^2 + 0.491 y^3 + 0.225 y^4",
    valid_range=(0.0, 1.2),
    range_basis=MEASURED_RANGE,
    nu_range=(0.5, 0.5),
    assumptions=_ASSUMPTIONS,
    source=_SOURCE,
    doi=_DOI,
    factor=_cone,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.1    0.2    0.3    0.4   0.5   0.6   0.8    1  1.2  1.5
0.5  0.039  0.072  0.079  0.079  0.12  0.26  0.31  1.5  4.9   14
""",
    ),
)

PUNCH = PublishedCorrection(
    name="garcia2018",
    indenter="flat punch",
    substrate=RIGID_BONDED,
    equation="P/P_halfspace = 1 + 1.133 eps + 1.283 eps^2 + 0.598 eps^3 - 0.291 eps^4",
    valid_range=(0.0, 1.9),
    range_basis=MEASURED_RANGE,
    nu_range=(0.5, 0.5),
    assumptions=_ASSUMPTIONS,
    source=_SOURCE,
    doi=_DOI,
    factor=_punch,
    measured_error=MeasuredError.from_table(
        (LAYER_NU,),
        """
       0.1   0.2   0.3   0.4   0.5   0.6  0.8    1  1.5    2
0.5  0.064  0.13  0.21  0.34  0.57  0.92  1.9  2.9  3.4  6.9
""",
    ),
)
