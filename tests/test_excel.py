"""Excel files: what is in them, read back by another library; and that nothing in them acts."""

import io
import sys
import zipfile

import numpy as np
import openpyxl
import pandas as pd
import pytest

import underlay as ul
from support.inverse import layer_on, measured
from underlay.report.excel import MOST_ROWS, excel_sheets, result_rows, workbook
from underlay.scene.scene_file import scene_from_text

#: Excel files hold sixteen digits.
DIGITS = 1e-15
HOSTILE = ("=1+1", "+cmd|'/C calc'!A0", "@SUM(A1)", "{=A1}", "http://a.org", "internal:A1", "a\x00\x0bb")


def read_back(content):
    """Cells of every sheet by name, the header first."""
    book = openpyxl.load_workbook(io.BytesIO(content))
    return {sheet.title: [[cell.value for cell in row] for row in sheet.iter_rows()] for sheet in book}


def as_table(rows):
    return pd.DataFrame(rows[1:], columns=rows[0])


@pytest.fixture(scope="module")
def fit():
    scene = layer_on(ul.RIGID)
    curve = measured(scene).with_metadata(name="=HYPERLINK(1)", path="a.csv", sha256="ab" * 32)
    free = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-2e-5, 4e-5), "instrument.baseline": None}
    return ul.fit(ul.Problem(scene, curve, free, noise=ul.Noise()))


def test_a_fit_is_read_back_with_every_number(fit, tmp_path):
    written = ul.write_excel(tmp_path / "fit.xlsx", fit, ul.pointwise_modulus(fit), settings={"by": "me"})
    sheets = read_back(written.read_bytes())
    assert list(sheets) == ["results", "settings", "curves", "depths"]
    results = as_table(sheets["results"]).set_index("parameter")
    known = fit.interval("layer.E")
    row = results.loc["layer.E"]
    assert row["unit"] == "MPa"
    assert [row["value"] * 1e6, row["low"] * 1e6, row["high"] * 1e6] == pytest.approx(
        [known.value, known.low, known.high], rel=DIGITS
    )
    assert row["verdict"] == fit.verdict.word
    contact = fit.interval("instrument.contact_depth")
    assert row["contact point (m)"] == pytest.approx(contact.value, rel=DIGITS)
    assert row["contact point low (m)"] == pytest.approx(contact.low, rel=DIGITS)
    assert (row["thickness (m)"], row["radius (m)"], row["points"]) == (5e-4, 1e-3, 300)
    assert (row["fitted from (m)"], row["fitted to (m)"]) == (-3e-5, 1.5e-4)
    curves = as_table(sheets["curves"])
    np.testing.assert_allclose(curves["force (N)"], fit.curves[0].force, rtol=DIGITS)
    np.testing.assert_allclose(curves["residual (N)"], fit.residuals[0], rtol=DIGITS)
    assert sheets["settings"][1] == ["by", "me"]


def test_the_settings_repeat_the_fit(fit):
    settings = as_table(read_back(workbook(excel_sheets(fit)))["settings"])
    lines = settings[settings["setting"].str.startswith("scene file")]["value"]
    again = scene_from_text("\n".join(lines))
    assert again.parameters == fit.problem.base_scenes[0].parameters
    words = dict(zip(settings["setting"], settings["value"], strict=True))
    assert words["free: layer.E"] == repr(fit.problem.priors["layer.E"])
    assert words["solver"].startswith("auto")
    assert words["curve: file_sha256"] == "ab" * 32


def test_the_csv_holds_the_same_rows(fit):
    sheet = as_table(read_back(workbook(excel_sheets(fit)))["results"])
    rows = result_rows(fit)
    assert list(sheet) == list(rows)
    np.testing.assert_allclose(sheet["value"].to_numpy(float), rows["value"], rtol=DIGITS)


