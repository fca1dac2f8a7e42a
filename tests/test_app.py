"""The page, as a person goes through it."""

import io
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from nicegui import ui

import underlay as ul
from support.films import write_films
from support.page import (
    PATIENCE,
    at_the_fit,
    begin,
    bring,
    changed,
    marks,
    page,
    press,
    run,
    second_browser,
    seen,
    sheet_of,
    stranger,
    text_of,
    until,
    until_said,
    wait_for,
    write,
)
from support.reports import text_in
from underlay.cli import main
from underlay.inference.batch.decisions import read_map
from underlay.inference.films import fit_film
from underlay.report.labels import label
from underlay.report.scene_tables import film_table
from underlay.scene.scene_file import read_scene_file

SAMPLES = Path(__file__).parents[1] / "data_samples"


async def fill_in_with_mistakes(user, folder):
    """Go through the form of the test; what cannot be is refused in words, and kept out of the file."""
    press(user, "step-2")
    press(user, "preset-cartilage_on_bone")
    await until(user, "to-fit")
    write(user, "layer.nu", "0.7")
    await until(user, "scene-problem")
    assert "nu" in text_of(user, "scene-problem")
    write(user, "layer.nu", "0.46")
    await until(user, "to-fit")
    write(user, "indenter.radius", "a lot")
    (radius,) = user.find(marker="indenter.radius").elements
    await wait_for(lambda: radius.error)
    assert "must be given as" in radius.error
    assert ul.load_scene(folder.scene).indenter.radius == 1e-3
    for marker in ("layer.nu", "layer.E", "layer.E.max"):
        before = folder.scene_text()
        write(user, marker, "0,45")
        (field,) = user.find(marker=marker).elements
        await wait_for(lambda field=field: field.error)
        assert "with a point, such as 0.45" in field.error
        assert folder.scene_text() == before
    write(user, "layer.nu", "0.46")
    write(user, "layer.E", "1")
    write(user, "layer.E.max", "1")
    write(user, "indenter.radius", "1")


async def drag_the_contact(user):
    """Move the contact point: both laws follow."""
    press(user, "step-3")
    await until(user, "modulus-half-space")
    before = [text_of(user, f"modulus-{law}") for law in ("layer-on-substrate", "half-space")]
    write(user, "contact", 300)
    await changed(user, "modulus-half-space", before[1])
    await changed(user, "modulus-layer-on-substrate", before[0])


def everything_is_told(shown):
    """Both parts, verdict, curve with residuals, the modulus by depth, what it is made of, effects, parameters."""
    text = text_in(shown["sheet"])
    assert "95 %: statistical up to 0" in text
    assert "Good. The model describes the curve" in text
    parts = (
        "Curve and fit.",
        "E by depth.",
        "Uncertainty budget of E.",
        "finite thickness",
        "(assumed here)",
    )
    assert [part for part in parts if part not in text] == []
    assert "Layer modulus" in text.partition("Uncertainty budgets")[2]
    assert "friction" in text.partition("Uncertainty budgets")[2]
    parameters = text.partition("Parameters and correlations")[2]
    assert parameters.index("layer modulus") < parameters.index("layer thickness")


async def come_back(user, folder):
    """What was found is there again; it says so when the test is another one."""
    await user.open(f"/analysis/{folder.name}")
    await until(user, "sheet")
    assert "Layer modulus" in sheet_of(user)
    assert "old" not in seen(user)
    write(user, "contact", 100)
    await until(user, "old")


