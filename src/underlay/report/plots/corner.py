"""A posterior parameter by parameter and pair by pair."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from scipy import ndimage

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.sampling.derived import kind_of_quantity
from underlay.report.labels import label
from underlay.report.plots.style import FIT, GREY, REFERENCE, YELLOW, axes, style, unit_of

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

__all__ = ["corner"]

_BINS = 32
# A cell is as wide as so many letters; a longer label would run into its neighbour.
_LETTERS = 15
_MASSES = (0.95, 0.68)
# Standard deviation, in bins, of the smoothing that makes contours of a finite number of draws.
_SMOOTHING = 1.0
# Ratio of the ends of a positive quantity above which its axis is in decades.
_DECADES = 20.0
_MARGIN = 0.003  # share of the draws left out of the picture on either side


def corner(posterior: Posterior, *, names: Sequence[str] | None = None, ax: Axes | None = None) -> Axes:
    """Draw the marginal distributions of a posterior and the 68 % and 95 % regions of every pair.

    Parameters
    ----------
    posterior : Posterior
        What `sample` returned.
    names : sequence of str, optional
        Parameters or derived quantities with as many draws; all parameters by default.
    ax : matplotlib Axes, optional
        A place in a grid of axes; it is divided and itself left empty.

    Returns
    -------
    matplotlib Axes
        The divided axes. Priors are orange, true values (of made data) dashed; a quantity that spans more than a
        factor of 20 has an axis in decades, where its bins are too.

    Raises
    ------
    InputError
        If `ax` was placed by hand and cannot be divided, or there is nothing of a name.
    """
    chosen = list(posterior.names if names is None else names)
    columns = [_Column(posterior, name) for name in chosen]
    count = len(columns)
    with style():
        side = max(2.4, 1.15 * count + 0.6)
        ax = axes(ax, width=side, height=side)
        figure, spec = ax.get_figure(root=False), ax.get_subplotspec()
        if figure is None or spec is None:
            raise InputError("corner divides its axes: pass one made by plt.subplots, or none")
        ax.set_axis_off()
        grid = spec.subgridspec(count, count, hspace=0.06, wspace=0.06)
        for i in range(count):
            for j in range(i + 1):
                cell = figure.add_subplot(grid[i, j])
                if i == j:
                    columns[i].draw(cell)
                else:
                    _pair(cell, columns[j], columns[i])
                _ticks(cell, columns[j], columns[i], i=i, j=j, last=count - 1)
    return ax


class _Column:
    """Draws of one quantity in the unit people use."""

    def __init__(self, posterior: Posterior, name: str) -> None:
        values = posterior.of(name).ravel()
        unit, self.factor = unit_of(float(np.median(values)), kind_of_quantity(name))
        words = textwrap.fill(label(name), _LETTERS)
        self.label = f"{words}\n({unit})" if unit else words
        self.draws = values / self.factor
        self.prior: FloatArray | None = None
        if name in posterior.names:
            self.prior = posterior.prior_quantiles[:, posterior.names.index(name)] / self.factor
        true = posterior.truth.get(name)
        self.truth = None if true is None else true / self.factor
        low, high = np.quantile(self.draws, (_MARGIN, 1.0 - _MARGIN))
        # A quantity known to its order of magnitude at best is one spike on an even axis.
        self.scale = "log" if low > 0.0 and high / low > _DECADES else "linear"
        if self.scale == "log":
            room = (high / low) ** 0.05
            self.window = (float(low / room), float(high * room))
            self.edges = np.geomspace(*self.window, _BINS + 1)
        else:
            room = 0.05 * (high - low)
            self.window = (float(low - room), float(high + room))
            self.edges = np.linspace(*self.window, _BINS + 1)

    def draw(self, cell: Axes) -> None:
        """Histogram, prior, median and truth."""
        shares = np.histogram(self.draws, self.edges)[0] / len(self.draws)
        cell.stairs(shares, self.edges, fill=True, color=FIT, alpha=0.8)
        if self.prior is not None:
            # Each quantile stands for an equal share of the prior, most of which may lie outside the picture.
            below = np.interp(self.edges, self.prior, (np.arange(len(self.prior)) + 0.5) / len(self.prior))
            cell.stairs(np.diff(below), self.edges, color=YELLOW, lw=1.2, baseline=None)
        cell.axvline(float(np.median(self.draws)), color="white", lw=0.8)
        if self.truth is not None:
            cell.axvline(self.truth, color=REFERENCE, ls="--", lw=1.0)
        cell.set_ylim(0.0, 1.1 * float(np.max(shares)))


def _pair(cell: Axes, across: _Column, up: _Column) -> None:
    counts, x, y = np.histogram2d(across.draws, up.draws, bins=(across.edges, up.edges))
    smooth = ndimage.gaussian_filter(counts.T, _SMOOTHING)
    ordered = np.sort(smooth, axis=None)[::-1]
    mass = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(mass, share)]) for share in _MASSES]
    middle = (0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    if levels[0] < levels[1] < ordered[0]:
        cell.contourf(*middle, smooth, levels=[*levels, float(ordered[0])], colors=["#a6cde4", FIT])
    else:
        cell.plot(across.draws, up.draws, ",", color=FIT)
    for value, line in ((across.truth, cell.axvline), (up.truth, cell.axhline)):
        if value is not None:
            line(value, color=REFERENCE, ls="--", lw=0.9)


def _ticks(cell: Axes, across: _Column, up: _Column, *, i: int, j: int, last: int) -> None:
    _scaled(cell.xaxis, cell.set_xscale, across)
    cell.set_xlim(across.window)
    if i == j:
        cell.set_yticks([])
        cell.spines["left"].set_visible(False)
    else:
        _scaled(cell.yaxis, cell.set_yscale, up)
        cell.set_ylim(up.window)
        cell.grid(color=GREY, lw=0.3, alpha=0.5)
    if i == last:
        cell.set_xlabel(across.label)
        cell.tick_params(axis="x", rotation=45)
    else:
        cell.tick_params(labelbottom=False)
    if j == 0 and i > 0:
        cell.set_ylabel(up.label)
    else:
        cell.tick_params(labelleft=False)


def _scaled(axis: Axis, set_scale: Callable[[str], None], column: _Column) -> None:
    """A few plain numbers along an axis, even or in decades."""
    if column.scale == "linear":
        axis.set_major_locator(MaxNLocator(3, prune="both"))
        return
    set_scale("log")
    axis.set_major_locator(LogLocator(numticks=4))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
