"""Which curves are called good? Random tests of a user's range, good ones and those that went wrong.

    python tests/studies/quality.py [--curves 25] [--kind slip ...] [--seconds 200]
                                    [--output tests/studies/results/quality.csv]

One row per kind of `tests/support/quality_kinds.py`: how many curves `check_quality` calls good, doubtful and
refuses, how many of those fitted (modulus, contact, baseline) have the verdict good, how many are good by both, how
often the contact found beforehand lies beyond twice its own error, and its median |z|.
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
from support.quality_kinds import KINDS, example
from support.user_scenes import user_test
from underlay.data.quality import GOOD, REFUSED

FREE = ["layer.E", "instrument.contact_depth", "instrument.baseline"]


def judged(scene, curve):
    """Words of the curve's quality and of its fit, and the z of the contact found, whose truth is zero."""
    quality = ul.check_quality(curve, scene)
    contact = quality.contact
    z = np.nan if contact is None else contact.depth / contact.uncertainty
    if quality.verdict == REFUSED:
        return quality.verdict, "none", z
    try:
        return quality.verdict, ul.fit(ul.Problem(scene, curve, FREE)).verdict.word, z
    except ul.UnderlayError:
        return quality.verdict, "none", z


def study(kind, args):
    """One line of the table."""
    rng = np.random.default_rng(args.seed)
    rows, end = [], time.monotonic() + args.seconds
    while len(rows) < args.curves and time.monotonic() < end:
        _, scene, depth, points, _ = user_test(rng)
        rows.append(judged(scene, example(kind, scene, depth, points, rng)))
    quality, fitted, z = (np.array(column) for column in zip(*rows, strict=True))
    known = np.abs(z[np.isfinite(z)])
    line = {"kind": kind, "seed": args.seed, "curves": len(rows)}
    line |= {
        f"quality {word} %": 100.0 * np.mean(quality == word) for word in ("good", "doubtful", "refused")
    }
    line |= {f"fit {word} %": 100.0 * np.mean(fitted == word) for word in ("good", "doubtful", "model wrong")}
    line["good by both %"] = 100.0 * np.mean((quality == GOOD) & (fitted == "good"))
    line["contact beyond two errors %"] = 100.0 * np.mean(known > 2.0) if known.size else np.nan
    line["contact median z"] = np.median(known) if known.size else np.nan
    return {name: round(value, 2) if isinstance(value, float) else value for name, value in line.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--curves", type=int, default=25)
    parser.add_argument("--kind", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=200.0)
    parser.add_argument("--output", type=Path, default=None)
    args = parser.parse_args()
    table = pd.DataFrame()
    for kind in args.kind:
        table = pd.concat([table, pd.DataFrame([study(kind, args)])], ignore_index=True)
        print(table.iloc[-1].to_string(), flush=True)
        if args.output is not None:
            table.to_csv(args.output, index=False)


if __name__ == "__main__":
    main()
