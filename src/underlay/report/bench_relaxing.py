"""What a layer that relaxes costs: forces of a ramp with a hold and of a whole cycle, and a fit of the former."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.synthetic import synthesize
from underlay.inference.least_squares import fit
from underlay.inference.problem import Problem
from underlay.mechanics.relaxation import Prony
from underlay.mechanics.response import Remembered
from underlay.mechanics.solvers import Exact
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

__all__ = ["CYCLE", "RAMP_AND_HOLD", "relaxing_fit", "relaxing_force"]

#: Times (s) and shares of the largest depth between which the depth goes evenly.
Motion = tuple[tuple[float, ...], tuple[float, ...]]

RAMP_AND_HOLD: Motion = ((0.0, 1.0, 10.0), (0.0, 1.0, 1.0))
CYCLE: Motion = ((0.0, 4.0, 10.0), (0.0, 1.0, 0.0))
_THREE_TERMS = Prony((0.3, 0.2, 0.1), (0.1, 1.0, 10.0))
_TWO_TERMS = Prony((0.4, 0.3), (0.2, 3.0))
_NOISE = 0.005  # of the largest force
_SHARE = 0.2  # of the table's depths, as of the elastic fits
# The start, over the truth.
_WRONG = {
    "layer.E": 3.0,
    "layer.thickness": 0.5,
    "instrument.contact_depth": 0.0,
    "layer.relaxation.fractions[0]": 0.5,
    "layer.relaxation.fractions[1]": 0.5,
    "layer.relaxation.times[0]": 2.0,
    "layer.relaxation.times[1]": 2.0,
}


def relaxing_force(scene: Scene, motion: Motion) -> Callable[[FloatArray], Callable[[], object]]:
    """Forces of three Prony terms along a motion, from an elastic law that is there already."""
    layer = replace(scene.layer, relaxation=_THREE_TERMS)
    memory = replace(scene, layer=layer).memory

    def prepare(depth: FloatArray) -> Callable[[], object]:
        law, (path, time) = scene.contact_law(float(depth[-1]), solver=Exact(1e-6)), _moved(depth, motion)
        if memory is None:
            raise TypeError("a relaxing layer remembers")
        response = Remembered(law, memory)
        return lambda: response.force(path, time)

    return prepare


def relaxing_fit(
    scene: Scene, motion: Motion, wrong: Mapping[str, float] = _WRONG
) -> Callable[[FloatArray], Callable[[], object]]:
    """Fit E, thickness, contact and two Prony terms: a new problem each time, from a wrong start."""
    relaxing = replace(scene, layer=replace(scene.layer, relaxation=_TWO_TERMS))

    def prepare(depth: FloatArray) -> Callable[[], object]:
        path, time = _moved(_SHARE * depth, motion)
        noise = Noise(force=_NOISE * float(relaxing.force(path, time).max()))
        curve = synthesize(relaxing, path, noise, rng=0, time=time)
        start = relaxing.with_values({name: relaxing.parameters[name] * by for name, by in wrong.items()})
        return lambda: fit(Problem(start, curve, list(wrong), solver="exact"))

    return prepare


def _moved(depth: FloatArray, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Depths (m) and times (s), as many as `depth` has, up to its last."""
    times, shares = motion
    time = np.linspace(times[0], times[-1], len(depth))
    return float(depth[-1]) * np.interp(time, times, shares), time
