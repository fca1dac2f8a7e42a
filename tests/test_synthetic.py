"""Synthetic curves: every effect off unless named, each as large as asked, and all of it reproducible."""

import numpy as np
import pytest
from scipy import stats

import underlay as ul

BARE = ul.Scene(
    ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)), instrument=ul.Instrument(contact_depth=2e-6)
)
SCENE = BARE.with_values({"instrument.baseline": 1e-4, "instrument.baseline_slope": 3.0})
DEPTH = np.linspace(-2e-5, 1e-4, 4001)
CLEAN = SCENE.force(DEPTH)
CONTACT = BARE.force(DEPTH)


def variance_p_value(sample, variance):
    """Two-sided p of the sample's sum of squares: sum / variance is chi-squared with n degrees of freedom."""
    p = stats.chi2.sf(np.sum(sample**2) / variance, sample.size)
    return 2.0 * min(p, 1.0 - p)


def test_simulate_is_the_scene():
    curve = ul.simulate(SCENE, DEPTH, time=np.arange(DEPTH.size))
    np.testing.assert_array_equal(curve.depth, DEPTH)
    np.testing.assert_array_equal(curve.force, CLEAN)
    np.testing.assert_array_equal(curve.time, np.arange(DEPTH.size))
    assert dict(curve.truth) == SCENE.parameters


def test_every_effect_is_off_unless_named():
    curve = ul.synthesize(SCENE, DEPTH)
    np.testing.assert_allclose(curve.force, CLEAN, rtol=1e-13, atol=1e-18)
    np.testing.assert_array_equal(curve.depth, DEPTH)
    assert curve.time is None
    assert {name: value for name, value in curve.truth.items() if name not in SCENE.parameters} == {
        "noise.force": 0.0,
        "noise.relative": 0.0,
        "noise.correlation_time": 0.0,
        "noise.depth": 0.0,
        "drift": 0.0,
        "quantisation": 0.0,
        "outliers": 0.0,
        "outlier_sd": 0.0,
        "seed": 0,
    }


def everything(rng):
    noise = ul.Noise(force=1e-6, relative=0.01, correlation_time=0.1, depth=1e-8)
    return ul.synthesize(
        SCENE,
        DEPTH,
        noise,
        rng,
        sampling_rate=50.0,
        disturbances=ul.Disturbances(drift=1e-6, outliers=0.01, outlier_sd=1e-4, quantisation=1e-7),
    )


def test_the_same_seed_gives_the_same_curve_bit_for_bit():
    first, second, other = everything(11), everything(11), everything(12)
    np.testing.assert_array_equal(first.force, second.force)
    np.testing.assert_array_equal(first.depth, second.depth)
    assert (first.force != other.force).mean() > 0.9
    assert first.truth["seed"] == 11
    assert first.truth["sampling_rate"] == 50.0
    assert first.truth["instrument.contact_depth"] == 2e-6


def test_a_generator_moves_on_and_leaves_no_seed():
    rng = np.random.default_rng(11)
    first, second = everything(rng), everything(rng)
    np.testing.assert_array_equal(first.force, everything(11).force)
    assert (first.force != second.force).mean() > 0.9
    assert "seed" not in first.truth


def test_an_effect_leaves_the_draws_of_the_others_alone():
    plain = ul.synthesize(SCENE, DEPTH, ul.Noise(force=1e-6), 5)
    more = ul.synthesize(
        SCENE,
        DEPTH,
        ul.Noise(force=1e-6, depth=1e-8),
        5,
        disturbances=ul.Disturbances(outliers=0.02, outlier_sd=1e-3),
    )
    untouched = more.force == plain.force
    assert 0.97 < untouched.mean() < 0.99


@pytest.mark.parametrize(
    ("noise", "variance"),
    [
        (ul.Noise(force=2e-6), np.full(DEPTH.size, 4e-12)),
        (ul.Noise(force=1e-6, relative=0.03), 1e-12 + (0.03 * CONTACT) ** 2),
        (ul.Noise(relative=0.03), (0.03 * CONTACT) ** 2),
    ],
)
def test_force_noise_has_the_variance_asked(noise, variance):
    residual = ul.synthesize(SCENE, DEPTH, noise, 21).force - CLEAN
    noisy = variance > 0.0
    # Where proportional noise is alone, points before contact are exact up to the rounding of the baseline.
    np.testing.assert_allclose(residual[~noisy], 0.0, atol=1e-18)
    standardised = residual[noisy] / np.sqrt(variance[noisy])
    assert variance_p_value(standardised, 1.0) > 0.01
    assert stats.kstest(standardised, "norm").pvalue > 0.01
    assert variance_p_value(standardised, 1.1) < 0.01


@pytest.mark.parametrize("tau", [0.02, 0.2])
def test_correlation_is_that_asked(tau):
    noise = ul.Noise(force=1e-6, correlation_time=tau)
    curve = ul.synthesize(SCENE, DEPTH, noise, 3, sampling_rate=100.0)
    z = (curve.force - CLEAN) / 1e-6
    for lag in (1, 2, 5):
        expected = np.exp(-lag / 100.0 / tau)
        # Bartlett: the sd of a sample correlation is at most sqrt((1 + rho1^2) / (1 - rho1^2) / n).
        rho = np.exp(-1.0 / 100.0 / tau)
        sd = np.sqrt((1.0 + rho**2) / (1.0 - rho**2) / z.size)
        assert abs(np.corrcoef(z[:-lag], z[lag:])[0, 1] - expected) < 3.5 * sd
    assert variance_p_value(noise.whiten(z, curve.time), 1.0) > 0.01


