"""Comparing models of one curve, and stating a model's error."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.posterior_cases import WHITE, halfspace_curve, halfspace_problem, halfspace_scene
from underlay.inference.sampling.model_comparison import pointwise_log_likelihood

LAYERED = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4), ul.RIGID)
DEPTH = np.linspace(0.0, 5e-5, 60)
NOISE = ul.Noise(force=2e-4)


@pytest.mark.parametrize(
    "noise", [ul.Noise(force=WHITE), ul.Noise(force=WHITE, relative=0.01, correlation_time=0.05)]
)
def test_points_add_up_to_the_likelihood(noise):
    problem = halfspace_problem(noise=noise)
    vectors = np.random.default_rng(0).normal(scale=0.01, size=(5, 2))
    points = pointwise_log_likelihood(problem, problem.physical(vectors))
    assert points.shape == (5, 40)
    np.testing.assert_allclose(points.sum(axis=1), problem.log_likelihood(vectors), rtol=1e-10)


def test_the_right_model_wins_and_its_error_is_stated():
    curve = ul.synthesize(LAYERED, DEPTH, NOISE, 1)
    free = {"layer.E": ul.LogUniform(1e4, 1e8)}
    models = {}
    for name, method in (("no layer effect", "halfspace"), ("exact", "exact")):
        problem = ul.Problem(LAYERED, curve, free, NOISE, solver=method)
        models[name] = (problem, ul.sample(problem, walkers=16))
    table = ul.compare_models(models)
    assert list(table.index) == ["exact", "no layer effect"]
    assert table.loc["no layer effect", "elpd_diff"] > 5.0 * table.loc["no layer effect", "dse"] > 0.0
    assert table.loc["exact", "p_loo"] == pytest.approx(1.0, abs=0.6)
    assert table.loc["exact", "model_error"] < 1e-4
    assert table.loc["exact", "weight"] > 0.95
    # The first point is not in contact: no draw changes its density, and that is no reason for doubt. A law
    # that misses the deepest points by many standard errors is one.
    assert DEPTH[0] == 0.0
    assert not table.loc["exact", "warning"]
    assert table.loc["no layer effect", "warning"]


def test_a_stated_model_error_widens_the_interval():
    curve = ul.synthesize(LAYERED, DEPTH, NOISE, 1)
    problem = ul.Problem(
        LAYERED, curve, {"layer.E": ul.LogUniform(1e4, 1e8)}, ul.Noise(force=2e-4, relative=0.003)
    )
    wider = ul.with_model_error(problem, 0.03)
    widths = [ul.sample(p, walkers=16).samples["layer.E"].std() for p in (problem, wider)]
    assert widths[1] > 1.5 * widths[0]
    with pytest.raises(ul.InputError, match="zero or more"):
        ul.with_model_error(problem, -0.1)


def test_a_posterior_of_another_problem_is_refused(tmp_path):
    """By what differs: what is free, curve, scene, law, noise or prior; where a search starts does not count."""
    problem = halfspace_problem()
    posterior = ul.sample(problem, walkers=8)
    moved = problem.revised(scenes=[halfspace_scene().with_values({"layer.E": 1.3e6})])
    scores = ul.compare_models({"a": (problem, posterior), "b": (moved, posterior)})
    assert scores["elpd_diff"].abs().max() < 1e-6
    others = halfspace_problem(halfspace_curve(seed=2))
    with pytest.raises(ul.InputError, match="model 'b' is not that of its problem: the curves differ"):
        ul.compare_models({"a": (problem, posterior), "b": (problem, ul.sample(others, walkers=8))})
    for other, told in {
        problem.revised(
            free={"layer.E": problem.free["layer.E"]}
        ): "free are layer.E, instrument.contact_depth",
        problem.revised(scenes=[halfspace_scene().with_values({"indenter.radius": 2e-3})]): (
            "indenter.radius is 0.001 there and 0.002 in the problem"
        ),
        problem.revised(scenes=[ul.Scene(LAYERED.indenter, LAYERED.layer, ul.RIGID)]): "",
        problem.revised(solver="halfspace"): "the contact law is",
        problem.revised(noise=ul.Noise(force=2.0 * WHITE)): "the noise differs",
        problem.revised(noise=ul.Noise()): "the noise is stated in one",
        ul.with_model_error(problem, 0.01): "the noise differs",
        problem.revised(free=problem.free | {"layer.E": ul.LogUniform(1e5, 1e7)}): "the priors differ",
    }.items():
        with pytest.raises(
            ul.InputError, match=rf"of model 'b' is not that of its problem: {told}.*ul\.sample"
        ):
            ul.compare_models({"a": (problem, posterior), "b": (other, posterior)})
    # Also of one that was saved, and of one that was saved without its problem.
    file = tmp_path / "posterior.npz"
    posterior.save(file)
    for kept in (ul.Posterior.load(file), replace(posterior, problem=None, missing="a reason")):
        ul.compare_models({"a": (problem, posterior), "b": (problem, kept)})
        with pytest.raises(ul.InputError, match="the curves differ"):
            ul.compare_models({"a": (others, kept), "b": (others, kept)})


def test_models_with_a_model_error_are_compared():
    """Their noise has no name in scene files, and arrays that no equality of theirs compares."""
    problem = halfspace_problem()
    models = [ul.with_model_error(problem, error) for error in (0.01, 0.02)]
    posteriors = [ul.sample(model, walkers=8) for model in models]
    pairs = {"one": (models[0], posteriors[0]), "two": (models[1], posteriors[1])}
    assert set(ul.compare_models(pairs).index) == {"one", "two"}
    with pytest.raises(ul.InputError, match="of model 'two' is not that of its problem: the noise differs"):
        ul.compare_models({**pairs, "two": (models[1], posteriors[0])})


def test_models_of_different_data_are_refused():
    one, other = halfspace_problem(), halfspace_problem(halfspace_curve(seed=2))
    posterior = ul.sample(one, walkers=8)
    with pytest.raises(ul.InputError, match="other curves"):
        ul.compare_models({"a": (one, posterior), "b": (other, posterior)})
    with pytest.raises(ul.InputError, match="at least two"):
        ul.compare_models({"a": (one, posterior)})
    assert halfspace_scene().substrate is None
