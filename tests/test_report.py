"""Reports: what the page says is what the fit found, and the notebook beside it says it again."""

import builtins
import re
import sys
from dataclasses import replace

import nbformat
import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support import real_data
from support.inverse import ambiguous
from support.real_data import real_file
from support.reports import SAMPLES, cells_of, joint_fit, page_text, small_posterior
from underlay.data.curve import recorded
from underlay.inference.priors import Truncated
from underlay.inference.profiling.profile_result import Interval
from underlay.report import labels, maps, tables, words
from underlay.report import limits as open_ends
from underlay.report.intervals import Estimate, estimates, wide_interval
from underlay.report.limits import distinct_scenes
from underlay.report.notebook import execute, filled, html_page, make_notebook
from underlay.report.posterior_tables import _span
from underlay.report.render import _exact_csv, problem_source, write_inputs

# --- words -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "low", "high", "kind", "text"),
    [
        (4.2e5, 4.0e5, 4.4e5, "pressure", "0.420 MPa (0.400 to 0.440)"),
        (1.5e-3, 1.1e-3, 2.2e-3, "length", "1.50 mm (1.10 to 2.20)"),
        (1.5e-3, 1.1e-3, np.inf, "length", "1.50 mm (at least 1.10)"),
        (0.45, -np.inf, 0.47, "dimensionless", "0.450 (at most 0.470)"),
        (1.0, -np.inf, np.inf, "force", "1.0000 N"),
        # An end near zero is not read as zero.
        (138.3, 4.787, 567.1, "pressure", "0.138 kPa (0.005 to 0.567)"),
        (5.88e11, 7.6e5, np.inf, "pressure", "588 GPa (at least 0.76 MPa)"),
        (1.2e-9, 0.0, 3e-9, "force", "1.2 nN (0.0 to 3.0)"),
    ],
)
def test_interval_in_words(value, low, high, kind, text):
    assert words.quantity_with_interval(value, low, high, kind) == text


def wide(value, noise, model):
    return Estimate("layer.E", "layer.E", value, *noise, "profile", "", *model, ("friction",))


@pytest.mark.parametrize(
    ("noise", "model", "text"),
    [
        # As many digits as the nearer of its own ends needs: 1.1 would look narrower than 1.09.
        ((1.09e6, 2.24e6), (1.083e6, 2.31e6), "1.08 to 2.31"),
        # More of them where rounding would turn two ends about that are nearly the same.
        ((1.0953e6, 1.4023e6), (1.0951e6, 2.2e6), "1.095 to 2.200"),
        ((1.39e6, 1.41e6), (0.5e6, 2.2e6), "0.50 to 2.20"),
        ((1.09e6, 2.24e6), (1.09e6, np.inf), "at least 1.09"),
        ((1.09e6, 2.24e6), (-np.inf, 2.31e6), "at most 2.31"),
        ((1.09e6, 2.24e6), (-np.inf, np.inf), ""),
    ],
)
def test_the_wider_interval_looks_wider(noise, model, text):
    assert wide_interval(wide(1.4e6, noise, model), "pressure") == text


def test_no_rounding_makes_the_wider_interval_the_narrower():
    rng = np.random.default_rng(1)
    for _ in range(2000):
        value = np.exp(rng.normal(0.0, 5.0))
        away = value * np.exp(rng.uniform(-9.0, 1.0, 2))
        more = away * (1.0 + np.exp(rng.uniform(-8.0, 3.0, 2)) * (rng.random(2) < 0.8))
        noise, model = ((value - ends[0], value + ends[1]) for ends in (away, more))
        text = words.quantity_with_interval(value, *noise, "dimensionless")
        own, wider = text.partition("(")[2][:-1], wide_interval(wide(value, noise, model), "dimensionless")
        low, high = map(float, own.split(" to "))
        wide_low, wide_high = map(float, wider.split(" to "))
        assert wide_low <= low <= high <= wide_high, (text, wider)


def test_ends_that_are_close_are_told_apart():
    interval = Interval("layer.E", 0.95, 1.00012e6, 1.00038e6, "data", "data")
    assert str(interval) == "layer.E between 1.00012 MPa and 1.00038 MPa (95 %)"
    assert _span(1.00012e6, 1.00038e6, "pressure") == "1.00012 to 1.00038 MPa"


