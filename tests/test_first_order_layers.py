"""First-order stiffening of layers between the tables, against linear finite elements of our own."""

import numpy as np
import pytest

from underlay.mechanics.stiffening import factors
from underlay.mechanics.stiffening.factors import Medium

# g1(t)/g1(0) from fields of linear finite elements (lab/linear_fields2.py), t = 0.2 0.35 0.5 0.7 0.9 1.1.
T = np.array([0.2, 0.35, 0.5, 0.7, 0.9, 1.1])
MEASURED = {
    0.4995: [1.6526, 2.4574, 3.4695, 5.0825, 7.0756, 9.633],
    0.49: [1.6375, 2.4211, 3.4012, 4.9414, 6.7992, 9.1067],
    0.475: [1.6169, 2.3715, 3.3104, 4.7638, 6.4622, 8.4858],
    0.45: [1.5874, 2.3034, 3.192, 4.5506, 6.0861, 7.8324],
    0.4: [1.542, 2.2048, 3.0366, 4.3158, 5.7372, 7.298],
    0.35: [1.5088, 2.138, 2.9454, 4.22, 5.6603, 7.2499],
    0.3: [1.4836, 2.0903, 2.8892, 4.193, 5.7088, 7.4144],
}


@pytest.mark.parametrize("nu", MEASURED)
def test_bonded_layers_of_any_nu(nu):
    series, _ = Medium(nu).growth(factors.finite_elements()["gent"], T)
    assert series == pytest.approx(MEASURED[nu], rel=6e-3)


def test_a_sliding_layer():
    series, _ = Medium(0.5, sliding=True).growth(factors.finite_elements()["gent"], T)
    assert series == pytest.approx([1.4399, 2.0755, 3.0749, 5.0602, 7.7013, 10.8355], rel=0.013)


def test_the_slope_of_the_series_is_its_derivative():
    step = 1e-3
    for sliding in (False, True):
        medium = Medium(0.5 if sliding else 0.42, sliding)
        at = [
            medium.growth(factors.finite_elements()["gent"], T * np.exp(k * step))[0] for k in (-2, -1, 1, 2)
        ]
        slope = (at[0] - 8.0 * at[1] + 8.0 * at[2] - at[3]) / (12.0 * step)
        assert medium.growth(factors.finite_elements()["gent"], T)[1] == pytest.approx(slope, rel=1e-9)
