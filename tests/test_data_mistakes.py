"""Mistakes in the data of a curve: signs, columns and units, parts that cannot be fitted. Each is told apart."""

import re

import numpy as np
import pytest

import underlay as ul
from underlay.cli import main
from underlay.data.signs import flipped, require_signs
from underlay.inference.batch import work
from underlay.inference.from_files import chosen_part
from underlay.scene.scene_file import read_scene_file

SCENE = """
[indenter]
shape = "{shape}"
radius = "0.5 mm"

[layer]
E = "0.4 MPa"
nu = 0.45
thickness = "1.5 mm"

[substrate]
rigid = true

[fit]
layer.E = {{ min = "10 kPa", max = "10 MPa" }}
instrument.contact_depth = {{ min = "-50 um", max = "50 um" }}

[curve]
{part}
"""
TRUE = ul.Scene(ul.Paraboloid(0.5e-3), ul.Layer(ul.Isotropic(0.62e6, 0.45), 1.5e-3), ul.RIGID)
INTO = np.linspace(-2e-5, 8e-5, 120)
DEPTH = np.concatenate((INTO, INTO[::-1][1:]))
NOISE = 2e-6


@pytest.fixture(scope="module")
def curve():
    return ul.synthesize(TRUE, DEPTH, ul.Noise(force=NOISE), rng=3)


@pytest.fixture
def put(tmp_path):
    """Writer of a table and a scene: (curve file, scene file)."""

    def write(depth, force, part="", *, header="depth (m),force (N)", shape="paraboloid"):
        path, scene = tmp_path / "curve.csv", tmp_path / "scene.toml"
        rows = (
            f"{d!r},{f!r}"
            for d, f in zip(np.asarray(depth).tolist(), np.asarray(force).tolist(), strict=True)
        )
        path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
        scene.write_text(SCENE.format(part=part, shape=shape), encoding="utf-8")
        return path, scene

    return write


# --- signs


@pytest.mark.parametrize("whole", [True, False], ids=["and back", "loading only"])
@pytest.mark.parametrize(
    ("columns", "told"),
    [
        (["depth"], r'sign of the depth is reversed.*flip = \["depth"\]'),
        (["force"], r'sign of the force is reversed.*flip = \["force"\]'),
        (["depth", "force"], r'signs of depth and force are reversed.*flip = \["depth", "force"\]'),
    ],
)
def test_a_reversed_sign_is_named_with_the_key_that_turns_it(curve, put, columns, told, whole):
    part = curve if whole else curve.select(slice(0, len(INTO)))
    wrong = {
        name: -getattr(part, name) if name in columns else getattr(part, name) for name in ("depth", "force")
    }
    with pytest.raises(ul.CurveError, match=told):
        ul.load_problem(*put(**wrong))
    keys = ", ".join(f'"{name}"' for name in columns)
    right = ul.load_problem(*put(**wrong, part=f"flip = [{keys}]"))
    expected = ul.load_problem(*put(part.depth, part.force))
    np.testing.assert_array_equal(right.curves[0].depth, expected.curves[0].depth)
    np.testing.assert_array_equal(right.curves[0].force, expected.curves[0].force)
    rules = right.curves[0].metadata["sign_rules"]
    assert all(rules[name].startswith("turned, as asked") for name in columns)


@pytest.mark.parametrize("offset", [0.0, 5.0, -2.0])
@pytest.mark.parametrize("from_contact", [False, True])
def test_both_signs_reversed_are_told_whatever_the_zero_of_the_force(curve, put, offset, from_contact):
    """A load cell that is not tared: the force begins far from zero, and falls from air, or ever faster."""
    way_in = curve.loading()
    kept = way_in.depth >= (0.0 if from_contact else -np.inf)
    path, scene = put(-way_in.depth[kept], offset * way_in.force.max() - way_in.force[kept])
    with pytest.raises(ul.CurveError, match="the signs of depth and force are reversed"):
        ul.load_problem(path, scene)


@pytest.mark.parametrize("offset", [0.0, 5.0, -2.0])
def test_a_contact_that_is_withdrawn_is_not_taken_for_one_that_is_made_with_both_signs_reversed(
    curve, offset
):
    back = curve.unloading()
    require_signs(ul.Curve(back.depth, back.force + offset * back.force.max()))


@pytest.mark.parametrize(
    ("depth", "force", "columns"), [(-1, 1, "depth"), (1, -1, "force"), (-1, -1, "depth and force")]
)
def test_reading_notes_what_looks_like_a_wrong_sign_and_turning_takes_the_note_off(
    curve, put, depth, force, columns
):
    path, _ = put(depth * curve.depth, force * curve.force)
    (note,) = ul.read(path).metadata["notes"]
    assert f"looks like the wrong sign of {columns}: " in note
    turned = flipped(ul.read(path), columns.split(" and "))
    assert turned.metadata["notes"] == ()
    np.testing.assert_array_equal(turned.depth, curve.depth)
    names = {"depth": "depth (m)", "force": "force (N)"}
    asked = {key: ("-" if key in columns else "") + name for key, name in names.items()}
    assert ul.read(path, columns=asked).metadata["notes"] == ()


