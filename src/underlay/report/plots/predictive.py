"""The posterior predictive band over the data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.report.plots.style import DATA, FIT, SKY, axes, style, unit_for, with_strip

if TYPE_CHECKING:
    from underlay.inference.sampling.posterior import Posterior

__all__ = ["predictive"]


def predictive(posterior: Posterior, *, curve: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the data, the median of the model and the 95 % bands; below, everything less the median.

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
    length, mm = unit_for(depth, "length")
    load, mN = unit_for(force, "force")
    small, uN = unit_for(force - model[middle], "force")
    with style():
        upper, lower = with_strip(axes(ax, height=3.4), share=0.4)
        for target, unit, base in ((upper, mN, np.zeros_like(force)), (lower, uN, model[middle])):
            target.fill_between(
                depth / mm, (reading[0] - base) / unit, (reading[-1] - base) / unit,
                color=SKY, alpha=0.35, lw=0.0, label="95 % of new readings",
            )  # fmt: skip
            target.plot(depth / mm, (force - base) / unit, ".", ms=1.8, color=DATA, label="measured")
            target.fill_between(
                depth / mm, (model[0] - base) / unit, (model[-1] - base) / unit,
                color=FIT, lw=0.8, label="95 % of the model",
            )  # fmt: skip
        upper.tick_params(labelbottom=False)
        upper.set_ylabel(f"force ({load})")
        upper.legend(loc="upper left")
        if len(posterior.predictive) > 1:
            upper.set_title(f"curve {curve + 1}")
        lower.set_xlabel(f"depth ({length})")
        lower.set_ylabel(f"less the median ({small})")
    return upper
