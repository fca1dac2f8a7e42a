"""The picture of an uncertainty budget: how far each source alone moves a number."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from underlay.errors import InputError
from underlay.report.plots import style
from underlay.report.screen import name_of, source_words
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.uncertainty.answer import Answer, Contribution

__all__ = ["budget"]

# Bars that are drawn, and the share of the variance below which a source has none.
_MOST, _SMALL = 7, 1e-3
# Letters of a source in a line beside its bar.
_LETTERS = 27
_MARKS: dict[str, dict[str, Any]] = {
    "seen": {"color": style.FIT},
    "given": {"color": style.SYSTEMATIC},
    "assumed": {"facecolor": "white", "edgecolor": style.SYSTEMATIC, "hatch": "/////", "lw": 0.8},
    "model": {"color": "#7d5700"},
}
_WORDS = {
    "seen": "seen in the curve",
    "given": "given",
    "assumed": "assumed: state yours",
    "model": "left out of the model",
}
_BESIDE: dict[str, Any] = {
    "xytext": (3.0, 0.0),
    "textcoords": "offset points",
    "va": "center",
    "fontsize": 7.5,
}


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
    rows = sorted(rows, key=lambda row: -row.half_width)[:_MOST]
    name, factor = style.unit_of(0.1 * whole, kind_of(answer.name))
    with style.style():
        panel = style.axes(ax, width=style.COLUMN, height=2.3)
        for place, row in enumerate(rows):
            panel.barh(-place, row.half_width / factor, height=0.62, **_MARKS[row.origin])
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
        there = [origin for origin in _MARKS if any(row.origin == origin for row in rows)]
        panel.legend(
            [Patch(**_MARKS[origin]) for origin in there],
            [_WORDS[origin] for origin in there],
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
