"""The paper, equation by equation: section 5, the blunt indenter."""

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import underlay as ul
from support.series import blunt_cases, blunt_curve, depth_5_3, fifty_digits, force_5_2, order_of, series
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.indenters import abel_factor

__all__ = ["fifty_digits"]  # used by pytest

EXPONENTS = [1.0, 1.0001, 1.5, 2.0, 3.0, 7.0, 50.0, 200.0]


def test_eq_5_1_shape():
    r = np.array([0.0, 0.5, 2.0])
    assert np.allclose(ul.PowerLaw(1.5, 3.0).surface(r), 3.0 * r**1.5, rtol=1e-15)


@pytest.mark.parametrize("lam", EXPONENTS)
def test_eq_5_4_and_5_5_and_5_10_factors(lam):
    gamma = mpmath.gamma
    x = mpf(lam)
    F_1 = x**2 * 2**x / (x + 1) * gamma(x / 2) ** 2 / gamma(x)
    F_2 = x * 2 ** (x - 2) * gamma(x / 2) ** 2 / gamma(x)
    F_3 = x ** ((x - 1) / x) * 2 ** ((x + 2) / x) / (x + 1) * gamma(x / 2) ** (-2 / x) * gamma(x) ** (1 / x)
    # A beta function of two gammas near lambda/2 = 100 loses some digits of ln Gamma: 1e-13.
    for mine, exact in (
        (blunt.force_prefactor(lam), F_1),
        (abel_factor(lam), F_2),
        (blunt.force_factor(lam), F_3),
    ):
        assert abs(float(mine) / float(exact) - 1.0) < 1e-13
    integral = mpmath.quad(lambda t: mpmath.sin(t) ** (x + 1), [0, mpmath.pi / 4, mpmath.pi / 2])
    assert abs(integral / (F_1 / 4 / x) - 1) < 1e-15  # the integral above (5.2)


@blunt_cases
def test_eq_5_2_and_5_3_are_4_14_and_4_15_for_a_power_law(lam, moments):
    # (4.14) and (4.15) in H and its moments, H = eps^lambda for A F_2 = h = 1.
    a_0, a_1 = moments
    eps, pi = mpf("0.37"), mpf(np.pi)
    H, N, M = eps**lam, lam / (lam + 1) * eps ** (lam + 1), eps ** (lam + 3) / (lam + 3)
    force = (1 - 8 * a_1 / (3 * pi) * eps**3) * N * (lam + 1) / lam
    bracket = a_0 + 2 * a_1 * eps**2 - 8 * a_0 * a_1 / (3 * pi) * eps**3
    depth = (1 - 4 * a_1 / (3 * pi) * eps**3) * H + 4 * a_1 / pi * M - 2 / pi * bracket * N
    assert abs(force / force_5_2(eps, lam, moments) - 1) < 1e-14
    assert abs(depth / depth_5_3(eps, lam, moments) - 1) < 1e-14


@blunt_cases
def test_eq_5_7_radius_series_inverts_5_3(lam, moments):
    B = blunt.radius_coefficients(lam, *moments)

    def residual(eps, B=B):
        varpi = depth_5_3(eps, lam, moments) ** (1 / lam)
        return varpi * series(B, varpi) / eps - 1

    assert order_of(residual) == pytest.approx(5.0, abs=0.01)
    wrong = (*B[:3], B[3] * mpf("1.001"))
    assert order_of(lambda eps: residual(eps, wrong)) == pytest.approx(4.0, abs=0.01)


def test_eq_5_6_and_5_8_dimensionless_depth():
    case = blunt_curve(2.0, 0.5 / 3.0, 1.0, 0.1, (0.0, 0.0), form="parametric")  # R = 3, h = 0.1
    assert case.start(np.array([0.02]))[0] == pytest.approx(np.sqrt(3.0 * 0.02))
    assert case.depth(np.array([0.3]))[0][0] == pytest.approx(0.3**2 / 3.0)


