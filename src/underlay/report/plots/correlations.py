"""Correlations of the parameters of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from underlay.report.plots.matrix import draw_matrix
from underlay.report.plots.style import axes, style

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["correlations"]


def correlations(result: Fit, *, ax: Axes | None = None) -> Axes:
    """Draw the correlation matrix of the parameters that have error bars.

    Parameters
    ----------
    result : Fit
        What `fit` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    frame = result.correlations
    with style():
        ax = axes(ax, height=0.9 + 0.42 * max(len(frame), 2))
        if len(frame):
            draw_matrix(ax, frame)
        else:
            ax.text(0.5, 0.5, "no parameter has an error bar", ha="center", va="center")
            ax.set_axis_off()
    return ax
