"""A sphere of radius 1 on layers of Ogden's energies by finite elements of our own, to a tenth of the thickness.

    python tests/studies/ogden_layers.py # -> results/ogden_layers.csv

Forces over the linear law of the same layer (nu 0.4995, bonded): the truths of `stiffening_coverage.py` on layers.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

import underlay as ul
from support.finite_elements import Layer, NoEquilibriumError, Press, Tip

RESULTS = Path(__file__).parent / "results" / "ogden_layers.csv"
NU, THICKNESSES, EXPONENTS = 0.4995, (2.0, 5.0), (-16.0, -10.0, 10.0, 20.0)
DEEPEST = 0.1  # of the thickness
MESHES = (
    (12, 24),
    (16, 32),
)  # elements under the contact, steps; the finer where the first does not get through


def rows_of(h, exponent):
    layer = ul.Layer(ul.Isotropic(1.0, NU), h)
    law = ul.contact_law(ul.Sphere(1.0), layer, ul.RIGID, max_depth=1.01 * DEEPEST * h, solver=ul.Exact(1e-7))
    found = None
    for elements, steps in MESHES:
        meshed = Layer(NU, h, 8.0 * h, finite=True, exponent=exponent)
        press = Press(Tip(1.0, sphere=True), meshed, float(law.contact_radius(DEEPEST * h)), elements)
        depths = np.linspace(0.0, DEEPEST * h, steps + 1)[1:]
        try:
            found = press.load(depths)
        except NoEquilibriumError as error:
            print(h, exponent, elements, error, flush=True)
            continue
        if len(found.depth) == steps:
            break
    for w, force in zip(found.depth, found.force, strict=True) if found is not None else ():
        ratio = force / law.force(w)
        yield {"alpha": exponent, "h/R": h, "w/R": f"{w:.5g}", "over the linear law": f"{ratio:.5f}"}


def study():
    rows = []
    for h in THICKNESSES:
        for exponent in EXPONENTS:
            rows += rows_of(h, exponent)
            print(*rows[-1].values(), flush=True)
            with RESULTS.open("w", newline="") as file:
                writer = csv.DictWriter(file, rows[0])
                writer.writeheader()
                writer.writerows(rows)


if __name__ == "__main__":
    study()
