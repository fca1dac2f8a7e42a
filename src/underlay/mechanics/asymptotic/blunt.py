"""The blunt indenter Phi(r) = A r^lambda in closed form: sections 5, 7 and 8 of the paper.

Pure functions of the shape exponent lambda and of the kernel's first two moments a_0, a_1 (1.8); every
argument may be an array and broadcasts. The coefficients of a series come as a tuple in increasing order, in powers
of eps = a/h, of varpi = a_half/h (5.8), or of P~, the half-space radius at the force over h (8.3); a is the contact
radius, a_half that on a half-space at the same depth, h the thickness.
Throughout, b = 2 a_0/pi and c = 8 a_1/(3 pi), so that 16 a_0 a_1/(3 pi^2) = b c.

Source: Argatov and Sabina, asymptotic analysis of the substrate effect for an arbitrary indenter; paraboloid:
Argatov (2011), second order. Erratum used here: in (7.5) the printed 8 a_1 (lambda - 2)/(3 pi (lambda + 3))
must read (lambda + 2); with the printed sign neither (7.6) nor (7.7) follows.

`series` makes curves of depth, force and contact radius of them. `order`, 0 to 4, is the number of terms kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from underlay._arrays import FloatArray
from underlay.mechanics.body import Real
from underlay.mechanics.indenters import abel_factor

#: Coefficients of x, x^2, x^3, x^4 in 1 + ...
Series: TypeAlias = "tuple[Real, Real, Real, Real]"


def kernel_terms(a_0: Real, a_1: Real) -> tuple[Real, Real]:
    """Return (b, c) = (2 a_0/pi, 8 a_1/(3 pi)): the flat punch's 1/kappa = 1 - b eps - c eps^3 + O(eps^5).

    eps is a/h, contact radius over thickness. kappa is the flat punch's stiffness over that on a
    half-space. a_0 and a_1 are moments of the kernel (1.8).
    """
    return 2.0 * a_0 / np.pi, 8.0 * a_1 / (3.0 * np.pi)


def force_prefactor(exponent: Real) -> Real:
    """F_1(lambda) of (5.4): P = theta A F_1 a^(lambda+1) on a half-space.

    (5.4) is 4 lambda/(lambda+1) times F_2 of (5.5), which is finite at lambda = 200.

    The shape is A r^lambda, lambda = `exponent`. theta is the layer's elastic constant. Equation
    numbers are those of Argatov and Sabina.
    """
    return 4.0 * exponent / (exponent + 1.0) * abel_factor(exponent)


def force_factor(exponent: Real) -> Real:
    """F_3(lambda) of (5.10): P = theta A^(-1/lambda) F_3 w^(1+1/lambda) on a half-space.

    The shape is A r^lambda, lambda = `exponent`. theta is the layer's elastic constant. Equation
    numbers are those of Argatov and Sabina.
    """
    return 4.0 * exponent / (exponent + 1.0) * abel_factor(exponent) ** (-1.0 / exponent)


def radius_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """B_1..B_4 of (5.7): a/h = varpi (1 + B_1 varpi + ... + B_4 varpi^4), a the contact radius.

    varpi is the half-space contact radius at the depth over the thickness. Equation numbers are those
    of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one, three = exponent, exponent + 1.0, exponent + 3.0
    return (
        b / one,
        three / (2.0 * one**2) * b**2,
        (lam + 4.0) * (lam + 2.0) / (3.0 * one**3) * b**3 + (2.0 * lam + 5.0) / (one * three) * c,
        (2.0 * lam + 5.0) * (lam + 5.0) * (3.0 * lam + 5.0) / (24.0 * one**4) * b**4
        + (lam**2 + 11.0 * lam + 22.0) / (one**2 * three) * b * c,
    )


def force_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """C_1..C_4 of (5.9), of the force over the half-space's: f_lambda = 1 + C_1 varpi + ... (7.2).

    varpi is the half-space contact radius at the depth over the thickness. Equation numbers are those
    of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one, three = exponent, exponent + 1.0, exponent + 3.0
    return (
        b,
        (2.0 * lam + 3.0) / (2.0 * one) * b**2,
        (lam + 2.0) * (3.0 * lam + 4.0) / (3.0 * one**2) * b**3 + (lam + 2.0) / three * c,
        (2.0 * lam + 5.0) * (3.0 * lam + 5.0) * (4.0 * lam + 5.0) / (24.0 * one**3) * b**4
        + (2.0 * lam + 5.0) * (lam + 2.0) / (one * three) * b * c,
    )


def inverse_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """D_1..D_4 of (8.2): varpi = P~ (1 + D_1 P~ + ... + D_4 P~^4), the inverse of (8.1).

    The paper leaves them unwritten; (8.4) is their lambda-th power, whose second and fourth terms vanish.

    varpi is the half-space contact radius at the depth over the thickness. The shape is A r^lambda,
    lambda = `exponent`. P~ is the half-space contact radius at the force over the thickness. Equation
    numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one = exponent, exponent + 1.0
    beta, gamma = b / one, (lam + 2.0) / (one * (lam + 3.0)) * c
    return (
        -beta,
        (1.0 - lam) / 2.0 * beta**2,
        -(1.0 - lam) * (1.0 - 2.0 * lam) / 6.0 * beta**3 - gamma,
        (1.0 - lam) * (1.0 - 2.0 * lam) * (1.0 - 3.0 * lam) / 24.0 * beta**4 + (1.0 - lam) * beta * gamma,
    )


