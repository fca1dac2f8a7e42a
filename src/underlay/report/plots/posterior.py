"""Pictures of a posterior, and of a profile likelihood.

A posterior is shown parameter by parameter and pair by pair (`corner`), and as the predictive band over the data
(`predictive`); a profile as the rise of chi-square while one parameter is varied (`profile`).
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, MaxNLocator
from scipy import ndimage

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.sampling.derived import kind_of_quantity
from underlay.report.labels import label
from underlay.report.plots import style
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.profiling.profile_result import LikelihoodProfile
    from underlay.inference.sampling.posterior import Posterior

_BINS = 32
# A cell is as wide as so many letters; a longer label would run into its neighbour.
_LETTERS = 15
_MASSES = (0.95, 0.68)
# Standard deviation, in bins, of the smoothing that makes contours of a finite number of draws.
_SMOOTHING = 1.0
# Ratio of the ends of a positive quantity above which its axis is in decades.
_DECADES = 20.0
_MARGIN = 0.003  # share of the draws left out of the picture on either side
_LEVELS = ((0.68, ":"), (0.95, "--"))


def corner(posterior: Posterior, *, names: Sequence[str] | None = None, ax: Axes | None = None) -> Axes:
    """Draw the marginal distributions of a posterior and the 68 % and 95 % regions of every pair.

    Parameters
    ----------
    posterior : Posterior
        What `sample` returned.
    names : sequence of str, optional
        Parameters or derived quantities with as many draws; all parameters by default.
    ax : matplotlib Axes, optional
        Axes made by ``plt.subplots``; they are divided into a grid and left empty themselves.

    Returns
    -------
    matplotlib Axes
        The divided axes. Priors are orange, true values (of synthetic data) dashed; a quantity that spans more than
        a factor of 20 has a logarithmic axis and bins.

    Raises
    ------
    InputError
        If `ax` was placed by hand and cannot be divided, or a name is unknown.
    """
    chosen = list(posterior.names if names is None else names)
    columns = [_Column(posterior, name) for name in chosen]
    count = len(columns)
    with style.style():
        side = max(2.4, 1.15 * count + 0.6)
        ax = style.axes(ax, width=side, height=side)
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
    """The draws of one quantity in a unit for people, with its prior, true value, bins and axis limits."""

    def __init__(self, posterior: Posterior, name: str) -> None:
        values = posterior.of(name).ravel()
        unit, self.factor = style.unit_of(float(np.median(values)), kind_of_quantity(name))
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
        ends = np.log([low, high]) if self.scale == "log" else np.array([low, high])
        room = 0.05 * np.ptp(ends)
        even = np.linspace(ends[0] - room, ends[1] + room, _BINS + 1)
        self.edges = np.exp(even) if self.scale == "log" else even
        self.window = (float(self.edges[0]), float(self.edges[-1]))

    def draw(self, cell: Axes) -> None:
        """Draw the histogram, with prior, median and true value."""
        shares = np.histogram(self.draws, self.edges)[0] / len(self.draws)
        cell.stairs(shares, self.edges, fill=True, color=style.FIT, alpha=0.8)
        if self.prior is not None:
            # Each quantile stands for an equal share of the prior, most of which may lie outside the picture.
            below = np.interp(self.edges, self.prior, (np.arange(len(self.prior)) + 0.5) / len(self.prior))
            cell.stairs(np.diff(below), self.edges, color=style.YELLOW, lw=1.2, baseline=None)
        cell.axvline(float(np.median(self.draws)), color="white", lw=0.8)
        if self.truth is not None:
            cell.axvline(self.truth, color=style.REFERENCE, ls="--", lw=1.0)
        cell.set_ylim(0.0, 1.1 * float(np.max(shares)))


def _pair(cell: Axes, across: _Column, up: _Column) -> None:
    counts, x, y = np.histogram2d(across.draws, up.draws, bins=(across.edges, up.edges))
    smooth = ndimage.gaussian_filter(counts.T, _SMOOTHING)
    ordered = np.sort(smooth, axis=None)[::-1]
    mass = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(mass, share)]) for share in _MASSES]
    middle = (0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    if levels[0] < levels[1] < ordered[0]:
        cell.contourf(*middle, smooth, levels=[*levels, float(ordered[0])], colors=["#a6cde4", style.FIT])
    else:
        cell.plot(across.draws, up.draws, ",", color=style.FIT)
    for value, line in ((across.truth, cell.axvline), (up.truth, cell.axhline)):
        if value is not None:
            line(value, color=style.REFERENCE, ls="--", lw=0.9)


def _ticks(cell: Axes, across: _Column, up: _Column, *, i: int, j: int, last: int) -> None:
    _scaled(cell.xaxis, cell.set_xscale, across)
    cell.set_xlim(across.window)
    if i == j:
        cell.set_yticks([])
        cell.spines["left"].set_visible(False)
    else:
        _scaled(cell.yaxis, cell.set_yscale, up)
        cell.set_ylim(up.window)
        cell.grid(color=style.GREY, lw=0.3, alpha=0.5)
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
    """Set a few plain tick labels on a linear or logarithmic axis."""
    if column.scale == "linear":
        axis.set_major_locator(MaxNLocator(3, prune="both"))
        return
    set_scale("log")
    style.plain_ticks(axis, LogLocator(numticks=4))


def predictive(posterior: Posterior, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the data, the median of the model and the 95 % bands; in the strip below, all less the median.

    Parameters
    ----------
    posterior : Posterior
        What `sample` returned.
    curve : int, default 0
        Which curve of a joint problem.
    ax : matplotlib Axes, optional
        Where to draw; its lower part becomes the strip.

    Returns
    -------
    matplotlib Axes
        The upper axes.
    """
    band = posterior.predictive[curve]
    order = np.argsort(band.depth, kind="stable")
    depth, force = band.depth[order], band.force[order]
    model, reading = band.model[:, order], band.reading[:, order]
    middle = len(model) // 2
    length, mm = style.unit_for(depth, "length")
    load, mN = style.unit_for(force, "force")
    small, uN = style.unit_for(force - model[middle], "force")
    with style.style():
        upper, lower = style.with_strip(style.axes(ax, height=3.4), share=0.4)
        for target, unit, base in ((upper, mN, np.zeros_like(force)), (lower, uN, model[middle])):
            target.fill_between(
                depth / mm, (reading[0] - base) / unit, (reading[-1] - base) / unit,
                color=style.SKY, alpha=0.35, lw=0.0, label="95 % of new readings",
            )  # fmt: skip
            target.plot(depth / mm, (force - base) / unit, ".", ms=1.8, color=style.DATA, label="measured")
            target.fill_between(
                depth / mm, (model[0] - base) / unit, (model[-1] - base) / unit,
                color=style.FIT, lw=0.8, label="95 % of the model",
            )  # fmt: skip
        upper.tick_params(labelbottom=False)
        upper.set_ylabel(f"force ({load})")
        upper.legend(loc="upper left")
        if len(posterior.predictive) > 1:
            upper.set_title(f"curve {curve + 1}")
        lower.set(xlabel=f"depth ({length})", ylabel=f"less the median ({small})")
    return upper


