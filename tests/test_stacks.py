"""Stacks of layers and imperfect interfaces: laws first, then 50-digit references, contact, fits, bad input.

References: 4 x 4 transfer matrices at 50 digits for the kernels (nothing shared with the recursion), and the
contact problem solved on those kernels at two resolutions that agree to 1e-12.
"""

import re
from dataclasses import replace
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import underlay as ul
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.kernel.bodies import sheets_of, values_of
from underlay.mechanics.kernel.recursion import Recursion
from underlay.scene.effects import effect_sizes

U = np.array([0.0, 1e-6, 0.01, 0.1, 0.3, 0.49, 0.51, 1.0, 2.0, 5.0, 12.0])
FIVE = np.array([0.1, 0.5, 1.0, 2.0, 5.0])

#: (E, nu, thickness) from the top down, then (E, nu) of the base or None for a rigid one.
STACKS = {
    "A": ([(1, 0.5, 1), (0.1, 0.3, 2)], None),
    "B": ([(1, 0.3, 1), (10, 0.25, 0.5)], (100, 0.3)),
    "C": ([(1, 0.45, 1), (0.01, 0.49, 1)], (1000, 0.2)),
    "D": ([(1, 0.3, 1), (1e-6, 0.45, 1)], None),
    "E": ([(1, 0.3, 1), (1e6, 0.3, 0.1)], (1e-3, 0.5)),
    "F": ([(1, 0.5, 1), (3, 0.4, 1), (0.5, 0.3, 1), (20, 0.2, 3)], (2, 0.35)),
    "G": ([(1, 0.5, 1), (1e-8, 0.5, 0.01), (1, 0.3, 1)], (1e-8, 0.5)),
}
#: 1 - L at `FIVE`, 50-digit transfer matrices.
KERNELS = {
    "A": "-0.01265242163411056 -3.594214393318742 -2.780955243591213 -0.5135226135891159 -0.004412979759282837",
    "B": "0.9472646087623487 0.7744045998523262 0.5586549705353224 0.217142628659657 0.002683866628118822",
    "C": "0.5351667898119572 -3.132214806928426 -4.564764817845589 -0.683448675951196 -0.005446259448844717",
    "D": "-4260.879926546599 -49.46353905987787 -6.382240683028489 -0.7090597040057619 -0.005564541583138061",
    "E": "-4.942959367872453 0.7502157436295634 0.5799768785919334 0.2385289165834939 0.003125232131606465",
    "F": "0.4511358057433014 0.4131523653319069 0.3537316080260957 0.2003844752027154 0.002896702664902338",
    "G": "-3294.109842836532 -27.2083303305448 -4.844803300053521 -0.6983775078737816 -0.005561519828136728",
}
MOMENTS = {
    "A": (-4.1962772715336, 1.5240746800262),
    "B": (1.3120848619754, -0.5685428639176),
    "C": (-5.2230034253031, 2.0987176603244),
    "F": (0.8706450251730, -0.5105812763882),
}
#: Stack, a/t_1, kappa, then w/(A a^lambda) and P/(theta A a^(lambda+1)) of a paraboloid and of a cone.
CONTACTS = """
A 0.2 0.656092019132 2.681490610229 5.280717915941 1.972580496615 3.110502404307
A 1 0.358235382161 3.058162528452 3.233163824638 2.174500748497 1.847111414485
A 3 0.420419687680 1.782203368078 1.644719961983 1.375543753455 0.842476009892
B 0.2 1.195217365974 1.785361017006 5.352960482925 1.444230433722 3.153203408244
B 1 2.369393082487 1.318403973930 6.594719140366 1.167630948587 3.933805023627
B 3 5.681128791275 1.123104135834 12.963635521434 1.063015909626 8.203822455656
C 0.2 0.605671186758 2.841862979043 5.260993454047 2.067180973911 3.098854939127
C 1 0.327329089787 2.972980551195 2.776957573760 2.120630931378 1.568695541934
C 3 0.524550202245 1.481822714363 1.465439760729 1.205222385836 0.731519093594
F 0.2 1.120473052128 1.859683956520 5.350842851721 1.488026455812 3.151956106587
F 1 1.511876084760 1.672037645833 6.280789533005 1.379557887789 3.742833196247
F 3 1.748505869029 1.770444051833 7.998880389907 1.454130112308 4.866125036724
"""


