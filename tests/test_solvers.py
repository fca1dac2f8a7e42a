"""Solvers: `Auto` keeps its promise, says how far it may be off and decides cheaply; what a ``solver=`` takes.

The reference is the exact law at 1e-11, itself held to independent solutions in test_exact.py.
"""

import itertools
import pickle

import numpy as np
import pytest

import underlay as ul
from support.call_counter import count_calls
from support.laws import exact_law
from underlay.mechanics.kernel import bodies as one_layer
from underlay.mechanics.solvers import as_solver, solver_named, solver_record

RTOLS = (1e-2, 1e-3, 1e-4, 1e-6)
#: Relative error of the reference.
REFERENCE = 1e-11
VARPI = (1e-7, 1e-5, 1e-3, 0.01, 0.1, 1.0, 8.0)
#: Depths asked of every law, as fractions of the deepest.
FRACTIONS = np.array([1e-3, 0.1, 0.5, 1.0])

ZINC = ul.TransverselyIsotropic.from_stiffness(A11=161e9, A12=34.2e9, A13=50.1e9, A33=61.0e9, A44=38.3e9)
SOFT_AXIS = ul.TransverselyIsotropic(E=5.8e6, E_axial=0.46e6, nu=0.3, nu_axial=0.02, G_axial=0.37e6)
STIFF_AXIS = ul.TransverselyIsotropic(E=1e6, E_axial=20e6, nu=0.3, nu_axial=0.25, G_axial=0.5e6)

PAIRS = {
    **{f"rigid, nu = {nu}": (ul.Isotropic(1.0, nu), ul.RIGID) for nu in (0.1, 0.3, 0.4, 0.45, 0.5)},
    **{
        f"E2/E1 = {ratio:g}, nu = {nu1} on {nu2}": (ul.Isotropic(1.0, nu1), ul.Isotropic(ratio, nu2))
        for ratio, nu1, nu2 in (
            (1e-3, 0.5, 0.3),
            (1e-2, 0.3, 0.3),
            (0.1, 0.5, 0.5),
            (0.5, 0.3, 0.4),
            (0.9, 0.45, 0.45),
            (0.999, 0.4, 0.4),
            (1.0, 0.5, 0.2),
            (1.0, 0.1, 0.45),
            (1.1, 0.3, 0.3),
            (2.0, 0.5, 0.5),
            (10.0, 0.3, 0.2),
            (1e3, 0.5, 0.3),
        )
    },
    "zinc on rigid": (ZINC, ul.RIGID),
    "zinc on steel": (ZINC, ul.Isotropic(210e9, 0.3)),
    "soft axis on stiff axis": (SOFT_AXIS, STIFF_AXIS),
    "stiff axis on soft axis": (STIFF_AXIS, SOFT_AXIS),
}

SHAPES = {
    "flat": ul.FlatPunch,
    "cone": lambda _: ul.Cone(1.2),
    "lambda 1.5": lambda _: ul.PowerLaw(1.5, 0.7),
    "paraboloid": lambda _: ul.Paraboloid(2.0),
    "lambda 4": lambda _: ul.PowerLaw(4.0, 0.3),
    "sphere, a = R/2": lambda radius: ul.Sphere(2.0 * radius),
    "sphere, a = R/5": lambda radius: ul.Sphere(5.0 * radius),
}


def deepest(indenter, varpi):
    """Depth (m) at which the half-space radius is `varpi` on a layer 1 m thick; 1 m for a flat punch."""
    return 1.0 if isinstance(indenter, ul.FlatPunch) else float(indenter.abel(np.array(varpi)))


def answers(law, depth):
    return np.array([law.force(depth), law.contact_radius(depth), law.stiffness(depth)])


#: Every pair with two shapes and every shape with four pairs: each effect of either is met, in a few seconds.
CASES = [
    (pair, shape)
    for pair, shape in itertools.product(PAIRS, SHAPES)
    if shape in ("paraboloid", "flat")
    or pair
    in ("rigid, nu = 0.5", "E2/E1 = 0.001, nu = 0.5 on 0.3", "E2/E1 = 10, nu = 0.3 on 0.2", "zinc on steel")
]


