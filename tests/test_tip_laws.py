"""Laws of spheres and measured tips off the tables of the flat punch, against those that are solved for."""

import numpy as np
import pytest

import underlay as ul
from underlay.inference.least_squares.scan_curve import power_law_objective
from underlay.inference.model.forward import TipOverPowerLaw
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.exact import law as direct
from underlay.mechanics.exact import tip_curves
from underlay.mechanics.exact.curve_family import (
    STIFF_END,
    IsotropicPair,
    RigidBase,
    end_numbers,
    ratio_number,
    ratio_span,
)
from underlay.mechanics.exact.law import exact_law
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution
from underlay.mechanics.exact.table_laws import in_size as size_slope
from underlay.mechanics.exact.table_laws import tip_laws
from underlay.mechanics.exact.tip_curves import PunchCell, punch_family
from underlay.mechanics.kernel import LayerKernel

SHARES = np.linspace(0.02, 1.0, 40)


def contact(tip, ratio, nu=0.5, thickness=1.0):
    base = ul.RIGID if ratio is None else ul.Isotropic(ratio, 0.3)
    return ul.Contact.of(tip, ul.Layer(ul.Isotropic(1.0, nu), thickness), base)


def tabulated(tip, ratio, depth, rtol, nu=0.5, thickness=1.0):
    family = RigidBase(nu) if ratio is None else IsotropicPair(nu, 0.3)
    ratios = None if ratio is None else [ratio]
    return tip_laws([contact(tip, ratio, nu, thickness)], family, ratios, [depth], rtol)[0]


def largest_error(law, reference, depth):
    w = SHARES * depth
    pairs = ((law.force, reference.force), (law.stiffness, reference.stiffness))
    pairs += ((law.contact_radius, reference.contact_radius),)
    return max(float(np.abs(one(w) / other(w) - 1.0).max()) for one, other in pairs)


@pytest.mark.parametrize("nu", [0.3, 0.5])
@pytest.mark.parametrize("ratio", [None, 1e4, 10.0, 0.5, 0.03])
@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-6])
def test_a_sphere_off_the_tables_errs_by_less_than_it_says(rtol, ratio, nu):
    for radius, share in ((0.3, 0.6), (1.0, 0.3), (1.0, 0.65), (4.0, 0.25)):
        tip = ul.Sphere(radius)
        depth = float(tip.abel(np.array(share * radius)))
        law = tabulated(tip, ratio, depth, rtol, nu)
        assert law is not None
        assert law.max_depth >= depth
        assert law.error_estimate <= rtol
        reference = exact_law(contact(tip, ratio, nu), depth, 1e-9)
        assert largest_error(law, reference, depth) <= law.error_estimate + reference.error_estimate


@pytest.mark.parametrize("ratio", [None, 1e4])
@pytest.mark.parametrize(("width", "rtol"), [(10.0, 1e-4), (13.0, 1e-6)])
def test_contacts_many_thicknesses_wide_are_off_the_tables_too(width, rtol, ratio):
    # Where a thin layer is walked to; a/h is half as much again, and ends at 20.
    tip = ul.Sphere(40.0)
    depth = float(tip.abel(np.array(width)))
    law = tabulated(tip, ratio, depth, rtol, 0.3)
    assert law is not None
    assert law.error_estimate <= rtol
    reference = exact_law(contact(tip, ratio, 0.3), depth, 1e-7)
    assert largest_error(law, reference, depth) <= law.error_estimate + reference.error_estimate


@pytest.mark.parametrize("ratio", [None, 1e4])
def test_where_the_contact_is_too_wide_the_tables_say_so_as_the_law_does(ratio):
    tip, deep = ul.Sphere(80.0), 40.0
    refusal = tabulated(tip, ratio, deep, 1e-6, 0.3)
    assert isinstance(refusal, ul.RangeError)
    with pytest.raises(ul.RangeError, match="20 thicknesses") as told:
        exact_law(contact(tip, ratio, 0.3), deep, 1e-6)
    assert "20 thicknesses" in str(refusal)
    assert 0.9995 * told.value.max_depth < refusal.max_depth < told.value.max_depth
    # Nothing is refused that there is.
    law = tabulated(tip, ratio, 1.0002 * refusal.max_depth, 1e-6, 0.3)
    assert not isinstance(law, ul.RangeError)


