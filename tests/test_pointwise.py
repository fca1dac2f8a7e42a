"""The modulus depth by depth: laws that hold without noise, what a wrong model shows, and coverage with noise."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.inverse import layer_on, measured
from underlay.inference.pointwise import Body, halfspace_of
from underlay.report import details as pointwise_tables
from underlay.report import screen

ELASTIC = ul.Isotropic(5e6, 0.3)
CLEAN, SOLVER = ul.Noise(force=1e-9), ul.Auto(1e-6)
FREE = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-2e-5, 4e-5)}
WIDE = {"layer.E": (1e4, 1e8), "instrument.contact_depth": (-3e-5, 6e-5), "instrument.baseline": None}


def clean_fit(scene, free=FREE, *, points=400, depth=1.2e-4, fitted=None, noise=CLEAN):
    curve = ul.synthesize(scene, np.linspace(-2e-5, depth, points), noise, rng=1)
    return ul.fit(ul.Problem(fitted or scene, curve, free, noise=noise))


@pytest.mark.parametrize(
    "scene",
    [
        layer_on(ul.RIGID),
        layer_on(ELASTIC),
        layer_on(ELASTIC, compliance=1e-6, baseline=2e-3, baseline_slope=3.0),
        layer_on(ul.RIGID, indenter=ul.Cone(np.deg2rad(70.0))),
        replace(layer_on(ul.RIGID), lever=ul.Lever(2e4, 0.9, 1.1)),
        layer_on(ul.Stack([ul.Layer(ul.Isotropic(3e6, 0.4), 2e-4)], base=ul.RIGID)),
    ],
    ids=["rigid", "elastic", "frame and baseline", "cone", "lever", "stack"],
)
def test_without_noise_every_depth_says_the_modulus(scene):
    found = ul.pointwise_modulus(clean_fit(scene))
    # The ladder of laws is good to 1e-5, the noise of 1e-9 N counts where the force is small.
    np.testing.assert_allclose(found.apparent.modulus[3:], 1e6, rtol=2e-5)
    np.testing.assert_allclose(found.incremental.modulus[3:], 1e6, rtol=2e-4)
    np.testing.assert_allclose(found.apparent.expected, 1e6, rtol=2e-5)


def test_the_half_space_reads_the_ratio_of_the_forces():
    scene = layer_on(ELASTIC)
    found = ul.pointwise_modulus(clean_fit(scene))
    bare = ul.contact_law(scene.indenter, scene.layer, None, max_depth=2e-4, solver="halfspace")
    law = scene.contact_law(2e-4)
    w = found.depth
    np.testing.assert_allclose(
        found.apparent_halfspace.modulus[3:], (1e6 * law.force(w) / bare.force(w))[3:], rtol=2e-5
    )
    np.testing.assert_allclose(
        found.incremental_halfspace.expected, 1e6 * law.stiffness(w) / bare.stiffness(w), rtol=2e-5
    )


def test_the_ladder_of_laws_finds_moduli_far_from_the_fit():
    """The law itself, forward at another modulus, then backward: the check of the ladder's stated error."""
    scene = layer_on(ELASTIC)
    depth = np.linspace(2e-5, 1.2e-4, 12)
    body = Body.of(scene, depth, (), SOLVER)
    assert not body.proportional
    for share in (0.05, 0.7, 1.9, 20.0):
        other = scene.with_values({"layer.E": share * 1e6})
        law = other.contact_law(2e-4)
        w = depth - 1e-5
        told = body.explain(scene.parameters, law.force(w), law.stiffness(w))
        np.testing.assert_allclose(told.apparent, share * 1e6, rtol=2e-5)
        np.testing.assert_allclose(told.incremental, share * 1e6, rtol=5e-5)
        step = 1e-3
        near = body.explain(scene.parameters, law.force(w) * (1.0 + step), law.stiffness(w))
        np.testing.assert_allclose(
            np.log(near.apparent / told.apparent) / np.log1p(step), told.apparent_power, rtol=5e-3
        )


def test_what_no_modulus_explains_is_not_a_number():
    scene = layer_on(ELASTIC)
    depth = np.linspace(2e-5, 1.2e-4, 4)
    told = Body.of(scene, depth, (), SOLVER).explain(
        scene.parameters, np.array([-1.0, 1e-30, 1e30, 0.01]), np.full(4, -1.0)
    )
    assert np.isnan(told.apparent).tolist() == [True, True, True, False]
    assert np.isnan(told.incremental).all()


