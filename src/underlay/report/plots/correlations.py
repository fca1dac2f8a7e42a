"""Correlations of fitted parameters as a matrix of numbers and colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.report.plots.style import COLUMN, DIVERGING, INK, axes, style
from underlay.report.words import label

if TYPE_CHECKING:
    from underlay.inference.fit_result import Fit

__all__ = ["correlations"]

# Above this the colour is dark and the number on it white.
_DARK = 0.6


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
    matrix, names = frame.to_numpy(), [label(str(name)) for name in frame.columns]
    count = len(names)
    with style():
        ax = axes(ax, width=COLUMN, height=0.9 + 0.42 * max(count, 2))
        if not count:
            ax.text(0.5, 0.5, "no parameter has an error bar", ha="center", va="center")
            ax.set_axis_off()
            return ax
        ax.imshow(np.tril(matrix), cmap=DIVERGING, vmin=-1.0, vmax=1.0)
        for i in range(count):
            for j in range(i + 1):
                colour = "white" if abs(matrix[i, j]) > _DARK else INK
                ax.text(j, i, f"{matrix[i, j]:.2f}", ha="center", va="center", color=colour)
        ax.set_yticks(range(count), names)
        ax.set_xticks(range(count), [name.replace(" ", "\n", 1) for name in names])
        ax.tick_params(length=0.0)
        ax.spines[:].set_visible(False)
    return ax