@pytest.mark.parametrize(("pair", "shape"), CASES)
def test_auto_keeps_its_promise_and_its_estimate_is_honest(pair, shape):
    material, substrate = PAIRS[pair]
    layer = ul.Layer(material, 1.0)
    broken, dishonest = [], []
    for varpi in VARPI:
        indenter = SHAPES[shape](varpi)
        deep = deepest(indenter, varpi)
        depth = deep * FRACTIONS
        reference = answers(exact_law(indenter, layer, substrate, max_depth=deep, rtol=REFERENCE), depth)
        for rtol in RTOLS:
            law = ul.contact_law(indenter, layer, substrate, max_depth=deep, solver=ul.Auto(rtol))
            error = float(np.abs(answers(law, depth) / reference - 1.0).max())
            case = f"a/h {varpi:g}, rtol {rtol:g}: error {error:.2e}, {law.error_estimate:.2e}, {law.reason}"
            if error > rtol:
                broken.append(case)
            if law.error_estimate < error / 3.0 - REFERENCE:
                dishonest.append(case)
    assert not broken, "\n".join(broken)
    assert not dishonest, "\n".join(dishonest)


def test_auto_keeps_its_promise_where_it_leaves_the_exact_law_out_of_it():
    # Random pairs, exponents and depths; the cases that go to the exact law are tested with it.
    rng = np.random.default_rng(3)
    tried = 0
    while tried < 100:
        nu1, nu2 = rng.uniform(0.0, 0.5, 2)
        substrate = ul.RIGID if rng.random() < 0.2 else ul.Isotropic(10.0 ** rng.uniform(-3, 3), nu2)
        layer = ul.Layer(ul.Isotropic(1.0, nu1), 1.0)
        indenter = ul.PowerLaw(rng.uniform(1.0, 6.0), 1.0)
        rtol = 10.0 ** rng.uniform(-6, -1.5)
        deep = deepest(indenter, 10.0 ** rng.uniform(-7, 0))
        law = ul.contact_law(indenter, layer, substrate, max_depth=deep, solver=ul.Auto(rtol))
        if law.method == "exact":
            continue
        tried += 1
        depth = deep * FRACTIONS
        reference = answers(exact_law(indenter, layer, substrate, max_depth=deep, rtol=REFERENCE), depth)
        error = float(np.abs(answers(law, depth) / reference - 1.0).max())
        assert error <= rtol, (indenter, layer, substrate, law.reason)
        # A bound, not an estimate: never below the error.
        assert error - REFERENCE <= law.error_estimate, (indenter, layer, substrate, law.reason)


# --- which law, and why ------------------------------------------------------------------------------------

GEL = ul.Layer(ul.Isotropic(1e4, 0.5), 1e-3)
BALL = ul.Paraboloid(1e-3)


@pytest.mark.parametrize(
    ("layer", "substrate", "depth", "method", "words"),
    [
        (ul.Layer(GEL.material), None, 1e-4, "halfspace", "no layer effect"),
        (ul.Layer(GEL.material), ul.RIGID, 1e-4, "halfspace", "no layer effect"),
        (GEL, ul.Isotropic(1e4, 0.5), 1e-4, "halfspace", "no layer effect"),
        (GEL, ul.Isotropic(1e4 * (1.0 + 1e-7), 0.5), 1e-4, "halfspace", "differ by 1e-07 in compliance"),
        (GEL, ul.RIGID, 1e-16, "halfspace", "a/h = 3.2e-07"),
        (GEL, ul.RIGID, 1e-16, "halfspace", "the layer changes the contact by at most 6e-07"),
        (GEL, ul.RIGID, 2e-6, "exact", "exact contact problem"),
        (GEL, ul.RIGID, 1e-4, "exact", "exact contact problem"),
        (GEL, ul.RIGID, 1e-2, "exact", "exact contact problem"),
        (GEL, ul.RIGID, 0.0, "halfspace", "no contact"),
        (GEL, ul.RIGID, -1e-3, "halfspace", "no contact"),
    ],
)
def test_auto_takes_the_cheapest_law_and_says_why(layer, substrate, depth, method, words):
    law = ul.contact_law(BALL, layer, substrate, max_depth=depth)
    assert law.method == method
    assert words in law.reason


def test_a_looser_tolerance_reaches_deeper_before_the_exact_law_is_needed():
    def last_depth(rtol):
        depths = np.geomspace(1e-17, 1e-5, 200)
        cheap = [
            ul.contact_law(BALL, GEL, ul.RIGID, max_depth=d, solver=ul.Auto(rtol)).method != "exact"
            for d in depths
        ]
        assert cheap == sorted(cheap, reverse=True)
        return depths[sum(cheap) - 1]

    reached = np.array([last_depth(rtol) for rtol in (1e-6, 1e-4, 1e-2)])
    # The layer's effect grows as a/h, and a^2 = R depth: 100 times the error, 10^4 the depth.
    assert reached[1:] / reached[:-1] == pytest.approx(1e4, rel=0.3)


