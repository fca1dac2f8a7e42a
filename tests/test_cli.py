"""The commands as a user meets them: results, files, and one clear line for every mistake."""

import json
import re
import shlex
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from support.inverse import ambiguous
from support.python import python
from underlay.data.export import curve_csv

SAMPLES = Path(__file__).resolve().parents[1] / "data_samples"
CURVE, SCENE = SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml"


def test_fit_prints_and_writes(done, tmp_path):
    words = ("--output", tmp_path / "new" / "folder", "--excel", tmp_path / "fit.xlsx")
    out = done("fit", CURVE, "--scene", SCENE, *words)
    assert re.search(r"^Layer modulus +E = 0\.6\d+ \(", out, re.MULTILINE)
    sheets = pd.read_excel(tmp_path / "fit.xlsx", sheet_name=None)
    assert list(sheets) == ["results", "settings", "curves", "depths"]
    results = tmp_path / "new" / "folder" / "cartilage_on_bone"
    written = json.loads(results.with_suffix(".fit.json").read_text())
    assert written["values"]["layer.E"] == pytest.approx(0.62e6, rel=0.05)
    assert list(pd.read_csv(results.with_suffix(".fit.csv"))["parameter"]) == list(written["values"])
    assert results.with_suffix(".fit.png").read_bytes().startswith(b"\x89PNG")


def test_an_excel_file_that_is_none_is_refused_before_the_fit(run, tmp_path):
    code, out, err = run("fit", CURVE, "--scene", SCENE, "--excel", tmp_path / "fit.xls")
    assert (code, out) == (2, "")
    assert "an Excel file ends in .xlsx; got 'fit.xls'" in err


def test_fit_says_a_second_optimum_beside_the_headline_and_once(run, done, tmp_path):
    problem = ambiguous()
    curve, scene = tmp_path / "curve.csv", tmp_path / "scene.toml"
    curve.write_text(curve_csv(problem.curves[0], []), encoding="utf-8")
    problem.base_scenes[0].save(scene)
    free = "layer.E = {}\nlayer.thickness = {}\ninstrument.contact_depth = {}\n"
    scene.write_text(scene.read_text() + "\n[fit]\n" + free, encoding="utf-8")
    out = done("fit", curve, "--scene", scene)
    first, second = out.strip().splitlines()[:2]
    assert first.startswith("Layer modulus")
    assert second.startswith("Layer thickness")
    # Both optima lie within what is stated; what else was found is said with the details.
    assert "known to a factor" in out
    assert "another optimum explains" in run("fit", curve, "--scene", scene, "--details")[1].replace(
        "\n", " "
    )


def test_formats_says_how_a_file_is_read_and_draws_its_segments(done, tmp_path):
    measured = SAMPLES / "chiaro_cell_indentation.csv"
    out = done("formats", measured, "--output", tmp_path / "pictures")
    assert "format csv" in out
    assert "loading 2533, unloading 233" in out
    picture = tmp_path / "pictures" / "chiaro_cell_indentation.segments.png"
    assert str(picture) in out
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_formats_takes_one_test_of_many_and_reads_as_the_scene_file_says(run, refused, tmp_path):
    both = tmp_path / "both.zip"
    with zipfile.ZipFile(both, "w") as archive:
        archive.writestr("first.csv", table(RAMP, "h (um),load (mN)"))
        archive.writestr("second.csv", table(RAMP[:40], "h (um),load (mN)"))
    scene = tmp_path / "scene.toml"
    columns = '\n[curve]\ncolumns = { depth = "h (um)", force = "load (mN)" }\n'
    scene.write_text(SCENE.read_text(encoding="utf-8") + columns, encoding="utf-8")
    assert run("formats", both, "--scene", scene, "--output", tmp_path)[0] == 0
    assert {path.name for path in tmp_path.glob("*.png")} == {"both-1.segments.png", "both-2.segments.png"}
    code, out, _ = run("formats", both, "--scene", scene, "--test", 2)
    assert code == 0
    assert "loading 40" in out
    assert "loading 60" not in out
    for words, line in (
        (("formats", both, "--scene", scene, "--test", 3), "no test 3; it holds 2"),
        (("formats", "--test", 1), "name the file to read"),
    ):
        assert line in refused(*words)


