"""The engine: where its search ends, what it solves for, and lmfit's word on it."""

from dataclasses import replace
from itertools import pairwise

import lmfit
import numpy as np
import pytest

import underlay as ul
from support.inverse import ambiguous, exact_curve, layer_on, measured, problem
from support.posed import CASES, posed
from underlay.inference.least_squares import settle as settling
from underlay.inference.least_squares.engine import Running, Search, damped_steps, minimise
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective
from underlay.inference.least_squares.projection import Places

E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"
SCENE = layer_on(ul.RIGID)
BASELINE, NU = "instrument.baseline", "layer.nu"


@pytest.mark.parametrize("case", CASES)
def test_a_place_of_the_search_says_what_the_residuals_say(case):
    p = posed(case)
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)))
    vector = np.linspace(0.02, 0.05, len(p.names))
    low, high = np.full((2, len(vector)), 9.0) * np.array([[-1.0], [1.0]])
    point = objective.point(vector, low, high)
    # Wherever the linear parameters were taken to, the residuals there have these products: to the rounding of
    # a sum of squares, and J to the differences of laws.
    residuals, jacobian = objective.residuals(point.vector), objective.jacobian(point.vector)
    assert point.square == pytest.approx(residuals @ residuals, rel=1e-9)
    scale = np.sqrt(np.diag(jacobian.T @ jacobian))
    assert np.abs(point.gradient - jacobian.T @ residuals).max() < 1e-6 * (scale * point.square**0.5).max()
    assert np.abs(point.normal - jacobian.T @ jacobian).max() < 1e-6 * (scale**2).max()


TIPS = {
    "paraboloid on a rigid base": (ul.Paraboloid(1e-3), ul.RIGID, [E, H, C]),
    "paraboloid": (ul.Paraboloid(1e-3), ul.Isotropic(4e6, 0.3), [E, H, BASE, C, BASELINE]),
    "cone of its own angle": (ul.Cone(1.2), ul.Isotropic(4e6, 0.3), [E, H, C, "indenter.half_angle"]),
    "sphere on a rigid base": (ul.Sphere(1e-3), ul.RIGID, [E, H, C]),
    "sphere": (ul.Sphere(1e-3), ul.Isotropic(4e6, 0.3), [E, H, BASE, C, BASELINE]),
}


@pytest.mark.parametrize("case", TIPS)
def test_several_places_at_once_say_what_each_says_alone(case):
    tip, base, free = TIPS[case]
    scene = replace(layer_on(base), indenter=tip)
    depth = np.linspace(-2e-5, 1.2e-4, 60)
    curve = ul.Curve(depth, scene.force(depth))
    p = problem(scene, free, curve, noise=ul.Noise(force=1e-3 * float(np.ptp(curve.force))))
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)))
    assert objective.asked.in_batches
    vectors = np.random.default_rng(0).normal(0.0, 0.15, (4, len(free)))
    low, high = np.full((2, *vectors.shape), 9.0) * np.array([-1.0, 1.0])[:, None, None]
    places = objective.places(vectors, low, high)
    alone = [objective.point(*one) for one in zip(vectors, low, high, strict=True)]
    scales = np.array([np.sqrt(np.diag(point.normal)) for point in alone])
    # One law is read off the same tables in both ways: to their rounding; the slopes of a sphere's are
    # differences over 1e-7.
    assert places.square == pytest.approx([point.square for point in alone], rel=1e-9)
    assert places.vector == pytest.approx(np.array([point.vector for point in alone]), abs=1e-9)
    for row, (point, scale) in enumerate(zip(alone, scales, strict=True)):
        share = np.abs(places.gradient[row] - point.gradient) / (scale * point.square**0.5)
        assert share.max() < 1e-6
        assert (np.abs(places.normal[row] - point.normal) / np.outer(scale, scale)).max() < 2e-6


