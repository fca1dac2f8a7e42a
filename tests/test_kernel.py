"""The substrate kernel: laws first, then the paper's appendix and reference values."""

from __future__ import annotations

import functools
from dataclasses import replace
from math import factorial

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import underlay as ul
from support import appendix
from support.reflected_kernel import constants_of_roots, random_material, reflected
from support.transfer_matrix import TransferMatrixKernel
from underlay.mechanics.body import PlaneConstants, isotropic_constants
from underlay.mechanics.kernel import LayerKernel, u_rule

EPS = np.finfo(float).eps
U = np.concatenate(([0.0], np.geomspace(1e-8, 50.0, 60)))
ZINC = ul.TransverselyIsotropic.from_stiffness(A11=161e9, A12=34.2e9, A13=50.1e9, A33=61.0e9, A44=38.3e9)
CARTILAGE = ul.TransverselyIsotropic(E=5.8e6, E_axial=0.46e6, nu=0.3, nu_axial=0.02, G_axial=0.37e6)

poissons = st.one_of(st.just(0.5), st.floats(-0.95, 0.5))
moduli = st.floats(-8.0, 8.0).map(lambda exponent: 10.0**exponent)
isotropic = st.builds(ul.Isotropic, moduli, poissons)


@st.composite
def transversely_isotropic(draw):
    """Any positive definite one: nu_axial within what E, E', nu allow, moduli within a factor of 30."""
    scale = draw(moduli)
    E, E_axial, G = (scale * 30.0 ** draw(st.floats(-0.5, 0.5)) for _ in range(3))
    nu = draw(st.floats(-0.9, 0.9))
    most = np.sqrt(0.5 * (1.0 - nu) * E_axial / E)
    return ul.TransverselyIsotropic(E, E_axial, nu, draw(st.floats(-0.99, 0.99)) * most, G)


materials = st.one_of(isotropic, transversely_isotropic())
bases = st.one_of(materials, st.just(ul.RIGID))


def scaled(material, factor):
    if material is ul.RIGID:
        return ul.RIGID
    if isinstance(material, ul.Isotropic):
        return replace(material, E=factor * material.E)
    return replace(
        material, E=factor * material.E, E_axial=factor * material.E_axial, G_axial=factor * material.G_axial
    )


def L(layer, base, u=U):
    return 1.0 - ul.SubstrateKernel(layer, base).one_minus_L(u)


def at_each(function, u):
    """A function of one wavenumber at all of u, in fifty digits."""
    with mp.workdps(50):
        return np.array([float(function(mp.mpf(x))) for x in u])


def transferred(layer, base, u):
    """L by transfer matrices in many digits."""
    reference = TransferMatrixKernel(layer, base)
    return np.array([float(reference.L(x)) for x in u])


# --- laws ---------------------------------------------------------------------------------------------------


