"""Moduli of a relaxation test as laboratories report them, without any fit of the transient.

The instantaneous one, before any water has moved, comes from the rise of the force over each ramp, by the elastic
law at nu = 0.5; the equilibrium one, after drainage, from the force at the end of each hold, by the law at the
drained Poisson's ratio. Each is the least-squares slope over all steps, for an isotropic layer of known thickness.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.errors import CurveError, InputError
from underlay.mechanics.materials import Isotropic
from underlay.scene.scene import Scene

# Last share of each hold, whose mean force is taken as the equilibrium force.
_LATE = 0.05
# Poisson's ratio before drainage.
_INCOMPRESSIBLE = 0.5


@dataclass(frozen=True)
class RelaxationModuli:
    """The two moduli that a laboratory reports from a relaxation test.

    Parameters
    ----------
    instantaneous, equilibrium : float
        Young's moduli (Pa): the initial one, of an incompressible layer, and the one after drainage.
    depth, peak, settled : ndarray (steps,)
        Depth (m) of each hold since contact, largest force (N) of its step and the force at its end.
    """

    instantaneous: float
    equilibrium: float
    depth: FloatArray
    peak: FloatArray
    settled: FloatArray


def relaxation_moduli(curve: Curve, scene: Scene) -> RelaxationModuli:
    """Instantaneous and equilibrium modulus of a record of ramps and holds.

    Parameters
    ----------
    curve : Curve
        One or more steps, with times.
    scene : Scene
        The test: tip, thickness, contact depth, baseline, and the drained Poisson's ratio of an isotropic layer.

    Returns
    -------
    RelaxationModuli

    Raises
    ------
    CurveError
        If there are no times, or no hold.
    InputError
        If the layer is not isotropic.
    """
    material = scene.layer.material
    if not material.isotropic:
        raise InputError("instantaneous and equilibrium moduli are reported of an isotropic layer")
    if curve.time is None:
        raise CurveError("a relaxation test needs the times of its points (s)")
    # Loaded only where it is used.
    from underlay.mechanics.biphasic.history import ramps_and_holds  # noqa: PLC0415  see above

    w = curve.depth - scene.instrument.contact_depth
    force = curve.force - scene.instrument.chain.reading(np.zeros_like(w), curve.depth)
    line = ramps_and_holds(w, curve.time).in_contact
    tops = np.flatnonzero(np.diff(line.value) > 0.0) + 1
    starts = [*line.time[tops - 1], curve.time[-1]]
    steps = [
        (float(line.value[top]), *_step(curve.time, force, starts[i : i + 2])) for i, top in enumerate(tops)
    ]
    if not steps:
        raise CurveError("a relaxation test has a ramp and a hold: the depth never rises")
    depth, peak, settled = np.array(steps).T
    quick, slow = (_unit_force(scene, nu, depth) for nu in (_INCOMPRESSIBLE, material.nu))
    rises = peak - np.concatenate(([0.0], settled[:-1]))
    grown = np.diff(quick, prepend=0.0)
    return RelaxationModuli(
        float(rises @ grown / (grown @ grown)), float(settled @ slow / (slow @ slow)), depth, peak, settled
    )


def _step(time: FloatArray, force: FloatArray, ends: list[float]) -> tuple[float, float]:
    """Largest force (N) of a step, between the starts of its ramp and of the next, and mean force at its end."""
    mine = np.flatnonzero((time >= ends[0]) & (time <= ends[1]))
    late = mine[-max(int(_LATE * mine.size), 1) :]
    return float(force[mine].max()), float(force[late].mean())


def _unit_force(scene: Scene, nu: float, depth: FloatArray) -> FloatArray:
    """Force (N), (steps,), on the elastic layer with Young's modulus 1 Pa and Poisson's ratio `nu`."""
    elastic = replace(scene.elastic, uncertainties=None)
    layer = replace(elastic.layer, material=Isotropic(1.0, nu))
    law = replace(elastic, layer=layer).contact_law(float(depth.max()))
    return np.asarray(law.force(depth))
