"""How often do 95 % intervals of E, thickness and work of adhesion hold the truth, on made withdrawals?

    python tests/studies/adhesion_coverage.py [--modes depth force cantilever] [--curves 500]
                                              [--output tests/studies/adhesion_coverage.json]

A paraboloid on a thin bonded layer, JKR, withdrawn after it was pressed in. What is held decides which states are
visited:

- "depth": a stiff instrument, 200 even depths down to and beyond the pull-off;
- "force": 200 even loads from the largest to the pull-off, where the record ends;
- "cantilever": 200 even travels of a cantilever's other end, which takes its share and lets the tip jump off.

The readings of "cantilever" begin anywhere within one spacing, drawn for each curve: the jump off falls anywhere
between two readings, beside one too. In "depth" it falls in the middle between two, and in "force" there is none.
White noise of 1 % of the pull-off force, its size known. E, thickness, work and contact point are free, and every
fit begins at the wrong numbers given below with its own scan, as a user's does. "profile" counts truths that the
profile likelihood does not reject, "standard error" those within 1.96 of it.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.inference.profiling.profile_result import interval_threshold

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from support.p_values import delta_chi_square_at  # noqa: E402  found from wherever it is run

LEVEL, WIDTH = 0.95, 1.959964
POINTS = 200
CONTACT = 2e-7
SCENE = ul.Scene(
    ul.Paraboloid(1e-5),
    ul.Layer(ul.Isotropic(5e3, 0.45), 8e-6),
    ul.RIGID,
    instrument=ul.Instrument(contact_depth=CONTACT),
    adhesion=ul.JKR(work=2e-4),
)
FREE = {
    "layer.E": ul.LogUniform(1e2, 1e6),
    "layer.thickness": ul.LogUniform(1e-6, 1e-4),
    "adhesion.work": ul.LogUniform(1e-6, 1e-1),
    "instrument.contact_depth": (-2e-6, 2e-6),
}
ASKED = ("layer.E", "layer.thickness", "adhesion.work")
WRONG = {"layer.E": 1e4, "layer.thickness": 1e-5, "adhesion.work": 1e-4, "instrument.contact_depth": 0.0}
DEEPEST = 1.8e-6
#: m/N: a cantilever of 0.1 N/m.
COMPLIANCE = 10.0
NOISE = 0.01
MODES = ("depth", "force", "cantilever")


def scene_of(mode):
    compliance = COMPLIANCE if mode == "cantilever" else 0.0
    return replace(SCENE, instrument=ul.Instrument(contact_depth=CONTACT, compliance=compliance))


def readings_of(mode, law, shift=0.0):
    """Depth readings (m) of one withdrawal, `shift` of a spacing deeper."""
    top = float(law.force(DEEPEST))
    if mode == "force":
        # The last load is the pull-off itself: its state is the end of the branch.
        return CONTACT + law.depth(np.linspace(top, -law.pull_off_force, POINTS + 1)[:-1])
    share = COMPLIANCE * top if mode == "cantilever" else 0.0
    depth = np.linspace(CONTACT + DEEPEST + share, -1.5e-6, POINTS)
    return depth + shift * (depth[0] - depth[1])


def run(mode, seeds, progress=lambda _: None):
    """Whether the profile holds the truth, and the pull (error over standard error), by parameter and curve."""
    scene = scene_of(mode)
    law = scene.contact_law(1.1 * DEEPEST)
    noise = ul.Noise(force=NOISE * law.pull_off_force)
    truth = scene.parameters
    held = {path: np.zeros(len(seeds), dtype=bool) for path in ASKED}
    pulls = {path: np.zeros(len(seeds)) for path in ASKED}
    for place, seed in enumerate(seeds):
        shift = np.random.default_rng([1, seed]).random() if mode == "cantilever" else 0.0
        depth = readings_of(mode, law, shift)
        curve = ul.synthesize(scene, depth, noise, rng=seed)
        fit = ul.fit(ul.Problem(scene.with_values(WRONG), curve, FREE, noise))
        threshold = interval_threshold(fit, LEVEL)
        for path in ASKED:
            held[path][place] = delta_chi_square_at(fit, path, truth[path]) <= threshold
            pulls[path][place] = (fit.values[path] - truth[path]) / fit.stderr[path]
        progress(place)
    return held, pulls


def summary(mode, held, pulls):
    """Row of the stored study."""
    return {
        "mode": mode,
        "curves": len(held[ASKED[0]]),
        "profile": {path: float(inside.mean()) for path, inside in held.items()},
        "standard error": {path: float((np.abs(pull) < WIDTH).mean()) for path, pull in pulls.items()},
        "sd of the pulls": {path: round(float(pull.std()), 3) for path, pull in pulls.items()},
        "mean of the pulls": {path: round(float(pull.mean()), 3) for path, pull in pulls.items()},
    }


def _store(path, row):
    """Put a row into the stored study; those of other modes stay."""
    stored = json.loads(path.read_text())["modes"] if path.exists() else []
    rows = {entry["mode"]: entry for entry in stored} | {row["mode"]: row}
    ordered = [rows[mode] for mode in MODES if mode in rows]
    path.write_text(json.dumps({"level": LEVEL, "points": POINTS, "modes": ordered}, indent=2) + "\n")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--modes", nargs="*", default=MODES, choices=MODES)
    parser.add_argument("--curves", type=int, default=500, help="curves per mode")
    parser.add_argument("--output", type=Path, default=Path(__file__).with_suffix(".json"))
    arguments = parser.parse_args()
    for mode in arguments.modes:
        told = run(
            mode, range(arguments.curves), lambda n, mode=mode: (n + 1) % 50 or print(mode, n + 1, flush=True)
        )
        row = summary(mode, *told)
        print(
            f"{mode}: " + ", ".join(f"{path} {100.0 * share:.1f} %" for path, share in row["profile"].items())
        )
        _store(arguments.output, row)


if __name__ == "__main__":
    main()