@given(materials, materials)
def test_at_zero_the_base_alone_is_felt(layer, base):
    # L(0) = theta1/theta2: a load of infinite wavelength does not see the layer. 1e-12: the thetas of
    # strongly anisotropic materials carry some tens of roundings, amplified by p and sigma.
    assert L(layer, base, np.array([0.0]))[0] == pytest.approx(layer.theta / base.theta, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("ratio", [np.inf, 1e8, 2.0, 0.1, 1.01e-3, 0.99e-3, 1e-6])
@pytest.mark.parametrize("nu", [-0.7, 0.0, 0.3, 0.5])
def test_the_closed_form_of_isotropic_layers_is_what_the_recursion_says(nu, ratio):
    """On both sides of where a soft base leaves it to the recursion, to the digits that both claim."""
    layer, base = ul.Isotropic(1.0, nu), ul.RIGID if ratio == np.inf else ul.Isotropic(ratio, 0.2)
    closed = L(layer, base)
    recursion = 1.0 - ul.StackKernel((ul.Layer(layer, 1.0),), base).one_minus_L(U)
    np.testing.assert_allclose(closed, recursion, rtol=1e-13, atol=1e-14)


@given(materials, bases)
def test_at_infinity_the_layer_alone_is_felt(layer, base):
    p, sigma = layer.plane_constants.p, layer.plane_constants.sigma
    slow = p / (0.5 * sigma + np.sqrt(max(0.25 * sigma**2 - p, 0.0)))
    far = np.array([60.0, 100.0]) / min(slow, 0.5 * sigma)
    assert np.all(np.abs(ul.SubstrateKernel(layer, base).one_minus_L(far)) < 1e-40)


@given(materials, materials)
def test_L_is_positive_and_is_bounded_by_the_softer_extreme(layer, base):
    # A load on the surface does positive work, and at fixed load (tractions free to follow) compliance of
    # layer-on-base lies above that of the layer bonded to a rigid base.
    value = L(layer, base)
    rounding = 1e-13 * np.maximum(value, 1.0)
    assert np.all(value > -rounding)
    assert np.all(value >= L(layer, ul.RIGID) - rounding)


@given(materials, materials, st.floats(0.0, 3.0))
def test_a_stiffer_base_never_gives_more(layer, base, exponent):
    # The strain energy at given loads decreases when a part is stiffened as a whole.
    softer, stiffer = L(layer, base), L(layer, scaled(base, 10.0**exponent))
    assert np.all(stiffer <= softer + 1e-13 * np.maximum(softer, 1.0))


@given(materials, bases, st.integers(-40, 40))
def test_only_ratios_of_moduli_matter(layer, base, power):
    # By a power of two the scaling itself is exact, so the kernel is the same to the last bits.
    factor = 2.0**power
    once = ul.SubstrateKernel(layer, base).one_minus_L(U)
    again = ul.SubstrateKernel(scaled(layer, factor), scaled(base, factor)).one_minus_L(U)
    np.testing.assert_allclose(again, once, rtol=4 * EPS, atol=4 * EPS)


@given(materials)
def test_identical_materials_leave_nothing(material):
    assert not np.any(ul.SubstrateKernel(material, replace(material)).one_minus_L(U))


@given(isotropic, st.one_of(isotropic, st.just(ul.RIGID)))
def test_isotropic_constants_make_a_transversely_isotropic_material_isotropic(layer, base):
    shear = layer.E / (2.0 * (1.0 + layer.nu))
    same = ul.TransverselyIsotropic(layer.E, layer.E, layer.nu, layer.nu, shear)
    expected = L(layer, base)
    np.testing.assert_allclose(L(same, base), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.45])
def test_a_thin_compressible_layer_on_a_rigid_base_is_a_bed_of_springs(nu):
    # W = h N/M, M the confined modulus, against W = N/(theta k) of the half-space: L = theta u/M (1 + O(u)).
    layer = ul.Isotropic(1.0, nu)
    M = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    u = np.array([1e-5])
    assert L(layer, ul.RIGID, u)[0] == pytest.approx(layer.theta * u[0] / M, rel=1e-4)


def test_a_thin_incompressible_layer_on_a_rigid_base_is_cubic():
    # Lubrication: W = N k^2 h^3/(3 mu) against N/(theta k), mu = E/3, theta = 2E/3:
    # L = (2/3) u^3 (1 + O(u^2)). At u = 1e-3 the rounding of L (1e-16) is 2e-7 of it, and the next term 2e-6.
    assert L(ul.Isotropic(1.0, 0.5), ul.RIGID, np.array([1e-3]))[0] == pytest.approx(2e-9 / 3.0, rel=1e-5)


def test_nothing_jumps_at_the_incompressible_limit():
    # L depends on 1 - 2 nu through theta u/M with M ~ 1/(1 - 2 nu): 1e-12 in nu moves L by no more.
    for base in (ul.RIGID, ul.Isotropic(1e-6, 0.3)):
        exact, near = L(ul.Isotropic(1.0, 0.5), base), L(ul.Isotropic(1.0, 0.5 - 1e-12), base)
        np.testing.assert_allclose(near, exact, rtol=1e-11, atol=1e-11)


# --- switches between formulas ------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [1e-8, 1e-4, 0.1])
@pytest.mark.parametrize(
    "layer", [ul.Isotropic(1.0, 0.5), ul.Isotropic(1.0, -0.9), ZINC, CARTILAGE], ids=repr
)
def test_both_sides_of_the_small_u_switch_hold(layer, ratio):
    constants = layer.plane_constants
    switch = 3.0 / max(constants.sigma, 2.0 * constants.p**0.5)
    u = switch * np.array([1.0 - 1e-12, 1.0 + 1e-12])
    base = ul.Isotropic(2.0 * ratio * layer.theta, 0.3)
    np.testing.assert_allclose(L(layer, base, u), transferred(layer, base, u), rtol=1e-14)


