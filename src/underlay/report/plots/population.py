"""The picture of a population: each unit (an animal, say) with its curves, and the mean of its group below."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from underlay._text import one_line
from underlay.inference.population.result import Group, Population
from underlay.report.labels import label
from underlay.report.plots.style import DATA, FIT, GREY, INK, PAGE, style, unit_of
from underlay.scene.parameters import kind_of

__all__ = ["population"]

_ROW, _HEAD = 0.19, 0.9
_MOST_UNITS = 60
# On an axis that spans less than this factor every line of the decade is labelled.
_NARROW = 6.0


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
    unit, factor = unit_of(groups[0].mean, kind_of(result.parameter))
    rows = sum(_shown(group) + 2 for group in groups)
    with style():
        if ax is None:
            ax = plt.subplots(figsize=(0.75 * PAGE, _HEAD + _ROW * rows), layout="constrained")[1]
        place, ticks, names = 0, [], []
        for group in groups:
            low, high = (np.clip(end / factor, 1e-300, 1e300) for end in (group.low, group.high))
            below = place + _shown(group) + 1
            ax.fill_betweenx([place - 0.5, below - 0.6], low, high, color=FIT, alpha=0.13, lw=0.0)
            for name, row in list(group.unit_values.iterrows())[:_MOST_UNITS]:
                ends = [row["low"] / factor, row["high"] / factor]
                ax.plot(ends, [place, place], color=DATA, lw=1.0)
                ax.plot(row["own"] / factor, place, "o", ms=4.0, mfc="white", mec=GREY)
                ax.plot(row["mean"] / factor, place, "o", ms=4.0, color=DATA)
                ticks.append(place)
                names.append(f"{one_line(name, 24)}  ({row['curves']:.0f})")
                place += 1
            if len(group.unit_values) > _MOST_UNITS:
                ticks.append(place)
                names.append(f"and {len(group.unit_values) - _MOST_UNITS} more")
                place += 1
            ax.plot([low, high], [place, place], color=FIT, lw=2.4)
            ax.plot(group.mean / factor, place, "D", ms=5.0, color=FIT)
            ticks.append(place)
            names.append(f"{one_line(group.name, 24) or 'all'}: mean")
            place = below + 1
        ax.set_xscale("log")
        ax.set_yticks(ticks, names)
        for text, name in zip(ax.get_yticklabels(), names, strict=True):
            text.set_color(FIT if name.endswith(": mean") else INK)
        ax.invert_yaxis()
        ax.set_xlabel(f"{label(result.parameter)} ({unit})" if unit else label(result.parameter))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        narrow = np.divide(*ax.get_xlim()[::-1]) < _NARROW
        ax.xaxis.set_minor_formatter(FuncFormatter(_every if narrow else _some))
        if result.by:
            what = result.by[0]
            handles = [
                Line2D([], [], marker="o", color=DATA, lw=1.0, ms=4.0, label=f"{what}, 95 %"),
                Line2D(
                    [], [], marker="o", mfc="white", mec=GREY, ls="none", ms=4.0, label="its curves alone"
                ),
                Line2D([], [], marker="D", color=FIT, lw=2.4, ms=5.0, label="mean of the group, 95 %"),
            ]
            ax.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return ax


def _shown(group: Group) -> int:
    return min(len(group.unit_values), _MOST_UNITS + 1)


def _every(value: float, _: int) -> str:
    return f"{value:g}"


def _some(value: float, _: int) -> str:
    """Label only 2 and 5 between the decades of an axis: more would overlap."""
    lead = value / 10.0 ** np.floor(np.log10(value))
    return f"{value:g}" if round(lead) in {2, 5} else ""