@blunt_cases
def test_eq_5_9_and_5_9a_force_series_follows_from_5_2_and_5_7(lam, moments):
    C = blunt.force_coefficients(lam, *moments)

    def residual(eps, C=C):
        varpi = depth_5_3(eps, lam, moments) ** (1 / lam)
        return varpi ** (lam + 1) * series(C, varpi) / force_5_2(eps, lam, moments) - 1

    assert order_of(residual) == pytest.approx(5.0, abs=0.01)
    wrong = (*C[:3], C[3] * mpf("1.001"))
    assert order_of(lambda eps: residual(eps, wrong)) == pytest.approx(4.0, abs=0.01)


def test_eq_5_9_is_the_explicit_law():
    depth = np.geomspace(1e-6, 0.3, 20)
    case = blunt_curve(1.5, 0.8, 3.0, 1.0, (1.377, -0.628))
    varpi = (depth / (0.8 * float(abel_factor(1.5)))) ** (1 / 1.5)
    C = blunt.force_coefficients(1.5, 1.377, -0.628)
    printed = (
        3.0 * 0.8 ** (-1 / 1.5) * float(blunt.force_factor(1.5)) * depth ** (1 + 1 / 1.5) * series(C, varpi)
    )
    assert np.allclose(case.load(depth, case.start(depth)), printed, rtol=1e-13)


def test_eq_5_11_paraboloid_coefficients():
    a_0, a_1, pi = 1.3, -0.6, np.pi
    assert ul.Paraboloid(2.0).surface(np.array(0.4)) == pytest.approx(0.04)
    assert float(blunt.force_prefactor(2.0)) == pytest.approx(16 / 3, rel=1e-15)
    assert float(abel_factor(2.0)) == pytest.approx(2, rel=1e-15)
    assert float(blunt.force_factor(2.0)) == pytest.approx(4 * np.sqrt(2) / 3, rel=1e-15)
    assert blunt.radius_coefficients(2.0, a_0, a_1) == pytest.approx(
        [
            2 * a_0 / (3 * pi),
            10 * a_0**2 / (9 * pi**2),
            64 * a_0**3 / (27 * pi**3) + 8 * a_1 / (5 * pi),
            154 * a_0**4 / (27 * pi**4) + 256 * a_0 * a_1 / (45 * pi**2),
        ],
        rel=1e-14,
    )
    assert blunt.force_coefficients(2.0, a_0, a_1) == pytest.approx(
        [
            2 * a_0 / pi,
            14 * a_0**2 / (3 * pi**2),
            320 * a_0**3 / (27 * pi**3) + 32 * a_1 / (15 * pi),
            286 * a_0**4 / (9 * pi**4) + 64 * a_0 * a_1 / (5 * pi**2),
        ],
        rel=1e-14,
    )


def test_eq_5_12_and_5_13_cone():
    a_0, a_1, h, theta, half_angle = 1.3, -0.6, 2.0, 5.0, 1.2
    cot, w, pi = np.tan(half_angle), np.linspace(0.01, 0.1, 5), np.pi  # gamma is the complement
    x = cot * w / h
    radius = 1 + 2 * a_0 / pi**2 * x + 8 * a_0**2 / pi**4 * x**2
    radius += (40 * a_0**3 / pi**6 + 56 * a_1 / (3 * pi**4)) * x**3
    radius += (224 * a_0**4 / pi**8 + 544 * a_0 * a_1 / (3 * pi**6)) * x**4
    force = 1 + 4 * a_0 / pi**2 * x + 20 * a_0**2 / pi**4 * x**2
    force += (112 * a_0**3 / pi**6 + 16 * a_1 / pi**4) * x**3
    force += (672 * a_0**4 / pi**8 + 224 * a_0 * a_1 / pi**6) * x**4
    case = blunt_curve(1.0, ul.Cone(half_angle).coefficient, theta, h, (a_0, a_1))
    s = case.start(w)
    assert np.allclose(case.radius(s), 2 * cot / pi * w * radius, rtol=1e-13)
    assert np.allclose(case.load(w, s), 4 * theta * cot / pi * w**2 * force, rtol=1e-13)
