"""Problems of known noise whose searches the tests of the engine watch."""

import numpy as np

import underlay as ul
from support.inverse import layer_on, measured, problem

E, H, C, BASE = "layer.E", "layer.thickness", "instrument.contact_depth", "substrate.E"
#: Base, what is free, and what the noise has beside its size.
CASES = {
    "rigid": (ul.RIGID, [E, H, C], {}),
    "known base": (ul.Isotropic(4e6, 0.3), [E, H, C], {}),
    "base": (ul.Isotropic(4e6, 0.3), [E, BASE, C, "instrument.baseline"], {}),
    "prior": (ul.RIGID, {E: None, H: ul.Normal(5e-4, 2e-5), C: None}, {}),
    "relative": (ul.RIGID, [E, C], {"relative": 0.01}),
    "correlated": (ul.RIGID, [E, H, C], {"correlation_time": 0.01}),
}


def posed(case):
    """A problem with a known noise."""
    base, free, more = CASES[case]
    scene = layer_on(base, baseline=2e-3)
    curve = measured(scene, level=0.003, **more)
    return problem(
        scene, free, curve, noise=ul.Noise(force=0.003 * float(np.ptp(scene.force(curve.depth))), **more)
    )
