"""What fits cost: the made curves of the table, a fit of each, and the plain Hertz fit of the same points."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.synthetic import synthesize
from underlay.inference.answer_cost import plain_hertz_fit
from underlay.inference.least_squares import fit
from underlay.inference.problem import Problem
from underlay.mechanics.body import Base, Layer
from underlay.mechanics.indenters import Indenter, Paraboloid
from underlay.mechanics.materials import Isotropic
from underlay.scene.instrument import Instrument
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

__all__ = ["exact_fit", "hertz_fit"]

_TIP, _NU, _E, _THICKNESS = Paraboloid(1e-3), 0.5, 3e6, 1e-3
# Of the table's depths (a/h up to 2): here a/h is up to 0.8, where thickness and base are both felt.
_SHARE = 0.2
_BEFORE, _CONTACT = 0.15, 0.05  # of the largest depth: where the readings begin, and where contact is
_NOISE = 0.005  # of the largest force
# The start, over the truth; the contact starts at zero.
_WRONG = {
    "layer.E": 3.0,
    "layer.nu": 0.8,
    "layer.thickness": 0.5,
    "substrate.E": 0.3,
    "instrument.contact_depth": 0.0,
}


def exact_fit(
    base: Base, free: Sequence[str], tip: Indenter = _TIP
) -> Callable[[FloatArray], Callable[[], object]]:
    """Fit the parameters at `free` with the exact law: a new problem each time, from a wrong start.

    Its noise is stated.
    """

    def prepare(depth: FloatArray) -> Callable[[], object]:
        scene, curve, noise = _measured(base, depth, tip)
        start = scene.with_values({path: scene.parameters[path] * _WRONG[path] for path in free})
        return lambda: fit(Problem(start, curve, free, noise=noise, solver="exact"))

    return prepare


def hertz_fit(base: Base) -> Callable[[FloatArray], Callable[[], object]]:
    """Fit Hertz's formula to the same points, from the same modulus and contact."""

    def prepare(depth: FloatArray) -> Callable[[], object]:
        curve = _measured(base, depth, _TIP)[1]
        start = _WRONG["layer.E"] * _E
        return lambda: plain_hertz_fit(curve.depth, curve.force, _TIP.radius, _NU, E=start)

    return prepare


def _measured(base: Base, depth: FloatArray, tip: Indenter) -> tuple[Scene, Curve, Noise]:
    """A scene, a curve of it with as many points as `depth` (m), and its noise."""
    deepest = _SHARE * float(depth[-1])
    layer = Layer(Isotropic(_E, _NU), _THICKNESS)
    scene = Scene(tip, layer, base, Instrument(contact_depth=_CONTACT * deepest))
    readings = np.linspace(-_BEFORE, 1.0, len(depth)) * deepest
    noise = Noise(force=_NOISE * float(scene.force(readings[-1])))
    return scene, synthesize(scene, readings, noise=noise, rng=0), noise
