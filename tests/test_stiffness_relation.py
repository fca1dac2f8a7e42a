"""The layer's modulus from unloading stiffness and contact area: arrays, limits, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import underlay as ul
from underlay.mechanics.asymptotic.law import punch_factor


def stiffness_of(E, nu, radius, thickness, substrate):
    """dP/dw of (9.5) with the fourth-order kappa_inf."""
    layer = ul.Isotropic(E, nu)
    a_0, a_1 = ul.SubstrateKernel(layer, substrate).coefficients(2)
    return 4.0 * layer.theta * radius * punch_factor(radius / thickness, a_0, a_1)


@given(st.floats(-3.0, 3.0), st.floats(0.0, 0.5), st.floats(0.02, 0.6))
@settings(max_examples=40)
def test_the_modulus_is_recovered_over_six_decades_of_ratio(log_ratio, nu, eps):
    substrate = ul.Isotropic(2e6, 0.3)
    E = 2e6 * 10.0**log_ratio
    stiffness = stiffness_of(E, nu, eps * 1e-3, 1e-3, substrate)
    found = ul.modulus_from_stiffness(
        stiffness,
        nu=nu,
        contact_radius=eps * 1e-3,
        thickness=1e-3,
        substrate=substrate,
        solver="asymptotic",
    )
    # The root is found to 1e-14 in ln E; a layer 1000 times stiffer answers that much to rounding in kappa.
    assert found == pytest.approx(E, rel=1e-9)


def test_arrays_of_stiffness_and_area():
    radius = np.array([1e-4, 2e-4, 3e-4])
    for substrate in (ul.RIGID, ul.Isotropic(5e5, 0.4)):
        stiffness = np.array([stiffness_of(1e6, 0.45, a, 1e-3, substrate) for a in radius])
        found = ul.modulus_from_stiffness(
            stiffness,
            nu=0.45,
            contact_area=np.pi * radius**2,
            thickness=1e-3,
            substrate=substrate,
            solver="asymptotic",
        )
        assert found.shape == (3,)
        assert np.allclose(found, 1e6, rtol=1e-9)
    both = ul.modulus_from_stiffness(np.array([[1.0], [2.0]]), nu=0.3, contact_radius=radius)
    assert both.shape == (2, 3)
    assert np.allclose(both, np.array([[1.0], [2.0]]) * (1.0 - 0.09) / (2.0 * radius), rtol=1e-14)


def test_without_a_layer_effect_it_is_the_classical_relation():
    classical = ul.modulus_from_stiffness(3.0, nu=0.3, contact_radius=1e-3)
    assert classical == pytest.approx(3.0 * 0.91 / 2e-3, rel=1e-14)
    assert ul.modulus_from_stiffness(3.0, nu=0.3, contact_radius=1e-3, substrate=ul.RIGID) == classical
    alike = ul.modulus_from_stiffness(
        3.0, nu=0.3, contact_radius=1e-3, thickness=2e-3, substrate=ul.Isotropic(float(classical), 0.3)
    )
    assert alike == pytest.approx(classical, rel=1e-12)
    thick = ul.modulus_from_stiffness(3.0, nu=0.3, contact_radius=1e-3, thickness=1e3, substrate=ul.RIGID)
    assert thick == pytest.approx(classical, rel=2e-6)  # 1 - b a/h


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "give one of contact_radius"),
        ({"contact_radius": 1.0, "contact_area": 1.0}, "give one of contact_radius"),
        ({"contact_radius": -1.0}, "contact_radius must be positive"),
        ({"contact_area": 0.0}, "contact_area must be positive"),
        ({"contact_radius": 1.0, "thickness": -1.0, "substrate": ul.RIGID}, "thickness must be positive"),
        (
            {"contact_radius": 1.0, "thickness": 2.0, "substrate": ul.RIGID, "solver": "hertz"},
            "no solver is called 'hertz'",
        ),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ul.InputError, match=message):
        ul.modulus_from_stiffness(1.0, nu=0.3, **arguments)


def test_a_base_more_compliant_than_the_test_is_refused():
    base = ul.Isotropic(1.0, 0.3)
    with pytest.raises(ul.RangeError, match="the substrate alone is too compliant"):
        ul.modulus_from_stiffness(1e9, nu=0.3, contact_radius=0.5, thickness=1.0, substrate=base)
