"""What a test can tell: how the errors hang together, and which products of parameters it fixes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.report.labels import symbol
from underlay.report.plots.matrix import draw_matrix
from underlay.report.plots.style import ACCENT, INK, REFERENCE, YELLOW, axes, style

if TYPE_CHECKING:
    from underlay.inference.design.identifiability import Identifiability

__all__ = ["identifiability"]

_COLOURS = {"fixed": ACCENT, "weakly fixed": YELLOW, "not fixed": REFERENCE}
# The axis of the bars: from a hundredth of a per cent to a factor of e, where nothing is fixed any more.
_LEAST, _MOST = 1e-4, 1.0
_SMALL_POWER = 0.05


def identifiability(told: Identifiability, *, ax: Axes | None = None) -> Axes:
    """Draw the correlations of the expected errors, and below them how well each combination is fixed.

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
    with style():
        ax = axes(ax, height=1.5 + 0.42 * rows + 0.36 * len(combinations))
        figure, spec = ax.get_figure(root=False), ax.get_subplotspec()
        draw_matrix(ax, told.correlations)
        ax.set_title("correlation of the errors")
        if not combinations or figure is None or spec is None:
            return ax
        parts = spec.subgridspec(2, 1, height_ratios=(0.42 * rows + 0.6, 0.36 * len(combinations) + 0.3))
        ax.set_subplotspec(parts[0])
        bars = figure.add_subplot(parts[1])
        for place, combination in enumerate(combinations):
            size = min(max(combination.relative_sd, 1.3 * _LEAST), _MOST)
            bars.barh(place, size, left=0.0, height=0.55, color=_COLOURS[combination.verdict])
            words = (
                f"to {100.0 * combination.relative_sd:.2g} %"
                if combination.relative_sd < _MOST
                else "not fixed"
            )
            inside = size > np.sqrt(_LEAST * _MOST)
            bars.text(
                size * (0.85 if inside else 1.2),
                place,
                words,
                va="center",
                ha="right" if inside else "left",
                color=INK,
            )
        bars.set_xscale("log")
        bars.set_xlim(_LEAST, _MOST)
        bars.set_yticks(range(len(combinations)), [_formula(entry.powers) for entry in combinations])
        bars.invert_yaxis()
        bars.set_xlabel("relative error of the product")
    return ax


def _formula(powers: object) -> str:
    items = sorted(dict(powers).items(), key=lambda item: -abs(item[1]))  # type: ignore[call-overload]  # a mapping
    parts = []
    for name, power in items:
        if abs(power) < _SMALL_POWER:
            continue
        letter = symbol(name)
        parts.append(letter if abs(power - 1.0) < 5e-3 else f"{{{letter}}}^{{{power:.2g}}}")
    return f"${' '.join(parts)}$"
