"""Do the printed intervals hold the truth? Random tests of a user's range, undisturbed or disturbed.

    python tests/studies/intervals.py [--curves 200] [--world clean slope ...] [--free E h] [--stated] [--one]
                                      [--elastic | --half-space] [--within 1.3] [--seed 16 ...] [--seconds 600]
                                      [--rows rows.csv]
                                      [--output tests/studies/results/intervals.csv]

One row per world and set of free parameters is written over the row of the same study: how many 95 % intervals of
each parameter hold the truth (and of fits with something on a bound alone), how wide they are against the quadratic
interval of white noise (median), how many verdicts were "model wrong", and what the headline costs in fits of the
same curve, the fit in milliseconds (median) and seconds (slowest), and both together in seconds of processor time.
A first fit goes before them untimed: what a process loads once is no part of what a curve costs.
`--stated` hands the fit the noise it was made with. With several seeds there are so many curves of each. Worlds
are those of `tests/support/worlds.py`; scenes those of `tests/support/user_scenes.py`, with `--elastic` those on
an elastic base alone, with `--half-space` their tips and depths on a half-space, or with `--one` the single scene
those worlds were first measured on. With `--within` thickness and base are stated to lie between two bounds this
factor apart, the truth anywhere between: many fits then end on a bound. `--world all` runs every one,
`--seconds` long each at most, and writes every row as it is done. With `--rows` every curve is kept in a file, and
a run goes on where the last one ended.
"""

from __future__ import annotations

import argparse
import importlib
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
COLUMNS = [
    *KEYS,
    "seed",
    "curve",
    "kind",
    "parameter",
    "held",
    "width",
    "open",
    "plain held",
    "bound",
    "verdict",
]
COLUMNS += ["cost", "seconds", "fit seconds"]


def one_scene():
    """The scene the worlds were first measured on: (kind, scene, depth, points, noise)."""
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), 1.5e-3)
    return "one", ul.Scene(ul.Sphere(1e-3), layer, ul.RIGID), 1.5e-4, 240, 0.003


def test_of(args, rng):
    """Draw one test: (kind, scene, depth, points, noise)."""
    while True:
        test = one_scene() if args.scenes == "one" else user_test(rng)
        if args.scenes == "half-space":
            return test[0], assumed(test[1], "Hertz on a layer"), *test[2:]
        if args.scenes != "elastic base" or isinstance(test[1].substrate, ul.Isotropic):
            return test


def bounds_about(truth, factor, rng):
    """Bounds a factor apart, or none, with the truth anywhere between."""
    if factor is None:
        return None
    low = truth * factor ** -rng.uniform()
    return ul.LogUniform(low, low * factor)


def measured(test, world, free, rng, *, stated, within):
    """Rows of one curve, one per parameter: held, width ratio, verdict and what fit and headline cost."""
    _, scene, depth, points, noise = test
    clean = Clean.of(scene, depth, points)
    curve = disturbed(clean, world, rng, noise)
    words = [word for word in free if word != "E2" or isinstance(scene.substrate, ul.Isotropic)]
    instrument = {"instrument.contact_depth": None, "instrument.baseline": None}
    given = ul.Noise(force=noise * clean.top) if stated else None
    factors = {word: None if word == "E" else within for word in words}
    bounds = {PATHS[word]: bounds_about(scene.parameters[PATHS[word]], factors[word], rng) for word in words}
    free_paths = {**bounds, **instrument}
    problem = ul.Problem(assumed(scene, world), curve, free_paths, given)
    began = time.process_time()
    fit = ul.fit(problem)
    spent = time.process_time() - began
    began = time.process_time()
    intervals = {word: fit.interval(PATHS[word]) for word in words}
    verdict = fit.verdict.word
    own = time.process_time() - began
    rows = []
    for word, known in intervals.items():
        truth, plain = scene.parameters[PATHS[word]], quadratic_interval(fit, PATHS[word], 0.95)
        ratio = np.nan
        if not (known.is_open or plain.is_open):
            ratio = np.log(known.high / known.low) / np.log(plain.high / plain.low)
        rows.append(
            {
                "parameter": word,
                "held": truth in known,
                "width": ratio,
                "open": known.is_open,
                "plain held": truth in plain,
                "bound": bool(fit.bounds_hit),
                "verdict": verdict,
                "cost": own / spent,
                "seconds": own + spent,
                "fit seconds": spent,
            }
        )
    return rows


