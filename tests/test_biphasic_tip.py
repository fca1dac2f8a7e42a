"""Sphere and paraboloid on a draining layer: the moving contact against reference values, its order, its ends."""

import numpy as np
import pytest
from scipy.optimize import brentq

from biphasic_reference import SPHERE_PEAKS, SPHERES, STEPS, isotropic, transverse
from underlay.errors import InputError, RangeError
from underlay.mechanics.biphasic.contacts import DrainingTip
from underlay.mechanics.biphasic.history import Polyline, ramp_and_hold
from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse
from underlay.mechanics.biphasic.moving import MovingContact
from underlay.mechanics.biphasic.transfer import PunchTransfer, Relaxing, relaxation
from underlay.mechanics.indenters import Cone, Paraboloid, Sphere
from underlay.mechanics.relaxation import Modes


def material_of(name):
    return transverse(name) if isinstance(name, str) else isotropic(name)


def ramped(row, steps):
    name, thickness, duration, tip, w0, P0, Pinf, time, expected = SPHERES[row]
    contact = DrainingTip(Paraboloid(1.0), material_of(name), thickness, tip, steps=steps)
    assert float(contact.undrained(w0).force(w0)) == pytest.approx(P0, rel=1e-7)
    assert float(contact.drained(w0).force(w0)) == pytest.approx(Pinf, rel=1e-7)
    return contact.force(ramp_and_hold(w0, duration), time) / P0 - expected


@pytest.mark.parametrize("row", range(len(SPHERES)))
def test_ramps(row):
    stiff = isinstance(SPHERES[row][0], str)
    assert np.abs(ramped(row, 20)).max() < (5e-4 if stiff else 1.6e-4)


@pytest.mark.parametrize("row", range(len(STEPS)))
def test_sudden_steps(row):
    thickness, tip, w0, time, expected = STEPS[row]
    contact = DrainingTip(Paraboloid(1.0), isotropic(0.3), thickness, tip)
    start, end = (float(law(w0).force(w0)) for law in (contact.undrained, contact.drained))
    found = (contact.force(ramp_and_hold(w0, 0.0), time) - end) / (start - end)
    assert np.abs(found - expected).max() < 6e-4


def moving(material, steps, ramp=0.1, tip="solid", w0=0.559415486, modes=None, hold=2):
    count = hold * steps
    depth = w0 * np.minimum(np.arange(1, count + 1) / steps, 1.0)
    contact = MovingContact(material.skeleton, 1.0, tip, ramp / steps, count, modes=modes)
    return contact.run(depth, lambda r: 0.5 * r * r, np.sqrt(2.0 * depth))


def test_radii():
    found = moving(isotropic(0.3), 20, hold=6)
    index = np.array([5, 10, 20, 24, 30, 40, 60, 120]) - 1
    expected = [0.447, 0.670, 1.006, 1.003, 0.997, 0.987, 0.9695, 0.939]
    assert np.abs(found.radius[index] - expected).max() < 8e-4


@pytest.mark.parametrize("tip", ["solid", "porous"])
def test_fixed_radius_is_the_punch(tip):
    skeleton, dt = isotropic(0.3).skeleton, 0.01
    force = MovingContact(skeleton, 1.0, tip, dt, 60).fixed(np.ones(60), 1.0) / (4.0 * skeleton.theta_drained)
    index = np.array([10, 30, 60]) - 1
    exact = relaxation(PunchTransfer(skeleton, 1.0, tip)).step(dt * (index + 0.5))
    assert np.abs(force[index] / exact - 1.0).max() < 4e-4


