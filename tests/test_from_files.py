"""A curve file and a scene file become a problem: parts of curves, priors by name, contact found in the data."""

from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from underlay.inference.from_files import free_of, whole_curve
from underlay.scene.scene_file import read_scene_file

SAMPLES = Path(__file__).resolve().parents[1] / "data_samples"
CURVE, SCENE = SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml"
CONTACT = 'instrument.contact_depth = { min = "-30 um", max = "100 um" }'


def changed(tmp_path, old, new):
    text = SCENE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "scene.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_contact_found_in_the_curve_is_the_prior(tmp_path):
    scene = changed(tmp_path, CONTACT, 'instrument.contact_depth = { prior = "found" }')
    problem = ul.load_problem(CURVE, scene)
    contact = ul.find_contact(problem.curves[0], scene=problem.base_scenes[0])
    prior = problem.priors["instrument.contact_depth"]
    assert prior == ul.Normal(contact.depth, contact.uncertainty)
    # The truth is 14 um; the estimate must be within four of its own standard deviations.
    assert abs(contact.depth - 14e-6) < 4 * contact.uncertainty
    assert abs(ul.fit(problem).values["layer.E"] - 0.62e6) < 0.05 * 0.62e6


@pytest.mark.parametrize("old", ['layer.E = { min = "10 kPa", max = "100 MPa" }', CONTACT])
def test_found_is_for_the_contact_of_a_curve(tmp_path, old):
    path = old.split(" = ")[0]
    file = read_scene_file(changed(tmp_path, old, f'{path} = {{ prior = "found" }}'))
    with pytest.raises(ul.InputError, match=r"'found' is for instrument\.contact_depth of a measured curve"):
        free_of(file)


def test_a_part_of_the_curve(tmp_path):
    text = '[curve]\nmin_depth = "0 um"\nmax_depth = "100 um"\n\n[solver]'
    depth = ul.load_problem(CURVE, changed(tmp_path, "[solver]", text)).curves[0].depth
    assert np.min(depth) >= 0.0
    assert np.max(depth) <= 1e-4


def test_no_point_left(tmp_path):
    text = '[curve]\nmin_depth = "5 mm"\n\n[solver]'
    with pytest.raises(ul.InputError, match=r"no point of the loading part.*depths run from"):
        ul.load_problem(CURVE, changed(tmp_path, "[solver]", text))


def test_the_whole_curve_is_read_again_as_it_was_read(tmp_path):
    path, scene = tmp_path / "curve.csv", tmp_path / "scene.toml"
    rows = [f"{h},{max(h, 0.0) ** 1.5}" for h in [*np.linspace(-2, 20, 60), *np.linspace(20, -2, 50)]]
    path.write_text("a (um),b (mN)\n" + "\n".join(rows) + "\n", encoding="utf-8")
    columns = '\n[curve]\ncolumns = { depth = "a (um)", force = "b (mN)" }\n'
    scene.write_text(SCENE.read_text(encoding="utf-8") + columns, encoding="utf-8")
    part = ul.load_problem(path, scene).curves[0]
    whole = whole_curve(part)
    assert len(part) < 70 < len(whole) == 110
    # Two equal readings at the turn are no hold.
    assert set(whole.segments()) == {"loading", "unloading"}
    # Without a scene file the same reader and test are used; these columns it cannot know.
    assert whole_curve(part.with_metadata(scene_path=None)) is None
    assert len(whole_curve(ul.read(CURVE).loading())) == len(ul.read(CURVE))
    # A curve made here, a file that has changed, and one that is gone.
    assert whole_curve(ul.Curve(part.depth, part.force)) is None
    path.write_text(path.read_text() + "0.0,0.0\n", encoding="utf-8")
    assert whole_curve(part) is None
    path.unlink()
    assert whole_curve(part) is None
