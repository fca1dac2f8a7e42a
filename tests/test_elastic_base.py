"""A relaxing layer on an elastic base: the exact punch, the quasi-elastic force and where it is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import special

import underlay as ul
from support.ageing_contact import kernel_polynomials, step_by_step
from underlay.mechanics.relaxation import Modes
from underlay.mechanics.viscoelastic.elastic_base import QuasiElastic, punch_relaxation, stated_error

NU, BASE_NU = 0.5, 0.3


def scene(tip, ratio, m0, *, relaxes=(1.0,)):
    """A layer of modulus 1 and thickness 1 that keeps 1 / ratio of it, on a base m0 times softer in shear."""
    base = (1.0 + BASE_NU) / (m0 * (1.0 + NU))
    share = (1.0 - 1.0 / ratio) / len(relaxes)
    relaxation = ul.Prony((share,) * len(relaxes), relaxes)
    return ul.Scene(
        tip, ul.Layer(ul.Isotropic(1.0, NU), 1.0, relaxation=relaxation), ul.Isotropic(base, BASE_NU)
    )


def test_a_sum_of_springs_gives_its_own_relaxation():
    """A layer in series with a spring, whose relaxation is known: 1 / (1 / E + 1 / b)."""
    found = punch_relaxation(lambda m: m / (m + 3.0), Modes(0.2, np.array([0.8]), np.array([2.0])))
    # E*(s) = 0.2 + 0.8 s / (s + 1/2): (s + 0.1) / (s + 0.5); K = (s + 0.1) / (4 s + 1.6): falls in 2.5 s.
    time = np.linspace(0.0, 10.0, 21)
    exact = (0.0625 + 0.1875 * np.exp(-0.4 * time)) / 0.25
    assert found.modulus(time) == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(("ratio", "m0", "radius"), [(2.0, 1.0, 1.0), (10.0, 1.0, 0.3), (10.0, 0.1, 3.0)])
def test_punch_obeys_the_laplace_transform(ratio, m0, radius):
    """At real s the transform of the force is the elastic stiffness at the modulus s E(s)."""
    made = scene(ul.FlatPunch(radius), ratio, m0)
    # Gauss-Laguerre in s t: e(t) varies over its own times, so many s are near those of the weights.
    x, weight = special.roots_laguerre(100)
    for s in (0.5, 1.0, 3.0):
        time = np.concatenate(([0.0], x / s))
        held = made.force(np.full(len(time), 1e-3), time)[1:]
        operational = 1.0 / ratio + (1.0 - 1.0 / ratio) * s / (s + 1.0)
        softer = made.softened(operational).contact_law(1e-3, solver=ul.Exact(1e-9))
        assert weight @ held == pytest.approx(float(softer.force(1e-3)), rel=1e-6)


def test_punch_relaxes_between_its_moduli_and_remembers():
    made = scene(ul.FlatPunch(1.0), 10.0, 1.0, relaxes=(0.1, 2.0))
    time = np.linspace(0.0, 40.0, 801)
    held = made.force(np.full(801, 1e-3), time)
    assert (np.diff(held) < 0.0).all()
    first, last = (float(made.softened(m).contact_law(1e-3).force(1e-3)) for m in (1.0, 0.1))
    assert held[0] == pytest.approx(first, rel=1e-6)
    assert held[-1] == pytest.approx(last, rel=1e-3)
    # The superposition of two steps is the sum of their forces: the punch is linear.
    steps = np.where(time < 5.0, 4e-4, 1e-3)
    late = np.concatenate((np.zeros(100), made.force(np.full(701, 6e-4), time[:701])))
    both = made.force(np.full(801, 4e-4), time) + late
    away = np.abs(time - 5.0) > 0.1
    assert made.force(steps, time)[away] == pytest.approx(both[away], rel=2e-2)


@pytest.mark.parametrize(
    ("ratio", "low", "high"), [(2.0, -0.022, -0.003), (10.0, -0.31, -0.03), (100.0, -0.81, -0.10)]
)
def test_quasi_elastic_error_table(ratio, low, high):
    """Worst error of k(E(t)) in a hold, over contact radius and base: always too low, worst after 2 to 10 tau."""
    time = np.concatenate(([0.0], np.geomspace(0.05, 30.0, 25)))
    worst = []
    for radius in (0.3, 1.0, 3.0):
        for m0 in (0.1, 1.0, 10.0):
            made = scene(ul.FlatPunch(radius), ratio, m0)
            exact = made.force(np.full(len(time), 1e-3), time)
            moduli = made.layer.relaxation.modulus(time)
            quasi = np.array([float(made.softened(m).contact_law(1e-3).force(1e-3)) for m in moduli])
            assert (quasi <= exact * (1.0 + 1e-4)).all()
            worst.append((quasi / exact - 1.0).min())
    assert low <= min(worst) <= max(worst) <= high
    assert min(worst) < 0.8 * low, "the stated error is not far above what is seen"
    relaxation = ul.Prony((1.0 - 1.0 / ratio,), (1.0,))
    assert stated_error(relaxation, time, np.full(len(time), 1e-3)) == pytest.approx(-low)


def test_along_a_short_ramp_the_error_is_small():
    time = np.linspace(0.0, 0.5, 31)
    for radius in (0.3, 1.0):
        made = scene(ul.FlatPunch(radius), 10.0, 1.0)
        exact = made.force(2e-3 * time, time)
        quasi = QuasiElastic(lambda m, s=made: s.softened(m).contact_law(1e-3), made.layer.relaxation, 1e-3)
        error = quasi.force(2e-3 * time, time)[1:] / exact[1:] - 1.0
        assert -0.022 < error.min() < -1e-3
        assert error.max() < 1e-4
    assert stated_error(made.layer.relaxation, time, time) == 0.022
    assert stated_error(made.layer.relaxation, 2.0 * time, time) == 0.31


SPHERE = ul.Paraboloid(1.0)

# --- step by step, by a computation that shares nothing with the package -------------------------------------


def test_the_reference_starts_from_the_same_elastic_contact():
    u = np.array([0.1, 1.0, 3.0])
    above, below = (sum(part) for part in kernel_polynomials(u, NU, BASE_NU))
    contact = scene(SPHERE, 10.0, 1.0).contact
    assert above / below == pytest.approx(1.0 - contact.kernel.one_minus_L(u), rel=1e-12)
    force, radius = step_by_step(np.array([0.3, 0.3]), 0.01, 1.0, 1.0, nodes=120)
    law = scene(SPHERE, 10.0, 1.0).elastic.contact_law(0.3)
    theta = 1.0 / (2.0 * (1.0 - NU**2))
    assert 4.0 * theta * force == pytest.approx(law.force([0.3, 0.3]), rel=2e-4)
    assert radius[0] == pytest.approx(float(law.contact_radius(0.3)), abs=0.01)
    # On a base that hardly yields: Lee and Radok's superposition.
    time, hard = np.linspace(0.0, 2.0, 41), scene(SPHERE, 4.0, 1e-4)
    depth = 0.3 * np.minimum(time / 0.5, 1.0)
    found, _ = step_by_step(depth, 0.05, 4.0, 1e-4, nodes=60)
    exact = replace(hard, substrate=ul.RIGID).force(depth, time)
    assert 4.0 * theta * found[3:] == pytest.approx(exact[3:], rel=5e-3)


# Depth of all rows: at once the contact reaches 0.71 where the moduli of layer and base are alike.
_DEPTH = 0.5268


@pytest.mark.parametrize(
    ("ratio", "m0", "on_ramp", "in_hold"),
    [
        (2.0, 1.0, -0.008, -0.021),
        (10.0, 0.1, -0.009, -0.134),
        (10.0, 1.0, -0.017, -0.288),
        (10.0, 10.0, -0.011, -0.168),
    ],
)
def test_quasi_elastic_error_of_a_sphere(ratio, m0, on_ramp, in_hold):
    """Ramp over half of the relaxation time and a hold of ten of them: worst errors of the quasi-elastic force.

    Twice the nodes and half the step change them by less than 0.001. The contact goes on growing in the hold. The
    depth counts: at 0.4 the second row is off by 0.11, and the last by 0.18.
    """
    step, made = 0.05, scene(SPHERE, ratio, m0)
    time = step * np.arange(211)
    depth = _DEPTH * np.minimum(time / 0.5, 1.0)
    exact, radius = step_by_step(depth, step, ratio, m0)
    assert radius[-1] > radius[10] + 0.04
    asked = np.append(np.arange(11), np.arange(20, 211, 10))
    quasi = QuasiElastic(lambda m: made.softened(m).contact_law(0.53), made.layer.relaxation, 0.53)
    theta = 1.0 / (2.0 * (1.0 - NU**2))
    error = quasi.force(depth[asked], time[asked])[3:] / (4.0 * theta * exact[asked][3:]) - 1.0
    assert error[:8].min() == pytest.approx(on_ramp, abs=1.5e-3)
    assert error[8:].min() == pytest.approx(in_hold, abs=3e-3)
    assert error.max() < 1e-3
    assert -error.min() < stated_error(made.layer.relaxation, time, depth)


@pytest.mark.parametrize(
    ("ratio", "radius", "m0", "worst"),
    [(2.0, 3.0, 0.1, -0.022), (10.0, 3.0, 0.1, -0.301), (100.0, 1.0, 1.0, -0.803)],
)
def test_punch_step_by_step(ratio, radius, m0, worst):
    """The punch's own series of exponentials, and the worst quasi-elastic errors of the table above."""
    step, made = 0.1, scene(ul.FlatPunch(radius), ratio, m0)
    time = step * np.arange(101)
    theta = 1.0 / (2.0 * (1.0 - NU**2))
    reference, _ = step_by_step(np.full(101, 1e-3), step, ratio, m0, punch=radius, nodes=60)
    found = made.force(np.full(101, 1e-3), time) / (4.0 * theta * reference)
    assert found == pytest.approx(np.ones(101), abs=1.5e-3)
    late = np.arange(10, 101, 6)
    moduli = made.layer.relaxation.modulus(time[late])
    quasi = np.array([float(made.softened(m).contact_law(1e-3).force(1e-3)) for m in moduli])
    assert (quasi / (4.0 * theta * reference[late]) - 1.0).min() == pytest.approx(worst, abs=3e-3)


