"""A measured tip: the interpolant's shape, its integrals, its inverse and its refusals."""

import dataclasses
import itertools

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import underlay as ul
from underlay.mechanics.halfspace import HalfspaceLaw

ROUNDING = 1e-13  # a sum of some hundred terms, each rounded to 1e-16


def tabulated(indenter, r):
    return ul.Profile(r, indenter.surface(r))


def relative(value, reference):
    return np.abs(value / reference - 1.0).max()


def uneven(count, end=1.0, seed=3):
    steps = np.random.default_rng(seed).uniform(0.3, 1.0, count - 1)
    return end * np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])


@pytest.mark.parametrize("indenter", [ul.Paraboloid(0.7), ul.Cone(1.2)], ids=["paraboloid", "cone"])
@pytest.mark.parametrize("r", [np.linspace(0.0, 1.0, 4), uneven(30)], ids=["even", "uneven"])
def test_paraboloid_and_cone_are_reproduced_to_rounding(indenter, r):
    tip = tabulated(indenter, r)
    a = np.linspace(0.01, 1.0, 77)
    assert relative(tip.surface(a), indenter.surface(a)) < 10 * ROUNDING
    assert relative(tip.abel(a), indenter.abel(a)) < ROUNDING
    assert relative(tip.abel_slope(a), indenter.abel_slope(a)) < ROUNDING
    for mine, exact in zip(tip.abel_moments(a), indenter.abel_moments(a), strict=True):
        assert relative(mine, exact) < 10 * ROUNDING


def test_a_finely_tabulated_sphere_converges_to_it_at_third_order():
    sphere = ul.Sphere(1.0)
    a = np.linspace(0.05, 0.8, 50)
    steps = np.array([40, 80, 160, 320])
    errors = [
        relative(tabulated(sphere, np.linspace(0.0, 0.8, n + 1)).abel(a), sphere.abel(a)) for n in steps
    ]
    slope = np.polyfit(np.log(1.0 / steps), np.log(errors), 1)[0]
    assert slope > 2.0  # heights are met to h^3 or better; the depth inherits it
    fine = tabulated(sphere, np.linspace(0.0, 0.8, 1001))
    assert relative(fine.abel(a), sphere.abel(a)) < 1e-6


def pieces_in_mpmath(tip):
    """The interpolant's slope, rebuilt from its heights alone: (left, right, slope at left, inclination)."""
    mids = 0.5 * (tip.r[1:] + tip.r[:-1])
    knots = np.unique(np.concatenate([tip.r, tip._polygon.bend_radii]))
    assert knots.size <= tip.r.size + mids.size
    pieces = []
    for left, right in itertools.pairwise(knots):
        low, middle, high = (float(tip.surface(np.array(x))) for x in (left, 0.5 * (left + right), right))
        width = mpmath.mpf(right) - mpmath.mpf(left)
        curvature = 4 * (mpmath.mpf(low) - 2 * mpmath.mpf(middle) + mpmath.mpf(high)) / width**2
        slope = (mpmath.mpf(high) - mpmath.mpf(low)) / width - curvature * width / 2
        pieces.append((mpmath.mpf(left), mpmath.mpf(right), slope, curvature))
    return pieces


def integral_of_slope(pieces, a, kernel):
    """int_0^a Phi'(s) kernel(s) ds / sqrt(a^2 - s^2) by mpmath, piece by piece, s = a sin(phi)."""
    total = mpmath.mpf(0)
    for left, right, slope, curvature in pieces:
        if left >= a:
            break
        end = min(right, a)

        def integrand(phi, left=left, slope=slope, curvature=curvature):
            s = a * mpmath.sin(phi)
            return (slope + curvature * (s - left)) * kernel(s)

        total += mpmath.quad(integrand, [mpmath.asin(left / a), mpmath.asin(end / a)])
    return total


@pytest.mark.parametrize(
    "height",
    [lambda r: 1 - np.sqrt(1 - r**2), lambda r: np.cosh(2 * r) - 1, lambda r: 0.3 * r + r**3],
    ids=["sphere", "cosh", "blunted cone"],
)
def test_integrals_of_the_interpolant_against_mpmath(height):
    r = uneven(9, end=0.9)
    tip = ul.Profile(r, height(r))
    with mpmath.workdps(25):
        pieces = pieces_in_mpmath(tip)
        for a in (0.03, 0.2, 0.5, 0.9):
            x = mpmath.mpf(a)
            H = x * integral_of_slope(pieces, x, lambda _s: 1)
            first = integral_of_slope(pieces, x, lambda s: x**2 - s**2)  # noqa: B023 - used at once
            # int H s^2 = int Phi' (a^2 - s^2)^(1/2) (a^2 + 2 s^2)/3 ds, (2.13)'s integral exchanged.
            second = integral_of_slope(pieces, x, lambda s: (x**2 - s**2) * (x**2 + 2 * s**2) / 3)  # noqa: B023
            point = np.array(a)
            # 1e-8 is what is promised; the rebuilt slopes carry rounding over the smallest piece, 1e-12.
            assert abs(tip.abel(point) / float(H) - 1) < 1e-11
            assert abs(tip.abel_moments(point)[0] / float(first) - 1) < 1e-11
            assert abs(tip.abel_moments(point)[1] / float(second) - 1) < 1e-11


