"""The fit a map repeats: the optimum of the general fit, or no answer at all."""

import numpy as np
import pytest

import underlay as ul
from underlay.inference.batch.curves import CurvePlace
from underlay.inference.batch.model import BatchModel
from underlay.inference.batch.results_table import Layout
from underlay.inference.batch.separable import SeparableModel, separable_warnings
from underlay.inference.batch.work import CurveFitter

LAYER = ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3)
SCENES = {
    "paraboloid": ul.Scene(ul.Paraboloid(5e-4), LAYER, ul.RIGID),
    "cone": ul.Scene(ul.Cone(np.radians(70.0)), LAYER, ul.RIGID),
    "sphere": ul.Scene(ul.Sphere(5e-4), LAYER, ul.RIGID),
    "half-space": ul.Scene(ul.Paraboloid(5e-4), ul.Layer(ul.Isotropic(1e6, 0.45))),
    "soft base": ul.Scene(ul.Paraboloid(5e-4), LAYER, ul.Isotropic(3e5, 0.3)),
    "stiff base under a sphere": ul.Scene(ul.Sphere(5e-4), LAYER, ul.Isotropic(1e7, 0.3)),
}
CONTACT = {"layer.E": (1e3, 1e9), "instrument.contact_depth": (-1e-4, 1e-4)}
FREE = {
    "modulus": {"layer.E": (1e3, 1e9)},
    "contact": CONTACT,
    "baseline": {**CONTACT, "instrument.baseline": None},
    "slope": {"instrument.baseline_slope": None, "instrument.baseline": None, **CONTACT},
}
EXACT = {"solver": ul.Exact(1e-10)}


def made(scene, seed, noise=2e-4, points=400):
    rng = np.random.default_rng(seed)
    true = scene.with_values({"layer.E": 1e6 * 10.0 ** rng.uniform(-1.0, 1.0)})
    size = true.force(6e-5)
    true = true.with_values(
        {
            "instrument.contact_depth": rng.uniform(-1e-5, 1e-5),
            "instrument.baseline": 0.02 * size * rng.normal(),
            "instrument.baseline_slope": 200.0 * size * rng.normal(),
        }
    )
    depth = np.sort(rng.uniform(-3e-5, 6e-5, points))
    return true, ul.synthesize(true, depth, ul.Noise(force=noise * size), rng=seed)


def given(true, free):
    """The scene with the made numbers of what is not fitted."""
    start = {"layer.E": 1e6} | {path: 0.0 for path in free if path != "layer.E"}
    return true.with_values({path: start[path] for path in free})


@pytest.mark.parametrize("free", FREE)
@pytest.mark.parametrize("scene", SCENES)
def test_the_optimum_is_that_of_the_general_fit(scene, free):
    """To 1e-6 of each parameter's natural size.

    The general fit follows its last step by slopes: derivatives are then off by 1e-3 of themselves at most, and
    residuals by 1e-3 of one standard deviation together, which times what they say to that is 1e-5 of their
    squares.
    """
    for seed in range(3):
        true, curve = made(SCENES[scene], seed)
        start = given(true, FREE[free])
        problem = ul.Problem(start, curve, FREE[free], **EXACT)
        quick = SeparableModel.of(problem).fit(curve, start.parameters)
        general = ul.fit(problem)
        sizes = {
            "layer.E": general.values["layer.E"],
            "instrument.contact_depth": np.ptp(curve.depth),
            "instrument.baseline": np.ptp(curve.force),
            "instrument.baseline_slope": np.ptp(curve.force) / np.ptp(curve.depth),
        }
        for index, name in enumerate(problem.names):
            assert abs(quick.values[index] - general.values[name]) < 1e-6 * sizes[name]
            error = np.sqrt(quick.covariance[index, index])
            assert error == pytest.approx(general.stderr[name], rel=1e-3)
        residuals = general.residuals[0]
        assert quick.sum_of_squares <= residuals @ residuals * (1.0 + 1e-5)
        found = separable_warnings(quick, lambda problem=problem: problem)
        assert [text[:40] for text in found] == [str(w)[:40] for w in general.warnings]


@pytest.mark.parametrize("scene", ["paraboloid", "sphere", "soft base", "stiff base under a sphere"])
def test_a_row_with_a_poissons_ratio_of_its_own_is_that_of_a_map_of_it(scene):
    own = SCENES[scene].with_values({"layer.nu": 0.3})
    curve = made(own, 3)[1]
    with_own, plain = (
        ul.fit_many([curve], start, CONTACT, manifest, workers=0)
        for start, manifest in ((SCENES[scene], [{"file": "curve 0", "layer.nu": 0.3}]), (own, None))
    )
    for path in CONTACT:
        assert with_own[path][0] == pytest.approx(plain[path][0], rel=1e-9)


