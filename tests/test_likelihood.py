"""The likelihood of a curve whose noise nobody stated: by dense matrices, and its intervals by quadrature."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.fft import idct

import underlay as ul
from support.worlds import Clean, disturbed
from underlay.inference.uncertainty.likelihood import Likelihood
from underlay.inference.uncertainty.mixture import weighted_quantiles
from underlay.inference.uncertainty.reading import DrawnReading
from underlay.inference.uncertainty.ridge import Ridges, draw

SCENE = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)
WORLDS = ["clean", "AR(1)", "fringes", "drag step", "random walk"]


def likelihood_in(world, seed=1, points=90):
    clean = Clean.of(SCENE, 1.5e-4, points)
    curve = disturbed(clean, world, np.random.default_rng(seed), 0.003)
    return Likelihood.of(ul.fit(ul.Problem(SCENE, curve, {"layer.E": ul.LogUniform(1e5, 1e7)})))


def dense_covariance(state, one):
    """Covariance (n, n) of a curve's rows under one hypothesis, without the variance of its white noise."""
    n, kinds = len(state.growth), state.hypotheses
    modes = idct(np.eye(n), axis=0, norm="ortho")
    noise = (modes * state.table.spectra[kinds.noise[one]]) @ modes.T
    loud = np.sqrt(state.growth)
    along = state.columns.values * kinds.sizes(state.columns, one)
    return noise * np.outer(loud, loud) + along @ along.T


@pytest.mark.parametrize("world", WORLDS)
def test_moments_scatter_as_dense_covariances_say(world):
    (state,) = likelihood_in(world).states
    law, moments = state.columns.values[:, state.columns.law], state.moments
    plain = np.flatnonzero(~state.hypotheses.corrects)
    for one in plain:
        dense = state.hypotheses.variance[one] * law.T @ dense_covariance(state, one) @ law
        np.testing.assert_allclose(moments.covariance[one], dense, rtol=1e-8)
        np.testing.assert_allclose(moments.information[one], law.T @ law, rtol=1e-12)


@pytest.mark.parametrize("world", ["AR(1)", "drag step", "random walk"])
def test_hypotheses_are_weighed_by_the_density_that_the_law_leaves(world):
    """Two that differ in the noise alone: the restricted likelihood, its size integrated out."""
    (state,) = likelihood_in(world).states
    kinds, law = state.hypotheses, state.columns.values[:, state.columns.law]
    residual = state.columns.values[:, state.columns.residual.start]
    freedom = len(residual) - law.shape[1]
    # White noise of a millionth of the force counts beside that of the rows.
    least = freedom * (1e-6 * np.abs(state.tangent.contact).max()) ** 2

    def log_density(one):
        covariance = dense_covariance(state, one)
        inner, whitened = law.T @ np.linalg.solve(covariance, law), np.linalg.solve(covariance, residual)
        left = residual @ whitened - law.T @ whitened @ np.linalg.solve(inner, law.T @ whitened)
        determinants = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
        return (
            -0.5 * (freedom * np.log(left + least) + determinants) + state.table.log_prior[kinds.noise[one]]
        )

    alike = [kinds.family, kinds.misfit, kinds.step, kinds.ramp]
    pairs = [
        (a, b)
        for a, b in itertools.combinations(range(len(kinds.weight)), 2)
        if all(entry[a] == entry[b] for entry in alike)
    ]
    assert pairs
    for a, b in pairs:
        found = np.log(kinds.weight[a] / kinds.weight[b])
        assert found == pytest.approx(log_density(a) - log_density(b), abs=1e-6)


@pytest.mark.parametrize("world", WORLDS)
def test_the_interval_is_that_of_the_density_by_quadrature(world):
    likelihood = likelihood_in(world)
    low, high = likelihood.read().interval(0)
    grid = np.linspace(low - 4.0 * (high - low), high + 4.0 * (high - low), 4001)
    log_density = likelihood.log_density(grid[:, None])
    share = np.cumsum(np.exp(log_density - np.nanmax(log_density)))
    ends = np.interp([0.025, 0.975], share / share[-1], grid)
    # The closed form takes the force for straight; the tails that the grid cuts hold less than a percent.
    np.testing.assert_allclose(ends, (low, high), atol=0.1 * (high - low))


