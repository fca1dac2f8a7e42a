"""Half-space law and indenters: Galin-Sneddon integrals, Hertz, limits, and the border of every law."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special
from scipy.integrate import quad

import underlay as ul

GEL = ul.Isotropic(E=2e3, nu=0.45)
SHAPES = [
    ul.Paraboloid(3e-3),
    ul.Cone(np.deg2rad(70.0)),
    ul.PowerLaw(1.5, 2.0),
    ul.PowerLaw(4.0, 1e6),
    ul.Sphere(3e-3),
]


def law_of(indenter, material=GEL):
    return ul.contact_law(indenter, ul.Layer(material), max_depth=1e-4)


@pytest.mark.parametrize("indenter", SHAPES, ids=lambda shape: shape.shape)
def test_abel_transform_is_the_galin_sneddon_integral(indenter):
    # (2.13): H(a) = a int_0^(pi/2) Phi'(a sin t) dt, with Phi' by a symmetric difference of the shape;
    # the difference's own error is (step^2/6) Phi'''/Phi' < 1e-8 at a relative step of 1e-4.
    a, step = 1e-3, 1e-4

    def slope(r):
        return (indenter.surface(r * (1 + step)) - indenter.surface(r * (1 - step))) / (2 * step * r)

    integral = a * quad(lambda t: slope(a * np.sin(t)), 0.0, np.pi / 2, epsrel=1e-11, epsabs=0)[0]
    assert indenter.abel(np.array(a)) == pytest.approx(integral, rel=2e-7)


@pytest.mark.parametrize("indenter", SHAPES, ids=lambda shape: shape.shape)
def test_moments_integrate_the_abel_transform(indenter):
    for a in np.array([1e-6, 1e-3, 1.499e-3, 1.501e-3, 2.9e-3]):
        # In x = s/a the integrand is smooth, so adaptive quadrature reaches rounding.
        first = a * quad(lambda x: float(indenter.abel(x * a)), 0, 1, epsrel=1e-13, epsabs=0)[0]  # noqa: B023
        third = a**3 * quad(lambda x: x * x * float(indenter.abel(x * a)), 0, 1, epsrel=1e-13, epsabs=0)[0]  # noqa: B023
        moments = indenter.abel_moments(np.array(a))
        assert float(moments[0]) == pytest.approx(first, rel=1e-13)
        assert float(moments[1]) == pytest.approx(third, rel=1e-13)


@pytest.mark.parametrize("indenter", SHAPES, ids=lambda shape: shape.shape)
def test_the_force_on_a_half_space_is_what_the_moment_leaves(indenter):
    radius = np.array([1e-6, 1e-3, 1.499e-3, 1.501e-3, 2.9e-3])
    depth = indenter.abel(radius)
    left = depth * radius - indenter.abel_moments(radius)[0]
    assert indenter.halfspace_force(depth, radius) == pytest.approx(left, rel=1e-14)


@given(st.floats(-12.0, 0.69))
def test_sphere_radius_inverts_its_depth(exponent):
    sphere = ul.Sphere(1.0)
    depth = np.array([10.0**exponent])
    radius = sphere.halfspace_radius(depth)
    # dH/da at a/R = 0.9999 is 5e3, so one rounding of the radius is 5e3 roundings of the depth.
    assert sphere.abel(radius) == pytest.approx(depth, rel=1e-12)


def test_hertz():
    # Hertz (1881): P = 4/3 E/(1-nu^2) sqrt(R) d^1.5.
    depth = np.geomspace(1e-9, 1e-4, 30)
    hertz = 4.0 / 3.0 * GEL.E / (1 - GEL.nu**2) * np.sqrt(3e-3) * depth**1.5
    assert law_of(ul.Paraboloid(3e-3)).force(depth) == pytest.approx(hertz, rel=1e-14)


def test_sneddon_cone_and_boussinesq_punch():
    depth = np.geomspace(1e-9, 1e-4, 30)
    modulus = GEL.E / (1 - GEL.nu**2)
    cone = 2.0 / np.pi * modulus * np.tan(np.deg2rad(35.0)) * depth**2
    assert law_of(ul.Cone(np.deg2rad(35.0))).force(depth) == pytest.approx(cone, rel=1e-14)
    assert law_of(ul.FlatPunch(2e-3)).force(depth) == pytest.approx(2.0 * modulus * 2e-3 * depth, rel=1e-14)


def test_equivalent_cones_have_the_pyramids_area():
    assert np.rad2deg(ul.Cone.berkovich().half_angle) == pytest.approx(70.30, abs=0.01)  # the known 70.3 deg
    assert np.rad2deg(ul.Cone.vickers().half_angle) == pytest.approx(70.30, abs=0.01)


def test_shallow_sphere_is_the_paraboloid():
    # w = a artanh(a/R) = a^2/R (1 + (a/R)^2/3 + ...): forces differ by O(w/R).
    depth = np.array([1e-12])
    ratio = law_of(ul.Sphere(1e-3)).force(depth) / law_of(ul.Paraboloid(1e-3)).force(depth)
    assert ratio == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("indenter", [*SHAPES, ul.FlatPunch(1e-3)], ids=lambda shape: shape.shape)
class TestBorder:
    def test_stiffness_is_the_derivative(self, indenter):
        law = law_of(indenter)
        w, step = 5e-5, 1e-5

        # Central difference, Richardson twice: the remainder is O(step^6), far below 1e-8 here.
        def difference(h):
            return (law.force(w * (1 + h)) - law.force(w * (1 - h))) / (2 * h * w)

        richardson = (
            64 * ((4 * difference(step) - difference(2 * step)) / 3)
            - 4 * ((4 * difference(2 * step) - difference(4 * step)) / 3)
        ) / 60
        assert law.stiffness(w) == pytest.approx(richardson, rel=1e-8)

    def test_depth_inverts_force(self, indenter):
        depth = np.array([0.0, 1e-9, 1e-6, 1e-4])
        law = law_of(indenter)
        assert law.depth(law.force(depth)) == pytest.approx(depth, rel=1e-12)

    def test_no_contact_no_force(self, indenter):
        law = law_of(indenter)
        depth = np.array([-1e-3, -5e-324, 0.0])
        for quantity in (law.force, law.stiffness, law.contact_radius):
            assert (quantity(depth) == 0.0).all()

    def test_shapes_of_arrays_are_kept(self, indenter):
        law = law_of(indenter)
        grid = np.linspace(-1e-5, 1e-4, 12).reshape(3, 4)
        assert law.force(grid).shape == (3, 4)
        assert np.ndim(law.force(1e-5)) == 0
        series = pd.Series(grid.ravel())
        assert law.force(series) == pytest.approx(law.force(grid).ravel(), rel=0, abs=0)

    def test_not_a_number_is_refused(self, indenter):
        law = law_of(indenter)
        for bad in (np.nan, np.inf, -np.inf):
            with pytest.raises(ul.InputError, match="index 1"):
                law.force([1e-6, bad])


def test_sphere_says_how_deep_it_may_go():
    law = law_of(ul.Sphere(1e-3))
    with pytest.raises(ul.RangeError, match="larger radius") as caught:
        law.force(6e-3)
    assert law.force(caught.value.max_depth) > 0
    with pytest.raises(ul.RangeError, match="beyond"):
        law.depth(2 * law.force(law.max_depth))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ul.Paraboloid(0.0), "radius must be positive"),
        (lambda: ul.Sphere(-1e-3), "radius must be positive"),
        (lambda: ul.FlatPunch(np.nan), "radius must be positive"),
        (lambda: ul.Cone(35.0), "is it in degrees"),
        (lambda: ul.Cone(0.0), "half-angle"),
        (lambda: ul.PowerLaw(0.9, 1.0), "at least 1"),
        (lambda: ul.PowerLaw(2.0, 0.0), "coefficient must be positive"),
        (lambda: ul.Paraboloid("wide"), "must be a number"),
    ],
)
def test_bad_shapes(make, message):
    with pytest.raises(ul.InputError, match=message):
        make()


def test_negative_force_has_no_depth():
    with pytest.raises(ul.InputError, match="0 N or more"):
        law_of(ul.Paraboloid(1e-3)).depth(-1.0)


def test_a_blunt_power_law_does_not_underflow() -> None:
    """Of exponent 20, where r^20 is 1e-320 and keeps four digits."""
    tip = ul.PowerLaw(20.0, 1e300)
    r = np.array([1e-16])
    depth = 1e-20 * float(10.0 * special.beta(10.0, 0.5))
    assert tip.abel(r)[0] == pytest.approx(depth, rel=1e-12, abs=0.0)
    assert tip.surface(r)[0] == pytest.approx(1e-20, rel=1e-12, abs=0.0)
    assert tip.abel_slope(r)[0] == pytest.approx(20.0 * depth / 1e-16, rel=1e-12, abs=0.0)
    assert tip.halfspace_radius(np.array([depth]))[0] == pytest.approx(1e-16, rel=1e-14, abs=0.0)
    law = ul.contact_law(tip, ul.Layer(ul.Isotropic(1e3, 0.5)), max_depth=1e-19)
    assert law.force(depth) == pytest.approx(
        20.0 / 21.0 * 4.0 * law.theta * depth * 1e-16, rel=1e-12, abs=0.0
    )


def test_a_depth_one_rounding_above_the_largest_is_the_largest() -> None:
    """It was refused with two equal numbers."""
    law = ul.contact_law(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e4, 0.5), 1e-3), ul.RIGID, max_depth=1e-4)
    above = float(np.nextafter(law.max_depth, 1.0))
    assert law.force(above) == pytest.approx(law.force(law.max_depth), rel=1e-14, abs=0.0)
    with pytest.raises(ul.RangeError):
        law.force(law.max_depth * (1.0 + 1e-14))
