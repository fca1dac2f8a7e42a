"""A correlation matrix as numbers and colours; shared by the pictures that show one."""

from __future__ import annotations

import textwrap

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from underlay.report.labels import label, symbol
from underlay.report.plots.style import DIVERGING, GREY, INK

__all__ = ["draw_matrix"]

# Above this the colour is dark and the number on it white.
_DARK = 0.6
# A name of more words than this, one below the other, runs into its neighbours: a column then has the letter.
_MOST_WORDS = 3
# Letters on a line of a name beside its row.
_WIDE = 30


def draw_matrix(ax: Axes, frame: pd.DataFrame) -> None:
    """Draw the lower triangle of a correlation matrix; NaN (nothing fixes it) is left grey."""
    matrix, names = frame.to_numpy(dtype=float), [label(str(name)) for name in frame.columns]
    count = len(names)
    shown = np.where(np.tri(count, dtype=bool), matrix, np.nan)
    ax.imshow(shown, cmap=DIVERGING, vmin=-1.0, vmax=1.0)
    for i in range(count):
        for j in range(i + 1):
            if np.isnan(matrix[i, j]):
                ax.text(j, i, "?", ha="center", va="center", color=GREY)
                continue
            colour = "white" if abs(matrix[i, j]) > _DARK else INK
            ax.text(j, i, f"{matrix[i, j]:.2f}", ha="center", va="center", color=colour)
    columns = [name.replace(" ", "\n") for name in names]
    for at, name in enumerate(names):
        if len(name.split()) > _MOST_WORDS:
            columns[at] = f"${symbol(str(frame.columns[at]))}$"
            names[at] = textwrap.fill(f"{name}, {columns[at]}", _WIDE)
    ax.set_yticks(range(count), names)
    ax.set_xticks(range(count), columns)
    ax.tick_params(length=0.0)
    ax.spines[:].set_visible(False)
