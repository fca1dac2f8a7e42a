"""Motions of a test by program: corners, sampling, scene files and the command that simulates them."""

import json

import numpy as np
import pytest

import underlay as ul
from underlay.scene.scene_file import read_scene_file

SCENE = """
[indenter]
shape = "sphere"
radius = "1 mm"
[layer]
E = "1 MPa"
nu = 0.5
thickness = "1 mm"
[layer.relaxation]
model = "prony"
fractions = [0.5]
times = ["1 s"]
[substrate]
rigid = true
[simulate]
max_depth = "100 um"
points = 101
"""


def test_ramps_go_at_their_rate_and_holds_rest():
    program = ul.Program.at(-1e-5).ramp(to=4e-5, rate=1e-5).hold(10.0).ramp(to=0.0, rate=2e-5)
    assert program.times == pytest.approx((0.0, 5.0, 15.0, 17.0), rel=1e-12)
    depth, time = program.sampled(points=171)
    rate = np.diff(depth) / np.diff(time)
    assert rate[:50] == pytest.approx(1e-5, rel=1e-9)
    assert not rate[51:149].any()
    assert rate[151:] == pytest.approx(-2e-5, rel=1e-9)
    # The same motion at a sampling rate.
    there, clock = program.sampled(sampling_rate=10.0)
    assert clock == pytest.approx(time, abs=1e-12)
    assert there == pytest.approx(depth, abs=1e-15)


def test_named_programs_are_made_of_ramps_and_holds():
    triangle = ul.Program.triangle(1e-5, 1e-6, hold=3.0)
    assert triangle.depths == (0.0, 1e-5, 1e-5, 0.0)
    assert triangle.times == pytest.approx((0.0, 10.0, 13.0, 23.0))
    steps = ul.Program.steps([1e-5, 2e-5], rate=1e-6, hold=5.0)
    assert steps.depths == (0.0, 1e-5, 1e-5, 2e-5, 2e-5)
    assert steps.times == pytest.approx((0.0, 10.0, 15.0, 25.0, 30.0))
    assert ul.Program().ramp(1e-5, 1e-6).hold(0.0).depths == (0.0, 1e-5)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: ul.Program().ramp(0.0, 1e-6), "at 0 m already"),
        (lambda: ul.Program().ramp(1e-6, 0.0), "rate"),
        (lambda: ul.Program().hold(-1.0), "zero seconds or longer"),
        (lambda: ul.Program().sampled(10), "does not last"),
        (lambda: ul.Program().hold(1.0).sampled(), "one of them"),
        (lambda: ul.Program().hold(1.0).sampled(1), "2 or more"),
    ],
)
def test_what_is_no_motion_is_refused(build, said):
    with pytest.raises(ul.InputError, match=said):
        build()


@pytest.mark.parametrize(
    ("lines", "duration", "corner"),
    [
        ('duration = "4 s"', 4.0, 1e-4),
        ('rate = "50 um/s"\nhold = "3 s"', 5.0, 1e-4),
        ('program = "triangle"\nrate = "50 um/s"\nhold = "3 s"', 7.0, 0.0),
        ('program = "triangle"\nduration = "10 s"', 10.0, 0.0),
        ('program = "steps"\nsteps = 4\nhold = "2 s"\nduration = "10 s"', 10.0, 1e-4),
    ],
)
def test_scene_file_names_the_program(tmp_path, lines, duration, corner):
    path = tmp_path / "scene.toml"
    path.write_text(f"{SCENE}{lines}\n", encoding="utf-8")
    simulate = read_scene_file(path).simulate
    assert simulate.time[-1] == pytest.approx(duration)
    assert simulate.depth[-1] == pytest.approx(corner, abs=1e-18)
    assert simulate.depth.max() == pytest.approx(1e-4, rel=0.05)
    assert len(simulate.depth) == 101


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ('program = "wave"', "program"),
        ('hold = "2 s"', "leaves no time to move"),
        ('hold = "-2 s"', "zero or longer"),
        ('rate = "0 um/s"', "rate must be positive"),
        ('rate = "5 um"', "rate"),
        ("steps = 3", "belongs to program"),
    ],
)
def test_bad_programs_are_one_line(tmp_path, refused, lines, said):
    path = tmp_path / "scene.toml"
    path.write_text(f"{SCENE}{lines}\n", encoding="utf-8")
    assert said in refused("simulate", path, "--output", tmp_path / "made.csv")


def test_the_command_simulates_a_program_with_noise_along_time(tmp_path, done):
    path = tmp_path / "scene.toml"
    path.write_text(f'{SCENE}program = "triangle"\nrate = "50 um/s"\nhold = "3 s"\n', encoding="utf-8")
    made = tmp_path / "made.csv"
    options = ["--noise", "force=1 uN", "--noise", "correlation_time=0.5 s", "--sampling-rate", "20 Hz"]
    done("simulate", path, "--output", made, *options)
    curve, file = ul.read(made), read_scene_file(path)
    assert len(curve) == 141
    assert curve.time[-1] == pytest.approx(7.0)
    depth, time = file.simulate.motion.sampled(sampling_rate=20.0)
    left = curve.force - file.scene.force(depth, time)
    # AR(1) over steps of 0.05 s: exp(-0.1), of 140 pairs to 0.04.
    assert np.corrcoef(left[1:], left[:-1])[0, 1] == pytest.approx(np.exp(-0.1), abs=0.15)
    assert (
        json.loads(made.with_suffix(".truth.json").read_text())["truth"]["layer.relaxation.times[0]"] == 1.0
    )
