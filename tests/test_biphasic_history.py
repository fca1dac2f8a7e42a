"""Piecewise linear histories, responses as tables, and what is said of a test."""

import numpy as np
import pytest

from underlay.errors import InputError
from underlay.mechanics.biphasic import judgement
from underlay.mechanics.biphasic.history import Contour, Polyline, Response, invert, ramp_and_hold, windows


def exponential(rate):
    """Response exp(-rate t) + 1, from 2 to 1."""
    return invert(lambda s: 1.0 + s / (s + rate), 2.0, 1.0, (1e-4, 30.0))


def test_contour_inverts():
    for contour in windows(1e-2, 10.0, 16):
        time = np.geomspace(contour.start, contour.end, 9)
        assert np.abs(contour.invert(1.0 / (contour.z + 1.0), time) - np.exp(-time)).max() < 1e-5
    fine = Contour.of(0.1, 1.0, 24)
    time = np.array([0.1, 1.0])
    assert np.abs(fine.invert(fine.z**-0.5, time) - 1.0 / np.sqrt(np.pi * time)).max() < 1e-9


def test_response_of_an_exponential():
    response, time = exponential(2.0), np.array([1e-6, 1e-3, 0.03, 0.7, 3.0, 100.0])
    assert np.abs(response.step(time) - 1.0 - np.exp(-2.0 * time)).max() < 2e-5
    assert np.abs(response.ramp(time) - time - 0.5 * (1.0 - np.exp(-2.0 * time))).max() < 2e-5
    assert response.step(np.array([-1.0, 0.0])).tolist() == [0.0, 2.0]
    assert response.ramp(np.array([-1.0, 0.0])).tolist() == [0.0, 0.0]


def test_response_in_other_units():
    response, time = exponential(2.0), np.array([0.1, 1.0])
    scaled = response.scaled(10.0, 60.0)
    assert np.abs(scaled.step(60.0 * time) - 10.0 * response.step(time)).max() < 1e-12
    assert np.abs(scaled.ramp(60.0 * time) - 600.0 * response.ramp(time)).max() < 1e-9


def test_tails_go_on_as_the_table_ends():
    time = np.geomspace(1e-3, 30.0, 55)
    half_space = Response(1.0, 0.0, time, 1.0 / (1.0 + np.sqrt(time)), endless=True)
    assert half_space.g(np.array([3000.0]))[0] == pytest.approx(half_space.fall[-1] / 10.0)
    for response in (half_space, Response(1.0, 0.0, time, np.exp(-0.1 * time))):
        near = np.array([30.0 * (1.0 - 1e-9), 30.0 * (1.0 + 1e-9)])
        assert np.ptp(response.g(near)) < 1e-8
        assert np.ptp(response.integral(near)) < 1e-6
    layer = Response(1.0, 0.0, time, np.exp(-0.1 * time))
    assert layer.g(np.array([60.0]))[0] == pytest.approx(np.exp(-6.0), rel=1e-2)


def test_polyline():
    line = Polyline([1.0, 1.0, 2.0, 3.0, 3.0], [1.0, 2.0, 4.0, 4.0, 1.0])
    assert line.at([0.5, 1.0, 1.5, 2.5, 3.0, 9.0]).tolist() == [0.0, 2.0, 3.0, 4.0, 1.0, 1.0]
    assert [part.tolist() for part in line.jumps] == [[1.0, 1.0, 3.0], [1.0, 1.0, -3.0]]
    assert [part.tolist() for part in line.bends] == [[1.0, 2.0], [2.0, -2.0]]
    assert ramp_and_hold(2.0, 4.0).rises.tolist() == [4.0]


def test_history_from_contact_on():
    line = Polyline([0.0, 1.0, 2.0, 3.0], [-2.0, -1.0, 1.0, 1.0]).in_contact
    assert (line.time.tolist(), line.value.tolist()) == ([1.5, 2.0, 3.0], [0.0, 1.0, 1.0])
    begun = Polyline([0.0, 0.0, 1.0], [0.0, 2.0, 3.0]).in_contact
    assert (begun.time.tolist(), begun.value.tolist()) == ([0.0, 0.0, 1.0], [0.0, 2.0, 3.0])
    assert Polyline([0.0, 1.0], [-2.0, -1.0]).in_contact.at([0.5]).tolist() == [0.0]


def test_superposed_responses_are_the_integral():
    response, line = exponential(3.0), Polyline([0.0, 0.3, 0.7], [0.2, 1.0, 0.5])
    time = np.array([0.2, 0.5, 2.0])
    s = np.linspace(0.0, 2.0, 200_001)
    middle, change = 0.5 * (s[1:] + s[:-1]), np.diff(line.at(s))
    expected = [
        0.2 * response.step(t) + response.step(t - middle[middle < t]) @ change[middle < t] for t in time
    ]
    assert np.abs(line.superposed(response, time) - expected).max() < 1e-5
    many = np.tile(time, 900_000)
    assert line.superposed(response, many)[-1] == pytest.approx(expected[-1], abs=1e-5)


def test_thinned():
    time = np.linspace(0.0, 10.0, 30_001)
    depth = np.minimum(time, 1.0) + 1e-4 * np.sin(50.0 * time)
    line = Polyline.thinned(time, depth, 1e-3)
    assert line.time.size < 6
    assert np.abs(line.at(time) - depth).max() <= 1.0001e-3


@pytest.mark.parametrize(
    ("time", "value", "message"),
    [
        ([0.0, 1.0], [0.0], "one time a value"),
        ([0.0, 2.0, 1.0], [0.0, 1.0, 1.0], "must not fall back; they do at index 2"),
        ([0.0, np.nan], [0.0, 1.0], "holds nan at index 1"),
        ([], [], "one time a value"),
    ],
)
def test_history_refusals(time, value, message):
    with pytest.raises(InputError, match=message):
        Polyline(time, value)
    with pytest.raises(InputError, match="a ramp lasts zero or more"):
        ramp_and_hold(1.0, -1.0)


def test_what_a_test_cannot_be():
    with pytest.raises(InputError, match="the record has 4 points after the ramp ends at 1 s"):
        judgement.checked_hold(np.linspace(0.0, 1.4, 15), 1.0)
    assert judgement.checked_hold(np.linspace(0.0, 2.0, 21), 1.0) == 10
    with pytest.raises(InputError, match="the force changes by 0 % and the depth by 50 %"):
        judgement.refuse_load_control(np.linspace(1.0, 2.0, 9), np.ones(9), slice(0, None))
    judgement.refuse_load_control(np.ones(9), np.linspace(2.0, 1.0, 9), slice(0, None))


def test_what_is_said():
    assert "ends at 0.5 a^2/c, before the plateau (at 1): E, nu" in judgement.hold_doubt(10.0, 20.0, 1.0)
    assert "hold for 60 s" in judgement.hold_doubt(40.0, 20.0, 0.1)
    assert judgement.hold_doubt(40.0, 20.0, 0.5) == ""
    assert "lasts 2 a^2/c" in judgement.ramp_doubt(40.0, 20.0)
    assert judgement.ramp_doubt(20.0, 20.0) == ""
    assert "no isotropic draining layer gives more than 3.1" in judgement.peak_doubt(5.0, 3.1)
    assert judgement.peak_doubt(3.0, 3.1) == ""
    assert "nu = 0.01" in judgement.anisotropy_doubt(nu=0.01)
    assert "E/E_axial = 40" in judgement.anisotropy_doubt(modulus_ratio=40.0)
    assert judgement.anisotropy_doubt(nu=0.2, modulus_ratio=5.0) == ""
