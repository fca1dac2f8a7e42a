"""What a file says of its test: compared with the scene, taken where the scene leaves it out, shown beside ours."""

import json

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import afm_files
from support import instrument_files as files
from underlay.inference.file_facts import settle
from underlay.report.maps import parameter_table
from underlay.report.tables import fit_table, interval_table
from underlay.scene.scene_file import read_scene_file

# The made Optics11 file: a tip of 25 um, k = 0.05 N/m, E[eff] = 1000 Pa, and the loading of a ball on a half-space
# whose reduced modulus is 3 F / (4 sqrt(R) w^1.5).
RADIUS, TOLD = 25e-6, 1000.0
REDUCED = 0.75 * 4e-8 / (np.sqrt(RADIUS) * (2e-6) ** 1.5)
NU = 0.4

SCENE = """
[indenter]
shape = "paraboloid"
{radius}

[layer]
E = "1 kPa"
nu = 0.4

[fit]
layer.E = {{ min = "1 Pa", max = "1 MPa" }}
instrument.contact_depth = {{ min = "-1 um", max = "1 um" }}
{more}
"""


@pytest.fixture
def told(tmp_path):
    """Writer of a scene beside the made file: (curve, scene)."""

    def write(radius="", more=""):
        curve, scene = tmp_path / "piuma.txt", tmp_path / "scene.toml"
        curve.write_bytes(files.optics11("old"))
        scene.write_text(SCENE.format(radius=radius and f'radius = "{radius}"', more=more), encoding="utf-8")
        return curve, scene

    return write


def test_a_radius_other_than_the_files_is_an_error_that_names_both(told):
    with pytest.raises(
        ul.InputError, match=r"says indenter\.radius = 25 um, the scene 8 um.*overrule = \[\"indenter"
    ):
        ul.load_problem(*told("8 um"))


@pytest.mark.parametrize("radius", ["25 um", "25.02 um", "0.025 mm"])
def test_a_radius_that_is_the_files_but_for_rounding_is_none(told, radius):
    problem = ul.load_problem(*told(radius))
    assert problem.curves[0].metadata["notes"] == ()


def test_the_scene_can_overrule_the_file_and_the_fit_says_so(told):
    problem = ul.load_problem(*told("8 um", '[curve]\noverrule = ["indenter.radius"]'))
    assert problem.base_scenes[0].parameters["indenter.radius"] == 8e-6
    assert (
        "indenter.radius = 8 um of the scene overrules the 25 um" in problem.curves[0].metadata["notes"][-1]
    )


def test_a_free_radius_is_not_compared(told):
    curve, scene = told("20 um", 'indenter.radius = { min = "10 um", max = "40 um" }')
    assert ul.load_problem(curve, scene).curves[0].metadata["notes"] == ()


def test_a_radius_left_out_is_the_files(told):
    curve, scene = told()
    problem = ul.load_problem(curve, scene)
    assert problem.base_scenes[0].parameters["indenter.radius"] == pytest.approx(RADIUS)
    assert "indenter.radius = 25 um is taken from the file" in problem.curves[0].metadata["notes"][-1]
    assert ul.fit(problem).values["layer.E"] == pytest.approx(REDUCED * (1.0 - NU**2), rel=1e-3)
    # Without a curve there is no radius.
    with pytest.raises(
        ul.InputError, match=r"\[indenter\] needs 'radius'; it can be left out only with a curve"
    ):
        ul.load_scene(scene)
    assert read_scene_file(scene).left_out == ("indenter.radius",)
    curve.write_bytes(files.delimited())
    with pytest.raises(ul.InputError, match=r"does not say indenter\.radius, which the scene leaves out"):
        ul.load_problem(curve, scene)


def test_a_cone_leaves_no_radius_out(tmp_path):
    scene = tmp_path / "scene.toml"
    text = SCENE.format(radius="", more="").replace('"paraboloid"', '"cone"\nhalf_angle = "70 deg"')
    scene.write_text(text, encoding="utf-8")
    assert read_scene_file(scene).left_out == ()


