"""Errors that all readings of a curve share: their algebra by dense matrices, and a smooth error of the law."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, stats

import underlay as ul
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.sampling.model_comparison import pointwise_log_likelihood

RNG = np.random.default_rng(4)
SCENE = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)))


def dense(noise, sigma, time):
    n = len(sigma)
    R = np.eye(n)
    if noise.correlation_time:
        R = np.exp(-np.abs(time[:, None] - time) / noise.correlation_time)
    return sigma[:, None] * (R + noise.columns @ noise.columns.T) * sigma


@pytest.mark.parametrize("correlation_time", [0.0, 0.7])
@pytest.mark.parametrize("size", [0.01, 1.0, 300.0])
def test_whitening_is_the_inverse_of_the_cholesky_factor(correlation_time, size):
    n = 30
    time = np.cumsum(RNG.uniform(0.1, 0.5, n))
    columns = size * RNG.standard_normal((n, 3))
    noise = ul.LowRankNoise(force=2.0, correlation_time=correlation_time, columns=columns)
    sigma = RNG.uniform(1.0, 3.0, n)
    V = dense(noise, sigma, time)
    residuals = RNG.standard_normal((4, n))
    # A whitening that only looks back, with a positive diagonal, is that of Cholesky and no other.
    expected = np.linalg.solve(np.linalg.cholesky(V), residuals.T).T
    lost = n * np.finfo(float).eps * np.linalg.cond(V)
    assert noise.whiten(residuals / sigma, time) == pytest.approx(expected, abs=lost * np.abs(expected).max())
    assert noise.log_determinant(sigma, time) == pytest.approx(0.5 * np.linalg.slogdet(V)[1], abs=1e-9 + lost)


def test_the_density_of_a_problem_is_that_of_the_normal_distribution():
    curve = ul.synthesize(SCENE, np.linspace(0.0, 1e-5, 12), ul.Noise(force=1e-5), rng=1)
    noise = ul.LowRankNoise(force=1e-5, columns=RNG.standard_normal((12, 2)))
    problem = ul.Problem(SCENE, curve, {"layer.E": None}, noise)
    V = dense(noise, np.full(12, 1e-5), None)
    for density, shift in zip(problem.log_likelihood(np.array([[0.0], [0.02]])), (0.0, 0.02), strict=True):
        model = SCENE.with_values({"layer.E": 1e6 * np.exp(shift)}).force(curve.depth)
        assert density == pytest.approx(stats.multivariate_normal.logpdf(curve.force, model, V), rel=1e-9)


def test_draws_have_the_covariance():
    columns = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]])
    noise = ul.LowRankNoise(force=1.0, correlation_time=1.0, columns=columns)
    time, sigma = np.arange(3.0), np.array([1.0, 2.0, 1.0])
    draws = noise.sample(np.random.default_rng(0), np.tile(sigma, (20_000, 1)), time)
    V = dense(noise, sigma, time)
    # The standard deviation of a sample covariance is at most sqrt(2 V_ii V_jj / draws).
    allowed = 5.0 * np.sqrt(2.0 * np.outer(np.diag(V), np.diag(V)) / 20_000)
    assert (np.abs(np.cov(draws.T) - V) < allowed).all()


def test_what_does_not_fit_is_refused():
    noise = ul.LowRankNoise(force=1e-6, columns=np.ones((5, 1)))
    with pytest.raises(ul.InputError, match="a curve with 5 readings; got 4"):
        noise.whiten(np.zeros(4))
    assert noise.of_readings(np.arange(5) != 2).columns.shape == (4, 1)
    curve = ul.synthesize(SCENE, np.linspace(0.0, 1e-5, 9), ul.Noise(force=1e-6), rng=1)
    with pytest.raises(ul.InputError, match="cannot be fitted beside shared errors"):
        ul.Problem(SCENE, curve, ["layer.E", "noise.force"], noise)
    with pytest.raises(ul.InputError, match=r"\(readings, errors\)"):
        ul.LowRankNoise(force=1e-6, columns=np.ones(5))


# --- the smooth error of a law -------------------------------------------------------------------------------


def stated(points, model_error=0.02, rng=1):
    curve = ul.synthesize(SCENE, np.linspace(0.0, 1e-5, points), ul.Noise(force=1e-7), rng=rng)
    problem = ul.Problem(SCENE, curve, {"layer.E": None}, ul.Noise(force=1e-7))
    return problem, ul.with_model_error(problem, model_error)


def smooth_shares(depth, count=40):
    """Relative errors of the force that are smooth in depth, 2 % at one standard deviation."""
    x, rng = np.pi * np.sqrt(depth / depth.max()), np.random.default_rng(2)
    for _ in range(count):
        u = rng.standard_normal(3)
        yield 0.02 * (u[0] + u[1] * np.cos(x) + u[2] * np.sin(x)) / np.sqrt(2.0)


def held(problems, curves):
    """Which of the problems' intervals hold the truth on other curves."""
    fits = [ul.fit(problem.revised(curves=curves)) for problem in problems]
    return [1e6 in found.interval("layer.E", part="statistical") for found in fits]


