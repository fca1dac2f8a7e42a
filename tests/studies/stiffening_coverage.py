"""How often do 95 % intervals hold the small-strain modulus and the stiffening of a layer that stiffens?

    python tests/studies/stiffening_coverage.py [--right 500] [--wrong 200] [--free 20]
                                                [--output tests/studies/results/stiffening_coverage.csv]
    python tests/studies/stiffening_coverage.py --misfits

It goes on from the rows of the output file that have as many curves.

A sphere of 25 um on 3 kPa, 240 points, white noise of 0.3 % of the largest force, known inputs. Truths: a Gent
layer (the model is right, `--right` curves a cell); Ogden's energy, on a half-space from the finite elements of the
study of stiffening layers (section 2: ln(S/N)/(a/R), between exponents by a monotone cubic through alpha = 2, where
it is 0), on layers to z = 0.1 from `ogden_layers.py`; a contact made gradually, without stiffening and with
(`--wrong` curves). E, 1/Jm, contact and baseline are free; `terms` says whether the form of the energy and the
spread of heights are rows of the budget, or free too (`--free` curves). Counted are the answer's interval and, as
controls without the two terms, its statistical part, and least squares' own error bars. The scene begins with
another E than the true one. `--misfits`: what fits with the size of the form that an exponent has leave of forces
without noise, rms over the largest, and their E over the true one.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

import underlay as ul

RESULTS = Path(__file__).parent / "results"
R, E, BEGUN = 25e-6, 3e3, 2e3
POINTS, NOISE = 240, 0.003
INPUTS = dict.fromkeys(("force", "depth", "indenter.radius", "layer.nu"), 0.0)
TERMS = ("layer.stiffening.form", "layer.stiffening.height_spread")
# Ogden's exponent: ln(S/N)/(a/R) at these a/R.
WIDTHS = np.array([0.0, 0.222, 0.311, 0.432, 0.520, 0.590, 0.648, 0.697])
OGDEN = {
    -20: (0.716, 0.881, 0.931, 0.980, 1.009, 1.032, 1.054, 1.076),
    -10: (0.390, 0.447, 0.465, 0.506, 0.535, 0.560, 0.585, 0.609),
    -4: (0.195, 0.208, 0.209, 0.225, 0.238, 0.250, 0.262, 0.276),
    2: (0.0,) * 8,
    10: (-0.260, -0.206, -0.176, -0.139, -0.109, -0.082, -0.057, -0.033),
    20: (-0.586, -0.332, -0.227, -0.093, -0.005, 0.065, 0.121, 0.170),
}
HALF_SPACE = PchipInterpolator(list(OGDEN), np.array(list(OGDEN.values())))
# Size of the form for an exponent less two, to first order; and the exponents that a form of the energy stands for.
SIZE = -0.0325379
LEAST, MOST = -16.0, 20.0
# Thickness and largest depth over R, Gent's 1/Jm, spread of heights over R, Ogden.s exponent (words: any of these).
CELLS = {
    "Gent 1, half-space": (np.inf, 0.5, 1.0, 0.0, None),
    "Gent 3, half-space": (np.inf, 0.5, 3.0, 0.0, None),
    "Gent 1, h = 4 R": (4.0, 0.35, 1.0, 0.0, None),
    "gradual 0.05 R, Gent 0": (np.inf, 0.5, 0.0, 0.05, None),
    "gradual 0.05 R, Gent 1": (np.inf, 0.5, 1.0, 0.05, None),
    "gradual 0.05 R, Gent 1, h = 4 R": (4.0, 0.35, 1.0, 0.05, None),
    "Ogden -16 to 20, evenly": (np.inf, 0.5, 0.0, 0.0, "evenly"),
    "Ogden -16 to 20, normal": (np.inf, 0.5, 0.0, 0.0, "normal"),
    **{f"Ogden {n}": (np.inf, 0.5, 0.0, 0.0, n) for n in (-20, -16, -10, -4, 10, 20)},
    **{f"Ogden {n}, h = 2 R": (2.0, 0.2, 0.0, 0.0, n) for n in (-16, -10, 10, 20)},
    **{f"Ogden {n}, h = 5 R": (5.0, 0.5, 0.0, 0.0, n) for n in (-16, -10, 10, 20)},
}
RIGHT = ("Gent 1, half-space", "Gent 3, half-space", "Gent 1, h = 4 R")
FREED = ("Gent 1, half-space", "gradual 0.05 R, Gent 0", "gradual 0.05 R, Gent 1", "Ogden -16 to 20, normal")


def scene(thickness: float, stiffening: ul.Gent | None, modulus: float = E) -> ul.Scene:
    """The test."""
    layered = bool(np.isfinite(thickness))
    layer = ul.Layer(ul.Isotropic(modulus, 0.5), thickness * R, stiffening=stiffening)
    known = INPUTS | ({"layer.thickness": 0.0} if layered else {})
    return ul.Scene(ul.Sphere(R), layer, ul.RIGID if layered else None, friction="none", uncertainties=known)


def stiffened(thickness: float, depth: np.ndarray, exponent: float) -> np.ndarray:
    """Force (N) at depths (m) of an Ogden layer, (n,)."""
    if np.isfinite(thickness):
        known = pd.read_csv(RESULTS / "ogden_layers.csv")
        known = known[(known["alpha"] == exponent) & (known["h/R"] == thickness)]
        ratio = PchipInterpolator([0.0, *known["w/R"]], [1.0, *known["over the linear law"]])
        return scene(thickness, None).force(depth) * ratio(np.maximum(depth / R, 0.0))
    law = ul.contact_law(ul.Sphere(R), ul.Layer(ul.Isotropic(E, 0.5)), max_depth=depth[-1])
    wide = law.contact_radius(depth) / R
    return scene(thickness, ul.Gent(0.0)).force(depth) * np.exp(
        wide * np.interp(wide, WIDTHS, HALF_SPACE(exponent))
    )


def drawn(how: str, rng: np.random.Generator) -> float:
    """An exponent between the ends: evenly, or normal with these at two standard deviations."""
    if how == "evenly":
        return float(rng.uniform(LEAST, MOST))
    middle, deviation = 0.5 * (LEAST + MOST), 0.25 * (MOST - LEAST)
    return float(next(x for x in iter(lambda: rng.normal(middle, deviation), None) if LEAST <= x <= MOST))


def made(cell: str, seed: int, noise: float = NOISE) -> tuple[ul.Curve, float]:
    """One curve, and its largest force (N)."""
    thickness, deepest, s, spread, exponent = CELLS[cell]
    rng = np.random.default_rng(seed)
    depth = np.linspace(-0.1, deepest, POINTS) * R
    if exponent is None:
        force = scene(thickness, ul.Gent(s, height_spread=spread * R)).force(depth)
    else:
        force = stiffened(thickness, depth, drawn(exponent, rng) if isinstance(exponent, str) else exponent)
    return ul.Curve(depth, force + noise * force.max() * rng.standard_normal(POINTS)), float(force.max())


def freed(top: float) -> dict[str, tuple[float, float] | None]:
    """The free numbers of a curve whose largest force is `top` (N)."""
    return {
        "layer.E": (1e2, 1e6),
        "layer.stiffening.inverse_limit": None,
        "instrument.contact_depth": (-0.2 * R, 0.3 * R),
        "instrument.baseline": (-top, top),
    }


def intervals(cell: str, seed: int, terms: bool) -> Iterator[dict[str, object]]:
    """What one curve's fit states of E, and of 1/Jm where there is a true one."""
    curve, top = made(cell, seed)
    free = freed(top) | (dict.fromkeys(TERMS) if terms else {})
    thickness, _, s, _, exponent = CELLS[cell]
    fit = ul.fit(ul.Problem(scene(thickness, ul.Gent(0.5), BEGUN), curve, free))
    truth = {"layer.E": E} | ({"layer.stiffening.inverse_limit": s} if exponent is None and s else {})
    for name, value in truth.items():
        told = fit.answer(name)
        alone, bar = told.statistical, 1.96 * fit.stderr[name]
        yield {
            "cell": cell, "terms": "free" if terms else "rows", "curve": seed, "parameter": name,
            "value": told.value / value, "low": told.low / value, "high": told.high / value,
            "holds": told.low <= value <= told.high, "statistical holds": alone.low <= value <= alone.high,
            "bars hold": abs(fit.values[name] - value) <= bar,
        }  # fmt: skip


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Shares that hold the truth, and the median half-width over the truth."""
    rows = rows.assign(**{"half width": 0.5 * (rows["high"] - rows["low"])})
    groups = rows.groupby(["cell", "terms", "parameter"], sort=False)
    return groups.agg(
        curves=("curve", "size"),
        holds=("holds", "mean"),
        statistical=("statistical holds", "mean"),
        least_squares=("bars hold", "mean"),
        value=("value", "median"),
        half_width=("half width", "median"),
    ).reset_index()


def study(right: int, wrong: int, free: int, output: Path) -> None:
    """Run every cell that the output lacks, and write after each."""
    known = pd.read_csv(output) if output.exists() else pd.DataFrame(columns=["cell", "terms", "curves"])
    found = []
    for terms in ("rows", "free"):
        for cell in FREED if terms == "free" else CELLS:
            count = free if terms == "free" else right if cell in RIGHT else wrong
            own = known[(known["cell"] == cell) & (known["terms"] == terms) & (known["curves"] == count)]
            if own.empty:
                rows = [row for seed in range(count) for row in intervals(cell, seed, terms == "free")]
                own = summary(pd.DataFrame(rows)).round(3)
            found.append(own)
            print(own.to_string(index=False, header=False), flush=True)
            pd.concat(found).to_csv(output, index=False)


def misfits() -> None:
    """Print, for every exponent and thickness: size of the form, misfit, E over the true one, 1/Jm."""
    for cell, (thickness, *_, exponent) in CELLS.items():
        if isinstance(exponent, int):
            curve, top = made(cell, 0, noise=0.0)
            size = SIZE * (exponent - 2.0)
            posed = scene(thickness, ul.Gent(0.5, form=size), BEGUN)
            fit = ul.fit(ul.Problem(posed, curve, freed(top), ul.Noise(force=NOISE * top)))
            off = float(np.sqrt(np.mean(np.square(fit.residuals)))) / top
            stiffness = fit.values["layer.stiffening.inverse_limit"]
            print(f"{cell:20} {size:6.3f} {off:8.2g} {fit.values['layer.E'] / E:6.3f} {stiffness:8.3g}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--right", type=int, default=500)
    parser.add_argument("--wrong", type=int, default=200)
    parser.add_argument("--free", type=int, default=20)
    parser.add_argument("--output", type=Path, default=RESULTS / "stiffening_coverage.csv")
    parser.add_argument("--misfits", action="store_true")
    given = parser.parse_args()
    misfits() if given.misfits else study(given.right, given.wrong, given.free, given.output)