def parts(name):
    rows, base = STACKS[name]
    layers = tuple(ul.Layer(ul.Isotropic(E, nu), t) for E, nu, t in rows)
    return layers, ul.RIGID if base is None else ul.Isotropic(*base)


def contact(tip, layers, base):
    return ul.Contact.of(tip, layers[0], ul.Stack(layers[1:], base) if len(layers) > 1 else base)


# --- laws that need no reference ------------------------------------------------------------------------

ZINC = ul.TransverselyIsotropic.from_stiffness(A11=161.0, A12=34.2, A13=50.1, A33=61.0, A44=38.3)
PAIRS = [
    (ul.Isotropic(1.0, 0.5), ul.RIGID),
    (ul.Isotropic(1.0, 0.3), ul.Isotropic(1e-4, 0.45)),
    (ul.Isotropic(1.0, 0.45), ul.Isotropic(1e4, 0.2)),
    (ZINC, ul.Isotropic(10.0, 0.3)),
    (ul.Isotropic(10.0, 0.3), ZINC),
]


@pytest.mark.parametrize(("layer", "base"), PAIRS, ids=range(len(PAIRS)))
@pytest.mark.parametrize("cuts", [(1.0,), (0.25, 0.5, 0.25), (0.5, 0.5), (0.125,) * 8])
def test_equal_layers_are_one_layer(layer, base, cuts):
    stack = ul.StackKernel(tuple(ul.Layer(layer, t) for t in cuts), base)
    whole = ul.SubstrateKernel(layer, base).one_minus_L(U)
    np.testing.assert_allclose(stack.one_minus_L(U * cuts[0]), whole, rtol=1e-12, atol=2e-13)


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(3.0, 0.2)], ids=["rigid", "elastic"])
@pytest.mark.parametrize("bonds", ["bonded", "slip", "each its own"])
def test_bodies_at_once_are_what_they_are_one_by_one(bonds, base):
    def body(number):
        bond = ("bonded", "slip")[number % 2] if bonds == "each its own" else bonds
        top = ul.Layer(ul.Isotropic(1.0 + number, 0.1 * number), 1.0, bond=bond)
        return ul.StackKernel((top, ul.Layer(ul.Isotropic(2.0, 0.45), 0.5 + number)), base)

    bodies, stretches = [body(number) for number in range(4)], (1.0, 0.9, 1.0, 1.3)
    alone = [one.one_minus_L(U * stretch) for one, stretch in zip(bodies, stretches, strict=True)]
    np.testing.assert_allclose(values_of(bodies, U, stretches), alone, rtol=0.0, atol=1e-14)


def test_a_layer_like_its_base_or_without_thickness_disappears():
    top, base = ul.Layer(ul.Isotropic(1.0, 0.4), 1.0), ul.Isotropic(0.05, 0.3)
    whole = ul.SubstrateKernel(top.material, base).one_minus_L(U)
    merged = ul.StackKernel((top, ul.Layer(base, 0.7)), base).one_minus_L(U)
    np.testing.assert_allclose(merged, whole, rtol=1e-12, atol=1e-13)
    gone = ul.StackKernel((top, ul.Layer(ul.Isotropic(3.0, 0.2), 1e-14)), base).one_minus_L(U)
    np.testing.assert_allclose(gone, whole, rtol=1e-12, atol=1e-12)


def test_a_thick_layer_is_all_there_is():
    layers = (ul.Layer(ul.Isotropic(1.0, 0.4), 1.0), ul.Layer(ul.Isotropic(9.0, 0.3), 400.0))
    deep = ul.StackKernel(layers, ul.RIGID).one_minus_L(FIVE)
    whole = ul.SubstrateKernel(layers[0].material, layers[1].material).one_minus_L(FIVE)
    np.testing.assert_allclose(deep, whole, rtol=1e-12)


