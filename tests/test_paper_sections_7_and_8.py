"""The paper, equation by equation: sections 7 and 8, scaling factors and depth from force."""

import numpy as np
import pytest
from mpmath import mpf

import underlay as ul
from support.reference_contact import solve
from support.series import (
    MOMENTS,
    blunt_cases,
    blunt_curve,
    depth_5_3,
    fifty_digits,
    force_5_2,
    order_of,
    series,
)
from underlay.mechanics.asymptotic import blunt

__all__ = ["fifty_digits"]  # used by pytest


def kappa_residual(lam, moments, K):
    def residual(eps):
        scaled_force = force_5_2(eps, lam, moments)
        varpi = depth_5_3(eps, lam, moments) ** (1 / lam)
        return scaled_force / varpi ** (lam + 1) / series(K, eps) - 1

    return residual


def test_eq_7_1_and_7_2_scaling_factor():
    case, halfspace = (blunt_curve(3.0, 0.8, 2.0, 1.0, moments) for moments in ((1.2, -0.5), (0.0, 0.0)))
    depth = np.linspace(0.01, 0.1, 5)
    varpi = case.start(depth)
    ratio = case.load(depth, varpi) / halfspace.load(depth, varpi)
    assert np.allclose(ratio, series(blunt.force_coefficients(3.0, 1.2, -0.5), varpi), rtol=1e-13)
    F_3 = float(blunt.force_factor(3.0))
    printed = 2.0 * 0.8 ** (-1 / 3) * F_3 * depth ** (4 / 3)
    assert np.allclose(halfspace.load(depth, varpi), printed, rtol=1e-13)


@blunt_cases
def test_eq_7_3_depth_series(lam, moments):
    coefficients = blunt.scaled_contact_coefficients(lam, *moments)

    def residual(eps):
        return depth_5_3(eps, lam, moments) ** (1 / lam) / (eps * series(coefficients, eps)) - 1

    # At lambda = 1 (5.3) is its own series, and nothing is left.
    assert residual(mpf("1e-7")) == pytest.approx(0.0, abs=1e-45) or order_of(residual) > 4.99


@blunt_cases
def test_eq_7_4_and_7_5_kappa_and_its_erratum(lam, moments):
    K = blunt.kappa_coefficients(lam, *moments)
    assert order_of(kappa_residual(lam, moments, K)) == pytest.approx(5.0, abs=0.02)
    # Erratum: as printed, 8 a_1 (lambda - 2)/(3 pi (lambda + 3)), the third order is off by 4 c/(lambda + 3).
    c = blunt.kernel_terms(*moments)[1]
    printed = (*K[:2], K[2] - 4 * c / (lam + 3), K[3])
    assert order_of(kappa_residual(lam, moments, printed)) == pytest.approx(3.0, abs=0.02)
    eps = mpf("1e-6")
    assert kappa_residual(lam, moments, printed)(eps) / eps**3 == pytest.approx(
        float(4 * c / (lam + 3)), rel=1e-3
    )


def test_eq_7_6_paraboloid_kappa():
    a_0, a_1, pi = 1.3, -0.6, np.pi
    assert blunt.kappa_coefficients(2.0, a_0, a_1) == pytest.approx(
        [
            2 * a_0 / pi,
            10 * a_0**2 / (3 * pi**2),
            140 * a_0**3 / (27 * pi**3) + 32 * a_1 / (15 * pi),
            70 * a_0**4 / (9 * pi**4) + 16 * a_0 * a_1 / (3 * pi**2),
        ],
        rel=1e-14,
    )


@pytest.mark.parametrize("moments", MOMENTS)
def test_eq_7_7_is_the_limit_of_7_5(moments):
    a_0, a_1 = (float(m) for m in moments)
    limit = blunt.kappa_infinity_coefficients(a_0, a_1)
    for lam in (1e4, 1e8):
        assert blunt.kappa_coefficients(lam, a_0, a_1) == pytest.approx(limit, rel=20 / lam)