def test_a_place_without_a_law_leaves_the_others():
    p = posed("rigid")
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)))
    # So far beyond the layer there is no law; the second is beyond what is asked for at all.
    vectors = np.array([[0.02, 0.03, 0.04], [0.0, 50.0, 0.0], [0.0, -6.0, 0.0]])
    low, high = np.full((2, *vectors.shape), 99.0) * np.array([-1.0, 1.0])[:, None, None]
    places = objective.places(vectors, low, high)
    assert np.isinf(places.square).tolist() == [False, True, True]
    assert objective.failures == 2
    assert places.square[0] == pytest.approx(objective.point(vectors[0], low[0], high[0]).square, rel=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_the_engine_ends_where_lmfit_does(case):
    p = posed(case)
    found, alone = ul.fit(p), quick_fit(p)
    deviation = np.sqrt(np.diag(found.scaled_covariance))
    # The last step is of hundredths of a standard error and off by its own share again; lmfit goes on to 1e-8.
    said = [parameter.value for parameter in found.lmfit.params.values()]
    assert (np.abs(found.vector - said) < 2e-3 * deviation).all()
    assert alone.vector == pytest.approx(found.vector, abs=0.0)
    assert alone.statistics.method != found.statistics.method


def test_lmfits_own_result_is_handed_over():
    p = posed("rigid")
    found = ul.fit(p)
    result = found.lmfit
    assert isinstance(result, lmfit.minimizer.MinimizerResult)
    assert list(result.params) == ["layer_E", "layer_thickness", "instrument_contact_depth"]
    assert result.chisqr == pytest.approx(found.statistics.chi_square, rel=1e-7)
    assert found.lmfit is result
    assert ul.fit(p, method="least_squares").lmfit.method == "least_squares"
    assert "layer_thickness" in lmfit.fit_report(result)
    # A fit by the engine alone asks for it when it is asked.
    assert quick_fit(p).lmfit.chisqr == pytest.approx(result.chisqr, rel=1e-7)


@pytest.mark.parametrize(
    ("method", "loss"), [("leastsq", None), ("least_squares", None), ("least_squares", "cauchy")]
)
def test_lmfit_cut_short_hands_over_the_lowest_place_that_it_asked_for(monkeypatch, method, loss):
    # Of lmfit's leastsq the last place is memory that MINPACK has given back; and the last one is seldom the best.
    monkeypatch.setattr(settling, "_MOST_EVALUATIONS", 8)
    pose = posed("rigid")
    objective = Objective(pose, freeze(pose, pose.start, pose.noises(pose.start)))
    asked, residuals = [], objective.residuals

    def told(vector):
        found = residuals(vector)
        asked.append((np.array(vector), found.copy()))
        return found

    monkeypatch.setattr(objective, "residuals", told)
    vector, result = settling.Minimiser(method, loss)(objective, pose.start + 0.5)
    assert result.aborted
    rho = np.log1p if loss else np.asarray
    sums = [rho(own * own).sum() for _, own in asked]
    best, its = asked[int(np.argmin(sums))]
    np.testing.assert_array_equal(vector, best)
    assert result.chisqr == pytest.approx(float(its @ its), rel=1e-12)
    assert not result.success


def test_what_would_leave_its_bound_goes_there_and_the_others_to_their_best_beside_it():
    # Of an incompressible layer: the estimate of Poisson's ratio lies beyond one half about every second time.
    scene = layer_on(ul.Isotropic(4e6, 0.3), nu=0.5)
    curve, noise = measured(scene, rng=2), ul.Noise(force=2e-3)
    found = ul.fit(problem(scene.with_values({NU: 0.4}), [E, NU, C], curve, noise=noise))
    held = ul.fit(problem(scene, [E, C], curve, noise=noise))
    assert found.values[NU] == 0.5
    # A step that was clipped alone left modulus and contact where they belong to a ratio beyond: after 14 models
    # that search ended higher by 0.1, and an eighth of a standard error away.
    # Where models follow by slopes they are off by a thousandth of a standard error: chi-square by twice as much,
    # times what residuals of unit variance say to that.
    assert found.statistics.chi_square == pytest.approx(held.statistics.chi_square, abs=5e-3)
    assert found.statistics.evaluations <= 6


def test_what_the_others_pull_back_in_leaves_its_end():
    # The sum of squares falls towards beyond the upper end of the second entry, but only until the first has moved:
    # the lowest place is at (1, -0.5).
    normal = np.array([[1.0, 0.9], [0.9, 1.0]])
    lowest = np.array([1.0, -0.5])
    gradient = -normal @ lowest
    assert gradient[1] < 0.0
    here = Places(np.zeros((1, 2)), np.ones(1), gradient[None], normal[None])
    ends = np.full((1, 2), -9.0), np.array([[9.0, 0.0]])
    step, gain, _ = damped_steps(here, np.zeros(1), np.ones(2, dtype=bool), *ends)
    np.testing.assert_allclose(step, lowest[None], rtol=1e-12)
    assert gain[0] == pytest.approx(lowest @ normal @ lowest, rel=1e-12)
    # Where it is pulled out there too, it stays.
    beyond = np.array([1.0, 0.5])
    here = Places(np.zeros((1, 2)), np.ones(1), -(normal @ beyond)[None], normal[None])
    step, _, _ = damped_steps(here, np.zeros(1), np.ones(2, dtype=bool), *ends)
    np.testing.assert_allclose(step, [[1.0 + 0.9 * 0.5, 0.0]], rtol=1e-12)


def test_no_search_ends_at_a_bound_that_the_data_pull_away_from():
    # On its way to 0.499 Poisson's ratio meets one half; five of these searches ended there, up to 0.17 higher.
    scene = ul.Scene(
        ul.Paraboloid(1e-3),
        ul.Layer(ul.Isotropic(3e6, 0.499), 1e-3),
        ul.Isotropic(1.3e7, 0.3),
        ul.Instrument(contact_depth=8e-5),
    )
    noise = ul.Noise(force=0.002 * float(scene.force(1.6e-3)))
    for seed in range(10):
        curve = measured(scene, depth=1.6e-3, first=-2.4e-4, level=0.002, rng=seed)
        start = scene.with_values({E: 9e6, NU: 0.45, C: 0.0})
        found = quick_fit(problem(start, [E, NU, C], curve, noise=noise))
        held = quick_fit(problem(scene.with_values({NU: 0.4999}), [E, C], curve, noise=noise))
        # With one more number free a fit is no worse, but for a thousandth of a standard error.
        assert found.statistics.chi_square <= held.statistics.chi_square + 1e-3


def test_what_leaves_its_bound_first_is_held_first():
    """A force a hundred thousand times too large: held all at once, the two would end between their bounds."""
    curve = exact_curve(SCENE)
    free = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-5e-5, 5e-5)}
    found = quick_fit(ul.Problem(SCENE, ul.Curve(curve.depth, 1e5 * curve.force), free))
    assert found.values["layer.E"] == pytest.approx(1e8, rel=1e-9)
    assert found.values["instrument.contact_depth"] == pytest.approx(-5e-5, rel=1e-9)


