"""Tables of master curves over the modulus ratio: as accurate as they claim, and functions of the ratio alone."""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.laws import exact_law
from underlay.mechanics.exact.curve_family import (
    Cell,
    IsotropicPair,
    curve_family,
    range_number,
    ratio_number,
)
from underlay.mechanics.exact.table_laws import side_by_side, tabulated_law

TIPS = {
    "paraboloid": ul.Paraboloid(2e-4),
    "cone": ul.Cone(np.deg2rad(70.0)),
    "quartic": ul.PowerLaw(4.0, 1e9),
}
THICKNESS = 3e-4


def pair(tip, ratio, varpi, rtol, *, layer_nu=0.45, base_nu=0.3, reference_rtol=1e-10):
    """The law from a table and the exact law of the same scene, solved for itself."""
    layer, base = (
        ul.Layer(ul.Isotropic(1e6, layer_nu), THICKNESS),
        ul.RIGID if ratio is None else ul.Isotropic(ratio * 1e6, base_nu),
    )
    deepest = float(tip.abel(np.array([varpi * THICKNESS]))[0])
    family = None if ratio is None else IsotropicPair(layer_nu, base_nu)
    law = tabulated_law(ul.Contact.of(tip, layer, base), family, ratio or np.inf, deepest, rtol)
    depth = np.linspace(0.01, 1.0, 50) * deepest
    return law, exact_law(tip, layer, base, max_depth=depth[-1], rtol=reference_rtol), depth


@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("ratio", [0.01, 0.3, 1.0, 3.0, 50.0, 2000.0, None])
@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_a_table_keeps_the_error_it_claims(tip, ratio, rtol):
    law, solved, depth = pair(tip, ratio, 1.1, rtol)
    assert law.error_estimate <= rtol
    for asked in ("force", "stiffness", "contact_radius"):
        error = np.abs(getattr(law, asked)(depth) / getattr(solved, asked)(depth) - 1.0).max()
        # 1e-10 is what the reference may be off by.
        assert error <= law.error_estimate + 1e-10


@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0, 300.0])
@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_the_derivative_in_the_ratio_is_that_of_the_force(ratio, nu):
    tip = TIPS["paraboloid"]
    law, _, depth = pair(tip, ratio, 1.1, 1e-6, layer_nu=nu)
    step = 1e-3
    up, down = (pair(tip, ratio * np.exp(s), 1.1, 1e-6, layer_nu=nu)[1].force(depth) for s in (step, -step))
    central = (up - down) / (2.0 * step)
    # A central difference is off by step^2/6 of a third derivative of order one, and the reference's own error
    # of 1e-10 enters with 1e-7; the slope of a series may be off by terms^2 (at most 64) times its own error.
    error = np.abs(law.with_slopes(depth)[2][0] - central) / law.force(depth)
    assert error.max() < 1e-6 / 6.0 + 1e-7 + 64e-6


def test_a_wide_cell_comes_in_pieces_and_keeps_its_promise():
    law, solved, depth = pair(TIPS["paraboloid"], 0.05, 5.0, 1e-6)
    assert len(law.curve.edges) > 2
    assert np.abs(law.force(depth) / solved.force(depth) - 1.0).max() <= law.error_estimate + 1e-10
    up, down = (pair(TIPS["paraboloid"], 0.05 * np.exp(s), 5.0, 1e-6)[1].force(depth) for s in (1e-3, -1e-3))
    error = np.abs(law.with_slopes(depth)[2][0] - (up - down) / 2e-3) / law.force(depth)
    assert error.max() < 1e-6 / 6.0 + 1e-7 + 64e-6  # as above


def test_neighbouring_cells_agree_on_their_common_edge():
    cell = Cell(2.0, IsotropicPair(0.45, 0.3), ratio_number(3.0), range_number(1.0), 1e-6)
    varpi = np.linspace(0.0, cell.top, 30)
    edge = cell.log_ratios[1]
    here, there = (curve_family(c).curve(edge) for c in (cell, cell._replace(ratio=cell.ratio + 1)))
    for which in range(3):
        assert np.abs(here.logarithm(which, varpi) - there.logarithm(which, varpi)).max() < 2e-6


def test_every_ratio_and_range_has_a_cell_that_holds_it():
    rng = np.random.default_rng(0)
    for ratio, varpi in zip(10.0 ** rng.uniform(-8, 8, 500), 10.0 ** rng.uniform(-6, 1, 500), strict=True):
        cell = Cell(2.0, IsotropicPair(0.5, 0.5), ratio_number(ratio), range_number(varpi), 1e-4)
        low, high = cell.log_ratios
        assert low <= np.log(ratio) <= high
        assert varpi <= cell.top
        assert cell.top <= 2.0 * varpi or cell.range == range_number(0.0)


