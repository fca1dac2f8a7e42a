"""The noise model: its likelihood is the Gaussian's, and what it draws has the asked variance."""

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from underlay.scene.noise import ar1_whiten

TIME = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.3, 40))
FORCE = np.linspace(0.0, 2e-3, 40)
STIFFNESS = np.linspace(0.0, 30.0, 40)


def dense_covariance(sigma, time, tau):
    correlation = np.exp(-np.abs(time[:, None] - time) / tau) if tau else np.eye(time.size)
    return sigma[:, None] * correlation * sigma


@pytest.mark.parametrize("tau", [0.0, 1e-3, 0.2, 50.0])
def test_likelihood_is_that_of_the_dense_gaussian(tau):
    noise = ul.Noise(force=1e-5, relative=0.02, depth=1e-6, correlation_time=tau)
    sigma = noise.sigma(FORCE, STIFFNESS)
    residual = np.random.default_rng(2).normal(size=FORCE.size) * 2e-5
    mine = noise.log_normalisation(sigma, TIME) - 0.5 * np.sum(noise.whiten(residual / sigma, TIME) ** 2)
    dense = stats.multivariate_normal(cov=dense_covariance(sigma, TIME, tau)).logpdf(residual)
    # Condition number of the correlation times rounding: 1e5 * 1e-16 at tau = 50 s.
    assert mine == pytest.approx(dense, rel=1e-10)


def test_variances_add_and_act_through_the_stiffness():
    noise = ul.Noise(force=3.0, relative=0.5, depth=2.0)
    np.testing.assert_allclose(noise.sigma(np.array([8.0]), np.array([6.0])), [13.0], rtol=1e-15)


def test_whitening_undoes_the_draw():
    noise = ul.Noise(force=1.0, correlation_time=0.4)
    sigma = np.ones((3, TIME.size))
    drawn = noise.sample(np.random.default_rng(5), sigma, TIME)
    innovations = np.random.default_rng(5).standard_normal((3, TIME.size))
    np.testing.assert_allclose(noise.whiten(drawn, TIME), innovations, atol=1e-12)


@pytest.mark.parametrize("tau", [0.0, 0.05, 0.5])
def test_variance_and_correlation_are_those_asked(tau):
    noise = ul.Noise(force=2.0, correlation_time=tau)
    draws = 20_000
    sigma = np.broadcast_to(np.linspace(1.0, 3.0, 25), (draws, 25))
    time = TIME[:25]
    sample = noise.sample(np.random.default_rng(3), sigma, time)
    expected = dense_covariance(sigma[0], time, tau)
    measured = sample.T @ sample / draws
    # Wishart: sd of an entry is sqrt((C_ii C_jj + C_ij^2) / draws); 625 entries stay within 4.5 of them.
    sd = np.sqrt((np.outer(np.diag(expected), np.diag(expected)) + expected**2) / draws)
    assert np.abs((measured - expected) / sd).max() < 4.5
    # The control: noise of another correlation time does not pass.
    other = dense_covariance(sigma[0], time, 2.0 * tau or 0.05)
    assert np.abs((measured - other) / sd).max() > 9.0


def test_batch_axes_give_each_set_its_own_numbers():
    white = np.array([1e-5, 2e-5, 4e-5])
    relative = np.array([0.01, 0.0, 0.05])
    depth = np.array([0.0, 1e-6, 2e-6])
    tau = np.array([0.05, 0.2, 1.0])
    force = np.stack([FORCE, 2 * FORCE, 3 * FORCE])
    stiffness = np.stack([STIFFNESS, 2 * STIFFNESS, STIFFNESS])
    numbers = {"force": white, "relative": relative, "depth": depth, "correlation_time": tau}
    all_sets = ul.Noise(force=1.0).at({name: values[:, None] for name, values in numbers.items()})
    sigma = all_sets.sigma(force, stiffness)
    residual = np.random.default_rng(0).normal(size=sigma.shape)
    whitened, normalisation = all_sets.whiten(residual, TIME), all_sets.log_normalisation(sigma, TIME)
    for i in range(3):
        one = ul.Noise(white[i], relative[i], tau[i], depth[i])
        np.testing.assert_allclose(sigma[i], one.sigma(force[i], stiffness[i]), rtol=1e-14)
        np.testing.assert_allclose(whitened[i], one.whiten(residual[i], TIME), rtol=1e-13)
        np.testing.assert_allclose(normalisation[i], one.log_normalisation(sigma[i], TIME), rtol=1e-13)
        # Point by point, given those before, it is the same determinant.
        each = one.log_deviations(sigma[i], TIME)
        assert each.sum() == pytest.approx(float(one.log_determinant(sigma[i], TIME)), rel=1e-13)


