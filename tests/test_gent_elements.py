"""The finite elements of the studies: tangents of Gent's and Ogden's solids, and their limits."""

import numpy as np
import pytest

from support import finite_elements as elements


@pytest.mark.parametrize(
    ("law", "number"),
    [(elements._gent, np.inf), (elements._gent, 0.5), (elements._ogden, -10.0), (elements._ogden, 10.0)],
)
def test_the_tangent_is_the_derivative_of_the_stress(law, number):
    strain = 0.1 * np.random.default_rng(0).standard_normal((5, 1, 1))
    pressure = law(strain, 0.4, number, np.zeros((1, 1))).pressure
    tangent = law(strain, 0.4, number, pressure).tangent
    for j in range(5):
        step = np.zeros((5, 1, 1))
        step[j] = 1e-6
        up, down = (law(strain + s * step, 0.4, number, pressure).stress for s in (1.0, -1.0))
        assert tangent[:, j, 0, 0] == pytest.approx((up - down)[:, 0, 0] / 2e-6, abs=1e-8)


def test_locked_is_nowhere():
    strain = np.zeros((5, 1, 1))
    strain[0], strain[3], strain[4] = 0.5, -0.5, 0.33
    assert np.isnan(elements._gent(strain, 0.4, 0.1, np.zeros((1, 1))).stress).all()
    assert np.isfinite(elements._gent(strain, 0.4, 10.0, np.zeros((1, 1))).stress).all()


def test_ogdens_of_exponent_two_is_neo_hookean():
    strain = 0.1 * np.random.default_rng(0).standard_normal((5, 2, 1))
    one, other = (
        law(strain, 0.4, k, np.ones((2, 1))) for law, k in ((elements._ogden, 2.0), (elements._gent, np.inf))
    )
    assert one.stress == pytest.approx(other.stress, abs=1e-14)
