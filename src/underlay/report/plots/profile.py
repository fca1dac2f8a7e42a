"""A profile likelihood: how the fit worsens as one parameter is moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.report.plots.style import DATA, FIT, REFERENCE, SKY, axes, style
from underlay.report.words import label
from underlay.scene.parameters import kind_of
from underlay.units import human_unit

if TYPE_CHECKING:
    from underlay.inference.profiles import Profile

__all__ = ["profile"]

_LEVELS = ((0.68, ":"), (0.95, "--"))


def profile(walk: Profile, *, ax: Axes | None = None) -> Axes:
    """Draw a profile likelihood with its 68 % and 95 % intervals.

    Parameters
    ----------
    walk : Profile
        What `underlay.profile` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    value, error = walk.fit.values[walk.name], walk.fit.stderr[walk.name]
    unit, factor = human_unit(value, kind_of(walk.name.partition("[")[0]))
    top = 1.25 * max(walk.threshold(0.95), float(walk.rise.min()))
    with style():
        ax = axes(ax, height=2.3)
        found = walk.interval(0.95)
        low = found.low if found.low_reason == "data" else float(walk.values[0])
        high = found.high if found.high_reason == "data" else float(walk.values[-1])
        ax.axvspan(low / factor, high / factor, color=SKY, alpha=0.25, lw=0.0)
        ax.plot(walk.values / factor, walk.rise, "o-", ms=2.5, color=FIT, label="profile")
        if np.isfinite(error) and error > 0.0:
            x = np.linspace(walk.values[0], walk.values[-1], 200)
            parabola = np.square((x - value) / error)
            ax.plot(x / factor, parabola, "-", lw=0.9, color=REFERENCE, label="standard error")
        for level, line in _LEVELS:
            ax.axhline(walk.threshold(level), ls=line, lw=0.8, color=DATA)
            ax.text(1.0, walk.threshold(level), f"{100 * level:.0f} %", transform=ax.get_yaxis_transform(),
                    ha="left", va="center", size=7.0, color=DATA)  # fmt: skip
        ax.set_ylim(0.0, top)
        ax.set_xlabel(f"{label(walk.name)} ({unit})" if unit else label(walk.name))
        ax.set_ylabel("rise of chi-square")
        ax.legend(loc="upper center")
    return ax