def test_where_the_tables_do_not_reach_there_is_no_law_rather_than_a_wrong_one():
    # A contact eight thicknesses wide takes more points at 1e-10 than a polynomial may have.
    wide = ul.Sphere(20.0)
    assert tabulated(wide, 10.0, float(wide.abel(np.array(8.0))), 1e-10) is None
    # And beyond the equator there is no contact at all.
    assert tabulated(ul.Sphere(1.0), 10.0, 20.0, 1e-3) is None


def test_on_a_base_far_softer_still_no_table_is_made():
    """Most of them only told, after up to 0.6 s, that they err by too much."""
    assert tabulated(ul.Sphere(1.0), 1.1e-5, 1e-3, 1e-4) is not None
    assert tabulated(ul.Sphere(1.0), 0.9e-5, 1e-3, 1e-4) is None


def test_where_a_curve_is_too_long_for_a_table_none_is_made(monkeypatch):
    """A plate on a base a thousand times softer, pressed wide: to make its tables took half of a fit."""
    made = []
    monkeypatch.setattr(tip_curves, "_placing", lambda *asked: made.append(asked))
    wide, less = (ul.Sphere(40.0).abel(np.array(width)) for width in (14.0, 5.0))
    assert tabulated(ul.Sphere(40.0), 1e-3, float(wide), 1e-6) is None
    assert not made
    # A shorter one is tried, as is one on a rigid base: a contact that is too wide is told apart by its table.
    tabulated(ul.Sphere(40.0), 1e-3, float(less), 1e-6)
    tabulated(ul.Sphere(40.0), None, float(wide), 1e-6)
    assert len(made) == 2


def test_towards_the_equator_a_law_ends_where_its_points_do():
    tip = ul.Sphere(1.0)
    for share in (0.75, 0.8, 0.85):
        depth = float(tip.abel(np.array(share)))
        law = tabulated(tip, 10.0, depth, 1e-3)
        if law is not None:
            reference = exact_law(contact(tip, 10.0), law.max_depth, 1e-8)
            assert largest_error(law, reference, law.max_depth) <= law.error_estimate


def test_the_size_of_everything_scales_out():
    depth = 0.2
    one = tabulated(ul.Sphere(1.0), 10.0, depth, 1e-6)
    other = tabulated(ul.Sphere(5e-6), 10.0, 5e-6 * depth, 1e-6, thickness=5e-6)
    w = SHARES * depth
    assert other.force(5e-6 * w) == pytest.approx(25e-12 * one.force(w), rel=1e-12)


def test_slopes_are_those_of_the_solved_law():
    radius, ratio, depth = 1.0, 5.0, 0.25
    law = tabulated(ul.Sphere(radius), ratio, depth, 1e-6)
    w, step = SHARES * depth, 1e-3
    force, stiffness, (told, in_thickness) = law.with_slopes(w)

    def solved(R, k):
        return exact_law(contact(ul.Sphere(R), k), depth, 1e-10).force(w)

    # The truncation of a central difference is 1e-7, that of the law's own 5e-5 of the second derivative.
    in_ratio = (solved(radius, ratio * np.exp(step)) - solved(radius, ratio * np.exp(-step))) / (2.0 * step)
    in_size = (solved(radius * np.exp(step), ratio) - solved(radius * np.exp(-step), ratio)) / (2.0 * step)
    assert told == pytest.approx(in_ratio, rel=1e-3)
    assert size_slope(w, force, stiffness, in_thickness) == pytest.approx(in_size, rel=1e-3)
    assert (law.with_slopes(-w)[2] == 0.0).all()