def test_depth_noise_moves_the_reported_depth_and_acts_through_the_stiffness():
    curve = ul.synthesize(SCENE, DEPTH, ul.Noise(depth=2e-8), 8)
    np.testing.assert_allclose(curve.force, CLEAN, rtol=1e-13, atol=1e-18)
    shift = (curve.depth - DEPTH) / 2e-8
    assert variance_p_value(shift, 1.0) > 0.01
    deep = DEPTH > 2e-5
    law = SCENE.contact_law(1e-4)
    as_force = (curve.force - SCENE.force(curve.depth) + 3.0 * (curve.depth - DEPTH))[deep]
    sigma = ul.Noise(force=0.0, depth=2e-8).sigma(CONTACT[deep], law.stiffness(DEPTH[deep] - 2e-6))
    # First order: the second-order term is 2e-8 / (4 * 2e-5) of the first, far below the 2 % of the test.
    assert variance_p_value(as_force / sigma, 1.0) > 0.01


def test_depth_noise_is_correlated_too():
    noise = ul.Noise(depth=2e-8, correlation_time=0.5)
    curve = ul.synthesize(SCENE, DEPTH, noise, 4, sampling_rate=100.0)
    z = (curve.depth - DEPTH) / 2e-8
    assert variance_p_value(noise.whiten(z, curve.time), 1.0) > 0.01
    assert np.corrcoef(z[:-1], z[1:])[0, 1] > 0.95


def test_drift_is_linear_in_time():
    time = np.cumsum(np.random.default_rng(0).uniform(0.1, 1.0, DEPTH.size))
    curve = ul.synthesize(SCENE, DEPTH, time=time, disturbances=ul.Disturbances(drift=2e-7))
    np.testing.assert_allclose(curve.force - CLEAN, 2e-7 * (time - time[0]), rtol=1e-12, atol=1e-17)


def test_quantisation_rounds_last_and_adds_the_variance_of_a_step():
    step = 5e-6
    curve = ul.synthesize(
        SCENE, DEPTH, ul.Noise(force=2e-5), 2, disturbances=ul.Disturbances(quantisation=step)
    )
    unrounded = ul.synthesize(SCENE, DEPTH, ul.Noise(force=2e-5), 2)
    np.testing.assert_allclose(curve.force / step, np.round(curve.force / step), atol=1e-9)
    error = curve.force - unrounded.force
    assert np.abs(error).max() <= 0.5 * step * (1 + 1e-9)
    # Noise of four steps makes the rounding error uniform: variance step^2 / 12, relative sd sqrt(0.8 / n).
    assert np.var(error) == pytest.approx(step**2 / 12.0, rel=3.5 * np.sqrt(0.8 / DEPTH.size))


def test_outliers_are_as_many_and_as_large_as_asked():
    curve = ul.synthesize(SCENE, DEPTH, rng=6, disturbances=ul.Disturbances(outliers=0.1, outlier_sd=1e-3))
    error = curve.force - CLEAN
    hit = np.abs(error) > 1e-12
    assert stats.binomtest(int(hit.sum()), DEPTH.size, 0.1).pvalue > 0.01
    assert variance_p_value(error[hit], 1e-6) > 0.01


def test_sampling_rate_sets_the_clock():
    curve = ul.synthesize(SCENE, DEPTH, sampling_rate=250.0)
    np.testing.assert_allclose(np.diff(curve.time), 0.004, rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": ul.Noise()}, r"noise\.force is unknown"),
        ({"noise": ul.Noise(force=1e-6, correlation_time=0.1)}, "needs the times"),
        ({"disturbances": ul.Disturbances(drift=1e-6)}, "needs the times"),
        ({"sampling_rate": 0.0}, "sampling_rate must be positive"),
        ({"sampling_rate": 1.0, "time": DEPTH}, "not both"),
        ({"time": [0.0, 1.0]}, "time has 2 points and depth 4001"),
        ({"rng": -3}, "rng must be a seed"),
        ({"rng": "today"}, "rng must be a seed"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(ul.InputError, match=message):
        ul.synthesize(SCENE, DEPTH, **options)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"drift": float("inf")}, "drift must be finite"),
        ({"quantisation": -1e-6}, "quantisation must be zero or positive"),
        ({"outliers": 1.5, "outlier_sd": 1.0}, "between 0 and 1"),
        ({"outliers": 0.1}, "give outlier_sd"),
        ({"outliers": 0.1, "outlier_sd": -1.0}, "outlier_sd must be zero or positive"),
    ],
)
def test_bad_disturbances(numbers, message):
    with pytest.raises(ul.InputError, match=message):
        ul.Disturbances(**numbers)


@pytest.mark.parametrize("depth", [[], [[0.0, 1.0]], 1.0])
def test_depth_is_one_column(depth):
    with pytest.raises(ul.InputError, match="depth must be a list"):
        ul.simulate(SCENE, depth)
