"""Does allowing for one thing more pretend to know more? Intervals with and without friction in large strains.

    python tests/studies/left_out_terms.py [curves]    # -> results/left_out_terms.csv, 60 curves: 3 minutes

A ball of 1 mm on 1.35 mm of nu = 0.46 on a rigid base, pressed 0.21 thicknesses, noise 0.15 % of the peak and of
unknown size; modulus, thickness, contact point and baseline free. The curves have nothing of what is left out, all
three of it as the priors have it, or a law that drifts by 10 % in place of it. An interval may get narrower with
the third error, since a drift is less needed to explain a curve: what it covers there is counted on its own.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

import underlay as ul
from underlay.inference.headline.averaged import averaged_interval
from underlay.inference.misfit.averaging import average
from underlay.inference.uncertainty.known_errors import left_out

RESULT = Path(__file__).parent / "results" / "left_out_terms.csv"
TRUTH = {"layer.E": 6.2e5, "layer.thickness": 1.35e-3}
BALL = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(6.2e5, 0.46), 1.35e-3), ul.RIGID)
DEPTH = np.linspace(-1e-4, 2.85e-4, 300)
FREE = dict.fromkeys((*TRUTH, "instrument.contact_depth", "instrument.baseline"))
KINDS = {"none": 5, "prior": 6, "drift": 7}
NOISE = 6e-4


def main(curves=60):
    """Fit the curves of every kind."""
    warnings.simplefilter("ignore")
    rows = []
    for kind, seed in KINDS.items():
        rng = np.random.default_rng(seed)
        found = pd.DataFrame([_told(_curve(kind, rng)) for _ in range(int(curves))])
        for path in TRUTH:
            ratio = found[f"three {path} width"] / found[f"two {path} width"]
            narrower = ratio < 1.0
            covers = {words: found[f"{words} {path}"].mean() for words in ("two", "three")}
            rows.append(
                {"kind": kind, "curves": len(found), "parameter": path}
                | {f"{words} cover": f"{share:.3f}" for words, share in covers.items()}
                | {"median width, three over two": f"{ratio.median():.3f}", "narrower": int(narrower.sum())}
                | {"three cover where narrower": f"{found.loc[narrower, f'three {path}'].mean():.3f}"}
            )
        pd.DataFrame(rows).to_csv(RESULT, index=False)
    print(pd.DataFrame(rows).to_string())


def _curve(kind, rng):
    sizes = rng.normal([0.5, 1.0, 0.25], [0.35, 0.5, 0.5]) if kind == "prior" else np.zeros(3)
    force = ul.Scene(BALL.indenter, BALL.layer, BALL.substrate, discrepancy=ul.Discrepancy(*sizes)).force(
        DEPTH
    )
    if kind == "drift":
        force = force * (1.0 + 0.1 * rng.normal() * np.maximum(DEPTH, 0.0) / DEPTH.max())
    return pd.DataFrame({"depth": DEPTH, "force": force + NOISE * rng.standard_normal(DEPTH.size)})


def _told(readings):
    fit = ul.fit(ul.Problem(BALL, ul.Curve.from_frame(readings), FREE))
    errors = left_out(fit.scenes[0], 2e-4).errors
    others = [other.vector for other in fit.alternatives]
    row = {}
    for words, allowed in (("two", errors[:2]), ("three", errors)):
        averaged = average(fit.problem, fit.vector, others, errors=allowed)
        for path, truth in TRUTH.items():
            known = averaged_interval(fit, averaged, path, 0.95)
            row |= {
                f"{words} {path}": truth in known,
                f"{words} {path} width": np.log(known.high / known.low),
            }
    return row


if __name__ == "__main__":
    main(*sys.argv[1:])
