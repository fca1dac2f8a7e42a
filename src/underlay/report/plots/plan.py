"""Which test would tell: the expected error over tip radius and depth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from underlay.report.labels import label
from underlay.report.plots.style import GREY, INK, SEQUENTIAL, axes, style, unit_for

if TYPE_CHECKING:
    from underlay.inference.design.planning import Plan

__all__ = ["plan"]

# Relative errors beyond these are as good, or as useless, as these.
_BEST, _WORST = 1e-3, 1.0


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
    radius_unit, radius = unit_for(tests.radii, "length")
    depth_unit, depth = unit_for(tests.depths, "length")
    relative = np.where(np.isinf(tests.stderr), _WORST, tests.stderr / abs(tests.value)).T
    with style():
        ax = axes(ax, height=2.8)
        ax.set_facecolor(GREY)
        ends = (np.nanmin(relative), np.nanmax(relative))
        norm = LogNorm(max(ends[0], _BEST), min(max(ends[1], 2.0 * max(ends[0], _BEST)), _WORST))
        mesh = ax.pcolormesh(
            tests.radii / radius,
            tests.depths / depth,
            relative,
            cmap=SEQUENTIAL,
            norm=norm,
            shading="nearest",
        )
        ax.set_xscale("log")
        ax.set_yscale("log")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_locator(NullLocator())
        if np.isfinite(tests.stderr).any():
            best = tests.best
            ax.plot(
                best[0] / radius,
                best[1] / depth,
                "*",
                ms=12,
                mfc="white",
                mec=INK,
                mew=0.8,
                label="recommended",
            )
            ax.legend(loc="lower right", frameon=True, framealpha=0.9, edgecolor="none")
        figure = ax.get_figure(root=False)
        if figure is not None:
            bar = figure.colorbar(mesh, ax=ax)
            bar.set_label(f"relative error of the {label(tests.parameter)}")
        ax.set_xlabel(f"tip radius ({radius_unit})")
        ax.set_ylabel(f"depth ({depth_unit})")
    return ax
