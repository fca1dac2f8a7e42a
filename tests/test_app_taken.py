"""What is shown and taken away is of the test that was fitted, whatever the form says by then."""

import io
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pandas as pd
import pytest

import underlay as ul
from support.analyses import looked_at, silent
from support.page import at_the_fit, page, press, press_until, run, seen, until, wait_for, write
from support.reports import SAMPLES, text_in
from underlay.app import tasks
from underlay.app.folder import AnalysisFolder, keep, kept, stem_of
from underlay.app.form import Draft
from underlay.app.shown import Film, Found, Sampled
from underlay.app.state import Snapshot
from underlay.app.tasks import Analyst


def gel(tmp_path):
    """The folder of an analysis of the gel."""
    return looked_at(tmp_path, "gel_on_glass")[1]


def change(folder):
    """What a hand in the form does: another Poisson's ratio, and so another modulus."""
    draft = Draft.of(folder.scene_text())
    draft.table("layer")["nu"] = 0.4
    folder.write_scene(draft.text())


def fitted_while_the_form_changes(folder, monkeypatch):
    """Fit, with another number in the form before the fit is through."""
    fit = tasks.least_squares_fit

    def meanwhile(problem):
        change(folder)
        return fit(problem)

    monkeypatch.setattr(tasks, "least_squares_fit", meanwhile)
    analyst = Analyst(str(folder.path))
    found = analyst.fit(silent)
    monkeypatch.setattr(tasks, "least_squares_fit", fit)
    return analyst, found


def members(archive):
    with zipfile.ZipFile(io.BytesIO(archive)) as file:
        return {name: file.read(name) for name in file.namelist()}


def run_as_program(path):
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, check=True)
    return done.stdout


def modulus_in(workbook):
    """Of the sheet of results, in kPa."""
    sheets = pd.read_excel(io.BytesIO(workbook), sheet_name=None)
    table = next(sheet for sheet in sheets.values() if "parameter" in sheet.columns)
    return float(table.set_index("parameter")["value"]["layer.E"])


def test_a_form_changed_during_a_fit_does_not_stamp_its_numbers(tmp_path, monkeypatch):
    folder = gel(tmp_path)
    first = Snapshot.now(folder)
    analyst, found = fitted_while_the_form_changes(folder, monkeypatch)
    now = Snapshot.now(folder)
    assert (found.of, found.scene) == (first.of, first.text)
    assert now.of != first.of
    before, is_same = analyst.before(Found, silent)
    assert (before.sheet, is_same) == (found.sheet, False)
    # What is taken away repeats the numbers that are shown, also by a process that did not fit them.
    taken = analyst.taken(silent)
    assert (taken.scene, taken.is_old) == (first.text, True)
    assert members(analyst.archive(silent))["scene.toml"].decode() == first.text
    shown = modulus_in(analyst.excel(silent))
    assert modulus_in(Analyst(str(folder.path)).excel(silent)) == shown
    again = Analyst(str(folder.path))
    again.fit(silent)
    assert modulus_in(again.excel(silent)) != pytest.approx(shown, rel=0.01)
    assert not again.taken(silent).is_old


def test_results_of_another_test_stay_out_of_the_archive(tmp_path):
    folder = gel(tmp_path)
    analyst = Analyst(str(folder.path))
    (folder.results / "gel_on_glass.csv.time.png").write_bytes(b"of a fit before this one")
    found = analyst.fit(silent)
    for kind, name in ((Sampled, "corner.png"), (Film, "film.csv")):
        (folder.results / f"{found.stem}.{name}").write_bytes(b"more")
        keep(folder, found.stem, kind("of another test"))
        assert f"results/{found.stem}.{name}" not in members(analyst.archive(silent))
        keep(folder, found.stem, kind(found.of))
        assert f"results/{found.stem}.{name}" in members(analyst.archive(silent))
    assert f"results/{found.stem}.fit.png" in members(analyst.archive(silent))
    assert f"results/{found.stem}.time.png" not in members(analyst.archive(silent))


def test_nothing_is_taken_away_of_a_curve_that_is_another_by_now(tmp_path):
    folder = gel(tmp_path)
    analyst = Analyst(str(folder.path))
    with pytest.raises(ul.InputError, match="press Fit first"):
        analyst.excel(silent)
    analyst.fit(silent)
    folder.remove_curve("gel_on_glass.csv")
    folder.add_curve("gel_on_glass.csv", (SAMPLES / "gel_on_glass.csv").read_bytes() + b"\n")
    for task in (analyst.excel, analyst.archive, analyst.report):
        with pytest.raises(ul.InputError, match="press Fit again"):
            task(silent)


