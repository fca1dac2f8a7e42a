"""Pictures of a map of many curves: a quantity by position, its distribution, an overview, and the population.

`survey` is the overview: modulus, thickness and verdict by position, and a histogram. `population` draws each unit
(an animal, say) with its curves, and the mean of its group below.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator
from scipy import spatial

from underlay._arrays import FloatArray
from underlay._text import one_line
from underlay.errors import InputError
from underlay.inference.batch.decisions import not_rejected
from underlay.report.labels import label
from underlay.report.plots import style
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.population.result import Group, Population

_SHOWN = (0.005, 0.995)
# Drawn over their own edges, neighbours leave no white lines between them.
_NO_GAPS: Any = {"edgecolors": "face", "lw": 0.2}
_ALONE = 1e-6  # m; a single site has no neighbour to measure its square by
_VERDICTS = (
    ("good", style.ACCENT, "o"),
    ("check", style.YELLOW, "^"),
    ("reject", style.REFERENCE, "x"),
    ("refused", style.REFERENCE, "x"),
)
# Inches of a row of a population, and of what is above the rows.
_ROW, _HEAD = 0.19, 0.9
_MOST_UNITS = 60
# On an axis that spans less than this factor every line of the decade is labelled.
_NARROW = 6.0


def histogram(table: pd.DataFrame, column: str = "layer.E", *, ax: Axes | None = None) -> Axes:
    """Draw the distribution of one column of a map, with its median, over the curves that are not rejected.

    Where all are rejected they are drawn without a median.

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
    _require(table, column)
    trusted = not_rejected(table) if {"status", "verdict"} <= set(table.columns) else table
    known, values = (
        each[np.isfinite(each)] for each in (rows[column].to_numpy(dtype=float) for rows in (trusted, table))
    )
    if not values.size:
        raise InputError(f"no curve of the map has a value of {column!r}")
    rejected = not known.size
    known = values if rejected else known
    words, factor = _axis(column, known)
    with style.panel(ax, height=2.3) as drawn:
        # A handful of wild values must not squeeze the others into one bar; they are counted at the ends.
        ends = np.quantile(known, _SHOWN)
        bins = max(8, min(60, int(np.sqrt(known.size))))
        drawn.hist(np.clip(known, *ends) / factor, bins=bins, color=style.FIT, alpha=0.85)
        middle = float(np.median(known))
        if not rejected:
            drawn.axvline(middle / factor, color=style.INK, lw=1.0, ls="--")
        told = f"curves, median {style.in_words(middle, _kind(column))}"
        drawn.set_title(f"{known.size} {'rejected curves' if rejected else told}")
        drawn.set(xlabel=words, ylabel="curves")
        drawn.yaxis.set_major_locator(MaxNLocator(integer=True))
    return drawn


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
    _require(table, x, y, column)
    placed = table[table[x].notna() & table[y].notna()]
    if not pd.api.types.is_numeric_dtype(placed[column]):
        raise InputError(f"{column!r} holds words; a map shows numbers, and plots.verdicts the verdicts")
    if placed[column].notna().sum() == 0:
        raise InputError(f"no site of the map has a value of {column!r}")
    across, up = placed[x].to_numpy(dtype=float), placed[y].to_numpy(dtype=float)
    length, scale = map_unit(placed, x, y)
    squares = _squares(across, up) / scale
    with style.panel(ax, height=3.0) as drawn:
        drawn.set_aspect("equal")
        values = placed[column].to_numpy(dtype=float)
        known = np.isfinite(values)
        words, factor = _axis(column, values[known])
        drawn.add_collection(PolyCollection(list(squares[~known]), facecolors=style.GREY, **_NO_GAPS))
        shades: Any = {"array": values[known] / factor, "cmap": style.SEQUENTIAL}
        filled = drawn.add_collection(PolyCollection(list(squares[known]), **shades, **_NO_GAPS))
        if (figure := drawn.get_figure(root=False)) is not None:
            bar = figure.colorbar(filled, cax=drawn.inset_axes((1.04, 0.0, 0.05, 1.0)))
            bar.set_label(words.replace(" of the ", "\nof the "))
        drawn.autoscale_view()
        drawn.set(xlabel=f"x ({length})", ylabel=f"y ({length})")
    return drawn