@pytest.mark.parametrize("roundings", [-40, -6, -3, 3, 6, 40])
def test_both_sides_of_the_equal_roots_switch_hold(roundings):
    # G' moved by some roundings moves d^2 by as many times 0.7 eps; the switch is at 4 eps.
    layer = ul.TransverselyIsotropic(1.0, 1.0, 0.3, 0.3, (1.0 + roundings * EPS) / 2.6)
    u = np.geomspace(0.01, 20.0, 8)
    for base, tolerance in ((ul.RIGID, 2e-15), (ul.Isotropic(1e-4, 0.3), 1e-14)):
        exact = transferred(layer, base, u)
        np.testing.assert_allclose(L(layer, base, u), exact, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("ratio", [0.54, 0.55])
def test_both_sides_of_the_soft_switch_hold(ratio):
    layer, base = ul.Isotropic(1.0, 0.5), ul.Isotropic(ratio, 0.5)
    u = np.geomspace(1e-6, 1.49, 10)
    np.testing.assert_allclose(L(layer, base, u), transferred(layer, base, u), rtol=1e-14)


# --- batches ------------------------------------------------------------------------------------------------


def batch(materials_):
    columns = zip(*(m.plane_constants for m in materials_), strict=True)
    return PlaneConstants(*(np.array(column)[:, None] for column in columns))


@pytest.mark.parametrize(
    "layers",
    [
        [ul.Isotropic(1.0, nu) for nu in (0.5, 0.3, -0.9, 0.2)],
        [ZINC, scaled(ZINC, 2.0), scaled(ZINC, 0.1), scaled(ZINC, 1e-3)],
        [CARTILAGE, scaled(CARTILAGE, 2.0), CARTILAGE, CARTILAGE],
        [ZINC, ul.Isotropic(1e9, 0.5), CARTILAGE, ul.Isotropic(1.0, 0.3)],
    ],
    ids=["equal roots", "complex roots", "real roots", "mixed"],
)
@pytest.mark.parametrize("on", ["rigid", "soft", "stiff", "mixed"])
def test_a_batch_is_its_members(layers, on):
    ratios = {
        "soft": (1e-6, 1e-3, 0.01, 0.1),
        "stiff": (1.0, 3.0, 10.0, 1e5),
        "mixed": (1e-6, 0.3, 0.7, 10.0),
    }
    bases_ = [ul.RIGID] * 4
    if on != "rigid":
        bases_ = [ul.Isotropic(r * 2.0 * m.theta, 0.4) for r, m in zip(ratios[on], layers, strict=True)]
    together = LayerKernel(batch(layers), None if on == "rigid" else batch(bases_)).values(U)
    assert together.shape == (4, U.size)
    for row, layer, base in zip(together, layers, bases_, strict=True):
        alone = ul.SubstrateKernel(layer, base).one_minus_L(U)
        # A member near another's kind of roots is evaluated by another branch: rounding only.
        np.testing.assert_allclose(1.0 - row, 1.0 - alone, rtol=3e-14, atol=3e-15)


def assert_rule_keeps(constants, eps_max, rtol, allowed, pairs=((0.0, 0.0), (1.0, 1.0), (1.0, 0.5))):
    """The rule for `rtol` gives int (1 - L) cos cos du, s and t shares of eps_max, to `allowed` of int |1 - L|."""
    u, weights = u_rule(*constants, eps_max, rtol)
    assert np.all(np.diff(u) > 0.0)
    got, exact = (
        LayerKernel(*constants).values(u) * weights,
        LayerKernel(*constants).values(FINE) * FINE_WEIGHTS,
    )
    errors = [
        got @ (np.cos(s * u) * np.cos(t * u)) - exact @ (np.cos(s * FINE) * np.cos(t * FINE))
        for s, t in eps_max * np.array(pairs)
    ]
    assert (np.abs(errors) <= allowed * np.abs(exact).sum(axis=-1)).all()


def test_one_rule_serves_every_member_of_a_batch():
    layers = batch([ul.Isotropic(1.0, 0.5), ZINC, CARTILAGE])
    bases_ = batch([ul.Isotropic(1e-5, 0.3), ul.Isotropic(6e12, 0.2), ul.Isotropic(1e5, 0.5)])
    assert_rule_keeps((layers, bases_), 2.0, 1e-6, 1e-6, ((0.0, 0.0), (1.0, 1.0), (1.0, 0.35)))


def test_a_batch_gives_the_coefficients_of_its_members():
    layers = [ul.Isotropic(1.0, 0.5), ul.Isotropic(2.0, 0.3)]
    bases_ = [ul.Isotropic(0.01, 0.3), ul.Isotropic(40.0, 0.2)]
    together = LayerKernel(batch(layers), batch(bases_)).moments(3)
    for row, layer, base in zip(together, layers, bases_, strict=True):
        np.testing.assert_allclose(row, ul.SubstrateKernel(layer, base).coefficients(3), rtol=1e-13)


# --- quadrature ---------------------------------------------------------------------------------------------


def reference_rule():
    """Gauss-Legendre with 24 nodes on panels that double from 1e-13 to 1, then of width 1/2 and 4."""
    x, w = np.polynomial.legendre.leggauss(24)
    edges = np.concatenate(
        ([0.0], 2.0 ** np.arange(-44.0, 0.0), np.arange(1.0, 60.0, 0.5), np.arange(60.0, 1500.0, 4.0))
    )
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()


FINE, FINE_WEIGHTS = reference_rule()


PAIRS = [
    *((ul.Isotropic(1.0, nu), ul.RIGID) for nu in (0.5, 0.3, -0.9)),
    *(
        (ul.Isotropic(1.0, 0.5), ul.Isotropic(r, 0.3))
        for r in (1e-8, 1e-5, 1e-3, 0.1, 0.7, 3.0, 10.0, 1e2, 1e4, 1e8)
    ),
    *((ul.Isotropic(1.0, 0.2), ul.Isotropic(r, 0.5)) for r in (1e-6, 1e-2, 0.5, 30.0)),
    (ZINC, ul.RIGID),
    (ZINC, ul.Isotropic(1e9, 0.3)),
    (CARTILAGE, ul.RIGID),
    (CARTILAGE, ul.Isotropic(1e3, 0.3)),
    (ul.Isotropic(1.0, 0.5), scaled(CARTILAGE, 1e-7)),
]


@pytest.mark.parametrize(("layer", "base"), PAIRS, ids=repr)
@pytest.mark.parametrize("eps_max", [0.0, 1.0, 4.0])
def test_the_rule_keeps_the_tolerance_asked(layer, base, eps_max):
    constants = layer.plane_constants, None if base is ul.RIGID else base.plane_constants
    for rtol in (1e-3, 1e-6, 1e-10, 1e-13):
        pairs = ((0.0, 0.0), (1.0, 1.0), (1.0, 0.5), (0.3, 0.0))
        assert_rule_keeps(constants, eps_max, rtol, rtol, pairs)


@given(materials, bases, st.sampled_from([0.0, 0.5, 2.0]), st.sampled_from([1e-3, 1e-6, 1e-9]))
def test_the_rule_keeps_the_tolerance_for_any_pair(layer, base, eps_max, rtol):
    # What u_rule promises: within a factor 2 where complex roots or a shear-weak base bring poles close.
    constants = layer.plane_constants, None if base is ul.RIGID else base.plane_constants
    assert_rule_keeps(constants, eps_max, rtol, 2.0 * rtol)


@pytest.mark.parametrize(("rtol", "least", "most"), [(1e-3, 12, 40), (1e-6, 20, 80), (1e-10, 40, 140)])
@pytest.mark.parametrize("ratio", [None, 1e-3, 0.1, 2.0, 1e3])
def test_the_rule_is_as_short_as_the_integrand_allows(rtol, least, most, ratio):
    base = None if ratio is None else isotropic_constants(ratio, 0.3)
    nodes, _ = u_rule(isotropic_constants(1.0, 0.5), base, 1.0, rtol)
    assert least <= nodes.size <= most


# --- coefficients -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nu", "a_0", "a_1"),
    [
        (0.3, 1.37685416546, -0.627551661384),
        (0.4, 1.51870801407, -0.747551510037),
        (0.5, 1.77021677337, -0.957769288898),
    ],
)
def test_coefficients_of_a_rigid_base(nu, a_0, a_1):
    # Twelve digits are tabulated: half a unit of the last one.
    got = ul.SubstrateKernel(ul.Isotropic(3.0, nu), ul.RIGID).coefficients(2)
    assert got == pytest.approx([a_0, a_1], abs=0.0, rel=5e-12)


