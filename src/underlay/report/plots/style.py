"""The common style of all pictures: colour-blind safe, journal column width, units for people."""

from __future__ import annotations

import html
import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, Locator, NullLocator

from underlay._arrays import FloatArray
from underlay._files import write_atomic
from underlay.errors import InputError
from underlay.units import format_quantity, human_unit, printed, printed_unit

#: Width of one journal column, and of the full page (inches).
COLUMN, PAGE = 3.5, 7.2
#: By role: data, model, comparison, contact. Hues of Okabe and Ito, dark enough for words (4.5:1 on white) but
#: for data, which is dots: a grey that eyes without short cones still tell from the model's blue.
DATA, FIT, REFERENCE, ACCENT, PURPLE, SKY, YELLOW = (
    "#7d8794",
    "#0b62a4",
    "#b8470f",
    "#0a7d5c",
    "#cc79a7",
    "#56b4e9",
    "#e69f00",
)
#: What is systematic (a fill only), and words beside a mark.
SYSTEMATIC, SOFT = "#c98a00", "#5b6470"
CYCLE = (FIT, REFERENCE, ACCENT, PURPLE, SKY, YELLOW, DATA)
GREY = "#b0b0b0"
#: What a scene is drawn with.
INK, METAL, LAYER, SUBSTRATE = "#1c2126", "#c3c9d1", "#dcebf7", "#cbbfa9"
#: Blue for negative, orange for positive, distinguishable with every common colour vision.
DIVERGING = "PuOr_r"
#: Points of a curve: more than the picture has pixels only make the file heavy. Points of a smooth line.
MOST_POINTS, LINE_POINTS = 1500, 400
#: Share of the contact that is shown of the flat part before it.
BEFORE = 0.35
#: Numbers of an axis without powers of ten.
PLAIN = FuncFormatter(lambda value, _: f"{value:g}")
#: Dark to light in even steps, also without colour.
SEQUENTIAL = "cividis"

# Any: the names of all settings differ between versions of matplotlib.
_STYLE: Any = mpl.rc_params_from_file(
    Path(__file__).with_name("underlay.mplstyle"), use_default_template=False
)
_STYLE |= dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), SOFT)
_STYLE |= dict.fromkeys(("xtick.labelcolor", "ytick.labelcolor"), INK)
_STYLE |= {"axes.prop_cycle": cycler(color=list(CYCLE))}
_FORMATS = {"png", "svg", "pdf"}
# What a picture says of who made it and when, and names of groups that nothing refers to.
_PREAMBLE = re.compile(r"^.*?(?=<svg)|<!--.*?-->|<metadata>.*?</metadata>", re.DOTALL)
_SIZE = re.compile(r'<svg[^>]*viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*>')
_GROUP = re.compile(r'<g id="[^"]*"')


@contextmanager
def style() -> Iterator[None]:
    """Draw with the style of this package inside a ``with`` block; the caller's settings are restored after it."""
    # Not rc_context: it puts everything back, also that the session is interactive, which matplotlib notes at
    # the first figure; a notebook would then show that one and no later one.
    before = {name: mpl.rcParams[name] for name in _STYLE}
    mpl.rcParams.update(_STYLE)
    try:
        yield
    finally:
        mpl.rcParams.update(before)


def axes(ax: Axes | None, *, width: float = PAGE, height: float = 2.9) -> Axes:
    """Return `ax`, or new axes of `width` by `height` (inches) where it is None; by default of page width."""
    if ax is not None:
        return ax
    return plt.subplots(figsize=(width, height), layout="constrained")[1]


@contextmanager
def panel(ax: Axes | None, *, width: float = PAGE, height: float = 2.9) -> Iterator[Axes]:
    """Draw with the style of this package into what `axes` returns, inside a ``with`` block."""
    with style():
        yield axes(ax, width=width, height=height)


def with_strip(ax: Axes, share: float = 0.3) -> tuple[Axes, Axes]:
    """Divide axes: their lower `share` becomes a strip with the same x axis.

    Returns
    -------
    (Axes, Axes)
        The upper axes, which are `ax`, and the strip.

    Raises
    ------
    InputError
        If `ax` belongs to no figure.
    """
    figure = ax.get_figure(root=False)
    spec = ax.get_subplotspec()
    if figure is None:
        raise InputError("these axes belong to no figure")
    if spec is not None:
        parts = spec.subgridspec(2, 1, height_ratios=(1.0 - share, share), hspace=0.08)
        ax.set_subplotspec(parts[0])
        return ax, figure.add_subplot(parts[1], sharex=ax)
    # Axes placed by hand keep their box: the strip takes its lower part.
    box = ax.get_position()
    ax.set_position((box.x0, box.y0 + share * box.height, box.width, (0.95 - share) * box.height))
    return ax, figure.add_axes((box.x0, box.y0, box.width, (share - 0.05) * box.height), sharex=ax)


