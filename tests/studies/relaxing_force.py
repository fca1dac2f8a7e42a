"""What the force of a relaxing layer costs, and which part of it no bookkeeping can spare.

    python tests/studies/relaxing_force.py

Three Prony terms at 1000 points, an elastic law that is there already. The unit is that law at the 1000 depths,
measured in turns; medians of the ratios go to ``results/relaxing_force.csv``. A fit prepares a motion once and asks
it for the law of every set of parameters that leaves contact point and relaxation as they are.

"Needed" sums what the constructions cannot do without, in bare numpy on arrays made before: the law at the points
that they ask, the recursions (one product with the loads, their growing sums, one product with what is left of
them, one sum over the terms), and on a way out one exponential for every point and term at each of the four places
where the formula has one: in the condition and in its derivative, to go on from the step before t1, and to come
back to the time of the point.
"""

from __future__ import annotations

import csv
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent.parent / "src")]

import underlay as ul  # noqa: E402  # after the path is set
from underlay.mechanics.response import Remembered  # noqa: E402

SCENE = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
PRONY = ul.Prony((0.3, 0.2, 0.1), (0.1, 1.0, 10.0))
MOTIONS = {
    "ramp of a tenth, hold": ((0.0, 1.0, 10.0), (0.0, 1.0, 1.0)),
    "ramp of a half, hold": ((0.0, 5.0, 10.0), (0.0, 1.0, 1.0)),
    "ramp": ((0.0, 10.0), (0.0, 1.0)),
    "in and out": ((0.0, 4.0, 10.0), (0.0, 1.0, 0.0)),
}
POINTS, DEEPEST, TURNS = 1000, 5e-5, 600


def needed(law: ul.ContactLaw, path: np.ndarray) -> Callable[[], object]:
    """The bare work that a motion's construction cannot do without; see above."""
    turn = int(path.argmax())
    w, out = path[: turn + 1], int((path[turn:] < path[turn]).sum())
    # Depths at t1, somewhere on the way in, are asked too.
    asked = np.concatenate((w, 0.5 * (w[1:] + w[:-1]), np.linspace(0.0, w[-1], out)))
    terms, weights = len(PRONY.times), np.asarray(PRONY.fractions)
    loads, left = np.random.default_rng(0).random((2, terms, len(w)))
    travelled, exponents = np.random.default_rng(1).random((2, terms, len(path)))
    exponents = -exponents[:, :out]

    def recursion(added: np.ndarray, factor: np.ndarray) -> np.ndarray:
        z = added * factor
        np.add.accumulate(z, axis=-1, out=z)
        z *= factor
        return weights @ z

    def call() -> None:
        law.force(asked)
        recursion(loads, left)
        if out:
            recursion(travelled, travelled)
            for _ in range(4):
                weights @ np.exp(exponents)

    return call


def measured() -> list[dict[str, object]]:
    """One row per motion."""
    law = SCENE.contact_law(DEEPEST, solver=ul.Exact(1e-6))
    memory = replace(SCENE, layer=replace(SCENE.layer, relaxation=PRONY)).memory
    rows = []
    for name, (times, shares) in MOTIONS.items():
        clock = np.linspace(times[0], times[-1], POINTS)
        path = DEEPEST * np.interp(clock, times, shares)
        response, prepared = Remembered(law, memory), memory.prepared(path, clock)
        calls = {
            "force": lambda r=response, p=path, t=clock: r.force(p, t),
            "prepared motion": lambda m=prepared: m(law.force),
            "needed": needed(law, path),
        }
        ratios: dict[str, list[float]] = {what: [] for what in calls}
        for _ in range(TURNS):
            unit = seconds(lambda p=path: law.force(p))
            for what, call in calls.items():
                ratios[what].append(seconds(call) / unit)
        rows.append({"motion": name} | {what: round(statistics.median(of), 2) for what, of in ratios.items()})
    return rows


def seconds(call: Callable[[], object]) -> float:
    """Processor time (s) of two calls."""
    begin = time.thread_time()
    call()
    call()
    return time.thread_time() - begin


def main() -> None:
    """Measure, print and store."""
    rows = measured()
    with (HERE / "results" / "relaxing_force.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows(rows)
    for row in rows:
        print(row)


if __name__ == "__main__":
    main()
