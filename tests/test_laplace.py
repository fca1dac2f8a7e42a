"""The start of the walkers: the top of a density and its width, also where it is bent, flat or cut off."""

import numpy as np
import pytest
from scipy import linalg

import underlay as ul
from underlay.inference.sampling.walker_start import find_mode, overdispersed

FAR = (np.full(3, -1e9), np.full(3, 1e9))


def gaussian(mean, covariance):
    precision = np.linalg.inv(covariance)
    return lambda q: -0.5 * np.einsum("mi,ij,mj->m", q - mean, precision, q - mean)


def correlated(scales, correlation):
    scales = np.asarray(scales)
    shape = np.full((scales.size, scales.size), correlation)
    np.fill_diagonal(shape, 1.0)
    return scales[:, None] * shape * scales


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.9999])
def test_a_normal_density_is_found_exactly(correlation):
    mean, covariance = np.array([1.0, -2e-3, 5e4]), correlated([0.1, 1e-5, 3e3], correlation)
    top = find_mode(gaussian(mean, covariance), np.array([2.0, 0.0, 0.0]), np.array([1e2, 1.0, 1e6]), FAR)
    # Differences of a quadratic are exact; rounding of a log-density of 1e5 leaves 1e-11 / step^2.
    np.testing.assert_allclose((top.mode - mean) / np.sqrt(np.diag(covariance)), 0.0, atol=0.05)
    np.testing.assert_allclose(top.factor @ top.factor.T, covariance, rtol=1e-3)


def test_a_direction_without_information_is_as_wide_as_the_prior():
    width = np.array([3.0, 7.0])
    top = find_mode(lambda q: -0.5 * (q[:, 0] / 0.1) ** 2, np.zeros(2), width, (-10 * width, 10 * width))
    np.testing.assert_allclose(np.diag(top.factor @ top.factor.T), [0.01, 49.0], rtol=1e-6)


def test_a_top_outside_the_box_is_approached_from_inside():
    box = (np.array([-1.0]), np.array([1.0]))

    def density(q):
        return np.where(np.abs(q[:, 0]) < 1.001, 5.0 * q[:, 0], -np.inf)

    top = find_mode(density, np.array([0.0]), np.array([0.5]), box)
    assert top.mode[0] == pytest.approx(1.0)
    walkers = overdispersed(density, top, 32, np.random.default_rng(0))
    assert (np.abs(walkers) < 1.001).all()


def test_walkers_are_twice_as_wide_as_the_posterior():
    covariance = correlated([1.0, 2.0, 0.5], 0.95)
    density = gaussian(np.zeros(3), covariance)
    top = find_mode(density, np.zeros(3), np.full(3, 10.0), FAR)
    walkers = overdispersed(density, top, 4000, np.random.default_rng(0))
    measured = walkers.T @ walkers / len(walkers)
    # Four times the covariance, less the points more than 30 log units down (chi-squared(3) > 15: 0.2 %).
    np.testing.assert_allclose(measured, 4.0 * covariance, rtol=0.12)


def test_a_bent_ridge_is_followed():
    def density(q):
        x, y = q.T
        return -0.5 * x**2 - 0.5 * ((y - x**2) / 0.1) ** 2

    top = find_mode(
        density, np.array([2.0, 3.9]), np.array([3.0, 9.0]), (np.full(2, -50.0), np.full(2, 50.0))
    )
    assert top.log_density > -0.1
    walkers = overdispersed(density, top, 64, np.random.default_rng(1))
    assert (density(walkers) > top.log_density - 20.0).all()


def test_steps_in_the_density_do_not_flatten_the_walkers():
    """A law that keeps its promise to 1e-4 makes a log-density rough by a tenth of a log unit."""
    smooth = gaussian(np.zeros(3), correlated([1e-2, 1.0, 0.1], 0.999))

    def density(q):
        rough = 0.1 * np.sin(1e4 * q.sum(axis=1))
        return np.where(np.abs(q[:, 1]) < 2.0, smooth(q) + rough, -np.inf)

    width = np.array([3.0, 1.3, 3.0])
    top = find_mode(density, np.array([0.01, 1.0, 0.1]), width, (-2.0 * width, 2.0 * width))
    walkers = overdispersed(density, top, 64, np.random.default_rng(0))
    exact = 4.0 * correlated([1e-2, 1.0, 0.1], 0.999)
    # Variances along the posterior's own axes, over its own: no axis collapsed.
    spread = linalg.eigh(np.cov(walkers.T), exact, eigvals_only=True)
    assert (spread > 0.05).all()


def test_a_start_without_density_is_refused():
    with pytest.raises(ul.FitError, match="move the start"):
        find_mode(lambda q: np.full(len(q), -np.inf), np.zeros(1), np.ones(1), (-np.ones(1), np.ones(1)))


def test_no_room_for_walkers_is_an_error():
    def needle(q):
        return np.where(np.abs(q[:, 0]) < 1e-300, 0.0, -np.inf)

    top = find_mode(lambda q: -(q[:, 0] ** 2), np.zeros(1), np.ones(1), (-np.ones(1), np.ones(1)))
    with pytest.raises(ul.FitError, match="found no place"):
        overdispersed(needle, top, 4, np.random.default_rng(0))
