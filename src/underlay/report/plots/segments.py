"""The segments of a curve: where it goes in, rests and comes back."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from underlay.data.curve import Curve
from underlay.data.segments import HOLD, LOADING, UNLOADING
from underlay.report.plots.style import DATA, FIT, REFERENCE, axes, style, unit_for, with_strip

__all__ = ["segments"]

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
