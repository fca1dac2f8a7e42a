"""A quantity by position: what a map of many curves shows."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.report.plots.style import GREY, SEQUENTIAL, axes, style, unit_for
from underlay.report.words import label
from underlay.scene.parameters import kind_of
from underlay.units import human_unit

__all__ = ["map"]


def map(  # noqa: A001  the public name; the builtin is not used here
    table: pd.DataFrame, column: str = "layer.E", *, x: str = "x", y: str = "y", ax: Axes | None = None
) -> Axes:
    """Draw one column of a map by position; sites without a value are grey.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per curve, such as the result of `fit_many`: positions `x`, `y` (m) and values (SI).
    column : str, default "layer.E"
        What to draw.
    x, y : str
        Names of the position columns.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If a column is missing or no site has a value; names the columns there are.
    """
    for name in (x, y, column):
        if name not in table.columns:
            raise InputError(
                f"the table has no column {name!r}; it has {', '.join(str(name) for name in table.columns)}"
            )
    values = table[column].to_numpy(dtype=float)
    known = np.isfinite(values)
    if not known.any():
        raise InputError(f"no site of the map has a value of {column!r}")
    across, up = table[x].to_numpy(dtype=float), table[y].to_numpy(dtype=float)
    length, scale = unit_for(np.concatenate([across - across.min(), up - up.min()]), "length")
    path = column.removesuffix(".stderr")
    unit, factor = human_unit(float(np.median(np.abs(values[known]))), kind_of(path))
    with style():
        ax = axes(ax, height=3.0)
        ax.set_aspect("equal")
        half = 0.5 * _pitch(across, up)
        corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
        squares = np.stack([across, up], axis=-1)[:, None, :] + corners
        ax.add_collection(
            PolyCollection(list(squares[~known] / scale), facecolors=GREY, edgecolors="face", lw=0.2)
        )
        drawn = PolyCollection(
            list(squares[known] / scale),
            array=values[known] / factor,
            cmap=SEQUENTIAL,
            edgecolors="face",
            lw=0.2,
        )
        ax.add_collection(drawn)
        ax.autoscale_view()
        figure = ax.get_figure(root=False)
        if figure is not None:
            words = label(path) + (", standard error" if path != column else "")
            figure.colorbar(drawn, cax=ax.inset_axes((1.04, 0.0, 0.05, 1.0))).set_label(
                f"{words} ({unit})" if unit else words
            )
        ax.set_xlabel(f"x ({length})")
        ax.set_ylabel(f"y ({length})")
    return ax


def _pitch(across: FloatArray, up: FloatArray) -> float:
    """Smallest step of the grid (m) in either direction; one millionth of its size where there is none."""
    steps = [np.diff(np.unique(np.round(values, 12))) for values in (across, up)]
    found = [float(step[step > 0.0].min()) for step in steps if (step > 0.0).any()]
    return min(found) if found else 1e-6