def test_the_flat_punch_is_read_between_the_ratios_and_radii_it_was_solved_at():
    family, ratio = IsotropicPair(0.45, 0.3), 3.0
    table = punch_family(PunchCell(family, ratio_number(ratio), 0, 1e-6))
    eps = np.array([0.011, 0.3, 0.77, 1.3])
    read = table.at(np.log(np.array(ratio)), eps)
    kernel = LayerKernel(isotropic_constants(1.0, 0.45), isotropic_constants(ratio, 0.3))
    solved = PunchSolution.solve(kernel, eps, table.resolution)
    for name in ("kappa", "g", "rho"):
        assert getattr(read, name) == pytest.approx(getattr(solved, name), rel=1e-6, abs=1e-6), name


@pytest.mark.parametrize("ratio", [1e4, 1e6, 1e10])
def test_bases_up_to_a_rigid_one_share_a_table_and_its_slope_dies_out(ratio):
    nu, depth = 0.45, 0.25
    family, tip = IsotropicPair(nu, 0.3), ul.Sphere(1.0)
    low = ratio_span(STIFF_END).low
    assert end_numbers(np.array([float(np.exp(low)) * 1.001, ratio])).tolist() == [STIFF_END, STIFF_END]
    softer = float(np.exp(low)) * 0.999
    assert end_numbers(np.array(softer)) == ratio_number(softer)
    law = tip_laws([contact(tip, ratio, nu)], family, [ratio], [depth], 1e-6)[0]
    w = SHARES * depth
    force, step = law.force(w), 1e-3

    def solved(k):
        return exact_law(contact(tip, k, nu), depth, 1e-10).force(w)

    in_ratio = (solved(ratio * np.exp(step)) - solved(ratio * np.exp(-step))) / (2.0 * step)
    # A thousandth, as between other ratios, and the rounding of both differences: of logarithms known to
    # 1e-14 over steps of 1e-7, and of laws solved to 1e-14 over 2e-3 where nodes are the same.
    told = law.with_slopes(w)[2][0]
    assert told == pytest.approx(in_ratio, rel=1e-3, abs=1e-7 * force.max())


@pytest.mark.parametrize("ratio", [0.05, 0.5, 5.0, 1e4])
def test_radii_that_share_fewer_nodes_are_as_exact_as_the_widest(ratio):
    family = IsotropicPair(0.4, 0.3)
    table = punch_family(PunchCell(family, int(end_numbers(np.array(ratio))), 4, 1e-6))
    eps = np.array([0.05, 0.7, 3.0, 4.9, 5.1, 9.9, 10.1, 19.0])
    read = table.at(np.log(np.array(ratio)), eps)
    solved = PunchSolution.solve(
        family.kernel(ratio), eps, proved_resolution(family.kernel(ratio), 20.0, 1e-10)
    )
    for one, other in zip(
        (read.kappa, *read.depth_and_force(read.rule.power_weights(2.0))),
        (solved.kappa, *solved.depth_and_force(solved.rule.power_weights(2.0))),
        strict=True,
    ):
        # The share that a table has of 1e-6.
        assert one == pytest.approx(other, rel=3e-7)


def test_a_measured_tip_has_its_tables_too():
    r = np.linspace(0.0, 1.0, 60)
    tip = ul.Profile(r, r**2 / 2.0 + 0.05 * r**4)
    depth = float(tip.abel(np.array(0.4)))
    law = tabulated(tip, 10.0, depth, 1e-3)
    assert law is not None
    assert largest_error(law, exact_law(contact(tip, 10.0), depth, 1e-7), depth) <= law.error_estimate


def test_a_sphere_over_its_paraboloid_is_exact_on_a_half_space():
    tip, rounded = ul.Sphere(1.0), ul.Paraboloid(1.0)
    depth = np.array([[-0.1, 0.0, 0.01, 0.3]])
    asked, ratio = TipOverPowerLaw(tip, rounded).seen(depth)
    by_tip, by_power_law = (
        ul.Scene(shape, ul.Layer(ul.Isotropic(1.0, 0.5), np.inf)).contact_law(1.0) for shape in (tip, rounded)
    )
    assert ratio * by_power_law.force(asked) == pytest.approx(by_tip.force(depth), rel=1e-12)
    assert by_power_law.stiffness(asked) == pytest.approx(by_tip.stiffness(depth), rel=1e-12)
    assert ratio[0, :2].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(3e7, 0.3)])
