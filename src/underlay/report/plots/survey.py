"""A map at a glance: modulus, its standard error, thickness and verdict by position, and a histogram."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from underlay.report.plots.histogram import histogram
from underlay.report.plots.map import map as map_of
from underlay.report.plots.style import ACCENT, PAGE, REFERENCE, YELLOW, style, unit_of

__all__ = ["survey", "verdicts"]

_VERDICTS = (("good", ACCENT, "o"), ("doubtful", YELLOW, "^"), ("refused", REFERENCE, "x"))


def survey(table: pd.DataFrame, column: str = "layer.E") -> Axes:
    """Draw what a map found.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of `fit_many`.
    column : str, default "layer.E"
        The parameter to draw.

    Returns
    -------
    matplotlib Axes
        Of the first panel; without positions there is only the histogram.

    Raises
    ------
    InputError
        If no curve has a value.
    """
    placed = np.isfinite(table[["x", "y"]].to_numpy(dtype=float)).all(axis=1)
    with style():
        if not placed.any():
            return histogram(table, column)
        here = table[placed]
        maps = [name for name in (column, f"{column}.stderr", "layer.thickness") if _has_values(here, name)]
        maps = list(dict.fromkeys(maps))
        panels = len(maps) + 2
        rows = -(-panels // 2)
        # The maps' colour bars stand outside their axes.
        layout = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.08)
        figure, grid = plt.subplots(rows, 2, figsize=(PAGE, 2.7 * rows), layout=layout)
        axes = list(grid.ravel())
        for name, ax in zip(maps, axes, strict=False):
            map_of(here, name, ax=ax)
        verdicts(here, ax=axes[len(maps)])
        histogram(table, column, ax=axes[len(maps) + 1])
        for ax in axes[panels:]:
            figure.delaxes(ax)
    first: Axes = axes[0]
    return first


def verdicts(table: pd.DataFrame, *, x: str = "x", y: str = "y", ax: Axes | None = None) -> Axes:
    """Draw the verdict on every curve by position, by colour and by shape."""
    across, up = table[x].to_numpy(dtype=float), table[y].to_numpy(dtype=float)
    length, scale = unit_of(float(max(np.ptp(across), np.ptp(up))), "length")
    with style():
        if ax is None:
            ax = plt.subplots(figsize=(0.5 * PAGE, 2.7), layout="constrained")[1]
        size = max(0.5, min(6.0, 110.0 / np.sqrt(len(table))))
        handles = []
        for name, colour, marker in _VERDICTS:
            these = (table["verdict"] == name).to_numpy()
            ax.plot(across[these] / scale, up[these] / scale, marker, ms=size, color=colour, ls="none")
            words = f"{name} ({np.count_nonzero(these)})"
            handles.append(Line2D([], [], marker=marker, color=colour, ls="none", ms=4.0, label=words))
        ax.set_aspect("equal")
        ax.set_xlabel(f"x ({length})")
        ax.set_ylabel(f"y ({length})")
        ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def _has_values(table: pd.DataFrame, name: str) -> bool:
    return name in table.columns and bool(np.isfinite(table[name].to_numpy(dtype=float)).any())
