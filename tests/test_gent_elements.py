"""The finite elements of the studies: the tangent of a Gent solid, and its limits."""

import numpy as np
import pytest

from support import finite_elements as elements


@pytest.mark.parametrize("limit", [np.inf, 0.5])
def test_the_tangent_is_the_derivative_of_the_stress(limit):
    strain = 0.1 * np.random.default_rng(0).standard_normal((5, 1, 1))
    pressure = elements._gent(strain, 0.4, limit, np.zeros((1, 1))).pressure
    tangent = elements._gent(strain, 0.4, limit, pressure).tangent
    for j in range(5):
        step = np.zeros((5, 1, 1))
        step[j] = 1e-6
        up, down = (elements._gent(strain + s * step, 0.4, limit, pressure).stress for s in (1.0, -1.0))
        assert tangent[:, j, 0, 0] == pytest.approx((up - down)[:, 0, 0] / 2e-6, abs=1e-8)


def test_locked_is_nowhere():
    strain = np.zeros((5, 1, 1))
    strain[0], strain[3], strain[4] = 0.5, -0.5, 0.33
    assert np.isnan(elements._gent(strain, 0.4, 0.1, np.zeros((1, 1))).stress).all()
    assert np.isfinite(elements._gent(strain, 0.4, 10.0, np.zeros((1, 1))).stress).all()