@pytest.mark.parametrize("name", STACKS)
def test_limits_of_the_wavenumber(name):
    layers, base = parts(name)
    kernel = ul.StackKernel(layers, base)
    below = 0.0 if base is ul.RIGID else layers[0].material.theta / base.theta
    assert 1.0 - kernel.one_minus_L(0.0) == pytest.approx(below, rel=1e-13, abs=1e-15)
    assert np.all(kernel.one_minus_L(np.geomspace(1e-9, 40.0, 200)) < 1.0)
    assert abs(kernel.one_minus_L(60.0)) < 1e-40


def test_springs_go_from_slip_to_bond():
    layer = ul.Layer(ul.Isotropic(2.0, 0.4), 0.5)
    lower = ul.StackKernel((replace(layer, bond="slip"),), ul.RIGID).one_minus_L(FIVE)
    upper = ul.SubstrateKernel(layer.material, ul.RIGID).one_minus_L(FIVE)
    for stiffness, expected, rtol in ((0.0, lower, 1e-14), (1e-9, lower, 1e-8), (1e13, upper, 1e-11)):
        bond = ul.Spring(shear=stiffness)
        got = ul.StackKernel((replace(layer, bond=bond),), ul.RIGID).one_minus_L(FIVE)
        np.testing.assert_allclose(got, expected, rtol=rtol)
    between = ul.StackKernel((replace(layer, bond=ul.Spring(shear=3.0)),), ul.RIGID).one_minus_L(FIVE)
    assert np.all((lower < between) & (between < upper))


def test_a_thin_soft_glue_is_a_spring():
    """A glue of thickness t is the springs M/t and G/t, to first order in t."""
    film, glue, base = ul.Isotropic(1.0, 0.3), ul.Isotropic(1e-3, 0.3), ul.Isotropic(5.0, 0.2)
    confined = 1e-3 * 0.7 / (1.3 * 0.4)
    errors = []
    for t in (1e-2, 5e-3):
        real = ul.StackKernel((ul.Layer(film, 1.0), ul.Layer(glue, t)), base).one_minus_L(FIVE)
        bond = ul.Spring(normal=confined / t, shear=1e-3 / 2.6 / t)
        spring = ul.StackKernel((ul.Layer(film, 1.0, bond=bond),), base).one_minus_L(FIVE)
        errors.append(np.abs(spring - real).max())
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] > 1.8


# --- references -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_of_stacks(name):
    expected = np.array(KERNELS[name].split(), dtype=float)
    np.testing.assert_allclose(ul.StackKernel(*parts(name)).one_minus_L(FIVE), expected, rtol=1e-12)


def transfer_matrix(name, u):
    """1 - L by 4 x 4 transfer matrices at 50 digits: nothing is shared with the recursion."""

    def constants(E, nu):
        E, nu = mp.mpf(E), mp.mpf(nu)
        return nu / (1 - nu), (1 + nu) * (1 - 2 * nu) / (E * (1 - nu)), E / (1 - nu**2), 2 * (1 + nu) / E

    def halfspace(q, c, g, S):
        p = mp.sqrt(q * q + c * g)
        sigma = mp.sqrt(S * g - 2 * q + 2 * p)
        return mp.matrix([[sigma / g, (q - p) / g], [(q - p) / g, p * sigma / g]])

    with mp.workdps(50):
        rows, base = STACKS[name]
        C = mp.zeros(2) if base is None else halfspace(*constants(*base))
        for E, nu, t in reversed(rows):
            q, c, g, S = constants(E, nu)
            N = mp.matrix([[0, 1, S, 0], [-q, 0, 0, c], [g, 0, 0, q], [0, 0, -1, 0]])
            T = mp.expm(N * mp.mpf(float(u)) * mp.mpf(t), method="taylor")
            C = mp.inverse(T[0:2, 0:2] + C * T[2:4, 0:2]) * (T[0:2, 2:4] + C * T[2:4, 2:4])
        return float(1 - C[1, 1] / halfspace(*constants(*rows[0][:2]))[1, 1])


