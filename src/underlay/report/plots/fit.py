"""Pictures of a curve, its fit, its segments and its relaxation.

A picture and where its axes lie in it, for pages that draw over it.

Pictures of a fit against depth and against time: data, fit, half-space of the same modulus, residuals.

A curve before it is fitted, with what two laws make of it where its contact point is held.

The relaxation that a fit found: modulus of the layer against time.

The segments of a curve: where it goes in, rests and comes back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import InputError
from underlay.inference.pointwise.explained import halfspace_of
from underlay.report.plots.style import (
    DATA,
    FIT,
    GREY,
    PAGE,
    REFERENCE,
    axes,
    drawn,
    style,
    unit_for,
    with_strip,
)

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.mechanics.body import Layer

__all__ = ["Canvas", "canvas", "fit", "fit_in_time", "fit_log", "laws", "relaxation", "segments"]


@dataclass(frozen=True)
class Canvas:
    """A picture as bytes, and where its horizontal axis lies in it.

    Parameters
    ----------
    data : bytes
        Of a PNG file.
    width, height : int
        In pixels.
    left, right, top, bottom : float
        Of the axes, in pixels from the upper left corner.
    low, high : float
        Ends of the horizontal axis (SI).
    """

    data: bytes
    width: int
    height: int
    left: float
    right: float
    top: float
    bottom: float
    low: float
    high: float


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


# More points than the picture has pixels only make it slow.
_LAWS_MOST_POINTS = 1500


# Of a picture on a page: crisp enough, and drawn in half the time of one for print.
_DPI = 130


_LINES = ((FIT, "-"), (REFERENCE, "--"))


def laws(
    curve: Curve, used: Curve, lines: Mapping[str, tuple[FloatArray, FloatArray]], *, ax: Axes | None = None
) -> Axes:
    """Draw a measured curve, which of its points are used, and laws beside it.

    Parameters
    ----------
    curve : Curve
        As it was read, with every segment.
    used : Curve
        The points that are fitted.
    lines : mapping of str to (depth, force)
        What each law gives, readings (m, N).
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        The axes.
    """
    length, mm = unit_for(curve.depth, "length")
    load, newton = unit_for(curve.force, "force")
    with style():
        ax = _wide_axes() if ax is None else ax
        for points, colour, label in ((curve, GREY, "measured"), (used, DATA, "used in the fit")):
            step = max(1, len(points) // _LAWS_MOST_POINTS)
            ax.plot(
                points.depth[::step] / mm,
                points.force[::step] / newton,
                ".",
                ms=3.0,
                color=colour,
                label=label,
            )
        for (label, (depth, force)), (colour, stroke) in zip(lines.items(), _LINES, strict=False):
            ax.plot(depth / mm, force / newton, stroke, color=colour, label=label)
        ax.set_xlim(float(np.min(curve.depth)) / mm, float(np.max(curve.depth)) / mm)
        low, high = float(np.min(curve.force)), float(np.max(curve.force))
        room = 0.06 * (high - low)
        ax.set_ylim((low - room) / newton, (high + room) / newton)
        ax.set(xlabel=f"depth reading ({length})", ylabel=f"force ({load})")
        ax.legend(loc="upper left")
    return ax


def _wide_axes() -> Axes:
    """Axes with margins by hand: a layout that is computed draws the picture three times."""
    return plt.figure(figsize=(PAGE, 3.9)).add_axes((0.085, 0.12, 0.9, 0.86))


def canvas(ax: Axes, metre: float) -> Canvas:
    """Return the picture of `ax` with the place of its axis; `metre` is the SI value of one unit of that axis."""
    data = drawn(ax, dpi=_DPI)
    # 24 bytes in, a PNG says its size.
    width, height = (int.from_bytes(data[start : start + 4], "big") for start in (16, 20))
    box = ax.get_position()
    # Plain floats: what numpy's write of themselves is no number to anyone else.
    low, high = map(float, ax.get_xlim())
    return Canvas(
        data,
        width,
        height,
        float(box.x0 * width),
        float(box.x1 * width),
        float((1.0 - box.y1) * height),
        float((1.0 - box.y0) * height),
        low * metre,
        high * metre,
    )


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


_COLOURS = {LOADING: FIT, HOLD: DATA, UNLOADING: REFERENCE}


_MARKS = {LOADING: ".", HOLD: "s", UNLOADING: "x"}


def segments(curve: Curve, *, title: str = "", ax: Axes | None = None) -> Axes:
    """Draw depth, and below it force, against time with every segment in its own colour and mark.

    Parameters
    ----------
    curve : Curve
        What `read` returned; without times the number of the point serves.
    title : str, optional
        Written above, e.g. which curve it is.
    ax : matplotlib Axes, optional
        Where to draw; its lower part becomes the strip with the force.

    Returns
    -------
    matplotlib Axes
        The upper axes.
    """
    labels = curve.segments()
    clock = np.arange(len(curve)) if curve.time is None else curve.time
    length, mm = unit_for(curve.depth, "length")
    load, mN = unit_for(curve.force, "force")
    with style():
        upper, lower = with_strip(axes(ax, height=3.4), share=0.5)
        for label, colour in _COLOURS.items():
            chosen = labels == label
            if chosen.any():
                for part, values in ((upper, curve.depth / mm), (lower, curve.force / mN)):
                    part.plot(clock[chosen], values[chosen], _MARKS[label], color=colour, ms=2.5, label=label)
        upper.set_ylabel(f"depth ({length})")
        upper.tick_params(labelbottom=False)
        upper.legend(loc="best")
        upper.set_title(title)
        lower.set_ylabel(f"force ({load})")
        lower.set_xlabel("point" if curve.time is None else "time (s)")
    return upper