def test_the_page_says_that_the_form_was_changed_while_it_fitted(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await at_the_fit(user, SAMPLES / "gel_on_glass.csv", "Held")
            press(user, "fit")
            await wait_for((folder.results / "fitted").exists)
            write(user, "contact", 300)
            await wait_for(lambda: "contact_depth =" in folder.scene_text())
            (folder.results / "go").touch()
            await until(user, content="Effects that were considered")
            assert "old" in seen(user)
            press(user, "step-5")
            await until(user, "old-fit")
            (code,) = user.find(marker="fitted-scene").elements
            assert "contact_depth =" not in code.content
            # Another fit is of the form as it is, and says nothing.
            press(user, "step-3")
            await until(user, "sheet")
            (folder.results / "fitted").unlink()
            await press_until(user, "fit", (folder.results / "fitted").exists)
            await until(user, content="Effects that were considered")
            assert "old" not in seen(user)

    run(person())


def test_the_script_prints_and_compares_what_the_page_prints(tmp_path):
    """Of the gel, whose noise nobody stated: page and script print the least-squares value."""
    folder = gel(tmp_path)
    analyst = Analyst(str(folder.path))
    found = analyst.fit(silent)
    with zipfile.ZipFile(io.BytesIO(analyst.archive(silent))) as archive:
        archive.extractall(tmp_path / "taken")
    value, low, high = (float(number) for number in found.values["layer.E"][:3])
    assert analyst._fit[1].values["layer.E"] == pytest.approx(value, rel=1e-9)
    # Without the contact point the model is rejected: the page prints the number alone.
    assert f"{value * 1e-3:.4g} kPa no uncertainty" in text_in(found.sheet)
    program = tmp_path / "taken" / "analysis.py"
    told = run_as_program(program)
    assert f"layer.E {value:.6g} ({low:.6g} to {high:.6g})" in told
    assert set(found.values) == {"layer.E", "instrument.baseline"}
    assert told.count("is as on the page") == 2
    # It compares: of another number it says that it differs.
    program.write_text(program.read_text().replace(found.values["layer.E"][0], "1254.7"))
    told = run_as_program(program)
    assert "layer.E differs from the page" in told
    assert "instrument.baseline is as on the page" in told


def test_the_script_of_a_curve_without_a_fit_compares_nothing(tmp_path):
    taken = Analyst(str(gel(tmp_path).path)).taken(silent)
    assert "fit.answer(name)" in taken.script
    assert "page" not in taken.script.split("import", 1)[1]


def test_files_of_one_name_but_for_their_endings_have_results_of_their_own(tmp_path):
    folder = gel(tmp_path)
    content = (folder.curves / "gel_on_glass.csv").read_bytes()
    other = folder.add_curve("gel_on_glass.txt", b"# the same again\n" + content)
    first = Analyst(str(folder.path)).fit(silent)
    kept_files = {path.name: path.read_bytes() for path in folder.results.iterdir()}
    draft = Draft.of(folder.scene_text())
    draft.table("curve")["file"] = f"curves/{other.name}"
    folder.write_scene(draft.text())
    analyst = Analyst(str(folder.path))
    assert analyst.before(Found, silent) == (None, False)
    second = analyst.fit(silent)
    assert (first.stem, second.stem) == ("gel_on_glass.csv", "gel_on_glass.txt")
    assert {name: (folder.results / name).read_bytes() for name in kept_files} == kept_files
    taken = members(analyst.archive(silent))
    assert "results/gel_on_glass.txt.fit.csv" in taken
    assert not [name for name in taken if name.startswith("results/gel_on_glass.csv")]


def test_long_names_keep_their_results_apart(tmp_path):
    folder = AnalysisFolder(tmp_path / "one")
    names = [folder.add_curve("\u6e2c" * 300 + ".csv", content).name for content in (b"1", b"2")]
    stems = [stem_of(name, test) for name in names for test in (None, 2, "2.csv")]
    for number, stem in enumerate(stems):
        for kind in (Sampled, Film):
            keep(folder, stem, kind(f"of {number}"))
    told = [kept(folder, stem, kind).of for stem in stems for kind in (Sampled, Film)]
    assert told == [f"of {number}" for number in range(len(stems)) for _ in range(2)]


@pytest.mark.parametrize("name", ["../scene.toml", "/etc/passwd", "a\\b", ".hidden", ""])
def test_no_result_is_read_from_elsewhere(tmp_path, name):
    folder = gel(tmp_path)
    with pytest.raises(ul.InputError, match="plain name"):
        folder.read_result(name)


@pytest.mark.parametrize("where", ["absolute", "relative"])
def test_the_archive_names_its_files_by_their_places_in_it(tmp_path, monkeypatch, where):
    folder = gel(tmp_path)
    if where == "relative":
        monkeypatch.chdir(tmp_path)
        folder = AnalysisFolder(Path("one"))
    analyst = Analyst(str(folder.path))
    stem = analyst.fit(silent).stem
    taken = members(analyst.archive(silent))
    here = str(tmp_path).encode()
    assert here in (folder.results / f"{stem}.fit.json").read_bytes() or where == "relative"
    assert not [name for name, content in taken.items() if here in content or b"one/curves" in content]
    record = json.loads(taken[f"results/{stem}.fit.json"])["provenance"]["curves"][0]
    assert (record["path"], record["scene_path"]) == ("curves/gel_on_glass.csv", "scene.toml")
    table = pd.read_csv(io.BytesIO(taken[f"results/{stem}.fit.csv"]))
    assert set(table["file"]) == {"curves/gel_on_glass.csv"}
    (root,) = [part for part in json.loads(taken["ro-crate-metadata.json"])["@graph"] if part["@id"] == "./"]
    assert (
        {"curves/gel_on_glass.csv", "scene.toml"}
        <= {part["@id"] for part in root["hasPart"]}
        == {*taken} - {"ro-crate-metadata.json"}
    )


def test_the_table_of_all_curves_says_the_test_that_was_fitted_and_the_page_that_it_is_another_now(tmp_path):
    folder = gel(tmp_path)
    analyst = Analyst(str(folder.path))
    assert not analyst.taken(silent).is_map_old
    analyst.fit_all(silent)
    assert not analyst.taken(silent).is_map_old
    change(folder)
    assert analyst.taken(silent).is_map_old
    assert analyst.overview(silent).is_old
    sheets = pd.read_excel(io.BytesIO(analyst.excel_of_all(silent)), sheet_name=None, header=None)
    said_in_it = " ".join(str(cell) for sheet in sheets.values() for cell in sheet.to_numpy().ravel())
    assert "nu = 0.5" in said_in_it
    assert "nu = 0.4" not in said_in_it
