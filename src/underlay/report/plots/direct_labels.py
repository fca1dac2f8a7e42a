"""Names in a column beside the points they belong to: one look instead of a legend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.report.plots.style import GREY

__all__ = ["label_points"]

# Of the axes' height: the least distance of two names. Of its width: where the column begins.
_APART, _COLUMN = 0.045, 0.56
_MARGIN = 0.06
_PASSES = 500


def label_points(
    drawn: Axes, x: Sequence[float], y: Sequence[float], names: Sequence[str], colours: Sequence[str]
) -> None:
    """Write the names of points (x, y) in a column on the right of logarithmic axes, whose limits make room."""
    low, high = np.log(drawn.dataLim.intervalx)
    width = max(high - low, 1.0) / (_COLUMN - 2.0 * _MARGIN)
    drawn.set_xlim(np.exp(low - _MARGIN * width), np.exp(low + (1.0 - _MARGIN) * width))
    bottom, top = np.log(drawn.dataLim.intervaly)
    drawn.set_ylim(np.exp(bottom - _MARGIN * (top - bottom)), np.exp(top + _MARGIN * (top - bottom)))
    bottom, top = np.log(drawn.get_ylim())
    heights = (np.log(y) - bottom) / (top - bottom)
    order = np.argsort(heights, kind="stable")
    for index, height in zip(order.tolist(), _apart(heights[order]).tolist(), strict=True):
        drawn.annotate(
            names[index],
            (x[index], y[index]),
            xytext=(_COLUMN, height),
            textcoords="axes fraction",
            va="center",
            fontsize=5.5,
            color=colours[index],
            arrowprops={
                "arrowstyle": "-",
                "color": GREY,
                "lw": 0.4,
                "shrinkA": 1.0,
                "shrinkB": 2.0,
                "relpos": (0.0, 0.5),
            },
        )


def _apart(heights: FloatArray) -> FloatArray:
    """The same heights (n,), ascending, moved as little as keeps them apart and inside."""
    placed, apart = heights.astype(float), min(_APART, 0.96 / max(len(heights) - 1, 1))
    for _ in range(_PASSES):
        close = np.diff(placed) < apart - 1e-6
        if not close.any():
            break
        push = np.where(close, 0.5 * (apart - np.diff(placed)), 0.0)
        placed[:-1] -= push
        placed[1:] += push
        placed = np.clip(placed, 0.02, 0.98)
    return placed