def test_draws_along_a_ridge_are_where_the_prior_is():
    """Of a thickness that the curve alone leaves open: a walk that did not know the prior went to 1e4 times it."""
    h, R = 1e-4, 25e-6
    scene = ul.Scene(
        ul.Sphere(R), ul.Layer(ul.Isotropic(3e3, 0.5), h, stiffening=ul.Gent(1.0)), ul.RIGID, friction="none"
    )
    depth = np.linspace(-0.1, 0.35, 120) * R
    curve = ul.synthesize(scene, depth, ul.Noise(force=0.003 * float(scene.force(depth[-1]))), rng=0)
    free = {
        "layer.E": None,
        "instrument.contact_depth": None,
        "layer.stiffening.inverse_limit": None,
        "layer.thickness": ul.Normal(h, 0.05 * h),
    }
    fit = ul.fit(ul.Problem(scene, curve, free))
    drawn = Likelihood.of(fit).read(0)
    thickness = fit.problem.physical(drawn.draws)[:, fit.names.index("layer.thickness")]
    assert (np.abs(thickness / h - 1.0) < 8.0 * 0.05).all()
    assert drawn.pareto < 0.7
    assert 1.0 / np.square(drawn.weights).sum() > 0.3 * len(drawn.weights)


@pytest.mark.parametrize("world", ["clean", "AR(1)"])
def test_the_density_falls_as_students_distributions_do(world):
    """Where the force is straight both readings are one: the density of draws and the mixture in closed form.

    Both sides of the middle together, so that what is left of the force's bend in ln E cancels.
    """
    likelihood = likelihood_in(world)
    mixture = likelihood.mixture
    middle, far = mixture.weights @ mixture.means[:, 0], 4.0 * mixture.deviations[0]
    places = middle + far * np.array([-1.0, 0.0, 1.0])
    scales = np.sqrt(mixture.covariances[:, 0, 0])
    students = stats.t.pdf(places[:, None], mixture.freedom, mixture.means[:, 0], scales) @ mixture.weights
    fall = np.array([0.5, -1.0, 0.5]) @ np.column_stack(
        (likelihood.log_density(places[:, None]), np.log(students))
    )
    # One parameter more among the degrees of freedom moves the fall at four deviations by 0.08.
    assert fall[0] == pytest.approx(fall[1], abs=0.02)


def test_weighted_quantiles_are_those_of_draws_repeated_by_their_weight():
    values, counts = np.array([3.0, -1.0, 0.5, 8.0, 2.0]), np.array([5, 1, 20, 2, 12])
    shares = np.array([0.1, 0.4, 0.7, 0.9])
    found = weighted_quantiles(values, counts / counts.sum(), shares)
    order = np.argsort(values)
    below = (np.cumsum(counts[order]) - 0.5 * counts[order]) / counts.sum()
    assert found == pytest.approx(np.interp(shares, below, values[order]), rel=1e-14)
    # Draws of one weight would have their median at 2.
    assert weighted_quantiles(values, counts / counts.sum(), np.array([0.5]))[0] < 1.5


def with_thickness(noise, seed=3, base=ul.RIGID):
    """The likelihood of a clean curve: modulus, thickness, contact point and the base's modulus are free."""
    scene = replace(SCENE, substrate=base)
    clean = Clean.of(scene, 1.5e-4, 240)
    force = clean.force + noise * clean.top * np.random.default_rng(seed).standard_normal(240)
    free = {"layer.E": (1e4, 1e8), "layer.thickness": (1e-4, 1e-2), "instrument.contact_depth": None}
    free |= {} if base == ul.RIGID else {"substrate.E": (1e3, 1e18)}
    return Likelihood.of(ul.fit(ul.Problem(scene, ul.Curve(clean.depth, force), free), start="given"))


def test_a_thickness_that_the_curve_tells_is_answered_in_closed_form():
    """As weighted draws have it: an end from 4000 of them is known to 0.06 standard deviations."""
    told = with_thickness(1e-3)
    assert told.is_straight
    closed, drawn = told.read(), DrawnReading(told, draw(Ridges.of(told), np.random.default_rng(1), 4000))
    for i, deviation in enumerate(told.mixture.deviations):
        assert closed.interval(i) == pytest.approx(drawn.interval(i), abs=0.2 * deviation)


def test_a_thickness_that_the_curve_hardly_tells_is_not():
    assert not with_thickness(3e-2).is_straight


def test_a_base_that_the_curve_does_not_tell_is_not():
    """Two standard deviations of its modulus are many decades off: numbers overflow there."""
    told = with_thickness(3e-3, base=ul.Isotropic(1e15, 0.3))
    assert told.mixture.deviations.max() > 1e3
    assert not told.is_straight
