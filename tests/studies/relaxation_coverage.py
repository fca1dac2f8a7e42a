"""How often do 95 % intervals hold the truth of a layer that relaxes?

    python tests/studies/relaxation_coverage.py [--curves 500]
                                                [--output tests/studies/results/relaxation_coverage.csv]

A paraboloid goes half of the thickness of a layer on a rigid base deep in contact radius, within the relaxation
time, rests for six of them and goes back: loading, hold and unloading are fitted together. The layer is a standard
linear solid; E at once, thickness, contact point, relaxing fraction and time are free and begin from the data and
from wrong values, the noise is white and stated. Counted are the intervals that `Fit.interval` states; those of
the moduli at once and at equilibrium are derived.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import underlay as ul

SCENE = ul.Scene(
    ul.Paraboloid(1e-3),
    ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=ul.Prony((0.6,), (2.0,))),
    ul.RIGID,
)
TIME = np.linspace(0.0, 16.0, 240)
DEPTH = np.interp(TIME, (0.0, 2.0, 14.0, 16.0), (-2e-5, 2e-4, 2e-4, -2e-5))
NOISE = ul.Noise(force=0.005 * float(SCENE.force(DEPTH, TIME).max()))
FREE = {
    "layer.E": (1e4, 1e8),
    "layer.thickness": (2e-4, 1e-2),
    "instrument.contact_depth": (-1e-4, 1e-4),
    "layer.relaxation.fractions[0]": (0.0, 1.0),
    "layer.relaxation.times[0]": (0.1, 16.0),
}
START = SCENE.with_values(
    {"layer.E": 3e5, "layer.relaxation.fractions[0]": 0.3, "layer.relaxation.times[0]": 5.0}
)
DERIVED = {"layer.equilibrium_modulus": 4e5}


def intervals(seed):
    """What one curve's fit states: truth inside, by name, and the interval's half-width over the truth."""
    curve = ul.synthesize(SCENE, DEPTH, NOISE, rng=seed, time=TIME)
    fit = ul.fit(ul.Problem(START, curve, FREE, NOISE))
    truth = {name: SCENE.parameters[name] for name in FREE} | DERIVED
    for name, value in truth.items():
        told = fit.interval(name, part="statistical")
        yield {
            "curve": seed,
            "parameter": name,
            "inside": told.low <= value <= told.high,
            "half width": 0.5 * (told.high - told.low),
        }


def run(curves, first=0):
    """One row per parameter: coverage (%), its standard error, and the median half-width (SI)."""
    rows = pd.DataFrame(row for seed in range(first, first + curves) for row in intervals(seed))
    found = rows.groupby("parameter", sort=False).agg(
        coverage=("inside", "mean"), half_width=("half width", "median")
    )
    found["coverage"] *= 100.0
    found["standard_error"] = np.sqrt(found["coverage"] * (100.0 - found["coverage"]) / curves)
    return found.assign(curves=curves).round({"coverage": 2, "standard_error": 2})


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--curves", type=int, default=500)
    here = Path(__file__).parent / "results" / "relaxation_coverage.csv"
    options.add_argument("--output", type=Path, default=here)
    asked = options.parse_args()
    table = run(asked.curves)
    table.to_csv(asked.output)
    print(table.to_string())


if __name__ == "__main__":
    main()