def test_a_calibration_other_than_the_files(tmp_path):
    curve, scene = tmp_path / "spot.jpk-force", tmp_path / "scene.toml"
    curve.write_bytes(afm_files.jpk())
    part = '[curve]\ncalibration = {{ spring_constant = "{}" }}\n{}'

    def problem(stiffness, more=""):
        text = SCENE.format(radius='radius = "5 um"', more=part.format(stiffness, more)).replace(
            'min = "-1 um", max = "1 um"', 'min = "-5 um", max = "-3 um"'
        )
        text += '[instrument]\ncontact_depth = "-4 um"\n'
        scene.write_text(text, encoding="utf-8")
        return ul.load_problem(curve, scene)

    assert problem("0.04 N/m").curves[0].metadata["spring_constant"] == 0.04
    with pytest.raises(ul.InputError, match=r"calibration\.spring_constant = 40 mN/m, the scene 80 mN/m"):
        problem("0.08 N/m")
    used = problem("0.08 N/m", 'overrule = ["calibration.spring_constant"]').curves[0]
    assert used.metadata["spring_constant"] == 0.08
    assert "overrules" in used.metadata["notes"][-1]


def test_the_bending_of_the_cantilever_is_taken_off_once(told):
    frame, cantilever = '[instrument]\ncompliance = "0.01 m/N"', '[instrument]\ncompliance = "20 m/N"'
    ul.load_problem(*told("25 um", frame))
    with pytest.raises(ul.InputError, match=r"the cantilever has 50 mN/m.*would take it off again"):
        ul.load_problem(*told("25 um", cantilever))
    both = cantilever + '\n[curve]\noverrule = ["instrument.compliance"]'
    assert "as asked" in ul.load_problem(*told("25 um", both)).curves[0].metadata["notes"][-1]


def test_what_is_overruled_must_be_something(told):
    with pytest.raises(ul.InputError, match=r"\[curve\] overrule"):
        ul.load_problem(*told("8 um", '[curve]\noverrule = ["layer.E"]'))


# --- the instrument's own modulus


def test_the_instruments_modulus_is_for_our_poisson_ratio(told, tmp_path):
    found = ul.fit(ul.load_problem(*told("25 um")))
    own = found.instrument_moduli["layer.E"]
    assert own.reduced == TOLD
    assert own.youngs == pytest.approx(TOLD * (1.0 - NU**2), rel=1e-12)
    assert own.difference == pytest.approx(REDUCED / TOLD - 1.0, rel=1e-3)
    row = fit_table(found).iloc[0]
    assert row["instrument's own"] * {"kPa": 1e3, "Pa": 1.0}[row["unit"]] == pytest.approx(840.0)
    written = json.loads(found.to_json(tmp_path / "fit.json").read_text())
    assert written["instrument_moduli"]["layer.E"]["youngs"] == pytest.approx(840.0)
    assert "0.84 kPa at nu = 0.4 (reduced: 1 kPa;" in interval_table(found).to_string()
    assert "instrument found 0.84 kPa" in found.report()


def test_without_an_instruments_modulus_nothing_is_said_of_one():
    depth = np.linspace(-1e-6, 4e-6, 60)
    scene = ul.Scene(ul.Paraboloid(1e-5), ul.Layer(ul.Isotropic(1e3, NU)))
    found = ul.fit(ul.Problem(scene, ul.synthesize(scene, depth, ul.Noise(force=1e-11), rng=0), ["layer.E"]))
    assert found.instrument_moduli == {}
    assert "instrument's own" not in fit_table(found).columns


