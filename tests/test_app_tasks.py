"""What the processes of the page do, called directly."""

import io
import json
import zipfile
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import underlay as ul
from support.analyses import looked_at, silent
from support.call_counter import count_calls
from support.reports import text_in
from underlay.app import tasks
from underlay.app.folder import AnalysisFolder, keep, kept, read_labels
from underlay.app.form import Draft, preset
from underlay.app.shown import Sampled
from underlay.app.tasks import Analyst
from underlay.inference.compare import laws_at_contact
from underlay.inference.from_files import read_whole
from underlay.inference.least_squares import fitting
from underlay.scene.program import default_depth
from underlay.scene.scene_file import read_scene_file, scene_file_from_text


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
    analyst, folder = looked_at(tmp_path, "gel_on_glass")
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
    assert "Assumed: indenter radius, layer thickness" in text_in(analyst.sample(2_000, silent).sheet)
    archive = zipfile.ZipFile(io.BytesIO(analyst.archive(silent)))
    exported = scene_file_from_text(archive.read("scene.toml").decode())
    assert exported.assumed == ("indenter.radius", "layer.E", "layer.thickness")
    (record,) = json.loads(archive.read("results/gel_on_glass.csv.fit.json"))["provenance"]["curves"]
    assert record["assumed"] == ["indenter.radius", "layer.thickness"]
    sheets = zipfile.ZipFile(io.BytesIO(analyst.excel(silent))).read("xl/sharedStrings.xml").decode()
    assert "indenter.radius, layer.thickness" in sheets


def test_a_share_of_the_force_is_a_range_that_the_picture_shows(tmp_path):
    _, folder = looked_at(tmp_path, "cartilage_on_bone", fit_from="10 % of force", fit_to="60 % of force")
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
    analyst, _ = looked_at(tmp_path, sample)
    seen = analyst.look(None, None, None, None, silent)
    counted = ((Figure, "savefig"), (tasks, "read_whole"), (fitting, "_fit_once"))
    pictures, readings, fits = (count_calls(monkeypatch, *called) for called in counted)
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
    plots = SimpleNamespace(scene=lambda test, **_more: drawn.append(test))
    monkeypatch.setattr("underlay.app.tasks.plots", plots)
    monkeypatch.setattr("underlay.app.tasks.drawn", lambda _ax: b"picture")
    assert analyst.scene(silent) == b"picture"
    assert drawn[0].indenter.radius == pytest.approx(27.5e-6)


def test_a_scene_without_a_curve_is_drawn_at_the_default_depth_of_every_command(tmp_path):
    analyst, folder = looked_at(tmp_path, "cartilage_on_bone")
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


# --- thickness of a map from its contact heights: some curves are beside the sample, on the bare substrate
# Reading of the bare substrate at the origin and its slopes; noise of the force; a gel of 2 kPa under a 5 um ball.
GROUND, SLOPES, NOISE, MODULUS = 40e-6, (2e-3, -1e-3), 2e-11, 2e3
# Between readings of the depth: the hard contact of a bare substrate lies between two of them.
STEP = 1e-8
GEL = {
    (0.0, 0.0): 5.0e-6,
    (1e-4, 0.0): 6.5e-6,
    (2e-4, 0.0): 8.0e-6,
    (0.0, 1e-4): 7.0e-6,
    (1e-4, 1e-4): 9.0e-6,
}
BARE = ((5e-4, 0.0), (5e-4, 3e-4), (0.0, 5e-4), (3e-4, 5e-4))


def ground(place, tilted):
    return GROUND + (np.dot(SLOPES, place) if tilted else 0.0)


def on_the_gel(place, thickness, rng, tilted):
    contact = ground(place, tilted) - thickness
    layer = ul.Layer(ul.Isotropic(MODULUS, 0.5), thickness)
    scene = ul.Scene(ul.Sphere(5e-6), layer, ul.RIGID)
    depth = np.arange(-2e-6, 1.5e-6, STEP)
    curve = ul.synthesize(scene, depth, ul.Noise(force=NOISE), rng=rng, solver=ul.Exact(1e-5))
    return contact + depth, curve.force