def test_a_shared_parameter_says_what_its_curves_have_in_common():
    scenes = [layer_on(ul.RIGID), layer_on(ul.RIGID, indenter=ul.Paraboloid(2e-3))]
    tests = [(scene, measured(scene, rng=n)) for n, scene in enumerate(scenes)]
    free = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-2e-5, 4e-5)}
    joint = ul.fit(ul.Problem.joint(tests, free, ["layer.E"], noise=ul.Noise()))
    rows = result_rows(joint).set_index("parameter")
    assert rows.loc["layer.E", "thickness (m)"] == 5e-4
    assert np.isnan(rows.loc["layer.E", "radius (m)"])
    assert rows.loc["instrument.contact_depth[1]", "radius (m)"] == 2e-3


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_becomes_a_formula_or_a_link(text):
    content = workbook({"results": pd.DataFrame({text: [text, 1.0], "n": [1, 2]})})
    shown = text if text.isprintable() else "a\\x00\\x0bb"
    cells = read_back(content)["results"]
    assert [row[0] for row in cells] == [shown, shown, 1]
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        sheet = archive.read("xl/worksheets/sheet1.xml").decode()
        assert "<f>" not in sheet
        assert "hyperlink" not in sheet.lower()
        assert not [name for name in archive.namelist() if "_rels/sheet" in name]


def test_what_is_not_finite_is_open_or_empty():
    table = pd.DataFrame({"x": [np.inf, -np.inf, np.nan, 1.5], "y": [None, pd.NA, True, np.int64(7)]})
    cells = read_back(workbook({"a": table}))["a"]
    assert [row[0] for row in cells[1:]] == ["open", "open", None, 1.5]
    assert [row[1] for row in cells[1:]] == [None, None, True, 7]


def test_a_text_longer_than_a_cell_is_cut():
    cells = read_back(workbook({"a": pd.DataFrame({"x": ["z" * 40_000]})}))["a"]
    assert len(cells[1][0]) == 32_767
    assert cells[1][0].endswith("\N{HORIZONTAL ELLIPSIS}")


def test_a_map_and_its_groups():
    modulus = 1e6 * np.exp(0.2 * np.random.default_rng(0).standard_normal(12))
    table = pd.DataFrame({"name": [f"c{n}" for n in range(12)], "layer.E": modulus, "layer.E.stderr": 1e4})
    table["path"] = table["name"] + ".csv"
    table = table.assign(status="fitted", verdict="good", reason="")
    table = table.assign(animal=["a0", "a1", "a2"] * 4, group=["ctl", "ctl", "oa"] * 4)
    found = ul.population(table, by=["animal"], group="group")
    sheets = read_back(workbook(excel_sheets(table, found)))
    assert list(sheets) == ["results", "settings", "curves", "groups", "ratios"]
    groups = as_table(sheets["groups"]).set_index("group")
    assert groups.loc["oa", "mean"] == pytest.approx(found.groups["oa"].mean, rel=DIGITS)
    assert len(sheets["results"]) == 13


def test_bad_requests(fit, tmp_path, monkeypatch):
    with pytest.raises(ul.InputError, match=r"ends in \.xlsx"):
        ul.write_excel(tmp_path / "fit.xls", fit)
    for results in ((), (1.0,), (fit, pd.DataFrame({"a": [1]})), (pd.DataFrame({"a": [1]}),)):
        with pytest.raises(ul.InputError, match=r"Excel file holds|no table of a map"):
            excel_sheets(*results)
    with pytest.raises(ul.InputError, match="write CSV"):
        workbook({"a": pd.DataFrame({"x": np.zeros(MOST_ROWS + 1)})})
    monkeypatch.setitem(sys.modules, "xlsxwriter", None)
    with pytest.raises(ul.MissingExtraError, match=r"pip install '\.\[excel\]'"):
        ul.write_excel(tmp_path / "fit.xlsx", fit)
    assert not list(tmp_path.iterdir())


def test_what_is_fitted_of_a_curve_is_one_number_in_its_row():
    """The columns that say what a curve was of hold the value beside them where that was fitted."""
    scene = layer_on(ul.RIGID)
    curve = measured(scene, correlation_time=0.02)
    found = ul.fit(ul.Problem(scene, curve, ["layer.E", "layer.thickness", "instrument.contact_depth"]))
    rows = result_rows(found).set_index("parameter")
    stated = found.interval("layer.thickness").value
    assert stated == found.values["layer.thickness"]
    assert rows["thickness (m)"].to_list() == [stated] * len(rows)