@pytest.mark.parametrize("form", ["explicit", "parametric", "compliance"])
def test_eq_7_7_against_the_exact_flat_punch(form):
    layer = ul.Isotropic(1.0, 0.5)
    eps = np.array([0.05, 0.07, 0.1])
    exact = [solve(ul.FlatPunch(e), e, 1.0, layer, ul.RIGID).kappa_inf for e in eps]
    error = np.abs(blunt.kappa_infinity(eps, 1.77021677337, -0.957769288898, form=form) / exact - 1)
    # The slope of an order-4 error is 5; the next term, eps^6, shifts it by less than 0.6 at 0.1.
    assert np.polyfit(np.log(eps), np.log(error), 1)[0] == pytest.approx(5.0, abs=0.6)


def test_eq_8_1_and_8_3_force_in_varpi():
    case, compliance = (
        blunt_curve(3.0, 0.8, 2.0, 1.5, (1.2, -0.5), form=form) for form in ("explicit", "compliance")
    )
    depth = np.linspace(0.01, 0.1, 5)
    s = case.start(depth)
    varpi = s / 1.5
    f = series(blunt.force_coefficients(3.0, 1.2, -0.5), varpi)
    printed = 2.0 * 0.8 * float(blunt.force_prefactor(3.0)) * 1.5**4 * varpi**4 * f
    assert np.allclose(case.load(depth, s), printed, rtol=1e-13)
    # (8.3): the compliance form's parameter is the half-space radius at the force.
    assert np.allclose(compliance.force(s * f**0.25)[0], printed, rtol=1e-13)


@blunt_cases
def test_eq_8_2_inverts_8_1(lam, moments):
    C = blunt.force_coefficients(lam, *moments)
    D = blunt.inverse_coefficients(lam, *moments)

    def residual(varpi):
        scaled = varpi * series(C, varpi) ** (1 / (lam + 1))
        return scaled * series(D, scaled) / varpi - 1

    assert order_of(residual) == pytest.approx(5.0, abs=0.01)


@blunt_cases
def test_eq_8_4_is_8_2_to_the_power_lambda(lam, moments):
    D = blunt.inverse_coefficients(lam, *moments)
    W = blunt.compliance_depth_coefficients(lam, *moments)
    if lam == 1:
        assert [float(d) for d in D] == pytest.approx([float(w) for w in W], abs=1e-15)
    else:
        order = order_of(lambda scaled: series(D, scaled) ** lam - series(W, scaled))
        assert order == pytest.approx(5.0, abs=0.05)


@blunt_cases
def test_eq_8_5_radius_from_force_follows_from_5_2(lam, moments):
    c = blunt.kernel_terms(*moments)[1]

    def residual(eps):
        scaled = force_5_2(eps, lam, moments) ** (1 / (lam + 1))
        return scaled * (1 + c / (lam + 1) * scaled**3) / eps - 1

    assert order_of(residual, decade=4) > 4.99  # the paper's order; in fact eps^6


def test_eq_8_4_and_8_5_as_arrays():
    case = blunt_curve(2.0, 0.5, 2.0, 1.5, (1.2, -0.5), form="compliance")
    scaled = np.linspace(0.1, 0.3, 4)
    force = case.force(1.5 * scaled)[0]
    lam, F_3 = 2.0, float(blunt.force_factor(2.0))
    bracket = 1 - 2 * lam * 1.2 / (np.pi * 3) * scaled
    bracket -= 8 * lam * 4 * -0.5 / (3 * np.pi * 3 * 5) * scaled**3
    printed = 0.5 ** (1 / 3) * (force / (2.0 * F_3)) ** (2 / 3) * bracket
    assert np.allclose(case.depth(1.5 * scaled)[0], printed, rtol=1e-13)
    radius = 1.5 * scaled * (1 + 8 * -0.5 / (3 * np.pi * 3) * scaled**3)
    assert np.allclose(case.radius(1.5 * scaled), radius, rtol=1e-13)