def test_names_for_people():
    assert labels.label("layer.E") == "layer modulus"
    assert labels.label("layer.E[1]") == "layer modulus (curve 2)"
    assert labels.label("indenter.tilt") == "indenter.tilt"


def cartilage(**changes):
    problem = ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml")
    return problem.revised(**changes) if changes else problem


def test_headline_holds_the_truth_of_a_made_curve():
    fit = ul.fit(cartilage())
    text = words.headline(fit)
    noise = r"\(([\d.]+) to ([\d.]+) from the noise; "
    model = r"with friction and finite strain unknown ([\d.]+) to ([\d.]+), 95 %\)\. Layer thickness "
    found = re.match(r"Layer modulus [\d.]+ MPa " + noise + model, text)
    assert found, text
    low, high, wide_low, wide_high = map(float, found.groups())
    # In print an end of both may be the same number: the ends themselves are not.
    assert wide_low <= low < 0.62 < high <= wide_high
    known, wide = (fit.interval("layer.E", model_error=word) for word in (False, True))
    assert wide.low < known.low < 0.62e6 < known.high < wide.high


def test_every_place_prints_the_interval_of_the_fit():
    fit = ul.fit(cartilage())
    known = fit.interval("layer.E")
    entry = next(row for row in estimates(fit) if row.name == "layer.E")
    assert (entry.low, entry.high) == (known.low, known.high)
    row = tables.fit_table(fit).set_index("parameter").loc["layer.E"]
    assert (row["low"], row["high"]) == pytest.approx((known.low / 1e6, known.high / 1e6), rel=1e-12)
    text = words.quantity_with_interval(known.value, known.low, known.high, "pressure")
    assert text in tables.interval_table(fit).to_string()
    assert text[:-1] in words.headline(fit)
    assert text[:-1] in words.summary(fit)


def test_what_is_not_fixed_is_said_to_be_not_fixed():
    # A thick layer barely touched: its thickness has no upper end.
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 5e-3), ul.RIGID)
    depth = np.linspace(-5e-6, 2e-5, 200)
    curve = ul.synthesize(scene, depth, noise=ul.Noise(force=3e-5), rng=1)
    fit = ul.fit(ul.Problem(scene, curve, free={"layer.E": None, "layer.thickness": (1e-4, 1.0)}))
    walk = ul.profile(fit, "layer.thickness")
    assert walk.interval().high_reason != "data"
    text = words.summary(fit)
    assert "Layer thickness is more than" in text or "Layer thickness is not fixed by this test" in text


def test_intervals_that_are_too_narrow_are_said_to_be():
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)))
    noise = ul.Noise(force=1e-3, correlation_time=0.1)
    curve = ul.synthesize(scene, np.linspace(0, 1e-4, 400), noise=noise, rng=3, time=np.linspace(0, 4, 400))
    fit = ul.fit(ul.Problem(scene, curve, free=["layer.E"], noise=ul.Noise(force=1e-3)))
    assert "intervals above are too narrow" in words.summary(fit)


def test_a_second_optimum_stands_beside_the_headline():
    fit = ul.fit(ambiguous())
    (other,) = fit.alternatives
    (sentence,) = open_ends.rivals(fit)
    numbers = re.fullmatch(
        r"A second optimum explains these data as well: layer modulus ([\d.]+) MPa, layer thickness ([\d.]+) mm; "
        r"chi-square higher by ([\d.]+)\. The intervals above (reach over it too|stop short of it); "
        r"ul\.profile\(fit, name, calibrate=99\) says how far they can be trusted\.",
        sentence,
    )
    assert numbers, sentence
    # As many digits as are shown: four of the parameters, two of the rise.
    assert float(numbers[1]) == pytest.approx(other.values["layer.E"] / 1e6, rel=5e-4)
    assert float(numbers[2]) == pytest.approx(other.values["layer.thickness"] / 1e-3, rel=5e-4)
    assert float(numbers[3]) == pytest.approx(other.delta_chi_square, rel=0.05)
    summary = words.summary(fit)
    assert summary.startswith("**Layer modulus")
    assert sentence in summary
    inside = [other.values[name] in fit.interval(name) for name in ("layer.E", "layer.thickness")]
    assert numbers[4] == ("reach over it too" if all(inside) else "stop short of it")
    table = tables.interval_table(fit)
    assert table.loc["layer modulus", "second optimum"] == f"{numbers[1]} MPa"