def scaled_contact_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """Coefficients of (7.3): varpi = eps (1 + ... eps + ... eps^4), the inverse of (5.7).

    varpi is the half-space contact radius at the depth over the thickness. eps is a/h, contact radius
    over thickness. Equation numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one, three = exponent, exponent + 1.0, exponent + 3.0
    return (
        -b / one,
        -(lam - 1.0) / (2.0 * one**2) * b**2,
        -(lam - 1.0) * (2.0 * lam - 1.0) / (6.0 * one**3) * b**3 - (2.0 * lam + 5.0) / (one * three) * c,
        -(lam - 1.0) * (2.0 * lam - 1.0) * (3.0 * lam - 1.0) / (24.0 * one**4) * b**4
        - (lam**2 - lam - 8.0) / (one**2 * three) * b * c,
    )


def parametric_depth_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """Coefficients of (5.3), depth w by contact radius: w = A F_2 a^lambda (1 + ... eps + ... eps^4).

    The second is zero.

    F_2(lambda) is `abel_factor`. eps is a/h, contact radius over thickness. Equation numbers are those
    of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one, three = exponent, exponent + 1.0, exponent + 3.0
    return (
        -lam / one * b,
        0.0 * b,
        -lam * (2.0 * lam + 5.0) / (one * three) * c,
        lam / one * b * c,
    )


def compliance_depth_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """Coefficients of (8.4), depth w by scaled force P~: w = A F_2 (P~ h)^lambda (1 + ... P~ + ... P~^4).

    The second and fourth are zero.

    F_2(lambda) is `abel_factor`. P~ is the half-space contact radius at the force over the thickness.
    Equation numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one = exponent, exponent + 1.0
    return -lam / one * b, 0.0 * b, -lam * (lam + 2.0) / (one * (lam + 3.0)) * c, 0.0 * b


def kappa_coefficients(exponent: Real, a_0: Real, a_1: Real) -> Series:
    """Coefficients of (7.5), erratum applied: kappa_lambda(eps) = 1 + ..., force over the half-space's.

    Both at the same depth, as a function of eps = a/h; (7.6) is lambda = 2.

    The shape is A r^lambda, lambda = `exponent`. Equation numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    lam, one, three = exponent, exponent + 1.0, exponent + 3.0
    two = 2.0 * lam + 1.0
    return (
        b,
        two / (2.0 * one) * b**2,
        two * (3.0 * lam + 1.0) / (6.0 * one**2) * b**3 + (lam + 2.0) / three * c,
        two * (3.0 * lam + 1.0) * (4.0 * lam + 1.0) / (24.0 * one**3) * b**4
        + (2.0 * lam**2 + 4.0 * lam - 1.0) / (one * three) * b * c,
    )


def kappa_infinity_coefficients(a_0: Real, a_1: Real) -> Series:
    """Coefficients of (7.7) and (9.3): the flat punch's kappa_inf(eps) = 1 + b eps + ..., lambda -> inf.

    The shape is A r^lambda, lambda = `exponent`. eps is a/h, contact radius over thickness. Equation
    numbers are those of Argatov and Sabina.
    """
    b, c = kernel_terms(a_0, a_1)
    return b, b**2, b**3 + c, b**4 + 2.0 * b * c


def kappa_infinity(eps: Real, a_0: Real, a_1: Real, *, order: int = 4, form: str = "explicit") -> FloatArray:
    """The flat punch's factor kappa_inf = dP/dw / (4 theta a) (9.5) at eps = a/h.

    The shape is A r^lambda, lambda = `exponent`. theta is the layer's elastic constant. Equation
    numbers are those of Argatov and Sabina.

    Parameters
    ----------
    eps, a_0, a_1 : float or ndarray
        Relative contact radius and the kernel's moments, broadcast together.
    order : int, default 4
        Terms kept, 0 to 4.
    form : str, default "explicit"
        ``"explicit"`` (7.7); ``"parametric"``, (9.2) at lambda = inf; ``"compliance"``,
        1/(1 - b eps - c eps^3), whose fourth-order term is exactly zero.

    Returns
    -------
    ndarray
        Not positive where the form has broken down.
    """
    if form == "explicit":
        return horner((1.0, *kappa_infinity_coefficients(a_0, a_1)[:order]), eps)
    b, c = kernel_terms(a_0, a_1)
    first = b * eps if order >= 1 else 0.0 * b * eps
    third = c * eps**3 if order >= 3 else 0.0 * c * eps
    if form == "compliance":
        return np.asarray(1.0 / (1.0 - first - third))
    cross = first * third if order >= 4 else 0.0
    return np.asarray((1.0 - third) / (1.0 - first - 2.0 * third + cross))


def horner(terms: Sequence[Real], x: Real) -> FloatArray:
    """Value of the polynomial with coefficients `terms` of 1, x, x^2, ..."""
    value = np.full_like(x, terms[-1])
    for term in terms[-2::-1]:
        value *= x
        value += term
    return value
