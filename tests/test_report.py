"""Reports: what the page says is what the fit found, the same each time, and nothing that was read acts on it."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import real_data
from support.inverse import ambiguous
from support.real_data import real_file
from support.reports import SAMPLES, joint_fit, page_text, sample_fit
from underlay.data.curve import recorded
from underlay.inference.batch.decisions import is_map, read_map
from underlay.report import labels, limits, screen, tables

# --- words -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "low", "high", "kind", "text"),
    [
        (4.2e5, 4.0e5, 4.4e5, "pressure", "0.420 ± 0.020 MPa"),
        (1.5e-3, 1.1e-3, 2.2e-3, "length", "1.50 (1.10 to 2.20) mm"),
        (1.5e-3, 1.1e-3, np.inf, "length", "1.5 mm (> 1.1 mm)"),
        (0.45, -np.inf, 0.47, "dimensionless", "0.45 (< 0.47)"),
        (1.0, -np.inf, np.inf, "force", "1 N"),
        # An end near zero is not read as zero.
        (138.3, 4.787, 567.1, "pressure", "0.138 (0.005 to 0.567) kPa"),
        (5.88e11, 7.6e5, np.inf, "pressure", "588 GPa (> 0.76 MPa)"),
        (1.2e-9, 0.0, 3.6e-9, "force", "1.2 (0.0 to 3.6) nN"),
        # An end far away is known to three digits of its distance.
        (7.8e4, 5.4e4, 5.018e6, "pressure", "78 (54 to 5020) kPa"),
    ],
)
def test_interval_in_words(value, low, high, kind, text):
    assert screen.interval_text(value, low, high, kind) == text


def test_names_for_people():
    assert labels.label("layer.E") == "layer modulus"
    assert labels.label("layer.E[1]") == "layer modulus (curve 2)"
    assert labels.label("indenter.tilt") == "indenter.tilt"


@pytest.fixture
def fit():
    return sample_fit("cartilage_on_bone")


def rejected():
    """A gel on glass, fitted as a half-space."""
    problem = ul.load_problem(SAMPLES / "gel_on_glass.csv", SAMPLES / "gel_on_glass.toml")
    scene = problem.base_scenes[0]
    bare = ul.Scene(scene.indenter, ul.Layer(scene.layer.material))
    free = {"layer.E": (1.0, 1e6), "instrument.contact_depth": (-1e-5, 1e-5), "instrument.baseline": None}
    return ul.fit(ul.Problem(bare, problem.curves[0], free))


def test_a_second_optimum_is_said_and_stands_in_the_table():
    fit = ul.fit(ambiguous())
    (other,) = fit.alternatives
    (sentence,) = limits.rivals(fit)
    assert sentence.startswith("A second optimum explains these data as well: layer modulus")
    table = tables.interval_table(fit)
    number = table.loc["layer modulus", "second optimum"].removesuffix(" MPa")
    assert float(number) == pytest.approx(other.values["layer.E"] / 1e6, rel=5e-4)


def test_curves_of_one_scene_are_shown_once_at_the_deepest():
    fit = joint_fit()
    first, second = limits.distinct_scenes(fit.scenes, fit.curves)
    assert (first.label, second.label) == ("curves 1 and 3", "curve 2")
    assert first.scene == fit.scenes[2]
    assert first.reading == fit.curves[2].depth.max()
    assert first.deepest == pytest.approx(1.2e-4 - fit.values["instrument.contact_depth[2]"])
    (alone,) = limits.distinct_scenes(fit.scenes[::2], fit.curves[::2])
    assert alone.label == ""
    assert alone.curves == (1, 2)


# --- the page --------------------------------------------------------------------------------------------


def test_the_page_prints_the_numbers_of_the_fit(fit, tmp_path):
    page = ul.report(fit, tmp_path / "page.html", command="underlay report curve.csv")
    text = page_text(page)
    for name in ("layer.E", "layer.thickness"):
        one = screen.written(fit.answer(name))
        assert (
            f"{one.number} {one.unit} {one.level}: statistical {one.reach}{one.statistical}, "
            f"systematic {one.reach}{one.systematic}" in text
        )
    assert "Good. The model describes the curve" in text
    parts = ("Curve and fit.", "E by depth.", "Uncertainty budget of E.", "Methods paragraph", "The test,")
    assert [part for part in parts if part not in text] == []
    entry = fit.provenance["curves"][0]
    assert f"SHA-256 {entry['file_sha256']}" in text
    assert entry["data_sha256"] in text
    assert "same numbers again: underlay report curve.csv" in text
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_the_methods_paragraph_cites_what_was_used(fit, tmp_path):
    text = page_text(ul.report(fit, tmp_path / "page.html")).partition("Methods paragraph")[2]
    assert "was fitted with the exact solution of the contact problem for a sphere, radius 1 mm" in text
    assert "on a layer bonded to a rigid substrate (underlay" in text
    assert "Poisson's ratio of the layer (0.46) was given" in text
    assert "A half-space (Hertz) model would have given 1.1" in text
    assert "[2] Argatov, I. I. and Sabina, F. J." in text


def test_the_same_fit_gives_the_same_bytes(fit, tmp_path):
    first, second = (ul.report(fit, tmp_path / f"{name}.html").read_bytes() for name in "ab")
    assert first == second


def test_pictures_are_inside_and_nothing_is_fetched_or_run(fit, tmp_path):
    source = ul.report(fit, tmp_path / "page.html").read_text(encoding="utf-8")
    assert source.count("<svg") == 4
    assert len(source) < 600_000
    assert "<metadata" not in source
    assert "default-src 'none'" in source
    assert not re.search(r"<(script|link|iframe|object|embed|form|base|a)\b", source)
    addresses = set(re.findall(r"https?://[^\"'<> ]+", source))
    assert addresses == {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    # Marks are drawn by references within the page: each finds its one picture's own.
    for name in set(re.findall(r'xlink:href="#(\w+)"', source)):
        assert source.count(f'id="{name}"') == 1


def test_what_is_rejected_has_no_uncertainty_and_no_paragraph(tmp_path):
    fit = rejected()
    assert fit.verdict == "reject"
    page = ul.report(fit, tmp_path / "page.html")
    text = page_text(page)
    assert "no uncertainty: the model is rejected" in text
    assert "Likely cause A stiffer base below the layer" in text
    assert "No modulus is reported, because the half-space model does not describe the curve" in text
    assert 'class="num grey"' in page.read_text(encoding="utf-8")
    sheet = text.partition("Parameters and correlations")[0]
    assert "expanded uncertainty" not in sheet
    assert not re.search(r"\d ± \d[\d.]* kPa", text)


def test_every_scene_and_curve_of_a_joint_fit_is_there(tmp_path):
    page = ul.report(joint_fit(), tmp_path / "joint.html")
    text = page_text(page)
    assert "site-1 and 2 more" in text
    assert "3 force-indentation curves were jointly fitted" in text
    # On the sheet four; behind it two more curves, and the other scene.
    assert page.read_text(encoding="utf-8").count("<svg") == 4 + 2 + 1
    assert "Curves 1 and 3" in text
    assert "curve 1 curve 2 curve 3" in text


@pytest.mark.parametrize(
    ("name", "parts", "pictures"),
    [
        ("mach1_relaxation", ("In time.", "Relaxation.", "Instantaneous E0", "Equilibrium"), 5),
        ("sticky_tip_withdrawal", ("Adhesion.", "the tip comes off", "not determined"), 4),
    ],
)
def test_relaxing_and_adhesive_samples_have_their_own_pictures(name, parts, pictures, tmp_path):
    page = ul.report(sample_fit(name), tmp_path / "p.html")
    text = page_text(page)
    assert [part for part in parts if part not in text] == []
    assert page.read_text(encoding="utf-8").count("<svg") >= pictures


def test_segments_of_a_curve_that_comes_back_are_shown(tmp_path):
    problem = ul.load_problem(SAMPLES / "chiaro_cell_indentation.csv", SAMPLES / "chiaro_cell.toml")
    assert "The whole measurement." in page_text(ul.report(ul.fit(problem), tmp_path / "cell.html"))


def test_details_are_folded_or_unfolded(fit, tmp_path):
    folded = ul.report(fit, tmp_path / "a.html").read_text(encoding="utf-8")
    opened = ul.report(fit, tmp_path / "b.html", details=True).read_text(encoding="utf-8")
    assert "<details open>" not in folded
    assert opened.count("<details open>") == folded.count("<details>") > 5


@pytest.mark.parametrize(
    ("what", "match"), [("a result", "of a Fit, a Posterior or a map"), (None, "an HTML or PDF file")]
)
def test_bad_requests(tmp_path, what, match):
    with pytest.raises(ul.InputError, match=match):
        ul.report(what, tmp_path / ("r.html" if what else "r.txt"))


def test_a_pdf_without_a_browser_is_one_clear_line(fit, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(ul.MissingExtraError, match="printed by Chromium or Chrome, and none is installed"):
        ul.report(fit, tmp_path / "page.pdf")
    assert not list(tmp_path.iterdir())


# --- a map ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def map_page(tmp_path_factory):
    number = 6
    table = pd.DataFrame(
        {
            "name": [*(f"s{n}" for n in range(5)), "broken <b>"],
            "path": [f"s{n}.csv" for n in range(number)],
            "x": np.arange(number) % 3 * 1e-3,
            "y": np.arange(number) // 3 * 1e-3,
            "status": [*["fitted"] * 5, "failed"],
            "verdict": [*["good"] * 4, "check", "refused"],
            "reason": [*[""] * 5, "no finite number"],
            "law": "exact",
            "layer.E": [*(1e6 + 1e5 * n for n in range(5)), np.nan],
            "layer.E.stderr": 1e4,
        }
    )
    return table, ul.report(table, tmp_path_factory.mktemp("map") / "map.html")


def test_page_of_a_map_says_what_was_found_and_what_was_not(map_page):
    _, page = map_page
    text = page_text(page)
    assert "6 curves, 5 fitted" in text
    assert "Layer modulus E, median 1.20 MPa middle half of the sites: 1.10 to 1.30 MPa" in text
    assert "4 good, 1 check, 0 reject, 1 without a fit" in text
    assert "broken <b>" in text
    assert "6 force-indentation curves were fitted one by one" in text
    # The map and the histogram; behind them the verdicts.
    source = page.read_text(encoding="utf-8")
    assert (source.count("<svg"), source.count("<img")) == (2, 1)


def test_numbers_of_a_map_are_of_the_curves_that_are_not_rejected(map_page, tmp_path):
    table = map_page[0].assign(verdict=["good", "check", "reject", "reject", "good", "refused"])
    table["layer.E"] = [1e6, 4e6, 1e9, 2e9, 9e6, np.nan]
    lines = " ".join(" ".join(screen.map_lines(table)).split())
    assert "median E = 4.0 MPa, middle half 2.5 to 6.5 MPa (3 curves; 2 rejected are left out)" in lines
    text = page_text(ul.report(table, tmp_path / "map.html"))
    assert (
        "median 4.0 MPa middle half of the sites: 2.5 to 6.5 MPa, 3 curves; 2 rejected are left out" in text
    )


def test_a_map_of_rejected_curves_says_that_it_has_no_number(map_page, tmp_path):
    table = map_page[0].assign(verdict=[*["reject"] * 5, "refused"])
    told = "the model is rejected for 5 curves, and no other has a fit"
    assert f"no number: {told}" in " ".join(" ".join(screen.map_lines(table)).split())
    assert f"Layer modulus E none {told}" in page_text(ul.report(table, tmp_path / "map.html"))
    # One that a person accepted counts.
    accepted = table.assign(decision=["accept", *[""] * 5])
    assert "median E = 1.00 MPa" in " ".join(screen.map_lines(accepted))


def test_a_map_cites_every_work_that_it_lists(map_page):
    text = page_text(map_page[1])
    numbers = set(re.findall(r"\[(\d+)\]", text))
    assert len(numbers) > 1
    for number in numbers:
        assert text.count(f"[{number}]") == 2


def test_a_curve_is_no_map(tmp_path):
    assert not is_map(SAMPLES / "cartilage_on_bone.csv")
    wrong = tmp_path / "x.csv"
    wrong.write_text("name,path,x,y,status,verdict\n")
    assert not is_map(wrong)
    with pytest.raises(ul.FileFormatError, match="no column 'reason'"):
        read_map(wrong)
    wrong.write_text(
        "name,path,status,verdict,reason,cause,layer.E,layer.E.stat.low\na,b,fitted,good,,,1.0,0.9\n"
    )
    with pytest.raises(ul.FileFormatError, match=r"no column 'layer\.E\.stat\.high'"):
        read_map(wrong)
    with pytest.raises(ul.FileAccessError):
        is_map(tmp_path / "none.csv")


# --- where it comes from ---------------------------------------------------------------------------------


def test_the_page_says_which_instrument_recorded_the_curve_and_when(tmp_path):
    curve = ul.read(real_file(real_data.CHIARO))
    told = "Chiaro, V3.5.0, 12/05/2025, 11:20:38"
    assert recorded(curve) == told
    scene = ul.Scene(ul.Paraboloid(27.5e-6), ul.Layer(ul.Isotropic(200.0, 0.5)))
    fit = ul.fit(ul.Problem(scene, curve.loading(), ["layer.E", "instrument.contact_depth"], ul.Noise()))
    assert fit.provenance["curves"][0]["recorded"] == told
    assert told in page_text(ul.report(fit, tmp_path / "page.html"))


def test_the_page_lists_what_speaks_against_a_curve():
    """As the command line and the app do: a paraboloid pressed deep, which no warning of the fit says."""
    scene = ul.Scene(ul.Paraboloid(1e-4), ul.Layer(ul.Isotropic(1e5, 0.4)), None)
    curve = ul.synthesize(scene, np.linspace(-2e-5, 5e-5, 200), ul.Noise(force=1e-6), rng=1)
    curve = curve.with_metadata(notes=("the sign was turned",))
    fit = ul.fit(ul.Problem(scene, curve, {"layer.E": None, "instrument.contact_depth": None}))
    table = tables.reservations_table(fit)
    assert list(table.index)[:2] == ["reading the file", "the curve"]
    assert any("choose the sphere" in text for text in table["reservation"])


def test_the_line_of_written_files_has_their_endings_whatever_the_curve_is_called():
    paths = ["results/relax.fit.csv", "results/relax.relaxation.png"]
    assert screen.written_line(paths, "results", "relax").endswith("results/relax (.fit.csv .relaxation.png)")
