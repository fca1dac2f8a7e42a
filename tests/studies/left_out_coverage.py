"""Do the intervals hold the truth of a layer in large strains, or under a tip that sticks?

    python tests/studies/left_out_coverage.py NU [seeds]    # -> results/left_out_coverage_NU.csv
    python tests/studies/left_out_coverage.py NU seeds stated    # -> results/left_out_coverage_NU_stated.csv

Curves of finite elements (`finite_elements.py curves NU`: a true sphere on a neo-Hookean layer bonded to a rigid
base, sliding and sticking), their ratio to the linear law smoothed over the meshes, with white noise of 0.3 % of
the peak of unknown size; modulus, thickness, contact point and baseline free, fitted by the law of small strains
without friction. `effect` is that ratio less one at the deepest point. With the
noise stated the statistical part is that of white noise, the control. Inputs are taken for exact, so that the
systematic part holds what the model leaves out and nothing else.
"""

from __future__ import annotations

import csv
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

import underlay as ul

RESULTS = Path(__file__).parent / "results"
E, THICKNESS, NOISE, POINTS = 1e6, 1e-3, 0.003, 240
DEPTHS = (0.1, 0.2, 0.3)
FREE = ("layer.E", "layer.thickness")
EXACT = {"indenter.radius": 0.0, "layer.nu": 0.0, "force": 0.0, "depth": 0.0}


def main(given, seeds=20, noise="unknown"):
    """Fit the cells of a Poisson's ratio that are not stored yet."""
    table = pd.read_csv(RESULTS / f"finite_element_curves_{given}.csv")
    stated = noise == "stated"
    path = RESULTS / f"left_out_coverage_{given}{'_stated' if stated else ''}.csv"
    rows = list(csv.DictReader(path.open())) if path.exists() else []
    known = {(float(row["h/R"]), int(row["stuck"]), row["w/h"]) for row in rows}
    for (nu, ratio, stuck), own in table.groupby(["nu", "h/R", "stuck"]):
        scene = ul.Scene(
            ul.Sphere(THICKNESS / ratio),
            ul.Layer(ul.Isotropic(E, nu), THICKNESS),
            ul.RIGID,
            uncertainties=EXACT,
        )
        last = float(own["w/h"].max())
        for deepest in sorted({min(depth, last) for depth in DEPTHS}):
            if (ratio, stuck, f"{deepest:.3g}") in known:
                continue
            rows.append(
                {"nu": nu, "h/R": ratio, "w/h": f"{deepest:.3g}", "stuck": stuck, "seeds": int(seeds)}
                | _cell(scene, own, deepest * THICKNESS, int(seeds), stated=stated)
            )
            print(rows[-1], flush=True)
            with path.open("w", newline="") as file:
                writer = csv.DictWriter(file, rows[0])
                writer.writeheader()
                writer.writerows(rows)


def _cell(scene, own, deepest, seeds, *, stated):
    depth = np.linspace(-0.4 * deepest, deepest, POINTS)
    force = _force(scene, own, depth)
    effect = force[-1] / scene.force(deepest) - 1.0
    counts, widths, size = {}, [], NOISE * force.max()
    for seed in range(seeds):
        scatter = size * np.random.default_rng(seed).standard_normal(POINTS)
        curve = ul.Curve.from_frame(pd.DataFrame({"depth": depth, "force": force + scatter}))
        free = dict.fromkeys((*FREE, "instrument.contact_depth", "instrument.baseline"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            noise = ul.Noise(force=float(size)) if stated else None
            fit = ul.fit(ul.Problem(scene, curve, free, noise))
            for part in ("statistical", "combined"):
                for path in FREE:
                    known = fit.interval(path, part=part)
                    key = f"{path} {part}"
                    counts[key] = counts.get(key, 0) + (scene.parameters[path] in known)
                    widths += [(key, np.log(known.high / known.low))] if known.low > 0.0 else [(key, np.inf)]
    shares = {key: f"{count / seeds:.2f}" for key, count in counts.items()}
    medians = {f"width of {key}": f"{np.median([w for k, w in widths if k == key]):.3f}" for key in counts}
    return {"effect": f"{effect:.3f}"} | shares | medians


def _force(scene, own, depth):
    """Forces (N) at depths (m): the linear law times a smooth ratio, which is one at contact.

    The more elements lie under the contact the more a force weighs: its error falls at least as their number.
    """
    known = own["w/h"].to_numpy() * THICKNESS
    law = scene.contact_law(float(max(own["to w/h"].max() * THICKNESS, depth.max())))
    ratio = own["P/(E h^2)"].to_numpy() * E * THICKNESS**2 / law.force(known)
    wide = law.contact_radius(known) / law.contact_radius(own["to w/h"].to_numpy() * THICKNESS)
    weights = own["elements"].to_numpy() * wide
    powers = np.arange(1, 5)
    root = np.sqrt(known / known.max())[:, None] ** powers
    fitted = np.linalg.lstsq(root * weights[:, None], (ratio - 1.0) * weights, rcond=None)[0]
    inside = np.maximum(depth, 0.0)
    return law.force(inside) * (1.0 + np.sqrt(inside / known.max())[:, None] ** powers @ fitted)


if __name__ == "__main__":
    main(*sys.argv[1:])
