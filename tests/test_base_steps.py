"""Steps of a base's modulus: what they are straight in, and what that spares a search."""

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on, measured, problem
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import BaseSteps, Objective, log_share
from underlay.inference.least_squares.settle import first_noises

E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"
HERE = np.zeros((1, 4))  # the numbers of the scene


def steps_of(ratio):
    """Of a problem with a base `ratio` times the layer."""
    p = problem(layer_on(ul.Isotropic(ratio * 1e6, 0.3)), [E, H, C, BASE])
    return BaseSteps.of(p.members, p.coordinates)


@pytest.mark.parametrize("ratio", [1e-6, 0.1, 1.0, 30.0, 1e6])
def test_a_step_leads_where_it_was_measured_to(ratio):
    rng = np.random.default_rng(0)
    here, there = rng.uniform(-2.0, 2.0, (2, 5, 4))
    course = steps_of(ratio)
    changes = course.changes(here, course.straight(here, there - here), 10.0)
    # u = -ln(1 + 1/k) of k up to 5e7 keeps nine digits of a change.
    assert changes == pytest.approx(there - here, rel=1e-7)


@pytest.mark.parametrize("ratio", [1e-3, 1.0, 1e3])
def test_a_short_step_is_one_of_the_logarithm(ratio):
    step = np.array([[0.3, -0.2, 0.1, 1e-4]])
    changes = steps_of(ratio).changes(HERE, step, 3.0)
    # d2(ln k)/du2 is at most one over the slope squared: the square of the step is what is left.
    assert changes == pytest.approx(step, abs=2e-8)
    assert (changes[:, :3] == step[:, :3]).all()


def test_a_step_is_straight_in_the_compliance_of_a_stiff_base_and_in_the_logarithm_of_a_soft_one():
    down = np.array([[0.0, 0.0, 0.0, -2.0]])
    stiff, soft = (steps_of(ratio).changes(HERE, down, 5.0)[0, 3] for ratio in (1e6, 1e-6))
    assert stiff == pytest.approx(-np.log(3.0), abs=1e-5)
    assert soft == pytest.approx(-2.0, abs=1e-5)


def test_no_step_leads_beyond_a_rigid_base_nor_further_than_the_longest():
    course = steps_of(10.0)
    for step, expected in ((1e3, 3.0), (np.inf, 3.0), (-1e3, -3.0)):
        assert course.changes(HERE, np.array([[0.0, 0.0, 0.0, step]]), 3.0)[0, 3] == pytest.approx(expected)
    rigid = course.straight(HERE, np.array([[0.0, 0.0, 0.0, np.inf]]))[0, 3]
    # u of a rigid base is zero.
    slope = 1.0 / 11.0
    assert rigid == pytest.approx(-float(log_share(np.log(10.0))) / slope)
    assert course.straight(HERE, np.array([[0.0, 0.0, 0.0, -np.inf]]))[0, 3] == -np.inf


def test_only_free_moduli_of_bases_are_stepped_so():
    stiff = layer_on(ul.Isotropic(1e8, 0.3))
    for free in ([E, H, C], [H, C]):
        p = problem(stiff, free)
        assert BaseSteps.of(p.members, p.coordinates) is None
    known = problem(stiff, [H, C, BASE])
    course = BaseSteps.of(known.members, known.coordinates)
    assert course.free.tolist() == [0.0]
    assert course.at_start == pytest.approx([np.log(100.0)])


def models_asked(p, start):
    """By a search on all points from a scaled start, and the sum of squares where it ends."""
    objective = Objective(p, freeze(p, start, first_noises(p, start)))
    found = minimise(objective, start)
    return objective.evaluations, found.point.square, objective


def test_a_search_from_too_stiff_a_base_comes_straight_down(monkeypatch):
    scene = layer_on(ul.Isotropic(2e7, 0.3))
    p = problem(scene, [E, H, C, BASE], measured(scene, level=1e-4))
    # From 100 times the layer to 20 times: steps of ln k are off by half their length there, those of 1/k are not.
    start = np.array([0.0, 0.0, 0.0, np.log(5.0)])
    asked, square, objective = models_asked(p, start)
    monkeypatch.setattr(BaseSteps, "of", lambda *_: None)
    in_logarithms, same, _ = models_asked(p, start)
    assert square == pytest.approx(same, rel=1e-6)
    assert objective.failures == 0
    assert asked < in_logarithms


def test_a_bound_of_a_base_is_met():
    scene = layer_on(ul.Isotropic(3e6, 0.3))
    curve = measured(scene, level=1e-3)
    for ends, side in (((3e5, 1e6), "upper"), ((1e7, 1e9), "lower")):
        start = scene.with_values({BASE: float(np.sqrt(np.prod(ends)))})
        fitted = ul.fit(ul.Problem(start, curve, {E: None, C: None, BASE: ends}, ul.Noise(force=1e-9)))
        assert side in fitted.bounds_hit[BASE]
