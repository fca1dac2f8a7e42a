"""A curve before it is fitted, with what two laws make of it where its contact point is held."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.data.curve import Curve
from underlay.report.canvas import Canvas
from underlay.report.plots.style import DATA, FIT, GREY, PAGE, REFERENCE, drawn, style, unit_for

__all__ = ["canvas", "laws"]

# More points than the picture has pixels only make it slow.
_MOST_POINTS = 1500
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
            step = max(1, len(points) // _MOST_POINTS)
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
