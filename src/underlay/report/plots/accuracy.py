"""Pictures of accuracy against cost: the error of force, modulus and posterior over the time they take.

The names of methods are written in a column beside their points, in place of a legend.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from underlay.errors import InputError
from underlay.report.plots import style
from underlay.report.tables import method_label

# Of the axes' height: the least distance of two names. Of its width: where the column begins.
_APART, _COLUMN = 0.045, 0.56
_MARGIN = 0.06
# Errors below these are those of the reference, and those that no measurement tells.
_FLOOR, _FLOOR_OF_ANSWERS = 1e-12, 1e-6
_COLOURS = {
    "explicit": style.REFERENCE,
    "parametric": style.PURPLE,
    "compliance": style.YELLOW,
    "exact": style.FIT,
    "auto": "black",
    "halfspace": style.ACCENT,
}
_HEIGHT = 3.8
_PUBLISHED = re.compile(r"([a-z]+)(\d+)(?:-(.+))?")
# Of the exact law's tolerances: the others lie between.
_NAMED, _NAMED_AUTO = (1e-1, 1e-2, 1e-4, 1e-6, 1e-10), 1e-4


def _label_points(
    drawn: Axes, x: Sequence[float], y: Sequence[float], names: Sequence[str], colours: Sequence[str]
) -> None:
    """Write the names of points (x, y) in a column at the right of logarithmic axes, and set limits to fit."""
    low, high = np.log(drawn.dataLim.intervalx)
    width = max(high - low, 1.0) / (_COLUMN - 2.0 * _MARGIN)
    drawn.set_xlim(np.exp(low - _MARGIN * width), np.exp(low + (1.0 - _MARGIN) * width))
    bottom, top = np.log(drawn.dataLim.intervaly)
    drawn.set_ylim(np.exp(bottom - _MARGIN * (top - bottom)), np.exp(top + _MARGIN * (top - bottom)))
    bottom, top = np.log(drawn.get_ylim())
    heights = (np.log(y) - bottom) / (top - bottom)
    order = np.argsort(-heights, kind="stable")
    room = np.full(len(order), min(_APART, 0.96 / max(len(order) - 1, 1)))
    line = {"arrowstyle": "-", "color": style.GREY, "lw": 0.4, "relpos": (0.0, 0.5)}
    line |= {"shrinkA": 1.0, "shrinkB": 2.0}
    how: dict[str, Any] = {"textcoords": "axes fraction", "va": "center", "fontsize": 5.5, "arrowprops": line}
    for index, height in zip(
        order.tolist(), style.apart(heights[order], room, 0.0, 1.0).tolist(), strict=True
    ):
        place, at = (_COLUMN, height), (x[index], y[index])
        drawn.annotate(names[index], at, xytext=place, color=colours[index], **how)


def accuracy_cost(table: pd.DataFrame, *, times: str = "cold", ax: Axes | None = None) -> Axes:
    """Draw the result of `accuracy_cost`: error of the force against time, both logarithmic.

    Parameters
    ----------
    table : pandas.DataFrame
        What `accuracy_cost` returned.
    times : str, default "cold"
        ``"cold"``, time from the materials to the forces, or ``"held"``, time with a contact law already built.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Methods are named beside their points; the line is the Pareto front, whose methods none beats in both.
    """
    if times not in ("cold", "held"):
        raise InputError(f"times must be 'cold' or 'held'; got {times!r}")
    known = table[table["error"].notna()].copy()
    known["x"], known["y"] = known[f"{times}_ratio"], known["error"].clip(lower=_FLOOR)
    front = known[known["pareto" if times == "cold" else "pareto_held"]].sort_values("x")
    with style.panel(ax, width=style.COLUMN, height=_HEIGHT) as drawn:
        drawn.set(xscale="log", yscale="log", ylabel="largest relative error of the force")
        drawn.step(front["x"], front["y"], where="post", color=style.GREY, lw=3.0, alpha=0.5)
        _draw(drawn, known)
        drawn.set_xlabel(f"time, {times} (formula = 1)")
    return drawn


def answer_cost(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Draw the result of `answer_cost`: errors of modulus and thickness against the time of the fit.

    Parameters
    ----------
    table : pandas.DataFrame
        What `answer_cost` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Full marks: modulus, with known thickness; open marks: thickness, fitted together with the modulus.
    """
    known = table.copy()
    known["x"], known["y"] = known["ratio"], known["E_error"].abs().clip(lower=_FLOOR_OF_ANSWERS)
    joint = known[known["thickness_error"].notna()]
    with style.panel(ax, width=style.COLUMN, height=_HEIGHT) as drawn:
        drawn.set(xscale="log", yscale="log", ylabel="relative error of E (full) and h (open)")
        thickness = joint["thickness_error"].abs().clip(lower=_FLOOR_OF_ANSWERS)
        for colour, x, y in zip(_colours(joint), joint["joint_ratio"], thickness, strict=True):
            drawn.plot(x, y, "D", ms=2.6, mfc="none", mew=0.6, color=colour)
        _draw(drawn, known)
        drawn.set_xlabel("time of the fit (Hertz fit = 1)")
    return drawn


