"""Which second tip would fix what one test leaves open: the forecast against the joint fit itself."""

import numpy as np
import pytest

import underlay as ul
from underlay.errors import InputError, ParameterError
from underlay.report import words

E, H, C = "layer.E", "layer.thickness", "instrument.contact_depth"
DEPTH, NOISE = 2e-5, ul.Noise(force=1e-5)


def scene(radius, thickness=1e-3):
    return ul.Scene(ul.Sphere(radius), ul.Layer(ul.Isotropic(1e6, 0.45), thickness), ul.RIGID)


def pressed(radius, seed, thickness=1e-3):
    depth = np.linspace(-DEPTH / 3.0, DEPTH, 200)
    return scene(radius, thickness), ul.synthesize(scene(radius, thickness), depth, NOISE, seed)


@pytest.fixture(scope="module")
def fit():
    test, curve = pressed(2e-4, 1)
    return ul.fit(ul.Problem(test, curve, [E, H, C], NOISE))


def test_the_tip_it_names_does_what_it_says(fit):
    found = ul.remedy(fit, H)
    assert fit.stderr[H] > 0.15 * fit.values[H]
    assert found.radius > 2e-4
    joint = ul.fit(ul.Problem.joint([pressed(2e-4, 1), pressed(found.radius, 2)], [E, H, C], [E, H], NOISE))
    # The forecast supposes the first fit's thickness, twice the true one, and so promises less than there is.
    assert joint.stderr[H] < 0.1 * joint.values[H]


def test_supposed_values_are_forecast_to_the_joint_fit_s_own_error(fit):
    found = ul.remedy(fit, H, value=1e-3)
    joint = ul.fit(ul.Problem.joint([pressed(2e-4, 1), pressed(found.radius, 2)], [E, H, C], [E, H], NOISE))
    forecast = found.stderr[found.radii == found.radius][0]
    # With the truth supposed only the first test's small share and the scatter of its own fit are left.
    assert joint.stderr[H] == pytest.approx(forecast, rel=0.25)


def test_no_tip_fixes_a_layer_without_end(fit):
    found = ul.remedy(fit, H, value=1.0)
    assert found.radius is None
    assert "no second sphere between" in found.sentence
    assert "measure it otherwise" in found.sentence


def test_the_nearest_tip_that_is_enough_is_named(fit):
    found = ul.remedy(fit, H)
    enough = found.stderr <= 0.1 * found.value
    distance = np.abs(np.log(found.radii / 2e-4))
    assert np.abs(np.log(found.radius / 2e-4)) == distance[enough].min()


def test_what_cannot_be_advised_is_said(fit):
    with pytest.raises(ParameterError, match="must be a fitted parameter of layer or substrate"):
        ul.remedy(fit, C)
    joint = ul.fit(ul.Problem.joint([pressed(2e-4, 1), pressed(1e-3, 2)], [E, H, C], [E, H], NOISE))
    with pytest.raises(InputError, match="of one curve; this one is of 2"):
        ul.remedy(joint, H)
    cone = ul.Scene(ul.Cone(np.deg2rad(70.0)), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    curve = ul.synthesize(cone, np.linspace(0.0, 1e-4, 50), ul.Noise(force=1e-6), 0)
    with pytest.raises(ParameterError, match="another radius, which Cone"):
        ul.remedy(ul.fit(ul.Problem(cone, curve, [E])), E)


def test_the_summary_says_which_tip_would_fix_what_is_open(fit):
    text = words.summary(fit)
    assert np.isinf(fit.interval(H).high)
    low = fit.interval(H).low
    assert "the data set no upper end" in text
    expected = ul.remedy(fit, H, value=2.0 * low).sentence
    assert f"Layer thickness, were it {2e3 * low:.4g} mm: {expected}." in text