def test_a_smooth_error_does_not_average_away():
    few, many = (ul.fit(stated(points)[1]) for points in (40, 1000))
    errors = [found.stderr["layer.E"] / found.values["layer.E"] for found in (few, many)]
    # The best estimate under three known shapes is better than any one point, which is off by 2 %, and no better
    # than their common part; noise of 1e-7 N on 1e-4 N adds nothing to that.
    assert errors[1] == pytest.approx(errors[0], rel=0.1)
    assert 0.002 < errors[1] < 0.02


def test_a_law_that_is_smoothly_wrong_is_covered_and_noise_in_proportion_does_not():
    problem, wider = stated(200)
    (curve,) = problem.curves
    both = wider, problem.revised(noise=ul.Noise(force=1e-7, relative=0.02))
    counts = np.zeros(2)
    for share in smooth_shares(curve.depth):
        counts += held(both, [ul.Curve(curve.depth, curve.force * (1.0 + share))])
    # 40 of a coverage of 95 % show fewer than 33 once in a thousand times.
    assert counts[0] >= 33
    assert counts[1] < 25


def test_a_model_error_needs_a_noise_that_is_known():
    problem, wider = stated(20)
    with pytest.raises(ul.InputError, match="zero or more"):
        ul.with_model_error(problem, -0.1)
    with pytest.raises(ul.InputError, match=r"state noise\.force"):
        ul.with_model_error(problem.revised(noise=ul.Noise()), 0.1)
    # A second error stands beside the first: their variances add.
    twice = ul.with_model_error(wider, 0.02)
    errors = [ul.fit(p).stderr["layer.E"] for p in (wider, twice)]
    assert errors[1] == pytest.approx(np.sqrt(2.0) * errors[0], rel=0.05)


# --- an error that curves have in common ---------------------------------------------------------------------


def repeated(curves, points=40, model_error=0.02):
    """So many curves of one test, fitted jointly with an error of the law."""
    tests = [
        (SCENE, ul.synthesize(SCENE, np.linspace(0.0, 1e-5, points), ul.Noise(force=1e-7), rng=number))
        for number in range(curves)
    ]
    free = {"layer.E": ul.LogUniform(1e4, 1e8)}
    problem = ul.Problem.joint(tests, free, ["layer.E"], ul.Noise(force=1e-7))
    return problem, ul.with_model_error(problem, model_error)