def test_a_relaxing_skeleton_under_a_fixed_radius():
    skeleton, dt = isotropic(0.3).skeleton, 0.01
    modes = Modes(0.4, np.array([0.6]), np.array([0.3]))
    force = MovingContact(skeleton, 1.0, "solid", dt, 60, modes=modes).fixed(np.ones(60), 1.0)
    index = np.array([10, 30, 60]) - 1
    exact = relaxation(Relaxing(PunchTransfer(skeleton, 1.0, "solid"), modes)).step(dt * (index + 0.5))
    assert np.abs(force[index] / (4.0 * skeleton.theta_drained) / exact - 1.0).max() < 1e-3


def test_a_relaxing_skeleton_that_has_drained_follows_lee_and_radok():
    # The ramp is a hundred times slower than the water: P = int e(t - s) dP_drained(w(s)).
    material, ramp, modes = (isotropic(0.3), 100.0, Modes(0.4, np.array([0.6]), np.array([30.0])))
    contact = DrainingTip(Paraboloid(1.0), material, 1.0, "porous", modes)
    undrained = contact.undrained(0.5)
    unit = material.drainage_time(float(undrained.contact_radius(0.5)))
    time = np.linspace(0.0, ramp * unit, 4001)
    elastic = contact.drained(0.5).force(0.5 * time / time[-1])
    middle = 0.5 * (time[1:] + time[:-1])
    expected = modes(time[-1] - middle) @ np.diff(elastic)
    slow = MovingContact(
        material.skeleton,
        1.0 / np.sqrt(unit),
        "porous",
        1.0,
        100,
        modes=Modes(0.4, modes.weights, modes.times / unit),
    )
    length = np.sqrt(unit)
    depth = 0.5 * np.arange(1, 101) / 100.0
    found = slow.run(depth / length, lambda r: 0.5 * length * r * r, undrained.contact_radius(depth) / length)
    assert found.force[-1] * length**2 == pytest.approx(expected, rel=1e-2)


def test_no_relaxation_of_the_skeleton_is_none():
    none = Modes(1.0, np.zeros(1), np.ones(1))
    with_, without = (moving(isotropic(0.3), 10, modes=modes) for modes in (none, None))
    assert np.abs(with_.force / without.force - 1.0).max() < 1e-9


def test_transversely_isotropic_with_isotropic_constants():
    same = BiphasicTransverse(2.6, 2.6, 0.3, 0.3, 1.0, isotropic(0.3).permeability)
    both = [moving(material, 10).force for material in (same, isotropic(0.3))]
    assert np.abs(both[0] / both[1] - 1.0).max() < 1e-8


def test_long_holds_end_on_the_drained_law_and_levels_join():
    contact = DrainingTip(Paraboloid(1.0), isotropic(0.3), 1.0, "solid")
    w0, time = 0.559415486, np.array([0.4, 0.59, 0.61, 1.0, 2.3, 2.5, 30.0])
    found = contact.force(ramp_and_hold(w0, 0.1), time)
    one_level = moving(isotropic(0.3), 20, hold=12).force
    assert np.abs(found[:3] / one_level[[79, 117, 121]] - 1.0).max() < 6e-4
    assert (np.diff(found) < 0.0).all()
    assert found[-1] / float(contact.drained(w0).force(w0)) == pytest.approx(1.0, abs=1e-6)


def test_several_ramps():
    material = isotropic(0.3)
    contact = DrainingTip(Paraboloid(1.0), material, 1.0, "solid")
    straight = contact.force(ramp_and_hold(0.5, 0.2), [0.1, 0.2, 0.3])
    broken = contact.force(Polyline([0.0, 0.1, 0.2], [0.0, 0.25, 0.5]), [0.1, 0.2, 0.3])
    assert np.abs(broken / straight - 1.0).max() < 1e-3
    stepped = Polyline([0.0, 0.1, 0.4, 0.5], [0.0, 0.3, 0.3, 0.5])
    found = contact.force(stepped, np.linspace(0.01, 1.0, 100))
    assert np.isfinite(found).all()
    assert found[9] > found[39]
    assert found[49] == found.max()