def test_forces_twice_as_large_are_moduli_twice_as_large():
    scene = layer_on(ul.RIGID)
    curve = measured(scene)
    fits = [
        ul.fit(ul.Problem(scene, ul.Curve(curve.depth, factor * curve.force), FREE, noise=ul.Noise()))
        for factor in (1.0, 2.0)
    ]
    one, two = (ul.pointwise_modulus(fit) for fit in fits)
    np.testing.assert_allclose(two.apparent.modulus, 2.0 * one.apparent.modulus, rtol=1e-5)
    np.testing.assert_allclose(two.incremental.low, 2.0 * one.incremental.low, rtol=1e-5)


def test_a_half_space_has_one_pair_of_moduli():
    scene = halfspace_of(layer_on(ul.RIGID))
    found = ul.pointwise_modulus(clean_fit(scene))
    assert not found.layered
    assert not [name for name in found.table if "halfspace" in name]
    np.testing.assert_allclose(found.apparent.modulus, found.apparent_halfspace.modulus, rtol=1e-12)


def test_a_half_space_fitted_to_a_layer_is_shown_to_be_wrong():
    """The control: where the model is wrong the modulus moves with depth, out of its own intervals."""
    truth = layer_on(ul.RIGID)
    noise = ul.Noise(force=1e-3)
    wrong = ul.pointwise_modulus(clean_fit(truth, fitted=halfspace_of(truth), noise=noise))
    right = ul.pointwise_modulus(clean_fit(truth, noise=noise))

    def held(curve):
        return np.mean((curve.low <= curve.expected) & (curve.expected <= curve.high))

    assert held(wrong.apparent) < 0.5
    assert held(right.apparent) > 0.8
    assert np.ptp(wrong.incremental.modulus) > 3.0 * np.ptp(right.incremental.modulus)


def test_the_intervals_cover():
    scene, noise, depths = layer_on(ul.RIGID), ul.Noise(force=1e-3), np.linspace(-2e-5, 1.2e-4, 300)
    inside = {"apparent": [], "incremental": []}
    free = {**FREE, "instrument.baseline": None}
    for seed in range(20):
        curve = ul.synthesize(scene, depths, noise, rng=seed)
        found = ul.pointwise_modulus(ul.fit(ul.Problem(scene, curve, free, noise=noise)), points=15)
        for name, hits in inside.items():
            known = getattr(found, name)
            hits.append(np.mean((known.low < 1e6) & (known.high > 1e6)))
    # 20 curves of about 14 depths, which hang together by the contact point: about 60 independent ones, whose share
    # of 0.95 has a standard error of 0.028.
    for hits in inside.values():
        assert 0.95 - 3.0 * 0.028 < np.mean(hits) <= 1.0


@pytest.mark.parametrize(
    "relaxation", [ul.Prony((0.5,), (0.5,)), ul.PowerLawRelaxation(0.2, 1.0)], ids=["prony", "power law"]
)
@pytest.mark.parametrize("base", [None, ul.RIGID], ids=["half-space", "rigid base"])
def test_a_sample_with_memory_reads_the_fit_s_modulus_at_every_depth(relaxation, base):
    """What has relaxed by then is in data and model alike: an elastic reading would fall by a fifth and more."""
    thickness = () if base is None else (5e-4,)
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), *thickness, relaxation=relaxation)
    scene = ul.Scene(ul.Paraboloid(1e-3), layer, base)
    depth, time = np.linspace(0.0, 1e-4, 300), np.linspace(0.0, 1.0, 300)
    noise = ul.Noise(force=1e-6)
    curve = ul.synthesize(scene, depth, noise, rng=0, time=time)
    fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, noise=noise))
    found = ul.pointwise_modulus(fit)
    np.testing.assert_allclose(found.apparent.modulus[5:], fit.answer("layer.E").value, rtol=2e-3)
    np.testing.assert_allclose(found.incremental.modulus[5:], fit.answer("layer.E").value, rtol=2e-2)
    np.testing.assert_allclose(found.apparent.expected, fit.answer("layer.E").value, rtol=1e-9)
    assert found.trend == "constant"


TIPS = [ul.Paraboloid(1e-3), ul.Cone(np.deg2rad(70.0)), ul.FlatPunch(3e-4)]


def drifting(tip, base, drift, seed):
    """A curve whose modulus grows by the share `drift` to full depth, with noise of 0.3 % of the largest force."""
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), *(() if base is None else (5e-4,)))
    scene = ul.Scene(tip, layer, base)
    rng = np.random.default_rng(seed)
    depth = np.linspace(-3e-5, 1.2e-4, (150, 400, 1500)[seed % 3])
    w = np.maximum(depth, 0.0)
    force = scene.contact_law(2e-4).force(w) * (1.0 + drift * w / w.max())
    curve = ul.Curve(depth, force + 3e-3 * force.max() * rng.standard_normal(len(depth)))
    return ul.fit(ul.Problem(scene, curve, WIDE))


