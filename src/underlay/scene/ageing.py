"""The force of a scene whose layer relaxes on an elastic base; see `mechanics.viscoelastic.elastic_base`."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.relaxation import Relaxation
from underlay.mechanics.response import Remembered, Response
from underlay.mechanics.solver import Solver
from underlay.mechanics.viscoelastic.elastic_base import QuasiElastic, punch_relaxation, stated_error
from underlay.mechanics.viscoelastic.history import Viscoelastic

# Largest tolerance of the laws of a punch, whose relaxation is exact: a rational function is fitted to them to
# 1e-8.
_FINE = 1e-9
# Share of the quasi-elastic error that the elastic laws may add.
_SHARE = 0.1


class Ageing(Protocol):
    """Interface of a scene with a relaxing layer, as the functions here use it."""

    @property
    def indenter(self) -> Indenter:
        """The tip that is pressed in."""

    def softened(self, share: float) -> Ageing:
        """The elastic scene with every modulus of the layer multiplied by `share`."""

    def contact_law(self, max_depth: float, *, solver: Solver) -> ContactLaw:
        """Elastic law of its contact up to a depth (m)."""


def is_punched(indenter: Indenter) -> bool:
    """Whether the contact radius is constant (a flat punch): then an elastic base is simulated exactly."""
    return indenter.has_edge


def ageing_response(
    scene: Ageing,
    relaxation: Relaxation,
    law: ContactLaw,
    solver: Solver,
    depth: FloatArray,
    time: FloatArray,
) -> Response:
    """Force response of a layer that relaxes on an elastic base: exact for a punch, else quasi-elastic.

    Parameters
    ----------
    scene : Ageing
        The scene, which gives elastic laws with softened layers.
    relaxation : Relaxation
        How the layer's moduli decay.
    law : ContactLaw
        Elastic law of the unrelaxed contact.
    solver : Solver
        What builds the laws of softened layers.
    depth, time : FloatArray
        Depths since contact (m) and times (s), each (n,).

    Raises
    ------
    InputError
        If the error of the quasi-elastic force exceeds the solver's tolerance.
    """
    reach = law.max_depth if np.isfinite(law.max_depth) else max(float(depth.max()), 1e-9)
    if is_punched(scene.indenter):
        solver = solver.with_tolerance(min(solver.tolerance, _FINE))
        modes = relaxation.modes(float(np.diff(time).min()), float(time[-1] - time[0]))
        whole = modes.constant + float(modes.weights.sum())
        punch = punch_relaxation(
            lambda share: float(
                scene.softened(share * whole).contact_law(reach, solver=solver).stiffness(0.5 * reach)
            ),
            type(modes)(modes.constant / whole, modes.weights / whole, modes.times),
        )
        scaled = scene.softened(whole).contact_law(reach, solver=solver)
        return Remembered(scaled, Viscoelastic(punch))
    error = stated_error(relaxation, time, depth)
    if solver.tolerance < error:
        raise InputError(refusal(error))
    solver = solver.with_tolerance(min(solver.tolerance, _SHARE * error))
    return QuasiElastic(
        lambda share: scene.softened(share).contact_law(reach, solver=solver), relaxation, reach
    )


def refusal(error: float) -> str:
    """Message that refuses a relaxing layer on an elastic base, with the relative error of the force."""
    return (
        "a layer that relaxes on an elastic base is simulated by the moduli of the moment, which here may be up to "
        f"{100.0 * error:.2g} % too low: ask for a tolerance (rtol) of {error:g} or more to accept that; a base "
        "1000 times stiffer, a rigid one, none at all, or a flat punch is exact"
    )