def profile(walk: LikelihoodProfile, *, ax: Axes | None = None) -> Axes:
    """Draw a profile likelihood with its 68 % and 95 % intervals.

    Profiles through further optima of the fit are drawn as well, as far as they lie within the picture, and the 95
    % region may be shaded in several parts.

    Parameters
    ----------
    walk : LikelihoodProfile
        What `underlay.profile` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    value, error = walk.fit.values[walk.name], walk.fit.stderr[walk.name]
    unit, factor = style.unit_of(value, kind_of(walk.name))
    top = 1.25 * max(walk.threshold(0.95), float(walk.delta_chi_square.min()))
    parts = [walk, *(branch for branch in walk.branches if branch.delta_chi_square.min() < top)]
    with style.panel(ax, height=2.3) as drawn:
        drawn.plot(
            walk.values / factor, walk.delta_chi_square, "o-", ms=2.5, color=style.FIT, label="profile"
        )
        for number, branch in enumerate(parts[1:]):
            drawn.plot(branch.values / factor, branch.delta_chi_square, "s--", ms=2.5, lw=1.0, color=style.ACCENT,
                    label="" if number else "about another optimum")  # fmt: skip
        if np.isfinite(error) and error > 0.0:
            # By its own width: it may be a hundredth of the profile's, or stand beside it.
            z = np.sqrt(top) * np.linspace(-1.0, 1.0, 201)
            how: Any = {"lw": 0.9, "color": style.REFERENCE, "label": "standard error"}
            drawn.plot((value + z * error) / factor, z * z, "-", **how)
        drawn.set_ylim(0.0, top)
        ends = np.array([value, *(end for part in parts for end in _reach(part, top))]) / factor
        room = 0.05 * np.ptp(ends)
        drawn.set_xlim(ends.min() - room, ends.max() + room)
        _shade(drawn, walk, factor)
        for level, line in _LEVELS:
            _draw_threshold(drawn, walk, level, line, factor)
        drawn.set(
            xlabel=style.with_unit(label(walk.name), unit),
            ylabel="(deviate of the level)²" if walk.averaged else "rise of chi-square",
        )
        drawn.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    return drawn


def _shade(ax: Axes, walk: LikelihoodProfile, factor: float) -> None:
    """Shade every part of the 95 % interval; an open end reaches to the bound or the edge of the picture.

    `factor` is the unit of the axis in SI.
    """
    parts, whole, edges = walk.parts(0.95), walk.interval(0.95), ax.get_xlim()
    ends = np.array(parts)
    ends[0, 0], ends[-1, 1] = min(ends[0, 0], whole.low), max(ends[-1, 1], whole.high)
    for low, high in np.clip(ends / factor, *edges):
        ax.axvspan(low, high, color=style.SKY, alpha=0.25, lw=0.0)


def _draw_threshold(ax: Axes, walk: LikelihoodProfile, level: float, line: str, factor: float) -> None:
    """Draw the rise of chi-square that ends the interval of a level; a calibrated one differs between the ends.

    `factor` is the unit of the axis in SI, `line` the line style.
    """
    low, high = ax.get_xlim()
    x = np.linspace(low, high, 201)
    q = np.array([_profile_scaled(walk, value * factor) for value in x])
    middle = float(walk.fit.vector[walk.index])
    below, above = (np.square(walk.limit(level, upper=upper)(q)) for upper in (False, True))
    rise = np.where(q < middle, below, above)
    ax.plot(x, rise, ls=line, lw=0.8, color=style.DATA)
    ax.text(1.005, rise[-1], f"{100 * level:.0f} %", transform=ax.get_yaxis_transform(),
            ha="left", va="center", size=7.0, color=style.DATA)  # fmt: skip


def _profile_scaled(walk: LikelihoodProfile, value: float) -> float:
    """Return the scaled parameter for a physical value.

    On a logarithmic scale a value below those of the profile, such as a negative one, gives that of the lowest.
    """
    coordinate = walk.fit.problem.coordinates[walk.index]
    return coordinate.scaled(max(value, float(walk.values[0])) if coordinate.scale is None else value)


def _reach(part: LikelihoodProfile, top: float) -> tuple[float, float]:
    """Return the values (SI) at which the line of a profile leaves the picture at the height `top`, or ends."""
    inside = np.flatnonzero(part.delta_chi_square < top)
    return (
        _leaving(part.values[: inside[0] + 1][::-1], part.delta_chi_square[: inside[0] + 1][::-1], top),
        _leaving(part.values[inside[-1] :], part.delta_chi_square[inside[-1] :], top),
    )


def _leaving(values: FloatArray, rise: FloatArray, top: float) -> float:
    """Return the value at which the line through the first two points, going outwards, meets `top`."""
    if len(values) == 1:
        return float(values[0])
    return float(np.interp(top, rise[:2], values[:2]))
