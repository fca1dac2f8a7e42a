"""Segments from the motion: known protocols, with noise, vibration, creep and uneven sampling."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from underlay.data import segments
from underlay.data.segments import label_pieces, segments_from_motion


def runs(labels):
    return [(str(label), len(list(group))) for label, group in itertools.groupby(labels)]


def names(labels):
    return [label for label, _ in runs(labels)]


def trapezoid(points=1000):
    time = np.linspace(0.0, 4.0, points)
    return time, np.interp(time, [0.0, 1.0, 3.0, 4.0], [0.0, 1.0, 1.0, 0.0]) * 1e-6


@pytest.mark.parametrize("noise", [0.0, 1e-9, 5e-9, 2e-8])
def test_approach_hold_and_retract_with_noise(noise):
    time, depth = trapezoid()
    noisy = depth + noise * np.random.default_rng(1).standard_normal(len(depth))
    labels = segments_from_motion(noisy, time)
    assert names(labels) == ["loading", "hold", "unloading"]
    true = np.where(time <= 1.0, "loading", np.where(time < 3.0, "hold", "unloading"))
    # A corner is found to where the motion leaves the tolerance of 1 % of its range or 4 sigma, either side.
    tolerance = max(0.01, 4 * noise / 1e-6) * 2 + 0.01
    assert np.mean(labels != true) < tolerance


@pytest.mark.parametrize("noise", [0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.05])
@pytest.mark.parametrize("points", [120, 600, 2400, 24_000])
def test_a_slow_ramp_of_many_noisy_readings_is_one_way_in_and_one_way_out(points, noise):
    """However many readings: the largest of their noise is no corner."""
    time = np.linspace(0.0, 120.0, points)
    load = np.interp(time, [0, 60, 120], [0, 1, 0])
    for seed in range(3):
        depth = load ** (2 / 3) + noise * np.random.default_rng(seed).standard_normal(points)
        assert names(segments_from_motion(depth, time, load)) == ["loading", "unloading"]


@pytest.mark.parametrize("noise", [0.002, 0.005, 0.01])
def test_a_hold_is_found_in_many_noisy_readings(noise):
    time = np.linspace(0.0, 150.0, 24_000)
    load = np.interp(time, [0, 60, 90, 150], [0, 1, 1, 0])
    depth = load ** (2 / 3) + noise * np.random.default_rng(2).standard_normal(len(time))
    labels = segments_from_motion(depth, time, load)
    assert names(labels) == ["loading", "hold", "unloading"]
    true = np.where(time <= 60, "loading", np.where(time < 90, "hold", "unloading"))
    assert np.mean(labels != true) < 0.015


@pytest.mark.parametrize("digits", [1, 2])
@pytest.mark.parametrize("rate", [0.5, 2.0, 20.0])
def test_a_slow_ramp_of_few_digits_is_no_stairs_of_holds(rate, digits):
    """Depth and force of 0.0, 0.1, 0.2 um and mN, each many times."""
    time = np.arange(0.0, 600.0, 1.0 / rate)
    load = np.interp(time, [0, 300, 600], [0, 5, 0]).round(digits)
    depth = (3.0 * (load / 5.0) ** (2 / 3)).round(digits)
    assert names(segments_from_motion(depth, time, load)) == ["loading", "unloading"]


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
@pytest.mark.parametrize("points", [120, 600, 2400])
def test_the_turns_of_many_cycles_are_no_holds(points, noise):
    time = np.linspace(0.0, 200.0, points)
    load = np.interp(time, np.arange(0, 201, 10), np.arange(21) % 2)
    depth = load ** (2 / 3) + noise * np.random.default_rng(4).standard_normal(points)
    labels = segments_from_motion(depth, time, load)
    assert names(labels) == ["loading", "unloading"] * 10
    true = np.where((time // 10) % 2 == 0, "loading", "unloading")
    # A turn is found to a reading.
    assert np.mean(labels != true) < 0.01 + 20 / points + 2.0 * noise


@pytest.mark.parametrize("growing", [False, True])
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_thousand_cycles_are_a_thousand_cycles(noise, growing):
    """No bound on the work ends the search for corners among them: what is left would rest."""
    phase = np.arange(60_000) / 60.0
    load = (1.0 - np.abs(phase % 1.0 * 2.0 - 1.0)) * (np.linspace(0.2, 1.0, 60_000) if growing else 1.0)
    depth = load ** (2 / 3) + noise * np.random.default_rng(7).standard_normal(60_000)
    labels = segments_from_motion(depth, phase, load)
    assert names(labels) == ["loading", "unloading"] * 1000
    assert np.mean(labels != np.where(phase % 1.0 < 0.5, "loading", "unloading")) < 0.06


def test_ten_steps_that_are_held_for_long_are_no_digits():
    """A relaxation in steps, each within one reading, without noise."""
    motion = np.repeat(np.arange(11.0), 50)
    assert np.mean(segments_from_motion(motion) == "hold") > 0.95


def test_vibration_is_not_a_reversal():
    time, depth = trapezoid()
    shaken = depth + 2e-8 * np.sin(2 * np.pi * 7.0 * time)
    assert names(segments_from_motion(shaken, time)) == ["loading", "hold", "unloading"]


def test_cycles_are_reversals():
    time = np.linspace(0.0, 8.0, 2000)
    depth = np.interp(time, range(9), [0.0, 0.3, 0.05, 0.5, 0.1, 0.7, 0.15, 1.0, 0.0])
    assert names(segments_from_motion(depth, time)) == ["loading", "unloading"] * 4


@pytest.mark.parametrize("steps", [1, 5, 20])
def test_every_step_of_a_staircase_is_seen(steps):
    per = 200
    motion = np.concatenate(
        [i + np.concatenate((np.linspace(0, 1, 40), np.ones(per - 40))) for i in range(steps)]
    )
    assert names(segments_from_motion(motion)) == ["loading", "hold"] * steps


def test_the_ramp_of_a_load_controlled_test_is_loading_although_it_slows():
    # Under a load ramp a ball sinks as t^(2/3); then it rests and comes back.
    time = np.linspace(0.0, 3.0, 900)
    load = np.interp(time, [0, 1, 2, 3], [0, 1, 1, 0])
    depth = load ** (2 / 3)
    labels = segments_from_motion(depth, time, load)
    assert names(labels) == ["loading", "hold", "unloading"]
    assert np.mean(labels == "loading") == pytest.approx(1 / 3, abs=0.02)


def test_slow_elastic_return_of_a_stiff_sample_is_unloading():
    """Depth falls by 12 % only, as slowly as creep; the force falls with it and tells."""
    time = np.linspace(0.0, 30.0, 3000)
    depth = np.interp(time, [0, 10, 15, 30], [0.0, 1.0, 1.01, 0.89])
    force = np.interp(time, [0, 10, 15, 30], [0.0, 1.0, 1.0, 0.0])
    assert names(segments_from_motion(depth, time, force)) == ["loading", "hold", "unloading"]
    assert names(segments_from_motion(depth, time)) == ["loading", "hold"]


def test_one_small_return_after_large_ones_is_no_vibration():
    """Lift-off, approach, a hold, and a return by 7 % of it all, while the force falls to nothing."""
    time = np.linspace(0.0, 16.0, 2800)
    depth = np.interp(time, [0, 2, 9, 11, 16], [0.0, -0.45, 0.53, 0.53, 0.455])
    force = np.interp(time, [0, 4, 9, 11, 16], [0.0, 0.0, 1.0, 1.0, 0.0])
    depth = depth + 0.001 * np.random.default_rng(6).standard_normal(len(time))
    labels = segments_from_motion(depth, time, force)
    assert names(labels) == ["unloading", "loading", "hold", "unloading"]
    # The depth leaves its tolerance a second later than the force lets go.
    assert time[labels == "hold"].max() == pytest.approx(11.0, abs=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_slow_loading_after_a_fast_approach_is_loading(noise):
    """Twenty times slower than the approach through air: only the force tells it from creep."""
    time = np.linspace(0.0, 10.0, 2000)
    depth = np.interp(time, [0, 5, 10], [-40.0, 0.0, 2.0])
    force = (np.clip(depth, 0.0, None) / 2.0) ** 1.5
    force += noise * np.random.default_rng(5).standard_normal(len(force))
    assert names(segments_from_motion(depth, time, force)) == ["loading"]
    assert names(segments_from_motion(depth, time)) == ["loading", "hold"]


def test_creep_under_a_held_force_is_a_hold_although_the_force_is_noisy():
    time = np.linspace(0.0, 40.0, 4000)
    depth = np.interp(time, [0, 1, 40], [0.0, 1.0, 1.2])
    for seed in range(20):
        noise = 0.05 * np.random.default_rng(seed).standard_normal(len(time))
        force = np.interp(time, [0, 1, 40], [0.0, 1.0, 1.0]) + noise
        assert names(segments_from_motion(depth, time, force)) == ["loading", "hold"]


def test_relaxation_at_constant_depth_is_a_hold_although_the_force_falls():
    time = np.linspace(0.0, 300.0, 3000)
    depth = np.interp(time, [0, 1, 300], [0.0, 1.0, 1.0])
    force = depth * (0.5 + 0.5 * np.exp(-np.clip(time - 1, 0, None) / 20))
    assert names(segments_from_motion(depth, time, force)) == ["loading", "hold"]


def test_uneven_sampling_does_not_matter():
    time, depth = trapezoid(4000)
    kept = np.sort(np.random.default_rng(2).choice(4000, 400, replace=False))
    assert names(segments_from_motion(depth[kept], time[kept])) == ["loading", "hold", "unloading"]


def test_noise_alone_is_a_hold():
    assert names(segments_from_motion(np.random.default_rng(3).standard_normal(500))) == ["hold"]


def test_marked_pieces_are_labelled_whole():
    depth = np.array([0.0, 1.0, 1.0, 1.1, 0.5, 0.0])
    labels = label_pieces(depth, np.array([0, 2, 4, 6]), {2: "hold"})
    assert list(labels) == ["loading", "loading", "hold", "hold", "unloading", "unloading"]


@settings(max_examples=60)
@given(hnp.arrays(float, st.integers(0, 80), elements=st.floats(-1e3, 1e3)))
@example(np.array([5e-324, 0.0, 0.0]))
def test_any_motion_gets_a_label_for_every_point(motion):
    labels = segments_from_motion(motion)
    assert labels.shape == motion.shape
    assert set(labels) <= {"loading", "hold", "unloading"}


def test_the_corners_of_a_wider_tolerance_are_the_first_of_a_narrower_one():
    rng = np.random.default_rng(0)
    clock = np.linspace(0.0, 1.0, 400)
    for bumps in (3.0, 40.0):
        motion = np.sin(bumps * clock) + rng.normal(scale=0.05, size=400)
        narrow = segments._splits(clock, motion, 0.02)
        for tolerance in (0.05, 0.1, 0.3):
            first = list(itertools.takewhile(lambda split, least=tolerance: split[0] > least, narrow))
            assert 0 < len(first) < len(narrow)
            assert first == segments._splits(clock, motion, tolerance)