convex_tips = st.lists(st.tuples(st.floats(0.1, 1.0), st.floats(0.0, 2.0)), min_size=4, max_size=12).map(
    lambda rows: (
        np.concatenate([[0.0], np.cumsum([w for w, _ in rows])]),
        np.concatenate([[0.0], np.cumsum([w * d for (w, _), d in zip(rows, _slopes(rows), strict=True)])]),
    )
)


def _slopes(rows):
    return 0.1 + np.cumsum([change for _, change in rows])


@given(convex_tips)
@settings(max_examples=60)
def test_the_interpolant_meets_the_points_and_is_convex(data):
    r, height = data
    tip = ul.Profile(r, height)
    assert np.abs(tip.surface(r) - height).max() < 1e-9 * height[-1]  # _ROUNDING of the chords, summed
    slope = np.diff(tip.surface(np.linspace(0.0, r[-1], 4001)))
    assert (slope > -1e-12 * height[-1]).all()
    assert (np.diff(slope) > -1e-11 * height[-1]).all()


@given(convex_tips)
@settings(max_examples=60)
def test_depth_radius_round_trip_and_derivatives(data):
    tip = ul.Profile(*data)
    a = np.linspace(0.02, 1.0, 9) * tip.max_radius
    depth = tip.abel(a)
    assert (np.diff(depth) > 0.0).all()
    assert relative(tip.halfspace_radius(depth), a) < 1e-10
    law = HalfspaceLaw(
        method="halfspace", reason="", max_depth=depth[-1], error_estimate=0.0, indenter=tip, theta=1.0
    )
    middle, step = 0.5 * depth[-1], 1e-6 * depth[-1]
    slope = (law.force(middle + step) - law.force(middle - step)) / (2 * step)
    assert abs(slope / law.stiffness(middle) - 1.0) < 1e-5  # central difference; a corner costs step^(1/2)


def test_a_corner_stays_a_corner():
    r = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    tip = ul.Profile(r, np.array([0.0, 1.0, 2.0, 5.0, 8.0]))
    assert np.allclose(tip.surface(np.array([0.5, 1.5, 2.5, 3.5])), [0.5, 1.5, 3.5, 6.5], rtol=0, atol=1e-12)
    # A cone of slope 1, then slope 3 from r = 2: H = (pi/2) r + 2 r acos(2/r).
    assert float(tip.abel(np.array(3.0))) == pytest.approx(1.5 * np.pi + 6 * np.arccos(2 / 3), rel=1e-14)


def test_an_offset_of_the_heights_is_removed_and_equal_tips_are_equal():
    r = np.linspace(0.0, 1.0, 9)
    first, second = ul.Profile(r, r**2), ul.Profile(r, r**2 + 5.0)
    assert first == ul.Profile(list(r), list(r**2))
    assert hash(first) == hash(ul.Profile(r, r**2))
    assert np.allclose(first.height, second.height, rtol=0, atol=1e-15)
    assert first.max_radius == 1.0
    assert not first.r.flags.writeable
    assert [field.name for field in dataclasses.fields(first)] == ["r", "height"]


@pytest.mark.parametrize(
    ("r", "height", "message"),
    [
        ([0, 1, 2], [0, 1, 4], "at least 4 points; got 3"),
        ([0, 1, 2, 3], [0, 1, 4], "equal length"),
        ([1, 2, 3, 4], [0, 1, 4, 9], "starts at its apex"),
        ([0, 1, 1, 2], [0, 1, 4, 9], "radii must increase"),
        ([0, 1, 2, 3], [0, 0, 4, 9], r"heights must increase.*r = 1 m \(point 1\)"),
        ([0, 1, 2, 3], [0, 2, 3, 9], r"not convex.*r = 1 m \(point 1\)"),
        ([0, 1, np.nan, 3], [0, 1, 4, 9], "index 2"),
    ],
)
def test_what_is_not_a_convex_tip_is_refused(r, height, message):
    with pytest.raises(ul.InputError, match=message):
        ul.Profile(r, height)


def test_a_contact_beyond_the_last_radius_is_refused():
    tip = ul.Profile(np.linspace(0, 1, 5), np.linspace(0, 1, 5) ** 2)
    with pytest.raises(ul.InputError, match="last measured radius"):
        tip.halfspace_radius(np.array([1.0, 2.1]))
