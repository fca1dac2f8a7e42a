"""Pictures of what a test determines, what makes it unsure, and which test would determine more.

The uncertainty budget of a number (`budget`); correlations of the fitted parameters (`correlations`); correlations
of the expected errors of a planned test and how well it determines products of parameters (`identifiability`); and
the expected error over tip radius and depth (`plan`).
"""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator

from underlay.errors import InputError
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.report.labels import label, symbol
from underlay.report.plots import style
from underlay.report.screen import name_of, source_words
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.design.identifiability import Identifiability
    from underlay.inference.design.planning import Plan
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.answer import Answer, Contribution

# Above this the colour is dark and the number on it white.
_DARK = 0.6
# A name of more words than this, one below the other, runs into its neighbours: a column then has the letter.
_MOST_WORDS = 3
# Letters on a line of a name beside its row.
_WIDE = 30
_COLOURS = {"fixed": style.ACCENT, "weakly fixed": style.YELLOW, "not fixed": style.REFERENCE}
# The axis of the bars: from a hundredth of a per cent to a factor of e, where nothing is fixed any more.
_LEAST, _MOST = 1e-4, 1.0
_SMALL_POWER = 0.05
# Relative errors beyond these are as good, or as useless, as these.
_BEST, _WORST = 1e-3, 1.0
# Bars that are drawn, and the share of the variance below which a source has none.
_BARS, _SMALL = 7, 1e-3
# Letters of a source in a line beside its bar.
_LETTERS = 27
# Where a source is known from: how its bar is drawn, and what the legend says.
_HATCHED = {"facecolor": "white", "edgecolor": style.SYSTEMATIC, "hatch": "/////", "lw": 0.8}
_ORIGINS: dict[str, tuple[dict[str, Any], str]] = {
    "seen": ({"color": style.FIT}, "seen in the curve"),
    "given": ({"color": style.SYSTEMATIC}, "given"),
    "assumed": (_HATCHED, "assumed: state yours"),
    "model": ({"color": "#7d5700"}, "left out of the model"),
}
_BESIDE: Any = {"xytext": (3.0, 0.0), "textcoords": "offset points", "va": "center", "fontsize": 7.5}


def _draw_matrix(ax: Axes, frame: pd.DataFrame) -> None:
    """Draw the lower triangle of a correlation matrix; NaN (an undetermined parameter) is a grey question mark."""
    matrix, names = frame.to_numpy(dtype=float), [label(str(name)) for name in frame.columns]
    count = len(names)
    shown = np.where(np.tri(count, dtype=bool), matrix, np.nan)
    ax.imshow(shown, cmap=style.DIVERGING, vmin=-1.0, vmax=1.0)
    for i in range(count):
        for j in range(i + 1):
            if np.isnan(matrix[i, j]):
                ax.text(j, i, "?", ha="center", va="center", color=style.GREY)
                continue
            colour = "white" if abs(matrix[i, j]) > _DARK else style.INK
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
    with style.panel(ax, height=0.9 + 0.42 * max(len(frame), 2)) as drawn:
        if len(frame):
            _draw_matrix(drawn, frame)
        else:
            drawn.text(0.5, 0.5, "no parameter has an error bar", ha="center", va="center")
            drawn.set_axis_off()
    return drawn


def identifiability(told: Identifiability, *, ax: Axes | None = None) -> Axes:
    """Draw the correlations of the expected errors, and how well each product of parameters is determined.

    Parameters
    ----------
    told : Identifiability
        What `underlay.identifiability` returned.
    ax : matplotlib Axes, optional
        Where to draw; its lower part becomes the bars.

    Returns
    -------
    matplotlib Axes
        The upper axes.
    """
    combinations = told.combinations
    rows = max(len(told.names), 2)
    with style.panel(ax, height=1.5 + 0.42 * rows + 0.36 * len(combinations)) as drawn:
        figure, spec = drawn.get_figure(root=False), drawn.get_subplotspec()
        _draw_matrix(drawn, told.correlations)
        drawn.set_title("correlation of the errors")
        if not combinations or figure is None or spec is None:
            return drawn
        parts = spec.subgridspec(2, 1, height_ratios=(0.42 * rows + 0.6, 0.36 * len(combinations) + 0.3))
        drawn.set_subplotspec(parts[0])
        bars = figure.add_subplot(parts[1])
        for place, combination in enumerate(combinations):
            half = NORMAL_95 * combination.relative_sd
            size = min(max(half, 1.3 * _LEAST), _MOST)
            bars.barh(place, size, left=0.0, height=0.55, color=_COLOURS[combination.verdict])
            words = f"± {100.0 * half:.2g} %" if half < _MOST else "not fixed"
            inside = size > np.sqrt(_LEAST * _MOST)
            colour = "white" if inside and combination.verdict == "fixed" else style.INK
            at, side = (0.85, "right") if inside else (1.2, "left")
            bars.text(at * size, place, words, va="center", ha=side, color=colour)
        bars.set_xscale("log")
        bars.set_xlim(_LEAST, _MOST)
        bars.set_yticks(range(len(combinations)), [_formula(entry.powers) for entry in combinations])
        bars.invert_yaxis()
        bars.set_xlabel("relative uncertainty of the product (95 %)")
    return drawn