def map_unit(table: pd.DataFrame, x: str = "x", y: str = "y") -> tuple[str, float]:
    """Return the unit of a map's axes for sites with these positions (m): printed name and SI value."""
    across, up = table[x].to_numpy(dtype=float), table[y].to_numpy(dtype=float)
    return style.unit_for(np.concatenate([across - across.min(), up - up.min()]), "length")


def boxes(table: pd.DataFrame, by: str, column: str = "layer.E", *, ax: Axes | None = None) -> Axes:
    """Draw a box plot of one column of a map for every value of a label, with the curves as points.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per curve, such as the result of `fit_many` (SI).
    by : str
        Column of the label: an animal, a group, a region.
    column : str, default "layer.E"
        What to draw.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Boxes hold the middle half, with the median; whiskers reach to the last curve within 1.5 boxes.

    Raises
    ------
    InputError
        If a column is missing, or no curve with a label has a value.
    """
    _require(table, by, column)
    known = table[table[by].notna() & np.isfinite(table[column].to_numpy(dtype=float))]
    if known.empty:
        raise InputError(f"no curve of the map has both a {by} and a value of {column!r}")
    words, factor = _axis(column, known[column].to_numpy(dtype=float))
    parts = {str(name): part[column].to_numpy(dtype=float) / factor for name, part in known.groupby(by)}
    with style.panel(ax, width=0.75 * style.PAGE, height=2.8) as drawn:
        ink: Any = {f"{part}props": {"color": style.FIT} for part in ("box", "whisker", "cap", "median")}
        drawn.boxplot(list(parts.values()), showfliers=False, **ink)
        for place, values in enumerate(parts.values(), start=1):
            # Side by side over a third of the distance of two boxes.
            across = place + np.linspace(-0.15, 0.15, len(values))
            drawn.plot(across, values, "o", ms=3.0, mec="none", color=style.DATA)
        drawn.set_xticks(
            range(1, len(parts) + 1), [f"{one_line(name, 24)} ({len(parts[name])})" for name in parts]
        )
        drawn.set_ylim(bottom=0.0)
        drawn.set_ylabel(words)
    return drawn


def _require(table: pd.DataFrame, *columns: str) -> None:
    """Raise an error for a table without one of these columns; the message lists those it has."""
    for name in columns:
        if name not in table.columns:
            there = ", ".join(str(name) for name in table.columns)
            raise InputError(f"the table has no column {name!r}; it has {there}")


def _kind(column: str) -> str:
    return kind_of(column.removesuffix(".stderr"))


def _axis(column: str, values: FloatArray) -> tuple[str, float]:
    """Return the words of an axis for a column's finite values (SI), and the SI value of its unit."""
    unit, factor = style.unit_of(float(np.median(np.abs(values))), _kind(column))
    return style.with_unit(label(column), unit), factor


def _squares(across: FloatArray, up: FloatArray) -> FloatArray:
    """Return the corners (n, 4, 2) of a square around each site, as wide as neighbours are apart (median, m)."""
    sites = np.stack([across, up], axis=-1)
    nearest = np.asarray(spatial.KDTree(sites).query(sites, k=2)[0])[:, 1]
    apart = nearest[np.isfinite(nearest) & (nearest > 0.0)]
    half = 0.5 * float(np.median(apart)) if apart.size else _ALONE
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    return np.asarray(sites[:, None, :] + corners)


def survey(table: pd.DataFrame, column: str = "layer.E") -> Axes:
    """Draw an overview of a map: one parameter and the thickness by position, verdicts, and a histogram.

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
    with style.style():
        if not placed.any():
            return histogram(table, column)
        here = table[placed]
        known = here.columns[here.notna().any()]
        maps = [name for name in dict.fromkeys((column, "layer.thickness")) if name in known]
        panels = len(maps) + 2
        rows = -(-panels // 2)
        # The maps' colour bars stand outside their axes.
        layout = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.08)
        figure, grid = plt.subplots(rows, 2, figsize=(style.PAGE, 2.7 * rows), layout=layout)
        cells = list(grid.ravel())
        for name, ax in zip(maps, cells, strict=False):
            map(here, name, ax=ax)
        verdicts(here, ax=cells[len(maps)])
        histogram(table, column, ax=cells[len(maps) + 1])
        for ax in cells[panels:]:
            figure.delaxes(ax)
    first: Axes = cells[0]
    return first


def verdicts(table: pd.DataFrame, *, x: str = "x", y: str = "y", ax: Axes | None = None) -> Axes:
    """Draw the verdict on every curve by position, as colour and shape of its mark.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per curve, such as the result of `fit_many`: ``verdict``, and positions `x`, `y` (m).
    x, y : str
        Names of the position columns.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    across, up = table[x].to_numpy(dtype=float), table[y].to_numpy(dtype=float)
    length, scale = map_unit(table, x, y)
    with style.panel(ax, width=0.5 * style.PAGE, height=2.7) as drawn:
        size = max(0.5, min(6.0, 110.0 / np.sqrt(len(table))))
        handles = []
        for name, colour, marker in _VERDICTS:
            these = (table["verdict"] == name).to_numpy()
            drawn.plot(across[these] / scale, up[these] / scale, marker, ms=size, color=colour, ls="none")
            words = f"{name} ({np.count_nonzero(these)})"
            handles.append(Line2D([], [], marker=marker, color=colour, ls="none", ms=4.0, label=words))
        drawn.set_aspect("equal")
        drawn.set(xlabel=f"x ({length})", ylabel=f"y ({length})")
        drawn.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn


