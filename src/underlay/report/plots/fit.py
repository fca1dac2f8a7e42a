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

__all__ = ["fit", "fit_in_time", "fit_log"]

# More points than the picture has pixels only make the file heavy.
_MOST_POINTS = 4000
# Share of the contact that is shown of the flat part before it; share of the depth from which logarithms are drawn.
_BEFORE, _SHALLOWEST = 0.35, 3e-3


def fit(result: Fit, *, curve: int = 0, whole: bool = False, ax: Axes | None = None) -> Axes:
    """Draw a fit, from shortly before contact: of a long approach the flat line would be all there is to see.

    Parameters
    ----------
    result : Fit
        What `fit` returned.
    curve : int, default 0
        Which curve of a joint fit.
    whole : bool, default False
        Draw all points, however long the approach.
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
            depth / mm,
            scene.force(depth, time, solver=result.solver) / newton,
            color=FIT,
            label=_fitted(result),
        )
        if scene.substrate is not None:
            bare = halfspace_of(scene).force(depth, time)
            upper.plot(depth / mm, bare / newton, "--", color=REFERENCE, label="half-space, same modulus")
        upper.legend(loc="upper left")
        lower.set_xlabel(f"depth ({length})")
        if not whole:
            _zoom(upper, measured.depth / mm, scene.instrument.contact_depth / mm)
    return upper


def _fitted(result: Fit) -> str:
    """Name of the line of the optimum: where nobody stated the noise, what is stated is averaged, and another."""
    return "least-squares fit, before averaging" if result.problem.noise_is_open else "fit"


def _zoom(panel: Axes, depth: FloatArray, contact: float) -> None:
    """Show what is about the contact, in the unit of the picture; all of it where that is most of the curve."""
    deepest = float(depth.max())
    first = contact - _BEFORE * (deepest - contact)
    if deepest > contact and first - float(depth.min()) > _BEFORE * (deepest - contact):
        margin = 0.02 * (deepest - first)
        panel.set_xlim(first - margin, deepest + margin)


def fit_log(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw force since the baseline against depth since contact, both logarithmic, with slopes to compare with.

    A paraboloid on a half-space has slope 3/2, a cone 2; a substrate bends the curve upwards, a wrong contact point
    at its shallow end.

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
        If the tip sticks, or the curve has no point beyond contact under force.
    """
    measured, scene = result.curves[curve], result.scenes[curve]
    if scene.adhesion is not None:
        raise InputError("a tip that sticks pulls: its forces have no logarithm")
    chain = scene.instrument.chain
    offset = chain.reading(np.zeros(len(measured)), measured.depth)
    travel, force = chain.travel(measured.depth), measured.force - offset
    fitted = force - result.residuals[curve]
    seen = (travel > 0.0) & (fitted > 0.0)
    if not seen.any():
        raise InputError("no point of this curve lies beyond contact under force")
    # Noise about zero has no logarithm: what lies below a thousandth of the depth says nothing here.
    seen &= travel > _SHALLOWEST * travel.max()
    length, metre = unit_for(travel[seen], "length")
    load, newton = unit_for(force[seen], "force")
    with style():
        panel = axes(ax, height=3.2)
        shown = seen & (force > 0.0)
        step = max(1, np.count_nonzero(shown) // _MOST_POINTS)
        x, y = travel[shown][::step] / metre, force[shown][::step] / newton
        panel.loglog(x, y, ".", ms=2.2, color=DATA, label="measured")
        order = np.argsort(travel[seen])
        panel.plot(
            travel[seen][order] / metre, fitted[seen][order] / newton, color=FIT, label=_fitted(result)
        )
        low, high = float(fitted[seen].min()) / newton, float(force.max()) / newton
        _slopes(panel, float(travel.max()) / metre, high)
        panel.set_ylim(0.5 * low, 2.0 * high)
        panel.set_xlabel(f"depth since contact ({length})")
        panel.set_ylabel(f"force ({load})")
        panel.legend(loc="upper left")
    return panel


def _slopes(panel: Axes, depth: float, force: float) -> None:
    """Lines of slope 3/2 and 2 through the deepest point."""
    ends = np.array([0.03, 1.0])
    for power, dashes in ((1.5, "--"), (2.0, ":")):
        panel.plot(
            depth * ends, force * ends**power, dashes, color=REFERENCE, lw=1.0, label=f"slope {power:g}"
        )


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
        upper.plot(measured.time, (measured.force - residual) / newton, color=FIT, label=_fitted(result))
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