def test_from_a_dropped_file_to_a_number_that_python_repeats(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await begin(user)
            await bring(user, ("note.csv", b"no curve\n"), ("<b>empty.csv", b""))
            await until_said(user, "is empty")
            await until(user, "refused")
            await bring(user, SAMPLES / "cartilage_on_bone.csv")
            await until(user, "file-cartilage_on_bone.csv")
            press(user, "file-cartilage_on_bone.csv")
            await until(user, "tests")
            await fill_in_with_mistakes(user, folder)
            await drag_the_contact(user)
            press(user, "fit")
            await until(user, content="Effects that were considered")
            assert "Layer modulus" in sheet_of(user)
            shown = json.loads((folder.results / "cartilage_on_bone.csv.found.shown.json").read_text())
            everything_is_told(shown)
            press(user, "step-5")
            await until(user, "script")
            press(user, "take-archive")
            archive = zipfile.ZipFile(io.BytesIO((await user.download.next(timeout=PATIENCE)).content))
            press(user, "take-excel")
            excel = (await user.download.next(timeout=PATIENCE)).content
            await come_back(user, folder)
        assert excel[:2] == b"PK"
        return archive, shown["values"]

    archive, values = run(person())
    archive.extractall(tmp_path / "taken")
    # In a shell that says nothing of threads: it is the library that takes one.
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    told = subprocess.run(
        [sys.executable, str(tmp_path / "taken" / "analysis.py")],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    ).stdout
    assert set(values) == {"layer.E", "layer.thickness", "instrument.contact_depth", "instrument.baseline"}
    for name, numbers in values.items():
        value, low, high = (float(number) for number in numbers[:3])
        assert f"{name} {value:.6g} ({low:.6g} to {high:.6g})" in told
        assert f"{name} is as on the page" in told


async def look_through(user, folder):
    """Next and previous curve; a change is undone, done again, and undone after the page was loaded again."""
    assert text_of(user, "place") == "site-1.csv, 1 of 7"
    press(user, "next")
    await changed(user, "place", "site-1.csv, 1 of 7")
    press(user, "previous")
    await changed(user, "place", "site-2.csv, 2 of 7")
    await until(user, "modulus-half-space")
    before = folder.scene_text()
    write(user, "contact", 300)
    await wait_for(lambda: "contact_depth =" in folder.scene_text())
    await wait_for(lambda: text_of(user, "undo") == "Undo: contact point")
    after = folder.scene_text()
    for way, text in (("undo", before), ("redo", after)):
        press(user, way)
        await wait_for(lambda text=text: folder.scene_text() == text)
    await user.open(f"/analysis/{folder.name}")
    await until(user, "modulus-half-space")
    press(user, "undo")
    await wait_for(lambda: folder.scene_text() == before)


async def refuse_one(user, folder):
    """A refusal needs a reason; what is shown as decided is on the disk, and the command line reads it."""
    press(user, "refuse-site-1.csv")
    await until(user, "reason")
    press(user, "refuse-now")
    await until_said(user, "say why")
    press(user, "refuse-site-1.csv")
    await until(user, "reason")
    write(user, "reason", "=air bubble")
    press(user, "refuse-now")
    await until(user, "decided-site-1.csv")
    decided = ul.read_decisions(folder.decisions).by_curve
    assert {name: (d.accepted, d.reason) for name, d in decided.items()} == {
        "site-1.csv": (False, "=air bubble")
    }
    assert "accept-site-7.csv" not in marks(user)  # it has no fit


def test_many_curves_are_fitted_decided_and_taken_together(tmp_path):
    async def person():
        async with page(tmp_path / "home") as user:
            press(user, "sample-joint/scene.toml")
            await until(user, "modulus-half-space")
            (analysis,) = user.home._open.values()
            folder = analysis.folder
            # One more, which holds no contact.
            readings = "".join(f"{number},0\n" for number in range(99))
            folder.add_curve("site-7.csv", f"depth (m),force (N)\n{readings}".encode())
            manifest = folder.path / "manifest.csv"
            manifest.write_text(manifest.read_text().rstrip() + "\nsite-7.csv,A,0,2,1.5\n")
            press(user, "step-1")
            press(user, "step-3")
            await until(user, content="1 of 7")
            await look_through(user, folder)
            press(user, "step-4")
            write(user, "label-files", "site-7")
            write(user, "label-name", "B")
            press(user, "label-set")
            await until_said(user, "are of animal B")
            press(user, "fit-all")
            await until(user, "card-site-1.csv")
            await refuse_one(user, folder)
            write(user, "by", "animal")
            press(user, "together")
            await until(user, content="geometric mean")
            await until(user, content="Curves by animal.")
            # Reopened, all of it is there; what a new decision makes old says so.
            await user.open(f"/analysis/{folder.name}")
            await until(user, "fit")
            press(user, "step-4")
            await until(user, "decided-site-1.csv")
            await until(user, content="geometric mean")
            assert "old-population" not in seen(user)
            assert text_of(user, "known-animal") == "animal: A (3), B (4)"
            press(user, "accept-site-3.csv")
            await until(user, "old-population")
            press(user, "open-site-2.csv")
            await until(user, content="site-2.csv, 2 of 7")
        judged = read_map(folder.results / "judged.csv")
        assert list(judged["status"]) == ["refused by hand", *["fitted"] * 5, "failed"]
        assert list(judged["animal"]) == [*"AAABBBB"]

    run(person())


FIELDS = (ui.input, ui.textarea, ui.select, ui.checkbox, ui.switch, ui.slider, ui.range, ui.upload)


def without_help(user):
    """Fields of the page, in steps that are shown and not, that say nothing where the mouse rests."""
    fields = [element for element in user.client.elements.values() if isinstance(element, FIELDS)]
    assert len(fields) > 40
    return [field._markers for field in fields if len(field._props.get("title", "")) < 20]


def test_every_field_of_every_step_has_help_and_a_number_that_nobody_entered_can_be_confirmed(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await begin(user)
            for step in ("3", "4", "5"):
                press(user, f"step-{step}")
            await until(user, content="No curve yet: bring some first.")
            await until(user, content="Not fitted yet: fit this curve in step 3.")
            press(user, "step-1")
            await bring(user, SAMPLES / "gel_on_glass.csv")
            await until(user, "tests")
            press(user, "step-3")
            await until(user, content="Complete the test")
            assert "Poisson's ratio of the layer" in text_of(user, "way")
            press(user, "step-2")
            assert state(user, 2) == "3 needed"
            press(user, "preset-gel_on_glass")
            await until(user, "to-fit")
            assert state(user, 2) == "3 assumed"
            press(user, "assumed-layer.nu")
            await wait_for(lambda: state(user, 2) == "2 assumed")
            write(user, "layer.thickness", "6.1")
            await wait_for(lambda: state(user, 2) == "1 assumed")
            assert read_scene_file(folder.scene).assumed == ("indenter.radius", "layer.E")
            # A layer under it, an elastic substrate, and what is known of a number before: more fields.
            write(user, "base", "elastic")
            await until(user, "substrate.E")
            press(user, "add-layer")
            await until(user, "substrate.layers[0].E")
            write(user, "prior", "normal")
            await until(user, "layer.E.mean")
            write(user, "layer.relaxation.model", "prony")
            await until(user, "layer.relaxation.fractions")
            assert without_help(user) == []

    run(person())


def state(user, number):
    """What stands behind the name of a step."""
    (tab,) = user.find(marker=f"step-{number}").elements
    return tab._props["label"].partition("   ")[2]


def test_two_browsers_do_not_mix_and_a_second_window_takes_over(tmp_path):
    async def persons():
        async with page(tmp_path) as first, second_browser(first) as second:
            one, other = await begin(first), await begin(second)
            assert one.path != other.path
            await bring(second, SAMPLES / "gel_on_glass.csv")
            await bring(first, SAMPLES / "cartilage_on_bone.csv")
            await until(first, "file-cartilage_on_bone.csv")
            await until(second, "file-gel_on_glass.csv")
            assert [path.name for path in one.curve_files()] == ["cartilage_on_bone.csv"]
            assert [path.name for path in other.curve_files()] == ["gel_on_glass.csv"]
            await second.open(f"/analysis/{one.name}")
            press(second, "step-1")
            await until(second, "file-cartilage_on_bone.csv")
            await bring(first, SAMPLES / "gel_on_glass.csv")
            await until_said(first, "opened in another window")
            assert [path.name for path in one.curve_files()] == ["cartilage_on_bone.csv"]
            with pytest.raises(AssertionError, match="403"):
                await stranger(first).open("/")

    run(persons())


def test_a_posterior_tells_how_far_it_is_stops_when_told_and_is_there_again(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await at_the_fit(user, SAMPLES / "gel_on_glass.csv", "Waiting")
            press(user, "step-5")
            write(user, "most", 2_000)
            press(user, "sample")
            await until(user, content="20 of about")
            press(user, "stop-sample")
            await until(user, content="interrupted after")
            said = sheet_of(user)
            assert "Layer modulus" in said
            posterior = ul.Posterior.load(folder.results / "gel_on_glass.csv.posterior.npz")
            assert not posterior.converged
            await user.open(f"/analysis/{folder.name}")
            await until(user, "modulus-half-space")
            press(user, "step-5")
            await until(user, content="interrupted after")
            assert sheet_of(user) == said
            assert "old-posterior" not in seen(user)
            await user.open(f"/analysis/{folder.name}")
            await until(user, "modulus-half-space")
            write(user, "contact", 300)
            press(user, "step-5")
            await until(user, "old-posterior")

    run(person())


def test_a_film_by_its_stiffness_and_a_test_written_as_text(tmp_path):
    async def person():
        made = tmp_path / "made"
        made.mkdir()
        film, base, scene = write_films(made)
        async with page(tmp_path / "home") as user:
            folder = await begin(user)
            await bring(user, film, base)
            await until(user, "tests")
            press(user, "step-2")
            await until(user, "scene-text")
            before = folder.scene_text()
            write(user, "scene-text", scene.read_text() + '\n[curve]\nfile = "../../scene.toml"\n')
            press(user, "use-text")
            await until_said(user, "one of the files of step 1")
            assert folder.scene_text() == before
            write(user, "scene-text", scene.read_text() + f'\n[curve]\nfile = "{film.name}"\n')
            press(user, "use-text")
            await wait_for(lambda: "berkovich" in folder.scene_text() or "cone" in folder.scene_text())
            press(user, "step-3")
            await until(user, "film-base")
            write(user, "film-base", base.name)
            press(user, "film")
            await until_said(user, "the known sample needs its modulus")
            write(user, "film-modulus", "165 GPa")
            press(user, "film")
            await until(user, content="left of the trend")
            return folder

    folder = run(person())
    shown = json.loads((folder.results / "oxide.xls.film.shown.json").read_text())
    curves = folder.curves / "oxide.xls", folder.curves / "silicon.xls"
    found = fit_film(read_scene_file(folder.scene), *curves, "165 GPa", ("0 nm", "1 m"))
    table = film_table(found)
    assert shown["table"] == table.assign(parameter=table["parameter"].map(label)).to_dict("records")
    assert shown["table"][0]["parameter"] == "layer modulus"


def test_without_the_extra_the_command_says_the_line_to_install_it(monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    monkeypatch.setattr("sys.argv", ["underlay", "app"])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert "pip install '.[app]' in the folder of underlay" in capsys.readouterr().err
