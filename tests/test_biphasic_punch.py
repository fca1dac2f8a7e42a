"""Flat punch on a draining layer: reference values, limits, exact superposition, creep, a skeleton that relaxes."""

import numpy as np
import pytest
from scipy.optimize import nnls

from biphasic_reference import (
    CREEP,
    CREEP_TIMES,
    FALL_TIMES,
    FALLS,
    KHAT,
    PEAKS,
    TI,
    TI_TIMES,
    VISCO,
    VISCO_TIMES,
    isotropic,
    transverse,
)
from underlay.errors import InputError, RangeError
from underlay.mechanics.biphasic.contacts import DrainingPunch
from underlay.mechanics.biphasic.history import Polyline, ramp_and_hold
from underlay.mechanics.biphasic.material import Biphasic, BiphasicTransverse
from underlay.mechanics.biphasic.transfer import PunchTransfer, Relaxing, relaxation
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.indenters import FlatPunch
from underlay.mechanics.relaxation import Modes

LAPLACE = np.array([0.1, 1.0, 10.0], dtype=complex)


def eps_of(thickness):
    return 0.0 if np.isinf(thickness) else 1.0 / thickness


@pytest.mark.parametrize(("eps", "tip"), list(KHAT))
def test_transfer_function(eps, tip):
    expected = KHAT[eps, tip]
    found = PunchTransfer(isotropic(0.3).skeleton, eps, tip)(LAPLACE).real
    assert np.abs(found / expected - 1.0).max() < 3e-6


@pytest.mark.parametrize("row", range(len(FALLS)))
@pytest.mark.parametrize("column", [0, 1])
def test_isotropic_falls(row, column):
    nu, eps, peak, falls = FALLS[row]
    transfer = PunchTransfer(isotropic(nu).skeleton, eps, ("solid", "porous")[column])
    assert transfer.undrained / transfer.drained == pytest.approx(peak, abs=6e-5)
    found = relaxation(transfer).g(FALL_TIMES)
    # Five or four digits printed, and 1e-5 of the inversion.
    printed = 6e-6 if column == 0 and eps > 0.0 else 6e-5
    assert np.abs(found - falls[:, column]).max() < printed + 1e-5


@pytest.mark.parametrize("row", range(len(TI)))
@pytest.mark.parametrize("tip", ["solid", "porous"])
def test_transversely_isotropic(row, tip):
    name, thickness, theta_d, theta_u, k0, kinf, tips = TI[row]
    material = transverse(name)
    skeleton = material.skeleton
    assert skeleton.theta_drained * material.G_axial == pytest.approx(theta_d, abs=6e-9)
    assert skeleton.theta_undrained * material.G_axial == pytest.approx(theta_u, abs=6e-9)
    transfer = PunchTransfer(skeleton, eps_of(thickness), tip)
    assert (transfer.undrained, transfer.drained) == (
        pytest.approx(k0, rel=4e-7),
        pytest.approx(kinf, rel=4e-9),
    )
    khat, falls = tips[tip]
    assert np.abs(transfer(LAPLACE).real / khat - 1.0).max() < 8e-6
    assert np.abs(relaxation(transfer).g(TI_TIMES) - falls).max() < 1.5e-5


@pytest.mark.parametrize("ratio", list(PEAKS))
def test_peak_over_equilibrium(ratio):
    for eps, expected in PEAKS[ratio]:
        if ratio == 0.0:
            material = Biphasic(1.0, 0.0, 1.0)
        else:
            material = BiphasicTransverse(ratio, 1.0, 0.2, 0.1, 1.0 / 2.2, 1.0)
        transfer = PunchTransfer(material.skeleton, eps, "solid")
        assert transfer.undrained / transfer.drained == pytest.approx(expected, rel=3e-4, abs=6e-4)


def test_early_times_follow_the_power_of_the_edge():
    expected = {"solid": (0.9583888, 0.9865375), "porous": (0.8696174, 0.9485398)}
    for tip, values in expected.items():
        transfer = PunchTransfer(isotropic(0.3).skeleton, 1.0, tip)
        reaching = relaxation(transfer, (1e-4, 30.0))
        assert np.abs(reaching.g(np.array([1e-3, 1e-4])) - values).max() < 1.5e-4
        assert abs(relaxation(transfer).g(np.array([1e-4]))[0] - values[1]) < 3e-3


def test_creep():
    for tip, expected in CREEP.items():
        material = isotropic(0.3)
        punch = DrainingPunch(1.0, material, 1.0, tip)
        load = Polyline([0.0], [punch.unit_stiffness])
        assert np.abs(punch.depth(load, CREEP_TIMES) - expected).max() < 3e-6
        assert punch.depth(load, [0.0])[0] == pytest.approx(0.197385, abs=6e-7)


def test_creep_undoes_relaxation():
    punch = DrainingPunch(1.0, transverse("five"), 1.0, "solid")
    time = np.linspace(0.0, 2.0, 4001)
    force = punch.force(ramp_and_hold(1.0, 0.5), time)
    depth = punch.depth(Polyline(time, force), np.array([0.25, 0.5, 0.6, 1.0, 2.0]))
    assert np.abs(depth - [0.5, 1.0, 1.0, 1.0, 1.0]).max() < 2e-4


def test_a_relaxing_skeleton():
    material = isotropic(0.3)
    modes = Modes(0.4, np.array([0.6]), np.array([0.3]))
    punch = DrainingPunch(1.0, material, 1.0, "solid", modes)
    found = punch.force(ramp_and_hold(1.0, 0.0), VISCO_TIMES) / punch.unit_stiffness
    assert np.abs(found - VISCO).max() < 1e-4
    still = Relaxing(PunchTransfer(material.skeleton, 1.0, "solid"), Modes(1.0, np.zeros(1), np.ones(1)))
    assert np.abs(still(LAPLACE) - still.elastic(LAPLACE)).max() < 1e-13


