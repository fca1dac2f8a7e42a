"""How a quantity is distributed over the curves of a map."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from underlay.errors import InputError
from underlay.report.labels import label
from underlay.report.plots.style import FIT, INK, axes, in_words, style, unit_of
from underlay.scene.parameters import kind_of

__all__ = ["histogram"]

_SHOWN = (0.005, 0.995)


def histogram(table: pd.DataFrame, column: str = "layer.E", *, ax: Axes | None = None) -> Axes:
    """Draw the distribution of one column of a map, with its median.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per curve, such as the result of `fit_many` (SI).
    column : str, default "layer.E"
        What to draw.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If there is no such column, or no value in it.
    """
    if column not in table.columns:
        there = ", ".join(str(name) for name in table.columns)
        raise InputError(f"the table has no column {column!r}; it has {there}")
    values = table[column].to_numpy(dtype=float)
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(f"no curve of the map has a value of {column!r}")
    kind = kind_of(column.removesuffix(".stderr"))
    unit, factor = unit_of(float(np.median(np.abs(known))), kind)
    with style():
        ax = axes(ax, height=2.3)
        # A handful of wild values must not squeeze the others into one bar; they are counted at the ends.
        ends = np.quantile(known, _SHOWN)
        inside = np.minimum(np.maximum(known, ends[0]), ends[1])
        bins = max(8, min(60, int(np.sqrt(known.size))))
        ax.hist(inside / factor, bins=bins, color=FIT, alpha=0.85)
        middle = float(np.median(known))
        ax.axvline(middle / factor, color=INK, lw=1.0, ls="--")
        ax.set_title(f"{known.size} curves, median {in_words(middle, kind)}")
        ax.set_xlabel(f"{label(column)} ({unit})" if unit else label(column))
        ax.set_ylabel("curves")
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    return ax