@pytest.mark.parametrize("name", STACKS)
def test_the_recursion_keeps_its_digits_where_it_changes_form(name):
    """A layer goes from its series to its closed forms at v sigma = 2, the one on top at u = 1."""
    u = np.array([1e-3, 0.03, 0.1, 0.3, 0.499, 0.501, 0.999, 1.001, 1.3, 12.0])
    expected = np.array([transfer_matrix(name, one) for one in u])
    np.testing.assert_allclose(ul.StackKernel(*parts(name)).one_minus_L(u), expected, rtol=1e-13)


@pytest.mark.parametrize("name", ["A", "F"])
def test_many_stacks_go_up_together(name):
    """Constants and thicknesses of (sets, 1): each set as alone, though they turn thick at different nodes."""
    layers, base = parts(name)
    scales = np.array([[0.2], [1.0], [30.0]])
    thicknesses = [layers[0].thickness, *(layer.thickness * scales for layer in layers[1:])]
    constants = [layer.material.plane_constants for layer in layers]
    bonds = ["slip", *("bonded" for _ in layers[1:])]
    together = Recursion(*sheets_of(constants, base.plane_constants, thicknesses, bonds)).one_minus_L(U[1:])
    for row, scale in zip(together, scales[:, 0], strict=True):
        own = [replace(layers[0], bond="slip")]
        own += [replace(layer, thickness=layer.thickness * scale) for layer in layers[1:]]
        np.testing.assert_allclose(row, ul.StackKernel(tuple(own), base).one_minus_L(U[1:]), rtol=1e-13)


@pytest.mark.parametrize("name", MOMENTS)
def test_moments_of_stacks(name):
    np.testing.assert_allclose(ul.StackKernel(*parts(name)).coefficients(2), MOMENTS[name], rtol=1e-11)


@pytest.mark.parametrize("line", CONTACTS.strip().splitlines())
def test_contacts_on_stacks(line):
    name, *numbers = line.split()
    eps, kappa, *values = (float(number) for number in numbers)
    layers, base = parts(name)
    theta = layers[0].material.theta
    for tip, w, P in zip((ul.Paraboloid(1.0), ul.Cone(np.pi / 4)), values[::2], values[1::2], strict=True):
        A, lam = tip.coefficient, tip.exponent
        depth = w * A * eps**lam
        law = exact_law(contact(tip, layers, base), depth * (1.0 + 1e-7), 1e-11)
        assert float(law.force(depth)) == pytest.approx(P * theta * A * eps ** (lam + 1.0), rel=1e-10)
        assert float(law.contact_radius(depth)) == pytest.approx(eps, rel=1e-10)
        assert float(law.stiffness(depth)) == pytest.approx(4.0 * theta * eps * kappa, rel=1e-10)


def test_smooth_base():
    """L = 2 sinh^2 u/(sinh 2u + 2u) for every nu; a_0 is AtomicJ's 1.16758 for a layer free to slip."""
    u = np.array([1e-3, 0.1, 0.4, 0.6, 1.0, 3.0, 8.0])
    for nu in (0.0, 0.3, 0.5):
        kernel = ul.StackKernel((ul.Layer(ul.Isotropic(7.0, nu), 2.0, bond="slip"),), ul.RIGID)
        L = 2.0 * np.sinh(u) ** 2 / (np.sinh(2.0 * u) + 2.0 * u)
        np.testing.assert_allclose(1.0 - kernel.one_minus_L(u), L, rtol=1e-12)
        a_0 = float(kernel.coefficients(1)[0])
        assert a_0 == pytest.approx(1.1675768374, abs=1e-10)
        assert f"{a_0:.5f}" == "1.16758"


