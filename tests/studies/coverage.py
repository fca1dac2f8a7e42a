"""How often do 95 % profile intervals hold the truth?

    python tests/studies/coverage.py [--replicas 1000] [--output tests/studies/coverage.json]

Every case draws curves from one scene with one kind of noise, fits each with the noise's own model, and asks
whether the truth is inside the profile interval of every parameter. Two cases fit AR(1) noise as if it were
white: their intervals must fail, and the fit must say so. The last is a curve with two optima.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import underlay as ul
from underlay.data.noise import Noise
from underlay.data.synthetic import synthesize
from underlay.inference.least_squares import fit
from underlay.inference.problem import Problem
from underlay.inference.profiles import interval_threshold, rise_at

LEVEL = 0.95
POINTS = 200
DEPTH = 2e-4
BASES = {"rigid": ul.RIGID, "elastic": ul.Isotropic(4e6, 0.3)}
FREE = {
    "E+contact": ("layer.E", "instrument.contact_depth"),
    "E+h+contact": ("layer.E", "layer.thickness", "instrument.contact_depth"),
}
#: Part of the largest force, of the force itself, and of the duration of the test.
NOISES = {
    "white": (0.002, 0.0, 0.0),
    "proportional": (0.001, 0.005, 0.0),
    "ar1": (0.002, 0.0, 0.02),
    # Three times as much, and the same curve of a layer on a rigid base has two optima: thin and soft, or
    # thick and stiff. The likelihood is then far from its asymptotic shape.
    "loud": (0.006, 0.0, 0.0),
}


@dataclass(frozen=True)
class Case:
    """One scene, one noise, one choice of free parameters, and the model the noise is fitted with."""

    base: str
    free: str
    noise: str
    fitted_as: str

    @property
    def name(self):
        return f"{self.base}, {self.free}, {self.noise} fitted as {self.fitted_as}"


def all_cases():
    own = [
        Case(base, free, noise, noise)
        for base in BASES
        for free in FREE
        for noise in ("white", "proportional", "ar1")
    ]
    return [
        *own,
        Case("rigid", "E+contact", "ar1", "white"),
        Case("rigid", "E+h+contact", "ar1", "white"),
        Case("rigid", "E+h+contact", "loud", "white"),
    ]


def run(case, replicas, seed=0):
    """Coverage of every free parameter, and how often the fit warned of correlated residuals."""
    scene = ul.Scene(
        ul.Paraboloid(1e-3),
        ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4),
        BASES[case.base],
        ul.Instrument(contact_depth=1e-5),
    )
    depth, time = np.linspace(-5e-5, DEPTH, POINTS), np.linspace(0.0, 1.0, POINTS)
    peak = float(scene.force(DEPTH))
    white, relative, tau = NOISES[case.noise]
    noise = Noise(force=white * peak, relative=relative, correlation_time=tau)
    # White noise is fitted with its size unknown, as most curves are; the others with their numbers.
    model = None if case.fitted_as == "white" else noise
    names = FREE[case.free]
    start = scene.with_values({"layer.E": 3e6, "instrument.contact_depth": 0.0})
    inside, warned, doubled = dict.fromkeys(names, 0), 0, 0
    for replica in range(replicas):
        curve = synthesize(scene, depth, time=time, noise=noise, rng=np.random.default_rng([seed, replica]))
        found = fit(Problem(start, curve, names, noise=model))
        threshold = interval_threshold(found, LEVEL)
        for name in names:
            inside[name] += rise_at(found, name, scene.parameters[name]) <= threshold
        doubled += bool(found.alternatives)
        warned += any(warning.code == "correlated-residuals" for warning in found.warnings)
    return {
        "case": case.name,
        "replicas": replicas,
        "coverage": {name: count / replicas for name, count in inside.items()},
        "warned": warned / replicas,
        "second optimum told": doubled / replicas,
    }


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--replicas", type=int, default=1000)
    parser.add_argument("--output", type=Path, default=Path(__file__).with_suffix(".json"))
    arguments = parser.parse_args()
    rows = []
    for case in all_cases():
        rows.append(run(case, arguments.replicas))
        found = ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in rows[-1]["coverage"].items())
        share = 100.0 * rows[-1]["warned"]
        print(f"{case.name}: {found}; warned {share:.1f} %", flush=True)
        study = {"level": LEVEL, "points": POINTS, "cases": rows}
        arguments.output.write_text(json.dumps(study, indent=2) + "\n")


if __name__ == "__main__":
    main()