def test_curves_that_have_errors_in_common_have_the_joint_normal_density():
    """Other depths, tips, correlations and own shared errors: against one dense covariance of all readings."""
    tests, noises = [], []
    for number, radius in enumerate((1e-3, 3e-3)):
        scene = SCENE.with_values({"indenter.radius": radius})
        n = 10 + 3 * number
        depth, time = np.linspace(0.0, 1e-5 * (1 + number), n), np.arange(float(n))
        tests.append((scene, ul.synthesize(scene, depth, ul.Noise(force=1e-5), rng=number, time=time)))
        own, common = RNG.standard_normal((n, number)), RNG.standard_normal((n, 2))
        noises.append(ul.LowRankNoise(force=1e-5, correlation_time=1.0 + number, columns=own, common=common))
    free = {"layer.E": ul.LogUniform(1e5, 1e7), "instrument.contact_depth": ul.Normal(0.0, 1e-6)}
    problem = ul.Problem.joint(tests, free, ["layer.E"], noises)
    blocks = [dense(one, np.full(len(c), 1e-5), c.time) for one, (_, c) in zip(noises, tests, strict=True)]
    shared = 1e-5 * np.concatenate([one.common for one in noises])
    V = linalg.block_diag(*blocks) + shared @ shared.T
    measured = np.concatenate([curve.force for _, curve in tests])
    vectors = np.random.default_rng(3).normal(scale=0.02, size=(3, len(problem.names)))
    for vector, density in zip(vectors, problem.log_likelihood(vectors), strict=True):
        model = np.concatenate(
            [s.force(c.depth) for s, c in zip(problem.scenes(vector), problem.curves, strict=True)]
        )
        assert density == pytest.approx(stats.multivariate_normal.logpdf(measured, model, V), rel=1e-8)
        whitened = problem.residuals(vector)
        assert whitened @ whitened == pytest.approx(
            (measured - model) @ np.linalg.solve(V, measured - model), rel=1e-7
        )
    points = pointwise_log_likelihood(problem, problem.physical(vectors))
    np.testing.assert_allclose(points.sum(axis=1), problem.log_likelihood(vectors), rtol=1e-9)
    # What a fit minimises is the same, and so are its slopes.
    objective = Objective(problem, freeze(problem, vectors[0], problem.noises(vectors[0])))
    steps = 1e-6 * np.eye(len(problem.names))
    found = [
        (objective.residuals(vectors[0] + h) - objective.residuals(vectors[0] - h)) / 2e-6 for h in steps
    ]
    slopes = objective.jacobian(vectors[0])
    np.testing.assert_allclose(slopes, np.transpose(found), atol=1e-6 * np.abs(slopes).max())
    fitted = ul.fit(problem)
    assert fitted.statistics.log_likelihood == pytest.approx(
        problem.log_likelihood(fitted.vector[None]).item(), abs=1e-4
    )


def test_an_error_of_the_law_does_not_average_away_with_curves():
    """Sixteen curves of one test know E no better than one; errors of each curve alone would to a quarter."""
    one, wider = repeated(1), repeated(16)
    alone, together = (ul.fit(problem) for _, problem in (one, wider))
    assert together.stderr["layer.E"] == pytest.approx(alone.stderr["layer.E"], rel=0.02)
    each = [replace(n, columns=n.common, common=np.zeros((40, 0))) for n in wider[1].noise]
    independent = ul.fit(wider[1].revised(noise=each))
    assert independent.stderr["layer.E"] == pytest.approx(alone.stderr["layer.E"] / 4.0, rel=0.02)
    # In an interval and in a posterior as well.
    told = together.interval("layer.E", part="statistical")
    assert told.high - told.low == pytest.approx(2 * 1.96 * together.stderr["layer.E"], rel=0.05)
    draws = ul.sample(repeated(3)[1], walkers=16, rng=1, progress=False).samples["layer.E"]
    assert draws.std() == pytest.approx(alone.stderr["layer.E"], rel=0.1)


def test_a_law_that_is_wrong_alike_in_all_curves_is_covered():
    """The same smooth error in four curves: the interval holds; with each curve's own error it must fail."""
    plain, wider = repeated(4)
    each = wider.revised(noise=[replace(n, columns=n.common, common=np.zeros((40, 0))) for n in wider.noise])
    counts = np.zeros(2)
    for share in smooth_shares(plain.curves[0].depth):
        wrong = [ul.Curve(curve.depth, curve.force * (1.0 + share)) for curve in plain.curves]
        counts += held((wider, each), wrong)
    # 40 of a coverage of 95 % show fewer than 33 once in a thousand times; of half the width it is 67 %.
    assert counts[0] >= 33
    assert counts[1] < 33


def test_curves_with_other_numbers_of_common_errors_are_refused():
    _, wider = repeated(2)
    fewer = replace(wider.noise[1], common=wider.noise[1].common[:, :2])
    with pytest.raises(ul.InputError, match="give each curve as many columns; got 3, 2"):
        wider.revised(noise=[wider.noise[0], fewer])
    with pytest.raises(ul.InputError, match=r"common are \(readings, errors\)"):
        ul.LowRankNoise(force=1e-6, common=np.ones(5))
    with pytest.raises(ul.InputError, match="a curve with 5 readings; got 4"):
        ul.LowRankNoise(force=1e-6, columns=np.ones((4, 1)), common=np.ones((5, 1))).whiten(np.zeros(4))
    noise = ul.LowRankNoise(force=1e-6, common=np.ones((5, 1)))
    assert noise.of_readings(np.arange(5) > 1).common.shape == (3, 1)
