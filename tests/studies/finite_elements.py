"""Our laws against finite elements of our own, and the curves of large strains that coverage is measured on.

    python tests/studies/finite_elements.py check     # -> results/finite_elements.csv
    python tests/studies/finite_elements.py curves NU # -> results/finite_element_curves_NU.csv, NU 0.3 or 0.49

`check`: Hertz, one layer without friction, one with a tip that sticks, one neo-Hookean, each on two meshes, over
the law that is to be met (of the neo-Hookean layer: the linear law times `finite_strain_excess` and one).
`curves`: a true sphere on a neo-Hookean layer, sliding and sticking; forces over E h^2.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

import underlay as ul
from support.finite_elements import Layer, Press, Tip
from underlay.mechanics.discrepancy import finite_strain_excess

RESULTS = Path(__file__).parent / "results"
MESHES = (8, 16)
STEPS = 12
# Poisson's ratio, h/R and largest w/h of the curves: the whole, and the first quarter on elements half as wide.
# Under a contact of few elements the force is off by per cents.
CURVES = [
    (nu, ratio, share * deepest)
    for nu in (0.3, 0.49)
    for ratio, deepest in ((0.5, 0.3), (1.0, 0.3), (2.0, 0.25))
    for share in (1.0, 0.25)
]
# The finest that reaches the depth: at nu = 0.49 elements turn inside out beside the tip, on fine meshes first.
CURVE_MESHES, CURVE_STEPS = (12, 8), 30


def law(tip, nu, deepest, *, thickness=1.0, friction="none"):
    base = ul.RIGID if np.isfinite(thickness) else None
    layer = ul.Layer(ul.Isotropic(1.0, nu), thickness)
    return ul.contact_law(tip, layer, base, max_depth=deepest, friction=friction)


def check():
    rows = []
    for name, nu, tip, deepest, options in (
        ("Hertz", 0.3, ul.Paraboloid(10.0), 1e-4, {}),
        ("layer", 0.3, ul.Paraboloid(10.0), 0.07, {}),
        ("layer", 0.45, ul.Paraboloid(10.0), 0.06, {}),
        ("stuck layer", 0.45, ul.Paraboloid(10.0), 0.06, {"stuck": True}),
        ("stuck layer", 0.49, ul.Paraboloid(10.0), 0.06, {"stuck": True}),
        ("neo-Hookean layer", 0.3, ul.Sphere(1.0), 0.3, {"finite": True}),
        ("neo-Hookean layer", 0.49, ul.Sphere(1.0), 0.3, {"finite": True}),
    ):
        for mesh in MESHES:
            rows += _checked(name, nu, tip, deepest, mesh, **options)
            _write("finite_elements.csv", rows)


def _checked(name, nu, tip, deepest, mesh, *, stuck=False, finite=False):
    ours = law(tip, nu, deepest, friction="stuck" if stuck else "none")
    thick = 1.0
    width = 8.0
    if name == "Hertz":
        # A contact of 0.03 h: the layer's share of the law is 3 %.
        width = 1.3
    wide = float(ours.contact_radius(deepest))
    steps = STEPS * mesh // MESHES[0]
    depth = np.linspace(0.0, deepest, steps + 1)[1:]
    layer = Layer(nu, thick, width, finite=finite)
    found = Press(Tip(tip.radius, isinstance(tip, ul.Sphere)), layer, wide, mesh, stuck=stuck).load(depth)
    expected = ours.force(depth)
    if finite:
        contact = ul.Contact.of(tip, ul.Layer(ul.Isotropic(1.0, nu), 1.0), ul.RIGID)
        expected = expected * (1.0 + finite_strain_excess(contact, depth, ours.contact_radius(depth)))
    rows = []
    for share in (1.0 / 3.0, 2.0 / 3.0, 1.0):
        i = round(share * steps) - 1
        rows.append(
            {
                "case": name, "nu": nu, "elements": mesh, "steps": steps,
                "w/h": f"{depth[i]:.4g}", "a/h": f"{float(ours.contact_radius(depth[i])):.4g}",
                "over the linear law": f"{found.force[i] / law(tip, nu, deepest).force(depth[i]):.5f}",
                "over ours": f"{found.force[i] / expected[i]:.5f}",
            }
        )  # fmt: skip
        print(rows[-1], flush=True)
    return rows


def curves(given):
    """Make those of a Poisson's ratio that are not stored yet."""
    path = RESULTS / f"finite_element_curves_{given}.csv"
    rows = list(csv.DictReader(path.open())) if path.exists() else []
    stored = {(float(row["h/R"]), float(row["to w/h"]), int(row["stuck"])) for row in rows}
    for nu, ratio, deepest in [curve for curve in CURVES if curve[0] == float(given)]:
        tip = ul.Sphere(1.0 / ratio)
        wide = float(law(tip, nu, deepest).contact_radius(deepest))
        depth = np.linspace(0.0, deepest, CURVE_STEPS + 1)[1:]
        for stuck in (False, True):
            if (ratio, float(f"{deepest:.6g}"), int(stuck)) in stored:
                continue
            found, mesh = farthest(tip, nu, wide, depth, stuck=stuck)
            print(nu, ratio, stuck, found.force / law(tip, nu, deepest).force(found.depth), flush=True)
            rows += [
                {
                    "nu": nu,
                    "h/R": ratio,
                    "stuck": int(stuck),
                    "to w/h": f"{deepest:.6g}",
                    "elements": mesh,
                    "w/h": f"{w:.6g}",
                    "P/(E h^2)": f"{P:.8g}",
                }
                for w, P in zip(found.depth, found.force, strict=True)
            ]
            _write(path.name, rows)


def farthest(tip, nu, wide, depth, *, stuck):
    """The curve on the finest mesh that goes to the end, or on the one that goes farthest; and that mesh."""
    tried = []
    for mesh in CURVE_MESHES:
        layer = Layer(nu, width=6.0, finite=True)
        found = Press(Tip(tip.radius, sphere=True), layer, wide, mesh, stuck=stuck).load(depth)
        tried.append((len(found.depth), mesh, found))
        if len(found.depth) == len(depth):
            break
    _, mesh, found = max(tried, key=lambda entry: entry[:2])
    return found, mesh


def _write(name, rows):
    with (RESULTS / name).open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    {"check": check, "curves": curves}[sys.argv[1]](*sys.argv[2:])
