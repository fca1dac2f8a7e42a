"""Profiles of numbers of the noise: the intervals of the textbook, and ends that are not there."""

import numpy as np
import pytest
from scipy import optimize

import underlay as ul
from support.inverse import layer_on, measured

E, C = "layer.E", "instrument.contact_depth"
SCENE = layer_on(ul.RIGID)
SIZE, TAU, RELATIVE = "noise.force", "noise.correlation_time", "noise.relative"


def test_the_size_of_white_noise_has_the_interval_of_its_restricted_likelihood():
    found = ul.fit(ul.Problem(SCENE, measured(SCENE, points=60), [E, C, SIZE]))
    interval = ul.profile(found, SIZE).interval()
    degrees, square = 58, float(np.square(found.residuals[0]).sum())
    estimate = (square / degrees) ** 0.5

    def over(sigma):
        # -2 ln of sigma^-(n - k) exp(-S / (2 sigma^2)), above its minimum, less chi-square's 95 %.
        ratio = (estimate / sigma) ** 2
        return degrees * (ratio - 1.0 - np.log(ratio)) - 3.841458820694124

    # Steps of half a unit of z read by monotone cubics: 1e-3 of the half-width, about a tenth of the value.
    assert interval.low == pytest.approx(optimize.brentq(over, 0.3 * estimate, estimate), rel=3e-4)
    assert interval.high == pytest.approx(optimize.brentq(over, estimate, 3.0 * estimate), rel=3e-4)
    assert "chi-square with one degree of freedom" in ul.profile(found, SIZE).basis()


def test_a_correlation_time_is_the_same_with_the_size_as_a_parameter_or_not():
    curve = measured(SCENE, correlation_time=0.02)
    alone, both = (ul.fit(ul.Problem(SCENE, curve, free)) for free in ([E, C, TAU], [E, C, TAU, SIZE]))
    # Both are at the maximum of one restricted likelihood, found to 1e-5 of ln tau, a ten thousandth of its error.
    assert alone.values[TAU] == pytest.approx(both.values[TAU], rel=1e-4)
    assert alone.noises[0].force == pytest.approx(both.values[SIZE], rel=1e-4)
    one, other = ul.profile(alone, TAU).interval(), ul.profile(both, TAU).interval()
    assert one.low == pytest.approx(other.low, rel=1e-3)
    assert one.high == pytest.approx(other.high, rel=1e-3)


def test_intervals_of_a_correlation_time_cover():
    inside = 0
    for seed in range(30):
        curve = measured(SCENE, correlation_time=0.02, rng=seed)
        interval = ul.profile(ul.fit(ul.Problem(SCENE, curve, [E, C, TAU])), TAU).interval()
        inside += interval.low <= 0.02 <= interval.high
    # Of 30 at 95 %, 24 or fewer have probability 0.003.
    assert inside > 24


def test_a_part_of_the_noise_that_is_not_there_is_bounded_above_only():
    curve = measured(SCENE, level=0.01)
    found = ul.fit(ul.Problem(SCENE, curve, [E, SIZE, RELATIVE], ul.Noise(relative=1e-3, force=1e-3)))
    interval = ul.profile(found, RELATIVE).interval()
    assert interval.low_reason == "none"
    assert interval.high_reason == "data"
    # The largest force is read to 1 %: a relative noise of several times that would show.
    assert 1e-3 < interval.high < 0.1