def test_an_optimum_the_data_nearly_reject_is_said_to_be_that():
    fit = ul.fit(ambiguous())
    # 3.9 is the 95 % threshold of F(1, 197).
    far, near = (replace(fit.alternatives[0], delta_chi_square=rise) for rise in (5.0, 3.8))
    first, second = open_ends.rivals(replace(fit, alternatives=(near, far)))
    assert first.startswith("A second optimum explains these data as well")
    assert second.startswith("A third optimum explains these data nearly as well")
    assert "higher by 5." in second
    assert open_ends.rivals(ul.fit(cartilage())) == []
    assert not [name for name in tables.interval_table(ul.fit(cartilage())) if "optimum" in name]


def test_summary_of_a_joint_fit_covers_every_curve():
    fit = joint_fit()
    ratios, depths = [], []
    for scene, curve in zip(fit.scenes, fit.curves, strict=True):
        deepest = curve.depth.max() - scene.instrument.contact_depth
        bare = scene.contact_law(deepest, solver="halfspace")
        ratios.append(float(scene.contact_law(deepest).force(deepest) / bare.force(deepest)))
        depths.append(deepest)
    text = words.summary(fit)
    # The first curve is of the scene of the third, which goes deeper.
    assert f"({min(depths[1:]) / 1e-3:.4g} to {max(depths) / 1e-3:.4g} mm into the sample" in text
    assert f"the force is {min(ratios[1:]):.3g} to {max(ratios):.3g} times" in text


def test_curves_of_one_scene_are_shown_once_at_the_deepest():
    fit = joint_fit()
    first, second = distinct_scenes(fit.scenes, fit.curves)
    assert (first.label, second.label) == ("curves 1 and 3", "curve 2")
    assert first.scene == fit.scenes[2]
    assert first.reading == fit.curves[2].depth.max()
    assert first.deepest == pytest.approx(1.2e-4 - fit.values["instrument.contact_depth[2]"])
    (alone,) = distinct_scenes(fit.scenes[::2], fit.curves[::2])
    assert alone.label == ""
    assert alone.curves == (1, 2)


# --- a problem as files and source -----------------------------------------------------------------------


def rebuilt(problem, folder):
    files = write_inputs(problem, folder)
    source = problem_source(problem, [str(file) for file in files])
    names = {"ul": ul}
    exec(source, names)  # noqa: S102  the source is what is tested
    return names["problem"]


def test_source_states_the_same_problem(tmp_path):
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.3e-3), ul.Isotropic(1e9, 0.3))
    curve = ul.synthesize(scene, np.linspace(0, 1e-4, 50), noise=ul.Noise(force=1e-4), rng=0)
    free = {
        "layer.E": ul.LogUniform(1e4, 1e8),
        "layer.thickness": Truncated(ul.Normal(1.3e-3, 1e-4), low=1e-4),
        "instrument.contact_depth": (-1e-5, 1e-5),
        "instrument.baseline": None,
    }
    first = ul.Problem(scene, curve, free, ul.Noise(force=1e-4, depth=1e-8), solver=ul.Exact(1e-4))
    second = rebuilt(first, tmp_path)
    assert second.names == first.names
    assert second.priors == first.priors
    assert second.noise == first.noise
    assert second.solver == first.solver
    assert second.base_scenes == first.base_scenes
    assert (second.curves[0].force == first.curves[0].force).all()
    at = first.start + 0.01
    assert second.log_posterior(at) == first.log_posterior(at)


def test_source_states_the_same_joint_problem(tmp_path):
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), 1.3e-3)
    tests = []
    for radius in (5e-4, 2e-3):
        scene = ul.Scene(ul.Sphere(radius), layer, ul.RIGID)
        tests.append(
            (scene, ul.synthesize(scene, np.linspace(0, 1e-4, 40), noise=ul.Noise(force=1e-4), rng=2))
        )
    first = ul.Problem.joint(
        tests, {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-1e-5, 1e-5)}, shared=["layer.E"]
    )
    second = rebuilt(first, tmp_path)
    assert second.names == first.names
    assert second.shared == first.shared
    assert second.log_posterior(first.start) == first.log_posterior(first.start)


# --- a map ----------------------------------------------------------------------------------------------