def on_the_glass(place, rng, tilted):
    depth = np.arange(-2e-6, 3 * STEP, STEP)
    # A tip that is pressed against glass goes on no further: the force rises within readings.
    force = np.where(depth > 0.0, 1.0 * depth, 0.0)
    return ground(place, tilted) + depth, force + NOISE * rng.standard_normal(len(depth))


def a_map(tmp_path, *, tilted, places=True):
    rng = np.random.default_rng(5)
    folder = AnalysisFolder(tmp_path / "one")
    rows = []
    curves = [
        (f"gel{n}.csv", place, on_the_gel(place, h, rng, tilted)) for n, (place, h) in enumerate(GEL.items())
    ]
    curves += [(f"glass{n}.csv", place, on_the_glass(place, rng, tilted)) for n, place in enumerate(BARE)]
    for name, place, (depth, force) in curves:
        table = pd.DataFrame({"depth (m)": depth, "force (N)": force})
        folder.add_curve(name, table.to_csv(index=False).encode())
        at = {"x (um)": 1e6 * place[0], "y (um)": 1e6 * place[1]} if places else {}
        rows.append({"file": name, "animal": "A", "thickness (um)": 3, **at})
    (folder.path / "manifest.csv").write_text(pd.DataFrame(rows).to_csv(index=False))
    draft = preset("gel_on_glass")
    draft.table("curve")["file"] = "curves/gel0.csv"
    draft.free["instrument.contact_depth"] = {}
    folder.write_scene(draft.text())
    return Analyst(str(folder.path)), folder


@pytest.mark.parametrize("tilted", [True, False])
def test_every_curve_of_the_map_gets_its_thickness_and_with_it_its_modulus(tmp_path, tilted):
    analyst, folder = a_map(tmp_path, tilted=tilted, places=tilted)
    said = analyst.thickness("Glass", silent)
    assert "under 5 curves: 4.98" in said
    assert f"taken as {'tilted' if tilted else 'level'}" in said
    labels = read_labels(folder)
    assert [name for name, row in labels.items() if row["bare substrate"]] == [
        f"glass{n}.csv" for n in range(4)
    ]
    found = [float(labels[f"gel{n}.csv"]["thickness (m)"]) for n in range(5)]
    # A contact is known to some readings on the glass, and on the gel to where its force leaves the noise.
    first = (NOISE * 3.0 / (16.0 / 9.0 * MODULUS * np.sqrt(5e-6))) ** (2.0 / 3.0)
    assert found == pytest.approx(list(GEL.values()), abs=2.0 * STEP + first)
    overview = analyst.fit_all(silent)
    assert overview.sheet
    table = pd.read_csv(folder.results / "map.csv", comment="#")
    assert list(table["name"]) == [f"gel{n}.csv" for n in range(5)]
    wrong = table["layer.E"] / MODULUS - 1.0
    # A percent of thickness moves the modulus by one or less.
    assert np.abs(wrong).max() < 1.5 * (2.0 * STEP + first) / min(GEL.values()) + 0.02
    assert len(analyst.gallery(0, silent).cards) == 5


def test_heights_that_cannot_be_are_refused_and_nothing_is_written(tmp_path):
    analyst, folder = a_map(tmp_path, tilted=False)
    before = (folder.path / "manifest.csv").read_text()
    for begins in ("", "nothing", "g"):
        with pytest.raises(ul.InputError, match="some must be on the bare substrate"):
            analyst.thickness(begins, silent)
    with pytest.raises(ul.InputError, match="count depth from one zero"):
        analyst.thickness("gel", silent)
    assert (folder.path / "manifest.csv").read_text() == before
    assert read_scene_file(folder.scene).draft.layer.thickness == 6e-6
