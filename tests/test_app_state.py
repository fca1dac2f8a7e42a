"""What is said of the depths of one curve is of no other: contact point, its bounds, and the range."""

from pathlib import Path

import pytest

import underlay as ul
from support.page import begin, bring, page, press, run, text_of, until, wait_for
from underlay.app.folder import AnalysisFolder
from underlay.app.form import Draft
from underlay.app.many import _scene_of_all
from underlay.app.state import OpenAnalysis, Snapshot
from underlay.app.tasks import Analyst
from underlay.scene.scene_file import read_scene_file

SAMPLES = Path(__file__).parents[1] / "data_samples"
CONTACT = "instrument.contact_depth"


def two_curves(tmp_path):
    """An analysis that looks at the first of two curves, with all that can be said of its depths."""
    folder = AnalysisFolder(tmp_path / "one")
    for name, sample in (("a.csv", "cartilage_on_bone.csv"), ("b.csv", "gel_on_glass.csv")):
        folder.add_curve(name, (SAMPLES / sample).read_bytes())
    analysis = OpenAnalysis(folder)
    analysis.pick("a.csv")
    analysis.draft.table("layer").update(nu="0.45", thickness="1 mm")
    analysis.draft.table("instrument")["contact_depth"] = "10 um"
    analysis.draft.table("curve").update(min_depth="-20 um", max_depth="200 um", fit_to="90 % of force")
    analysis.draft.free[CONTACT] = {"min": "-40 um", "max": "300 um"}
    analysis.keep()
    return analysis


def said_of_depths(analysis):
    draft = Draft.of(analysis.folder.scene_text())
    keys = [("instrument", "contact_depth"), ("curve", "min_depth"), ("curve", "max_depth")]
    return [draft.get(section, key) for section, key in keys], draft.free.get(CONTACT)


def test_another_curve_takes_over_no_depth_and_the_first_has_its_own_again(tmp_path):
    analysis = two_curves(tmp_path)
    first = Snapshot.now(analysis.folder).of
    analysis.pick("b.csv")
    assert Snapshot.now(analysis.folder).of != first
    assert said_of_depths(analysis) == (["", "", ""], {})
    assert read_scene_file(analysis.folder.scene).curve["fit_to"] == "90 % of force"
    analysis.draft.free[CONTACT] = {"min": "-1 um", "max": "2 um"}
    analysis.pick("a.csv")
    assert Snapshot.now(analysis.folder).of == first
    analysis.pick("a.csv")
    assert Snapshot.now(analysis.folder).of == first
    analysis.pick("b.csv")
    assert said_of_depths(analysis) == (["", "", ""], {"min": "-1 um", "max": "2 um"})


@pytest.mark.parametrize("looked_at", ["a.csv", "b.csv"])
def test_a_file_that_is_brought_under_a_name_that_was_removed_is_another_curve(tmp_path, looked_at):
    analysis = two_curves(tmp_path)
    analysis.pick(looked_at)
    analysis.remove("a.csv")
    analysis.folder.add_curve("a.csv", (SAMPLES / "gel_on_glass.csv").read_bytes())
    analysis.pick("a.csv")
    assert said_of_depths(analysis)[0] == ["", "", ""]
    assert not said_of_depths(analysis)[1]


def test_the_fit_of_all_curves_has_the_depths_of_none(tmp_path):
    analysis = two_curves(tmp_path)
    draft = Draft.of(_scene_of_all(analysis.folder))
    assert draft.free[CONTACT] == {}
    assert not {"min_depth", "max_depth"} & set(draft.peek("curve"))
    assert "contact_depth" not in draft.peek("instrument")


def test_each_curve_is_fitted_with_the_bounds_that_its_own_depths_give(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await begin(user)
            await bring(user, SAMPLES / "cartilage_on_bone.csv", SAMPLES / "gel_on_glass.csv")
            await until(user, "tests")
            bounds = []
            for name in ("cartilage_on_bone", "gel_on_glass"):
                press(user, "step-1")
                press(user, f"file-{name}.csv")
                await wait_for(lambda name=name: name in folder.scene_text())
                press(user, "step-2")
                press(user, f"preset-{name}")
                await until(user, "to-fit")
                press(user, "step-3")
                await until(user, "modulus-half-space")
                await wait_for(lambda: Draft.of(folder.scene_text()).free.get(CONTACT))
                entry = Draft.of(folder.scene_text()).free[CONTACT]
                bounds.append([float(entry[end].split()[0]) for end in ("min", "max")])
            # Without a sample in between, which says all anew, it is the same.
            press(user, "step-1")
            press(user, "file-cartilage_on_bone.csv")
            await wait_for(lambda: "cartilage_on_bone" in folder.scene_text())
            press(user, "step-3")
            await wait_for(lambda: Draft.of(folder.scene_text()).free.get(CONTACT))
            entry = Draft.of(folder.scene_text()).free[CONTACT]
            bounds.append([float(entry[end].split()[0]) for end in ("min", "max")])
        assert bounds[0] == bounds[2]
        assert bounds[0][1] > 10.0 * bounds[1][1]

    run(person())


def test_zero_has_the_unit_of_what_stands_beside_it_or_none(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await begin(user)
            await bring(user, SAMPLES / "gel_on_glass.csv")
            await until(user, "tests")
            press(user, "step-2")
            press(user, "preset-gel_on_glass")
            await until(user, "to-fit")
            await until(user, content="fixed at 0")
            texts = [element.text for element in user.client.elements.values() if hasattr(element, "text")]
            assert "fixed at 0" in texts
            assert not [text for text in texts if str(text).startswith("fixed at 0 ")]
            analysis = user.home.analysis(folder.name)
            analysis.draft.table("instrument")["contact_depth"] = "-1e-22 m"
            analysis.keep()
            press(user, "step-3")
            await until(user, "modulus-half-space")
            assert text_of(user, "contact-words") == "0 \u00b5m"

    run(person())


def test_when_the_curve_that_is_looked_at_is_removed_another_is_looked_at(tmp_path):
    analysis = two_curves(tmp_path)
    analysis.remove("a.csv")
    assert analysis.curve_name == "b.csv"
    assert read_scene_file(analysis.folder.scene).curve_path == analysis.folder.path / "curves" / "b.csv"
    assert said_of_depths(analysis) == (["", "", ""], {})
    analysis.remove("b.csv")
    assert analysis.curve_name == ""
    # The scene names no file that is not there, and what needs one says so.
    assert read_scene_file(analysis.folder.scene).curve_path is None


@pytest.mark.parametrize("task", ["fit", "taken", "excel", "archive"])
def test_an_analysis_without_a_file_says_to_bring_one(tmp_path, task):
    analyst = Analyst(str(AnalysisFolder(tmp_path / "new").path))
    with pytest.raises(ul.InputError, match="bring a file first"):
        getattr(analyst, task)(lambda _value: None)
