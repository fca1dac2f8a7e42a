"""Steps of a layer's Poisson's ratio: what they are straight in, and what that spares a search."""

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on, measured, problem
from underlay.inference.least_squares.engine import minimise
from underlay.inference.least_squares.models import freeze
from underlay.inference.least_squares.objective import Objective, PoissonSteps
from underlay.inference.least_squares.settle import first_noises

E, H, C, NU = "layer.E", "layer.thickness", "instrument.contact_depth", "layer.nu"


def steps_from(nu):
    """Of a problem whose layer has this ratio, and one scaled unit of it."""
    p = problem(layer_on(ul.Isotropic(4e6, 0.3), nu=nu), [E, C, NU])
    return PoissonSteps.of(p.members, p.coordinates), p.coordinates[2].scale


@pytest.mark.parametrize("nu", [0.1, 0.3, 0.45, 0.499])
def test_a_step_leads_where_it_was_measured_to(nu):
    steps, unit = steps_from(nu)
    there = np.zeros((5, 3))
    there[:, 2] = np.linspace(0.0, 0.5 - nu, 5) / unit
    there[0] = [0.3, -0.1, -0.7]
    here = np.zeros((5, 3))
    along = steps.straight(here, there.copy())
    # One half is reached, and not as a limit; downwards a step is what it says.
    assert steps.changes(here, along, 3.0) == pytest.approx(there, rel=1e-12, abs=1e-14)
    assert (along[0] == there[0]).all()


def test_a_short_step_is_one_of_the_ratio_and_a_long_one_shorter():
    steps, unit = steps_from(0.4)
    step = np.array([[0.2, 0.1, 1e-5], [0.2, 0.1, 0.2 / unit]])
    changes = steps.changes(np.zeros((2, 3)), step, 3.0)
    assert (changes[:, :2] == step[:, :2]).all()
    # Half the square over the room, (1 - 2 nu + 0.13)/2 in nu, is left of it.
    assert changes[0, 2] == pytest.approx(1e-5, rel=1e-5 * unit / 0.165)
    # 0.165 (1 - exp(-0.2 / 0.165)) in nu.
    assert changes[1, 2] * unit == pytest.approx(0.165 * -np.expm1(-0.2 / 0.165), rel=1e-12)


def test_only_a_ratio_that_is_free_is_stepped_so():
    p = problem(layer_on(ul.RIGID), [E, H, C])
    assert PoissonSteps.of(p.members, p.coordinates) is None


@pytest.mark.parametrize("base", [ul.Isotropic(3e7, 0.3), ul.RIGID])
@pytest.mark.parametrize("wide", [0.8, 1.5])
def test_the_force_is_nearly_straight_in_it(base, wide):
    R, h = 1e-3, 1e-3
    depth = (wide * h) ** 2 / R / 1.5

    def log_force(nu):
        return float(
            np.log(ul.Scene(ul.Paraboloid(R), ul.Layer(ul.Isotropic(3e6, nu), h), base).force(depth))
        )

    ratios = np.linspace(0.4, 0.5, 6)
    forces = np.array([log_force(nu) + np.log1p(-nu * nu) for nu in ratios])
    share = (forces - forces[0]) / (forces[-1] - forces[0])
    steps, unit = steps_from(0.4)
    there = np.zeros((6, 3))
    there[:, 2] = (ratios - 0.4) / unit
    along = steps.straight(np.zeros((6, 3)), there.copy())[:, 2]
    assert np.abs(along / along[-1] - share).max() < 0.4 * np.abs(there[:, 2] / there[-1, 2] - share).max()


def test_searches_from_too_compressible_a_layer_come_straighter_up(monkeypatch):
    tried = []
    for nu in (0.45, 0.48, 0.5):
        scene = layer_on(ul.Isotropic(1e7, 0.3), nu=nu)
        curve = measured(scene, level=1e-3)
        tried += [problem(scene.with_values({NU: start}), [E, C, NU], curve) for start in (0.1, 0.3, 0.4)]

    def searches():
        asked, squares = 0, []
        for p in tried:
            objective = Objective(p, freeze(p, p.start, first_noises(p, p.start)))
            vector = minimise(objective, p.start).vector
            asked += objective.evaluations
            squares.append(objective.square(vector))
        return asked, np.array(squares)

    asked, squares = searches()
    monkeypatch.setattr(PoissonSteps, "of", lambda *_: None)
    in_nu, same = searches()
    # What the last steps leave of 300 points is a thousandth of a standard error, its square of 300, and some.
    assert squares == pytest.approx(same, rel=1e-6)
    assert asked < in_nu


def test_an_incompressible_layer_is_met():
    scene = layer_on(ul.Isotropic(1e7, 0.3), nu=0.5)
    curve = measured(scene, level=1e-3, rng=3)
    found = [
        ul.fit(problem(scene.with_values({NU: nu}), [E, C, NU], curve, noise=ul.Noise(force=1e-4)))
        for nu in (0.1, 0.3, 0.49)
    ]
    chi_squares = [each.statistics.chi_square for each in found]
    # What a step leaves that gains 2e-7 of them.
    assert chi_squares == pytest.approx([min(chi_squares)] * 3, rel=1e-6)
    assert all(each.values[NU] > 0.499 for each in found)


def test_the_ratio_in_the_plane_of_a_transversely_isotropic_layer_may_pass_one_half():
    """Its steps are its own: 1 - 2 nu is nothing to it, and a logarithm of that no number."""
    layer = ul.Layer(ul.TransverselyIsotropic(E=1e6, E_axial=3e5, nu=0.6, nu_axial=0.1, G_axial=2e5), 5e-4)
    scene = ul.Scene(ul.Paraboloid(1e-3), layer, ul.RIGID, ul.Instrument(contact_depth=1e-5))
    p = problem(scene.with_values({NU: 0.7}), [C, NU], measured(scene, level=1e-4))
    assert PoissonSteps.of(p.members, p.coordinates) is None
    found = ul.fit(p)
    assert found.statistics.success
    # Four standard errors: one curve in 16,000 is further off.
    assert abs(found.values[NU] - 0.6) < 4.0 * found.stderr[NU]
