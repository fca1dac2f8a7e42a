"""Do the printed intervals hold the truth? Random tests of a user's range, undisturbed or disturbed.

    python tests/studies/intervals.py [--curves 200] [--world clean slope ...] [--free E h] [--stated] [--one]
                                      [--seconds 600] [--output tests/studies/results/intervals.csv]

One row per world and set of free parameters is written over the row of the same study: how many 95 % intervals of
each parameter hold the truth, how wide they are against the quadratic interval of white noise (median), how many
verdicts were "model wrong", and the slowest headline in fits of the same curve. `--stated` hands the fit the noise
it was made with. Worlds are those of `tests/support/worlds.py`; scenes those of `tests/support/user_scenes.py`, or
with `--one` the single scene those worlds were first measured on. `--world all` runs every one, `--seconds` long
each at most, and writes every row as it is done.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import underlay as ul
from support.user_scenes import user_test
from support.worlds import WORLDS, Clean, assumed, disturbed
from underlay.inference.headline.plain import quadratic_interval

PATHS = {"E": "layer.E", "h": "layer.thickness", "E2": "substrate.E"}
KEYS = ["scenes", "world", "free", "noise"]


def one_scene():
    """The scene the worlds were first measured on: (kind, scene, depth, points, noise)."""
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3)
    return "one", ul.Scene(ul.Sphere(1e-3), layer, ul.RIGID), 1.5e-4, 240, 0.003


def measured(test, world, free, rng, *, stated):
    """Rows (parameter, held, width ratio, open) of one curve, its verdict, and what its headline cost in fits."""
    _, scene, depth, points, noise = test
    clean = Clean.of(scene, depth, points)
    curve = disturbed(clean, world, rng, noise)
    names = [PATHS[word] for word in free if word != "E2" or isinstance(scene.substrate, ul.Isotropic)]
    instrument = {"instrument.contact_depth": None, "instrument.baseline": None}
    given = ul.Noise(force=noise * clean.top) if stated else None
    problem = ul.Problem(assumed(scene, world), curve, {**dict.fromkeys(names), **instrument}, given)
    began = time.perf_counter()
    fit = ul.fit(problem)
    spent = time.perf_counter() - began
    began = time.perf_counter()
    intervals = {name: fit.interval(name) for name in names}
    verdict = fit.verdict
    own = time.perf_counter() - began
    cost = own / spent, own
    rows = []
    for name in names:
        truth, known, plain = scene.parameters[name], intervals[name], quadratic_interval(fit, name, 0.95)
        ratio = np.nan
        if not (known.is_open or plain.is_open):
            ratio = np.log(known.high / known.low) / np.log(plain.high / plain.low)
        rows.append((name, truth in known, ratio, known.is_open, truth in plain, bool(fit.bounds_hit)))
    return rows, verdict, cost


def study(args, world):
    """One line of the table."""
    rng = np.random.default_rng(args.seed)
    rows, words, costs, misses = [], [], [], 0
    end = time.monotonic() + args.seconds
    while len(words) < args.curves and time.monotonic() < end:
        test = one_scene() if args.one else user_test(rng)
        try:
            own, verdict, cost = measured(test, world, args.free, rng, stated=args.stated)
        except ul.UnderlayError as error:
            misses += 1
            print(f"{test[0]}: {error}")
            continue
        rows += own
        words.append((verdict.word, all(row[1] for row in own)))
        costs.append(cost)
    frame = pd.DataFrame(rows, columns=["parameter", "held", "width", "open", "plain held", "bound"])
    line = {
        "scenes": "one" if args.one else "random",
        "world": world,
        "free": "+".join(args.free),
        "noise": "stated" if args.stated else "unknown",
        "seed": args.seed,
        "curves": len(words),
        "not fitted": misses,
    }
    for word in args.free:
        own = frame[frame["parameter"] == PATHS[word]]
        line |= {
            f"{word} held %": round(100.0 * own["held"].mean(), 1),
            f"{word} quadratic held %": round(100.0 * own["plain held"].mean(), 1),
            f"{word} width": round(own["width"].median(), 2),
            f"{word} open %": round(100.0 * own["open"].mean(), 1),
        }
    line["model wrong %"] = round(100.0 * np.mean([word == "model wrong" for word, _ in words]), 1)
    line["good %"] = round(100.0 * np.mean([word == "good" for word, _ in words]), 1)
    line["held or wrong %"] = round(100.0 * np.mean([word == "model wrong" or ok for word, ok in words]), 1)
    ratio, spent = np.array(costs).T
    line["cost median"], line["cost largest"] = round(float(np.median(ratio)), 1), round(ratio.max(), 1)
    line["slowest s"] = round(spent.max(), 2)
    return line


def stored(line, path):
    """Write a line over that of the same study."""
    table = pd.DataFrame([line])
    if path.exists():
        old = pd.read_csv(path)
        same = (old[KEYS] == pd.Series({key: line[key] for key in KEYS})).all(axis=1)
        table = pd.concat([old[~same], table], ignore_index=True)
    table.to_csv(path, index=False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--curves", type=int, default=200)
    parser.add_argument("--world", nargs="+", choices=["all", *WORLDS], default=["clean"])
    parser.add_argument("--free", nargs="+", choices=list(PATHS), default=["E"])
    parser.add_argument("--stated", action="store_true")
    parser.add_argument("--one", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--output", type=Path, default=None)
    args = parser.parse_args()
    for world in WORLDS if "all" in args.world else args.world:
        line = study(args, world)
        print(pd.Series(line).to_string(), flush=True)
        if args.output is not None:
            stored(line, args.output)


if __name__ == "__main__":
    main()
