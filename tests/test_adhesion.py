"""JKR, DMT and Maugis-Dugdale on layers: closed forms, limits, identities, and two independent solutions."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import underlay as ul
from underlay.mechanics.adhesion.jkr import jkr_branch, maugis_state
from underlay.mechanics.adhesion.radius_relation import solve_relation
from underlay.mechanics.exact.contact_problem import weights_over_depth
from underlay.mechanics.exact.nodes import even_rule
from underlay.mechanics.exact.punch_solution import PunchSolution, proved_resolution

FINE = ul.Exact(rtol=1e-10)


def layer(nu, thickness=1.0):
    """A layer of theta = 1 Pa."""
    return ul.Layer(ul.Isotropic(2.0 * (1.0 - nu**2), nu), thickness)


def base_of(nu, ratio):
    return ul.RIGID if ratio == np.inf else ul.Isotropic(2.0 * (1.0 - nu**2) * ratio, nu)


def law_of(work, *, nu=0.5, ratio=np.inf, tip=None, depth=0.0, solver=FINE, **more):
    """Law of theta = h = R = 1, in SI units."""
    scene = ul.Scene(tip or ul.Paraboloid(1.0), layer(nu), base_of(nu, ratio), adhesion=ul.JKR(work, **more))
    return scene.contact_law(depth, solver=solver)


def halfspace(tip, work, depth=0.0):
    return ul.Scene(tip, layer(0.3, np.inf), adhesion=ul.JKR(work)).contact_law(depth)


# --- the half-space: closed forms ---------------------------------------------------------------------------


def test_halfspace_is_johnson_kendall_and_roberts():
    law = halfspace(ul.Paraboloid(3.0), 0.7, 5.0)
    star = 2.0  # E* = 2 theta
    assert law.pull_off_force == pytest.approx(1.5 * np.pi * 3.0 * 0.7, rel=1e-12)
    depth = -0.75 * (np.pi**2 * 0.7**2 * 3.0 / star**2) ** (1.0 / 3.0)
    assert law.pull_off_depth == pytest.approx(depth, rel=1e-12)
    assert law.pull_off().force == pytest.approx(-5.0 / 6.0 * np.pi * 3.0 * 0.7, rel=1e-7)
    assert law.jump_in().force == pytest.approx(-4.0 / 3.0 * np.pi * 3.0 * 0.7, rel=1e-7)
    load = np.array([0.0, 0.3, 20.0])
    pull = 3.0 * np.pi * 0.7 * 3.0
    cubed = 0.75 * 3.0 / star * (load + pull + np.sqrt(2.0 * pull * load + pull**2))
    np.testing.assert_allclose(law.contact_radius(law.depth(load)), np.cbrt(cubed), rtol=1e-7)


def test_a_flat_punch_is_kendalls():
    law = halfspace(ul.FlatPunch(0.5), 0.7)
    assert law.pull_off_force == pytest.approx(4.0 * 0.5 * np.sqrt(np.pi * 0.5 * 0.7), rel=1e-12)
    assert law.force(law.pull_off_depth * (1.0 + 1e-12)) == 0.0
    assert law.force(law.pull_off_depth * (1.0 - 1e-9)) == pytest.approx(-law.pull_off_force, rel=1e-8)


def test_little_adhesion_is_none():
    """At a given depth the first change of the force is - 2 pi a work/(dw_el/da)."""
    w, work = np.linspace(0.05, 0.5, 7), 1e-7
    elastic = ul.contact_law(ul.Paraboloid(1.0), layer(0.5), ul.RIGID, max_depth=0.5, solver=FINE)
    law = law_of(work, depth=0.5)
    radius = elastic.contact_radius(w)
    first = -2.0 * np.pi * radius * work / law.branch.relation.at(radius).depth_slope
    np.testing.assert_allclose(law.force(w) - elastic.force(w), first, rtol=2e-2, atol=1e-9)


# --- reference values ---------------------------------------------------------------------------------------

#: Lambda -> pull-off force over pi R work: rigid base nu = 0.5, 0.45, 0.3; E2/E1 = 10 and 0.1 (nu = 0.3).
PULL_OFF = {
    1e-6: (1.50000215, 1.50000188, 1.50000141, 1.50000122, 1.49999655),
    1e-4: (1.50021391, 1.50018686, 1.50014023, 1.50012141, 1.49965710),
    1e-3: (1.50208574, 1.50182254, 1.50136900, 1.50118533, 1.49664366),
    1e-2: (1.51877211, 1.51641107, 1.51235854, 1.51069538, 1.46998142),
    0.1: (1.62339974, 1.60805820, 1.58224163, 1.57096095, 1.31554983),
    1.0: (1.86324945, 1.81730449, 1.74774241, 1.71090015, 1.03752002),
    10.0: (2.08335160, 1.98445946, 1.87260870, 1.79776506, 1.25058329),
    100.0: (2.28343740, 2.08194962, 1.93580201, 1.80525883, 1.37815103),
}
BODIES = ((0.5, np.inf), (0.45, np.inf), (0.3, np.inf), (0.3, 10.0), (0.3, 0.1))
RADII = {1e-6: 0.012090, 1e-3: 0.121008, 1.0: 1.161160, 100.0: 3.662931}


@pytest.mark.parametrize("column", range(5))
def test_pull_off_table(column):
    nu, ratio = BODIES[column]
    for work, row in PULL_OFF.items():
        law = law_of(work, nu=nu, ratio=ratio, solver=ul.Exact(1e-9))
        assert law.pull_off_force / (np.pi * work) == pytest.approx(row[column], abs=1e-7), work
        if column == 0 and work in RADII:
            assert law.pull_off(np.inf).radius == pytest.approx(RADII[work], abs=1e-6)


@pytest.mark.parametrize(
    ("nu", "work", "point"),
    [
        (0.5, 1.0, (0.2, -0.5884620465, -0.6165117639, 1.2806366058, 1.2729192956)),
        (0.5, 1.0, (0.5, -0.5204207967, -2.3251424011, 1.9329343708, 1.8046737904)),
        (0.5, 1.0, (1.0, -0.0799744953, -5.4937999818, 3.6187358490, 2.7721013843)),
        (0.5, 1.0, (1.5, 0.5367683168, -3.3207619077, 6.0030130839, 3.7748224045)),
        (0.5, 1.0, (2.0, 1.3014076178, 17.4963494098, 9.1494504520, 4.8371488419)),
        (0.3, 0.1, (0.5, -0.0657865338, -0.4793163113, 1.6240254132, 1.5512096539)),
        (0.3, 0.1, (1.0, 0.3772614009, 0.6714572019, 2.4835246291, 2.0731514139)),
        (0.3, 0.1, (2.0, 2.0143464234, 30.4143381109, 4.3532442903, 2.8547341306)),
    ],
)
def test_reference_points(nu, work, point):
    radius, depth, force, kappa, edge = point
    law = law_of(work, nu=nu, depth=2.2)
    here, elastic = (part.at(np.array([radius])) for part in (law.branch, law.branch.relation))
    found = (here.depth, here.force, elastic.kappa, elastic.edge)
    np.testing.assert_allclose(np.ravel(found), (depth, force, kappa, edge), rtol=1e-9)


@pytest.mark.parametrize(
    ("nu", "work", "depth", "radius", "zero_load"),
    [
        (0.5, 1.0, -0.6046020656, 0.274968, 1.645373829),
        (0.3, 0.1, -0.1730811998, 0.198179, 0.871223772),
    ],
)
def test_depth_control_and_zero_load(nu, work, depth, radius, zero_load):
    law = law_of(work, nu=nu)
    assert law.pull_off_depth == pytest.approx(depth, abs=1e-10)
    assert law.pull_off().radius == pytest.approx(radius, abs=1e-6)
    assert law.zero_load_radius == pytest.approx(zero_load, rel=1e-9)


def test_a_thin_layer_approaches_two_and_three():
    def factor(nu, work):
        return law_of(work, nu=nu, solver=ul.Exact(1e-7)).pull_off_force / (np.pi * work)

    compressible = [2.0 - factor(0.3, work) for work in (1e3, 1e4)]
    assert compressible == pytest.approx([2.0 - 1.96629, 2.0 - 1.98157], abs=1e-5)
    thin = [3.0 - factor(0.5, work) for work in (1e3, 1e4, 1e5)]
    assert thin == pytest.approx([3.0 - 2.46806, 3.0 - 2.62074, 3.0 - 2.73597], abs=1e-5)
    # The rest goes with h/a_c.
    assert thin[1] / thin[2] == pytest.approx(14.7508 / 9.5484, rel=0.1)


# --- what holds for every body and tip ----------------------------------------------------------------------

TIPS = (ul.Paraboloid(1.0), ul.Sphere(8.0), ul.Cone(1.2), ul.PowerLaw(4.0, 0.5))


@pytest.mark.parametrize("ratio", [np.inf, 5.0, 0.2])
@pytest.mark.parametrize("tip", TIPS, ids=lambda tip: type(tip).__name__)
def test_identities(tip, ratio):
    law = law_of(0.05, nu=0.4, ratio=ratio, tip=tip, depth=0.3)
    a = np.linspace(0.3, 0.9, 5) * law.branch.end
    step = 1e-4 * law.branch.end
    up, down, here = (law.branch.relation.at(a + shift) for shift in (step, -step, 0.0))
    slope = ((a + step) * up.kappa - (a - step) * down.kappa) / (2.0 * step)
    np.testing.assert_allclose(slope, here.edge**2, rtol=1e-6)
    # dP_el/da = 4 theta a kappa dw_el/da
    ratio_of_slopes = (up.force - down.force) / (up.depth - down.depth)
    np.testing.assert_allclose(ratio_of_slopes, 4.0 * a * here.kappa, rtol=1e-6)
    points = [law.branch.at(a + shift) for shift in (step, -step, 0.0)]
    np.testing.assert_allclose(
        (points[0].force - points[1].force) / (2.0 * step), points[2].force_slope, rtol=1e-5
    )


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(5.0, 0.3)], ids=["rigid", "elastic"])
def test_a_layer_in_two_halves_is_the_layer(base):
    whole = ul.Scene(ul.Paraboloid(1.0), layer(0.4), base, adhesion=ul.JKR(0.3))
    half = layer(0.4, 0.5)
    halves = replace(whole, layer=half, substrate=ul.Stack([half], base=base))
    one, two = (scene.contact_law(0.5, solver=ul.Exact(1e-9)) for scene in (whole, halves))
    assert two.pull_off_force == pytest.approx(one.pull_off_force, rel=1e-8)
    assert two.pull_off_depth == pytest.approx(one.pull_off_depth, rel=1e-8)
    w = np.linspace(-0.1, 0.5, 7)
    np.testing.assert_allclose(two.force(w), one.force(w), rtol=1e-6, atol=1e-9)


def test_a_layer_that_slips_lies_between_the_bonded_one_and_none():
    """Free to slip it is softer: a smaller pull-off factor than bonded (nu = 0.5), a larger one than 3/2."""
    bonded, slipping, thick = (
        ul.Scene(ul.Paraboloid(1.0), top, ul.RIGID, adhesion=ul.JKR(1.0)).contact_law(
            0.0, solver=ul.Exact(1e-8)
        )
        for top in (layer(0.5), replace(layer(0.5), bond="slip"), layer(0.5, 1e3))
    )
    assert bonded.pull_off_force > 1.05 * slipping.pull_off_force > 1.05 * thick.pull_off_force
    a = np.array([0.5, 1.0, 1.5])
    up, down, here = (slipping.branch.relation.at(a + shift) for shift in (1e-4, -1e-4, 0.0))
    slope = ((a + 1e-4) * up.kappa - (a - 1e-4) * down.kappa) / 2e-4
    np.testing.assert_allclose(slope, here.edge**2, rtol=1e-6)


@pytest.mark.parametrize("ratio", [np.inf, 0.2])
def test_the_work_of_a_cycle_is_that_of_its_jumps(ratio):
    """Adhesion gives dgamma dA back: int P dw = int G dA along the branch, with G = dgamma, plus the elastic."""
    law = law_of(0.05, nu=0.4, ratio=ratio, depth=0.3, solver=ul.Exact(1e-8))
    w = np.linspace(0.0, 0.3, 4001)
    work = float(np.sum(0.5 * (law.force(w)[1:] + law.force(w)[:-1]) * np.diff(w)))
    ends = law.contact_radius(w[[0, -1]])

    def stored(radius, depth):
        """Elastic energy: that of the contact without adhesion at this radius, then of a punch drawn back."""
        radii = np.linspace(1e-6, radius, 4001)
        elastic = law.branch.relation.at(radii)
        energy = float(np.sum(0.5 * (elastic.force[1:] + elastic.force[:-1]) * np.diff(elastic.depth)))
        drop, stiffness = depth - elastic.depth[-1], 4.0 * radius * elastic.kappa[-1]
        return energy + elastic.force[-1] * drop + 0.5 * stiffness * drop**2

    change = stored(ends[1], w[-1]) - stored(ends[0], w[0])
    assert work == pytest.approx(change - 0.05 * np.pi * (ends[1] ** 2 - ends[0] ** 2), rel=1e-4)


def test_law_follows_its_branch_and_ends_at_the_pull_off():
    law = law_of(0.3, nu=0.45, depth=1.0, solver=ul.Exact(1e-8))
    w = np.linspace(law.pull_off_depth * 0.999, 1.0, 23)
    radius = law.contact_radius(w)
    here = law.branch.at(radius)
    np.testing.assert_allclose(here.depth, w, atol=1e-8)
    np.testing.assert_allclose(law.force(w), here.force, atol=1e-7)
    np.testing.assert_allclose(law.stiffness(w)[1:], (here.force_slope / here.depth_slope)[1:], rtol=1e-4)
    assert law.force(law.pull_off_depth - 1e-9) == 0.0
    assert law.domain == (law.pull_off_depth, 1.0)
    loads = np.linspace(-law.pull_off_force, 1.0, 9)[1:]
    np.testing.assert_allclose(law.force(law.depth(loads)), loads, atol=1e-6)
    with pytest.raises(ul.InputError, match="comes off"):
        law.depth(-1.01 * law.pull_off_force)
    with pytest.raises(ul.RangeError):
        law.force(1.1)


def test_a_measured_tip_grows_as_its_depth_says():
    """dw/da of the elastic contact, of which the slope in the work of adhesion is made, against differences.

    The derivative of a series through a tip with corners was 1e-3 off.
    """
    r = np.linspace(0.0, 2e-6, 30)
    tip, layer = ul.Profile(r, np.hypot(r, 2e-7) - 2e-7), ul.Layer(ul.Isotropic(1e5, 0.45), 1e-6)
    contact = ul.Contact.of(tip, layer, ul.RIGID)
    radius, step = np.linspace(0.15, 0.98, 21) * 1.5e-6, 1e-5
    nodes = proved_resolution(contact.kernel, 1.6, 1e-12).scaled(4.0, 1.5)

    def depth(a):
        weights = weights_over_depth(tip, tip.power_law, even_rule(nodes.radial), a)
        found = PunchSolution.solve(contact.kernel, a / 1e-6, nodes).depth_and_force(weights)
        return found[0] * tip.abel(a)

    at = [depth(radius * (1.0 + k * step)) for k in (-2, -1, 1, 2)]
    slope = (at[0] - 8.0 * at[1] + 8.0 * at[2] - at[3]) / (12.0 * step * radius)
    found = solve_relation(contact, 1.5e-6, 1e-6).at(radius)
    assert found.depth_slope == pytest.approx(slope, rel=1e-4)
    law = ul.Scene(tip, layer, ul.RIGID, adhesion=ul.JKR(1e-3)).contact_law(3e-7)
    w = np.linspace(1e-8, 2.9e-7, 9)
    a = law.contact_radius(w)
    closed = -2.0 * np.pi * 1e-3 * a / law.branch.at(a).depth_slope
    assert law.work_slope(w) == pytest.approx(closed, rel=1e-9)


def test_a_spring_pulls_off_between_depth_and_load():
    law = law_of(0.3, nu=0.45, depth=1.0)
    forces = [law.pull_off(compliance).force for compliance in (0.0, 1e-9, 0.1, 1.0, 1e6, np.inf)]
    assert (np.diff(forces) < 1e-6).all()
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)
    assert forces[4] == pytest.approx(-law.pull_off_force, rel=1e-6)
    travel = np.linspace(1.2, -1.5, 60)
    tip = law.tip_depth(travel, 0.3)
    np.testing.assert_allclose(tip + 0.3 * law.force(tip), travel, atol=1e-6)
    assert law.jump_in(0.3).depth == pytest.approx(-0.3 * law.jump_in(0.3).force, rel=1e-9)


def test_states():
    laws = {
        states: law_of(0.3, depth=1.0, branch=states) for states in ("separating", "approaching", "cycle")
    }
    way = np.concatenate((np.linspace(-0.5, 0.5, 41), np.linspace(0.49, -0.5, 40)))
    approach, withdrawal = way <= 0.5, np.arange(81) > 40
    assert approach.all()
    cycle = laws["cycle"].force(way)
    np.testing.assert_array_equal(cycle[~withdrawal], laws["approaching"].force(way[~withdrawal]))
    np.testing.assert_array_equal(cycle[withdrawal], laws["separating"].force(way[withdrawal]))
    assert (cycle[:20] == 0.0).all()
    assert cycle[41:].min() < 0.0
    with pytest.raises(ul.InputError, match="separating"):
        ul.JKR(1.0, branch="leaving")


def test_a_fold_takes_the_widest_contact_and_reports_its_jump():
    law = law_of(1e-3, nu=0.3, ratio=0.01, tip=ul.Cone(0.8), depth=10.0, solver=ul.Exact(1e-8))
    assert len(law.jumps) == 1
    jump = law.jumps[0]
    assert 0.0 < jump.inner < jump.outer
    assert "jumps at depth" in law.reason
    for side, radius in ((1e-9, jump.outer), (-1e-9, jump.inner)):
        assert law.contact_radius(jump.at + side) == pytest.approx(radius, rel=2e-3)
    # No wider contact has this depth.
    for depth in (jump.at * 0.9, jump.at * 1.1):
        wider = np.linspace(float(law.contact_radius(depth)) * 1.0001, law.branch.end, 400)
        assert (law.branch.at(wider).depth > depth).all()


def test_a_fold_under_load():
    """E2/E1 = 0.1: the load has two minima, the depth one; the tip comes off at the lower."""
    law = law_of(0.1, nu=0.3, ratio=0.1, tip=ul.Cone(0.8), depth=2.0, solver=ul.Exact(1e-8))
    assert law.jumps == ()
    first, last = law.load_path.jumps
    assert first.outer > first.inner > last.outer > last.inner == 0.0
    forces = law.branch.at(np.geomspace(law.branch.start, law.branch.end, 20001)).force
    assert law.pull_off_force == pytest.approx(-forces.min(), rel=1e-6)
    for radius in (first.outer, first.inner):
        assert law.branch.at(np.array([radius])).force[0] == pytest.approx(first.at, rel=1e-9)


# --- Maugis and Dugdale -------------------------------------------------------------------------------------


def contact_of(nu, ratio=np.inf):
    return ul.Contact.of(ul.Paraboloid(1.0), layer(nu), base_of(nu, ratio))


def test_maugis_reference():
    state = maugis_state(contact_of(0.5), 0.5, 0.6, 2.0)
    assert state.force == pytest.approx(-1.246373871238, abs=1e-12)
    assert state.depth == pytest.approx(-0.158666132691, abs=1e-12)
    assert 2.0 * state.separation == pytest.approx(0.282960578649, abs=1e-12)


@pytest.mark.parametrize(
    ("nu", "ratio", "radius"), [(0.5, np.inf, 1.0), (0.5, np.inf, 3.0), (0.3, np.inf, 1.0), (0.3, 0.1, 1.0)]
)
def test_jkr_is_the_limit_of_a_short_range(nu, ratio, radius):
    """Stresses and gaps alone against the energy release rate: the difference falls in proportion to c - a."""
    contact, shares = contact_of(nu, ratio), np.array([1e-3, 1e-4, 1e-5])
    errors = []
    for share in shares:
        stress = 1.0 / np.sqrt(share)  # the stress intensity stays
        state = maugis_state(contact, radius, radius * (1.0 + share), stress)
        branch = jkr_branch(contact, stress * state.separation, 1.0 + radius, 1e-11)
        jkr, elastic = branch.at(np.array([radius])), branch.relation.at(np.array([radius]))
        errors.append(float((state.force - jkr.force[0]) / (elastic.force - jkr.force)[0]))
    slopes = np.diff(np.log(np.abs(errors))) / np.diff(np.log(shares))
    np.testing.assert_allclose(slopes, 1.0, atol=0.01)
    assert abs(errors[-1]) < 1e-4


def test_maugis_law_and_the_ledger():
    scene = ul.Scene(ul.Paraboloid(1.0), layer(0.5), ul.RIGID, adhesion=ul.Maugis(work=1.0, range=0.02))
    near = replace(scene, adhesion=ul.JKR(1.0))
    law, jkr = scene.contact_law(0.5), near.contact_law(0.5)
    assert "(c - a)/a" in law.reason
    assert law.pull_off_force == pytest.approx(jkr.pull_off_force, rel=0.02)
    assert law.pull_off_force != jkr.pull_off_force
    w = np.array([0.0, 0.4])
    np.testing.assert_allclose(law.force(w), jkr.force(w), rtol=0.02)


# --- DMT ----------------------------------------------------------------------------------------------------


def test_dmt():
    scene = ul.Scene(ul.Paraboloid(2.0), layer(0.5), ul.RIGID, adhesion=ul.DMT(0.1))
    law, elastic = scene.contact_law(0.5), replace(scene, adhesion=None).contact_law(0.5)
    w = np.array([0.1, 0.4])
    np.testing.assert_allclose(law.force(w), elastic.force(w) - 4.0 * np.pi * 0.1, rtol=1e-12)
    np.testing.assert_array_equal(law.contact_radius(w), elastic.contact_radius(w))
    assert law.pull_off_force == pytest.approx(4.0 * np.pi * 0.1)
    assert float(law.force(law.depth(-0.5))) == pytest.approx(-0.5, rel=1e-9)
    with pytest.raises(ul.InputError, match="JKR"):
        replace(scene, indenter=ul.Cone(1.0)).contact_law(0.5)


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("work", [-1.0, 0.0, np.nan, np.inf])
def test_impossible_works(work):
    for kind in (ul.JKR, ul.DMT):
        with pytest.raises(ul.InputError, match="work of adhesion"):
            kind(work)


def test_a_formula_without_an_edge_is_refused():
    scene = ul.Scene(
        ul.Paraboloid(1e-5), ul.Layer(ul.Isotropic(1e4, 0.5), 1e-5), ul.RIGID, adhesion=ul.JKR(1e-3)
    )
    for solver in ("dimitriadis2002", "asymptotic"):
        with pytest.raises(ul.InputError, match="edge"):
            scene.contact_law(1e-6, solver=solver)
    alone = replace(scene, layer=ul.Layer(scene.layer.material), substrate=None)
    bare = scene.contact_law(1e-6, solver="halfspace")
    assert bare.pull_off_force == pytest.approx(alone.contact_law(1e-6).pull_off_force, rel=1e-9)


def test_adhesion_beyond_the_solution_is_refused():
    scene = ul.Scene(ul.Paraboloid(1.0), layer(0.5), ul.RIGID, adhesion=ul.JKR(1e9))
    with pytest.raises(ul.RangeError, match="20 thicknesses"):
        scene.contact_law(0.1)
    with pytest.raises(ul.RangeError, match="20"):
        ul.Scene(ul.FlatPunch(30.0), layer(0.5), ul.RIGID, adhesion=ul.JKR(1.0)).contact_law(0.1)


def test_the_branch_of_a_paraboloid_does_not_fold_on_a_softer_base():
    """E2/E1 = 0.1: one stable branch, of depth and of load, at every Lambda, where a cone's load has two."""
    for work in (1e-4, 1e-2, 0.1, 1.0, 10.0, 100.0):
        law = law_of(work, nu=0.3, ratio=0.1, solver=ul.Exact(1e-7))
        assert law.jumps == ()
        assert len(law.load_path.pieces) == 1, work


