"""Quadrature rules: exact on the polynomials they promise."""

import mpmath as mp
import numpy as np
import pytest

from underlay.mechanics.exact.nodes import even_rule, legendre_rule


@pytest.mark.parametrize("count", [2, 4, 24, 64, 130, 400])
def test_gauss_legendre_is_exact_and_precise(count):
    x, weights = legendre_rule(count)
    assert (np.diff(x) > 0.0).all()
    # int cos(k x) = 2 sin(k)/k, resolved once k is well below the count; what is left is rounding.
    for k in (1e-4, 0.3 * count) if count > 20 else (1e-4,):
        assert weights @ np.cos(k * x) == pytest.approx(2.0 * np.sin(k) / k, abs=4e-15)
    degree = 2 * count - 2
    assert weights @ x**degree == pytest.approx(2.0 / (degree + 1), rel=1e-12)


@pytest.mark.parametrize("count", [1, 2, 5, 16, 45])
def test_the_even_rule_integrates_even_polynomials(count):
    rule = even_rule(count)
    for degree in (0, 2, 4 * count - 2):
        assert rule.weights @ rule.nodes**degree == pytest.approx(1.0 / (degree + 1), rel=1e-13)
    np.testing.assert_array_equal(rule.with_edge, np.append(rule.nodes, 1.0))


@pytest.mark.parametrize("exponent", [1.0, 1.0001, 1.5, 2.0, 4.0, 200.0])
def test_power_weights_are_exact_for_any_exponent(exponent):
    rule = even_rule(9)
    weights = rule.power_weights(exponent)
    for degree in (0, 2, 16):
        assert weights @ rule.nodes**degree == pytest.approx(1.0 / (exponent + degree + 1.0), rel=1e-12)


def test_power_weights_of_a_cosine():
    with mp.workdps(25):
        exact = float(mp.quad(lambda x: x ** mp.mpf(1.5) * mp.cos(3 * x), [0, 0.1, 1]))
    rule = even_rule(10)
    # Interpolation of cos 3x by even polynomials of degree 18: (3/2)^20/20! = 1e-15.
    assert rule.power_weights(1.5) @ np.cos(3.0 * rule.nodes) == pytest.approx(exact, rel=1e-13)