def test_a_sphere_over_its_paraboloid_is_nearly_right_on_a_layer(base):
    tip, rounded, depth = ul.Sphere(1e-3), ul.Paraboloid(1e-3), np.linspace(4e-6, 3.6e-4, 20)
    by_tip, by_power_law = (
        ul.Scene(shape, ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), base).contact_law(
            3.6e-4, solver=ul.Exact(1e-4)
        )
        for shape in (tip, rounded)
    )
    asked, ratio = TipOverPowerLaw(tip, rounded).seen(depth)
    # The two differ by up to 13 %; what is left is the product of that and the layer's share.
    assert ratio * by_power_law.force(asked) == pytest.approx(by_tip.force(depth), rel=0.02)


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(3e7, 0.3)])
def test_the_model_by_the_power_law_says_its_own_derivatives(base):
    scene = ul.Scene(
        ul.Sphere(1e-3), ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), base, ul.Instrument(contact_depth=2e-5)
    )
    free = ("layer.E", "layer.thickness", "instrument.contact_depth")
    depth = np.linspace(-5e-5, 3e-4, 200)
    problem = ul.Problem(
        scene, ul.synthesize(scene, depth), free, noise=ul.Noise(force=1e-3), solver=ul.Exact(1e-6)
    )
    objective = power_law_objective(problem, robust=False)
    low, high = problem.bounds.T
    here = objective.places(np.zeros((2, 3)), np.array([low, low]), np.array([high, high]))
    alone = objective.jacobian(here.vector[0])
    assert alone.T @ alone == pytest.approx(here.normal[0], rel=1e-6)
    forward, values = objective.members[0].forward, dict(objective.members[0].base)
    for column, path in zip(forward.jacobian(values, free)[1].T, free, strict=True):
        step = 1e-4 * values[path]
        ahead, behind = (
            forward.jacobian(values | {path: values[path] + side}, free)[0].force for side in (step, -step)
        )
        slope = (ahead - behind) / (2.0 * step)
        assert column == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max())


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(3e7, 0.3)])
def test_a_fit_of_a_sphere_solves_no_contact_of_its_own(base, monkeypatch):
    scene = ul.Scene(
        ul.Sphere(1e-3), ul.Layer(ul.Isotropic(3e6, 0.5), 1e-3), base, ul.Instrument(contact_depth=2e-5)
    )
    noise = ul.Noise(force=0.002 * float(scene.force(3e-4)))
    curve = ul.synthesize(scene, np.linspace(-5e-5, 3e-4, 200), noise=noise, rng=0)
    free = ("layer.E", "layer.thickness", "instrument.contact_depth")
    start = scene.with_values({"layer.E": 9e6, "layer.thickness": 0.5e-3, "instrument.contact_depth": 0.0})
    solved = []
    real = direct.known_curve

    def counted(problem, top, rtol):
        solved.append(rtol)
        return real(problem, top, rtol)

    monkeypatch.setattr(direct, "known_curve", counted)
    found = ul.fit(ul.Problem(start, curve, free, noise=noise, solver=ul.Exact(1e-6)))
    assert solved == []
    for name in ("layer.E", "layer.thickness"):
        assert abs(found.values[name] - scene.parameters[name]) < 4.0 * found.stderr[name], name
    # The law that the tables give and the one that is solved for agree on the optimum.
    own = found.problem.revised(scenes=found.scenes)
    exact = [
        member.scene_at(own.physical(own.start)).force(curve.depth, solver=ul.Exact(1e-9))
        for member in own.members
    ]
    assert curve.force - exact[0] == pytest.approx(found.residuals[0], abs=1e-5 * float(curve.force.max()))
