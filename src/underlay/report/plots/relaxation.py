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
    from underlay.scene.scene import Scene

__all__ = ["relaxation"]

_CURVE_POINTS = 200
# Draws of the fitted numbers behind a band of 95 %: its ends are known to a tenth of its width.
_DRAWS = 2000
_BAND = (2.5, 97.5)


def relaxation(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the modulus of a relaxing layer against time, with the band of 95 % that its fit leaves.

    The band is that of the fit's covariance; draws that are no relaxation are left out. It reaches from the
    sampling interval of the record to its length: about other times the record says nothing.

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
    band = _draws(result, scene, time)
    best = scene.parameters["layer.E"] * scene.layer.relaxation.modulus(time)
    name, pascal = unit_for(best, "pressure")
    with style():
        panel = axes(ax)
        if len(band):
            low, high = np.percentile(band, _BAND, axis=0)
            panel.fill_between(time, low / pascal, high / pascal, color=FIT, alpha=0.25, lw=0.0, label="95 %")
        panel.plot(time, best / pascal, color=FIT, label="fit")
        panel.set_xscale("log")
        panel.set_xlabel("time after a sudden strain (s)")
        panel.set_ylabel(f"layer modulus ({name})")
        panel.legend(loc="best")
    return panel


def _draws(result: Fit, scene: Scene, time: FloatArray) -> FloatArray:
    """Modulus (Pa) at times (s), (draws, n), by numbers drawn from the covariance of a fit."""
    paths = [name for name in result.names if name == "layer.E" or name.startswith("layer.relaxation.")]
    rows = [result.names.index(name) for name in paths]
    covariance = np.asarray(result.covariance)[np.ix_(rows, rows)]
    middle = np.array([result.values[name] for name in paths])
    drawn = np.random.default_rng(0).multivariate_normal(middle, covariance, size=_DRAWS if paths else 0)
    moduli = []
    for numbers in drawn.tolist():
        try:
            layer = scene.with_values(dict(zip(paths, numbers, strict=True))).layer
        except InputError:
            continue
        if layer.relaxation is not None:
            moduli.append(layer.material.E * layer.relaxation.modulus(time))
    return np.array(moduli)
