"""Materials: what is allowed, what the messages say, and the way between the sets of constants."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import underlay as ul
from support import appendix
from underlay.mechanics.body import isotropic_constants, transversely_isotropic_constants

ZINC_STIFFNESS = {"A11": 161e9, "A12": 34.2e9, "A13": 50.1e9, "A33": 61.0e9, "A44": 38.3e9}


@st.composite
def stiffnesses(draw):
    """Positive definite stiffnesses, a margin away from the border: their inverse is well conditioned."""
    scale = 10.0 ** draw(st.floats(-3.0, 12.0))
    A11, A33, A44 = (scale * 10.0 ** draw(st.floats(-1.0, 1.0)) for _ in range(3))
    A12 = A11 * draw(st.floats(-0.9, 0.9))
    A13 = 0.9 * draw(st.floats(-1.0, 1.0)) * np.sqrt(0.5 * (A11 + A12) * A33)
    return {"A11": A11, "A12": A12, "A13": float(A13), "A33": A33, "A44": A44}


@given(stiffnesses())
def test_stiffness_to_engineering_constants_and_back(given_stiffness):
    # The margin of 0.19 in the determinant amplifies rounding by some tens; A12 and A13 may be zero.
    back = ul.TransverselyIsotropic.from_stiffness(**given_stiffness).stiffness()
    size = max(given_stiffness["A11"], given_stiffness["A33"])
    for name, value in given_stiffness.items():
        assert back[name] == pytest.approx(value, rel=1e-12, abs=1e-13 * size), name


@given(stiffnesses())
def test_plane_constants_are_those_of_the_stiffnesses(A):
    # q = A13/A33, c = 1/A33, g = A11 - A13^2/A33, S = 1/A44.
    constants = ul.TransverselyIsotropic.from_stiffness(**A).plane_constants
    g = A["A11"] - A["A13"] ** 2 / A["A33"]
    assert constants.q == pytest.approx(A["A13"] / A["A33"], rel=1e-12, abs=1e-13)
    assert constants.c == pytest.approx(1.0 / A["A33"], rel=1e-12)
    assert constants.g == pytest.approx(g, rel=1e-12)
    assert constants.S * A["A44"] == pytest.approx(1.0, rel=4e-16)


@given(stiffnesses())
def test_theta_is_that_of_the_appendix(A):
    # theta = 1/(2 pi H), H = (gamma_1 + gamma_2) A11/(2 pi (A11 A33 - A13^2)).
    with mp.workdps(50):
        numbers = (mp.mpf(A[name]) for name in ("A11", "A13", "A33", "A44"))
        exact = float(mp.re(1 / (2 * mp.pi * appendix.AppendixConstants.from_stiffness(*numbers).H)))
    assert ul.TransverselyIsotropic.from_stiffness(**A).theta == pytest.approx(exact, rel=1e-12)


@given(st.floats(1e-6, 1e12), st.one_of(st.just(0.5), st.floats(-0.95, 0.5)))
def test_isotropic_constants_agree_both_ways(E, nu):
    isotropic = ul.Isotropic(E, nu)
    same = ul.TransverselyIsotropic(E, E, nu, nu, E / (2.0 * (1.0 + nu)))
    assert same.theta == pytest.approx(isotropic.theta, rel=1e-13)
    constants = isotropic.plane_constants
    assert constants.p == pytest.approx(1.0, rel=1e-14)
    assert constants.sigma == pytest.approx(2.0, rel=1e-14)
    assert constants.theta == pytest.approx(E / (2.0 * (1.0 - nu * nu)), rel=1e-13)
    assert constants.p_minus_q == pytest.approx((1.0 - 2.0 * nu) / (1.0 - nu), rel=1e-13)


def test_p_minus_q_does_not_cancel():
    # p - q = (1 - 2 nu)/(1 - nu) = 4e-12 here, to full precision from q next to 1; 1 - 2 nu is exact.
    nu = 0.5 - 1e-12
    exact = float((1 - 2 * mp.mpf(nu)) / (1 - mp.mpf(nu)))
    assert isotropic_constants(1.0, nu).p_minus_q == pytest.approx(exact, rel=1e-15)


@given(st.floats(1e-6, 1e12), st.floats(1e-6, 1e12), st.floats(-0.9, 0.9), st.floats(-2.0, 2.0))
def test_every_material_that_is_accepted_has_real_constants(E, E_axial, nu, nu_axial):
    assume(1.0 - nu - 2.0 * E / E_axial * nu_axial**2 >= 0.0)
    material = ul.TransverselyIsotropic(E, E_axial, nu, nu_axial, 0.1 * E)
    constants = material.plane_constants
    assert constants.c >= 0.0
    assert constants.p_minus_q >= 0.0
    assert constants.sigma > 0.0
    assert 0.0 < material.theta < np.inf


def test_incompressible_materials_are_finite():
    assert ul.Isotropic(3.0, 0.5).plane_constants.c == 0.0
    # n = 1/2, nu = 3/4, nu' = 1/2; and one whose own rounding leaves the stability limit at -1e-17.
    assert ul.TransverselyIsotropic(1.0, 2.0, 0.75, 0.5, 0.3).plane_constants.c == 0.0
    axial = float(np.sqrt(0.5 * 0.7 * 1.0 / 3.0))
    near = ul.TransverselyIsotropic(3.0, 1.0, 0.3, axial, 1.0)
    assert 0.0 <= near.plane_constants.c < 1e-15
    with pytest.raises(ul.MaterialError, match="infinite stiffnesses"):
        ul.TransverselyIsotropic(1.0, 2.0, 0.75, 0.5, 0.3).stiffness()


def test_zinc_has_complex_roots():
    # sqrt(A11 A33) < A13 + 2 A44: sigma^2 < 4 p.
    constants = ul.TransverselyIsotropic.from_stiffness(**ZINC_STIFFNESS).plane_constants
    assert constants.sigma**2 < 4.0 * constants.p


@pytest.mark.parametrize(
    ("change", "inequalities"),
    [
        ({"A44": -1.0}, ["A44 > 0"]),
        ({"A44": 0.0}, ["A44 > 0"]),
        ({"A33": -1e9, "A44": -1.0}, ["A44 > 0", "A33 > 0", r"(A11 + A12) A33 > 2 A13^2"]),
        ({"A12": 161e9}, ["A11 > |A12|"]),
        ({"A12": -170e9}, ["A11 > |A12|", r"(A11 + A12) A33 > 2 A13^2"]),
        ({"A13": 90e9}, [r"(A11 + A12) A33 > 2 A13^2"]),
    ],
)
def test_every_failed_inequality_of_the_stiffnesses_is_named(change, inequalities):
    with pytest.raises(ul.MaterialError) as caught:
        ul.TransverselyIsotropic.from_stiffness(**(ZINC_STIFFNESS | change))
    message = str(caught.value)
    named = message.removeprefix("not positive definite: ").split(" fail")[0].split(" and ")
    assert named == inequalities
    for name, value in change.items():
        assert f"{name} = {value:.6g}" in message


@pytest.mark.parametrize(
    ("nu", "nu_axial", "inequalities"),
    [
        (0.3, 0.7, ["1 - nu - 2 (E/E_axial) nu_axial^2 >= 0"]),
        (-1.0, 0.2, ["-1 < nu < 1"]),
        (1.2, 0.0, ["-1 < nu < 1", "1 - nu - 2 (E/E_axial) nu_axial^2 >= 0"]),
    ],
)
def test_every_failed_inequality_of_the_engineering_constants_is_named(nu, nu_axial, inequalities):
    with pytest.raises(ul.MaterialError) as caught:
        ul.TransverselyIsotropic(E=1.0, E_axial=1.0, nu=nu, nu_axial=nu_axial, G_axial=1.0)
    named = str(caught.value).removeprefix("not positive definite: ").split(" fail")[0].split(" and ")
    assert named == inequalities
    assert f"nu = {nu!r}" in str(caught.value)


@pytest.mark.parametrize("nu", [-1.0, 0.5000001, 2.0])
def test_an_isotropic_ratio_out_of_range_is_named(nu):
    with pytest.raises(ul.MaterialError, match=rf"\(-1, 0\.5\]; got {nu}"):
        ul.Isotropic(1.0, nu)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.inf, np.nan, "stiff"])
def test_moduli_are_positive_numbers(bad):
    with pytest.raises(ul.InputError, match="modulus"):
        ul.Isotropic(bad, 0.3)
    for name in ("E", "E_axial", "G_axial"):
        moduli = {"E": 1.0, "E_axial": 1.0, "G_axial": 1.0, name: bad}
        with pytest.raises(ul.InputError, match="modulus"):
            ul.TransverselyIsotropic(nu=0.3, nu_axial=0.3, **moduli)


def test_a_stiffness_that_is_no_number_is_named():
    with pytest.raises(ul.InputError, match="A33"):
        ul.TransverselyIsotropic.from_stiffness(**(ZINC_STIFFNESS | {"A33": np.nan}))


def test_material_errors_are_value_errors():
    with pytest.raises(ValueError, match="nu"):
        ul.Isotropic(1.0, 0.7)
    assert issubclass(ul.MaterialError, ul.UnderlayError)


def test_a_layer_is_made_of_a_material_and_has_a_thickness():
    assert ul.Layer(ul.Isotropic(1.0, 0.3)).thickness == np.inf
    with pytest.raises(ul.InputError, match="a layer is made of Isotropic"):
        ul.Layer(ul.RIGID, 1.0)
    with pytest.raises(ul.InputError, match="thickness"):
        ul.Layer(ul.Isotropic(1.0, 0.3), -1.0)


def test_batched_constants_are_those_of_the_members():
    E, nu = np.array([1.0, 2e6]), np.array([0.5, -0.3])
    together = isotropic_constants(E, nu)
    for i in range(2):
        alone = isotropic_constants(float(E[i]), float(nu[i]))
        assert [column[i] for column in together] == list(alone)
        assert together.theta[i] == pytest.approx(alone.theta, rel=1e-15)
    shear = E / (2.0 * (1.0 + nu))
    same = transversely_isotropic_constants(E, E, nu, nu, shear)
    np.testing.assert_allclose(same.theta, together.theta, rtol=1e-14)
