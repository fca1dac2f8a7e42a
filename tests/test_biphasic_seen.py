"""A draining layer where people look: plans, comparisons of models, pictures, report, form."""

import numpy as np
import pytest

import underlay as ul
from underlay.app.form import Draft
from underlay.scene.scene_keys import TOP

RADIUS, DEEP = 1e-3, 2e-5
FREE = {
    "layer.E": ul.LogUniform(1e4, 1e8),
    "layer.nu": ul.Uniform(0.0, 0.48),
    "layer.permeability": ul.LogUniform(1e-17, 1e-13),
}


def on_bone(material, radius=0.5e-3, relaxation=None):
    layer = ul.Layer(material, 1e-3, relaxation=relaxation)
    drainage = "solid" if material.drains else None
    return ul.Scene(ul.FlatPunch(radius), layer, ul.RIGID, drainage=drainage, uncertainties="none")


WATER = ul.Biphasic(0.5e6, 0.15, 1e-15)
FIBRES = ul.BiphasicTransverse(2e6, 0.4e6, 0.2, 0.1, 0.2e6, 1e-15)


def record(depth=DEEP, ramp=5.0, end=6000.0):
    time = np.concatenate((np.linspace(0.0, ramp, 30), ramp + np.geomspace(ramp / 30.0, end, 100)))
    return depth * np.minimum(time / ramp, 1.0), time


@pytest.fixture(scope="module")
def found():
    scene, (depth, time) = on_bone(WATER), record()
    noise = ul.Noise(force=0.01 * scene.force(depth, time).max())
    curve = ul.synthesize(scene, depth, noise, rng=1, time=time)
    return ul.fit(ul.Problem(scene, curve, FREE, noise))


def test_a_plan_proposes_a_second_radius_four_times_smaller():
    # The shear modulus is open: one radius tells E, E_axial and G_axial together only.
    scene, way = on_bone(FIBRES, RADIUS), record()
    noise = ul.Noise(force=0.01 * scene.force(*way).max() / 4.0)
    free = ["layer.E", "layer.E_axial", "layer.G_axial", "layer.permeability"]
    radii = [0.25 * RADIUS, 0.5 * RADIUS, RADIUS]
    planned = ul.plan(scene, free=free, noise=noise, radii=radii, depths=[DEEP], record=way)
    both = planned.second(RADIUS, DEEP)
    assert both.best[0] == pytest.approx(0.25 * RADIUS)
    assert both.stderr[0, 0] < 0.3 * planned.stderr[2, 0]
    assert both.stderr[0, 0] < 0.5 * both.stderr[2, 0]


def test_a_plan_needs_the_motion():
    scene = on_bone(WATER)
    with pytest.raises(ul.InputError, match="planned with the motion of the test"):
        ul.plan(scene, free=FREE, noise=ul.Noise(force=1e-4), radii=[RADIUS], depths=[DEEP])


def test_a_second_tip_for_the_thickness(found):
    curve = found.curves[0]
    free = {**FREE, "layer.thickness": ul.Uniform(5e-4, 2e-3)}
    fit = ul.fit(ul.Problem(found.scene, curve, free, found.problem.members[0].noise))
    told = ul.second_test(fit, "layer.thickness", value=1e-3, target=0.02)
    assert told.radius is not None
    assert told.shares.min() < 0.5 * fit.stderr["layer.thickness"] / 1e-3


def test_models_are_weighed(found):
    curve, noise = found.curves[0], found.problem.members[0].noise
    series = ul.Prony((0.5,), (100.0,))
    relaxing = {
        "layer.E": FREE["layer.E"],
        "layer.relaxation.fractions[0]": ul.Uniform(0.0, 0.95),
        "layer.relaxation.times[0]": ul.LogUniform(1.0, 3000.0),
    }
    fibrous = ul.BiphasicTransverse(0.6e6, 0.5e6, 0.2, 0.1, 0.25e6, 1e-15)
    # The skeleton's own relaxation stands: what is weighed is water alone against both.
    both = on_bone(WATER, relaxation=ul.Prony((0.3,), (100.0,)))
    candidates = {
        "Prony": (on_bone(ul.Isotropic(1e6, 0.49), relaxation=series), relaxing),
        "biphasic": (found.scene, FREE),
        "fibrous": (on_bone(fibrous), {name: FREE[name] for name in ("layer.E", "layer.permeability")}),
        "both": (both, FREE),
    }
    models = {}
    for name, (scene, free) in candidates.items():
        problem = ul.Problem(scene, curve, free, noise)
        models[name] = problem, ul.sample(problem, method="importance", rng=0)
    table = ul.compare_models(models)
    assert table.index[0] == "biphasic"
    assert table.loc["biphasic", "probability"] > 0.9
    assert table.loc["Prony", "elpd_diff"] > 5.0 * table.loc["Prony", "dse"]


def test_pictures(found):
    upper = ul.plots.fit_in_time(found)
    assert upper.get_lines()[-1].get_ydata().size == len(found.curves[0])
    panel = ul.plots.drainage(found)
    measured, fitted = (line.get_ydata() for line in panel.get_lines())
    assert fitted[0] == 1.0
    assert fitted[-1] == 0.0
    assert np.all(np.diff(fitted) < 0.0)
    assert np.std(measured - fitted) == pytest.approx(0.02, rel=0.3)
    elastic = on_bone(ul.Isotropic(1e6, 0.4))
    curve = ul.synthesize(elastic, record()[0], ul.Noise(force=1e-4), rng=0)
    fit = ul.fit(ul.Problem(elastic, curve, ["layer.E"]))
    with pytest.raises(ul.InputError, match="does not drain"):
        ul.plots.drainage(fit)


def test_report(found, tmp_path):
    text = ul.report(found, tmp_path / "page.html").read_text(encoding="utf-8")
    for words in ("In time.", "Drainage.", "Permeability of the layer", "Aggregate modulus of the layer"):
        assert words in text


def test_a_layer_of_the_form_may_drain():
    draft = Draft({"layer": {"E": "1 MPa"}})
    fields = {field.key.name: field for field in draft.fields("layer")}
    assert not fields["permeability"].required
    assert "permeability_ratio" not in fields
    draft.put("layer", fields["permeability"].key, "1e-15 m^4/(N s)")
    drainage = next(field for field in draft.fields(TOP) if field.key.name == "drainage")
    draft.put(TOP, drainage.key, "solid")
    draft.set_axial("layer", axial=True)
    assert "permeability_ratio" in {field.key.name for field in draft.fields("layer")}
    assert Draft.of(draft.text()).get("layer", "permeability") == "1e-15 m^4/(N s)"
    assert Draft.of(draft.text()).get(TOP, "drainage") == "solid"
