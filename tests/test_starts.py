"""Starts and their candidates: blocks, the scan's agreement with a known base, which minima are kept."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.inverse import exact_curve, layer_on, measured, problem
from underlay.inference.answer_cost import plain_hertz_fit
from underlay.inference.least_squares import fitting
from underlay.inference.least_squares.candidates import candidates
from underlay.inference.least_squares.scan import Landscape, scan
from underlay.inference.least_squares.scan_curve import Blocks, blocked_objective
from underlay.inference.least_squares.settle import settle

E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"
SCENE = layer_on(ul.RIGID)
BASELINE = "instrument.baseline"


@pytest.mark.parametrize("points", [20, 32, 33, 1000])
def test_blocks_are_the_medians_or_averages_of_neighbours(points):
    rng = np.random.default_rng(points)
    curve = ul.Curve(rng.permutation(np.linspace(0.0, 1.0, points)), rng.standard_normal(points))
    order = np.argsort(curve.depth)
    groups = np.array_split(order, min(32, points))
    for middle, averages in ((np.median, False), (np.mean, True)):
        blocks = Blocks.of(curve, 32, averages=averages)
        # Sums of the same numbers in another order: a few roundings.
        assert blocks.force == pytest.approx([middle(curve.force[g]) for g in groups], rel=1e-12, abs=1e-14)
        assert blocks.depth == pytest.approx([middle(curve.depth[g]) for g in groups], rel=1e-12, abs=1e-14)


def test_averages_of_a_parabola_are_brought_onto_it():
    depth = np.sort(np.random.default_rng(0).uniform(-1.0, 2.0, 1000))
    curve = ul.Curve(depth, 3.0 * depth**2 - depth + 0.5)
    averages = Blocks.of(curve, 32, averages=True)
    on_it = 3.0 * averages.depth**2 - averages.depth + 0.5
    # Curvature adds 3 var(w), with 31 points over a thirty-second of the range; the parabola found is that to
    # what its ends carry of the same, which is equal but for how uneven the depths are.
    assert (averages.force - on_it).min() > 5e-4
    assert np.abs(averages.straightened().force - on_it).max() < 0.1 * (averages.force - on_it).max()
    few = Blocks.of(curve, 6, averages=True)
    assert few.straightened() is few


@pytest.mark.parametrize("indenter", [ul.Paraboloid(1e-3), ul.Sphere(1e-3), ul.Cone(1.2)])
@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(4e6, 0.3), ul.Isotropic(3e5, 0.3)])
def test_blocked_derivatives_are_those_of_its_residuals(indenter, base):
    scene = layer_on(base, indenter=indenter, baseline=2e-3)
    free = [E, H, C, BASELINE, *([] if base is ul.RIGID else [BASE])]
    p = problem(scene, free)
    blocked = blocked_objective(p, robust=False)
    vector = np.full(len(free), 0.01)
    jacobian = blocked.jacobian(vector, rough=True)
    for k, step in enumerate(1e-3 * np.eye(len(free))):
        change = blocked.residuals(vector + step) - blocked.residuals(vector - step)
        # Laws to 1e-3: their differences over 2e-3 are within a few hundredths of the largest derivative.
        assert np.abs(change / 2e-3 - jacobian[:, k]).max() < 0.05 * np.abs(jacobian[:, k]).max(), free[k]


def test_linear_parameters_are_at_their_best_wherever_it_is_asked():
    scene = layer_on(ul.Isotropic(4e6, 0.3), baseline=2e-3)
    p = problem(scene, [E, H, C, BASE, BASELINE])
    blocked = blocked_objective(p, robust=False)
    wide = np.full(5, 5.0)
    point = blocked.point(np.array([0.7, 0.1, 0.02, 0.7, 0.3]), -wide, wide)
    # Both moduli together, and the baseline: the gradient vanishes along them, up to the rounding of the solution.
    scale = np.sqrt(np.diag(point.normal) * point.square)
    gradient = point.gradient
    assert abs(gradient[0] + gradient[3]) < 1e-4 * scale[0]
    assert abs(gradient[4]) < 1e-9 * scale[4]
    assert point.vector[3] - point.vector[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(4e6, 0.3)])
def test_a_rough_fit_ends_within_a_fraction_of_a_standard_error(base):
    scene = layer_on(base)
    p = problem(scene, [E, H, C], measured(scene, points=1000))
    found = ul.fit(p)
    deviation = np.sqrt(np.diag(found.scaled_covariance))
    (rough,) = candidates(blocked_objective(p, robust=False), [found.vector + np.array([0.4, 0.3, 0.01])])
    # Averages of 31 points lose little of what 1000 tell; the law is coarse to 1e-3 of the force.
    assert (np.abs(rough.vector - found.vector) < 0.5 * deviation).all()


def test_one_place_is_kept_once():
    p = problem(SCENE, [E, H, C])
    start = ul.fit(p).vector
    near = start + np.array([[0.0, 0.0, 0.0], [0.05, 0.04, 0.0], [-0.1, -0.1, 0.0]])
    assert len(candidates(blocked_objective(p, robust=False), near)) == 1


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(2e7, 0.3), ul.Isotropic(3e6, 0.3)])
def test_the_scan_finds_the_thickness_between_those_that_it_tries(base):
    scene = layer_on(base)
    start = scene.with_values({E: 1e2 * scene.parameters[E], H: 3.0 * scene.parameters[H]})
    p = ul.Problem(start, exact_curve(scene), [E, H, C])
    best = p.values(scan(p)[0].vector)
    # Those that it tries are 0.54 apart in the logarithm, so without looking between them it is up to 0.27 off; a
    # parabola leaves the third power of that.
    assert abs(np.log(best[H] / scene.parameters[H])) < 0.1


def test_a_valley_aslant_the_ratios_is_one_start():
    scene = layer_on(ul.Isotropic(1e7, 0.3))
    start = scene.with_values({E: 3e6, H: 3e-4, BASE: 1e8})
    landscape = Landscape.of(ul.Problem(start, exact_curve(scene), [E, H, C, BASE]))
    # One beside the other, each ratio's column has a lowest thickness of its own.
    lowest = landscape.misfit.argmin(axis=0)
    assert len(set(lowest.tolist())) > 2
    assert len(landscape.minima(3)) == 1


@pytest.mark.parametrize("modulus", [4e6, 1e8, 2e5])
def test_the_scan_agrees_with_a_base_that_is_known(modulus):
    scene = layer_on(ul.Isotropic(modulus, 0.3))
    start = scene.with_values({E: 1e3 * scene.parameters[E]})
    p = ul.Problem(start, exact_curve(scene), [E, C])
    best = p.values(scan(p)[0].vector)
    # Between ratios up to seven apart the straight line in ln k is off by a few tens of per cent, that in
    # -ln(1 + 1/k) by a few.
    assert abs(np.log(best[E] / 1e6)) < 0.1
    assert abs(best[C] - 1e-5) < 0.05 * 1.8e-4


def test_plain_hertz_finds_what_made_the_curve():
    scene = ul.Scene(
        ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45)), instrument=ul.Instrument(1e-5, 2e-3)
    )
    curve = exact_curve(scene)
    found = plain_hertz_fit(curve.depth, curve.force, 1e-3, 0.45, E=3e6)
    assert found == pytest.approx({"E": 1e6, "contact_depth": 1e-5, "baseline": 2e-3}, rel=1e-5)


@pytest.mark.parametrize("replica", range(10))
def test_a_second_basin_between_the_points_of_the_grid_is_found(replica):
    # A layer on a base four times stiffer, whose modulus is known: 2.7 times thinner and softer fits nearly as
    # well, and its basin shadows the true one on the coarse grid.
    scene = ul.Scene(
        ul.Paraboloid(1e-3),
        ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4),
        ul.Isotropic(4e6, 0.3),
        ul.Instrument(contact_depth=1e-5),
    )
    noise = ul.Noise(force=0.002 * float(scene.force(2e-4)))
    depth = np.linspace(-5e-5, 2e-4, 200)
    curve = ul.synthesize(scene, depth, noise, np.random.default_rng([0, replica]))
    free = ("layer.E", "layer.thickness", "instrument.contact_depth")
    start = scene.with_values({"layer.E": 3e6, "instrument.contact_depth": 0.0})
    blind, told = (
        ul.fit(ul.Problem(start, curve, free, noise)),
        ul.fit(ul.Problem(scene, curve, free, noise), start="given"),
    )
    # The same optimum to the tolerance of the minimiser, or a better one.
    assert blind.statistics.chi_square <= told.statistics.chi_square + 1e-3


@pytest.mark.parametrize(("level", "leaves"), [(1e-4, 1), (0.05, 0)])
def test_starts_far_above_the_best_are_none(level, leaves, monkeypatch):
    scene = layer_on(ul.Isotropic(1e7, 0.3))
    p = problem(scene, [E, H, C], measured(scene, level=level, points=400))
    landscape = Landscape.of(p)
    chosen = landscape.minima(3)
    monkeypatch.setattr("underlay.inference.least_squares.scan._HOPELESS", np.inf)
    # Where noise decides all are alike; where it does not, a layer so thick explains nothing.
    left = [place for place in landscape.minima(3) if place not in chosen]
    assert len(left) == leaves
    limit = 25.0 * landscape.misfit[chosen[0]]
    assert max(landscape.misfit[place] for place in chosen) <= limit
    assert all(landscape.misfit[place] > limit for place in left)


def test_beside_a_start_that_explains_the_data_far_worse_ones_are_not_searched_from(monkeypatch):
    """One whose model is wrong explains nothing: then all are."""
    asked = []
    monkeypatch.setattr(fitting, "candidates", lambda *given: asked.append(given) or candidates(*given))
    scene = layer_on(ul.Isotropic(1e7, 0.3))
    curve = measured(scene, level=0.001, points=400, depth=1e-4)
    p = problem(scene, [E, H, C, BASE], curve)
    starts = scan(p)
    assert min(start.misfit for start in starts[1:]) > 2.0
    quick = fitting.quick_fit(p)
    assert not asked
    below = [settle(p, start.vector) for start in starts]
    best = min(optimum.objective.square(optimum.vector) for optimum in below)
    assert quick.statistics.chi_square <= best * (1.0 + 1e-6)
    wavy = curve.force + 0.03 * np.ptp(curve.force) * np.sin(4e5 * curve.depth)
    fitting.quick_fit(problem(scene, [E, H, C, BASE], ul.Curve(curve.depth, wavy)))
    assert asked


def test_a_layer_on_another_is_found_without_laws_of_thin_layers():
    """Every law of a stack is solved for: a first step that is too long asks for those that cost most."""
    below = ul.Stack([ul.Layer(ul.Isotropic(3e5, 0.3), 1e-3 / 3.0)], ul.RIGID)
    gel, touch = ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), ul.Instrument(contact_depth=1.8e-5)
    made = ul.Scene(ul.Paraboloid(1e-3), gel, below, touch)
    depth = np.linspace(-5.4e-5, 3.6e-4, 1000)
    noise = ul.Noise(force=0.005 * float(made.force(depth[-1])))
    begun = made.with_values({E: 9e6, H: 5e-4, C: 0.0})
    found = ul.fit(ul.Problem(begun, ul.synthesize(made, depth, noise, rng=0), [E, H, C], noise))
    assert found.values[E] == pytest.approx(3e6, rel=0.05)
    assert found.values[H] == pytest.approx(1e-3, rel=0.1)
    # Those of the scan are not counted; with steps three times as long it is ten.
    assert found.statistics.laws_built <= 6


@pytest.mark.parametrize("radius", [2.5e-6, 1.2e-6])
def test_a_ball_that_travels_through_air_by_many_radii_finds_its_contact(radius):
    """No law of the ball goes as deep as the first readings are away from the last."""
    made = ul.Scene(ul.Sphere(radius), ul.Layer(ul.Isotropic(2e3, 0.5)), uncertainties="none")
    depth = np.linspace(-3e-5, 1e-6, 1500)
    curve = ul.synthesize(made, depth, ul.Noise(force=1e-11), np.random.default_rng(2))
    away = ul.Curve(depth - 2.5e-5, curve.force)
    free = {"layer.E": (1.0, 1e10), "instrument.contact_depth": None, "instrument.baseline": None}
    fit = ul.fit(ul.Problem(made, away, free))
    assert fit.values["layer.E"] == pytest.approx(2e3, rel=0.05)
    assert fit.values["instrument.contact_depth"] == pytest.approx(-2.5e-5, abs=5e-8)


def test_bounds_of_the_contact_beyond_the_readings_are_refused():
    made = ul.Scene(ul.Sphere(2.5e-6), ul.Layer(ul.Isotropic(2e3, 0.5)))
    curve = ul.synthesize(made, np.linspace(-2e-6, 1e-6, 200), ul.Noise(force=1e-11), 2)
    late = replace(made, instrument=ul.Instrument(contact_depth=4e-6))
    with pytest.raises(ul.InputError, match=r"from 3 um to 6 um, and the readings are from -2 um to 1 um"):
        ul.Problem(late, curve, {"layer.E": None, "instrument.contact_depth": (3e-6, 6e-6)})


@pytest.mark.parametrize("tip", [ul.Paraboloid(3e-3), ul.Sphere(3e-3)])
def test_a_contact_is_sought_among_the_readings_wherever_they_are(tip):
    """Depths of an instrument may be counted from far away; the scene's contact of zero is no start then."""
    made = ul.Scene(tip, ul.Layer(ul.Isotropic(5e5, 0.45)), uncertainties="none")
    depth = np.linspace(-2e-4, 1e-4, 400)
    curve = ul.synthesize(made, depth, ul.Noise(force=1e-4), np.random.default_rng(0))
    free = {"layer.E": (1e3, 1e8), "instrument.contact_depth": None, "instrument.baseline": None}
    fit = ul.fit(ul.Problem(made, ul.Curve(depth - 0.05, curve.force), free))
    assert fit.values["layer.E"] == pytest.approx(5e5, rel=0.02)
    assert fit.values["instrument.contact_depth"] == pytest.approx(-0.05, abs=1e-6)