def test_a_law_chosen_for_a_depth_ends_there_and_says_so():
    law = ul.contact_law(BALL, GEL, ul.RIGID, max_depth=1e-16)
    assert law.method != "exact"
    assert law.max_depth == 1e-16
    assert law.force(0.0) == 0.0
    with pytest.raises(ul.RangeError, match="ask for less depth, or build it for more"):
        law.force(1.01e-16)


def test_no_layer_effect_computes_no_kernel(monkeypatch):
    kernels = count_calls(monkeypatch, one_layer, "isotropic_formula")
    for layer, substrate, depth in (
        (ul.Layer(GEL.material), None, 1e-4),
        (ul.Layer(GEL.material), ul.RIGID, 1e-4),
        (GEL, GEL.material, 1e-4),
        (GEL, ul.Isotropic(1e4 * (1.0 + 1e-8), 0.5), 1e-4),
        (GEL, ul.RIGID, 1e-16),
    ):
        ul.contact_law(BALL, layer, substrate, max_depth=depth).force(depth)
    assert kernels.calls == 0
    ul.contact_law(BALL, GEL, ul.RIGID, max_depth=2e-6, solver=ul.Auto(1e-8))
    assert kernels.calls > 0


def test_a_shape_that_ends_too_early_is_refused_as_by_the_exact_law():
    with pytest.raises(ul.RangeError, match="end of the indenter's shape"):
        ul.contact_law(ul.Sphere(1e-4), GEL, ul.RIGID, max_depth=1e-3)


# --- what the decision rests on ----------------------------------------------------------------------------


@pytest.mark.parametrize("varpi", [0.1, 1.0, 5.0])
def test_the_contrast_bounds_the_layer_effect(varpi):
    # Force: a theorem (energy is monotone in the stiffness of a part). Radius, stiffness: measured, within 4.
    rng = np.random.default_rng(1)
    for _ in range(20):
        nu1 = rng.uniform(0.0, 0.5)
        nu2 = float(np.clip(nu1 + rng.uniform(-0.05, 0.05), 0.0, 0.5))
        layer, substrate = (
            ul.Layer(ul.Isotropic(1.0, nu1), 1.0),
            ul.Isotropic(np.exp(rng.uniform(-0.1, 0.1)), nu2),
        )
        indenter = ul.PowerLaw(rng.uniform(1.0, 4.0), 1.0)
        depth = np.array([deepest(indenter, varpi)])
        law = exact_law(indenter, layer, substrate, max_depth=float(depth[0]), rtol=1e-9)
        halfspace = ul.contact_law(indenter, layer, substrate, max_depth=depth[0], solver="halfspace")
        change = answers(law, depth) / answers(halfspace, depth)
        delta = ul.SubstrateKernel(layer.material, substrate).contrast
        assert 1.0 / (1.0 + delta) - 1e-9 <= change[0, 0] <= 1.0 / (1.0 - delta) + 1e-9
        assert np.abs(change - 1.0).max() <= 4.0 * delta


def random_material(rng):
    if rng.random() < 0.5:
        return ul.Isotropic(10.0 ** rng.uniform(-3, 3), rng.uniform(0.0, 0.5))
    return ul.TransverselyIsotropic(
        E=1.0,
        E_axial=10.0 ** rng.uniform(-0.4, 1.3),
        nu=rng.uniform(0.0, 0.4),
        nu_axial=rng.uniform(0.0, 0.3),
        G_axial=10.0 ** rng.uniform(-1.5, 0.5),
    )


def test_the_effect_of_a_deep_layer_is_bounded_by_contrast_times_its_share_of_the_thickness():
    # Measured on 400 pairs where the bound was written: at most 1.6, and 2 is taken.
    rng = np.random.default_rng(11)
    largest = 0.0
    for _ in range(60):
        layer = random_material(rng)
        base = ul.RIGID if rng.random() < 0.2 else random_material(rng)
        exponent = rng.choice([1.0, 1.5, 2.0, 4.0, np.inf])
        kernel_of_pair = ul.SubstrateKernel(layer, base)
        varpi = 0.01 * rng.random() * kernel_of_pair.decay / kernel_of_pair.contrast
        indenter = ul.FlatPunch(varpi) if np.isinf(exponent) else ul.PowerLaw(exponent, 1.0)
        depth = deepest(indenter, varpi) * FRACTIONS
        found, bare = (
            answers(
                ul.contact_law(indenter, ul.Layer(layer, 1.0), base, max_depth=depth[-1], solver=s), depth
            )
            for s in (ul.Exact(1e-9), "halfspace")
        )
        bound = kernel_of_pair.contrast * varpi / kernel_of_pair.decay
        largest = max(largest, float(np.abs(found / bare - 1.0).max()) / bound)
    assert 1.0 < largest < 2.0


def contrast(layer, base):
    return ul.SubstrateKernel(layer, base).contrast