def test_bounds_hold_every_place_that_is_asked_for():
    p = problem(SCENE, {E: (0.9e6, 1.02e6), H: (4e-4, 5.02e-4), C: (-1e-4, 1e-4)}, measured(SCENE, rng=4))
    asked = []
    objective = Objective(p, freeze(p, p.start, [ul.Noise(force=1e-4)]))
    models = objective.asked.columns
    objective.asked.columns = lambda physical, **how: (
        asked.append(np.array(physical)) or models(physical, **how)
    )
    minimise(objective, p.start)
    low, high = np.array([[c.low, c.high] for c in p.coordinates]).T
    assert len(asked) > 2
    # The exponential of a bound's logarithm is the bound to rounding.
    slack = 1e-12 * (high - low)
    assert all(((x >= low - slack) & (x <= high + slack)).all() for x in asked)


def test_a_last_step_beyond_the_laws_is_not_taken(monkeypatch):
    given = posed("rigid")
    found = minimise(Objective(given, freeze(given, given.start, given.noises(given.start))), given.start)
    beyond = found.vector - np.array([0.0, 5.0, 0.0])  # a/h above 20
    monkeypatch.setattr(settling, "minimise", lambda *_: replace(found, vector=beyond))
    assert np.array_equal(settling.settle(given, given.start).vector, found.point.vector)


def test_what_is_held_stays():
    p = posed("base")
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)), held=frozenset({0, 3}))
    start = np.array([0.1, 0.0, 0.0, 0.02])
    found = minimise(objective, start)
    assert found.vector[[0, 3]] == pytest.approx(start[[0, 3]], abs=0.0)
    assert found.success


def test_a_search_cut_short_says_so():
    p = problem(SCENE.with_values({E: 3e6, H: 3e-4}), [E, H, C], exact_curve(SCENE))
    objective = Objective(p, freeze(p, p.start, [ul.Noise(force=1e-6)]))
    short = minimise(objective, p.start, Search(steps=2))
    assert not short.success
    assert "2 steps" in short.message


def test_both_optima_are_found_without_lmfit():
    p = ambiguous()
    alone, confirmed = quick_fit(p), ul.fit(p)
    assert len(alone.alternatives) == len(confirmed.alternatives) == 1
    assert alone.values[E] == pytest.approx(confirmed.values[E], abs=1e-2 * confirmed.stderr[E])


