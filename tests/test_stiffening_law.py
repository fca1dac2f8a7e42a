"""The law of a sphere on a layer that stiffens: slopes, energy, gradual contact, and everything that is refused."""

import numpy as np
import pytest
from scipy import integrate, special

import underlay as ul
from underlay.mechanics.stiffening.factors import gradual_depth, moment, series_moment
from underlay.mechanics.stiffening.law import FormUnknown

R = 25e-6
E = 3000.0


def law(s=1.0, *, nu=0.5, h=2.0, bond="bonded", deepest=0.3, tip=None, solver=None, **terms):
    layer = ul.Layer(ul.Isotropic(E, nu), h * R, bond=bond, stiffening=ul.Gent(s, **terms))
    base = ul.RIGID if np.isfinite(h) else None
    solver = solver or ul.Auto(1e-8)
    return ul.contact_law(tip or ul.Sphere(R), layer, base, max_depth=deepest * R, solver=solver)


CASES = {
    "half-space": {"h": np.inf, "s": 3.0, "deepest": 0.6},
    "bonded": {"h": 2.0, "s": 1.0},
    "bonded, form": {"h": 2.0, "s": 1.0, "form": 0.4},
    "sliding": {"h": 2.0, "s": 1.0, "bond": "slip"},
    "compressible": {"h": 1.0, "s": 3.0, "nu": 0.4, "deepest": 0.2},
    "neo-Hookean": {"h": 1.0, "s": 0.0},
    "gradual": {"h": 2.0, "s": 1.0, "height_spread": 0.03 * R, "form": -0.3},
}


@pytest.mark.parametrize("case", CASES)
def test_the_slope_is_the_derivative_of_the_force(case):
    """To 9 digits on a half-space; on layers to what the linear law's own slope is, 1e-8 at rtol = 1e-8."""
    given = CASES[case]
    one = law(**given)
    w = np.linspace(0.05, 0.98, 9) * one.max_depth
    step = 2e-3
    forces = [one.force(w * (1.0 + k * step)) for k in (-2, -1, 1, 2)]
    measured = (forces[0] - 8.0 * forces[1] + 8.0 * forces[2] - forces[3]) / (12.0 * step * w)
    linear = one.linear_law
    own = [linear.force(w * (1.0 + k * step)) for k in (-2, -1, 1, 2)]
    its = (own[0] - 8.0 * own[1] + 8.0 * own[2] - own[3]) / (12.0 * step * w) / linear.stiffness(w) - 1.0
    found = one.stiffness(w) / measured - 1.0
    print(case, "slope:", np.abs(found).max(), "linear law's:", np.abs(its).max())
    # What is left once the linear law's own difference is taken off is of the factors.
    assert np.abs(found).max() < 1e-9 + 1.5 * np.abs(its).max()


@pytest.mark.parametrize("case", ["half-space", "bonded, form", "gradual"])
def test_own_slopes_are_derivatives(case):
    given = {"form": 0.0, "height_spread": 0.0, **CASES[case]}
    w = np.linspace(0.1, 0.9, 5) * law(**given).max_depth
    built = law(**given)
    slopes = {name: built.own_slope(name, w) for name in ("inverse_limit", "form", "height_spread")}
    for name, key in (("inverse_limit", "s"), ("form", "form"), ("height_spread", "height_spread")):
        if not given.get(key, 1.0) and name == "height_spread":
            assert not slopes[name].any()
            continue
        step = 1e-4 * (1.0 if key != "height_spread" else given[key])
        up, down = (law(**{**given, key: given[key] + k * step}).force(w) for k in (1, -1))
        measured = (up - down) / (2.0 * step)
        # On the first layer the depth of the linear law, and with it its error, is not quite the same.
        assert slopes[name] == pytest.approx(
            measured, rel=1e-6, abs=1e-7 * float(np.abs(slopes[name]).max())
        ), name