def test_fit_draws_the_segments_of_a_curve_that_comes_back(run, done, tmp_path):
    assert run("fit", CURVE, "--scene", SCENE, "--output", tmp_path)[0] == 0
    assert not list(tmp_path.glob("*.segments.png"))
    words = ("fit", SAMPLES / "chiaro_cell_indentation.csv", "--scene", SAMPLES / "chiaro_cell.toml")
    assert ".segments.png" in done(*words, "--output", tmp_path)
    assert (tmp_path / "chiaro_cell_indentation.segments.png").exists()


def test_demo_says_where_its_files_are(done, tmp_path):
    out = done("demo", "--output", tmp_path)
    for name in ("chiaro_cell_indentation.fit.png", "cartilage_on_bone.fit.csv"):
        assert str(tmp_path / name) in out
        assert (tmp_path / name).stat().st_size > 0


def table(rows, header="depth (um),force (mN)"):
    return "\n".join([header, *rows]) + "\n"


RAMP = [f"{d:.3f},{max(d, 0.0) ** 1.5:.6f}" for d in np.linspace(-5, 20, 60)]

#: content of the curve file -> what the one line must say
BAD_CURVES = {
    "empty": (b"", "empty"),
    "words": (b"once upon a time\nthere was a gel\n", "not recognised|not a|no "),
    "unknown unit": (table(RAMP, "depth (um),force (parsnip)").encode(), "parsnip"),
    "not a number": (table([*RAMP[:30], "7.0,nan", *RAMP[30:]]).encode(), "nan|NaN"),
    "seven points": (table(RAMP[-7:]).encode(), "at least 8"),
    "never deeper": (
        table([f"{5 - i * 0.01:.3f},1.0" for i in range(60)]).encode(),
        "never increases|loading",
    ),
    "no force at all": (table([f"{i},0" for i in range(60)]).encode(), "zero"),
    "binary": (bytes(range(256)) * 40, "not|no "),
}


@pytest.mark.parametrize("case", BAD_CURVES, ids=str)
def test_bad_curves_end_with_one_line_and_two(refused, tmp_path, case):
    content, words = BAD_CURVES[case]
    curve, out = tmp_path / "curve.csv", tmp_path / "out"
    curve.write_bytes(content)
    err = refused("fit", curve, "--scene", SCENE, "--output", out)
    assert err.startswith("underlay: ")
    assert re.search(words, err), err
    assert not out.exists() or not list(out.iterdir())


def test_files_that_are_not_there(refused, tmp_path):
    for words in (
        ("fit", tmp_path / "none.csv", "--scene", SCENE),
        ("fit", CURVE, "--scene", tmp_path / "none.toml"),
        ("fit", CURVE, "--scene", SCENE, "--output", CURVE),
    ):
        refused(*words)


def test_bad_scenes_end_with_one_line(refused, tmp_path):
    text = SCENE.read_text(encoding="utf-8")
    # A layer this thin is beyond the root of the series, if not thinner than the depth pressed.
    thin = text.replace('thickness = "2 mm"', 'thickness = "0.3 mm"').replace(
        'layer.thickness = { min = "0.3 mm", max = "10 mm" }', ""
    )
    scene = tmp_path / "scene.toml"
    for wrong, message in (
        (text.replace("nu = 0.46", "nu = 0.7"), "nu must be in"),
        (text.replace('radius = "1 mm"', 'radius = "20 um"'), "larger radius"),
        (thin.replace("[solver]\nrtol = 1e-5", '[solver]\nname = "asymptotic"'), "exact"),
    ):
        scene.write_text(wrong, encoding="utf-8")
        assert message in refused("fit", CURVE, "--scene", scene)


def next_step(err):
    """The command that a refusal names, as a shell would run it."""
    first, step = err.splitlines()
    assert first.startswith("underlay: ")
    return shlex.split(step.removeprefix("Next step: underlay "))


