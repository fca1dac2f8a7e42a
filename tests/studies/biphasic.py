"""How often the intervals of a draining layer's E, nu and k hold the truth, and the shipped tables' errors.

::

    python tests/studies/biphasic.py FITS [sphere]
    python tests/studies/biphasic.py tables
"""

import sys
import time as clock
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / "src")]

import underlay as ul  # noqa: E402  after the path
from underlay.mechanics.biphasic import punch_table, tip_table  # noqa: E402

FREE = {"layer.E": None, "layer.nu": ul.Uniform(0.0, 0.48), "layer.permeability": None}
START = {"layer.E": 2e5, "layer.nu": 0.3, "layer.permeability": 3e-16}


def coverage(count, tip, depth, end):
    """Share of 95 % intervals (answers, statistical part) that hold the truth, and seconds of processor a fit."""
    layer = ul.Layer(ul.Biphasic(0.5e6, 0.2, 1e-15), 1e-3)
    scene = ul.Scene(tip, layer, ul.RIGID, drainage="solid", uncertainties="none")
    time = np.concatenate((np.linspace(0.0, 20.0, 40), 20.0 + np.geomspace(0.5, end, 160)))
    record = depth * np.minimum(time / 20.0, 1.0)
    noise = ul.Noise(force=0.01 * float(scene.force(record, time).max()))
    held, begun = np.zeros(len(FREE)), clock.process_time()
    for seed in range(count):
        curve = ul.synthesize(scene, record, noise, rng=seed, time=time)
        fit = ul.fit(ul.Problem(scene.with_values(START), curve, FREE))
        answers = [fit.answer(name) for name in FREE]
        held += [a.low <= scene.parameters[n] <= a.high for n, a in zip(FREE, answers, strict=True)]
    return dict(zip(FREE, (held / count).tolist(), strict=True)), (clock.process_time() - begun) / count


def tables():
    """Largest errors of both tables: 200 points of the punch's, 30 of the sphere's."""
    for drainage in ("solid", "porous"):
        print("punch", drainage, punch_table.measured_error(punch_table.shipped(drainage), 200, seed=1))
        print("tip", drainage, tip_table.measured_error(tip_table.shipped(drainage), 30, seed=1))


if __name__ == "__main__":
    if sys.argv[1] == "tables":
        tables()
    else:
        is_sphere = "sphere" in sys.argv[2:]
        test = (ul.Sphere(2e-3), 4e-5, 700.0) if is_sphere else (ul.FlatPunch(0.5e-3), 5e-5, 2000.0)
        shares, seconds = coverage(int(sys.argv[1]), *test)
        print(shares, f"{seconds:.2f} s a fit with its answers")
