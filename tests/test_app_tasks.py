"""What the processes of the page do, called directly."""

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import underlay as ul
from support.call_counter import count_calls
from support.reports import text_in
from underlay.app import tasks
from underlay.app.folder import AnalysisFolder, keep, kept
from underlay.app.form import Draft, preset
from underlay.app.shown import Sampled
from underlay.app.tasks import Analyst
from underlay.inference.compare import laws_at_contact
from underlay.inference.from_files import read_whole
from underlay.inference.least_squares import fitting
from underlay.scene.program import default_depth
from underlay.scene.scene_file import read_scene_file, scene_file_from_text

SAMPLES = Path(__file__).parents[1] / "data_samples"


def silent(_value):
    return None


def looked_at(tmp_path, sample, name, **curve):
    """The tasks on an analysis of one sample curve, and its scene file."""
    folder = AnalysisFolder(tmp_path / "one")
    brought = folder.add_curve(f"{name}.csv", (SAMPLES / f"{name}.csv").read_bytes())
    draft = preset(sample)
    draft.table("curve").update(file=f"curves/{brought.name}", **curve)
    folder.write_scene(draft.text())
    return Analyst(str(folder.path)), folder


def test_a_file_is_told_with_its_segments_and_what_the_instrument_found(tmp_path):
    analyst, _ = looked_at(tmp_path, "cell_on_glass", "chiaro_cell_indentation")
    told = analyst.read("chiaro_cell_indentation.csv", silent)
    assert told.facts["The instrument's own reduced modulus"] == "0.156 kPa"
    assert set(told.facts) >= {"Spring constant", "Tip radius"}
    (test,) = told.tests
    assert test["segments"] == "loading 2533, unloading 233"
    assert "µm" in test["depth"]  # as it is printed, not as it is typed
    assert "nN" in test["force"]
    for picture in analyst.curve("chiaro_cell_indentation.csv", 1, silent):
        assert picture[:4] == b"\x89PNG"


def test_what_nobody_entered_is_assumed_in_the_result_in_the_report_and_in_the_exported_test(tmp_path):
    analyst, folder = looked_at(tmp_path, "gel_on_glass", "gel_on_glass")
    draft = Draft.of(folder.scene_text())
    draft.confirm("layer.nu")
    draft.free["instrument.contact_depth"] = {"min": "-1 um", "max": "1 um"}
    folder.write_scene(draft.text())
    found = analyst.fit(silent)
    pages = text_in(found.sheet), text_in(analyst.report(silent).decode())
    for text in pages:
        assert "Assumed: indenter radius, layer thickness: usual values, not measured; enter yours." in text
        assert "indenter radius and layer thickness (6 \N{MICRO SIGN}m) were assumed, not measured" in text
        assert "Poisson's ratio of the layer (0.5) was given" in text
    archive = zipfile.ZipFile(io.BytesIO(analyst.archive(silent)))
    exported = scene_file_from_text(archive.read("scene.toml").decode())
    assert exported.assumed == ("indenter.radius", "layer.E", "layer.thickness")


def test_a_share_of_the_force_is_a_range_that_the_picture_shows(tmp_path):
    _, folder = looked_at(
        tmp_path, "cartilage_on_bone", "cartilage_on_bone", fit_from="10 % of force", fit_to="60 % of force"
    )
    file = read_scene_file(folder.scene)
    curve = read_whole(file, file.curve_path)
    held = laws_at_contact(file, curve, 1.4e-5)
    top = float(curve.force.max())
    # The baseline, and one reading more or less at each end.
    assert float(held.used.force.min()) == pytest.approx(0.1 * top, abs=0.02 * top)
    assert float(held.used.force.max()) == pytest.approx(0.6 * top, abs=0.02 * top)


