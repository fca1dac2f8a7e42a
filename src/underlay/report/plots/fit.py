"""Pictures of a fit against depth and against time: data, fit, half-space of the same modulus, residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.errors import InputError
from underlay.inference.pointwise.explained import halfspace_of
from underlay.report.plots.style import DATA, FIT, REFERENCE, axes, style, unit_for, with_strip

if TYPE_CHECKING:
    from underlay._arrays import FloatArray
    from underlay.inference.least_squares import Fit

__all__ = ["fit", "fit_in_time"]

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
    if scene.memory is not None or scene.adhesion is not None:
        # Between the points nobody knows the time, nor whether the tip is on its way in or out.
        depth, time = measured.depth, measured.time
    length, mm = unit_for(measured.depth, "length")
    with style():
        upper, lower, newton = _measured(result, curve, measured.depth / mm, ax)
        upper.plot(
            depth / mm, scene.force(depth, time, solver=result.solver) / newton, color=FIT, label="fit"
        )
        if scene.substrate is not None:
            bare = halfspace_of(scene).force(depth, time)
            upper.plot(depth / mm, bare / newton, "--", color=REFERENCE, label="half-space, same modulus")
        upper.legend(loc="upper left")
        lower.set_xlabel(f"depth ({length})")
    return upper


def fit_in_time(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw one curve of a fit against time, with its residuals below.

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

    Raises
    ------
    InputError
        If the curve has no times.
    """
    measured, residual = result.curves[curve], result.residuals[curve]
    if measured.time is None:
        raise InputError("this curve has no times to be drawn against")
    with style():
        upper, lower, newton = _measured(result, curve, measured.time, ax)
        upper.plot(measured.time, (measured.force - residual) / newton, color=FIT, label="fit")
        upper.legend(loc="best")
        lower.set_xlabel("time (s)")
    return upper


def _measured(result: Fit, curve: int, x: FloatArray, ax: Axes | None) -> tuple[Axes, Axes, float]:
    """Draw measured forces and residuals against `x`, (n,); axes, strip, and the unit of the forces (N)."""
    measured, residual = result.curves[curve], result.residuals[curve]
    load, newton = unit_for(measured.force, "force")
    small, fine = unit_for(residual, "force")
    step = max(1, len(measured.depth) // _MOST_POINTS)
    upper, lower = with_strip(axes(ax, height=3.4))
    upper.plot(x[::step], measured.force[::step] / newton, ".", ms=2.2, color=DATA, label="measured")
    upper.set_ylabel(f"force ({load})")
    upper.tick_params(labelbottom=False)
    if len(result.curves) > 1:
        upper.set_title(f"curve {curve + 1}")
    lower.axhline(0.0, color=FIT, lw=1.0)
    lower.plot(x[::step], residual[::step] / fine, ".", ms=1.8, color=DATA)
    lower.set_ylabel(f"residual ({small})")
    return upper, lower, newton