def test_an_empty_list_says_that_the_signs_are_right(curve, put):
    problem = ul.load_problem(*put(curve.depth, -curve.force, "flip = []"))
    np.testing.assert_allclose(problem.curves[0].force, -curve.force[: len(INTO)], atol=1e-15)


def test_other_things_are_not_taken_for_a_sign(curve):
    require_signs(curve.unloading())
    # Adhesion before contact, a sloping baseline with a contact at its end, and noise.
    x = np.linspace(0.0, 1.0, 200)
    contact = np.clip(x - 0.6, 0.0, None) ** 1.5
    require_signs(ul.Curve(x, contact - 2.0 * np.exp(-(((x - 0.55) / 0.05) ** 2))))
    require_signs(ul.Curve(x, contact - 0.4 * x))
    require_signs(ul.Curve(x, np.random.default_rng(0).standard_normal(200)))
    require_signs(ul.Curve(x[:5], -x[:5]))
    require_signs(ul.Curve(x, np.where(x > 0.5, np.nan, -x)))


def test_segments_of_the_motion_turn_with_the_depth_and_those_of_the_file_do_not(curve):
    labels = curve.segments()
    wrong = ul.Curve(-curve.depth, curve.force, segment=np.where(labels == "loading", "unloading", "loading"))
    assert list(flipped(wrong, ["depth"]).segment) == list(labels)
    named = ul.Curve(-curve.depth, curve.force, segment=labels)
    assert list(flipped(named, ["depth"]).segment) == list(labels)


# --- columns and units


def test_the_same_force_everywhere_is_no_contact(put):
    with pytest.raises(ul.CurveError, match=r"no contact, the force is the same \(0\.003 N\) at every point"):
        ul.load_problem(*put(INTO, np.full_like(INTO, 3e-3)))
    with pytest.raises(ul.CurveError, match="no contact, the force is zero at every point"):
        ul.load_problem(*put(INTO, np.zeros_like(INTO)))


@pytest.mark.parametrize(
    ("header", "told"),
    [
        # What stands in the file are metres and newtons.
        ("depth (km),force (N)", r"depth or its unit looks wrong: pressed .* layer is 1\.5 mm thick"),
        (
            "depth (mm),force (N)",
            r"depth, force or a unit looks wrong: .* times larger than with layer\.E at its bound of 10 MPa",
        ),
        (
            "depth (m),force (uN)",
            r" times smaller than with layer\.E at its bound of 10 kPa",
        ),
        ("depth (m),force (kN)", r" times larger than with layer\.E at its bound of 10 MPa"),
    ],
)
def test_a_unit_that_is_wrong_by_a_thousand_is_told_by_the_scene(curve, put, header, told):
    with pytest.raises(ul.CurveError, match=told):
        ul.load_problem(*put(curve.depth, curve.force, header=header))


def test_ten_radii_deep_is_no_indentation(put):
    scene = ul.Scene(ul.Paraboloid(1e-6), ul.Layer(ul.Isotropic(1e6, 0.45)))
    x = np.linspace(-1e-6, 12e-6, 100)
    path, file = put(x, np.asarray(scene.force(np.clip(x, 0.0, None))))
    text = file.read_text().replace("0.5 mm", "1 um").replace('thickness = "1.5 mm"', "")
    file.write_text(text.replace("[substrate]\nrigid = true", ""))
    with pytest.raises(
        ul.CurveError, match=r"pressed .* beyond contact where the indenter is 1 um in radius"
    ):
        ul.load_problem(path, file)


def test_a_deflection_given_as_depth_is_told_by_its_straight_line(put):
    deflection = np.concatenate((np.zeros(40), np.linspace(0.0, 4e-5, 80)))
    force = 30.0 * deflection
    with pytest.raises(
        ul.CurveError, match=r"proportional to the depth \(30 N/m\).*looks like the deflection"
    ):
        ul.load_problem(*put(deflection, force))
    # A flat punch gives such a line by itself.
    assert (
        ul.load_problem(*put(deflection, force, shape="flat_punch")).n_points == 79
    )  # the rest in front is a hold


@pytest.mark.parametrize("free", ['layer.thickness = { min = "0.1 mm", max = "5 mm" }', ""])
def test_a_sound_curve_is_none_of_these(curve, put, free):
    path, scene = put(curve.depth, curve.force)
    scene.write_text(scene.read_text().replace("[fit]\n", f"[fit]\n{free}\n"))
    assert ul.load_problem(path, scene).n_points == len(INTO)


