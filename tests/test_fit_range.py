"""Over which points a law is fitted, and the recipes of instruments: their numbers, repeated from the points."""

import numpy as np
import pytest

import underlay as ul
from support import instrument_files as made
from support.maps import SCENE_TOML
from support.real_data import CHIARO, real_file
from underlay.data.export import curve_csv
from underlay.inference.recipe import LeastSquaresFromContact, LineInPower, recipe_of
from underlay.scene.fit_range import PRESETS, Mark

#: A paraboloid on a half-space, in contact at 10 um, and a layer on it.
HALF = ul.Scene(
    ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)), None, ul.Instrument(contact_depth=1e-5)
)
LAYER = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 2e-4), ul.RIGID, HALF.instrument)
READINGS = np.linspace(-2e-5, 1.1e-4, 131)


@pytest.mark.parametrize(
    ("text", "mark"),
    [
        ("10 % of force", Mark(0.1, "force")),
        ("98% Force", Mark(0.98, "force")),
        ("50 % of the depth", Mark(0.5, "depth")),
        ("0.5 radius", Mark(0.5, "radius")),
        ("2 times the radius", Mark(2.0, "radius")),
        ("10 % of thickness", Mark(0.1, "thickness")),
        ("2 um", Mark(2e-6, "length")),
    ],
)
def test_an_end_is_read_as_people_write_it_and_back(text, mark):
    found = Mark.parse(text)
    assert found.of == mark.of
    assert found.value == pytest.approx(mark.value, rel=1e-15)
    assert Mark.parse(str(found)) == found


@pytest.mark.parametrize(
    "text", ["10 %", "120 % of force", "half the depth", "3", "2 N", "-1 radius", 5, "1 km of force"]
)
def test_what_is_no_end_of_a_range_is_refused(text):
    with pytest.raises(ul.InputError, match=r"of force|% of the force"):
        Mark.parse(text)


@pytest.mark.parametrize(
    ("low", "high", "depths"),
    [
        ("20 % of depth", "50 % of depth", (2e-5, 5e-5)),
        ("0.02 radius", "0.05 radius", (2e-5, 5e-5)),
        ("10 % of thickness", "25 % of thickness", (2e-5, 5e-5)),
        ("20 um", "50 um", (2e-5, 5e-5)),
        # F is w^(3/2): 12.5 % of the force is a quarter of the depth.
        ("12.5 % of force", None, (2.5e-5, 1e-4)),
    ],
)
def test_every_way_to_say_a_range_keeps_those_points(low, high, depths):
    scene = LAYER if "thickness" in str(low) else HALF
    part = ul.in_range(ul.simulate(scene, READINGS), ul.FitRange.of(low, high), scene, 1e-5)
    # Readings are 1 um apart.
    assert part.depth.min() - 1e-5 == pytest.approx(depths[0], abs=1e-6)
    assert part.depth.max() - 1e-5 == pytest.approx(depths[1], abs=1e-6)
    assert part.metadata["fit_range"] == str(ul.FitRange.of(low, high))


def test_without_a_lower_end_the_points_before_contact_stay():
    curve = ul.simulate(HALF, READINGS)
    part = ul.in_range(curve, ul.FitRange.of(high="50 % of depth"), HALF, 1e-5)
    assert part.depth.min() == READINGS[0]
    assert ul.in_range(curve, ul.FitRange(), HALF) is curve


def test_noise_cuts_no_holes_and_the_baseline_is_taken_off():
    curve = ul.synthesize(
        HALF.with_values({"instrument.baseline": 5e-3}), READINGS, ul.Noise(force=1e-3), rng=0
    )
    part = ul.in_range(curve, ul.FitRange.of("10 % of force", "60 % of force"), HALF)
    kept = np.isin(curve.depth, part.depth)
    assert np.count_nonzero(np.diff(kept.astype(int))) == 2
    top = np.ptp(ul.simulate(HALF, READINGS).force)
    first, last = part.force[0] - 5e-3, part.force[-1] - 5e-3
    # Of a noise of a thousandth of the largest force the first passage is a few standard deviations early.
    assert first == pytest.approx(0.1 * top, abs=0.03 * top)
    assert last == pytest.approx(0.6 * top, abs=0.03 * top)


def test_a_range_that_means_nothing_here_is_refused():
    curve = ul.simulate(HALF, READINGS)
    with pytest.raises(ul.InputError, match=r"multiple of the thickness.*give layer\.thickness"):
        ul.in_range(curve, ul.FitRange.of("10 % of thickness"), HALF, 1e-5)
    with pytest.raises(ul.CurveError, match=r"no point of .* is left from 1 mm"):
        ul.in_range(curve, ul.FitRange.of("1 mm"), HALF, 1e-5)


def scene_file(tmp_path, keys):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE_TOML.replace("[fit]", f"[curve]\n{keys}\n[fit]"), encoding="utf-8")
    return path


def test_a_scene_file_says_the_range_and_a_map_keeps_to_it(tmp_path):
    scene = scene_file(tmp_path, 'fit_from = "5 % of thickness"\nfit_to = "90 % of force"')
    truth = ul.load_scene(scene)
    curve = tmp_path / "curve.csv"
    made_curve = ul.synthesize(truth, np.linspace(-2e-5, 2e-4, 221), ul.Noise(force=1e-4), rng=0)
    curve.write_text(curve_csv(made_curve), encoding="utf-8")
    problem = ul.load_problem(curve, scene)
    kept = problem.curves[0]
    # 5 % of 1.5 mm, contact found to within a micrometre.
    assert kept.depth.min() == pytest.approx(7.5e-5, abs=2e-6)
    assert kept.force.max() == pytest.approx(0.9 * made_curve.force.max(), rel=0.02)
    alone = ul.fit(problem)
    row = ul.fit_many([curve], scene, workers=0).iloc[0]
    assert row["layer.E"] == pytest.approx(alone.values["layer.E"], rel=1e-4)


