"""The picture of what accuracy costs: error against time for every method, and the front of the best ones."""

from __future__ import annotations

from string import ascii_uppercase

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from underlay.errors import InputError
from underlay.report.plots.style import (
    ACCENT,
    COLUMN,
    DATA,
    FIT,
    PURPLE,
    REFERENCE,
    YELLOW,
    axes,
    style,
)

__all__ = ["accuracy_cost"]

# Errors below this are those of the reference.
_FLOOR = 1e-12
_FAMILIES = (
    ("explicit", "form", "o", REFERENCE, "asymptotic, explicit"),
    ("parametric", "form", "v", PURPLE, "asymptotic, parametric"),
    ("compliance", "form", "^", YELLOW, "asymptotic, compliance"),
    ("exact", "method", "s", FIT, "exact"),
    ("auto", "method", "x", "black", "auto"),
    ("halfspace", "method", "D", DATA, "half-space"),
)
_OURS = {"asymptotic", "exact", "auto", "halfspace"}


def accuracy_cost(table: pd.DataFrame, *, times: str = "cold", ax: Axes | None = None) -> Axes:
    """Draw the result of `accuracy_cost`: error against time, both logarithmic.

    Parameters
    ----------
    table : pandas.DataFrame
        What `accuracy_cost` returned.
    times : str, default "cold"
        ``"cold"``, from the materials to the forces, or ``"held"``, with the law there already.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
        Published corrections are letters; the line is the front of the methods that none beats in both.
    """
    if times not in ("cold", "held"):
        raise InputError(f"times must be 'cold' or 'held'; got {times!r}")
    known = table[table["error"].notna()]
    cost = known[f"{times}_ratio"]
    error = known["error"].clip(lower=_FLOOR)
    front = known[known["pareto" if times == "cold" else "pareto_held"]].index
    with style():
        drawn = axes(ax, width=1.5 * COLUMN, height=3.3)
        order = cost[front].sort_values().index
        drawn.step(cost[order], error[order], where="post", color=ACCENT, lw=3.0, alpha=0.35, label="best")
        for name, column, marker, colour, label in _FAMILIES:
            rows = known.index[known[column] == name]
            if len(rows):
                joined = rows[np.argsort(error[rows].to_numpy())]
                drawn.plot(cost[joined], error[joined], marker, ms=4.0, color=colour, mfc="none", label=label)
        _draw_published(drawn, known, cost, error)
        drawn.set(xscale="log", yscale="log", ylabel="largest relative error of the force")
        drawn.set_xlabel(f"time, {times} (explicit formula = 1)")
        drawn.margins(x=0.12)
        drawn.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn


def _draw_published(
    drawn: Axes, known: pd.DataFrame, cost: pd.Series[float], error: pd.Series[float]
) -> None:
    """Published corrections as letters, explained in the legend: names would cover each other."""
    rows = known.index[~known["method"].isin(_OURS)]
    for letter, row in zip(ascii_uppercase, rows, strict=False):
        drawn.plot(
            cost[row],
            error[row],
            marker=f"${letter}$",
            ms=5.0,
            ls="none",
            color=DATA,
            mew=0.3,
            label=str(known.loc[row, "method"]),
        )
