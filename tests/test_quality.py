"""The verdict on a curve: what is good passes, and each fault is named."""

import numpy as np
import pytest

import underlay as ul
from underlay.data import quality as module
from underlay.data.quality import DOUBTFUL, GOOD, REFUSED

RNG_SEED = 21


def made(exponent=1.5, *, noise=0.003, points=500, scale=1e-6, **metadata):
    rng = np.random.default_rng(RNG_SEED)
    x = np.linspace(-1.0, 1.0, points)
    force = np.clip(x, 0.0, None) ** exponent + noise * rng.standard_normal(points)
    return ul.Curve(x * scale, force * 1e-8, time=np.arange(points) * 0.01, metadata=metadata)


def told(curve, scene=None):
    return ul.check_quality(curve, scene)


def test_a_clean_curve_is_good():
    quality = told(made())
    assert (quality.verdict, quality.reasons) == (GOOD, ())
    assert quality.exponent == pytest.approx(1.5, abs=0.1)
    assert quality.signal_to_noise == pytest.approx(1 / 0.003, rel=0.3)
    quality.require()


@pytest.mark.parametrize(("exponent", "why"), [(0.75, "a wrong contact point"), (2.6, "a stiffer substrate")])
def test_a_wrong_exponent_is_named(exponent, why):
    quality = told(made(exponent))
    assert quality.verdict == DOUBTFUL
    assert any("where depth^1.50 is expected" in reason and why in reason for reason in quality.reasons)


def test_the_scene_says_which_exponent_to_expect():
    """A thin incompressible layer is far steeper than a half-space, and rightly so."""
    scene = ul.Scene(ul.Paraboloid(20e-6), ul.Layer(ul.Isotropic(1e4, 0.5), 1.5e-6), ul.RIGID)
    x = np.linspace(-1e-6, 1e-6, 500)
    force = scene.force(np.clip(x, 0.0, None))
    force = force + 0.002 * force[-1] * np.random.default_rng(2).standard_normal(500)
    curve = ul.Curve(x, force)
    with_scene = told(curve, scene)
    assert with_scene.expected_exponent > 1.9
    assert not any("grows as depth^" in reason for reason in with_scene.reasons)
    assert any("grows as depth^" in reason for reason in told(curve).reasons)


def test_a_slip_is_named():
    curve = made()
    force = np.array(curve.force)
    force[curve.depth > 0.7e-6] -= 0.2e-8
    assert any(
        "the tip slipped, or the sample broke" in reason
        for reason in told(ul.Curve(curve.depth, force)).reasons
    )


def test_cycles_are_told_and_are_no_slip():
    once = made()
    depth = np.tile(np.concatenate((once.depth, once.depth[::-1])), 3)
    force = np.tile(np.concatenate((once.force, once.force[::-1])), 3)
    reasons = told(ul.Curve(depth, force)).reasons
    assert any(reason.startswith("the sample is loaded 3 times: ") for reason in reasons)
    assert not any("slipped" in reason for reason in reasons)
    # A slip in one of them is still one.
    force[(np.arange(len(force)) < 500) & (depth > 0.7e-6)] -= 0.2e-8
    assert any(
        "the tip slipped, or the sample broke" in reason for reason in told(ul.Curve(depth, force)).reasons
    )


def test_a_weak_curve_is_named():
    assert any("times the noise" in reason for reason in told(made(noise=0.08)).reasons)


def test_few_points_are_named():
    quality = told(made(points=30))
    assert any("points beyond contact" in reason for reason in quality.reasons)


def test_a_ball_too_deep_for_its_paraboloid():
    deep = made(scale=1e-5, indenter_radius=1e-5)
    assert any("no sphere holds contact so deep" in r or "choose the sphere" in r for r in told(deep).reasons)
    half = made(scale=4e-6, indenter_radius=1e-5)
    assert any(
        "there a paraboloid is off by 4 % in force; choose the sphere" in r for r in told(half).reasons
    )
    assert told(made(scale=1e-7, indenter_radius=1e-5)).verdict == GOOD
    scene = ul.Scene(ul.Sphere(1e-5), ul.Layer(ul.Isotropic(1e4, 0.5)))
    assert not any("paraboloid" in reason for reason in told(half, scene).reasons)


@pytest.mark.parametrize(
    ("curve", "why"),
    [
        (ul.Curve(np.arange(5.0), np.arange(5.0)), "at least 8"),
        (ul.Curve(np.arange(20.0), np.zeros(20)), "force is zero"),
        (ul.Curve(-np.arange(20.0), np.arange(20.0)), "never increases"),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_the_reason(curve, why):
    quality = told(curve)
    assert quality.verdict == REFUSED
    assert why in quality.reasons[0]
    with pytest.raises(ul.CurveError, match=why):
        quality.require()


def test_a_failed_search_and_a_force_as_small_is_a_test_in_air():
    weak = made(1.0, search_criterion=1e-8, search_reached=0.4e-8)
    assert told(weak).verdict == REFUSED
    assert "no contact: the search for it stopped" in told(weak).reasons[0]
    # The same curve with a force far beyond what was searched for was in contact after all.
    assert told(made(1.5, search_criterion=1e-9, search_reached=0.4e-9)).verdict == GOOD


def test_a_ball_against_its_paraboloid():
    """In plain numbers what the indenters say, and half of what is allowed where it is not asked."""
    radius = 2e-3
    for ratio in (module._SHALLOW, 0.2, 0.5, 2.0):
        depth = np.array([ratio * radius])
        ball, paraboloid = (
            ul.Scene(tip, ul.Layer(ul.Isotropic(1e3, 0.4))).force(depth)[0]
            for tip in (ul.Sphere(radius), ul.Paraboloid(radius))
        )
        assert module._ball_against_paraboloid(ratio) == pytest.approx(paraboloid / ball - 1.0, rel=1e-9)
    assert module._ball_against_paraboloid(module._SHALLOW) < 0.51 * module._SHAPE
