"""The paper, equation by equation: section 9, incremental stiffness and the modulus from it."""

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import underlay as ul
from support.reference_contact import solve
from support.series import blunt_cases, blunt_curve, depth_5_3, fifty_digits, force_5_2, order_of, series
from underlay.mechanics.asymptotic import blunt

__all__ = ["fifty_digits"]  # used by pytest


@blunt_cases
def test_eq_9_1_and_9_2_quotient(lam, moments):
    eps = mpf("0.21")
    numerator = mpmath.diff(lambda x: force_5_2(x, lam, moments), eps)
    denominator = mpmath.diff(lambda x: depth_5_3(x, lam, moments), eps)
    quotient = 4 * lam / (lam + 1) * numerator / denominator  # theta A F_1 = 4 lambda/(lambda+1) A F_2
    case = blunt_curve(float(lam), 1.0, 1.0, 1.0, moments, form="parametric")
    s = np.array([float(eps)])
    assert case.force(s)[1] / case.depth(s)[1] == pytest.approx(float(quotient), rel=1e-12)


@blunt_cases
def test_eq_9_3_does_not_depend_on_the_shape(lam, moments):
    b, c = blunt.kernel_terms(*moments)
    one = lam + 1
    kappa = blunt.kappa_infinity_coefficients(*moments)

    def residual(eps):
        above = 1 - c * (lam + 4) / one * eps**3
        below = 1 - b * eps - c * (2 * lam + 5) / one * eps**3 + b * c * (lam + 4) / one * eps**4
        return above / below - series(kappa, eps)

    assert order_of(residual) == pytest.approx(5.0, abs=0.02)


@blunt_cases
def test_eq_9_4_and_the_erratum_before_it(lam, moments):
    A, h = mpf("0.7"), mpf("0.01")
    F_2 = lam * 2 ** (lam - 2) * mpmath.gamma(lam / 2) ** 2 / mpmath.gamma(lam)
    w = A * F_2 * (mpf("0.3") * h) ** lam

    def varpi_of(depth):
        return (depth / (A * F_2)) ** (1 / lam) / h

    varpi = varpi_of(w)
    slope = mpmath.diff(varpi_of, w, h=w * mpf("1e-15"))
    # Erratum: h in the printed denominator must be h^lambda; as printed it is wrong by h^(lambda - 1).
    assert abs(slope * lam * F_2 * A * h**lam / varpi ** (1 - lam) - 1) < 1e-12
    assert abs(varpi ** (1 - lam) / (lam * F_2 * A * h) / slope / h ** (lam - 1) - 1) < 1e-12
    # (9.4) itself is the derivative of (8.1).
    C = blunt.force_coefficients(lam, *moments)
    force_slope = mpmath.diff(lambda x: x ** (lam + 1) * series(C, x), varpi)
    scale = 4 * lam / (lam + 1) * A * F_2 * h ** (lam + 1)
    if lam <= 7:
        case = blunt_curve(float(lam), float(A), 1.0, float(h), moments)
        s = case.start(np.array([float(w)]))
        assert case.force(s)[1] / case.depth(s)[1] == pytest.approx(
            float(scale * force_slope * slope), rel=1e-10
        )
        prefactor = (lam + 1) / lam * float(blunt.force_factor(float(lam))) * F_2 ** (1 / lam)
        assert abs(prefactor - 4) < 1e-12  # the identity after (9.4)


SUBSTRATES = {"rigid": ul.RIGID, "soft": ul.Isotropic(0.1, 0.3), "very soft": ul.Isotropic(1e-3, 0.3)}


@pytest.mark.parametrize("substrate", SUBSTRATES.values(), ids=SUBSTRATES)
@pytest.mark.parametrize("indenter", [ul.PowerLaw(1.5, 1.0), ul.Sphere(2.0)], ids=["power", "sphere"])
def test_eq_9_5_holds_exactly(indenter, substrate):
    layer = ul.Isotropic(1.0, 0.45)
    below, here, above = (solve(indenter, 0.7 * (1 + d), 1.0, layer, substrate) for d in (-1e-4, 0, 1e-4))
    slope = (above.force - below.force) / (above.depth - below.depth)
    # Central difference: 1e-8 times a second derivative of order one.
    assert slope == pytest.approx(4 * layer.theta * 0.7 * here.kappa_inf, rel=1e-7)


@pytest.mark.parametrize(
    "substrate", [*SUBSTRATES.values(), ul.Isotropic(20.0, 0.2)], ids=[*SUBSTRATES, "stiff"]
)
def test_eq_9_6_modulus_from_stiffness(substrate):
    layer, a, h = ul.Isotropic(1.3, 0.4), 0.5, 2.0

    punch = solve(ul.FlatPunch(a / h), a / h, 1.0, layer, substrate, nodes=20)
    stiffness = 4 * layer.theta * a * punch.kappa_inf
    known = {"nu": 0.4, "thickness": h, "substrate": substrate}
    E = ul.modulus_from_stiffness(stiffness, contact_radius=a, solver=ul.Exact(1e-11), **known)
    # Over the very soft base the modulus answers ten times the error of the force.
    assert pytest.approx(1.3, rel=1e-10) == E
    by_area = ul.modulus_from_stiffness(stiffness, contact_area=np.pi * a**2, solver=ul.Exact(1e-11), **known)
    assert by_area == pytest.approx(E, rel=1e-12)
    # Fourth order at a/h = 0.25: eps^5 = 1e-3 times a coefficient below one in kappa; over a very soft base
    # the stiffness is the base's, and the modulus answers ten times its error.
    tolerance = 0.02 if substrate == SUBSTRATES["very soft"] else 2e-3
    asymptotic = ul.modulus_from_stiffness(stiffness, contact_radius=a, solver="asymptotic", **known)
    assert asymptotic == pytest.approx(1.3, rel=tolerance)