def warm_up():
    """Load what a first fit loads, and what the first one loads whose end another program is to confirm."""
    importlib.import_module("lmfit")
    rng = np.random.default_rng(0)
    measured(one_scene(), "clean", ["E", "h"], rng, stated=False, within=None)


def scenes_of(args):
    """In words, for the table."""
    return args.scenes if args.within is None else f"{args.scenes}, within {args.within:g}"


def study(args, world):
    """All rows of one study, those kept from an earlier run first; a curve that was not fitted has no parameter."""
    key = {
        "scenes": scenes_of(args),
        "world": world,
        "free": "+".join(args.free),
        "noise": "stated" if args.stated else "unknown",
        "seed": ", ".join(map(str, args.seed)),
    }
    kept = pd.DataFrame(columns=[*key, "curve"])
    if args.rows is not None and args.rows.exists():
        kept = pd.read_csv(args.rows, dtype={"seed": str})
    frame = kept[(kept[list(key)] == pd.Series(key)).all(axis=1)]
    warm_up()
    end = time.monotonic() + args.seconds
    for curve in range(frame["curve"].nunique(), args.curves * len(args.seed)):
        if time.monotonic() > end:
            break
        seed, number = divmod(curve, args.curves)
        rng = np.random.default_rng([args.seed[seed], number])
        test = test_of(args, rng)
        try:
            rows = measured(test, world, args.free, rng, stated=args.stated, within=args.within)
        except ul.UnderlayError as error:
            print(f"{test[0]}: {error}")
            rows = [{}]
        own = pd.DataFrame([{**key, "curve": curve, "kind": test[0], **row} for row in rows])
        frame = own if frame.empty else pd.concat([frame, own], ignore_index=True)
        if args.rows is not None:
            own = own.reindex(columns=COLUMNS)
            own.to_csv(args.rows, mode="a", header=not args.rows.exists(), index=False, float_format="%.4g")
    return key, frame


def line_of(key, frame):
    """One line of the table."""
    fitted = frame.dropna(subset="parameter").astype({"held": bool, "plain held": bool, "open": bool})
    line = {**key, "curves": fitted["curve"].nunique(), "not fitted": frame["parameter"].isna().sum()}
    for word in key["free"].split("+"):
        own = fitted[fitted["parameter"] == word]
        bound = own[own["bound"].astype(bool)]
        line |= {
            f"{word} held %": round(100.0 * own["held"].mean(), 1),
            f"{word} quadratic held %": round(100.0 * own["plain held"].mean(), 1),
            f"{word} width": round(own["width"].median(), 2),
            f"{word} open %": round(100.0 * own["open"].mean(), 1),
            f"{word} at a bound": len(bound),
            f"{word} at a bound held %": round(100.0 * bound["held"].mean(), 1),
        }
    held = fitted.groupby("curve")["held"].all()
    each = fitted.groupby("curve").first()
    wrong = each["verdict"] == "model wrong"
    line["model wrong %"] = round(100.0 * wrong.mean(), 1)
    line["good %"] = round(100.0 * (each["verdict"] == "good").mean(), 1)
    line["held or wrong %"] = round(100.0 * (wrong | held).mean(), 1)
    line["cost median"], line["cost largest"] = round(each["cost"].median(), 1), round(each["cost"].max(), 1)
    line["cost above 2 %"] = round(100.0 * (each["cost"] > 2.0).mean(), 1)
    line["above 1 s %"] = round(100.0 * (each["seconds"] > 1.0).mean(), 1)
    line["slowest s"] = round(each["seconds"].max(), 2)
    line["fit ms"] = round(1e3 * each["fit seconds"].median(), 1)
    line["slowest fit s"] = round(each["fit seconds"].max(), 2)
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
    for flag, name in {"--one": "one", "--elastic": "elastic base", "--half-space": "half-space"}.items():
        parser.add_argument(flag, dest="scenes", action="store_const", const=name, default="random")
    parser.add_argument("--within", type=float, default=None)
    parser.add_argument("--seed", type=int, nargs="+", default=[16])
    parser.add_argument("--rows", type=Path, default=None)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--output", type=Path, default=None)
    args = parser.parse_args()
    for world in WORLDS if "all" in args.world else args.world:
        line = line_of(*study(args, world))
        print(pd.Series(line).to_string(), flush=True)
        if args.output is not None:
            stored(line, args.output)


if __name__ == "__main__":
    main()
