"""Published corrections: their printed formulas, their bookkeeping, and their error against the exact law."""

from __future__ import annotations

import dataclasses
import pickle
import re
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import underlay as ul
from support import fredholm
from support.fredholm import (
    bonded_kernel,
    fixed_radius_factor,
    flat_punch,
    frictionless_kernel,
    power_law,
)
from support.laws import published_law
from support.published_errors import contact_of, exact_factor, factor_of, remeasure
from support.reference_contact import dyadic_rule
from underlay.mechanics.published.correction import ELASTIC, OutOfRange, PolynomialFactor
from underlay.mechanics.published.formulas import dimitriadis_expansion
from underlay.mechanics.published.law import published_names

CORRECTIONS = {(c.name, c.indenter): c for c in ul.published_corrections()}
RIGID_ONES = [c for c in ul.published_corrections() if c.substrate != ELASTIC]
ELASTIC_ONES = [c for c in ul.published_corrections() if c.substrate == ELASTIC]
BONDED = bonded_kernel(ul.Isotropic(1.0, 0.5), ul.RIGID)


def label(correction):
    return f"{correction.name}-{correction.indenter.replace(' ', '-')}"


def signed_error(name, kind, sizes, kernel=None, **contact):
    """P/P_exact - 1 at contact sizes u."""
    test = contact_of(kind, **contact)
    exact = exact_factor(kernel or bonded_kernel(test.layer, test.base or ul.RIGID), kind)
    sizes = np.atleast_1d(np.asarray(sizes, dtype=float))
    return factor_of(CORRECTIONS[name, kind], test, sizes) / exact(sizes) - 1.0


