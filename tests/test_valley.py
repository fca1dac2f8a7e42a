"""Searches and profiles under one combination of noise, drift and jump: slopes, crossings, and where they end."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.worlds import Clean, disturbed
from underlay.inference.misfit.averaging import average
from underlay.inference.misfit.blocked import Blocked
from underlay.inference.misfit.competition import Competition
from underlay.inference.misfit.descent import Combination, Place, descend
from underlay.inference.misfit.drift import BENT, NEAR_BASE, RELAXING
from underlay.inference.misfit.sizes import Sizes
from underlay.inference.misfit.valley import Path, Stop

FREE = ["layer.E", "instrument.contact_depth", "instrument.baseline"]


def problem_of(world="stiffening", free=FREE):
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID)
    curve = disturbed(Clean.of(scene, 1.5e-4, 160), world, np.random.default_rng(5), 0.003)
    return ul.Problem(scene, curve, free)


def standing(problem, drift, jump, ramp, noise=None):
    """A problem in blocks, its misfits standing about its fit, and a combination of the sizes asked for."""
    vector = ul.fit(problem).vector
    blocked = replace(Blocked.of(problem, vector), errors=())
    model = blocked.linearised(vector)
    found = Competition.of(model, Sizes(drifts=(drift,)))
    amounts = np.array([*drift, jump, ramp])
    chosen = replace(Combination.of(found, found.heaviest), noise=noise, amounts=amounts)
    columns = model.parts[0].columns(amounts).shape[1] - len(vector) - 1
    return blocked.standing(model, amounts), vector, replace(chosen, misfits=np.zeros(columns))


@pytest.mark.parametrize("drift", [BENT, RELAXING, NEAR_BASE])
@pytest.mark.parametrize("noise", [None, (0.05, 10.0)])
def test_the_slope_of_the_squares_is_right_whatever_follows_the_fit(drift, noise):
    blocked, vector, chosen = standing(problem_of(), drift, 4.64, 0.03, noise)
    vector = vector + np.array([0.05, 0.01, 0.002])
    start = Place.of(blocked, vector, chosen)
    here = Place.of(blocked, vector, chosen, start.misfits)
    for i in range(len(vector)):
        # As far as S rises by a hundredth of s^2: a difference over twice that is off by h^2 / 6 of S''', the
        # model's third derivative by unit steps of ln E, at most, and rounding by 1e-16 S / h.
        h = 0.1 * (here.variance / here.normal[i, i]) ** 0.5
        ends = [
            Place.of(blocked, vector + side * h * np.eye(len(vector))[i], chosen).square for side in (1, -1)
        ]
        assert here.gradient[i] == pytest.approx(
            (ends[0] - ends[1]) / (4.0 * h), rel=2e-3, abs=1e-3 * here.variance / h
        )
    # Derivatives with nothing that follows are those of another function.
    assert abs(start.gradient[0] - here.gradient[0]) > 5e-3 * abs(here.gradient[0])


def test_squares_do_not_leap_where_a_reading_crosses_a_step_of_a_jump():
    problem = problem_of("drag step")
    blocked, vector, chosen = standing(problem, BENT, 21.5, 0.0)
    moving = replace(blocked, curves=tuple(replace(curve, shapes=None) for curve in blocked.curves))
    # Readings are 1 / 160 of the range of the depths apart: some two dozen places between each and the next.
    shifts = np.linspace(0.0, 2.0 / 160, 49)[:, None] * np.array([0.0, 1.0, 0.0])

    def leaps(of):
        squares = [Place.of(of, vector + shift, chosen).square / chosen.variance for shift in shifts]
        return np.abs(np.diff(squares, n=2)).max()

    # A parabola of curvature N bends by 2 N h^2 over s^2 between three places h apart.
    here = Place.of(blocked, vector, chosen)
    bend = 2.0 * here.normal[1, 1] * (shifts[1, 1] - shifts[0, 1]) ** 2 / here.variance
    assert leaps(blocked) < 1.5 * bend
    assert leaps(moving) > 5.0 * bend


@pytest.mark.parametrize("world", ["stiffening", "relaxation", "drag step"])
def test_a_search_ends_at_the_optimum_wherever_it_begins(world):
    averaged = average(problem_of(world), problem_of(world).start)
    valley = averaged.valley
    best = valley.optimum
    free = np.ones(len(best.vector), dtype=bool)
    # No step gains more than what a search leaves: a third of a standard deviation, squared.
    assert abs(best.gain(best.step(0.0, free))) < 0.3**2
    deviation = np.sqrt(np.diagonal(np.linalg.inv(best.normal)) * best.variance)
    for way in (-1.5, 1.5):
        again = descend(valley.blocked, best.vector + way * deviation * [1, 0, 0], valley.combination)
        assert abs(again.square - best.square) < 0.1**2 * best.variance
        assert np.abs(again.vector - best.vector) == pytest.approx(0.0, abs=0.1 * deviation.max())


@pytest.mark.parametrize("world", ["stiffening", "relaxation", "Hertz on a layer"])
def test_an_end_lies_where_z_is_what_was_asked(world):
    problem = problem_of("stiffening" if world.startswith("Hertz") else world)
    valley = average(problem, problem.start).valley
    for direction in (-1.0, 1.0):
        for z in (1.0, 1.96, 3.2):
            end = valley.end(0, direction, z)
            place = valley.held(0, end, valley.optimum)
            # Two parabolas may differ by 0.1, and the cubic between them by a part of that.
            assert valley.z(place) == pytest.approx(z, abs=0.05)


def stops_of(z, slope, *, at):
    """Stops of a profile z(gone); the optimum, of which only the vector is asked, is the first."""
    return [Stop(None, gone, z(gone), slope(gone)) for gone in at]


def test_a_cubic_between_stops_is_the_profile_where_that_is_one():
    path = Path(2.0, -1.0, stops_of(lambda x: x + 0.3 * x**2, lambda x: 1.0 + 0.6 * x, at=[0.0, 1.5, 3.0]))
    for gone in (0.2, 1.4, 1.5, 2.9):
        assert path.crossing(gone + 0.3 * gone**2) == pytest.approx(2.0 - gone, rel=1e-12)
        assert path.is_settled(gone + 0.3 * gone**2)
    assert path.crossing(6.0) == -np.inf
    bent = Path(0.0, 1.0, stops_of(np.sqrt, lambda x: 0.5 / np.sqrt(x), at=[0.04, 4.0]))
    assert not bent.is_settled(1.0)