def test_quasi_elastic_force_is_taken_only_within_the_tolerance():
    time = np.linspace(0.0, 4.0, 81)
    depth = 0.1 * np.minimum(time, 1.0)
    soft = scene(SPHERE, 2.0, 1.0)
    with pytest.raises(ul.InputError, match=r"up to 2\.2 % too low.* \(rtol\) of 0\.022 or more"):
        soft.force(depth, time)
    taken = soft.force(depth, time, solver=ul.Auto(rtol=0.025))
    # Between the elastic force at once and that of the equilibrium modulus.
    assert (taken[1:] < soft.elastic.force(depth)[1:]).all()
    assert (taken[1:] > soft.softened(0.5).force(depth)[1:] * (1.0 - 1e-3)).all()
    with pytest.raises(ul.InputError, match=r"up to 31 % too low"):
        scene(SPHERE, 10.0, 1.0).force(depth, time, solver=ul.Auto(rtol=0.025))
    # The ramp alone, shorter than half of the relaxation time.
    ramp = time[time <= 0.5]
    scene(SPHERE, 10.0, 1.0).force(0.1 * ramp, ramp, solver=ul.Auto(rtol=0.025))


def test_quasi_elastic_is_exact_where_the_base_does_not_matter():
    """On a base of the same kind that hardly yields, and where nothing relaxes."""
    time = np.linspace(0.0, 2.0, 201)
    depth = 0.1 * np.minimum(time, 1.0)
    near = scene(SPHERE, 2.0, 0.002)
    rigid = replace(near, substrate=ul.RIGID)
    assert near.ages
    quasi = near.force(depth, time, solver=ul.Auto(rtol=0.025))
    share = near.elastic.force(depth)[-1] / rigid.elastic.force(depth)[-1]
    assert quasi[20:] == pytest.approx(share * rigid.force(depth, time)[20:], rel=5e-3)
    none = scene(SPHERE, 1.0, 1.0)
    assert none.force(depth, time, solver=ul.Auto(rtol=0.025)) == pytest.approx(
        none.elastic.force(depth), rel=3e-3, abs=1e-12
    )


def test_what_an_ageing_base_does_not_allow_is_named():
    made = scene(SPHERE, 2.0, 1.0)
    time = np.linspace(0.0, 2.0, 41)
    loose = ul.Auto(rtol=0.025)
    with pytest.raises(ul.InputError, match="leave the unloading out"):
        made.force(0.1 * np.minimum(time, 2.0 - time), time, solver=loose)
    with pytest.raises(ul.InputError, match="under given depths only"):
        made.depth(np.linspace(0.0, 1e-3, 41), time)
    curve = ul.simulate(made, 0.1 * time, time, solver=loose)
    with pytest.raises(ul.InputError, match="simulated but not fitted"):
        ul.Problem(made, curve, ["layer.E"], solver=loose)
    assert made.effects(0.1).set_index("effect").loc["relaxation", "simulated"]
