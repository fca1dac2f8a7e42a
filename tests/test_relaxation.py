"""Relaxation functions: what they are, and the exponentials that stand for them."""

import numpy as np
import pytest
from scipy import special

import underlay as ul
from underlay.mechanics.viscoelastic.history import Viscoelastic

TWO_TERMS = ul.Prony(fractions=(0.5, 0.3), times=(0.1, 2.0))


def test_prony_series_falls_from_one_to_its_equilibrium():
    time = np.linspace(0.0, 50.0, 2001)
    e = TWO_TERMS.modulus(time)
    assert e[0] == pytest.approx(1.0, rel=1e-15)
    assert e[-1] == pytest.approx(0.2, rel=1e-9)
    assert (np.diff(e) < 0.0).all()
    assert TWO_TERMS.modulus(0.1) == pytest.approx(0.2 + 0.5 / np.e + 0.3 * np.exp(-0.05), rel=1e-14)


@pytest.mark.parametrize("exponent", [0.05, 0.2, 0.5, 0.7])
def test_power_law_is_a_sum_of_exponentials(exponent):
    law = ul.PowerLawRelaxation(exponent, time=3.0)
    time = np.geomspace(1e-2, 1e3, 200)
    # Trapezoid rule, step d: 2 |Gamma(a + 2 pi i / d)| / Gamma(a) of the value, and the ends 1e-9 of it each.
    rule = 2.0 * abs(special.gamma(exponent + 4.0j * np.pi)) / special.gamma(exponent)
    assert law.modes(1e-2, 1e3)(time) == pytest.approx(law.modulus(time), rel=rule + 4e-9)
    assert law.modulus(3.0) == 1.0


def test_dynamic_modulus_is_that_of_each_model():
    omega = np.array([0.3, 2.0, 40.0])
    found = Viscoelastic(TWO_TERMS).dynamic_modulus(omega, longest=10.0)
    x, y = 1j * omega * 0.1, 1j * omega * 2.0
    assert found == pytest.approx(0.2 + 0.5 * x / (1 + x) + 0.3 * y / (1 + y), rel=1e-14)
    # A power law: Gamma(1 - a) (i omega t0)^a, a loss angle of a pi / 2 at every frequency.
    weak = Viscoelastic(ul.PowerLawRelaxation(0.2)).dynamic_modulus(omega, longest=1e3)
    assert np.angle(weak) == pytest.approx(0.1 * np.pi, rel=1e-4)
    assert np.abs(weak[2] / weak[1]) == pytest.approx(20.0**0.2, rel=1e-4)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: ul.Prony((0.6, 0.5), (1.0, 2.0)), "add up to 1.1"),
        (lambda: ul.Prony((0.6,), (1.0, 2.0)), "1 fractions and 2 times"),
        (lambda: ul.Prony((-0.1,), (1.0,)), r"fractions\[0\] must be zero or more"),
        (lambda: ul.Prony((0.1,), (0.0,)), r"times\[0\] must be positive"),
        (lambda: ul.Prony(0.5, 1.0), "a list of at least one number"),
        (lambda: ul.Prony((0.5,), (1.0,), relaxes="bulk"), "'shear_and_bulk', 'shear'"),
        (lambda: ul.PowerLawRelaxation(0.9), "between 0.01 and 0.7"),
        (lambda: ul.PowerLawRelaxation(0.2, time=0.0), "time"),
        (lambda: ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3, relaxation="soft"), "such as Prony"),
        (
            lambda: ul.Layer(
                ul.Isotropic(1e6, 0.45), 1e-3, relaxation=ul.Prony((0.5,), (1.0,), relaxes="shear")
            ),
            "Poisson's ratio would rise in time",
        ),
    ],
)
def test_what_cannot_be_is_refused(build, said):
    with pytest.raises(ul.InputError, match=said):
        build()
    ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=ul.Prony((0.5,), (1.0,), relaxes="shear"))