@pytest.mark.parametrize("base", [None, ul.RIGID], ids=["half-space", "rigid base"])
@pytest.mark.parametrize("tip", TIPS, ids=["paraboloid", "cone", "punch"])
def test_a_constant_modulus_is_called_constant_and_a_drift_is_named(tip, base):
    """One test at four standard deviations: of 720 clean curves, a third of correlated noise, none was misnamed."""
    drifts = (0.0, 12), (0.15, 6), (-0.15, 6)
    constant, risen, fallen = (
        [ul.pointwise_modulus(drifting(tip, base, drift, seed)).trend for seed in range(count)]
        for drift, count in drifts
    )
    assert constant == ["constant"] * 12
    # By 15 % of noise of 0.3 %: five standard deviations and more but for the fewest readings.
    assert "falling" not in risen
    assert risen.count("rising") >= 4
    assert fallen.count("falling") >= 4


def test_the_words_agree_with_the_verdict_where_the_contact_point_hides_a_change():
    """A modulus that grows from contact on: the fitted contact point moves, and the readings hardly rise."""
    tip, layer = ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45))
    scene = ul.Scene(tip, layer, None)
    depth = np.linspace(-1e-5, 1.2e-4, 300)
    w = np.maximum(depth, 0.0)
    force = scene.contact_law(2e-4).force(w) * (1.0 + 0.4 * np.sqrt(w / w.max()))
    noisy = force + 1e-4 * force.max() * np.random.default_rng(1).standard_normal(len(w))
    fit = ul.fit(ul.Problem(scene, ul.Curve(depth, noisy), WIDE))
    assert "rises with depth" in fit.verdict.reason
    words = screen.by_depth_words(fit.modulus_by_depth())
    assert "rising" in words
    assert "constant" not in words


def test_one_number_for_all_depths_does_not_rise():
    found = replace(ul.pointwise_modulus(clean_fit(layer_on(ul.RIGID))), trend="rising")
    assert screen.by_depth_words(found) == "1.00 MPa, constant within its uncertainty"


def test_a_force_lost_in_the_noise_has_an_open_interval_and_raises_no_warning():
    """A detector that saturates: the fit's baseline passes through forces near zero."""
    depth = np.linspace(-1e-6, 1.5e-6, 600)
    w = np.maximum(depth, 0.0)
    force = np.minimum(4.0 / 3.0 * 800.0 / 0.75 * 5e-6**0.5 * w**1.5, 1.2e-9)
    noisy = force + 2e-11 * np.random.default_rng(3).standard_normal(600) * (force < 1.2e-9)
    scene = ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(1e3, 0.5)), None)
    free = {"layer.E": (10.0, 1e6), "instrument.contact_depth": (-1.5e-6, 1e-6), "instrument.baseline": None}
    fit = ul.fit(ul.Problem(scene, ul.Curve(depth, noisy), free))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = fit.modulus_by_depth()
    assert np.isfinite(found.apparent.high).all()


def test_what_cannot_be_read_is_refused():
    fit = clean_fit(layer_on(ul.RIGID))
    scene = ul.Scene(
        ul.Paraboloid(1e-5), ul.Layer(ul.Isotropic(1e4, 0.45), 1e-5), ul.RIGID, adhesion=ul.JKR(1e-4)
    )
    curve = ul.synthesize(scene, np.linspace(0.0, 1e-6, 50), ul.Noise(force=1e-11), rng=0)
    sticking = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e3, 1e6)}, noise=ul.Noise(force=1e-11)))
    few = clean_fit(layer_on(ul.RIGID), points=14)
    for found, more, message in (
        (fit, {"curve": 1}, "curve must be"),
        (fit, {"points": 1}, "points must be 2"),
        (sticking, {}, "sticks"),
        (few, {}, "needs 16 points"),
    ):
        with pytest.raises(ul.UnderlayError, match=message):
            ul.pointwise_modulus(found, **more)


def test_the_page_says_how_many_depths_agree_and_draws_them():
    found = ul.pointwise_modulus(clean_fit(layer_on(ul.RIGID)))
    sentence = pointwise_tables.pointwise_sentence(found)
    assert f"of {len(found.depth)} depths" in sentence
    assert "half-space reads" in sentence
    table = pointwise_tables.pointwise_table(found)
    assert len(table) == 10
    assert table["from the force, layer in the model (MPa)"].str.startswith(("1.0", "1 ", "0.999")).all()
    ax = ul.plots.pointwise_modulus(found)
    assert "half-space" in [line.get_label() for line in ax.get_lines()]
    assert {"half-space (Hertz)", "layer on substrate"} <= {text.get_text() for text in ax.texts}
    assert ax.get_ylim()[0] == 0.0
    ul.plots.pointwise_modulus(found, ax=ax)