@pytest.mark.parametrize(
    ("layer", "base"),
    [
        (ul.Isotropic(1.0, 0.5), ul.RIGID),
        (ul.Isotropic(1.0, 0.3), ul.Isotropic(1e-3, 0.5)),
        (ul.Isotropic(1.0, 0.5), ul.Isotropic(1e-7, 0.2)),
        (ul.Isotropic(1.0, 0.4), ul.Isotropic(20.0, 0.2)),
    ],
    ids=repr,
)
def test_coefficients_are_the_moments_of_the_kernel(layer, base):
    # (1.8) with the closed isotropic L, by tanh-sinh quadrature in 30 digits; 1e-13 is what L itself holds.
    ratio, nu_2 = (0, 0) if base is ul.RIGID else (mp.mpf(layer.E) / mp.mpf(base.E), base.nu)
    breaks = [0, *(mp.mpf(10) ** k for k in np.arange(-9, 1, 0.5)), 2, 4, 8, 16, 32, 64]
    got = ul.SubstrateKernel(layer, base).coefficients(4)
    # The four moments ask for the same points.
    felt = functools.cache(lambda u: 1 - appendix.isotropic_L(u, ratio, layer.nu, nu_2))
    with mp.workdps(30):
        for m in range(4):
            moment = mp.quad(lambda u, m=m: felt(u) * u ** (2 * m), breaks, maxdegree=5)
            exact = float((-1) ** m * moment / (2**m * factorial(m)) ** 2)
            assert got[m] == pytest.approx(exact, rel=1e-13)