def law_of(name, indenter, *, nu=0.5, thickness=10e-6, E=3e3, base=ul.RIGID, max_depth=1e-6):
    """A published law whose warnings are not the point of the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ul.UnderlayWarning)
        return published_law(name, indenter, ul.Layer(ul.Isotropic(E, nu), thickness), base, max_depth)


def law_for(correction, length=1.0, stiffness=1.0, *, thickness=10e-6, max_depth=1e-6):
    """A published law of a tip it is for, with all lengths and moduli times a factor."""
    tips = {"sphere": ul.Paraboloid(5e-6 * length), "cone": ul.Cone(0.6)}
    tip = tips.get(correction.indenter, ul.FlatPunch(4e-6 * length))
    base = ul.Isotropic(6e3 * stiffness, 0.5) if correction.substrate == ELASTIC else ul.RIGID
    size = {"thickness": thickness * length, "max_depth": max_depth * length}
    return law_of(correction.name, tip, base=base, E=3e3 * stiffness, **size)


def differences(function, x, share):
    """Its derivative by a stencil of fourth order, the step a share of x."""
    step = share * x
    near, far = (function(x + k * step) - function(x - k * step) for k in (1, 2))
    return (8.0 * near - far) / (12.0 * step)


# --- the reference itself -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nu", "a_0"),
    [(0.0, 1.2111), (0.2, 1.2926), (0.3, 1.37685416546), (0.4, 1.51870801407), (0.5, 1.77021677337)],
)
def test_reference_kernel_has_the_known_first_moment(nu, a_0):
    u, du = dyadic_rule()
    digits = len(str(a_0).split(".")[1])
    assert_allclose(
        bonded_kernel(ul.Isotropic(1.0, nu), ul.RIGID)(u) @ du, a_0, rtol=0, atol=0.51 * 10.0**-digits
    )


def test_frictionless_kernel_has_the_known_first_moment_and_form():
    u, du = dyadic_rule()
    assert_allclose(frictionless_kernel(u) @ du, 1.16758, rtol=0, atol=0.5e-5)
    moderate = np.array([0.05, 0.5, 2.0, 5.0])  # where the hyperbolic form neither cancels nor overflows
    L = (np.cosh(2 * moderate) - 1.0) / (np.sinh(2 * moderate) + 2 * moderate)
    assert_allclose(frictionless_kernel(moderate), 1.0 - L, rtol=0, atol=1e-13)


def test_reference_solution_meets_known_values():
    kappa = flat_punch(BONDED, [0.2, 0.4, 0.6, 0.8, 1.0, 2.0])
    assert_allclose(kappa, [1.28064, 1.68372, 2.21289, 2.86024, 3.61874, 9.14945], rtol=0, atol=0.51e-5)
    one = power_law(BONDED, 1.0, 2.0)  # H = a^2 is A = 1/2: w/(A a^2) and P/(theta A a^3)
    assert_allclose(2.0 * one.depth, 1.118830971125, rtol=1e-11)
    assert_allclose(2.0 * one.force, 7.522667596682, rtol=1e-11)


def test_reference_solution_has_converged(monkeypatch):
    coarse = power_law(BONDED, [0.1, 1.0, 3.0], 1.0)
    monkeypatch.setattr(fredholm, "NODES", 48)
    fine = power_law(BONDED, [0.1, 1.0, 3.0], 1.0)
    # A cone's H has a kink at the axis of the even extension, but Gauss nodes on (0, 1) do not see it.
    assert_allclose(coarse.factor, fine.factor, rtol=1e-10)


# --- error against the exact problem, at sizes and with digits as they were once printed -----------

ON_BASE = {"nu": 0.3, "nu_base": 0.3}
PRINTED_ERRORS = [
    ("dimitriadis2002", "sphere", {}, "0.19 -0.9, 0.42 -5.5, 0.75 -13.5, 1.05 -16.5"),
    ("garcia2018", "sphere", {}, "0.59 1.6, 0.75 4.9, 1.05 17"),
    ("garcia2018", "cone", {}, "1.46 12"),
    ("garcia2018", "flat punch", {}, "1.0 2.9, 2.0 -7"),
    ("gavara2012", "cone", {}, "0.08 25, 0.28 302"),
    ("managuli2018", "cone", {}, "0.28 -0.9, 0.61 -8"),
    ("long2011", "sphere", {"size": 5.0}, "1.05 -7, 1.35 -9"),
    ("clifford2009", "sphere", ON_BASE | {"ratio": 10.0}, "0.28 7, 0.83 24"),
    ("gao1992", "flat punch", ON_BASE | {"ratio": 0.5}, "0.2 5, 0.7 10"),
    ("gao1992", "flat punch", ON_BASE | {"ratio": 2.0}, "0.2 6, 0.7 11"),
    ("gao1992", "flat punch", ON_BASE | {"ratio": 10.0}, "0.2 101, 0.7 183"),
    ("hay2011", "flat punch", ON_BASE | {"ratio": 0.5}, "1.0 2"),
    ("hay2011", "flat punch", ON_BASE | {"ratio": 2.0}, "1.0 -1"),
    ("hay2011", "flat punch", ON_BASE | {"ratio": 10.0}, "2.0 -10"),
    ("hay2011", "flat punch", {"ratio": 10.0, "nu": 0.5, "nu_base": 0.3}, "2.4 -39"),
]
CASES = [(*case, *point.split()) for *case, points in PRINTED_ERRORS for point in points.split(", ")]


def half_unit(printed):
    """Half of the last digit of a printed number."""
    return 0.5 * 10.0 ** -len(printed.partition(".")[2])


def assert_printed_error(error_at, size, percent):
    """The printed error is met somewhere in the interval that the printed size was rounded from."""
    around = float(size) + half_unit(size) * np.linspace(-1.0, 1.0, 21)
    error = 100.0 * error_at(around)
    assert error.min() - half_unit(percent) <= float(percent) <= error.max() + half_unit(percent), error


@pytest.mark.parametrize(("name", "kind", "contact", "size", "percent"), CASES)
def test_error_against_the_exact_law(name, kind, contact, size, percent):
    assert_printed_error(lambda sizes: signed_error(name, kind, sizes, **contact), size, percent)


@pytest.mark.parametrize(("size", "percent"), [("0.10", "1.4"), ("0.44", "6.6"), ("0.82", "15")])
def test_unbonded_error_against_a_frictionless_base(size, percent):
    assert_printed_error(
        lambda sizes: signed_error("dimitriadis2002-unbonded", "sphere", sizes, frictionless_kernel),
        size,
        percent,
    )


@pytest.mark.parametrize(
    ("name", "kind", "contact", "sizes", "worst_percent"),
    [
        ("garcia2018", "sphere", {}, (0.01, 0.42), "0.3"),
        ("garcia2018", "cone", {}, (0.01, 0.83), "0.3"),
        ("garcia2018", "flat punch", {}, (0.01, 0.5), "0.6"),
        ("hermanowicz2021", "sphere", {}, (0.1, 1.9), "0.08"),
        # Sometimes given as 1.8 %; the maximum lies at X = 0.53.
        ("long2011", "sphere", {"size": 5.0}, (0.01, 0.75), "2.0"),
        # Sometimes given as 6 %; the maximum over bases 2 to 1000 times stiffer is that of a ratio of 10.
        ("doss2019", "sphere", {"ratio": 10.0}, (0.01, 0.79), "6.6"),
        ("doss2019", "sphere", {"ratio": 100.0}, (0.01, 0.79), "1.3"),
    ],
)
def test_largest_error_up_to_a_size(name, kind, contact, sizes, worst_percent):
    worst = 100.0 * np.abs(signed_error(name, kind, np.linspace(*sizes, 300), **contact)).max()
    assert abs(worst - float(worst_percent)) <= half_unit(worst_percent) + 1e-9


def test_doss_fails_for_a_softer_base_past_its_range():
    assert signed_error("doss2019", "sphere", [1.0], ratio=0.1)[0] < -0.2
    assert signed_error("doss2019", "sphere", [1.3], ratio=0.01)[0] < -0.3


HAYES_RADII = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0])


@pytest.mark.parametrize(
    ("nu", "table", "exact"),
    [
        (
            0.3,
            "1.207 1.472 1.784 2.124 2.480 2.845 3.214 3.586 3.960 4.336",
            "1.207 1.473 1.785 2.126 2.484 2.850 3.222 3.597 3.974 4.353",
        ),
        (
            0.5,
            "1.281 1.683 2.211 2.855 3.609 4.469 5.441 6.528 7.735 9.069",
            "1.281 1.684 2.213 2.860 3.619 4.487 5.468 6.568 7.793 9.149",
        ),
    ],
)
def test_hayes_table_against_the_exact_factor(nu, table, exact):
    contact = contact_of("flat punch", nu=nu)
    read = factor_of(CORRECTIONS["hayes1972", "flat punch"], contact, HAYES_RADII)
    kappa = flat_punch(bonded_kernel(contact.layer, ul.RIGID), HAYES_RADII)
    for found, printed in ((read, table), (np.round(kappa, 3), exact)):
        assert found.tolist() == [float(word) for word in printed.split()]


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_hayes_spline_adds_little_between_the_entries(nu):
    fine = np.linspace(0.02, 2.0, 100)
    error = 100.0 * signed_error("hayes1972", "flat punch", fine, nu=nu)
    entries = np.append(0.0, 100.0 * signed_error("hayes1972", "flat punch", HAYES_RADII, nu=nu))
    drift = np.interp(fine, np.append(0.0, HAYES_RADII), entries)
    assert np.abs(error - drift).max() < 0.03


def test_long_branches_are_as_far_apart_as_stated():
    correction = CORRECTIONS["long2011", "sphere"]
    deepest = np.array([np.sqrt(2.0 * 0.6)])
    thin, thick = (
        correction.factor(contact_of("sphere", size=R)).value(deepest)[0] for R in (2.0, 2.0 + 1e-9)
    )
    assert_allclose(thin / thick - 1.0, -0.09, atol=0.005)
    low = signed_error("long2011", "sphere", [np.sqrt(0.5 * 0.5)], size=0.5)[0]
    assert_allclose(low, -0.33, atol=0.005)


def test_hermanowicz_switch_is_as_small_as_stated():
    switch = np.sqrt(0.4)
    below, above = 100.0 * signed_error("hermanowicz2021", "sphere", switch * np.array([1 - 1e-9, 1 + 1e-9]))
    assert abs(below - 0.082) <= 0.0005
    assert abs(above - 0.052) <= 0.0005


@pytest.mark.parametrize("correction", ul.published_corrections(), ids=label)
def test_stored_error_table_is_what_is_measured(correction):
    stored, measured = correction.measured_error.worst, remeasure(correction)
    assert np.array_equal(np.isinf(stored), np.isinf(measured))
    finite = np.isfinite(stored)
    # Rounding up to two digits adds at most a tenth; 1e-11 stands for identical laws that differ by rounding.
    assert (stored[finite] >= measured[finite] * (1.0 - 1e-6) - 1e-11).all()
    assert (stored[finite] <= measured[finite] * 1.1 * (1.0 + 1e-6) + 1e-11).all()


@pytest.mark.parametrize("correction", ELASTIC_ONES, ids=label)
def test_estimate_is_honest_between_measured_materials(correction):
    rng = np.random.default_rng(7)
    table = correction.measured_error
    for _ in range(10):
        ratio, nu, nu_base = (
            nodes[0] * (nodes[-1] / nodes[0]) ** rng.random() if nodes.size > 1 else nodes[0]
            for nodes in table.nodes
        )
        size = table.variable[-1] * rng.uniform(0.02, 1.0)
        tip = {"size": size} if correction.indenter == "flat punch" else {}
        materials = {"ratio": ratio, "nu": nu, "nu_base": nu_base}
        contact = contact_of(correction.indenter, **materials, **tip)
        depth = size**2 if correction.indenter == "sphere" else 1.0
        error = abs(signed_error(correction.name, correction.indenter, [size], **materials, **tip)[0])
        assert table.up_to(contact, depth) >= error / 3.0, (ratio, nu, nu_base, size)


@pytest.mark.parametrize("nu", [0.07, 0.26, 0.37, 0.47])
@pytest.mark.parametrize("size", [0.07, 0.35, 0.9])
def test_dimitriadis_estimate_is_honest_between_measured_nu(nu, size):
    contact = contact_of("sphere", nu=nu)
    error = abs(signed_error("dimitriadis2002", "sphere", [size], nu=nu)[0])
    assert CORRECTIONS["dimitriadis2002", "sphere"].measured_error.up_to(contact, size**2) >= error / 3.0


# --- small contacts ---------------------------------------------------------------------------------


def initial_slope(name, kind, **contact):
    tiny = 1e-6
    return (factor_of(CORRECTIONS[name, kind], contact_of(kind, **contact), np.array([tiny]))[0] - 1.0) / tiny


def exact_slope(kind, nu=0.5):
    """d(P/P_halfspace)/du at u = 0: 2 a_0/pi for sphere and punch, 4 a_0/pi^2 for a cone."""
    u, du = dyadic_rule()
    a_0 = bonded_kernel(ul.Isotropic(1.0, nu), ul.RIGID)(u) @ du
    return 4.0 * a_0 / np.pi**2 if kind == "cone" else 2.0 * a_0 / np.pi


@pytest.mark.parametrize(
    ("name", "kind", "percent"),
    [
        ("dimitriadis2002", "sphere", 0.6),
        ("garcia2018", "sphere", 0.6),
        ("garcia2018", "cone", 0.6),
        ("garcia2018", "flat punch", 0.6),
        ("managuli2018", "cone", 0.6),
        # Fits over a whole range trade the first term for the rest.
        ("long2011", "sphere", 2.1),
        ("hermanowicz2021", "sphere", 2.0),
    ],
)
def test_linear_term_is_the_exact_one(name, kind, percent):
    contact = {"size": 5.0} if name == "long2011" else {}
    assert_allclose(initial_slope(name, kind, **contact), exact_slope(kind), rtol=0.01 * percent)


@pytest.mark.parametrize("nu", [0.3, 0.4, 0.45])
def test_dimitriadis_linear_term_follows_nu(nu):
    assert_allclose(initial_slope("dimitriadis2002", "sphere", nu=nu), exact_slope("sphere", nu), rtol=0.007)


def test_dimitriadis_fit_in_nu_drifts_where_it_was_not_meant():
    assert 1.05 < initial_slope("dimitriadis2002", "sphere", nu=0.0) / exact_slope("sphere", 0.0) < 1.07


def test_unbonded_linear_term_depends_on_nu_though_the_exact_one_does_not():
    u, du = dyadic_rule()
    exact = 2.0 * (frictionless_kernel(u) @ du) / np.pi
    assert_allclose(initial_slope("dimitriadis2002-unbonded", "sphere", nu=0.3) / exact, 1.02, atol=0.005)
    assert_allclose(initial_slope("dimitriadis2002-unbonded", "sphere", nu=0.5) / exact, 1.19, atol=0.005)


def test_gavara_terms_are_wrong_as_printed():
    assert_allclose(initial_slope("gavara2012", "cone") / exact_slope("cone"), 0.5, rtol=0.006)
    exact = exact_factor(BONDED, "cone")
    curvature = (exact(0.05) - 1.0 - exact_slope("cone") * 0.05) / 0.05**2
    assert 16.0 * 1.7795**2 / curvature > 70.0


# --- printed forms and bookkeeping --------------------------------------------------------------------


EQUATION_11 = (1.0, 0.884, 0.781, 0.386, 0.0048)
EQUATION_12 = (1.0, 1.133, 1.283, 0.769, 0.0975)


def printed_digits(numbers, like):
    """`numbers` rounded to as many digits as `like` are printed with."""
    return [float(f"{number:.{len(str(p).split('.')[1])}f}") for number, p in zip(numbers, like, strict=True)]


def test_dimitriadis_unbonded_form_rounds_to_the_printed_coefficients():
    coefficients = CORRECTIONS["dimitriadis2002-unbonded", "sphere"].factor(contact_of("sphere")).coefficients
    assert printed_digits(coefficients, EQUATION_11) == list(EQUATION_11)


def test_dimitriadis_bonded_form_differs_from_the_printed_coefficients_by_one_sign():
    correction = CORRECTIONS["dimitriadis2002", "sphere"]
    assert correction.factor(contact_of("sphere")).coefficients == EQUATION_12
    general = correction.factor(contact_of("sphere", nu=0.5 - 1e-9)).coefficients
    assert printed_digits(general, EQUATION_12) == [*EQUATION_12[:4], -EQUATION_12[4]]


def test_dimitriadis_general_form_is_the_expansion_at_a_fixed_contact_radius():
    """f = w - w x^2 + K f without f(1) = 0, to X^4: settles the sign that equation (12) has otherwise."""
    u, du = dyadic_rule()
    spectrum = BONDED(u) * du
    a_0, a_1 = spectrum.sum(), -0.25 * (spectrum @ u**2)
    assert_allclose(a_1, -0.957769288898, rtol=1e-11)
    radii = np.array([0.02, 0.04])
    factor = fixed_radius_factor(BONDED, radii)
    general = dimitriadis_expansion(-a_0, -a_1)
    flipped = PolynomialFactor((*general.coefficients[:4], -general.coefficients[4]))
    remainder, with_flip = (np.abs(factor - form.value(radii)) for form in (general, flipped))
    order = np.log2(remainder[1] / remainder[0])
    assert 4.9 < order < 5.1
    assert np.log2(with_flip[1] / with_flip[0]) < 4.5


def test_exact_quadratic_term_is_seven_sixths_of_the_fixed_radius_one():
    radii = np.array([1e-3, 2e-3])
    solution = power_law(BONDED, radii, 2.0)
    X = np.sqrt(solution.depth)
    slope = exact_slope("sphere")
    quadratic = (solution.factor - 1.0 - slope * X) / X**2
    extrapolated = 2.0 * quadratic[0] - quadratic[1]  # the next term is linear in X
    assert_allclose(extrapolated / slope**2, 7.0 / 6.0, rtol=1e-3)


def test_dimitriadis_step_at_one_half_is_as_stated():
    correction = CORRECTIONS["dimitriadis2002", "sphere"]
    X = np.array([0.75])
    printed, general = (
        correction.factor(contact_of("sphere", nu=nu)).value(X)[0] for nu in (0.5, 0.5 - 1e-12)
    )
    assert_allclose(printed / general - 1.0, 0.02, atol=0.005)


def test_sphere_force_written_out():
    R, h, E, d = 5e-6, 8e-6, 2e3, 0.4e-6
    X = np.sqrt(R * d) / h
    law = law_of("garcia2018", ul.Paraboloid(R), thickness=h, E=E)
    expected = (
        (16.0 / 9.0) * E * np.sqrt(R) * d**1.5 * (1 + 1.133 * X + 1.497 * X**2 + 1.469 * X**3 + 0.755 * X**4)
    )
    assert_allclose(law.force(d), expected, rtol=1e-14)
    assert_allclose(law.contact_radius(d), np.sqrt(R * d), rtol=1e-14)


def test_cone_half_angle_is_from_the_axis_in_radians():
    degrees, h, E, d = 35.0, 8e-6, 2e3, 0.4e-6
    tangent = np.tan(np.deg2rad(degrees))
    law = law_of("managuli2018", ul.Cone(np.deg2rad(degrees)), thickness=h, E=E)
    C = 1.7795 * tangent / np.pi**2
    expected = (8.0 / (3.0 * np.pi)) * E * tangent * d**2 * (1 + 4 * C * d / h + 20 * C**2 * (d / h) ** 2)
    assert_allclose(law.force(d), expected, rtol=1e-14)
    with pytest.raises(ul.InputError, match="degrees"):
        ul.Cone(degrees)


def test_punch_force_written_out():
    a, h, E, d = 1e-3, 2.5e-3, 1e6, 1e-5
    law = published_law("hayes1972", ul.FlatPunch(a), ul.Layer(ul.Isotropic(E, 0.5), h), ul.RIGID, 2e-5)
    assert_allclose(law.force(d), 2.0 * a * d * 1.683 * E / 0.75, rtol=1e-14)
    assert_allclose(law.stiffness(d), law.force(d) / d, rtol=1e-14)


def test_depth_is_measured_from_contact():
    law = law_of("garcia2018", ul.Paraboloid(5e-6))
    contact_depth = 3e-7
    piezo = np.array([-1e-6, 0.0, contact_depth, 5e-7, 1.2e-6])
    force = law.force(piezo - contact_depth)
    assert force[:3].tolist() == [0.0, 0.0, 0.0]
    # The correction is that of the depth after contact, not of the reading.
    assert force[4] == law.force(9e-7)


def test_the_layers_own_nu_is_used():
    stiff, soft = (law_of("dimitriadis2002", ul.Paraboloid(5e-6), nu=nu) for nu in (0.5, 0.3))
    X = np.sqrt(5e-6 * 1e-6) / 10e-6
    alpha = -(1.2876 - 1.4678 * 0.3 + 1.3442 * 0.09) / 0.7
    assert_allclose(soft.factor.value(np.array([1e-9])) - 1.0, -2.0 * alpha / np.pi * 1e-9, rtol=1e-6)
    assert stiff.factor.value(np.array([X]))[0] > soft.factor.value(np.array([X]))[0]
    assert_allclose(soft.contact.halfspace.theta, 3e3 / (2.0 * 0.91), rtol=1e-15)


def test_a_formula_for_nu_one_half_says_so_when_given_another():
    layer = ul.Layer(ul.Isotropic(3e3, 0.45), 10e-6)
    with pytest.warns(ul.UnderlayWarning, match=r"nu of the layer is 0\.45, outside 0\.5 to 0\.5"):
        law = published_law("garcia2018", ul.Paraboloid(5e-6), layer, ul.RIGID, 1e-6)
    assert law.warnings == (OutOfRange("nu of the layer", 0.45, 0.5, 0.5),)
    assert law.error_estimate == np.inf
    halfspace = (4.0 / 3.0) * 3e3 / (1.0 - 0.45**2) * np.sqrt(5e-6) * 1e-6**1.5
    assert_allclose(law.force(1e-6) / halfspace, law.factor.value(law.contact.variable(np.array([1e-6])))[0])


def test_hayes_refuses_what_its_table_does_not_hold():
    layer = ul.Layer(ul.Isotropic(1e6, 0.4), 2e-3)
    with pytest.raises(ul.InputError, match=r"nu = 0\.3 and 0\.5 alone; the layer's nu is 0\.4"):
        published_law("hayes1972", ul.FlatPunch(1e-3), layer, ul.RIGID, 1e-5)
    with pytest.raises(ul.InputError, match="table of hayes1972 ends at a/h = 2"):
        law_of("hayes1972", ul.FlatPunch(5e-3), thickness=2e-3)


# --- laws every one of them keeps ----------------------------------------------------------------------


@pytest.mark.parametrize("correction", ul.published_corrections(), ids=label)
def test_stiffness_is_the_derivative_of_the_force_and_depth_its_inverse(correction):
    law = law_for(correction)
    depth = np.array([1e-9, 3e-8, 2.1e-7, 6e-7, 9e-7])
    # Truncation step^4/30 d^5P/dd^5 is about 1e-12 of the slope, rounding 1e-16/1e-3.
    assert_allclose(law.stiffness(depth), differences(law.force, depth, 1e-3), rtol=1e-10)
    for w in (depth, np.array([1e-12, 1e-8, 2e-7, 1e-6])):
        assert_allclose(law.depth(law.force(w)), w, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "kind", "sizes"),
    [
        ("hermanowicz2021", "sphere", [0.3, 0.6, 0.7, 1.5]),
        ("doss2019", "sphere", [0.3, 1.1, 1.2, 2.0]),
        ("long2011", "sphere", [0.3, 1.0, 2.0]),
    ],
)
def test_slope_on_both_sides_of_a_switch(name, kind, sizes):
    contact = contact_of(kind, size=5.0, ratio=np.inf if name != "doss2019" else 7.0)
    factor = CORRECTIONS[name, kind].factor(contact)
    u = np.array(sizes)
    assert_allclose(factor.slope(u), differences(factor.value, u, 1e-4), rtol=1e-9)


@settings(max_examples=40)
@given(
    correction=st.sampled_from(ul.published_corrections()),
    length=st.floats(1e-3, 1e3),
    stiffness=st.floats(1e-3, 1e3),
)
def test_force_scales_with_modulus_and_lengths(correction, length, stiffness):
    one, other = law_for(correction), law_for(correction, length, stiffness)
    # Powers of lengths amplify the rounding of the arguments to a few units in the last place.
    assert_allclose(other.force(5e-7 * length), one.force(5e-7) * stiffness * length**2, rtol=1e-13)


@pytest.mark.parametrize("correction", ul.published_corrections(), ids=label)
def test_an_endlessly_thick_layer_is_a_half_space(correction):
    # Long's branch for R/h < 2 does not hold for a thick layer; its range ends at R/h = 0.3.
    thickness, max_depth = (1.0, 1e-6) if correction.name != "long2011" else (2.4e-6, 1e-17)
    law = law_for(correction, thickness=thickness, max_depth=max_depth)
    assert_allclose(law.force(max_depth) / law.contact.halfspace.force(max_depth), 1.0, atol=2e-5)


@pytest.mark.parametrize("correction", ELASTIC_ONES, ids=label)
def test_a_base_like_the_layer_is_no_base_and_a_stiffer_one_gives_more_force(correction):
    tip = ul.Paraboloid(5e-6) if correction.indenter == "sphere" else ul.FlatPunch(4e-6)
    laws = [law_of(correction.name, tip, base=ul.Isotropic(E, 0.5)) for E in (1e3, 2e3, 3e3, 6e3, 3e4, 3e5)]
    ratio = laws[2].force(1e-6) / laws[2].contact.halfspace.force(1e-6)
    # Hay and Crawford's constant does not vanish with the contrast.
    assert_allclose(ratio, 1.0, atol=0.02 if correction.name == "hay2011" else 1e-14)
    assert (np.diff([law.force(1e-6) for law in laws]) > 0.0).all()


@pytest.mark.parametrize("name", ["gao1992", "hay2011"])
def test_a_punch_far_wider_than_the_film_feels_the_base_alone(name):
    base = ul.Isotropic(9e3, 0.3)
    law = law_of(name, ul.FlatPunch(1.0), base=base, thickness=1e-6)
    assert_allclose(law.stiffness(1e-6), 4.0 * base.theta, rtol=1e-3)


def test_doss_large_contact_feels_the_base_alone():
    law = law_of("doss2019", ul.Paraboloid(1.0), base=ul.Isotropic(9e3, 0.5), thickness=1e-8)
    assert_allclose(law.force(1e-6) / law.contact.halfspace.force(1e-6), 3.0, rtol=1e-6)


# --- ranges, warnings, refusals -------------------------------------------------------------------------


def test_a_law_within_its_range_is_silent_and_knows_its_error():
    law = published_law(
        "garcia2018", ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(3e3, 0.5), 10e-6), ul.RIGID, 1e-6
    )
    assert law.warnings == ()
    X = np.sqrt(5e-6 * 1e-6) / 10e-6
    true = np.abs(signed_error("garcia2018", "sphere", np.linspace(0.01, X, 50))).max()
    assert true / 3.0 <= law.error_estimate <= 3.0 * true
    assert "Garcia & Garcia 2018" in law.reason
    assert law.method == "garcia2018"


def test_outside_the_range_the_law_warns_once_and_answers():
    layer = ul.Layer(ul.Isotropic(3e3, 0.5), 2e-6)
    with pytest.warns(ul.UnderlayWarning, match=r"X = sqrt\(R d\)/h is 1\.118, outside 0 to 0\.75") as caught:
        law = published_law("garcia2018", ul.Paraboloid(5e-6), layer, ul.RIGID, 1e-6)
    assert len(caught) == 1
    law.force(1e-6)  # a further warning here would be an error
    law.stiffness(1e-6)
    (record,) = law.warnings
    assert (record.low, record.high) == (0.0, 0.75)
    assert_allclose(record.value, np.sqrt(5.0) / 2.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        record.value = 0.0
    assert law.error_estimate > 0.15


def test_long_checks_depth_and_radius_too():
    law = law_of("long2011", ul.Paraboloid(50e-6), thickness=3e-6, max_depth=2e-6)
    assert {record.variable for record in law.warnings} == {"R/h", "d/h", "X = sqrt(R d)/h"}


def test_clifford_and_gao_check_the_contrast():
    soft = law_of("clifford2009", ul.Paraboloid(5e-6), base=ul.Isotropic(2e3, 0.5), max_depth=1e-7)
    assert [record.variable for record in soft.warnings] == ["E of the base over E of the layer"]
    hard = law_of("gao1992", ul.FlatPunch(4e-6), base=ul.Isotropic(3e4, 0.5))
    assert hard.warnings == (OutOfRange("E of the base over E of the layer", 10.0, 0.5, 2.0),)
    assert hard.error_estimate > 0.5


def test_a_true_sphere_is_a_paraboloid_with_a_larger_error():
    layer = ul.Layer(ul.Isotropic(3e3, 0.5), 20e-6)
    sphere, paraboloid = (
        published_law("garcia2018", tip(5e-6), layer, ul.RIGID, 2e-6) for tip in (ul.Sphere, ul.Paraboloid)
    )
    assert sphere.force(2e-6) == paraboloid.force(2e-6)
    # Half-space: Hertz against the true sphere at d/R = 0.4 is about 4 to 6 % high.
    assert 0.02 < sphere.error_estimate - paraboloid.error_estimate < 0.08
    assert law_of("garcia2018", ul.Sphere(5e-6), thickness=200e-6, max_depth=30e-6).error_estimate == np.inf


GEL = ul.Layer(ul.Isotropic(3e3, 0.5), 10e-6)
FIBROUS = ul.TransverselyIsotropic(E=3e3, E_axial=2e3, nu=0.3, nu_axial=0.2, G_axial=1e3)
BOWL, PUNCH, ELASTIC_BASE = ul.Paraboloid(5e-6), ul.FlatPunch(5e-6), "on an isotropic elastic substrate"


@pytest.mark.parametrize(
    ("name", "indenter", "layer", "base", "message"),
    [
        ("garcia2081", BOWL, GEL, ul.RIGID, "Did you mean 'garcia2018'"),
        ("hertz", BOWL, GEL, ul.RIGID, "Known: dimitriadis2002"),
        ("managuli2018", BOWL, GEL, ul.RIGID, r"needs a cone \(Cone\); got Paraboloid"),
        ("dimitriadis2002", ul.Cone(0.5), GEL, ul.RIGID, r"a sphere \(Paraboloid or Sphere\); got Cone"),
        ("garcia2018", ul.PowerLaw(1.5, 1.0), GEL, ul.RIGID, "needs a sphere or a cone or a flat punch"),
        ("garcia2018", BOWL, GEL, ul.Isotropic(1e9, 0.3), "on a rigid substrate; got Isotropic"),
        ("hay2011", PUNCH, GEL, ul.RIGID, f"{ELASTIC_BASE}; got Isotropic.* on RIGID"),
        ("hay2011", PUNCH, GEL, FIBROUS, ELASTIC_BASE),
        ("garcia2018", BOWL, ul.Layer(FIBROUS, 1e-5), ul.RIGID, "needs an isotropic layer"),
        ("garcia2018", BOWL, ul.Layer(ul.Isotropic(3e3, 0.5)), ul.RIGID, "finite thickness"),
    ],
)
def test_refusals_say_what_is_needed(name, indenter, layer, base, message):
    with pytest.raises(ul.InputError, match=message):
        published_law(name, indenter, layer, base, 1e-6)


@pytest.mark.parametrize("max_depth", [0.0, -1e-6, np.inf, np.nan])
def test_the_largest_depth_must_be_given(max_depth):
    with pytest.raises(ul.InputError, match="max_depth"):
        published_law("garcia2018", ul.Paraboloid(5e-6), GEL, ul.RIGID, max_depth)


def test_a_formula_that_turns_down_is_refused():
    with pytest.raises(ul.RangeError, match="stops growing") as caught:
        law_of("long2011", ul.Paraboloid(3e-6), max_depth=8e-6)
    # Up to the depth it names, it works.
    law_of("long2011", ul.Paraboloid(3e-6), max_depth=caught.value.max_depth)
    with pytest.raises(ul.RangeError, match="no growing force at all"):
        law_of("garcia2018", ul.FlatPunch(60e-6))


def test_beyond_the_largest_depth_is_an_error():
    law = law_of("garcia2018", ul.Paraboloid(5e-6))
    with pytest.raises(ul.RangeError, match="build it for more"):
        law.force(1.1e-6)


# --- the records ------------------------------------------------------------------------------------------


def test_records_are_complete_and_distinct():
    records = ul.published_corrections()
    assert len({(record.name, record.indenter) for record in records}) == len(records) == 14
    assert published_names() == tuple(dict.fromkeys(record.name for record in records))
    for record in records:
        assert re.fullmatch(r"10\.\d{4,5}/\S+", record.doi), record.name
        assert re.search(r"(19|20)\d\d", record.source).group() == re.search(r"\d{4}", record.name).group()
        assert record.assumptions
        assert record.equation
        assert record.range_basis
        low, high = record.valid_range
        assert low < high
        with pytest.raises(dataclasses.FrozenInstanceError):
            record.name = "other"


@pytest.mark.parametrize("correction", ul.published_corrections(), ids=label)
def test_laws_travel_between_processes(correction):
    law = law_for(correction)
    copy = pickle.loads(pickle.dumps(law))  # noqa: S301 - our own bytes
    assert copy.correction == correction
    assert hash(copy.correction) == hash(correction)
    assert copy.force(5e-7) == law.force(5e-7)
    assert copy.warnings == law.warnings


def test_every_error_is_one_of_ours():
    with pytest.raises(ul.UnderlayError):
        published_law("nobody1900", ul.Paraboloid(1.0), GEL, ul.RIGID, 1.0)