def test_the_force_is_the_product_of_its_factors():
    one = law(1.0, form=0.2)
    linear = ul.contact_law(
        ul.Sphere(R),
        ul.Layer(ul.Isotropic(E, 0.5), 2.0 * R),
        ul.RIGID,
        max_depth=0.3 * R,
        solver=ul.Exact(1e-8),
    )
    w = np.linspace(0.05, 0.3, 6) * R
    a, z = linear.contact_radius(w) / R, w / (2.0 * R)
    N = np.exp(-0.0301 * a - 0.0860 * a * a + 0.2198 * z * z)
    F = one.force(w) / (linear.force(w) * N * one.stiffening(w))
    L = 1.43 * a[-1]
    assert F[-1] == pytest.approx(np.exp(0.2 * L + 2.5 * 0.04 / (1.0 + 0.225 + 0.08) * L**2), rel=0.01)
    neo = law(0.0)
    assert neo.force(w) == pytest.approx(linear.force(w) * N, rel=1e-7)
    assert (neo.stiffening(w) == 1.0).all()
    assert law(1e-9).force(w) == pytest.approx(neo.force(w), rel=1e-9)


def test_energy_is_kept():
    """Work by the force is the integral of what its slope says; depth and force are each other's inverse."""
    one = law(1.0, height_spread=0.02 * R)
    w = np.linspace(0.0, 0.3 * R, 4001)
    work = integrate.simpson(one.force(w), x=w)
    again = integrate.simpson(one.stiffness(w) * (w[-1] - w), x=w) + float(one.force(0.0)) * w[-1]
    assert work == pytest.approx(again, rel=1e-9)
    force = one.force(w[1::500])
    assert one.depth(force) == pytest.approx(w[1::500], rel=1e-9)


def test_first_order_energy_is_the_envelope():
    """U(s) - U(0) at fixed depth over s, from the law, is the integral of mu I^2/4 over Hertz's field."""
    s, w = 1e-3, np.geomspace(1e-8, 1e-5, 2001) * R
    stiff, plain = (law(value, h=np.inf, deepest=0.01).force(w) for value in (s, 0.0))
    added = integrate.simpson((stiff - plain) * w, x=np.log(w))
    a, mu = np.sqrt(w[-1] * R), E / 3.0
    hertz = mu * s / 4.0 * 0.5975175641774 * a**7 / R**4
    assert added == pytest.approx(hertz, rel=2e-4)


def test_a_scale_of_length_or_modulus_is_only_a_scale():
    small = law(2.0)
    layer = ul.Layer(ul.Isotropic(7.0 * E, 0.5), 2000.0 * R, stiffening=ul.Gent(2.0))
    tip, solver = ul.Sphere(1000.0 * R), ul.Auto(1e-8)
    large = ul.contact_law(tip, layer, ul.RIGID, max_depth=300.0 * R, solver=solver)
    w = np.linspace(0.0, 0.3, 7) * R
    assert large.force(1000.0 * w) == pytest.approx(7e6 * small.force(w), rel=1e-9)


def test_known_errors_are_columns_of_force():
    one = law(1.0)
    w = np.array([0.1, 0.3]) * R
    errors = one.known_errors(w)
    assert errors["stiffening"] == pytest.approx(0.03 * one.force(w) * (1.0 - 1.0 / one.stiffening(w)))
    assert errors["finite strain"] == pytest.approx(0.004 * one.force(w))
    assert law(1.0, nu=0.3).known_errors(w)["finite strain"] == pytest.approx(
        0.007 * law(1.0, nu=0.3).force(w)
    )


def test_the_linear_contact_radius_is_not_printed():
    with pytest.raises(ul.InputError, match=r"0\.84 to 0\.73 of the linear"):
        law().contact_radius(0.1 * R)


def test_a_sphere_touches_where_linear_elasticity_says():
    one = law()
    assert one.force(np.array([-1e-6, 0.0])).tolist() == [0.0, 0.0]
    w = 1e-6 * R
    hertz = 4.0 / 3.0 * E / 0.75 * np.sqrt(R) * w**1.5
    # 0.0301 a/R of N and 2 a/h of the layer are left.
    assert float(one.force(w)) == pytest.approx(hertz, rel=3e-3)


