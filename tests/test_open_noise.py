"""Posteriors of curves whose noise nobody stated: the same likelihood as that of the fit's intervals."""

import numpy as np
import pytest

import underlay as ul
from support.worlds import Clean, disturbed

SCENE = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)
E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"
PRIORS = {
    E: ul.LogUniform(1e4, 1e8),
    H: ul.LogUniform(3e-4, 1.5e-2),
    C: ul.Uniform(-3e-5, 3e-5),
    BASE: ul.LogUniform(1e5, 1e9),
}


def posed(world, free=(E,), seed=1, points=150, noise=None):
    scene = SCENE if BASE not in free else ul.Scene(SCENE.indenter, SCENE.layer, ul.Isotropic(4e6, 0.3))
    clean = Clean.of(scene, 1.5e-4, points)
    curve = disturbed(clean, world, np.random.default_rng(seed), 0.003)
    size = ul.Noise(force=0.003 * clean.top) if noise == "stated" else None
    return ul.Problem(scene, curve, {name: PRIORS[name] for name in free}, size)


def joint():
    curves = [posed("clean", seed=seed).curves[0] for seed in (1, 2)]
    return ul.Problem.joint([(SCENE, curve) for curve in curves], {E: PRIORS[E], C: PRIORS[C]}, [E])


CASES = {
    "clean": lambda: posed("clean", (E, C)),
    "AR and white": lambda: posed("AR(1) and white", (E, C)),
    "thickness": lambda: posed("clean", (E, H, C)),
    "base": lambda: posed("clean", (E, BASE, C)),
    "joint": joint,
    "stated": lambda: posed("clean", (E, H, C), noise="stated"),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("method", [None, "emcee"])
def test_the_statistical_part_is_that_of_the_fit(case, method):
    problem = CASES[case]()
    known, found = ul.fit(problem), ul.sample(problem, method=method, rng=1)
    assert found.converged
    assert found.diagnostics.weighted == (method is None)
    for name in problem.names:
        c = problem.coordinates[problem.names.index(name)]
        own, theirs = (
            np.array([c.scaled(end) for end in (part.low, part.high)])
            for part in (found.answer(name).statistical, known.answer(name).statistical)
        )
        sigma = np.ptp(theirs) / 3.92
        # Errors of both: the fit's own draws are a thousand, worth 0.1 standard deviations at an end.
        errors = np.hypot(0.1, np.array(found.diagnostics.quantile_errors[name])[[0, 2]])
        assert (np.abs(own - theirs) < 4.0 * errors * sigma).all()
        assert found.answer(name).value == known.answer(name).value


def test_white_noise_that_is_stated_is_three_times_too_sure_of_a_correlated_curve():
    """The control: the agreement above is no agreement of everything with everything."""
    problem = posed("AR(1) and white", (E, C))
    white = ul.sample(problem.revised(noise=ul.Noise()), method="importance").samples[E]
    open_ = ul.sample(problem, method="importance").samples[E]
    assert np.ptp(np.quantile(white, [0.025, 0.975])) < 0.4 * np.ptp(np.quantile(open_, [0.025, 0.975]))


def test_there_is_no_evidence_where_no_noise_is_stated():
    problem = posed("clean", (E, C))
    assert ul.sample(problem, method="importance").log_evidence is None
    assert ul.sample(problem.revised(noise=ul.Noise()), method="importance").log_evidence is not None


def coverage(problems, samples):
    """Share of 95 % intervals that hold the truth."""
    held = []
    for problem, sample in zip(problems, samples, strict=True):
        low, high = np.quantile(sample, [0.025, 0.975])
        held.append(low <= problem.base_scenes[0].parameters[E] <= high)
    return np.mean(held)


def test_intervals_cover_and_those_of_white_noise_do_not():
    problems = [posed("AR(1) and white", (E, C), seed=seed) for seed in range(100, 140)]
    own = [ul.sample(one, method="importance").samples[E] for one in problems]
    white = [ul.sample(one.revised(noise=ul.Noise()), method="importance").samples[E] for one in problems]
    # Forty of 95 %: 36 or fewer have a chance of 5 %, 33 or fewer of 0.03 %.
    assert coverage(problems, own) > 33 / 40
    assert coverage(problems, white) < 33 / 40


def test_new_readings_lie_about_the_model():
    points, noise = 200, 0.003
    posterior = ul.sample(posed("clean", (E, H, C), points=points), rng=1, method="importance")
    (band,) = posterior.predictive
    assert band.coverage() == pytest.approx(0.95, abs=4.0 * np.sqrt(0.0475 / points))
    half = 0.5 * (band.reading[-1] - band.reading[0])
    top = np.ptp(SCENE.force(np.array([0.0, 1.5e-4])))
    # Before contact it is the noise alone: its size is known to 5 %, a quantile of 500 draws to 10 %.
    assert np.median(half[band.depth < 0.0]) == pytest.approx(1.96 * noise * top, rel=0.2)


def test_the_name_that_goes_says_so_and_still_works():
    problem = posed("clean", (E, C))
    with pytest.warns(DeprecationWarning, match="marginalised goes"):
        averaged = ul.marginalised(problem)
    likelihood = ul.fit(problem).statement.likelihood
    vectors = ul.fit(problem).vector + np.array([[0.0, 0.0], [1e-3, -1e-3], [0.0, 2e-3]])
    np.testing.assert_allclose(averaged.log_posterior(vectors), likelihood.log_density(vectors), rtol=1e-9)
    stated = problem.revised(noise=ul.Noise())
    with pytest.warns(DeprecationWarning, match="marginalised goes"):
        assert ul.marginalised(stated) is stated