def test_a_preset_is_its_range_and_an_unknown_one_is_named(tmp_path):
    assert str(PRESETS["bioindenter"]) == "from 10 % of force to 98 % of force"
    path = tmp_path / "bio.TXT"
    path.write_bytes(made.bioindenter())
    told = 'preset = "bioindenter"'
    problem = ul.load_problem(path, scene_file(tmp_path, told))
    assert problem.curves[0].metadata["fit_range"] == str(PRESETS["bioindenter"])
    with pytest.raises(ul.InputError, match=r"\[curve\] preset.*'bioindenter'"):
        ul.load_problem(path, scene_file(tmp_path, 'preset = "piuma"'))


def hertz(depth, E_reduced, radius, contact):
    return 4.0 / 3.0 * E_reduced * np.sqrt(radius) * np.maximum(depth - contact, 0.0) ** 1.5


def test_the_recipes_find_what_hertz_s_formula_was_made_from():
    depth = np.linspace(0.0, 2e-5, 2001)
    force = hertz(depth, 8e5, 5e-4, 3e-6)
    found = LineInPower(0.1, 0.98).find(ul.Curve(depth, force), 5e-4)
    assert found.reduced == pytest.approx(8e5, rel=1e-9)
    assert found.contact_depth == pytest.approx(3e-6, rel=1e-9)
    # With an offset of the force, and the software's contact off by half a micrometre.
    shifted = ul.Curve(depth, force + 1e-5, np.linspace(0.0, 2.0, 2001))
    found = LeastSquaresFromContact(2.5e-6).find(shifted, 5e-4)
    assert found.reduced == pytest.approx(8e5, rel=1e-6)
    assert found.contact_depth == pytest.approx(3e-6, rel=1e-6)
    assert depth[found.points[-1]] < 3e-6 + 1.7e-5 * 0.5 ** (2.0 / 3.0) < depth[found.points[-1] + 2]


def test_a_recipe_without_points_or_contact_is_refused():
    flat = ul.Curve(np.linspace(0.0, 1e-5, 100), np.linspace(1.0, 0.5, 100))
    with pytest.raises(ul.CurveError, match="does not grow"):
        LineInPower(0.1, 0.98).find(flat, 1e-3)
    with pytest.raises(ul.CurveError, match="only 0 points"):
        LineInPower(0.9999, 0.99999).find(flat, 1e-3)


def test_the_steps_lead_from_the_instrument_s_number_to_ours():
    """On a layer the software's half-space reads too much, and the account of it ends at our own value."""
    readings = np.linspace(0.0, 1e-4, 400)
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 3e-4), ul.RIGID)
    curve = ul.synthesize(scene, readings, ul.Noise(force=1e-5), rng=0)
    told = LineInPower(0.1, 0.98).find(curve, 1e-3).reduced
    curve = curve.with_metadata(instrument_reduced_modulus=told, instrument_fit_range=(0.1, 0.98))
    free = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-1e-5, 1e-5)}
    fit = ul.fit(ul.Problem(scene, curve, free, noise=ul.Noise(force=1e-5)))
    steps = ul.steps_to_ours(fit)
    assert [step.what for step in steps][0::5] == [
        "the instrument's own number",
        "the layer, what it stands on, and all else of the scene",
    ]
    assert steps[1].modulus == pytest.approx(steps[0].modulus, rel=1e-12)
    assert steps[-1].modulus == fit.values["layer.E"]
    assert steps[-2].modulus > 1.5 * steps[-1].modulus


def test_a_bioindenter_s_file_states_its_recipe(tmp_path):
    content = made.bioindenter().decode("latin-1")
    path = tmp_path / "bio.TXT"
    content = content.replace("Method\tHertz", "Method :\tHertz\r\n\r\n  Load Fit [10%,98%]")
    path.write_text(content, encoding="latin-1")
    assert recipe_of(ul.read(path)) == LineInPower(0.1, 0.98)
    path.write_text(content.replace("Load Fit [", "Loaf Fit ["), encoding="latin-1")
    assert recipe_of(ul.read(path)) is None


def test_a_chiaro_s_own_number_is_given_back():
    curve = ul.read(real_file(CHIARO))
    recipe = recipe_of(curve)
    assert isinstance(recipe, LeastSquaresFromContact)
    found = recipe.find(curve, curve.metadata["indenter_radius"])
    assert found.reduced == pytest.approx(curve.metadata["instrument_reduced_modulus"], rel=0.005)


def test_real_files_of_piuma_and_bioindenter_give_their_numbers_back():
    """CellMechLab/NanoPrepare, testdata (11 files) and a file of artorg-unibe-ch/CartilageIndentationAnalysis."""
    files = [*real_file("piuma").glob("*.txt"), *real_file("bioindenter").glob("*.TXT")]
    if not files:
        pytest.skip("no folder piuma or bioindenter beside the real files")
    for path in files:
        curve = ul.read(path)
        recipe = recipe_of(curve)
        radius = curve.metadata.get("indenter_radius", 500e-6)
        if recipe is not None:
            told = curve.metadata["instrument_reduced_modulus"]
            assert recipe.find(curve, radius).reduced == pytest.approx(told, rel=0.011), path.name
