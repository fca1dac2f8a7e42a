"""Factors of a layer that stiffens against finite elements of our own, at depths no fit has seen.

    python tests/studies/stiffening.py [ELEMENTS] # -> results/stiffening.csv

A true sphere of radius 1 on Gent layers; forces over the linear law of the same layer, beside N G.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

import underlay as ul
from support.finite_elements import Layer, NoEquilibriumError, Press, Tip
from underlay.mechanics.stiffening.factors import Medium, Place, crowding, gent, neo_hookean

RESULTS = Path(__file__).parent / "results" / "stiffening.csv"
# nu (0.4995 stands for 0.5), sliding, h/R, Jm.
CASES = (
    (0.4995, False, 1.2, np.inf), (0.4995, False, 1.2, 1.0), (0.4995, False, 1.2, 0.4), (0.4995, False, 3.0, 0.5),
    (0.4995, False, 3.0, 0.2), (0.4995, True, 3.0, 0.5), (0.4995, True, 1.2, 1.0), (0.4, False, 1.5, np.inf),
    (0.4, False, 1.5, 0.5), (0.35, False, 3.0, 0.3), (0.4995, False, 6.0, 0.1), (0.4995, True, 3.0, np.inf),
    (0.4995, False, 0.7, 0.5),
)  # fmt: skip
STEPS, LOOKS = 30, (8, 14, 19, 24, 29)


def rows_of(nu, sliding, h, limit, elements):
    deepest = min(0.5, 0.3 * h)
    layer = ul.Layer(ul.Isotropic(1.0, nu), h, bond="slip" if sliding else "bonded")
    law = ul.contact_law(ul.Sphere(1.0), layer, ul.RIGID, max_depth=1.01 * deepest, solver=ul.Exact(1e-7))
    width = (10.0 if sliding else 8.0) * h
    meshed = Layer(nu, h, width, finite=True, sliding=sliding, limit=limit)
    press = Press(Tip(1.0, sphere=True), meshed, float(law.contact_radius(deepest)), elements)
    found = press.load(np.linspace(0.0, deepest, STEPS + 1)[1:])
    medium = Medium(0.5 if nu == 0.4995 else nu, sliding)
    for i in LOOKS:
        if i >= len(found.depth):
            return
        w = found.depth[i : i + 1]
        a = law.contact_radius(w)
        place = Place(w, w / h, a / h, a)
        if crowding(place.z, 1.0 / limit, medium)[0] > 0.6:
            return
        N, G = neo_hookean(place, medium).value[0], gent(place, medium, 1.0 / limit)[0].value[0]
        ratio = found.force[i] / law.force(w)[0]
        yield {
            "nu": nu, "sliding": int(sliding), "h/R": h, "Jm": limit, "elements": elements, "w/R": f"{w[0]:.4g}",
            "over the linear law": f"{ratio:.5f}", "N": f"{N:.5f}", "G": f"{G:.5f}",
            "over N G": f"{ratio / (N * G):.5f}",
        }  # fmt: skip


def study(elements=10):
    rows = []
    for case in CASES:
        try:
            rows += list(rows_of(*case, int(elements)))
        except NoEquilibriumError as error:
            print(case, error, flush=True)
        for row in rows[-len(LOOKS) :]:
            print(*row.values(), flush=True)
        RESULTS.parent.mkdir(exist_ok=True)
        with RESULTS.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    study(*sys.argv[1:])
