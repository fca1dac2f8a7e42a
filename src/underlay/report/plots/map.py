"""A quantity by position: what a map of many curves shows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from scipy import spatial

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.report.labels import label
from underlay.report.plots.style import GREY, SEQUENTIAL, axes, style, unit_for, unit_of
from underlay.scene.parameters import kind_of

__all__ = ["map"]

# Drawn over their own edges, neighbours leave no white lines between them.
_NO_GAPS: Any = {"edgecolors": "face", "lw": 0.2}
_ALONE = 1e-6  # m; a single site has no neighbour to measure its square by


def map(  # noqa: A001  the public name; the builtin is not used here
    table: pd.DataFrame, column: str = "layer.E", *, x: str = "x", y: str = "y", ax: Axes | None = None
) -> Axes:
    """Draw one column of a map by position; sites without a value are grey.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per curve, such as the result of `fit_many`: positions `x`, `y` (m) and values (SI).
    column : str, default "layer.E"
        What to draw; for the verdict see `verdicts`.
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
    placed = table[table[x].notna() & table[y].notna()]
    if not pd.api.types.is_numeric_dtype(placed[column]):
        raise InputError(f"{column!r} holds words; a map shows numbers, and plots.verdicts the verdicts")
    if placed[column].notna().sum() == 0:
        raise InputError(f"no site of the map has a value of {column!r}")
    across, up = placed[x].to_numpy(dtype=float), placed[y].to_numpy(dtype=float)
    length, scale = unit_for(np.concatenate([across - across.min(), up - up.min()]), "length")
    squares = _squares(across, up) / scale
    with style():
        ax = axes(ax, height=3.0)
        ax.set_aspect("equal")
        _draw(ax, squares, placed[column].to_numpy(dtype=float), column)
        ax.autoscale_view()
        ax.set_xlabel(f"x ({length})")
        ax.set_ylabel(f"y ({length})")
    return ax


def _draw(ax: Axes, squares: FloatArray, values: FloatArray, column: str) -> None:
    known = np.isfinite(values)
    unit, factor = unit_of(float(np.median(np.abs(values[known]))), kind_of(column.removesuffix(".stderr")))
    ax.add_collection(PolyCollection(list(squares[~known]), facecolors=GREY, **_NO_GAPS))
    drawn = PolyCollection(list(squares[known]), array=values[known] / factor, cmap=SEQUENTIAL, **_NO_GAPS)
    ax.add_collection(drawn)
    figure = ax.get_figure(root=False)
    if figure is not None:
        bar = figure.colorbar(drawn, cax=ax.inset_axes((1.04, 0.0, 0.05, 1.0)))
        words = label(column).replace(" of the ", "\nof the ")
        bar.set_label(f"{words} ({unit})" if unit else words)


def _squares(across: FloatArray, up: FloatArray) -> FloatArray:
    """Corners (n, 4, 2) of a square around each site, as wide as the usual distance of neighbours (m)."""
    sites = np.stack([across, up], axis=-1)
    nearest = np.asarray(spatial.KDTree(sites).query(sites, k=2)[0])[:, 1]
    apart = nearest[np.isfinite(nearest) & (nearest > 0.0)]
    half = 0.5 * float(np.median(apart)) if apart.size else _ALONE
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    return np.asarray(sites[:, None, :] + corners)
