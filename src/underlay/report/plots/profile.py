"""A profile likelihood: how the fit worsens as one parameter is moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.report.labels import label
from underlay.report.plots.style import ACCENT, DATA, FIT, REFERENCE, SKY, axes, style, unit_of
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.profiles import LikelihoodProfile

__all__ = ["profile"]

_LEVELS = ((0.68, ":"), (0.95, "--"))


def profile(walk: LikelihoodProfile, *, ax: Axes | None = None) -> Axes:
    """Draw a profile likelihood with its 68 % and 95 % intervals.

    Where the fit has other optima, so has the profile: each is drawn as far as it stands in the picture, and
    what 95 % do not reject may be shaded in several parts.

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
    unit, factor = unit_of(value, kind_of(walk.name))
    top = 1.25 * max(walk.threshold(0.95), float(walk.delta_chi_square.min()))
    parts = [walk, *(branch for branch in walk.branches if branch.delta_chi_square.min() < top)]
    with style():
        ax = axes(ax, height=2.3)
        ax.plot(walk.values / factor, walk.delta_chi_square, "o-", ms=2.5, color=FIT, label="profile")
        for number, branch in enumerate(parts[1:]):
            ax.plot(branch.values / factor, branch.delta_chi_square, "s--", ms=2.5, lw=1.0, color=ACCENT,
                    label="" if number else "about another optimum")  # fmt: skip
        if np.isfinite(error) and error > 0.0:
            # By its own width: it may be a hundredth of the profile's, or stand beside it.
            z = np.sqrt(top) * np.linspace(-1.0, 1.0, 201)
            ax.plot((value + z * error) / factor, z * z, "-", lw=0.9, color=REFERENCE, label="standard error")
        ax.set_ylim(0.0, top)
        ends = np.array([value, *(end for part in parts for end in _reach(part, top))]) / factor
        room = 0.05 * np.ptp(ends)
        ax.set_xlim(ends.min() - room, ends.max() + room)
        _shade(ax, walk, factor)
        for level, line in _LEVELS:
            _draw_threshold(ax, walk, level, line, factor)
        ax.set_xlabel(f"{label(walk.name)} ({unit})" if unit else label(walk.name))
        ax.set_ylabel("(deviate of the level)²" if walk.averaged else "rise of chi-square")
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    return ax


def _shade(ax: Axes, walk: LikelihoodProfile, factor: float) -> None:
    """Shade every part of the 95 % interval; where the data set no end, up to the bound or out of the picture."""
    parts, whole, edges = walk.parts(0.95), walk.interval(0.95), ax.get_xlim()
    ends = np.array(parts)
    ends[0, 0], ends[-1, 1] = min(ends[0, 0], whole.low), max(ends[-1, 1], whole.high)
    for low, high in np.clip(ends / factor, *edges):
        ax.axvspan(low, high, color=SKY, alpha=0.25, lw=0.0)


def _draw_threshold(ax: Axes, walk: LikelihoodProfile, level: float, line: str, factor: float) -> None:
    """Draw the rise that ends the interval; from drawn curves it is another one at each end, and in between."""
    low, high = ax.get_xlim()
    x = np.linspace(low, high, 201)
    q = np.array([_scaled(walk, value * factor) for value in x])
    middle = float(walk.fit.vector[walk.index])
    below, above = (np.square(walk.limit(level, upper=upper)(q)) for upper in (False, True))
    rise = np.where(q < middle, below, above)
    ax.plot(x, rise, ls=line, lw=0.8, color=DATA)
    ax.text(1.005, rise[-1], f"{100 * level:.0f} %", transform=ax.get_yaxis_transform(),
            ha="left", va="center", size=7.0, color=DATA)  # fmt: skip


def _scaled(walk: LikelihoodProfile, value: float) -> float:
    """Scaled value of the parameter; that of the lowest walked where the picture goes below what can be."""
    coordinate = walk.fit.problem.coordinates[walk.index]
    return coordinate.scaled(max(value, float(walk.values[0])) if coordinate.scale is None else value)


def _reach(part: LikelihoodProfile, top: float) -> tuple[float, float]:
    """Where the line of a profile leaves the picture (SI), or ends."""
    inside = np.flatnonzero(part.delta_chi_square < top)
    return (
        _leaving(part.values[: inside[0] + 1][::-1], part.delta_chi_square[: inside[0] + 1][::-1], top),
        _leaving(part.values[inside[-1] :], part.delta_chi_square[inside[-1] :], top),
    )


def _leaving(values: FloatArray, rise: FloatArray, top: float) -> float:
    """Value at which the line through the first two points, walking outwards, meets `top`."""
    if len(values) == 1:
        return float(values[0])
    return float(np.interp(top, rise[:2], values[:2]))