def _formula(powers: object) -> str:
    items = sorted(dict(powers).items(), key=lambda item: -abs(item[1]))  # type: ignore[call-overload]  # a mapping
    parts = []
    for name, power in items:
        if abs(power) < _SMALL_POWER:
            continue
        letter = symbol(name)
        parts.append(letter if abs(power - 1.0) < 5e-3 else f"{{{letter}}}^{{{power:.2g}}}")
    return f"${' '.join(parts)}$"


def plan(tests: Plan, *, ax: Axes | None = None) -> Axes:
    """Draw the expected relative error of a parameter for every test of a grid.

    Parameters
    ----------
    tests : Plan
        What `underlay.plan` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Tests that cannot be done are left grey; the star is the recommended one.
    """
    radius_unit, radius = style.unit_for(tests.radii, "length")
    depth_unit, depth = style.unit_for(tests.depths, "length")
    relative = np.where(np.isinf(tests.error), _WORST, NORMAL_95 * tests.error / abs(tests.value)).T
    with style.panel(ax, height=2.8) as drawn:
        drawn.set_facecolor(style.GREY)
        ends = (np.nanmin(relative), np.nanmax(relative))
        norm = LogNorm(max(ends[0], _BEST), min(max(ends[1], 2.0 * max(ends[0], _BEST)), _WORST))
        shades: Any = {"cmap": style.SEQUENTIAL, "norm": norm, "shading": "nearest"}
        mesh = drawn.pcolormesh(tests.radii / radius, tests.depths / depth, relative, **shades)
        drawn.set(xscale="log", yscale="log")
        for axis in (drawn.xaxis, drawn.yaxis):
            style.plain_ticks(axis, LogLocator(subs=(1.0, 2.0, 5.0)))
        if np.isfinite(tests.error).any():
            star: Any = {"ms": 12, "mfc": "white", "mec": style.INK, "mew": 0.8, "label": "recommended"}
            drawn.plot(tests.best[0] / radius, tests.best[1] / depth, "*", **star)
            drawn.legend(loc="lower right", frameon=True, framealpha=0.9, edgecolor="none")
        figure = drawn.get_figure(root=False)
        if figure is not None:
            bar = figure.colorbar(mesh, ax=drawn)
            bar.set_label(f"relative uncertainty of the {label(tests.parameter)} (95 %)")
        drawn.set(xlabel=f"tip radius ({radius_unit})", ylabel=f"depth ({depth_unit})")
    return drawn


def budget(answer: Answer, *, ax: Axes | None = None) -> Axes:
    """Draw as bars how far each source of uncertainty alone moves a number, at the level of its interval.

    Parameters
    ----------
    answer : Answer
        What `Fit.answer` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Of a lopsided effect the larger side is drawn.

    Raises
    ------
    InputError
        If an end of the interval is open: then there is no budget.
    """
    if answer.is_open:
        raise InputError(f"{answer.name} is not determined: there is no budget to draw")
    whole = max(answer.high - answer.value, answer.value - answer.low)
    rows = [row for row in answer.contributions if row.share >= _SMALL and math.isfinite(row.half_width)]
    rows = sorted(rows, key=lambda row: -row.half_width)[:_BARS]
    name, factor = style.unit_of(0.1 * whole, kind_of(answer.name))
    with style.panel(ax, width=style.COLUMN, height=2.3) as panel:
        for place, row in enumerate(rows):
            panel.barh(-place, row.half_width / factor, height=0.62, **_ORIGINS[row.origin][0])
            panel.annotate(_short(row.half_width / factor), (row.half_width / factor, -place), **_BESIDE)
        panel.barh(-len(rows), whole / factor, height=0.62, color=style.INK)
        total = f"{_short(whole / factor)} {name}".rstrip()
        panel.annotate(total, (whole / factor, -len(rows)), fontweight="bold", **_BESIDE)
        panel.set_yticks([-place for place in range(len(rows) + 1)], [*map(_named, rows), "combined"])
        panel.get_yticklabels()[-1].set_fontweight("bold")
        panel.tick_params(axis="y", length=0)
        panel.spines["left"].set_visible(False)
        widest = max([whole, *(row.half_width for row in rows)]) / factor
        panel.set_xlim(0.0, 1.22 * widest)
        unit = f" ({name})" if name else ""
        letter = name_of(answer.name)[1]
        panel.set_xlabel(f"Contribution to the uncertainty of {letter}{unit}", loc="right")
        there = [shown for origin, shown in _ORIGINS.items() if any(row.origin == origin for row in rows)]
        panel.legend(
            [Patch(**mark) for mark, _ in there],
            [words for _, words in there],
            # Above the sum: there bars are shortest.
            loc="lower right",
            bbox_to_anchor=(1.0, 1.15 / (len(rows) + 1.0)),
            labelcolor=style.SOFT,
            handlelength=1.2,
            handleheight=0.8,
            borderaxespad=0.0,
        )
    return panel


def _named(row: Contribution) -> str:
    """Return the name and size of a source of uncertainty, wrapped to fit beside the bars."""
    return "\n".join(textwrap.wrap(f"{source_words(row.source)} {row.size}".strip(), _LETTERS))


def _short(value: float) -> str:
    """Write a number with two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"
