"""Posteriors of curves whose noise nobody stated: the density by dense matrices, its intervals by quadrature."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import special

import underlay as ul
from support.worlds import Clean, assumed, disturbed
from underlay.inference.headline.averaged import averaged_fit, averaged_interval
from underlay.inference.ridge import importance
from underlay.inference.sampling.convergence import highest_density_interval
from underlay.report.words import longer_intervals, posterior_summary

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
    # With E alone free the law's force goes as it does, and a drift is a share of that force.
    moduli = problem.physical(vectors)[:, 0] / problem.physical(averaged.vector)[0]
    n = len(curve.force)
    for (g, c), variance, fading in zip(found.places, found.variance, found.fading, strict=True):
        still = np.eye(n)
        if found.noises[g] is not None:
            tau, share = found.noises[g]
            still += share * np.exp(-np.abs(part.time[:, None] - part.time) / tau)
        drift, (jump, ramp) = np.split(found.sizes.amounts[c], [-2])
        drift, ramp = drift / variance**0.5, ramp / variance**0.5
        for size, columns in ((jump, part.jump), (ramp, part.ramp)):
            still += (size**2 * columns) @ columns.T
        V = still + np.square(moduli)[:, None, None] * ((drift**2 * part.drift) @ part.drift.T)
        square = np.einsum("sn,sn->s", residuals, np.linalg.solve(V, residuals[..., None])[..., 0])
        terms.append(prior[g, c] + fading - 0.5 * np.linalg.slogdet(V)[1] - 0.5 * n * np.log(square))
    return special.logsumexp(terms, axis=0)


@pytest.mark.parametrize("world", ["clean", "AR(1) and white", "adhesion", "stiffening"])
def test_the_density_is_that_of_dense_covariances(world):
    problem = posed(world)
    fit = ul.fit(problem)
    vectors = fit.vector + np.sqrt(fit.scaled_covariance[0, 0]) * np.array([[0.0], [1.0], [-2.0]])
    own = ul.marginalised(problem).log_likelihood(vectors)
    # Combinations that weigh less than a thousandth together are left out: 1 % of a density of a tenth of the top.
    expected = dense_densities(problem, vectors)
    assert own - own[0] == pytest.approx(expected - expected[0], abs=0.02)


def test_a_drift_is_no_stand_in_for_the_law():
    problem = posed("stiffening")
    fit = ul.fit(problem)
    vectors = fit.vector + np.log([[1.0], [0.85], [1.25], [0.05], [1e-3]])
    own = ul.marginalised(problem).log_likelihood(vectors)
    expected = dense_densities(problem, vectors)
    # The combinations left out weigh a thousandth at the top, and more where the others weigh next to nothing.
    assert own[:3] - own[0] == pytest.approx(expected[:3] - expected[0], abs=0.05)
    # Drifts of a fixed force, as large as the fit's, would explain what a layer without stiffness leaves.
    assert (own[3:] < own[0] - 50.0).all()


def by_quadrature(problem, q, inside=0.95):
    """The interval of the only parameter that holds a probability, from its density at scaled values q."""
    density = problem.log_posterior(q[:, None])
    below = np.cumsum(np.exp(density - density.max()))
    ends = [0.5 - 0.5 * inside, 0.5 + 0.5 * inside]
    return problem.physical(np.interp(ends, below / below[-1], q)[:, None])[:, 0]


@pytest.mark.parametrize("world", ["clean", "AR(1) and white", "stiffening", "drag step"])
def test_the_interval_of_the_posterior_is_the_fits(world):
    problem = posed(world)
    fit = ul.fit(problem)
    stated = averaged_interval(fit, averaged_fit(fit), "layer.E", 0.95)
    middle, half = fit.vector[0], 4.0 * np.log(stated.high / stated.low)
    found = by_quadrature(ul.marginalised(problem), np.linspace(middle - half, middle + half, 2001))
    # The fit's is that of linear models about its optima, with columns that follow the parameters: where a layer
    # that relaxes is not excluded, it ends at q = -0.2 in ln E for exp(q) - 1 = -0.2.
    width = stated.high - stated.low
    assert found == pytest.approx([stated.low, stated.high], abs=0.2 * width)


def test_a_posterior_leaves_out_what_its_fit_does():
    layer = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    bare = assumed(layer, "Hertz on a layer")
    free = {"layer.E": ul.LogUniform(1e4, 1e8)}
    for made in (bare, layer):
        data = disturbed(Clean.of(made, 1.2e-4, 120), "clean", np.random.default_rng(3), 0.003)
        problem = ul.Problem(bare, data, free)
        fit, found = ul.fit(problem), ul.sample(problem, rng=1)
        inside = found.inside(0.95)
        assert inside == averaged_fit(fit).inside(0.95)
        draws, row = found.samples["layer.E"].to_numpy(), found.summary().loc["layer.E"]
        assert (row["hdi95_low"], row["hdi95_high"]) == highest_density_interval(draws, inside)
        after = found.prior_comparison().loc["layer.E"]
        assert (after["posterior_low"], after["posterior_high"]) == (row["hdi95_low"], row["hdi95_high"])
        known = averaged_interval(fit, averaged_fit(fit), "layer.E", 0.95)
        stated = np.log([known.low, known.high])
        own = np.log(np.quantile(draws, [0.5 - 0.5 * inside, 0.5 + 0.5 * inside]))
        # As wide as the fit's, whose linear models have other tails than the density.
        assert own == pytest.approx(stated, abs=0.35 * np.ptp(stated))
        plain = np.ptp(np.log(np.quantile(draws, [0.025, 0.975])))
        if made is bare:
            assert inside == 0.95
            assert longer_intervals(found) == ""
        else:
            assert inside > 0.99
            assert longer_intervals(found) in posterior_summary(found)
            assert f"holds {100.0 * inside:.4g} % of the draws" in longer_intervals(found)
            # Of a normal distribution 95 % are 0.62 times as wide as 99.85 %.
            assert plain < 0.75 * np.ptp(stated)


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
    # Four standard deviations out: further on it is the lightest models that are left, of other noises each time.
    q = np.array([[0.0], [0.002]])
    rises = [np.diff(one.log_likelihood(q))[0] for one in (*single, ul.marginalised(joint))]
    # Two curves that both look clean tell together what they tell one by one, but for the few models that differ.
    assert rises[2] == pytest.approx(rises[0] + rises[1], rel=0.2)


def test_a_sample_allows_for_what_its_fit_allows_for():
    problem = posed("AR(1) and white", points=50)
    found = ul.sample(problem)
    assert found.problem.likelihood is not None
    # Weighted draws, since nobody asked for a chain, and with them the evidence.
    assert (found.diagnostics.method, found.converged) == ("importance", True)
    q = np.linspace(-0.5, 0.5, 4001)
    density = found.problem.log_posterior(q[:, None])
    top = density.max()
    expected = top + np.log(np.exp(density - top).sum() * (q[1] - q[0]))
    assert found.log_evidence.value == pytest.approx(expected, abs=4.0 * found.log_evidence.error)
    draws = np.quantile(found.samples["layer.E"], [0.025, 0.975])
    stated = ul.fit(problem).interval("layer.E")
    assert draws == pytest.approx([stated.low, stated.high], abs=0.15 * (stated.high - stated.low))
    # The control: white noise is three times too sure.
    white = ul.sample(problem.revised(noise=ul.Noise()), method="importance").samples["layer.E"]
    assert np.ptp(np.quantile(white, [0.025, 0.975])) < 0.4 * np.ptp(draws)


def test_a_chain_is_made_where_one_is_asked_for_or_weights_are_not_believed(monkeypatch):
    problem = posed("clean", points=50)
    with pytest.warns(ul.UnderlayWarning, match="not converged after 20 steps"):
        asked = ul.sample(problem, walkers=8, max_steps=20, method="emcee")
    monkeypatch.setattr(importance, "_LARGEST_INDEX", -np.inf)
    with pytest.warns(ul.UnderlayWarning, match="not converged after 20 steps"):
        declined = ul.sample(problem, walkers=8, max_steps=20)
    for posterior in (asked, declined):
        assert posterior.diagnostics.method == "emcee"
        assert posterior.diagnostics.walkers == 8
    assert declined.log_evidence is None


def test_the_parts_of_a_likelihood_are_all_of_it():
    likelihood = ul.marginalised(posed("drag step")).likelihood
    physical = np.array([[9e5], [1e6], [1.02e6]])
    parts = [part.likelihood(physical) for part in likelihood.parts]
    assert len(parts) > 1
    assert special.logsumexp(parts, axis=0) == pytest.approx(likelihood(physical), abs=1e-9)


def test_evidences_of_the_same_blocks_compare():
    problem = posed("clean", points=50)
    models = {
        "sphere": problem,
        "paraboloid": problem.revised(scenes=[replace(SCENE, indenter=ul.Paraboloid(1e-3))]),
    }
    drawn = {name: (one, ul.sample(one)) for name, one in models.items()}
    table = ul.compare_models(drawn)
    told = {name: posterior.log_evidence.value for name, (_, posterior) in drawn.items()}
    odds = np.exp(told["sphere"] - told["paraboloid"])
    assert table.loc["sphere", "probability"] == pytest.approx(odds / (1.0 + odds), abs=1e-12)
    # Averaged noise is not stated noise, and a posterior read from a file does not know its blocks.
    white = problem.revised(noise=ul.Noise(force=1e-5))
    other = ul.compare_models({**drawn, "white": (white, ul.sample(white, method="importance"))})
    assert other["probability"].isna().all()


@pytest.mark.parametrize(("free", "words"), [([], "half-space"), (["layer.thickness"], "read off its shape")])
def test_a_longer_interval_says_what_would_shorten_it(free, words):
    layer = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    problem = ul.Problem(layer, ul.simulate(layer, np.linspace(0.0, 1e-4, 30)), ["layer.E", *free])
    told = longer_intervals(SimpleNamespace(inside=lambda level: 1.0 - 0.03 * (1.0 - level), problem=problem))
    assert words in told
    assert "holds 99.85 % of the draws" in told


@pytest.mark.parametrize("world", ["clean", "relaxation"])
def test_new_readings_lie_about_the_model_with_what_it_is_off_by(world):
    """The thickness takes up what the law is off by: what is left of the data is no noise of theirs."""
    points, noise = 200, 0.003
    clean = Clean.of(SCENE, 1.5e-4, points)
    curve = disturbed(clean, world, np.random.default_rng(3), noise)
    free = {
        "layer.E": ul.LogUniform(1e5, 1e7),
        "layer.thickness": ul.LogUniform(3e-4, 1.5e-2),
        "instrument.contact_depth": ul.Uniform(-3e-5, 3e-5),
    }
    posterior = ul.sample(ul.Problem(SCENE, curve, free), rng=1, method="importance")
    (band,) = posterior.predictive
    half = 0.5 * (band.reading[-1] - band.reading[0])
    # The size of the noise is known to 1 / sqrt(2 n), 5 %; a 97.5 % quantile of some hundred draws to 10 %, and
    # the median over the readings to far less.
    assert np.median(half) == pytest.approx(1.96 * noise * clean.top, rel=4.0 * 0.05)
    assert band.coverage() == pytest.approx(0.95, abs=4.0 * np.sqrt(0.0475 / points))
    assert (band.reading[-1] - band.reading[0] > band.model[-1] - band.model[0]).all()
