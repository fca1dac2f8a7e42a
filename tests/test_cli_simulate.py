"""`underlay simulate`: the noise that is named, no other, and the record that makes it again."""

import json
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from underlay.scene.scene_file import read_scene_file

SCENE = """
[indenter]
shape = "sphere"
radius = "0.5 mm"
[layer]
E = "0.4 MPa"
nu = 0.45
thickness = "1.5 mm"
[substrate]
rigid = true
[instrument]
baseline = "30 uN"
[simulate]
start = "-20 um"
max_depth = "80 um"
points = 101
duration = "2 s"
"""
WITH_NOISE = SCENE + '[noise]\nforce = "40 uN"\nrelative = "1 %"\n'
# The CSV has seven digits: half a unit of the last is 5e-7 of a number that begins with 1.
DIGITS = 5.01e-7


@pytest.fixture
def run(run, monkeypatch, tmp_path):
    """Call the entry point in a folder with two scenes."""
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "noisy.toml").write_text(WITH_NOISE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return run


def made(done, *words, scene="scene.toml"):
    done("simulate", scene, "--output", "made.csv", *words)
    return ul.read("made.csv"), json.loads(Path("made.truth.json").read_text(encoding="utf-8"))


def by_hand(scene="scene.toml", noise=None, *, time=True, offsets=None, **settings):
    file = read_scene_file(scene)
    clock = {"time": file.simulate.time} if time else {}
    changed = file.scene.with_values(offsets or {})
    return ul.synthesize(changed, file.simulate.depth, noise, 4, **clock, **settings)


def same(curve, other):
    for got, wanted in ((curve.force, other.force), (curve.depth, other.depth), (curve.time, other.time)):
        np.testing.assert_allclose(got, wanted, rtol=DIGITS, atol=1e-12 * np.ptp(wanted))


CASES = {
    "white": (["force=2 uN"], {"noise": ul.Noise(force=2e-6)}),
    "relative": (["force=2 uN", "relative=0.5%"], {"noise": ul.Noise(force=2e-6, relative=0.005)}),
    "depth": (["depth=30 nm"], {"noise": ul.Noise(depth=3e-8)}),
    "correlated": (
        ["force=2 uN", "correlation-time=50 ms"],
        {"noise": ul.Noise(force=2e-6, correlation_time=0.05)},
    ),
    "drift": (["drift=-3 uN/s"], {"disturbances": ul.Disturbances(drift=-3e-6)}),
    "steps": (["quantisation=0.5 mN"], {"disturbances": ul.Disturbances(quantisation=5e-4)}),
    "outliers": (
        ["outliers=10%", "outlier_sd=1 mN"],
        {"disturbances": ul.Disturbances(outliers=0.1, outlier_sd=1e-3)},
    ),
}


@pytest.mark.parametrize("name", ["scene.toml", "./scene.toml", "link.csv"])
def test_a_scene_is_not_written_over_by_its_curve(name, refused):
    Path("link.csv").symlink_to("scene.toml")
    said = refused("simulate", "scene.toml", "--output", name)
    assert "is the scene file: name the CSV to write" in said
    assert Path("scene.toml").read_text(encoding="utf-8") == SCENE
    assert not Path("scene.truth.json").exists()


@pytest.mark.parametrize("case", CASES)
def test_what_is_named_is_made_and_nothing_else(done, case):
    named, settings = CASES[case]
    curve, record = made(done, "--seed", "4", *[word for text in named for word in ("--noise", text)])
    expected = by_hand(**settings)
    same(curve, expected)
    clean, _ = made(done, "--seed", "4")
    changed = not np.allclose(curve.force, clean.force, rtol=0.0, atol=1e-9)
    assert changed or not np.allclose(curve.depth, clean.depth, rtol=0.0, atol=1e-9)
    on = {key for key in ("drift", "quantisation", "outliers", "outlier_sd") if record["truth"][key]}
    on |= {
        key.removeprefix("noise.")
        for key in record["truth"]
        if key.startswith("noise.") and record["truth"][key]
    }
    assert on == {text.partition("=")[0].replace("-", "_") for text in named}


def test_without_a_name_there_is_no_noise(done):
    curve, record = made(done)
    file = read_scene_file("scene.toml")
    same(curve, ul.simulate(file.scene, file.simulate.depth, time=file.simulate.time))
    assert set(record["truth"]) == set(file.scene.parameters)


def test_the_command_line_goes_before_the_scene_file(done):
    stated, _ = made(done, "--seed", "4", scene="noisy.toml")
    same(stated, by_hand(noise=ul.Noise(force=4e-5, relative=0.01)))
    white, _ = made(done, "--seed", "4", "--noise", "force=2 uN", scene="noisy.toml")
    same(white, by_hand(noise=ul.Noise(force=2e-6, relative=0.01)))
    off, _ = made(done, "--seed", "4", "--noise", "relative=0", scene="noisy.toml")
    same(off, by_hand(noise=ul.Noise(force=4e-5)))
    none, _ = made(done, "--noise", "none", scene="noisy.toml")
    same(none, by_hand())
    alone, _ = made(done, "--seed", "4", "--noise", "none", "--noise", "depth=30 nm", scene="noisy.toml")
    same(alone, by_hand(noise=ul.Noise(depth=3e-8)))


def test_offsets_and_sampling_rate(done):
    given = ("contact_depth=5 um", "baseline=10 uN", "baseline_slope=0.2 N/m")
    curve, record = made(done, *[word for text in given for word in ("--offset", text)])
    offsets = {"contact_depth": 5e-6, "baseline": 1e-5, "baseline_slope": 0.2}
    offsets = {f"instrument.{name}": value for name, value in offsets.items()}
    same(curve, by_hand(offsets=offsets))
    assert {name: record["truth"][name] for name in offsets} == pytest.approx(offsets, rel=1e-15)
    sampled, record = made(done, "--seed", "4", "--sampling-rate", "200 Hz", "--noise", "drift=1 uN/s")
    same(sampled, by_hand(time=False, sampling_rate=200.0, disturbances=ul.Disturbances(drift=1e-6)))
    assert record["truth"]["sampling_rate"] == 200.0


def test_the_recorded_command_makes_the_same_again(done, tmp_path):
    words = ("--noise", "force=2 uN", "--noise", "outliers=5%", "--noise", "outlier_sd=1 mN")
    words += ("--seed", "9", "--offset", "baseline=1 uN", "--sampling-rate", "50 Hz")
    made(done, *words, scene="noisy.toml")
    first = [Path(name).read_bytes() for name in ("made.csv", "made.truth.json")]
    command = shlex.split(json.loads(first[1])["command"])
    (tmp_path / "again").mkdir()
    shutil.copy("noisy.toml", "again")
    with pytest.MonkeyPatch.context() as elsewhere:
        elsewhere.chdir(tmp_path / "again")
        done(*command[1:])
    assert [(tmp_path / "again" / name).read_bytes() for name in ("made.csv", "made.truth.json")] == first


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--noise", "forse=2 uN"), "--noise has no 'forse'; did you mean force? There are force, relative"),
        (("--noise", "2 uN"), "--noise has no '2 uN'. There are force"),
        (("--noise", "force"), '--noise force needs a value, e.g. --noise force="20 uN"'),
        (("--noise", "relative="), "--noise relative needs a value, e.g. --noise relative=0.45"),
        (("--noise", "force=2"), "--noise force: '2' has no unit"),
        (("--noise", "force=2 mm"), "--noise force: 'mm' is a unit of length, but a force is needed"),
        (("--noise", "drift=2 uN"), "'uN' is a unit of force, but a loading rate is needed: pN/s"),
        (("--noise", "relative=2 mm"), "a dimensionless number"),
        (("--noise", "force=-2 uN"), "noise.force must be zero or positive"),
        (("--noise", "force=1 uN", "--noise", "force=2 uN"), "--noise force is given twice"),
        (("--noise", "correlation_time=1 s"), "name the noise too"),
        (("--noise", "outliers=1%"), "outlier_sd"),
        (("--noise", "outlier_sd=1 mN"), "say how many too, e.g. --noise outliers=1%"),
        (("--noise", "outliers=3", "--noise", "outlier_sd=1 mN"), "between 0 and 1"),
        (("--offset", "radius=1 mm"), "--offset has no 'radius'. There are contact_depth, baseline"),
        (("--sampling-rate", "0 Hz"), "--sampling-rate must be positive"),
        (("--sampling-rate", "3"), "a frequency takes one of Hz"),
    ],
)
def test_mistakes_end_with_one_line(refused, words, line):
    assert line in refused("simulate", "scene.toml", "--output", "none.csv", *words)
    assert not Path("none.csv").exists()