# --- gradual contact ------------------------------------------------------------------------------------------


def test_heights_that_spread_are_a_mean_of_forces():
    d = 0.7
    w = np.array([-2.0, -0.4, 0.0, 1.0, 5.0])
    for depth, asked in zip(w, gradual_depth(w, d).depth, strict=True):
        mean, _ = integrate.quad(
            lambda u, depth=depth: u**1.5 * np.exp(-0.5 * ((depth - u) / d) ** 2) / (d * np.sqrt(2 * np.pi)),
            0.0, max(depth, 0.0) + 9.0 * d, epsabs=0.0, epsrel=1e-11, limit=300,
        )  # fmt: skip
        assert asked**1.5 == pytest.approx(mean, rel=1e-9)


def test_gradual_contact_fades():
    w = np.array([10.0, 100.0, 1e4])
    found = gradual_depth(w, 1.0)
    assert (found.depth - w)[1:] == pytest.approx(0.25 / w[1:], rel=1e-3)
    assert found.slope == pytest.approx(1.0, abs=3e-3)
    assert gradual_depth(np.array([0.3]), 1e-6).depth == pytest.approx(0.3, rel=1e-11)


def test_the_two_forms_of_the_moment_agree_where_they_meet():
    near = np.array([12.0])
    for power in (0.5, 1.5):
        below, above = float(moment(near, power)[0]), float(series_moment(near, power)[0])
        print("moment", power, above / below - 1.0)
        assert above == pytest.approx(below, rel=2e-12)
    assert moment(np.array([0.0]), 1.5)[0] == pytest.approx(
        2.0**0.75 * special.gamma(1.25) / (2.0 * np.sqrt(np.pi)), rel=1e-13
    )


def test_the_kept_curve_is_the_moment_and_its_slope_its_own():
    x = np.random.default_rng(1).uniform(-7.99, 11.99, 500)
    found = gradual_depth(x, 1.0)
    print("kept curve", np.abs(found.depth / moment(x, 1.5) ** (2 / 3) - 1.0).max())
    assert found.depth == pytest.approx(moment(x, 1.5) ** (2 / 3), rel=2e-11)
    step = 1e-6
    up, down = (gradual_depth(x + k * step, 1.0).depth for k in (1, -1))
    assert found.slope == pytest.approx((up - down) / (2.0 * step), rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("spread", [0.01, 0.05])
def test_gradual_contact_against_the_mean_of_the_law_itself(spread):
    """The law asked at one depth against the mean of its forces: of a sphere on a layer that stiffens."""
    node, weight = np.polynomial.legendre.leggauss(400)
    for h, s, allowed in ((np.inf, 3.0, 2e-4), (2.0, 1.0, 2e-3)):
        plain = law(s, h=h, deepest=0.5 if h > 2 else 0.45)
        gradual = law(s, h=h, deepest=0.3, height_spread=spread * R)
        for depth in (0.0, 0.05, 0.1, 0.2, 0.3):
            low, high = max(depth - 6 * spread, 0.0), min(depth + 6 * spread, plain.max_depth / R)
            u = 0.5 * (high - low) * (node + 1.0) + low
            mean = np.sum(
                weight * 0.5 * (high - low) * plain.force(u * R)
                * np.exp(-0.5 * ((depth - u) / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi))
            )  # fmt: skip
            found = float(gradual.force(depth * R))
            full = float(gradual.force(0.3 * R))
            print("gradual", spread, h, depth, found / mean - 1.0, (found - mean) / full)
            assert abs(found - mean) / full < allowed * (spread / 0.01) ** 2


# --- refusals -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"tip": ul.Paraboloid(R)}, r"true spheres; a paraboloid is one below w = 0\.1 R"),
        ({"tip": ul.Cone(1.2), "h": np.inf}, "a cone or pyramid on a half-space cannot tell stiffening"),
        ({"tip": ul.Cone(1.2)}, "true spheres; Cone was not measured"),
        ({"tip": ul.FlatPunch(R)}, "true spheres; a flat punch was not measured"),
        ({"nu": 0.25}, r"nu from 0\.3 to 0\.5; here 0\.25"),
        ({"nu": 0.49, "bond": "slip"}, r"a sliding base at nu = 0\.5 only; here 0\.49"),
        ({"bond": ul.Spring(1e9)}, "bonded or a sliding base; here springs"),
        ({"h": 0.4}, r"layers from 0\.5 R thick; here h = 0\.4 R"),
    ],
)
def test_what_was_not_measured_is_refused(given, words):
    with pytest.raises(ul.InputError, match=words):
        law(**given)


