"""The relaxation that a fit found: modulus of the layer against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.errors import InputError
from underlay.report.plots.style import FIT, axes, style, unit_for

if TYPE_CHECKING:
    from underlay._arrays import FloatArray
    from underlay.inference.least_squares import Fit
    from underlay.mechanics.body import Layer

__all__ = ["relaxation"]

_CURVE_POINTS = 60


def relaxation(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the modulus of a relaxing layer against time, with the band of 95 % that its fit leaves.

    The band is that of `Fit.band`, point by point. It reaches from the sampling interval of the record to its
    length: about other times the record says nothing.

    Parameters
    ----------
    result : Fit
        What `fit` returned.
    curve : int, default 0
        Which curve of a joint fit.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If the layer does not relax.
    """
    scene, clock = result.scenes[curve], result.curves[curve].time
    if scene.layer.relaxation is None or clock is None:
        raise InputError("this layer does not relax: there is nothing to draw against time")
    time = np.geomspace(float(np.median(np.diff(clock))), float(clock[-1] - clock[0]), _CURVE_POINTS)
    member = result.problem.members[curve]

    def moduli(physical: FloatArray) -> FloatArray:
        return np.stack([_modulus(member.scene_at(row).layer, time) for row in physical])

    low, middle, high = result.band(moduli)
    name, pascal = unit_for(middle, "pressure")
    with style():
        panel = axes(ax)
        if np.isfinite(low).all():
            panel.fill_between(time, low / pascal, high / pascal, color=FIT, alpha=0.25, lw=0.0, label="95 %")
        panel.plot(time, middle / pascal, color=FIT, label="fit")
        panel.set_xscale("log")
        panel.set_xlabel("time after a sudden strain (s)")
        panel.set_ylabel(f"layer modulus ({name})")
        panel.legend(loc="best")
    return panel


def _modulus(layer: Layer, time: FloatArray) -> FloatArray:
    """In-plane modulus (Pa), (n,), of a relaxing layer at times (s), (n,), after a sudden strain."""
    if layer.relaxation is None:
        return np.full(len(time), layer.material.E)
    return np.asarray(layer.material.E * layer.relaxation.modulus(time))