def test_an_approach_before_contact():
    contact = DrainingTip(Paraboloid(1.0), isotropic(0.3), 1.0, "porous")
    touching = contact.force(ramp_and_hold(0.3, 0.1), [0.05, 0.1, 0.2])
    approached = contact.force(Polyline([-0.2, 0.1], [-0.6, 0.3]), [-0.1, 0.0, 0.05, 0.1, 0.2])
    assert approached[:2].tolist() == [0.0, 0.0]
    assert np.abs(approached[2:] / touching - 1.0).max() < 1e-9
    at_once = contact.force(ramp_and_hold(0.3, 0.0), [-1.0, 0.0])
    assert at_once == pytest.approx([0.0, float(contact.undrained(0.3).force(0.3))])


def test_a_small_sphere_is_a_paraboloid():
    material, depth = isotropic(0.3), ramp_and_hold(1e-3, 1e-4)
    both = [
        DrainingTip(tip(1.0), material, 0.5, "solid").force(depth, [1e-4, 1e-3])
        for tip in (Sphere, Paraboloid)
    ]
    assert np.abs(both[0] / both[1] - 1.0).max() < 5e-4


def test_scaling():
    one = DrainingTip(Paraboloid(1.0), Biphasic(1.0, 0.2, 1.0), 1.0, "solid")
    two = DrainingTip(Paraboloid(1e-3), Biphasic(2e5, 0.2, 1e-15), 1e-3, "solid")
    unit = two.material.drainage_time(1e-3) / one.material.drainage_time(1.0)
    time = np.array([0.05, 0.1, 0.3])
    first = one.force(ramp_and_hold(0.3, 0.1), time)
    second = two.force(ramp_and_hold(0.3e-3, 0.1 * unit), time * unit)
    assert np.abs(second / (first * 0.2) - 1.0).max() < 1e-7


@pytest.mark.parametrize("ratio", list(SPHERE_PEAKS))
def test_peak_over_equilibrium_at_equal_depth(ratio):
    stiff = BiphasicTransverse(ratio or 1.0, 1.0, 0.2, 0.1, 1.0 / 2.2, 1.0)
    material = stiff if ratio > 0.0 else Biphasic(1.0, 0.0, 1.0)
    for eps, expected in SPHERE_PEAKS[ratio]:
        contact = DrainingTip(Paraboloid(1.0), material, 1.0, "solid")
        law = contact.undrained(2.5)
        w = brentq(lambda depth, law=law, eps=eps: float(law.contact_radius(depth)) - eps, 1e-4, 2.5)
        assert float(law.force(w) / contact.drained(2.5).force(w)) == pytest.approx(
            expected, rel=3e-4, abs=6e-4
        )


def test_refusals():
    contact = DrainingTip(Paraboloid(1.0), isotropic(0.3), 1.0, "solid")
    with pytest.raises(InputError, match=r"falls back by 0\.2 m of 0\.5 m"):
        contact.force(Polyline([0.0, 1.0, 2.0], [0.0, 0.5, 0.3]), [2.0])
    with pytest.raises(RangeError, match=r"1\.2 m in a layer 1 m thick") as caught:
        contact.force(ramp_and_hold(1.2, 0.1), [0.1])
    assert caught.value.max_depth == 1.0
    with pytest.raises(InputError, match="sudden step at"):
        contact.force(Polyline([0.0, 0.1, 0.2, 0.2], [0.0, 0.1, 0.1, 0.2]), [0.3])
    with pytest.raises(RangeError, match="needs 20001 steps of time"):
        contact.force(Polyline([0.0, 0.01, 9.9, 10.0], [0.0, 0.1, 0.1, 0.2]), [10.0])
    with pytest.raises(InputError, match="never touches"):
        contact.force(ramp_and_hold(-0.1, 0.1), [0.1])
    with pytest.raises(InputError, match="under flat punches, spheres and paraboloids"):
        DrainingTip(Cone(1.0), isotropic(0.3), 1.0, "solid")
