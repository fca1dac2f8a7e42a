"""What the prior of a drifting law costs clean curves and brings disturbed ones, and what no prior can bring.

    python tests/studies/misfit_priors.py [--curves 100] [--seed 160] [--world clean stiffening ...] [--seconds 60]
                                          [--rows rows.csv] [--output tests/studies/results/misfit_priors.csv]

Random tests of a user's range (`tests/support/user_scenes.py`), modulus, contact and baseline free, the noise not
stated; the same curves under every prior of `PRIORS`. One row per world and prior: how many 95 % intervals hold the
true modulus, how many do or have the verdict "model wrong", and the width against the quadratic interval of white
noise (median). The intervals are those of the mixture alone, without the walk where it is bent.

Beside them what nobody can see: the curve is made again without noise and fitted, and the root of its chi-square is
the distance, in standard deviations, of the most powerful test that knows the disturbance and its size. Where it is
below 2.58 that test finds it in less than half of all curves at one false alarm in 200 (one-sided 0.5 %). A curve
is "hidden" where that is so and the fit is nevertheless off by more than two of its standard errors: an interval
that holds the truth there is as much wider on every clean curve that looks the same.

`--rows` keeps every curve in a file; a run goes on where the last one ended.
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
from underlay.inference.misfit.averaging import average
from underlay.inference.misfit.drift import BENT, FAR_BASE, NEAR_BASE, RELAXING, SMOOTH
from underlay.inference.misfit.sizes import Sizes

E = "layer.E"
FREE = [E, "instrument.contact_depth", "instrument.baseline"]
#: Kinds of drift that compete, by name, and the prior probability of none.
PRIORS = {
    "smooth 0.8": ((SMOOTH,), 0.8),
    "bent 0.8": ((BENT,), 0.8),
    "relaxing 0.85": ((RELAXING,), 0.85),
    "bent, relaxing 0.8": ((BENT, RELAXING), 0.8),
    "bent, bases 0.65": ((BENT, FAR_BASE, NEAR_BASE), 0.65),
}
_SEEN, _OFF = 2.58, 2.0
_WRONG = 0.01


def hidden(scene, clean, world, rng, noise):
    """Distance of the best test in standard deviations, and of the fitted modulus in standard errors."""
    data = disturbed(clean, world, rng, 0.0)
    fit = ul.fit(ul.Problem(assumed(scene, world), data, FREE, ul.Noise(force=noise * clean.top)))
    return fit.statistics.chi_square**0.5, abs(fit.values[E] - scene.parameters[E]) / fit.stderr[E]


def measured(world, seed, number):
    """Rows of one curve, one per prior."""
    rng = np.random.default_rng([seed, number])
    kind, scene, depth, points, noise = user_test(rng)
    clean = Clean.of(scene, depth, points)
    again = np.random.default_rng()
    again.bit_generator.state = rng.bit_generator.state
    problem = ul.Problem(assumed(scene, world), disturbed(clean, world, rng, noise), FREE)
    fit = ul.fit(problem)
    seen, off = hidden(scene, clean, world, again, noise)
    plain, truth = quadratic_interval(fit, E, 0.95), scene.parameters[E]
    entry = fit.names.index(E)
    others = [other.vector for other in fit.alternatives]
    rows = []
    for prior, (drifts, exact) in PRIORS.items():
        found = average(problem, fit.vector, others, sizes=Sizes(drifts=drifts, exact=exact))
        ends = found.mixture.quantiles(entry, [0.025, 0.975])
        low, high = (float(problem.coordinates[entry].physical(np.array(end))) for end in ends)
        rows.append(
            {
                "world": world,
                "seed": seed,
                "curve": number,
                "kind": kind,
                "noise": noise,
                "prior": prior,
                "held": low <= truth <= high,
                "wrong": found.exact_law < _WRONG,
                "width": np.log(high / low) / np.log(plain.high / plain.low),
                "seen": seen,
                "off": off,
            }
        )
    return rows


def study(world, args):
    """All rows of one world."""
    kept = pd.read_csv(args.rows) if args.rows is not None and args.rows.exists() else pd.DataFrame()
    frame = kept if kept.empty else kept[(kept["world"] == world) & (kept["seed"] == args.seed)]
    begun = frame["curve"].max() + 1 if len(frame) else 0
    end = time.monotonic() + args.seconds
    for number in range(begun, args.curves):
        if time.monotonic() > end:
            break
        try:
            own = pd.DataFrame(measured(world, args.seed, number))
        except (ul.UnderlayError, np.linalg.LinAlgError) as error:
            print(f"{world} {number}: {error}")
            continue
        frame = own if frame.empty else pd.concat([frame, own], ignore_index=True)
        if args.rows is not None:
            own.to_csv(args.rows, mode="a", header=not args.rows.exists(), index=False, float_format="%.4g")
    return frame


def table(frame):
    """One line per prior."""
    frame = frame.assign(
        either=frame["held"] | frame["wrong"],
        hidden=(frame["seen"] < _SEEN) & (frame["off"] > _OFF),
    )
    frame["open to see"] = frame["either"].where(~frame["hidden"])
    lines = frame.groupby(["world", "prior", "seed"], sort=False).agg(
        curves=("held", "size"),
        held=("held", "mean"),
        wrong=("wrong", "mean"),
        either=("either", "mean"),
        width=("width", "median"),
        hidden=("hidden", "mean"),
        seen=("open to see", "mean"),
    )
    shares = {
        "held": "held %",
        "wrong": "model wrong %",
        "either": "held or wrong %",
        "hidden": "hidden %",
        "seen": "held or wrong of the others %",
    }
    for name in shares:
        lines[name] = (100.0 * lines[name].astype(float)).round(1)
    lines["width"] = lines["width"].round(2)
    return lines.rename(columns=shares).reset_index()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--curves", type=int, default=100)
    parser.add_argument("--seed", type=int, default=160)
    parser.add_argument("--world", nargs="+", choices=list(WORLDS), default=["clean"])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rows", type=Path, default=None)
    parser.add_argument("--output", type=Path, default=None)
    args = parser.parse_args()
    found = pd.concat([study(world, args) for world in args.world], ignore_index=True)
    lines = table(found)
    print(lines.to_string(), flush=True)
    if args.output is not None:
        if args.output.exists():
            old = pd.read_csv(args.output)
            lines = pd.concat([old[~old["world"].isin(lines["world"])], lines], ignore_index=True)
        lines.to_csv(args.output, index=False)


if __name__ == "__main__":
    main()
