"""The asymptotic law against the exact contact problem: which form holds where, orders, error estimate."""

import sys

import numpy as np
import pytest

import underlay as ul
from support.laws import asymptotic_law, exact_law
from support.pairs import FORMS, PAIRS, PARABOLOID, SHAPES
from support.reference_contact import solve

# Relative error of the force at a/h = 0.2, 0.6, 1; None where the form has no root.
HARD_CASES = {
    "rigid nu=.5": [(4e-5, 1e-2, 7e-2), (1.6e-4, 2e-2, 1e-2), (2.2e-4, 7e-2, 0.43)],
    "0.5": [(8e-5, 2e-2, 0.21), (5e-5, 1e-2, None), (4e-5, 6e-3, 6e-2)],
    "0.1": [(5.0, 2.5e3, 2.7e4), (1.3e-4, None, None), (6e-5, 3e-3, 1.3e-2)],
    "0.001": [(2e10, 2.1e13, 1.3e14), (4e-5, None, None), (3e-6, 1e-3, 6e-3)],
}


@pytest.mark.parametrize("pair", HARD_CASES)
def test_which_form_holds_where(pair):
    layer, substrate = PAIRS[pair]
    lines = [f"E2/E1 {pair}: error of the force at a/h = 0.2, 0.6, 1"]
    for form, expected in zip(FORMS, HARD_CASES[pair], strict=True):
        row = []
        for eps, wanted in zip((0.2, 0.6, 1.0), expected, strict=True):
            exact = solve(PARABOLOID, eps, 1.0, layer.material, substrate)
            if wanted is None:
                with pytest.raises(ul.RangeError):
                    asymptotic_law(PARABOLOID, layer, substrate, exact.depth, form=form)
                row.append("no root")
                continue
            law = asymptotic_law(PARABOLOID, layer, substrate, exact.depth, form=form)
            error = abs(law.force(exact.depth) / exact.force - 1.0)
            row.append(f"{error:.1e}")
            assert error == pytest.approx(wanted, rel=0.25)  # the numbers above have one or two digits
        lines.append(f"  {form:11s}" + "".join(f"{entry:>10s}" for entry in row))
    sys.stdout.write("\n" + "\n".join(lines) + "\n")


# The orders drop what the series do not have: the compliance form has no even terms but the zeroth, the
# parametric form no second one.
ERROR_ORDER = {"explicit": (1, 2, 3, 4, 5), "parametric": (1, 3, 3, 4, 5), "compliance": (1, 3, 3, 5, 5)}


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize(
    ("shape", "form"),
    [*(("paraboloid", form) for form in FORMS), *(("sphere", form) for form in FORMS[1:])],
)
@pytest.mark.parametrize("pair", ["rigid nu=.3", "0.5"])
def test_the_error_falls_as_the_order_says(pair, shape, form, order):
    layer, substrate = PAIRS[pair]
    indenter = SHAPES[shape]
    # So small because the explicit series has fourth-order terms that nearly cancel for some materials.
    eps = np.geomspace(0.01, 0.03, 4)
    cases = [solve(indenter, e, 1.0, layer.material, substrate) for e in eps]
    law = asymptotic_law(indenter, layer, substrate, cases[-1].depth, order=order, form=form)
    errors = [abs(law.force(case.depth) / case.force - 1.0) for case in cases]
    slope = np.polyfit(np.log(eps), np.log(errors), 1)[0]
    # The term after the leading one may be ten times larger: 10 eps, 0.3 of an order.
    assert slope == pytest.approx(ERROR_ORDER[form][order], abs=0.3)


@pytest.mark.parametrize("pair", ["rigid nu=.5", "0.1"])
def test_the_exact_law_confirms_the_fourth_order(pair):
    layer, substrate = PAIRS[pair]
    depth = PARABOLOID.abel(np.geomspace(0.03, 0.12, 8)) * (1.0 if pair != "0.1" else 1.4)
    exact = exact_law(PARABOLOID, layer, substrate, max_depth=depth[-1], rtol=1e-11)
    law = asymptotic_law(PARABOLOID, layer, substrate, depth[-1], form="compliance")
    eps = exact.contact_radius(depth)
    error = np.abs(law.force(depth) / exact.force(depth) - 1.0)
    assert np.polyfit(np.log(eps), np.log(error), 1)[0] == pytest.approx(5.0, abs=0.4)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("shape", SHAPES)
def test_the_error_estimate_is_honest(shape, pair):
    """Never below 0.4 of the error up to a/h = 1, and within 5 times it in most cases."""
    layer, substrate = PAIRS[pair]
    indenter = SHAPES[shape]
    radii = np.array([0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
    deepest = solve(indenter, 1.0, 1.0, layer.material, substrate, nodes=20).depth
    exact = exact_law(indenter, layer, substrate, max_depth=deepest, rtol=1e-9)
    grid = np.linspace(0.0, deepest, 3001)[1:]
    ratios = []
    for depth in np.interp(radii, exact.contact_radius(grid), grid):
        below = depth * np.linspace(0.1, 1.0, 40)
        for form in FORMS[1:] if shape == "sphere" else FORMS:
            for order in range(5):
                try:
                    law = asymptotic_law(indenter, layer, substrate, depth, order=order, form=form)
                except ul.RangeError:
                    continue
                error = np.abs(law.force(below) / exact.force(below) - 1.0).max()
                if error > 1e-8:  # ten times the reference's own
                    ratios.append(law.error_estimate / error)
    assert min(ratios) > 0.4
    assert np.percentile(ratios, 70) < 5.0


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("form", FORMS)
def test_the_error_estimate_of_a_flat_punch_is_honest(form, pair):
    layer, substrate = PAIRS[pair]
    for radius in (0.1, 0.3, 0.6, 1.0):
        for order in range(5):
            try:
                law = asymptotic_law(ul.FlatPunch(radius), layer, substrate, 0.1, order=order, form=form)
            except ul.RangeError:
                continue
            exact = solve(ul.FlatPunch(radius), radius, 1.0, layer.material, substrate, nodes=20).kappa_inf
            error = abs(law.series.kappa / exact - 1.0)
            assert law.error_estimate > 0.5 * error
            assert law.stiffness(0.1) == 4.0 * layer.material.theta * radius * law.series.kappa
            assert law.contact_radius(0.1) == radius
