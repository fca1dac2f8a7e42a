"""`underlay report`: each kind of result finds its page, and each mistake its one clear line."""

import json
import re
import resource
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest

from support.reports import SAMPLES, cells_of, page_text, small_posterior
from underlay import fit, load_problem
from underlay.data.export import curve_csv


@pytest.fixture
def run(run, monkeypatch, tmp_path):
    """Call the entry point in a folder with a curve and a scene: (exit code, stdout, stderr)."""
    shutil.copy(SAMPLES / "cartilage_on_bone.csv", tmp_path / "curve.csv")
    shutil.copy(SAMPLES / "cartilage_on_bone.toml", tmp_path / "scene.toml")
    monkeypatch.chdir(tmp_path)
    return run


def test_page_of_a_curve_and_of_a_kept_fit(run, tmp_path):
    code, out, err = run("report", "curve.csv", "--scene", "scene.toml")
    assert (code, err) == (0, "")
    assert out.splitlines() == ["wrote " + str(tmp_path / "report.html")]
    assert "underlay report curve.csv --scene scene.toml --output report.html" in page_text(
        tmp_path / "report.html"
    )
    (tmp_path / "results").mkdir()
    fit(load_problem("curve.csv", "scene.toml")).to_json("results/curve.fit.json")
    assert run("report", "results/curve.fit.json", "--output", "results/page.html")[0] == 0
    text = page_text(tmp_path / "results" / "page.html")
    assert "underlay report results/curve.fit.json --output results/page.html" in text
    assert [path.name for path in (tmp_path / "results").iterdir() if path.suffix != ".json"] == ["page.html"]


def test_a_page_takes_four_seconds_of_processor(tmp_path):
    """Import and fit included; measured in a process of its own, with room for a slow machine."""
    curve, scene = (SAMPLES / f"cartilage_on_bone.{ending}" for ending in ("csv", "toml"))
    words = ("report", str(curve), "--scene", str(scene), "--output", str(tmp_path / "page.html"))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "underlay", *words], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime - before.ru_utime < 6.0


def test_sample_then_report_needs_nothing_more(run, done, tmp_path):
    scene = tmp_path / "scene.toml"
    bounded = 'instrument.baseline = { min = "-10 mN", max = "10 mN" }'
    scene.write_text(scene.read_text().replace("instrument.baseline = {}", bounded), encoding="utf-8")
    words = ("--scene", "scene.toml", "--output", "results", "--walkers", "16", "--max-steps", "60")
    code, out, err = run("sample", "curve.csv", *words)
    assert code == 0
    # A scene whose noise nobody states: it is said before the wait.
    is_open = "[noise]" not in scene.read_text()
    assert ("the noise of the force is not given" in out + err) == is_open
    # Neither file is needed any more.
    scene.unlink()
    (tmp_path / "curve.csv").unlink()
    done("report", "results/curve.posterior.npz", "--output", "results/page.html")
    text = page_text(tmp_path / "results" / "page.html")
    for part in ("Data and prediction.", "The test,", "rigid, bonded to the layer"):
        assert part in text, part
    # The corner as pixels; the band over the data, the drawing of the scene.
    source = (tmp_path / "results" / "page.html").read_text()
    assert (source.count("<img"), source.count("<svg")) == (1, 2)


def test_weighted_draws_are_asked_for_by_name(done, refused, tmp_path):
    scene = tmp_path / "scene.toml"
    bounded = 'instrument.baseline = { min = "-10 mN", max = "10 mN" }\n[noise]\nforce = "0.6 mN"'
    scene.write_text(scene.read_text().replace("instrument.baseline = {}", bounded), encoding="utf-8")
    words = ("sample", "curve.csv", "--scene", "scene.toml", "--output", "weighted", "--method", "importance")
    short = done(*words)
    # The number first, as `fit` prints it, and how it was drawn; tables for those who ask.
    number = next(line for line in short.splitlines() if line.startswith("Layer modulus"))
    assert "stat" in number
    assert "syst" in number
    assert "Verdict  " in short
    assert re.search(r"^Sampling +\d+ effective samples, [\d.]+ s$", short, re.MULTILINE)
    assert "weighted samples" not in short
    out = done(*words, "--details")
    assert number in out
    assert "weighted samples" in out
    # No chain is kept, so none goes on.
    assert sorted(path.suffix for path in (tmp_path / "weighted").iterdir()) == [
        ".csv",
        ".npz",
        ".png",
        ".png",
    ]
    assert "leave --method out" in refused(*words, "--resume")