def scene(base=ul.RIGID, layer=None, **options):
    layer = layer or ul.Layer(ul.Isotropic(E, 0.5), 2.0 * R, stiffening=ul.Gent(1.0))
    return ul.Scene(ul.Sphere(R), layer, base, **options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"base": ul.Isotropic(1e6, 0.3)}, "here an elastic base"),
        ({"base": ul.Stack([ul.Layer(ul.Isotropic(1e6, 0.3), R)])}, "here further layers under it"),
        ({"friction": "stuck"}, "tips without friction"),
        ({"adhesion": ul.JKR(1e-3)}, "tips without adhesion"),
        ({"finite_strain": False}, "large strains: leave out finite_strain = false"),
    ],
)
def test_what_stands_beside_it_is_refused(options, words):
    with pytest.raises(ul.InputError, match=words):
        scene(**options)


def test_relaxation_and_anisotropy_are_refused():
    stiff = {"thickness": 2.0 * R, "stiffening": ul.Gent(1.0)}
    with pytest.raises(ul.InputError, match="layers that do not relax"):
        scene(layer=ul.Layer(ul.Isotropic(E, 0.5), relaxation=ul.Prony([0.3], [1.0]), **stiff))
    fibres = ul.TransverselyIsotropic(E=E, nu=0.3, E_axial=2 * E, nu_axial=0.3, G_axial=E)
    with pytest.raises(ul.InputError, match="isotropic layers; here TransverselyIsotropic"):
        scene(layer=ul.Layer(fibres, **stiff))
    with pytest.raises(ul.InputError, match="one layer on a rigid base may"):
        ul.Stack([ul.Layer(ul.Isotropic(E, 0.5), **stiff)])


@pytest.mark.parametrize(
    ("given", "words", "largest"),
    [
        ({"h": np.inf, "s": 0.1, "deepest": 0.7}, r"w/R = 0\.6", 0.6),
        ({"h": 1.0, "s": 0.1, "deepest": 0.4}, r"w/h = 0\.3", 0.3),
        ({"h": 1.0, "s": 10.0, "deepest": 0.3}, r"X \(1 is locked\) = 0\.6", None),
        ({"h": np.inf, "s": 100.0, "deepest": 0.5}, "G = 3", None),
        ({"h": 1.0, "s": 3.0, "deepest": 0.5}, "w/h|X", None),
    ],
)
def test_a_depth_beyond_is_refused_with_the_largest_that_is_not(given, words, largest):
    with pytest.raises(ul.RangeError, match=f"known up to ({words})") as raised:
        law(**given)
    deepest = raised.value.max_depth / R
    assert largest is None or deepest == pytest.approx(largest, rel=1e-9)
    assert law(**{**given, "deepest": deepest * (1.0 - 1e-9)}).max_depth > 0.0
    with pytest.raises(ul.RangeError):
        law(**{**given, "deepest": deepest * 1.001})


def test_a_negative_limit_is_refused():
    with pytest.raises(ul.InputError, match=r"zero \(neo-Hookean\) or more; got -0\.1"):
        ul.Gent(-0.1)
    assert ul.Gent.locking_at(1.18).inverse_limit == pytest.approx(11.46, rel=0.01)


def test_depths_at_which_the_form_matters_are_doubted():
    assert any(isinstance(doubt, FormUnknown) for doubt in law(1.0).warnings)
    assert not any(isinstance(doubt, FormUnknown) for doubt in law(1.0, deepest=0.19).warnings)
    assert not law(1.0, h=np.inf, deepest=0.6).warnings
