"""The picture of a film: its modulus depth by depth, with the base in the model and without."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.report.plots.style import FIT, REFERENCE, axes, style, unit_for

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit

__all__ = ["film"]

# Standard deviations to the ends of 95 %.
_WIDTH = 1.96


def film(found: StiffnessFit, *, ax: Axes | None = None) -> Axes:
    """Draw what the contact stiffness says of a film at each depth.

    Parameters
    ----------
    found : StiffnessFit
        What `fit_stiffness` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    table = found.table
    depth, bare = table["depth"].to_numpy(), table["half-space modulus"].to_numpy()
    length, metre = unit_for(depth, "length")
    name, pascal = unit_for(bare, "pressure")
    with style():
        panel = axes(ax)
        panel.plot(
            depth / metre, bare / pascal, ".-", ms=3.0, lw=0.9, color=REFERENCE, label="half-space formula"
        )
        if "layer modulus" in table:
            layer = table["layer modulus"].to_numpy()
            noise = table["layer modulus noise"].to_numpy() / layer
            if np.isfinite(noise).all():
                low, high = (layer * np.exp(sign * _WIDTH * noise) / pascal for sign in (-1.0, 1.0))
                panel.fill_between(
                    depth / metre, low, high, color=FIT, alpha=0.2, lw=0.0, label="noise, 95 %"
                )
            panel.plot(
                depth / metre,
                layer / pascal,
                ".-",
                ms=3.0,
                lw=0.9,
                color=FIT,
                label="film, base in the model",
            )
            panel.axhline(found.values["layer.E"] / pascal, ls="--", lw=1.0, color=FIT, label="fit")
        panel.set_ylim(0.0)
        panel.set_xlabel(f"depth ({length})")
        panel.set_ylabel(f"modulus ({name})")
        panel.legend(loc="best")
    return panel