# --- parts


def test_the_unloading_of_an_elastic_sample_gives_the_modulus_of_its_loading(curve, put):
    fits = [
        ul.fit(ul.load_problem(*put(curve.depth, curve.force, f'segment = "{part}"')))
        for part in ("loading", "unloading")
    ]
    assert [len(fit.curves[0]) for fit in fits] == [len(INTO), len(INTO) - 1]
    for fit in fits:
        assert abs(fit.values["layer.E"] - 0.62e6) < 4.0 * fit.stderr["layer.E"]
    assert not any("elastic" in note for note in fits[1].curves[0].metadata["notes"])
    # The points of one branch in the other order are the same problem.
    there, back = curve.loading(), curve.loading()
    back = ul.Curve(back.depth[::-1], back.force[::-1], segment=["unloading"] * len(back))
    free = {"layer.E": (1e4, 1e7), "instrument.contact_depth": (-5e-5, 5e-5)}
    one, other = (ul.fit(ul.Problem(TRUE, part, free)) for part in (there, back))
    assert other.values["layer.E"] == pytest.approx(one.values["layer.E"], rel=1e-6)
    assert ul.find_contact(back).depth == pytest.approx(ul.find_contact(there).depth, abs=1e-9)


def test_curve_unloading_is_fitted_as_it_is(curve):
    fit = ul.fit(ul.Problem(TRUE, curve.unloading(), {"layer.E": (1e4, 1e7)}))
    assert abs(fit.values["layer.E"] - 0.62e6) < 4.0 * fit.stderr["layer.E"]


def test_an_unloading_that_gives_less_work_back_says_so(curve, put):
    force = np.where(np.arange(len(DEPTH)) < len(INTO), curve.force, 0.7 * curve.force)
    part = ul.load_problem(*put(curve.depth, force, 'segment = "unloading"')).curves[0]
    assert re.search(r"gives 3\d % less work than the way in took", part.metadata["notes"][-1])


def test_a_hold_is_refused_when_the_scene_is_read(curve, put):
    _, scene = put(curve.depth, curve.force, 'segment = "hold"')
    with pytest.raises(
        ul.InputError, match=r"\[curve\] segment: a hold cannot be fitted.*Allowed are 'loading', 'unl"
    ):
        read_scene_file(scene)


def test_a_part_that_is_not_there_is_said_with_those_that_are(curve):
    with pytest.raises(ul.CurveError, match="has no unloading part, only loading"):
        chosen_part(curve.loading(), {"segment": "unloading"})


def test_a_map_says_the_same_of_each_curve(curve, put, tmp_path):
    folder = tmp_path / "curves"
    folder.mkdir()
    for name, force, unit in (("a", curve.force, "m"), ("b", -curve.force, "m"), ("c", curve.force, "mm")):
        path, scene = put(curve.depth, force, header=f"depth ({unit}),force (N)")
        path.rename(folder / f"{name}.csv")
    table = ul.fit_many(folder, scene, workers=0)
    assert list(table["status"]) == ["fitted", "failed", "failed"]
    assert "sign of the force is reversed" in table["reason"][1]
    assert "a unit looks wrong" in table["reason"][2]


def test_a_map_asks_about_sizes_only_of_a_fit_in_doubt(monkeypatch):
    """On an elastic base the engine fits: laws at the corners of the bounds would cost a third of the row."""
    asked = []
    monkeypatch.setattr(work, "require_sizes", asked.append)
    scene = ul.Scene(
        ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.Isotropic(1e7, 0.3), ul.Instrument()
    )
    depth = np.linspace(-1e-5, 8e-5, 200)
    good = ul.synthesize(scene, depth, ul.Noise(force=1e-5), rng=1)
    free = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-5e-5, 5e-5)}
    table = ul.fit_many([good, ul.Curve(good.depth, 1e5 * good.force)], scene, free, workers=0)
    assert table["status"][0] == "fitted"
    assert len(asked) == 1
    assert asked[0].curves[0].force.max() > 1e4 * good.force.max()


def test_the_command_fits_an_unloading(curve, put, tmp_path, monkeypatch, capsys):
    path, scene = put(curve.depth, curve.force, 'segment = "unloading"')
    words = ["underlay", "fit", str(path), "--scene", str(scene), "--output", str(tmp_path / "out")]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit, match="0"):
        main()
    # Four in a thousand is the drift of the law that the averaging allows for.
    found = float(re.search(r"Layer modulus +E = ([0-9.]+) ", capsys.readouterr().out).group(1))
    assert found == pytest.approx(0.62, rel=4e-3)
    assert (tmp_path / "out" / "curve.fit.json").is_file()
