"""Posteriors at random: scenes, what is free in them, and how much the data tell."""

import numpy as np

import underlay as ul

CONTACT, BASELINE = "instrument.contact_depth", "instrument.baseline"
#: What is free, with the base it needs: two to five parameters.
FREE = (
    ("rigid", ("layer.E", CONTACT)),
    ("rigid", ("layer.E", "layer.thickness")),
    ("rigid", ("layer.E", "layer.thickness", CONTACT)),
    ("none", ("layer.E", CONTACT, BASELINE)),
    ("rigid", ("layer.E", "layer.nu", CONTACT)),
    ("elastic", ("layer.E", "substrate.E", CONTACT)),
    ("elastic", ("layer.E", "layer.thickness", "substrate.E", CONTACT)),
    ("rigid", ("layer.E", "layer.thickness", CONTACT, BASELINE)),
    ("elastic", ("layer.E", "substrate.E", CONTACT, BASELINE)),
    ("elastic", ("layer.E", "layer.thickness", "substrate.E", CONTACT, BASELINE)),
)


def random_problem(seed):
    """A curve of a random scene and what is free in it, the same for the same seed."""
    rng = np.random.default_rng([seed, 2026])
    base, free = FREE[seed % len(FREE)]
    E, h = 10.0 ** rng.uniform(3.5, 7.5), 10.0 ** rng.uniform(-4.3, -2.7)
    # Contact radius over thickness at the deepest point, for a tip that touches with a^2 = R d or a = d tan.
    wide = 10.0 ** rng.uniform(-0.9, 0.4)
    deep = h * 10.0 ** rng.uniform(-1.7, -0.8)
    if rng.random() < 0.7:
        tip = ul.Paraboloid((wide * h) ** 2 / deep)
    else:
        tip = ul.Cone(float(np.arctan(min(wide * h / deep, 60.0))))
    nu = rng.uniform(0.2, 0.48)
    ratio = 10.0 ** rng.uniform(-1.0, 2.0)
    substrate = {"rigid": ul.RIGID, "none": None, "elastic": ul.Isotropic(E * ratio, 0.3)}[base]
    layer = ul.Layer(ul.Isotropic(E, nu)) if base == "none" else ul.Layer(ul.Isotropic(E, nu), h)
    scene = ul.Scene(tip, layer, substrate)
    depth = np.linspace(-0.1 * deep, deep, int(rng.integers(60, 400)))
    largest = float(scene.force(np.array([deep]), solver=ul.Auto(1e-4))[0])
    noise = ul.Noise(force=largest * 10.0 ** rng.uniform(-3.0, -1.5))
    curve = ul.synthesize(scene, depth, noise, rng, solver=ul.Auto(1e-4))
    priors = {
        "layer.E": ul.LogUniform(E / 100.0, E * 100.0),
        "layer.thickness": ul.LogUniform(h / 8.0, h * 8.0)
        if rng.random() < 0.6
        else ul.LogNormal(h * np.exp(rng.normal(0.0, 0.1)), 0.3),
        "layer.nu": ul.Uniform(0.05, 0.49),
        "substrate.E": ul.LogUniform(E * ratio / 300.0, E * ratio * 300.0),
        CONTACT: ul.Uniform(-0.1 * deep, 0.1 * deep),
        BASELINE: ul.Normal(0.0, 3.0 * noise.force),
    }
    return ul.Problem(scene, curve, {name: priors[name] for name in free}, noise, solver=ul.Auto(1e-4))
