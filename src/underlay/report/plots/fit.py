"""The picture of a fit: data, fitted curve, what a half-space of the same modulus would do, residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.mechanics.body import Layer
from underlay.report.plots.style import DATA, FIT, REFERENCE, axes, style, unit_for, with_strip
from underlay.scene.scene import Scene

if TYPE_CHECKING:
    from underlay.inference.least_squares import Fit

__all__ = ["fit"]

# More points than the picture has pixels only make the file heavy.
_MOST_POINTS = 4000


def fit(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw a fit.

    Parameters
    ----------
    result : Fit
        What `fit` returned.
    curve : int, default 0
        Which curve of a joint fit.
    ax : matplotlib Axes, optional
        Where to draw; its lower part becomes a strip of residuals.

    Returns
    -------
    matplotlib Axes
        The upper axes.
    """
    measured, scene = result.curves[curve], result.scenes[curve]
    depth, time = np.linspace(measured.depth.min(), measured.depth.max(), 400), None
    if scene.memory is not None:
        depth, time = measured.depth, measured.time  # between the points nobody knows the time
    length, mm = unit_for(measured.depth, "length")
    load, mN = unit_for(measured.force, "force")
    step = max(1, len(measured.depth) // _MOST_POINTS)
    with style():
        upper, lower = with_strip(axes(ax, height=3.4))
        upper.plot(
            measured.depth[::step] / mm,
            measured.force[::step] / mN,
            ".",
            ms=2.2,
            color=DATA,
            label="measured",
        )
        upper.plot(depth / mm, scene.force(depth, time, solver=result.solver) / mN, color=FIT, label="fit")
        if scene.substrate is not None:
            bare = halfspace_of(scene).force(depth)
            upper.plot(depth / mm, bare / mN, "--", color=REFERENCE, label="half-space, same modulus")
        upper.set_ylabel(f"force ({load})")
        upper.tick_params(labelbottom=False)
        upper.legend(loc="upper left")
        if len(result.curves) > 1:
            upper.set_title(f"curve {curve + 1}")
        residual = result.residuals[curve]
        small, uN = unit_for(residual, "force")
        lower.axhline(0.0, color=FIT, lw=1.0)
        lower.plot(measured.depth[::step] / mm, residual[::step] / uN, ".", ms=1.8, color=DATA)
        lower.set_xlabel(f"depth ({length})")
        lower.set_ylabel(f"residual ({small})")
    return upper


def halfspace_of(scene: Scene) -> Scene:
    """Return the scene with the layer made infinitely thick: what a half-space formula assumes."""
    return Scene(scene.indenter, Layer(scene.layer.material), None, scene.instrument)
