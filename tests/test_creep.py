"""A given force: creep functions, the depth under them, and the answer to a micro-oscillation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate

import underlay as ul
from underlay.mechanics.response import Remembered
from underlay.mechanics.viscoelastic.bed import Creep, depth_under
from underlay.mechanics.viscoelastic.history import Viscoelastic

SOLID = ul.Prony((0.7,), (0.5,))
RELAXATIONS = [
    SOLID,
    ul.Prony((0.5, 0.3), (0.1, 2.0)),
    ul.Prony((0.5, 0.5), (0.1, 2.0)),
    ul.Prony((1.0,), (0.5,)),
    ul.Prony((0.2, 0.2, 0.1), (1.0, 1.0, 3.0)),
    ul.Prony((0.0,), (1.0,)),
    ul.PowerLawRelaxation(0.2),
]


@pytest.mark.parametrize("relaxation", RELAXATIONS)
def test_creep_and_relaxation_undo_each_other(relaxation):
    """int_0^t j(t - s) de(s) + j(t) e(0) = 1: in Laplace's s, s e(s) times s j(s) is one."""
    modes = relaxation.modes(1e-2, 10.0)
    creep = Creep.of(modes)
    for s in (1e-3, 0.1, 1.0, 30.0):
        e = modes.constant + (modes.weights * s * modes.times / (1.0 + s * modes.times)).sum()
        own = creep.modes
        j = own.constant + (own.weights * s * own.times / (1.0 + s * own.times)).sum() + creep.flow / s
        assert e * j == pytest.approx(1.0, rel=1e-9)


def test_creep_of_a_standard_linear_solid():
    """j(t) = [1 - f exp(-t / lambda)] / (1 - f), lambda = tau / (1 - f)."""
    creep = Creep.of(SOLID.modes(0.0, 1.0))
    time = np.linspace(0.0, 5.0, 11)
    assert creep(time) == pytest.approx((1.0 - 0.7 * np.exp(-time * 0.3 / 0.5)) / 0.3, rel=1e-12)
    # A Maxwell fluid flows: j = 1 + t / tau.
    assert Creep.of(ul.Prony((1.0,), (0.5,)).modes(0.0, 1.0))(time) == pytest.approx(
        1.0 + 2.0 * time, rel=1e-12
    )


@pytest.fixture(scope="module")
def law():
    layer = ul.Layer(ul.Isotropic(1.5, 0.5), 1.0)
    return ul.contact_law(ul.Paraboloid(1.0), layer, ul.RIGID, max_depth=0.9, solver=ul.Exact(rtol=1e-9))


@pytest.mark.parametrize("relaxation", [SOLID, ul.Prony((0.5, 0.3), (0.1, 2.0)), ul.Prony((1.0,), (0.5,))])
def test_depth_control_and_load_control_undo_each_other(law, relaxation):
    """Loading and unloading; of second order in the steps, since the force is straight between the points."""
    response, errors = Remembered(law, Viscoelastic(relaxation)), []
    for points in (121, 241):
        time = np.linspace(0.0, 1.6, points)
        depth = np.where(time <= 1.0, 0.5 * time, 0.5 - (time - 1.0) * 0.5 / 1.5)
        force = response.force(depth, time)
        touching = force > 0.02 * force.max()
        errors.append(np.abs(response.depth(force, time) - depth)[touching].max() / 0.5)
    assert errors[0] < 2e-4
    assert errors[1] < 0.35 * errors[0]


def test_any_history_of_the_force(law):
    """Two cycles, depth control and back; and the bed under one loading and unloading as the closed forms."""
    response = Remembered(law, Viscoelastic(SOLID))
    time = np.linspace(0.0, 3.4, 341)
    depth = 0.5 * np.interp(time, (0.0, 1.0, 1.3, 1.8, 2.2, 2.6, 3.4), (0.0, 0.7, 0.45, 0.9, 0.9, 0.55, 1.0))
    force = response.force(depth, time)
    touching = force > 0.02 * force.max()
    assert np.abs(response.depth(force, time) - depth)[touching].max() < 5e-4
    cycle = np.interp(time, (0.0, 1.0, 2.0, 3.4), (0.0, 0.8, 0.8, 0.1))
    closed = response.depth(cycle, time)
    bed = depth_under(law.force, cycle, SOLID.modes(0.01, 3.4), time, 1.01 * closed.max())
    assert np.abs(bed - closed).max() < 2e-4 * closed.max()


