"""The exact law: laws of the contact problem that hold without any reference number."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import underlay as ul
from support.laws import exact_law
from underlay.mechanics.exact.contact_problem import SHARE_OF_NODES, ContactProblem
from underlay.mechanics.halfspace import HalfspaceLaw

SHAPES = {
    "cone": ul.Cone(1.2),
    "paraboloid": ul.Paraboloid(20.0),
    "lambda 1.5": ul.PowerLaw(1.5, 0.1),
    "lambda 4": ul.PowerLaw(4.0, 0.01),
    "sphere": ul.Sphere(11.0),
}
RTOL = 1e-8


def depth_at(shape, radius):
    """Depth at which a half-space would show that contact radius."""
    return float(shape.abel(np.array(radius)))


@st.composite
def cases(draw):
    """A shape, a layer one length unit thick on a substrate, and a depth."""
    shape = SHAPES[draw(st.sampled_from(sorted(SHAPES)))]
    layer = ul.Isotropic(draw(st.floats(0.5, 2.0)), draw(st.floats(0.0, 0.5)))
    # A cone on a base more than twenty times softer folds; the other shapes never do.
    softest = -1.0 if isinstance(shape, ul.Cone) else -2.5
    power = draw(st.floats(softest, 3.0))
    base = draw(st.sampled_from([ul.RIGID, ul.Isotropic(layer.E * 10.0**power, draw(st.floats(0.0, 0.5)))]))
    return shape, ul.Layer(layer, 1.0), base, depth_at(shape, draw(st.floats(0.02, 3.0)))


@settings(max_examples=40, derandomize=True)
@given(cases())
def test_stiffness_is_the_slope_of_force(case):
    shape, layer, base, deepest = case
    law = exact_law(shape, layer, base, max_depth=deepest, rtol=RTOL)
    # Work done between two depths by Gauss-Legendre: the increase of force is the integral of stiffness.
    x, weight = np.polynomial.legendre.leggauss(24)
    low, high = 0.3 * deepest, deepest
    w = low + 0.5 * (high - low) * (x + 1.0)
    gained = 0.5 * (high - low) * (weight @ law.stiffness(w))
    # Both sides carry the law's own error; the quadrature is exact to rounding on so smooth a curve.
    assert law.force(low) + gained == pytest.approx(law.force(high), rel=10 * RTOL)


@settings(max_examples=25, derandomize=True)
@given(cases())
def test_stiffness_is_that_of_a_flat_punch_of_the_contact_radius(case):
    shape, layer, base, deepest = case
    law = exact_law(shape, layer, base, max_depth=deepest, rtol=RTOL)
    radius = float(law.contact_radius(deepest))
    punch = exact_law(ul.FlatPunch(radius), layer, base, max_depth=1.0, rtol=RTOL)
    # The punch is solved at the law's radius: its error enters times dln(kappa a)/dln a, below 4.
    assert law.stiffness(deepest) == pytest.approx(punch.stiffness(0.1), rel=10 * RTOL)


@settings(max_examples=25, derandomize=True)
@given(cases())
def test_force_radius_and_depth_increase_and_invert(case):
    shape, layer, base, deepest = case
    law = exact_law(shape, layer, base, max_depth=deepest, rtol=RTOL)
    w = deepest * np.linspace(1e-3, 1.0, 200)
    assert (np.diff(law.force(w)) > 0.0).all()
    assert (np.diff(law.contact_radius(w)) > 0.0).all()
    # Newton ends at rounding; force and stiffness differ from one another by the law's error only.
    np.testing.assert_allclose(law.depth(law.force(w)), w, rtol=1e-10)


@settings(max_examples=25, derandomize=True)
@given(cases(), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_only_ratios_matter(case, stiffer, longer):
    shape, layer, base, deepest = case
    scaled = {
        ul.Cone: lambda s: s,
        ul.Paraboloid: lambda s: ul.Paraboloid(s.radius * longer),
        ul.Sphere: lambda s: ul.Sphere(s.radius * longer),
        ul.PowerLaw: lambda s: ul.PowerLaw(s.exponent, s.coefficient * longer ** (1.0 - s.exponent)),
    }[type(shape)](shape)
    material = layer.material
    other = base if base is ul.RIGID else ul.Isotropic(base.E * stiffer, base.nu)
    law = exact_law(shape, layer, base, max_depth=deepest, rtol=RTOL)
    twin = exact_law(
        scaled,
        ul.Layer(ul.Isotropic(material.E * stiffer, material.nu), longer),
        other,
        max_depth=deepest * longer,
        rtol=RTOL,
    )
    w = deepest * np.array([0.1, 0.5, 1.0])
    np.testing.assert_allclose(twin.force(w * longer), law.force(w) * stiffer * longer**2, rtol=2 * RTOL)
    np.testing.assert_allclose(twin.contact_radius(w * longer), law.contact_radius(w) * longer, rtol=2 * RTOL)


@settings(max_examples=25, derandomize=True)
@given(cases(), st.floats(0.3, 0.95))
def test_a_softer_substrate_carries_less(case, softer):
    shape, layer, base, deepest = case
    weaker = (
        ul.Isotropic(layer.material.E * 50.0, 0.3)
        if base is ul.RIGID
        else ul.Isotropic(base.E * softer, base.nu)
    )
    w = deepest * np.array([0.1, 0.5, 1.0])
    law = exact_law(shape, layer, base, max_depth=deepest, rtol=RTOL)
    less = exact_law(shape, layer, weaker, max_depth=deepest, rtol=RTOL)
    assert (less.force(w) < law.force(w)).all()


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_identical_materials_and_an_infinite_layer_are_a_half_space(name):
    shape, material = SHAPES[name], ul.Isotropic(2.0, 0.4)
    deepest = depth_at(shape, 2.0)
    w = deepest * np.array([1e-6, 0.1, 1.0])
    half = HalfspaceLaw(
        method="halfspace",
        reason="",
        max_depth=deepest,
        error_estimate=0.0,
        indenter=shape,
        theta=material.theta,
    )
    for layer, base in (
        (ul.Layer(material, 1.0), material),
        (ul.Layer(material), ul.RIGID),
        (ul.Layer(material), None),
    ):
        law = exact_law(shape, layer, base, max_depth=deepest, rtol=1e-9)
        # A power law's factors are then exactly one; the sphere's are expanded, within rtol.
        np.testing.assert_allclose(law.force(w), half.force(w), rtol=1e-9)
        np.testing.assert_allclose(law.contact_radius(w), half.contact_radius(w), rtol=1e-9)
        np.testing.assert_allclose(law.stiffness(w), half.stiffness(w), rtol=1e-9)


@pytest.mark.parametrize("ratio", [3.0, 0.5])
def test_a_wide_contact_feels_the_substrate_alone(ratio):
    # kappa_inf -> theta_2/theta_1 as a/h -> inf; the error of order (h/a) ln(a/h) a little less than halves.
    layer, base = ul.Isotropic(1.0, 0.3), ul.Isotropic(ratio, 0.3)
    gaps = []
    for eps in (5.0, 10.0, 20.0):
        law = exact_law(ul.FlatPunch(eps), ul.Layer(layer, 1.0), base, max_depth=1.0, rtol=1e-8)
        gaps.append(abs(law.stiffness(1.0) / (4.0 * base.theta * eps) - 1.0))
    assert gaps[2] < 0.1
    assert 1.5 < gaps[0] / gaps[1] < gaps[1] / gaps[2] < 2.0


@pytest.mark.parametrize(("nu", "fraction"), [(0.3, 0.02), (0.5, 0.03)])
def test_a_wide_punch_on_a_rigid_base_meets_the_thin_layer_theory(nu, fraction):
    material = ul.Isotropic(1.0, nu)
    eps = 20.0
    law = exact_law(ul.FlatPunch(eps), ul.Layer(material, 1.0), ul.RIGID, max_depth=1.0, rtol=1e-8)
    kappa = law.stiffness(1.0) / (4.0 * material.theta * eps)
    if nu == 0.5:
        expected = 3.0 * np.pi / 64.0 * eps**3 * (1.0 + 1.459 / eps) ** 4
    else:
        confined = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
        expected = np.pi * confined / (4.0 * material.theta) * eps * (1.0 + 0.244 / eps)
    # The next term of either expansion is of order 1/eps^2 = 0.0025 of the leading one.
    assert kappa == pytest.approx(expected, rel=fraction * 0.2)


def test_a_small_contact_on_a_sphere_is_one_on_a_paraboloid():
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    w = 1e-6 * np.array([0.2, 1.0])
    sphere = exact_law(ul.Sphere(1e3), layer, ul.RIGID, max_depth=1e-6, rtol=1e-9)
    paraboloid = exact_law(ul.Paraboloid(1e3), layer, ul.RIGID, max_depth=1e-6, rtol=1e-9)
    # H(r) = (r^2/R)(1 + r^2/(3 R^2)): a/R = 3e-5 leaves 3e-10.
    np.testing.assert_allclose(sphere.force(w), paraboloid.force(w), rtol=3e-9)


def test_a_very_blunt_power_law_is_a_flat_punch():
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    gaps = []
    for exponent in (50.0, 100.0, 200.0):
        # r = 1 at depth F_2, the radius hardly changes around it.
        shape = ul.PowerLaw(exponent, 1.0)
        law = exact_law(shape, layer, ul.RIGID, max_depth=2.0 * depth_at(shape, 1.0), rtol=1e-8)
        radius = float(law.contact_radius(depth_at(shape, 1.0)))
        punch = exact_law(ul.FlatPunch(radius), layer, ul.RIGID, max_depth=1e3, rtol=1e-8)
        w = depth_at(shape, 1.0)
        gaps.append(abs(law.force(w) / punch.force(w) - 1.0))
    # P = P_punch lambda/(lambda+1) to leading order: the gap falls as 1/lambda.
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.1)
    assert gaps[1] / gaps[2] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(0.1, 0.3)])
def test_isotropic_constants_make_the_anisotropic_law_isotropic(base):
    E, nu = 1.3, 0.35
    same = ul.TransverselyIsotropic(E, E, nu, nu, E / (2.0 * (1.0 + nu)))
    shape, w = ul.Paraboloid(5.0), np.array([0.01, 0.3])
    plain = exact_law(shape, ul.Layer(ul.Isotropic(E, nu), 1.0), base, max_depth=0.3, rtol=1e-9)
    other = exact_law(shape, ul.Layer(same, 1.0), base, max_depth=0.3, rtol=1e-9)
    np.testing.assert_allclose(other.force(w), plain.force(w), rtol=2e-9)


def test_a_measured_paraboloid_is_a_paraboloid():
    r = np.linspace(0.0, 4.0, 9)
    tip, shape = ul.Profile(r, r**2 / 40.0), ul.Paraboloid(20.0)
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    w = depth_at(shape, 1.0) * np.array([0.01, 0.3, 1.0])
    measured = exact_law(tip, layer, ul.RIGID, max_depth=w[-1], rtol=1e-6)
    analytic = exact_law(shape, layer, ul.RIGID, max_depth=w[-1], rtol=1e-8)
    np.testing.assert_allclose(measured.force(w), analytic.force(w), rtol=1e-6)
    np.testing.assert_allclose(measured.contact_radius(w), analytic.contact_radius(w), rtol=1e-6)


def test_the_curve_serves_another_modulus_and_thickness():
    shape = ul.Paraboloid(2.0)
    law = exact_law(shape, ul.Layer(ul.Isotropic(1.0, 0.45), 1.0), ul.RIGID, max_depth=0.5, rtol=1e-8)
    other = exact_law(shape, ul.Layer(ul.Isotropic(3.0, 0.45), 1.7), ul.RIGID, max_depth=0.5, rtol=1e-8)
    reused = replace(law, theta=ul.Isotropic(3.0, 0.45).theta, thickness=1.7)
    w = np.linspace(0.01, 0.5, 7)
    np.testing.assert_allclose(reused.force(w), other.force(w), rtol=2e-8)


# --- the border -------------------------------------------------------------------------------------------


def test_no_contact_no_force():
    law = exact_law(ul.Paraboloid(1.0), ul.Layer(ul.Isotropic(1.0, 0.5), 1.0), ul.RIGID, max_depth=0.1)
    depth = np.array([-1.0, -0.0, 0.0, 5e-324])
    np.testing.assert_array_equal(law.force(depth)[:3], 0.0)
    np.testing.assert_array_equal(law.stiffness(depth)[:3], 0.0)
    assert 0.0 <= law.force(5e-324) < 1e-300


def test_depths_beyond_are_refused_with_the_largest_that_works():
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    law = exact_law(ul.Paraboloid(1.0), layer, ul.RIGID, max_depth=0.1)
    with pytest.raises(ul.RangeError, match="build it for more") as caught:
        law.force(0.11)
    assert caught.value.max_depth == 0.1
    with pytest.raises(ul.InputError, match="depth"):
        law.force(np.nan)
    with pytest.raises(ul.RangeError, match="20 thicknesses") as caught:
        exact_law(ul.Paraboloid(1e4), layer, ul.RIGID, max_depth=1.0)
    deepest = caught.value.max_depth
    reached = exact_law(ul.Paraboloid(1e4), layer, ul.RIGID, max_depth=deepest * (1 - 1e-9)).contact_radius(
        deepest * 0.999999
    )
    assert reached == pytest.approx(20.0, rel=1e-5)
    with pytest.raises(ul.RangeError, match="20"):
        exact_law(ul.FlatPunch(21.0), layer, ul.RIGID, max_depth=1.0)


def test_the_end_of_a_sphere_is_said():
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    with pytest.raises(ul.RangeError, match="end of the indenter's shape") as caught:
        exact_law(ul.Sphere(1.0), layer, ul.RIGID, max_depth=100.0)
    shallower = exact_law(
        ul.Sphere(1.0), layer, ul.RIGID, max_depth=0.999 * caught.value.max_depth, rtol=1e-4
    )
    assert 0.99 < shallower.contact_radius(shallower.max_depth) < 0.9999 * (1 + 1e-4)


def test_a_folding_contact_keeps_the_larger_load():
    # A cone, a film, a base a thousand times softer: over some depths three radii solve the equations.
    shape, layer, base = ul.Cone(1.2), ul.Layer(ul.Isotropic(1.0, 0.3), 1.0), ul.Isotropic(1e-3, 0.5)
    law = exact_law(shape, layer, base, max_depth=9.5, rtol=1e-6)
    assert len(law.curve.jumps) == 1
    assert "jump" in law.reason
    jump = float(shape.abel(np.array(law.curve.jumps[0])))
    below, above = jump * (1 - 1e-9), jump * (1 + 1e-9)
    # Force is continuous where the branches carry the same load; radius and stiffness step up.
    assert law.force(above) == pytest.approx(law.force(below), rel=1e-6)
    assert law.contact_radius(above) > 5.0 * law.contact_radius(below)
    assert law.stiffness(above) > law.stiffness(below)


@pytest.mark.parametrize("ratio", [1e-5, 1e-3])
@pytest.mark.parametrize("tip", [ul.Paraboloid(20.0), ul.Sphere(60.0)], ids=["paraboloid", "sphere"])
def test_narrow_contacts_among_wide_ones_are_as_exact_on_the_nodes_that_do_for_them(tip, ratio):
    contact = ul.Contact.of(tip, ul.Layer(ul.Isotropic(1.0, 0.4), 1.0), ul.Isotropic(ratio, 0.45))
    problem = ContactProblem.of(tip, 1.0, contact.kernel)
    chi, rtol = np.geomspace(0.02, 20.0, 120), 1e-7
    resolution = problem.resolution(20.0, rtol)
    # Enough of them for narrow ones to be solved for by themselves.
    assert chi.size * resolution.size > 1_000_000
    exact = np.column_stack(problem.solve(chi, problem.resolution(20.0, 1e-11)))
    graded = np.column_stack(problem.solve(chi, resolution, rtol))
    # The share of the error that is claimed for nodes.
    assert (np.abs(graded - exact) < SHARE_OF_NODES * rtol * np.maximum(np.abs(exact), 1.0)).all()
    assert np.abs(graded - np.column_stack(problem.solve(chi, resolution))).max() > 0.0
    # The widest need all of theirs.
    fewer = np.column_stack(problem.solve(chi[-5:], problem.resolution(10.0, rtol)))
    assert np.abs(fewer - exact[-5:]).max() > SHARE_OF_NODES * rtol