def test_without_a_scene_the_next_step_leads_to_a_fit_as_it_is_printed(
    run, done, refused, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    curve = tmp_path / "my curve.csv"
    curve.write_bytes(CURVE.read_bytes())
    for command in ("fit", "sample", "compare", "film"):
        err = refused(command, curve.name)
        assert next_step(err) == ["formats", "my curve.csv", "--new-scene", "my curve.toml"]
    assert run(*next_step(err))[0] == 0
    scene = tmp_path / "my curve.toml"
    assert "TODO" in scene.read_text(encoding="utf-8")
    scene.write_bytes(SCENE.read_bytes())
    _, _, err = run("fit", curve.name)
    assert next_step(err) == ["fit", "my curve.csv", "--scene", "my curve.toml"]
    out = done(*next_step(err))
    assert out.strip().startswith("Layer modulus")


def test_a_folder_for_one_curve_leads_to_a_map_and_a_map_without_a_scene_to_a_new_scene(
    run, refused, tmp_path
):
    folder = tmp_path / "curves"
    folder.mkdir()
    (folder / "a.csv").write_bytes(CURVE.read_bytes())
    _, _, err = run("fit", folder, "--scene", SCENE)
    assert next_step(err) == ["map", str(folder), "--scene", str(SCENE)]
    err = refused("map", folder)
    assert next_step(err)[:2] == ["formats", str(folder / "a.csv")]
    refused("fit", tmp_path / "none.csv")


def test_the_module_runs_too(tmp_path):
    done = python("-m", "underlay", "fit", tmp_path / "none.csv", "--scene", SCENE)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_a_curve_without_contact_is_refused(refused, tmp_path):
    rng = np.random.default_rng(3)
    curve = tmp_path / "air.csv"
    rows = [
        f"{d:.3f},{f:.6f}" for d, f in zip(np.linspace(0, 300, 400), rng.normal(0, 0.01, 400), strict=True)
    ]
    curve.write_text(table(rows), encoding="utf-8")
    err = refused("fit", curve, "--scene", SCENE)
    assert "contact" in err or "noise" in err


def test_a_doubtful_curve_is_fitted_and_the_doubt_is_said(run, done, tmp_path):
    # A force that grows in proportion to the depth is no ball on a layer.
    rng = np.random.default_rng(4)
    depth = np.linspace(-40, 300, 681)
    force = np.maximum(depth, 0.0) * 0.5 + rng.normal(0, 0.3, 681)
    curve = tmp_path / "punch.csv"
    curve.write_text(table([f"{d:.3f},{f:.6f}" for d, f in zip(depth, force, strict=True)]), encoding="utf-8")
    out = done("fit", curve, "--scene", SCENE)
    assert "reject" in out
    assert "no uncertainty given" in out
    assert "grows as depth^" in run("fit", curve, "--scene", SCENE, "--details")[1]


def test_in_a_file_no_table_is_cut_off(done):
    out = done("keys", "curve")
    assert "…" not in out
    for words in ("Deepest reading that is used", "loading", "calibration", "imprint"):
        assert words in out
    out = done("compare", SAMPLES / "gel_on_glass.csv", "--scene", SAMPLES / "gel_on_glass.toml")
    assert "…" not in out


@pytest.mark.parametrize("command", ["film", "fit", "compare", "population", "cite"])
def test_input_that_is_refused_leaves_no_folder_behind(run, tmp_path, command):
    curve, scene = tmp_path / "short.csv", ["--scene", tmp_path / "scene.toml"]
    curve.write_text("depth (um),force (mN)\n0,0\n1,1\n", encoding="utf-8")
    scene[1].write_text((SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8"), encoding="utf-8")
    there = tmp_path / "there"
    there.mkdir()
    for output in (tmp_path / "new", tmp_path / "new" / "within", there):
        words = [command, curve, *([] if command in {"population", "cite"} else scene), "--output", output]
        assert run(*words)[0] == 2
        # What was there before is left, however empty.
        assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml", "short.csv", "there"]


def test_compare_says_what_a_curve_cannot_tell(done, tmp_path):
    """A flat punch: every law is a straight line, and theory orders them."""
    scene = tmp_path / "punch.toml"
    scene.write_text(
        '[indenter]\nshape = "flat_punch"\nradius = "0.6 mm"\n'
        '[layer]\nE = "1 MPa"\nnu = 0.45\nthickness = "1 mm"\n[substrate]\nrigid = true\n'
        '[fit]\nlayer.E = {min = "10 kPa", max = "100 MPa"}\n'
        'instrument.contact_depth = {min = "-50 um", max = "50 um"}\ninstrument.baseline = {}\n'
        '[simulate]\nstart = "-10 um"\nmax_depth = "40 um"\npoints = 200\n[noise]\nforce = "2 mN"\n',
        encoding="utf-8",
    )
    done("simulate", scene, "--output", tmp_path / "punch.csv")
    out = done("compare", tmp_path / "punch.csv", "--scene", scene)
    rows = [text.split() for text in out.splitlines()]
    first = next(i for i, row in enumerate(rows) if row and row[0] == "exact")
    assert rows[first - 2][:2] == ["contact", "model"]
    assert "This curve cannot tell exact, asymptotic:4" in out
    assert "nu = 0.3 and 0.5 alone" in out
