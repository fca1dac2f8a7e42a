"""How often the intervals of a draining layer's E, nu and k hold the truth, and the shipped tables' errors.

The tests are a flat punch (a/h = 0.5) and a sphere, ramp of 20 s and hold, 200 points, noise 1 % of the peak, h
known. Each has a control that must fail: a record whose noise is alike for 30 s, fitted as white noise of its size.

::

    python tests/studies/biphasic.py coverage FITS     # writes tests/studies/results/biphasic_coverage.csv
    python tests/studies/biphasic.py tables
"""

import sys
import time as clock
from pathlib import Path

import numpy as np
import pandas as pd

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / "src")]

import underlay as ul  # noqa: E402  after the path
from underlay.mechanics.biphasic import punch_table, tip_table  # noqa: E402

RESULTS = Path(__file__).with_name("results") / "biphasic_coverage.csv"
FREE = {"layer.E": None, "layer.nu": ul.Uniform(0.0, 0.48), "layer.permeability": None}
START = {"layer.E": 2e5, "layer.nu": 0.3, "layer.permeability": 3e-16}
TESTS = {"punch": (ul.FlatPunch(0.5e-3), 5e-5, 2000.0), "sphere": (ul.Sphere(2e-3), 4e-5, 700.0)}
# Of the control's noise (s); fits of a block, and of its controls.
ALIKE, BLOCK, CONTROLS = 30.0, 50, 10


def coverage(tip, depth, end, seeds, *, control=False):
    """How many 95 % intervals (answers) hold the truth, by number, and seconds of processor a fit."""
    layer = ul.Layer(ul.Biphasic(0.5e6, 0.2, 1e-15), 1e-3)
    scene = ul.Scene(tip, layer, ul.RIGID, drainage="solid", uncertainties="none")
    time = np.concatenate((np.linspace(0.0, 20.0, 40), 20.0 + np.geomspace(0.5, end, 160)))
    record = depth * np.minimum(time / 20.0, 1.0)
    size = 0.01 * float(scene.force(record, time).max())
    noise = ul.Noise(force=size, correlation_time=ALIKE if control else 0.0)
    held, begun = dict.fromkeys(FREE, 0), clock.process_time()
    for seed in seeds:
        curve = ul.synthesize(scene, record, noise, rng=seed, time=time)
        told = {"noise": ul.Noise(force=size)} if control else {}
        fit = ul.fit(ul.Problem(scene.with_values(START), curve, FREE, **told))
        for name in FREE:
            answer = fit.answer(name)
            held[name] += answer.low <= scene.parameters[name] <= answer.high
    return held, (clock.process_time() - begun) / len(seeds)


def main(count):
    """All tests and their controls, a row each; in turn by blocks of seeds, and kept after every one."""
    found = {}
    for first in range(0, count, BLOCK):
        for control in (False, True):
            for name, test in TESTS.items():
                kind = f"{name}, correlated noise as white" if control else name
                seeds = range(first, min(first + (CONTROLS if control else BLOCK), count))
                held, seconds = coverage(*test, seeds, control=control)
                row = found.setdefault(kind, dict.fromkeys(("fits", *FREE, "seconds"), 0))
                for key, value in {"fits": len(seeds), **held, "seconds": seconds * len(seeds)}.items():
                    row[key] += value
        table = pd.DataFrame.from_dict(found, orient="index").rename_axis("test").round({"seconds": 1})
        fits = min(first + BLOCK, count)
        told = f"# python tests/studies/biphasic.py coverage {fits}\n# intervals that hold the truth\n"
        RESULTS.write_text(told + table.to_csv(lineterminator="\n"))
        print(table.to_string(), flush=True)


def tables():
    """Largest errors of both tables: 200 points of the punch's, 30 of the sphere's."""
    for drainage in ("solid", "porous"):
        print("punch", drainage, punch_table.measured_error(punch_table.shipped(drainage), 200, seed=1))
        print("tip", drainage, tip_table.measured_error(tip_table.shipped(drainage), 30, seed=1))


if __name__ == "__main__":
    if sys.argv[1] == "tables":
        tables()
    else:
        main(int(sys.argv[2]))
