"""Does a fit reach the optimum from a start that is wrong by orders of magnitude?

    python tests/studies/starts.py [--scenes 500] [--base-free] [--seed 0] [--output tests/studies/starts.json]

Random scenes whose curves fix modulus, thickness and contact; the modulus starts wrong by up to 1e3 and the
thickness by up to 10, either way. With the base free it is 0.06 to 60 times the layer, and starts wrong by up to
100; it need not be fixed. The optimum is that of a fit started at the truth, which may itself miss: "truth missed"
tells where it was left by more than the tolerance.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import underlay as ul

BASE = "substrate.E"
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
    noise = ul.Noise(force=NOISE * float(scene.force(readings[-1])))
    return scene, start, ul.synthesize(scene, readings, noise=noise, rng=rng)


def random_base(rng):
    """Return what `random_scene` does for a base that is free: of any modulus, from a wrong start of it too."""
    scene, start, curve = random_scene(rng)
    while scene.substrate is ul.RIGID:
        scene, start, curve = random_scene(rng)
    modulus = 20.0 * scene.parameters["layer.E"] * 10.0 ** rng.uniform(-2.5, 0.5)
    scene = scene.with_values({BASE: modulus})
    noise = ul.Noise(force=NOISE * float(scene.force(curve.depth[-1])))
    return (
        scene,
        start.with_values({BASE: modulus * 10.0 ** rng.uniform(-2.0, 2.0)}),
        ul.synthesize(scene, curve.depth, noise=noise, rng=rng),
    )


def missed(scenes, seed=0, *, base_free=False):
    """Numbers of the scenes whose wrong start ended elsewhere, with the rise of chi-square there.

    And those whose start at the truth did.
    """
    rng = np.random.default_rng(seed)
    free = (*FREE, BASE) if base_free else FREE
    found, truth = {}, {}
    for number in range(scenes):
        scene, start, curve = (random_base if base_free else random_scene)(rng)
        at_truth = ul.fit(ul.Problem(scene, curve, free), start="given")
        from_wrong = ul.fit(ul.Problem(start, curve, free))
        square = [float(np.square(result.residuals[0]).sum()) for result in (from_wrong, at_truth)]
        rise = (square[0] / square[1] - 1.0) * at_truth.statistics.chi_square
        if abs(rise) > TOLERANCE:
            (found if rise > 0.0 else truth)[number] = abs(rise)
    return found, truth


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--base-free", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path(__file__).with_suffix(".json"))
    arguments = parser.parse_args()
    found, truth = missed(arguments.scenes, arguments.seed, base_free=arguments.base_free)
    share = 1.0 - len(found) / arguments.scenes
    study = {"scenes": arguments.scenes, "reached": share, "missed (scene: rise of chi-square)": found}
    if truth:
        study["truth missed (scene: rise of chi-square)"] = truth
    # One file for all: what is asked again takes the place of what it was.
    stored = json.loads(arguments.output.read_text()) if arguments.output.exists() else {}
    kind = "base free" if arguments.base_free else "base known"
    stored[f"{kind}, seed {arguments.seed}"] = study
    arguments.output.write_text(json.dumps(stored, indent=2) + "\n")
    print(f"{100.0 * share:.1f} % of {arguments.scenes} reached the optimum")


if __name__ == "__main__":
    main()
