"""Posteriors of curves whose noise nobody stated: the density by dense matrices, its intervals by quadrature."""

import numpy as np
import pytest
from scipy import special

import underlay as ul
from support.worlds import Clean, disturbed
from underlay.inference.headline.averaged import averaged_fit

SCENE = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)
FREE = {"layer.E": ul.LogUniform(1e5, 1e7)}


def posed(world, seed=1, points=90):
    clean = Clean.of(SCENE, 1.5e-4, points)
    return ul.Problem(SCENE, disturbed(clean, world, np.random.default_rng(seed), 0.003), FREE)


def dense_densities(problem, vectors):
    """Log-densities (sets,) up to a constant, every combination of the fit by its dense covariance."""
    averaged = averaged_fit(ul.fit(problem))
    found, (curve,) = averaged.competition, averaged.blocked.curves
    part = averaged.blocked.linearised(averaged.vector).parts[0]
    prior = found.sizes.log_prior(len(found.noises))
    terms = []
    models = [curve.forward.force(curve.member.values_at(problem.physical(vector))) for vector in vectors]
    residuals = (np.array(models) - curve.force) / curve.member.scatter
    n = len(curve.force)
    for (g, c), variance in zip(found.places, found.variance, strict=True):
        V = np.eye(n)
        if found.noises[g] is not None:
            tau, share = found.noises[g]
            V += share * np.exp(-np.abs(part.time[:, None] - part.time) / tau)
        drift, jump, ramp = found.sizes.amounts[c] / np.array([variance**0.5, 1.0, variance**0.5])
        for size, columns in ((drift, part.drift), (jump, part.jump), (ramp, part.ramp)):
            V += size**2 * columns @ columns.T
        square = np.einsum("sn,ns->s", residuals, np.linalg.solve(V, residuals.T))
        terms.append(prior[g, c] - 0.5 * np.linalg.slogdet(V)[1] - 0.5 * n * np.log(square))
    return special.logsumexp(terms, axis=0)


@pytest.mark.parametrize("world", ["clean", "AR(1) and white", "adhesion"])
def test_the_density_is_that_of_dense_covariances(world):
    problem = posed(world)
    fit = ul.fit(problem)
    vectors = fit.vector + np.sqrt(fit.scaled_covariance[0, 0]) * np.array([[0.0], [1.0], [-2.0]])
    own = ul.marginalised(problem).log_likelihood(vectors)
    # Combinations that weigh less than a thousandth together are left out: 1 % of a density of a tenth of the top.
    expected = dense_densities(problem, vectors)
    assert own - own[0] == pytest.approx(expected - expected[0], abs=0.02)


def by_quadrature(problem, q):
    """The 95 % interval of the only parameter from its density at scaled values q."""
    density = problem.log_posterior(q[:, None])
    below = np.cumsum(np.exp(density - density.max()))
    return problem.physical(np.interp([0.025, 0.975], below / below[-1], q)[:, None])[:, 0]


@pytest.mark.parametrize("world", ["clean", "AR(1) and white", "stiffening", "drag step"])
def test_the_interval_of_the_posterior_is_the_fits(world):
    problem = posed(world)
    fit = ul.fit(problem)
    stated = fit.interval("layer.E")
    middle, half = fit.vector[0], 4.0 * np.log(stated.high / stated.low)
    found = by_quadrature(ul.marginalised(problem), np.linspace(middle - half, middle + half, 2001))
    # The fit's is that of linear models about its optima, with columns that follow the parameters.
    width = stated.high - stated.low
    assert found == pytest.approx([stated.low, stated.high], abs=0.15 * width)


def test_stated_noise_is_left_alone_and_a_clean_curve_too():
    problem = posed("clean")
    stated = problem.revised(noise=ul.Noise())
    assert ul.marginalised(stated) is stated
    assert ul.marginalised(ul.marginalised(problem)).likelihood is not None
    perfect = problem.revised(curves=[ul.simulate(SCENE, np.linspace(0.0, 1e-4, 50))])
    assert ul.marginalised(perfect).log_posterior(np.zeros((1, 1))).shape == (1,)


def test_curves_of_a_joint_problem_share_what_is_weighed():
    problem = posed("clean")
    other = disturbed(Clean.of(SCENE, 1.5e-4, 90), "clean", np.random.default_rng(5), 0.003)
    joint = ul.Problem.joint([(SCENE, problem.curves[0]), (SCENE, other)], FREE, ["layer.E"])
    single = [ul.marginalised(one) for one in (problem, problem.revised(curves=[other]))]
    q = np.array([[0.0], [0.004]])
    rises = [np.diff(one.log_likelihood(q))[0] for one in (*single, ul.marginalised(joint))]
    # Two curves that both look clean tell together what they tell one by one, but for the few models that differ.
    assert rises[2] == pytest.approx(rises[0] + rises[1], rel=0.2)


def test_a_sample_allows_for_what_its_fit_allows_for():
    problem = posed("AR(1) and white", points=50)
    found = ul.sample(problem, method="importance")
    assert found.problem.likelihood is not None
    draws = np.quantile(found.samples["layer.E"], [0.025, 0.975])
    stated = ul.fit(problem).interval("layer.E")
    assert draws == pytest.approx([stated.low, stated.high], abs=0.15 * (stated.high - stated.low))
    # The control: white noise is three times too sure.
    white = ul.sample(problem.revised(noise=ul.Noise()), method="importance").samples["layer.E"]
    assert np.ptp(np.quantile(white, [0.025, 0.975])) < 0.4 * np.ptp(draws)