@given(materials)
@settings(max_examples=30)
def test_coefficients_of_identical_materials_are_zero(material):
    assert not np.any(ul.SubstrateKernel(material, material).coefficients(3))


# --- the paper's appendix -----------------------------------------------------------------------------------


def appendix_constants(material):
    return appendix.AppendixConstants.from_stiffness(
        *appendix.stiffness(material.E, material.E_axial, material.nu, material.nu_axial, material.G_axial)
    )


ANISOTROPIC_PAIRS = [(CARTILAGE, ZINC), (ZINC, CARTILAGE), (scaled(CARTILAGE, 1e4), ZINC)]


@pytest.mark.parametrize(("layer", "base"), ANISOTROPIC_PAIRS, ids=repr)
def test_the_appendix_holds_with_a_21_negative(layer, base):
    u = np.array([1e-3, 0.1, 0.5, 2.0, 8.0])
    with mp.workdps(50):
        one, two = appendix_constants(layer), appendix_constants(base)
    exact = at_each(lambda x: appendix.kernel_L(x, one, two), u)
    np.testing.assert_allclose(L(layer, base, u), exact, rtol=1e-13, atol=1e-14)


def test_the_appendix_as_printed_is_wrong():
    # With + (2 gamma_1/Z){...} for a_21 even the layer's own compliance fails: L must be positive.
    with mp.workdps(50):
        printed = appendix.kernel_L(
            mp.mpf("0.1"), appendix_constants(CARTILAGE), appendix_constants(ZINC), sign_of_a21=1
        )
    exact = TransferMatrixKernel(CARTILAGE, ZINC).L(0.1)
    assert abs(printed - exact) > 0.1 * abs(exact)


