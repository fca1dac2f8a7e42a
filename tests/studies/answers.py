"""Do answers hold the truth, and how wide are they? Worlds of noise, random scenes, and false verdicts.

    python tests/studies/answers.py worlds [--curves 200] [--free E] [--seed 1]
    python tests/studies/answers.py scenes [--curves 100] [--free E h E2] [--seed 1]
    python tests/studies/answers.py verdicts [--curves 2000] [--seed 1]
    python tests/studies/answers.py hard [--curves 30] [--seed 1]
    python tests/studies/answers.py places [--curves 20] [--seed 1]
    python tests/studies/answers.py pages    # writes the tables of the pages again

`worlds` are disturbances of one scene (`tests/support/worlds.py`), `scenes` clean tests of a user's range. A row of
``results/answers_KIND_FREE.csv`` says how many statistical parts (95 %) hold the truth, how wide they are over that
of white noise (median and geometric mean), the Winkler score and white's (both of ln of the number), how many
intervals of white noise hold the truth (the control: it must fail where noise is not white), and the cost in
milliseconds of processor (median, 90 %). In worlds in which the law is wrong the truth is what the law makes of the
curve without its white noise. `verdicts` counts what is called check or reject of clean and of correlated curves.
`hard` counts what holds of contacts made gradually and of levers softer than the sample, how many misfits above
three noises are named, and how many answers of one record at 500 and at 5000 points overlap.
`places` takes curves of every kind as files through `fit`, `map`, `report`, the page, JSON and Excel and counts
those whose numbers are the same to the last digit, and through `sample`, whose ends may differ by its Monte Carlo
error.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[2] / "src")]

import underlay as ul  # noqa: E402  after the path
from support.answer_tables import write  # noqa: E402
from support.places import KINDS, Written, differences, from_draws  # noqa: E402
from support.user_scenes import user_test  # noqa: E402
from support.worlds import LAW_LIKE, NOISES, Clean, world_curves  # noqa: E402

RESULTS = Path(__file__).with_name("results")
PATHS = {"E": "layer.E", "h": "layer.thickness", "E2": "substrate.E"}
CONTACT, BASELINE = "instrument.contact_depth", "instrument.baseline"
ONE = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3), ul.RIGID, uncertainties="none")
_Z = 1.96


def read(problem, truth):
    """One row a number: scaled truth, ends, least squares and its white error, and the cost."""
    began = time.process_time()
    fit = ul.fit(problem)
    bare = time.process_time()
    ends = {name: fit.interval(name, part="statistical") for name in truth}
    done = time.process_time()
    rows = []
    for name, value in truth.items():
        i = fit.names.index(name)
        known = ends[name]
        rows.append(
            {
                "parameter": name,
                "true": np.log(value),
                "low": np.log(known.low) if known.low > 0.0 else -np.inf,
                "high": np.log(known.high) if np.isfinite(known.high) else np.inf,
                "value": np.log(fit.values[name]),
                "white": float(fit.scaled_covariance[i, i]) ** 0.5,
                "fit ms": 1e3 * (bare - began),
                "ms": 1e3 * (done - bare),
            }
        )
    return rows


def free_of(keys, deep, scene, rng=None):
    """Bounds: of one scene wide ones, else some way about the truth."""
    known = scene.parameters
    wide = {"E": 1e4, "h": 30.0, "E2": 1e4}

    def about(value, factor):
        below, above = (0.5, 0.5) if rng is None else rng.uniform(0.2, 0.8, 2)
        return (value * factor**-below, value * factor**above)

    bounds = {PATHS[key]: about(known[PATHS[key]], wide[key]) for key in keys}
    return {**bounds, CONTACT: (-0.4 * deep, 0.4 * deep), BASELINE: None}


def worlds(keys, count, seed):
    clean = Clean.of(ONE, 1.5e-4, 240)
    for number, world in enumerate((*NOISES, *LAW_LIKE)):
        for k in range(count):
            curve, quiet = world_curves(clean, world, np.random.default_rng([seed, number, k]))
            free = free_of(keys, 2.5e-4, ONE)
            truth = {PATHS[key]: ONE.parameters[PATHS[key]] for key in keys}
            if world in LAW_LIKE:
                values = ul.fit(ul.Problem(ONE, quiet, free)).values
                truth = {name: values[name] for name in truth}
            for row in read(ul.Problem(ONE, curve, free), truth):
                yield {"kind": world, "curve": k, **row}


def scenes(keys, count, seed):
    made = number = 0
    while made < count:
        rng = np.random.default_rng([seed, number])
        number += 1
        name, scene, deep, points, noise = user_test(rng)
        if "E2" in keys and name not in {"soft base", "film"}:
            continue
        made += 1
        clean = Clean.of(scene, deep, min(points, 600))
        force = clean.force + noise * clean.top * rng.standard_normal(len(clean.depth))
        curve = ul.Curve(clean.depth, force, time=clean.time)
        truth = {PATHS[key]: scene.parameters[PATHS[key]] for key in keys}
        for row in read(ul.Problem(scene, curve, free_of(keys, deep, scene, rng)), truth):
            yield {"kind": "clean scenes", "curve": made, **row}


def winkler(low, high, true):
    """Score of 95 % intervals: width, and forty times what they miss by."""
    return high - low + 40.0 * np.maximum(low - true, 0.0) + 40.0 * np.maximum(true - high, 0.0)


def _share(low, high, true):
    return round(100.0 * ((low <= true) & (true <= high)).mean(), 1)


def summed(rows):
    for (kind, parameter), own in rows.groupby(["kind", "parameter"], sort=False):
        closed = own[np.isfinite(own["low"]) & np.isfinite(own["high"])]
        ratio = (closed["high"] - closed["low"]) / (2.0 * _Z * closed["white"])
        white = own["value"] - _Z * own["white"], own["value"] + _Z * own["white"]
        ours = winkler(closed["low"], closed["high"], closed["true"]).mean()
        theirs = winkler(*(end[closed.index] for end in white), closed["true"]).mean()
        yield {
            "kind": kind,
            "parameter": parameter,
            "curves": len(own),
            "covered %": round(
                100.0 * ((own["low"] <= own["true"]) & (own["true"] <= own["high"])).mean(), 1
            ),
            "white covered %": round(
                100.0 * ((white[0] <= own["true"]) & (own["true"] <= white[1])).mean(), 1
            ),
            "open": len(own) - len(closed),
            "width, median": round(float(ratio.median()), 2),
            "width, geometric": round(float(np.exp(np.log(ratio).mean())), 2),
            "score": float(f"{ours:.3g}"),
            "score of white": float(f"{theirs:.3g}"),
            "ms, median": round(float(own["ms"].median()), 1),
            "ms, 90 %": round(float(own["ms"].quantile(0.9)), 1),
        }


def verdicts(count, seed):
    """What is called check or reject of clean curves, thickness known and free, and of correlated ones."""
    clean = Clean.of(ONE, 1.5e-4, 240)
    for kind, world, keys, share in (
        ("clean, h known", "clean", ("E",), 1.0),
        ("clean, h free", "clean", ("E", "h"), 1.0),
        ("correlated, h known", "AR(1) and white", ("E",), 0.25),
    ):
        words = []
        for k in range(int(count * share)):
            curve, _ = world_curves(clean, world, np.random.default_rng([seed, 99, k]))
            words.append(ul.fit(ul.Problem(ONE, curve, free_of(keys, 2.5e-4, ONE))).verdict)
        misfit = [word for word in words if "at depth" in word.reason or "gradually" in word.reason]
        alarms = [word for word in words if word != "good"]
        yield {"kind": kind, "curves": len(words), "not good": len(alarms), "for a misfit": len(misfit)}


def gradual(seed):
    """Contacts of heights that scatter by 0.3 to 2.5 um in 15 um: does the answer hold E, and is it within 10 %?"""
    scene = ul.Scene(ul.Sphere(0.15e-3), ul.Layer(ul.Isotropic(0.75e6, 0.46), 1e-3), ul.RIGID)
    law, (heights, weights) = scene.contact_law(6e-5), np.polynomial.hermite_e.hermegauss(40)
    free = {PATHS["E"]: (1e4, 1e8), CONTACT: (-6e-6, 1e-5), BASELINE: None}
    for spread in (0.3e-6, 0.7e-6, 1.5e-6, 2.5e-6):
        for points in (142, 1180):
            depth = np.linspace(-6e-6, 1.5e-5, points)
            parts = [law.force(np.maximum(depth - spread * height, 0.0)) for height in heights]
            force = weights @ np.array(parts) / weights.sum()
            rng = np.random.default_rng([seed, points, int(spread * 1e7)])
            force = force + 0.003 * force.max() * rng.standard_normal(points)
            bare = ul.Problem(replace(scene, uncertainties="none"), ul.Curve(depth, force), free)
            known = ul.fit(bare).answer(PATHS["E"])
            yield 0.75e6 in known.interval and abs(known.value / 0.75e6 - 1.0) < 0.1


def levers(count, seed):
    """Levers 2 to 20 times softer than the contact, whose noise is in depth and force: does the answer hold E?"""
    scene = ul.Scene(ul.Paraboloid(2e-6), ul.Layer(ul.Isotropic(3e6, 0.5)), uncertainties="none")
    law, depths, k = scene.contact_law(1e-5), np.linspace(0.0, 1e-6, 4000), 0.2
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        ratio, noise, points = np.exp(rng.uniform(np.log([2.0, 1e-10, 300.0]), np.log([20.0, 5e-10, 2000.0])))
        deepest = depths[np.searchsorted(law.stiffness(depths[1:]), ratio * k)]
        w = np.linspace(-0.5 * deepest, deepest, int(points))
        shake = rng.normal(0.0, noise, len(w))
        curve = ul.Curve(w - shake, law.force(np.maximum(w, 0.0)) + k * shake)
        yield (
            3e6
            in ul.fit(ul.Problem(scene, curve, [PATHS["E"], CONTACT, BASELINE])).answer(PATHS["E"]).interval
        )


def named(count, seed):
    """Law-like worlds whose misfit exceeds three noises: is the verdict check or reject?"""
    clean = Clean.of(ONE, 1.5e-4, 240)
    for number, world in enumerate(LAW_LIKE):
        for k in range(count):
            curve, quiet = world_curves(clean, world, np.random.default_rng([seed, 98, number, k]))
            free = free_of(("E",), 2.5e-4, ONE)
            misfit = ul.fit(ul.Problem(ONE, quiet, free)).residuals[0]
            if np.abs(misfit).max() > 3.0 * 0.003 * clean.top:
                yield ul.fit(ul.Problem(ONE, curve, free)).verdict != "good"


def thinned(count, seed):
    """One record at 5000 points and at every tenth: do the statistical parts overlap, the longer's the shorter?"""
    clean = Clean.of(ONE, 1.5e-4, 5000)
    for k in range(count):
        curve, _ = world_curves(clean, "clean", np.random.default_rng([seed, 97, k]))
        few = ul.Curve(curve.depth[::10], curve.force[::10], time=curve.time[::10])
        a, b = (
            ul.fit(ul.Problem(ONE, own, free_of(("E",), 2.5e-4, ONE))).interval(
                PATHS["E"], part="statistical"
            )
            for own in (curve, few)
        )
        yield a.low <= b.high and b.low <= a.high and a.high - a.low < 0.5 * (b.high - b.low)


