"""Pictures of a curve and its fit: against depth, in logarithms, against time, and by segments.

`fit` shows data, fit, the best half-space fit and residuals; `laws` a curve before it is fitted, with contact
models at a given contact point; `relaxation` and `drainage` the fitted time course; `segments` loading, hold and
unloading of a curve. `canvas` returns a picture with the position of its axes, for pages that draw over it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.errors import InputError
from underlay.report.plots import style
from underlay.report.screen import half_space_fit

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

# Share of the depth from which logarithms are drawn.
_SHALLOWEST = 3e-3
# Points over which the residual of a comparison is averaged, as a share of the curve.
_SMOOTHED = 0.015
_LATE = 0.75  # share of a record, and of its force, beyond which labels have room if nothing is there
# Of a picture on a page: crisp enough, and drawn in half the time of one for print.
_DPI = 130
#: Colour and stroke of the laws beside a curve, in their order.
LAW_STROKES = ((style.FIT, "-"), (style.REFERENCE, "--"))
_CURVE_POINTS = 60
_COLOURS = {LOADING: style.FIT, HOLD: style.DATA, UNLOADING: style.REFERENCE}
_MARKS = {LOADING: ".", HOLD: "s", UNLOADING: "x"}


@dataclass(frozen=True)
class Canvas:
    """A picture as bytes, with the position of its axes in pixels.

    Parameters
    ----------
    data : bytes
        Content of a PNG file.
    width, height : int
        Size in pixels.
    left, right, top, bottom : float
        Sides of the axes, in pixels from the upper left corner.
    low, high : float
        Ends of the horizontal axis (SI).
    floor, ceiling : float
        Ends of the vertical axis (SI), where they were given.
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
    floor: float = 0.0
    ceiling: float = 1.0