@pytest.mark.parametrize("nu_1", [0.5, 0.3, -0.9])
@pytest.mark.parametrize(("ratio", "nu_2"), [(0, 0.0), (1e-3, 0.3), (0.5, 0.5), (4.0, 0.2), (1e6, 0.45)])
def test_the_isotropic_form_of_the_appendix(nu_1, ratio, nu_2):
    # d1, d2, d3 (the appendix's last equation) at E1/E2 = ratio.
    layer = ul.Isotropic(1.0, nu_1)
    base = ul.RIGID if ratio == 0 else ul.Isotropic(1.0 / ratio, nu_2)
    u = np.geomspace(1e-6, 30.0, 25)
    with mp.workdps(50):
        given_ratio = 0 if base is ul.RIGID else 1 / mp.mpf(base.E)
    exact = at_each(lambda x: appendix.isotropic_L(x, given_ratio, nu_1, nu_2), u)
    np.testing.assert_allclose(L(layer, base, u), exact, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("nu", [0.5, 0.3, 0.0, -0.9])
def test_the_rigid_isotropic_form(nu):
    u = np.geomspace(1e-6, 30.0, 25)
    exact = at_each(lambda x: appendix.rigid_isotropic_L(x, nu), u)
    np.testing.assert_allclose(L(ul.Isotropic(7.0, nu), ul.RIGID, u), exact, rtol=0.0, atol=1e-14)


# --- every kind of roots -----------------------------------------------------------------------------------


@pytest.mark.parametrize("decade", range(-4, 7))
def test_roots_of_every_kind_keep_thirteen_digits(decade):
    """4 p/sigma^2 from 1e-4, real and far apart, to 1e7, turning 1000 times as fast as they decay."""
    rng = np.random.default_rng(decade + 4)
    for number in range(6):
        layer = constants_of_roots(10.0 ** rng.uniform(-2, 2), 10.0 ** (decade + rng.uniform()), rng)
        base = constants_of_roots(1.0, 1.0, rng) if number % 3 else None
        if number % 3 == 2:
            soft = 10.0 ** rng.uniform(-8, 0)
            base = base._replace(c=base.c / soft, g=base.g * soft, S=base.S / soft)
        u = np.geomspace(1e-4, 8.0, 9) / np.sqrt(layer.p)
        exact = reflected(u, layer, base)
        found = LayerKernel(layer, base).values(u)
        assert np.abs(found - exact).max() <= 1e-13 * np.maximum(1.0, np.abs(exact)).max()
        np.testing.assert_allclose(1.0 - found, 1.0 - exact, rtol=1e-13, atol=1e-13)


def test_a_layer_is_its_slices_whatever_its_roots():
    """The kernel of one layer and that of a stack, on 400 random materials; apart by up to 1e-4 and more before."""
    rng, worst = np.random.default_rng(0), 0.0
    for number in range(400):
        layer, base = random_material(rng), random_material(rng) if number % 3 else ul.RIGID
        u = np.geomspace(1e-6, 10.0, 25) / np.sqrt(layer.plane_constants.p)
        whole = ul.SubstrateKernel(layer, base).one_minus_L(u)
        slices = tuple(ul.Layer(layer, t) for t in (0.4, 0.35, 0.25))
        cut = ul.StackKernel(slices, base).one_minus_L(0.4 * u)
        worst = max(worst, float((np.abs(cut - whole) / np.maximum(1.0, np.abs(whole))).max()))
    assert worst < 1e-12


# --- the border ---------------------------------------------------------------------------------------------


def test_scalars_and_shapes_pass_through():
    kernel = ul.SubstrateKernel(ul.Isotropic(1.0, 0.3), ul.RIGID)
    assert np.ndim(kernel.one_minus_L(0.3)) == 0
    assert kernel.one_minus_L(np.full((2, 3), 0.3)).shape == (2, 3)
    # A product of one column is rounded by another path than one of several.
    assert kernel.one_minus_L([0.1, 0.3])[1] == pytest.approx(kernel.one_minus_L(0.3), rel=1e-15)


def test_bad_requests_say_what_is_allowed():
    kernel = ul.SubstrateKernel(ul.Isotropic(1.0, 0.3), ul.RIGID)
    with pytest.raises(ul.InputError, match="zero or more; got -1"):
        kernel.one_minus_L([0.0, -1.0])
    with pytest.raises(ul.InputError, match="index 1"):
        kernel.one_minus_L([0.0, np.nan])
    with pytest.raises(ul.InputError, match=r"1\.\.12; got 0"):
        kernel.coefficients(0)
    with pytest.raises(ul.InputError, match="layer material"):
        ul.SubstrateKernel(ul.RIGID, ul.RIGID)
    with pytest.raises(ul.InputError, match="substrate"):
        ul.SubstrateKernel(ul.Isotropic(1.0, 0.3), None)