def posterior_cost(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Draw the result of `posterior_cost`: the error of quantiles against the time of the sampling.

    Parameters
    ----------
    table : pandas.DataFrame
        What `posterior_cost` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        The band is the error of the reference itself. Chains that converged before their limit share one mark.
    """
    by_steps = table[table["way"] == "emcee"].sort_values("steps")
    ended = by_steps["error"].duplicated(keep=False)
    walkers = by_steps.assign(ended=ended).drop_duplicates("error")
    others = table[table["way"] != "emcee"]
    with style.panel(ax, width=style.COLUMN, height=_HEIGHT) as drawn:
        drawn.set(xscale="log", yscale="log", ylabel="error of the 5, 50, 95 % quantiles (sd)")
        drawn.plot(walkers["ratio"], walkers["error"], "o-", ms=3.5, lw=0.8, color=style.FIT)
        drawn.plot(others["ratio"], others["error"], "s", ms=3.5, color=style.REFERENCE)
        floor = table.attrs.get("reference_error", 0.0)
        shown = pd.concat([walkers, others])
        # At least from the reference's own error to one standard deviation: what is less apart is no difference.
        least, most = shown["error"].min(), shown["error"].max()
        bottom, top = 0.5 * (min(least, floor) or least), 2.0 * max(most, 0.5)
        drawn.update_datalim([(ratio, end) for ratio in shown["ratio"] for end in (bottom, top)])
        names = [
            "emcee, ended by itself" if ends else f"emcee, {count:.0f} steps"
            for count, ends in zip(walkers["steps"], walkers["ended"], strict=True)
        ] + [{"fit": "fit, as a normal"}.get(way, way) for way in others["way"]]
        colours = [style.FIT] * len(walkers) + [style.REFERENCE] * len(others)
        _label_points(drawn, shown["ratio"].tolist(), shown["error"].tolist(), names, colours)
        drawn.axhspan(
            drawn.get_ylim()[0], max(floor, drawn.get_ylim()[0]), color=style.GREY, alpha=0.25, lw=0.0
        )
        drawn.set_xlabel("time (Hertz fit = 1)")
    return drawn


def what_accuracy_costs(
    force: pd.DataFrame,
    answers: pd.DataFrame | None = None,
    posterior: pd.DataFrame | None = None,
    *,
    title: str = "",
) -> Figure:
    """Draw the pictures of `accuracy_cost`, `answer_cost` and `posterior_cost` side by side, at page width.

    Parameters
    ----------
    force, answers, posterior : pandas.DataFrame
        What `accuracy_cost`, `answer_cost` and `posterior_cost` returned for one scene.
    title : str, optional
        Written above.

    Returns
    -------
    matplotlib Figure
    """
    panels = [(accuracy_cost, force), (answer_cost, answers), (posterior_cost, posterior)]
    given = [(draw, table) for draw, table in panels if table is not None]
    with style.style():
        figure, places = plt.subplots(
            1, len(given), figsize=(style.PAGE, _HEIGHT), layout="constrained", squeeze=False
        )
        for place, (draw, table) in zip(places[0], given, strict=True):
            draw(table, ax=place)
        if title:
            figure.suptitle(title, fontsize=8.5)
    return figure


def _draw(drawn: Axes, known: pd.DataFrame) -> None:
    """Draw the marks of all methods, and the names of the most telling ones of each family."""
    colours = _colours(known)
    for colour, x, y in zip(colours, known["x"], known["y"], strict=True):
        drawn.plot(x, y, "o", ms=3.5, color=colour)
    for form in ("explicit", "parametric", "compliance"):
        series = known[known["form"] == form].sort_values("order")
        drawn.plot(series["x"], series["y"], "-", lw=0.5, color=_COLOURS[form], alpha=0.6)
    named = known.assign(colour=colours)[[_telling(row) for _, row in known.iterrows()]]
    names = [_in_words(method_label(row)) for _, row in named.iterrows()]
    _label_points(drawn, named["x"].tolist(), named["y"].tolist(), names, named["colour"].tolist())


def _colours(known: pd.DataFrame) -> list[str]:
    return [
        _COLOURS.get(form or method, style.DATA)
        for form, method in zip(known["form"], known["method"], strict=True)
    ]


def _in_words(label: str) -> str:
    """A method's label for people: ``"half-space"``, ``"exact 1e-6"``, ``"Garcia 2018"`` of ``"garcia2018"``."""
    if published := _PUBLISHED.fullmatch(label):
        author, year, variant = published.groups(default="")
        return f"{author.capitalize()} {year}{f', {variant}' if variant else ''}"
    return label.replace("halfspace", "half-space").replace("e-0", "e-")


def _telling(row: pd.Series[Any]) -> bool:
    """Whether a method is named: first and fourth order, and some tolerances; the others lie between these."""
    if row["form"]:
        return bool(row["order"] == 4 or (row["form"], row["order"]) == ("explicit", 1))
    return row["rtol"] in {"exact": _NAMED, "auto": (_NAMED_AUTO,)}.get(row["method"], (row["rtol"],))