def fit(
    result: Fit, *, curve: int = 0, whole: bool = False, half_space: Fit | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a fit against indentation from its contact point, with the residuals below.

    Of a long approach only the last part before contact is shown, so that the contact fills the picture.

    Parameters
    ----------
    result : Fit
        What `fit` returned.
    curve : int, default 0
        Which curve of a joint fit.
    whole : bool, default False
        Draw all points, however long the approach.
    half_space : Fit, optional
        Best half-space fit of the same curve, drawn dashed; by default it is computed.
    ax : matplotlib Axes, optional
        Where to draw; its lower part becomes a strip of residuals.

    Returns
    -------
    matplotlib Axes
        The upper axes.
    """
    x, metre, length = _indentation(result, curve)
    bare = half_space_fit(result) if half_space is None else half_space
    with style.style():
        upper, lower, newton, offset = _measured(result, curve, x / metre, ax)
        fitted = result.curves[curve].force - result.residuals[curve] - offset
        upper.plot(x / metre, fitted / newton, color=style.FIT, label="fit")
        words = [
            _contact_words(result, curve),
            ("measured", style.DATA),
            (f"{_model_words(result, curve)}, fitted", style.FIT),
        ]
        if bare is not None:
            words.append((_half_space_line(upper, lower, (bare, x / metre, newton, offset)), style.REFERENCE))
        for panel in (upper, lower):
            panel.axvline(0.0, color=style.ACCENT, lw=0.9, zorder=0.5)
        lower.set_xlabel(f"Indentation δ ({length})")
        if not whole:
            _zoom(upper, x / metre)
        _say(upper, words)
    return upper


def _indentation(result: Fit, curve: int) -> tuple[FloatArray, float, str]:
    """Return indentation from the contact point (m), (n,), and the unit of its axis: SI value and name."""
    instrument, measured = result.scenes[curve].instrument, result.curves[curve]
    force = measured.force - result.residuals[curve] - _offset(result, curve)
    indentation = instrument.chain.travel(measured.depth) - instrument.compliance * force
    length, metre = _axis_unit(indentation, "length")
    return indentation, metre, length


def _offset(result: Fit, curve: int) -> FloatArray:
    """Return the force readings that the instrument would give without contact (N), (n,)."""
    depth = result.curves[curve].depth
    return np.asarray(result.scenes[curve].instrument.chain.reading(np.zeros(len(depth)), depth))


def _axis_unit(values: FloatArray, kind: str) -> tuple[str, float]:
    """Return the unit (name, SI value) in which the largest of `values` is one or more: 286 µm, not 0.286 mm."""
    return style.unit_for(0.1 * values, kind)


def _model_words(result: Fit, curve: int) -> str:
    scene = result.scenes[curve]
    if scene.substrate is None:
        return "half-space"
    return "layers on substrate" if len(scene.layers) > 1 else "layer on substrate"


def _contact_words(result: Fit, curve: int) -> tuple[str, str]:
    """Return the label of the contact point, with its uncertainty where it was fitted, and its colour."""
    names = ("instrument.contact_depth", f"instrument.contact_depth[{curve}]")
    name = next((name for name in names if name in result.names), "")
    known = result.answer(name) if name else None
    if known is None or known.is_open:
        return "contact point", style.ACCENT
    half = style.in_words(max(known.high - known.value, known.value - known.low), "length", digits=2)
    return f"contact point, δ = 0 ± {half}", style.ACCENT


def _half_space_line(upper: Axes, lower: Axes, what: tuple[Fit, FloatArray, float, FloatArray]) -> str:
    """Draw the best half-space fit and its smoothed residual; return its label.

    `what` is that fit, the indentation in units of the axis, the unit of force (N), and the force without contact
    (N).
    """
    bare, x, newton, offset = what
    (residual,), (measured,) = bare.residuals, bare.curves
    how: Any = {"lw": 1.2, "color": style.REFERENCE, "label": "half-space, best fit"}
    upper.plot(x, (measured.force - residual - offset) / newton, "--", **how)
    width = max(1, round(_SMOOTHED * len(residual)))
    smooth = np.convolve(residual, np.full(width, 1.0 / width), "valid")
    first = (len(residual) - len(smooth)) // 2
    lower.plot(x[first : first + len(smooth)], smooth / newton, color=style.REFERENCE, lw=1.0)
    return f"half-space (Hertz), best fit: {style.in_words(bare.values['layer.E'], 'pressure', digits=3)}"


def _say(panel: Axes, words: Sequence[tuple[str, str]], *, right: bool = False) -> None:
    """Write labels in the colours of their marks, from the top left down, where a rising curve leaves room.

    With `right` they are at the top right.
    """
    left = panel.transAxes.inverted().transform(panel.transData.transform((0.0, 0.0)))[0]
    place = max(float(left), 0.0) + 0.02 if left < 0.45 else 0.02
    where: Any = {"xycoords": "axes fraction", "textcoords": "offset points", "va": "top"}
    if right:
        place, where["ha"] = 0.98, "right"
    for row, (text, colour) in enumerate(words):
        panel.annotate(text, (place, 0.985), xytext=(0.0, -11.0 * row), color=colour, **where)


def _zoom(panel: Axes, x: FloatArray) -> None:
    """Limit the axis to the contact and a short part before it, unless that is most of the curve anyway."""
    deepest = float(x.max())
    first = -style.BEFORE * deepest
    if deepest > 0.0 and first - float(x.min()) > style.BEFORE * deepest:
        margin = 0.02 * (deepest - first)
        panel.set_xlim(first - margin, deepest + margin)


def fit_log(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw force above the baseline against indentation, both logarithmic, with lines of slope 3/2 and 2.

    A paraboloid on a half-space has slope 3/2, a cone 2; a substrate bends the curve upwards, a wrong contact point
    bends it at its shallow end.

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
        If the scene has adhesion (negative forces), or the curve has no point in contact with positive force.
    """
    measured, scene = result.curves[curve], result.scenes[curve]
    if scene.adheres:
        raise InputError("a tip that sticks pulls: its forces have no logarithm")
    travel, force = _indentation(result, curve)[0], measured.force - _offset(result, curve)
    fitted = force - result.residuals[curve]
    seen = (travel > 0.0) & (fitted > 0.0)
    if not seen.any():
        raise InputError("no point of this curve lies beyond contact under force")
    # Noise about zero has no logarithm: what lies below a thousandth of the depth says nothing here.
    seen &= travel > _SHALLOWEST * travel.max()
    length, metre = style.unit_for(travel[seen], "length")
    load, newton = style.unit_for(force[seen], "force")
    with style.panel(ax, height=3.2) as panel:
        shown = seen & (force > 0.0)
        step = max(1, np.count_nonzero(shown) // style.MOST_POINTS)
        x, y = travel[shown][::step] / metre, force[shown][::step] / newton
        panel.loglog(x, y, ".", ms=2.2, color=style.DATA, label="measured")
        order = np.argsort(travel[seen])
        panel.plot(travel[seen][order] / metre, fitted[seen][order] / newton, color=style.FIT, label="fit")
        low, high = float(fitted[seen].min()) / newton, float(force.max()) / newton
        _slopes(panel, float(travel.max()) / metre, high)
        panel.set_ylim(0.5 * low, 2.0 * high)
        panel.set(xlabel=f"indentation ({length})", ylabel=f"force ({load})")
        panel.legend(loc="upper left")
    return panel


def _slopes(panel: Axes, depth: float, force: float) -> None:
    """Draw lines of slope 3/2 and 2 through the deepest point, given in units of the axes."""
    ends = np.array([0.03, 1.0])
    for power, dashes in ((1.5, "--"), (2.0, ":")):
        panel.plot(
            depth * ends, force * ends**power, dashes, color=style.REFERENCE, lw=1.0, label=f"slope {power:g}"
        )


def fit_in_time(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the force of one curve of a fit against time, with its residuals below.

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
    with style.style():
        upper, lower, newton, offset = _measured(result, curve, measured.time, ax)
        upper.plot(measured.time, (measured.force - residual - offset) / newton, color=style.FIT, label="fit")
        late = measured.force[measured.time > measured.time[0] + _LATE * np.ptp(measured.time)]
        # A force that has fallen by then leaves room on the right.
        falls = late.size > 0 and float(late.max()) < measured.force.min() + _LATE * np.ptp(measured.force)
        _say(upper, [("measured", style.DATA), ("fit", style.FIT)], right=falls)
        lower.set_xlabel("Time (s)")
    return upper


def _measured(
    result: Fit, curve: int, x: FloatArray, ax: Axes | None
) -> tuple[Axes, Axes, float, FloatArray]:
    """Draw measured forces and residuals against `x`, (n,).

    Returns the axes, the strip of residuals, the unit of force (N), and the force without contact (N), (n,).
    """
    measured, residual, offset = result.curves[curve], result.residuals[curve], _offset(result, curve)
    load, newton = _axis_unit(measured.force - offset, "force")
    step = -(-len(x) // style.MOST_POINTS)
    upper, lower = style.with_strip(style.axes(ax, height=3.4))
    dots: dict[str, Any] = {"ms": 3.0, "mec": "none"}
    force = (measured.force - offset)[::step] / newton
    upper.plot(x[::step], force, "o", color=style.DATA, alpha=0.35, label="measured", **dots)
    upper.set_ylabel(f"Force F ({load})")
    upper.tick_params(labelbottom=False)
    if len(result.curves) > 1:
        upper.set_title(f"curve {curve + 1}")
    lower.axhline(0.0, color=style.GREY, lw=0.8, zorder=0.5)
    lower.plot(x[::step], residual[::step] / newton, "o", color=style.FIT, alpha=0.5, **dots | {"ms": 2.2})
    lower.set_ylabel(f"Residual ({load})")
    return upper, lower, newton, offset


def laws(
    curve: Curve,
    used: Curve,
    lines: Mapping[str, tuple[FloatArray, FloatArray]],
    *,
    contact: float = 0.0,
    view: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a measured curve against indentation, which of its points are fitted, and contact models over it.

    Parameters
    ----------
    curve : Curve
        The curve as it was read, with every segment.
    used : Curve
        The points that are fitted.
    lines : mapping of str to (depth, force)
        Depth and force readings (m, N) of each contact model, by name.
    contact : float, default 0.0
        Depth reading of the contact point (m), from which indentation is counted.
    view : (float, float), optional
        Ends of the axis as depth readings (m); by default those of the curve.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        The axes.
    """
    low, high = view or (float(np.min(curve.depth)), float(np.max(curve.depth)))
    length, metre = _axis_unit(np.array([low - contact, high - contact]), "length")
    load, newton = _axis_unit(np.array(force_ends(curve, low, high)), "force")
    with style.style():
        # Page width with fixed margins: a computed layout draws the picture three times.
        ax = ax or plt.figure(figsize=(style.PAGE, 3.9)).add_axes((0.085, 0.12, 0.9, 0.86))
        words = [
            ("measured", style.SOFT),
            *([("used in the fit", style.DATA)] if len(used) < len(curve) else []),
        ]
        for points, colour in ((curve, style.GREY), (used, style.DATA)):
            inside = np.flatnonzero((points.depth >= low) & (points.depth <= high))
            step = inside[:: max(1, len(inside) // style.MOST_POINTS)]
            x, y = (points.depth[step] - contact) / metre, points.force[step] / newton
            ax.plot(x, y, ".", ms=3.0, color=colour)
        for (label, (depth, force)), (colour, stroke) in zip(lines.items(), LAW_STROKES, strict=False):
            ax.plot((depth - contact) / metre, force / newton, stroke, color=colour)
            words.append((label, colour))
        ax.set_xlim((low - contact) / metre, (high - contact) / metre)
        ax.set_ylim(*(end / newton for end in force_ends(curve, low, high)))
        ax.set(xlabel=f"Indentation δ ({length})", ylabel=f"Force F ({load})")
        _say(ax, words)
    return ax


def force_ends(curve: Curve, low: float, high: float) -> tuple[float, float]:
    """Return the ends of the vertical axis (N) on which a curve is drawn between two depth readings (m)."""
    shown = (curve.depth >= low) & (curve.depth <= high)
    forces = curve.force[shown] if shown.any() else curve.force
    least, most = float(np.min(forces)), float(np.max(forces))
    room = 0.06 * (most - least)
    return least - room, most + room


def canvas(ax: Axes, across: tuple[float, float], up: tuple[float, float] = (0.0, 1.0)) -> Canvas:
    """Return the figure of `ax` as PNG with the position of its axes, and close it.

    Parameters
    ----------
    ax : matplotlib Axes
        The only axes of their figure.
    across, up : (float, float)
        Ends (SI) of the horizontal and of the vertical axis.
    """
    data = style.drawn(ax, dpi=_DPI)
    # 24 bytes in, a PNG says its size.
    width, height = (int.from_bytes(data[start : start + 4], "big") for start in (16, 20))
    box = ax.get_position()
    sides = (box.x0 * width, box.x1 * width, (1.0 - box.y1) * height, (1.0 - box.y0) * height)
    # Plain floats: what numpy's write of themselves is no number to anyone else.
    return Canvas(data, width, height, *map(float, (*sides, *across, *up)))


def relaxation(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the modulus of a relaxing layer against time, with its 95 % confidence band.

    The band is that of `Fit.band`, point by point. It reaches from the sampling interval of the record to its
    length: other times are not measured.

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
        """Return the in-plane modulus (Pa) of each row of parameters (k,) at the times (n,): (k, n)."""
        layers = [member.scene_at(row).layer for row in physical]
        return np.stack([one.material.E * one.relaxation.modulus(time) for one in layers if one.relaxation])

    low, middle, high = result.band(moduli)
    name, pascal = style.unit_for(middle, "pressure")
    with style.panel(ax) as panel:
        if np.isfinite(low).all():
            panel.fill_between(
                time, low / pascal, high / pascal, color=style.FIT, alpha=0.25, lw=0.0, label="95 %"
            )
        panel.plot(time, middle / pascal, color=style.FIT, label="fit")
        panel.set(xscale="log", xlabel="time after a sudden strain (s)", ylabel=f"layer modulus ({name})")
        panel.legend(loc="best")
    return panel


def drainage(result: Fit, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the normalised force g that is left to relax in the last hold, against the square root of time.

    g = (F - F_end)/(F_peak - F_end), with peak and end force of the fit: drainage begins as a straight line in this
    picture, and its time scales with the square of the contact radius.

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
        If the layer does not drain.
    """
    measured, residual = result.curves[curve], result.residuals[curve]
    if not result.scenes[curve].layer.material.drains or measured.time is None:
        raise InputError("this layer does not drain: there is nothing to draw against the root of time")
    fitted = measured.force - residual
    peak = len(fitted) - 1 - int(np.argmax(fitted[::-1]))
    held = slice(peak, None)
    root = np.sqrt(measured.time[held] - measured.time[peak])
    step = -(-len(root) // style.MOST_POINTS)
    with style.panel(ax) as panel:
        for force, how in ((measured.force, "o"), (fitted, "-")):
            left = (force[held] - fitted[-1]) / (fitted[peak] - fitted[-1])
            label, colour = ("fit", style.FIT) if how == "-" else ("measured", style.DATA)
            panel.plot(root[::step], left[::step], how, ms=2.5, color=colour, label=label)
        panel.set(xlabel="root of the time since the peak (s$^{1/2}$)", ylabel="force left to fall, g")
        panel.legend(loc="best")
    return panel


def segments(curve: Curve, *, title: str = "", ax: Axes | None = None) -> Axes:
    """Draw depth, and below it force, against time with every segment in its own colour and mark.

    Parameters
    ----------
    curve : Curve
        What `read` returned; without times it is drawn against the index of the points.
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
    length, mm = style.unit_for(curve.depth, "length")
    load, mN = style.unit_for(curve.force, "force")
    with style.style():
        upper, lower = style.with_strip(style.axes(ax, height=3.4), share=0.5)
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
