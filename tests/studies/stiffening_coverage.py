"""How often do 95 % intervals hold the small-strain modulus and the stiffening of a layer that stiffens?

    python tests/studies/stiffening_coverage.py [--curves 20]
                                                [--output tests/studies/results/stiffening_coverage.csv]

A sphere of 25 um on 3 kPa, 240 points, white noise of 0.3 % of the largest force, known inputs. Truths: a Gent
layer (the model is right); Ogden's energy on a half-space, by finite elements (the table of section 2 of the study
of stiffening layers, ln(S/N)/(a/R)); a contact made gradually, without stiffening and with. E, 1/Jm, contact and
baseline are free; `terms` says whether the form of the energy and the spread of heights are free too, or rows of
the budget. Counted are the answer's interval and, as a control, its statistical part alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

import underlay as ul

R, E = 25e-6, 3e3
POINTS, NOISE = 240, 0.003
INPUTS = dict.fromkeys(("force", "depth", "indenter.radius", "layer.nu"), 0.0)
TERMS = ("layer.stiffening.form", "layer.stiffening.height_spread")
# Ogden's exponent: ln(S/N)/(a/R) at these a/R.
WIDTHS = np.array([0.0, 0.222, 0.311, 0.432, 0.520, 0.590, 0.648, 0.697])
OGDEN = {
    -20: (0.716, 0.881, 0.931, 0.980, 1.009, 1.032, 1.054, 1.076),
    -10: (0.390, 0.447, 0.465, 0.506, 0.535, 0.560, 0.585, 0.609),
    -4: (0.195, 0.208, 0.209, 0.225, 0.238, 0.250, 0.262, 0.276),
    10: (-0.260, -0.206, -0.176, -0.139, -0.109, -0.082, -0.057, -0.033),
}
# Thickness and largest depth over R, Gent's 1/Jm, spread of heights over R, Ogden's exponent.
CELLS = {
    "Gent 1, half-space": (np.inf, 0.5, 1.0, 0.0, None),
    "Gent 3, half-space": (np.inf, 0.5, 3.0, 0.0, None),
    "Gent 1, h = 4 R": (4.0, 0.35, 1.0, 0.0, None),
    "gradual 0.05 R, Gent 0": (np.inf, 0.5, 0.0, 0.05, None),
    "gradual 0.03 R, Gent 1": (np.inf, 0.5, 1.0, 0.03, None),
    "gradual 0.03 R, Gent 1, h = 4 R": (4.0, 0.35, 1.0, 0.03, None),
    "Ogden -4": (np.inf, 0.5, 0.0, 0.0, -4),
    "Ogden -10": (np.inf, 0.5, 0.0, 0.0, -10),
    "Ogden -20": (np.inf, 0.5, 0.0, 0.0, -20),
    "Ogden 10": (np.inf, 0.5, 0.0, 0.0, 10),
}


def scene(thickness: float, stiffening: ul.Gent | None) -> ul.Scene:
    """The test."""
    layered = bool(np.isfinite(thickness))
    layer = ul.Layer(ul.Isotropic(E, 0.5), thickness * R, stiffening=stiffening)
    known = INPUTS | ({"layer.thickness": 0.0} if layered else {})
    return ul.Scene(ul.Sphere(R), layer, ul.RIGID if layered else None, friction="none", uncertainties=known)


def made(cell: str, seed: int) -> tuple[ul.Curve, float]:
    """One curve, and its largest force (N)."""
    thickness, deepest, s, spread, exponent = CELLS[cell]
    depth = np.linspace(-0.1, deepest, POINTS) * R
    force = scene(thickness, ul.Gent(s, height_spread=spread * R)).force(depth)
    if exponent is not None:
        law = ul.contact_law(ul.Sphere(R), ul.Layer(ul.Isotropic(E, 0.5)), max_depth=depth[-1])
        wide = law.contact_radius(depth) / R
        force = force * np.exp(wide * np.interp(wide, WIDTHS, OGDEN[exponent]))
    noise = NOISE * force.max() * np.random.default_rng(seed).standard_normal(POINTS)
    return ul.Curve(depth, force + noise), float(force.max())


def intervals(cell: str, seed: int, terms: bool) -> Iterator[dict[str, object]]:
    """What one curve's fit states of E, and of 1/Jm where there is a true one."""
    curve, top = made(cell, seed)
    free = {
        "layer.E": (1e2, 1e6),
        "layer.stiffening.inverse_limit": None,
        "instrument.contact_depth": (-0.2 * R, 0.3 * R),
        "instrument.baseline": (-top, top),
    }
    thickness, _, s, _, exponent = CELLS[cell]
    posed = ul.Problem(scene(thickness, ul.Gent(0.5)), curve, free | (dict.fromkeys(TERMS) if terms else {}))
    fit = ul.fit(posed)
    truth = {"layer.E": E} | ({"layer.stiffening.inverse_limit": s} if exponent is None and s else {})
    for name, value in truth.items():
        told = fit.answer(name)
        alone = told.statistical
        yield {
            "cell": cell, "terms": "free" if terms else "rows", "curve": seed, "parameter": name,
            "value": told.value / value, "low": told.low / value, "high": told.high / value,
            "holds": told.low <= value <= told.high, "statistical holds": alone.low <= value <= alone.high,
        }  # fmt: skip


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Shares that hold the truth, and the median half-width over the truth."""
    rows = rows.assign(**{"half width": 0.5 * (rows["high"] - rows["low"])})
    groups = rows.groupby(["cell", "terms", "parameter"], sort=False)
    return groups.agg(
        curves=("curve", "size"),
        holds=("holds", "mean"),
        statistical=("statistical holds", "mean"),
        value=("value", "median"),
        half_width=("half width", "median"),
    ).reset_index()


def study(curves: int, output: Path) -> None:
    """Run every cell, and write after each."""
    rows: list[dict[str, object]] = []
    for cell in CELLS:
        for terms in (False, True):
            for seed in range(curves):
                rows += intervals(cell, seed, terms)
            found = summary(pd.DataFrame(rows))
            print(found[found["cell"] == cell].to_string(index=False, header=False), flush=True)
            found.round(3).to_csv(output, index=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--curves", type=int, default=20)
    parser.add_argument(
        "--output", type=Path, default=Path(__file__).parent / "results" / "stiffening_coverage.csv"
    )
    given = parser.parse_args()
    study(given.curves, given.output)