def test_another_cell_s_ratio_is_refused():
    family = curve_family(Cell(2.0, IsotropicPair(0.45, 0.3), ratio_number(3.0), range_number(1.0), 1e-4))
    with pytest.raises(ul.RangeError, match="ask the cell that holds them"):
        family.curve(np.log(300.0))


def test_where_the_contact_is_too_wide_there_is_no_table():
    assert (
        curve_family(Cell(2.0, IsotropicPair(0.5, 0.3), ratio_number(1e3), range_number(18.0), 1e-4)) is None
    )
    contact = ul.Contact.of(TIPS["paraboloid"], ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3), ul.RIGID)
    too_deep = float(contact.indenter.abel(np.array(18e-3)))
    assert tabulated_law(contact, None, np.inf, too_deep, 1e-4) is None


def test_a_rigid_base_has_one_curve_for_every_modulus_thickness_and_radius():
    laws = [
        tabulated_law(
            ul.Contact.of(ul.Paraboloid(radius), ul.Layer(ul.Isotropic(E, 0.5), h), ul.RIGID),
            None,
            np.inf,
            float(ul.Paraboloid(radius).abel(np.array(8.0 * h))),
            1e-6,
        )
        for radius, E, h in ((1e-3, 1e6, 1e-3), (1e-5, 5e2, 3e-6))
    ]
    assert laws[0].curve is laws[1].curve


def test_no_table_understates_its_error():
    rng = np.random.default_rng(5)
    for _ in range(40):
        tip = ul.PowerLaw(float(rng.choice([1.0, 2.0, 4.0])), 1e3)
        law, solved, depth = pair(
            tip,
            10.0 ** rng.uniform(-4.0, 5.0),
            10.0 ** rng.uniform(-2.0, 0.6),
            1e-4,
            layer_nu=float(rng.choice([0.0, 0.3, 0.5])),
            base_nu=float(rng.choice([0.2, 0.5])),
            reference_rtol=1e-7,
        )
        assert np.abs(law.force(depth) / solved.force(depth) - 1.0).max() <= law.error_estimate + 1e-7


@pytest.mark.parametrize("ratio", [0.02, 0.2, 10.0, 100.0])
def test_a_law_solved_alone_is_that_of_the_table(ratio):
    tip = TIPS["paraboloid"]
    table, _, depth = pair(tip, ratio, 1.1, 1e-5)
    contact = ul.Contact.of(tip, ul.Layer(ul.Isotropic(1e6, 0.45), THICKNESS), ul.Isotropic(ratio * 1e6, 0.3))
    alone = tabulated_law(contact, IsotropicPair(0.45, 0.3), ratio, float(depth[-1]), 1e-5, alone=True)
    assert (alone.known_slopes, table.known_slopes) == (0, 1)
    assert alone.max_depth == table.max_depth
    for asked in ("force", "stiffness"):
        both = getattr(alone, asked)(depth), getattr(table, asked)(depth)
        np.testing.assert_allclose(*both, rtol=alone.error_estimate + table.error_estimate)
    # Side by side in one call they are what they are one by one.
    # Next to one of another stretched variable, and next to itself, which shares it.
    for other in (0.2 * ratio, ratio):
        together = side_by_side(contact, IsotropicPair(0.45, 0.3), [ratio, other], float(depth[-1]), 1e-5)
        for asked in (depth[None], np.stack((depth, 0.5 * depth))):
            np.testing.assert_allclose(together(asked)[0], alone.force(depth), rtol=1e-12)


@pytest.mark.parametrize("base", [ul.RIGID, ul.Isotropic(3e6, 0.3)], ids=["rigid", "elastic"])
def test_a_kept_law_is_the_law_of_its_contact_and_is_solved_once(base):
    contact = ul.Contact.of(TIPS["paraboloid"], ul.Layer(ul.Isotropic(1e6, 0.45), THICKNESS), base)
    depth = np.linspace(0.0, 1.0, 50) * 2e-4
    kept, own = ul.Auto(1e-3).kept_law(contact, depth[-1]), ul.Exact(1e-9).law(contact, depth[-1])
    error = np.abs(kept.force(depth[1:]) / own.force(depth[1:]) - 1.0).max()
    assert error <= kept.error_estimate + own.error_estimate
    stiffer = ul.Contact.of(TIPS["paraboloid"], ul.Layer(ul.Isotropic(2e6, 0.45), THICKNESS), base)
    if base is ul.RIGID:
        assert ul.Auto(1e-3).kept_law(stiffer, depth[-1]).curve is kept.curve


def test_no_law_is_kept_of_a_tip_that_is_no_power_law_nor_of_one_that_sticks():
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), THICKNESS)
    for tip, changes in ((ul.Sphere(2e-4), {}), (TIPS["cone"], {"friction": "stuck"})):
        contact = replace(ul.Contact.of(tip, layer, ul.RIGID), **changes)
        assert ul.Auto().kept_law(contact, 1e-5) is None