@pytest.mark.parametrize(
    ("eps", "kappa", "w", "P"),
    [
        (0.25, 1.220708578, 1.763033611, 5.359708828),
        (0.5, 1.506087868, 1.573799899, 5.515721877),
        (1.0, 2.198621366, 1.347961290, 6.312490989),
        (2.0, 3.727606480, 1.180461085, 8.919478026),
        (4.0, 6.853184282, 1.089957175, 14.969663799),
    ],
)
def test_contact_on_a_smooth_base(eps, kappa, w, P):
    layer, tip = ul.Layer(ul.Isotropic(1.0, 0.4), 1.0, bond="slip"), ul.Paraboloid(1.0)
    theta = layer.material.theta
    law = exact_law(ul.Contact.of(tip, layer, ul.RIGID), 0.5 * w * eps**2 * (1.0 + 1e-7), 1e-11)
    depth = 0.5 * w * eps**2
    # The reference has ten digits.
    assert float(law.stiffness(depth)) == pytest.approx(4.0 * theta * eps * kappa, rel=1e-9)
    assert float(law.force(depth)) == pytest.approx(0.5 * P * theta * eps**3, rel=1e-9)


@pytest.mark.parametrize("solver", [ul.Exact(1e-10), ul.Asymptotic()])
def test_solvers_see_no_difference_between_one_layer_and_its_slices(solver):
    whole = ul.Scene(ul.Sphere(1.0), ul.Layer(ul.Isotropic(1.0, 0.4), 1.0), ul.Isotropic(20.0, 0.3))
    half = ul.Layer(ul.Isotropic(1.0, 0.4), 0.5)
    sliced = replace(whole, layer=half, substrate=ul.Stack([half], whole.substrate))
    depth = np.linspace(0.005, 0.05, 5)
    if isinstance(solver, ul.Exact):
        forces = [scene.force(depth, solver=solver) for scene in (sliced, whole)]
        np.testing.assert_allclose(*forces, rtol=1e-9)
    a, b = sliced.contact.kernel.coefficients(3), whole.contact.kernel.coefficients(3)
    np.testing.assert_allclose(a, b * 0.5 ** (2.0 * np.arange(3) + 1.0), rtol=1e-12)


# --- scenes ---------------------------------------------------------------------------------------------

FILM = ul.Scene(
    ul.Sphere(50e-6),
    ul.Layer(ul.Isotropic(1e6, 0.3), 20e-6),
    ul.Stack([ul.Layer(ul.Isotropic(3e6, 0.49), 10e-6)], ul.RIGID),
)
HELD = replace(
    FILM,
    layer=replace(FILM.layer, bond="slip"),
    substrate=ul.Stack(
        [FILM.substrate.layers[0], ul.Layer(ul.Isotropic(1e5, 0.4), 1e-6, bond=ul.Spring(normal=1e12))],
        ul.TransverselyIsotropic(E=7e10, E_axial=6e10, nu=0.2, nu_axial=0.2, G_axial=3e10),
    ),
)


@pytest.mark.parametrize("scene", [FILM, HELD])
def test_scene_files_hold_stacks(tmp_path, scene):
    assert ul.load_scene(scene.save(tmp_path / "scene.toml")) == scene


def test_the_layers_that_the_reference_prints_are_read(tmp_path):
    page = Path(__file__).resolve().parents[1] / ".reference" / "pages" / "scene_files.md"
    blocks = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    scene, layers = (next(b for b in blocks if word in b) for word in ("[indenter]", "[[substrate.layers]]"))
    path = tmp_path / "scene.toml"
    path.write_text(scene + layers, encoding="utf-8")
    assert ul.load_scene(path).substrate.layers == (ul.Layer(ul.Isotropic(20e6, 0.4), 100e-6),)


def test_paths_of_a_stack():
    known = HELD.parameters
    assert known["substrate.layers[0].E"] == 3e6
    assert known["substrate.layers[1].bond.normal"] == 1e12
    assert known["substrate.E_axial"] == 6e10
    changed = HELD.with_values({"substrate.layers[1].thickness": 2e-6})
    assert changed.substrate.layers[1].thickness == 2e-6