OF_OUR_OWN = """
## Stiffest site

```python
stiffest = table.loc[table["layer.E"].idxmax(), "name"]
f"{stiffest} of {len(table)} rows"
```
"""


@pytest.fixture(scope="module")
def map_page(tmp_path_factory):
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3), ul.RIGID)
    depth = np.linspace(-1e-5, 5e-5, 60)
    curves = [
        ul.synthesize(scene.with_values({"layer.E": 1e6 + 1e5 * n}), depth, ul.Noise(force=1e-4), rng=n)
        for n in range(5)
    ]
    curves.append(ul.Curve(depth, np.full(60, np.nan), metadata={"name": "broken <b>"}))
    curves = [
        curve.with_metadata(name=curve.metadata.get("name") or f"s{n}") for n, curve in enumerate(curves)
    ]
    manifest = pd.DataFrame(
        {
            "file": [c.metadata["name"] for c in curves],
            "x": np.arange(6) % 3 * 1e-3,
            "y": np.arange(6) // 3 * 1e-3,
        }
    )
    table = ul.fit_many(curves, scene, {"layer.E": (1e4, 1e8)}, manifest, workers=0)
    folder = tmp_path_factory.mktemp("map")
    return table, ul.report(table, folder / "map.html", sections=[OF_OUR_OWN])


def test_a_section_of_our_own_ends_the_page(map_page):
    _, page = map_page
    text = page_text(page)
    assert text.index("Stiffest site") > text.index("5 of 6 curves were fitted")
    assert "s4 of 6 rows" in text[text.index("Stiffest site") :]
    assert "stiffest = table" in page.with_suffix(".ipynb").read_text()


def test_page_of_a_map_says_what_was_found_and_what_was_not(map_page):
    _, page = map_page
    text = page_text(page)
    assert "5 of 6 curves were fitted" in text
    assert "Layer modulus 1.2" in text
    assert "broken <b>" in text
    assert "NaN" in text or "nan" in text
    assert page.read_text().count("<img") == 4  # modulus, its error, verdicts, histogram


def test_map_reads_back_and_a_curve_is_no_map(map_page, tmp_path):
    table, page = map_page
    kept = page.parent / "map.inputs" / "map.csv"
    assert maps.is_map(kept)
    np.testing.assert_allclose(maps.read_map(kept)["layer.E"], table["layer.E"], rtol=1e-15)
    assert not maps.is_map(SAMPLES / "cartilage_on_bone.csv")
    wrong = tmp_path / "x.csv"
    wrong.write_text("name,path,x,y,status,verdict\n")
    assert not maps.is_map(wrong)
    with pytest.raises(ul.FileFormatError, match="no column 'reason'"):
        maps.read_map(wrong)
    with pytest.raises(ul.FileAccessError):
        maps.is_map(tmp_path / "none.csv")


# --- the page and its notebook ---------------------------------------------------------------------------


def test_segments_of_a_curve_that_comes_back_are_shown(tmp_path):
    problem = ul.load_problem(SAMPLES / "chiaro_cell_indentation.csv", SAMPLES / "chiaro_cell.toml")
    page = ul.report(ul.fit(problem), tmp_path / "cell.html")
    assert "where the tip goes in, rests and comes back" in page_text(page)
    kept = ul.read(tmp_path / "cell.inputs" / "measured-1.csv")
    whole = ul.read(SAMPLES / "chiaro_cell_indentation.csv")
    np.testing.assert_array_equal(kept.depth, whole.depth)
    np.testing.assert_array_equal(kept.segments(), whole.segments())
    (cell,) = [cell for cell in cells_of(page.with_suffix(".ipynb")) if "segments" in "".join(cell["source"])]
    assert any("image/png" in output.get("data", {}) for output in cell["outputs"])


def test_report_of_a_joint_posterior_shows_every_scene(tmp_path):
    joint = joint_fit()
    free = {
        "layer.E": ul.LogUniform(1e4, 1e8),
        "layer.thickness": ul.LogUniform(1e-4, 1e-2),
        "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5),
    }
    problem = joint.problem.revised(free=free, noise=ul.Noise(force=1e-4))
    posterior = ul.sample(problem, walkers=16, max_steps=100, rng=0, method="importance")
    page = ul.report(posterior, tmp_path / "joint.html")
    # The corner, the band of every curve, the drawing of every scene.
    assert page.read_text().count("<img") == 1 + 3 + 2
    text = page_text(page)
    assert "quantity curve 1 curve 2 curve 3" in text
    for entry in posterior.provenance["curves"]:
        assert entry["data_sha256"] in text


