"""Which second tip would fix what one test leaves open: the forecast against the joint fit itself."""

import numpy as np
import pytest

import underlay as ul
from underlay.report import limits

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
    found = ul.second_test(fit, H)
    assert fit.stderr[H] > 0.15 * fit.values[H]
    assert found.radius > 2e-4
    joint = ul.fit(ul.Problem.joint([pressed(2e-4, 1), pressed(found.radius, 2)], [E, H, C], [E, H], NOISE))
    # The interval of the first fit holds the true thickness, so no worse can come than the worst that is said; the
    # joint fit's own place moves its error by as much as in the test below.
    shares = found.shares[:, found.radii == found.radius]
    assert joint.stderr[H] < 1.25 * shares.max() * joint.values[H]
    assert found.values[0] == pytest.approx(fit.interval(H).low, rel=1e-9)
    assert (shares <= 0.1).all()


def test_one_supposed_value_promises_too_much(fit):
    """The control: what the optimum alone promises is not what most of the interval gets."""
    alone = ul.second_test(fit, H, value=fit.interval(H).low)
    over = ul.second_test(fit, H)
    same = over.shares[:, over.radii == alone.radius][:, 0]
    assert alone.shares[0, alone.radii == alone.radius] <= 0.1
    assert same.max() > 1.5 * float(alone.shares[0, alone.radii == alone.radius][0])


def test_it_says_for_which_values_it_would_not_do(fit):
    strict = ul.second_test(fit, H, target=0.02)
    fixed = strict.shares[:, strict.radii == strict.radius][:, 0] <= 0.02
    assert fixed.any()
    assert not fixed.all()
    last, first = strict.values[fixed][-1], strict.values[~fixed][0]
    assert last < first
    assert strict.sentence.endswith(
        f"% if it is {1e3 * last:.4g} mm or less, but not if it is {1e3 * first:.4g} mm"
    )


def test_supposed_values_are_forecast_to_the_joint_fit_s_own_error(fit):
    found = ul.second_test(fit, H, value=1e-3)
    joint = ul.fit(ul.Problem.joint([pressed(2e-4, 1), pressed(found.radius, 2)], [E, H, C], [E, H], NOISE))
    forecast = found.stderr[0, found.radii == found.radius][0]
    # With the truth supposed only the first test's small share and the scatter of its own fit are left.
    assert joint.stderr[H] == pytest.approx(forecast, rel=0.25)


def test_no_tip_fixes_a_layer_without_end(fit):
    found = ul.second_test(fit, H, value=1.0)
    assert found.radius is None
    assert "no second sphere between" in found.sentence
    assert "measure it otherwise" in found.sentence


def test_the_nearest_tip_that_is_enough_is_named(fit):
    found = ul.second_test(fit, H)
    enough = (found.shares <= 0.1).sum(axis=0)
    distance = np.abs(np.log(found.radii / 2e-4))
    assert np.abs(np.log(found.radius / 2e-4)) == distance[enough == enough.max()].min()


def test_what_cannot_be_advised_is_said(fit):
    with pytest.raises(ul.ParameterError, match="must be a fitted parameter of layer or substrate"):
        ul.second_test(fit, C)
    joint = ul.fit(ul.Problem.joint([pressed(2e-4, 1), pressed(1e-3, 2)], [E, H, C], [E, H], NOISE))
    with pytest.raises(ul.InputError, match="of one curve; this one is of 2"):
        ul.second_test(joint, H)
    cone = ul.Scene(ul.Cone(np.deg2rad(70.0)), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    curve = ul.synthesize(cone, np.linspace(0.0, 1e-4, 50), ul.Noise(force=1e-6), 0)
    with pytest.raises(ul.ParameterError, match="another radius, which Cone"):
        ul.second_test(ul.fit(ul.Problem(cone, curve, [E])), E)


def test_the_advice_says_which_tip_would_fix_what_is_open(fit):
    assert np.isinf(fit.interval(H).high)
    assert f"Layer thickness: {ul.second_test(fit, H).sentence}." in limits.advice(fit)


def test_the_former_name_says_the_new_one(fit):
    with pytest.warns(ul.UnderlayWarning, match="ul.second_test"):
        former = ul.remedy(fit, H, value=1e-3)
    assert former.sentence == ul.second_test(fit, H, value=1e-3).sentence
