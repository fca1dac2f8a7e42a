"""Depth, force and contact radius of a blunt indenter by the asymptotic formulas, as pure functions of arrays.

Every argument broadcasts: parameter sets as (batch, 1) against depths or forces (n,) give (batch, n), which
is what a fit or a map of many curves calls. `AsymptoticLaw` checks ranges and errors; these do not.

theta (Pa) is the layer's elastic constant, A (m^(1-lambda)) and lambda the shape Phi = A r^lambda (5.1),
h (m) the thickness, a_0 and a_1 the kernel's moments (1.8), `order` 0 to 4 the terms kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.body import Real
from underlay.mechanics.indenters import abel_factor


class BluntLayer(NamedTuple):
    """A power-law indenter A r^lambda on a layer: lambda, A (m^(1-lambda)), theta (Pa), h (m), a_0, a_1.

    theta is the layer's elastic constant, h its thickness, a_0 and a_1 the kernel's moments (1.8); floats or
    arrays.
    """

    exponent: Real
    coefficient: Real
    theta: Real
    thickness: Real
    a_0: Real
    a_1: Real

    @property
    def shape_and_moments(self) -> tuple[Real, Real, Real]:
        """(lambda, a_0, a_1): the arguments of the coefficients in `blunt`.

        The shape is A r^lambda.
        """
        return self.exponent, self.a_0, self.a_1


def scaled_depth(depth: FloatArray, case: BluntLayer) -> FloatArray:
    """varpi, the half-space contact radius at `depth` (m) over the thickness: (w/(A F_2))^(1/lambda)/h (5.8).

    w is the depth, and F_2(lambda) the factor of (5.5), `abel_factor`.

    The shape is A r^lambda. Equation numbers are those of Argatov and Sabina.
    """
    scale = case.coefficient * abel_factor(case.exponent)
    return np.asarray((depth / scale) ** (1.0 / case.exponent) / case.thickness)


def scaled_force(force: FloatArray, case: BluntLayer) -> FloatArray:
    """P~, the half-space contact radius at `force` (N) over the thickness: (P/(theta A F_1))^(1/(lambda+1))/h.

    Equation (8.3) of the paper, with P the force and F_1(lambda) of (5.4).

    The shape is A r^lambda. theta is the layer's elastic constant.
    """
    scale = case.theta * case.coefficient * blunt.force_prefactor(case.exponent)
    return np.asarray((force / scale) ** (1.0 / (case.exponent + 1.0)) / case.thickness)


def explicit_force(depth: FloatArray, case: BluntLayer, order: int = 4) -> FloatArray:
    """Force (N) at `depth` w (m): (5.9) in the form (8.1), 4 theta lambda/(lambda+1) w varpi h f_lambda.

    varpi is `scaled_depth`, and f_lambda the series in it, kept up to `order`.

    varpi is the half-space contact radius at the depth over the thickness. The shape is A r^lambda.
    theta is the layer's elastic constant. Equation numbers are those of Argatov and Sabina.
    """
    varpi = scaled_depth(depth, case)
    factor = blunt.truncated(blunt.force_coefficients(*case.shape_and_moments), varpi, order)
    lam = case.exponent
    return np.asarray(4.0 * case.theta * lam / (lam + 1.0) * depth * varpi * case.thickness * factor)


def explicit_radius(depth: FloatArray, case: BluntLayer, order: int = 4) -> FloatArray:
    """Contact radius (m) at `depth` (m): the series (5.7), kept up to `order`.

    Equation numbers are those of Argatov and Sabina.
    """
    varpi = scaled_depth(depth, case)
    return np.asarray(
        case.thickness
        * varpi
        * blunt.truncated(blunt.radius_coefficients(*case.shape_and_moments), varpi, order)
    )


def explicit_stiffness(depth: FloatArray, case: BluntLayer, order: int = 4) -> FloatArray:
    """dP/dw (N/m) at `depth` w (m): the series (9.4), kept up to `order`; its prefactor is 4 theta h varpi.

    varpi is the half-space contact radius at the depth over the thickness. theta is the layer's elastic
    constant. Equation numbers are those of Argatov and Sabina.
    """
    varpi = scaled_depth(depth, case)
    one = case.exponent + 1.0
    weighted = [
        c * (one + n) / one for n, c in enumerate(blunt.force_coefficients(*case.shape_and_moments), start=1)
    ]
    series = blunt.truncated((weighted[0], weighted[1], weighted[2], weighted[3]), varpi, order)
    return np.asarray(4.0 * case.theta * case.thickness * varpi * series)


def parametric_depth(radius: FloatArray, case: BluntLayer, order: int = 4) -> FloatArray:
    """Depth (m) at contact `radius` (m): the series (5.3), kept up to `order`.

    Equation numbers are those of Argatov and Sabina.
    """
    series = blunt.truncated(
        blunt.parametric_depth_coefficients(*case.shape_and_moments), radius / case.thickness, order
    )
    return np.asarray(case.coefficient * abel_factor(case.exponent) * radius**case.exponent * series)


def parametric_stiffness(radius: FloatArray, case: BluntLayer) -> FloatArray:
    """dP/dw (N/m) at contact `radius` (m), fourth order: (9.2), the quotient (9.1) of (5.2) and (5.3).

    Equation numbers are those of Argatov and Sabina.
    """
    b, c = blunt.kernel_terms(case.a_0, case.a_1)
    lam, one, eps = case.exponent, case.exponent + 1.0, radius / case.thickness
    above = 1.0 - c * (lam + 4.0) / one * eps**3
    below = 1.0 - b * eps - c * (2.0 * lam + 5.0) / one * eps**3 + b * c * (lam + 4.0) / one * eps**4
    return np.asarray(4.0 * case.theta * radius * above / below)


def compliance_depth(force: FloatArray, case: BluntLayer, order: int = 4) -> FloatArray:
    """Depth (m) at `force` (N): the series (8.4), kept up to `order`.

    Equation numbers are those of Argatov and Sabina.
    """
    scaled = scaled_force(force, case)
    series = blunt.truncated(blunt.compliance_depth_coefficients(*case.shape_and_moments), scaled, order)
    depth = case.coefficient * abel_factor(case.exponent) * (case.thickness * scaled) ** case.exponent
    return np.asarray(depth * series)


def compliance_radius(force: FloatArray, case: BluntLayer, order: int = 4) -> FloatArray:
    """Contact radius (m) at `force` (N): the series (8.5), kept up to `order`.

    Equation numbers are those of Argatov and Sabina.
    """
    scaled = scaled_force(force, case)
    c = blunt.kernel_terms(case.a_0, case.a_1)[1] if order >= 3 else 0.0
    return np.asarray(case.thickness * scaled * (1.0 + c / (case.exponent + 1.0) * scaled**3))