@pytest.mark.parametrize("sample", ["cartilage_on_bone", "gel_on_glass"])
def test_while_a_handle_is_moved_two_laws_are_fitted_once_each_and_no_picture_is_drawn(
    tmp_path, monkeypatch, sample
):
    analyst, _ = looked_at(tmp_path, sample, sample)
    seen = analyst.look(None, None, None, None, silent)
    pictures, readings = (
        count_calls(monkeypatch, Figure, "savefig"),
        count_calls(monkeypatch, tasks, "read_whole"),
    )
    fits = count_calls(monkeypatch, fitting, "_fit_once")
    moved = seen.contact + 0.01 * (seen.extent[1] - seen.extent[0])
    laws, notes = analyst.laws(moved, seen.low, seen.high, silent)
    assert (pictures.calls, readings.calls, fits.calls) == (0, 0, 2)
    assert [law.name for law in laws] == ["layer on substrate", "half-space"]
    assert [law.modulus for law in laws] != [law.modulus for law in seen.laws]
    assert not notes
    # What is shown while it moves is what is shown when it rests.
    assert analyst.look(moved, seen.low, seen.high, None, silent).laws == laws
    assert pictures.calls == 1


def test_a_tip_that_only_the_file_knows_is_drawn_as_the_file_says_it(tmp_path, monkeypatch):
    analyst, folder = looked_at(tmp_path, "cell_on_glass", "chiaro_cell_indentation")
    draft = preset("cell_on_glass")
    draft.table("curve")["file"] = "curves/chiaro_cell_indentation.csv"
    del draft.table("indenter")["radius"]
    folder.write_scene(draft.text())
    drawn = []

    @dataclass
    class Plots:
        @staticmethod
        def scene(test, **_more):
            drawn.append(test)

    monkeypatch.setattr("underlay.app.tasks.plots", Plots)
    monkeypatch.setattr("underlay.app.tasks.drawn", lambda _ax: b"picture")
    assert analyst.scene(silent) == b"picture"
    assert drawn[0].indenter.radius == pytest.approx(27.5e-6)


def test_a_scene_without_a_curve_is_drawn_at_the_default_depth_of_every_command(tmp_path):
    analyst, folder = looked_at(tmp_path, "cartilage_on_bone", "cartilage_on_bone")
    folder.write_scene(preset("cartilage_on_bone").text())
    file = read_scene_file(folder.scene)
    assert analyst._deepest(file) == default_depth(file.scene)
    assert 0.0 < default_depth(file.scene) <= 0.1 * file.scene.layer.thickness


def test_what_is_kept_is_what_was_shown_and_a_damaged_file_is_nothing(tmp_path):
    folder = AnalysisFolder(tmp_path / "one")
    shown = Sampled("of this", "<p>E is 1 MPa</p>", ("sample again",))
    assert kept(folder, "a", Sampled) is None
    keep(folder, "a", shown)
    assert json.dumps(kept(folder, "a", Sampled).__dict__) == json.dumps(shown.__dict__)
    (path,) = folder.results.iterdir()
    for damaged in (b"{", b"[1]", b'{"other": 1}', np.random.default_rng(0).bytes(100)):
        path.write_bytes(damaged)
        assert kept(folder, "a", Sampled) is None


@pytest.mark.parametrize("task", ["fit", "sample"])
def test_a_loading_that_left_an_imprint_is_refused_as_by_every_command(tmp_path, task):
    folder = AnalysisFolder(tmp_path / "one")
    into, out = np.linspace(0.0, 1e-6, 80), np.linspace(1e-6, 0.7e-6, 80)
    depth = np.concatenate((into, out))
    force = 1e-2 * np.concatenate(((into / 1e-6) ** 2, ((out - 0.7e-6) / 0.3e-6).clip(0.0) ** 1.5))
    rows = "".join(f"{d!r},{f!r}\n" for d, f in zip(depth.tolist(), force.tolist(), strict=True))
    folder.add_curve("imprint.csv", b"depth (m),force (N)\n" + rows.encode())
    folder.write_scene(
        '[indenter]\nshape = "cone"\nhalf_angle = "70.3 deg"\n[layer]\nE = "70 GPa"\nnu = 0.2\n'
        '[fit]\nlayer.E = { min = "1 GPa", max = "1 TPa" }\n[curve]\nfile = "curves/imprint.csv"\n'
    )
    arguments = (silent,) if task == "fit" else (10, silent)
    with pytest.raises(ul.CurveError, match="elastoplastic"):
        getattr(Analyst(str(folder.path)), task)(*arguments)