def apart(wanted: FloatArray, heights: FloatArray, low: float, high: float = np.inf) -> FloatArray:
    """Return places (n,) for labels near those wanted, from the top down, so that no two overlap.

    `heights` are the labels' own heights (n,); they stay between `low` and `high` as far as there is room.
    """
    places, room = wanted.copy(), 0.5 * heights
    places[-1] = max(places[-1], low + room[-1])
    for n in range(len(places) - 2, -1, -1):
        places[n] = max(places[n], places[n + 1] + room[n] + room[n + 1])
    places[0] = min(places[0], high - room[0])
    for n in range(1, len(places)):
        places[n] = min(places[n], places[n - 1] - room[n] - room[n - 1])
    return places


def unit_for(values: FloatArray, kind: str) -> tuple[str, float]:
    """Return the unit that suits the largest of `values` (SI): printed name and SI value."""
    return unit_of(float(np.max(np.abs(values), initial=0.0)), kind)


def unit_of(value: float, kind: str) -> tuple[str, float]:
    """Return the unit that suits `value` (SI): printed name and SI value."""
    unit, factor = human_unit(value, kind)
    return printed_unit(unit), factor


def plain_ticks(axis: Axis, locator: Locator) -> None:
    """Set plain numbers at the places of a locator on a logarithmic axis, and none between them."""
    axis.set_major_locator(locator)
    axis.set_major_formatter(PLAIN)
    axis.set_minor_locator(NullLocator())


def with_unit(words: str, unit: str) -> str:
    """Return the words of an axis with its unit in brackets, where it has one."""
    return f"{words} ({unit})" if unit else words


def in_words(value: float, kind: str, uncertainty: float | None = None, *, digits: int = 4) -> str:
    """Return an SI value as `format_quantity` writes it, with the micro sign where it is needed."""
    return printed(format_quantity(value, kind, uncertainty, digits=digits))


def save(ax: Axes, path: str | os.PathLike[str]) -> Path:
    """Write the figure of `ax` to a PNG, SVG or PDF file, whole or not at all, and close it.

    Raises
    ------
    InputError
        If the ending of `path` is none of these.
    FileAccessError
        If the file cannot be written.
    """
    target = Path(path)
    format_ = target.suffix.lstrip(".").lower()
    if format_ not in _FORMATS:
        raise InputError(f"a picture is written as .png, .svg or .pdf; got {target.name!r}")
    return write_atomic(target, drawn(ax, format_))


def inline_svg(ax: Axes, name: str, alt: str) -> str:
    """Return the figure of `ax` as an SVG element for an HTML page, and close it; equal pictures give equal text.

    Parameters
    ----------
    ax : matplotlib Axes
        Axes of the figure.
    name : str
        Makes the ids of this picture differ from those of others on the page.
    alt : str
        Text for screen readers.
    """
    with mpl.rc_context({"svg.hashsalt": f"underlay {name}"}):
        text = _PREAMBLE.sub("", drawn(ax, "svg").decode("utf-8"))
    size = _SIZE.search(text)
    if size is None:
        raise ValueError("a picture without a size")
    head = (
        f'<svg role="img" aria-label="{html.escape(alt)}" viewBox="0 0 {size[1]} {size[2]}" '
        'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    return _GROUP.sub("<g", text[: size.start()] + head + text[size.end() :]).strip()


def drawn(ax: Axes, format_: str = "png", *, dpi: float | None = None) -> bytes:
    """Return the figure of `ax` as the bytes of a PNG, SVG or PDF file, and close it.

    Raises
    ------
    InputError
        If `ax` belongs to no figure.
    """
    figure = ax.get_figure(root=True)
    if figure is None:
        raise InputError("these axes belong to no figure")
    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format=format_, dpi=mpl.rcParams["savefig.dpi"] if dpi is None else dpi)
    plt.close(figure)
    return buffer.getvalue()