def test_a_held_force_creeps_from_one_elastic_depth_to_the_other(law):
    response = Remembered(law, Viscoelastic(SOLID))
    time = np.linspace(0.0, 60.0, 601)
    depth = response.depth(np.full(601, 0.5), time)
    # A sudden force: at once the elastic depth, then that of the creep function at every moment.
    exact = law.depth(0.5 * Creep.of(SOLID.modes(0.0, 1.0))(time))
    assert depth == pytest.approx(exact, rel=1e-10)
    assert depth[0] == pytest.approx(float(law.depth(0.5)), rel=1e-9)
    assert depth[-1] == pytest.approx(float(law.depth(0.5 / 0.3)), rel=1e-9)


def test_the_surface_recovers_when_the_force_is_gone(law):
    time = np.linspace(0.0, 20.0, 801)
    force = np.interp(time, (0.0, 1.0, 1.5), (0.0, 0.5, 0.0))
    depth = Remembered(law, Viscoelastic(SOLID)).depth(force, time)
    gone = time > 1.5
    assert (np.diff(depth[gone]) < 0.0).all()
    assert 0.0 < depth[-1] < 1e-3 * depth.max()


SCENE = ul.Scene(
    ul.Sphere(1e-3),
    ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=ul.Prony((0.4, 0.3), (0.2, 3.0))),
    ul.RIGID,
    ul.Instrument(contact_depth=1e-6, baseline=1e-4),
)


def test_scene_is_told_its_force():
    time = np.linspace(0.0, 5.0, 201)
    force = np.interp(time, (0.0, 1.0), (1e-4, 0.03))
    curve = ul.simulate(SCENE, force=force, time=time)
    assert curve.depth[0] == pytest.approx(1e-6, rel=1e-9)
    assert SCENE.force(curve.depth, time) == pytest.approx(force, rel=2e-3, abs=1e-5)
    # Without memory it is the inverse of the elastic force, time or none.
    elastic = replace(SCENE, layer=replace(SCENE.layer, relaxation=None))
    assert elastic.force(elastic.depth(force)) == pytest.approx(force, rel=1e-6)


def test_mistakes_of_load_control_are_named():
    time = np.linspace(0.0, 2.0, 21)
    with pytest.raises(ul.InputError, match="must be pressed"):
        SCENE.depth(np.full(21, -1e-3), time)
    with pytest.raises(ul.InputError, match=r"times of every force; pass time"):
        SCENE.depth(np.full(21, 1e-3))
    with pytest.raises(ul.InputError, match="not both"):
        ul.simulate(SCENE, np.zeros(21), time, force=np.zeros(21))
    with pytest.raises(ul.InputError, match="give the depths"):
        ul.simulate(SCENE)
    tilted = replace(SCENE, instrument=ul.Instrument(baseline_slope=1.0))
    with pytest.raises(ul.InputError, match="tilted baseline"):
        tilted.depth(np.full(21, 1e-3), time)


def test_a_micro_oscillation_is_answered_with_the_dynamic_modulus(law):
    """A small sine about a depth held: amplitude and phase of the force after the transient."""
    response = Remembered(law, Viscoelastic(SOLID))
    omega, small = 4.0, 1e-5
    told = complex(response.dynamic_stiffness(0.3, omega / (2.0 * np.pi)))
    time = np.concatenate((np.linspace(0.0, 1.0, 101), np.linspace(1.0, 12.0, 2201)[1:]))
    still = 0.3 * np.minimum(time, 1.0)
    # The oscillation rides on a slow drift inwards, so that the contact never shrinks.
    drift = 1.05 * small * omega * np.maximum(time - 1.0, 0.0)
    wave = small * np.sin(omega * (time - 1.0)) * (time > 1.0)
    force = response.force(still + drift + wave, time) - response.force(still + drift, time)
    last = time > time[-1] - 2.0 * np.pi / omega
    clock = time[last] - 1.0
    share = 2.0 / (clock[-1] - clock[0]) / small
    storage = share * integrate.trapezoid(force[last] * np.sin(omega * clock), clock)
    loss = share * integrate.trapezoid(force[last] * np.cos(omega * clock), clock)
    # The drift makes the contact stiffer by its own 1e-3 of the depth.
    assert complex(storage, loss) == pytest.approx(told, rel=5e-3)
    with pytest.raises(ul.InputError, match="must be positive"):
        response.dynamic_stiffness(0.3, 0.0)
