"""The samples: made bit for bit by their recorded commands, and fitted blind back to their truth."""

import json
import shlex
import sys
from pathlib import Path

import pytest

import underlay as ul

sys.path.insert(0, str(Path(__file__).parent / "studies"))
import joint

SAMPLES = Path(__file__).resolve().parents[1] / "data_samples"
MADE = ("cartilage_on_bone", "gel_on_glass", "soft_film_on_softer_base")


@pytest.mark.parametrize("name", MADE)
def test_the_recorded_command_makes_the_file_bit_for_bit(run, name, tmp_path, monkeypatch):
    record = json.loads((SAMPLES / f"{name}.truth.json").read_text(encoding="utf-8"))
    command = shlex.split(record["command"])
    assert command[:2] == ["underlay", "simulate"]
    (tmp_path / command[2]).write_bytes((SAMPLES / command[2]).read_bytes())
    monkeypatch.chdir(tmp_path)
    assert run(*command[1:])[0] == 0
    for file in (f"{name}.csv", f"{name}.truth.json"):
        assert (tmp_path / file).read_bytes() == (SAMPLES / file).read_bytes()


@pytest.mark.parametrize("name", MADE)
def test_a_blind_fit_recovers_the_truth(name):
    truth = json.loads((SAMPLES / f"{name}.truth.json").read_text(encoding="utf-8"))["truth"]
    fit = ul.fit(ul.load_problem(SAMPLES / f"{name}.csv", SAMPLES / f"{name}.toml"))
    for parameter, value in fit.values.items():
        # The start differs from the truth: the fit did not simply stay where it was.
        if parameter == "layer.E":
            assert ul.load_scene(SAMPLES / f"{name}.toml").parameters[parameter] > 2 * truth[parameter]
        assert abs(value - truth[parameter]) < 3 * fit.stderr[parameter], parameter


def test_a_half_space_would_have_been_wrong():
    """The control: without the substrate the same data give a modulus many standard errors off."""
    problem = ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml")
    scene = problem.base_scenes[0]
    bare = ul.Scene(scene.indenter, ul.Layer(scene.layer.material), None, scene.instrument)
    free = dict.fromkeys(["layer.E", "instrument.contact_depth", "instrument.baseline"])
    fit = ul.fit(ul.Problem(bare, problem.curves[0], free))
    assert fit.values["layer.E"] > 1.3 * 0.62e6


def test_the_real_curve_agrees_with_its_instrument():
    fit = ul.fit(ul.load_problem(SAMPLES / "chiaro_cell_indentation.csv", SAMPLES / "chiaro_cell.toml"))
    reduced = fit.values["layer.E"] / (1 - 0.5**2)
    # The instrument's own result, in the file's header: E[eff] = E/(1-nu^2) = 156.009 Pa.
    assert reduced == pytest.approx(156.009, rel=0.03)
    assert {warning.code for warning in fit.warnings}, "its residuals hang together, and the fit must say so"


def test_the_relaxation_curve_is_fitted_from_file_to_result():
    problem = ul.load_problem(SAMPLES / "mach1_relaxation.csv", SAMPLES / "mach1_relaxation.toml")
    assert problem.curves[0].time[-1] > 300.0
    assert set(problem.curves[0].segments()) == {"loading", "hold"}
    fit = ul.fit(problem)
    kept = fit.scene.layer.relaxation.equilibrium
    # After 300 s the force is 0.51 of its peak; the slowest term has 5 % of its own left to lose, and the ramp
    # of half a second has not seen the modulus at once.
    assert 0.4 < kept < 0.6
    assert {warning.code for warning in fit.warnings}, "its residuals hang together, and the fit must say so"
    # An elastic fit of the ramp alone gives less than the modulus at once, and more than that at equilibrium.
    scene = problem.base_scenes[0].elastic
    names = ["layer.E", "instrument.contact_depth", "instrument.baseline"]
    elastic = ul.fit(
        ul.Problem(scene, problem.curves[0].loading(), {name: problem.free[name] for name in names})
    )
    assert kept * fit.values["layer.E"] < elastic.values["layer.E"] < fit.values["layer.E"]


def test_the_relaxation_curve_says_where_it_comes_from():
    text = (SAMPLES / "mach1_relaxation.csv").read_text(encoding="utf-8")
    for needed in (
        "RenatoC322/Biomomentum-functions",
        "ed1b31a",
        "Copyright (c) 2024 vtrno",
        "does not say what it is",
    ):
        assert needed in text
    licence = SAMPLES / "LICENSES" / "biomomentum-functions-MIT.txt"
    assert "Permission is hereby granted" in licence.read_text(encoding="utf-8")


def test_the_tip_that_sticks_is_held_by_what_the_curve_shows():
    """A real withdrawal: the fitted pull-off is near the smallest force, and the fit is not called good."""
    problem = ul.load_problem(SAMPLES / "sticky_tip_withdrawal.csv", SAMPLES / "sticky_tip_withdrawal.toml")
    fit = ul.fit(problem)
    curve, law = problem.curves[0], fit.scenes[0].contact_law(0.0)
    deepest = fit.values["instrument.baseline"] - curve.force.min()
    assert law.pull_off_force == pytest.approx(deepest, rel=0.25)
    # The tip leaves where the cantilever's base was when the force came back to nothing.
    off = law.pull_off(fit.scenes[0].instrument.compliance)
    base = (
        fit.values["instrument.contact_depth"] + off.depth + fit.scenes[0].instrument.compliance * off.force
    )
    after = slice(int(curve.force.argmin()), None)
    level = abs(curve.force[after] - fit.values["instrument.baseline"])
    gone = curve.depth[after][level < 1e-9].max()
    assert base == pytest.approx(gone, abs=2e-8)
    assert str(fit.verdict).startswith("check: the model"), (
        "its dip is deeper than JKR's, and the fit must say so"
    )


def test_the_small_map_is_made_again_to_the_bit(tmp_path):
    joint.make(tmp_path)
    kept = sorted(path.relative_to(joint.FOLDER) for path in joint.FOLDER.rglob("*.csv"))
    assert kept == sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*.csv"))
    for name in kept:
        assert (tmp_path / name).read_bytes() == (joint.FOLDER / name).read_bytes(), name