def test_page_of_a_kept_posterior_without_its_scene(run, refused, tmp_path):
    problem, posterior = small_posterior()
    replace(posterior, problem=None, missing="kept the draws alone").save(tmp_path / "draws.npz")
    assert run("report", "draws.npz")[0] == 0
    text = page_text(tmp_path / "report.html")
    assert "draws.npz: posterior" in text
    assert "The test is not shown: this posterior does not hold its scene (kept the draws alone)" in text
    assert "underlay report POSTERIOR.npz CURVE --scene SCENE.toml" in text
    assert (tmp_path / "report.html").read_text().count("<img") == 1
    # With the files that were sampled it is shown; with others it is refused.
    (tmp_path / "made.csv").write_text(curve_csv(problem.curves[0]), encoding="utf-8")
    problem.base_scenes[0].save(tmp_path / "made.toml")
    free = (
        '\n[fit]\nlayer.E = { min = "10 kPa", max = "100 MPa" }\n'
        'instrument.contact_depth = { min = "-10 um", max = "10 um" }\n'
    )
    (tmp_path / "made.toml").write_text((tmp_path / "made.toml").read_text() + free, encoding="utf-8")
    assert run("report", "draws.npz", "made.csv", "--scene", "made.toml")[0] == 0
    assert "to scale at the median" in page_text(tmp_path / "report.html")
    for words, line in (
        (("draws.npz", "curve.csv", "--scene", "scene.toml"), "the problem frees layer.E, layer.thickness"),
        (("draws.npz", "curve.csv"), "add --scene SCENE.toml for curve.csv"),
        (("draws.npz", "--scene", "scene.toml"), "name the curve that was sampled too"),
    ):
        assert line in refused("report", *words)


def test_a_notebook_is_executed_where_it_stands_and_keeps_what_is_there(done, refused, tmp_path):
    words = ("report", "curve.csv", "scene.toml", "--notebook", "mine/mine.ipynb")
    assert "jupyter lab mine/mine.ipynb" in done(*words)
    cells = cells_of(tmp_path / "mine" / "mine.ipynb")
    text = json.dumps(cells)
    assert "ul.load_problem('../curve.csv', '../scene.toml')" in text
    assert all(cell["execution_count"] for cell in cells if cell["cell_type"] == "code")
    assert text.count("image/png") >= 5
    assert "Layer modulus" in text
    assert not (tmp_path / "report.html").exists()
    before = (tmp_path / "mine" / "mine.ipynb").read_bytes()
    assert "may hold your work" in refused(*words)
    assert (tmp_path / "mine" / "mine.ipynb").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("curve.csv",), "add --scene SCENE.toml for curve.csv"),
        (("none.csv", "--scene", "scene.toml"), "cannot open 'none.csv'"),
        (("curve.csv", "--scene", "none.toml"), "cannot open 'none.toml': No such file"),
        (("curve.csv", "curve.csv", "--scene", "scene.toml"), "one page is of one curve"),
        (("curve.csv", "--scene", "scene.toml", "--output", "page.txt"), "a report is an HTML or PDF file"),
        (
            ("curve.csv", "--scene", "scene.toml", "--output", "scene.toml/page.html"),
            "cannot write into folder",
        ),
        (("scene.toml",), "nothing to report"),
        (("bad.json",), "bad.json is not a result of underlay fit"),
        (("bad.npz",), "bad.npz is not a saved posterior"),
        (("bad.parquet",), "bad.parquet is not the table of a map"),
        (("--notebook", "mine.txt", "curve.csv", "scene.toml"), "a notebook ends in .ipynb"),
    ],
)
def test_mistakes_are_one_line(refused, tmp_path, words, line):
    (tmp_path / "bad.json").write_text('{"values": {}}')
    (tmp_path / "bad.npz").write_text("no archive")
    (tmp_path / "bad.parquet").write_text("no table")
    err = refused("report", *words)
    assert line in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "report.html").exists()


def test_a_record_whose_files_changed_is_refused(refused, tmp_path):
    fit(load_problem("curve.csv", "scene.toml")).to_json("curve.fit.json")
    scene = tmp_path / "scene.toml"
    scene.write_text(scene.read_text().replace("nu = 0.46", "nu = 0.3"))
    assert "is not the fit of curve.csv with this scene file" in refused("report", "curve.fit.json")
    curve = tmp_path / "curve.csv"
    curve.write_text(curve.read_text().replace("0.001436591", "0.001536591"))
    assert "curve.csv has changed since curve.fit.json was made" in refused("report", "curve.fit.json")