# --- AtomicJ's bonded incompressible layer ------------------------------------------------------------------

# Polynomials in a/h for kappa - 1 and for the share of the paraboloid, below and above 1.2: those of its class
# XiApproximationBondedIncompressibleLayer (Hermanowicz, AtomicJ 2.4.0), as numbers.
XI_ZERO = [
    Polynomial([0, 1.12729483847, 1.25347438557, 0.784557557893, -0.806650058195, 0.259925491535]),
    Polynomial([-0.322009880002, 1.9372155069, 0.854220636985, 0.147403896538]),
]
XI_TWO = [
    Polynomial([0, 1.12624783907, 1.29498838323, 0.187321789575, -0.636455484683, 0.279078209377]),
    Polynomial([-0.0494637745853, 1.59724947918, 0.638511388572, 0.0738401286106]),
]


def test_atomicj_agrees_within_its_own_tenth_of_a_per_cent():
    """Its force, P = (4/3) theta a [3 w kappa - a^2 (1 + xi_2)/R], at the radii and depths of JKR."""
    law = law_of(1.0, depth=2.5, solver=ul.Exact(1e-8))
    radius = np.linspace(0.1, 0.98 * law.branch.end, 60)
    here, elastic = law.branch.at(radius), law.branch.relation.at(radius)
    above = radius > 1.2
    xi_0, xi_2 = (np.where(above, *(part(radius) for part in pair[::-1])) for pair in (XI_ZERO, XI_TWO))
    np.testing.assert_allclose(1.0 + xi_0, elastic.kappa, rtol=1e-3)
    force = 4.0 / 3.0 * radius * (3.0 * here.depth * (1.0 + xi_0) - radius**2 * (1.0 + xi_2))
    scale = np.maximum(elastic.force, np.abs(here.force))
    assert (np.abs(force - here.force) < 1e-3 * scale).all()


