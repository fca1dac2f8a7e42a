"""What a fit costs with all that it states of itself, over the fit alone: an interval and a verdict."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from underlay.data.synthetic import simulate, synthesize
from underlay.inference.least_squares import fit
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.problem import Problem
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.indenters import Paraboloid
from underlay.mechanics.materials import Isotropic
from underlay.mechanics.relaxation import Prony
from underlay.report.bench_made import POINTS, over, scene_of
from underlay.scene.noise import Noise
from underlay.scene.scene import Scene

__all__ = ["STATED"]

_TIP, _GEL = Paraboloid(1e-3), Isotropic(3e6, 0.5)
_LAYER = scene_of(_TIP, RIGID)
_RELAXING = Scene(_TIP, Layer(_GEL, 1e-3, relaxation=Prony((0.4,), (0.3,))), RIGID)
_HALF_SPACE = Scene(_TIP, Layer(_GEL))


def _over_the_fit(made: Scene, fitted: Scene, *, noise_is_stated: bool = False) -> Callable[[int], float]:
    """A fit of modulus and contact with its interval and verdict over the fit alone, by rounds.

    The curve is one of the scene `made`, `fitted` with another one.
    """

    def measure(rounds: int) -> float:
        depth, time = np.linspace(-5e-5, 3.6e-4, POINTS), np.linspace(0.0, 1.0, POINTS)
        noise = Noise(force=0.005 * float(simulate(made, depth, time=time).force.max()))
        curve = synthesize(made, depth, noise=noise, rng=0, time=time)
        free = ("layer.E", "instrument.contact_depth")

        def found() -> Fit:
            return fit(Problem(fitted, curve, free, noise=noise if noise_is_stated else None))

        def stated() -> object:
            result = found()
            return result.interval("layer.E"), result.verdict

        return over(found, stated, rounds)

    return measure


#: What is fitted, and what measures it.
STATED = (
    ("noise stated", _over_the_fit(_LAYER, _LAYER, noise_is_stated=True)),
    ("noise not stated", _over_the_fit(_LAYER, _LAYER)),
    ("the sample relaxes", _over_the_fit(_RELAXING, _LAYER)),
    ("a layer taken for a half-space", _over_the_fit(_LAYER, _HALF_SPACE)),
)