def test_a_transversely_isotropic_layer_is_compared_by_its_indentation_modulus():
    # One with the constants of an isotropic material must give what that material gives.
    material = ul.TransverselyIsotropic(E=2e3, E_axial=2e3, nu=NU, nu_axial=NU, G_axial=2e3 / (2 * (1 + NU)))
    curve = ul.Curve([0.0], [0.0], metadata={"instrument_reduced_modulus": TOLD})
    from underlay.inference.least_squares.provenance import instrument_modulus  # noqa: PLC0415

    own = instrument_modulus(ul.Scene(ul.Paraboloid(1e-5), ul.Layer(material)), curve)
    assert own.youngs == pytest.approx(TOLD * (1.0 - NU**2), rel=1e-9)


# --- maps


def test_a_map_takes_compares_and_shows_what_each_file_says(told, tmp_path):
    folder = tmp_path / "curves"
    folder.mkdir()
    (folder / "a.txt").write_bytes(files.optics11("old"))
    other = files.optics11("old").replace(b"Tip radius (um)\t25.000", b"Tip radius (um)\t50.000")
    (folder / "b.txt").write_bytes(other)
    _, scene = told()
    table = ul.fit_many(folder, scene, workers=0)
    assert list(table["status"]) == ["fitted", "fitted"]
    assert list(table["indenter.radius"]) == pytest.approx([25e-6, 50e-6])
    # E of the same force goes as one over the root of the radius.
    ratio = table["layer.E"][0] / table["layer.E"][1]
    assert ratio == pytest.approx(np.sqrt(2.0), rel=1e-3)
    assert list(table["layer.E.instrument"]) == pytest.approx([840.0, 840.0])
    expected = 100.0 * (table["layer.E"] / 840.0 - 1.0)
    pd.testing.assert_series_equal(table["layer.E.difference_percent"], expected, check_names=False)
    assert "0.84 kPa" in parameter_table(table).to_string()
    _, scene = told("25 um")
    table = ul.fit_many(folder, scene, workers=0)
    assert list(table["status"]) == ["fitted", "failed"]
    assert "says indenter.radius = 50 um, the scene 25 um" in table["reason"][1]


def test_a_map_of_files_that_say_nothing_of_what_is_left_out_is_refused_at_once(told, tmp_path):
    folder = tmp_path / "curves"
    folder.mkdir()
    (folder / "a.csv").write_bytes(files.delimited())
    _, scene = told()
    with pytest.raises(
        ul.InputError, match=r"leaves out indenter\.radius, which none of the first curves says"
    ):
        ul.fit_many(folder, scene, workers=0)


def test_a_map_with_a_scene_of_python_says_where_a_file_differs(told):
    curve, _ = told()
    scene = ul.Scene(ul.Paraboloid(10e-6), ul.Layer(ul.Isotropic(1e3, NU)))
    free = {"layer.E": (1.0, 1e6), "instrument.contact_depth": (-1e-6, 1e-6)}
    row = ul.fit_many([curve], scene, free, workers=0).iloc[0]
    assert (row["status"], row["verdict"]) == ("fitted", "check")
    assert row["reason"].count("indenter.radius = 10 um of the scene overrules the 25 um") == 1


def test_a_fit_in_python_warns_of_what_the_file_says_otherwise(told):
    curve = ul.read(told()[0]).loading()
    layer, free = ul.Layer(ul.Isotropic(1e3, NU)), {"layer.E": (1.0, 1e6)}

    def codes(radius, curve=curve):
        return [
            w.code for w in ul.fit(ul.Problem(ul.Scene(ul.Paraboloid(radius), layer), curve, free)).warnings
        ]

    assert "file" not in codes(25e-6)
    assert codes(10e-6).count("file") == 1
    assert "file" not in codes(10e-6, curve.with_metadata(indenter_radius=None))


def test_numbers_of_a_file_that_are_none_are_not_compared():
    scene = ul.Scene(ul.Paraboloid(10e-6), ul.Layer(ul.Isotropic(1e3, NU)))
    for value in (None, True, "25 um", 0.0, -1.0):
        curve = ul.Curve([0.0], [0.0], metadata={"indenter_radius": value})
        assert settle(scene, curve).notes == ()
