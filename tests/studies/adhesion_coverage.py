"""How often 95 % intervals of E, work of adhesion and contact point hold the truth, on made withdrawals.

    python tests/studies/adhesion_coverage.py [curves]

A paraboloid on a thin bonded layer, depth control down to and beyond the pull-off, white noise of 2 % of the
pull-off force; every fifth fit begins from the data alone, the others at the truth. 200 curves on 22 November 2026:
95.5 % (E), 94.0 % (work), 95.0 % (contact); standard deviations of the pulls 1.00, 1.02, 1.06.
"""

import sys

import numpy as np

import underlay as ul

SCENE = ul.Scene(
    ul.Paraboloid(1e-5),
    ul.Layer(ul.Isotropic(5e3, 0.45), 8e-6),
    ul.RIGID,
    instrument=ul.Instrument(contact_depth=2e-7),
    adhesion=ul.JKR(work=2e-4),
)
FREE = {
    "layer.E": ul.LogUniform(1e2, 1e6),
    "adhesion.work": ul.LogUniform(1e-6, 1e-1),
    "instrument.contact_depth": (-2e-6, 2e-6),
}
INSIDE = 1.959964
EVERY = 5


def main(curves):
    noise = ul.Noise(force=0.02 * SCENE.contact_law(2e-6).pull_off_force)
    depth = np.linspace(2e-6, -1e-6, 150)
    pulls = np.empty((curves, len(FREE)))
    for seed in range(curves):
        curve = ul.synthesize(SCENE, depth, noise, rng=seed)
        start = "given" if seed % EVERY else "scan"
        fit = ul.fit(ul.Problem(SCENE, curve, FREE, noise), start=start)
        pulls[seed] = [(fit.values[p] - SCENE.parameters[p]) / fit.stderr[p] for p in FREE]
    for path, pull in zip(FREE, pulls.T, strict=True):
        print(
            f"{path}: {100.0 * (np.abs(pull) < INSIDE).mean():.1f} % inside, sd of the pulls {pull.std():.3f}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
