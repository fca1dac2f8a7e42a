"""Thickness of a map from its contact heights: some curves beside the sample, on the bare substrate."""

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from underlay.app.folder import AnalysisFolder
from underlay.app.form import preset
from underlay.app.labels import read_labels
from underlay.app.tasks import Analyst
from underlay.scene.scene_file import read_scene_file

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


def silent(_value):
    return None


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