def test_every_layer_and_the_interfaces_are_effects():
    sizes = effect_sizes(HELD, np.array([1e-6]), ul.Exact(1e-4))
    layers, base = HELD.substrate.layers, HELD.substrate.base
    force = HELD.force(1e-6)
    for name, body in (("layer 2", ul.Stack(layers[1:], base)), ("layer 3", ul.Stack(layers[:1], base))):
        without = replace(HELD, substrate=body).force(1e-6)
        assert sizes[name][0] == pytest.approx(force / without - 1.0, abs=3e-4)
    assert sizes["interfaces"][0] < 0.0


@pytest.mark.parametrize(
    ("path", "true", "prior"),
    [
        ("layer.E", 1e6, ul.LogUniform(1e4, 1e8)),
        ("substrate.layers[0].E", 3e6, ul.LogUniform(1e5, 1e8)),
        ("substrate.layers[0].thickness", 10e-6, ul.LogUniform(1e-6, 1e-4)),
    ],
)
def test_one_unknown_of_a_known_stack_is_fitted(path, true, prior):
    curve = ul.synthesize(FILM, np.linspace(0.0, 4e-6, 60), ul.Noise(force=1e-7), rng=3)
    fit = ul.fit(ul.Problem(FILM, curve, free={path: prior}))
    assert abs(fit.values[path] - true) < 4.0 * fit.stderr[path]
    assert fit.stderr[path] < 0.05 * true


# --- what the automatic solver joins ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("layers", "base", "said", "rtol"),
    [
        (
            [(1e6, 0.4, 5e-6), (1e6, 0.4, 15e-6), (3e6, 0.4, 1e-5)],
            (70e9, 0.2),
            "layer 2 as the layer on top",
            1e-6,
        ),
        ([(1e6, 0.4, 2e-5), (3e6, 0.4, 1e-5), (70e9, 0.2, 1e-3)], (70e9, 0.2), "layer 3 as the base", 1e-6),
        ([(1e6, 0.4, 2e-5), (3e6, 0.4, 1e-5), (3.01e6, 0.4, 1e-11)], None, "layer 3 as layer 2", 1e-6),
        ([(1e6, 0.4, 2e-5), (3e6, 0.4, 1e-5), (5e6, 0.4, 1.0)], None, "the base as layer 3", 1e-3),
        ([(1e6, 0.4, 2e-5), (1.2e6, 0.4, 1e-5), (1e6, 0.4, 2e-5)], None, "", 1e-6),
    ],
)
def test_auto_joins_layers_that_do_not_matter(layers, base, said, rtol):
    made = [ul.Layer(ul.Isotropic(E, nu), t) for E, nu, t in layers]
    stack = ul.Stack(made[1:], ul.RIGID if base is None else ul.Isotropic(*base))
    tip, depth = ul.Paraboloid(50e-6), np.geomspace(1e-8, 2e-6, 12)
    auto, exact = (
        ul.contact_law(tip, made[0], stack, max_depth=2e-6, solver=solver)
        for solver in (ul.Auto(rtol), ul.Exact(1e-9))
    )
    assert said in auto.reason
    assert ("taken together" in auto.reason) == bool(said)
    np.testing.assert_allclose(auto.force(depth), exact.force(depth), rtol=rtol)
    np.testing.assert_allclose(auto.stiffness(depth), exact.stiffness(depth), rtol=rtol)