def hard(count, seed):
    """Counts of all four."""
    for kind, held in (
        ("gradual contact", gradual(seed)),
        ("soft lever", levers(count, seed)),
        ("misfit above three noises named", named(count, seed)),
        ("500 and 5000 points", thinned(count, seed)),
    ):
        every = [bool(one) for one in held]
        yield {"kind": kind, "curves": len(every), "as it should": sum(every)}


def places(count, seed):
    """Curves of every kind through every door: the same digits, and the same draws but for their errors?"""
    for kind in KINDS:
        same, near, ends = 0, 0, 0
        for k in range(count):
            with tempfile.TemporaryDirectory() as folder:
                written = Written.of(kind, 1000 * seed + k, Path(folder))
                fit, found = written.said(Path(folder))
                same += not differences(found)
                problem = ul.load_problem(written.curve, written.scene)
                # A chain where the weighted draws are refused is cut short: it says that it has not converged.
                posterior = ul.sample(problem, rng=k, max_steps=2000)
                off = from_draws(fit, posterior) if posterior.diagnostics.converged else []
                near, ends = near + sum(abs(own) <= 3.0 for own in off), ends + len(off)
        yield {"kind": kind, "curves": count, "same digits": same, "ends": ends, "ends within errors": near}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kind", choices=["worlds", "scenes", "verdicts", "hard", "places", "pages"])
    parser.add_argument("--curves", type=int, default=200)
    parser.add_argument("--free", nargs="+", default=["E"], choices=list(PATHS))
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    if asked.kind == "pages":
        write()
        return
    counts = {"verdicts": verdicts, "hard": hard, "places": places}
    if asked.kind in counts:
        table = pd.DataFrame(counts[asked.kind](asked.curves, asked.seed))
        path = RESULTS / f"answers_{asked.kind}.csv"
    else:
        made = {"worlds": worlds, "scenes": scenes}[asked.kind](asked.free, asked.curves, asked.seed)
        table = pd.DataFrame(summed(pd.DataFrame(made)))
        if asked.kind == "worlds":
            noise = table[table["kind"].isin(NOISES)]
            print(
                f"score over white's, noise worlds: {noise['score'].mean() / noise['score of white'].mean():.3f}"
            )
        path = RESULTS / f"answers_{asked.kind}_{'_'.join(asked.free)}.csv"
    table.insert(0, "seed", asked.seed)
    table.to_csv(path, index=False)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