def test_a_row_of_a_stack_with_a_thickness_of_its_own_is_that_of_a_map_of_it():
    """The buried layer stays as thick: it was taken to grow with the one on top."""
    scene = ul.Scene(ul.Paraboloid(5e-4), LAYER, ul.Stack([LAYER], ul.Isotropic(1e7, 0.3)))
    own = scene.with_values({"layer.thickness": 5e-4})
    curve = made(own, 3)[1]
    with_own, plain = (
        ul.fit_many([curve], start, CONTACT, manifest, workers=0)
        for start, manifest in ((scene, [{"file": "curve 0", "layer.thickness": 5e-4}]), (own, None))
    )
    for path in CONTACT:
        assert with_own[path][0] == pytest.approx(plain[path][0], rel=1e-9)


def test_a_known_noise_sets_the_errors():
    true, curve = made(SCENES["paraboloid"], 5)
    start = given(true, CONTACT)
    noise = ul.Noise(force=3.0 * 2e-4 * true.force(6e-5))
    problem = ul.Problem(start, curve, CONTACT, noise, **EXACT)
    quick, general = SeparableModel.of(problem).fit(curve, start.parameters), ul.fit(problem)
    for index, name in enumerate(problem.names):
        assert np.sqrt(quick.covariance[index, index]) == pytest.approx(general.stderr[name], rel=1e-5)


@pytest.mark.parametrize("factor", [1e-9, 1e-6, 1e6, 1e9])
def test_units_leave_no_trace(factor):
    """Forces and moduli in other units: the same contact, the modulus in proportion."""
    true, curve = made(SCENES["paraboloid"], 7)
    start = given(true, CONTACT)
    one = SeparableModel.of(ul.Problem(start, curve, CONTACT, **EXACT)).fit(curve, start.parameters)
    scaled = ul.Curve(curve.depth, factor * curve.force)
    there = start.with_values(
        {
            path: factor * start.parameters[path]
            for path in ("layer.E", "instrument.baseline", "instrument.baseline_slope")
        }
    )
    free = {**CONTACT, "layer.E": (factor * 1e3, factor * 1e9)}
    other = SeparableModel.of(ul.Problem(there, scaled, free, **EXACT)).fit(scaled, there.parameters)
    assert other.values[0] == pytest.approx(factor * one.values[0], rel=1e-9)
    assert other.values[1] == pytest.approx(one.values[1], abs=1e-9 * np.ptp(curve.depth))


def test_what_is_not_separable_is_left_to_the_general_fit():
    scene, (_, curve) = SCENES["paraboloid"], made(SCENES["paraboloid"], 0)
    soft = ul.Scene(ul.Paraboloid(5e-4), LAYER, ul.Isotropic(1e5, 0.3))
    for other, free, noise in (
        (scene, {**CONTACT, "layer.thickness": (1e-4, 1e-2)}, None),
        (scene, {"instrument.contact_depth": (-1e-4, 1e-4)}, None),
        (scene, {**CONTACT, "layer.E": ul.LogNormal(1e6, 0.1)}, None),
        (scene, CONTACT, ul.Noise(force=1e-5, relative=0.01)),
    ):
        assert SeparableModel.of(ul.Problem(other, curve, free, noise)) is None
    # On an elastic base a law must tell its derivative in E.
    assert SeparableModel.of(ul.Problem(soft, curve, CONTACT, solver=ul.Asymptotic())) is None
    model = SeparableModel.of(ul.Problem(scene, curve, CONTACT))
    assert model.fit(curve, {**scene.parameters, "instrument.compliance": 1e-4}) is None
    # On a bound, without contact, with an impossible depth: nothing is guessed.
    near = {**CONTACT, "layer.E": (1e3, 1.02e6)}
    stiff, stiff_curve = made(scene, 1)
    held = given(stiff, near)
    assert stiff.parameters["layer.E"] > 1.03e6
    assert SeparableModel.of(ul.Problem(held, stiff_curve, near)).fit(stiff_curve, held.parameters) is None
    falling = ul.Curve(curve.depth, -np.maximum(curve.depth, 0.0))
    assert model.fit(falling, scene.parameters) is None
    deep = ul.Curve(1e3 * curve.depth, curve.force)
    assert model.fit(deep, scene.parameters) is None


#: As in the test of the optimum above.
EQUAL_TO = {"layer.E": 1e-5, "layer.E.stderr": 1e-3, "rms": 1e-5, "reduced_chi_square": 1e-5}


def test_both_routes_give_the_same_row(monkeypatch):
    """A worker that takes the general route for every curve writes the same numbers."""
    model = BatchModel(SCENES["paraboloid"], CONTACT, None, EXACT["solver"])
    layout = Layout.of(list(CONTACT), (), sampled=False)
    places = [CurvePlace(i, f"c{i}", curve=made(SCENES["paraboloid"], i)[1]) for i in range(4)]
    quick = [layout.cells(text) for _, text in CurveFitter(model, layout).rows(places)]
    monkeypatch.setattr(SeparableModel, "fit", lambda *_: None)
    general = [layout.cells(text) for _, text in CurveFitter(model, layout).rows(places)]
    for one, other in zip(quick, general, strict=True):
        for name in layout.kinds:
            if name in EQUAL_TO:
                assert float(one[name]) == pytest.approx(float(other[name]), rel=EQUAL_TO[name])
            elif name not in ("seconds", "reason") and not name.startswith("instrument"):
                assert one[name] == other[name], name
