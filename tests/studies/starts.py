"""Does a fit reach the optimum from a start that is wrong by orders of magnitude?

    python tests/studies/starts.py [--scenes 500] [--output tests/studies/starts.json]

Random scenes whose curves fix modulus, thickness and contact; the modulus starts wrong by up to 1e3 and the
thickness by up to 10, either way. The optimum is that of a fit started at the truth.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.data.synthetic import synthesize
from underlay.inference.least_squares import fit
from underlay.inference.problem import Problem
from underlay.scene.noise import Noise

FREE = ("layer.E", "layer.thickness", "instrument.contact_depth")
NOISE = 0.001  # of the largest force
# A fit has missed if its chi-square is higher than the optimum's by more than this.
TOLERANCE = 0.01


def random_scene(rng):
    """Return a scene, the same with a wrong start, and a curve of it."""
    radius = 10.0 ** rng.uniform(-6.0, -2.0)
    thickness = radius * 10.0 ** rng.uniform(-0.5, 0.5)
    ratio = rng.uniform(0.3, 0.9)  # sqrt(R w_max) / h: where both E and h are told
    depth = (ratio * thickness) ** 2 / radius
    modulus = 10.0 ** rng.uniform(2.0, 9.0)
    base = ul.RIGID if rng.random() < 0.5 else ul.Isotropic(20.0 * modulus, 0.3)
    contact = rng.uniform(-0.3, 0.3) * depth
    scene = ul.Scene(
        ul.Paraboloid(radius),
        ul.Layer(ul.Isotropic(modulus, rng.uniform(0.2, 0.5)), thickness),
        base,
        ul.Instrument(contact_depth=contact),
    )
    wrong = (modulus * 10.0 ** rng.uniform(-3, 3), thickness * 10.0 ** rng.uniform(-1, 1), 0.0)
    start = scene.with_values(dict(zip(FREE, wrong, strict=True)))
    readings = np.linspace(contact - 0.4 * depth, contact + depth, 150)
    noise = Noise(force=NOISE * float(scene.force(readings[-1])))
    return scene, start, synthesize(scene, readings, noise=noise, rng=rng)


def missed(scenes, seed=0):
    """Numbers of the scenes whose wrong start ended elsewhere, with the rise of chi-square there."""
    rng = np.random.default_rng(seed)
    found = {}
    for number in range(scenes):
        scene, start, curve = random_scene(rng)
        at_truth = fit(Problem(scene, curve, FREE), start="given")
        from_wrong = fit(Problem(start, curve, FREE))
        square = [float(np.square(result.residuals[0]).sum()) for result in (from_wrong, at_truth)]
        rise = (square[0] / square[1] - 1.0) * at_truth.statistics.chi_square
        if rise > TOLERANCE:
            found[number] = rise
    return found


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--output", type=Path, default=Path(__file__).with_suffix(".json"))
    arguments = parser.parse_args()
    found = missed(arguments.scenes)
    share = 1.0 - len(found) / arguments.scenes
    study = {"scenes": arguments.scenes, "reached": share, "missed (scene: rise of chi-square)": found}
    arguments.output.write_text(json.dumps(study, indent=2) + "\n")
    print(f"{100.0 * share:.1f} % of {arguments.scenes} reached the optimum")


if __name__ == "__main__":
    main()
