"""The small map of data_samples/joint: two made joints of three sites each, thinner towards the edge.

    python tests/studies/joint.py [FOLDER]

Modulus 0.9 and 1.3 MPa, spread by 10 % within a joint; each site has its own thickness, contact point and noise.
The truth stands in truth.csv.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import underlay as ul

FOLDER = Path(__file__).resolve().parents[2] / "data_samples" / "joint"
MADE = "# made by: python tests/studies/joint.py"
ANIMALS = {"A": 0.9e6, "B": 1.3e6}
DEPTH = np.linspace(-2e-5, 1.2e-4, 71)


def make(folder: Path = FOLDER) -> None:
    """Write the curves, what is known of each site, and the truth."""
    (folder / "curves").mkdir(parents=True, exist_ok=True)
    known = ["file,animal,x (mm),y (mm),thickness (mm)"]
    truth = ["file,E (Pa)"]
    for number, animal in enumerate(animal for animal in ANIMALS for _ in range(3)):
        rng = np.random.default_rng(number)
        thickness = round(float(rng.uniform(1.0, 1.8)), 2)
        modulus = ANIMALS[animal] * float(np.exp(0.1 * rng.standard_normal()))
        scene = ul.Scene(
            ul.Sphere(5e-4),
            ul.Layer(ul.Isotropic(modulus, 0.45), thickness * 1e-3),
            ul.RIGID,
            ul.Instrument(
                contact_depth=float(rng.uniform(-5e-6, 5e-6)), baseline=float(rng.normal(0.0, 1e-4))
            ),
        )
        curve = ul.synthesize(scene, DEPTH, ul.Noise(force=1e-4), number, solver=ul.Exact(rtol=1e-10))
        name = f"site-{number + 1}.csv"
        lines = [MADE, "depth (um),force (mN)"]
        lines += [f"{w * 1e6:.7g},{P * 1e3:.7g}" for w, P in zip(curve.depth, curve.force, strict=True)]
        (folder / "curves" / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
        known.append(f"{name},{animal},{number % 3},{number // 3},{thickness}")
        truth.append(f"{name},{modulus:.12g}")
    (folder / "manifest.csv").write_text("\n".join([MADE, *known]) + "\n", encoding="utf-8")
    (folder / "truth.csv").write_text("\n".join([MADE, *truth]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    make(*map(Path, sys.argv[1:2]))
