"""Does the second tip bring what was said? Promise against outcome where a first test leaves the thickness open.

    python tests/studies/second_tip.py [--scenes 20] [--seed 0] [--output tests/studies/results/second_tip.csv]

Random tests of a user's range (`tests/support/user_scenes.py`) with modulus, thickness and contact free, the
noise stated. Where the 95 % interval of the thickness goes further than 10 % either way, `ul.second_test` names a
tip; the second test is made on the true specimen and both are fitted jointly. One row per scene: the promise for
the true thickness (between those for the supposed ones, in logarithms), the best and worst promised, the joint
fit's relative standard error and how far its thickness is from the truth; and what a forecast from the optimum
alone promises of the same tip, as a control.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import underlay as ul
from support.user_scenes import user_test

E, H, C = "layer.E", "layer.thickness", "instrument.contact_depth"
_OPEN, _FACTOR = 0.1, 1.5


def pressed(scene, depth, points, noise, rng):
    """The scene and a made curve of it."""
    readings = np.linspace(-depth / 3.0, depth, points)
    return scene, ul.synthesize(scene, readings, noise, int(rng.integers(2**31)))


def row(rng):
    """One scene's promise and outcome; None where the first test leaves nothing open or no tip is named."""
    kind, scene, depth, points, share = user_test(rng)
    noise = ul.Noise(force=share * float(scene.force(np.array([depth]))[0]))
    first = pressed(scene, depth, points, noise, rng)
    truth = scene.layer.thickness
    try:
        fit = ul.fit(ul.Problem(*first, [E, H, C], noise))
        known = fit.interval(H)
        if known.low > (1.0 - _OPEN) * known.value and known.high < (1.0 + _OPEN) * known.value:
            return None
        found = ul.second_test(fit, H)
        if found.radius is None:
            return None
        alone = ul.second_test(fit, H, value=fit.values[H])
        second = pressed(
            scene.with_values({"indenter.radius": found.radius}), found.depth, points, noise, rng
        )
        joint = ul.fit(ul.Problem.joint([first, second], [E, H, C], [E, H], noise))
    except ul.UnderlayError as error:
        return {"kind": kind, "refused": str(error)[:80]}
    at = found.radii == found.radius
    shares = found.shares[:, at][:, 0]
    promise = float(np.exp(np.interp(np.log(truth), np.log(found.values), np.log(shares))))
    outcome = joint.stderr[H] / joint.values[H]
    return {
        "kind": kind,
        "inside": bool(known.low <= truth <= known.high),
        "promise": promise,
        "best": shares.min(),
        "worst": shares.max(),
        "alone": float(alone.shares[0, at][0]),
        "outcome": outcome,
        "off": joint.values[H] / truth - 1.0,
    }


def summary(table):
    """What is asked: promise within a factor 1.5 of the outcome."""
    done = table.dropna(subset=["outcome"])

    def within(column):
        return 100.0 * float((np.abs(np.log(done[column] / done["outcome"])) <= np.log(_FACTOR)).mean())

    between = (done["outcome"] >= done["best"] / _FACTOR) & (done["outcome"] <= done["worst"] * _FACTOR)
    return (
        f"{len(done)} scenes: promise at the truth within a factor {_FACTOR} {within('promise'):.0f} %, outcome "
        f"between best and worst (with that factor) {100.0 * float(between.mean()):.0f} %, from the optimum "
        f"alone {within('alone'):.0f} %"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=None)
    args = parser.parse_args()
    rng, rows = np.random.default_rng(args.seed), []
    while len(rows) < args.scenes:
        found = row(rng)
        if found is None:
            continue
        rows.append(found)
        print(found, flush=True)
        if args.output is not None:
            pd.DataFrame(rows).to_csv(args.output, index=False, float_format="%.4g")
    print(summary(pd.DataFrame(rows)))


if __name__ == "__main__":
    main()