def test_white_noise_alone_takes_one_logarithm_per_set():
    noise = ul.Noise(force=1.0).at({"force": np.full((4, 1), 0.3)})
    view = noise.sigma(np.ones((4, 30)))
    assert view.shape == (4, 30)
    assert view.strides[-1] == 0
    np.testing.assert_allclose(
        noise.log_normalisation(view), noise.log_normalisation(np.array(view)), rtol=1e-14
    )


def test_close_points_keep_their_digits():
    time = np.array([0.0, 1e-12])
    e = ar1_whiten(np.array([1.0, 1.0 + 3e-6]), time, 1.0)
    # sqrt(1 - rho^2) = sqrt(2e-12); the rounding of 1 + 3e-6 limits the numerator to 1e-10 relative.
    assert e[1] == pytest.approx((3e-6 + 1e-12) / np.sqrt(2e-12), rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"force": -1e-6}, r"noise\.force must be zero or positive"),
        ({"force": 1e-6, "relative": -0.1}, r"noise\.relative must be zero or positive"),
        ({"force": 1e-6, "correlation_time": float("nan")}, r"noise\.correlation_time must be finite"),
        ({"depth": "thin"}, r"noise\.depth must be a number"),
        ({"force": 0.0}, "zero noise"),
        ({"force": 0.0, "correlation_time": 1.0}, "zero noise"),
    ],
)
def test_bad_settings(settings, message):
    with pytest.raises(ul.InputError, match=message):
        ul.Noise(**settings)


def test_unknown_white_noise_cannot_be_evaluated():
    with pytest.raises(ul.InputError, match=r"noise\.force is unknown"):
        ul.Noise(relative=0.1).sigma(FORCE)


def test_depth_noise_needs_the_stiffness():
    with pytest.raises(ul.InputError, match="stiffness"):
        ul.Noise(force=1.0, depth=1.0).sigma(FORCE)


def test_zero_sigma_is_no_likelihood():
    noise = ul.Noise(force=0.0, relative=0.1)
    with pytest.raises(ul.InputError, match=r"give noise\.force too"):
        noise.log_normalisation(noise.sigma(FORCE))


@pytest.mark.parametrize(
    ("time", "message"),
    [(None, "needs the times"), (np.array([0.0, 1.0, 1.0]), "do not increase after index 1")],
)
def test_correlation_needs_increasing_times(time, message):
    with pytest.raises(ul.InputError, match=message):
        ar1_whiten(np.zeros(3), time, 0.5)


def test_batched_correlation_times_must_all_be_positive():
    with pytest.raises(ul.InputError, match="positive"):
        ar1_whiten(np.zeros((2, 3)), np.arange(3.0), np.array([[0.1], [0.0]]))


def test_a_curve_without_scatter_says_that_its_noise_must_be_stated():
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)))
    depth = np.linspace(0.0, 1e-5, 20)
    curve = ul.Curve(depth, scene.force(depth))
    with pytest.raises(ul.InputError, match=r"cannot be estimated from it: state noise\.force"):
        ul.Noise().of_size(0.0)
    known = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, ul.Noise(force=1e-6)))
    assert known.values["layer.E"] == pytest.approx(1e6, rel=1e-9)
