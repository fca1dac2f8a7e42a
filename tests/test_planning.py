"""Planning: what the grid promises is what a fit of such a test finds."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on

E, H, C = "layer.E", "layer.thickness", "instrument.contact_depth"
SCENE = layer_on(ul.RIGID)
NOISE = ul.Noise(force=2e-4)
RADII, DEPTHS = np.geomspace(1e-4, 3e-3, 4), np.geomspace(2e-5, 2e-4, 4)


@pytest.fixture(scope="module")
def grid():
    return ul.plan(SCENE, free=[E, H, C], noise=NOISE, radii=RADII, depths=DEPTHS)


def curve_of(radius, depth, rng=0):
    scene = SCENE.with_values({"indenter.radius": radius})
    readings = np.linspace(-depth / 3.0, depth, 200) + 1e-5
    return scene, ul.synthesize(scene, readings, time=np.arange(200.0), noise=NOISE, rng=rng)


def test_the_promise_is_kept_by_a_fit(grid):
    radius, depth = grid.best
    i, j = list(RADII).index(radius), list(DEPTHS).index(depth)
    scene, curve = curve_of(radius, depth)
    # Evaluated at the fit instead of the truth: first order in the relative error, a few per cent.
    assert ul.fit(ul.Problem(scene, curve, [E, H, C], NOISE)).stderr[E] == pytest.approx(
        grid.stderr[i, j], rel=0.1
    )


def test_two_tests_together_are_what_a_joint_fit_finds(grid):
    first = (RADII[0], DEPTHS[2])
    both = grid.second(*first)
    i, j = 3, 1
    tests = [curve_of(*first, rng=1), curve_of(RADII[i], DEPTHS[j], rng=2)]
    joint = ul.fit(ul.Problem.joint(tests, [E, H, C], shared=[E, H], noise=NOISE))
    assert joint.stderr[E] == pytest.approx(both.stderr[i, j], rel=0.25)
    assert (both.stderr <= grid.stderr * (1.0 + 1e-9)).all()


def test_deeper_tells_more(grid):
    assert (np.diff(grid.stderr[0]) < 0.0).all()


def test_the_recommendation_is_the_mildest_of_the_good(grid):
    radius, depth = grid.best
    i, j = list(RADII).index(radius), list(DEPTHS).index(depth)
    good = grid.stderr <= 1.1 * grid.stderr.min()
    assert good[i, j]
    assert grid.peak_force[i, j] == grid.peak_force[good].min()
    half = 1.96 * grid.stderr[i, j] / grid.value
    assert "layer.E to ± " in grid.recommendation
    assert f"({100.0 * half:.2g} %) at 95 %, from the noise alone" in grid.recommendation
    assert "force up to" in grid.recommendation
    assert grid.interval is None
    assert grid.to_frame().shape == (4, 4)


def test_above_ten_per_cent_it_promises_an_interval_not_an_error():
    # A small tip hardly feels the base: linear, the error is a third; the test itself would set no upper end.
    far = ul.plan(SCENE, free=[E, H, C], noise=NOISE, radii=[1e-4], depths=[4e-5], parameter=H)
    assert 0.1 * far.value < far.stderr[0, 0] < np.inf
    scene, _ = curve_of(1e-4, 4e-5)
    made = ul.simulate(scene, np.linspace(-4e-5 / 3.0, 4e-5, 200) + 1e-5)
    own = ul.profile(ul.fit(ul.Problem(scene, made, [E, H, C], NOISE)), H).interval()
    assert far.interval.low == pytest.approx(own.low, rel=1e-3)
    assert far.interval.high_reason == own.high_reason
    assert f"the best test of this grid does not determine it: {far.interval}" in far.recommendation
    assert "to no better than ± 20 % (95 %)" in far.second(1e-4, 4e-5).recommendation


def test_a_prior_helps_where_the_data_do_not(grid):
    helped = ul.plan(
        SCENE, free={E: None, H: ul.Normal(5e-4, 1e-5), C: None}, noise=NOISE, radii=RADII, depths=DEPTHS
    )
    assert (helped.stderr <= grid.stderr).all()
    assert helped.stderr[0, 0] < 0.5 * grid.stderr[0, 0]


def test_a_test_that_cannot_be_done_is_left_out():
    # A true sphere of 50 um cannot go 200 um deep: its contact would pass the equator.
    sphere = layer_on(ul.RIGID, indenter=ul.Sphere(1e-3))
    mixed = ul.plan(sphere, free=[E, C], noise=NOISE, radii=[5e-5, 1e-3], depths=[1e-5, 4e-4])
    assert np.isnan(mixed.stderr[0, 1])
    assert (0, 1) in mixed.refusals
    assert np.isfinite(mixed.stderr[1]).all()
    with pytest.raises(ul.InputError, match="cannot be done"):
        mixed.second(5e-5, 4e-4)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"parameter": "layer.nu"}, ul.ParameterError, "must be a free parameter"),
        ({"noise": ul.Noise()}, ul.InputError, "noise must be given"),
        ({"radii": [0.0]}, ul.InputError, "positive"),
        ({"depths": [[1e-5]]}, ul.InputError, "one row"),
        ({"free": ["layer.EE"], "parameter": "layer.EE"}, ul.ParameterError, "did you mean"),
    ],
)
def test_bad_input(change, error, message):
    with pytest.raises(error, match=message):
        ul.plan(SCENE, **({"free": [E, C], "noise": NOISE, "radii": RADII, "depths": DEPTHS} | change))


def test_a_tip_without_a_radius():
    with pytest.raises(ul.ParameterError, match="does not have"):
        ul.plan(layer_on(ul.RIGID, indenter=ul.Cone(1.2)), free=[E], noise=NOISE, radii=[1e-3], depths=[1e-5])


def test_stated_uncertainties_decide_where_the_noise_is_small():
    """A wide flat punch on a thin layer is read best, and depends most on Poisson's ratio."""
    free = {E: (1e4, 1e8), C: (-5e-5, 5e-5)}
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3)
    known = ul.Scene(ul.FlatPunch(6e-4), layer, ul.RIGID)
    unsure = replace(known, uncertainties={"layer.nu": 0.02, "layer.thickness": 2e-5})
    asked = {"free": free, "noise": ul.Noise(force=2e-3), "radii": [3e-4, 6e-4, 3e-3], "depths": [4e-5]}
    alone, whole = ul.plan(known, **asked), ul.plan(unsure, **asked)
    assert alone.combined is None
    assert alone.best[0] == 3e-3
    assert whole.stderr == pytest.approx(alone.stderr)
    assert whole.best[0] == 3e-4
    assert whole.combined[2, 0] > 3.0 * whole.combined[0, 0]
    # What a fit of such a test says.
    for i, radius in enumerate(asked["radii"][:2]):
        scene = unsure.with_values({"indenter.radius": radius})
        curve = ul.simulate(scene, np.linspace(-4e-5 / 3.0, 4e-5, 200), time=np.linspace(0.0, 1.0, 200))
        told = ul.fit(ul.Problem(scene, curve, free, ul.Noise(force=2e-3))).answer(E)
        # To first order in uncertainties of up to 7 %, and without the mean shift of friction.
        assert 1.96 * whole.combined[i, 0] == pytest.approx(0.5 * (told.high - told.low), rel=0.05)
    share = 100.0 * 1.96 * whole.combined[0, 0] / 1e6
    assert f"({share:.2g} %) at 95 %, with the uncertainties of inputs and model" in whole.recommendation
    assert "from the noise alone" in whole.recommendation
    assert whole.to_frame().iloc[1, 0] == whole.combined[1, 0]
    assert whole.second(6e-4, 4e-5).combined is None


def test_a_sample_that_remembers_is_planned_with_its_motion():
    """Without times a test would be taken to last a second, in which no relaxation of a minute is seen."""
    relaxing = replace(SCENE, layer=replace(SCENE.layer, relaxation=ul.Prony((0.3,), (3.0,))))
    asked = {"free": [E, C], "noise": NOISE, "radii": [1e-3], "depths": [1e-4]}
    with pytest.raises(ul.InputError, match="planned with the motion of the test"):
        ul.plan(relaxing, **asked)
    time = np.linspace(0.0, 61.0, 200)
    record = (np.minimum(time, 1.0) - 0.25, time)
    free = [E, C, "layer.relaxation.fractions[0]", "layer.relaxation.times[0]"]
    assert np.isfinite(ul.plan(relaxing, **asked | {"free": free}, record=record).stderr).all()