def test_report_of_another_problem_is_refused(tmp_path):
    _, posterior = small_posterior()
    with pytest.raises(ul.InputError, match="the problem frees"):
        ul.report(posterior, tmp_path / "x.html", problem=cartilage())


@pytest.mark.parametrize(
    ("what", "match"), [("a result", "of a Fit, a Posterior or a map"), (None, "HTML file")]
)
def test_bad_requests(tmp_path, what, match):
    with pytest.raises(ul.InputError, match=match):
        ul.report(what, tmp_path / ("r.html" if what else "r.pdf"))


def test_without_the_extra_it_says_what_to_install(tmp_path, monkeypatch):
    real = builtins.__import__

    def missing(name, *rest, **named):
        if name.startswith(("nbclient", "nbformat", "nbconvert")):
            raise ImportError(name)
        return real(name, *rest, **named)

    for name in [name for name in sys.modules if name.startswith(("nbclient", "nbformat", "nbconvert"))]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(ul.MissingExtraError, match=r"pip install '\.\[report\]'"):
        ul.report(ul.fit(cartilage()), tmp_path / "r.html")


def test_a_failing_cell_is_one_clear_line(tmp_path):
    notebook = make_notebook(filled("posterior_scene", {}), "x")
    with pytest.raises(ul.FitError, match=r"the notebook of the report stopped: NameError"):
        execute(notebook, tmp_path)


def test_markup_in_names_is_text_on_the_page():
    evil = "<script>alert(1)</script><img src=http://example.com/x.png onerror=alert(1)>"
    table = f"<table><tr><td>{evil}</td></tr></table>"
    outputs = [
        nbformat.v4.new_output("execute_result", {"text/html": table}),
        nbformat.v4.new_output("execute_result", {"text/markdown": evil}),
        nbformat.v4.new_output("execute_result", {"text/plain": evil}),
        nbformat.v4.new_output("stream", text=evil),
    ]
    cells = [nbformat.v4.new_code_cell(evil, outputs=outputs), nbformat.v4.new_markdown_cell(evil)]
    page = html_page(nbformat.v4.new_notebook(cells=cells, metadata={"title": evil}))
    assert "<script" not in page
    assert "<img" not in page
    assert "<td>" in page


def test_the_page_says_which_instrument_recorded_the_curve_and_when(tmp_path):
    """Also when it is made from a copy of the curve, whose file has no header of an instrument."""
    curve = ul.read(real_file(real_data.CHIARO))
    told = "Chiaro, V3.5.0, 12/05/2025, 11:20:38"
    assert recorded(curve) == told
    copy = tmp_path / "copy.csv"
    copy.write_text(_exact_csv(curve.loading()), encoding="utf-8")
    again = ul.read(copy)
    assert recorded(again) == told
    scene = ul.Scene(ul.Paraboloid(27.5e-6), ul.Layer(ul.Isotropic(200.0, 0.5)))
    fit = ul.fit(ul.Problem(scene, again, ["layer.E", "instrument.contact_depth"], ul.Noise()))
    assert fit.provenance["curves"][0]["recorded"] == told
    assert told in tables.provenance_table(fit, {}).to_string()


def test_the_page_lists_what_speaks_against_a_curve_and_counts_it():
    """As the command line and the app do: a paraboloid pressed deep, which no warning of the fit says."""
    scene = ul.Scene(ul.Paraboloid(1e-4), ul.Layer(ul.Isotropic(1e5, 0.4)), None)
    curve = ul.synthesize(scene, np.linspace(-2e-5, 5e-5, 200), ul.Noise(force=1e-6), rng=1)
    curve = curve.with_metadata(notes=("the sign was turned",))
    fit = ul.fit(ul.Problem(scene, curve, {"layer.E": None, "instrument.contact_depth": None}))
    table = tables.reservations_table(fit)
    assert list(table.index)[:2] == ["reading the file", "the curve"]
    assert any("use the sphere" in text for text in table["reservation"])
    assert f"There are {len(table)} reservations, listed below." in words.summary(fit)
