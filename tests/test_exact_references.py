"""The exact law against independent solutions: twenty stored digits, and a brute-force double solution."""

import json

import mpmath as mp
import numpy as np
import pytest

import underlay as ul
from support import reference_contact
from support.laws import exact_law
from support.reference_solver import DIGITS, EXPONENTS, MATERIALS, STORED, material, solve, weighted_kernel

ROWS = json.loads(STORED.read_text(encoding="utf-8"))


def errors(law, radius, depth, force, stiffness):
    """Relative errors of force, contact radius and stiffness at one depth."""
    got = (law.force(depth), law.contact_radius(depth), law.stiffness(depth))
    return [abs(value / true - 1.0) for value, true in zip(got, (force, radius, stiffness), strict=True)]


def stored_cases():
    for row in ROWS:
        for exponent in EXPONENTS:
            yield pytest.param(row, exponent, id=f"{row['materials']}, a/h {row['eps']}, lambda {exponent}")


def folded(row, exponent):
    """Where a cone's depth is not the largest so far, or not yet passed: no single disc to compare with."""
    depths = [
        float(r[f"lambda={exponent}"][0]) * r["eps"] ** exponent
        for r in ROWS
        if r["materials"] == row["materials"]
    ]
    return depths != sorted(depths)


@pytest.mark.parametrize(("row", "exponent"), list(stored_cases()))
def test_stored_digits_are_met_at_every_tolerance(row, exponent):
    if folded(row, exponent):
        pytest.skip(
            "three discs satisfy the equations here: see test_a_folding_contact_keeps_the_larger_load"
        )
    inner, outer = (material(constants) for constants in MATERIALS[row["materials"]])
    shape, eps = ul.PowerLaw(exponent, 0.1), row["eps"]
    depth_ratio, force_ratio = (float(value) for value in row[f"lambda={exponent}"])
    depth = depth_ratio * float(shape.abel(np.array(eps)))
    scale = 4.0 * inner.theta * eps
    force, stiffness = scale * depth / depth_ratio * force_ratio, scale * float(row["kappa_inf"])
    for rtol in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10):
        # The last digits of the depth itself move the force by a few 1e-16.
        law = exact_law(shape, ul.Layer(inner, 1.0), outer, max_depth=depth * (1.0 + 1e-14), rtol=rtol)
        worst = max(errors(law, eps, depth, force, stiffness))
        assert worst <= max(rtol, 1e-11)
        assert law.error_estimate >= worst / 3.0 or worst < 1e-11


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['materials']}, a/h {row['eps']}")
def test_stored_digits_of_the_flat_punch(row):
    inner, outer = (material(constants) for constants in MATERIALS[row["materials"]])
    for rtol in (1e-2, 1e-4, 1e-6, 1e-10):
        law = exact_law(ul.FlatPunch(row["eps"]), ul.Layer(inner, 1.0), outer, max_depth=1.0, rtol=rtol)
        error = abs(law.stiffness(1.0) / (4.0 * inner.theta * row["eps"] * float(row["kappa_inf"])) - 1.0)
        assert error <= rtol
        assert law.error_estimate >= error / 3.0


def test_the_stored_digits_are_those_of_the_solver():
    row = next(row for row in ROWS if row["materials"] == "rigid nu=0.3" and row["eps"] == 0.1)
    # Fewer wavenumbers, fewer functions: what is left is the same to sixteen digits.
    with mp.workdps(DIGITS):
        again = solve(weighted_kernel(*MATERIALS["rigid nu=0.3"], 0.1, order=12), 0.1, (2.0,), 8)
    assert float(again["kappa_inf"]) == pytest.approx(float(row["kappa_inf"]), rel=1e-15)
    assert float(again["lambda=2.0"][1]) == pytest.approx(float(row["lambda=2.0"][1]), rel=1e-15)


@pytest.mark.parametrize("eps", [0.05, 1.0, 3.0, 10.0])
@pytest.mark.parametrize(
    ("inner", "outer"),
    [
        (ul.Isotropic(1.0, 0.5), ul.RIGID),
        (ul.Isotropic(1.0, 0.3), ul.Isotropic(0.05, 0.4)),
        (ul.TransverselyIsotropic(0.2, 1.0, 0.3, 0.4, 0.5), ul.Isotropic(0.05, 0.5)),
    ],
    ids=["rigid", "soft", "transversely isotropic"],
)
def test_spheres_and_wide_contacts_against_brute_force(inner, outer, eps):
    for shape in (ul.Sphere(11.0), ul.Paraboloid(20.0)):
        # Nodes of the reference resolve the kernel twice over: its own error is below 1e-10.
        contact = reference_contact.solve(shape, eps, 1.0, inner, outer, nodes=int(40 + 14 * eps))
        stiffness = 4.0 * inner.theta * eps * contact.kappa_inf
        for rtol in (1e-3, 1e-6, 1e-9):
            law = exact_law(
                shape, ul.Layer(inner, 1.0), outer, max_depth=contact.depth * (1 + 1e-13), rtol=rtol
            )
            worst = max(errors(law, eps, contact.depth, contact.force, stiffness))
            assert worst <= rtol
            assert law.error_estimate >= worst / 3.0


def test_the_published_anchor():
    # Paraboloid, nu = 0.5 on a rigid base, a/h = 1.
    shape, layer = ul.Paraboloid(3.0), ul.Isotropic(2.0, 0.5)
    depth = 1.118830971125 * shape.coefficient
    law = exact_law(shape, ul.Layer(layer, 1.0), ul.RIGID, max_depth=depth, rtol=1e-10)
    # The anchor has thirteen digits, half a unit in the last of which is 5e-13.
    assert law.contact_radius(depth) == pytest.approx(1.0, rel=2e-11)
    assert law.force(depth) == pytest.approx(7.522667596682 * layer.theta * shape.coefficient, rel=2e-11)


@pytest.mark.parametrize(
    ("eps", "kappa"),
    [(0.2, 1.28064), (0.4, 1.68372), (0.6, 2.21289), (0.8, 2.86024), (1, 3.61874), (2, 9.14945)],
)
def test_the_flat_punch_table(eps, kappa):
    law = exact_law(ul.FlatPunch(eps), ul.Layer(ul.Isotropic(1.0, 0.5), 1.0), ul.RIGID, max_depth=1.0)
    assert law.stiffness(1.0) / (4.0 * ul.Isotropic(1.0, 0.5).theta * eps) == pytest.approx(kappa, abs=6e-6)


def test_a_cone_is_a_power_law_of_one():
    layer = ul.Layer(ul.Isotropic(1.0, 0.5), 1.0)
    cone = ul.Cone(1.2)
    w = np.array([0.05, 0.4])
    same = ul.PowerLaw(1.0, cone.coefficient)
    one, two = (exact_law(shape, layer, ul.RIGID, max_depth=0.4).force(w) for shape in (cone, same))
    np.testing.assert_array_equal(one, two)
