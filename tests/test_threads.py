"""What is solved for, fitted or drawn takes one thread of linear algebra, and leaves as many as there were."""

import numpy as np
import pytest
import scipy.linalg  # noqa: F401  its own linear algebra is one of those counted
from threadpoolctl import threadpool_info, threadpool_limits

import underlay as ul
from support.inverse import layer_on, measured, problem
from underlay._threads import one_thread
from underlay.inference.model.forward import Forward
from underlay.inference.uncertainty.likelihood import Likelihood
from underlay.mechanics.exact.punch_solution import PunchGrid

FREE = ["layer.E", "instrument.contact_depth"]


def threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture
def two():
    with threadpool_limits(2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("linear algebra has one thread here")
        yield


@pytest.fixture
def seen(monkeypatch):
    """Numbers of threads that were seen where laws are asked for, and the weights of a fit's residuals found."""
    found = set()

    def watched(owner, name):
        original = getattr(owner, name)

        def looked(*args, **options):
            found.update(threads())
            return original(*args, **options)

        monkeypatch.setattr(owner, name, looked)

    watched(Forward, "law")
    watched(PunchGrid, "solve")
    watched(Likelihood, "of")
    return found


@pytest.mark.usefixtures("two")
def test_one_thread_inside_and_those_of_before_after_it():
    with one_thread():
        assert threads() == {1}
        with one_thread():
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}
    with pytest.raises(KeyError), one_thread():
        raise KeyError
    assert threads() == {2}


def fitted():
    return ul.fit(problem(layer_on(ul.RIGID), FREE))


CALLS = {
    "a law": lambda: ul.contact_law(
        ul.Sphere(1e-3),
        ul.Layer(ul.Isotropic(1e6, 0.4), 1.1e-3),
        ul.RIGID,
        max_depth=1e-5,
        solver=ul.Exact(3e-8),
    ),
    "a fit": fitted,
    "a profile": lambda: ul.profile(problem(layer_on(ul.RIGID), FREE), "layer.E"),
    "a plan": lambda: ul.plan(
        layer_on(ul.RIGID), free=FREE, noise=ul.Noise(force=1e-4), radii=[1e-3], depths=[1e-4]
    ),
    "what a test tells": lambda: ul.identifiability(
        layer_on(ul.RIGID), depth=np.linspace(0.0, 1e-4, 30), free=FREE, noise=ul.Noise(force=1e-4)
    ),
}


@pytest.mark.usefixtures("two")
@pytest.mark.parametrize("name", CALLS)
def test_what_takes_time_takes_one_thread(name, seen):
    CALLS[name]()
    assert seen == {1}
    assert threads() == {2}


@pytest.mark.usefixtures("two")
@pytest.mark.parametrize("stated", [False, True])
def test_an_interval_takes_one_thread(stated, request):
    scene = layer_on(ul.RIGID)
    curve = measured(scene)
    noise = ul.Noise(force=float(np.std(curve.force[:20]))) if stated else None
    fit = ul.fit(ul.Problem(scene, curve, [*FREE, "layer.thickness"], noise))
    seen = request.getfixturevalue("seen")
    fit.interval("layer.thickness")
    assert seen == {1}
    assert fit.verdict.word
    assert threads() == {2}


@pytest.mark.usefixtures("two")
def test_a_posterior_takes_one_thread(seen):
    free = {"layer.E": ul.LogUniform(1e5, 1e7), "instrument.contact_depth": ul.Uniform(0.0, 2e-5)}
    ul.sample(problem(layer_on(ul.RIGID), free), method="importance")
    assert seen == {1}


@pytest.mark.usefixtures("two")
def test_the_control_sees_what_nothing_limits(seen):
    made = problem(layer_on(ul.RIGID), FREE)
    made.members[0].model(made.physical(np.zeros(2)))
    assert 2 in seen