def test_contrast_of_equal_scaled_and_rigid_materials():
    assert contrast(ZINC, ZINC) == 0.0
    assert contrast(ul.Isotropic(1.0, 0.3), ul.Isotropic(2.0, 0.3)) == pytest.approx(0.5)
    assert contrast(ul.Isotropic(1.0, 0.3), ul.Isotropic(0.5, 0.3)) == pytest.approx(1.0)
    assert contrast(ZINC, ul.RIGID) == 1.0


# --- the door -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rtol", [0.0, -1e-3, 0.6, 1e-13, np.nan, np.inf, "tight"])
def test_an_impossible_accuracy_is_refused(rtol):
    with pytest.raises(ul.InputError, match="rtol"):
        ul.Auto(rtol)


def test_unknown_solvers_and_missing_substrates_are_named():
    with pytest.raises(ul.InputError, match="halfspace, asymptotic, exact"):
        ul.contact_law(BALL, GEL, ul.RIGID, max_depth=1e-5, solver="magic")
    with pytest.raises(ul.InputError, match="Did you mean 'exact'"):
        ul.contact_law(BALL, GEL, ul.RIGID, max_depth=1e-5, solver="exat")
    with pytest.raises(ul.InputError, match="garcia2018 needs a layer of finite thickness on a substrate"):
        ul.contact_law(BALL, ul.Layer(GEL.material), None, max_depth=1e-5, solver="garcia2018")


@pytest.mark.parametrize(
    "solver",
    [
        ul.Auto(1e-3),
        ul.Exact(1e-8),
        ul.Asymptotic(3, "parametric"),
        ul.HalfSpace(),
        ul.Published("garcia2018"),
    ],
    ids=lambda solver: solver.name,
)
def test_a_solver_is_its_record_its_name_and_its_copy(solver):
    assert solver_named(**solver_record(solver)) == solver
    assert as_solver(solver.name).name == solver.name
    assert type(solver)(**solver.numbers) == solver
    assert pickle.loads(pickle.dumps(solver)) == solver  # noqa: S301  our own bytes
    assert hash(solver) == hash(solver_named(**solver_record(solver)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ul.Asymptotic(5), "order must be 0, 1, 2, 3 or 4; got 5"),
        (lambda: ul.Asymptotic(form="series"), "unknown form 'series'"),
        (lambda: ul.Published("nobody1900"), "no published correction is called 'nobody1900'"),
        (lambda: as_solver("asymptotic:7"), "an order 0 to 4"),
        (lambda: as_solver("exact:2"), "an order 0 to 4"),
        (lambda: as_solver(3), "a solver is a name"),
        (lambda: as_solver(ul.Exact), "a solver is a name"),
        (lambda: solver_named("exact", order=2), "the solver 'exact' has no order; it has rtol"),
        (lambda: solver_named("halfspace", rtol=1e-3), "has no rtol; it has no numbers"),
    ],
)
def test_what_is_no_solver_is_refused(make, message):
    with pytest.raises(ul.InputError, match=message):
        make()


@pytest.mark.parametrize("solver", ["halfspace", "asymptotic", "exact"])
def test_force_and_stiffness_together_are_the_two_alone(solver):
    layer, tip = ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), ul.Paraboloid(1e-3)
    law = ul.contact_law(tip, layer, ul.RIGID, max_depth=5e-5, solver=solver)
    for depth in (np.linspace(-1e-5, 5e-5, 50), np.linspace(1e-6, 5e-5, 12).reshape(3, 4), 2e-5, -1e-5):
        force, stiffness = law.force_and_stiffness(depth)
        # One product of matrices for two rows rounds as two do, up to the order of its sums.
        assert force == pytest.approx(law.force(depth), rel=1e-13)
        assert stiffness == pytest.approx(law.stiffness(depth), rel=1e-13)
    if np.isfinite(law.max_depth):
        with pytest.raises(ul.RangeError):
            law.force_and_stiffness(np.array([2.0 * law.max_depth]))


@pytest.mark.parametrize("solver", [ul.Auto(), ul.Exact(), ul.Stuck()], ids=lambda solver: solver.name)
@pytest.mark.parametrize("tip", [ul.Sphere(1e-5), ul.Paraboloid(1e-5), ul.Cone(1.0), ul.FlatPunch(1e-5)])
def test_a_test_that_never_touches_has_a_law(solver, tip):
    layer = ul.Layer(ul.Isotropic(2e6, 0.46), 2e-3)
    law = ul.contact_law(tip, layer, ul.RIGID, max_depth=0.0, solver=solver)
    assert law.force(np.array([-1e-6, 0.0])).tolist() == [0.0, 0.0]