def test_what_joining_costs_is_bounded():
    """Over random stacks with a looser and looser tolerance, nothing moves by more than is allowed."""
    rng, joined = np.random.default_rng(5), 0
    for _ in range(12):
        rows = [
            (10.0 ** rng.uniform(-0.5, 0.5), rng.uniform(0.2, 0.5), 10.0 ** rng.uniform(-2, 1))
            for _ in range(3)
        ]
        made = [ul.Layer(ul.Isotropic(E, nu), t) for E, nu, t in [(1.0, 0.4, 1.0), *rows]]
        tip, deepest, rtol = ul.Paraboloid(10.0), 10.0 ** rng.uniform(-3, -1), 1e-2
        auto, exact = (
            ul.contact_law(tip, made[0], ul.Stack(made[1:]), max_depth=deepest, solver=solver)
            for solver in (ul.Auto(rtol), ul.Exact(1e-6))
        )
        joined += "taken together" in auto.reason
        for name in ("force", "contact_radius", "stiffness"):
            got, expected = (float(getattr(law, name)(deepest)) for law in (auto, exact))
            assert got == pytest.approx(expected, rel=rtol)
    assert joined >= 2


# --- bad input ------------------------------------------------------------------------------------------


def test_bad_bodies_are_refused():
    gel = ul.Layer(ul.Isotropic(1e4, 0.5), 1e-4)
    with pytest.raises(ul.InputError, match=r"up to 7 layers, 8 with the one on top; got 8"):
        ul.Stack([gel] * 8)
    with pytest.raises(ul.InputError, match=r"layers\[1\] of a Stack needs a finite thickness"):
        ul.Stack([gel, ul.Layer(gel.material)])
    with pytest.raises(ul.InputError, match="thickness must be positive"):
        ul.Stack([ul.Layer(gel.material, 0.0)])
    with pytest.raises(ul.InputError, match="one layer or more"):
        ul.Stack([])
    with pytest.raises(ul.InputError, match="unknown bond 'glued'"):
        replace(gel, bond="glued")
    with pytest.raises(ul.InputError, match="nothing would hold the layer"):
        ul.Spring(normal=0.0)
    with pytest.raises(ul.InputError, match="shear stiffness must be zero or more"):
        ul.Spring(shear=-1.0)
    with pytest.raises(ul.InputError, match=r"needs an isotropic layer on .* got .*slip"):
        ul.contact_law(
            ul.Sphere(1e-3), replace(gel, bond="slip"), ul.RIGID, max_depth=1e-6, solver="garcia2018"
        )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '[substrate]\nrigid = true\n[[substrate.layers]]\nE = "1 MPa"\nnu = 0.4\n',
            r"layers\[0\].* finite thickness",
        ),
        ('[substrate]\nrigid = true\n[substrate.layers]\nE = "1 MPa"\n', r"\[\[substrate.layers\]\]"),
        (
            '[substrate]\nrigid = true\n[[substrate.layers]]\nE = "1 MPa"\nnu = 0.4\nbond = "glued"\n',
            r"\[substrate.layers\[0\]\] bond: 'glued' is not known",
        ),
    ],
)
def test_bad_scene_files_are_refused(tmp_path, text, message):
    path = tmp_path / "scene.toml"
    head = (
        '[indenter]\nshape = "sphere"\nradius = "1 mm"\n[layer]\nE = "1 kPa"\nnu = 0.5\nthickness = "1 mm"\n'
    )
    path.write_text(head + text, encoding="utf-8")
    with pytest.raises(ul.InputError, match=message) as caught:
        ul.load_scene(path)
    assert "\n" not in str(caught.value)


def test_slip_under_slip_is_held_by_symmetry():
    """No translation is left in an axisymmetric contact: two faces that slip are no mechanism."""
    slippery = ul.Layer(ul.Isotropic(1e4, 0.5), 1e-4, bond="slip")
    kernel = ul.StackKernel((slippery, slippery), ul.RIGID)
    L = 1.0 - kernel.one_minus_L(np.geomspace(1e-8, 1.0, 50))
    assert np.all(L > 0.0)
    law = ul.contact_law(ul.FlatPunch(1e-4), slippery, ul.Stack([slippery]), max_depth=1e-6)
    bonded = ul.contact_law(
        ul.FlatPunch(1e-4), replace(slippery, bond="bonded"), ul.Stack([slippery]), max_depth=1e-6
    )
    assert 0.0 < law.force(1e-6) < bonded.force(1e-6)