def test_poro_visco_is_no_product():
    modes = Modes(0.4, np.array([0.6]), np.array([0.3]))
    both, alone = (DrainingPunch(1.0, isotropic(0.3), 1.0, "solid", m) for m in (modes, None))
    step, at = ramp_and_hold(1.0, 0.0), np.array([1.0])
    product = modes(at) * alone.force(step, at)
    assert product[0] / both.force(step, at)[0] == pytest.approx(0.94, abs=0.01)


def test_ends_are_the_elastic_laws():
    for material in (isotropic(0.2), transverse("ten")):
        punch = DrainingPunch(1.0, material, 1.0, "solid")
        for elastic, end in (
            (material.undrained, punch.response.start),
            (material.drained, punch.response.end),
        ):
            law = exact_law(Contact.of(FlatPunch(1.0), Layer(elastic, 1.0), RIGID), 1.0, 1e-10)
            assert float(law.stiffness(0.5)) == pytest.approx(end, rel=1e-9)


def test_scaling_in_modulus_permeability_and_length():
    one = DrainingPunch(1.0, Biphasic(1.0, 0.2, 1.0), 2.0, "solid")
    two = DrainingPunch(1e-3, Biphasic(3e5, 0.2, 2e-15), 2e-3, "solid")
    time = np.array([0.01, 0.1, 1.0])
    first = one.force(ramp_and_hold(1.0, 0.05), time)
    unit = two.unit_time / one.unit_time
    second = two.force(ramp_and_hold(1e-3, 0.05 * unit), time * unit)
    assert np.abs(second / (first * 3e5 * 1e-6) - 1.0).max() < 1e-10


def test_superposition():
    punch = DrainingPunch(1.0, isotropic(0.1), 1.0, "porous")
    time = np.linspace(0.0, 2.0, 41)
    one = punch.force(Polyline([0.0, 0.4], [0.0, 1.0]), time)
    joined = punch.force(Polyline([0.0, 0.1, 0.4], [0.0, 0.25, 1.0]), time)
    assert np.abs(joined - one).max() < 1e-12 * one.max()
    sudden = punch.force(ramp_and_hold(1.0, 0.0), time[1:])
    quick = punch.force(ramp_and_hold(1.0, 1e-7), time[1:])
    assert np.abs(quick / sudden - 1.0).max() < 1e-6
    twice = punch.force(Polyline([0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 3.0]), time)
    later = punch.force(ramp_and_hold(1.0, 0.0), time - 1.0)
    assert (
        np.abs(twice - punch.force(ramp_and_hold(1.0, 0.0), time) - 2.0 * later).max() < 1e-12 * twice.max()
    )


@pytest.mark.parametrize("tip", ["solid", "porous"])
def test_fall_is_completely_monotone(tip):
    time = np.geomspace(3e-3, 20.0, 60)
    for material in (isotropic(0.3), transverse("five")):
        fall = relaxation(PunchTransfer(material.skeleton, 1.0, tip)).g(time)
        assert (np.diff(fall) < 1e-6).all()
        rates = np.geomspace(0.05, 1e5, 32)
        residual = nnls(np.exp(-np.outer(time, rates)), fall)[1] / np.sqrt(time.size)
        assert residual < 4e-4


def test_next_to_incompressible_there_is_no_relaxation():
    transfer = PunchTransfer(Biphasic(1.0, 0.4999, 1.0).skeleton, 0.0, "solid")
    assert transfer.undrained / transfer.drained == pytest.approx(1.0, abs=3e-4)


def test_long_holds_end_on_the_drained_law():
    for eps, most in ((1.0, 1e-7), (0.0, 5e-3)):
        response = relaxation(PunchTransfer(isotropic(0.3).skeleton, eps, "solid"))
        assert abs(response.step(np.array([1e4]))[0] / response.end - 1.0) < most
    half_space = relaxation(PunchTransfer(isotropic(0.3).skeleton, 0.0, "solid"))
    assert np.abs(half_space.g(np.array([10.0, 30.0])) - [0.0670, 0.0383]).max() < 1e-4


def test_peak_on_a_ramp_is_below_that_of_a_step():
    punch = DrainingPunch(1.0, Biphasic(1.0, 0.0, 1.0), 1.0, "solid")
    assert punch.peak_ratio == pytest.approx(3.251, abs=1e-3)
    drained = 2.0 * punch.response.end
    step, ramp = (float(punch.force(ramp_and_hold(2.0, tr), [tr])[0]) / drained for tr in (0.0, 0.3))
    assert step == pytest.approx(punch.peak_ratio, rel=1e-12)
    assert 1.0 < ramp < 0.9 * punch.peak_ratio


def test_a_punch_that_is_withdrawn_comes_off():
    punch = DrainingPunch(1.0, isotropic(0.3), 1.0, "solid")
    with pytest.raises(RangeError, match=r"comes off at 1\.5 s"):
        punch.force(Polyline([0.0, 0.1, 1.0, 1.5], [0.0, 1.0, 1.0, 0.0]), [0.1, 1.0, 1.5])


def test_refusals():
    with pytest.raises(InputError, match="drainage of the tip must be one of"):
        DrainingPunch(1.0, isotropic(0.3), 1.0, "open")
    with pytest.raises(InputError, match="layer thickness must be positive"):
        DrainingPunch(1.0, isotropic(0.3), -1.0, "solid")
    flowing = DrainingPunch(1.0, isotropic(0.3), 1.0, "solid", Modes(0.0, np.ones(1), np.ones(1)))
    with pytest.raises(InputError, match="creeps without end"):
        flowing.depth(ramp_and_hold(1.0, 0.1), [1.0])