@pytest.mark.parametrize(
    ("tip", "adhesion"),
    [(ul.FlatPunch(2e-6), ul.JKR(1e-4)), (ul.Paraboloid(1e-5), ul.DMT(2e-4))],
    ids=["punch", "dmt"],
)
def test_a_spring_shares_the_travel_under_tension_too(tip, adhesion):
    """w + C P(w) = s from the pull-off on: the law with the depth given is the reference."""
    scene = ul.Scene(tip, ul.Layer(ul.Isotropic(5e3, 0.45), 8e-6), ul.RIGID, adhesion=adhesion)
    law, compliance = scene.contact_law(1e-6), 10.0
    w = np.linspace(0.999 * law.pull_off_depth or 1e-12, 5e-7, 40)
    force = law.force(w)
    assert force[0] < 0.0 < force[-1]
    behind = replace(scene, instrument=ul.Instrument(compliance=compliance))
    # Two laws of a tolerance of 1e-6.
    np.testing.assert_allclose(behind.force(w + compliance * force), force, atol=1e-6 * abs(force).max())
    off = law.jump_travels(compliance)[0] - 1e-12
    assert float(behind.force(off)) == 0.0
    # A fit's own law is a scaled one.
    curve = ul.synthesize(behind, np.linspace(6e-7, -6e-7, 40), ul.Noise(force=1e-12), rng=0)
    forward = ul.Problem(behind, curve, ["layer.E", "layer.thickness", "adhesion.work"]).members[0].forward
    values = behind.parameters | {"layer.E": 7e3, "layer.thickness": 6e-6}
    moved = behind.with_values({"layer.E": 7e3, "layer.thickness": 6e-6})
    expected = moved.force(curve.depth)
    np.testing.assert_allclose(forward.reading(values).force, expected, atol=1e-5 * abs(expected).max())
