"""The paper, equation by equation: section 6, the hemisphere."""

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import underlay as ul
from support.laws import asymptotic_law
from support.series import fifty_digits, order_of
from underlay.mechanics.asymptotic import integral_relations as hemisphere

__all__ = ["fifty_digits"]  # used by pytest


ALPHAS = [mpf("0.001"), mpf("0.1"), mpf("0.49"), mpf("0.51"), mpf("0.9")]


def log_ratio(alpha):
    return mpmath.log((1 + alpha) / (1 - alpha))


def load_6_9(alpha):
    return (1 + alpha**2) * log_ratio(alpha) - 2 * alpha


def depth_6_4(alpha, mu, a_0, a_1):
    ln, pi = log_ratio(alpha), mpmath.pi
    return (
        alpha / 2 * ln
        - mu * a_0 / (2 * pi) * load_6_9(alpha)
        + mu**3 * a_1 / (6 * pi) * (2 * alpha * (7 * alpha**2 + 3) - (7 * alpha**4 + 6 * alpha**2 + 3) * ln)
        + mu**4 * 4 * a_0 * a_1 / (3 * pi**2) * alpha**3 * load_6_9(alpha)
    )


def alpha_3_of_6_8(alpha, a_1):
    square = 1 - alpha**2
    numerator = alpha**2 * square * load_6_9(alpha)
    return 4 * a_1 / (3 * mpmath.pi) * numerator / (square * log_ratio(alpha) + 2 * alpha)


def depth_6_11(alpha, mu, a_0, a_1):
    third = (3 * alpha**4 + 2 * alpha**2 + 3) * log_ratio(alpha) - 6 * alpha * (1 + alpha**2)
    first = alpha / 2 * log_ratio(alpha) - mu * a_0 / (2 * mpmath.pi) * load_6_9(alpha)
    return first - mu**3 * a_1 / (6 * mpmath.pi) * third


@pytest.mark.parametrize("alpha", ALPHAS)
def test_eq_6_1_and_6_2_hemisphere_integrals(alpha):
    sphere, a = ul.Sphere(1.0), np.array(float(alpha))
    ln = log_ratio(alpha)
    second = -alpha / 2 + (1 + alpha**2) / 4 * ln
    third = alpha / 4 + alpha**3 / 12 - (1 - alpha**4) / 8 * ln
    assert float(sphere.surface(a)) == pytest.approx(float(1 - mpmath.sqrt(1 - alpha**2)), rel=1e-14)
    assert float(sphere.abel(a)) == pytest.approx(float(alpha / 2 * ln), rel=1e-14)
    moments = sphere.abel_moments(a)
    assert float(a * sphere.abel(a) - moments[0]) == pytest.approx(float(second), rel=1e-13)
    assert float(moments[1]) == pytest.approx(float(third), rel=1e-13)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_eq_6_3_and_6_4_and_6_5_hemisphere_parametric(alpha):
    mu, a_0, a_1 = 0.8, 1.377, -0.628
    a = np.array([float(alpha)])
    load = float(load_6_9(alpha) * (1 - mu**3 * alpha**3 * 8 * a_1 / (3 * mpmath.pi)))
    depth = float(depth_6_4(alpha, mpf(mu), mpf(a_0), mpf(a_1)))
    assert hemisphere.parametric_load(a, mu, a_1)[0] == pytest.approx(load, rel=1e-13)
    assert hemisphere.parametric_depth(a, mu, a_0, a_1)[0] == pytest.approx(depth, rel=1e-13)


def test_eq_6_3_and_6_4_are_the_parametric_law_of_a_sphere():
    R, h, layer = 2.0, 2.5, ul.Isotropic(3.0, 0.3)
    law = asymptotic_law(ul.Sphere(R), ul.Layer(layer, h), ul.RIGID, 0.2, form="parametric")
    alpha = np.linspace(0.05, 0.3, 6)
    a_0, a_1 = 1.3768541654643, -0.62755166138354
    depth = R * hemisphere.parametric_depth(alpha, R / h, a_0, a_1)
    force = layer.theta * R**2 * hemisphere.parametric_load(alpha, R / h, a_1)
    assert np.allclose(law.force(depth), force, rtol=1e-11)
    assert np.allclose(law.contact_radius(depth), R * alpha, rtol=1e-11)


@pytest.mark.parametrize("alpha_0", ALPHAS[1:])
def test_eq_6_6_and_6_7_and_6_8_and_6_10_england_radius(alpha_0):
    a_1 = mpf("-0.628")
    load, third = load_6_9(alpha_0), alpha_3_of_6_8(alpha_0, a_1)

    def remainder(mu):
        def excess(a):
            return load_6_9(a) * (1 - mu**3 * a**3 * 8 * a_1 / (3 * mpmath.pi)) - load

        return (mpmath.findroot(excess, alpha_0) - alpha_0) / (mu**3 * third) - 1

    # alpha_1 = alpha_2 = alpha_4 = 0: after alpha_3 comes mu^6, so the ratio is off by mu^3.
    assert order_of(remainder, decade=4) == pytest.approx(3.0, abs=0.01)
    mu = 0.5
    mine = hemisphere.england_radius(np.array([float(alpha_0)]), mu, float(a_1))[0]
    assert mine == pytest.approx(float(alpha_0 + mu**3 * third), rel=1e-13)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_eq_6_9_halfspace_root(alpha):
    load = np.array([float(load_6_9(alpha))])
    assert hemisphere.halfspace_alpha(load)[0] == pytest.approx(float(alpha), rel=1e-13)
    assert hemisphere.halfspace_load(np.array([float(alpha)]))[0] == pytest.approx(load[0], rel=1e-13)


@pytest.mark.parametrize("alpha_0", ALPHAS[1:])
def test_eq_6_11_england_depth(alpha_0):
    a_0, a_1 = mpf("1.377"), mpf("-0.628")
    third = alpha_3_of_6_8(alpha_0, a_1)

    def residual(mu):
        return depth_6_4(alpha_0 + mu**3 * third, mu, a_0, a_1) - depth_6_11(alpha_0, mu, a_0, a_1)

    assert order_of(residual, decade=4) > 4.99  # O(mu^5), as the paper says; in fact mu^6
    mine = hemisphere.england_depth(np.array([float(alpha_0)]), 0.5, float(a_0), float(a_1))[0]
    assert mine == pytest.approx(float(depth_6_11(alpha_0, mpf("0.5"), a_0, a_1)), rel=1e-13)


def test_eq_6_10_and_6_11_are_the_compliance_law_of_a_sphere():
    R, h, layer, base = 2.0, 2.5, ul.Isotropic(3.0, 0.3), ul.Isotropic(0.6, 0.3)
    law = asymptotic_law(ul.Sphere(R), ul.Layer(layer, h), base, 0.2, form="compliance")
    b, c = law.series.b, law.series.c
    a_0, a_1 = b * np.pi / 2, c * 3 * np.pi / 8
    alpha_0 = np.linspace(0.05, 0.3, 6)
    depth = R * hemisphere.england_depth(alpha_0, R / h, a_0, a_1)
    assert np.allclose(law.force(depth), layer.theta * R**2 * hemisphere.halfspace_load(alpha_0), rtol=1e-11)
    radius = R * hemisphere.england_radius(alpha_0, R / h, a_1)
    assert np.allclose(law.contact_radius(depth), radius, rtol=1e-11)