def population(result: Population, *, ax: Axes | None = None) -> Axes:
    """Draw the units (animals, say) of every group with their intervals, and the mean of the group below them.

    Parameters
    ----------
    result : Population
        Result of `population`.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Filled points are estimates of units, shrunk towards the mean of their group; open points use the curves
        of a unit alone; the band is the interval of the mean.
    """
    groups = list(result.groups.values())
    words, factor = _axis(result.parameter, np.array([groups[0].mean]))
    rows = sum(_shown(group) + 2 for group in groups)
    with style.panel(ax, width=0.75 * style.PAGE, height=_HEAD + _ROW * rows) as drawn:
        place, names = 0, dict[int, str]()
        for group in groups:
            low, high = (np.clip(end / factor, 1e-300, 1e300) for end in (group.low, group.high))
            below = place + _shown(group) + 1
            drawn.fill_betweenx([place - 0.5, below - 0.6], low, high, color=style.FIT, alpha=0.13, lw=0.0)
            for name, row in list(group.unit_values.iterrows())[:_MOST_UNITS]:
                ends = [row["low"] / factor, row["high"] / factor]
                drawn.plot(ends, [place, place], color=style.DATA, lw=1.0)
                drawn.plot(row["own"] / factor, place, "o", ms=4.0, mfc="white", mec=style.GREY)
                drawn.plot(row["mean"] / factor, place, "o", ms=4.0, color=style.DATA)
                names[place] = f"{one_line(name, 24)}  ({row['curves']:.0f})"
                place += 1
            if len(group.unit_values) > _MOST_UNITS:
                names[place] = f"and {len(group.unit_values) - _MOST_UNITS} more"
                place += 1
            drawn.plot([low, high], [place, place], color=style.FIT, lw=2.4)
            drawn.plot(group.mean / factor, place, "D", ms=5.0, color=style.FIT)
            names[place] = f"{one_line(group.name, 24) or 'all'}: mean"
            place = below + 1
        drawn.set_xscale("log")
        drawn.set_yticks(list(names), list(names.values()))
        for text in drawn.get_yticklabels():
            text.set_color(style.FIT if text.get_text().endswith(": mean") else style.INK)
        drawn.invert_yaxis()
        drawn.set_xlabel(words)
        drawn.xaxis.set_major_formatter(style.PLAIN)
        narrow = np.divide(*drawn.get_xlim()[::-1]) < _NARROW
        drawn.xaxis.set_minor_formatter(style.PLAIN if narrow else FuncFormatter(_some))
        if result.by:
            marks: Any = {
                f"{result.by[0]}, 95 %": {"marker": "o", "color": style.DATA, "lw": 1.0, "ms": 4.0},
                "its curves alone": {
                    "marker": "o",
                    "mfc": "white",
                    "mec": style.GREY,
                    "ls": "none",
                    "ms": 4.0,
                },
                "mean of the group, 95 %": {"marker": "D", "color": style.FIT, "lw": 2.4, "ms": 5.0},
            }
            handles = [Line2D([], [], label=words, **mark) for words, mark in marks.items()]
            drawn.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return drawn


def _shown(group: Group) -> int:
    return min(len(group.unit_values), _MOST_UNITS + 1)


def _some(value: float, _: int) -> str:
    """Label only 2 and 5 between the decades of an axis: more would overlap."""
    lead = value / 10.0 ** np.floor(np.log10(value))
    return f"{value:g}" if round(lead) in {2, 5} else ""