def test_a_last_step_to_where_there_is_no_law_is_not_made(monkeypatch):
    scene = layer_on(ul.Isotropic(3e7, 0.3))
    depth = np.linspace(-2e-5, 1.2e-4, 60)
    curve = ul.Curve(depth, scene.force(depth))
    p = problem(scene, [E, H, C], curve, noise=ul.Noise(force=1e-3 * float(np.ptp(curve.force))))
    real = settling.minimise

    def beyond(objective, start, search, give_up=None):
        found = real(objective, start, search, give_up)
        # A layer so thin that the contact is wider than what is solved for.
        return replace(found, vector=found.vector - 12.0 * np.eye(3)[1])

    monkeypatch.setattr(settling, "minimise", beyond)
    found = quick_fit(p)
    assert found.values[H] == pytest.approx(scene.layer.thickness, rel=1e-3)


def test_a_search_is_told_what_its_next_step_promises():
    p = posed("rigid")
    asked = []
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)))
    found = minimise(objective, np.array([0.4, 0.2, 0.02]), Search(settled=1e-12), asked.append)
    assert found.success
    assert [ahead.steps for ahead in asked] == list(range(len(asked)))
    squares = [ahead.square for ahead in asked]
    assert (np.diff(squares) <= 0.0).all()
    # Newton's steps square the distance that is left, and so the part of a gain that the linear model misses falls
    # in proportion to the root of the gain: at a standard error it is some hundredths.
    near = [(a, b) for a, b in pairwise(asked) if 1e-3 < a.square - b.square < 1.0]
    assert near
    for ahead, after in near:
        assert ahead.promised == pytest.approx(after.square, abs=0.1 * (ahead.square - after.square))


@pytest.mark.parametrize(
    ("step", "gain", "words"),
    [
        (3.0, 3e-4, "the valley goes on and gains nothing"),
        (3.0, 1e-3, ""),
        (2.9, 3e-4, ""),
        (0.1, 1e-9, "the last step gained nothing"),
    ],
)
def test_a_valley_is_left_where_a_step_as_long_as_any_gains_nothing(step, gain, words):
    p = posed("rigid")
    objective = Objective(p, freeze(p, p.start, p.noises(p.start)))
    low, high = (end[None] for end in p.bounds.T)
    begin = objective.places(p.start[None], low, high)
    there = replace(
        begin, vector=begin.vector + np.array([step, 0.0, 0.0]), square=begin.square * (1.0 - gain)
    )
    still = np.zeros(1, dtype=bool)
    here = Running(np.arange(1), begin, begin, still, still, still, np.array([1e-5]), low, high)
    _, why = here.moved(there, Search(endless=5e-4))
    assert why == [words]


def asked_of(scene, depth):
    """What asks for the models of a curve up to a depth (m), and the scene's own place."""
    curve = exact_curve(scene, points=40, depth=depth, first=0.0)
    p = problem(scene, [E, H, C], curve, noise=ul.Noise(force=1e-3 * float(curve.force.max())))
    return Objective(p, freeze(p, p.start, p.noises(p.start))).asked, p.physical(p.start)


def test_rough_derivatives_serve_those_alone_who_ask_for_no_others():
    scene = layer_on(ul.Isotropic(4e6, 0.3))
    tip = replace(scene, indenter=ul.Sphere(1e-3))
    asked, place = asked_of(tip, 1e-4)
    # Off a table both are the same columns, asked for once.
    rough = asked.columns(place, rough=True)
    assert asked.columns(place, rough=False) is rough
    # Of a tip that sticks they are differences of laws: rough ones err by the step, and are not handed out.
    asked, place = asked_of(replace(scene, friction="stuck"), 1e-4)
    member = asked.members[0]
    assert member.forward.laws.tips is None
    rough = asked.columns(place, rough=True)
    fine = asked.columns(place, rough=False)
    assert fine is not rough
    assert asked.columns(place, rough=True) is fine
    # A forward difference over 1e-3 of a ratio k is off by half of that of k^2 P'', as large as P or less.
    per_unit = asked.models(place)[0].max() / np.abs(place[:2])
    assert (np.abs(rough[0] - fine[0])[:, :2].max(axis=0) < 1e-3 * per_unit).all()
    assert np.abs(rough[0] - fine[0]).max() > 0.0
