"""Robust losses: the derivatives that standard errors need are those of what is summed."""

import numpy as np
import pytest
from scipy import optimize

from underlay.inference.least_squares.models import LOSSES, SQUARES


@pytest.mark.parametrize("loss", [SQUARES, *LOSSES.values()], ids=["squares", *LOSSES])
def test_weight_and_slope_are_derivatives_of_what_is_summed(loss):
    # Beside the corner of Huber's, at one.
    r = np.array([0.1, 0.5, 0.9, 1.2, 3.0, 20.0])
    step = 1e-5 * r
    z, dz = r * r, 2.0 * r * step
    up, down = loss.rho(z + dz), loss.rho(z - dz)
    # A central difference is off by the square of the step, 1e-9 of z, and by rounding over the step.
    assert loss.weight(z) == pytest.approx((up - down) / (2.0 * dz), rel=1e-7, abs=1e-9)
    up, down = ((r + h) * loss.weight((r + h) ** 2) for h in (step, -step))
    assert loss.slope(z) == pytest.approx((up - down) / (2.0 * step), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("name", LOSSES)
def test_what_is_summed_is_what_scipy_minimises(name):
    r = np.array([0.3, -0.8, 1.5, -6.0])
    found = optimize.least_squares(lambda x: r + 0.0 * x[0], [0.0], loss=name)
    assert 0.5 * LOSSES[name].rho(r * r).sum() == pytest.approx(found.cost, rel=1e-14)
